//! The equations of motion of the two-track car: one unit on two axles, in the air.

use super::output::{self, CarFlow, CarOutput, SIGNALS};
use super::plant::{CarPlant, STATES, WHEELS};
use crate::numerics::lanes::{FOUR, Lanes};
use crate::path::Path;
use crate::vehicle::air;
use crate::vehicle::drive::DriveLine;
use crate::vehicle::effects::Effects;
use crate::vehicle::sensors::{BODY_SIGNALS, body_signals};
use crate::vehicle::steering::SteeringChain;
use crate::vehicle::stepper::{Plant, PlantStepError, StageInputs, State, check_upright};
use crate::vehicle::surface::Surface;
use crate::vehicle::trigonometry::{cos_of, sin_of};
use crate::vehicle::tyre::TyreModel;
use crate::vehicle::unit::{
    BODY, Gravity, PER_WHEEL, PITCH, ROLL, SPIN, UnitConstants, VX, VY, X, Y, YAW, YAW_RATE, gravity,
    gravity_on, roll,
};

/// Forces and disturbances from road and earth.
#[derive(Debug, Clone, Copy)]
pub(super) struct CarEnvironment {
    pub gravity: Gravity,
    /// Friction factors under the axles.
    pub friction: [f64; 2],
}

impl<T: TyreModel> Plant<STATES, SIGNALS> for CarPlant<T> {
    type Environment = CarEnvironment;
    type Flow = CarFlow;
    type Output = CarOutput;

    fn steering(&self) -> &SteeringChain {
        &self.steering
    }

    fn drive(&self) -> &DriveLine {
        &self.drive
    }

    fn effects(&self) -> &Effects {
        &self.effects
    }

    fn placed(&self, x: f64, y: f64, yaw: f64, vx: f64) -> [f64; STATES] {
        let mut states = [0.0; STATES];
        let (sin, cos) = yaw.sin_cos();
        states[X] = x - self.unit.reference_x * cos;
        states[Y] = y - self.unit.reference_x * sin;
        states[YAW] = yaw;
        states[VX] = vx;
        for wheel in 0..4 {
            states[WHEELS + wheel * PER_WHEEL + SPIN] = vx / self.unit.axles[wheel / 2].radius;
        }
        states
    }

    /// Gravity and friction at the place of the car.
    fn environment(&self, y: &[f64; STATES], road: Option<&Path>, station: f64) -> CarEnvironment {
        let gravity = gravity(&self.effects, y[YAW], road, station);
        let friction =
            [0, 1].map(|axle| road.map_or(1.0, |road| road.friction(station + self.unit.axles[axle].x)));
        CarEnvironment { gravity, friction: friction.map(|friction| friction * self.effects.road_friction) }
    }

    fn on(&self, surface: Surface) -> CarEnvironment {
        let friction = surface.friction * self.effects.road_friction;
        CarEnvironment { gravity: gravity_on(&self.effects, surface), friction: [friction; 2] }
    }

