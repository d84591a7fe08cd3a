//! Conventions of the log's columns: tested on the log, not trusted.
//!
//! | convention | test |
//! |---|---|
//! | side of `roll` | to the right side down in a left turn, as a body leans; otherwise the sign is reversed |
//! | frame of `ay` | an accelerometer in body axes feels gravity by roll and bank; a navigation unit gives the level frame's `v r + v'`. Each is scored by what it leaves to the likeliest of nothing and single effects, |
//!
//! ```text
//!     score = max over none and singles of  -eta J / 2 - k odds,        J by one linear step from the neutral replay.
//! ```
//!
//! A clear winner is used and reported; else the frame is that of the documentation, body axes.

use super::calibration::Calibration;
use super::fit::{Linear, Prior};
use super::noise::Noise;
use super::problem::Problem;
use super::replay::{Channel, Drive, ReplayVehicle};
use super::report::{Finding, Gravity};

/// Correlation of roll with lateral acceleration beyond which its side is sure.
const SURE: f64 = 0.5;
/// Logarithm of the odds of a clear winner: twenty to one.
const CLEAR: f64 = 3.0;

/// Turns a roll of the opposite sign.
pub fn turn_roll(drive: &mut Drive) -> Option<Finding> {
    roll_with_lateral_accel(drive).filter(|correlation| *correlation < -SURE)?;
    drive.columns.get_mut("roll")?.iter_mut().for_each(|roll| *roll = -*roll);
    let words = "roll counts to the other side: a body leans to the right in a left turn, which is positive; its sign was turned";
    Some(Finding { gravity: Gravity::Warning, signal: Some("roll".to_owned()), words: words.to_owned() })
}

/// Sets the frame of the lateral acceleration.
pub fn find_frame<V: ReplayVehicle>(problem: &mut Problem<V>) -> Option<Finding> {
    if !problem.drive.channels.contains(&Channel::Ay) {
        return None;
    }
    let [body, level] = scores(problem)?;
    let words = "it is that of a level frame, without gravity's share by roll and bank, and is compared so";
    let found = Finding { gravity: Gravity::Note, signal: Some("ay".to_owned()), words: words.to_owned() };
    (level > body + CLEAR).then(|| {
        problem.level();
        found
    })
}

/// Correlation of the roll with the lateral acceleration by speed and yaw rate.
fn roll_with_lateral_accel(drive: &Drive) -> Option<f64> {
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

/// Scores of both readings of a log, with the noise of the body's frame.
fn scores<V: ReplayVehicle>(problem: &Problem<V>) -> Option<[f64; 2]> {
    let calibration = Calibration::built_in();
    let prior = Prior::of(problem);
    let frames = problem.in_both_frames(&prior.mean)?;
    let trace = problem.trace(&prior.mean).ok()?;
    let weights = Noise::of(problem, &trace, &[]).coarse(problem, &frames[0].0).weights(problem);
    Some(frames.map(|(gap, slopes)| {
        let linear = Linear::new(slopes, weights.clone());
        let of = |freed: &[usize]| {
            let precision = prior.freed(problem, freed);
            let cost = prior.step(&linear, &prior.mean, &gap, &precision).cost;
            calibration.weight(-calibration.temper * cost, 0.0, calibration.odds * freed.len() as f64)
        };
        let singles = (0..problem.knobs.len()).filter(|&i| problem.knobs[i].is_candidate());
        singles.map(|i| of(&[i])).fold(of(&[]), f64::max)
    }))
}
