//! Ratios among columns that tell the same motion twice.

use crate::log::clean_log::{CleanLog, STANDING};
use crate::log::kinematics;
use crate::numerics::statistics::{Slope, median, quantile, slope};
use crate::path::wrap_angle;
use crate::vehicle::GRAVITY;
use std::collections::BTreeMap;

/// Rows farther apart in time belong to two drives, s.
const ANOTHER_DRIVE: f64 = 9.9;
/// A larger change of yaw from row to row, as a share of its range in whatever unit, is its wrapping.
const WRAP: f64 = 0.5;
/// Lateral accelerations that no vehicle on a road reaches, m/s2.
const IMPOSSIBLE: f64 = 40.0;
/// Lateral acceleration in turns that are none, m/s2: a 57th of what any vehicle can.
pub(super) const SLIGHT: f64 = 0.17;
/// Two full turns, rad.
const FEW_TURNS: f64 = 2.0 * std::f64::consts::TAU;
/// Time over which the way driven is taken for a chord, s.
const LONGEST_CHORD: f64 = 2.0;
/// Lateral acceleration up to which tyres are linear, m/s2.
pub(super) const MILD: f64 = 3.0;
/// Length of the stretches that are compared, s: longer than any delay, shorter than a bend.
pub(super) const BLOCK: f64 = 0.5;

/// Ratio of the change of yaw to that of yaw rate's integral; `None` where the two hardly correlate, as without turns.
/// Compared over spans of time: from row to row noise exceeds the changes.
pub(in crate::log) fn turn_factor(time: &[f64], yaw: &[f64], yaw_rate: &[f64]) -> Option<f64> {
    let range = |share: f64| quantile(yaw.iter().copied().filter(|yaw| yaw.is_finite()).collect(), share);
    let wrap = WRAP * (range(0.99)? - range(0.01)?);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let (mut since, mut asked, mut turned) = (0.0, 0.0, 0.0);
    for i in 1..time.len() {
        let step = time[i] - time[i - 1];
        let (by_rate, by_yaw) = (0.5 * (yaw_rate[i - 1] + yaw_rate[i]) * step, yaw[i] - yaw[i - 1]);
        // Not a number compares as neither.
        if by_yaw.abs() < wrap && by_rate.is_finite() && step < ANOTHER_DRIVE {
            (since, asked, turned) = (since + step, asked + by_rate, turned + by_yaw);
        }
        if since >= BLOCK {
            (xx, xy, yy) = (xx + asked * asked, xy + asked * turned, yy + turned * turned);
            (since, asked, turned) = (0.0, 0.0, 0.0);
        }
    }
    if xy * xy < 0.5 * xx * yy || xx == 0.0 { None } else { Some(xy / xx) }
}

/// Ratio of the way driven to that by speed and clock: the typical row of a moving vehicle.
fn way_factor(time: &[f64], [x, y, vx]: [&[f64]; 3]) -> Option<f64> {
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

/// [`way_factor`] of a log that has the columns `x`, `y`, `vx`.
pub(in crate::log) fn way_factor_of<'a>(
    time: &[f64],
    column: impl Fn(&'static str) -> Option<&'a [f64]>,
) -> Option<f64> {
    way_factor(time, [column("x")?, column("y")?, column("vx")?])
}

/// The same of a log on its even clock.
pub(super) fn way(log: &CleanLog) -> Option<f64> {
    way_factor_of(&log.time, |name| log.columns.get(name).map(Vec::as_slice))
}

/// True if yaw rate must be in degrees per second: as radians the vehicle would turn impossibly fast.
pub(in crate::log) fn impossible_yaw_rate(vx: &[f64], yaw_rate: &[f64]) -> bool {
    let lateral = vx.iter().zip(yaw_rate).map(|(v, rate)| (v * rate).abs()).collect();
    quantile(lateral, 0.98).is_some_and(|lateral| lateral > IMPOSSIBLE)
}

/// True if yaw and yaw rate disagree by a factor because of the yaw rate, which has to be multiplied by it. By `ay`; or else by
/// what is driven: no turn is impossibly fast, and not all are none. Where both pass, a yaw in radians has a few turns at most.
pub(in crate::log) fn is_yaw_rate_wrong(columns: &BTreeMap<&'static str, Vec<f64>>, factor: f64) -> bool {
    let (vx, rate, yaw) = (&columns["vx"], &columns["yaw_rate"], &columns["yaw"]);
    let turning: Vec<f64> = vx.iter().zip(rate).map(|(v, rate)| v * rate).collect();
    let Some(lateral) = quantile(turning.iter().map(|lateral| lateral.abs()).collect(), 0.98) else {
        return false;
    };
    if let Some(slope) = columns.get("ay").and_then(|ay| slope(turning.into_iter().zip(ay.iter().copied()))) {
        let told = slope.factor.abs().ln();
        return (told - factor.ln()).abs() < told.abs();
    }
    let is_driven = |lateral: f64| (SLIGHT..IMPOSSIBLE).contains(&lateral);
    match [is_driven(lateral), is_driven(factor * lateral)] {
        [true, false] => false,
        [false, true] => true,
        _ if factor < 1.0 => true,
        _ => {
            let finite = yaw.iter().copied().filter(|yaw| yaw.is_finite());
            let (low, high) =
                finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), yaw| (a.min(yaw), b.max(yaw)));
            high - low < FEW_TURNS
        }
    }
}

