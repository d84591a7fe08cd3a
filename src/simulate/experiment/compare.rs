//! The comparison on one plant, with or without noise: collect, learn, tune, drive.
//!
//! 1. For each seed the nominal MPC, calm and with dither, drives the training route. The truck's is then driven again,
//!    by an MPC that has learned one linear model from that. From these drives each row learns (`learn.rs`). Rows that
//!    model the delay are identified from a recorded step (`step.rs`).
//! 2. Each row searches its weights on pieces of the training route (`weights.rs`, `tune.rs`), each piece with another
//!    seed's model and noise. The nominal MPC comes first: the car's others may not steer more roughly than it does at
//!    its best. Candidates are shaken on the training route by twice the noise (typical noise on plants without), with
//!    every seed's model. The best two that stand it are compared there: a loop at its edge looks calm until a road
//!    shakes it.
//! 3. Three protocols on the test route. *Own best*: each row at the weights that it found. *Frozen*: all at the
//!    weights that the nominal found. *Default*: all at the weights that users get.
//!
//! Nothing of the test route is used before it is driven.

use super::learn::{RowModel, SHORT_HORIZON};
use super::plant::TestPlant;
use super::response::RecordedResponse;
use super::result::{Condition, DriveMetrics, Effort, RowResult, vehicle_digest};
use super::roads::Roads;
use super::row::{Predictor, TableRow};
use super::step::SteeringStep;
use super::trial::{LOST, TrialError, TrialFor};
use super::vehicle::{Again, Compared, NominalOf};
use super::weights::{CostWeights, search};
use crate::control::{ControlledParameters, PredictionModelFor, Residual};
use crate::nominal::{ERRORS, IdentifyError};
use crate::numerics::parallel;
use crate::path::{Path, PathError};
use crate::residual::gp::GpTrainError;
use crate::residual::{DataError, DataSet, TrainError};
use crate::simulate::{CAR_COLUMNS, DriveFor, SensorNoise, StepTimes};
use crate::vehicle::{Car, VehicleParameters as _};
use std::sync::{Arc, Mutex, PoisonError};

/// Reasons for which there is no comparison.
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
    #[error("the steering actuator cannot be identified from a recorded step: {0}")]
    Identify(#[from] IdentifyError),
    #[error("the row {row} has a nonlinear model, and there is none of a {vehicle}: leave it out")]
    NoModel { row: &'static str, vehicle: &'static str },
    #[error(
        "while collecting, the nominal MPC lost the {vehicle} on the plant {plant}: there is nothing to learn from"
    )]
    Lost { vehicle: &'static str, plant: String },
}

/// One plant of a car with its data.
pub type Comparison<'a> = ComparisonFor<'a, Car, ERRORS, CAR_COLUMNS>;

/// Number of amplitudes of the dither that are tried until the collecting MPC stands one, each half the one before.
const DITHERS: usize = 3;

/// Data sets, one for each seed.
type Data<P, const S: usize, const C: usize> = Vec<DataSet<NominalOf<P, S, C>, S>>;

/// Learned models by predictor and by the seed of the drives.
type LearnedModels<P, const S: usize, const C: usize> = (Predictor, usize, RowModel<NominalOf<P, S, C>, S>);

/// One plant with its data.
pub struct ComparisonFor<'a, P: Compared<S, C>, const S: usize, const C: usize> {
    /// The vehicle.
    pub vehicle: &'a P::Parameters,
    /// Deviations of the vehicle from its nominal model.
    pub plant: &'a TestPlant,
    /// Noise of its sensors.
    pub noise: Option<SensorNoise>,
    /// The roads.
    pub roads: &'a Roads,
    /// Effort of the comparison.
    pub effort: Effort,
    pub(super) data: Data<P, S, C>,
    pub(super) test_data: Data<P, S, C>,
    /// Amplitudes of the drives' dither, rad, if some did not stand that of the setting.
    weaker_dithers: Vec<f64>,
    /// Those of the second round's drives, seed by seed; 0 where each amplitude lost the vehicle.
    again_dithers: Vec<f64>,
    /// The step that delay models are identified from.
    pub(super) step: Option<SteeringStep>,
    /// Responses to a step of the command, for the evaluation of learned models.
    pub(super) responses: Vec<RecordedResponse<S>>,
    /// Learned models of the rows, for each seed: some rows share one, and all are asked for it again.
    pub(super) learned: Mutex<Vec<LearnedModels<P, S, C>>>,
}

