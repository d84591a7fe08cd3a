//! The two-track car: 14 degrees of freedom, transient tyres, drive, brakes and air.
//!
//! State (36 numbers): pose and velocities in the plane of the road (6), roll, pitch and heave of the body (6), and
//! for each wheel its spin, two deflections of the tyre, its vertical motion (2), and the wind-up of its brake.
//! Integrated by the classic Runge-Kutta method at 1000 Hz whatever step is asked for; steering and drive are exact.
//!
//! | file | idea |
//! |---|---|
//! | `state.rs` | what changes while driving |
//! | `plant.rs` | the constants of one car with its effects |
//! | `dynamics.rs` | the equations of motion |
//! | `wheel.rs` | one wheel: transient slip, forces, spin, brake |
//! | `sensors.rs` | what is measured |

mod dynamics;
mod plant;
mod sensors;
mod state;
mod wheel;

use super::effects::{EffectOutOfRange, Effects};
use super::parameters::{CarParameters, VehicleError};
use crate::path::Path;
use dynamics::{Environment, Flow, Stage};
use plant::Plant;
use sensors::Motion;
pub use sensors::{CarOutput, CarStatus, WheelOutput};
use state::{CarState, STATES, YAW};
use std::sync::Arc;

/// The longest step of the integration, s.
pub const LONGEST_SUBSTEP: f64 = 1e-3;
/// The longest step that may be asked for, s.
pub const LONGEST_STEP: f64 = 3600.0;
/// Roll and pitch angles beyond which the car counts as rolled over, rad.
pub const ROLLED_OVER: f64 = 0.9;

/// What the driver, or a controller, asks of the car; held over a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CarInput {
    /// Road-wheel angle asked of the steering actuator, rad.
    pub steer_cmd: f64,
    /// Longitudinal acceleration asked of drive and brakes, m/s2.
    pub accel_cmd: f64,
}

/// Why a car could not be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum CarError {
    #[error(transparent)]
    Parameters(#[from] VehicleError),
    #[error(transparent)]
    Effects(#[from] EffectOutOfRange),
    /// Payload and shift have put the CG outside the wheelbase.
    #[error(
        "the CG lies {ahead} m ahead of the rear axle, outside the wheelbase of {wheelbase} m; change effect.payload_x, \
         effect.payload or effect.cg_shift"
    )]
    CgOutside { ahead: f64, wheelbase: f64 },
}

/// Why a step could not be made. The car is as it was before the step.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum StepError {
    #[error("{name} = {value} at {time} s: not a finite number; the step was not made")]
    InputNotFinite { name: &'static str, value: f64, time: f64 },
    #[error("a step of {step} s at {time} s: must be greater than 0 and at most {LONGEST_STEP} s")]
    StepLength { step: f64, time: f64 },
    /// The body lies beyond what springs and this model describe.
    #[error(
        "the car rolled over at {time} s (roll {roll} rad, pitch {pitch} rad); drive slower or start anew"
    )]
    RolledOver { time: f64, roll: f64, pitch: f64 },
    #[error(
        "the state became infinite or not a number at {time} s; check the parameters, and report the case"
    )]
    NotFinite { time: f64 },
}

/// Why a saved state could not be restored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "this is no saved state of this car ({reason}); use one that the same car with the same parameters saved"
)]
pub struct RestoreError {
    reason: String,
}

/// The car.
pub struct Car {
    plant: Plant,
    road: Option<Arc<Path>>,
    state: CarState,
    /// The state before the step under way, for errors.
    before: CarState,
    output: CarOutput,
}

impl Car {
    /// A car at rest at the origin, heading east.
    ///
    /// # Errors
    /// Parameters or effects out of range, a CG outside the wheelbase.
    pub fn new(
        parameters: &CarParameters,
        effects: &Effects,
        road: Option<Arc<Path>>,
    ) -> Result<Self, CarError> {
        parameters.check()?;
        effects.check()?;
        let plant = Plant::new(parameters, effects)?;
        let state = CarState::at_rest(&plant);
        let mut car = Self { before: state.clone(), output: CarOutput::default(), plant, road, state };
        car.before.reserve(&car.plant);
        car.place(0.0, 0.0, 0.0, 0.0);
        Ok(car)
    }

    /// Puts the car somewhere: position of its reference point in m, yaw in rad, speed in m/s; wheels rolling,
    /// steering straight, time 0, nothing under way.
    pub fn place(&mut self, x: f64, y: f64, yaw: f64, vx: f64) {
        self.state = CarState::placed(&self.plant, x, y, yaw, vx);
        self.state.station = self.road.as_ref().map_or(0.0, |road| road.project(x, y, yaw, None).station);
        let motion = self.observe();
        self.state.sensors.start(&self.plant, motion);
        self.sense(motion);
        self.before.copy_from(&self.state);
    }

    /// Advances by `step` seconds with the input held. No allocation, no lock.
    ///
    /// # Errors
    /// See [`StepError`]; the car and its output are then as they were.
    pub fn step(&mut self, input: &CarInput, step: f64) -> Result<(), StepError> {
        let time = self.state.time;
        for (name, value) in [("steer_cmd", input.steer_cmd), ("accel_cmd", input.accel_cmd)] {
            if !value.is_finite() {
                return Err(StepError::InputNotFinite { name, value, time });
            }
        }
        if !(step > 0.0 && step <= LONGEST_STEP) {
            return Err(StepError::StepLength { step, time });
        }
        self.before.copy_from(&self.state);
        let result = self.advance(input, step);
        match result {
            Ok(motion) => self.sense(motion),
            Err(_) => self.state.copy_from(&self.before),
        }
        result.map(|_| ())
    }

