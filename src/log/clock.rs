//! A log's clock: its unit, the order of its rows, and their even clock.

use super::clean_log::{CleanError, is_as_long};
use super::finding::{Finding, FindingSeverity};
use crate::numerics::statistics::median;
use std::cmp::Ordering;
use std::ops::Range;

/// Fewest samples a second in which steering can be seen.
const SLOWEST: f64 = 6.0;
/// Samples a second below which more would be better.
const SLOW: f64 = 20.0;
/// Largest useful number of samples a second: the rows are reduced to it.
pub(super) const FASTEST: f64 = 100.0;
/// A longer gap ends a drive, s.
const LONGEST_GAP: f64 = 10.0;
/// Number of steps without a row that is a gap.
pub(super) const GAP_STEPS: f64 = 2.5;
/// Largest distance of a late stamp from an even clock, in steps: the stamps came late, not the rows.
const LATE_STEPS: f64 = 1.5;
/// Spread of even stamps, as a share of a step.
const EVEN: f64 = 0.05;

/// Rows to take, their order, and their times.
pub(super) struct Clock {
    /// Rows of the log.
    pub rows: Vec<usize>,
    /// Time of each, s, strictly increasing.
    pub time: Vec<f64>,
    /// Usual time from row to row, s.
    pub spacing: f64,
    /// Step of the even clock, s: longer than that where rows come faster than is useful.
    pub step: f64,
    /// Factor from the log's stamps to seconds.
    pub factor: f64,
}

/// Reads the clock of a drive of at least `least` s. `way` is the ratio of a row's way to that by speed and clock, where a log has
/// both. `same` tells if two rows hold the same values.
///
/// # Errors
/// No row, a log that is too short or too slow.
pub(super) fn read(
    stamps: &[f64],
    least: f64,
    way: Option<f64>,
    same: impl Fn(usize, usize) -> bool,
    findings: &mut Vec<Finding>,
) -> Result<Clock, CleanError> {
    let mut found = |gravity, words: String| findings.push(Finding::new(gravity, Some("time"), words));
    let mut rows: Vec<usize> = (0..stamps.len()).filter(|&row| stamps[row].is_finite()).collect();
    if rows.len() < stamps.len() {
        let count = stamps.len() - rows.len();
        found(
            FindingSeverity::Warning,
            format!("{count} of {} rows have no time and are left out", stamps.len()),
        );
    }
    if rows.len() < 2 {
        return Err(CleanError::NoRows { rows: stamps.len() });
    }
    put_in_order(stamps, &mut rows, &mut found);
    if rows.len() > 2 && stamps[rows[0]] == stamps[rows[rows.len() - 1]] {
        return Err(CleanError::FewTimes { rows: rows.len(), times: 1, apart: 0.0 });
    }
    let before = rows.len();
    rows.dedup_by(|next, row| stamps[*next] == stamps[*row] && same(*row, *next));
    if rows.len() < before {
        found(
            FindingSeverity::Note,
            format!("{} rows stand twice; one of each is left", before - rows.len()),
        );
    }
    let factor = unit(stamps, &rows, way);
    if factor != 1.0 {
        let unit = UNITS.iter().find(|(size, _)| *size == factor).map_or("another unit", |(_, name)| name);
        found(FindingSeverity::Warning, format!("the clock counts {unit}; it was converted to seconds"));
    }
    few_times(stamps, &rows, factor)?;
    // A speed or a position in another unit explains no more.
    let told = way.filter(|way| !(0.2..5.0).contains(&(way / factor)));
    let mut time: Vec<f64> = rows.iter().map(|&row| stamps[row] * factor).collect();
    spread(&mut time, &mut found);
    longest_drive(&mut rows, &mut time, &mut found);
    let length = time.last().unwrap_or(&0.0) - time.first().unwrap_or(&0.0);
    let Some(typical) = typical_step(&time).filter(|_| time.len() > 2) else {
        return Err(CleanError::TooShort { length, rows: rows.len(), least, unit: told });
    };
    if 1.0 / typical < SLOWEST {
        return Err(CleanError::TooSlow { rate: 1.0 / typical, least: SLOWEST });
    }
    if !is_as_long(length + typical, least) {
        return Err(CleanError::TooShort { length, rows: rows.len(), least, unit: told });
    }
    if 1.0 / typical < SLOW {
        let rate = 1.0 / typical;
        found(
            FindingSeverity::Warning,
            format!(
                "{rate:.1} rows a second: effects of the actuator are hard to tell apart below {SLOW:.0}"
            ),
        );
    }
    straighten(&mut time, typical, &mut found);
    let gaps: Vec<f64> =
        time.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > GAP_STEPS * typical).collect();
    if !gaps.is_empty() {
        let longest = gaps.iter().fold(0.0_f64, |a, b| a.max(*b));
        found(
            FindingSeverity::Warning,
            format!("{} gaps, the longest of {longest:.2} s: nothing is judged inside them", gaps.len()),
        );
    }
    let step = even_step(typical);
    if step > typical * 1.001 {
        found(
            FindingSeverity::Note,
            format!("{:.0} rows a second are brought down to {FASTEST:.0} by averaging", 1.0 / typical),
        );
    }
    Ok(Clock { rows, time, spacing: typical, step, factor })
}