impl<'a, P: Compared<S, C>, const S: usize, const C: usize> ComparisonFor<'a, P, S, C> {
    /// Collects the drives to learn from.
    ///
    /// # Errors
    /// The vehicle is lost; parameters out of range.
    pub fn collect(
        vehicle: &'a P::Parameters,
        plant: &'a TestPlant,
        noise: Option<SensorNoise>,
        roads: &'a Roads,
        effort: Effort,
    ) -> Result<Self, CompareError> {
        let mut comparison = Self {
            vehicle,
            plant,
            noise,
            roads,
            effort,
            data: Vec::new(),
            test_data: Vec::new(),
            weaker_dithers: Vec::new(),
            again_dithers: Vec::new(),
            step: None,
            responses: Vec::new(),
            learned: Mutex::default(),
        };
        let parameters = P::controller_of_the_papers(vehicle);
        if P::SETTING.rows.iter().any(|row| row.predictor.delay_model().is_some()) {
            let sample_time = parameters.mpc.sample_time;
            comparison.step = Some(SteeringStep::record::<P, S, C>(vehicle, plant, sample_time)?);
        }
        let rows = (P::SETTING.window, P::SETTING.horizon.unwrap_or(SHORT_HORIZON));
        for &speed in P::SETTING.step_speeds {
            let sample_time = parameters.mpc.sample_time;
            comparison.responses.push(RecordedResponse::record::<P, C>(
                vehicle,
                plant,
                sample_time,
                speed,
                rows,
            )?);
        }
        let Effort { seeds, drives, threads, .. } = comparison.effort;
        let logs = parallel::map(parallel::threads(threads), seeds * (drives + 1), |i| {
            // The last of each seed's drives is one of the test route, to measure predictions on.
            let to_learn = i % (drives + 1) < drives;
            let path = if to_learn { &comparison.roads.train } else { &comparison.roads.test };
            let (weights, dither) = (P::SETTING.calm, P::SETTING.dither);
            let driven =
                comparison.drive_to_learn_from(path, i, PredictionModelFor::Nominal, weights, dither)?;
            driven.ok_or_else(|| CompareError::Lost { vehicle: P::KIND, plant: plant.name.to_string() })
        });
        let config = parameters.data_config();
        let nominal = parameters.vehicle.nominal();
        let (logs, dithers): (Vec<_>, Vec<_>) =
            logs.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
        if dithers.iter().any(|&dither| dither != P::SETTING.dither) {
            comparison.weaker_dithers = dithers;
        }
        for seed in logs.chunks(drives + 1) {
            let logs: Vec<_> = seed.iter().map(DriveFor::to_learn_from).collect();
            comparison.data.push(DataSet::new(&logs[..drives], &nominal, config)?);
            comparison.test_data.push(DataSet::new(&logs[drives..], &nominal, config)?);
        }
        if let Some(again) = P::SETTING.again {
            let further = comparison.collect_again(again)?;
            for ((first, further), data) in logs.chunks(drives + 1).zip(&further).zip(&mut comparison.data) {
                let all: Vec<_> =
                    first[..drives].iter().chain(further).map(DriveFor::to_learn_from).collect();
                *data = DataSet::new(&all, &nominal, config)?;
            }
        }
        Ok(comparison)
    }

    /// The second round: for each seed drives of the training route by an MPC with one linear model, learned from the first.
    /// If that one loses the vehicle at each amplitude of the dither there are none, and the first round must do.
    fn collect_again(&mut self, again: Again) -> Result<Vec<Vec<DriveFor<C>>>, CompareError> {
        let Effort { seeds, drives, threads, .. } = self.effort;
        let this = &*self;
        let driven = parallel::map(parallel::threads(threads), seeds * drives, |i| {
            let (model, _) = this.model(Predictor::Linear, i / drives)?;
            let number = seeds * (drives + 1) + i;
            this.drive_to_learn_from(&this.roads.train, number, model, again.weights, again.dither)
        });
        let driven = driven.into_iter().collect::<Result<Vec<_>, CompareError>>()?;
        self.again_dithers = driven.iter().map(|drive| drive.as_ref().map_or(0.0, |drive| drive.1)).collect();
        // What was learned from the first round alone is not what the row has.
        self.learned.get_mut().unwrap_or_else(PoisonError::into_inner).clear();
        let mut driven = driven.into_iter();
        Ok((0..seeds)
            .map(|_| driven.by_ref().take(drives).flatten().map(|drive| drive.0).collect())
            .collect())
    }

