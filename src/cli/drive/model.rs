//! The prediction model of the controller, from the command line: a variant, and what was learned for it.

use super::super::files::Named;
use super::super::named;
use crate::control::{
    Choice, ControlVariant, ControlledParameters, ControllerParametersFor, PredictionModelFor, Propagation,
    RollOut,
};
use clap::Args;
use std::error::Error;
use std::path::{Path, PathBuf};

/// Prediction model of the controller: the same words as the FMU's.
#[derive(Debug, Clone, Args)]
pub(in crate::cli) struct ModelArgs {
    /// Prediction model of the controller; none with --residual: what the file is for
    #[arg(long, default_value = "adaptive", hide_possible_values = true, value_parser = named(ControlVariant::ALL, ControlVariant::name, ControlVariant::meaning))]
    variant: ControlVariant,
    /// Learned model to predict with (from rfl train) [default: VARIANT.rflm in --models]
    #[arg(long, value_name = "FILE")]
    residual: Option<PathBuf>,
    /// Folder with a learned model for each variant
    #[arg(long, value_name = "DIR", default_value = MODELS)]
    models: PathBuf,
    /// Add the residual without propagating it, as printed by Zhao et al., eq. (9)
    #[arg(long)]
    direct: bool,
}

/// Folder in which `rfl train` puts models and `rfl drive` looks for them.
pub(in crate::cli) const MODELS: &str = "out/residual";

/// A variant and its prediction model.
type Chosen<G, const S: usize> =
    (ControlVariant, PredictionModelFor<<G as ControlledParameters<S>>::Vehicle, S>);

impl ModelArgs {
    /// Takes a file's variant if the command line asks for none.
    pub fn prefer(&mut self, variant: Option<ControlVariant>) {
        if let (ControlVariant::None, None, Some(variant)) = (self.variant, &self.residual, variant) {
            self.variant = variant;
        }
    }

    /// The variant and its model for a controller with these parameters.
    pub fn choose<G: ControlledParameters<S>, const S: usize>(
        &self,
        parameters: &ControllerParametersFor<G>,
    ) -> Result<Chosen<G, S>, Box<dyn Error>> {
        let choice = Choice {
            variant: self.variant,
            file: self.residual.clone(),
            folder: self.models.clone(),
            propagation: if self.direct { Propagation::Direct } else { Propagation::Propagated },
            roll_out: RollOut::Corrected,
        };
        Ok(choice.prediction_model(parameters)?)
    }

    /// The files that a model is read from, with their options: the one that is named, or a folder.
    pub fn files(&self) -> Vec<Named<&Path>> {
        vec![match &self.residual {
            Some(file) => ("--residual", file),
            None => ("--models", &self.models),
        }]
    }
}
