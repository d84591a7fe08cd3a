//! The smoothest curve that stays within a tolerance of noisy points.
//!
//! Points that are rounded or measured carry an error `sigma`; at spacing `h` their second differences carry a
//! curvature error of about `2.4 sigma / h^2`: 1 cm at 1 m is a bend of 40 m radius that is not there. So
//!
//! ```text
//!     min  lambda * integral |r'''|^2 dt   s.t.   RMS distance of the points, sum h_i |p_i - r(t_i)|^2 / sum h_i <= tolerance^2
//! ```
//!
//! over quintic splines with even knots (a P-spline: the integral is taken as third differences of the B-spline
//! coefficients, Eilers and Marx 1996). The third derivative of an arc-length curve is, in a bend, the change of
//! curvature: the penalty spares circles of any radius little and clothoids least.

use super::banded::Banded;
use super::spline::{Curve, Knot, Vector, distance};

/// Third difference.
const DIFFERENCE: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];
/// Narrowest and widest knot spacing in m.
const KNOTS: (f64, f64) = (0.5, 5.0);

/// Quintic B-spline weights at `u` in [0, 1) of a knot interval: of value, slope and second derivative, per knot
/// spacing.
fn weights(u: f64) -> [[f64; 6]; 3] {
    // Differences of truncated powers: B(x) = sum (-1)^k C(6,k) (x - k)_+^5 / 120, at x = u + 5 - j.
    const BINOMIAL: [f64; 6] = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0];
    let weight = |j: usize| {
        // By symmetry B(x) = B(6 - x): take the end with fewer terms, for precision.
        let x = u + (5 - j) as f64;
        let mirrored = x > 3.0;
        let z = if mirrored { 6.0 - x } else { x };
        let mut sums = [0.0; 3];
        for (k, factor) in BINOMIAL.iter().enumerate() {
            let d = z - k as f64;
            if d <= 0.0 {
                break;
            }
            sums[0] += factor * d.powi(5) / 120.0;
            sums[1] += factor * d.powi(4) / 24.0;
            sums[2] += factor * d.powi(3) / 6.0;
        }
        [sums[0], if mirrored { -sums[1] } else { sums[1] }, sums[2]]
    };
    let all = [0, 1, 2, 3, 4, 5].map(weight);
    [0, 1, 2].map(|order| all.map(|weight| weight[order]))
}

/// The smoothing spline's problem: points, their parameters, and the knots.
struct Problem<'a> {
    points: &'a [Vector],
    t: &'a [f64],
    weights: Vec<f64>,
    period: f64,
    intervals: usize,
    periodic: bool,
}

