//! A vehicle in motion: its state, its steps, its measurements.
//!
//! The plant gives the equations of motion `y' = f(y, steering, drive, road)`. They are integrated by the classic
//! Runge-Kutta method at 1000 Hz, regardless of the step asked for. Steering chain and drive are exact in time.

use super::array;
use super::drive::DriveLine;
use super::effects::Effects;
use super::sensors::{BODY_SIGNALS, Latency};
use super::steering::{SteeringChain, SteeringState};
use super::substep::LONGEST_SUBSTEP;
use super::surface::Surface;
use super::unit::{X, Y, YAW};
use crate::finite::check_finite;
use crate::numerics::lanes::{FOUR, Lanes, Work, compute};
use crate::path::Path;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The longest step that may be asked for, s.
pub const LONGEST_STEP: f64 = 3600.0;
/// Roll and pitch angles beyond which a vehicle counts as rolled over, rad.
pub const ROLLED_OVER: f64 = 0.9;

/// Inputs of a vehicle, from a driver or a controller; held over a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct VehicleInput {
    /// Road-wheel angle asked of the steering actuator, rad.
    pub steer_cmd: f64,
    /// Longitudinal acceleration asked of drive and brakes, m/s2.
    pub accel_cmd: f64,
}

/// Reasons for which a step could not be made. The vehicle is as it was before the step.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum PlantStepError {
    #[error("{name} = {value} at {time:.3} s: not a finite number; the step was not made")]
    InputNotFinite { name: &'static str, value: f64, time: f64 },
    #[error("a step of {step} s at {time:.3} s: must be greater than 0 and at most {LONGEST_STEP} s")]
    StepLength { step: f64, time: f64 },
    /// The body is beyond the range of springs and model.
    #[error(
        "rolled over at {time:.3} s (roll {roll:.3} rad, pitch {pitch:.3} rad); drive slower or start anew"
    )]
    RolledOver { time: f64, roll: f64, pitch: f64 },
    /// Trailer and cab would touch.
    #[error(
        "jack-knifed at {time:.3} s: articulation {articulation:.3} rad, beyond hitch.articulation_limit = {limit} \
         rad, where trailer and cab touch; drive slower, steer less, or start anew"
    )]
    JackKnifed { time: f64, articulation: f64, limit: f64 },
    #[error(
        "the state became infinite or not a number at {time:.3} s; check the parameters, and report the case"
    )]
    NotFinite { time: f64 },
}

/// Reasons for which a saved state could not be restored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "this is no saved state of this vehicle ({reason}); use one that the same vehicle with the same parameters saved"
)]
pub struct RestoreError {
    reason: String,
}

/// Steering and drive at an instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct StageInputs {
    /// Angle of the road wheels, rad.
    pub steer: f64,
    /// Acceleration of drive and brakes, m/s2.
    pub accel: f64,
}

/// The motion at an instant: signals that may be late, and those known at once.
#[derive(Debug, Clone, Copy)]
pub(super) struct SensedMotion<F, const S: usize> {
    pub signals: [f64; S],
    pub flow: F,
}

/// The equations of a vehicle with `N` states, `S` signals of its motion.
pub(super) trait Plant<const N: usize, const S: usize> {
    /// Forces and disturbances from road and earth at a place.
    type Environment: Copy;
    /// Forces at an instant, for outputs.
    type Flow: Copy + Default;
    /// Measured signals.
    type Output: Copy + Default;

    fn steering(&self) -> &SteeringChain;
    fn drive(&self) -> &DriveLine;
    fn effects(&self) -> &Effects;
    /// States with the reference point somewhere (m, m, rad), wheels rolling at a speed (m/s).
    fn placed(&self, x: f64, y: f64, yaw: f64, vx: f64) -> [f64; N];
    fn environment(&self, y: &[f64; N], road: Option<&Path>, station: f64) -> Self::Environment;
    /// The same wholly on one surface, driven straight along it.
    fn on(&self, surface: Surface) -> Self::Environment;
    /// Rates of all states at an instant, by lanes of a kind. No allocation. To be inlined always, as [`Work::with`].
    fn derivative_by<L: Lanes<Stored = [f64; FOUR]>>(
        &self,
        y: &[f64; N],
        stage: &StageInputs,
        environment: &Self::Environment,
        rates: &mut [f64; N],
        flow: &mut Self::Flow,
    );
    /// The same, by the widest lanes that there are.
    fn derivative(
        &self,
        y: &[f64; N],
        stage: &StageInputs,
        environment: &Self::Environment,
        rates: &mut [f64; N],
        flow: &mut Self::Flow,
    ) where
        Self: Sized,
    {
        compute(Evaluation { plant: self, y, stage, environment, rates, flow });
    }
    /// Checks that the model is within its range.
    fn check(&self, y: &[f64; N], time: f64) -> Result<(), PlantStepError>;
    /// The true motion signals of the first body alone.
    fn body_signals(&self, y: &[f64; N], rates: &[f64; N], flow: &Self::Flow) -> [f64; BODY_SIGNALS];
    /// The true signals; missing parts of the flow for outputs are added.
    fn signals(&self, y: &[f64; N], rates: &[f64; N], flow: &mut Self::Flow) -> [f64; S];
    /// The output from the (delayed) signals, and signals without latency.
    fn measure(&self, state: &State<N, S>, flow: &Self::Flow, delayed: &[f64; S]) -> Self::Output;
}

