//! The equations of motion of tractor and semi-trailer: two units, the hitch between them, the air around them.

use super::hitch::to_trailer;
use super::output::{self, SIGNALS, TruckFlow, TruckOutput};
use super::plant::{STATES, TRAILER, TRAILER_STATES, TruckPlant, WHEELS, WIND_UP};
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
    BODY, Gravity, HEAVE, HEAVE_RATE, PER_WHEEL, PITCH, PITCH_RATE, ROLL, ROLL_RATE, SPIN, UnitConstants, VX,
    VY, X, Y, YAW, YAW_RATE, gravity, gravity_on, roll,
};

/// Place of a state of the semi-trailer's body among the truck's states.
const TRAILER_BODY: [(usize, usize); TRAILER_STATES] = [
    (YAW, TRAILER),
    (YAW_RATE, TRAILER + 1),
    (ROLL, TRAILER + 2),
    (ROLL_RATE, TRAILER + 3),
    (PITCH, TRAILER + 4),
    (PITCH_RATE, TRAILER + 5),
    (HEAVE, TRAILER + 6),
    (HEAVE_RATE, TRAILER + 7),
];
/// The first state of the semi-trailer's wheels among those of all wheels.
const TRAILER_WHEELS: usize = 4 * PER_WHEEL;

/// Forces and disturbances from road and earth.
#[derive(Debug, Clone, Copy)]
pub(super) struct TruckEnvironment {
    /// Under the tractor and under the semi-trailer, in axes of each.
    pub gravity: [Gravity; 2],
    /// Friction factors under the axle groups.
    pub friction: [f64; 3],
}

impl<T: TyreModel> TruckPlant<T> {
    /// The semi-trailer's body, its place left out, from all states and the sine and cosine of the articulation.
    pub(super) fn trailer_body(&self, y: &[f64; STATES], turn: (f64, f64)) -> [f64; BODY] {
        let mut body = [0.0; BODY];
        for (of_body, of_truck) in TRAILER_BODY {
            body[of_body] = y[of_truck];
        }
        let [vx, vy] = self.hitch.trailer_velocity(split(y).0, &body, turn);
        (body[VX], body[VY]) = (vx, vy);
        body
    }

    /// rad
    pub(super) fn articulation(&self, y: &[f64; STATES]) -> f64 {
        y[YAW] - y[TRAILER]
    }

    /// The articulation and its rate, rad and rad/s.
    pub(super) fn articulations(&self, y: &[f64; STATES]) -> [f64; 2] {
        [self.articulation(y), y[YAW_RATE] - y[TRAILER + 1]]
    }

    /// The semi-trailer's body with its place.
    pub(super) fn trailer_placed(&self, y: &[f64; STATES]) -> [f64; BODY] {
        let mut body = self.trailer_body(y, self.articulation(y).sin_cos());
        let tractor = split(y).0;
        let [low, high] = &self.hitch.pins;
        let (own, other) = (tractor[YAW].sin_cos(), body[YAW].sin_cos());
        let (along, aside) = (low.x, low.offset(tractor));
        let (back, astray) = (high.x, high.offset(&body));
        body[X] = tractor[X] + along * own.1 - aside * own.0 - (back * other.1 - astray * other.0);
        body[Y] = tractor[Y] + along * own.0 + aside * own.1 - (back * other.0 + astray * other.1);
        body
    }
}

impl<T: TyreModel> Plant<STATES, SIGNALS> for TruckPlant<T> {
    type Environment = TruckEnvironment;
    type Flow = TruckFlow;
    type Output = TruckOutput;

    fn steering(&self) -> &SteeringChain {
        &self.steering
    }

    fn drive(&self) -> &DriveLine {
        &self.drive
    }

    fn effects(&self) -> &Effects {
        &self.effects.vehicle
    }

    fn placed(&self, x: f64, y: f64, yaw: f64, vx: f64) -> [f64; STATES] {
        let mut states = [0.0; STATES];
        let (sin, cos) = yaw.sin_cos();
        states[X] = x - self.tractor.reference_x * cos;
        states[Y] = y - self.tractor.reference_x * sin;
        states[YAW] = yaw;
        states[VX] = vx;
        states[TRAILER] = yaw;
        let axles = self.tractor.axles.iter().chain(&self.trailer.axles);
        for (index, axle) in axles.enumerate() {
            for wheel in [2 * index, 2 * index + 1] {
                states[WHEELS + wheel * PER_WHEEL + SPIN] = vx / axle.radius;
            }
        }
        states
    }