/// A factor that is, within 15 %, the one for a unit.
pub(in crate::log) fn near(factor: f64, unit: f64) -> bool {
    (factor / unit - 1.0).abs() < 0.15
}

/// Means of a column over blocks of rows that all count.
pub(super) fn blocks<'a>(log: &'a CleanLog, column: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    let size = log.rows_in(BLOCK);
    column.chunks_exact(size).zip(log.valid.chunks_exact(size)).map(move |(values, valid)| {
        if valid.iter().all(|valid| *valid) { values.iter().sum::<f64>() / size as f64 } else { f64::NAN }
    })
}

/// Ratio of the station's change to the way by speed and clock. It jumps where a lap ends.
pub(super) fn station_factor(log: &CleanLog) -> Option<f64> {
    let (station, vx) = (log.columns.get("station")?, log.columns.get("vx")?);
    let still = vec![0.0; station.len()];
    way_factor(&log.time, [station, &still, vx])
}

/// Slope of the path's yaw rate over speed times curvature.
pub(super) fn bend(log: &CleanLog) -> Option<Slope> {
    let [vx, rate, e2_rate, curvature] =
        ["vx", "yaw_rate", "e2_rate", "curvature"].map(|name| log.columns.get(name));
    let of_path = blocks(log, rate?).zip(blocks(log, e2_rate?)).map(|(rate, e2_rate)| rate - e2_rate);
    slope(blocks(log, vx?).zip(blocks(log, curvature?)).map(|(v, curvature)| v * curvature).zip(of_path))
}

/// Slope of the curvature's change over speed times its rate along the road.
pub(super) fn winding(log: &CleanLog) -> Option<Slope> {
    let (vx, rate) = (log.columns.get("vx")?, log.columns.get("curvature_rate")?);
    change(log, "curvature", &vx.iter().zip(rate).map(|(v, rate)| v * rate).collect::<Vec<_>>())
}

/// True if the vehicle turns at all. In turns of a millionth the steering is the beginning of a plan, and `ay` a drift.
pub(super) fn turns(log: &CleanLog) -> bool {
    let (Some(vx), Some(rate)) = (log.columns.get("vx"), log.columns.get("yaw_rate")) else { return false };
    let turning = blocks(log, vx).zip(blocks(log, rate)).map(|(v, rate)| (v * rate).abs());
    quantile(turning.collect(), 0.98).is_some_and(|most| most > SLIGHT)
}

/// Slope of `ay` over `vx * yaw_rate`.
pub(super) fn lateral(log: &CleanLog) -> Option<Slope> {
    let (ay, vx, rate) = (log.columns.get("ay")?, log.columns.get("vx")?, log.columns.get("yaw_rate")?);
    let turning = blocks(log, vx).zip(blocks(log, rate)).map(|(v, rate)| v * rate);
    slope(turning.zip(blocks(log, ay)))
}

