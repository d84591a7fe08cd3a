//! Vehicles without their fast motions: for hundreds of replays, at ten thousand times real time.
//!
//! The equations are the plant's own, evaluated once a step of 20 ms instead of four times a millisecond. Speed is
//! given. The slow motions (sideways, yaw, roll) are integrated by Adams and Bashforth's rule of third order. It is of
//! second order for trucks: their fifth wheel's dry friction is too stiff. The tyres' relaxation is exact for the mean
//! slip velocity by the same rule,
//!
//! ```text
//!     <f> = (23 f - 16 f- + 5 f--) / 12,   x+ = x + h <f>,   v+ = e^(-a h) v + (1 - e^(-a h)) / a <s>,   v' = s - a v
//! ```
//!
//! Faster motions follow their equilibrium by a Newton step each time, without their mass. They are the wheels' spin,
//! pitch and heave of the body with the wheels below it. So does the wheels' height `z` between tyre `k` and damper
//! `d`, which is then led by one step,
//!
//! ```text
//!     z = (F + k z~ + d (z~' + z- / h)) / (k + d / h),   z+ = 2 z - z-,      F: force found at z~, z~'
//! ```
//!
//! Wheels that turn faster than the vehicle moves give it the force for that at once; otherwise every drive force would
//! come two steps late:
//!
//! ```text
//!     a = a~ + sum I (w' - a~ / r) / r / (m + sum I / r^2),      a~, w': acceleration and spin rate found
//! ```
//!
//! Steering chain and drive are exact. Every effect thus has the same meaning as in the plant;
//! `examples/diagnose_replay.rs` measures the remaining difference.
//!
//! | file | idea |
//! |---|---|
//! | `past.rs` | the rule of Adams and Bashforth |
//! | `fast.rs` | wheels, pitch and heave at their equilibrium |
//! | `decay.rs` | `1 - e^-z` |

mod decay;
mod fast;
mod past;

use super::sensors::measured;
use super::steering::SteeringState;
use super::stepper::{Plant, StageInputs};
use super::surface::Surface;
use super::unit::{BODY, PER_WHEEL, SHORTEST_RELAXATION, UnitAxle, VX, VY, Wheels, YAW, YAW_RATE};
use crate::numerics::lanes::compute;
use crate::vehicle::tyre::TyreModel;
use decay::one_minus_exp_neg;
pub(super) use fast::SprungBody;
use fast::{FastWheels, Follow};
use past::Past;

/// Longest step times the frequency of the quickest motion sideways: the rule is not stable with much more.
const LONGEST: f64 = 0.5;
/// Largest number of parts of a step.
const MOST_PARTS: f64 = 4.0;
/// Steps of the fast motions before a start.
const SETTLING: usize = 40;
/// Axles of the first body, and of its group of wheels; others are a trailer's.
const FIRST_AXLES: usize = 2;
const MOST_BODIES: usize = 2;

/// Input of the steering.
#[derive(Debug, Clone, Copy)]
pub enum ReducedSteer {
    /// As commanded; through the whole steering chain. rad
    Commanded(f64),
    /// As measured at the sensor; only the chain behind it acts. rad
    Measured(f64),
}

/// Inputs over a step.
#[derive(Debug, Clone, Copy)]
pub struct ReducedInput {
    /// Steering, held over the step.
    pub steer: ReducedSteer,
    /// Acceleration asked of drive and brakes, m/s2.
    pub accel: f64,
    /// True if `accel` is that of drive and brakes themselves, without their lag.
    pub accel_is_given: bool,
    /// True longitudinal velocity at the begin of the step, m/s.
    pub vx: f64,
    /// True heading, rad, if it is known: for the wind.
    pub yaw: Option<f64>,
    /// The road below.
    pub surface: Surface,
}

/// Start of a drive.
#[derive(Debug, Clone, Copy, Default)]
pub struct ReducedStart {
    /// m/s, m/s, rad/s, rad
    pub vx: f64,
    /// Of the reference point.
    pub vy: f64,
    #[allow(missing_docs)]
    pub yaw_rate: f64,
    #[allow(missing_docs)]
    pub yaw: f64,
    /// Angle of the steering at the sensor, rad.
    pub steer: f64,
    /// m/s2
    pub accel: f64,
    /// rad, rad/s
    pub articulation: f64,
    #[allow(missing_docs)]
    pub articulation_rate: f64,
}

