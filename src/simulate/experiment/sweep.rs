//! The error over the dead time of the steering: what each delay model is worth, at weights that are the same for all.

use super::compare::{CompareError, ComparisonFor};
use super::plant::{STEER_DELAY, STEER_LAG, TestPlant};
use super::result::{DriveMetrics, Effort};
use super::roads::Roads;
use super::row::{Predictor, TableRow};
use super::vehicle::Compared;
use super::weights::CostWeights;
use crate::numerics::parallel;
use crate::path::sudoku::Route;
use serde::Serialize;
use std::borrow::Cow;

/// Setting of a sweep.
#[derive(Debug, Clone, Copy)]
pub struct SweepSetting {
    /// Dead times, s.
    pub dead_times: &'static [f64],
    /// The lag behind them, s.
    pub lag: f64,
    /// The road.
    pub test: Route,
    /// The rows.
    pub rows: &'static [TableRow],
    /// Weights by name.
    pub weights: &'static [(&'static str, CostWeights)],
}

/// Weights without observer.
const fn weights(q_e1_rate: f64, q_e2: f64, r_rate: f64) -> CostWeights {
    CostWeights { q_e1_rate, q_e2, q_e2_rate: 0.0, r_rate, disturbance_noise: 0.0, prediction_noise: 0.0 }
}

impl SweepSetting {
    /// The truck's: up to a dead time of 0.5 s.
    pub const TRUCK: Self = Self {
        dead_times: &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5],
        lag: 0.2,
        test: Route::TruckOffRoad,
        rows: &[
            TableRow::NOMINAL,
            TableRow::plain(Predictor::FirstOrder),
            TableRow::plain(Predictor::Pade11),
            TableRow::plain(Predictor::Pade22),
            TableRow::plain(Predictor::Identified),
            TableRow::plain(Predictor::Oracle),
            TableRow::plain(Predictor::Rfl),
            TableRow::plain(Predictor::RflS),
        ],
        weights: &[("default", weights(0.4, 0.0, 0.1)), ("damped", weights(1.0, 300.0, 30.0))],
    };
}

/// One point of the sweep.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct SweepPoint {
    pub dead_time: f64,
    pub lag: f64,
    /// Name of the weights.
    pub weights: &'static str,
    pub row: String,
    /// None where the collecting nominal MPC was lost: there was nothing to learn from.
    pub outcome: Option<DriveMetrics>,
}

/// Sweeps the dead time of a vehicle's steering, with the first seed's models; nothing for a vehicle without a sweep.
///
/// # Errors
/// See [`CompareError`].
pub fn sweep<P: Compared<S, C>, const S: usize, const C: usize>(
    vehicle: &P::Parameters,
    threads: usize,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Vec<SweepPoint>, CompareError> {
    let Some(setting) = P::SETTING.sweep else { return Ok(vec![]) };
    let mut points = Vec::new();
    for &dead_time in setting.dead_times {
        progress(&format!("dead time {dead_time:.1} s"));
        let plant = TestPlant {
            name: Cow::Owned(format!("dead_time_{dead_time:.1}")),
            effects: Cow::Owned(vec![(STEER_DELAY, dead_time), (STEER_LAG, setting.lag)]),
            ..TestPlant::new("", "A dead time and a lag added to the steering", &[], setting.test)
        };
        let roads = Roads::new(&P::SETTING, &plant)?;
        let effort = Effort { seeds: 1, drives: P::SETTING.drives, budget: 0, threads };
        let collected = ComparisonFor::<P, S, C>::collect(vehicle, &plant, None, &roads, effort.clone());
        let (comparison, learns) = match collected {
            Err(CompareError::Lost { .. }) => {
                let none = Effort { seeds: 0, ..effort };
                (ComparisonFor::collect(vehicle, &plant, None, &roads, none)?, false)
            }
            collected => (collected?, true),
        };
        let jobs: Vec<_> = setting
            .weights
            .iter()
            .flat_map(|weights| setting.rows.iter().map(move |row| (weights, row)))
            .collect();
        let outcomes = parallel::map(parallel::threads(threads), jobs.len(), |i| {
            let ((_, weights), row) = jobs[i];
            if row.predictor.learns() && !learns {
                return Ok(None);
            }
            Ok(Some(DriveMetrics::from(&comparison.drive(*row, weights, &roads.test)?)))
        });
        for ((weights, row), outcome) in jobs.iter().zip(outcomes) {
            let outcome: Result<_, CompareError> = outcome;
            points.push(SweepPoint {
                dead_time,
                lag: setting.lag,
                weights: weights.0,
                row: row.name(),
                outcome: outcome?,
            });
        }
    }
    Ok(points)
}
