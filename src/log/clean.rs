//! A log prepared for comparison: an even clock, no gaps, units and signs checked; every repair is reported.
//!
//! Faults with a certain repair are mended and reported (order, gaps, milliseconds, degrees, km/h, wrapped yaw). Others
//! are refused, or left as they are and reported as suspect; no answer from a suspect log is to be trusted.

use super::agreement::{self, Factors};
use super::averaged;
use super::clean_log::{
    CleanError, CleanLog, Coarseness, LEAST_LENGTH, STANDING, UnusableLog, is_long_enough,
};
use super::clock::{self, Clock};
use super::clock_steps;
use super::coarse;
use super::copied;
use super::description::describe;
use super::dropouts;
use super::even::on_even_clocks;
use super::finding::{Finding, FindingSeverity};
use super::frozen;
use super::held;
use super::join::JUMP;
use super::jumps::{self, Beyond, Jump};
use super::late::{self, Lateness};
use super::mixed;
use super::outliers;
use super::point;
use super::read::DriveLog;
use super::resample::{Interpolation, SHORT, between};
use super::reversing;
use super::rows::{LogColumns, LogRows, WrongRows, bridge, hold};
use super::saturated;
use super::spinning;
use super::turning;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

impl CleanLog {
    /// Cleans a log. `steering` is the road-wheel angle, rad, of the vehicle for each 1/m of curvature in steady
    /// cornering at a speed in m/s: about its wheelbase.
    ///
    /// # Errors
    /// Missing columns, and faults beyond repair.
    pub fn of(log: &DriveLog, steering: &dyn Fn(f64) -> f64) -> Result<Self, UnusableLog> {
        clean(log, steering, None).map_err(|cause| UnusableLog::of(log, cause))
    }

    /// The same of a known vehicle, whose centre of gravity lies `rear` m before its rear axle: velocities and places of another
    /// point of the body are brought there.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn of_vehicle(log: &DriveLog, steering: &dyn Fn(f64) -> f64, rear: f64) -> Result<Self, UnusableLog> {
        clean(log, steering, Some(rear)).map_err(|cause| UnusableLog::of(log, cause))
    }
}

/// A checked log: prepared for comparison, and the data on its rows for other uses.
pub(super) struct Checked {
    pub log: CleanLog,
    /// What was mended in the file.
    pub file: MendedFile,
    /// Columns that come late.
    pub late: Lateness,
    /// Reasons for which nothing can be learned from the errors to the path.
    pub errors: Option<CleanError>,
}

fn clean(log: &DriveLog, steering: &dyn Fn(f64) -> f64, rear: Option<f64>) -> Result<CleanLog, CleanError> {
    let columns = log.columns().map(|(name, values)| (name, values.to_vec())).collect();
    let mut clean = check(&columns, true, steering, rear)
        .map_err(|error| match error {
            CleanError::Missing { column, .. } => CleanError::Missing { column, near: log.like(column) },
            error => error,
        })?
        .log;
    clean.findings.extend(log.findings());
    Ok(clean)
}

/// The one check of a log, for every use. `turning`: the yaw rate is needed. `rear`: see [`CleanLog::of_vehicle`].
///
/// # Errors
/// Missing columns, and faults beyond repair.
pub(super) fn check(
    log: &LogColumns,
    turning: bool,
    steering: &dyn Fn(f64) -> f64,
    rear: Option<f64>,
) -> Result<Checked, CleanError> {
    for column in ["time", "vx", "yaw_rate"] {
        if !log.contains_key(column) && (turning || column != "yaw_rate") {
            return Err(CleanError::Missing { column, near: Vec::new() });
        }
    }
    let commanded = log.contains_key("steer_cmd");
    if !commanded && !log.contains_key("steer") {
        return Err(CleanError::Missing { column: "steer_cmd", near: Vec::new() });
    }
    outliers::absurd(log)?;

    let read = Read::of(log, commanded, &BTreeMap::new(), &[], steering)?;
    let impossible = impossible(log, &read)?;
    // Without these values even the units may be others.
    let read =
        if impossible.is_empty() { read } else { Read::of(log, commanded, &impossible, &[], steering)? };
    let mended = with_even_clock(log, &read);
    let (log, read) = match &mended {
        Some((mended, finding)) => {
            let mut read = Read::of(mended, commanded, &impossible, &[], steering)?;
            read.log.findings.push(finding.clone());
            (mended, read)
        }
        None => (log, read),
    };
    let read = without_jumps(log, commanded, &impossible, read, steering)?;
    let Read { mut log, file } = read;
    let seams = with_seams(&mut log, &file.drives);
    let signs = agreement::check(&mut log, steering);
    let errors = agreement::check_errors(&log, steering);
    without_seams(&mut log, &seams);
    signs?;
    agreement::check_order(&log)?;
    let mut late = late::mend(&mut log);
    if let Some(rear) = rear {
        point::mend(&mut log, rear);
    }
    for (name, seconds) in late::mend_felt(&mut log, &late) {
        *late.entry(name).or_insert(0.0) += seconds;
    }
    let errors = errors.err();
    if let Some(error) = &errors {
        log.find(
            FindingSeverity::Warning,
            "e1",
            format!("{error}; a diagnosis does not ask the errors to the path"),
        );
    }
    if !log.commanded {
        let steer = log.columns["steer"].clone();
        log.columns.insert("steer_cmd", steer);
        let words = "there is no steer_cmd: the measured angle steer stands in, and nothing between command and sensor can be seen";
        log.find(FindingSeverity::Note, "steer_cmd", words.into());
    }
    describe(&mut log);
    log.findings.sort_by_key(|finding| std::cmp::Reverse(finding.gravity));
    Ok(Checked { log, file, late, errors })
}

