//! Checks of a road's points: repairs, refusals, closure.

use super::error::{InputPlace, PathError};
use super::noise::{PointNoise, middle};
use super::note::Note;
use super::read::Accuracy;
use super::sample::{Closure, PathOptions, Sample, Smoothing};
use super::smooth::{Goal, smooth};
use super::spline::{Knot, QuinticSpline, Vector, distance};
use super::stops::{WIDTHS, usual_spacing, without_stops};
use super::straight::fill;
use super::wrap_angle;
use crate::numerics::statistics::upper_median;
use std::borrow::Cow;

/// Distance below which a point is the same as the one before (m).
const SAME: f64 = 1e-6;
/// Largest disagreement of headings and curvatures with the points at which they still hold (rad).
const DISAGREEMENT: f64 = 0.02;
/// Change of direction between two chords from which on a road is out of order (rad).
const TURNS_BACK: f64 = 2.2;
/// Shortest road, and largest median spacing: beyond them the unit is another (m).
const SHORTEST: f64 = 1.0;
const SPACING: f64 = 500.0;
const LONGEST_STRAIGHT: f64 = 50e3;

/// A road that is fit to be a path.
pub(super) struct CheckedRoad {
    pub samples: Vec<Sample>,
    pub periodic: bool,
    pub notes: Vec<Note>,
    /// The curve relative to `origin`.
    pub curve: QuinticSpline,
    pub origin: Vector,
}

/// Tightest bend of a road that noise leaves drivable in m.
const TIGHTEST: f64 = 2.0;
/// Roads without stops that are drawn at most.
const MORE_WIDTHS: usize = 4;
/// Radius of the smallest circle of a small car in m.
const TURNING_CIRCLE: f64 = 4.5;

/// Checks and repairs points, and draws the curve.
pub(super) fn check(
    mut samples: Vec<Sample>,
    options: &PathOptions,
    accuracy: Accuracy,
) -> Result<CheckedRoad, PathError> {
    for (index, sample) in samples.iter().enumerate() {
        check_values(sample, index)?;
    }
    let stood = drive_on(&mut samples)?;
    let mut road = measured_and_drawn(samples, options, accuracy)?;
    road.notes.extend(stood.map(Note::info));
    // Of a lap both are one place, and a stretch that nobody gets through lies between.
    if let (true, [first, .., last]) = (road.periodic, &mut road.samples[..])
        && (first.speed, last.speed) == (Some(0.0), Some(0.0))
    {
        (first.speed, last.speed) = (None, None);
        road.notes
            .push(Note::info("the speed is 0 where the lap begins and ends, and is not taken from there"));
    }
    Ok(road)
}

/// The road through points, or, by what is asked of it, near those that are noisy.
fn measured_and_drawn(
    samples: Vec<Sample>,
    options: &PathOptions,
    accuracy: Accuracy,
) -> Result<CheckedRoad, PathError> {
    // Original indices, for messages.
    let samples: Vec<(usize, Sample)> = samples.into_iter().enumerate().collect();
    // Headings and curvatures tell the road better than its points.
    let posed = || samples.iter().all(|(_, sample)| sample.yaw.is_some() && sample.curvature.is_some());
    let noise = || measured(&samples);
    match options.smoothing {
        Smoothing::AsAccurate if !posed() => {
            let noise = noise();
            drawn(samples.clone(), options, accuracy, noise)
                .or_else(|error| without_wander(&samples, options, accuracy).ok_or(error))
        }
        Smoothing::Within(value) if value > 0.0 => match drawn(samples.clone(), options, accuracy, None) {
            // Points in driving order turn back where their noise is larger than their spacing.
            Err(error @ PathError::TurnsBack { .. }) => match noise() {
                Some(noise) => drawn(samples, options, accuracy, Some(noise)),
                None => Err(error),
            },
            other => other,
        },
        _ => drawn(samples, options, accuracy, None),
    }
}

fn measured(samples: &[(usize, Sample)]) -> Option<PointNoise> {
    PointNoise::measure(&samples.iter().map(|(_, sample)| [sample.x, sample.y]).collect::<Vec<_>>())
}

