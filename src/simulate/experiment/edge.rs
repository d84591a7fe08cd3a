//! The paper's setting: a nominal MPC near the edge of its stability, and all others at its weights.
//!
//! At one frozen weight set the cut of the error against the nominal MPC can be made as large as one likes: the nominal's
//! error grows without bound towards its edge, that of a model that knows the delay does not. The truck paper's 94 % are of
//! this kind (nominal RMSE 0.38 m, at most 1.4 m). Here the edge is looked for openly: on the ways from the
//! nominal's best weights to the default ones and to each other row's best, over decades, the tightest at which it still
//! finishes, by bisection; and of these edges the one at which RFL or RFL+S gains most. It is the most flattering
//! comparison that can be had, on purpose.

use super::compare::{CompareError, ComparisonFor};
use super::result::Outcome;
use super::row::{Predictor, Row};
use super::vehicle::Compared;
use super::weights::Weights;
use crate::residual::parallel;
use serde::Serialize;

/// What was found.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct Edge {
    /// Whose weights the way leads to, and the share of the way from the nominal MPC's best.
    pub towards: String,
    pub share: f64,
    pub weights: Weights,
    /// The nominal MPC and rows without observer on the plant's test road with the first seed's model, by name.
    pub rows: Vec<(String, Outcome)>,
}

/// Halvings of the way.
const HALVINGS: u32 = 6;

impl<P: Compared<S, C>, const S: usize, const C: usize> ComparisonFor<'_, P, S, C> {
    /// Drives rows at the nominal MPC's edge; `best` are all rows' weights at their own best, the nominal MPC's first.
    ///
    /// # Errors
    /// See [`CompareError`].
    ///
    /// # Panics
    /// If there are no weights: a mistake of the calling code.
    pub fn edge(&self, best: &[(Row, Weights)]) -> Result<Edge, CompareError> {
        let (_, nominal) = best[0];
        let default = ("the default weights".to_owned(), Weights::of(&P::controller(self.vehicle).mpc));
        let others = best[1..].iter().map(|(row, weights)| (row.name(), *weights));
        let ends: Vec<_> = std::iter::once(default).chain(others).collect();
        let rows: Vec<Row> = best.iter().map(|(row, _)| *row).filter(|row| !row.observes).collect();
        let threads = parallel::threads(self.effort.threads);
        let edges = parallel::map(threads, ends.len(), |i| {
            let (share, weights) = self.tightest(&nominal, &ends[i].1)?;
            let nominal = self.outcome(Row::NOMINAL, &weights)?;
            let mut least = f64::INFINITY;
            for row in rows.iter().filter(|row| matches!(row.predictor, Predictor::Rfl | Predictor::RflS)) {
                let outcome = self.outcome(*row, &weights)?;
                if !outcome.lost {
                    least = least.min(outcome.tracking.rmse / nominal.tracking.rmse);
                }
            }
            Ok::<_, CompareError>((least, i, share, weights))
        });
        let edges = edges.into_iter().collect::<Result<Vec<_>, _>>()?;
        let (_, end, share, weights) =
            edges.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("there is the default's");
        let outcomes = parallel::map(threads, rows.len(), |i| self.outcome(rows[i], &weights));
        let rows = rows.iter().zip(outcomes).map(|(row, outcome)| Ok((row.name(), outcome?)));
        let rows = rows.collect::<Result<_, CompareError>>()?;
        Ok(Edge { towards: ends[end].0.clone(), share, weights, rows })
    }

    /// How far the nominal MPC can go on the way between weights and still finish: share and weights.
    fn tightest(&self, from: &Weights, to: &Weights) -> Result<(f64, Weights), CompareError> {
        let at = |share: f64| P::SETTING.space.between(from, to, share);
        if !self.outcome(Row::NOMINAL, &at(1.0))?.lost {
            return Ok((1.0, at(1.0)));
        }
        let (mut stands, mut falls) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (stands + falls);
            let lost = self.outcome(Row::NOMINAL, &at(middle))?.lost;
            (stands, falls) = if lost { (stands, middle) } else { (middle, falls) };
        }
        Ok((stands, at(stands)))
    }

    /// A drive of the test road with the first seed's model.
    fn outcome(&self, row: Row, weights: &Weights) -> Result<Outcome, CompareError> {
        Ok(Outcome::from(&self.drive(row, weights, &self.roads.test)?))
    }
}
