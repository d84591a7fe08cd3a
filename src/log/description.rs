//! A clean log in words: its excitation and its noise.

use super::clean_log::CleanLog;
use super::differences::noise;
use super::finding::{Finding, FindingSeverity};
use crate::numerics::statistics::quantile;

/// Range of a steering that counts as none, rad.
const HARDLY_STEERED: f64 = 2e-3;

/// Excitation of the log, in numbers, and its noise.
pub(super) fn describe(log: &mut CleanLog) {
    let judged = |name: &str| -> Vec<f64> {
        let values = log.columns.get(name).into_iter().flatten().zip(&log.valid);
        values.filter(|(_, valid)| **valid).map(|(value, _)| *value).collect()
    };
    let (vx, steer, rate) = (judged("vx"), judged("steer_cmd"), judged("yaw_rate"));
    let lateral: Vec<f64> = vx.iter().zip(&rate).map(|(v, rate)| (v * rate).abs()).collect();
    let at = |values: &[f64], share| quantile(values.to_vec(), share).unwrap_or(0.0);
    let range = [at(&steer, 0.01), at(&steer, 0.99)];
    let words = format!(
        "judged: {:.1} s at {:.1} to {:.1} m/s, steering from {:.3} to {:.3} rad, lateral acceleration up to {:.1} m/s2",
        log.step * vx.len() as f64,
        at(&vx, 0.01),
        at(&vx, 0.99),
        range[0],
        range[1],
        at(&lateral, 0.99)
    );
    let noisy = noises(log);
    let hardly = range[1] - range[0] < HARDLY_STEERED;
    log.findings.push(Finding::new(FindingSeverity::Note, None, words));
    if !noisy.is_empty() {
        log.findings.push(Finding::new(
            FindingSeverity::Note,
            None,
            format!("noise from row to row: {}", noisy.join(", ")),
        ));
    }
    if hardly {
        let words = format!(
            "hardly steered: within {:.4} rad all the time; effects that show in turns cannot be seen",
            range[1] - range[0]
        );
        log.find(FindingSeverity::Warning, "steer_cmd", words);
    }
    if !rate.is_empty() && rate.iter().all(|value| *value == rate[0]) {
        log.find(
            FindingSeverity::Suspicion,
            "yaw_rate",
            "yaw_rate never changes: is its sensor connected?".into(),
        );
    }
}

/// Noise of the motion signals, from third differences, which no vehicle's motion reaches; in words.
fn noises(log: &CleanLog) -> Vec<String> {
    ["vx", "vy", "yaw_rate", "ay", "steer"]
        .into_iter()
        // On lines between samples nothing is to be seen of it.
        .filter(|name| !log.coarse.contains_key(name))
        .filter_map(|name| {
            let signal = crate::signal::find(name)?;
            let values = log.columns.get(name)?;
            let noise =
                noise(values, std::slice::from_ref(&(0..values.len()))).filter(|noise| *noise > 0.0)?;
            Some(format!("{name} {noise:.1e} {}", signal.unit.symbol))
        })
        .collect()
}
