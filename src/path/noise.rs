//! The noise of points, measured from the points themselves.
//!
//! Take the frame of the road's local direction at each point. The offsets `n` of its neighbours follow a parabola of
//! their places `u` along the road. Noise is the remainder:
//!
//! ```text
//!     e_i = n_i - parabola(u_i),    var e_i = sigma^2 (1 - h_ii),    h: hat matrix of the fit
//! ```
//!
//! `sigma` is a robust scale (median) of `e_i / sqrt(1 - h_ii)`, so that a corner, drawn on purpose, is no noise. The
//! fit does not use the spacing: uneven points on a smooth road have none. Of the remainder of a smooth road,
//! neighbours have one sign; of noise, they change it. The window grows until it is long against the noise. Points 10
//! cm apart with 1 m of noise have a direction over 10 m only.
//!
//! Coordinates that are all multiples of a step `q` have been rounded, if the remainders are about as large as rounding
//! makes them, `q / sqrt 12`. Rounding of neighbours need not change its sign. A road that was drawn on a grid, without
//! such remainders, is exact.

use super::spline::{Vector, distance};
use crate::numerics::statistics::{MEDIAN_OF_NORMAL, upper_median};

/// Noise of points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PointNoise {
    /// Standard deviation across the road in m.
    pub sigma: f64,
    /// Step of the coordinates in m, where its rounding is the noise.
    pub step: Option<f64>,
    /// Number of points on either side of a mean that is long against the noise.
    half: usize,
}

/// Points on either side, at first and at most.
const HALF: (usize, usize) = (3, 192);
/// Length of a window, in standard deviations.
const LONG: f64 = 12.0;
/// Curvature error below which noise does not matter, in 1/m ...
const CURVATURE: f64 = 0.005;
/// ... and where fewer than this share of neighbours change their sign: of noise, half do in a long window, more in a
/// short one.
const CHANGES: f64 = 0.4;
/// Fewest points to tell noise by.
const POINTS: usize = 30;
/// Share of a step's rounding error that remainders of rounded points have at least, where there are any.
const ROUNDED: f64 = 0.5;
/// Ratio of a noise to a known accuracy up to which it is that accuracy.
pub(super) const ABOUT: f64 = 1.5;
/// Curvature error below which rounding does not matter, in 1/m.
pub(super) const SLIGHT: f64 = 1e-5;

impl PointNoise {
    /// RMS distance of the points from the road in m: across and along.
    pub fn rms(&self) -> f64 {
        self.sigma * 2f64.sqrt()
    }

    /// Measures the noise of points in driving order; `None` if there is none that matters. All coordinates are multiples
    /// of `step` in m, if there is one.
    pub fn measure(points: &[Vector], step: Option<f64>) -> Option<Self> {
        let mut half = HALF.0;
        while points.len() >= POINTS.max(2 * half + 2) && half <= HALF.1 {
            let found = Residuals::of(points, half);
            let sigma = found.scale_above(0.0)?;
            // On a line along an axis, or between points of the grid, nothing is rounded.
            let shows = |rounding: &f64| {
                found.scale_above(1e-6 * rounding).is_some_and(|scale| scale >= ROUNDED * rounding)
            };
            let rounding = step.map(rounding_error).filter(shows);
            if found.length < LONG * sigma.max(rounding.unwrap_or(0.0)) {
                half *= 2;
                continue;
            }
            let spacing = found.length / (2 * half) as f64;
            // Of a large noise, rounding is part.
            let noisy = curvature_error(sigma, spacing) > CURVATURE && found.changes() > CHANGES;
            if noisy && rounding.is_none_or(|rounding| sigma > ABOUT * rounding) {
                return Some(Self { sigma, step: None, half });
            }
            let rounding = rounding.filter(|&rounding| curvature_error(rounding, spacing) > SLIGHT)?;
            return Some(Self { sigma: rounding, step, half });
        }
        None
    }

    /// Means of neighbours, one for each point: its place along the road, free of most of the noise. The ends of an
    /// open road, which have neighbours on one side, are continued straight.
    pub fn means(&self, points: &[Vector], periodic: bool) -> Vec<Vector> {
        let n = points.len();
        let half = self.half.min((n - 1) / 4);
        let mean = |i: usize| middle((i + n - half..=i + n + half).map(|k| points[k % n]), 2 * half + 1);
        let mut means: Vec<Vector> = (0..n).map(mean).collect();
        if periodic || half == 0 {
            return means;
        }
        for (end, inward) in [(half, 2 * half), (n - 1 - half, n - 1 - 2 * half)] {
            let (at, next) = (means[end], means[inward]);
            for step in 1..=half {
                let share = step as f64 / half as f64;
                let i = if end < inward { end - step } else { end + step };
                means[i] = [0, 1].map(|c| at[c] + share * (at[c] - next[c]));
            }
        }
        means
    }

