//! Signs, frames and ratios that no unit explains: refused, or suspect.

use super::commands::{ASKED, driven};
use super::rate_scale;
use super::ratios::{
    Errors, STEEP, bend, blocks, course, errors, gravity, lateral, steered, turn_factor, turning, turns, way,
    winding,
};
use crate::log::clean_log::{CleanError, CleanLog};
use crate::log::finding::FindingSeverity;
use crate::log::kinematics::{self, Told};
use crate::log::units::DEGREE;
use crate::numerics::statistics::{Slope, median, slope};
use crate::vehicle::GRAVITY;
use std::f64::consts::FRAC_PI_2;

/// Ratio of the steering to the needed one that an effect can explain.
const PLAUSIBLE: std::ops::Range<f64> = 0.5..2.0;
/// The same where a speed in knots or mph would be taken for an effect: nothing else in the log tells its unit.
const SURE: std::ops::Range<f64> = 0.7..1.4;

/// Signs of the errors to the path and of its curvature, and ratios that no unit explains.
///
/// # Errors
/// A sign that is reversed; a factor.
pub(in crate::log) fn check_errors(log: &CleanLog, steering: &dyn Fn(f64) -> f64) -> Result<(), CleanError> {
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

/// Angle within which a course is that of a turned frame, rad, and slope over yaw of a mirrored one.
const QUARTER: f64 = 0.2;
const MIRRORED: std::ops::Range<f64> = -1.3..-0.7;

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
    /// `steer_cmd` and `steer` over the angle of steady cornering, of a vehicle that turns.
    steered: [Option<f64>; 2],
    /// ay over speed times yaw rate, of a vehicle that turns.
    lateral: Option<f64>,
    /// vy over the velocity across the body by x, y and yaw, or by ay.
    across: Option<Told>,
    /// ax over the change of vx.
    along: Option<Told>,
    /// The acceleration over the asked one.
    driven: Option<Told>,
    /// True if `ax` feels the turns and `ay` does not.
    crossed: bool,
}

impl Motion {
    fn of(log: &CleanLog, steering: &dyn Fn(f64) -> f64) -> Self {
        let turn = match (log.columns.get("yaw"), log.columns.get("yaw_rate")) {
            (Some(yaw), Some(rate)) => {
                let valid = yaw.iter().zip(&log.valid);
                let yaw: Vec<f64> = valid.map(|(yaw, valid)| if *valid { *yaw } else { f64::NAN }).collect();
                turn_factor(&log.time, &yaw, rate)
            }
            _ => None,
        };
        let course = course(log);
        let (apart, mirrored) = course.map_or((0.0, 0.0), |course| (course.apart, course.mirrored));
        let course = course.map(|course| course.slope.factor);
        // No two of these are one quantity: they agree in turns, and only there.
        let in_turns = |of: Option<Slope>| of.filter(|_| turns(log)).map(|slope| slope.factor);
        let steered = ["steer_cmd", "steer"].map(|column| in_turns(steered(log, column, steering)));
        Self {
            turn,
            course,
            apart,
            mirrored,
            steered,
            lateral: in_turns(lateral(log)),
            across: kinematics::vy_factor(log),
            along: kinematics::ax_factor(log),
            driven: driven(log).map(|(by, slope)| (by, slope.factor)),
            crossed: crossed(log),
        }
    }

    /// The fault of a frame as a whole, where the course of x, y tells it: a sign alone would be the wrong advice.
    fn frame(&self) -> Option<CleanError> {
        if self.crossed {
            return Some(CleanError::Frame {
                words: "ax is vx * yaw_rate, and ay is not: the two stand for one another, or the accelerometer is turned by a \
                        quarter; ax is the acceleration forward, ay that to the left",
            });
        }
        let (course, turn) = (self.course?, self.turn?);
        let quarter = self.mirrored.abs() < QUARTER && MIRRORED.contains(&course);
        let backwards = self.apart.abs() > std::f64::consts::PI - QUARTER && MIRRORED.contains(&-course);
        match turn < 0.0 {
            true if quarter => Some(CleanError::Frame {
                words: "yaw is a heading from north, clockwise, as of a compass; give it from the x axis, counter-clockwise: \
                        pi/2 - yaw (in degrees 90 - yaw)",
            }),
            false if quarter => Some(CleanError::Frame {
                words: "x and y stand for one another: x is the position to the east, y to the north where yaw counts from the \
                        east",
            }),
            true if backwards => Some(CleanError::Backwards),
            _ => None,
        }
    }

