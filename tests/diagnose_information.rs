//! The summary of a log: with priors it says what the diagnosis says.

use crate::diagnose::{found, log, singles};
use nalgebra::{DMatrix, DVector};
use rfl_mpc::diagnose::Information;

/// Precision matrix of a summary.
fn precision(of: &Information) -> DMatrix<f64> {
    let count = of.parameters.len();
    assert_eq!(of.precision.len(), count * (count + 1) / 2);
    DMatrix::from_fn(count, count, |a, b| of.precision[a.max(b) * (a.max(b) + 1) / 2 + a.min(b)])
}

/// Difference of an effect from its neutral value and its standard deviation, by a summary and the priors that it tells:
/// tolerances, and for the effect the size of what is named.
fn estimate(of: &Information, effect: &str) -> (f64, f64) {
    let parameters = &of.parameters;
    let prior = |place: usize| {
        let it = &parameters[place];
        it.tolerance.powi(2) + if it.name == effect { it.change.powi(2) } else { 0.0 }
    };
    let free: Vec<usize> = (0..parameters.len()).filter(|&place| prior(place) > 0.0).collect();
    let matrix = precision(of);
    let at = DVector::from_iterator(parameters.len(), parameters.iter().map(|it| it.value));
    let shift = DVector::from_column_slice(&of.gradient) + &matrix * at;
    let normal = DMatrix::from_fn(free.len(), free.len(), |a, b| {
        matrix[(free[a], free[b])] + if a == b { 1.0 / prior(free[a]) } else { 0.0 }
    });
    let right = DVector::from_iterator(free.len(), free.iter().map(|&i| shift[i]));
    let covariance = normal.cholesky().expect("a precision is positive").inverse();
    let place = free.iter().position(|&i| parameters[i].name == effect).expect("the effect is a parameter");
    ((&covariance * right)[place], covariance[(place, place)].sqrt())
}

#[test]
fn a_summary_with_its_priors_says_what_the_diagnosis_says() {
    let report = found(&log(3, &[("steer_offset", 0.02)]), &singles()).report;
    let named = &report.verdict.effects[0];
    assert_eq!(named.id, "steer_offset", "{}", report.verdict.summary);
    let summary = report.information.as_ref().expect("there is a summary");
    let (value, deviation) = estimate(summary, "effect.steer_offset");
    assert!((value - named.value).abs() < 0.5 * deviation, "{value} {} {deviation}", named.value);
    assert!((value - 0.02).abs() < 4.0 * deviation, "{value} {deviation}");
    // Errors of the model's form are marginalised; what is left is a likelihood.
    assert!(summary.parameters.iter().all(|it| !it.name.starts_with("form.")));
    let least = precision(summary).symmetric_eigenvalues().min();
    assert!(least > -1e-6 * precision(summary).symmetric_eigenvalues().max(), "{least}");
}
