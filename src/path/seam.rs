//! The place of a road's end beside its start: a lap leads on into it.
//!
//! A tangent of each end comes from the parabola through its points, by their number; of noisy points, as many as are long against
//! the noise. The end leads into the start if
//!
//! ```text
//!     gap  <=  2 spacings + SPREAD sigma
//!     |chord - tangent of the end| + |tangent of the start - chord|  <  min(0.5 + 1.5 most, TURNS_BACK)
//! ```
//!
//! The chord lies between the middles of both ends' points: of a bend it has the direction at the seam. `most` is what the same sum
//! is elsewhere on the road at most: its corners, and what noise makes of it. A road that came back beside its start turns by pi.

use super::noise::{PointNoise, middle};
use super::spline::{Vector, distance};
use super::wrap_angle;
use crate::numerics::statistics::upper_median;

/// Change of direction between two chords from which on a road is out of order (rad).
pub(super) const TURNS_BACK: f64 = 2.2;

/// Distance of two measurements of one place, in standard deviations of a coordinate, that one pair in a thousand has.
const SPREAD: f64 = 5.26;
/// Points of an end that have no noise.
const EXACT: usize = 3;
/// Fewest points of a lap.
const FEWEST: usize = 8;

/// Place of an end beside the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Seam {
    /// Far from it, or the road has too few points to tell.
    Apart,
    /// Near, and the road turns there as nowhere else: a figure of eight, drawn from its crossing.
    Turns,
    /// Near, and ahead.
    Smooth,
}

impl Seam {
    /// The seam of a road's points, whose median spacing in m is given.
    pub fn of(points: &[Vector], noise: Option<&PointNoise>, median: f64) -> Self {
        let n = points.len();
        let (stride, sigma) = noise.map_or((1, 0.0), |noise| (noise.stride(), noise.sigma));
        let size = noise.map_or(EXACT, |_| (4 * stride + 1).min(n / 4).max(EXACT));
        if n < FEWEST.max(2 * size) {
            return Self::Apart;
        }
        let gap = distance(points[n - 1], points[0]);
        if gap > 2.0 * spacing(points, noise, median) + SPREAD * sigma {
            return Self::Apart;
        }
        let piece = |from: usize| SeamPiece::of(&points[from..from + size]);
        let along = (0..=n - 2 * size).step_by(stride);
        let most = along.map(|from| piece(from).turn_to(&piece(from + size))).fold(0.0, f64::max);
        let turn = piece(n - size).turn_to(&piece(0));
        if turn < (0.5 + 1.5 * most).min(TURNS_BACK) { Self::Smooth } else { Self::Turns }
    }
}

/// The larger of the usual spacing and that at both ends, in m; of noisy points, that of their means.
fn spacing(points: &[Vector], noise: Option<&PointNoise>, median: f64) -> f64 {
    let block = noise.map_or(1, PointNoise::stride);
    let means: Vec<Vector> =
        points.chunks_exact(block).map(|part| middle(part.iter().copied(), block)).collect();
    let mut steps: Vec<f64> =
        means.windows(2).map(|pair| distance(pair[0], pair[1]) / block as f64).collect();
    let (Some(&first), Some(&last)) = (steps.first(), steps.last()) else { return median };
    let usual = if noise.is_some() { upper_median(&mut steps) } else { median };
    usual.max(first).max(last)
}

/// A piece of road through points.
struct SeamPiece {
    middle: Vector,
    /// Headings at the first point and at the last, rad.
    headings: [f64; 2],
}

impl SeamPiece {
    /// The least-squares parabola of points, by their number.
    fn of(points: &[Vector]) -> Self {
        let half = 0.5 * (points.len() - 1) as f64;
        let mut moments = [0.0; 3];
        let mut sums = [[0.0; 3]; 2];
        for (k, point) in points.iter().enumerate() {
            let u = k as f64 - half;
            let powers = [1.0, u, u * u];
            for (moment, power) in moments.iter_mut().zip(powers) {
                *moment += power * power;
            }
            // From the first point: positions may lie far from the origin.
            for (c, sums) in sums.iter_mut().enumerate() {
                sums.iter_mut()
                    .zip(powers)
                    .for_each(|(sum, power)| *sum += power * (point[c] - points[0][c]));
            }
        }
        let [count, square, fourth] = moments;
        let slope = |at: f64| {
            sums.map(|[sum, first, second]| {
                let bend = (count * second - square * sum) / (count * fourth - square * square);
                first / square + 2.0 * bend * at
            })
        };
        Self {
            middle: middle(points.iter().copied(), points.len()),
            headings: [slope(-half), slope(half)].map(heading),
        }
    }

    /// Turn from this piece's end to the start of the next, by way of the chord between their middles, in rad.
    fn turn_to(&self, next: &Self) -> f64 {
        let chord = heading([0, 1].map(|c| next.middle[c] - self.middle[c]));
        wrap_angle(chord - self.headings[1]).abs() + wrap_angle(next.headings[0] - chord).abs()
    }
}

fn heading([x, y]: Vector) -> f64 {
    y.atan2(x)
}
