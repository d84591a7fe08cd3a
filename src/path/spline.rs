//! A smooth curve through points: piecewise polynomials with continuous curvature.
//!
//! Every curve is a chain of quintics, each given by position, first and second derivative at its two ends. So
//! position, heading and curvature are continuous, whatever the source of the curve:
//!
//! - **points alone**: the interpolating cubic spline `x(t), y(t)`. Its `t` is the arc length of the spline itself
//!   (found by iteration), so that uneven spacing does not ripple the curvature;
//! - **points with heading and curvature**: these hold exactly, `r' = (cos yaw, sin yaw)`, `r'' = curvature * normal`;
//! - **noisy points**: a smoothing spline, see `smooth.rs`.

use super::quadrature::integrate;

/// A point or vector in the plane.
pub(super) type Vector = [f64; 2];

/// An end of a quintic: parameter, position, first and second derivative.
#[derive(Debug, Clone, Copy)]
pub(super) struct Knot {
    pub t: f64,
    pub p: Vector,
    pub d1: Vector,
    pub d2: Vector,
}

/// A chain of quintics. A closed curve's last knot repeats its first one.
#[derive(Debug, Clone)]
pub(super) struct QuinticSpline {
    pub knots: Vec<Knot>,
    /// Parameters of the curve's original points (closed: the first one again at the end).
    pub marks: Vec<f64>,
    /// Yaw (continuous) and curvature at the knots, if they were given: rounded positions would give worse ones.
    pub yaw: Option<Vec<[f64; 2]>>,
}

/// Coefficients of a quintic in `t - t0`, rising powers.
pub(super) type Quintic = [f64; 6];

/// The quintic with given value, slope and second derivative at 0 and at `h`.
pub(super) fn quintic(start: [f64; 3], end: [f64; 3], h: f64) -> Quintic {
    let [p0, v0, a0] = start;
    let [p1, v1, a1] = end;
    let p = p1 - p0 - h * (v0 + 0.5 * h * a0);
    let v = h * (v1 - v0 - h * a0);
    let a = h * h * (a1 - a0);
    let h3 = h * h * h;
    [
        p0,
        v0,
        0.5 * a0,
        (10.0 * p - 4.0 * v + 0.5 * a) / h3,
        (-15.0 * p + 7.0 * v - a) / (h3 * h),
        (6.0 * p - 3.0 * v + 0.5 * a) / (h3 * h * h),
    ]
}

/// Value, first and second derivative of a quintic.
#[inline]
pub(super) fn evaluate(c: &Quintic, u: f64) -> [f64; 3] {
    [
        c[0] + u * (c[1] + u * (c[2] + u * (c[3] + u * (c[4] + u * c[5])))),
        c[1] + u * (2.0 * c[2] + u * (3.0 * c[3] + u * (4.0 * c[4] + u * 5.0 * c[5]))),
        2.0 * c[2] + u * (6.0 * c[3] + u * (12.0 * c[4] + u * 20.0 * c[5])),
    ]
}

/// Distance between two points.
pub(super) fn distance(a: Vector, b: Vector) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

impl QuinticSpline {
    /// The interpolating cubic spline through points; `periodic` leads from the last back to the first.
    /// Wants two distinct points (periodic: three), consecutive ones apart.
    pub fn through(points: &[Vector], periodic: bool) -> Self {
        let closed: Vec<Vector> =
            if periodic { points.iter().chain(points.first()).copied().collect() } else { points.to_vec() };
        let mut steps: Vec<f64> = closed.windows(2).map(|pair| distance(pair[0], pair[1])).collect();
        let mut curve = Self::cubic(&closed, &steps, periodic);
        // Chords are shorter than the arcs; with arcs for steps, |r'| is even and so is the curvature.
        for _ in 0..3 {
            steps = (0..curve.pieces()).map(|i| curve.piece_length(i)).collect();
            curve = Self::cubic(&closed, &steps, periodic);
        }
        curve
    }

    /// The curve with given headings (rad) and curvatures (1/m) at the points.
    pub fn through_poses(points: &[Vector], yaw: &[f64], curvature: &[f64], periodic: bool) -> Self {
        let count = points.len() + usize::from(periodic);
        let mut knots: Vec<Knot> = Vec::with_capacity(count);
        let mut angles: Vec<[f64; 2]> = Vec::with_capacity(count);
        for index in 0..count {
            let i = index % points.len();
            let (sin, cos) = yaw[i].sin_cos();
            let t = knots.last().map_or(0.0, |last| {
                // Of an arc, and nearly of a clothoid: length from chord and turned angle.
                let half =
                    0.5 * (last.d1[0] * sin - last.d1[1] * cos).atan2(last.d1[0] * cos + last.d1[1] * sin);
                let chord = distance(last.p, points[i]);
                last.t + if half.abs() < 1e-6 { chord } else { chord * half / half.sin() }
            });
            let unwrapped =
                angles.last().map_or(yaw[i], |last| last[0] + super::wrap_angle(yaw[i] - last[0]));
            angles.push([unwrapped, curvature[i]]);
            knots.push(Knot {
                t,
                p: points[i],
                d1: [cos, sin],
                d2: [-curvature[i] * sin, curvature[i] * cos],
            });
        }
        let marks = knots.iter().map(|knot| knot.t).collect();
        Self { knots, marks, yaw: Some(angles) }
    }

