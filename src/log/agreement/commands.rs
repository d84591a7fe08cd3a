//! Commands beside what the vehicle does with them: an `accel_cmd` that is no acceleration, a `steer_cmd` that comes after its answer,
//! and commands that rest while the vehicle does not.
//!
//! ```text
//!     ax, or the change of vx                 = k lag(accel_cmd) + c
//!     steer, or the angle of steady cornering = k lag(steer_cmd) + c
//! ```
//!
//! over stretches of half a second. `k` holds a gain and a payload, `c` a drag or an offset, the lag is the actuator's: they are
//! for a diagnosis to find. A recorder that writes 0 while a person drives shows as a command that rests, and a vehicle that does
//! much more than asked there.

use super::ratios::{BLOCK, MILD, blocks};
use crate::log::clean_log::{CleanError, CleanLog, is_long_enough};
use crate::log::copied;
use crate::log::even::SETTLING;
use crate::log::finding::FindingSeverity;
use crate::log::kinematics;
use crate::log::rows::repeats;
use crate::numerics::statistics::{Slope, independent, slope};
use std::ops::Range;

/// Time constants of an actuator that are tried, s.
const LAGS: [f64; 6] = [0.0, 0.1, 0.25, 0.5, 1.0, 2.0];
/// Ratio of `ax` to the change of vx within which it is the acceleration.
const FELT: Range<f64> = 0.7..1.4;
/// Ratios of an acceleration to the asked one that gains, payloads and lags explain.
pub(super) const ASKED: Range<f64> = 0.4..2.5;
/// Shortest rest of a command that is looked at, s.
const REST: f64 = 1.0;
/// Fewest stretches with a moving command that tell its answer.
const FEWEST: usize = 20;
/// Remainder in a rest, over that elsewhere, of a command that was not the vehicle's.
const BEYOND: f64 = 5.0;
/// Least such remainder: of an acceleration by `ax`, as of drag, and by vx, as on a slope of 5 %, m/s2; of an angle, rad, and as a
/// share of its spread.
const DRAG: f64 = 0.25;
const SLOPE: f64 = 0.5;
const ANGLE: f64 = 0.01;
const SPREAD: f64 = 0.2;
/// Share of a drive at rest beyond which an `accel_cmd` is another quantity, as of the drive without the brakes.
const MOST: f64 = 0.2;
/// Share of a drive at rest beyond which a `steer_cmd` is not what was asked.
const HALF: f64 = 0.5;

/// Rows by which an angle may come before its command: stamps and an even clock move a held command by one. And the longest time
/// that is looked for, s.
const ROUNDED: usize = 1;
const EARLIEST: f64 = 1.0;
/// Times that are tried to either side.
const TIMES: usize = 100;
/// Share of an angle's spread that its command leaves at the right time: of one that is its answer.
const ANSWERS: f64 = 0.05;
/// Least amount by which another time leaves less, in variances of remainders that are independent.
const CLEARLY: f64 = 16.0;

/// A measured angle comes after its command.
///
/// # Errors
/// It comes before.
pub(in crate::log) fn check_order(log: &CleanLog) -> Result<(), CleanError> {
    let (Some(command), Some(angle), true) =
        (log.columns.get("steer_cmd"), log.columns.get("steer"), log.commanded)
    else {
        return Ok(());
    };
    let judged = |values: &[f64]| -> Vec<f64> {
        let each = values.iter().zip(&log.valid);
        each.map(|(value, valid)| if *valid { *value } else { f64::NAN }).collect()
    };
    match steers_early(log.step, &judged(command), &judged(angle)) {
        Some(seconds) => Err(CleanError::Early { seconds }),
        None => Ok(()),
    }
}

/// Time by which an angle comes before its command, s, where that is clear: the one at which the command explains most of it. Values
/// that are not numbers do not count.
pub(in crate::log) fn steers_early(step: f64, command: &[f64], angle: &[f64]) -> Option<f64> {
    let most = ((EARLIEST / step) as usize).min(command.len());
    let pairs = |early: usize, late: usize| {
        command[early..].iter().copied().zip(angle[late.min(angle.len())..].iter().copied())
    };
    let best = |of: &dyn Fn(usize) -> Option<Slope>| {
        let each = (0..most).step_by(most.div_ceil(TIMES).max(1)).filter_map(|rows| Some((rows, of(rows)?)));
        each.max_by(|(_, one), (_, other)| one.explained.total_cmp(&other.explained))
    };
    let (rows, early) = best(&|rows| slope(pairs(rows, 0)))?;
    // A steering that swings in one rhythm is as late as it is early.
    let (_, late) = best(&|rows| slope(pairs(0, rows)))?;
    let left: Vec<f64> = pairs(rows, 0).map(|(command, angle)| angle - early.factor * command).collect();
    let (least, gained) = (1.0 - early.explained, early.explained - late.explained);
    let is_answer = least < ANSWERS && independent(&left) * gained > CLEARLY * least;
    (is_answer && rows > ROUNDED).then_some(rows as f64 * step)
}

