//! The comparison on one plant, with or without noise: collect, learn, tune, drive.
//!
//! 1. For each seed the nominal MPC, calm and with dither, drives the training route; from that each row learns.
//! 2. Each row searches its weights on pieces of the training route (`weights.rs`), each piece with another seed's
//!    model and noise, the nominal MPC first: no other may steer more roughly than it does at its best. The best two
//!    that stand the whole training route with every seed's model, shaken by twice the noise (typical noise on plants
//!    without), are compared there: a loop at its edge looks calm until a road shakes it.
//! 3. Three protocols on the test route: *own best*, each row at the weights that it found, *frozen*, all at the
//!    weights that the nominal found, and *default*, all at the weights that users get.
//!
//! Nothing of the test route is used before it is driven.

use super::fit::{FitMetrics, steps_ahead};
use super::plant::Plant;
use super::row::Row;
use super::trial::{LOST, Trial, TrialError};
use super::weights::{Found, Weights, search};
use crate::control::{BicycleModel, ControllerParameters, PredictionModel, Propagation, Residual, RollOut};
use crate::path::sudoku::Route;
use crate::path::{Closure, Path, PathError, RoadClass};
use crate::residual::gp::{self, GpConfig, GpTrainError};
use crate::residual::{DataError, DataSet, ResidualModel, TrainConfig, TrainError, parallel, train};
use crate::simulate::{Drive, InputMetrics, STATION, SensorNoise, StepTimes, TrackingMetrics};
use crate::vehicle::CarParameters;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Why there is no comparison.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum CompareError {
    #[error(transparent)]
    Trial(#[from] TrialError),
    #[error(transparent)]
    Path(#[from] PathError),
    #[error(transparent)]
    Data(#[from] DataError),
    #[error(transparent)]
    Train(#[from] TrainError),
    #[error(transparent)]
    Gp(#[from] GpTrainError),
    #[error(
        "while collecting, the nominal MPC lost the car on the plant {plant}: there is nothing to learn from"
    )]
    Lost { plant: &'static str },
}

/// How much is done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Effort {
    /// Seeds: each has drives, models and noise of its own.
    pub seeds: usize,
    /// Drives of the training route from which a seed's models are learned.
    pub drives: usize,
    /// Candidates of each row's search.
    pub budget: usize,
    /// Threads; the results do not depend on it.
    pub threads: usize,
}

impl Default for Effort {
    fn default() -> Self {
        Self { seeds: 5, drives: 2, budget: 64, threads: 0 }
    }
}

/// One drive of the test route in numbers.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct Outcome {
    pub tracking: TrackingMetrics,
    pub classes: BTreeMap<&'static str, TrackingMetrics>,
    pub steering: InputMetrics,
    /// The car left the path: the loop diverged. The other numbers are then those until there.
    pub lost: bool,
}

impl From<&Drive> for Outcome {
    fn from(drive: &Drive) -> Self {
        let classes = RoadClass::ALL
            .iter()
            .map(|class| (class.name(), drive.tracking_on(*class)))
            .filter(|(_, metrics)| metrics.count > 0)
            .collect();
        Self {
            tracking: drive.tracking(),
            classes,
            steering: drive.steering(),
            lost: drive.lost || !drive.finished,
        }
    }
}

/// What a row's residual predicts, for one seed.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct RowFit {
    pub train: FitMetrics,
    pub test: FitMetrics,
    /// After a horizon of 16 steps, on the test route.
    pub test_16_steps: FitMetrics,
}

/// One row of the comparison.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct RowResult {
    pub row: &'static str,
    pub weights: Weights,
    /// Score of the weights on the training pieces, m.
    pub score: f64,
    /// Every candidate's weights and score.
    pub tried: Vec<(Weights, f64)>,
    /// One for each seed; one only where no seed plays a part.
    pub own_best: Vec<Outcome>,
    pub frozen: Vec<Outcome>,
    pub default: Vec<Outcome>,
    pub fit: Vec<RowFit>,
    pub time: Option<StepTimes>,
}

