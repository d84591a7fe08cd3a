//! Relations that the columns of a log must satisfy, whatever the vehicle: otherwise a unit or a sign is wrong.
//!
//! ```text
//!     d(yaw)/dt = yaw_rate       |d(x, y)|/dt = vx       course(x, y) = yaw + slip       ay = vx * yaw_rate + ...
//!     d(e1)/dt = e1_rate = vy cos e2 + vx sin e2       d(e2)/dt = e2_rate = yaw_rate - curvature * vx
//!     steer = (l + K vx^2) * yaw_rate / vx               (steady cornering, Rajamani ch. 3.3)
//! ```

use super::clean_log::{CleanError, CleanLog, STANDING};
use super::finding::FindingSeverity;
use super::kinematics::{self, Told};
use super::units::{self, ACCELERATIONS, ANGLES, DEGREE, LENGTHS, LogUnit, Shown, UnitConclusion, sized};
use crate::numerics::statistics::{Slope, median, quantile, slope};
use crate::path::wrap_angle;
use crate::vehicle::GRAVITY;
use std::collections::BTreeMap;

/// Factors by which columns of the file were multiplied.
pub(super) type Factors = BTreeMap<&'static str, f64>;

/// Rows farther apart in time belong to two drives, s.
const ANOTHER_DRIVE: f64 = 9.9;

/// Metres in a degree of longitude, 111,000 at most: positions that move more slowly than this share of the speed are degrees.
const LARGEST_DEGREE: f64 = 1e-4;

/// A larger change of yaw from row to row is its wrapping.
const WRAP: f64 = 3.0;
/// Lateral accelerations that no vehicle on a road reaches, m/s2.
const IMPOSSIBLE: f64 = 40.0;

/// Ratio of the change of yaw to that of yaw rate's integral; `None` where the two hardly correlate, as without turns.
/// Compared over spans of time: from row to row noise exceeds the changes.
pub(super) fn turn_factor(time: &[f64], yaw: &[f64], yaw_rate: &[f64]) -> Option<f64> {
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let (mut since, mut asked, mut turned) = (0.0, 0.0, 0.0);
    for i in 1..time.len() {
        let step = time[i] - time[i - 1];
        let (by_rate, by_yaw) = (0.5 * (yaw_rate[i - 1] + yaw_rate[i]) * step, yaw[i] - yaw[i - 1]);
        // Not a number compares as neither.
        if by_yaw.abs() < WRAP && by_rate.is_finite() && step < ANOTHER_DRIVE {
            (since, asked, turned) = (since + step, asked + by_rate, turned + by_yaw);
        }
        if since >= BLOCK {
            (xx, xy, yy) = (xx + asked * asked, xy + asked * turned, yy + turned * turned);
            (since, asked, turned) = (0.0, 0.0, 0.0);
        }
    }
    if xy * xy < 0.5 * xx * yy || xx == 0.0 { None } else { Some(xy / xx) }
}

/// Time over which the way driven is taken for a chord, s.
const LONGEST_CHORD: f64 = 2.0;

/// Ratio of the way driven to that by speed and clock: the typical row of a moving vehicle.
pub(super) fn way_factor(time: &[f64], [x, y, vx]: [&[f64]; 3]) -> Option<f64> {
    let fast = 0.3 * quantile(vx.iter().map(|v| v.abs()).collect(), 0.95)?;
    // Positions are rounded and may come more slowly than rows: over a hundred rows that does not matter. Over a longer time the
    // way is no chord.
    let spacing = median(time.windows(2).map(|pair| pair[1] - pair[0]).collect())?;
    let longest = (LONGEST_CHORD / spacing).round().clamp(1.0, 100.0) as usize;
    let apart = (time.len() / 20).clamp(1, longest);
    let factor = |from: usize, to: usize| {
        let moved = (x[to] - x[from]).hypot(y[to] - y[from]);
        let said = 0.5 * (vx[from] + vx[to]).abs() * (time[to] - time[from]);
        (vx[from].abs() > fast && vx[to].abs() > fast && said > 0.0).then_some(moved / said)
    };
    median((apart..time.len()).step_by(1 + apart / 4).filter_map(|to| factor(to - apart, to)).collect())
}

/// [`way_factor`] of a log that has its columns.
fn way(log: &CleanLog) -> Option<f64> {
    let [x, y, vx] = ["x", "y", "vx"].map(|name| log.columns.get(name));
    way_factor(&log.time, [x?, y?, vx?])
}

/// True if yaw rate must be in degrees per second: as radians the vehicle would turn impossibly fast.
pub(super) fn impossible_yaw_rate(vx: &[f64], yaw_rate: &[f64]) -> bool {
    let lateral = vx.iter().zip(yaw_rate).map(|(v, rate)| (v * rate).abs()).collect();
    quantile(lateral, 0.98).is_some_and(|lateral| lateral > IMPOSSIBLE)
}