    /// Columns that should have one sign, and the factor between them.
    fn pairs(&self, log: &CleanLog) -> [SignPair; 8] {
        let by_accelerometer = self.across.is_some_and(|(by, _)| by == "ay");
        [
            ("yaw", "yaw_rate", self.turn),
            // Mirrored at the y axis, the course is half a turn less yaw; at the x axis it is that without the half turn.
            (if (self.mirrored - FRAC_PI_2).abs() < QUARTER { "x" } else { "y" }, "yaw", self.course),
            // Of a log without a command both are the same column.
            ("steer_cmd", "yaw_rate", self.steered[0].filter(|_| log.commanded)),
            ("steer", "yaw_rate", self.steered[1]),
            ("ay", "yaw_rate", self.lateral),
            // By the accelerometer: `ay` less the change of vy is `vx yaw_rate`.
            ("vy", if by_accelerometer { "yaw_rate" } else { "y" }, self.across.map(|(_, factor)| factor)),
            ("ax", "vx", self.along.map(|(_, factor)| factor)),
            ("accel_cmd", self.driven.map_or("vx", |(by, _)| by), self.driven.map(|(_, factor)| factor)),
        ]
    }
}

/// Share of the acceleration of turns in the wrong column.
const CROSSED: f64 = 0.8;

/// True if an accelerometer feels turns along the body, and not across it.
fn crossed(log: &CleanLog) -> bool {
    let (Some(ax), Some(ay), Some(turning)) = (log.columns.get("ax"), log.columns.get("ay"), turning(log))
    else {
        return false;
    };
    let by_turning = |column| slope(blocks(log, &turning).zip(blocks(log, column)));
    by_turning(ay).is_none()
        && by_turning(ax).is_some_and(|slope| {
            slope.explained > CROSSED && (1.0 - slope.factor.abs()).abs() < 1.0 - CROSSED
        })
}

/// Angle between yaw and the course that no slip explains, rad: with `vy` and its standard error, and without.
const OFFSET: f64 = 0.05;
const SURE_OFFSET: f64 = 0.01;
const ANOTHER_AXIS: f64 = 0.3;

