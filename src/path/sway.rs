//! Roads that sway: their points have errors that last for some metres, as a receiver's that drifts.
//!
//! Such errors look like a road, and are smoothed as little as one. But their bends follow each other to and fro, each tight and
//! within less than a lane; a road's do not, nor do a slalom's, which leave the line by a vehicle's width, or a small track's, which
//! turn:
//!
//! ```text
//!     between two zeros of the curvature:  |curvature| > 1 / 100 m somewhere,  |turn| < 0.5 rad,  within 0.5 m of the chord
//! ```
//!
//! five times and more, one after the other.
//!
//! A curve through a corner of a line of points rings on both sides of it: as many bends, but the points lie on lines. Those that leave
//! theirs, by turns to the left and to the right, tell the one from the other.

use super::draw::curvature;
use super::spline::{QuinticSpline, Vector, distance};
use super::wrap_angle;
use std::fmt;

/// Bends one after the other.
const BENDS: usize = 5;
/// Widest bend that matters, m.
const WIDEST: f64 = 100.0;
/// Largest turn of a bend, rad, and largest distance from its chord, m.
const TURN: f64 = 0.5;
const ASIDE: f64 = 0.5;
/// Least distance of points from their chord that is no ringing, m.
const RINGS: f64 = 0.01;

/// The longest part of a road that sways.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sway {
    bends: usize,
    /// Stations, m.
    from: f64,
    to: f64,
    /// Bends that leave their chords, each to the other side than the one before, and the curvature of the newest of them in 1/m.
    sides: (usize, f64),
    /// Largest distance of a bend from its chord, m; its middle's station, m, and its turn, rad.
    aside: f64,
    widest: (f64, f64),
    /// Tightest bend, m.
    radius: f64,
}

impl fmt::Display for Sway {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "from station {:.0} to {:.0} m the road bends to and fro {} times within {:.2} m, with radii down to {:.1} m",
            self.from, self.to, self.bends, self.aside, self.radius
        )
    }
}

impl Sway {
    /// `None` of a road that neither sways nor rings.
    pub fn of(curve: &QuinticSpline) -> Option<Self> {
        Self::longest(curve).filter(|sway| sway.bends >= BENDS && sway.aside >= RINGS)
    }

    /// Station, m, and turn, rad, of the corner about which the curve rings; none of a road that sways.
    pub fn corner(&self) -> Option<(f64, f64)> {
        (self.sides.0 < BENDS).then_some(self.widest)
    }

    /// True of a curve with no two such bends one after the other: a sound road has none.
    pub fn is_none_in(curve: &QuinticSpline) -> bool {
        Self::longest(curve).is_none_or(|sway| sway.bends < 2)
    }

    fn longest(curve: &QuinticSpline) -> Option<Self> {
        let knots = &curve.knots;
        let bends: Vec<f64> = knots.iter().map(curvature).collect();
        let (mut start, mut station) = (0, 0.0);
        let (mut now, mut longest): (Option<Self>, Option<Self>) = (None, None);
        for end in 1..knots.len() {
            if end + 1 < knots.len() && bends[end] * bends[start] > 0.0 {
                continue;
            }
            let way: f64 = knots[start..=end].windows(2).map(|pair| distance(pair[0].p, pair[1].p)).sum();
            let heading = |at: usize| knots[at].d1[1].atan2(knots[at].d1[0]);
            let tightest = bends[start..end].iter().fold(0.0f64, |most, bend| most.max(bend.abs()));
            let points: Vec<Vector> = knots[start..=end].iter().map(|knot| knot.p).collect();
            let aside = beside_chord(&points);
            let turn = wrap_angle(heading(end) - heading(start)).abs();
            now = (tightest * WIDEST > 1.0 && turn < TURN && aside < ASIDE).then(|| {
                let before = now.unwrap_or(Self {
                    bends: 0,
                    from: station,
                    to: station,
                    sides: (0, 0.0),
                    aside: 0.0,
                    widest: (station, 0.0),
                    radius: WIDEST,
                });
                let leaves = aside >= RINGS && bends[start] * before.sides.1 <= 0.0;
                Self {
                    bends: before.bends + 1,
                    from: before.from,
                    to: station + way,
                    sides: if leaves { (before.sides.0 + 1, bends[start]) } else { before.sides },
                    aside: before.aside.max(aside),
                    widest: if aside > before.aside { (station + 0.5 * way, turn) } else { before.widest },
                    radius: before.radius.min(tightest.recip()),
                }
            });
            if now.is_some_and(|now| longest.is_none_or(|longest| now.bends > longest.bends)) {
                longest = now;
            }
            (start, station) = (end, station + way);
        }
        longest
    }
}

/// Largest distance of points from the line between the first and the last of them.
fn beside_chord(points: &[Vector]) -> f64 {
    let (Some(&from), Some(&to)) = (points.first(), points.last()) else { return 0.0 };
    let [x, y] = [to[0] - from[0], to[1] - from[1]];
    let length = x.hypot(y).max(1e-9);
    let aside = points.iter().map(|p| ((p[0] - from[0]) * y - (p[1] - from[1]) * x).abs() / length);
    aside.fold(0.0, f64::max)
}
