//! The paper's setting: a nominal MPC near the edge of its stability, and all others at its weights.
//!
//! At one frozen weight set the cut of the error against the nominal MPC can be made as large as one likes: the nominal's
//! error grows without bound towards its edge, that of a model that knows the delay does not. The truck paper's 94 % are of
//! this kind (nominal RMSE 0.38 m, at most 1.4 m). Here the edge is looked for openly: on the way from the nominal's best
//! weights to the default ones, over decades, the tightest at which it still finishes, by bisection.

use super::compare::{CompareError, ComparisonFor};
use super::result::Outcome;
use super::row::Row;
use super::vehicle::Compared;
use super::weights::Weights;
use crate::residual::parallel;
use serde::Serialize;

/// What was found.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct Edge {
    /// Share of the way from the nominal MPC's best weights to the default ones.
    pub share: f64,
    pub weights: Weights,
    /// The nominal MPC and rows without observer on the plant's test road with the first seed's model, by name.
    pub rows: Vec<(String, Outcome)>,
}

/// Halvings of the way.
const HALVINGS: u32 = 6;

impl<P: Compared<S, C>, const S: usize, const C: usize> ComparisonFor<'_, P, S, C> {
    /// Drives rows at the nominal MPC's edge; `best` are its best weights.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn edge(&self, rows: &[Row], best: &Weights) -> Result<Edge, CompareError> {
        let default = Weights::of(&P::controller(self.vehicle).mpc);
        let at = |share: f64| P::SETTING.space.between(best, &default, share);
        let outcome = |row: Row, weights: &Weights| -> Result<Outcome, CompareError> {
            Ok(Outcome::from(&self.drive(row, weights, &self.roads.test)?))
        };
        let (mut stands, mut falls) = (0.0, 1.0);
        if !outcome(Row::NOMINAL, &default)?.lost {
            stands = 1.0;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (stands + falls);
            let lost = stands < 1.0 && outcome(Row::NOMINAL, &at(middle))?.lost;
            (stands, falls) = if lost { (stands, middle) } else { (middle, falls) };
        }
        let weights = at(stands);
        let others =
            rows.iter().copied().filter(|row| *row != Row::NOMINAL && !row.observes && self.has(*row));
        let rows: Vec<Row> = std::iter::once(Row::NOMINAL).chain(others).collect();
        let threads = parallel::threads(self.effort.threads);
        let outcomes = parallel::map(threads, rows.len(), |i| outcome(rows[i], &weights));
        let rows = rows.iter().zip(outcomes).map(|(row, outcome)| Ok((row.name(), outcome?)));
        Ok(Edge { share: stands, weights, rows: rows.collect::<Result<_, CompareError>>()? })
    }
}