/// Step of the even clock of rows with this spacing, s.
fn even_step(spacing: f64) -> f64 {
    let step = (spacing * 1e6).round() / 1e6;
    if step < 0.999 / FASTEST { 1.0 / FASTEST } else { step }
}

impl Clock {
    /// The rows `knot`, `knot + beat`, ... only.
    ///
    /// # Errors
    /// They come too slowly.
    pub(super) fn every(&mut self, beat: usize, knot: usize) -> Result<(), CleanError> {
        let rate = 1.0 / (self.spacing * beat as f64);
        if rate < SLOWEST {
            return Err(CleanError::TooSlow { rate, least: SLOWEST });
        }
        self.rows = self.rows.iter().skip(knot).step_by(beat).copied().collect();
        self.time = self.time.iter().skip(knot).step_by(beat).copied().collect();
        self.spacing *= beat as f64;
        self.step = even_step(self.spacing);
        Ok(())
    }
}

/// Rows a second beyond which none are recorded.
const MOST_ROWS: f64 = 5000.0;

/// Checks that the sorted stamps are not so coarse that many rows share each one, and the unit of their steps is no clock's.
fn few_times(stamps: &[f64], rows: &[usize], factor: f64) -> Result<(), CleanError> {
    let steps: Vec<f64> =
        rows.windows(2).map(|pair| stamps[pair[1]] - stamps[pair[0]]).filter(|step| *step > 0.0).collect();
    let (times, length) = (steps.len() + 1, steps.iter().sum::<f64>());
    let shared = rows.len() > 2 * times;
    match median(steps) {
        Some(apart) if shared && rows.len() as f64 > MOST_ROWS * factor * length => {
            Err(CleanError::FewTimes { rows: rows.len(), times, apart })
        }
        _ => Ok(()),
    }
}

/// Sorts the rows by time.
fn put_in_order(stamps: &[f64], rows: &mut [usize], found: &mut impl FnMut(FindingSeverity, String)) {
    let of =
        |order| (1..rows.len()).filter(|&i| stamps[rows[i]].total_cmp(&stamps[rows[i - 1]]) == order).count();
    let (back, on) = (of(Ordering::Less), of(Ordering::Greater));
    if back > 0 {
        rows.sort_by(|a, b| stamps[*a].total_cmp(&stamps[*b]));
        if back > on {
            let words = "time falls from row to row: the rows were taken from the last to the first; if they were measured in the order \
                         in which they stand, delete the column and give their rate (--rate HZ)";
            return found(FindingSeverity::Warning, words.to_owned());
        }
        found(FindingSeverity::Warning, format!("{back} rows were out of order in time and were sorted"));
    }
}