/// A factor that is, within 15 %, the one for a unit.
pub(super) fn near(factor: f64, unit: f64) -> bool {
    (factor / unit - 1.0).abs() < 0.15
}

/// Lateral acceleration up to which tyres are linear, m/s2.
const MILD: f64 = 3.0;
/// Ratio of the steering to the needed one that an effect can explain.
const PLAUSIBLE: std::ops::Range<f64> = 0.5..2.0;
/// The same where a speed in knots or mph would be taken for an effect: nothing else in the log tells its unit.
const SURE: std::ops::Range<f64> = 0.7..1.4;

/// Length of the stretches that are compared, s: longer than any delay, shorter than a bend.
const BLOCK: f64 = 0.5;

/// Means of a column over blocks of rows that all count.
fn blocks<'a>(log: &'a CleanLog, column: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    let size = ((BLOCK / log.step).round() as usize).max(1);
    column.chunks_exact(size).zip(log.valid.chunks_exact(size)).map(move |(values, valid)| {
        if valid.iter().all(|valid| *valid) { values.iter().sum::<f64>() / size as f64 } else { f64::NAN }
    })
}

/// Converts columns in foreign units, by their relations to others. To be called before all else.
pub(super) fn mend_units(log: &mut CleanLog, factors: &mut Factors) {
    let way = way(log);
    let lateral = lateral(log);
    let shown = Shown {
        way,
        station: station_factor(log),
        lateral: lateral.filter(|slope| slope.explained > 0.8).map(|slope| slope.factor),
        bend: bend(log).filter(|slope| slope.explained > 0.8).map(|slope| slope.factor),
        winding: winding(log).filter(|slope| slope.explained > 0.8).map(|slope| slope.factor),
    };
    let (mut speed, mut acceleration) = (sized(units::SPEEDS)[0], sized(ACCELERATIONS)[0]);
    match units::told(&shown) {
        UnitConclusion::Units(units) => {
            for (unit, columns, by) in [
                (units.speed, &["vx"][..], "vx"),
                (units.position, &["x", "y"], "x"),
                (units.station, &["station"], "station"),
                (units.acceleration, &["ay"], "ay"),
                (units.turn, &["yaw_rate"], "yaw_rate"),
                (units.curvature, &["curvature"], "curvature"),
                (units.curvature_rate, &["curvature_rate"], "curvature_rate"),
            ] {
                convert(log, factors, unit, columns, &evidence(by, unit, &shown));
            }
            (speed, acceleration) = (units.speed, units.acceleration);
        }
        UnitConclusion::Either(one, other) => {
            let words = format!(
                "the columns contradict one another: {}, or {}? Which one cannot be told; convert to SI units (scripts/import_log.py can)",
                one.words(),
                other.words()
            );
            log.find(FindingSeverity::Suspicion, "vx", words);
        }
        UnitConclusion::Si => {
            if let Some(way) = way.filter(|way| !(0.7..1.4).contains(way)) {
                let degrees = if way < LARGEST_DEGREE {
                    ". Are they latitude and longitude? Give metres to the east and north"
                } else {
                    ""
                };
                let factor = if way < 0.01 { format!("{way:.1e}") } else { format!("{way:.3}") };
                let words = format!(
                    "x and y move {factor} times as fast as vx says: one of them has another unit (m and m/s are needed){degrees}"
                );
                log.find(FindingSeverity::Suspicion, "vx", words);
            }
            // A poor ay in g is one all the same.
            let [_, g] = sized(ACCELERATIONS);
            if let Some(slope) = lateral.filter(|slope| near(slope.factor / g.1, 1.0)) {
                let by = format!("ay is {:.2} times vx * yaw_rate", slope.factor);
                convert(log, factors, g, &["ay"], &by);
                acceleration = g;
            }
        }
    }
    mend_others(log, factors, speed, acceleration);
    mend_errors(log, factors);
    mend_angles(log, factors);
}

/// The velocity across and the acceleration along the body, in units of their own. Where nothing tells, `ax` has that of `ay`.
/// A `vy` beside a converted `vx` is left out then: in the wrong unit it is taken for slip.
fn mend_others(log: &mut CleanLog, factors: &mut Factors, speed: LogUnit, acceleration: LogUnit) {
    let speeds = sized(units::SPEEDS);
    match kinematics::vy_factor(log) {
        Some((by, factor)) => {
            if let Some(unit) = units::foreign(factor, &speeds) {
                let by = if by == "y" { "x, y and yaw tell" } else { "ay tells" };
                convert(log, factors, unit, &["vy"], &format!("vy is {:.2} times what {by}", factor.abs()));
            }
        }
        None if speed.1 != 1.0 && log.columns.remove("vy").is_some() => {
            let words = format!("vx is in {}, and no column tells whether vy is: left out", speed.0);
            log.find(FindingSeverity::Warning, "vy", words);
        }
        None => {}
    }
    let told = kinematics::ax_factor(log);
    let unit = told.and_then(|(_, factor)| units::foreign(factor, &sized(ACCELERATIONS)));
    match (told, unit) {
        (Some((_, factor)), Some(unit)) => {
            let words = format!("ax is {:.3} times what the change of vx tells", factor.abs());
            convert(log, factors, unit, &["ax"], &words);
        }
        (None, _) if log.columns.contains_key("ax") => {
            convert(log, factors, acceleration, &["ax"], "ax is in the unit of ay");
        }
        _ => {}
    }
}

