//! The nearest point of a path: station and errors of a vehicle.
//!
//! The foot `s` of a position `p` solves `(p - r(s)) . r'(s) = 0`, by Newton's method: the left side's slope is
//! `-(1 - curvature * e1)`. With a hint (the last station) the search walks downhill in distance from there. So it
//! stays on its branch where a road crosses itself or runs back beside itself. Without one it searches the whole road.
//! A wrong heading counts like a distance there, so that of two crossing or opposing lanes the vehicle's own is found.

use super::grid::yaw_at;
use super::spline::evaluate;
use super::{Path, wrap_angle};

/// Length that stands for a heading error in a global search: driving against the road's direction counts as 6 m.
const HEADING_LENGTH: f64 = 3.0;
/// Cells from one look to the next in a global search (2 m).
const STRIDE: usize = 8;
/// A foot found from a hint that is farther away than this is checked against the whole road (m).
const LOST: f64 = 10.0;

/// Position along the path of a projected point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Where {
    /// Beside the path.
    Beside,
    /// Before the start of an open path; its first tangent was extended.
    BeforeStart,
    /// Beyond the end of an open path; its last tangent was extended.
    BeyondEnd,
}

/// A position's foot on a path and its errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// Arc length of the foot in m. Closed path: in `[0, length)`. Open path: negative before the start and over
    /// the length beyond the end, along the extended tangent.
    pub station: f64,
    /// Lateral error in m, positive to the left of the path.
    pub e1: f64,
    /// Yaw error in rad, in (-pi, pi].
    pub e2: f64,
    /// The path's curvature at the foot in 1/m (0 on an extension).
    pub curvature: f64,
    /// Change of the path's curvature per arc length at the foot in 1/m2 (0 on an extension).
    pub curvature_rate: f64,
    /// Beside the path or beyond its ends.
    pub place: Where,
}

impl Projection {
    /// Rates of `e1` and `e2` (m/s, rad/s) of a vehicle with this velocity in body axes (m/s) and yaw rate (rad/s):
    ///
    /// ```text
    /// e1' = vx sin e2 + vy cos e2,    e2' = r - curvature s',    s' = (vx cos e2 - vy sin e2) / (1 - curvature e1)
    /// ```
    ///
    /// Source: Rajamani, Vehicle Dynamics and Control, ch. 2.5, without its small angles.
    #[must_use]
    pub fn error_rates(&self, vx: f64, vy: f64, yaw_rate: f64) -> (f64, f64) {
        let (sin, cos) = self.e2.sin_cos();
        // A point beyond the centre of curvature has no foot on the path: bounded, not inverted.
        let stretch = (1.0 - self.curvature * self.e1).max(0.1);
        let station_rate = (vx * cos - vy * sin) / stretch;
        (vx * sin + vy * cos, yaw_rate - self.curvature * station_rate)
    }
}

impl Path {
    /// Projects a pose (m, m, rad) onto the path. `hint` is a station near the foot, usually the last one. Without it,
    /// the whole road is searched (about ten microseconds per kilometre) and the heading counts. A pose that is not
    /// finite gives errors that are not finite, at the hint.
    #[must_use]
    pub fn project(&self, x: f64, y: f64, yaw: f64, hint: Option<f64>) -> Projection {
        let p = [x - self.origin[0], y - self.origin[1]];
        if !(x.is_finite() && y.is_finite()) {
            let station = hint.filter(|hint| hint.is_finite()).unwrap_or(0.0);
            let e2 = wrap_angle(yaw);
            return Projection {
                station,
                e1: f64::NAN,
                e2,
                curvature: self.curvature(station),
                curvature_rate: self.curvature_rate(station),
                place: Where::Beside,
            };
        }
        match hint.filter(|hint| hint.is_finite()) {
            None => self.project_globally(p, yaw),
            Some(hint) => {
                let near = self.foot(p, yaw, self.downhill(p, self.locate(hint).cell));
                let distance = near.e1.hypot(self.beyond(&near));
                if distance <= LOST {
                    return near;
                }
                let global = self.project_globally(p, yaw);
                if global.e1.hypot(self.beyond(&global)) < 0.5 * distance { global } else { near }
            }
        }
    }

    /// Metres along the extended tangent beyond an end of the path; negative before its start.
    fn beyond(&self, foot: &Projection) -> f64 {
        match foot.place {
            Where::Beside => 0.0,
            Where::BeforeStart => foot.station,
            Where::BeyondEnd => foot.station - self.length,
        }
    }