    fn advance(&mut self, input: &CarInput, step: f64) -> Result<Motion, StepError> {
        let start = self.state.time;
        self.state.steering.command(&self.plant.steering, start, input.steer_cmd);
        let asked = input.accel_cmd * self.plant.drive_gain;
        // A step of 0.01 s is ten substeps though 0.01 / 0.001 is a little more than ten.
        let substeps = (step / LONGEST_SUBSTEP - 1e-9).ceil().max(1.0);
        let h = step / substeps;
        let mut motion = None;
        let mut done = 0.0;
        while done < substeps {
            self.substep(asked, h);
            done += 1.0;
            self.state.time = start + done * h;
            self.check()?;
            if self.state.sensors.wants(&self.plant, self.state.time) {
                let now = self.observe();
                self.state.sensors.push(self.state.time, now);
                motion = (done == substeps).then_some(now);
            }
        }
        Ok(motion.unwrap_or_else(|| self.observe()))
    }

    /// One step of the classic Runge-Kutta method.
    fn substep(&mut self, asked: f64, h: f64) {
        let environment = self.environment();
        let Self { plant, state, .. } = self;
        let time = state.time;
        let stage = |state: &CarState| Stage {
            steer: state.steering.road_wheel(&plant.steering),
            accel: state.drive,
        };
        let begin = stage(state);
        state.steering.advance(&plant.steering, time, 0.5 * h);
        state.advance_drive(plant, asked, 0.5 * h);
        let middle = stage(state);
        state.steering.advance(&plant.steering, time + 0.5 * h, 0.5 * h);
        state.advance_drive(plant, asked, 0.5 * h);
        let end = stage(state);

        let y = state.y;
        let (mut k, mut sum, mut at) = ([0.0; STATES], [0.0; STATES], [0.0; STATES]);
        let mut flow = Flow::default();
        plant.derivative(&y, &begin, &environment, &mut k, &mut flow);
        for i in 0..STATES {
            sum[i] = k[i];
            at[i] = y[i] + 0.5 * h * k[i];
        }
        plant.derivative(&at, &middle, &environment, &mut k, &mut flow);
        for i in 0..STATES {
            sum[i] += 2.0 * k[i];
            at[i] = y[i] + 0.5 * h * k[i];
        }
        plant.derivative(&at, &middle, &environment, &mut k, &mut flow);
        for i in 0..STATES {
            sum[i] += 2.0 * k[i];
            at[i] = y[i] + h * k[i];
        }
        plant.derivative(&at, &end, &environment, &mut k, &mut flow);
        for i in 0..STATES {
            state.y[i] = y[i] + h / 6.0 * (sum[i] + k[i]);
        }
        if let Some(road) = &self.road {
            let (x, y, yaw) = (self.state.y[state::X], self.state.y[state::Y], self.state.y[YAW]);
            self.state.station = road.project(x, y, yaw, Some(self.state.station)).station;
        }
    }

    /// Gravity and friction where the car is.
    fn environment(&self) -> Environment {
        let yaw = self.state.y[YAW];
        match &self.road {
            None => self.plant.environment(0.0, 0.0, 0.0, [1.0, 1.0]),
            Some(road) => {
                let station = self.state.station;
                let here = road.at(station);
                let friction = [0, 1].map(|axle| road.at(station + self.plant.axles[axle].x).friction);
                self.plant.environment(yaw - here.yaw, here.bank, here.grade, friction)
            }
        }
    }

    fn check(&self) -> Result<(), StepError> {
        let (y, time) = (&self.state.y, self.state.time);
        if !y.iter().all(|value| value.is_finite()) {
            return Err(StepError::NotFinite { time });
        }
        let (roll, pitch) = (y[state::ROLL], y[state::PITCH]);
        if roll.abs() > ROLLED_OVER || pitch.abs() > ROLLED_OVER {
            return Err(StepError::RolledOver { time, roll, pitch });
        }
        Ok(())
    }

    /// The true motion now.
    fn observe(&self) -> Motion {
        let stage =
            Stage { steer: self.state.steering.road_wheel(&self.plant.steering), accel: self.state.drive };
        let (mut rates, mut flow) = ([0.0; STATES], Flow::default());
        self.plant.derivative(&self.state.y, &stage, &self.environment(), &mut rates, &mut flow);
        Motion::of(&self.plant, &self.state, &rates, &flow)
    }

    /// Sets the output from what the sensors make of the motion.
    fn sense(&mut self, motion: Motion) {
        let Self { plant, state, output, .. } = self;
        let delayed = state.sensors.read(plant, state.time, &motion);
        *output = sensors::measure(plant, state, &motion, &delayed);
    }

    /// What is measured at the end of the last step.
    #[must_use]
    pub fn output(&self) -> &CarOutput {
        &self.output
    }

    /// Time since the car was placed, s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.state.time
    }

    /// Appends everything that steps change to `bytes`.
    pub fn save(&self, bytes: &mut Vec<u8>) {
        let saved = postcard::to_allocvec(&self.state).unwrap_or_default();
        bytes.extend_from_slice(&saved);
    }

    /// Restores what [`save`](Self::save) wrote; the car then goes on bit for bit.
    ///
    /// # Errors
    /// Bytes that are cut off, too many, or of something else. The car is then as it was.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let refuse = |reason: String| RestoreError { reason };
        let (mut state, rest) =
            postcard::take_from_bytes::<CarState>(bytes).map_err(|error| refuse(error.to_string()))?;
        if !rest.is_empty() {
            return Err(refuse(format!("{} bytes too many", rest.len())));
        }
        if !state.is_sound() {
            return Err(refuse("it holds numbers that are not finite".to_string()));
        }
        state.reserve(&self.plant);
        self.state = state;
        let motion = self.observe();
        self.sense(motion);
        Ok(())
    }
}
