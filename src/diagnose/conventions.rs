//! Conventions of the log's columns: tested on the log, not trusted.
//!
//! | convention | test |
//! |---|---|
//! | side of `roll` | to the right side down in a left turn, as a body leans; otherwise the sign is reversed |
//! | frame of `ay` | an accelerometer in body axes feels gravity by roll and bank; a navigation unit gives the level frame's `v r + v'`. Each is scored by what it leaves to the likeliest of nothing and single effects, |
//!
//! ```text
//!     score = max over none and singles of  -eta J / 2 - k odds,        J of a fit, with the noise that the better one leaves.
//! ```
//!
//! Where neither reading fits, that noise is large, and a small difference tells little. A clear winner is used and
//! reported; else the frame is that of the documentation, body axes.

use super::calibration::Calibration;
use super::noise::Noise;
use super::problem::Problem;
use super::rank::glance;
use super::replay::{ReplayDrive, ReplayVehicle};
use super::report::{Finding, FindingSeverity};

/// Correlation of roll with lateral acceleration beyond which its side is sure.
const SURE: f64 = 0.5;
/// Logarithm of the odds of a clear winner: twenty to one.
const CLEAR: f64 = 3.0;

/// Turns a roll of the opposite sign.
pub fn turn_roll(drive: &mut ReplayDrive) -> Option<Finding> {
    roll_with_lateral_accel(drive).filter(|correlation| *correlation < -SURE)?;
    drive.columns.get_mut("roll")?.iter_mut().for_each(|roll| *roll = -*roll);
    let words = "roll counts to the other side: a body leans to the right in a left turn, which is positive; its sign was turned";
    Some(Finding {
        gravity: FindingSeverity::Warning,
        signal: Some("roll".to_owned()),
        summary: words.to_owned(),
    })
}

/// True if the lateral acceleration is that of a level frame: from the same problem read both ways.
pub fn is_level<V: ReplayVehicle>(body: &Problem<V>, level: &Problem<V>) -> bool {
    let calibration = Calibration::built_in();
    let odds = calibration.odds / calibration.temper;
    let gain = || {
        let [of_body, of_level] = [glance(body, odds)?, glance(level, odds)?];
        let size = |noise: &Noise| noise.effective.iter().map(|it| it.ln()).sum::<f64>();
        let noise = [&of_body.noise, &of_level.noise];
        let noise = if size(noise[1]) < size(noise[0]) { noise[1] } else { noise[0] };
        Some(of_body.cost(body, &of_level, noise, odds)? - of_level.cost(level, &of_body, noise, odds)?)
    };
    gain().is_some_and(|gain| 0.5 * calibration.temper * gain > CLEAR)
}

/// What is said of a level frame.
#[must_use]
pub fn level_frame() -> Finding {
    let words = "it is that of a level frame, without gravity's share by roll and bank, and is compared so";
    Finding { gravity: FindingSeverity::Note, signal: Some("ay".to_owned()), summary: words.to_owned() }
}

/// Correlation of the roll with the lateral acceleration by speed and yaw rate.
fn roll_with_lateral_accel(drive: &ReplayDrive) -> Option<f64> {
    let (roll, vx, rate) = (drive.column("roll"), drive.column("vx"), drive.column("yaw_rate"));
    if roll.is_empty() || rate.is_empty() {
        return None;
    }
    let rows: Vec<usize> = (0..drive.time.len()).filter(|&row| drive.scored[row]).collect();
    let mean =
        |of: &dyn Fn(usize) -> f64| rows.iter().map(|&row| of(row)).sum::<f64>() / rows.len().max(1) as f64;
    let lateral = |row: usize| vx[row] * rate[row];
    let means = [mean(&|row| roll[row]), mean(&lateral)];
    let covariance = mean(&|row| (roll[row] - means[0]) * (lateral(row) - means[1]));
    let sizes = [mean(&|row| (roll[row] - means[0]).powi(2)), mean(&|row| (lateral(row) - means[1]).powi(2))];
    let size = (sizes[0] * sizes[1]).sqrt();
    (size > 0.0).then(|| covariance / size)
}