/// A log whose clock was set ahead in a drive, without that; none where it was not.
fn with_even_clock(log: &LogColumns, read: &Read) -> Option<(LogColumns, Finding)> {
    let MendedFile { drives, factors, .. } = &read.file;
    let steps = clock_steps::find(log, drives, factors);
    let first = steps.first()?;
    let stamps = &log["time"];
    let mut time = stamps.clone();
    for step in &steps {
        let drive = drives.iter().find(|drive| drive.rows.contains(&step.row))?;
        let [first, last] = [drive.rows.iter().min()?, drive.rows.iter().max()?];
        let later = (*first..=*last).filter(|&row| stamps[row] >= stamps[step.row]);
        later.for_each(|row| time[row] -= step.ahead / drive.factor);
    }
    let words = format!(
        "the clock goes ahead by {:.2} s before row {}{}, and the vehicle's place does not: it was set in mid-drive; the rows behind it \
         were taken as much earlier",
        first.ahead,
        first.row + 1,
        if steps.len() > 1 { format!(", and {} times more", steps.len() - 1) } else { String::new() },
    );
    let mut mended = log.clone();
    mended.insert("time", time);
    Some((mended, Finding::new(FindingSeverity::Warning, Some("time"), words)))
}

/// A log whose place jumps, as several drives; without its place, if these were too short.
fn without_jumps(
    log: &LogColumns,
    commanded: bool,
    wrong: &WrongRows,
    read: Read,
    steering: &dyn Fn(f64) -> f64,
) -> Result<Read, CleanError> {
    let jumps = jumps::jumps(log, &read.file.drives, &read.file.factors, &read.file.left_out);
    let Some(first) = jumps.first() else { return Ok(read) };
    let judged = |read: &Read| read.log.valid.iter().filter(|valid| **valid).count();
    match Read::of(log, commanded, wrong, &jumps, steering) {
        Ok(parts) if 2 * judged(&parts) >= judged(&read) => Ok(parts),
        // Of a motion without places nothing is to be left out.
        _ if !matches!(first.beyond, Beyond::Way(_)) => Ok(read),
        _ => {
            let mut log = log.clone();
            log.retain(|name, _| !matches!(*name, "x" | "y"));
            let mut read = Read::of(&log, commanded, wrong, &[], steering)?;
            for name in ["x", "y"] {
                read.file.left_out.insert(name, (0..log["vx"].len()).collect());
            }
            let words = format!(
                "x and y jump {} times, first by {} in row {}, and agree with vx for too short a time between: they are left out",
                jumps.len(),
                first.beyond.size(),
                first.row + 1
            );
            read.log.find(FindingSeverity::Warning, "x", words);
            Ok(read)
        }
    }
}

/// A log on an even clock in SI units.
struct Read {
    log: CleanLog,
    file: MendedFile,
}

/// What was mended in a file.
pub(super) struct MendedFile {
    /// Factors of the columns; those in SI units are not named.
    factors: Factors,
    /// Rows whose value in a column is wrong.
    left_out: WrongRows,
    /// The drives: rows in their order, and their times.
    pub drives: Vec<Clock>,
    /// Mended columns before they were brought to an even clock, the row of the file of each, and factors that are in them.
    mended: LogColumns,
    in_file: Vec<usize>,
    factors_in_mended: Factors,
}

