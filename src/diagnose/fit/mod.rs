//! Fits with the tolerances marginalised.
//!
//! Over coordinates `x` with prior precisions `P` (tolerances; nearly zero for free effects), around a point with gap
//! `e` and slopes `S`, the best step is
//!
//! ```text
//!     J = min over d  (e - S d)' W (e - S d) + (x + d)' P (x + d),      (S' W S + P) d = S' W e - P x
//! ```
//!
//! which equals `e' (W^-1 + U U')^-1 e` with `U = S P^-1/2` at `x = 0` (Woodbury), at the price of a small matrix.
//!
//! | file | idea |
//! |---|---|
//! | `prior.rs` | the prior `P`, and what is left of it where some are free |
//! | `linearisation.rs` | the linear problem around a point |

mod linearisation;
mod prior;

pub use linearisation::{
    Converged, Explained, LinearSolution, Linearisation, Marginalised, ReducedGap, SlopeColumn,
};
pub(super) use prior::FREE;
pub use prior::{Precision, Prior};

use super::problem::Problem;
use super::replay::ReplayVehicle;
use std::borrow::Cow;
use std::sync::Arc;

/// Maximum Gauss-Newton iterations.
const STEPS: usize = 6;
/// Tries of each kind: of a step's own length or a shorter one, and then with damping.
const TRIES: usize = 4;
/// Bounds of a shorter step's length, as shares: a parabola is rough far away.
const SHORTER: f64 = 0.4;
const SHORTEST: f64 = 0.1;

/// Damping of a step at the first try, and its factor at each further try; after a gain it falls by the same factor.
const HELD: f64 = 1.0;
const MORE: f64 = 10.0;
/// Promise of a damped step that is worth a try, in gains that end a search.
const WORTH: f64 = 10.0;

/// A gain that ends a search.
fn enough(cost: f64) -> f64 {
    0.05 + 1e-4 * cost
}

/// A point that was fitted.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Places of the uncertain parameters that were free.
    pub free: Vec<usize>,
    /// Coordinates.
    pub x: Vec<f64>,
    /// Gap there.
    pub gap: Vec<f64>,
    /// Remaining cost: weighted square of the gap, plus the penalty of the tolerances.
    pub cost: f64,
    /// Slopes over the free uncertain parameters and their companions, taken last.
    pub columns: Vec<SlopeColumn>,
    /// Coordinates at which the slopes were taken.
    pub columns_at: Vec<f64>,
}

impl Fit {
    /// The slopes over what was free.
    #[must_use]
    pub fn of_free(&self) -> Vec<SlopeColumn> {
        self.columns.iter().filter(|(i, _)| self.free.contains(i)).cloned().collect()
    }
}

/// Starting point of a fit, with its known gap and slopes.
#[derive(Clone)]
pub struct Start<'a> {
    /// Coordinates.
    pub x: Cow<'a, [f64]>,
    /// The gap there.
    pub gap: Option<Cow<'a, [f64]>>,
    /// Some slopes, and the coordinates at which they were taken.
    pub slopes: Option<(&'a [f64], Cow<'a, [SlopeColumn]>)>,
}

impl<'a> From<&'a Fit> for Start<'a> {
    fn from(fit: &'a Fit) -> Self {
        Self {
            x: (&fit.x).into(),
            gap: Some((&fit.gap).into()),
            slopes: Some((&fit.columns_at, (&fit.columns).into())),
        }
    }
}

impl<'a> From<&'a Vec<f64>> for Start<'a> {
    fn from(x: &'a Vec<f64>) -> Self {
        Self { x: x.into(), gap: None, slopes: None }
    }
}

/// The length to try after a whole step that costs `rise` more than none; None where no length is worth it. A parabola
/// gives the best length. The step `promised` is its slope:
///
/// ```text
///     J(l) = J(0) - 2 promised l + (rise + 2 promised) l^2,    l* = promised / (rise + 2 promised),    J(l*) = J(0) - promised l*
/// ```
fn shorter(promised: f64, rise: f64, worth: f64) -> Option<f64> {
    let least = promised / (rise + 2.0 * promised);
    (promised > 0.0 && promised * least >= worth).then(|| least.clamp(SHORTEST, SHORTER))
}