impl RowResult {
    /// Outcomes of each protocol.
    #[must_use]
    pub fn protocols(&self) -> [(&'static str, &[Outcome]); 3] {
        [("own best", &self.own_best), ("frozen", &self.frozen), ("default", &self.default)]
    }
}

/// A plant, with or without noise.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct Condition {
    pub plant: &'static str,
    pub noise: bool,
    pub vehicle: String,
    pub effort: Effort,
    pub rows: Vec<RowResult>,
}

/// Roads of the comparison.
pub struct Roads {
    /// All of the training route.
    pub train: Arc<Path>,
    /// Pieces of it on which weights are tuned: turns, a U-turn, a sweeper, cross-country.
    pub pieces: Vec<Arc<Path>>,
    /// Piece on which candidates are shaken.
    pub shaking: Arc<Path>,
    /// The test route.
    pub test: Arc<Path>,
}

/// Pieces of the training route, m; each begins on a straight.
const PIECES: [(usize, usize); 2] = [(650, 1360), (4300, 5300)];

/// Where candidates are shaken: the fast beginning of the second piece.
const SHAKING: (usize, usize) = (4300, 4650);

impl Roads {
    /// Draws them.
    ///
    /// # Errors
    /// None for our own courses, unless they were changed.
    pub fn new() -> Result<Self, PathError> {
        let train = Arc::new(Route::SudokuTrain.path()?);
        let samples = Route::SudokuTrain.samples();
        let length = train.length();
        let index = |station: usize| station * samples.len() / length as usize;
        let piece = |&(from, to): &(usize, usize)| {
            Path::from_samples(samples[index(from)..index(to)].to_vec(), Closure::Open).map(Arc::new)
        };
        Ok(Self {
            pieces: PIECES.iter().map(piece).collect::<Result<_, _>>()?,
            shaking: piece(&SHAKING)?,
            train,
            test: Arc::new(Route::SudokuTest.path()?),
        })
    }
}

/// Weights of a collecting controller. The default ones ring on a car with a slow actuator, and a model that has
/// learned ringing, with its saturated commands, makes the loop diverge. Measured on lag 0.1 s and dead time 0.06 s,
/// RFL+S with a window of 16, mean lateral error on the test route: nominal 34 mm, learned from drives with the
/// default weights 767 mm, with these 16 mm.
pub const CALM: Weights = Weights {
    q_e1_rate: 1.0,
    q_e2: 2.0,
    q_e2_rate: 0.0,
    r_rate: 0.3,
    disturbance_noise: 0.0,
    prediction_noise: 0.0,
};
/// Amplitude of the dither of those drives, rad.
pub const DITHER: f64 = 0.01;

/// Lateral error at which a candidate's drive is given up, m: no row's best comes near.
const HOPELESS: f64 = 0.6;
/// Candidates of a search that are compared on the whole training route.
const VALIDATED: usize = 2;
/// Candidates that are shaken, to find those.
const TRIED: usize = 12;
/// The seed whose model compares them: another than those that the pieces were driven with.
const VALIDATING: usize = 2;
/// What steering more roughly than the nominal MPC costs at least, m.
const COST_OF_ROUGHNESS: f64 = 100.0;
/// The seed whose model is shaken.
const SHAKEN_SEED: usize = 4;
/// What a piece of road that was not driven to its end costs, m.
const COST_OF_LOSS: f64 = 1e3;
/// Streams of random numbers that must not meet.
const TUNING_NOISE: u64 = 900;

/// One plant with its data.
pub struct Comparison<'a> {
    /// The car.
    pub car: &'a CarParameters,
    /// What it has beyond its nominal model.
    pub plant: Plant,
    /// Noise of its sensors.
    pub noise: Option<SensorNoise>,
    /// The roads.
    pub roads: &'a Roads,
    /// How much is done.
    pub effort: Effort,
    data: Vec<DataSet>,
    test_data: Vec<DataSet>,
    /// What rows have learned, for each seed: some rows share it, and all are asked for it again.
    learned: Mutex<Vec<(Row, usize, Model)>>,
}

