//! Columns that come later than others: a receiver's latency, a low pass, a moving average of one column.
//!
//! Heading and its rate, speed and acceleration, place and velocity tell the same motion twice. If one of the two comes later by
//! `tau`,
//!
//! ```text
//!     d(yaw)  = g int yaw_rate dt + tau d(yaw_rate) + c dt
//!     int ax dt = k d(vx) + tau d(ax) + c dt
//!     d(x, y) = f int v dt - tau d(v) + l d(t) + m d(n) + a int v' dt     v: in world axes, v' across it; t, n: along, across the heading
//!     int ay dt = g (int vx yaw_rate dt + d(vy)) - tau d(ay) + c dt
//! ```
//!
//! over spans of the log, with a scale, an offset, and a lever arm of their own. A vehicle whose sensors are late as a whole
//! is another matter, and so is an actuator. The later column is taken earlier by whole rows, which leaves its noise as it
//! is. Less than [`LEAST`] is what sensors differ by, and known to the diagnosis.

use super::clean_log::CleanLog;
use super::finding::FindingSeverity;
use super::join::JUMP;
use super::kinematics;
use crate::numerics::statistics::median;
use std::collections::BTreeMap;

/// Least lateness that is mended, s: twice that of an inertial sensor's low pass.
const LEAST: f64 = 0.02;
/// Least lateness of a lateral accelerometer alone, s: a body that leans late brings gravity late, which is up to 0.03 s.
const LEAST_FELT: f64 = 0.05;
/// ... in standard errors.
const SURE: f64 = 4.0;
/// Longest lateness that is mended, s: more is none of a sensor, and the relations are linear in a little of it only.
const LONGEST: f64 = 0.5;
/// Longest lateness of an inertial sensor's own low pass, s: of second order at 4 Hz. All signals of the sensor pass it. A
/// later yaw rate was smoothed alone.
const LONGEST_LOW_PASS: f64 = 0.06;

/// Rounds of measuring a lateness and taking it out: what is linear in it is exact for a little of it only.
const ROUNDS: usize = 3;

/// Seconds by which columns were taken earlier.
pub(super) type Lateness = BTreeMap<&'static str, f64>;

/// Takes late columns earlier; gives how much.
pub(super) fn mend(log: &mut CleanLog) -> Lateness {
    let mut taken = Lateness::new();
    let yaw_rate = |late: f64| -> &'static [&'static str] {
        match late {
            late if late > LONGEST_LOW_PASS => &["yaw_rate"],
            late if late > 0.0 => &["yaw_rate", "ay", "ax"],
            _ => &["yaw"],
        }
    };
    taken.extend(mend_one(log, kinematics::yaw_rate_late, yaw_rate, ["yaw says", "yaw_rate says"]));
    // An instrument that tells vy tells vx with it.
    let speed = |late: f64| -> &'static [&'static str] { if late > 0.0 { &["vx", "vy"] } else { &[] } };
    taken.extend(mend_one(log, kinematics::vx_late, speed, ["ax says", ""]));
    let place = |late: f64| -> &'static [&'static str] { if late > 0.0 { &["x", "y"] } else { &[] } };
    taken.extend(mend_one(log, kinematics::place_late, place, ["vx and yaw say", ""]));
    taken
}

/// Takes an `ay` that is later than yaw rate and `vy` earlier; gives how much. To be called when `vy` is that of the centre of
/// gravity: another place of its sensor is alike. Behind a yaw rate that was late alone it is likely: one unit measures both. `taken`:
/// what was taken earlier before.
pub(super) fn mend_felt(log: &mut CleanLog, taken: &Lateness) -> Lateness {
    let likely = taken.contains_key("yaw_rate") && !taken.contains_key("ay");
    let names: &[&str] = if likely { &["ay", "ax"] } else { &["ay"] };
    let lateness = |log: &CleanLog| kinematics::ay_late(log, likely).filter(|(late, _)| *late > LEAST_FELT);
    mend_one(log, lateness, |_| names, ["vx, vy and yaw_rate say", ""])
}