/// Evidence for a column's unit, in words.
fn evidence(column: &str, (_, unit): LogUnit, shown: &Shown) -> String {
    match column {
        "vx" => {
            let by = match shown {
                Shown { way: Some(_), .. } => "x and y move",
                Shown { station: Some(_), .. } => "the station moves",
                Shown { lateral: Some(_), .. } => "ay tells",
                _ => "the curvature tells",
            };
            format!("vx is {unit:.2} times as fast as {by}")
        }
        "x" => format!("x and y move {unit:.3} times as fast as vx says"),
        "station" => format!("the station moves {unit:.3} times as fast as vx says"),
        "ay" => "ay is a tenth of vx * yaw_rate".into(),
        "yaw_rate" => "yaw_rate is 57 times what ay tells".into(),
        "curvature_rate" => "curvature_rate is 1000 times what the curvature's change tells".into(),
        _ => "curvature is 1000 times what the turns tell".into(),
    }
}

/// Brings columns from a unit to SI, the first of them named; nothing where it is SI.
fn convert(log: &mut CleanLog, factors: &mut Factors, unit: LogUnit, columns: &[&'static str], why: &str) {
    let (name, size) = unit;
    if size == 1.0 {
        return;
    }
    let there: Vec<&str> =
        columns.iter().copied().filter(|column| log.columns.contains_key(column)).collect();
    for column in columns {
        scale(log, factors, column, 1.0 / size);
    }
    // The one that tells is named first.
    let Some(&column) = there.iter().find(|column| why.contains(**column)).or(there.first()) else { return };
    let others: Vec<&str> = there.into_iter().filter(|other| *other != column).collect();
    let with = if others.is_empty() { String::new() } else { format!(" ({} with it)", others.join(", ")) };
    let si = crate::signal::find(column).map_or("SI units", |signal| signal.unit.symbol);
    log.find(FindingSeverity::Warning, column, format!("{why}: taken as {name} and converted to {si}{with}"));
}

fn scale(log: &mut CleanLog, factors: &mut Factors, name: &'static str, factor: f64) {
    if let Some(column) = log.columns.get_mut(name) {
        column.iter_mut().for_each(|value| *value *= factor);
    }
    *factors.entry(name).or_insert(1.0) *= factor;
}

/// Ratio of the station's change to the way by speed and clock. It jumps where a lap ends.
fn station_factor(log: &CleanLog) -> Option<f64> {
    let (station, vx) = (log.columns.get("station")?, log.columns.get("vx")?);
    let still = vec![0.0; station.len()];
    way_factor(&log.time, [station, &still, vx])
}

/// Slope of the path's yaw rate over speed times curvature.
fn bend(log: &CleanLog) -> Option<Slope> {
    let [vx, rate, e2_rate, curvature] =
        ["vx", "yaw_rate", "e2_rate", "curvature"].map(|name| log.columns.get(name));
    let of_path = blocks(log, rate?).zip(blocks(log, e2_rate?)).map(|(rate, e2_rate)| rate - e2_rate);
    slope(blocks(log, vx?).zip(blocks(log, curvature?)).map(|(v, curvature)| v * curvature).zip(of_path))
}

/// Slope of the curvature's change over speed times its rate along the road.
fn winding(log: &CleanLog) -> Option<Slope> {
    let (vx, rate) = (log.columns.get("vx")?, log.columns.get("curvature_rate")?);
    change(log, "curvature", &vx.iter().zip(rate).map(|(v, rate)| v * rate).collect::<Vec<_>>())
}

/// Ratios among the errors to the path.
struct Errors {
    /// Change of e1 over the integral of e1_rate.
    lateral: Option<f64>,
    /// e1_rate over vy cos e2 + vx sin e2.
    drift: Option<f64>,
    /// Change of e2 over the integral of e2_rate.
    heading: Option<f64>,
    /// e2_rate over yaw_rate - vx * curvature.
    turn: Option<f64>,
}

/// Change of a column over the integral of what should be its rate.
fn change(log: &CleanLog, what: &str, rate: &[f64]) -> Option<Slope> {
    let what = log.columns.get(what)?;
    let size = ((BLOCK / log.step).round() as usize).max(1);
    let means: Vec<f64> = blocks(log, what).collect();
    // Each step between two rows counts in the difference of two blocks' means as often as pairs of their rows span it.
    let asked = |block: usize| -> f64 {
        let spans = |step: usize| (step + 1).min(2 * size - 1 - step) as f64 / size as f64;
        let first = block * size;
        let mean = |step: usize| 0.5 * (rate[first + step] + rate[first + step + 1]);
        (0..2 * size - 1).map(|step| spans(step) * mean(step)).sum::<f64>() * log.step
    };
    slope(means.windows(2).enumerate().map(|(block, pair)| (asked(block), pair[1] - pair[0])))
}

/// [`change`] of a column over another, as a factor.
fn change_over(log: &CleanLog, what: &str, rate: &str) -> Option<f64> {
    change(log, what, log.columns.get(rate)?).map(|slope| slope.factor)
}

fn errors(log: &CleanLog) -> Errors {
    let get = |name: &str| log.columns.get(name);
    let drift = || {
        let (vx, e2, rate) = (get("vx")?, get("e2")?, get("e1_rate")?);
        let none = vec![0.0; vx.len()];
        let vy = get("vy").unwrap_or(&none);
        // Exactly: where the vehicle follows its path closely, the two nearly cancel.
        let asked =
            vx.iter().zip(e2).zip(vy).map(|((vx, e2), vy)| vy * e2.cos() + vx * e2.sin()).collect::<Vec<_>>();
        slope(blocks(log, &asked).zip(blocks(log, rate)))
    };
    let turn = || {
        let (vx, curvature, rate, e2_rate) =
            (get("vx")?, get("curvature")?, get("yaw_rate")?, get("e2_rate")?);
        let asked =
            vx.iter().zip(curvature).zip(rate).map(|((v, bend), rate)| rate - v * bend).collect::<Vec<_>>();
        slope(blocks(log, &asked).zip(blocks(log, e2_rate)))
    };
    let factor = |slope: Option<Slope>| slope.map(|slope| slope.factor);
    // Without vy the sign alone is sure.
    let sign = || kinematics::drift_factor(log).filter(|factor| *factor < 0.0 && get("vy").is_none());
    Errors {
        lateral: change_over(log, "e1", "e1_rate"),
        drift: factor(drift()).or_else(sign),
        heading: change_over(log, "e2", "e2_rate"),
        turn: factor(turn()),
    }
}

/// Errors to the path in foreign units: converted.
fn mend_errors(log: &mut CleanLog, factors: &mut Factors) {
    let (degrees, lengths) = (sized(ANGLES), sized(LENGTHS));
    let tell =
        |factor: Option<f64>, units: &[LogUnit]| factor.and_then(|factor| units::foreign(factor, units));
    if let Some(unit) = tell(errors(log).turn, &degrees) {
        convert(log, factors, unit, &["e2_rate"], "e2_rate is 57 times what yaw_rate and curvature tell");
    }
    if let Some(unit) = tell(errors(log).heading, &degrees) {
        convert(log, factors, unit, &["e2"], "e2 changes 57 times as fast as e2_rate says");
    }
    let drift = errors(log).drift;
    if let (Some(factor), Some(unit)) = (drift, tell(drift, &lengths)) {
        convert(
            log,
            factors,
            unit,
            &["e1_rate"],
            &format!("e1_rate is {:.3} times vy cos e2 + vx sin e2", factor.abs()),
        );
    }
    let lateral = errors(log).lateral;
    if let (Some(factor), Some(unit)) = (lateral, tell(lateral, &lengths)) {
        let words = format!("e1 changes {:.3} times as fast as e1_rate says", factor.abs());
        convert(log, factors, unit, &["e1"], &words);
    }
}

/// Response of body and road to a motion.
struct Leaning {
    column: &'static str,
    /// The motion that the angle follows, and its name in words.
    follows: fn(&CleanLog) -> Option<Vec<f64>>,
    named: &'static str,
    /// Limit of the slope, in radians: between the softest vehicle's in radians and the stiffest one's in degrees.
    most: f64,
}

/// A body leans 0.5 to 12 degrees at 1 g, 0.0009 to 0.02 rad for each m/s2, on soft springs twice as far. In degrees it
/// is 0.05 and more. A trailer 2 to 14 m long stands at that many radians for each 1/m of curvature; in degrees it is
/// 115 and more.
const LEANING: [Leaning; 3] = [
    Leaning { column: "roll", follows: turning, named: "vx * yaw_rate", most: 0.045 },
    Leaning { column: "pitch", follows: |log| log.columns.get("ax").cloned(), named: "ax", most: 0.045 },
    Leaning { column: "articulation", follows: bending, named: "yaw_rate / vx", most: 40.0 },
];
/// Angles to the road, and of the road, that no road vehicle has for long, rad.
const STEEP: f64 = 0.8;

fn turning(log: &CleanLog) -> Option<Vec<f64>> {
    let (vx, rate) = (log.columns.get("vx")?, log.columns.get("yaw_rate")?);
    Some(vx.iter().zip(rate).map(|(v, rate)| v * rate).collect())
}

fn bending(log: &CleanLog) -> Option<Vec<f64>> {
    let (vx, rate) = (log.columns.get("vx")?, log.columns.get("yaw_rate")?);
    Some(vx.iter().zip(rate).map(|(v, rate)| if *v > STANDING { rate / v } else { f64::NAN }).collect())
}

/// Gravity in the accelerometer along an axis, in parts of it: the sine of a grade, and of a bank.
fn gravity(log: &CleanLog, column: &str) -> Option<Vec<f64>> {
    let vx = log.columns.get("vx")?;
    let (felt, moved) = match column {
        "grade" => {
            let speeding = |row: usize| {
                let (before, after) = (row.saturating_sub(1), (row + 1).min(vx.len() - 1));
                (vx[after] - vx[before]) / (log.step * (after - before) as f64)
            };
            (log.columns.get("ax")?, (0..vx.len()).map(speeding).collect())
        }
        _ => (log.columns.get("ay")?, turning(log)?),
    };
    Some(felt.iter().zip(moved).map(|(felt, moved)| (felt - moved) / GRAVITY).collect())
}

/// Angles of body, trailer and road in degrees, slopes in per cent: converted.
fn mend_angles(log: &mut CleanLog, factors: &mut Factors) {
    let [_, degrees] = sized(ANGLES);
    for Leaning { column, follows, named, most } in LEANING {
        let slope = match (log.columns.get(column), follows(log)) {
            (Some(angle), Some(motion)) => slope(blocks(log, &motion).zip(blocks(log, angle))),
            _ => None,
        };
        if let Some(slope) = slope.filter(|slope| slope.factor.abs() > most) {
            let words = format!("{column} is {:.2} times {named}, as no angle in radians is", slope.factor);
            convert(log, factors, degrees, &[column], &words);
        }
    }
    for column in ["grade", "bank"] {
        let factor = match (log.columns.get(column), gravity(log, column)) {
            (Some(angle), Some(part)) => {
                slope(blocks(log, &part).zip(blocks(log, angle))).map(|slope| slope.factor)
            }
            _ => None,
        };
        let slopes = [("rad", 1.0), degrees, ("per cent", 100.0)];
        if let Some((factor, unit)) =
            factor.and_then(|factor| Some((factor, units::foreign(factor, &slopes)?)))
        {
            let words = format!("{column} is {factor:.0} times what the accelerometer shows of gravity");
            convert(log, factors, unit, &[column], &words);
        }
    }
    let change = change_over(log, "articulation", "articulation_rate");
    if change.is_some_and(|factor| near(factor.abs() / DEGREE, 1.0)) {
        let words = "articulation_rate is 57 times the change of articulation";
        convert(log, factors, ("deg/s", degrees.1), &["articulation_rate"], words);
    }
    for column in ["roll", "pitch", "grade", "bank"] {
        let large = log.columns.get(column).and_then(|angle| {
            quantile(angle.iter().map(|angle| angle.abs()).collect(), 0.98).filter(|angle| *angle > STEEP)
        });
        if let Some(angle) = large {
            let words = format!(
                "{column} is up to {angle:.1}, as no angle in radians is, and is left out; give it in radians"
            );
            log.columns.remove(column);
            log.find(FindingSeverity::Warning, column, words);
        }
    }
}

/// Signs of the errors to the path and of its curvature, and ratios that no unit explains.
///
/// # Errors
/// A sign that is reversed; a factor.
pub(super) fn check_errors(log: &CleanLog, steering: &dyn Fn(f64) -> f64) -> Result<(), CleanError> {
    let Errors { lateral, drift, heading, turn } = errors(log);
    let factor = |slope: Option<Slope>| slope.map(|slope| slope.factor);
    let of_path = [
        ("e1", "e1_rate", lateral),
        ("e1_rate", "e2", drift),
        ("e2", "e2_rate", heading),
        ("e2_rate", "yaw_rate", turn),
        ("curvature", "yaw_rate", factor(bend(log))),
        ("curvature", "curvature_rate", factor(winding(log))),
    ];
    // Columns that agree with the vehicle's motion are not to blame.
    check_signs(&[&of_path[..], &Motion::of(log, steering).pairs(log)].concat())?;
    for (column, factor, against) in [
        ("e1", lateral, "changes {} times as fast as e1_rate says"),
        ("e1_rate", drift, "is {} times vy cos e2 + vx sin e2"),
        ("e2", heading, "changes {} times as fast as e2_rate says"),
        ("e2_rate", turn, "is {} times yaw_rate - vx * curvature"),
    ] {
        // Errors are projections; a factor of two is beyond all of that.
        if let Some(factor) = factor.filter(|factor| !(0.5..2.0).contains(factor)) {
            let words = against.replace("{}", &format!("{factor:.3}"));
            return Err(CleanError::Contradicts { column, words });
        }
    }
    Ok(())
}

/// Slope of `ay` over `vx * yaw_rate`.
fn lateral(log: &CleanLog) -> Option<Slope> {
    let (ay, vx, rate) = (log.columns.get("ay")?, log.columns.get("vx")?, log.columns.get("yaw_rate")?);
    let turning = blocks(log, vx).zip(blocks(log, rate)).map(|(v, rate)| v * rate);
    slope(turning.zip(blocks(log, ay)))
}

/// Angle within which a course is that of a turned frame, rad, and slope over yaw of a mirrored one.
const QUARTER: f64 = 0.2;
const MIRRORED: std::ops::Range<f64> = -1.3..-0.7;

/// The course by x and y beside yaw.
#[derive(Debug, Clone, Copy)]
struct CourseBesideYaw {
    /// Slope of its changes over those of yaw.
    slope: Slope,
    /// The angle from yaw to it, and that from a quarter turn less yaw, rad.
    apart: f64,
    mirrored: f64,
}

fn course(log: &CleanLog) -> Option<CourseBesideYaw> {
    let (x, y, yaw) = (log.columns.get("x")?, log.columns.get("y")?, log.columns.get("yaw")?);
    let points: Vec<[f64; 3]> =
        blocks(log, x).zip(blocks(log, y)).zip(blocks(log, yaw)).map(|((x, y), yaw)| [x, y, yaw]).collect();
    // A course, and the heading half-way along it.
    let courses: Vec<[f64; 2]> = points
        .windows(2)
        .map(|pair| {
            let (dx, dy) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
            let moved = dx.hypot(dy) > 0.5;
            [if moved { dy.atan2(dx) } else { f64::NAN }, 0.5 * (pair[0][2] + pair[1][2])]
        })
        .collect();
    let turned =
        courses.windows(2).map(|pair| (pair[1][1] - pair[0][1], wrap_angle(pair[1][0] - pair[0][0])));
    let typical =
        |of: fn([f64; 2]) -> f64| median(courses.iter().map(|pair| wrap_angle(of(*pair))).collect());
    Some(CourseBesideYaw {
        slope: slope(turned)?,
        apart: typical(|[course, yaw]| course - yaw)?,
        mirrored: typical(|[course, yaw]| course + yaw - std::f64::consts::FRAC_PI_2)?,
    })
}

/// Slope of a steering column over the angle of steady cornering.
fn steered(log: &CleanLog, column: &str, steering: &dyn Fn(f64) -> f64) -> Option<Slope> {
    let (steer, vx, rate) = (log.columns.get(column)?, log.columns.get("vx")?, log.columns.get("yaw_rate")?);
    // Close to the limit of grip any vehicle needs more.
    let mild = |v: f64, rate: f64| if (v * rate).abs() < MILD { steering(v) * rate / v } else { f64::NAN };
    let needed = blocks(log, vx).zip(blocks(log, rate)).map(|(v, rate)| mild(v, rate));
    slope(needed.zip(blocks(log, steer)))
}

/// Steering angles in degrees: converted. `steering` is the road-wheel angle for a unit of curvature at a speed.
pub(super) fn mend_steering(log: &mut CleanLog, factors: &mut Factors, steering: &dyn Fn(f64) -> f64) {
    for column in ["steer_cmd", "steer"] {
        let factor = steered(log, column, steering).map_or(1.0, |slope| slope.factor.abs());
        if (40.0..80.0).contains(&factor) {
            scale(log, factors, column, DEGREE);
            let words = format!(
                "{column} is {factor:.0} times what the turns need: taken as degrees and converted to radians"
            );
            log.find(FindingSeverity::Warning, column, words);
        }
    }
}

/// Ratios among the columns of a vehicle's motion.
struct Motion {
    /// Change of yaw over the integral of yaw rate.
    turn: Option<f64>,
    /// Change of the course by x and y over that of yaw.
    course: Option<f64>,
    /// The angle between course and yaw, rad.
    apart: f64,
    /// The angle between course and a quarter turn less yaw, rad.
    mirrored: f64,
    /// `steer_cmd` and `steer` over the angle of steady cornering.
    steered: [Option<f64>; 2],
    /// ay over speed times yaw rate.
    lateral: Option<f64>,
    /// vy over the velocity across the body by x, y and yaw, or by ay.
    across: Option<Told>,
    /// ax over the change of vx.
    along: Option<Told>,
}

impl Motion {
    fn of(log: &CleanLog, steering: &dyn Fn(f64) -> f64) -> Self {
        let turn = match (log.columns.get("yaw"), log.columns.get("yaw_rate")) {
            (Some(yaw), Some(rate)) => turn_factor(&log.time, yaw, rate),
            _ => None,
        };
        let course = course(log);
        let (apart, mirrored) = course.map_or((0.0, 0.0), |course| (course.apart, course.mirrored));
        let course = course.map(|course| course.slope.factor);
        let steered =
            ["steer_cmd", "steer"].map(|column| steered(log, column, steering).map(|slope| slope.factor));
        Self {
            turn,
            course,
            apart,
            mirrored,
            steered,
            lateral: lateral(log).map(|slope| slope.factor),
            across: kinematics::vy_factor(log),
            along: kinematics::ax_factor(log),
        }
    }

    /// The fault of a frame as a whole, where the course of x, y tells it: a sign alone would be the wrong advice.
    fn frame(&self) -> Option<&'static str> {
        let (course, turn) = (self.course?, self.turn?);
        let quarter = self.mirrored.abs() < QUARTER && MIRRORED.contains(&course);
        let backwards = self.apart.abs() > std::f64::consts::PI - QUARTER && MIRRORED.contains(&-course);
        match turn < 0.0 {
            true if quarter => Some(
                "yaw is a heading from north, clockwise, as of a compass; give it from the x axis, counter-clockwise: pi/2 - \
                 yaw (in degrees 90 - yaw)",
            ),
            false if quarter => Some(
                "x and y stand for one another: x is the position to the east, y to the north where yaw counts from the east",
            ),
            true if backwards => Some(
                "time runs backwards: the vehicle moves against yaw, and turns against yaw_rate; count time from the start of \
                 the drive",
            ),
            _ => None,
        }
    }

    /// Columns that should have one sign, and the factor between them.
    fn pairs(&self, log: &CleanLog) -> [SignPair; 7] {
        [
            ("yaw", "yaw_rate", self.turn),
            ("y", "yaw", self.course),
            // Of a log without a command both are the same column.
            ("steer_cmd", "yaw_rate", self.steered[0].filter(|_| log.commanded)),
            ("steer", "yaw_rate", self.steered[1]),
            ("ay", "yaw_rate", self.lateral),
            ("vy", self.across.map_or("y", |(by, _)| by), self.across.map(|(_, factor)| factor)),
            ("ax", "vx", self.along.map(|(_, factor)| factor)),
        ]
    }
}