/// The road of a drive that stopped, if it is one: its stops are points.
fn without_wander(
    samples: &[(usize, Sample)],
    options: &PathOptions,
    accuracy: Accuracy,
) -> Option<CheckedRoad> {
    let (spacing, mut before) = (usual_spacing(samples), samples.len());
    let found = WIDTHS.iter().filter_map(|width| {
        let kept = without_stops(samples, *width, spacing)?;
        if std::mem::replace(&mut before, kept.len()) == kept.len() {
            return None;
        }
        let (left_out, noise) = (samples.len() - kept.len(), measured(&kept));
        let mut road = drawn(kept, options, accuracy, noise).ok()?;
        road.notes.push(Note::info(format!(
            "{left_out} point(s) left out where the vehicle stood or crawled: a stop is one point, the mean of those \
             within {width} m of one another"
        )));
        Some(road)
    });
    // A receiver's wander that is left is a bend that no car drives: a few more widths are tried, for each takes a while.
    let mut gentlest: Option<(f64, CheckedRoad)> = None;
    for road in found.take(MORE_WIDTHS) {
        let bend = tightest(&road.curve);
        if gentlest.as_ref().is_none_or(|(other, _)| bend < *other) {
            gentlest = Some((bend, road));
        }
        if bend * TURNING_CIRCLE < 1.0 {
            break;
        }
    }
    gentlest.map(|(_, road)| road)
}

/// The road through points, or near those that have `noise`.
fn drawn(
    samples: Vec<(usize, Sample)>,
    options: &PathOptions,
    accuracy: Accuracy,
    noise: Option<PointNoise>,
) -> Result<CheckedRoad, PathError> {
    let mut notes: Vec<Note> = Vec::new();
    let mut same = SAME;
    if let Smoothing::Within(value) = options.smoothing {
        if !(0.0..=5.0).contains(&value) {
            return Err(PathError::Tolerance { value });
        }
        // Points closer than their noise have no direction between them: a vehicle at rest, say.
        if noise.is_none() {
            same = (2.0 * value).max(SAME);
        }
    }
    let mut kept: Vec<(usize, Sample)> = Vec::with_capacity(samples.len());
    let total = samples.len();
    for (index, sample) in samples {
        let repeats =
            kept.last().is_some_and(|(_, last)| distance([last.x, last.y], [sample.x, sample.y]) < same);
        if !repeats {
            kept.push((index, sample));
        }
    }
    if kept.len() < total {
        notes.push(Note::info(if same > SAME {
            format!("{} point(s) dropped that lie within {same} m of the one before", total - kept.len())
        } else {
            format!("{} point(s) dropped that repeat the one before", total - kept.len())
        }));
    }
    if kept.len() < 2 {
        return Err(PathError::TooFewPoints { place: InputPlace::default(), count: kept.len(), needed: 2 });
    }
    let position = |point: &(usize, Sample)| [point.1.x, point.1.y];
    let mut spacings: Vec<f64> =
        kept.windows(2).map(|pair| distance(position(&pair[0]), position(&pair[1]))).collect();
    let median = upper_median(&mut spacings);
    let long = spacings.iter().sum::<f64>();
    // Two points are a straight: it has no shape that is lost between them.
    let farthest = if kept.len() == 2 { LONGEST_STRAIGHT } else { SPACING };
    if long < SHORTEST || median > farthest {
        return Err(PathError::SuspiciousUnit { place: InputPlace::default(), median, long, unit: "m" });
    }
    let first = position(&kept[0]);
    let repeated_start = kept.len() > 3 && distance(position(&kept[kept.len() - 1]), first) < same;
    let periodic = match options.closure {
        Closure::Open => false,
        Closure::Closed => true,
        Closure::Detect => {
            let ends = if repeated_start { &kept[..kept.len() - 1] } else { &kept[..] };
            let seam = leads_into_start(ends, noise.as_ref(), median);
            if repeated_start && seam == Seam::Turns {
                notes.push(Note::warning(
                    "the road ends where it begins, but in another direction: taken as open; closed on demand",
                ));
            }
            // Of a few points nobody knows how smooth the road is.
            seam == Seam::Smooth || repeated_start && seam == Seam::Apart
        }
    };
    if periodic && repeated_start {
        kept.pop();
    }
    if periodic && kept.len() < 3 {
        return Err(PathError::TooFewPoints { place: InputPlace::default(), count: kept.len(), needed: 3 });
    }
    notes.extend(fill(&mut kept, median, periodic)?);
    refuse_turning_back(&directed(&kept, noise.as_ref(), periodic), periodic).map_err(
        |error| match &noise {
            Some(noise) => noise.refusal("turns back on itself".into()),
            None => error,
        },
    )?;
    if !periodic && options.closure == Closure::Detect {
        notes.extend(passes_its_start(&kept, median).map(Note::warning));
    }

    let samples: Vec<Sample> = kept.into_iter().map(|(_, sample)| sample).collect();
    let origin = first;
    let points: Vec<Vector> =
        samples.iter().map(|sample| [sample.x - origin[0], sample.y - origin[1]]).collect();
    let (tolerance, why) = match (options.smoothing, accuracy) {
        (Smoothing::None, _) | (Smoothing::AsAccurate, Accuracy::Exact) => (None, ""),
        (Smoothing::Within(value), _) => (Some(value), ""),
        (Smoothing::AsAccurate, Accuracy::Digit(digit)) => {
            (rounding(digit, median), ", the rounding of the coordinates")
        }
        (Smoothing::AsAccurate, Accuracy::Measured(value)) => {
            (Some(value), ", the accuracy of racetrack-database")
        }
    };
    let (goal, why) = match &noise {
        // Unless the file's own accuracy is about that of its points.
        Some(noise)
            if !matches!(options.smoothing, Smoothing::Within(_))
                && tolerance.is_none_or(|known| noise.rms() > 1.5 * known) =>
        {
            (Some(Goal::Nearest(noise.rms())), ", by their measured noise")
        }
        _ => (tolerance.map(Goal::Within), why),
    };
    let along = noise.as_ref().map(|noise| noise.means(&points, periodic));
    let pinned = !matches!(options.smoothing, Smoothing::Within(_));
    let curve = poses(&samples, &points, periodic, &mut notes).filter(|_| pinned).unwrap_or_else(|| {
        let smoothed = goal.and_then(|goal| smooth(&points, along.as_deref(), periodic, goal));
        if let (Some(goal), Some(curve)) = (goal, &smoothed) {
            let at_marks = curve.at_marks();
            let distances = || at_marks.iter().zip(&points).map(|(at, point)| distance(*at, *point));
            let farthest = 1e3 * distances().fold(0.0, f64::max);
            let rms = match goal {
                Goal::Within(tolerance) => tolerance,
                Goal::Nearest(_) => (distances().map(|d| d * d).sum::<f64>() / points.len() as f64).sqrt(),
            };
            notes.push(Note::info(format!(
                "smoothed: {:.1} mm RMS from the points{why}; {farthest:.1} mm at most",
                1e3 * rms
            )));
        }
        smoothed.unwrap_or_else(|| {
            let curve = QuinticSpline::through(&points, periodic);
            if let Some(error) = wobble(&curve) {
                notes.push(Note::warning(format!(
                    "the curvature wobbles by {error:.4} 1/m from point to point: the points look noisy; give a \
                     smoothing tolerance of about their noise"
                )));
            }
            curve
        })
    });
    if let Some(noise) = &noise {
        let tightest = tightest(&curve);
        if tightest * TIGHTEST > 1.0 {
            return Err(noise.refusal(format!("has bends of {:.2} m radius", 1.0 / tightest)));
        }
    }
    Ok(CheckedRoad { samples, periodic, notes, curve, origin })
}