    /// Largest curvature that it makes at points with a spacing in m, in 1/m. A tighter bend is the road's own.
    pub fn bend(&self, spacing: f64) -> f64 {
        MOST * curvature_error(self.sigma, spacing)
    }

    /// Stride at which [`means`](Self::means) are apart against the noise: they give the road's direction.
    pub fn stride(&self) -> usize {
        self.half
    }
}

/// Largest of the errors of a road's points, in standard deviations.
const MOST: f64 = 4.0;

/// Standard deviation of the rounding to a step.
pub(super) fn rounding_error(step: f64) -> f64 {
    step / 12f64.sqrt()
}

/// RMS error of the curvature through three points, in 1/m, of points with a standard deviation at a spacing.
pub(super) fn curvature_error(sigma: f64, spacing: f64) -> f64 {
    6f64.sqrt() * sigma / (spacing * spacing)
}

/// Remainders of the windows' parabolas.
struct Residuals {
    /// At each point with a whole window around it, scaled to the noise's own size.
    values: Vec<f64>,
    /// Median length of a window in m.
    length: f64,
}

impl Residuals {
    fn of(points: &[Vector], half: usize) -> Self {
        let (mut values, mut lengths) = (Vec::new(), Vec::new());
        for window in points.windows(2 * half + 1) {
            let mean = |part: &[Vector]| middle(part.iter().copied(), part.len());
            let (begin, end) = (mean(&window[..half]), mean(&window[half + 1..]));
            let between = distance(begin, end);
            // Means of the two halves are half a window (and one point) apart.
            lengths.push(between * (2 * half) as f64 / (half + 1) as f64);
            if between > 0.0 {
                let direction = [(end[0] - begin[0]) / between, (end[1] - begin[1]) / between];
                values.extend(left_over(window, half, direction, between));
            }
        }
        Self { values, length: upper_median(&mut lengths) }
    }

    /// Scale of those that are at least so large.
    fn scale_above(&self, least: f64) -> Option<f64> {
        let sizes = self.values.iter().map(|value| value.abs());
        let mut sizes: Vec<f64> = sizes.filter(|size| *size >= least).collect();
        if sizes.len() < POINTS / 2 {
            return None;
        }
        // Of a normal distribution, those within 3 standard deviations have an RMS of 0.9866: a better estimate than the
        // median, as blind to corners.
        sizes.sort_by(f64::total_cmp);
        let bound = 3.0 * upper_median(&mut sizes) / MEDIAN_OF_NORMAL;
        let within = &sizes[..sizes.partition_point(|size| *size <= bound)];
        Some(
            (within.iter().map(|size| size * size).sum::<f64>() / within.len().max(1) as f64).sqrt() / 0.9866,
        )
    }

    fn changes(&self) -> f64 {
        let pairs = self.values.windows(2);
        pairs.clone().filter(|pair| pair[0] * pair[1] < 0.0).count() as f64 / pairs.len().max(1) as f64
    }
}

/// The middle point's distance from the least-squares parabola of its window, over `sqrt(1 - h)`.
fn left_over(window: &[Vector], middle: usize, direction: Vector, scale: f64) -> Option<f64> {
    let origin = window[middle];
    let local = |p: &Vector| {
        let d = [p[0] - origin[0], p[1] - origin[1]];
        [(d[0] * direction[0] + d[1] * direction[1]) / scale, d[1] * direction[0] - d[0] * direction[1]]
    };
    // The middle is at u = 0: its fitted value is the constant, its leverage the inverse's first entry.
    let mut moments = [0.0; 5];
    let mut right = [0.0; 3];
    for [u, n] in window.iter().map(local) {
        let mut power = 1.0;
        for (k, moment) in moments.iter_mut().enumerate() {
            *moment += power;
            if k < 3 {
                right[k] += power * n;
            }
            power *= u;
        }
    }
    let [m0, m1, m2, m3, m4] = moments;
    let cofactors = [m2 * m4 - m3 * m3, m2 * m3 - m1 * m4, m1 * m3 - m2 * m2];
    let determinant = m0 * cofactors[0] + m1 * cofactors[1] + m2 * cofactors[2];
    let constant =
        (cofactors[0] * right[0] + cofactors[1] * right[1] + cofactors[2] * right[2]) / determinant;
    let rest = 1.0 - cofactors[0] / determinant;
    let value = -constant / rest.sqrt();
    (rest > 1e-3 && value.is_finite()).then_some(value)
}

/// The mean of so many points.
pub(super) fn middle(points: impl Iterator<Item = Vector>, count: usize) -> Vector {
    points.fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]]).map(|sum| sum / count as f64)
}