/// What a row predicts with, and how well.
type Model = (PredictionModel, Option<RowFit>);

impl<'a> Comparison<'a> {
    /// Collects the drives to learn from.
    ///
    /// # Errors
    /// The car is lost; parameters out of range.
    pub fn collect(
        car: &'a CarParameters,
        plant: Plant,
        noise: Option<SensorNoise>,
        roads: &'a Roads,
        effort: Effort,
    ) -> Result<Self, CompareError> {
        let mut comparison = Self {
            car,
            plant,
            noise,
            roads,
            effort,
            data: Vec::new(),
            test_data: Vec::new(),
            learned: Mutex::default(),
        };
        let Effort { seeds, drives, threads, .. } = comparison.effort;
        let logs = parallel::map(parallel::threads(threads), seeds * (drives + 1), |i| {
            // The last of each seed's drives is one of the test route, to measure predictions on.
            let to_learn = i % (drives + 1) < drives;
            let path = if to_learn { &comparison.roads.train } else { &comparison.roads.test };
            Trial {
                dither: Some((DITHER, 1 + i)),
                noise: comparison.noise.map(|noise| (noise, 1000 + i as u64)),
                ..comparison.trial(path, PredictionModel::Nominal, CALM, 0)
            }
            .drive()
        });
        let parameters = ControllerParameters::for_car(car);
        let config = parameters.mpc.data_config();
        let vehicle = parameters.vehicle.single_track();
        let logs = logs.into_iter().collect::<Result<Vec<_>, _>>()?;
        if logs.iter().any(|drive| drive.lost) {
            return Err(CompareError::Lost { plant: plant.name() });
        }
        for seed in logs.chunks(drives + 1) {
            let logs: Vec<_> = seed.iter().map(Drive::to_learn_from).collect();
            comparison.data.push(DataSet::new(&logs[..drives], &vehicle, config)?);
            comparison.test_data.push(DataSet::new(&logs[drives..], &vehicle, config)?);
        }
        Ok(comparison)
    }

