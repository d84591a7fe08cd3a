//! Linear lateral models in errors to a path, whatever the vehicle.
//!
//! ```text
//! x' = A x + B u + D psi_des' + E psi_des''       x = [e1, e1', e2, e2', ..]
//! ```
//!
//! with the steering angle as `u` and the road's heading rate `psi_des' = v kappa` and heading acceleration as known
//! disturbances. A car has these four states; a vehicle with a trailer has more behind them. Learning and control know
//! a vehicle by [`LateralVehicle`] alone: they are written once, for any number of states `S`.

use super::zero_order_hold;
use crate::signal::Signal;
use nalgebra::{SMatrix, SVector, Vector4};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Errors of the CG to the path, `[e1 m, e1' m/s, e2 rad, e2' rad/s]`: the state of a car, and the first states of every
/// vehicle.
pub type ErrorState = Vector4<f64>;

/// Number of the errors to the path.
pub const ERRORS: usize = 4;

/// Reasons for which a nominal model cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SingleTrackError {
    /// A parameter that must be positive is not.
    #[error("{name} = {value} must be a positive number; check the vehicle file")]
    NotPositive {
        /// The parameter's name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A parameter that may have either sign is no number.
    #[error("{name} = {value} must be a finite number; check the vehicle file")]
    NotFinite {
        /// The parameter's name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

/// A vehicle by the parameters of its linear model with `S` states.
pub trait LateralVehicle<const S: usize>:
    std::fmt::Debug + Copy + PartialEq + Send + Sync + Serialize + DeserializeOwned + 'static
{
    /// Name of such a vehicle in files and messages, e.g. `car`.
    const KIND: &'static str;
    /// The states in order: the four errors to the path, then the vehicle's own.
    const STATES: [Signal; S];

    /// The model at a speed in m/s. It is stiff as the speed goes to 0: the caller clamps it from below.
    ///
    /// # Errors
    /// A parameter or a speed that is not positive.
    fn model_at(&self, speed: f64) -> Result<ContinuousErrorModel<S>, SingleTrackError>;

    /// The state of steady cornering with no lateral error, for each 1/m of curvature.
    fn steady_state(&self, speed: f64) -> SVector<f64, S>;

    /// Steering angle of steady cornering for each 1/m of curvature, rad m: the wheelbase, and understeer by the speed squared.
    fn steady_steer(&self, speed: f64) -> f64;

    /// The parameters with their names, in the order of the vehicle's hash in files.
    fn parameters(&self) -> Vec<(&'static str, f64)>;

    /// The vehicle with the cornering stiffness of one axle off by a share, axle by axle. None where nothing is known of it.
    fn stiffness_off(&self, _share: f64) -> Vec<Self> {
        Vec::new()
    }

    /// The vehicle with one yaw inertia off by a share, body by body. None where nothing is known of it.
    fn inertia_off(&self, _share: f64) -> Vec<Self> {
        Vec::new()
    }

    /// Distance between the axles that steering turns the vehicle about, m.
    fn wheelbase(&self) -> f64 {
        self.steady_steer(0.0)
    }
}

/// `x' = A x + B u + D psi_des' + E psi_des''` at one speed.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub struct ContinuousErrorModel<const S: usize = ERRORS> {
    pub a: SMatrix<f64, S, S>,
    pub b: SVector<f64, S>,
    pub d: SVector<f64, S>,
    pub e: SVector<f64, S>,
}

/// `x_{k+1} = A x_k + B u_k + D psi_des' + E psi_des''` over one sample at one speed.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub struct DiscreteErrorModel<const S: usize = ERRORS> {
    pub a: SMatrix<f64, S, S>,
    pub b: SVector<f64, S>,
    pub d: SVector<f64, S>,
    pub e: SVector<f64, S>,
}

impl<const S: usize> ContinuousErrorModel<S> {
    /// The model of a vehicle at speed `v` in m/s: [`LateralVehicle::model_at`].
    ///
    /// # Errors
    /// A parameter or a speed that is not positive.
    pub fn new(vehicle: &impl LateralVehicle<S>, v: f64) -> Result<Self, SingleTrackError> {
        vehicle.model_at(v)
    }

    /// Steering that holds the vehicle straight against accelerations of its rates `d`, rad: `0 = A x + B u + d` with `e1 = 0`.
    /// Zero where none does.
    #[must_use]
    pub fn steady_steer_against(&self, accelerations: &SVector<f64, S>) -> f64 {
        // e1 has no effect: the steering takes its column. Every second state is the rate of the one before it.
        let mut of_unknowns = self.a;
        of_unknowns.set_column(0, &self.b);
        let of_rates = SVector::from_fn(|i, _| if i % 2 == 1 { -accelerations[i] } else { 0.0 });
        let steady = of_unknowns.try_inverse().map(|inverse| inverse * of_rates);
        steady.map(|unknowns| unknowns[0]).filter(|steer| steer.is_finite()).unwrap_or(0.0)
    }

    /// Exact discretisation over `sample_time` seconds with inputs held.
    #[must_use]
    pub fn discretise(&self, sample_time: f64) -> DiscreteErrorModel<S> {
        let inputs = SMatrix::<f64, S, 3>::from_columns(&[self.b, self.d, self.e]);
        let (a, inputs) = zero_order_hold(&self.a, &inputs, sample_time);
        DiscreteErrorModel {
            a,
            b: inputs.column(0).into_owned(),
            d: inputs.column(1).into_owned(),
            e: inputs.column(2).into_owned(),
        }
    }
}

impl<const S: usize> DiscreteErrorModel<S> {
    /// One step ahead.
    #[must_use]
    pub fn step(
        &self,
        x: &SVector<f64, S>,
        steer: f64,
        heading_rate: f64,
        heading_accel: f64,
    ) -> SVector<f64, S> {
        self.a * x + self.b * steer + self.d * heading_rate + self.e * heading_accel
    }
}