    /// Cubic spline with parameter steps `steps` between `points` (periodic: the first point stands again last).
    fn cubic(points: &[Vector], steps: &[f64], periodic: bool) -> Self {
        let second = if periodic { periodic_second(points, steps) } else { open_second(points, steps) };
        let mut t = 0.0;
        let last = points.len() - 1;
        let knots: Vec<Knot> = (0..=last)
            .map(|i| {
                let d1 = if i < last {
                    let h = steps[i];
                    [0, 1].map(|k| {
                        (points[i + 1][k] - points[i][k]) / h
                            - h / 6.0 * (2.0 * second[i][k] + second[i + 1][k])
                    })
                } else {
                    let h = steps[i - 1];
                    [0, 1].map(|k| {
                        (points[i][k] - points[i - 1][k]) / h
                            + h / 6.0 * (second[i - 1][k] + 2.0 * second[i][k])
                    })
                };
                let knot = Knot { t, p: points[i], d1, d2: second[i] };
                t += steps.get(i).copied().unwrap_or(0.0);
                knot
            })
            .collect();
        let marks = knots.iter().map(|knot| knot.t).collect();
        Self { knots, marks, yaw: None }
    }

    /// Number of quintics.
    pub fn pieces(&self) -> usize {
        self.knots.len() - 1
    }

    /// Quintics of x and y of a piece, in `t - t_i`.
    pub fn piece(&self, i: usize) -> [Quintic; 2] {
        let (a, b) = (&self.knots[i], &self.knots[i + 1]);
        [0, 1].map(|k| quintic([a.p[k], a.d1[k], a.d2[k]], [b.p[k], b.d1[k], b.d2[k]], b.t - a.t))
    }

    /// Arc length at the knots in m.
    pub fn knot_stations(&self) -> Vec<f64> {
        let mut stations = vec![0.0];
        for i in 0..self.pieces() {
            stations.push(stations[i] + self.piece_length(i));
        }
        stations
    }

    /// Arc length at the points that the curve was made from, in m.
    pub fn mark_stations(&self) -> Vec<f64> {
        let stations = self.knot_stations();
        let mut i = 0;
        self.marks
            .iter()
            .map(|&t| {
                while i + 1 < self.pieces() && self.knots[i + 1].t <= t {
                    i += 1;
                }
                if t >= self.knots[i + 1].t {
                    stations[i + 1]
                } else {
                    stations[i] + arc_length(&self.piece(i), 0.0, t - self.knots[i].t)
                }
            })
            .collect()
    }

    /// The curve at the points that it was made from.
    pub fn at_marks(&self) -> Vec<Vector> {
        let mut i = 0;
        self.marks
            .iter()
            .map(|&t| {
                while i + 1 < self.pieces() && self.knots[i + 1].t <= t {
                    i += 1;
                }
                self.piece(i).map(|coordinate| evaluate(&coordinate, t - self.knots[i].t)[0])
            })
            .collect()
    }

    /// Arc length of a piece in m.
    pub fn piece_length(&self, i: usize) -> f64 {
        let piece = self.piece(i);
        let h = self.knots[i + 1].t - self.knots[i].t;
        let parts = (h.ceil() as usize).clamp(1, 64);
        let width = h / parts as f64;
        (0..parts).map(|part| arc_length(&piece, part as f64 * width, (part + 1) as f64 * width)).sum()
    }
}

/// Arc length of a piece between two parameters, which must be near enough for one quadrature.
pub(super) fn arc_length(piece: &[Quintic; 2], from: f64, to: f64) -> f64 {
    integrate(from, to, |u| [speed(piece, u)])[0]
}

/// `|r'(t)|`.
pub(super) fn speed(piece: &[Quintic; 2], u: f64) -> f64 {
    evaluate(&piece[0], u)[1].hypot(evaluate(&piece[1], u)[1])
}

