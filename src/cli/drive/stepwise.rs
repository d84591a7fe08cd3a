//! A controller of any kind of vehicle behind one interface, for a program that closes the loop itself.

use crate::control::{
    ControlledParameters, ControllerError, ControllerFor, KnownActuator, Measurement, PredictionModelFor,
    StepError, StepReport,
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

    /// The steering actuator as the drive has shown it.
    fn actuator(&self) -> Option<KnownActuator>;

    /// A controller of its own in the same state: its steps are those that this one would make.
    ///
    /// # Errors
    /// As of making one.
    fn copied(&self) -> Result<Box<dyn Stepwise>, ControllerError>;
}

/// A controller, and the model that a copy of it is made with.
pub(super) struct Steps<G: ControlledParameters<S>, const S: usize> {
    pub controller: ControllerFor<G, S>,
    pub model: PredictionModelFor<G::Vehicle, S>,
}

impl<G: ControlledParameters<S>, const S: usize> Stepwise for Steps<G, S>
where
    Self: Send + 'static,
{
    fn step(&mut self, time: Option<f64>, measured: &Measurement) -> Result<StepReport, StepError> {
        match time {
            Some(time) => self.controller.step_at(time, measured).copied(),
            None => self.controller.step(measured).copied(),
        }
    }

    fn sample_time(&self) -> f64 {
        self.controller.parameters().mpc.sample_time
    }

    fn start(&self) -> [f64; 4] {
        let begin = self.controller.path().at(0.0);
        [begin.x, begin.y, begin.yaw, self.controller.start_speed()]
    }

    fn length(&self) -> f64 {
        self.controller.path().length()
    }

    fn actuator(&self) -> Option<KnownActuator> {
        self.controller.known_actuator()
    }

    fn copied(&self) -> Result<Box<dyn Stepwise>, ControllerError> {
        let (parameters, path) = (*self.controller.parameters(), self.controller.path().clone());
        let mut controller = ControllerFor::predicting_with(parameters, path, self.model.clone())?;
        // One of the same parameters and model takes it.
        let refused = controller.restore(self.controller.state().clone());
        debug_assert!(refused.is_none(), "the state of a controller that was made alike");
        Ok(Box::new(Self { controller, model: self.model.clone() }))
    }
}
