//! Data for the identification of the steering actuator: command and response of a log, on its own mended clock.
//!
//! The measured angle is compared row by row, as it was recorded: resampled commands are no commands any more. A new
//! start of the clock begins a new drive. The yaw rate goes through a vehicle's model and is taken from the even clock
//! of [`CleanLog`], with all repairs that are made there.

use super::agreement::{near, steers_early, way_factor_of};
use super::averaged;
use super::clean::leave_out_faults;
use super::clean_log::{CleanError, CleanLog, STANDING, UnusableLog};
use super::clock;
use super::coarse;
use super::copied;
use super::dropouts;
use super::finding::{Finding, FindingSeverity};
use super::held;
use super::join::JUMP;
use super::outliers;
use super::read::DriveLog;
use super::rows::{LogColumns, LogRows, WrongRows, hold};
use crate::nominal::SteeringDrive;
use crate::numerics::statistics::{median, quantile};
use std::collections::BTreeMap;
use std::ops::Range;

const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Steering beyond this is an angle in degrees, or at the steering wheel, rad.
const MOST: f64 = 1.6;

/// Least length of a drive, s: longer than what is forgotten at its beginning and a delay. The intervals say what it tells.
const LEAST_LENGTH: f64 = 2.0;

/// A log's drives for an identification, and what was found on the way.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SteeringLog {
    /// One for each start of the clock.
    pub drives: Vec<SteeringDrive>,
    /// Repairs and suspicions, the gravest first.
    pub findings: Vec<Finding>,
    /// True where command or angle are no radians at the wheels: a gap and an offset are in their unit.
    pub in_other_unit: bool,
}