/// Angle between yaw and the course that no slip explains, rad: with `vy` and its standard error, and without.
const OFFSET: f64 = 0.05;
const SURE_OFFSET: f64 = 0.01;
const ANOTHER_AXIS: f64 = 0.3;

/// Signs, and ratios that no unit explains.
///
/// # Errors
/// A sign that is reversed; a steering-wheel angle.
pub(super) fn check(log: &mut CleanLog, steering: &dyn Fn(f64) -> f64) -> Result<(), CleanError> {
    let motion = Motion::of(log, steering);
    if let Some(words) = motion.frame() {
        return Err(CleanError::Frame { words });
    }
    check_signs(&motion.pairs(log))?;
    let Motion { turn, course, apart, steered, lateral, along, .. } = motion;
    let contradicts = |factor: &f64| !(0.4..2.5).contains(factor);
    if let Some(factor) = lateral.filter(contradicts) {
        let words = format!("ay is {factor:.2} times vx * yaw_rate: its unit, or that of vx, is another one");
        log.find(FindingSeverity::Suspicion, "ay", words);
    }
    // Speed and yaw rate tell an angle at the steering wheel, if their own units are right.
    let told = !lateral.is_some_and(|factor| contradicts(&factor));
    let tells_speed =
        lateral.is_some() || ["x", "station", "curvature"].iter().any(|name| log.columns.contains_key(name));
    let (plausible, unknown) = if tells_speed {
        (PLAUSIBLE, "")
    } else {
        (SURE, ", and no column tells the unit of vx (x and y, or ay, would)")
    };
    for (column, factor) in ["steer_cmd", "steer"].into_iter().zip(steered) {
        match factor {
            Some(factor) if told && factor > 400.0 => return Err(CleanError::SteeringWheel { column, ratio: factor * DEGREE, degrees: true }),
            Some(factor) if told && factor > 6.0 => return Err(CleanError::SteeringWheel { column, ratio: factor, degrees: false }),
            Some(factor) if !plausible.contains(&factor) && (log.commanded || column == "steer") => log.find(
                FindingSeverity::Suspicion,
                column,
                format!(
                    "{column} is {factor:.2} times what this vehicle would need for the turns of the log: another vehicle, another speed unit, or a wrong steering ratio{unknown}"
                ),
            ),
            _ => {}
        }
    }
    let felt = gravity(log, "bank").and_then(median).filter(|part| part.abs() > STEEP);
    if let Some(part) = felt {
        let words = format!(
            "ay is {:+.1} m/s2 off vx * yaw_rate throughout: gravity or an offset is in it; take it out, or leave ay out",
            part * GRAVITY
        );
        log.find(FindingSeverity::Suspicion, "ay", words);
    }
    if let Some(factor) = turn.filter(|factor| !(0.7..1.4).contains(factor)) {
        let words =
            format!("yaw changes {factor:.2} times as fast as yaw_rate says: one of them has another unit");
        log.find(FindingSeverity::Suspicion, "yaw", words);
    }
    if let Some(words) = motion_of_clock(log, turn, along) {
        log.find(FindingSeverity::Suspicion, "time", words);
    }
    let off = kinematics::yaw_offset(log)
        .filter(|(angle, error)| angle.abs() > OFFSET && *error < SURE_OFFSET)
        .map(|(angle, _)| angle)
        .or(course.map(|_| apart).filter(|apart| apart.abs() > ANOTHER_AXIS));
    if let Some(angle) = off {
        let words = format!(
            "the course of x, y is {angle:+.3} rad off yaw: yaw is measured from another axis; give it from the x axis, counter-clockwise"
        );
        log.find(FindingSeverity::Suspicion, "yaw", words);
    }
    Ok(())
}