/// A clock that goes back by more than so many steps starts anew, if it runs on evenly there.
const ANEW: f64 = 20.0;
/// Number of rows that decide if it does.
const RUNS_ON: usize = 20;

/// Stretches of consecutively recorded rows: a new one begins at a new start of the clock. Blocks of one drive in a
/// wrong order, whose stamps do not overlap, are one stretch: sorting mends them.
pub(super) fn drives(stamps: &[f64]) -> Vec<Range<usize>> {
    let steps = stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    let typical = median(steps).unwrap_or(f64::INFINITY);
    let mut starts = vec![0];
    let mut latest = f64::NEG_INFINITY;
    for (row, stamp) in stamps.iter().enumerate().filter(|(_, stamp)| stamp.is_finite()) {
        let stays_below = || *stamp < latest - ANEW * typical && runs_on(&stamps[row..], latest);
        let was_set_back =
            || *stamp < latest - GAP_STEPS * typical && passes(&stamps[row..], latest, typical);
        if stays_below() || was_set_back() {
            starts.push(row);
            latest = *stamp;
        }
        latest = latest.max(*stamp);
    }
    let ends = starts.iter().skip(1).copied().chain([stamps.len()]);
    let drives: Vec<Range<usize>> = starts.iter().copied().zip(ends).map(|(from, to)| from..to).collect();
    let extent = |drive: &Range<usize>| {
        let stamps = stamps[drive.clone()].iter().copied().filter(|stamp| stamp.is_finite());
        stamps
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), stamp| (low.min(stamp), high.max(stamp)))
    };
    // Blocks in a wrong order do not lie among the stamps of others.
    let apart = |drive: &Range<usize>| {
        let (low, high) = extent(drive);
        stamps[..drive.start].iter().all(|stamp| !(low..=high).contains(stamp))
    };
    if drives.iter().all(apart) {
        return std::iter::once(0..stamps.len()).collect();
    }
    drives
}

/// Reason for which none of a log's drives can be used, from their errors.
pub(super) fn none_usable(drives: &[Range<usize>], errors: Vec<CleanError>) -> CleanError {
    let length = |error: &CleanError| match error {
        CleanError::TooShort { length, least, .. } => Some((*length, *least)),
        _ => None,
    };
    let lengths: Option<Vec<(f64, f64)>> = errors.iter().map(length).collect();
    match (drives, lengths) {
        ([_, second, ..], Some(lengths)) => CleanError::ShortDrives {
            row: second.start + 1,
            drives: drives.len(),
            length: lengths.iter().map(|(length, _)| *length).fold(0.0, f64::max),
            least: lengths.first().map_or(0.0, |(_, least)| *least),
        },
        _ => errors.into_iter().next().unwrap_or(CleanError::NoRows { rows: 0 }),
    }
}

/// True if the clock stays below its latest stamp for a while.
fn runs_on(stamps: &[f64], latest: f64) -> bool {
    stamps.iter().filter(|stamp| stamp.is_finite()).take(RUNS_ON).all(|stamp| *stamp < latest)
}

/// True if the clock goes on evenly up to its latest stamp and beyond: it was set back. Rows that came late end before it.
fn passes(stamps: &[f64], latest: f64, step: f64) -> bool {
    let even = |pair: &&[f64]| pair[1] > pair[0] && pair[1] - pair[0] < GAP_STEPS * step;
    let mut pairs = stamps.windows(2);
    pairs.by_ref().take_while(even).any(|pair| pair[1] > latest)
}

/// Units of clocks, s; those of the first four need no evidence but their steps.
const UNITS: [(f64, &str); 10] = [
    (1.0, "seconds"),
    (1e-3, "milliseconds"),
    (1e-6, "microseconds"),
    (1e-9, "nanoseconds"),
    (1e-4, "steps of 0.1 ms"),
    (1e-5, "steps of 0.01 ms"),
    (1e-7, "steps of 100 ns"),
    (60.0, "minutes"),
    (3600.0, "hours"),
    (86_400.0, "days"),
];
const USUAL: usize = 4;