    fn trial(&self, path: &Arc<Path>, model: PredictionModel, weights: Weights, seed: u64) -> Trial<'a> {
        Trial {
            car: self.car,
            plant: self.plant,
            path: path.clone(),
            model,
            weights,
            noise: self.noise.map(|noise| (noise, seed)),
            give_up: LOST,
            dither: None,
        }
    }

    /// Trains a residual on a seed's drives.
    ///
    /// # Errors
    /// Too little data.
    pub fn train(&self, config: &TrainConfig, seed: usize) -> Result<ResidualModel, CompareError> {
        let config = TrainConfig { seed: seed as u64 + 1, threads: self.effort.threads, ..config.clone() };
        Ok(train(&self.data[seed], None, &config, &|_| ())?.model)
    }

    /// How well a residual predicts.
    #[must_use]
    pub fn fit(&self, model: &ResidualModel, seed: usize) -> RowFit {
        RowFit {
            train: model.measure(&self.data[seed]).into(),
            test: model.measure(&self.test_data[seed]).into(),
            test_16_steps: steps_ahead(model, &self.test_data[seed], 16),
        }
    }

    /// What a row predicts with, learned from a seed's drives; learned once.
    fn model(&self, row: Row, seed: usize) -> Result<Model, CompareError> {
        let row = row.predicts_as();
        let learned = || self.learned.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., model)) = learned().iter().find(|(of, with, _)| (*of, *with) == (row, seed)) {
            return Ok(model.clone());
        }
        let model = self.learn(row, seed)?;
        learned().push((row, seed, model.clone()));
        Ok(model)
    }

    fn learn(&self, row: Row, seed: usize) -> Result<Model, CompareError> {
        if let Some(config) = row.training() {
            let model = self.train(&config, seed)?;
            let fit = self.fit(&model, seed);
            return Ok((propagated(model), Some(fit)));
        }
        let model = match row {
            Row::Oracle => PredictionModel::Actuator(self.plant.actuator(self.car)),
            Row::Nmpc => PredictionModel::Bicycle(BicycleModel::default()),
            Row::GpNmpc => {
                let config =
                    GpConfig { seed: seed as u64 + 1, threads: self.effort.threads, ..GpConfig::default() };
                let trained = gp::train(&self.data[seed], None, &config, &|_| ())?;
                PredictionModel::Bicycle(BicycleModel {
                    gp: Some(Arc::new(trained.model)),
                    ..BicycleModel::default()
                })
            }
            _ => PredictionModel::Nominal,
        };
        Ok((model, None))
    }

    /// Compares the rows; the nominal MPC is the first, whether asked for or not. `progress` is called from the threads
    /// that work.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn run(&self, rows: &[Row], progress: &(dyn Fn(&str) + Sync)) -> Result<Condition, CompareError> {
        let threads = parallel::threads(self.effort.threads);
        let (nominal, limit) = self.row(Row::Mpc, None, threads, progress)?;
        let measure = (nominal.weights, limit);
        let others: Vec<Row> = rows.iter().copied().filter(|row| *row != Row::Mpc).collect();
        // Rows side by side, each on one thread; the slowest, at the tables' ends, first.
        let others = parallel::map(threads, others.len(), |i| {
            self.row(others[others.len() - 1 - i], Some(measure), 1, progress).map(|(result, _)| result)
        });
        let others = others.into_iter().rev().collect::<Result<Vec<_>, _>>()?;
        Ok(Condition {
            plant: self.plant.name(),
            noise: self.noise.is_some(),
            vehicle: self.car.name.clone(),
            effort: self.effort.clone(),
            rows: std::iter::once(nominal).chain(others).collect(),
        })
    }

    /// One row, measured by the nominal MPC's weights and roughness; that one's own if there are none. The row's
    /// roughness on the pieces beside it.
    fn row(
        &self,
        row: Row,
        nominal: Option<(Weights, f64)>,
        threads: usize,
        progress: &dyn Fn(&str),
    ) -> Result<(RowResult, f64), CompareError> {
        progress(&format!("{}: learning", row.name()));
        let seeds = if row.learns() || self.noise.is_some() { self.effort.seeds } else { 1 };
        let learned = if row.learns() { seeds } else { 1 };
        let (models, fits): (Vec<_>, Vec<_>) = (0..learned)
            .map(|seed| self.model(row, seed))
            .collect::<Result<Vec<_>, _>>()?
            .into_iter()
            .unzip();
        progress(&format!("{}: tuning", row.name()));
        let limit = nominal.map_or(f64::INFINITY, |(_, limit)| limit);
        let known = nominal.map(|(weights, _)| weights);
        let found = search(self.effort.budget, 1, row.observes(), known, |weights| {
            self.score(&models, weights, limit, threads).unwrap_or(f64::INFINITY)
        });
        let own = self.validate(&models, &found)?;
        let frozen = known.unwrap_or(own);
        progress(&format!("{}: driving", row.name()));
        let observing = |weights: Weights| Weights {
            disturbance_noise: own.disturbance_noise,
            prediction_noise: own.prediction_noise,
            ..weights
        };
        let protocols = [own, observing(frozen), observing(Weights::default())];
        let outcomes = parallel::map(threads, protocols.len() * seeds, |i| {
            let (weights, seed) = (protocols[i / seeds], i % seeds);
            let model = models[seed.min(learned - 1)].clone();
            let drive = self.trial(&self.roads.test, model, weights, 1 + seed as u64).drive()?;
            Ok::<_, TrialError>(Outcome::from(&drive))
        });
        let mut own_best = outcomes.into_iter().collect::<Result<Vec<_>, _>>()?;
        let mut frozen = own_best.split_off(seeds);
        let default = frozen.split_off(seeds);
        let roughness = self.pieces(&models, &own, threads)?.1;
        let result = RowResult {
            row: row.name(),
            weights: own,
            score: found.score,
            tried: found.tried,
            own_best,
            frozen,
            default,
            fit: fits.into_iter().flatten().collect(),
            time: None,
        };
        Ok((result, roughness))
    }

    /// The noise that candidates must stand: a margin of two, and typical noise on plants without. A loop at its edge looks
    /// calm until a road shakes it.
    fn shaking(&self) -> SensorNoise {
        self.noise.map_or(SensorNoise::TYPICAL, |noise| noise.scaled(2.0))
    }

    /// A candidate's drive: its drive, and what is minimised, m. If the car is lost: the further it came, the better; a
    /// search that sees no difference goes nowhere.
    fn candidate(
        &self,
        path: &Arc<Path>,
        models: &[PredictionModel],
        weights: &Weights,
        noise: Option<SensorNoise>,
        seed: usize,
    ) -> Result<(Drive, f64), TrialError> {
        let model = models[seed % models.len()].clone();
        let noise = noise.map(|noise| (noise, TUNING_NOISE + seed as u64));
        let drive = Trial { give_up: HOPELESS, noise, ..self.trial(path, model, *weights, 0) }.drive()?;
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
    fn pieces(
        &self,
        models: &[PredictionModel],
        weights: &Weights,
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

    /// The better, on the whole training route, of the two best candidates that stand it shaken with every seed's model;
    /// the best candidate if none does.
    fn validate(&self, models: &[PredictionModel], found: &Found) -> Result<Weights, CompareError> {
        let mut best = found.tried.clone();
        best.sort_by(|a, b| a.1.total_cmp(&b.1));
        best.dedup();
        let error = |weights: &Weights, noise: Option<SensorNoise>, seed: usize| {
            self.candidate(&self.roads.train, models, weights, noise, seed).map(|(_, error)| error)
        };
        let mut standing: Vec<(f64, Weights)> = vec![];
        for (weights, _) in best.iter().filter(|candidate| candidate.1 < COST_OF_ROUGHNESS).take(TRIED) {
            if standing.len() == VALIDATED {
                break;
            }
            let mut stands = true;
            for seed in 0..models.len() {
                stands = error(weights, Some(self.shaking()), seed)? < COST_OF_LOSS;
                if !stands {
                    break;
                }
            }
            if stands {
                standing.push((error(weights, self.noise, VALIDATING)?, *weights));
            }
        }
        standing.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(standing.first().map_or(found.weights, |best| best.1))
    }

    /// What the search minimises: the tracking error, m, of candidates that steer no more roughly than the nominal MPC
    /// at its best; others only among themselves.
    fn score(
        &self,
        models: &[PredictionModel],
        weights: &Weights,
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

    /// Times the control steps of a row at its best, one drive at a time, and gives that drive.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn time(&self, row: Row, weights: &Weights) -> Result<(StepTimes, Drive), CompareError> {
        let (model, _) = self.model(row, 0)?;
        let drive = self.trial(&self.roads.test, model, *weights, 1).drive()?;
        Ok((drive.times(ControllerParameters::default().mpc.sample_time), drive))
    }

    /// Drives a road with a residual of one's own choice, for ablations.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn drive_with(&self, residual: Residual, weights: &Weights) -> Result<Outcome, CompareError> {
        let model = PredictionModel::Residual(residual);
        Ok(Outcome::from(&self.trial(&self.roads.test, model, *weights, 1).drive()?))
    }
}

/// A residual as it is used by default.
fn propagated(model: ResidualModel) -> PredictionModel {
    PredictionModel::Residual(Residual {
        model: Arc::new(model),
        propagation: Propagation::Propagated,
        roll_out: RollOut::Corrected,
    })
}
