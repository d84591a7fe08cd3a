//! Answers of the wheels to short commands.
//!
//! The measured angle, or the yaw rate over the speed, follows the command through a dead time and a lag, which the whole
//! log tells. Where the command leaves its way for a few rows it follows, too, or goes on as if they were not there:
//!
//! ```text
//!     r = y - g f(u without the rows),   p = g f(the rows alone),   b = r p / (p p)
//! ```
//!
//! both without their lines in time over about a second: `b` is about 1 of a command, and 0 of what only the recorder
//! has seen. A command that is held for long is followed wholly: `r - p` is clearly less than `r`.

use super::rows::LogRows;
use crate::numerics::statistics::{Slope, slope};
use std::ops::Range;

/// What the wheels say to some rows of the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Answer {
    /// They follow.
    Given,
    /// They go on as if the rows were not there.
    None,
    /// Their noise is larger, or nothing follows the command.
    Unknown,
}

/// Time by which the angle may come before the command, as loggers confuse them, and after it, s.
const DELAYS: [f64; 2] = [-0.3, 0.6];
const DELAY_STEP: f64 = 0.02;
/// Lags, s.
const LAGS: [f64; 5] = [0.0, 0.05, 0.1, 0.2, 0.4];
/// Time before and after rows in which their answer is looked for, beside delay and lag, s.
const AROUND: f64 = 0.3;
/// Rows from which delay and lag are told, at most.
const ROWS: usize = 20_000;
/// Least answer, as a share of what is asked. A limit of the rate makes it less than 1.
const LEAST: f64 = 0.25;
/// Ratio of mean squares of which one explains clearly better.
const CLEARLY: f64 = 2.0;
const WELL: f64 = 1.2;

/// Sums over the rows about a run.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    pp: f64,
    pr: f64,
    rr: f64,
}

impl Sums {
    /// Squares of what the rows leave open.
    fn with(self) -> f64 {
        self.rr - 2.0 * self.pr + self.pp
    }

    fn answer(self) -> Answer {
        let share = self.pr / self.pp;
        let (without, with) = (self.rr, self.with());
        let best = self.rr - share * self.pr;
        if share.is_nan() {
            Answer::Unknown
        } else if share >= LEAST && without > WELL * best {
            Answer::Given
        } else if share < LEAST && with > CLEARLY * without {
            Answer::None
        } else {
            Answer::Unknown
        }
    }
}

/// The answer to each of some runs of `steer_cmd`.
pub(super) fn answers(log: &LogRows, runs: &[Range<usize>]) -> Vec<Answer> {
    let found = sums_in(log, runs).map(|each| told_together(&each));
    found.unwrap_or_else(|| vec![Answer::Unknown; runs.len()])
}

/// True for each run of `steer_cmd`, held for a while, that the wheels follow clearly.
pub(super) fn followed(log: &LogRows, runs: &[Range<usize>]) -> Vec<bool> {
    let is_followed = |sums: &Sums| CLEARLY * sums.with() < sums.rr;
    sums_in(log, runs).map_or_else(|| vec![false; runs.len()], |each| each.iter().map(is_followed).collect())
}

/// Sums about each of some runs of `steer_cmd`. `None` where nothing follows it.
fn sums_in(log: &LogRows, runs: &[Range<usize>]) -> Option<Vec<Sums>> {
    if runs.is_empty() {
        return None;
    }
    let column = |name: &str| log.columns.get(name).map(Vec::as_slice);
    match (column("steer_cmd"), column("steer"), column("yaw_rate"), column("vx")) {
        (Some(command), Some(steer), ..) => sums_of(command, (steer, None), &log.spans, log.spacing, runs),
        (Some(command), None, Some(rate), Some(vx)) => {
            sums_of(command, (rate, Some(vx)), &log.spans, log.spacing, runs)
        }
        _ => None,
    }
}

