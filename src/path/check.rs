//! Checks of a road's points: repairs, refusals, closure.

use super::accuracy::Accuracy;
use super::corners::{RoundedCorner, round};
use super::draw::{Outline, tightest};
use super::error::{InputPlace, PathError};
use super::noise::PointNoise;
use super::note::Note;
use super::sample::{Closure, PathOptions, RoadClass, Sample, Smoothing};
use super::seam::{Seam, TURNS_BACK};
use super::spline::{QuinticSpline, Vector, distance};
use super::stops::{WIDTHS, usual_spacing, without_stops};
use super::straight::fill;
use super::wrap_angle;
use crate::numerics::Fnv;
use crate::numerics::statistics::upper_median;
use std::borrow::Cow;
use std::f64::consts::PI;

/// Distance below which a point is the same as the one before (m).
const SAME: f64 = 1e-6;
/// Shortest road, and largest median spacing: beyond them the unit is another (m).
const SHORTEST: f64 = 1.0;
const SPACING: f64 = 500.0;
const LONGEST_STRAIGHT: f64 = 50e3;

/// A road that is fit to be a path.
pub(super) struct CheckedRoad {
    pub samples: Vec<Sample>,
    /// Places in the file of the samples.
    pub places: Vec<usize>,
    pub periodic: bool,
    pub notes: Vec<Note>,
    /// Those rounded.
    pub corners: Vec<RoundedCorner>,
    /// The curve relative to `origin`.
    pub curve: QuinticSpline,
    pub origin: Vector,
    /// Hash of the points as given.
    pub hash: u64,
}

/// Roads without stops that are drawn at most.
const MORE_WIDTHS: usize = 4;
/// Rounds of looking for corners at most.
const CORNER_ROUNDS: usize = 8;
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
    let mut hash = hash(&samples, accuracy);
    let stood = drive_on(&mut samples)?;
    let mut road = measured_and_drawn(samples, options, accuracy)?;
    if !road.corners.is_empty() {
        options.least_radius.iter().for_each(|radius| hash.add(&radius.to_le_bytes()));
    }
    road.hash = hash.value();
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
    let noise = || measured(&samples, accuracy);
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

fn measured(samples: &[(usize, Sample)], accuracy: Accuracy) -> Option<PointNoise> {
    let mut points: Vec<Vector> = samples.iter().map(position).collect();
    // A receiver slower than its log repeats its points: no smoother road, but fewer points.
    points.dedup_by(|point, before| distance(*before, *point) < SAME);
    PointNoise::measure(&points, accuracy.coarse_step())
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
        let (left_out, noise) = (samples.len() - kept.len(), measured(&kept, accuracy));
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
    let noise = noise.as_ref();
    let same = least_distance(options.smoothing, noise.is_some())?;
    let mut kept = without_repeats(samples, same, &mut notes);
    let median = median_spacing(&kept)?;
    let origin = position(&kept[0]);
    let repeated_start = kept.len() > 3 && distance(position(&kept[kept.len() - 1]), origin) < same;
    let points = || kept.iter().map(position).collect::<Vec<Vector>>();
    // A road that says itself that it is closed, or that ends elsewhere, needs no guess.
    let (periodic, guessed) = match options.closure {
        Closure::Open => (false, false),
        Closure::Closed => (true, false),
        Closure::Detect if repeated_start => {
            (closes_where_it_began(&points(), noise, median, &mut notes), false)
        }
        Closure::Detect => (Seam::of(&points(), noise, median) == Seam::Smooth, true),
    };
    if periodic && repeated_start {
        kept.pop();
    }
    if periodic && kept.len() < 3 {
        return Err(PathError::TooFewPoints { place: InputPlace::default(), count: kept.len(), needed: 3 });
    }
    if !(periodic && guessed) {
        return traced(kept, periodic, median, (options, accuracy, noise), notes);
    }
    let gap = distance(position(&kept[kept.len() - 1]), origin);
    let lies = format!("the last point lies {gap:.1} m from the first and leads into it");
    let with = |words: &str| notes.iter().cloned().chain([Note::info(format!("{lies}: {words}"))]).collect();
    let closed = with("taken as closed (--open: it is not)");
    traced(kept.clone(), true, median, (options, accuracy, noise), closed).or_else(|_| {
        // Nobody has said that it is closed.
        let open = with("taken as open all the same, for a closed road is refused there (--closed says why)");
        traced(kept, false, median, (options, accuracy, noise), open)
    })
}

/// The road through points that are closed or not, of a median spacing in m.
fn traced(
    mut kept: Vec<(usize, Sample)>,
    periodic: bool,
    median: f64,
    (options, accuracy, noise): (&PathOptions, Accuracy, Option<&PointNoise>),
    mut notes: Vec<Note>,
) -> Result<CheckedRoad, PathError> {
    notes.extend(fill(&mut kept, median, periodic)?);
    // Noise that turns no two chords back on each other leaves the points' own directions.
    let turning = noise.filter(|noise| noise.bend(median) * median > PI - TURNS_BACK);
    refuse_turning_back(&directed(&kept, turning, periodic), periodic).map_err(|error| match turning {
        Some(noise) => noise.refusal("turns back on itself".into()),
        None => error,
    })?;
    if periodic || options.closure == Closure::Detect {
        notes.extend(passes_its_start(&kept, median, periodic).map(Note::warning));
    }

    let mut outline = Outline::of(&kept, periodic, median, noise);
    let mut corners = Vec::new();
    let curve = match outline.told(options.smoothing, &mut notes) {
        Some(curve) => curve,
        None => {
            let mut about = Vec::new();
            let mut curve = outline.curve(options.smoothing, accuracy, &mut about)?;
            // Directions of noisy points are no corners.
            let radius = options.least_radius.filter(|_| noise.is_none_or(|noise| noise.step.is_some()));
            // What is near a corner is drawn anew with it, and may turn out to be one, too.
            for _ in 0..CORNER_ROUNDS {
                let Some((points, found)) = radius.and_then(|radius| round(&kept, &curve, periodic, radius))
                else {
                    break;
                };
                kept = points;
                corners.extend(found);
                outline = Outline::of(&kept, periodic, median, noise);
                about.clear();
                curve = outline.curve(options.smoothing, accuracy, &mut about)?;
            }
            corners.sort_by_key(|corner: &RoundedCorner| corner.row);
            notes.append(&mut about);
            curve
        }
    };
    let origin = position(&kept[0]);
    let (places, samples) = kept.into_iter().unzip();
    Ok(CheckedRoad { samples, places, periodic, notes, corners, curve, origin, hash: 0 })
}