impl Read {
    /// Reads the columns without the values of `wrong`; a drive ends at each of `jumps`.
    fn of(
        log: &LogColumns,
        commanded: bool,
        wrong: &WrongRows,
        jumps: &[Jump],
        steering: &dyn Fn(f64) -> f64,
    ) -> Result<Self, CleanError> {
        let mut findings = Vec::new();
        let mut columns = log.clone();
        let mut stamps = columns.remove("time").unwrap_or_default();
        for (name, rows) in wrong {
            let Some(column) = columns.get_mut(name) else { continue };
            let values: Vec<(usize, f64)> = rows.iter().map(|&row| (row, column[row])).collect();
            rows.iter().for_each(|&row| column[row] = f64::NAN);
            let words = format!(
                "{}: no road vehicle does that; left out, like missing values",
                outliers::listed(name, &values)
            );
            findings.push(Finding::new(FindingSeverity::Warning, Some(name), words));
        }
        let mut left_out = wrong.clone();
        leave_out_astray(&mut columns, jumps, &mut left_out, &mut findings);
        outliers::stamps(&mut stamps, &mut findings);
        dropouts::leave_out_rows(&mut columns, &mut left_out, &mut findings);
        let drives = read_drives(&stamps, &columns, jumps, &mut findings)?;
        let rows: Vec<usize> = drives.iter().flat_map(|drive| drive.rows.iter().copied()).collect();
        for column in columns.values_mut() {
            *column = rows.iter().map(|&row| column[row]).collect();
        }
        let (mut time, mut spans, mut factors) = (Vec::new(), Vec::new(), Factors::new());
        for drive in &drives {
            let from = time.last().map_or(0.0, |last| last + JUMP - drive.time[0]);
            spans.push(time.len()..time.len() + drive.rows.len());
            // One drive is left as it is, to the last bit.
            time.extend(drive.time.iter().map(|stamp| if from == 0.0 { *stamp } else { from + stamp }));
        }
        let mut mended = LogRows {
            file: log,
            columns,
            time,
            spans,
            spacing: drives[0].spacing,
            in_file: rows,
            findings,
            left_out,
            coarse: BTreeMap::new(),
        };
        dropouts::leave_out(&mut mended);
        frozen::leave_out_speeds(&mut mended);
        turning::mend(&mended.time, &mut mended.columns, &mut factors, &mut mended.findings);
        copied::leave_out(&mut mended);
        averaged::leave_out(&mut mended);
        held::mend(&mut mended, &[]);
        frozen::leave_out_contradicted(&mut mended);
        coarse::mend(&mut mended);
        leave_out_faults(&mut mended);
        let LogRows { columns, spans, findings, left_out, in_file, coarse, .. } = mended;
        let factors_in_mended = factors.clone();
        let mut log = on_even_clocks(&drives, &spans, &columns, commanded, &left_out, findings)?;
        let seams = with_seams(&mut log, &drives);
        agreement::mend_units(&mut log, &mut factors);
        without_seams(&mut log, &seams);
        leave_out_standing(&mut log)?;
        reversing::leave_out(&mut log, steering);
        spinning::leave_out(&mut log);
        let seams = with_seams(&mut log, &drives);
        agreement::mend_steering(&mut log, &mut factors, steering);
        agreement::leave_out_rests(&mut log, steering);
        without_seams(&mut log, &seams);
        let of = |factors: &Factors, name: &str| factors.get(name).copied().unwrap_or(1.0);
        for (name, coarse) in coarse {
            let unit = (of(&factors, name) / of(&factors_in_mended, name)).abs();
            log.coarse.insert(name, Coarseness { deviation: unit * coarse.deviation, ..coarse });
        }
        let file = MendedFile { factors, left_out, drives, mended: columns, in_file, factors_in_mended };
        Ok(Self { log, file })
    }
}

impl MendedFile {
    /// The columns of the file, row by row, in SI units, mended but for what comes late; what is wrong is not a number.
    pub fn columns(&self, file: &LogColumns) -> LogColumns {
        let factor = |factors: &Factors, name: &str| factors.get(name).copied().unwrap_or(1.0);
        let mut columns = file.clone();
        for (&name, column) in &mut columns {
            let whole = factor(&self.factors, name);
            column.iter_mut().for_each(|value| *value *= whole);
            if let Some(mended) = self.mended.get(name) {
                let rest = whole / factor(&self.factors_in_mended, name);
                self.in_file.iter().zip(mended).for_each(|(&row, value)| column[row] = rest * value);
            }
            // Of several recorders each row may have the columns of one.
            for Clock { rows, time, .. } in &self.drives {
                let values: Vec<f64> = rows.iter().map(|&row| column[row]).collect();
                let filled = match name {
                    "time" => continue,
                    "steer_cmd" => hold(time, &values),
                    _ if between(name) == Interpolation::Hold => hold(time, &values),
                    _ => bridge(time, &values, SHORT),
                };
                rows.iter().zip(filled).for_each(|(&row, value)| column[row] = value);
            }
            self.left_out.get(name).into_iter().flatten().for_each(|&row| column[row] = f64::NAN);
        }
        columns
    }
}