    #[inline(always)]
    fn derivative_by<L: Lanes<Stored = [f64; FOUR]>>(
        &self,
        y: &[f64; STATES],
        stage: &StageInputs,
        environment: &CarEnvironment,
        rates: &mut [f64; STATES],
        flow: &mut CarFlow,
    ) {
        let Self { unit, effects, .. } = self;
        let (body, wheels): (&[f64; BODY], &[f64]) = split(y);
        let (body_rates, wheel_rates) = rates.split_at_mut(BODY);
        let forces = self.drive.forces(stage.accel, unit.rim_speed(wheels));
        flow.drive_force = forces.0 - forces.1;

        let [front, rear] = &unit.axles;
        let steer = [front.wheel_angle(body[ROLL], stage.steer), rear.wheel_angle(body[ROLL], stage.steer)];
        let angles = L::load(&[steer[0], steer[1], y[YAW], 0.0]);
        let [sin_front, sin_rear, sin_yaw, _] = sin_of(angles).store();
        let [cos_front, cos_rear, cos_yaw, _] = cos_of(angles).store();
        let steer = [(sin_front, cos_front), (sin_rear, cos_rear)];
        let front = front.suspension(body, &wheels[..2 * PER_WHEEL], steer[0], forces);
        let rear = rear.suspension(body, &wheels[2 * PER_WHEEL..], steer[1], forces);
        let mut axles = [front.0, rear.0];
        let motions = [front.1[0], front.1[1], rear.1[0], rear.1[1]];
        let friction = environment.friction;
        let friction = [friction[0], friction[0], friction[1], friction[1]];
        flow.wheels = roll::<L, T, 4>(&self.wheels, wheels, &motions, friction, wheel_rates);
        for (index, given) in axles.iter_mut().enumerate() {
            unit.axles[index].gather(&flow.wheels[2 * index..2 * index + 2], steer[index], given);
        }

        let (drag, side) =
            air::forces(effects, (self.drag, self.side), (body[VX], body[VY]), (sin_yaw, cos_yaw));
        let gravity = &environment.gravity;
        let mut push = unit.push(body, &axles, gravity);
        push.longitudinal += drag;
        push.lateral += side;
        push.yawing = push.yawing + side * self.pressure_centre + air::brake_pull(effects, body[VX]);
        let accel = unit.acceleration(&push);
        UnitConstants::<T, 2>::plane(body, &accel, gravity, (sin_yaw, cos_yaw), body_rates);
        unit.vertical(body, &axles, &accel, gravity, (wheels, &flow.wheels), (body_rates, wheel_rates));
        // What an accelerometer at the CG feels: the body's sway over the wheels belongs to it.
        flow.specific = [accel.specific_x, push.lateral / unit.mass, gravity.z];
    }

    fn check(&self, y: &[f64; STATES], time: f64) -> Result<(), PlantStepError> {
        check_upright(y[ROLL], y[PITCH], time)
    }

    fn body_signals(&self, y: &[f64; STATES], rates: &[f64; STATES], flow: &CarFlow) -> [f64; BODY_SIGNALS] {
        body_signals(&self.effects, split(y).0, self.unit.reference_x, flow.specific, rates[YAW_RATE])
    }

    fn signals(&self, y: &[f64; STATES], rates: &[f64; STATES], flow: &mut CarFlow) -> [f64; SIGNALS] {
        for (wheel, output) in flow.outputs.iter_mut().enumerate() {
            *output = flow.wheels[wheel].output(y[WHEELS + wheel * PER_WHEEL + SPIN]);
        }
        self.body_signals(y, rates, flow)
    }

    fn measure(&self, state: &State<STATES, SIGNALS>, flow: &CarFlow, delayed: &[f64; SIGNALS]) -> CarOutput {
        output::measure(self, state, flow, delayed)
    }
}

/// Body and wheels.
fn split(y: &[f64; STATES]) -> (&[f64; BODY], &[f64]) {
    y.split_first_chunk().expect("there are more states than a body's")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Random;
    use crate::numerics::lanes::{compute, compute_portably};
    use crate::vehicle::builtin;
    use crate::vehicle::stepper::Evaluation;

    #[test]
    fn every_processor_gives_the_same_bits() {
        let effects = Effects { wind_y: 3.0, road_bank: 0.02, tyre_relaxation: 0.0, ..Effects::default() };
        for name in crate::vehicle::BUILTIN {
            let plant = {
                let car = builtin(name).unwrap();
                CarPlant::new(&car, car.tyres(), &effects).unwrap()
            };
            let mut random = Random::new(7);
            for _ in 0..300 {
                let mut draw = |greatest: f64| greatest * (2.0 * random.uniform() - 1.0);
                let mut y = plant.placed(draw(100.0), draw(100.0), draw(4.0), draw(30.0));
                for state in &mut y[VY..] {
                    *state += draw(0.05) * (1.0 + state.abs());
                }
                let (stage, environment) =
                    (StageInputs { steer: draw(0.5), accel: draw(8.0) }, plant.environment(&y, None, 0.0));
                let evaluate = |portably: bool| {
                    let (mut rates, mut flow) = ([0.0; STATES], CarFlow::default());
                    let evaluation = Evaluation {
                        plant: &plant,
                        y: &y,
                        stage: &stage,
                        environment: &environment,
                        rates: &mut rates,
                        flow: &mut flow,
                    };
                    if portably {
                        compute_portably(evaluation)
                    } else {
                        compute(evaluation)
                    }
                    (rates.map(f64::to_bits), flow.specific.map(f64::to_bits))
                };
                assert_eq!(evaluate(false), evaluate(true), "{name}");
            }
        }
    }
}
