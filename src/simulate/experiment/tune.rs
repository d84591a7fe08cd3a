//! Score of a row's weights: on pieces of the training route, shaken, and on a longer part of it.

use super::compare::{CompareError, ComparisonFor};
use super::trial::{TrialError, TrialFor};
use super::vehicle::{Compared, NominalOf};
use super::weights::{CostWeights, WeightSearch};
use crate::control::PredictionModelFor;
use crate::numerics::parallel;
use crate::path::Path;
use crate::simulate::{DriveFor, STATION, SensorNoise};
use std::sync::Arc;

/// Candidates of a search that are compared on a longer road.
const VALIDATED: usize = 2;
/// Least cost of steering that is rougher than allowed, m.
const COST_OF_ROUGHNESS: f64 = 100.0;
/// The seed whose model is shaken.
const SHAKEN_SEED: usize = 4;
/// Cost of a piece of road that was not driven to its end, m.
const COST_OF_LOSS: f64 = 1e3;
/// Streams of random numbers that must not meet.
const TUNING_NOISE: u64 = 900;

/// The models of a row, one for each seed that plays a part.
type Models<P, const S: usize, const C: usize> = [PredictionModelFor<NominalOf<P, S, C>, S>];

impl<P: Compared<S, C>, const S: usize, const C: usize> ComparisonFor<'_, P, S, C> {
    /// The noise that candidates must stand: a margin of two, and typical noise on plants without. A loop at its edge looks
    /// calm until a road shakes it.
    fn shaking(&self) -> SensorNoise {
        self.noise.map_or(P::SETTING.noise, |noise| noise.scaled(2.0))
    }

    /// A candidate's drive: its drive, and what is minimised, m. If the vehicle is lost: the further it came, the better; a
    /// search that sees no difference goes nowhere.
    fn candidate(
        &self,
        path: &Arc<Path>,
        models: &Models<P, S, C>,
        weights: &CostWeights,
        noise: Option<SensorNoise>,
        seed: usize,
    ) -> Result<(DriveFor<C>, f64), TrialError> {
        let model = models[seed % models.len()].clone();
        let noise = noise.map(|noise| (noise, TUNING_NOISE + seed as u64));
        let give_up = P::SETTING.hopeless;
        let drive = TrialFor { give_up, noise, ..self.trial(path, model, *weights, 0) }.drive()?;
        let tracking = drive.tracking();
        let error = if drive.lost || !drive.finished {
            let driven = drive.rows.last().map_or(0.0, |row| row[STATION]);
            COST_OF_LOSS * (2.0 - driven / path.length())
        } else {
            tracking.mae + tracking.rmse + 0.1 * tracking.max
        };
        Ok((drive, error))
    }

    /// Tracking error and steering roughness (RMS rate) on the pieces of the training route.
    pub(super) fn pieces(
        &self,
        models: &Models<P, S, C>,
        weights: &CostWeights,
        threads: usize,
    ) -> Result<(f64, f64), CompareError> {
        let pieces = &self.roads.pieces;
        let drives = parallel::map(threads, pieces.len(), |i| {
            self.candidate(&pieces[i], models, weights, self.noise, i)
        });
        let (mut error, mut length, mut rates, mut count) = (0.0, 0.0, 0.0, 0.0);
        for (drive, piece) in drives.into_iter().zip(pieces) {
            let (drive, missed) = drive?;
            error += piece.length() * missed;
            length += piece.length();
            rates += drive.rows.len() as f64 * drive.steering().rate_rms.powi(2);
            count += drive.rows.len() as f64;
        }
        Ok((error / length, (rates / count).sqrt()))
    }

    /// The better of the two best candidates on the roads for validation, among those that stand them shaken with every
    /// seed's model. The best candidate if none does.
    pub(super) fn validate(
        &self,
        models: &Models<P, S, C>,
        found: &WeightSearch,
    ) -> Result<CostWeights, CompareError> {
        let mut best = found.tried.clone();
        best.sort_by(|a, b| a.1.total_cmp(&b.1));
        best.dedup();
        let roads = &self.roads.validation;
        let error = |weights: &CostWeights, road: &Arc<Path>, noise: Option<SensorNoise>, seed: usize| {
            self.candidate(road, models, weights, noise, seed).map(|(_, error)| error)
        };
        let stands = |weights: &CostWeights| -> Result<bool, TrialError> {
            for (seed, road) in (0..models.len()).flat_map(|seed| roads.iter().map(move |road| (seed, road)))
            {
                if error(weights, road, Some(self.shaking()), seed)? >= COST_OF_LOSS {
                    return Ok(false);
                }
            }
            Ok(true)
        };
        // Seeds share a model where nothing is learned, and differ in their noise only.
        let distinct = if self.noise.is_some() { usize::MAX } else { models.len() };
        let seeds = || P::SETTING.validating.iter().take(distinct);
        let mean = |weights: &CostWeights| -> Result<f64, TrialError> {
            let (mut sum, mut length) = (0.0, 0.0);
            for (&seed, road) in seeds().flat_map(|seed| roads.iter().map(move |road| (seed, road))) {
                sum += road.length() * error(weights, road, self.noise, seed)?;
                length += road.length();
            }
            Ok(sum / length)
        };
        let mut standing: Vec<(f64, CostWeights)> = vec![];
        for (weights, _) in
            best.iter().filter(|candidate| candidate.1 < COST_OF_ROUGHNESS).take(P::SETTING.shaken)
        {
            if standing.len() == VALIDATED {
                break;
            }
            if stands(weights)? {
                standing.push((mean(weights)?, *weights));
            }
        }
        standing.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(standing.first().map_or(found.weights, |best| best.1))
    }

    /// Objective of the search: the tracking error, m, of candidates that steer no more roughly than `limit`, the
    /// nominal MPC at its best. Rougher ones are compared only among themselves.
    pub(super) fn score(
        &self,
        models: &Models<P, S, C>,
        weights: &CostWeights,
        limit: f64,
        threads: usize,
    ) -> Result<f64, CompareError> {
        let noise = Some(self.shaking());
        let (_, shaken) = self.candidate(&self.roads.shaking, models, weights, noise, SHAKEN_SEED)?;
        if shaken >= COST_OF_LOSS {
            return Ok(shaken);
        }
        let (error, roughness) = self.pieces(models, weights, threads)?;
        Ok(if error < COST_OF_LOSS / 4.0 && roughness > limit {
            COST_OF_ROUGHNESS * roughness / limit
        } else {
            error
        })
    }
}
