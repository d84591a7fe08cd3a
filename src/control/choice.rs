//! Variant of the MPC: from a user's word, parameters and files to the controller's prediction model.
//!
//! FMU and program share it, so that both know the same words, look for models in the same way and give the same
//! messages.

use super::condense::Propagation;
use super::parameters::ControllerParametersFor;
use super::variant::{PredictionModelFor, Residual, RollOut};
use super::vehicle::{ControlledParameters, ControlledVehicle, GpOf, Nonlinear};
use crate::enumeration;
use crate::input;
use crate::nominal::{ERRORS, LateralVehicle as _};
use crate::residual::{FileError, FileKind, Kind, ResidualModelFor, in_file};
use crate::vehicle::SingleTrack;
use std::path::{Path, PathBuf};
use std::sync::Arc;

enumeration! {
    /// The variants of the controller: its prediction models.
    pub enum ControlVariant {
        None = 0 "none", "The nominal model alone; with a model file, what that file holds";
        Linear = 1 "linear", "With a learned residual: one linear model for all";
        Rt = 2 "rt", "With a learned residual: a tree with constant leaves";
        Rf = 3 "rf", "With a learned residual: a forest with constant leaves";
        Rtl = 4 "rtl", "With a learned residual: a tree with linear leaves";
        Rfl = 5 "rfl", "With a learned residual: a forest with linear leaves";
        RflS = 6 "rfl_s", "With a learned residual: a forest that splits on speed and road only, its leaves linear in commands and road";
        Actuator = 7 "actuator", "The nominal model behind a steering actuator with known dead time and lag (actuator.*)";
        Nmpc = 8 "nmpc", "Nonlinear MPC on a single-track model with saturating tyres (nmpc.*)";
        GpNmpc = 9 "gp_nmpc", "Nonlinear MPC with a learned model: Gaussian processes for what the nonlinear model misses";
        Adaptive = 10 "adaptive", "The nominal model behind the steering actuator that the drive shows, to begin with that of actuator.*; with a model file, what that file holds";
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

    /// True if it needs a learned model.
    #[must_use]
    pub fn is_learned(self) -> bool {
        !matches!(self, Self::None | Self::Actuator | Self::Nmpc | Self::Adaptive)
    }
}

/// Extension of a model's file.
pub const MODEL_EXTENSION: &str = "rflm";

/// Choice of a user.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The variant; `none` with a file means the variant of the file.
    pub variant: ControlVariant,
    /// The file of the learned model, if one was given.
    pub file: Option<PathBuf>,
    /// Folder of the variants' models, as `VARIANT.rflm`, for those without a file of their own.
    pub folder: PathBuf,
    /// Propagation of a residual in the prediction.
    pub propagation: Propagation,
    /// Model of the predicted states at which a residual is asked.
    pub roll_out: RollOut,
}

/// Reasons for which a variant is not available.
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
        "the variant {variant} has no learned model, but the file {} was given: leave the file out, or choose the \
         variant none (then the file decides)",
        file.display()
    )]
    FileNotUsed { variant: &'static str, file: PathBuf },
    #[error(
        "the variant {variant} has a nonlinear model, and there is none of a {vehicle}: choose a variant with a linear \
         model"
    )]
    NoNonlinear { variant: &'static str, vehicle: &'static str },
}

/// A learned model of any kind for a car.
pub type LearnedModel = LearnedModelFor<SingleTrack, ERRORS>;

/// A learned model of any kind for a kind of vehicle with `S` states.
#[derive(Debug, Clone)]
pub enum LearnedModelFor<V: ControlledVehicle<S>, const S: usize> {
    /// Error of the linear model.
    Residual(Arc<ResidualModelFor<V, S>>),
    /// Error of the nonlinear model.
    Gp(Arc<GpOf<V, S>>),
}

impl<V: ControlledVehicle<S>, const S: usize> LearnedModelFor<V, S> {
    /// Reads a model's file.
    ///
    /// # Errors
    /// A file that cannot be read, or is no model.
    pub fn read(file: &Path) -> Result<Self, FileError> {
        in_file(file, || Self::from_bytes(&input::read(file, input::MODEL).map_err(FileError::Read)?))
    }

