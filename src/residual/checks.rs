//! Faults of recorded drives: rates, gaps, units, stuck columns.

use super::recorded::{DataReport, DriveRow, ROAD_NAMES, Recorded};
use crate::nominal::SingleTrackError;
use crate::signal::{self, Signal};

/// Reasons for which drives cannot be learned from.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DataError {
    /// The nominal model cannot be made.
    #[error(transparent)]
    Vehicle(#[from] SingleTrackError),
    /// A sample time that is none.
    #[error("the sample time {value} s must be a positive number")]
    SampleTime {
        /// The value given.
        value: f64,
    },
    /// There is no row that can be used.
    #[error(
        "{rows} rows were given and none can be used; a drive needs rows in which all columns are numbers"
    )]
    Empty {
        /// Rows given.
        rows: usize,
    },
    /// A state of the vehicle was not recorded.
    #[error("drive {drive}: there is no column `{column}`, and it is a state of this vehicle; record it")]
    NoColumn {
        /// The drive.
        drive: String,
        /// The column.
        column: &'static str,
    },
    /// Columns differ in length.
    #[error(
        "drive {drive}: column `{column}` has {found} rows where `time` has {expected}; all columns need the same"
    )]
    ColumnLength {
        /// The drive.
        drive: String,
        /// The column.
        column: &'static str,
        /// Its length.
        found: usize,
        /// The length of `time`.
        expected: usize,
    },
    /// Time stands or runs backwards.
    #[error(
        "drive {drive}, row {row}: time goes from {before} s to {after} s; it must increase (are several drives in one file? give one drive for each)"
    )]
    TimeOrder {
        /// The drive.
        drive: String,
        /// The row, from 0.
        row: usize,
        /// Time of the row before.
        before: f64,
        /// Time of the row.
        after: f64,
    },
    /// The drive cannot be brought to the sample time.
    #[error(
        "drive {drive} is sampled every {found:.6} s, the controller every {wanted} s; only a whole number of times faster can be thinned, so record every {wanted} s or a whole fraction of it, or train for a sample time that fits"
    )]
    Rate {
        /// The drive.
        drive: String,
        /// Median time between rows, s.
        found: f64,
        /// The controller's sample time, s.
        wanted: f64,
    },
    /// Many values that cannot be.
    #[error(
        "drive {drive}: `{column}` is outside [{min}, {max}] {unit} in {rows} rows, e.g. {value} in row {row}; {hint}"
    )]
    OutOfRange {
        /// The drive.
        drive: String,
        /// The column.
        column: &'static str,
        /// Smallest value that can be.
        min: f64,
        /// Largest value that can be.
        max: f64,
        /// Their unit.
        unit: &'static str,
        /// Rows concerned.
        rows: usize,
        /// The first of them, from 0.
        row: usize,
        /// The value there.
        value: f64,
        /// Probable cause.
        hint: &'static str,
    },
    /// A column has the wrong unit, judged by the vehicle's motion.
    #[error("`{column}` is {factor:.3} times what the motion says ({evidence}); {hint}")]
    Unit {
        /// The column.
        column: &'static str,
        /// Ratio of the values to the expected ones.
        factor: f64,
        /// Quantity that it was compared with.
        evidence: &'static str,
        /// Probable cause.
        hint: &'static str,
    },
    /// A column that must change never does.
    #[error("`{column}` is {value} in every row; {hint}")]
    Constant {
        /// The column.
        column: &'static str,
        /// Its value.
        value: f64,
        /// Advice.
        hint: &'static str,
    },
}

/// Deviation from the median step beyond which rows are not neighbours.
const GAP: f64 = 0.25;

/// Deviation of the ratio of rates from a whole number that still counts as jitter of clocks.
const RATE: f64 = 0.02;

/// Share of rows with impossible values beyond which they are no glitches but a wrong unit.
const GLITCHES: f64 = 0.01;