/// Fits with some uncertain parameters free, from a point, with slopes `linear` for the background. Slopes of free uncertain parameters are taken
/// anew at each step. A step that raises the cost is shortened, then damped more and more. With many coordinates that
/// act alike, an undamped step leaves the range of its slopes, and no length of it gains.
#[must_use]
pub fn fit<'a, V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    free: &[usize],
    start: impl Into<Start<'a>>,
    steps: usize,
) -> Option<Fit> {
    let start = start.into();
    let precision = prior.free(problem, free);
    let own = problem.with_companions(free);
    let within = |x: &[f64]| -> Vec<f64> {
        let bound = |(i, x): (usize, &f64)| problem.uncertain[i].within(*x, free.contains(&i));
        x.iter().enumerate().map(bound).collect()
    };
    let mut x = within(&start.x);
    let mut gap = match start.gap {
        Some(known) if x == *start.x => known.into_owned(),
        _ => problem.residual(&x)?,
    };
    let mut cost = linear.square(&gap) + precision.penalty(&prior.off(&x));
    let mut known = start
        .slopes
        .filter(|(at, _)| problem.is_near(&x, at))
        .map_or_else(Vec::new, |(_, it)| it.into_owned());
    let mut columns: Vec<SlopeColumn> = Vec::new();
    let mut columns_at = x.clone();
    let mut damping = 0.0;
    for _ in 0..steps.clamp(1, STEPS) {
        let column = |&i: &usize| {
            let there = known.iter().find(|(j, _)| *j == i);
            there.cloned().unwrap_or_else(|| (i, Arc::new(problem.slope(&x, &gap, i))))
        };
        columns = own.iter().map(column).collect();
        columns_at.clone_from(&x);
        known.clear();
        let local = linear.with(&columns);
        let off = prior.off(&x);
        let step_by = |damping: f64| local.damped(&off, &gap, &precision, damping);
        let (mut step, mut length) = (step_by(damping), 1.0);
        let mut better = None;
        for tries in 1..=TRIES {
            let there: Vec<f64> = x.iter().zip(&step.change).map(|(x, change)| x + length * change).collect();
            let there = within(&there);
            let mut rise = f64::INFINITY;
            if let Some(new) = problem.residual(&there) {
                let new_cost = linear.square(&new) + precision.penalty(&prior.off(&there));
                if new_cost < cost {
                    better = Some((there, new, new_cost));
                    break;
                }
                rise = new_cost - cost;
            }
            let whole = damping == 0.0 && tries == 1;
            if let Some(least) = shorter(cost - step.cost, rise, enough(cost)).filter(|_| whole) {
                length = least;
                continue;
            }
            if tries == TRIES {
                break;
            }
            damping = (MORE * damping).max(HELD);
            (step, length) = (step_by(damping), 1.0);
            if cost - step.cost < WORTH * enough(cost) {
                break;
            }
        }
        damping = if damping > HELD { damping / MORE } else { 0.0 };
        let Some((there, new, new_cost)) = better else { break };
        let gained = cost - new_cost;
        (x, gap, cost) = (there, new, new_cost);
        if gained < enough(cost) {
            break;
        }
    }
    Some(Fit { free: free.to_vec(), x, gap, cost, columns, columns_at })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_that_costs_more_is_made_as_short_as_a_parabola_says() {
        // J = -4 l + 10 l^2 has its least, -0.4, at 0.2.
        let found = shorter(2.0, 6.0, 0.1);
        assert!((found.unwrap() - 0.2).abs() < 1e-12);
        assert_eq!(shorter(2.0, 6.0, 0.41), None);
    }

    #[test]
    fn no_try_is_much_shorter_than_the_step_nor_as_long() {
        assert_eq!(shorter(50.0, 9900.0, 0.1), Some(SHORTEST));
        assert_eq!(shorter(50.0, 1.0, 0.1), Some(SHORTER));
        assert_eq!(shorter(50.0, f64::INFINITY, 0.1), None);
        assert_eq!(shorter(f64::NAN, f64::NAN, 0.1), None);
    }
}
