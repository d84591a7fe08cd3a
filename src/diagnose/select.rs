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
