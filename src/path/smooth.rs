//! Smooth curves near noisy points.
//!
//! Points that are rounded or measured carry an error `sigma`. At spacing `h` their second differences carry a
//! curvature error of about `2.4 sigma / h^2`. 1 cm at 1 m is a bend of 40 m radius that is not there. So
//!
//! ```text
//!     min  sum w_i |p_i - r(t_i)|^2 + lambda * integral |r'''|^2 dt,     w_i = h_i / sum h_i
//! ```
//!
//! over quintic splines with even knots (a P-spline: the integral is taken as third differences of the B-spline
//! coefficients, Eilers and Marx 1996). The third derivative of an arc-length curve is, in a bend, the change of
//! curvature. The penalty spares circles of any radius little and clothoids least.
//!
//! For a given tolerance, `lambda` is as large as the points' distance allows ([`Goal::Within`]). For a known noise, it
//! minimises the distance from the road ([`Goal::Nearest`]). Points as far off as their noise would be too much. A
//! curve takes part of the noise with it, `H_ii` of each point's own. One that keeps all of it at a distance cuts the
//! tight bends. The expected square error of the curve is, but for a constant (Mallows 1973; Craven and Wahba 1979),
//!
//! ```text
//!     sum w_i |p_i - r(t_i)|^2 + 2 rms^2 sum w_i H_ii,      sum w_i H_ii = trace (A^-1 B' W^2 B) = d/de log det (A + e B' W^2 B)
//! ```
//!
//! with `A = B' W B + lambda D' D` the normal equations' matrix and `H = B A^-1 B' W`.

use super::banded::{Banded, Factored};
use super::spline::{Knot, QuinticSpline, Vector, distance};

/// Third difference.
const DIFFERENCE: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];
/// Narrowest and widest knot spacing in m.
const KNOTS: (f64, f64) = (0.5, 5.0);
/// Most knots of a point; a smoothing spline of any penalty needs one (Reinsch 1967), if it may lie where the point does.
const KNOTS_A_POINT: usize = 4;
/// Length of a curve that is no longer near its parameter, over the parameter's.
const LONGER: f64 = 2.0;
/// Points that a shorter road is taken to have.
const FEW_POINTS: usize = 50;

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

/// Criterion of the penalty.
#[derive(Debug, Clone, Copy)]
pub(super) enum Goal {
    /// The smoothest curve within this RMS distance of the points in m.
    Within(f64),
    /// The curve nearest to the road, estimated from points with noise of this RMS in m.
    Nearest(f64),
}

/// Exponents of the penalty, against weights that sum to one.
const PENALTIES: (f64, f64) = (-12.0, 8.0);

/// The smoothing spline's problem: points, their parameters, and the knots.
struct SmoothingProblem<'a> {
    points: &'a [Vector],
    weights: Vec<f64>,
    period: f64,
    intervals: usize,
    periodic: bool,
    /// Of each point, the knot interval and the B-splines' values.
    basis: Vec<(usize, [f64; 6])>,
    /// `B' W B`, and `B' W p`.
    normal: Banded<6>,
    right: Vec<Vector>,
}

impl<'a> SmoothingProblem<'a> {
    fn new(
        points: &'a [Vector],
        t: &[f64],
        weights: &[f64],
        (period, intervals): (f64, usize),
        periodic: bool,
    ) -> Self {
        let n = if periodic { intervals } else { intervals + 5 };
        let mut problem = Self {
            points,
            weights: weights.to_vec(),
            period,
            intervals,
            periodic,
            basis: Vec::with_capacity(points.len()),
            normal: Banded::new(n, periodic),
            right: vec![[0.0; 2]; n],
        };
        for &t in t {
            let (index, u) = problem.interval(t);
            problem.basis.push((index, super::smooth::weights(u)[0]));
        }
        problem.normal = problem.gram(|weight| weight);
        for (((index, basis), point), weight) in problem.basis.iter().zip(points).zip(weights) {
            for (a, value) in basis.iter().enumerate() {
                let right = &mut problem.right[(index + a) % n];
                *right = [0, 1].map(|c| right[c] + weight * value * point[c]);
            }
        }
        problem
    }

    /// `B' f(W) B`.
    fn gram(&self, of: impl Fn(f64) -> f64) -> Banded<6> {
        let n = self.right.len();
        let mut matrix = Banded::new(n, self.periodic);
        for ((index, basis), &weight) in self.basis.iter().zip(&self.weights) {
            let weight = of(weight);
            for a in 0..6 {
                for b in a..6 {
                    matrix.add((index + a) % n, b - a, weight * basis[a] * basis[b]);
                }
            }
        }
        matrix
    }

    /// The knot interval of a parameter, and where in it.
    fn interval(&self, t: f64) -> (usize, f64) {
        let scaled = t / self.period * self.intervals as f64;
        let index = (scaled.max(0.0) as usize).min(self.intervals - 1);
        (index, scaled - index as f64)
    }