/// Factor from the clock to seconds.
fn unit(stamps: &[f64], rows: &[usize], way: Option<f64>) -> f64 {
    let steps = rows.windows(2).map(|pair| stamps[pair[1]] - stamps[pair[0]]).filter(|step| *step > 0.0);
    let Some(step) = median(steps.collect()) else { return 1.0 };
    let plausible = |factor: f64| (factor * step > 1e-4 && factor * step < 2.0).then_some(factor);
    let by_way = way.filter(|way| *way > 0.0).map(|way| (way.log10() / 3.0).round().clamp(-3.0, 0.0));
    let by_way = by_way.and_then(|thousands| plausible(10_f64.powi(3 * thousands as i32)));
    // A unit that few clocks have must agree with the way.
    let rare = || {
        let agrees = |size: &&(f64, &str)| way.is_some_and(|way| (way / size.0 - 1.0).abs() < 0.1);
        UNITS[USUAL..].iter().find(agrees).and_then(|(size, _)| plausible(*size))
    };
    // Nobody records a drive with a row every few seconds, or with ten thousand a second.
    let by_step = || UNITS[..USUAL].iter().find_map(|(size, _)| plausible(*size));
    rare().or(by_way).or_else(by_step).unwrap_or(1.0)
}

/// Rows with the same stamp are spread up to the next stamp. A log begins and ends in the midst of a stamp: its first rows
/// are the last of their stamp, and its last rows the first, a row as far from the next as between.
fn spread(time: &mut [f64], found: &mut impl FnMut(FindingSeverity, String)) {
    let typical = typical_step(time).unwrap_or(0.0);
    let mut groups: Vec<Range<usize>> = Vec::new();
    for row in 0..time.len() {
        match groups.last_mut() {
            Some(group) if time[group.start] == time[row] => group.end = row + 1,
            _ => groups.push(row..row + 1),
        }
    }
    let until = |group: &Range<usize>| {
        let next = time.get(group.end).map(|next| next - time[group.start]);
        next.map_or(typical, |next| next.min(typical * group.len() as f64))
    };
    let inner = groups.get(1..groups.len().saturating_sub(1)).unwrap_or_default();
    let usual = median(inner.iter().map(|group| until(group) / group.len() as f64).collect());
    let mut spread = time.to_vec();
    let last = groups.len().saturating_sub(1);
    for (k, group) in groups.iter().enumerate().filter(|(_, group)| group.len() > 1) {
        let whole = until(group);
        let own = whole / group.len() as f64;
        let step = usual.filter(|_| k == 0 || k == last).map_or(own, |usual| usual.min(own));
        let begin = if k == 0 { whole - step * group.len() as f64 } else { 0.0 };
        for (i, row) in group.clone().enumerate() {
            spread[row] = time[row] + begin + step * i as f64;
        }
    }
    let count = time.len() - groups.len();
    time.copy_from_slice(&spread);
    if count > 0 {
        // A few in a long log are a recorder's habit.
        let gravity = if 100 * count > time.len() { FindingSeverity::Warning } else { FindingSeverity::Note };
        found(
            gravity,
            format!("{count} rows repeat the time of the row before; they were spread up to the next time"),
        );
    }
}

/// Leaves only the longest stretch without a very long gap.
fn longest_drive(
    rows: &mut Vec<usize>,
    time: &mut Vec<f64>,
    found: &mut impl FnMut(FindingSeverity, String),
) {
    let breaks = (1..time.len()).filter(|&i| time[i] - time[i - 1] > LONGEST_GAP);
    let edges: Vec<usize> = [0].into_iter().chain(breaks).chain([time.len()]).collect();
    let Some(&[from, to]) = edges.windows(2).max_by_key(|pair| pair[1] - pair[0]) else { return };
    if edges.len() > 2 {
        found(
            FindingSeverity::Warning,
            format!(
                "{} gaps of more than {LONGEST_GAP} s; only the longest drive between them is used, {:.1} s to {:.1} s",
                edges.len() - 2,
                time[from],
                time[to - 1]
            ),
        );
        *rows = rows[from..to].to_vec();
        *time = time[from..to].to_vec();
    }
}