/// The uninterrupted stretches of a drive, at the sample time.
pub(super) fn stretches<const S: usize>(
    drive: &Recorded<'_, S>,
    sample_time: f64,
    report: &mut DataReport,
) -> Result<Vec<Vec<DriveRow<S>>>, DataError> {
    if !(sample_time > 0.0 && sample_time.is_finite()) {
        return Err(DataError::SampleTime { value: sample_time });
    }
    let time = drive.time();
    let expected = time.len();
    for &(column, values) in &drive.columns {
        if values.len() != expected {
            let drive = drive.name.to_owned();
            if values.is_empty() {
                return Err(DataError::NoColumn { drive, column });
            }
            return Err(DataError::ColumnLength { drive, column, found: values.len(), expected });
        }
    }
    report.rows += expected;
    let kept = plausible(drive, report)?;
    let mut steps = Vec::with_capacity(kept.len());
    for pair in kept.windows(2) {
        let (before, after) = (time[pair[0]], time[pair[1]]);
        if after <= before {
            return Err(DataError::TimeOrder { drive: drive.name.to_owned(), row: pair[1], before, after });
        }
        steps.push(after - before);
    }
    if steps.is_empty() {
        return Ok(vec![]);
    }
    let middle = steps.len() / 2;
    let step = *steps.clone().select_nth_unstable_by(middle, f64::total_cmp).1;
    let ratio = sample_time / step;
    let factor = ratio.round().max(1.0);
    if (ratio / factor - 1.0).abs() > RATE {
        return Err(DataError::Rate { drive: drive.name.to_owned(), found: step, wanted: sample_time });
    }
    if factor > 1.0 {
        report.thinned.push((drive.name.to_owned(), factor as usize));
    }
    let mut stretches = vec![vec![drive.row(kept[0])]];
    for (&row, found) in kept[1..].iter().zip(steps) {
        if (found / step - 1.0).abs() > GAP {
            report.gaps += 1;
            stretches.push(vec![]);
        }
        if let Some(stretch) = stretches.last_mut() {
            stretch.push(drive.row(row));
        }
    }
    Ok(stretches.into_iter().map(|stretch| thin(&stretch, factor as usize)).collect())
}

/// Rows whose values are finite and possible.
fn plausible<const S: usize>(
    drive: &Recorded<'_, S>,
    report: &mut DataReport,
) -> Result<Vec<usize>, DataError> {
    let rows = drive.time().len();
    let columns = &drive.columns;
    let finite: Vec<usize> = (0..rows).filter(|&i| columns.iter().all(|(_, c)| c[i].is_finite())).collect();
    report.not_finite += rows - finite.len();
    let mut impossible = vec![false; rows];
    for (column, values) in &columns[1..] {
        let Some(signal) = signal::find(column) else { continue };
        let (min, max) = signal.range;
        let outside: Vec<usize> =
            finite.iter().copied().filter(|&i| !(min..=max).contains(&values[i])).collect();
        outside.iter().for_each(|&i| impossible[i] = true);
        if outside.len() as f64 > GLITCHES * finite.len() as f64 {
            return Err(DataError::OutOfRange {
                drive: drive.name.to_owned(),
                column,
                min,
                max,
                unit: signal.unit.symbol,
                rows: outside.len(),
                row: outside[0],
                value: values[outside[0]],
                hint: match signal.unit.symbol {
                    "rad" => {
                        "it seems to be in degrees, or a steering-wheel angle; give road-wheel angles and headings in radians"
                    }
                    "rad/s" => "it seems to be in degrees per second; give radians per second",
                    _ => "check its unit",
                },
            });
        }
    }
    let numbers = finite.len();
    let kept: Vec<usize> = finite.into_iter().filter(|&i| !impossible[i]).collect();
    report.implausible += numbers - kept.len();
    Ok(kept)
}

/// Every `factor`-th row, from a row on at which commands change: a command that the controller held over its step is
/// then unchanged. The command of a step is the mean of those recorded in it.
fn thin<const S: usize>(stretch: &[DriveRow<S>], factor: usize) -> Vec<DriveRow<S>> {
    if factor == 1 {
        return stretch.to_vec();
    }
    let mut changes = vec![0_usize; factor];
    for (i, pair) in stretch.windows(2).enumerate() {
        changes[(i + 1) % factor] += usize::from(pair[0].command != pair[1].command);
    }
    // The first of the phases with most changes.
    let phase = (0..factor).rev().max_by_key(|&phase| changes[phase]).unwrap_or(0);
    let held = |rows: &[DriveRow<S>]| {
        let first = rows[0].command;
        let change: f64 = rows.iter().map(|row| row.command - first).sum();
        DriveRow { command: first + change / rows.len() as f64, ..rows[0] }
    };
    stretch.get(phase..).unwrap_or_default().chunks(factor).map(held).collect()
}

/// Slope of `y` on `x` through the origin, and the share of `y` that it explains.
#[derive(Default)]
struct OriginSlope {
    xx: f64,
    xy: f64,
    yy: f64,
}

impl OriginSlope {
    fn add(&mut self, x: f64, y: f64) {
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
    }

