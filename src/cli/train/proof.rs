//! The proof in simulated closed loop: a model against the default controller, on plants that explain the logs.

use super::super::drive::MODELS;
use super::super::progress_bar;
use super::super::vehicle::{Commanded, VehicleLinearModel, vehicle_named};
use super::TrainArgs;
use crate::control::{
    Choice, ControlVariant, ControlledParameters, ControllerParametersFor, PredictionModelFor, Propagation,
    Residual, RollOut,
};
use crate::residual::{DataSet, ResidualModelFor, ShownActuator};
use crate::simulate::prove::{Contest, Exam, ExplainingPlants, NotBetter, PlantRange, explaining_plants};
use serde_json::{Value, json};
use std::error::Error;
use std::sync::Arc;

/// Proves models in closed loop.
pub(super) struct Prover<'a, P: Commanded<S, C>, const S: usize, const C: usize> {
    args: &'a TrainArgs,
    data: &'a DataSet<VehicleLinearModel<P, S, C>, S>,
    shown: ShownActuator,
    controller: ControllerParametersFor<P::Nominal>,
    vehicle: P::Parameters,
}

impl<'a, P, const S: usize, const C: usize> Prover<'a, P, S, C>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    pub fn new(
        args: &'a TrainArgs,
        data: &'a DataSet<VehicleLinearModel<P, S, C>, S>,
        shown: &ShownActuator,
        controller: ControllerParametersFor<P::Nominal>,
    ) -> Result<Self, Box<dyn Error>> {
        Ok(Self { args, data, shown: *shown, controller, vehicle: vehicle_named(&args.vehicle)? })
    }

    /// Drives with a model that leaves such shares of the states' one-step errors, and the verdict.
    pub fn prove(
        &self,
        model: &Arc<ResidualModelFor<VehicleLinearModel<P, S, C>, S>>,
        left: &[f64; S],
    ) -> Result<(Value, Result<(), NotBetter>), Box<dyn Error>> {
        let left = [left[1], left[3]];
        let (close, others) =
            (self.explaining(PlantRange::OF_THE_FILE)?, self.explaining(PlantRange::OF_THE_KIND)?);
        let plants = if close.misfit.explains(others.misfit.left) {
            close
        } else {
            say!(
                "proof: no plant close to the vehicle's file explains the logs; others of its kind are driven instead"
            );
            others
        };
        let (value, verdict) = self.drive(model, &plants)?;
        let verdict = verdict.map_err(|reason| match reason {
            // On a plant of another kind the model is worse for a reason that the vehicle does not have.
            NotBetter::Lost { .. } => reason,
            _ if plants.misfit.explains(left) => reason,
            _ => NotBetter::Unexplained { plants: plants.misfit, model: left },
        });
        Ok((value, verdict))
    }

    /// Plants of a range that explain the logs.
    fn explaining(&self, range: PlantRange) -> Result<ExplainingPlants<P, S, C>, Box<dyn Error>> {
        let nominal = self.controller.vehicle.nominal();
        let mass = P::mass(&nominal);
        let numbers = [self.args.tuning.seed, self.args.tuning.threads as u64];
        Ok(explaining_plants(self.data, &self.shown, &self.vehicle, range, mass, numbers)?)
    }

    /// Drives of plants without the model and with it, and the verdict.
    fn drive(
        &self,
        model: &Arc<ResidualModelFor<VehicleLinearModel<P, S, C>, S>>,
        plants: &ExplainingPlants<P, S, C>,
    ) -> Result<(Value, Result<(), NotBetter>), Box<dyn Error>> {
        let (args, controller) = (self.args, self.controller);
        let default = Choice {
            variant: ControlVariant::Adaptive,
            file: None,
            folder: MODELS.into(),
            propagation: Propagation::Propagated,
            roll_out: RollOut::Corrected,
        };
        let default = default.prediction_model(&controller)?.1;
        let contest = Contest { vehicle: self.vehicle.clone(), controller, default };
        let bar = progress_bar("default controller", 1.0, args.quiet);
        let (seed, threads) = (args.tuning.seed, args.tuning.threads);
        let mut exam = Exam::new(&contest, &plants.plants, seed, threads, &|| bar.step())?;
        bar.finish_and_clear();
        let bar = progress_bar("proving", exam.len() as f64, args.quiet);
        let residual = Residual {
            model: model.clone(),
            propagation: Propagation::Propagated,
            roll_out: RollOut::Corrected,
        };
        let proof = exam.prove(&PredictionModelFor::Residual(residual), &|| bar.step())?;
        bar.finish_and_clear();
        let [default, learned] = proof.figures();
        let change = proof.change();
        say!(
            "proof: {} drives on roads and plants that explain the logs: mean {:.2} mm, max {:.1} mm, lost {}; default controller \
             {:.2} mm, {:.1} mm, {}; change of the mean {change}",
            proof.drives.len(),
            1e3 * learned.mean,
            1e3 * learned.max,
            learned.lost,
            1e3 * default.mean,
            1e3 * default.max,
            default.lost
        );
        let value = json!({
            "default": default, "learned": learned, "change": change, "plants": plants.misfit, "drives": proof.drives,
        });
        Ok((value, proof.check()))
    }
}
