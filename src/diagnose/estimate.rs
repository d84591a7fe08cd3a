//! The value of a fitted effect, and its uncertainty.

use super::fit::Fit;
use super::problem::Problem;
use super::replay::ReplayVehicle;
use nalgebra::DMatrix;

/// A wind as a log without a compass shows it.
#[derive(Clone, Copy)]
pub struct Wind {
    /// In units of the coordinate.
    pub speed: f64,
    /// Sine and cosine of its direction, by the heading at the log's start.
    pub to: (f64, f64),
    /// The uncertain parameter of its other component.
    pub across: usize,
}

/// The wind of an uncertain parameter of a fit, if it is not one component alone.
#[must_use]
pub fn wind_of<V: ReplayVehicle>(problem: &Problem<V>, fit: &Fit, uncertain: usize) -> Option<Wind> {
    let (across, _) = problem.companion(uncertain).filter(|_| problem.uncertain[uncertain].id == "wind_x")?;
    let (sin, cos) = fit.x[across].atan2(fit.x[uncertain]).sin_cos();
    Some(Wind { speed: fit.x[across].hypot(fit.x[uncertain]), to: (sin, cos), across })
}

/// Coordinate of a free effect and its standard deviation, from the covariance of all; of a wind without a compass, its strength.
#[must_use]
pub fn estimate<V: ReplayVehicle>(
    problem: &Problem<V>,
    fit: &Fit,
    covariance: &DMatrix<f64>,
    uncertain: usize,
) -> (f64, f64) {
    let (x, variance) = match wind_of(problem, fit, uncertain) {
        Some(Wind { speed, to: (sin, cos), across }) => {
            let both =
                cos * cos * covariance[(uncertain, uncertain)] + sin * sin * covariance[(across, across)];
            (speed, both + 2.0 * sin * cos * covariance[(uncertain, across)])
        }
        None => (fit.x[uncertain], covariance[(uncertain, uncertain)]),
    };
    (x, variance.max(0.0).sqrt())
}

/// Half of a 95 % interval; `wider` is the contribution of the model's form to a fit's own standard deviation.
#[must_use]
pub fn half_width(wider: f64, deviation: f64) -> f64 {
    1.96 * wider * deviation
}