impl SteeringLog {
    /// Drives with the measured angle as response; `steering` as for [`CleanLog::of`].
    ///
    /// # Errors
    /// A missing column; no stretch that is long enough.
    pub fn by_angle(log: &DriveLog, steering: &dyn Fn(f64) -> f64) -> Result<Self, UnusableLog> {
        let unusable = |cause| UnusableLog::of(log, cause);
        let column = |name: &'static str| {
            log.column(name)
                .ok_or_else(|| unusable(CleanError::Missing { column: name, near: log.like(name) }))
        };
        let (stamps, command, angle) = (column("time")?, column("steer_cmd")?, column("steer")?);
        let columns: LogColumns = log
            .columns()
            .filter(|(name, _)| ["steer_cmd", "steer", "vx"].contains(name))
            .map(|(name, values)| (name, values.to_vec()))
            .collect();
        outliers::absurd(&log.columns().map(|(name, values)| (name, values.to_vec())).collect())
            .map_err(unusable)?;
        let mut found = Self { findings: log.findings().collect(), ..Self::default() };
        let factors = found.units(log, [command, angle], steering)?;
        let (mut errors, mut stated) = (Vec::new(), Vec::new());
        let way = way_factor_of(stamps, |name| log.column(name));
        let spans = clock::drives(stamps);
        let name = log.file.display().to_string();
        for span in &spans {
            let [stamps, command, angle] = [stamps, command, angle].map(|column| &column[span.clone()]);
            let same = |a: usize, b: usize| {
                command[a].to_bits() == command[b].to_bits() && angle[a].to_bits() == angle[b].to_bits()
            };
            let mut findings = Vec::new();
            match clock::read(stamps, LEAST_LENGTH, way, same, &mut findings) {
                Ok(clock) => {
                    let in_file: Vec<usize> = clock.rows.iter().map(|row| span.start + row).collect();
                    let of = |(&name, column): (&&'static str, &Vec<f64>)| {
                        (name, in_file.iter().map(|&row| column[row]).collect())
                    };
                    let mut rows = LogRows {
                        file: &columns,
                        columns: columns.iter().map(of).collect(),
                        time: clock.time.clone(),
                        spans: std::iter::once(0..in_file.len()).collect(),
                        spacing: clock.spacing,
                        in_file,
                        findings,
                        left_out: WrongRows::new(),
                        coarse: BTreeMap::new(),
                    };
                    dropouts::leave_out(&mut rows);
                    if let Some(words) = copied::copy(&rows).or_else(|| averaged::contradiction(&rows)) {
                        return Err(unusable(CleanError::Suspect { words }));
                    }
                    if let Some(seconds) =
                        steers_early(rows.spacing, &rows.columns["steer_cmd"], &rows.columns["steer"])
                    {
                        return Err(unusable(CleanError::Early { seconds }));
                    }
                    // A fit needs no angle where none was measured.
                    held::mend(&mut rows, &["steer"]);
                    let written = rows.columns["steer"].clone();
                    coarse::mend(&mut rows);
                    leave_out_faults(&mut rows);
                    // A line through the steps of a number begins before the number does: it would make the lag longer.
                    let angles = rows.columns.get_mut("steer").into_iter().flatten();
                    angles
                        .zip(written)
                        .filter(|(angle, _)| angle.is_finite())
                        .for_each(|(angle, it)| *angle = it);
                    let idle = idle(&mut rows);
                    found.findings.append(&mut rows.findings);
                    let commands = clock.time.iter().copied().zip(rows.columns["steer_cmd"].iter().copied());
                    stated.push(commands.filter(|(_, command)| command.is_finite()).collect());
                    found.drives.push(drive(name.clone(), &clock.time, &rows.columns, factors, &idle));
                }
                Err(error) => errors.push(error),
            }
        }
        if found.drives.is_empty() {
            return Err(unusable(clock::none_usable(&spans, errors)));
        }
        if spans.len() > 1 {
            let words = format!(
                "the clock starts anew {} times: {} drives of {LEAST_LENGTH} s and more are used",
                spans.len() - 1,
                found.drives.len()
            );
            found.findings.push(Finding::new(FindingSeverity::Warning, Some("time"), words));
        }
        found.findings.extend(seldom_commanded(&stated));
        found.findings.sort_by_key(|finding| std::cmp::Reverse(finding.gravity));
        Ok(found)
    }

    /// The drive with the yaw rate as response.
    ///
    /// # Errors
    /// As [`CleanLog::of`]; a log without the command.
    pub fn by_yaw_rate(log: &DriveLog, steering: &dyn Fn(f64) -> f64) -> Result<Self, UnusableLog> {
        let clean = CleanLog::of(log, steering)?;
        if !clean.commanded {
            let cause = CleanError::Missing { column: "steer_cmd", near: log.like("steer_cmd") };
            return Err(UnusableLog::of(log, cause));
        }
        if let Some(finding) = clean.suspect() {
            let cause = CleanError::Suspect { words: finding.summary.clone() };
            return Err(UnusableLog::of(log, cause));
        }
        let valid = |column: &str| -> Vec<f64> {
            let values = clean.columns[column].iter().zip(&clean.valid);
            values.map(|(value, valid)| if *valid { *value } else { f64::NAN }).collect()
        };
        let (command, response, speed) =
            (&clean.columns["steer_cmd"], valid("yaw_rate"), &clean.columns["vx"]);
        // Where the clock started anew there is a jump.
        let jumps = (1..clean.time.len()).filter(|&row| clean.time[row] - clean.time[row - 1] > 0.9 * JUMP);
        let edges: Vec<usize> = [0].into_iter().chain(jumps).chain([clean.time.len()]).collect();
        let part = |edge: &[usize]| SteeringDrive {
            name: log.file.display().to_string(),
            steer_cmd: command[edge[0]..edge[1]].to_vec(),
            response: response[edge[0]..edge[1]].to_vec(),
            speed: speed[edge[0]..edge[1]].to_vec(),
            time: clean.time[edge[0]..edge[1]].to_vec(),
        };
        Ok(Self {
            drives: edges.windows(2).map(part).collect(),
            findings: clean.findings,
            in_other_unit: false,
        })
    }

    /// Factors to radians of command and angle.
    fn units(
        &mut self,
        log: &DriveLog,
        columns: [&[f64]; 2],
        steering: &dyn Fn(f64) -> f64,
    ) -> Result<[f64; 2], UnusableLog> {
        let high = |values: &[f64]| quantile(values.iter().map(|value| value.abs()).collect(), 0.95);
        // Where the log tells how it turned, cleaning knows units and signs.
        let clean = match CleanLog::of(log, steering) {
            Ok(clean) => Some(clean),
            Err(UnusableLog {
                cause: cause @ (CleanError::Sign { .. } | CleanError::SteeringWheel { .. }),
                ..
            }) => {
                self.in_other_unit = true;
                let words = format!("{cause}; dead time and lag do not depend on it");
                self.findings.push(Finding::new(FindingSeverity::Warning, Some("steer_cmd"), words));
                None
            }
            // The angle would come before its command.
            Err(error @ UnusableLog { cause: CleanError::Backwards, .. }) => return Err(error),
            Err(_) => None,
        };
        let mut factors = [1.0; 2];
        for ((name, column), factor) in ["steer_cmd", "steer"].into_iter().zip(columns).zip(&mut factors) {
            let Some(raw) = high(column).filter(|raw| *raw > MOST) else { continue };
            let mended = clean.as_ref().and_then(|clean| high(clean.columns.get(name)?));
            if mended.is_some_and(|mended| near(mended / raw / DEGREE, 1.0)) {
                *factor = DEGREE;
                let words = format!("{name} was taken as degrees and converted to radians");
                self.findings.push(Finding::new(FindingSeverity::Warning, Some(name), words));
            } else {
                self.in_other_unit = true;
                let words = format!(
                    "{name} reaches {raw:.1}: degrees, or a steering-wheel angle? Gain and offset are in its unit"
                );
                self.findings.push(Finding::new(FindingSeverity::Warning, Some(name), words));
            }
        }
        Ok(factors)
    }
}