/// A plant's equations at an instant.
pub(super) struct Evaluation<'a, P: Plant<N, S>, const N: usize, const S: usize> {
    pub plant: &'a P,
    pub y: &'a [f64; N],
    pub stage: &'a StageInputs,
    pub environment: &'a P::Environment,
    pub rates: &'a mut [f64; N],
    pub flow: &'a mut P::Flow,
}

impl<P: Plant<N, S>, const N: usize, const S: usize> Work for Evaluation<'_, P, N, S> {
    type Given = ();

    #[inline(always)]
    fn with<L: Lanes<Stored = [f64; FOUR]>>(self) {
        self.plant.derivative_by::<L>(self.y, self.stage, self.environment, self.rates, self.flow);
    }
}

/// Everything that steps change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct State<const N: usize, const S: usize> {
    /// Since the vehicle was placed, s.
    pub time: f64,
    #[serde(with = "array")]
    pub y: [f64; N],
    pub steering: SteeringState,
    /// Acceleration by drive and brakes, m/s2.
    pub drive: f64,
    /// Arc length on the road, m.
    pub station: f64,
    pub sensors: Latency<S>,
}

impl<const N: usize, const S: usize> State<N, S> {
    fn placed<P: Plant<N, S>>(plant: &P, x: f64, y: f64, yaw: f64, vx: f64) -> Self {
        Self {
            time: 0.0,
            y: plant.placed(x, y, yaw, vx),
            steering: SteeringState::at_rest(plant.steering(), plant.steering().straight()),
            drive: 0.0,
            station: 0.0,
            sensors: Latency::new(plant.effects().sensor_delay),
        }
    }

    fn copy_from(&mut self, other: &Self) {
        self.time = other.time;
        self.y = other.y;
        self.steering.copy_from(&other.steering);
        self.drive = other.drive;
        self.station = other.station;
        self.sensors.copy_from(&other.sensors);
    }

    /// Room for all that may be under way.
    fn reserve<P: Plant<N, S>>(&mut self, plant: &P) {
        self.steering.reserve(plant.steering());
        self.sensors.reserve(plant.effects().sensor_delay);
    }
}

/// A vehicle under way.
pub(super) struct Stepper<P: Plant<N, S>, const N: usize, const S: usize> {
    pub plant: P,
    road: Option<Arc<Path>>,
    state: State<N, S>,
    /// The state before the step under way, for errors.
    before: State<N, S>,
    output: P::Output,
}

impl<P: Plant<N, S>, const N: usize, const S: usize> Stepper<P, N, S> {
    /// At rest at the origin, heading east.
    pub fn new(plant: P, road: Option<Arc<Path>>) -> Self {
        let state = State::placed(&plant, 0.0, 0.0, 0.0, 0.0);
        let mut stepper = Self { before: state.clone(), output: P::Output::default(), plant, road, state };
        stepper.before.reserve(&stepper.plant);
        stepper.place(0.0, 0.0, 0.0, 0.0);
        stepper
    }

    pub fn place(&mut self, x: f64, y: f64, yaw: f64, vx: f64) {
        self.state = State::placed(&self.plant, x, y, yaw, vx);
        self.state.station = self.road.as_ref().map_or(0.0, |road| road.project(x, y, yaw, None).station);
        let motion = self.observe();
        self.state.sensors.start(self.plant.effects().sensor_delay, motion.signals);
        self.sense(motion);
        self.before.copy_from(&self.state);
    }

    pub fn step(&mut self, input: &VehicleInput, step: f64) -> Result<(), PlantStepError> {
        self.step_ending(input, step, |_| false).map(|_| ())
    }

