//! The check that a learned model fits a controller.

use crate::nominal::LateralVehicle;
use crate::vehicle::SingleTrack;

/// Relative difference of parameters that still counts as rounding of a file.
const SAME: f64 = 1e-9;

/// True if two parameters are the same but for rounding.
pub(super) fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * a.abs().max(b.abs())
}

/// Expectations of a controller for a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected<V = SingleTrack> {
    /// The controller's nominal vehicle.
    pub vehicle: V,
    /// Its sample time, s.
    pub sample_time: f64,
    /// The speed below which it holds its prediction model, m/s.
    pub min_model_speed: f64,
    /// Its window, if it cannot take the model's.
    pub window: Option<usize>,
}

impl<V> Expected<V> {
    /// Compares with the controller that a model was learned for, except for the window.
    pub(super) fn check<const S: usize>(
        &self,
        vehicle: &V,
        sample_time: f64,
        min_model_speed: f64,
    ) -> Result<(), ModelMismatch>
    where
        V: LateralVehicle<S>,
    {
        for ((parameter, model), (_, controller)) in
            vehicle.parameters().into_iter().zip(self.vehicle.parameters())
        {
            if !same(model, controller) {
                return Err(ModelMismatch::Vehicle { parameter, model, controller });
            }
        }
        let (model, controller) = (sample_time, self.sample_time);
        if !same(model, controller) {
            return Err(ModelMismatch::SampleTime { model, controller });
        }
        let (model, controller) = (min_model_speed, self.min_model_speed);
        if !same(model, controller) {
            return Err(ModelMismatch::MinModelSpeed { model, controller });
        }
        Ok(())
    }
}

/// Reasons for which a model does not fit a controller.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelMismatch {
    /// Learned for another vehicle.
    #[error(
        "the residual was learned for a nominal vehicle with {parameter} = {model}, the controller has {controller}; train on this vehicle's parameters, or load its model"
    )]
    Vehicle {
        /// The parameter that differs.
        parameter: &'static str,
        /// The model's value.
        model: f64,
        /// The controller's value.
        controller: f64,
    },
    /// Learned for another sample time.
    #[error(
        "the residual was learned for a sample time of {model} s, the controller steps every {controller} s; its commands would mean other times"
    )]
    SampleTime {
        /// The model's, s.
        model: f64,
        /// The controller's, s.
        controller: f64,
    },
    /// Labels and predictions hold the model at different speeds.
    #[error(
        "the residual was learned with the nominal model held below {model} m/s, the controller holds it below {controller} m/s; set mpc.min_model_speed to {model}"
    )]
    MinModelSpeed {
        /// The model's, m/s.
        model: f64,
        /// The controller's, m/s.
        controller: f64,
    },
    /// Learned against a nominal model on another road.
    #[error(
        "the residual was learned for a nominal friction of {model}, the controller's bicycle model has {controller}; set it to {model}, or train anew"
    )]
    Friction {
        /// The model's.
        model: f64,
        /// The controller's.
        controller: f64,
    },
    /// The windows differ.
    #[error("the residual needs a window of {model} commands, the controller keeps {controller}")]
    Window {
        /// The model's, steps.
        model: usize,
        /// The controller's, steps.
        controller: usize,
    },
}
