//! The way from one pose to another by an arc, a straight and an arc of one radius, and the same line with a curvature that is continuous.
//!
//! ```text
//!     r(s) = mean of p(s + u) over |u| <= window / 2,    p: straight, arc, straight, arc, straight
//! ```
//!
//! The mean turns no tighter than the arcs but for `sinc(window / 2 radius)`, by which they are wider; it begins and ends on the lines.

use super::segment::Pose;
use super::spline::Vector;
use std::f64::consts::{PI, TAU};

/// Parts of a window in its mean.
const PARTS: u32 = 64;
/// Error of an angle that rounding makes, rad.
const ROUNDED: f64 = 1e-6;

/// A straight of half a window, an arc, a straight, an arc, and half a window again.
pub(super) struct TwoArcs {
    from: Pose,
    /// Length, m, and curvature, 1/m, of each piece.
    pieces: [[f64; 2]; 5],
    window: f64,
}

impl TwoArcs {
    /// The way between two poses that turns to these sides (1: left, -1: right) and by `turn` rad in all, with a `radius` in m and a
    /// `window` in m over which the curvature changes. `None` if there is none without a loop.
    pub fn between(
        [from, to]: [Pose; 2],
        sides: [f64; 2],
        turn: f64,
        radius: f64,
        window: f64,
    ) -> Option<Self> {
        let half = 0.5 * window;
        let wide = radius * (half / radius) / (half / radius).sin();
        let [begin, end] = [ahead(from, half), ahead(to, -half)];
        let centre = |pose: Pose, side: f64| {
            let (sin, cos) = pose.yaw.sin_cos();
            [pose.x - side * wide * sin, pose.y + side * wide * cos]
        };
        let (first, last) = (centre(begin, sides[0]), centre(end, sides[1]));
        let [dx, dy] = [last[0] - first[0], last[1] - first[1]];
        // A straight between circles on its two sides crosses from the one to the other.
        let (apart, across) = (dx.hypot(dy), wide * (sides[0] - sides[1]).abs());
        if apart < across {
            return None;
        }
        let crossing = if across > 0.0 { sides[0] * (across / apart).asin() } else { 0.0 };
        let yaw = dy.atan2(dx) + crossing;
        let arcs = [sides[0] * (yaw - begin.yaw), sides[1] * (end.yaw - yaw)].map(|arc| {
            let arc = arc.rem_euclid(TAU);
            if arc > TAU - ROUNDED { 0.0 } else { arc }
        });
        let loops = (sides[0] * arcs[0] + sides[1] * arcs[1] - turn).abs() > ROUNDED;
        if loops || arcs.iter().any(|arc| *arc > PI) {
            return None;
        }
        let arc = |k: usize| [wide * arcs[k], sides[k] / wide];
        let straight = (apart * apart - across * across).max(0.0).sqrt();
        Some(Self { from, pieces: [[half, 0.0], arc(0), [straight, 0.0], arc(1), [half, 0.0]], window })
    }

    /// Length of the lines and arcs, m.
    pub fn length(&self) -> f64 {
        self.pieces.iter().map(|[length, _]| length).sum()
    }

    /// The smooth line's point at a place of the lines and arcs.
    pub fn at(&self, s: f64) -> Vector {
        let part = self.window / f64::from(PARTS);
        let sum = (0..PARTS).fold([0.0; 2], |sum, k| {
            let p = self.exact(s - 0.5 * self.window + (f64::from(k) + 0.5) * part);
            [sum[0] + p[0], sum[1] + p[1]]
        });
        sum.map(|sum| sum / f64::from(PARTS))
    }

    /// The point of the lines and arcs; both ends go straight on.
    fn exact(&self, s: f64) -> Vector {
        let (mut pose, mut rest) = (self.from, s);
        for (k, &[length, curvature]) in self.pieces.iter().enumerate() {
            let last = k + 1 == self.pieces.len();
            let way = if last { rest } else { rest.min(length) };
            pose = along(pose, way, curvature);
            rest -= way;
            if rest <= 0.0 {
                break;
            }
        }
        [pose.x, pose.y]
    }
}

fn ahead(pose: Pose, way: f64) -> Pose {
    along(pose, way, 0.0)
}

/// The pose further along a circle, or a straight.
fn along(pose: Pose, way: f64, curvature: f64) -> Pose {
    let half = 0.5 * way * curvature;
    let chord = if half == 0.0 { way } else { way * half.sin() / half };
    let (sin, cos) = (pose.yaw + half).sin_cos();
    Pose { x: pose.x + chord * cos, y: pose.y + chord * sin, yaw: pose.yaw + 2.0 * half }
}