/// What a command is answered with.
struct CommandAnswer {
    slope: Slope,
    /// Asked and given in each stretch, without the constant.
    asked: Vec<f64>,
    given: Vec<f64>,
}

impl CommandAnswer {
    /// By the stretches that count, at the lag that explains most; `None` where the two hardly correlate.
    fn of(log: &CleanLog, command: &[f64], given: &[f64], counts: &[bool]) -> Option<Self> {
        let counted = |values: &[f64]| -> Vec<f64> {
            let each = values.iter().zip(counts);
            each.map(|(value, counts)| if *counts { *value } else { f64::NAN }).collect()
        };
        let of = |lag: f64| -> Option<(Slope, Vec<f64>)> {
            let asked: Vec<f64> = blocks(log, &lagged(command, log.step, lag)).collect();
            Some((slope(counted(&asked).into_iter().zip(given.iter().copied()))?, asked))
        };
        let (slope, asked) =
            LAGS.into_iter().filter_map(of).max_by(|a, b| a.0.explained.total_cmp(&b.0.explained))?;
        let asked: Vec<f64> = asked.iter().map(|asked| slope.factor * asked).collect();
        let apart: Vec<f64> = given.iter().zip(&asked).map(|(given, asked)| given - asked).collect();
        let constant = mean(&counted(&apart));
        Some(Self { slope, asked, given: given.iter().map(|given| given - constant).collect() })
    }

    /// To a command that never changes: none.
    fn to_nothing(given: &[f64]) -> Self {
        let constant = mean(given);
        let slope = Slope { factor: 0.0, explained: 0.0 };
        Self {
            slope,
            asked: vec![0.0; given.len()],
            given: given.iter().map(|given| given - constant).collect(),
        }
    }

    fn left(&self, stretch: usize) -> f64 {
        self.given[stretch] - self.asked[stretch]
    }
}

fn mean(values: &[f64]) -> f64 {
    let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    finite.iter().sum::<f64>() / finite.len().max(1) as f64
}

fn size(values: impl Iterator<Item = f64>) -> f64 {
    mean(&values.map(|value| value * value).collect::<Vec<_>>()).sqrt()
}

/// A command behind a lag of first order.
fn lagged(command: &[f64], step: f64, lag: f64) -> Vec<f64> {
    let (share, mut state) = (step / (lag + step), command.first().copied().unwrap_or(0.0));
    let follow = |asked: &f64| {
        state += share * (asked - state);
        state
    };
    command.iter().map(follow).collect()
}

/// The acceleration in each stretch: `ax`, which feels no slope of the road, or else the change of vx.
fn felt(log: &CleanLog) -> Option<(&'static str, Vec<f64>)> {
    let is_one = kinematics::ax_factor(log).is_some_and(|(_, factor)| FELT.contains(&factor));
    if let Some(ax) = log.columns.get("ax").filter(|_| is_one) {
        return Some(("ax", blocks(log, ax).collect()));
    }
    let vx = log.columns.get("vx")?;
    let at = |row: usize| vx[row.min(vx.len() - 1)];
    let gained: Vec<f64> =
        (0..vx.len()).map(|row| (at(row + 1) - at(row.saturating_sub(1))) / (2.0 * log.step)).collect();
    Some(("vx", blocks(log, &gained).collect()))
}

/// Slope of the acceleration over the asked one, and the column that tells it.
pub(super) fn driven(log: &CleanLog) -> Option<(&'static str, Slope)> {
    let command = log.columns.get("accel_cmd")?;
    let (by, given) = felt(log)?;
    let counts = moving(log, command).0;
    CommandAnswer::of(log, command, &given, &counts).map(|answer| (by, answer.slope))
}

/// Stretches in which a command is not at rest; all, if these are few. And the rests, as rows.
fn moving(log: &CleanLog, command: &[f64]) -> (Vec<bool>, Vec<Range<usize>>) {
    let rests = repeats(command, 0..command.len(), (REST / log.step).round() as usize);
    let mut rests_at = vec![false; command.len()];
    rests.iter().for_each(|rest| rests_at[rest.clone()].fill(true));
    let size = log.rows_in(BLOCK);
    let moves: Vec<bool> = rests_at.chunks_exact(size).map(|rows| rows.iter().any(|rests| !rests)).collect();
    let count = moves.iter().filter(|moves| **moves).count();
    (if count < FEWEST { vec![true; moves.len()] } else { moves }, rests)
}