impl PointNoise {
    fn refusal(&self, shape: String) -> PathError {
        PathError::Noise { place: InputPlace::default(), rms: self.rms(), shape }
    }
}

/// Points that give the road's direction: those kept or, for noisy ones, means of them.
fn directed<'a>(
    kept: &'a [(usize, Sample)],
    noise: Option<&PointNoise>,
    periodic: bool,
) -> Cow<'a, [(usize, Sample)]> {
    let Some(noise) = noise else { return kept.into() };
    let points: Vec<Vector> = kept.iter().map(|(_, sample)| [sample.x, sample.y]).collect();
    let means = noise.means(&points, periodic);
    let at = |i: usize| (kept[i].0, Sample::at(means[i][0], means[i][1]));
    let last = kept.len() - 1;
    (0..=last - noise.stride().min(last)).step_by(noise.stride()).map(at).chain([at(last)]).collect()
}

/// Largest curvature at the knots in 1/m.
fn tightest(curve: &QuinticSpline) -> f64 {
    curve.knots.iter().map(|knot| curvature(knot).abs()).fold(0.0, f64::max)
}

/// Curvature at a knot in 1/m.
fn curvature(knot: &Knot) -> f64 {
    let speed = knot.d1[0].hypot(knot.d1[1]).max(1e-9);
    (knot.d1[0] * knot.d2[1] - knot.d1[1] * knot.d2[0]) / speed.powi(3)
}

/// RMS curvature error of an interpolating curve in 1/m, if it looks like noise: large, and of alternating sign.
fn wobble(curve: &QuinticSpline) -> Option<f64> {
    let seconds: Vec<f64> = curve
        .knots
        .windows(3)
        .map(|k| curvature(&k[0]) - 2.0 * curvature(&k[1]) + curvature(&k[2]))
        .collect();
    if seconds.len() < 20 {
        return None;
    }
    let count = seconds.len() as f64;
    // White noise has second differences of 6 times its variance, which change sign four times of five.
    let error = (seconds.iter().map(|second| second * second).sum::<f64>() / count / 6.0).sqrt();
    let changes = seconds.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count() as f64 / count;
    (error > 0.005 && changes > 0.65).then_some(error)
}

