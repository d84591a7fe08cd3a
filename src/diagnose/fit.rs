//! Fits with the tolerances marginalised.
//!
//! Over coordinates `x` with prior precisions `P` (tolerances; next to none for what is freed), around a point with gap
//! `e` and slopes `S` the best step is
//!
//! ```text
//!     J = min over d  (e - S d)' W (e - S d) + (x + d)' P (x + d),      (S' W S + P) d = S' W e - P x
//! ```
//!
//! which equals `e' (W^-1 + U U')^-1 e` with `U = S P^-1/2` at `x = 0` (Woodbury), at the price of a small matrix.

use super::problem::Problem;
use super::replay::ReplayVehicle;
use nalgebra::{DMatrix, DVector};

/// Standard deviation of the coordinate of what is freed: says next to nothing.
const FREED: f64 = 12.0;
/// Steps of Gauss and Newton.
const STEPS: usize = 6;

/// Slopes at a point with their weighted products.
#[derive(Clone)]
pub struct Linear {
    /// Columns, one for each knob.
    pub slopes: Vec<Vec<f64>>,
    /// Weight of each residual.
    pub weights: Vec<f64>,
    gram: DMatrix<f64>,
}

/// A solution of the linear problem.
pub struct Step {
    /// Change of the coordinates.
    pub change: Vec<f64>,
    /// What is left.
    pub cost: f64,
}

fn dot(a: &[f64], b: &[f64], weights: &[f64]) -> f64 {
    a.iter().zip(b).zip(weights).map(|((a, b), w)| a * b * w).sum()
}

impl Linear {
    /// From slopes and weights.
    #[must_use]
    pub fn new(slopes: Vec<Vec<f64>>, weights: Vec<f64>) -> Self {
        let count = slopes.len();
        let mut gram = DMatrix::zeros(count, count);
        for i in 0..count {
            for j in 0..=i {
                let value = dot(&slopes[i], &slopes[j], &weights);
                gram[(i, j)] = value;
                gram[(j, i)] = value;
            }
        }
        Self { slopes, weights, gram }
    }

    /// The same with other slopes of some knobs.
    #[must_use]
    pub fn with(&self, columns: &[(usize, &[f64])]) -> Self {
        let mut other = self.clone();
        for &(i, column) in columns {
            other.slopes[i] = column.to_vec();
        }
        for &(i, _) in columns {
            for j in 0..other.slopes.len() {
                let value = dot(&other.slopes[i], &other.slopes[j], &self.weights);
                other.gram[(i, j)] = value;
                other.gram[(j, i)] = value;
            }
        }
        other
    }

    /// The weighted square of a gap.
    #[must_use]
    pub fn square(&self, gap: &[f64]) -> f64 {
        dot(gap, gap, &self.weights)
    }

    /// The step from `x` with gap `gap`; `precision` over knobs (infinite: fixed).
    #[must_use]
    pub fn step(&self, x: &[f64], gap: &[f64], precision: &[f64]) -> Step {
        let free: Vec<usize> = (0..x.len()).filter(|&i| precision[i].is_finite()).collect();
        let prior: f64 = free.iter().map(|&i| precision[i] * x[i] * x[i]).sum();
        let cost = self.square(gap) + prior;
        let right = DVector::from_iterator(
            free.len(),
            free.iter().map(|&i| dot(&self.slopes[i], gap, &self.weights) - precision[i] * x[i]),
        );
        let mut change = vec![0.0; x.len()];
        let Some(solved) = self.normal(&free, precision).cholesky().map(|c| c.solve(&right)) else {
            return Step { change, cost };
        };
        for (&i, &value) in free.iter().zip(solved.iter()) {
            change[i] = value;
        }
        Step { change, cost: cost - right.dot(&solved) }
    }

    fn normal(&self, free: &[usize], precision: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(free.len(), free.len(), |a, b| {
            let (i, j) = (free[a], free[b]);
            // A hair more on the diagonal keeps what the log does not show regular.
            self.gram[(i, j)] + if a == b { precision[i] + 1e-9 * (1.0 + self.gram[(i, i)]) } else { 0.0 }
        })
    }

    /// Covariance of the coordinates after the fit, of the knobs that are free.
    #[must_use]
    pub fn covariance(&self, precision: &[f64]) -> DMatrix<f64> {
        let count = precision.len();
        let free: Vec<usize> = (0..count).filter(|&i| precision[i].is_finite()).collect();
        let mut all = DMatrix::zeros(count, count);
        if let Some(inverse) = self.normal(&free, precision).cholesky().map(|c| c.inverse()) {
            for (a, &i) in free.iter().enumerate() {
                for (b, &j) in free.iter().enumerate() {
                    all[(i, j)] = inverse[(a, b)];
                }
            }
        }
        all
    }