    /// `None` where the two hardly correlate.
    fn value(&self) -> Option<f64> {
        let explained = self.xy * self.xy / (self.xx * self.yy);
        (explained > 0.5).then_some(self.xy / self.xx)
    }
}

const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// Compares columns with one another: units that are wrong by a factor show in the vehicle's motion.
pub(super) fn units<const S: usize>(
    stretches: &[Vec<DriveRow<S>>],
    wheelbase: f64,
    sample_time: f64,
) -> Result<(), DataError> {
    let (mut steer, mut heading, mut lateral) =
        (OriginSlope::default(), OriginSlope::default(), OriginSlope::default());
    for stretch in stretches {
        for pair in stretch.windows(2) {
            let (now, next) = (pair[0].state, pair[1].state);
            let (e1_rate, e2, e2_rate, v) = (now[1], now[2], now[3], pair[0].road[0]);
            if v < 1.0 {
                continue;
            }
            heading.add(0.5 * (e2_rate + next[3]), (next[2] - e2) / sample_time);
            lateral.add(v * e2, e1_rate);
        }
        // Means over half a second: within it, delays and inertia may even turn the sign.
        for block in stretch.chunks((0.5 / sample_time).ceil() as usize) {
            let mean =
                |value: fn(&DriveRow<S>) -> f64| block.iter().map(value).sum::<f64>() / block.len() as f64;
            let asked = mean(|row| row.road[0] * row.command) / wheelbase;
            steer.add(asked, mean(|row| row.state[3] + row.road[0] * row.road[1]));
        }
    }
    let off_by_degrees = |factor: f64| (0.3..3.0).contains(&(factor / DEGREES));
    if let Some(slope) = heading.value().filter(|&slope| off_by_degrees(slope) || off_by_degrees(1.0 / slope))
    {
        let (column, factor) = if slope > 1.0 { ("e2", slope) } else { ("e2_rate", 1.0 / slope) };
        let hint = "it seems to be in degrees; give radians";
        return Err(DataError::Unit { column, factor, evidence: "change of e2 against e2_rate", hint });
    }
    if let Some(slope) = lateral.value().filter(|slope| off_by_degrees(1.0 / slope)) {
        return Err(DataError::Unit {
            column: "e2",
            factor: 1.0 / slope,
            evidence: "e1_rate against vx e2",
            hint: "it seems to be in degrees; give e2 in rad and e2_rate in rad/s",
        });
    }
    if let Some(slope) = steer.value() {
        let (column, evidence) = ("steer_cmd", "yaw rate against vx steer_cmd / wheelbase");
        if slope < 0.0 {
            let hint = "its sign seems to be turned; steering is positive to the left";
            return Err(DataError::Unit { column, factor: 1.0 / slope, evidence, hint });
        }
        if slope < 0.12 {
            let hint =
                "it seems to be in degrees or a steering-wheel angle; give the road-wheel angle in radians";
            return Err(DataError::Unit { column, factor: 1.0 / slope, evidence, hint });
        }
    }
    Ok(())
}

/// Columns that never change: an error where nothing can be learned without them, else noted.
pub(super) fn variation<const S: usize>(
    stretches: &[Vec<DriveRow<S>>],
    states: &[Signal; S],
    report: &mut DataReport,
) -> Result<(), DataError> {
    let mut rows = stretches.iter().flatten();
    let Some(first) = rows.next() else { return Err(DataError::Empty { rows: report.rows }) };
    // Command and states, without which nothing can be learned; then the road.
    let names = states.iter().map(|signal| signal.name);
    let names: Vec<&'static str> = ["steer_cmd"].into_iter().chain(names).chain(ROAD_NAMES).collect();
    let values = |row: &DriveRow<S>| -> Vec<f64> {
        [row.command].into_iter().chain(row.state).chain(row.road).collect()
    };
    let reference = values(first);
    let mut constant = vec![true; names.len()];
    for row in rows {
        let same = values(row).into_iter().zip(&reference).map(|(x, first)| x == *first);
        constant.iter_mut().zip(same).for_each(|(constant, same)| *constant &= same);
    }
    for (i, &column) in names.iter().enumerate().filter(|&(i, _)| constant[i]) {
        if i > S {
            report.constant.push(column);
            continue;
        }
        let hint = if i == 0 {
            "drive with steering that changes, best with a little dither"
        } else {
            "the sensor or the recording seems stuck"
        };
        return Err(DataError::Constant { column, value: reference[i], hint });
    }
    Ok(())
}
