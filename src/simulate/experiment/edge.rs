//! The paper's setting: a nominal MPC near the edge of its stability, and all others at its weights.
//!
//! At one frozen weight set the cut of the error against the nominal MPC can be made arbitrarily large. The nominal's
//! error grows without bound towards its edge; that of a model that knows the delay does not. The truck paper's 94 %
//! are of this kind (nominal RMSE 0.38 m, at most 1.4 m). Here the edge is searched for openly, by bisection, in two
//! ways:
//!
//! - At the plant's own delay: the tightest weights at which the nominal still finishes. They lie on the ways from the
//!   nominal's best to the default ones and to each other row's best, over decades. The edge with the largest gain of
//!   RFL or RFL+S counts.
//! - At the default weights, which suit a controller that knows the delay: the longest dead time at which the nominal
//!   still finishes.
//!
//! Both are deliberately the most flattering comparison.

use super::compare::{CompareError, ComparisonFor};
use super::plant::{STEER_DELAY, TestPlant};
use super::result::{DriveMetrics, Effort};
use super::row::{Predictor, TableRow};
use super::trial::TrialFor;
use super::vehicle::Compared;
use super::weights::CostWeights;
use crate::control::PredictionModelFor;
use crate::numerics::parallel;
use serde::Serialize;
use std::borrow::Cow;

/// Result of the search.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct Edge {
    /// End of the way, and the share of it that the nominal MPC goes.
    pub towards: String,
    pub share: f64,
    /// Dead time of the steering beyond the vehicle file's, s.
    pub dead_time: f64,
    pub weights: CostWeights,
    /// The nominal MPC and rows without observer on the plant's test road with the first seed's model, by name.
    pub rows: Vec<(String, DriveMetrics)>,
}

/// Halvings of the way.
const HALVINGS: u32 = 6;

impl<P: Compared<S, C>, const S: usize, const C: usize> ComparisonFor<'_, P, S, C> {
    /// Drives rows where the weights are tightest for the nominal MPC; `best` are all rows' weights at their own best, the
    /// nominal MPC's first.
    ///
    /// # Errors
    /// See [`CompareError`].
    ///
    /// # Panics
    /// If there are no weights: a mistake of the calling code.
    pub fn edge_of_weights(&self, best: &[(TableRow, CostWeights)]) -> Result<Edge, CompareError> {
        let (_, nominal) = best[0];
        let default = ("the default weights".to_owned(), self.default_weights());
        let others = best[1..].iter().map(|(row, weights)| (row.name(), *weights));
        let ends: Vec<_> = std::iter::once(default).chain(others).collect();
        let rows = plain(best);
        let edges = parallel::map(parallel::threads(self.effort.threads), ends.len(), |i| {
            let at = |share: f64| P::SETTING.space.between(&nominal, &ends[i].1, share);
            let share = furthest(|share| Ok(!self.outcome(TableRow::NOMINAL, &at(share))?.lost))?;
            let nominal = self.outcome(TableRow::NOMINAL, &at(share))?;
            let mut least = f64::INFINITY;
            for row in rows.iter().filter(|row| matches!(row.predictor, Predictor::Rfl | Predictor::RflS)) {
                let outcome = self.outcome(*row, &at(share))?;
                if !outcome.lost {
                    least = least.min(outcome.tracking.rmse / nominal.tracking.rmse);
                }
            }
            Ok::<_, CompareError>((least, i, share, at(share)))
        });
        let edges = edges.into_iter().collect::<Result<Vec<_>, _>>()?;
        let (_, end, share, weights) =
            edges.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("there is the default's");
        self.edge_at(ends[end].0.clone(), share, weights, &rows)
    }

    /// Drives rows at the default weights behind the longest dead time, up to the plant's, that the nominal MPC stands
    /// with them. None where it does not even stand that of the vehicle file.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn edge_of_delay(&self, best: &[(TableRow, CostWeights)]) -> Result<Option<Edge>, CompareError> {
        let weights = self.default_weights();
        let plant = |share: f64| {
            let shorter = |&(id, value): &(&'static str, f64)| {
                (id, if id == STEER_DELAY { share * value } else { value })
            };
            TestPlant {
                effects: Cow::Owned(self.plant.effects.iter().map(shorter).collect()),
                ..self.plant.clone()
            }
        };
        let stands = |share: f64| {
            let trial = self.trial(&self.roads.test, PredictionModelFor::Nominal, weights, 1);
            Ok(!TrialFor { plant: &plant(share), ..trial }.drive()?.lost)
        };
        if !stands(0.0)? {
            return Ok(None);
        }
        let share = furthest(stands)?;
        let plant = plant(share);
        let effort = Effort { seeds: 1, ..self.effort.clone() };
        let shorter =
            ComparisonFor::<P, S, C>::collect(self.vehicle, &plant, self.noise, self.roads, effort)?;
        let towards = "the plant's dead time at the default weights".to_owned();
        shorter.edge_at(towards, share, weights, &plain(best)).map(Some)
    }

    /// Rows at weights on this plant.
    fn edge_at(
        &self,
        towards: String,
        share: f64,
        weights: CostWeights,
        rows: &[TableRow],
    ) -> Result<Edge, CompareError> {
        let threads = parallel::threads(self.effort.threads);
        let outcomes = parallel::map(threads, rows.len(), |i| self.outcome(rows[i], &weights));
        let rows = rows.iter().zip(outcomes).map(|(row, outcome)| Ok((row.name(), outcome?)));
        let rows = rows.collect::<Result<_, CompareError>>()?;
        Ok(Edge { towards, share, dead_time: self.plant.effect(STEER_DELAY), weights, rows })
    }

    /// A drive of the test road with the first seed's model.
    fn outcome(&self, row: TableRow, weights: &CostWeights) -> Result<DriveMetrics, CompareError> {
        Ok(DriveMetrics::from(&self.drive(row, weights, &self.roads.test)?))
    }
}

/// The rows without observer.
fn plain(best: &[(TableRow, CostWeights)]) -> Vec<TableRow> {
    best.iter().map(|(row, _)| *row).filter(|row| !row.observes).collect()
}

/// Furthest stable point of a way, as a share of it, if its beginning is stable.
fn furthest(stands: impl Fn(f64) -> Result<bool, CompareError>) -> Result<f64, CompareError> {
    if stands(1.0)? {
        return Ok(1.0);
    }
    let (mut near, mut far) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (near + far);
        if stands(middle)? {
            near = middle;
        } else {
            far = middle;
        }
    }
    Ok(near)
}