/// The motion at the begin of a step. True, and with effects of the sensors but their latency; units as in `signal`.
#[derive(Debug, Clone, Copy, Default)]
#[allow(missing_docs)]
pub struct ReducedOutput {
    /// True velocity and yaw rate of the reference point, rate of the longitudinal velocity.
    pub true_vy: f64,
    pub true_yaw_rate: f64,
    pub vx_rate: f64,
    pub vx: f64,
    pub vy: f64,
    pub yaw_rate: f64,
    pub ax: f64,
    pub ay: f64,
    pub roll: f64,
    pub steer: f64,
    pub articulation: f64,
    pub articulation_rate: f64,
}

/// A vehicle without its fast motions.
pub trait ReducedVehicle {
    /// Starts somewhere, tyres and springs settled.
    fn start(&mut self, start: &ReducedStart);
    /// Sets sideways velocity (m/s, of the reference point) and yaw rate (rad/s) while driving, tyres settled.
    fn set_motion(&mut self, vy: f64, yaw_rate: f64);
    /// The motion now; then one step of at most about 20 ms.
    fn step(&mut self, input: &ReducedInput, step: f64) -> ReducedOutput;
}

/// A plant with its fast motions declared.
pub(super) trait Relaxed<const N: usize, const S: usize>: Plant<N, S> {
    /// The formula of its tyres.
    type Tyre: TyreModel;
    /// States that are integrated.
    const SLOW: &'static [usize];
    /// Order of their integration, 2 or 3.
    const ORDER: usize;
    /// Place of the first wheel's states; those of the others follow, left and right of each axle.
    const FIRST_WHEEL: usize;
    /// Number of axles.
    const AXLES: usize;
    /// The tyres of each body's axles.
    fn wheels(&self) -> &[Wheels<Self::Tyre>];
    fn axle(&self, index: usize) -> &UnitAxle<Self::Tyre>;
    fn bodies(&self) -> Vec<SprungBody>;
    /// Reference point forward of the CG, m.
    fn arm(&self) -> f64;
    /// Mass of the whole vehicle, kg.
    fn mass(&self) -> f64;
    /// Places of a trailer's yaw and yaw rate, and of the wind-up of the fifth wheel's friction.
    fn trailer(&self) -> Option<[usize; 3]>;
    /// Articulation as measured and its rate.
    fn measured_articulation(&self, y: &[f64; N]) -> (f64, f64);
}

/// Lateral relaxation length of an axle's tyres at a load of each in N, m.
fn relaxation<T: TyreModel>(axle: &UnitAxle<T>, each: f64) -> f64 {
    let length =
        if axle.relaxation > 0.0 { axle.relaxation } else { axle.tyre.lateral_relaxation(each, 0.0) };
    length.max(SHORTEST_RELAXATION)
}

/// A plant without its fast motions.
pub(super) struct Reduced<P: Relaxed<N, S>, const N: usize, const S: usize> {
    plant: P,
    surface: Surface,
    environment: P::Environment,
    bodies: Vec<SprungBody>,
    /// Those below each body.
    wheels: Vec<FastWheels>,
    y: [f64; N],
    rates: [f64; N],
    /// Past rates of the slow motions, in the order of `P::SLOW`.
    past: Vec<Past<f64>>,
    /// Fastest natural frequency of the motion sideways on its tyres, rad/s.
    frequency: f64,
    steering: SteeringState,
    drive: f64,
    time: f64,
}

impl<P: Relaxed<N, S>, const N: usize, const S: usize> Reduced<P, N, S> {
    pub fn new(plant: P) -> Self {
        let y = plant.placed(0.0, 0.0, 0.0, 0.0);
        let wheels = (0..P::AXLES).step_by(FIRST_AXLES).map(|first| {
            let last = (first + 1).min(P::AXLES - 1);
            let at = P::FIRST_WHEEL + 2 * first * PER_WHEEL;
            FastWheels::new([plant.axle(first), plant.axle(last)], at, 2 * (last + 1 - first))
        });
        let wheels = wheels.collect();
        Self {
            surface: Surface::default(),
            environment: plant.on(Surface::default()),
            bodies: plant.bodies(),
            wheels,
            y,
            rates: [0.0; N],
            past: vec![Past::NONE; P::SLOW.len()],
            frequency: Self::frequency(&plant),
            steering: SteeringState::at_rest(plant.steering(), 0.0),
            drive: 0.0,
            time: 0.0,
            plant,
        }
    }