/// The same of a command and a response, which is also a multiple of the second column. `None` where it does not follow.
fn sums_of(
    command: &[f64],
    (response, times): (&[f64], Option<&[f64]>),
    spans: &[Range<usize>],
    spacing: f64,
    runs: &[Range<usize>],
) -> Option<Vec<Sums>> {
    let (without, alone) = apart(command, spans, runs);
    // The body turns later than the wheels.
    let through = |column: &Vec<f64>, lag: f64| match times {
        None => lagged(column, spans, lag),
        Some(_) => lagged(&lagged(column, spans, lag), spans, lag),
    };
    let behind = |lag: f64| [&without, &alone].map(|column| through(column, lag / spacing));
    let factor = |row: usize| times.map_or(1.0, |times| times[row]);
    let rows = |seconds: f64| (seconds / spacing).round() as isize;
    let delays = || (rows(DELAYS[0])..=rows(DELAYS[1])).step_by(rows(DELAY_STEP).max(1) as usize);
    let stride = (command.len() / ROWS).max(1);
    // Of the command with the runs and without them, the one that explains more tells delay and lag: what a slow drive
    // leaves open, answered runs tell.
    let mut best: Option<(Slope, f64, isize)> = None;
    for lag in LAGS {
        let [without, alone] = behind(lag);
        let with: Vec<f64> = without.iter().zip(&alone).map(|(a, b)| a + b).collect();
        for (filtered, delay) in
            [&without, &with].into_iter().flat_map(|it| delays().map(move |delay| (it, delay)))
        {
            let rows = spans.iter().flat_map(|span| span.clone().step_by(stride).map(move |row| (span, row)));
            let pairs = rows.map(|(span, row)| (factor(row) * at(filtered, span, row, delay), response[row]));
            let Some(found) = slope(pairs) else { continue };
            if best.is_none_or(|(slope, ..)| found.explained > slope.explained) {
                best = Some((found, lag, delay));
            }
        }
    }
    let (Slope { factor: gain, .. }, lag, delay) = best?;
    let behind = behind(lag);
    let about = |run: &Range<usize>| {
        let Some(span) = spans.iter().find(|span| span.contains(&run.start)) else { return Sums::default() };
        let from = (run.start as isize + delay.min(0) - rows(AROUND)).max(span.start as isize) as usize;
        let to = run.end as isize + delay.max(0) + rows(AROUND + 2.0 * lag);
        let to = (to.max(0) as usize).min(span.end);
        let rows_about = (from..to).filter_map(|row| {
            let [r, p] = behind.each_ref().map(|column| gain * factor(row) * at(column, span, row, delay));
            let r = response[row] - r;
            (r.is_finite() && p.is_finite()).then_some((row as f64, r, p))
        });
        sums(&rows_about.collect::<Vec<_>>())
    };
    Some(runs.iter().map(about).collect())
}

/// The answer to each run; those that alone tell nothing may tell it together.
fn told_together(each: &[Sums]) -> Vec<Answer> {
    let unknown = each.iter().filter(|sums| sums.answer() == Answer::Unknown && sums.pp.is_finite());
    let together = unknown.fold(Sums::default(), |all, sums| Sums {
        pp: all.pp + sums.pp,
        pr: all.pr + sums.pr,
        rr: all.rr + sums.rr,
    });
    let of = |sums: &Sums| match sums.answer() {
        Answer::Unknown => together.answer(),
        answer => answer,
    };
    each.iter().map(of).collect()
}

/// A command without some runs, on lines over them, and what these add; gaps hold the last value.
fn apart(command: &[f64], spans: &[Range<usize>], runs: &[Range<usize>]) -> (Vec<f64>, Vec<f64>) {
    let (mut without, mut alone) = (command.to_vec(), vec![0.0; command.len()]);
    for run in runs {
        let Some(span) = spans.iter().find(|span| span.contains(&run.start)) else { continue };
        let before = (span.start..run.start).rev().map(|row| without[row]).find(|value| value.is_finite());
        let after = (run.end..span.end).map(|row| command[row]).find(|value| value.is_finite());
        let Some((before, after)) = before.or(after).zip(after.or(before)) else { continue };
        for row in run.clone() {
            let along = (row + 1 - run.start) as f64 / (run.len() + 1) as f64;
            without[row] = before + along * (after - before);
            alone[row] = if command[row].is_finite() { command[row] - without[row] } else { 0.0 };
        }
    }
    for span in spans {
        let mut last = f64::NAN;
        for row in span.clone() {
            last = if without[row].is_finite() { without[row] } else { last };
            without[row] = last;
        }
    }
    (without, alone)
}