impl Problem<'_> {
    fn unknowns(&self) -> usize {
        if self.periodic { self.intervals } else { self.intervals + 5 }
    }

    /// The knot interval of a parameter, and where in it.
    fn interval(&self, t: f64) -> (usize, f64) {
        let scaled = t / self.period * self.intervals as f64;
        let index = (scaled.max(0.0) as usize).min(self.intervals - 1);
        (index, scaled - index as f64)
    }

    /// Coefficients at a penalty, and the mean square distance of the points.
    fn solve(&self, lambda: f64) -> Option<(Vec<Vector>, f64)> {
        let n = self.unknowns();
        let mut matrix = Banded::<6>::new(n, self.periodic);
        let mut right = vec![[0.0; 2]; n];
        for ((point, &t), &weight) in self.points.iter().zip(self.t).zip(&self.weights) {
            let (index, u) = self.interval(t);
            let basis = weights(u)[0];
            for a in 0..6 {
                let row = (index + a) % n;
                for b in a..6 {
                    matrix.add(row, b - a, weight * basis[a] * basis[b]);
                }
                right[row] = [0, 1].map(|c| right[row][c] + weight * basis[a] * point[c]);
            }
        }
        for i in 0..if self.periodic { n } else { n - 3 } {
            for (a, left) in DIFFERENCE.iter().enumerate() {
                for (b, right) in DIFFERENCE.iter().enumerate().skip(a) {
                    matrix.add((i + a) % n, b - a, lambda * left * right);
                }
            }
        }
        let coefficients = matrix.solve(&right)?;
        let mut square = 0.0;
        for ((point, &t), &weight) in self.points.iter().zip(self.t).zip(&self.weights) {
            let at = self.evaluate(&coefficients, t)[0];
            square += weight * distance(*point, at).powi(2);
        }
        Some((coefficients, square))
    }

    /// Position, first and second derivative in `t`.
    fn evaluate(&self, coefficients: &[Vector], t: f64) -> [Vector; 3] {
        let (index, u) = self.interval(t);
        let per_knot = self.intervals as f64 / self.period;
        let basis = weights(u);
        [0, 1, 2].map(|order| {
            [0, 1].map(|c| {
                let sum: f64 =
                    (0..6).map(|a| basis[order][a] * coefficients[(index + a) % coefficients.len()][c]).sum();
                sum * per_knot.powi(order as i32)
            })
        })
    }

    /// The largest penalty that keeps the tolerance; `None` if these knots cannot keep it.
    fn best(&self, tolerance: f64) -> Option<Vec<Vector>> {
        let allowed = tolerance * tolerance;
        let fits = |exponent: f64| self.solve(10f64.powf(exponent)).filter(|(_, square)| *square <= allowed);
        // Penalties against weights that sum to one.
        let (mut low, mut high) = (-12.0, 8.0);
        let mut best = fits(low)?.0;
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            match fits(middle) {
                Some((coefficients, _)) => (best, low) = (coefficients, middle),
                None => high = middle,
            }
        }
        Some(best)
    }
}

/// The smoothest quintic spline with a length-weighted RMS distance to the points of at most `tolerance` (m), and
/// where the points lie along it. `None` if the tolerance is too narrow to smooth at all: interpolate then. `along`:
/// a point for each that tells better where along the road it is, if noise is larger than the spacing.
pub(super) fn smooth(
    points: &[Vector],
    along: Option<&[Vector]>,
    periodic: bool,
    tolerance: f64,
) -> Option<Curve> {
    let n = points.len();
    if n < 6 || tolerance <= 0.0 {
        return None;
    }
    let closed = n + usize::from(periodic);
    let along = along.unwrap_or(points);
    let mut t = vec![0.0];
    for i in 1..closed {
        // Points apart have means apart, nearly always.
        t.push(t[i - 1] + distance(along[i - 1], along[i % n]).max(1e-9));
    }
    let mut curve: Option<Curve> = None;
    // Noise lengthens chords; the smooth curve's own arc length is the better parameter.
    for _ in 0..2 {
        if let Some(curve) = &curve {
            t = curve.mark_stations();
        }
        let period = *t.last().unwrap_or(&0.0);
        let spacing = (period / n as f64).clamp(KNOTS.0, KNOTS.1);
        let mut weights: Vec<f64> = (0..n)
            .map(|i| {
                let before = if i > 0 {
                    t[i] - t[i - 1]
                } else if periodic {
                    period - t[n - 1]
                } else {
                    0.0
                };
                let after = if i + 1 < closed { t[i + 1] - t[i] } else { 0.0 };
                0.5 * (before + after)
            })
            .collect();
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= total);
        let mut intervals = ((period / spacing).ceil() as usize).clamp(18, 1_000_000);
        let (problem, coefficients) = loop {
            let problem =
                Problem { points, t: &t[..n], weights: weights.clone(), period, intervals, periodic };
            if let Some(coefficients) = problem.best(tolerance) {
                break (problem, coefficients);
            }
            intervals *= 2;
            if intervals > 4 * n.max(50) {
                return None;
            }
        };
        let knots = (0..=intervals)
            .map(|i| {
                let at = if periodic && i == intervals { 0.0 } else { i as f64 / intervals as f64 * period };
                let [p, d1, d2] = problem.evaluate(&coefficients, at);
                Knot { t: i as f64 / intervals as f64 * period, p, d1, d2 }
            })
            .collect();
        curve = Some(Curve { knots, marks: t.clone(), yaw: None });
    }
    curve
}