    /// A drive with the dither that it stands: half as much each time that the vehicle is lost; none if it never stands.
    fn drive_to_learn_from(
        &self,
        path: &Arc<Path>,
        number: usize,
        model: PredictionModelFor<NominalOf<P, S, C>, S>,
        weights: CostWeights,
        mut dither: f64,
    ) -> Result<Option<(DriveFor<C>, f64)>, CompareError> {
        for _ in 0..DITHERS {
            let trial = TrialFor {
                dither: Some((dither, 1 + number)),
                noise: self.noise.map(|noise| (noise, 1000 + number as u64)),
                ..self.trial(path, model.clone(), weights, 0)
            };
            let drive = trial.drive()?;
            if !drive.lost {
                return Ok(Some((drive, dither)));
            }
            dither *= 0.5;
        }
        Ok(None)
    }

    pub(super) fn trial(
        &self,
        path: &Arc<Path>,
        model: PredictionModelFor<NominalOf<P, S, C>, S>,
        weights: CostWeights,
        seed: u64,
    ) -> TrialFor<'a, P, S, C> {
        TrialFor {
            vehicle: self.vehicle,
            plant: self.plant,
            path: path.clone(),
            model,
            weights,
            noise: self.noise.map(|noise| (noise, seed)),
            give_up: LOST,
            dither: None,
        }
    }

    /// Compares the rows. The nominal MPC is the first, even if not asked for. If its best weights are `known`, it is
    /// left out. `progress` is called from the threads that work.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn run(
        &self,
        rows: &[TableRow],
        known: Option<CostWeights>,
        progress: &(dyn Fn(&str) + Sync),
    ) -> Result<Condition, CompareError> {
        self.run_keeping(rows, known, progress, &|_| ())
    }

    /// As [`Self::run`]; after each row `keep` is given what there is, in any order, by one thread at a time.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn run_keeping(
        &self,
        rows: &[TableRow],
        known: Option<CostWeights>,
        progress: &(dyn Fn(&str) + Sync),
        keep: &(dyn Fn(&Condition) + Sync),
    ) -> Result<Condition, CompareError> {
        let threads = parallel::threads(self.effort.threads);
        let (others, left_out): (Vec<TableRow>, Vec<TableRow>) =
            rows.iter().copied().filter(|row| *row != TableRow::NOMINAL).partition(|row| self.has(*row));
        let mut condition = self.condition(&left_out)?;
        let measure = if let Some(weights) = known {
            (weights, self.pieces(&[PredictionModelFor::Nominal], &weights, threads)?.1)
        } else {
            let (nominal, roughness) = self.row(TableRow::NOMINAL, None, threads, progress)?;
            let measure = (nominal.weights, roughness);
            condition.rows.push(nominal);
            keep(&condition);
            measure
        };
        // Rows side by side, the slowest, at the tables' ends, first; each on one thread unless there are more than rows.
        let within = (threads / others.len().max(1)).max(1);
        let kept = Mutex::new(condition);
        let done = parallel::map(threads, others.len(), |i| {
            let (result, _) = self.row(others[others.len() - 1 - i], Some(measure), within, progress)?;
            let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
            kept.rows.push(result);
            keep(&kept);
            Ok::<_, CompareError>(())
        });
        done.into_iter().collect::<Result<(), _>>()?;
        let mut condition = kept.into_inner().unwrap_or_else(PoisonError::into_inner);
        let place = |result: &RowResult| others.iter().position(|row| row.name() == result.row);
        condition.rows.sort_by_key(place);
        Ok(condition)
    }

    /// All but the rows.
    fn condition(&self, left_out: &[TableRow]) -> Result<Condition, CompareError> {
        let further = P::controller_of_the_papers(self.vehicle).vehicle.further_states();
        Ok(Condition {
            plant: self.plant.name.to_string(),
            noise: self.noise.is_some(),
            vehicle: self.vehicle.name().to_owned(),
            vehicle_digest: vehicle_digest(self.vehicle),
            effort: self.effort.clone(),
            rows: vec![],
            left_out: left_out.iter().map(|row| row.name()).collect(),
            weaker_dithers: self.weaker_dithers.clone(),
            again_dithers: self.again_dithers.clone(),
            articulation_bound: further.first().and_then(|state| state.bound).map(|bound| bound.max),
            step: self.step.clone(),
            identified: self.identified()?,
        })
    }

    /// One row, measured by the nominal MPC's weights and roughness, or by its own if there are none. The row's
    /// roughness on the pieces comes beside it.
    fn row(
        &self,
        row: TableRow,
        nominal: Option<(CostWeights, f64)>,
        threads: usize,
        progress: &dyn Fn(&str),
    ) -> Result<(RowResult, f64), CompareError> {
        let name = row.name();
        progress(&format!("{name}: learning"));
        let learns = row.predictor.learns();
        let seeds = if learns || self.noise.is_some() { self.effort.seeds } else { 1 };
        let learned = if learns { seeds } else { 1 };
        let (models, fits): (Vec<_>, Vec<_>) = (0..learned)
            .map(|seed| self.model(row.predictor, seed))
            .collect::<Result<Vec<_>, _>>()?
            .into_iter()
            .unzip();
        progress(&format!("{name}: tuning"));
        let limit = nominal.map_or(f64::INFINITY, |(_, roughest)| P::SETTING.roughness * roughest);
        let known = nominal.map(|(weights, _)| weights);
        let found = search(&P::SETTING.space, self.effort.budget, 1, row.observes, known, |weights| {
            self.score(&models, weights, limit, threads).unwrap_or(f64::INFINITY)
        });
        // Not always the candidate with the least score: see `validate`.
        let own = self.validate(&models, &found)?;
        let frozen = known.unwrap_or(own);
        progress(&format!("{name}: driving"));
        let observing = |weights: CostWeights| CostWeights {
            disturbance_noise: own.disturbance_noise,
            prediction_noise: own.prediction_noise,
            ..weights
        };
        let default = self.default_weights();
        let drive = |path: &Arc<Path>, weights: CostWeights, seed: usize| {
            let model = models[seed.min(learned - 1)].clone();
            let drive = self.trial(path, model, weights, 1 + seed as u64).drive()?;
            Ok::<_, TrialError>(DriveMetrics::from(&drive))
        };
        let protocols = [own, observing(frozen), observing(default)];
        let outcomes = parallel::map(threads, protocols.len() * seeds, |i| {
            drive(&self.roads.test, protocols[i / seeds], i % seeds)
        });
        let mut own_best = outcomes.into_iter().collect::<Result<Vec<_>, _>>()?;
        let mut frozen = own_best.split_off(seeds);
        let default = frozen.split_off(seeds);
        let further = self.roads.further.iter().map(|(route, path)| {
            let outcomes = parallel::map(threads, seeds, |seed| drive(path, own, seed));
            Ok((route.name(), outcomes.into_iter().collect::<Result<_, TrialError>>()?))
        });
        let further = further.collect::<Result<_, TrialError>>()?;
        let roughness = self.pieces(&models, &own, threads)?.1;
        let result = RowResult {
            row: name,
            weights: own,
            score: found.score_of(&own),
            tried: found.tried,
            own_best,
            frozen,
            default,
            fit: fits.into_iter().flatten().collect(),
            time: None,
            further,
        };
        Ok((result, roughness))
    }

    /// The weights that users get.
    pub(super) fn default_weights(&self) -> CostWeights {
        CostWeights::of(&P::controller_of_the_papers(self.vehicle).mpc)
    }

    /// Times the control steps of a row at its best on the test road, one drive at a time, and gives that drive.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn time(
        &self,
        row: TableRow,
        weights: &CostWeights,
    ) -> Result<(StepTimes, DriveFor<C>), CompareError> {
        let drive = self.drive(row, weights, &self.roads.test)?;
        Ok((drive.times(P::controller_of_the_papers(self.vehicle).mpc.sample_time), drive))
    }

    /// Drives a road with a row's first model.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn drive(
        &self,
        row: TableRow,
        weights: &CostWeights,
        path: &Arc<Path>,
    ) -> Result<DriveFor<C>, CompareError> {
        let (model, _) = self.model(row.predictor, 0)?;
        Ok(self.trial(path, model, *weights, 1).drive()?)
    }

    /// Drives the test road with a residual of one's own choice, for ablations.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn drive_with(
        &self,
        residual: Residual<NominalOf<P, S, C>, S>,
        weights: &CostWeights,
    ) -> Result<DriveMetrics, CompareError> {
        let model = PredictionModelFor::Residual(residual);
        Ok(DriveMetrics::from(&self.trial(&self.roads.test, model, *weights, 1).drive()?))
    }
}
