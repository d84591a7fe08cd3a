//! Columns in foreign units, told by their relations to others: converted.

use super::commands::driven;
use super::ratios::{
    LEANING, Leaning, SLIGHT, STEEP, bend, blocks, change_over, errors, gravity, lateral, near,
    station_factor, steered, turning, way, winding,
};
use crate::log::clean_log::CleanLog;
use crate::log::finding::FindingSeverity;
use crate::log::kinematics;
use crate::log::units::{
    self, ACCELERATIONS, ANGLES, DEGREE, LENGTHS, LogUnit, Shown, UnitConclusion, sized,
};
use crate::numerics::statistics::{quantile, slope};
use std::collections::BTreeMap;

/// Factors by which columns of the file were multiplied.
pub(in crate::log) type Factors = BTreeMap<&'static str, f64>;

/// Metres in a degree of longitude, 111,000 at most: positions that move more slowly than this share of the speed are degrees.
const LARGEST_DEGREE: f64 = 1e-4;

/// Converts columns in foreign units, by their relations to others. To be called before all else.
pub(in crate::log) fn mend_units(log: &mut CleanLog, factors: &mut Factors) {
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
            // That of vx, if it explains vy. By the accelerometer no other one is told: a low pass of
            // ay, or another point of the car, changes the ratio as far, and the two velocities are those of one instrument.
            let same = units::foreign(factor, &[speeds[0], speed]);
            if let Some(unit) = same.or_else(|| units::foreign(factor, &speeds).filter(|_| by == "y")) {
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
    let asked = driven(log).filter(|(_, slope)| slope.explained > 0.8);
    let unit = asked.and_then(|(_, slope)| units::foreign(1.0 / slope.factor, &sized(ACCELERATIONS)));
    if let (Some((by, slope)), Some(unit)) = (asked, unit) {
        let words =
            format!("accel_cmd is {:.3} times the acceleration that {by} tells", 1.0 / slope.factor.abs());
        convert(log, factors, unit, &["accel_cmd"], &words);
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
        "yaw_rate" if unit < 1.0 => "yaw_rate is a 57th of what ay tells".into(),
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

/// True if a log tells of lateral accelerations that nobody drives to be diagnosed.
fn hardly_turns(log: &CleanLog) -> bool {
    let lateral = turning(log).map(|lateral| lateral.into_iter().map(f64::abs).collect());
    lateral.and_then(|lateral| quantile(lateral, 0.98)).is_some_and(|lateral| lateral < SLIGHT)
}

/// Steering angles in degrees: converted. `steering` is the road-wheel angle for a unit of curvature at a speed.
pub(in crate::log) fn mend_steering(
    log: &mut CleanLog,
    factors: &mut Factors,
    steering: &dyn Fn(f64) -> f64,
) {
    for column in ["steer_cmd", "steer"] {
        let factor = steered(log, column, steering).map_or(1.0, |slope| slope.factor.abs());
        if (40.0..80.0).contains(&factor) {
            scale(log, factors, column, DEGREE);
            if hardly_turns(log) {
                let words = format!(
                    "{column} is {factor:.0} times what the turns need, and these are too slight for a drive: is yaw_rate in rad/s \
                     though the file names deg/s, or was it converted twice? Give it in rad/s"
                );
                log.find(FindingSeverity::Suspicion, "yaw_rate", words);
                continue;
            }
            let words = format!(
                "{column} is {factor:.0} times what the turns need: taken as degrees and converted to radians"
            );
            log.find(FindingSeverity::Warning, column, words);
        }
    }
}
