//! Which variant of the MPC: from a user's word, parameters and files to what the controller predicts with.
//!
//! FMU and program ask here, so that both know the same words, look for models in the same way and say the same
//! when something is missing.

use super::condense::Propagation;
use super::parameters::ControllerParameters;
use super::variant::{PredictionModel, Residual, RollOut};
use crate::enumeration;
use crate::nominal::Actuator;
use crate::residual::{FileError, Kind, ResidualModel};
use std::path::PathBuf;
use std::sync::Arc;

enumeration! {
    /// The variants of the controller: what it predicts with.
    pub enum ControlVariant {
        None = 0 "none", "The nominal model alone; with a model file, what that file holds";
        Linear = 1 "linear", "With a learned residual: one linear model for all";
        Rt = 2 "rt", "With a learned residual: a tree with constant leaves";
        Rf = 3 "rf", "With a learned residual: a forest with constant leaves";
        Rtl = 4 "rtl", "With a learned residual: a tree with linear leaves";
        Rfl = 5 "rfl", "With a learned residual: a forest with linear leaves";
        RflS = 6 "rfl_s", "With a learned residual: a forest that splits on speed and road only, its leaves linear in commands and road";
        Actuator = 7 "actuator", "The nominal model behind a steering actuator with known dead time and lag (actuator.*)";
        Nmpc = 8 "nmpc", "Nonlinear MPC on a bicycle model";
        GpNmpc = 9 "gp_nmpc", "Nonlinear MPC with Gaussian processes for what its model misses";
    }
}

impl ControlVariant {
    /// The variant that predicts with a kind of residual.
    #[must_use]
    pub fn of_residual(kind: Kind) -> Self {
        // The numbers are the same.
        Self::from_number(kind as i32).unwrap_or_default()
    }

    /// The kind of residual that it predicts with, `none` among them; `None` for a variant without one.
    #[must_use]
    pub fn residual(self) -> Option<Kind> {
        Kind::from_number(self as i32)
    }
}

/// Extension of a model's file.
pub const MODEL_EXTENSION: &str = "rflm";

/// What a user chose.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The variant; `none` with a file: the variant that the file is for.
    pub variant: ControlVariant,
    /// The file of the learned model, if one was given.
    pub file: Option<PathBuf>,
    /// Where the models of variants lie otherwise, as `VARIANT.rflm`.
    pub folder: PathBuf,
    /// How a residual enters the prediction.
    pub propagation: Propagation,
    /// With what the states are predicted at which a residual is asked.
    pub roll_out: RollOut,
}

/// Why a variant cannot be had.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ChoiceError {
    #[error(
        "the variant {variant} needs a learned model, and there is none at {}. Make one with `rfl collect` and \
         `rfl train out/collect/*.csv --kind {variant}`; then give its file (parameter residual.file, option \
         --residual), or pack it into the FMU with `fmu-build --residual out/residual/{variant}.rflm`",
        file.display()
    )]
    NoModel { variant: &'static str, file: PathBuf },
    #[error(transparent)]
    File(#[from] FileError),
    #[error(
        "{} holds a model of kind {found}, and the variant is {variant}: choose the variant {found} (or none: then \
         the file decides), or a file of kind {variant}",
        file.display()
    )]
    OtherKind { file: PathBuf, found: &'static str, variant: &'static str },
    #[error(
        "the variant {variant} has no learned residual, but the file {} was given: leave the file out, or choose the \
         variant none (then the file decides)",
        file.display()
    )]
    FileNotUsed { variant: &'static str, file: PathBuf },
    #[error("the variant {variant} is not in this version; there are {}", available().join(", "))]
    NotBuiltIn { variant: &'static str },
}

/// Names of the variants that can be chosen.
fn available() -> Vec<&'static str> {
    let there =
        |variant: &&ControlVariant| variant.residual().is_some() || **variant == ControlVariant::Actuator;
    ControlVariant::ALL.iter().filter(there).map(|variant| variant.name()).collect()
}

impl Choice {
    /// What the controller predicts with, and the variant that this is.
    ///
    /// # Errors
    /// A model that is missing, damaged or of another kind; a variant that is not in this version.
    pub fn prediction_model(
        &self,
        parameters: &ControllerParameters,
    ) -> Result<(ControlVariant, PredictionModel), ChoiceError> {
        let variant = self.variant;
        match (variant.residual(), &self.file) {
            (Some(Kind::None), None) => Ok((variant, PredictionModel::Nominal)),
            (Some(_), Some(file)) => {
                let model = ResidualModel::read(file)?;
                let found = ControlVariant::of_residual(model.schema().kind);
                if variant != ControlVariant::None && variant != found {
                    let (found, variant) = (found.name(), variant.name());
                    return Err(ChoiceError::OtherKind { file: file.clone(), found, variant });
                }
                Ok((found, self.with_residual(model)))
            }
            (Some(_), None) => {
                let file = self.folder.join(variant.name()).with_extension(MODEL_EXTENSION);
                if !file.exists() {
                    return Err(ChoiceError::NoModel { variant: variant.name(), file });
                }
                Self { file: Some(file), ..self.clone() }.prediction_model(parameters)
            }
            (None, Some(file)) => {
                Err(ChoiceError::FileNotUsed { variant: variant.name(), file: file.clone() })
            }
            (None, None) if variant == ControlVariant::Actuator => {
                let actuator = &parameters.actuator;
                let (dead_time, time_constant) = (actuator.dead_time, actuator.time_constant);
                Ok((variant, PredictionModel::Actuator(Actuator { dead_time, time_constant })))
            }
            (None, None) => Err(ChoiceError::NotBuiltIn { variant: variant.name() }),
        }
    }

    fn with_residual(&self, model: ResidualModel) -> PredictionModel {
        let (propagation, roll_out) = (self.propagation, self.roll_out);
        PredictionModel::Residual(Residual { model: Arc::new(model), propagation, roll_out })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_have_the_same_numbers_and_names_as_variants() {
        for &kind in Kind::ALL {
            let variant = ControlVariant::of_residual(kind);
            assert_eq!((variant as i32, variant.name()), (kind as i32, kind.name()));
            assert_eq!(variant.residual(), Some(kind));
        }
        assert_eq!(ControlVariant::Actuator.residual(), None);
    }
}
