//! Dominance: size of an effect's response relative to that of the background.

use super::fit::Fit;
use super::problem::Problem;
use super::rank::Ranking;
use super::replay::ReplayVehicle;

/// Response of the motion to an effect, over that to the background: the tolerances without any of the effects.
pub(super) fn dominance<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    at: &Fit,
    effect: usize,
) -> f64 {
    let without = |effects: &[usize]| problem.residual(&ranking.prior.without(problem, effects, &at.x));
    let (Some(gap), Some(background)) = (without(&[effect]), without(&at.free)) else {
        return f64::INFINITY;
    };
    ratio(distance(ranking, &gap, &at.gap), distance(ranking, &background, &ranking.neutral))
}

fn distance(ranking: &Ranking, a: &[f64], b: &[f64]) -> f64 {
    let apart: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    ranking.linear.square(&apart).sqrt()
}

fn ratio(own: f64, background: f64) -> f64 {
    own / background.max(0.05 * own).max(1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_background_of_nothing_leaves_a_bounded_ratio() {
        assert_eq!(ratio(3.0, 2.0), 1.5);
        assert!((ratio(3.0, 0.0) - 20.0).abs() < 1e-12);
        assert_eq!(ratio(0.0, 0.0), 0.0);
    }
}
