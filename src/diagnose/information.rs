//! Gaussian likelihood of all parameters at once, from one log: the summary that drives of a fleet are joined by.
//!
//! Around the fit `x` of the first hypothesis, with gap `e`, slopes `S`, weights `W` and temper `eta`, the likelihood is
//!
//! ```text
//!     log L(x + d) = g' d - d' G d / 2 + const,      G = eta S' W S,   g = eta S' W e
//! ```
//!
//! Errors of the model's form `f` have no meaning outside the log: they are marginalised with their prior `N(m, 1/P)`,
//!
//! ```text
//!     G <- G_kk - G_kf (G_ff + P)^-1 G_fk,     g <- g_k - G_kf (G_ff + P)^-1 (g_f - P (x_f - m)).
//! ```
//!
//! The result does not hold the prior of any parameter: summaries of several drives add up. Parameters are in physical units, as
//! differences from the simulator's value, so that drives with other signals and rates agree on them.

use super::fit::{FREE, Fit, Linearisation, Prior};
use super::problem::Problem;
use super::replay::ReplayVehicle;
use super::report::{Information, InformedParameter};
use nalgebra::{DMatrix, DVector};

/// Summary of a log around a fit; None where slopes are no numbers.
#[must_use]
pub fn information<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    local: &Linearisation,
    fit: &Fit,
    temper: f64,
) -> Option<Information> {
    let all = 0..problem.uncertain.len();
    let (form, kept): (Vec<usize>, Vec<usize>) = all.partition(|&i| problem.uncertain[i].is_form());
    let gradient = local.gradient(&fit.gap);
    let gram = |rows: &[usize], columns: &[usize]| {
        DMatrix::from_fn(rows.len(), columns.len(), |a, b| temper * local.gram[(rows[a], columns[b])])
    };
    let pulls = |of: &[usize]| DVector::from_iterator(of.len(), of.iter().map(|&i| temper * gradient[i]));
    let off = prior.off(&fit.x);
    let mut of_form = gram(&form, &form);
    let mut form_pulls = pulls(&form);
    for (a, &i) in form.iter().enumerate() {
        let precision = 1.0 / prior.covariance[(i, i)].max(f64::MIN_POSITIVE);
        of_form[(a, a)] += precision;
        form_pulls[a] -= precision * off[i];
    }
    let across = gram(&kept, &form);
    let factor = of_form.cholesky()?;
    let precision = gram(&kept, &kept) - &across * factor.solve(&across.transpose());
    let pulls = pulls(&kept) - &across * factor.solve(&form_pulls);
    let units: Vec<f64> = kept.iter().map(|&i| problem.uncertain[i].step_of_one(problem.vehicle)).collect();
    let parameters = kept.iter().zip(&units).map(|(&i, unit)| {
        let uncertain = &problem.uncertain[i];
        let main = (0..problem.uncertain.len()).find_map(|main| {
            let (companion, deviation) = problem.companion(main)?;
            (companion == i).then(|| (problem.uncertain[main].parameter(), deviation))
        });
        let change = if uncertain.is_candidate() { FREE } else { main.as_ref().map_or(0.0, |it| it.1) };
        InformedParameter {
            name: uncertain.parameter(),
            given: uncertain.adjusted(0.0, problem.vehicle).0,
            unit: uncertain.symbol::<V>(),
            reciprocal: uncertain.is_reciprocal(),
            tolerance: unit * prior.covariance[(i, i)].max(0.0).sqrt(),
            change: unit * change,
            least: (change > 0.0).then_some(unit * uncertain.named_least),
            greatest: (change > 0.0).then_some(unit * uncertain.greatest),
            goes_with: main.map(|it| it.0),
            value: unit * fit.x[i],
        }
    });
    let lower = (0..kept.len()).flat_map(|a| (0..=a).map(move |b| (a, b)));
    let found = Information {
        parameters: parameters.collect(),
        precision: lower.map(|(a, b)| precision[(a, b)] / (units[a] * units[b])).collect(),
        gradient: pulls.iter().zip(&units).map(|(pull, unit)| pull / unit).collect(),
        temper,
    };
    found.precision.iter().chain(&found.gradient).all(|value| value.is_finite()).then_some(found)
}