/// Second derivatives of the open cubic spline. The ends are "not a knot" (the first two pieces are one cubic), so that
/// a bend may begin with the road. Constant second derivative instead, if the end pieces differ much in length.
fn open_second(points: &[Vector], steps: &[f64]) -> Vec<Vector> {
    let n = points.len();
    if n == 2 {
        return vec![[0.0; 2]; 2];
    }
    let inner = n - 2;
    let mut lower = vec![0.0; inner];
    let mut diagonal = vec![0.0; inner];
    let mut upper = vec![0.0; inner];
    let mut right: Vec<Vector> = vec![[0.0; 2]; inner];
    for i in 0..inner {
        let (h0, h1) = (steps[i], steps[i + 1]);
        (lower[i], diagonal[i], upper[i]) = (h0, 2.0 * (h0 + h1), h1);
        right[i] = bend(points[i], points[i + 1], points[i + 2], h0, h1);
    }
    let ratio = |end: f64, next: f64| if inner >= 2 && end < 1.5 * next { end / next } else { 0.0 };
    let (first, last) = (ratio(steps[0], steps[1]), ratio(steps[n - 2], steps[n - 3]));
    // m_0 = (1 + ratio) m_1 - ratio m_2, and the same at the other end.
    diagonal[0] += steps[0] * (1.0 + first);
    upper[0] -= steps[0] * first;
    diagonal[inner - 1] += steps[n - 2] * (1.0 + last);
    lower[inner - 1] -= steps[n - 2] * last;
    let m = solve_tridiagonal(&lower, &diagonal, &upper, &right);
    let extrapolate =
        |near: Vector, next: Vector, ratio: f64| [0, 1].map(|k| (1.0 + ratio) * near[k] - ratio * next[k]);
    let mut second = Vec::with_capacity(n);
    second.push(extrapolate(m[0], *m.get(1).unwrap_or(&m[0]), first));
    second.extend_from_slice(&m);
    second.push(extrapolate(m[inner - 1], if inner > 1 { m[inner - 2] } else { m[0] }, last));
    second
}

/// Second derivatives of the periodic cubic spline (Sherman-Morrison on the cyclic tridiagonal system).
fn periodic_second(points: &[Vector], steps: &[f64]) -> Vec<Vector> {
    let n = steps.len();
    let before = |i: usize| if i == 0 { n - 1 } else { i - 1 };
    let lower: Vec<f64> = (0..n).map(|i| steps[before(i)]).collect();
    let upper = steps.to_vec();
    let mut diagonal: Vec<f64> = (0..n).map(|i| 2.0 * (steps[before(i)] + steps[i])).collect();
    let right: Vec<Vector> = (0..n)
        .map(|i| bend(points[before(i)], points[i], points[i + 1], steps[before(i)], steps[i]))
        .collect();
    let corner = steps[n - 1];
    let gamma = -diagonal[0];
    diagonal[0] -= gamma;
    diagonal[n - 1] -= corner * corner / gamma;
    let mut unit = vec![[0.0; 2]; n];
    unit[0] = [gamma; 2];
    unit[n - 1] = [corner; 2];
    let y = solve_tridiagonal(&lower, &diagonal, &upper, &right);
    let z = solve_tridiagonal(&lower, &diagonal, &upper, &unit);
    let scale = corner / gamma;
    let denominator = 1.0 + z[0][0] + scale * z[n - 1][0];
    let factor = [0, 1].map(|k| (y[0][k] + scale * y[n - 1][k]) / denominator);
    let mut second: Vec<Vector> = (0..n).map(|i| [0, 1].map(|k| y[i][k] - factor[k] * z[i][k])).collect();
    second.push(second[0]);
    second
}

/// Six times the second divided difference's numerator: the spline equations' right-hand side.
fn bend(a: Vector, b: Vector, c: Vector, h0: f64, h1: f64) -> Vector {
    [0, 1].map(|k| 6.0 * ((c[k] - b[k]) / h1 - (b[k] - a[k]) / h0))
}

/// Thomas' algorithm; `lower[0]` and the last `upper` are not read.
fn solve_tridiagonal(lower: &[f64], diagonal: &[f64], upper: &[f64], right: &[Vector]) -> Vec<Vector> {
    let n = diagonal.len();
    let mut factor = vec![0.0; n];
    let mut x = right.to_vec();
    let mut pivot = diagonal[0];
    x[0] = x[0].map(|value| value / pivot);
    for i in 1..n {
        factor[i] = upper[i - 1] / pivot;
        pivot = diagonal[i] - lower[i] * factor[i];
        x[i] = [0, 1].map(|k| (x[i][k] - lower[i] * x[i - 1][k]) / pivot);
    }
    for i in (0..n - 1).rev() {
        x[i] = [0, 1].map(|k| x[i][k] - factor[i + 1] * x[i + 1][k]);
    }
    x
}