    /// Products of two gaps with the background marginalised: `a' (W^-1 + U U')^-1 b`.
    #[must_use]
    pub fn marginal(&self, a: &[f64], b: &[f64], precision: &[f64]) -> f64 {
        let free: Vec<usize> = (0..precision.len()).filter(|&i| precision[i].is_finite()).collect();
        let project = |gap: &[f64]| {
            DVector::from_iterator(free.len(), free.iter().map(|&i| dot(&self.slopes[i], gap, &self.weights)))
        };
        let straight = dot(a, b, &self.weights);
        let Some(factor) = self.normal(&free, precision).cholesky() else { return straight };
        straight - project(a).dot(&factor.solve(&project(b)))
    }
}

/// A point that was fitted.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Places of the knobs that were freed.
    pub freed: Vec<usize>,
    /// Coordinates.
    pub x: Vec<f64>,
    /// Gap there.
    pub gap: Vec<f64>,
    /// What is left: weighted square of the gap, and how unlikely the tolerances are.
    pub cost: f64,
    /// Slopes over what was freed.
    pub columns: Vec<Vec<f64>>,
}

/// Prior over the knobs: mean and precision of each coordinate.
#[derive(Debug, Clone)]
pub struct Prior {
    /// Coordinates that are expected.
    pub mean: Vec<f64>,
    /// One over the variance; infinite: fixed.
    pub precision: Vec<f64>,
}

impl Prior {
    /// Tolerances of the knobs.
    #[must_use]
    pub fn of<V: ReplayVehicle>(problem: &Problem<V>) -> Self {
        let precision = problem
            .knobs
            .iter()
            .map(|knob| if knob.tolerance > 0.0 { knob.tolerance.powi(-2) } else { f64::INFINITY })
            .collect();
        Self { mean: vec![0.0; problem.knobs.len()], precision }
    }

    /// With some knobs freed; a payload takes its place with it.
    #[must_use]
    pub fn freed<V: ReplayVehicle>(&self, problem: &Problem<V>, freed: &[usize]) -> Vec<f64> {
        let mut precision = self.precision.clone();
        for &i in freed {
            precision[i] = FREED.powi(-2);
            if problem.knobs[i].id == "payload"
                && let Some(place) = problem.find("payload_x")
            {
                precision[place] = super::knob::PAYLOAD_PLACE.powi(-2);
            }
        }
        precision
    }

    fn penalty(&self, x: &[f64], precision: &[f64]) -> f64 {
        x.iter()
            .zip(&self.mean)
            .zip(precision)
            .filter(|(_, p)| p.is_finite())
            .map(|((x, mean), p)| p * (x - mean).powi(2))
            .sum()
    }

    /// The linear step under this prior.
    #[must_use]
    pub fn step(&self, linear: &Linear, x: &[f64], gap: &[f64], precision: &[f64]) -> Step {
        let off: Vec<f64> = x.iter().zip(&self.mean).map(|(x, mean)| x - mean).collect();
        linear.step(&off, gap, precision)
    }
}

/// Fits with some knobs freed, from a point, with slopes `linear` for the background. Slopes of what is freed are taken
/// anew at each step.
#[must_use]
pub fn fit<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linear,
    freed: &[usize],
    start: &[f64],
    steps: usize,
) -> Option<Fit> {
    let precision = prior.freed(problem, freed);
    let mut own: Vec<usize> = freed.to_vec();
    if freed.iter().any(|&i| problem.knobs[i].id == "payload") {
        own.extend(problem.find("payload_x"));
    }
    let within = |x: &[f64]| -> Vec<f64> {
        let bound = |(i, x): (usize, &f64)| problem.knobs[i].within(*x, freed.contains(&i));
        x.iter().enumerate().map(bound).collect()
    };
    let mut x = within(start);
    let mut gap = problem.residual(&x)?;
    let mut cost = linear.square(&gap) + prior.penalty(&x, &precision);
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for _ in 0..steps.clamp(1, STEPS) {
        columns = own.iter().map(|&i| problem.slope(&x, &gap, i)).collect();
        let given: Vec<(usize, &[f64])> =
            own.iter().copied().zip(columns.iter().map(Vec::as_slice)).collect();
        let local = linear.with(&given);
        let step = prior.step(&local, &x, &gap, &precision);
        let mut length = 1.0;
        let mut better = None;
        for _ in 0..4 {
            let there: Vec<f64> = x.iter().zip(&step.change).map(|(x, change)| x + length * change).collect();
            let there = within(&there);
            if let Some(new) = problem.residual(&there) {
                let new_cost = linear.square(&new) + prior.penalty(&there, &precision);
                if new_cost < cost {
                    better = Some((there, new, new_cost));
                    break;
                }
            }
            length *= 0.4;
        }
        let Some((there, new, new_cost)) = better else { break };
        let gained = cost - new_cost;
        (x, gap, cost) = (there, new, new_cost);
        if gained < 0.05 + 1e-4 * cost {
            break;
        }
    }
    Some(Fit { freed: freed.to_vec(), x, gap, cost, columns })
}