    /// A model from the bytes of its file.
    ///
    /// # Errors
    /// Bytes that are no model.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FileError> {
        match FileKind::of(bytes) {
            Some(FileKind::Gp) => Ok(Self::Gp(Arc::new(V::Nonlinear::gp_from_bytes(bytes)?))),
            // What is neither is refused in the words of the ordinary one.
            _ => Ok(Self::Residual(Arc::new(ResidualModelFor::from_bytes(bytes)?))),
        }
    }

    /// The variant that it is for.
    #[must_use]
    pub fn variant(&self) -> ControlVariant {
        match self {
            Self::Residual(model) => ControlVariant::of_residual(model.schema().kind),
            Self::Gp(_) => ControlVariant::GpNmpc,
        }
    }
}

impl Choice {
    /// The controller's prediction model, and its variant.
    ///
    /// # Errors
    /// A model that is missing, damaged or of another kind.
    pub fn prediction_model<G: ControlledParameters<S>, const S: usize>(
        &self,
        parameters: &ControllerParametersFor<G>,
    ) -> Result<(ControlVariant, PredictionModelFor<G::Vehicle, S>), ChoiceError> {
        let variant = self.variant;
        if matches!(variant, ControlVariant::Nmpc | ControlVariant::GpNmpc) {
            // A vehicle without a nonlinear model needs no file for one.
            nonlinear(variant, parameters, None)?;
        }
        let file = match &self.file {
            Some(file) => file.clone(),
            None if variant.is_learned() => self.packed()?,
            None => {
                let model = match variant {
                    ControlVariant::Actuator => PredictionModelFor::Actuator(parameters.actuator.actuator()),
                    ControlVariant::Adaptive => PredictionModelFor::Adaptive(parameters.actuator.actuator()),
                    ControlVariant::Nmpc => nonlinear(variant, parameters, None)?,
                    _ => PredictionModelFor::Nominal,
                };
                return Ok((variant, model));
            }
        };
        self.learned(file, parameters, LearnedModelFor::read)
    }

    /// The prediction model with a learned model that is given as the bytes of its file, checked as a file is. Messages
    /// name it as `name`.
    ///
    /// # Errors
    /// As [`prediction_model`](Self::prediction_model).
    pub fn prediction_model_of<G: ControlledParameters<S>, const S: usize>(
        &self,
        name: &str,
        bytes: &[u8],
        parameters: &ControllerParametersFor<G>,
    ) -> Result<(ControlVariant, PredictionModelFor<G::Vehicle, S>), ChoiceError> {
        let read = |name: &Path| in_file(name, || LearnedModelFor::from_bytes(bytes));
        self.learned(PathBuf::from(name), parameters, read)
    }

    /// The prediction model with what `read` makes of a file.
    fn learned<G: ControlledParameters<S>, const S: usize>(
        &self,
        file: PathBuf,
        parameters: &ControllerParametersFor<G>,
        read: impl FnOnce(&Path) -> Result<LearnedModelFor<G::Vehicle, S>, FileError>,
    ) -> Result<(ControlVariant, PredictionModelFor<G::Vehicle, S>), ChoiceError> {
        let variant = self.variant;
        if matches!(variant, ControlVariant::Actuator | ControlVariant::Nmpc) {
            return Err(ChoiceError::FileNotUsed { variant: variant.name(), file });
        }
        let model = read(&file)?;
        let found = model.variant();
        if !matches!(variant, ControlVariant::None | ControlVariant::Adaptive) && variant != found {
            return Err(ChoiceError::OtherKind { file, found: found.name(), variant: variant.name() });
        }
        let (propagation, roll_out) = (self.propagation, self.roll_out);
        let model = match model {
            LearnedModelFor::Residual(model) => {
                PredictionModelFor::Residual(Residual { model, propagation, roll_out })
            }
            LearnedModelFor::Gp(model) => nonlinear(found, parameters, Some(model))?,
        };
        Ok((found, model))
    }

    /// The file of the variant's model in the folder.
    fn packed(&self) -> Result<PathBuf, ChoiceError> {
        let variant = self.variant.name();
        let file = self.folder.join(variant).with_extension(MODEL_EXTENSION);
        if file.exists() { Ok(file) } else { Err(ChoiceError::NoModel { variant, file }) }
    }
}

fn nonlinear<G: ControlledParameters<S>, const S: usize>(
    variant: ControlVariant,
    parameters: &ControllerParametersFor<G>,
    gp: Option<Arc<GpOf<G::Vehicle, S>>>,
) -> Result<PredictionModelFor<G::Vehicle, S>, ChoiceError> {
    let model = Nonlinear::of(&parameters.nmpc, gp).map(PredictionModelFor::Nonlinear);
    model.ok_or(ChoiceError::NoNonlinear { variant: variant.name(), vehicle: G::Vehicle::KIND })
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
