//! Straights without points: a map's line has points where it bends and none between, and a recorder may lose rows.
//!
//! Where the chord over a gap goes on as the road does on both sides, the road between is a straight, and gets points. Rows
//! lost in a bend of curvature `kappa` leave a chord that turns away from the road by
//!
//! ```text
//!     kappa L / 2    over a length L,    where neighbours with a spacing d turn by kappa d
//! ```
//!
//! A gap has many times the usual spacing, so that the one is many times the other; such a road is refused.

use super::error::{InputPlace, PathError};
use super::note::Note;
use super::sample::Sample;
use super::spline::distance;
use super::wrap_angle;

/// A gap is wider than this many median spacings ...
const GAP_SPACINGS: f64 = 8.0;
/// ... and wider than this (m).
const GAP_LEAST: f64 = 30.0;
/// Turns from point to point beside a gap that tell how the road turns there.
const BESIDE: usize = 3;
/// Largest turn at the end of a straight, as a multiple of those beside it ...
const TURNS: f64 = 2.0;
/// ... or in rad, of points on a line that are rounded.
const ROUNDED: f64 = 0.005;
/// New points on a straight: as far apart as so many median spacings, and not more of them than this.
const SPACINGS: f64 = 2.0;
const POINTS: f64 = 10_000.0;

/// Puts points on the straights of a road, given with their places in the file, whose median spacing in m is given.
/// `closed`: a straight may lead from the last point to the first.
///
/// # Errors
/// A gap that is no straight.
pub(super) fn fill(
    points: &mut Vec<(usize, Sample)>,
    median: f64,
    closed: bool,
) -> Result<Vec<Note>, PathError> {
    let count = points.len();
    let widest = (GAP_SPACINGS * median).max(GAP_LEAST);
    let mut notes = Vec::new();
    let mut filled = Vec::with_capacity(count);
    for i in 0..count {
        filled.push(points[i]);
        if i + 1 == count && !closed {
            break;
        }
        let ((_, from), (behind, to)) = (points[i], points[(i + 1) % count]);
        let gap = distance([from.x, from.y], [to.x, to.y]);
        if gap <= widest || count <= 2 {
            continue;
        }
        if !is_straight(points, i, closed) {
            return Err(PathError::Gap { place: InputPlace::point(behind), distance: gap, median });
        }
        notes.push(Note::info(format!(
            "no points on {gap:.0} m before point {} of {count}: a straight, as the road points along it on both sides",
            (i + 1) % count + 1
        )));
        let pieces = (gap / (SPACINGS * median).max(gap / POINTS)).ceil() as usize;
        filled.extend((1..pieces).map(|k| (behind, between(&from, &to, k as f64 / pieces as f64))));
    }
    *points = filled;
    Ok(notes)
}

/// Whether the chord from point `i` to the next goes on as the road does before and behind it.
fn is_straight(points: &[(usize, Sample)], i: usize, closed: bool) -> bool {
    let count = points.len() as isize;
    let heading = |k: isize| {
        let inside = closed || (0..count - 1).contains(&k);
        inside.then(|| {
            let [(_, from), (_, to)] = [k, k + 1].map(|k| points[k.rem_euclid(count) as usize]);
            (to.y - from.y).atan2(to.x - from.x)
        })
    };
    // Turn at the beginning of a chord.
    let turn = |k: isize| Some(wrap_angle(heading(k)? - heading(k - 1)?).abs());
    let i = i as isize;
    let before = (turn(i), (1..=BESIDE as isize).filter_map(|k| turn(i - k)).fold(0.0, f64::max));
    let behind = (turn(i + 1), (2..=1 + BESIDE as isize).filter_map(|k| turn(i + k)).fold(0.0, f64::max));
    [before, behind].iter().all(|(turn, beside)| turn.is_none_or(|turn| turn <= TURNS * beside + ROUNDED))
}

/// A point of the straight between two others, at a share of it.
pub(super) fn between(from: &Sample, to: &Sample, share: f64) -> Sample {
    let mixed = |a: f64, b: f64| a + share * (b - a);
    let both = |a: Option<f64>, b: Option<f64>| Some(mixed(a?, b?));
    let heading = (to.y - from.y).atan2(to.x - from.x);
    Sample {
        x: mixed(from.x, to.x),
        y: mixed(from.y, to.y),
        yaw: from.yaw.and(to.yaw).map(|_| heading),
        curvature: from.curvature.and(to.curvature).map(|_| 0.0),
        speed: both(from.speed, to.speed),
        bank: both(from.bank, to.bank),
        grade: both(from.grade, to.grade),
        friction: both(from.friction, to.friction),
        class: from.class,
    }
}
