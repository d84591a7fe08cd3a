//! Prediction model of a row: learned from a seed's drives, identified from a recorded step, or known.

use super::compare::{CompareError, ComparisonFor};
use super::fit::steps_ahead;
use super::plant::{STEER_DELAY, STEER_LAG};
use super::result::RowFit;
use super::row::{Predictor, TableRow};
use super::step::Identified;
use super::vehicle::{Compared, NominalOf};
use crate::control::{
    ControlledVehicle, GpOf, NmpcParameters, Nonlinear, PredictionModelFor, Propagation, Residual, RollOut,
};
use crate::nominal::{Actuator, LateralVehicle};
use crate::residual::gp::GpConfig;
use crate::residual::{ResidualModelFor, TrainConfig, train};
use std::sync::{Arc, PoisonError};

/// Steps ahead for which predictions of every vehicle are measured.
pub const SHORT_HORIZON: usize = 16;

/// Prediction model of a row, and its quality.
pub(super) type RowModel<V, const S: usize> = (PredictionModelFor<V, S>, Option<RowFit>);

impl<P: Compared<S, C>, const S: usize, const C: usize> ComparisonFor<'_, P, S, C> {
    /// True if this vehicle can have a row: there may be no nonlinear model of it.
    #[must_use]
    pub fn has(&self, row: TableRow) -> bool {
        let nmpc = P::controller_of_the_papers(self.vehicle).nmpc;
        !row.predictor.is_nonlinear() || self.nonlinear(&nmpc, None).is_some()
    }

    fn nonlinear(
        &self,
        nmpc: &NmpcParameters,
        gp: Option<Arc<GpOf<NominalOf<P, S, C>, S>>>,
    ) -> Option<PredictionModelFor<NominalOf<P, S, C>, S>> {
        Nonlinear::of(nmpc, gp).map(PredictionModelFor::Nonlinear)
    }

    /// Training for a row on this plant, if anything is learned.
    #[must_use]
    pub fn training(&self, of: Predictor) -> Option<TrainConfig> {
        let mut config = of.training(P::SETTING.window)?;
        if self.noise.is_none() {
            config.prefilter = config.prefilter.min(P::SETTING.quiet_prefilter);
        }
        Some(config)
    }

    /// Trains a residual on a seed's drives.
    ///
    /// # Errors
    /// Too little data.
    pub fn train(
        &self,
        config: &TrainConfig,
        seed: usize,
    ) -> Result<ResidualModelFor<NominalOf<P, S, C>, S>, CompareError> {
        let config = TrainConfig { seed: seed as u64 + 1, threads: self.effort.threads, ..config.clone() };
        Ok(train(&self.data[seed], None, &config, &|_| ())?.model)
    }

    /// Prediction errors of a residual.
    #[must_use]
    pub fn fit(&self, model: &ResidualModelFor<NominalOf<P, S, C>, S>, seed: usize) -> RowFit {
        let test = &self.test_data[seed];
        RowFit {
            train: model.measure(&self.data[seed]).into(),
            test: model.measure(test).into(),
            test_16_steps: steps_ahead(model, test, SHORT_HORIZON),
            test_horizon: P::SETTING.horizon.map(|steps| steps_ahead(model, test, steps)),
            steps: self
                .responses
                .iter()
                .map(|response| (format!("step_at_{}", response.speed), response.predicted_by(model)))
                .collect(),
        }
    }

    /// Prediction model of a row, learned from a seed's drives; learned once.
    pub(super) fn model(
        &self,
        of: Predictor,
        seed: usize,
    ) -> Result<RowModel<NominalOf<P, S, C>, S>, CompareError> {
        let learned = || self.learned.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., model)) = learned().iter().find(|(known, with, _)| (*known, *with) == (of, seed)) {
            return Ok(model.clone());
        }
        let model = self.learn(of, seed)?;
        learned().push((of, seed, model.clone()));
        Ok(model)
    }

    fn learn(&self, of: Predictor, seed: usize) -> Result<RowModel<NominalOf<P, S, C>, S>, CompareError> {
        if let Some(config) = self.training(of) {
            let model = self.train(&config, seed)?;
            let fit = self.fit(&model, seed);
            return Ok((propagated(model), Some(fit)));
        }
        let model = match of {
            Predictor::Oracle => PredictionModelFor::Actuator(self.actuator()),
            Predictor::Nmpc | Predictor::GpNmpc => {
                let nmpc = P::controller_of_the_papers(self.vehicle).nmpc;
                let none = || CompareError::NoModel { row: of.name(), vehicle: NominalOf::<P, S, C>::KIND };
                let gp = match of {
                    Predictor::GpNmpc => Some(Arc::new(self.learn_gp(&nmpc, seed)?)),
                    _ => None,
                };
                self.nonlinear(&nmpc, gp).ok_or_else(none)?
            }
            _ => match (of.delay_model(), &self.step) {
                (Some(model), Some(step)) => PredictionModelFor::Actuator(step.identify(model)?.actuator),
                _ => PredictionModelFor::Nominal,
            },
        };
        Ok((model, None))
    }

    fn learn_gp(
        &self,
        nmpc: &NmpcParameters,
        seed: usize,
    ) -> Result<GpOf<NominalOf<P, S, C>, S>, CompareError> {
        let config = GpConfig {
            friction: nmpc.friction,
            points: P::SETTING.gp_points,
            seed: seed as u64 + 1,
            threads: self.effort.threads,
            ..GpConfig::default()
        };
        Ok(P::gp_of(&self.data[seed], &config)?)
    }

    /// The true steering actuator, which the oracle gets.
    #[must_use]
    pub fn actuator(&self) -> Actuator {
        let steering = P::steering(self.vehicle);
        Actuator {
            dead_time: steering.dead_time + self.plant.effect(STEER_DELAY),
            time_constant: steering.lag + self.plant.effect(STEER_LAG),
            ..Actuator::default()
        }
    }

    /// Identification from the recorded step for each delay model.
    pub(super) fn identified(&self) -> Result<Vec<Identified>, CompareError> {
        let Some(step) = &self.step else { return Ok(vec![]) };
        let models = Predictor::ALL.iter().filter_map(|of| Some((of.name(), of.delay_model()?)));
        let identified = models.map(|(row, model)| {
            let found = step.identify(model)?;
            let Actuator { dead_time, time_constant, .. } = found.actuator;
            Ok(Identified { row, dead_time, time_constant, rmse: found.rmse })
        });
        identified.collect()
    }
}

/// A residual with the default propagation.
fn propagated<V: ControlledVehicle<S>, const S: usize>(
    model: ResidualModelFor<V, S>,
) -> PredictionModelFor<V, S> {
    PredictionModelFor::Residual(Residual {
        model: Arc::new(model),
        propagation: Propagation::Propagated,
        roll_out: RollOut::Corrected,
    })
}