/// RMS distance by which rounding to `digit` moves points, if that matters at their spacing.
fn rounding(digit: f64, spacing: f64) -> Option<f64> {
    let sigma = digit / 12f64.sqrt();
    let curvature_error = 6f64.sqrt() * sigma / (spacing * spacing);
    (curvature_error > 1e-5).then_some(sigma * 2f64.sqrt())
}

/// The curve from heading and curvature, where the road has both and they fit its points.
fn poses(
    samples: &[Sample],
    points: &[Vector],
    periodic: bool,
    notes: &mut Vec<Note>,
) -> Option<QuinticSpline> {
    let column = |value: fn(&Sample) -> Option<f64>| samples.iter().map(value).collect::<Option<Vec<f64>>>();
    let (yaw, curvature) = match (column(|sample| sample.yaw), column(|sample| sample.curvature)) {
        (Some(yaw), Some(curvature)) => (yaw, curvature),
        (None, None) if samples.iter().all(|sample| sample.yaw.is_none() && sample.curvature.is_none()) => {
            return None;
        }
        _ => {
            notes.push(Note::info("columns yaw and curvature are not used: every point must have both"));
            return None;
        }
    };
    let worst = worst_disagreement(points, &yaw, &curvature, periodic);
    if worst < DISAGREEMENT {
        return Some(QuinticSpline::through_poses(points, &yaw, &curvature, periodic));
    }
    notes.push(Note::info(format!(
        "columns yaw and curvature are not used: they disagree with the points by up to {worst:.3} rad between \
         neighbours"
    )));
    None
}

/// Largest error of headings and curvatures against the chords between neighbouring points, in rad.
fn worst_disagreement(points: &[Vector], yaw: &[f64], curvature: &[f64], periodic: bool) -> f64 {
    let n = points.len();
    let last = if periodic { n } else { n - 1 };
    (0..last).fold(0.0, |worst: f64, i| {
        let j = (i + 1) % n;
        let (a, b) = (points[i], points[j]);
        let turn = wrap_angle(yaw[j] - yaw[i]);
        let chord = distance(a, b);
        let half = 0.5 * turn;
        let arc = if half.abs() < 1e-6 { chord } else { chord * half / half.sin() };
        // Of a clothoid: turn = mean curvature * arc, and the chord's direction is the mean heading less
        // arc * (difference of curvature) / 12.
        let from_turn = (turn - 0.5 * arc * (curvature[i] + curvature[j])).abs();
        let chord_yaw = yaw[i] + half - arc * (curvature[j] - curvature[i]) / 12.0;
        let from_chord = wrap_angle((b[1] - a[1]).atan2(b[0] - a[0]) - chord_yaw).abs();
        worst.max(from_turn).max(from_chord)
    })
}

fn check_values(sample: &Sample, index: usize) -> Result<(), PathError> {
    let columns: [(&'static str, Option<f64>, f64, f64, &'static str); 8] = [
        ("x", Some(sample.x), -1e7, 1e7, "m"),
        ("y", Some(sample.y), -1e7, 1e7, "m"),
        ("yaw", sample.yaw, -1e4, 1e4, "rad"),
        ("curvature", sample.curvature, -2.0, 2.0, "1/m"),
        ("speed", sample.speed, 0.0, 150.0, "m/s"),
        ("bank", sample.bank, -0.8, 0.8, "rad"),
        ("grade", sample.grade, -0.8, 0.8, "rad"),
        ("friction", sample.friction, 0.01, 3.0, "1 (a factor of the tyre's nominal grip)"),
    ];
    for (column, value, low, high, unit) in columns {
        let Some(value) = value else { continue };
        if !value.is_finite() {
            return Err(PathError::NotFinite { place: InputPlace::point(index), column, value });
        }
        if value < low || value > high {
            return Err(PathError::OutOfRange {
                place: InputPlace::point(index),
                column,
                value,
                low,
                high,
                unit,
            });
        }
    }
    Ok(())
}

/// How an end lies to the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Seam {
    /// Far from it, or the road has too few points to tell.
    Apart,
    /// Near, and the road turns there as nowhere else: a figure of eight, drawn from its crossing.
    Turns,
    /// Near, and ahead.
    Smooth,
}