    /// Frequency of the mass on the tyres' side walls, rad/s: whatever the speed, nothing sideways decays by more than
    /// half of it in a second. For stiffer springs, that of a body that rolls on them.
    fn frequency(plant: &P) -> f64 {
        let axles = || (0..FIRST_AXLES).map(|i| plant.axle(i));
        let mut rolling = [0.0; MOST_BODIES];
        for index in 0..P::AXLES {
            let axle = plant.axle(index);
            rolling[index / FIRST_AXLES] += 2.0 * axle.spring * axle.half_track.powi(2) + axle.anti_roll_bar;
        }
        let rolls = plant.bodies().into_iter().zip(rolling).map(|(body, k)| (k / body.roll_inertia).sqrt());
        let rolling = rolls.fold(0.0, f64::max);
        let stiffness = |axle: &UnitAxle<P::Tyre>| {
            2.0 * axle.tyres * axle.tyre.cornering_stiffness(axle.static_load / axle.tyres, 0.0)
        };
        let shortest =
            axles().map(|axle| relaxation(axle, axle.static_load / axle.tyres)).fold(f64::INFINITY, f64::min);
        (axles().map(stiffness).sum::<f64>() / plant.mass() / shortest).max(0.0).sqrt().max(rolling)
    }

    fn derivative(&mut self, stage: &StageInputs) -> P::Flow {
        let mut flow = P::Flow::default();
        self.plant.derivative(&self.y, stage, &self.environment, &mut self.rates, &mut flow);
        flow
    }

    /// Acceleration of the vehicle, m/s2, by wheels that turn faster than it moves: the force that they do not have
    /// yet. A wheel that spins or is locked gets no more.
    fn late(&self) -> f64 {
        let (mut force, mut mass) = (0.0, self.plant.mass());
        self.wheels.iter().for_each(|wheels| wheels.add_late(&self.rates, (&mut force, &mut mass)));
        force / mass
    }

    /// Fast motions follow their equilibrium. With `h`, the tyres' lateral deflections are integrated; without it they
    /// settle.
    fn follow(&mut self, h: Option<f64>) {
        let Self { plant, y, rates, wheels, bodies, .. } = self;
        for ((wheels, constants), body) in wheels.iter_mut().zip(plant.wheels()).zip(bodies.iter()) {
            compute(Follow { wheels, constants, body, y, rates, order: P::ORDER, h });
        }
    }

    /// Slow motions.
    fn integrate(&mut self, h: f64) {
        for (&i, past) in P::SLOW.iter().zip(&mut self.past) {
            self.y[i] += h * past.ahead(self.rates[i], P::ORDER);
        }
        if let Some([_, rate, wind_up]) = self.plant.trailer() {
            let (z, turning) = (self.y[wind_up], self.y[YAW_RATE] - self.y[rate]);
            let back = turning - self.rates[wind_up];
            let decay = if z == 0.0 { 0.0 } else { (back / z).max(0.0) * h };
            let lost = one_minus_exp_neg(decay);
            let share = if decay > 1e-9 { lost / decay } else { 1.0 };
            self.y[wind_up] = z * (1.0 - lost) + turning * h * share;
        }
    }