/// Takes the later side of one relation earlier. `columns` are those of a lateness, negative where the other side is late;
/// `by` says against what each is late.
fn mend_one(
    log: &mut CleanLog,
    measured: impl Fn(&CleanLog) -> Option<(f64, f64)>,
    columns: impl Fn(f64) -> &'static [&'static str],
    by: [&str; 2],
) -> Lateness {
    let Some((first, late)) = rows_late(log, measured(log)) else { return Lateness::new() };
    let names = columns(late);
    if names.is_empty() {
        return Lateness::new();
    }
    earlier(log, names, first);
    let (mut rows, mut total) = (first, late);
    for _ in 1..ROUNDS {
        let more = rows_late(log, measured(log)).filter(|(_, more)| more.signum() == late.signum());
        let Some((few, more)) = more else { break };
        earlier(log, names, few);
        (rows, total) = (rows + few, total + more);
    }
    let there: Vec<&str> = names.iter().copied().filter(|name| log.columns.contains_key(name)).collect();
    let Some((first, others)) = there.split_first() else { return Lateness::new() };
    let with = if others.is_empty() { String::new() } else { format!(", {} with it", others.join(" and ")) };
    let against = if late > 0.0 { by[0] } else { by[1] };
    let words =
        format!("{first} comes {:.3} s later than {against}: taken {rows} rows earlier{with}", total.abs());
    log.find(FindingSeverity::Warning, first, words);
    there.into_iter().map(|name| (name, rows as f64 * log.step)).collect()
}

/// Whole rows of a lateness that is sure, and the lateness, s.
fn rows_late(log: &CleanLog, told: Option<(f64, f64)>) -> Option<(usize, f64)> {
    let (late, error) = told?;
    let rows = (late.abs() / log.step).round() as usize;
    let is_late = (LEAST..LONGEST).contains(&late.abs());
    (is_late && late.abs() > SURE * error && rows > 0).then_some((rows, late))
}

/// A column of a log on its own clock, taken earlier by so many seconds. Rows that have no row so much later get no value.
pub(super) fn taken_earlier(time: &[f64], values: &[f64], seconds: f64) -> Vec<f64> {
    let steps = time.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| step.is_finite()).collect();
    let Some(spacing) = median(steps).filter(|spacing| *spacing > 0.0) else { return values.to_vec() };
    let rows = (seconds / spacing).round() as usize;
    // Across a gap the row is another one.
    let there = |row: usize| (time[row + rows] - time[row] - seconds).abs() < 2.0 * spacing;
    let value = |row: usize| (row + rows < time.len() && there(row)).then(|| values[row + rows]);
    (0..time.len()).map(|row| value(row).unwrap_or(f64::NAN)).collect()
}

/// Takes columns earlier by rows; the last rows of each drive do not count then.
fn earlier(log: &mut CleanLog, names: &[&'static str], rows: usize) {
    let mut starts: Vec<usize> = vec![0];
    starts.extend((1..log.time.len()).filter(|&row| log.time[row] - log.time[row - 1] > 0.9 * JUMP));
    starts.push(log.time.len());
    for drive in starts.windows(2) {
        let last = drive[1].saturating_sub(1);
        for name in names {
            let Some(column) = log.columns.get_mut(name) else { continue };
            for row in drive[0]..drive[1] {
                column[row] = column[(row + rows).min(last)];
            }
        }
        let from = drive[1].saturating_sub(rows).max(drive[0]);
        log.valid[from..drive[1]].fill(false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute of turns at changing speed: `ay` late by rows, or of an accelerometer so many m before the centre of gravity.
    fn drive(rows: usize, lever: f64) -> CleanLog {
        let (step, count) = (0.02, 3000);
        let time = |row: usize| step * row as f64;
        let speed = |t: f64| 11.0 + 5.0 * (0.21 * t).sin();
        let rate = |t: f64| 0.2 * (0.9 * t).sin() + 0.1 * (1.7 * t).cos();
        let across = |t: f64| (1.5 - 0.005 * speed(t).powi(2)) * rate(t);
        let change = |of: &dyn Fn(f64) -> f64, t: f64| (of(t + 1e-4) - of(t - 1e-4)) / 2e-4;
        let felt = |t: f64| speed(t) * rate(t) + change(&across, t) + lever * change(&rate, t);
        let noise = |row: usize| 0.02 * (7.3 * (row * row) as f64).sin();
        let column = |of: &dyn Fn(usize) -> f64| (0..count).map(of).collect::<Vec<f64>>();
        let columns = [
            ("vx", column(&|row| speed(time(row)))),
            ("vy", column(&|row| across(time(row)))),
            ("yaw_rate", column(&|row| rate(time(row)))),
            ("ay", column(&|row| 1.08 * felt(time(row) - step * rows as f64) + noise(row))),
        ];
        CleanLog::of_columns(step, columns.into())
    }

    #[test]
    fn a_late_accelerometer_is_told_from_one_at_another_place() {
        for rows in [4, 8] {
            let mut log = drive(rows, 0.0);
            let taken = mend_felt(&mut log, &Lateness::new());
            assert!((taken["ay"] - 0.02 * rows as f64).abs() < 0.03, "{rows}: {taken:?}");
        }
        for lever in [0.0, -1.2, 1.2] {
            let mut log = drive(0, lever);
            assert!(mend_felt(&mut log, &Lateness::new()).is_empty(), "{lever}");
        }
    }
}