    /// Gravity and friction at the places of the units; the road's own length stands for that of the bent truck.
    fn environment(&self, y: &[f64; STATES], road: Option<&Path>, station: f64) -> TruckEnvironment {
        let effects = &self.effects.vehicle;
        let [low, high] = &self.hitch.pins;
        let behind = low.x - high.x;
        let gravity =
            [gravity(effects, y[YAW], road, station), gravity(effects, y[TRAILER], road, station + behind)];
        let axles = [self.tractor.axles[0].x, self.tractor.axles[1].x, behind + self.trailer.axles[0].x];
        let friction = axles.map(|ahead| road.map_or(1.0, |road| road.friction(station + ahead)));
        TruckEnvironment { gravity, friction: friction.map(|friction| friction * effects.road_friction) }
    }

    fn on(&self, surface: Surface) -> TruckEnvironment {
        let effects = &self.effects.vehicle;
        let friction = surface.friction * effects.road_friction;
        TruckEnvironment { gravity: [gravity_on(effects, surface); 2], friction: [friction; 3] }
    }

    #[inline(always)]
    fn derivative_by<L: Lanes<Stored = [f64; FOUR]>>(
        &self,
        y: &[f64; STATES],
        stage: &StageInputs,
        environment: &TruckEnvironment,
        rates: &mut [f64; STATES],
        flow: &mut TruckFlow,
    ) {
        let effects = &self.effects.vehicle;
        let (tractor, wheels) = split(y);
        let (rates, wheel_rates) = rates.split_at_mut(WHEELS);
        let forces = self.drive.forces(stage.accel, self.tractor.rim_speed(wheels));
        flow.drive_force = forces.0 - forces.1;

        let [front, rear] = &self.tractor.axles;
        let [group] = &self.trailer.axles;
        let angles = L::load(&[
            front.wheel_angle(tractor[ROLL], stage.steer),
            rear.wheel_angle(tractor[ROLL], stage.steer),
            group.wheel_angle(y[TRAILER + 2], stage.steer),
            y[YAW],
        ]);
        let articulation = self.articulation(y);
        let (sin, cos) = (sin_of(angles).store(), cos_of(angles).store());
        let pair = |i: usize| (sin[i], cos[i]);
        let (steer, yaw) = ([pair(0), pair(1), pair(2)], pair(3));
        let turn = (sin_of(articulation), cos_of(articulation));
        let yaw_behind = (yaw.0 * turn.1 - yaw.1 * turn.0, yaw.1 * turn.1 + yaw.0 * turn.0);

        let trailer = &self.trailer_body(y, turn);
        let at = |axle: usize| &wheels[2 * axle * PER_WHEEL..];
        let (mut on_front, front_motion) = front.suspension(tractor, at(0), steer[0], forces);
        let (mut on_rear, rear_motion) = rear.suspension(tractor, at(1), steer[1], forces);
        let (mut on_group, group_motion) = group.suspension(trailer, at(2), steer[2], forces);
        let motions = [
            front_motion[0],
            front_motion[1],
            rear_motion[0],
            rear_motion[1],
            group_motion[0],
            group_motion[1],
        ];
        let [a, b, c] = environment.friction;
        flow.wheels = roll::<L, T, 6>(&self.wheels, wheels, &motions, [a, a, b, b, c, c], wheel_rates);
        front.gather(&flow.wheels[0..2], steer[0], &mut on_front);
        rear.gather(&flow.wheels[2..4], steer[1], &mut on_rear);
        group.gather(&flow.wheels[4..6], steer[2], &mut on_group);
        let (on_tractor, on_trailer) = ([on_front, on_rear], [on_group]);

        // All that acts on each unit but the force in the hitch.
        let gravity = &environment.gravity;
        let mut pushes = [
            self.tractor.push(tractor, &on_tractor, &gravity[0]),
            self.trailer.push(trailer, &on_trailer, &gravity[1]),
        ];
        let (drag, side) = air::forces(effects, (self.drag, self.side[0]), (tractor[VX], tractor[VY]), yaw);
        pushes[0].longitudinal += drag;
        pushes[0].lateral += side;
        pushes[0].yawing += side * self.pressure_centre[0] + air::brake_pull(effects, tractor[VX]);
        let (_, side) = air::forces(effects, (0.0, self.side[1]), (trailer[VX], trailer[VY]), yaw_behind);
        pushes[1].lateral += side;
        pushes[1].yawing += side * self.pressure_centre[1];
        let bodies = [tractor, trailer];
        let hitch = self.hitch.flow(bodies, turn, y[WIND_UP]);
        self.hitch.add(&hitch, bodies, turn, &mut pushes);

        // The force in the hitch.
        let force = self.hitch.force((&self.tractor, &self.trailer), bodies, &pushes, gravity, turn);
        let behind = to_trailer([-force[0], -force[1]], turn);
        let [low, high] = &self.hitch.pins;
        pushes[0].add(&low.push(tractor, force));
        pushes[1].add(&high.push(trailer, behind));

        let accel = self.tractor.acceleration(&pushes[0]);
        UnitConstants::<T, 2>::plane(tractor, &accel, &gravity[0], yaw, rates);
        let (own, other) = wheel_rates.split_at_mut(TRAILER_WHEELS);
        let first = (&wheels[..TRAILER_WHEELS], &flow.wheels[..4]);
        self.tractor.vertical(tractor, &on_tractor, &accel, &gravity[0], first, (rates, own));
        self.tractor.lift(low.pitching(force[0], -hitch.more), -hitch.more, rates);
        flow.specific = [accel.specific_x, pushes[0].lateral / self.tractor.mass, gravity[0].z];
        flow.hitch = [force[0], force[1], hitch.load];

        let accel = self.trailer.acceleration(&pushes[1]);
        let mut body_rates = [0.0; BODY];
        UnitConstants::<T, 1>::plane(trailer, &accel, &gravity[1], yaw_behind, &mut body_rates);
        let last = (&wheels[TRAILER_WHEELS..], &flow.wheels[4..]);
        self.trailer.vertical(trailer, &on_trailer, &accel, &gravity[1], last, (&mut body_rates, other));
        let pitching = high.pitching(behind[0], hitch.more) + hitch.rolling * turn.0;
        self.trailer.lift(pitching, hitch.more, &mut body_rates);
        for (of_body, of_truck) in TRAILER_BODY {
            rates[of_truck] = body_rates[of_body];
        }
        rates[WIND_UP] = hitch.wind_up_rate;
    }