/// Error of a clock from which on it is named, and share of it by which two relations may differ: a way is a chord of its
/// bend, and shorter by up to 1 %.
const CLOCK: f64 = 0.02;
const ALIKE: f64 = 0.5;

/// Words on a clock that runs at a wrong rate: one factor is missing wherever a change in time is compared with a rate. A
/// sensor's scale is in one relation only.
fn motion_of_clock(log: &CleanLog, turn: Option<f64>, along: Option<Told>) -> Option<String> {
    // An acceleration is a rate; the change of vx is divided by the clock's time.
    let along = along.map(|(_, factor)| 1.0 / factor);
    let told =
        [(way(log), "x and y move", "vx"), (turn, "yaw turns", "yaw_rate"), (along, "vx changes", "ax")];
    let told: Vec<(f64, &str, &str)> =
        told.into_iter().filter_map(|(factor, what, by)| Some((factor?, what, by))).collect();
    let off = |factor: f64| (factor.max(1e-9)).ln();
    let alike =
        |a: f64, b: f64| off(a).abs() > CLOCK.ln_1p() && (off(a) - off(b)).abs() < ALIKE * off(a).abs();
    let pair = told.iter().enumerate().find_map(|(i, one)| {
        told[i + 1..].iter().find(|other| alike(one.0, other.0)).map(|other| (*one, *other))
    });
    let ((factor, what, by), (second, also, than)) = pair?;
    Some(format!(
        "{what} {factor:.3} times as fast as {by} says, and {also} {second:.3} times as fast as {than} says: the clock runs at \
         another rate, or rows were lost and stamped anew; give the times at which the rows were measured (--rate HZ where \
         there is no column time)"
    ))
}

