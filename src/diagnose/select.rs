//! Long logs: choice of the most informative stretches.
//!
//! Three minutes tell no more than half a minute of good driving: the model's form limits. Blocks of 20 s are chosen by
//! the motion of their steering, at all speeds alike.

use super::report::{Finding, FindingSeverity};
use crate::log::CleanLog;
use std::borrow::Cow;

/// Longest log that is used whole, and the used length of longer ones, s.
const WHOLE: f64 = 400.0;
const USED: f64 = 240.0;
/// Length of a block, s; classes of speed.
const BLOCK: f64 = 20.0;
const CLASSES: usize = 4;

/// The log, or the chosen part of a long one, with a note on it.
#[must_use]
pub fn chosen(log: &CleanLog) -> (Cow<'_, CleanLog>, Option<Finding>) {
    let rows = log.time.len();
    let (block, length) = ((BLOCK / log.step) as usize, rows as f64 * log.step);
    let (Some(steer), Some(vx)) = (log.columns.get("steer_cmd"), log.columns.get("vx")) else {
        return (Cow::Borrowed(log), None);
    };
    if length <= WHOLE || block == 0 {
        return (Cow::Borrowed(log), None);
    }
    let mut blocks: Vec<(usize, f64, f64)> = (0..rows / block)
        .map(|b| {
            let range = b * block..(b + 1) * block;
            let counted = range.clone().filter(|&i| log.valid[i]).count() as f64 / block as f64;
            let mean = steer[range.clone()].iter().sum::<f64>() / block as f64;
            let speed = vx[range.clone()].iter().sum::<f64>() / block as f64;
            let moved = steer[range].iter().map(|s| (s - mean).powi(2)).sum::<f64>().sqrt();
            // The same angle tells more at speed.
            (b, speed, if counted > 0.9 { moved * speed * speed } else { 0.0 })
        })
        .filter(|(_, speed, told)| *speed > 3.0 && *told > 0.0)
        .collect();
    blocks.sort_by(|a, b| a.1.total_cmp(&b.1));
    let wanted = (USED / BLOCK) as usize;
    let mut kept: Vec<usize> = Vec::new();
    let class = blocks.len().div_ceil(CLASSES).max(1);
    for part in blocks.chunks_mut(class) {
        part.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.cmp(&b.0)));
        kept.extend(part.iter().take(wanted / CLASSES).map(|(b, ..)| *b));
    }
    kept.sort_unstable();
    if kept.is_empty() {
        kept.extend(0..wanted.min(rows / block));
    }
    let mut short = CleanLog {
        step: log.step,
        time: Vec::new(),
        columns: log.columns.keys().map(|&name| (name, Vec::new())).collect(),
        commanded: log.commanded,
        valid: Vec::new(),
        coarse: log.coarse.clone(),
        findings: Vec::new(),
    };
    for &b in &kept {
        let range = b * block..(b + 1) * block;
        short.time.extend_from_slice(&log.time[range.clone()]);
        short.valid.extend_from_slice(&log.valid[range.clone()]);
        for (name, column) in &log.columns {
            if let Some(place) = short.columns.get_mut(name) {
                place.extend_from_slice(&column[range.clone()]);
            }
        }
    }
    let words = format!(
        "of {:.0} min, {} blocks of {BLOCK} s are used: those in which the steering moves most, at all speeds",
        length / 60.0,
        kept.len()
    );
    (Cow::Owned(short), Some(Finding { gravity: FindingSeverity::Note, signal: None, summary: words }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of 20 s, 10 rows a second: the speed of each, and how much its steering moves.
    fn log(blocks: &[(f64, f64)]) -> CleanLog {
        let rows = 200 * blocks.len();
        let of = |row: usize| blocks[row / 200];
        let column = |value: &dyn Fn(usize) -> f64| (0..rows).map(value).collect::<Vec<f64>>();
        let columns = [
            ("vx", column(&|row| of(row).0)),
            ("steer_cmd", column(&|row| of(row).1 * (0.3 * row as f64).sin())),
        ];
        CleanLog::of_columns(0.1, columns.into())
    }

    fn used(log: &CleanLog) -> Vec<usize> {
        let (short, _) = chosen(log);
        short.time.chunks(200).map(|block| (block[0] / 20.0).round() as usize).collect()
    }

    #[test]
    fn a_log_of_a_few_minutes_is_used_whole() {
        let log = log(&[(10.0, 0.1); 20]);
        let (same, words) = chosen(&log);
        assert!(matches!(same, Cow::Borrowed(_)) && words.is_none());
    }

    #[test]
    fn the_stretches_that_steer_most_are_used_at_each_speed_and_in_their_order() {
        // Four speeds, eight blocks each; the steering moves in every second one.
        let blocks: Vec<(f64, f64)> = (0..32)
            .map(|b| (8.0 + 5.0 * f64::from(b % 4), if b / 4 % 2 == 0 { 0.001 } else { 0.05 }))
            .collect();
        let log = log(&blocks);
        let used = used(&log);
        assert_eq!(used.len(), 12);
        assert!(used.is_sorted() && used.iter().all(|&b| blocks[b].1 > 0.01), "{used:?}");
        for speed in [8.0, 13.0, 18.0, 23.0] {
            assert_eq!(used.iter().filter(|&&b| blocks[b].0 == speed).count(), 3, "{speed} m/s in {used:?}");
        }
        assert!(chosen(&log).1.is_some_and(|note| note.summary.contains("of 11 min, 12 blocks")));
    }

    #[test]
    fn what_does_not_count_and_what_stands_is_not_chosen() {
        let mut blocks = vec![(10.0, 0.05); 24];
        blocks[3].0 = 1.0;
        let mut log = log(&blocks);
        log.valid[7 * 200..8 * 200].fill(false);
        let used = used(&log);
        assert!(!used.contains(&3) && !used.contains(&7), "{used:?}");
    }
}
