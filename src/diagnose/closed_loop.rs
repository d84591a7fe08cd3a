//! Effect of the gap on tracking: the same controller on the same path, in the log and in the simulator.
//!
//! The lateral error of each is averaged over stretches of the path. The gap is the RMS of their difference over the
//! stretches that both have driven.

use super::report::Gap;
use crate::control::{
    ControlledParameters, ControllerError, ControllerFor, ControllerParametersFor, PredictionModelFor,
};
use crate::log::{CleanLog, NotOnRoad};
use crate::path::Path;
use crate::simulate::{ClosedLoopFor, DriveError, STATION, SimulatedVehicle};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Length of a stretch, m.
const STRETCH: f64 = 1.0;
/// Longest simulated drive, s.
const LONGEST: f64 = 3600.0;
/// Communication step, s.
const STEP: f64 = 0.02;
/// Fewest stretches that both have driven.
const LEAST: usize = 50;

/// Reasons for which the loop cannot be compared.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ClosedLoopError {
    #[error(transparent)]
    NotOnRoad(#[from] NotOnRoad),
    #[error("log and simulator have only {stretches} m of the path in common; at least {LEAST} m are needed")]
    LittleInCommon { stretches: usize },
    #[error("the controller: {0}")]
    Controller(#[from] ControllerError),
    #[error("the simulated vehicle: {reason}")]
    Vehicle { reason: String },
    #[error("the simulated drive: {0}")]
    Drive(#[from] DriveError),
}

/// A lateral error along a path.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LateralErrorProfile {
    /// Mean and number of samples of each stretch.
    stretches: BTreeMap<i64, (f64, u32)>,
}

impl LateralErrorProfile {
    /// From stations and lateral errors, m.
    #[must_use]
    pub fn of(samples: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut stretches = BTreeMap::<i64, (f64, u32)>::new();
        for (station, error) in samples.filter(|(station, error)| station.is_finite() && error.is_finite()) {
            let (mean, count) = stretches.entry((station / STRETCH).floor() as i64).or_default();
            *count += 1;
            *mean += (error - *mean) / f64::from(*count);
        }
        Self { stretches }
    }

    /// RMS of the error itself, m.
    #[must_use]
    pub fn rms(&self) -> f64 {
        let squares: f64 = self.stretches.values().map(|(error, _)| error * error).sum();
        (squares / self.stretches.len().max(1) as f64).sqrt()
    }

    /// RMS of the difference to another, m, and the number of stretches that both have.
    #[must_use]
    pub fn gap(&self, other: &Self) -> (f64, usize) {
        let both =
            self.stretches.iter().filter_map(|(place, one)| Some((one.0, other.stretches.get(place)?.0)));
        let (squares, count) = both.fold((0.0, 0), |(sum, count), (a, b)| (sum + (a - b).powi(2), count + 1));
        ((squares / count.max(1) as f64).sqrt(), count)
    }
}

/// The lateral error of a log along a path, as recorded or by projection; and its noise, m.
///
/// # Errors
/// A log without error and pose; another path.
pub fn logged(log: &CleanLog, path: &Path) -> Result<(LateralErrorProfile, f64), ClosedLoopError> {
    let places = log.places(path)?;
    let samples: Vec<(f64, f64)> =
        places.into_iter().zip(&log.valid).filter(|(_, valid)| **valid).map(|(place, _)| place).collect();
    let differences: f64 = samples.windows(3).map(|s| (s[2].1 - 2.0 * s[1].1 + s[0].1).powi(2)).sum();
    // Second differences of white noise have six times its variance.
    let noise = (differences / 6.0 / samples.len().max(1) as f64).sqrt();
    let profile = LateralErrorProfile::of(samples.into_iter());
    // A stretch's mean has the less noise the more samples it is made of.
    let shares: f64 = profile.stretches.values().map(|(_, count)| 1.0 / f64::from(*count)).sum();
    let noise = noise * (shares / profile.stretches.len().max(1) as f64).sqrt();
    Ok((profile, noise))
}

/// The lateral error of a controller along the path in a simulator.
///
/// # Errors
/// A controller or a vehicle that cannot be made, or cannot go on.
pub fn simulated<P: SimulatedVehicle<S, C>, const S: usize, const C: usize>(
    vehicle: &P::Parameters,
    controller: ControllerParametersFor<P::Nominal>,
    model: PredictionModelFor<<P::Nominal as ControlledParameters<S>>::Vehicle, S>,
    path: &Arc<Path>,
    progress: impl Fn(f64),
) -> Result<LateralErrorProfile, ClosedLoopError> {
    use crate::vehicle::VehicleParameters as _;
    let controller = ControllerFor::predicting_with(controller, path.clone(), model)?;
    let closed = ClosedLoopFor::<P, S, C>::at_start(controller, vehicle, vehicle.effects(), STEP);
    let mut closed = closed.map_err(|error| ClosedLoopError::Vehicle { reason: error.to_string() })?;
    let drive = closed.drive(LONGEST, |row| progress(row[STATION] / path.length()))?;
    Ok(LateralErrorProfile::of(
        drive.rows.iter().map(|row| row[STATION]).zip(drive.lateral_errors.iter().copied()),
    ))
}

/// The gap in tracking error to the log: of the simulator as given, with the effect, and recalibrated.
///
/// # Errors
/// Log and simulator that have too little of the path in common.
pub fn gap(
    logged: &LateralErrorProfile,
    noise: f64,
    [given, effect, recalibrated]: [&LateralErrorProfile; 3],
) -> Result<Gap, ClosedLoopError> {
    let mut gaps = [0.0; 3];
    for (gap, simulated) in gaps.iter_mut().zip([given, effect, recalibrated]) {
        let (rms, stretches) = logged.gap(simulated);
        if stretches < LEAST {
            return Err(ClosedLoopError::LittleInCommon { stretches });
        }
        *gap = rms;
    }
    let [before, effect, recalibrated] = gaps;
    // Nothing is learned on top here: what is left is what recalibration leaves.
    Ok(Gap { before, effect, recalibrated, learnable: None, noise })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_of_the_log_is_what_remains_where_the_simulator_is_right() {
        let mut random = crate::numerics::Random::new(5);
        let mut noise = || 0.04 * ((0..12).map(|_| random.uniform()).sum::<f64>() - 6.0);
        // Slow at first, fast later: few samples in each of the later stretches.
        let station: Vec<f64> = (0..4000).map(|i| 1e-4 * f64::from(i * i) / 8.0).collect();
        let e1: Vec<f64> = station.iter().map(|s| (0.02 * s).sin() + noise()).collect();
        let columns = BTreeMap::from([("station", station.clone()), ("e1", e1)]);
        let log = CleanLog::of_columns(0.02, columns);
        let (logged, noise) = logged(&log, &crate::path::sudoku::Route::SudokuTurns.path().unwrap()).unwrap();
        let exact = LateralErrorProfile::of(station.iter().map(|s| (*s, (0.02 * s).sin())));
        let (gap, _) = logged.gap(&exact);
        assert!((gap / noise - 1.0).abs() < 0.2, "{gap} {noise}");
    }

    #[test]
    fn the_gap_is_that_of_the_stretches_in_common() {
        let profile = |offset: f64, from: i32| {
            LateralErrorProfile::of((from..from + 1000).map(|i| (0.1 * f64::from(i), offset)))
        };
        let (log, given, better) = (profile(0.3, 0), profile(0.0, 200), profile(0.25, 0));
        let gap = super::gap(&log, 0.01, [&given, &better, &log]).unwrap();
        assert!((gap.before - 0.3).abs() < 1e-12 && (gap.effect - 0.05).abs() < 1e-12);
        assert_eq!((gap.recalibrated, gap.learnable, gap.noise), (0.0, None, 0.01));
        let elsewhere = profile(0.0, 5000);
        assert!(matches!(
            super::gap(&log, 0.0, [&elsewhere; 3]),
            Err(ClosedLoopError::LittleInCommon { .. })
        ));
        assert!((log.rms() - 0.3).abs() < 1e-12);
    }
}