    fn project_globally(&self, p: [f64; 2], yaw: f64) -> Projection {
        let direction = [yaw.cos(), yaw.sin()];
        let cost = |node: usize| {
            let cell = &self.cells[node];
            let (sin, cos) = cell.yaw[0].sin_cos();
            let agreement = direction[0] * cos + direction[1] * sin;
            let turned = if agreement.is_nan() {
                0.0
            } else {
                2.0 * HEADING_LENGTH * HEADING_LENGTH * (1.0 - agreement)
            };
            self.squared_distance(p, node) + turned
        };
        let count = self.cells.len();
        let looks = || (0..count).step_by(STRIDE).chain([count - 1]);
        let least = looks().map(cost).fold(f64::INFINITY, f64::min);
        // A look lies at most half a stride from the best station near it; heading changes little over that.
        let reach = least.sqrt() + STRIDE as f64 * self.step;
        let mut best: Option<(f64, Projection)> = None;
        for look in looks().filter(|&look| cost(look) <= reach * reach) {
            let foot = self.foot(p, yaw, self.downhill(p, look));
            let along = self.beyond(&foot);
            let turned = if foot.e2.is_nan() {
                0.0
            } else {
                2.0 * HEADING_LENGTH * HEADING_LENGTH * (1.0 - foot.e2.cos())
            };
            let cost = foot.e1 * foot.e1 + along * along + turned;
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, foot));
            }
        }
        // There is always a look with the least cost; positions so far away that costs overflow start at 0.
        best.map_or_else(|| self.foot(p, yaw, 0), |(_, foot)| foot)
    }

    /// Walks from node to node while the distance falls.
    fn downhill(&self, p: [f64; 2], start: usize) -> usize {
        let count = self.cells.len();
        let mut node = start;
        let mut here = self.squared_distance(p, node);
        let mut direction: Option<bool> = None;
        for _ in 0..count {
            let next = |forward: bool| match (forward, self.periodic) {
                (true, true) => Some((node + 1) % count),
                (false, true) => Some((node + count - 1) % count),
                (true, false) => (node + 1 < count).then_some(node + 1),
                (false, false) => node.checked_sub(1),
            };
            let step = [true, false]
                .into_iter()
                .filter(|&forward| direction.is_none_or(|chosen| chosen == forward))
                .filter_map(|forward| {
                    next(forward).map(|index| (self.squared_distance(p, index), index, forward))
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match step {
                Some((there, index, forward)) if there < here => {
                    (node, here, direction) = (index, there, Some(forward));
                }
                _ => break,
            }
        }
        node
    }

    #[inline]
    fn squared_distance(&self, p: [f64; 2], node: usize) -> f64 {
        let cell = &self.cells[node];
        let (dx, dy) = (p[0] - cell.x[0], p[1] - cell.y[0]);
        dx * dx + dy * dy
    }

    /// The foot near a node that is nearer than its neighbours: safeguarded Newton between those.
    fn foot(&self, p: [f64; 2], yaw: f64, node: usize) -> Projection {
        let around = node as f64 * self.step;
        let (mut low, mut high) = (around - self.step, around + self.step);
        if !self.periodic {
            low = low.max(0.0);
            // The last node is a cell's end, not a cell's start.
            high = high.min(self.length);
        }
        let mut station = around;
        for _ in 0..30 {
            let (along, slope) = self.along(p, station);
            if along > 0.0 {
                low = station;
            } else {
                high = station;
            }
            let newton = station + along / slope;
            let next =
                if slope > 0.0 && newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
            let moved = (next - station).abs();
            station = next;
            if moved < 1e-12 * self.length.max(1.0) {
                break;
            }
        }
        let spot = self.locate(station);
        let cell = &self.cells[spot.cell];
        let [path_yaw, mut curvature, mut curvature_rate] = yaw_at(&cell.yaw, spot.offset);
        let (sin, cos) = path_yaw.sin_cos();
        let (dx, dy) = (p[0] - evaluate(&cell.x, spot.offset)[0], p[1] - evaluate(&cell.y, spot.offset)[0]);
        let along = dx * cos + dy * sin;
        let mut place = Where::Beside;
        let tiny = 1e-9 * self.length.max(1.0);
        if !self.periodic {
            if station <= tiny && along < -tiny {
                place = Where::BeforeStart;
                station = along;
            } else if station >= self.length - tiny && along > tiny {
                place = Where::BeyondEnd;
                station = self.length + along;
            }
            if place != Where::Beside {
                (curvature, curvature_rate) = (0.0, 0.0);
            }
        } else {
            station = station.rem_euclid(self.length);
            if station >= self.length {
                station = 0.0;
            }
        }
        Projection {
            station,
            e1: dy * cos - dx * sin,
            e2: wrap_angle(yaw - path_yaw),
            curvature,
            curvature_rate,
            place,
        }
    }

    /// `(p - r) . t` with the tangent `t` of the yaw angle, and its negative derivative `1 - curvature * e1`.
    fn along(&self, p: [f64; 2], station: f64) -> (f64, f64) {
        let spot = self.locate(station);
        let cell = &self.cells[spot.cell];
        let [yaw, curvature, _] = yaw_at(&cell.yaw, spot.offset);
        let (sin, cos) = yaw.sin_cos();
        let (ex, ey) = (p[0] - evaluate(&cell.x, spot.offset)[0], p[1] - evaluate(&cell.y, spot.offset)[0]);
        (ex * cos + ey * sin, 1.0 - curvature * (ey * cos - ex * sin))
    }
}