/// Leaves out what is no measurement.
pub(super) fn leave_out_faults(log: &mut LogRows) {
    saturated::leave_out(log);
    outliers::leave_out(log);
    frozen::leave_out(log);
}

/// The drives of a log: the clock may start anew, and the place may jump.
fn read_drives(
    stamps: &[f64],
    columns: &LogColumns,
    jumps: &[Jump],
    findings: &mut Vec<Finding>,
) -> Result<Vec<Clock>, CleanError> {
    let way = agreement::way_factor_of(stamps, |name| columns.get(name).map(Vec::as_slice));
    let by_clock = clock::drives(stamps);
    let spans = divided(&by_clock, jumps);
    let (mut drives, mut errors) = (Vec::new(), Vec::new());
    for span in &spans {
        let from = span.start;
        let same = |a: usize, b: usize| {
            columns.values().all(|column| column[from + a].to_bits() == column[from + b].to_bits())
        };
        let mut found = Vec::new();
        match clock::read(&stamps[span.clone()], LEAST_LENGTH, way, same, &mut found) {
            Ok(mut clock) => {
                let rows: Vec<usize> = clock.rows.iter().map(|row| from + row).collect();
                if let Some(names) = mixed::columns(columns, &rows, stamps) {
                    return Err(CleanError::Mixed { columns: names });
                }
                if let Err(error) = without_filled(&mut clock, from, columns, &mut found) {
                    errors.push(error);
                    continue;
                }
                clock.rows.iter_mut().for_each(|row| *row += from);
                drives.push(clock);
                found.retain(|finding| !findings.contains(finding));
                findings.append(&mut found);
            }
            Err(error) => errors.push(error),
        }
    }
    if drives.is_empty() {
        return Err(clock::none_usable(&spans, errors));
    }
    let used =
        format!("{} drives, of which {} of {LEAST_LENGTH} s and more are used", spans.len(), drives.len());
    if by_clock.len() > 1 {
        let rows: Vec<String> =
            by_clock[1..].iter().take(8).map(|span| (span.start + 1).to_string()).collect();
        let more = if by_clock.len() > 9 { ", ..." } else { "" };
        let words = format!("the clock jumps back and starts anew in row {}{more}: {used}", rows.join(", "));
        findings.push(Finding::new(FindingSeverity::Warning, Some("time"), words));
    }
    if let Some(jump) = jumps.first() {
        let more =
            if jumps.len() > 1 { format!(", and {} times more", jumps.len() - 1) } else { String::new() };
        let (column, what) = jump.beyond.words();
        let words = format!(
            "{what} in row {}{more}: rows are missing, or another drive begins; {used}",
            jump.row + 1
        );
        findings.push(Finding::new(FindingSeverity::Warning, Some(column), words));
    }
    Ok(drives)
}

/// Leaves out places of a receiver that has lost its way.
fn leave_out_astray(
    columns: &mut LogColumns,
    jumps: &[Jump],
    left_out: &mut WrongRows,
    findings: &mut Vec<Finding>,
) {
    let astray: BTreeSet<usize> = jumps.iter().flat_map(|jump| jump.astray.iter().copied()).collect();
    let (Some(first), Some(last)) = (astray.first(), astray.last()) else { return };
    let words = format!(
        "x and y drift away from vx and yaw before or after they jump: the receiver had lost its way; left out in {} rows from row {} \
         to row {}",
        astray.len(),
        first + 1,
        last + 1
    );
    findings.push(Finding::new(FindingSeverity::Warning, Some("x"), words));
    for name in ["x", "y"] {
        let Some(column) = columns.get_mut(name) else { continue };
        astray.iter().for_each(|&row| column[row] = f64::NAN);
        left_out.entry(name).or_default().extend(&astray);
    }
}

/// Stretches of rows, divided at jumps.
fn divided(spans: &[Range<usize>], jumps: &[Jump]) -> Vec<Range<usize>> {
    let mut starts: Vec<usize> = spans.iter().map(|span| span.start).collect();
    let end = spans.last().map_or(0, |span| span.end);
    starts.extend(jumps.iter().map(|jump| jump.row));
    starts.sort_unstable();
    starts.dedup();
    let ends = starts.iter().skip(1).copied().chain([end]);
    starts.iter().copied().zip(ends).map(|(from, to)| from..to).collect()
}