/// Two columns that should have one sign, and the factor between them.
type SignPair = (&'static str, &'static str, Option<f64>);

/// Finds the column whose sign contradicts the others.
fn check_signs(pairs: &[SignPair]) -> Result<(), CleanError> {
    // Whoever contradicts more columns than it agrees with is the one.
    let score = |column: &str| {
        let of = pairs.iter().filter(|(a, b, _)| *a == column || *b == column);
        of.filter_map(|(_, _, factor)| *factor).map(|factor| if factor < 0.0 { 1 } else { -1 }).sum::<i32>()
    };
    let against = pairs.iter().filter(|(_, _, factor)| factor.is_some_and(|factor| factor < 0.0));
    let scored = against.map(|&(one, other, _)| (one, other, score(one) - score(other)));
    // The first of equals.
    let Some((one, other, more)) = scored.rev().max_by_key(|(_, _, more)| more.abs()) else { return Ok(()) };
    let (column, against) = if more < 0 { (other, one) } else { (one, other) };
    Err(CleanError::Sign { column, against, tied: more == 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blamed(pairs: &[SignPair]) -> (&'static str, bool) {
        match check_signs(pairs) {
            Err(CleanError::Sign { column, tied, .. }) => (column, tied),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn who_contradicts_the_others_is_blamed() {
        let all = |yaw: f64, course: f64, steer: f64, ay: f64| {
            [
                ("yaw", "yaw_rate", Some(yaw)),
                ("y", "yaw", Some(course)),
                ("steer", "yaw_rate", Some(steer)),
                ("ay", "yaw_rate", Some(ay)),
            ]
        };
        assert_eq!(blamed(&all(1.0, 1.0, -1.0, 1.0)).0, "steer");
        assert_eq!(blamed(&all(-1.0, 1.0, -1.0, -1.0)).0, "yaw_rate");
        assert_eq!(blamed(&all(-1.0, -1.0, 1.0, 1.0)).0, "yaw");
        assert_eq!(blamed(&all(1.0, 1.0, 1.0, -1.0)).0, "ay");
        assert!(blamed(&[("steer", "yaw_rate", Some(-1.0))]).1);
        assert!(check_signs(&all(1.0, 1.0, 1.0, 0.9)).is_ok());
    }
}