/// The step between rows, without gaps: the mean of the steps near the median, since stamps are rounded.
fn typical_step(time: &[f64]) -> Option<f64> {
    let steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = median(steps.iter().copied().filter(|step| *step > 0.0).collect())?;
    let regular = steps.into_iter().filter(|step| *step < GAP_STEPS * middle);
    let (sum, count) = regular.fold((0.0, 0_u32), |(sum, count), step| (sum + step, count + 1));
    let mean = sum / f64::from(count);
    Some(if (mean / middle - 1.0).abs() < 0.1 { mean } else { middle })
}

/// Treats uneven stamps as late ones if the rows themselves come evenly.
fn straighten(time: &mut [f64], step: f64, found: &mut impl FnMut(FindingSeverity, String)) {
    let steps: Vec<f64> =
        time.windows(2).map(|pair| pair[1] - pair[0]).filter(|between| *between < GAP_STEPS * step).collect();
    let spread = (steps.iter().map(|between| (between - step).powi(2)).sum::<f64>()
        / steps.len().max(1) as f64)
        .sqrt();
    // Stamps in whole milliseconds spread by half of one, and that harms nothing.
    if spread < EVEN * step || spread < 1e-3 {
        return;
    }
    let count = time.len() as f64;
    let middle = 0.5 * (count - 1.0);
    let mean = time.iter().sum::<f64>() / count;
    let slope = time.iter().enumerate().map(|(i, stamp)| (i as f64 - middle) * (stamp - mean)).sum::<f64>()
        / (count * (count * count - 1.0) / 12.0);
    let even = |i: usize| mean + slope * (i as f64 - middle);
    let farthest = time.iter().enumerate().map(|(i, stamp)| (stamp - even(i)).abs()).fold(0.0, f64::max);
    let percent = 100.0 * spread / step;
    if farthest < LATE_STEPS * step {
        (0..time.len()).for_each(|i| time[i] = even(i));
        found(
            FindingSeverity::Note,
            format!(
                "the stamps jitter by {percent:.0} % of a step around an even clock; the even clock was taken"
            ),
        );
    } else {
        found(
            FindingSeverity::Warning,
            format!(
                "the time between rows varies by {percent:.0} % (standard deviation); values are interpolated to an even clock, and small delays are uncertain by that"
            ),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_start_of_the_clock_begins_a_drive() {
        let lap = |_| (0..50).map(|k| 0.02 * f64::from(k));
        let mut stamps: Vec<f64> = (0..3).flat_map(lap).collect();
        assert_eq!(drives(&stamps), [0..50, 50..100, 100..150]);
        stamps.swap(70, 71);
        assert_eq!(drives(&stamps), [0..50, 50..100, 100..150]);
    }

    #[test]
    fn a_clock_that_is_set_back_a_little_begins_a_drive() {
        let stamps: Vec<f64> =
            (0..300).map(|k| 0.02 * f64::from(k) - if k < 150 { 0.0 } else { 0.11 }).collect();
        assert_eq!(drives(&stamps), [0..150, 150..300]);
        // Four rows that come late, all at once.
        let mut stamps: Vec<f64> = (0..300).map(|k| 0.02 * f64::from(k)).collect();
        stamps[100..114].rotate_left(4);
        assert_eq!(drives(&stamps), std::iter::once(0..300).collect::<Vec<_>>());
    }

    #[test]
    fn blocks_in_a_wrong_order_and_late_rows_are_one_drive() {
        let mut stamps: Vec<f64> = (0..300).map(|k| 0.02 * f64::from(k)).collect();
        let late = stamps.remove(40);
        stamps.insert(90, late);
        assert_eq!(drives(&stamps), std::iter::once(0..300).collect::<Vec<_>>());
        let blocks = [&stamps[..100], &stamps[200..], &stamps[100..200]].concat();
        assert_eq!(drives(&blocks), std::iter::once(0..300).collect::<Vec<_>>());
    }
}