    /// The normal equations' matrix at a penalty, and with so much of another.
    fn factored(&self, lambda: f64, other: Option<(f64, &Banded<6>)>) -> Option<Factored<6>> {
        let mut matrix = self.normal.clone();
        let n = matrix.band.len();
        for i in 0..if self.periodic { n } else { n - 3 } {
            for (a, left) in DIFFERENCE.iter().enumerate() {
                for (b, right) in DIFFERENCE.iter().enumerate().skip(a) {
                    matrix.add((i + a) % n, b - a, lambda * left * right);
                }
            }
        }
        if let Some((share, other)) = other {
            for (row, other) in matrix.band.iter_mut().zip(&other.band) {
                row.iter_mut().zip(other).for_each(|(value, other)| *value += share * other);
            }
        }
        matrix.factored()
    }

    /// Mean square distance of the points.
    fn square(&self, coefficients: &[Vector]) -> f64 {
        let n = coefficients.len();
        let points = self.basis.iter().zip(self.points).zip(&self.weights);
        points
            .map(|(((index, basis), point), weight)| {
                let at = [0, 1].map(|c| (0..6).map(|a| basis[a] * coefficients[(index + a) % n][c]).sum());
                weight * distance(*point, at).powi(2)
            })
            .sum()
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

    /// The best coefficients; `None` if these knots cannot keep the tolerance.
    fn best(&self, goal: Goal) -> Option<Vec<Vector>> {
        match goal {
            Goal::Within(tolerance) => self.smoothest(tolerance * tolerance),
            Goal::Nearest(noise) => self.nearest(noise * noise),
        }
    }

    /// At the largest penalty with a mean square that is allowed.
    fn smoothest(&self, allowed: f64) -> Option<Vec<Vector>> {
        let fits = |exponent: f64| {
            let coefficients = self.factored(10f64.powf(exponent), None)?.solve(&self.right);
            (self.square(&coefficients) <= allowed).then_some(coefficients)
        };
        let (mut low, mut high) = PENALTIES;
        let mut best = fits(low)?;
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            match fits(middle) {
                Some(coefficients) => (best, low) = (coefficients, middle),
                None => high = middle,
            }
        }
        Some(best)
    }

    /// At the penalty with the least expected error, where points have noise of a mean square.
    fn nearest(&self, noise: f64) -> Option<Vec<Vector>> {
        let spread = self.gram(|weight| weight * weight);
        // Small against the matrix, which holds each weight once.
        let little = 1e-4 / self.weights.iter().copied().fold(0.0, f64::max);
        let error = |exponent: f64| {
            let lambda = 10f64.powf(exponent);
            let factored = self.factored(lambda, None)?;
            let more = self.factored(lambda, Some((little, &spread)))?;
            let taken = (more.log_determinant() - factored.log_determinant()) / little;
            let coefficients = factored.solve(&self.right);
            let error = self.square(&coefficients) + 2.0 * noise * taken;
            error.is_finite().then_some((error, exponent, coefficients))
        };
        let least = |exponents: &mut dyn Iterator<Item = f64>| {
            exponents.filter_map(error).min_by(|a, b| a.0.total_cmp(&b.0))
        };
        // Decades first, then tenths around the best.
        let decades = (PENALTIES.1 - PENALTIES.0) as usize;
        let (_, around, _) = least(&mut (0..=decades).map(|k| PENALTIES.0 + k as f64))?;
        let (_, _, coefficients) = least(&mut (-9..=9).map(|k| around + 0.1 * f64::from(k)))?;
        Some(coefficients)
    }
}

/// The quintic spline near points that reaches the goal, and the places of the points along it. `None` if a tolerance
/// is too narrow to smooth at all: interpolate then. `along` gives for each point a better one for its place along the
/// road, for noise larger than the spacing.
pub(super) fn smooth(
    points: &[Vector],
    along: Option<&[Vector]>,
    periodic: bool,
    goal: Goal,
) -> Option<QuinticSpline> {
    let (Goal::Within(distance_allowed) | Goal::Nearest(distance_allowed)) = goal;
    let n = points.len();
    if n < 6 || distance_allowed <= 0.0 {
        return None;
    }
    let closed = n + usize::from(periodic);
    let along = along.unwrap_or(points);
    let mut t = vec![0.0];
    for i in 1..closed {
        // Points apart have means apart, nearly always.
        t.push(t[i - 1] + distance(along[i - 1], along[i % n]).max(1e-9));
    }
    let mut curve: Option<QuinticSpline> = None;
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
        // Points that are far apart leave knots between them without any.
        let most = KNOTS_A_POINT * n.max(FEW_POINTS);
        let mut intervals = ((period / spacing).ceil() as usize).clamp(18, most);
        let (problem, coefficients) = loop {
            let problem = SmoothingProblem::new(points, &t[..n], &weights, (period, intervals), periodic);
            if let Some(coefficients) = problem.best(goal) {
                break (problem, coefficients);
            }
            intervals *= 2;
            if intervals > most {
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
        let drawn = QuinticSpline { knots, marks: t.clone(), yaw: None };
        // It is not by its arc length that the points lie where `t` says: they have no order, and the curve is no road.
        if drawn.mark_stations().last().is_none_or(|length| *length > LONGER * period) {
            return None;
        }
        curve = Some(drawn);
    }
    curve
}
