//! What a named effect does a little otherwise in another formulation is no further effect.
//!
//! Errors of the model's form (`form.rs`) are of the whole motion. An effect has its own: with `g_c(t)` what it does to a
//! channel, it may come out larger or later there, and larger in all channels with what the drive does, `z_k(t)`, standardised:
//!
//! ```text
//!     d_c(t) = x_c g_c - y_c dg_c/dt + sum_k w_k g_c z_k(t),      x ~ N(0, SIZE^2), y ~ N(0, LATE^2), w ~ N(0, VARY^2)
//! ```
//!
//! What these explain of a gap is no evidence: `J` of two candidates, with a further effect and without, is compared with them
//! marginalised.

use super::constancy::{Cause, Columns, following};
use super::fit::Fit;
use super::problem::Problem;
use super::rank::{Ranking, expected};
use super::replay::ReplayVehicle;

/// Standard deviations: size of what an effect does to a channel, as a share; lateness, s; change with one standard deviation
/// of what the drive does, as a share.
const SIZE: f64 = 0.05;
const LATE: f64 = 0.01;
const VARY: f64 = 0.05;

/// Errors of what the effects of a fit do.
pub struct Echo<'a> {
    of: &'a Fit,
    /// Each as large as one standard deviation.
    columns: Vec<Vec<f64>>,
    /// What they explain beyond the fit itself.
    own: f64,
}

impl<'a> Echo<'a> {
    /// Of the effects of a fit.
    #[must_use]
    pub fn of<V: ReplayVehicle>(
        problem: &Problem<V>,
        ranking: &Ranking,
        causes: &[Columns],
        of: &'a Fit,
    ) -> Self {
        let mut columns = Vec::new();
        for &effect in &of.freed {
            let Some(without) = problem.residual(&ranking.prior.without(problem, &[effect], &of.x)) else {
                continue;
            };
            let does: Vec<f64> = without.iter().zip(&of.gap).map(|(without, with)| without - with).collect();
            columns.extend(by_channel(problem, &does));
            let follows = causes.iter().filter(|(cause, _)| *cause != Cause::Time).flat_map(|(_, z)| z);
            columns.extend(follows.map(|z| following(problem, &does, z, VARY)));
        }
        let own = explained(problem, ranking, of, &columns);
        Self { of, columns, own }
    }

    /// What a fit with a further effect explains more, these errors marginalised in both.
    #[must_use]
    pub fn evidence<V: ReplayVehicle>(&self, problem: &Problem<V>, ranking: &Ranking, more: &Fit) -> f64 {
        self.of.cost - self.own - (more.cost - explained(problem, ranking, more, &self.columns))
    }
}

/// Larger, and later, in each channel that it moves.
fn by_channel<V: ReplayVehicle>(problem: &Problem<V>, does: &[f64]) -> Vec<Vec<f64>> {
    let (every, rows) = (problem.filter.every, &problem.rows);
    let mut columns = Vec::new();
    for (_, block) in &problem.blocks {
        let own = &does[block.clone()];
        let column = |values: &dyn Fn(usize) -> f64| {
            let mut column = vec![0.0; does.len()];
            column[block.clone()].iter_mut().enumerate().for_each(|(k, value)| *value = values(k));
            column
        };
        let slope = |k: usize| {
            let (a, b) = (k.max(1) - 1, (k + 1).min(own.len() - 1));
            // None over a gap of the log.
            let apart = (rows[b] - rows[a]) as f64 * problem.drive.step;
            if b > a && rows[b] - rows[a] == (b - a) * every { (own[b] - own[a]) / apart } else { 0.0 }
        };
        columns.push(column(&|k| SIZE * own[k]));
        columns.push(column(&|k| -LATE * slope(k)));
    }
    columns
}

fn explained<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    fit: &Fit,
    columns: &[Vec<f64>],
) -> f64 {
    let linear = ranking.linear.with(&fit.of_freed());
    let precision = ranking.prior.freed(problem, &fit.freed);
    let Some(background) = linear.marginalised(&precision) else { return 0.0 };
    let gap = background.reduced(expected(&linear, &ranking.prior, fit));
    background.explained(&gap, columns.iter().map(Vec::as_slice), 1.0).map_or(0.0, |(explained, _)| explained)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::constancy::causes;
    use crate::diagnose::fit::Prior;
    use crate::diagnose::rank::rank;
    use crate::diagnose::replay::{Drive, neutral};
    use crate::diagnose::simulated::{Conditions, drive};
    use crate::vehicle::{TruckEffects, builtin};

    /// A log of a ratio, whose gap is made larger by an error of what the ratio does, and by another effect.
    #[test]
    fn an_error_of_what_an_effect_does_is_no_evidence_and_another_effect_is() {
        let car = builtin("c_class").unwrap();
        let mut effects = TruckEffects::default();
        effects.vehicle.steer_gain = 1.2;
        let conditions = Conditions { seed: 3, duration: 40.0, step: 0.02, ..Conditions::default() };
        let log = drive(&car, &effects, &conditions).unwrap();
        let drive = Drive::new(&log, false);
        let correction = neutral(&drive, &car).unwrap();
        let problem = Problem::new(&drive, &car, &correction, &[], 0);
        let ranking = rank(&problem, Prior::of(&problem), &|_, _| false, &|_, _| {}).unwrap();
        let causes = causes(&problem);
        let gain = problem.find("steer_gain").unwrap();
        let fit = ranking.singles.iter().find(|fit| fit.freed == [gain]).unwrap();
        let echo = Echo::of(&problem, &ranking, &causes, fit);
        let channels = problem.blocks.len();
        assert_eq!(echo.columns.len(), 2 * channels + 5);

        // A further effect explains so many times a column: all that it adds, and that beyond errors of the ratio.
        let linear = ranking.linear.with(&fit.of_freed());
        let precision = ranking.prior.freed(&problem, &fit.freed);
        let least = |gap: &[f64]| ranking.prior.step(&linear, &fit.x, gap, &precision).cost;
        let adds = |column: &[f64], times: f64| {
            let gap: Vec<f64> =
                fit.gap.iter().zip(column).map(|(gap, column)| gap + times * column).collect();
            let before = Fit { cost: least(&gap), gap, ..fit.clone() };
            let after = Fit { cost: least(&fit.gap), ..fit.clone() };
            let own = explained(&problem, &ranking, &before, &echo.columns);
            let of_before = Echo { of: &before, columns: echo.columns.clone(), own };
            (before.cost - after.cost, of_before.evidence(&problem, &ranking, &after))
        };
        // Two standard deviations off cost no more than 4, and would have been evidence of more than 100.
        let of_errors: Vec<(f64, f64)> = echo.columns.iter().map(|column| adds(column, 2.0)).collect();
        assert!(of_errors.iter().all(|(_, beyond)| *beyond < 4.2), "{of_errors:?}");
        assert!(of_errors.iter().any(|(all, _)| *all > 100.0), "{of_errors:?}");
        for id in ["steer_offset", "yaw_rate_bias", "wind_y", "steer_delay"] {
            let (all, beyond) = adds(&ranking.linear.slopes[problem.find(id).unwrap()], 3.0);
            assert!(all > 30.0 && beyond > 0.95 * all, "{id}: {all} {beyond}");
        }
    }
}