/// Signs, and ratios that no unit explains.
///
/// # Errors
/// A sign that is reversed; a steering-wheel angle.
pub(in crate::log) fn check(log: &mut CleanLog, steering: &dyn Fn(f64) -> f64) -> Result<(), CleanError> {
    let motion = Motion::of(log, steering);
    if let Some(error) = motion.frame() {
        return Err(error);
    }
    check_signs(&motion.pairs(log))?;
    let Motion { turn, course, apart, steered, lateral, along, driven, .. } = motion;
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
    } else if let Some(words) = rate_scale::words(log) {
        log.find(FindingSeverity::Suspicion, "yaw_rate", words);
    }
    if let Some((by, factor)) = driven.filter(|(_, factor)| !ASKED.contains(factor)) {
        let words = format!(
            "accel_cmd is {:.3} times the acceleration that {by} tells: a torque, a force, a pedal or per cent? It is left out; give the \
             asked acceleration in m/s2",
            1.0 / factor
        );
        log.columns.remove("accel_cmd");
        log.find(FindingSeverity::Warning, "accel_cmd", words);
    }
    if let Some(lever) = kinematics::course_as_yaw(log) {
        let words = format!(
            "yaw turns before yaw_rate, as the course of a point {lever:.1} m before the rear axle does: it has the sideslip in it, and is \
             left out; give the heading of the body"
        );
        log.columns.remove("yaw");
        log.find(FindingSeverity::Warning, "yaw", words);
        return Ok(());
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
/// sensor's scale is in one relation only. The way counts where there is one; an acceleration has pitch and slopes in it, and is
/// asked only where another relation is missing.
fn motion_of_clock(log: &CleanLog, turn: Option<f64>, along: Option<Told>) -> Option<String> {
    let way = way(log).map(|factor| (factor, "x and y move", "vx"));
    let turn = turn.map(|factor| (factor, "yaw turns", "yaw_rate"));
    // An acceleration is a rate; the change of vx is divided by the clock's time.
    let along = along.map(|(_, factor)| (1.0 / factor, "vx changes", "ax"));
    let off = |factor: f64| (factor.max(1e-9)).ln();
    let alike =
        |a: f64, b: f64| off(a).abs() > CLOCK.ln_1p() && (off(a) - off(b)).abs() < ALIKE * off(a).abs();
    let (first, second) = match (way, turn) {
        (Some(way), Some(turn)) => (way, turn),
        (Some(one), None) | (None, Some(one)) => (one, along?),
        (None, None) => return None,
    };
    let ((factor, what, by), (second, also, than)) = alike(first.0, second.0).then_some((first, second))?;
    Some(format!(
        "{what} {factor:.3} times as fast as {by} says, and {also} {second:.3} times as fast as {than} says: the clock runs at \
         another rate, or rows were lost and stamped anew; give the times at which the rows were measured (--rate HZ where \
         there is no column time)"
    ))
}

/// Two columns that should have one sign, and the factor between them.
type SignPair = (&'static str, &'static str, Option<f64>);

/// Finds the columns whose sign contradicts the others.
///
/// Relations with a positive factor join columns of one handedness, those with a negative one columns of two. Of two groups that
/// are connected, the smaller one is wrong: a turned column, or all of a sensor, or of a frame.
fn check_signs(pairs: &[SignPair]) -> Result<(), CleanError> {
    let told: Vec<(&'static str, &'static str, f64)> =
        pairs.iter().filter_map(|&(one, other, factor)| Some((one, other, factor?))).collect();
    let Some(&(named, against, _)) = told.iter().find(|(_, _, factor)| *factor < 0.0) else { return Ok(()) };
    let mut sides: Vec<(&'static str, bool)> = vec![(named, true)];
    let mut next = 0;
    while let Some(&(column, side)) = sides.get(next) {
        for &(one, other, factor) in told.iter().filter(|(one, other, _)| *one == column || *other == column)
        {
            let neighbour = if one == column { other } else { one };
            if sides.iter().all(|(known, _)| *known != neighbour) {
                sides.push((neighbour, side == (factor > 0.0)));
            }
        }
        next += 1;
    }
    let of = |wanted: bool| -> Vec<&'static str> {
        sides.iter().filter(|(_, side)| *side == wanted).map(|(column, _)| *column).collect()
    };
    let (mine, others) = (of(true), of(false));
    let tied = mine.len() == others.len();
    // Of two equal groups that of the first relation is named.
    let (mut columns, mut against) = match mine.len() > others.len() {
        true => (others, named_first(mine, named)),
        false => (mine, named_first(others, against)),
    };
    // An inertial sensor that is mounted the other way round has two axes turned, and no relation joins `ax` to the others.
    let is_sensor = columns.iter().all(|column| matches!(*column, "ay" | "yaw_rate"));
    if is_sensor && !tied && told.iter().any(|&(one, _, factor)| one == "ax" && factor < 0.0) {
        columns.push("ax");
        against.push("vx");
    }
    Err(CleanError::Sign { columns, against, tied })
}

/// Columns with one of them first.
fn named_first(columns: Vec<&'static str>, first: &'static str) -> Vec<&'static str> {
    let mut columns = columns;
    columns.sort_by_key(|column| *column != first);
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blamed(pairs: &[SignPair]) -> (String, bool) {
        match check_signs(pairs) {
            Err(CleanError::Sign { columns, tied, .. }) => (columns.join(" "), tied),
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
        // An inertial sensor of the other handedness.
        let sensor = [
            ("yaw", "yaw_rate", Some(-1.0)),
            ("y", "yaw", Some(1.0)),
            ("steer_cmd", "yaw_rate", Some(-1.0)),
            ("steer", "yaw_rate", Some(-1.0)),
            ("ay", "yaw_rate", Some(1.0)),
            ("ax", "vx", Some(1.0)),
        ];
        assert_eq!(blamed(&sensor), ("yaw_rate ay".to_owned(), false));
        // An accelerometer that is turned by half a turn.
        let turned = [&all(1.0, 1.0, 1.0, -1.0)[..], &[("ax", "vx", Some(-1.0))]].concat();
        assert_eq!(blamed(&turned), ("ay ax".to_owned(), false));
        assert!(check_signs(&all(1.0, 1.0, 1.0, 0.9)).is_ok());
    }
}