    /// The same, but ends after the first substep whose output is an end. Gives the time made.
    pub fn step_until(
        &mut self,
        input: &VehicleInput,
        step: f64,
        is_end: impl Fn(&P::Output) -> bool,
    ) -> Result<f64, PlantStepError> {
        self.step_ending(input, step, |stepper| {
            let motion = stepper.observe();
            stepper.sense(motion);
            is_end(&stepper.output)
        })
    }

    fn step_ending(
        &mut self,
        input: &VehicleInput,
        step: f64,
        ends: impl FnMut(&mut Self) -> bool,
    ) -> Result<f64, PlantStepError> {
        let time = self.state.time;
        for (name, value) in [("steer_cmd", input.steer_cmd), ("accel_cmd", input.accel_cmd)] {
            if !value.is_finite() {
                return Err(PlantStepError::InputNotFinite { name, value, time });
            }
        }
        if !(step > 0.0 && step <= LONGEST_STEP) {
            return Err(PlantStepError::StepLength { step, time });
        }
        self.before.copy_from(&self.state);
        let output = self.output;
        let result = self.advance(input, step, ends);
        match result {
            Ok((_, motion)) => self.sense(motion),
            Err(_) => {
                self.state.copy_from(&self.before);
                self.output = output;
            }
        }
        result.map(|(made, _)| made)
    }

    /// Gives the time made, and the motion then.
    fn advance(
        &mut self,
        input: &VehicleInput,
        step: f64,
        mut ends: impl FnMut(&mut Self) -> bool,
    ) -> Result<(f64, SensedMotion<P::Flow, S>), PlantStepError> {
        let start = self.state.time;
        self.state.steering.command(self.plant.steering(), start, input.steer_cmd);
        let asked = input.accel_cmd * self.plant.drive().gain;
        let delay = self.plant.effects().sensor_delay;
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
            if self.state.sensors.wants(delay, self.state.time) {
                let now = self.observe();
                self.state.sensors.push(self.state.time, now.signals);
                motion = (done == substeps).then_some(now);
            }
            if done < substeps && ends(self) {
                return Ok((done * h, self.observe()));
            }
        }
        Ok((step, motion.unwrap_or_else(|| self.observe())))
    }

    /// One step of the classic Runge-Kutta method.
    fn substep(&mut self, asked: f64, h: f64) {
        let environment = self.environment();
        let Self { plant, state, .. } = self;
        let chain = *plant.steering();
        let time = state.time;
        let stage = |state: &State<N, S>| StageInputs {
            steer: state.steering.road_wheel(&chain),
            accel: state.drive,
        };
        let begin = stage(state);
        state.steering.advance(&chain, time, 0.5 * h);
        state.drive = plant.drive().follow(state.drive, asked, 0.5 * h);
        let middle = stage(state);
        state.steering.advance(&chain, time + 0.5 * h, 0.5 * h);
        state.drive = plant.drive().follow(state.drive, asked, 0.5 * h);
        let end = stage(state);

        let y = state.y;
        let (mut k, mut sum, mut at) = ([0.0; N], [0.0; N], y);
        let mut flow = P::Flow::default();
        // One call for all four: the equations are long, and instructions want room in a cache, too.
        let stages = [(begin, 0.5 * h, 1.0), (middle, 0.5 * h, 2.0), (middle, h, 2.0), (end, h, 1.0)];
        for (stage, ahead, weight) in stages {
            plant.derivative(&at, &stage, &environment, &mut k, &mut flow);
            for i in 0..N {
                sum[i] += weight * k[i];
                at[i] = y[i] + ahead * k[i];
            }
        }
        for i in 0..N {
            state.y[i] = y[i] + h / 6.0 * sum[i];
        }
        if let Some(road) = &self.road {
            let (x, y, yaw) = (self.state.y[X], self.state.y[Y], self.state.y[YAW]);
            self.state.station = road.project(x, y, yaw, Some(self.state.station)).station;
        }
    }

    fn environment(&self) -> P::Environment {
        self.plant.environment(&self.state.y, self.road.as_deref(), self.state.station)
    }

    fn check(&self) -> Result<(), PlantStepError> {
        let (y, time) = (&self.state.y, self.state.time);
        if !y.iter().all(|value| value.is_finite()) {
            return Err(PlantStepError::NotFinite { time });
        }
        self.plant.check(y, time)
    }

    /// The true motion now.
    fn observe(&self) -> SensedMotion<P::Flow, S> {
        let steer = self.state.steering.road_wheel(self.plant.steering());
        let stage = StageInputs { steer, accel: self.state.drive };
        let (mut rates, mut flow) = ([0.0; N], P::Flow::default());
        self.plant.derivative(&self.state.y, &stage, &self.environment(), &mut rates, &mut flow);
        SensedMotion { signals: self.plant.signals(&self.state.y, &rates, &mut flow), flow }
    }

    /// Sets the output from the sensors' readings of the motion.
    fn sense(&mut self, motion: SensedMotion<P::Flow, S>) {
        let Self { plant, state, output, .. } = self;
        let delayed = state.sensors.read(plant.effects().sensor_delay, state.time, &motion.signals);
        *output = plant.measure(state, &motion.flow, &delayed);
    }

    pub fn output(&self) -> &P::Output {
        &self.output
    }

    pub fn time(&self) -> f64 {
        self.state.time
    }

    pub fn save(&self, bytes: &mut Vec<u8>) {
        let saved = postcard::to_allocvec(&self.state).unwrap_or_default();
        bytes.extend_from_slice(&saved);
    }

    /// A saved state.
    fn read(bytes: &[u8]) -> Result<State<N, S>, RestoreError> {
        let refuse = |reason: String| RestoreError { reason };
        let (state, rest) =
            postcard::take_from_bytes::<State<N, S>>(bytes).map_err(|error| refuse(error.to_string()))?;
        if !rest.is_empty() {
            return Err(refuse(format!("{} bytes too many", rest.len())));
        }
        check_finite(&state).map_err(|error| refuse(error.to_string()))?;
        Ok(state)
    }

    pub fn check_state(bytes: &[u8]) -> Result<(), RestoreError> {
        Self::read(bytes).map(|_| ())
    }

    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let mut state = Self::read(bytes)?;
        state.reserve(&self.plant);
        self.state = state;
        let motion = self.observe();
        self.sense(motion);
        Ok(())
    }
}