/// A column through a lag of so many rows.
fn lagged(column: &[f64], spans: &[Range<usize>], lag: f64) -> Vec<f64> {
    let share = if lag > 0.0 { -(-1.0 / lag).exp_m1() } else { 1.0 };
    let mut filtered = column.to_vec();
    for span in spans {
        let mut state = f64::NAN;
        for row in span.clone() {
            let value = column[row];
            state = if state.is_finite() { state + share * (value - state) } else { value };
            filtered[row] = state;
        }
    }
    filtered
}

/// Value so many rows before one of a span.
fn at(column: &[f64], span: &Range<usize>, row: usize, delay: isize) -> f64 {
    let then = row as isize - delay;
    if then < span.start as isize || then >= span.end as isize { f64::NAN } else { column[then as usize] }
}

/// Sums of products of two columns, both without their lines in time.
fn sums(rows: &[(f64, f64, f64)]) -> Sums {
    let count = rows.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64, f64)) -> f64| rows.iter().map(of).sum::<f64>() / count;
    let (t, r, p) = (mean(&|row| row.0), mean(&|row| row.1), mean(&|row| row.2));
    let tt = mean(&|row| (row.0 - t).powi(2));
    let rise = |of: &dyn Fn(&(f64, f64, f64)) -> f64| mean(&|row| (row.0 - t) * of(row)) / tt;
    let (rise_r, rise_p) = (rise(&|row| row.1 - r), rise(&|row| row.2 - p));
    let mut sums = Sums::default();
    for (time, one, two) in rows {
        let one = one - r - rise_r * (time - t);
        let two = two - p - rise_p * (time - t);
        sums.pp += two * two;
        sums.pr += two * one;
        sums.rr += one * one;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A command with falls to 0 for some rows, the angle that follows the command, and one that does not see the falls.
    fn drive(length: usize, noise: f64) -> (Vec<f64>, [Vec<f64>; 2], Vec<Range<usize>>) {
        let runs: Vec<Range<usize>> =
            [300, 710, 1110].into_iter().map(|start| start..start + length).collect();
        let smooth: Vec<f64> = (0..1500).map(|row| 0.1 * (0.008 * row as f64).sin()).collect();
        let mut command = smooth.clone();
        runs.iter().flat_map(Range::clone).for_each(|row| command[row] = 0.0);
        let span = std::slice::from_ref(&(0..1500)).to_vec();
        let mut random = 1_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let angles = [&command, &smooth].map(|column| {
            let angle = lagged(column, &span, 5.0);
            (0..1500_usize).map(|row| 15.0 * angle[row.saturating_sub(4)] + noise * next()).collect()
        });
        (command, angles, runs)
    }

    #[test]
    fn wheels_answer_a_command_and_no_dropout() {
        for length in 1..=5 {
            let (command, [followed, unseen], runs) = drive(length, 0.03);
            let spans = std::slice::from_ref(&(0..1500)).to_vec();
            let ask = |angle: &[f64]| {
                told_together(&sums_of(&command, (angle, None), &spans, 0.02, &runs).unwrap())
            };
            assert_eq!(ask(&followed), [Answer::Given; 3], "{length}");
            assert_eq!(ask(&unseen), [Answer::None; 3], "{length}");
        }
    }

    #[test]
    fn noise_and_a_column_that_does_not_follow_tell_nothing() {
        let (command, [followed, _], runs) = drive(1, 3.0);
        let spans = std::slice::from_ref(&(0..1500)).to_vec();
        let answers = told_together(&sums_of(&command, (&followed, None), &spans, 0.02, &runs).unwrap());
        assert!(!answers.contains(&Answer::None), "{answers:?}");
        let other: Vec<f64> = (0..1500).map(|row| (0.03 * f64::from(row)).sin()).collect();
        assert!(sums_of(&command, (&other, None), &spans, 0.02, &runs).is_none());
    }
}