/// Slope of a steering column over the angle of steady cornering.
pub(super) fn steered(log: &CleanLog, column: &str, steering: &dyn Fn(f64) -> f64) -> Option<Slope> {
    let (steer, vx, rate) = (log.columns.get(column)?, log.columns.get("vx")?, log.columns.get("yaw_rate")?);
    // Close to the limit of grip any vehicle needs more.
    let mild = |v: f64, rate: f64| if (v * rate).abs() < MILD { steering(v) * rate / v } else { f64::NAN };
    let needed = blocks(log, vx).zip(blocks(log, rate)).map(|(v, rate)| mild(v, rate));
    slope(needed.zip(blocks(log, steer)))
}

/// Ratios among the errors to the path.
pub(super) struct Errors {
    /// Change of e1 over the integral of e1_rate.
    pub lateral: Option<f64>,
    /// e1_rate over vy cos e2 + vx sin e2.
    pub drift: Option<f64>,
    /// Change of e2 over the integral of e2_rate.
    pub heading: Option<f64>,
    /// e2_rate over yaw_rate - vx * curvature.
    pub turn: Option<f64>,
}

/// Change of a column over the integral of what should be its rate.
pub(super) fn change(log: &CleanLog, what: &str, rate: &[f64]) -> Option<Slope> {
    let what = log.columns.get(what)?;
    let size = log.rows_in(BLOCK);
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
pub(super) fn change_over(log: &CleanLog, what: &str, rate: &str) -> Option<f64> {
    change(log, what, log.columns.get(rate)?).map(|slope| slope.factor)
}

pub(super) fn errors(log: &CleanLog) -> Errors {
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

/// Response of body and road to a motion.
pub(super) struct Leaning {
    pub column: &'static str,
    /// The motion that the angle follows, and its name in words.
    pub follows: fn(&CleanLog) -> Option<Vec<f64>>,
    pub named: &'static str,
    /// Limit of the slope, in radians: between the softest vehicle's in radians and the stiffest one's in degrees.
    pub most: f64,
}

/// A body leans 0.5 to 12 degrees at 1 g, 0.0009 to 0.02 rad for each m/s2, on soft springs twice as far. In degrees it
/// is 0.05 and more. A trailer 2 to 14 m long stands at that many radians for each 1/m of curvature; in degrees it is
/// 115 and more.
pub(super) const LEANING: [Leaning; 3] = [
    Leaning { column: "roll", follows: turning, named: "vx * yaw_rate", most: 0.045 },
    Leaning { column: "pitch", follows: |log| log.columns.get("ax").cloned(), named: "ax", most: 0.045 },
    Leaning { column: "articulation", follows: bending, named: "yaw_rate / vx", most: 40.0 },
];
/// Angles to the road, and of the road, that no road vehicle has for long, rad.
pub(super) const STEEP: f64 = 0.8;

pub(super) fn turning(log: &CleanLog) -> Option<Vec<f64>> {
    let (vx, rate) = (log.columns.get("vx")?, log.columns.get("yaw_rate")?);
    Some(vx.iter().zip(rate).map(|(v, rate)| v * rate).collect())
}

pub(super) fn bending(log: &CleanLog) -> Option<Vec<f64>> {
    let (vx, rate) = (log.columns.get("vx")?, log.columns.get("yaw_rate")?);
    Some(vx.iter().zip(rate).map(|(v, rate)| if *v > STANDING { rate / v } else { f64::NAN }).collect())
}

/// Gravity in the accelerometer along an axis, in parts of it: the sine of a grade, and of a bank.
pub(super) fn gravity(log: &CleanLog, column: &str) -> Option<Vec<f64>> {
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

/// The course by x and y beside yaw.
#[derive(Debug, Clone, Copy)]
pub(super) struct CourseBesideYaw {
    /// Slope of its changes over those of yaw.
    pub slope: Slope,
    /// The angle from yaw to it, and that from a quarter turn less yaw, rad.
    pub apart: f64,
    pub mirrored: f64,
}

pub(super) fn course(log: &CleanLog) -> Option<CourseBesideYaw> {
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
