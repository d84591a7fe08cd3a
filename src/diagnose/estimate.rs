//! The value of a fitted effect, and its uncertainty.

use super::fit::Fit;
use super::problem::Problem;
use super::replay::ReplayVehicle;
use nalgebra::DMatrix;

/// Standard deviations from nothing beyond which it is no matter.
const FAR: f64 = 6.0;

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

/// Ends of a 95 % interval of a coordinate with an estimate `x` and a standard deviation, for an effect that is there: on its side
/// of `nothing`, the coordinate without it,
///
/// ```text
/// x ~ N(estimate, deviation^2) | x > nothing        or x < nothing, on the estimate's side: a truncated normal's quantiles
/// ```
///
/// That it is there is what its probability says; an interval with nothing in it would say it once more, and differently.
/// Far from nothing it is `x -+ 1.96 deviation`.
#[must_use]
pub fn interval(x: f64, deviation: f64, nothing: f64) -> [f64; 2] {
    let distance = (x - nothing).abs() / deviation;
    // A value that is known exactly has no distance.
    if distance >= FAR || distance.is_nan() {
        return [-1.96, 1.96].map(|quantile| x + quantile * deviation);
    }
    let side = if x < nothing { -1.0 } else { 1.0 };
    // The distribution of z, the distance from the estimate outwards, from -distance on.
    let outside = upper_tail(distance);
    let ends = [0.975, 0.025].map(|above| {
        let z = quantile_of_upper_tail(above * (1.0 - outside));
        x + side * z * deviation
    });
    if side > 0.0 { ends } else { [ends[1], ends[0]] }
}

/// Probability that a normal variable is beyond `z` standard deviations.
fn upper_tail(z: f64) -> f64 {
    0.5 * libm::erfc(z / std::f64::consts::SQRT_2)
}

/// The `z` beyond which a normal variable is with a probability, by bisection.
fn quantile_of_upper_tail(probability: f64) -> f64 {
    let (mut low, mut high) = (-2.0 * FAR, 2.0 * FAR);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if upper_tail(middle) > probability { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_far_from_nothing_is_that_of_a_normal() {
        let [low, high] = interval(2.0, 0.1, 0.0);
        assert!((low - 1.804).abs() < 1e-9 && (high - 2.196).abs() < 1e-9);
        // And it has no step where nothing comes near.
        let [near, far] = [FAR - 1e-9, FAR + 1e-9].map(|x| interval(x, 1.0, 0.0)[0]);
        assert!((near - far).abs() < 1e-3, "{near}, {far}");
    }

    #[test]
    fn an_interval_near_nothing_holds_95_percent_of_what_is_not_nothing() {
        for (x, deviation, nothing) in [(0.5, 1.0, 0.0), (-0.2, 0.4, 0.1), (0.83, 0.18, 1.0), (1.2, 0.1, 1.0)]
        {
            let [low, high] = interval(x, deviation, nothing);
            assert!(low < high && (low - nothing) * (high - nothing) > 0.0, "{low}, {high}");
            let above = |at: f64| upper_tail((at - x) / deviation);
            let there = if x > nothing { above(nothing) } else { 1.0 - above(nothing) };
            assert!(((above(low) - above(high)) / there - 0.95).abs() < 1e-9);
        }
        // Of an estimate of nothing a half-normal's.
        let [low, high] = interval(1e-12, 1.0, 0.0);
        assert!((low - 0.0313).abs() < 1e-3 && (high - 2.2414).abs() < 1e-3, "{low}, {high}");
    }
}
