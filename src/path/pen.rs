//! A pen that draws a course along lines: straights, rounded corners, U-turns.
//!
//! A corner between two lines is clothoid, arc, clothoid, symmetric to the corner. It takes the same tangent
//! length `T` of both lines; from the chord `c` of the rounding and its angle `theta`, `T = c / (2 cos(theta / 2))`.
//! The rest of a line between two corners is straight, so a course stays on its lanes exactly.

use super::sample::RoadClass;
use super::segment::{Course, Pose, Rough, Segment};
use super::wrap_angle;
use std::f64::consts::PI;

/// Rounding of a corner or a U-turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rounding {
    /// Radius of the arc in m.
    pub radius: f64,
    /// Length of a clothoid in m.
    pub transition: f64,
    /// Class of the road.
    pub class: RoadClass,
    /// Speed limit in m/s.
    pub speed: f64,
}

/// Radius of the swerve that makes room for a U-turn in m.
const SWERVE_RADIUS: f64 = 20.0;
/// Length of the clothoid into a swerve in m.
const SWERVE_TRANSITION: f64 = 6.0;

/// The pen: where it is, and what it has drawn.
pub(super) struct Pen {
    start: Pose,
    at: Pose,
    segments: Vec<Segment>,
    rough: Vec<Rough>,
    /// Class and speed limit of the straights to come.
    pub straight: (RoadClass, f64),
}

impl Pen {
    pub fn new(start: Pose, straight: (RoadClass, f64)) -> Self {
        Self { start, at: start, segments: Vec::new(), rough: Vec::new(), straight }
    }

    /// Pose of the pen.
    pub fn pose(&self) -> Pose {
        self.at
    }

    /// Length drawn in m.
    pub fn length(&self) -> f64 {
        self.segments.iter().map(|segment| segment.length).sum()
    }

    /// Draws a straight.
    pub fn straight(&mut self, length: f64) {
        assert!(length >= -1e-9, "a course's straight of {length} m: two corners overlap at {:?}", self.at);
        if length > 1e-9 {
            self.draw(length, 0.0, 0.0, self.straight);
        }
    }

    /// Draws straight on towards a vertex and round it, into the direction `yaw`.
    pub fn corner(&mut self, vertex: [f64; 2], yaw: f64, rounding: Rounding) {
        let angle = wrap_angle(yaw - self.at.yaw);
        let shape = corner_shape(angle, rounding);
        let tangent = tangent_length(&shape, angle);
        let (dx, dy) = (vertex[0] - self.at.x, vertex[1] - self.at.y);
        let (sin, cos) = self.at.yaw.sin_cos();
        let off = dy * cos - dx * sin;
        assert!(off.abs() < 1e-6, "a course's vertex {vertex:?} lies {off} m beside its line");
        self.straight(dx * cos + dy * sin - tangent);
        for [length, from, to] in shape {
            if length > 1e-9 {
                self.draw(length, from, to, (rounding.class, rounding.speed));
            }
        }
        // The corner ends on the next line; say so exactly, so that rounding does not add up along the course.
        let end = self.at.yaw;
        self.at = Pose { x: vertex[0] + tangent * end.cos(), y: vertex[1] + tangent * end.sin(), yaw: end };
    }

    /// Draws a U-turn that ends `displacement` m beside its start, to the left if positive. It first swerves to the
    /// other side by the necessary distance.
    pub fn u_turn(&mut self, displacement: f64, rounding: Rounding) {
        let side = displacement.signum();
        let (mut low, mut high) = (0.0, SWERVE_RADIUS);
        let width = |swerve: f64| {
            let end = draw_shape(&u_turn_shape(side, swerve, rounding));
            side * end.y
        };
        let wanted = displacement.abs();
        assert!(
            width(low) >= wanted && width(high) <= wanted,
            "no U-turn of {rounding:?} ends {wanted} m beside"
        );
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if width(middle) > wanted { low = middle } else { high = middle }
        }
        for [length, from, to] in u_turn_shape(side, 0.5 * (low + high), rounding) {
            self.draw(length, from, to, (rounding.class, rounding.speed));
        }
    }

    /// Makes everything drawn since `from` an uneven stretch.
    pub fn roughen(&mut self, from: f64, seed: u64) {
        self.rough.push(Rough { from, to: self.length(), seed });
    }

    /// The course.
    pub fn finish(self, closed: bool) -> Course {
        Course { start: self.start, segments: self.segments, rough: self.rough, closed }
    }

    fn draw(&mut self, length: f64, from: f64, to: f64, (class, speed): (RoadClass, f64)) {
        let segment = Segment { length, start_curvature: from, end_curvature: to, class, speed };
        self.at = segment.pose(self.at, length);
        self.segments.push(segment);
    }
}

/// A segment of a shape: length, curvature at start and end.
type Piece = [f64; 3];

/// Clothoid, arc, clothoid. Small angles have no arc and shorter clothoids.
fn corner_shape(angle: f64, rounding: Rounding) -> [Piece; 3] {
    let curvature = angle.signum() / rounding.radius;
    let transition = rounding.transition.min(rounding.radius * angle.abs());
    let arc = rounding.radius * angle.abs() - transition;
    [[transition, 0.0, curvature], [arc, curvature, curvature], [transition, curvature, 0.0]]
}

/// Length of the tangents of a corner in m.
pub(super) fn corner_tangent(angle: f64, rounding: Rounding) -> f64 {
    tangent_length(&corner_shape(angle, rounding), angle)
}

fn tangent_length(shape: &[Piece], angle: f64) -> f64 {
    let end = draw_shape(shape);
    end.x.hypot(end.y) / (2.0 * (0.5 * angle).cos())
}

/// Swerve, turn, swerve back; the arc of each swerve is `swerve` m long.
fn u_turn_shape(side: f64, swerve: f64, rounding: Rounding) -> [Piece; 7] {
    let (out, turn) = (-side / SWERVE_RADIUS, side / rounding.radius);
    let l = rounding.transition;
    let turned = 2.0 * (0.5 * out * SWERVE_TRANSITION + out * swerve) + (out + turn) * l;
    let arc = (side * PI - turned) / turn;
    [
        [SWERVE_TRANSITION, 0.0, out],
        [swerve, out, out],
        [l, out, turn],
        [arc, turn, turn],
        [l, turn, out],
        [swerve, out, out],
        [SWERVE_TRANSITION, out, 0.0],
    ]
}

/// End of a shape that begins at the origin towards x.
fn draw_shape(shape: &[Piece]) -> Pose {
    let origin = Pose { x: 0.0, y: 0.0, yaw: 0.0 };
    shape.iter().fold(origin, |pose, &[length, start_curvature, end_curvature]| {
        let class = RoadClass::Straight;
        Segment { length, start_curvature, end_curvature, class, speed: 0.0 }.pose(pose, length)
    })
}