/// Columns that a drive moves at each row.
const ALWAYS: [&str; 7] = ["steer", "vx", "vy", "yaw_rate", "ax", "ay", "x"];

/// Leaves out the rows that someone has filled in between others. `from` is the row of the file that is the clock's first.
fn without_filled(
    clock: &mut Clock,
    from: usize,
    columns: &LogColumns,
    findings: &mut Vec<Finding>,
) -> Result<(), CleanError> {
    let moving: Vec<Vec<f64>> = ALWAYS
        .iter()
        .filter_map(|name| columns.get(name))
        .map(|column| clock.rows.iter().map(|&row| column[from + row]).collect())
        .collect();
    let moving: Vec<&[f64]> = moving.iter().map(Vec::as_slice).collect();
    let lines = || held::beat_of_lines(&moving, held::LONGEST_LINE).map(|found| (found, "interpolated"));
    let repeats = || held::beat_of_repeats(&moving).map(|found| (found, "repeated"));
    let Some(((beat, knot), how)) = lines().or_else(repeats) else { return Ok(()) };
    clock.every(beat, knot)?;
    let words = format!(
        "one row in {beat} was measured, and those between were {how} from it: {:.1} rows a second are used",
        1.0 / clock.spacing
    );
    findings.push(Finding::new(FindingSeverity::Warning, Some("time"), words));
    Ok(())
}

/// Signals of a vehicle's motion that need a bound in every diagnosis.
const BOUNDED: [&str; 10] = ["steer_cmd", "steer", "x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay"];

/// Values that are impossible for a road vehicle, once units are known: rows of the file by column.
///
/// # Errors
/// Too many impossible values for glitches in a needed column.
fn impossible(log: &LogColumns, read: &Read) -> Result<WrongRows, CleanError> {
    let mut all = BTreeMap::new();
    for (&name, values) in log.iter().filter(|(name, _)| BOUNDED.contains(name)) {
        let factor = read.file.factors.get(name).copied().unwrap_or(1.0);
        let known = read.file.left_out.get(name).map(Vec::as_slice).unwrap_or_default();
        let mut rows = outliers::impossible(name, values, factor);
        rows.retain(|row| !known.contains(row));
        if rows.is_empty() {
            continue;
        }
        // One number throughout is a recorder's word for none.
        let is_word = rows.iter().all(|&row| values[row] == values[rows[0]]);
        let most = if is_word { dropouts::MOST } else { outliers::MOST };
        if rows.len() as f64 <= most * values.len() as f64 {
            all.insert(name, rows);
        } else if matches!(name, "vx" | "yaw_rate") {
            let (row, count) = (rows[0], rows.len());
            return Err(CleanError::Impossible { column: name, row: row + 1, value: values[row], count });
        }
    }
    Ok(all)
}

/// Takes the rows about the seams between drives out of the comparison; gives those that counted.
fn with_seams(log: &mut CleanLog, drives: &[Clock]) -> Vec<usize> {
    if drives.len() < 2 {
        return Vec::new();
    }
    let seams: Vec<usize> =
        (1..log.time.len()).filter(|&row| log.time[row] - log.time[row - 1] > 0.9 * JUMP).collect();
    let rows: Vec<usize> =
        seams.iter().flat_map(|&row| [row - 1, row]).filter(|&row| log.valid[row]).collect();
    rows.iter().for_each(|&row| log.valid[row] = false);
    rows
}

fn without_seams(log: &mut CleanLog, rows: &[usize]) {
    rows.iter().for_each(|&row| log.valid[row] = true);
}

/// A vehicle that stands tells nothing.
fn leave_out_standing(log: &mut CleanLog) -> Result<(), CleanError> {
    let vx = &log.columns["vx"];
    let mut standing = 0_usize;
    for (valid, vx) in log.valid.iter_mut().zip(vx) {
        standing += usize::from(*vx < STANDING);
        *valid &= *vx >= STANDING;
    }
    let moving = log.step * (vx.len() - standing) as f64;
    let judged = log.step * log.valid.iter().filter(|valid| **valid).count() as f64;
    if !is_long_enough(judged) {
        return Err(CleanError::Standing { moving: judged.min(moving) });
    }
    if standing > 0 {
        let words = format!(
            "for {:.1} s the vehicle stands, creeps or rolls back (below {STANDING} m/s): not judged",
            log.step * standing as f64
        );
        log.find(FindingSeverity::Note, "vx", words);
    }
    Ok(())
}
