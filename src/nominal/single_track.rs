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

use super::{ContinuousErrorModel, LateralVehicle, SingleTrackError};
use crate::signal::{E1, E1_RATE, E2, E2_RATE, Signal};
use crate::vehicle::SingleTrack;
use nalgebra::{Matrix4, Vector4};

impl LateralVehicle<4> for SingleTrack {
    const KIND: &'static str = "car";
    const STATES: [Signal; 4] = [E1, E1_RATE, E2, E2_RATE];

    fn model_at(&self, v: f64) -> Result<ContinuousErrorModel, SingleTrackError> {
        let SingleTrack { mass: m, yaw_inertia: iz, lf, lr, cf, cr } = *self;
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
        Ok(ContinuousErrorModel {
            a,
            b: Vector4::new(0.0, cf / m, 0.0, cf * lf / iz),
            d: Vector4::new(0.0, moment / (m * v) - v, 0.0, -damping / (iz * v)),
            e: Vector4::new(0.0, 0.0, 0.0, -1.0),
        })
    }

    fn steady_state(&self, speed: f64) -> Vector4<f64> {
        Vector4::new(0.0, 0.0, steady_yaw_error(self, speed), 0.0)
    }

    fn steady_steer(&self, speed: f64) -> f64 {
        let Self { mass, lf, lr, cf, cr, .. } = *self;
        let wheelbase = lf + lr;
        wheelbase + mass / wheelbase * (lr / cf - lf / cr) * speed * speed
    }

    fn stiffness_off(&self, share: f64) -> Vec<Self> {
        let times = 1.0 + share;
        vec![Self { cf: self.cf * times, ..*self }, Self { cr: self.cr * times, ..*self }]
    }

    fn inertia_off(&self, share: f64) -> Vec<Self> {
        vec![Self { yaw_inertia: self.yaw_inertia * (1.0 + share), ..*self }]
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        let Self { mass, yaw_inertia, lf, lr, cf, cr } = *self;
        vec![
            ("mass", mass),
            ("yaw_inertia", yaw_inertia),
            ("lf", lf),
            ("lr", lr),
            ("front cornering stiffness", cf),
            ("rear cornering stiffness", cr),
        ]
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
        let steer = car.steady_steer(v) * kappa;
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
