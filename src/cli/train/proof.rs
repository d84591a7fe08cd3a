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
use crate::simulate::prove::{Contest, Exam, ExplainingPlants, NotBetter, PlantMisfit, explaining_plants};
use serde_json::{Value, json};
use std::error::Error;
use std::sync::{Arc, Mutex};

/// Proves models in closed loop.
pub(super) struct Prover<P: Commanded<S, C>, const S: usize, const C: usize> {
    exam: Mutex<Exam<P, S, C>>,
    misfit: PlantMisfit,
}

impl<P, const S: usize, const C: usize> Prover<P, S, C>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    pub fn new(
        args: &TrainArgs,
        data: &DataSet<VehicleLinearModel<P, S, C>, S>,
        shown: &ShownActuator,
        controller: ControllerParametersFor<P::Nominal>,
    ) -> Result<Self, Box<dyn Error>> {
        let vehicle: P::Parameters = vehicle_named(&args.vehicle)?;
        let nominal = controller.vehicle.nominal();
        let mass = P::mass(&nominal);
        let loaded = |stiffness, payload| P::loaded(nominal, stiffness, payload);
        let (seed, threads) = (args.tuning.seed, args.tuning.threads);
        let ExplainingPlants { plants, misfit } =
            explaining_plants::<P, S, C>(data, shown, &vehicle, mass, &loaded, [seed, threads as u64])?;
        let default = Choice {
            variant: ControlVariant::Adaptive,
            file: None,
            folder: MODELS.into(),
            propagation: Propagation::Propagated,
            roll_out: RollOut::Corrected,
        };
        let default = default.prediction_model(&controller)?.1;
        let contest = Contest { vehicle, controller, default };
        let bar = progress_bar("default controller", 1.0, args.quiet);
        let exam = Exam::new(&contest, &plants, seed, threads, &|| bar.step())?;
        bar.finish_and_clear();
        Ok(Self { exam: Mutex::new(exam), misfit })
    }

    /// Drives with a model that leaves such shares of the states' one-step errors, and the verdict.
    pub fn prove(
        &self,
        model: &Arc<ResidualModelFor<VehicleLinearModel<P, S, C>, S>>,
        left: &[f64; S],
        args: &TrainArgs,
    ) -> Result<(Value, Result<(), NotBetter>), Box<dyn Error>> {
        let mut exam = self.exam.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
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
        let left = [left[1], left[3]];
        // On a plant of another kind the model is worse for a reason that the vehicle does not have.
        let verdict = proof.check().map_err(|reason| match reason {
            NotBetter::Lost { .. } => reason,
            _ if self.misfit.explains(left) => reason,
            _ => NotBetter::Unexplained { plants: self.misfit, model: left },
        });
        let value = json!({
            "default": default, "learned": learned, "change": change, "plants": self.misfit, "drives": proof.drives,
        });
        Ok((value, verdict))
    }
}
