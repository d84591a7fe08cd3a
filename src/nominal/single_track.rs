//! The car's nominal model: linear single track in errors to the path.
//!
//! State `x = [e1, e1', e2, e2']`, input `u = steer`, disturbances `psi_des' = v kappa` and
//! `psi_des'' = v^2 kappa'` (`kappa'` along the path), axle cornering stiffnesses `cf`, `cr`:
//!
//! ```text
//! A = [0 1 0 0;  0 -(cf+cr)/(m v) (cf+cr)/m (cr lr - cf lf)/(m v);
//!      0 0 0 1;  0 (cr lr - cf lf)/(Iz v) (cf lf - cr lr)/Iz -(cf lf^2 + cr lr^2)/(Iz v)]
//! B = [0; cf/m; 0; cf lf/Iz]
//! D = [0; (cr lr - cf lf)/(m v) - v; 0; -(cf lf^2 + cr lr^2)/(Iz v)]    E = [0; 0; 0; -1]
//! ```
//!
//! Source: Rajamani, Vehicle Dynamics and Control, ch. 2.5; Zhao et al., ITSC 2024, eq. (2).

use super::zero_order_hold;
use crate::vehicle::SingleTrack;
use nalgebra::{Matrix4, SMatrix, SVector, Vector4};

/// `[e1 m, e1' m/s, e2 rad, e2' rad/s]`.
pub type ErrorState = Vector4<f64>;

/// Why a single-track model cannot be made.
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

/// `x' = A x + B u + D psi_des' + E psi_des''` at one speed, of a vehicle with `S` states: the car's, unless said.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub struct ContinuousErrorModel<const S: usize = 4> {
    pub a: SMatrix<f64, S, S>,
    pub b: SVector<f64, S>,
    pub d: SVector<f64, S>,
    pub e: SVector<f64, S>,
}

/// `x_{k+1} = A x_k + B u_k + D psi_des' + E psi_des''` over one sample at one speed.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub struct DiscreteErrorModel<const S: usize = 4> {
    pub a: SMatrix<f64, S, S>,
    pub b: SVector<f64, S>,
    pub d: SVector<f64, S>,
    pub e: SVector<f64, S>,
}

impl ContinuousErrorModel {
    /// The model at speed `v` in m/s. The model is stiff as `v` goes to 0: the caller clamps `v` from below.
    ///
    /// # Errors
    /// A parameter or a speed that is not positive.
    pub fn new(vehicle: &SingleTrack, v: f64) -> Result<Self, SingleTrackError> {
        let SingleTrack { mass: m, yaw_inertia: iz, lf, lr, cf, cr } = *vehicle;
        let positive = [
            ("vehicle.mass", m),
            ("vehicle.yaw_inertia", iz),
            ("vehicle.cg_to_front_axle", lf),
            ("vehicle.cg_to_rear_axle", lr),
            ("tyre.front.stiffness", cf),
            ("tyre.rear.stiffness", cr),
            ("speed", v),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(SingleTrackError::NotPositive { name, value });
            }
        }
        let sum = cf + cr;
        let moment = cr * lr - cf * lf;
        let damping = cf * lf * lf + cr * lr * lr;
        #[rustfmt::skip]
        let a = Matrix4::new(
            0.0, 1.0,                0.0,          0.0,
            0.0, -sum / (m * v),     sum / m,      moment / (m * v),
            0.0, 0.0,                0.0,          1.0,
            0.0, moment / (iz * v),  -moment / iz, -damping / (iz * v),
        );
        Ok(Self {
            a,
            b: Vector4::new(0.0, cf / m, 0.0, cf * lf / iz),
            d: Vector4::new(0.0, moment / (m * v) - v, 0.0, -damping / (iz * v)),
            e: Vector4::new(0.0, 0.0, 0.0, -1.0),
        })
    }
}

impl<const S: usize> ContinuousErrorModel<S> {
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

/// Yaw error in steady cornering with no lateral error, in rad per unit of curvature: the body then drives with
/// the sideslip `beta = (lr - m lf v^2 / (cr L)) kappa`, so `e2 = -beta`.
#[must_use]
pub fn steady_yaw_error(vehicle: &SingleTrack, v: f64) -> f64 {
    let wheelbase = vehicle.lf + vehicle.lr;
    -(vehicle.lr - vehicle.mass * vehicle.lf * v * v / (vehicle.cr * wheelbase))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car() -> SingleTrack {
        SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 }
    }

    #[test]
    fn steady_cornering_is_an_equilibrium() {
        let (car, v, kappa) = (car(), 15.0, 0.01);
        let model = ContinuousErrorModel::new(&car, v).unwrap();
        let wheelbase = car.lf + car.lr;
        let understeer = car.mass / wheelbase * (car.lr / car.cf - car.lf / car.cr);
        let steer = (wheelbase + understeer * v * v) * kappa;
        let x = Vector4::new(0.0, 0.0, steady_yaw_error(&car, v) * kappa, 0.0);
        let rate = model.a * x + model.b * steer + model.d * (v * kappa);
        assert!(rate.norm() < 1e-12, "{rate}");
        let discrete = model.discretise(0.02);
        assert!((discrete.step(&x, steer, v * kappa, 0.0) - x).norm() < 1e-14);
    }

    #[test]
    fn names_the_parameter_that_is_wrong() {
        let error = ContinuousErrorModel::new(&SingleTrack { cr: 0.0, ..car() }, 10.0).unwrap_err();
        assert!(error.to_string().contains("tyre.rear.stiffness"), "{error}");
    }
}