    fn check(&self, y: &[f64; STATES], time: f64) -> Result<(), PlantStepError> {
        check_upright(y[ROLL], y[PITCH], time)?;
        check_upright(y[TRAILER + 2], y[TRAILER + 4], time)?;
        let (articulation, limit) = (self.articulation(y), self.hitch.articulation_limit);
        if articulation.abs() > limit {
            return Err(PlantStepError::JackKnifed { time, articulation, limit });
        }
        Ok(())
    }

    fn body_signals(
        &self,
        y: &[f64; STATES],
        rates: &[f64; STATES],
        flow: &TruckFlow,
    ) -> [f64; BODY_SIGNALS] {
        let arm = self.tractor.reference_x;
        body_signals(&self.effects.vehicle, split(y).0, arm, flow.specific, rates[YAW_RATE])
    }

    fn signals(&self, y: &[f64; STATES], rates: &[f64; STATES], flow: &mut TruckFlow) -> [f64; SIGNALS] {
        for (wheel, output) in flow.outputs.iter_mut().enumerate() {
            *output = flow.wheels[wheel].output(y[WHEELS + wheel * PER_WHEEL + SPIN]);
        }
        let own = self.body_signals(y, rates, flow);
        let trailer = self.trailer_placed(y);
        let [articulation, articulation_rate] = self.articulations(y);
        let more = [
            articulation,
            articulation_rate,
            trailer[X],
            trailer[Y],
            trailer[YAW],
            trailer[VX],
            trailer[VY],
            trailer[YAW_RATE],
            trailer[ROLL],
        ];
        std::array::from_fn(|i| if i < BODY_SIGNALS { own[i] } else { more[i - BODY_SIGNALS] })
    }

    fn measure(
        &self,
        state: &State<STATES, SIGNALS>,
        flow: &TruckFlow,
        delayed: &[f64; SIGNALS],
    ) -> TruckOutput {
        output::measure(self, state, flow, delayed)
    }
}

/// The tractor's body, and all wheels.
fn split(y: &[f64; STATES]) -> (&[f64; BODY], &[f64]) {
    (y.first_chunk().expect("there are more states than a body's"), &y[WHEELS..])
}