/// Rolled over, of one body.
pub(super) fn check_upright(roll: f64, pitch: f64, time: f64) -> Result<(), PlantStepError> {
    if roll.abs() > ROLLED_OVER || pitch.abs() > ROLLED_OVER {
        return Err(PlantStepError::RolledOver { time, roll, pitch });
    }
    Ok(())
}

/// The steps of a vehicle on tyres `T` that has a `stepper`, declared once for all of them.
macro_rules! vehicle {
    ($vehicle:ty, $output:ty, $stepper:ty) => {
        impl<T: TyreModel> $vehicle {
            /// Puts the vehicle at a place: position of its reference point in m, yaw in rad, speed in m/s. The wheels
            /// roll, the steering is straight, the time is 0, and nothing is under way.
            pub fn place(&mut self, x: f64, y: f64, yaw: f64, vx: f64) {
                self.stepper.place(x, y, yaw, vx);
            }

            /// Advances by `step` seconds with the input held. No allocation, no lock.
            ///
            /// # Errors
            /// See [`PlantStepError`]; the vehicle and its output are then as they were.
            pub fn step(&mut self, input: &VehicleInput, step: f64) -> Result<(), PlantStepError> {
                self.stepper.step(input, step)
            }

            /// The same, but ends at 1000 Hz as soon as an output is an end. Gives the time made, in s.
            ///
            /// # Errors
            /// As [`step`](Self::step).
            pub fn step_until(
                &mut self,
                input: &VehicleInput,
                step: f64,
                is_end: impl Fn(&$output) -> bool,
            ) -> Result<f64, PlantStepError> {
                self.stepper.step_until(input, step, is_end)
            }

            /// Measurements at the end of the last step.
            #[must_use]
            pub fn output(&self) -> &$output {
                self.stepper.output()
            }

            /// Time since the vehicle was placed, s.
            #[must_use]
            pub fn time(&self) -> f64 {
                self.stepper.time()
            }

            /// Appends all that steps change to `bytes`.
            pub fn save(&self, bytes: &mut Vec<u8>) {
                self.stepper.save(bytes);
            }

            /// Restores the output of [`save`](Self::save); the vehicle then goes on bit for bit.
            ///
            /// # Errors
            /// Bytes that are cut off, too many, or of something else. The vehicle is then as it was.
            pub fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
                self.stepper.restore(bytes)
            }

            /// Checks bytes that are to be restored later.
            ///
            /// # Errors
            /// Bytes that are cut off, too many, or of something else, and numbers that no drive can have.
            pub fn check_state(bytes: &[u8]) -> Result<(), RestoreError> {
                <$stepper>::check_state(bytes)
            }
        }
    };
}
pub(super) use vehicle;