/// Rows in which the actuator was given no command.
fn idle(rows: &mut LogRows) -> Vec<bool> {
    let mut idle = standing(rows);
    let [command, angle] = ["steer_cmd", "steer"].map(|name| &rows.columns[name]);
    let copies = copied::stretches(command, angle, rows.spacing);
    if !copies.is_empty() {
        let seconds = rows.spacing * copies.iter().map(Range::len).sum::<usize>() as f64;
        let words = format!(
            "for {seconds:.1} s steer_cmd is the angle that was measured: nothing was commanded; left out"
        );
        rows.find(FindingSeverity::Warning, "steer_cmd", words);
        copies.into_iter().for_each(|copy| idle[copy].fill(true));
    }
    idle
}

/// Rows in which the vehicle stands, where the log has it moving, too: a person turns the wheel, and tyres that do not roll hold it.
/// What follows is a new stretch: no command tells where the wheels were.
fn standing(rows: &mut LogRows) -> Vec<bool> {
    let stands: Vec<bool> =
        rows.columns.get("vx").into_iter().flatten().map(|vx| vx.abs() < STANDING).collect();
    let count = stands.iter().filter(|stands| **stands).count();
    if count == 0 || count == stands.len() {
        return vec![false; rows.time.len()];
    }
    let seconds = count as f64 * rows.spacing;
    let words = format!("for {seconds:.1} s the vehicle stands or creeps (below {STANDING} m/s): left out");
    rows.find(FindingSeverity::Note, "vx", words);
    stands
}

/// Time from command to command beyond which it matters that it may have changed between, s: a controller's usual one.
const SELDOM: f64 = 0.025;
/// Share of the changes that another one follows at once, from which on the command may have changed between them.
const EACH: f64 = 0.5;

/// Times of the commands that a log states, and the commands.
type Stated = Vec<(f64, f64)>;

/// A word on a command that changes from one to the next, and comes seldom: between them it may have been another one.
fn seldom_commanded(drives: &[Stated]) -> Option<Finding> {
    let steps = |drive: &Stated| -> Vec<(f64, bool)> {
        drive.windows(2).map(|pair| (pair[1].0 - pair[0].0, pair[0].1 != pair[1].1)).collect()
    };
    let steps: Vec<(f64, bool)> = drives.iter().flat_map(steps).collect();
    let changes = steps.iter().filter(|(_, changed)| *changed).count();
    let in_turn = steps.windows(2).filter(|pair| pair[0].1 && pair[1].1).count();
    let apart = median(steps.into_iter().map(|(apart, _)| apart).collect())?;
    if apart < SELDOM || (in_turn as f64) < EACH * changes as f64 || changes == 0 {
        return None;
    }
    let words = format!(
        "a command stands each {apart:.3} s and is taken to be in force up to the next one; if it changed between, the dead time, and \
         its sum with the lag, are up to {:.3} s longer than told",
        0.5 * apart
    );
    Some(Finding::new(FindingSeverity::Warning, Some("steer_cmd"), words))
}

/// Command and measured angle at their times. A command is in force up to the next one; rows without are
/// left out, and so are those in which none was given to it.
fn drive(
    name: String,
    time: &[f64],
    columns: &LogColumns,
    factors: [f64; 2],
    idle: &[bool],
) -> SteeringDrive {
    let (command, angle) = (&hold(time, &columns["steer_cmd"]), &columns["steer"]);
    let rows: Vec<usize> = (0..time.len()).filter(|&row| command[row].is_finite() && !idle[row]).collect();
    let of = |column: &[f64], factor: f64| rows.iter().map(|&row| factor * column[row]).collect();
    SteeringDrive {
        name,
        steer_cmd: of(command, factors[0]),
        response: of(angle, factors[1]),
        time: of(time, 1.0),
        ..SteeringDrive::default()
    }
}