    /// The motion now, if it is asked for; then one step that is short enough.
    fn part(&mut self, input: &ReducedInput, step: f64, output: Option<&mut ReducedOutput>) {
        let chain = *self.plant.steering();
        if input.surface != self.surface {
            (self.surface, self.environment) = (input.surface, self.plant.on(input.surface));
        }
        self.y[VX] = input.vx;
        if let Some(yaw) = input.yaw {
            let turn = yaw - self.y[YAW];
            self.y[YAW] = yaw;
            if let Some([trailer, ..]) = self.plant.trailer() {
                self.y[trailer] += turn;
            }
        }
        let (steer, at_sensor) = match input.steer {
            ReducedSteer::Commanded(angle) => {
                let now = (self.steering.road_wheel(&chain), self.steering.measured());
                self.steering.command(&chain, self.time, angle);
                self.steering.advance(&chain, self.time, step);
                now
            }
            ReducedSteer::Measured(angle) => (chain.gain * angle + chain.offset, angle),
        };
        if input.accel_is_given {
            self.drive = input.accel;
        }
        let flow = self.derivative(&StageInputs { steer, accel: self.drive });
        let late = self.late();
        if let Some(output) = output {
            let signals = self.plant.body_signals(&self.y, &self.rates, &flow);
            let [_, _, _, vx, vy, yaw_rate, ax, ay, roll, ..] = measured(self.plant.effects(), &signals);
            let (articulation, articulation_rate) = self.plant.measured_articulation(&self.y);
            *output = ReducedOutput {
                true_vy: signals[4],
                true_yaw_rate: signals[5],
                vx_rate: self.rates[VX] + late,
                vx,
                vy,
                yaw_rate,
                ax: ax + late,
                ay,
                roll,
                steer: at_sensor,
                articulation,
                articulation_rate,
            };
        }
        self.rates[VX] += late;
        self.integrate(step);
        self.follow(Some(step));
        if !input.accel_is_given {
            let line = self.plant.drive();
            self.drive = line.follow(self.drive, input.accel * line.gain, step);
        }
        self.time += step;
    }
}

impl<P: Relaxed<N, S>, const N: usize, const S: usize> ReducedVehicle for Reduced<P, N, S> {
    fn start(&mut self, start: &ReducedStart) {
        self.y = self.plant.placed(0.0, 0.0, start.yaw, start.vx);
        self.y[VY] = start.vy - self.plant.arm() * start.yaw_rate;
        self.y[YAW_RATE] = start.yaw_rate;
        if let Some([yaw, rate, _]) = self.plant.trailer() {
            self.y[yaw] = start.yaw - start.articulation;
            self.y[rate] = start.yaw_rate - start.articulation_rate;
        }
        self.steering = SteeringState::at_rest(self.plant.steering(), start.steer);
        (self.drive, self.time) = (start.accel, 0.0);
        self.wheels.iter_mut().for_each(FastWheels::start);
        let stage = StageInputs { steer: self.steering.road_wheel(self.plant.steering()), accel: self.drive };
        for _ in 0..SETTLING {
            self.derivative(&stage);
            self.follow(None);
        }
        self.past.fill(Past::NONE);
    }

    fn set_motion(&mut self, vy: f64, yaw_rate: f64) {
        let changed = yaw_rate - self.y[YAW_RATE];
        self.y[VY] = vy - self.plant.arm() * yaw_rate;
        self.y[YAW_RATE] = yaw_rate;
        if let Some([_, rate, _]) = self.plant.trailer() {
            self.y[rate] += changed;
        }
        let stage = StageInputs { steer: self.steering.road_wheel(self.plant.steering()), accel: self.drive };
        self.derivative(&stage);
        self.follow(None);
        self.past.fill(Past::NONE);
    }

    fn step(&mut self, input: &ReducedInput, step: f64) -> ReducedOutput {
        let parts = (step * self.frequency / LONGEST).clamp(1.0, MOST_PARTS).ceil();
        let mut output = ReducedOutput::default();
        self.part(input, step / parts, Some(&mut output));
        (1..parts as usize).for_each(|_| self.part(input, step / parts, None));
        output
    }
}

/// Stiffness of a body's springs in heave (N/m) and pitch (N m/rad).
pub(super) fn spring_stiffness<'a, T: TyreModel>(axles: impl Iterator<Item = &'a UnitAxle<T>>) -> (f64, f64) {
    axles.fold((0.0, 0.0), |(heave, pitch), axle| {
        let tyre = axle.tyres * axle.tyre.vertical_stiffness();
        let side = axle.spring * tyre / (axle.spring + tyre);
        (heave + 2.0 * side, pitch + 2.0 * side * axle.x_sprung * axle.x_sprung)
    })
}

/// Places of heave and pitch of the first body.
pub(super) const FIRST_BODY: ([usize; 2], [usize; 2]) =
    ([super::unit::HEAVE, super::unit::HEAVE_RATE], [super::unit::PITCH, super::unit::PITCH_RATE]);
const _: () = assert!(BODY == 12);
