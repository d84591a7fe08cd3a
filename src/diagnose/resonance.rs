//! Resonance of the steering: an inertia of its own overshoots, unlike a dead time or a lag.
//!
//! To second order in the frequency, a dead time `T`, a lag `tau` and a resonance of frequency `w` and damping `d` are
//!
//! ```text
//!     exp(-s T) = 1 - T s + T^2 s^2 / 2        1 / (1 + tau s) = 1 - tau s + tau^2 s^2
//!     1 / (1 + 2 d s / w + s^2 / w^2) = 1 - (2 d / w) s + ((4 d^2 - 1) / w^2) s^2
//! ```
//!
//! The last alone has a term of second order below zero. So every resonant steering is represented by a command with an
//! added `c s^2`, `c < 0`, beside a first order of any size.
//!
//! Source: the series; a steering column on its torsion bar swings at 3 to 10 Hz, Pfeffer and Harrer, Steering Handbook, 2017.

use super::fit::{Explained, Fit, Linearisation, Precision, Prior};
use super::problem::Problem;
use super::rank::expected;
use super::replay::ReplayVehicle;

/// Standard deviations of the added terms: of first order, s, and of second, s2 (a resonance at 4 Hz).
const FIRST: f64 = 0.05;
const SECOND: f64 = 0.002;
/// Half the width over which the command is smoothed and differentiated, s.
const HALF: f64 = 0.05;

/// Means over `half` rows to either side, within a stretch.
fn smooth(values: &[f64], half: usize) -> Vec<f64> {
    let mean = |i: usize| {
        let part = &values[i.saturating_sub(half)..(i + half + 1).min(values.len())];
        part.iter().sum::<f64>() / part.len() as f64
    };
    (0..values.len()).map(mean).collect()
}

/// First and second rate of change of the command, 1/s and 1/s2 times rad.
fn rates<V: ReplayVehicle>(problem: &Problem<V>) -> [Vec<f64>; 2] {
    let drive = problem.drive;
    let half = ((HALF / drive.step).round() as usize).max(1);
    let over = half as f64 * drive.step;
    let mut rates = [vec![0.0; drive.time.len()], vec![0.0; drive.time.len()]];
    for &(from, to) in &drive.stretches {
        let command = smooth(&smooth(&drive.steer[from..to], half), half);
        for i in half..command.len().saturating_sub(half) {
            let (before, here, after) = (command[i - half], command[i], command[i + half]);
            rates[0][from + i] = (after - before) / (2.0 * over);
            rates[1][from + i] = (after - 2.0 * here + before) / (over * over);
        }
    }
    rates
}

/// Gain of a resonant steering over a fit; `linear` and `precision` are those at the fit. None where the command is not
/// known, or nothing swings.
pub fn resonance<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    (linear, precision): (&Linearisation, &Precision),
    fit: &Fit,
) -> Option<Explained> {
    if !problem.drive.commanded {
        return None;
    }
    let background = linear.marginalised(precision)?;
    let column = |(rate, deviation): (Vec<f64>, f64)| {
        let more: Vec<f64> = rate.iter().map(|rate| deviation * rate).collect();
        let there = problem.residual_steered(&fit.x, &more)?;
        Some(fit.gap.iter().zip(&there).map(|(here, there)| here - there).collect::<Vec<f64>>())
    };
    let columns: Option<Vec<Vec<f64>>> =
        rates(problem).into_iter().zip([FIRST, SECOND]).map(column).collect();
    let gap = background.reduced(expected(linear, prior, fit));
    background.explained(&gap, columns?.into_iter(), 1.0).filter(|found| found.shares[1] < 0.0)
}

#[cfg(test)]
mod tests {
    use super::smooth;

    #[test]
    fn a_ramp_stays_a_ramp() {
        let ramp: Vec<f64> = (0..20).map(f64::from).collect();
        let found = smooth(&ramp, 2);
        assert!(found[2..18].iter().zip(&ramp[2..18]).all(|(found, ramp)| (found - ramp).abs() < 1e-12));
    }
}
