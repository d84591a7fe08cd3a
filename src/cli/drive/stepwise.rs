//! A controller of any kind of vehicle behind one interface, for a program that closes the loop itself.

use crate::control::{
    ControlledParameters, ControllerFor, KnownActuator, Measurement, StepError, StepReport,
};

/// A controller that is called step by step.
pub trait Stepwise: Send {
    /// One control step, at a time in s; without, a sample time after the one before.
    ///
    /// # Errors
    /// A first measurement that is not finite.
    fn step(&mut self, time: Option<f64>, measured: &Measurement) -> Result<StepReport, StepError>;

    /// Sample time, s.
    fn sample_time(&self) -> f64;

    /// Start of the road and planned speed there: x, y, yaw, speed.
    fn start(&self) -> [f64; 4];

    /// Length of the road, m.
    fn length(&self) -> f64;

    /// Dead time and lag of the steering actuator, and the uncertainty of their sum, as the drive has shown them, s.
    fn actuator(&self) -> Option<[f64; 3]>;
}

impl<G: ControlledParameters<S>, const S: usize> Stepwise for ControllerFor<G, S>
where
    ControllerFor<G, S>: Send,
{
    fn step(&mut self, time: Option<f64>, measured: &Measurement) -> Result<StepReport, StepError> {
        match time {
            Some(time) => self.step_at(time, measured).copied(),
            None => ControllerFor::step(self, measured).copied(),
        }
    }

    fn sample_time(&self) -> f64 {
        self.parameters().mpc.sample_time
    }

    fn start(&self) -> [f64; 4] {
        let begin = self.path().at(0.0);
        [begin.x, begin.y, begin.yaw, self.start_speed()]
    }

    fn length(&self) -> f64 {
        self.path().length()
    }

    fn actuator(&self) -> Option<[f64; 3]> {
        let KnownActuator { actuator, spread, .. } = self.known_actuator()?;
        Some([actuator.dead_time, actuator.time_constant, spread])
    }
}