/// Hash of points: that of the road, on every machine.
fn hash(samples: &[Sample], accuracy: Accuracy) -> Fnv {
    let mut hash = Fnv::new();
    let accuracy = match accuracy {
        Accuracy::Exact => [0.0; 2],
        Accuracy::Rounded { digit, step } => [digit.unwrap_or(0.0), step],
        Accuracy::Measured(rms) => [-rms; 2],
    };
    accuracy.iter().for_each(|number| hash.add(&f64::to_le_bytes(*number)));
    for Sample { x, y, yaw, curvature, speed, bank, grade, friction, class } in samples {
        for value in [*x, *y] {
            hash.add(&value.to_le_bytes());
        }
        for value in [yaw, curvature, speed, bank, grade, friction] {
            hash.add(&value.unwrap_or(f64::NAN).to_le_bytes());
        }
        hash.add(class.map_or("", RoadClass::name).as_bytes());
    }
    hash
}

fn position((_, sample): &(usize, Sample)) -> Vector {
    [sample.x, sample.y]
}

/// Distance below which a point repeats the one before, in m.
fn least_distance(smoothing: Smoothing, noisy: bool) -> Result<f64, PathError> {
    let Smoothing::Within(value) = smoothing else { return Ok(SAME) };
    if !(0.0..=5.0).contains(&value) {
        return Err(PathError::Tolerance { value });
    }
    // Points closer than their noise have no direction between them: a vehicle at rest, say.
    Ok(if noisy { SAME } else { (2.0 * value).max(SAME) })
}

/// The points less those that repeat the one before.
fn without_repeats(mut kept: Vec<(usize, Sample)>, same: f64, notes: &mut Vec<Note>) -> Vec<(usize, Sample)> {
    let total = kept.len();
    kept.dedup_by(|point, before| distance(position(before), position(point)) < same);
    if kept.len() < total {
        notes.push(Note::info(if same > SAME {
            format!("{} point(s) dropped that lie within {same} m of the one before", total - kept.len())
        } else {
            format!("{} point(s) dropped that repeat the one before", total - kept.len())
        }));
    }
    kept
}

/// Median spacing of the points, in m.
///
/// # Errors
/// Too few points; a road whose unit is not the metre.
fn median_spacing(kept: &[(usize, Sample)]) -> Result<f64, PathError> {
    if kept.len() < 2 {
        return Err(PathError::TooFewPoints { place: InputPlace::default(), count: kept.len(), needed: 2 });
    }
    let mut spacings: Vec<f64> =
        kept.windows(2).map(|pair| distance(position(&pair[0]), position(&pair[1]))).collect();
    let median = upper_median(&mut spacings);
    let long = spacings.iter().sum::<f64>();
    // Two points are a straight: it has no shape that is lost between them.
    let farthest = if kept.len() == 2 { LONGEST_STRAIGHT } else { SPACING };
    if long < SHORTEST || median > farthest {
        return Err(PathError::SuspiciousUnit { place: InputPlace::default(), median, long, unit: "m" });
    }
    Ok(median)
}

/// True if a road whose last point repeats the first is a lap.
fn closes_where_it_began(
    points: &[Vector],
    noise: Option<&PointNoise>,
    median: f64,
    notes: &mut Vec<Note>,
) -> bool {
    let turns = Seam::of(&points[..points.len() - 1], noise, median) == Seam::Turns;
    if turns {
        notes.push(Note::warning(
            "the road ends where it begins, but in another direction: taken as open; closed on demand",
        ));
    }
    // Of a few points nobody knows how smooth the road is.
    !turns
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

/// A note on a road that overlaps itself: a lap that was recorded a little too long.
fn passes_its_start(kept: &[(usize, Sample)], median: f64, periodic: bool) -> Option<String> {
    let p = |i: usize| [kept[i].1.x, kept[i].1.y];
    let heading = |i: usize| (p(i + 1)[1] - p(i)[1]).atan2(p(i + 1)[0] - p(i)[0]);
    // It has left its start in between.
    let leaves = |from: usize| (from..kept.len()).find(|&i| distance(p(i), p(0)) > 10.0 * median);
    let away = leaves(0)?;
    let again = (away..kept.len() - 1)
        .find(|&i| distance(p(i), p(0)) < 2.0 * median && wrap_angle(heading(i) - heading(0)).abs() < 0.5)?;
    // The end of a closed road comes to its start; of two laps in one, the first one does so as well.
    (!periodic || leaves(again).is_some()).then(|| format!(
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