/// Whether the end leads on into the start. Of noisy points, what is compared is means that are long against the noise.
fn leads_into_start(kept: &[(usize, Sample)], noise: Option<&PointNoise>, median: f64) -> Seam {
    let size = noise.map_or(1, PointNoise::stride);
    let n = kept.len();
    if n < 8 * size {
        return Seam::Apart;
    }
    let points: Vec<Vector> = kept.iter().map(|(_, sample)| [sample.x, sample.y]).collect();
    let mean = |from: usize| middle(points[from..from + size].iter().copied(), size);
    let [before, end, start, after] = [n - 2 * size, n - size, 0, size].map(mean);
    let usual = if noise.is_some() { 0.0 } else { median };
    let local = distance(before, end).max(distance(start, after)).max(usual);
    if distance(end, start) > 2.0 * local {
        return Seam::Apart;
    }
    let turns = |[a, b, c, d]: [Vector; 4]| turn(a, b, c) + turn(b, c, d);
    let along = (0..n / size - 3).map(|k| turns([k, k + 1, k + 2, k + 3].map(|block| mean(block * size))));
    let most = along.fold(0.0, f64::max);
    if turns([before, end, start, after]) < 0.5 + 1.5 * most { Seam::Smooth } else { Seam::Turns }
}

/// A note on a road that overlaps itself: a lap that was recorded a little too long.
fn passes_its_start(kept: &[(usize, Sample)], median: f64) -> Option<String> {
    let p = |i: usize| [kept[i].1.x, kept[i].1.y];
    let heading = |i: usize| (p(i + 1)[1] - p(i)[1]).atan2(p(i + 1)[0] - p(i)[0]);
    // It has left its start in between.
    let away = (0..kept.len()).find(|&i| distance(p(i), p(0)) > 10.0 * median)?;
    let again = (away..kept.len() - 1)
        .find(|&i| distance(p(i), p(0)) < 2.0 * median && wrap_angle(heading(i) - heading(0)).abs() < 0.5)?;
    Some(format!(
        "the road passes its start again at point {} of {}: for a closed road, remove the points from there on",
        kept[again].0 + 1,
        kept.len()
    ))
}

/// Speeds of 0 where a recorded drive stood: the road goes on, at the speeds before and after. A first and a last point at
/// rest stay. Gives a note, if there are any.
///
/// # Errors
/// The speed is 0 everywhere.
fn drive_on(samples: &mut [Sample]) -> Result<Option<String>, PathError> {
    let speeds: Vec<f64> = samples.iter().map(|sample| sample.speed.unwrap_or(f64::NAN)).collect();
    let moves = |speed: &f64| *speed != 0.0;
    let (Some(first), Some(last)) = (speeds.iter().position(moves), speeds.iter().rposition(moves)) else {
        return Err(PathError::Standing { place: InputPlace::default() });
    };
    let (mut count, mut before) = (0, first);
    // A road may begin and end at rest.
    for i in 1..speeds.len() - 1 {
        if moves(&speeds[i]) {
            before = i;
            continue;
        }
        // Before the first that moves, and behind the last, it is theirs.
        let after = speeds[i..].iter().position(moves).map_or(last, |rows| i + rows);
        let share = if after > before { (i - before) as f64 / (after - before) as f64 } else { 0.0 };
        let speed = speeds[before] + share * (speeds[after] - speeds[before]);
        samples[i].speed = Some(speed).filter(|speed| speed.is_finite());
        count += 1;
    }
    let words = || {
        format!(
            "the speed is 0 at {count} point(s), where the vehicle stood: taken from the points before and after"
        )
    };
    Ok((count > 0).then(words))
}

/// Change of direction from the chord `a` to `b` to that from `b` to `c`, without its sign, in rad.
fn turn(a: Vector, b: Vector, c: Vector) -> f64 {
    wrap_angle((c[1] - b[1]).atan2(c[0] - b[0]) - (b[1] - a[1]).atan2(b[0] - a[0])).abs()
}

fn refuse_turning_back(kept: &[(usize, Sample)], periodic: bool) -> Result<(), PathError> {
    let n = kept.len();
    let p = |i: usize| [kept[i % n].1.x, kept[i % n].1.y];
    let corners = if periodic { 0..n } else { 0..n - 2 };
    for i in corners {
        let (a, b, c) = (p(i), p(i + 1), p(i + 2));
        let turn = turn(a, b, c);
        if turn > TURNS_BACK {
            let place = InputPlace::point(kept[(i + 1) % n].0);
            return Err(PathError::TurnsBack { place, degrees: turn.to_degrees() });
        }
    }
    Ok(())
}
