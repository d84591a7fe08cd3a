//! Margins that the linear loop must have: at each speed, with each vehicle and actuator of the ensemble.

use super::axis::ControllerNumbers;
use super::scenario::{Scenario, ScenarioError};
use crate::control::{ControlledParameters, LinearController, Margins, PredictionModelFor, SteeringLoop};
use crate::simulate::experiment::{Compared, NominalOf};

/// Speeds of the margins, m/s.
pub const SPEEDS: [f64; 8] = [2.0, 4.0, 6.0, 9.0, 13.0, 18.0, 24.0, 30.0];

/// Margins that are asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarginGoal {
    /// Delay margin, s.
    pub delay: f64,
    /// Gain margin, a factor.
    pub gain: f64,
    /// Largest speed of the margins, m/s; the speeds of a scenario if it is not finite.
    pub speed: f64,
}

/// Cost of a goal that is missed altogether, m.
const MISSED: f64 = 2.0;
/// Additional cost of an unstable loop, m for each unit of the spectral radius above 1.
const UNSTABLE: f64 = 20.0;

/// A scenario's steering loop, and its margins; none where it is unstable.
pub type LoopMargins<P, const S: usize, const C: usize> =
    (SteeringLoop<NominalOf<P, S, C>, S>, Option<Margins>);

/// The loop of a scenario at each speed, with its margins; none where it is unstable.
///
/// # Errors
/// Parameters out of range.
pub fn margins_over_speeds<P: Compared<S, C>, const S: usize, const C: usize>(
    scenario: &Scenario<P, S, C>,
    values: &ControllerNumbers,
    speeds: &[f64],
) -> Result<Vec<LoopMargins<P, S, C>>, ScenarioError> {
    let parameters = scenario.controller_with(values)?;
    // Before the drive has shown the actuator the prediction has the file's: margins are about that one.
    let (model, actuator) = match &scenario.model {
        PredictionModelFor::Adaptive(known) => (PredictionModelFor::Actuator(*known), *known),
        model => (model.clone(), scenario.actuator),
    };
    let controllers = LinearController::at_speeds(&parameters, model, speeds)?;
    let vehicle = parameters.vehicle.nominal();
    let loops = controllers.into_iter().map(|controller| {
        let of = SteeringLoop::new(controller, vehicle, actuator, parameters.mpc.min_model_speed)?;
        let margins = of.margins();
        Ok((of, margins))
    });
    loops.collect()
}

impl MarginGoal {
    /// Cost of a scenario's missing margins, m: that of the worst speed.
    pub(super) fn penalty<P: Compared<S, C>, const S: usize, const C: usize>(
        &self,
        scenario: &Scenario<P, S, C>,
        values: &ControllerNumbers,
    ) -> Result<f64, ScenarioError> {
        let speeds: Vec<f64> = SPEEDS.into_iter().filter(|speed| *speed <= self.speed).collect();
        let loops = margins_over_speeds(scenario, values, &speeds)?;
        Ok(loops.iter().map(|(of, margins)| self.missed(of, margins.as_ref())).fold(0.0, f64::max))
    }

    fn missed<V: crate::nominal::LateralVehicle<S>, const S: usize>(
        &self,
        of: &SteeringLoop<V, S>,
        margins: Option<&Margins>,
    ) -> f64 {
        let Some(margins) = margins else {
            return MISSED + UNSTABLE * (of.spectral_radius() - 1.0);
        };
        let short = |has: f64, goal: f64| if goal > 0.0 { (1.0 - has / goal).max(0.0) } else { 0.0 };
        MISSED * short(margins.delay, self.delay).max(short(margins.gain - 1.0, self.gain - 1.0))
    }
}