/// Rests of a command in which the vehicle does much more than asked. `least` is the least remainder that is one.
fn rests(log: &CleanLog, command: &[f64], given: &[f64], least: f64) -> Vec<Range<usize>> {
    let (moves, rests) = moving(log, command);
    let is_constant = rests.iter().any(|rest| rest.len() == command.len());
    let answer = if is_constant {
        Some(CommandAnswer::to_nothing(given))
    } else {
        CommandAnswer::of(log, command, given, &moves).filter(|answer| answer.slope.factor > 0.0)
    };
    let Some(answer) = answer else { return Vec::new() };
    let elsewhere = size((0..moves.len()).filter(|&i| moves[i] && !is_constant).map(|i| answer.left(i)));
    let rows = log.rows_in(BLOCK);
    let is_foreign = |rest: &Range<usize>| {
        // What the actuator had been asked before is over after a while.
        let stretches = || rest.start.div_ceil(rows) + 1..rest.end / rows;
        let left = size(stretches().map(|i| answer.left(i)));
        let [asked, given] = [&answer.asked, &answer.given].map(|of| size(stretches().map(|i| of[i])));
        left > least.max(BEYOND * elsewhere) && given > asked + least
    };
    rests.into_iter().filter(is_foreign).collect()
}

/// Takes rows out of the comparison in which a command rests and the vehicle does not; an `accel_cmd` that does so for long is
/// left out, and so is a `steer_cmd` beside a measured angle. `steering` is the road-wheel angle for a unit of curvature at a speed.
pub(in crate::log) fn leave_out_rests(log: &mut CleanLog, steering: &dyn Fn(f64) -> f64) {
    if let (Some(command), Some((by, given))) = (log.columns.get("accel_cmd"), felt(log)) {
        let found = rests(log, command, &given, if by == "ax" { DRAG } else { SLOPE });
        let count: usize = found.iter().map(Range::len).sum();
        if count as f64 > MOST * command.len() as f64 {
            let words = format!(
                "accel_cmd rests for {:.1} s in all while {by} tells that the vehicle drives and brakes: it is not what was asked, or \
                 one of drive and brakes only; the column is left out",
                log.step * count as f64
            );
            log.columns.remove("accel_cmd");
            log.find(FindingSeverity::Warning, "accel_cmd", words);
        } else {
            take_out(log, "accel_cmd", &found, ["rests", "drives or brakes"]);
        }
    }
    if log.commanded
        && let Some((command, given)) = log.columns.get("steer_cmd").zip(turned(log, steering))
    {
        let middle = mean(&given);
        let spread = size(given.iter().map(|given| given - middle).filter(|given| given.is_finite()));
        let found = rests(log, command, &given, ANGLE.max(SPREAD * spread));
        let count: usize = found.iter().map(Range::len).sum();
        if count as f64 > HALF * command.len() as f64 && log.columns.contains_key("steer") {
            let words = format!(
                "steer_cmd rests for {:.1} s in all while the vehicle steers: it is not what was asked; the column is left out",
                log.step * count as f64
            );
            log.columns.remove("steer_cmd");
            log.commanded = false;
            log.find(FindingSeverity::Warning, "steer_cmd", words);
        } else {
            take_out(log, "steer_cmd", &found, ["rests", "steers"]);
        }
    }
    if let (true, Some(command), Some(angle)) =
        (log.commanded, log.columns.get("steer_cmd"), log.columns.get("steer"))
    {
        let found = copied::stretches(command, angle, log.step);
        take_out(log, "steer_cmd", &found, ["is the measured angle", "steers"]);
    }
}

/// The steering in each stretch: the measured angle, or that of steady cornering.
fn turned(log: &CleanLog, steering: &dyn Fn(f64) -> f64) -> Option<Vec<f64>> {
    if let Some(steer) = log.columns.get("steer") {
        return Some(blocks(log, steer).collect());
    }
    let (vx, rate) = (log.columns.get("vx")?, log.columns.get("yaw_rate")?);
    let needed =
        |(v, rate): (f64, f64)| if (v * rate).abs() < MILD { steering(v) * rate / v } else { f64::NAN };
    Some(blocks(log, vx).zip(blocks(log, rate)).map(needed).collect())
}

/// Takes rows in which a command says nothing, and what follows, as after a gap, out of the comparison.
fn take_out(log: &mut CleanLog, column: &'static str, rests: &[Range<usize>], [is, does]: [&str; 2]) {
    let Some(longest) = rests.iter().max_by_key(|rest| rest.len()) else { return };
    let value = log.columns[column][longest.start];
    let settling = (SETTLING / log.step).round() as usize;
    let mut valid = log.valid.clone();
    for rest in rests {
        let end = (rest.end + settling).min(valid.len());
        valid[rest.start..end].fill(false);
    }
    let is_enough = is_long_enough(log.step * valid.iter().filter(|valid| **valid).count() as f64);
    let (gravity, then) = if is_enough {
        log.valid = valid;
        (FindingSeverity::Warning, "not judged there")
    } else {
        (FindingSeverity::Suspicion, "the rest of the drive is too short to be judged alone")
    };
    let words = format!(
        "{column} {is} {} for {:.1} s in all while the vehicle {does}, the longest time at {value:.4} from {:.2} s to {:.2} s: someone \
         else was in control; {then}",
        if rests.len() == 1 { "once".to_owned() } else { format!("{} times", rests.len()) },
        log.step * rests.iter().map(Range::len).sum::<usize>() as f64,
        log.time[longest.start],
        log.time[longest.end - 1],
    );
    log.find(gravity, column, words);
}
