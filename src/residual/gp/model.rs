//! The learned process of the controller.
//!
//! At each step of the horizon the nonlinear controller predicts with
//!
//! ```text
//! [vy, r, ..]_{k+1} = model([vy, r, ..]_k, vx_k, steer_k, Ts) + mean(vx, vy, r, .., steer, accel)_k
//! ```
//!
//! and asks for the mean and its derivatives by the inputs. Nothing is allocated. Far from all data the mean is zero:
//! the nominal model.

use super::sparse::Sparse;
use super::{GP_OUTPUTS, INPUTS, TRUCK_GP_OUTPUTS, TRUCK_INPUTS};
use crate::nominal::LateralVehicle;
use crate::residual::fits::{Expected, ModelMismatch, same};
use crate::residual::schema::Range;
use crate::vehicle::{Articulated, SingleTrack};
use serde::{Deserialize, Serialize};

/// Learned model of one output: the readable part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GpOutput {
    /// The signal's name.
    pub name: String,
    /// Its unit, and that of `signal` and `noise`.
    pub unit: String,
    /// Length scale of each input, in the input's unit.
    pub length_scales: Vec<f64>,
    /// Standard deviation of the residual.
    pub signal: f64,
    /// Standard deviation of the noise on labels.
    pub noise: f64,
    /// Points of the dictionary.
    pub points: usize,
    /// Logarithm of the likelihood of the samples that the hyperparameters were fitted on.
    pub log_likelihood: f64,
}

/// From what a process was learned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GpTraining {
    /// Identifies the drives' values.
    pub data_hash: String,
    /// Samples learned from.
    pub samples: usize,
    /// Samples that the hyperparameters were fitted on.
    pub hyperparameter_samples: usize,
    /// Rows on each side over which recorded states were smoothed.
    pub smoothing: usize,
    /// The seed.
    pub seed: u64,
}

/// Description of a process, apart from its numbers: the readable head of its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GpSchema<V = SingleTrack> {
    /// Time between control steps, s.
    pub sample_time: f64,
    /// Speed below which the nominal model was held, m/s.
    pub min_model_speed: f64,
    /// Friction coefficient of the nonlinear nominal model.
    pub friction: f64,
    /// The vehicle of the nonlinear nominal model.
    pub vehicle: V,
    /// From what the process was learned.
    pub training: GpTraining,
    /// Ranges of the inputs in training.
    pub inputs: Vec<Range>,
    /// Learned model of each output.
    pub outputs: Vec<GpOutput>,
}

/// Error of the nominal model over one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpResidual<const D: usize = INPUTS, const O: usize = GP_OUTPUTS> {
    /// Of vy, m/s, and yaw rate, rad/s, and the other outputs of the vehicle's process.
    pub mean: [f64; O],
    /// Derivatives of each by the inputs.
    pub gradient: [[f64; D]; O],
}

/// A process learned of a car: inputs `[vx, vy, yaw_rate, steer_cmd, accel]`, outputs `[vy, yaw_rate]`.
pub type GpModel = GpModelFor<SingleTrack, INPUTS, GP_OUTPUTS>;

/// A process learned of a truck: inputs `[vx, vy, yaw_rate, articulation, articulation_rate, steer_cmd, accel]`, outputs
/// `[vy, yaw_rate, articulation_rate]`.
pub type TruckGpModel = GpModelFor<Articulated, TRUCK_INPUTS, TRUCK_GP_OUTPUTS>;

/// A learned Gaussian process with `D` inputs and `O` outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct GpModelFor<V, const D: usize, const O: usize> {
    pub(super) schema: GpSchema<V>,
    /// `O` of them.
    pub(super) outputs: Vec<Sparse<D>>,
}

impl<V, const D: usize, const O: usize> GpModelFor<V, D, O> {
    /// Description of the process.
    #[must_use]
    pub fn schema(&self) -> &GpSchema<V> {
        &self.schema
    }

    /// The process of each output.
    #[must_use]
    pub fn outputs(&self) -> &[Sparse<D>] {
        &self.outputs
    }

    /// The residual at vx, m/s, vy, m/s, yaw rate, rad/s, the body's further states, steering command, rad, longitudinal
    /// acceleration, m/s2.
    #[must_use]
    pub fn residual(&self, input: &[f64; D]) -> GpResidual<D, O> {
        let found: [(f64, [f64; D]); O] = std::array::from_fn(|o| self.outputs[o].mean(input));
        GpResidual { mean: found.map(|(mean, _)| mean), gradient: found.map(|(_, gradient)| gradient) }
    }

    /// Variance of each noise-free residual. `room` is made once, as an empty vector; it grows at the first call.
    pub fn variance(&self, input: &[f64; D], room: &mut Vec<f64>) -> [f64; O] {
        std::array::from_fn(|o| self.outputs[o].variance(input, room))
    }

    /// Distance of the worst input from its range in training, in widths of that range; 0 inside.
    #[must_use]
    pub fn excess(&self, input: &[f64; D]) -> f64 {
        self.schema.inputs.iter().zip(input).map(|(range, &x)| range.excess(x)).fold(0.0, f64::max)
    }

    /// Checks that the process was learned for such a controller, whose nonlinear model has this friction coefficient.
    /// A window does not matter: there is none.
    ///
    /// # Errors
    /// The first difference that matters.
    pub fn check_fits<const S: usize>(
        &self,
        expected: &Expected<V>,
        friction: f64,
    ) -> Result<(), ModelMismatch>
    where
        V: LateralVehicle<S>,
    {
        let GpSchema { vehicle, sample_time, min_model_speed, friction: model, .. } = &self.schema;
        let model = *model;
        expected.check(vehicle, *sample_time, *min_model_speed)?;
        if !same(model, friction) {
            return Err(ModelMismatch::Friction { model, controller: friction });
        }
        Ok(())
    }
}
