//! The nonlinear single-track model: the prediction model of a careful engineer's nonlinear MPC.
//!
//! ```text
//! m (vy' + vx r) = Fyf cos(delta) + Fyr          alpha_f = delta - atan((vy + lf r) / vx)
//! Iz r'          = lf Fyf cos(delta) - lr Fyr     alpha_r =       - atan((vy - lr r) / vx)
//! Fy = D sin(C atan(B alpha)),   D = mu Fz (static load),   B = cornering stiffness / (C D)
//! ```
//!
//! For small slip angles it is the linear model of [`super::ContinuousErrorModel`]. The friction `mu` is given, not
//! learned: below 2.5 m/s2 of lateral acceleration the tyres' peak cannot be observed.
//!
//! Source: Kabzan et al., Learning-Based MPC for Autonomous Racing, RA-L 2019, eqs. (1)-(3); Pacejka, Tire and Vehicle
//! Dynamics, ch. 4 (its simplest form).

use super::SingleTrackError;
use crate::signal::GRAVITY;
use crate::vehicle::SingleTrack;

/// Shape factor `C` of the lateral tyre force: the usual value of a car tyre.
const SHAPE: f64 = 1.3;
/// Largest product of the fastest pole and a step of Runge-Kutta: well within its stability limit of 2.8.
pub(super) const STEP_LIMIT: f64 = 1.0;

/// One axle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxleConstants {
    /// Force at the peak, N.
    peak: f64,
    /// `B`, 1/rad.
    slope: f64,
}

impl AxleConstants {
    /// An axle with a force at the peak, N, and a cornering stiffness, N/rad.
    pub(super) fn new(peak: f64, stiffness: f64) -> Self {
        Self { peak, slope: stiffness / (SHAPE * peak) }
    }

    /// The slip angle, rad, of a share of the peak force; near the peak if the axle cannot hold it.
    pub(super) fn slip_angle(&self, share: f64) -> f64 {
        (share.clamp(-0.99, 0.99).asin() / SHAPE).tan() / self.slope
    }

    /// Lateral force, N, and its derivative, N/rad.
    pub(super) fn force(&self, slip_angle: f64) -> (f64, f64) {
        let x = self.slope * slip_angle;
        let (sin, cos) = (SHAPE * x.atan()).sin_cos();
        (self.peak * sin, self.peak * cos * SHAPE * self.slope / (1.0 + x * x))
    }
}

/// The model of one vehicle on one road.
#[derive(Debug, Clone, PartialEq)]
pub struct Bicycle {
    vehicle: SingleTrack,
    front: AxleConstants,
    rear: AxleConstants,
}

/// `[vy m/s, yaw_rate rad/s]` with derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LateralMotion {
    /// Values: of the rates, or of the state after a step.
    pub value: [f64; 2],
    /// Derivatives of each value by `vy`, `yaw_rate` and `steer`.
    pub jacobian: [[f64; 3]; 2],
}

impl Bicycle {
    /// The model with a friction coefficient.
    ///
    /// # Errors
    /// A parameter that is not positive.
    pub fn new(vehicle: &SingleTrack, friction: f64) -> Result<Self, SingleTrackError> {
        let SingleTrack { mass, yaw_inertia, lf, lr, cf, cr } = *vehicle;
        let positive = [
            ("vehicle.mass", mass),
            ("vehicle.yaw_inertia", yaw_inertia),
            ("vehicle.cg_to_front_axle", lf),
            ("vehicle.cg_to_rear_axle", lr),
            ("tyre.front.stiffness", cf),
            ("tyre.rear.stiffness", cr),
            ("friction", friction),
        ];
        if let Some(&(name, value)) = positive.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite()))
        {
            return Err(SingleTrackError::NotPositive { name, value });
        }
        let axle = |stiffness: f64, lever: f64| {
            let peak = friction * mass * GRAVITY * lever / (lf + lr);
            AxleConstants::new(peak, stiffness)
        };
        Ok(Self { vehicle: *vehicle, front: axle(cf, lr), rear: axle(cr, lf) })
    }

    /// The vehicle.
    #[must_use]
    pub fn vehicle(&self) -> &SingleTrack {
        &self.vehicle
    }

    /// Rates of `vy`, m/s2, and of the yaw rate, rad/s2, at a positive `vx`.
    #[must_use]
    pub fn rates(&self, vy: f64, yaw_rate: f64, vx: f64, steer: f64) -> LateralMotion {
        let SingleTrack { mass, yaw_inertia, lf, lr, .. } = self.vehicle;
        let (slope_f, slope_r) = ((vy + lf * yaw_rate) / vx, (vy - lr * yaw_rate) / vx);
        let (force_f, stiffness_f) = self.front.force(steer - slope_f.atan());
        let (force_r, stiffness_r) = self.rear.force(-slope_r.atan());
        let (sin, cos) = steer.sin_cos();
        let turn_f = 1.0 / (vx * (1.0 + slope_f * slope_f));
        let turn_r = 1.0 / (vx * (1.0 + slope_r * slope_r));
        // Derivatives of the axles' forces across the body by vy, yaw rate, steer.
        let front = [-turn_f, -turn_f * lf, 1.0].map(|by| stiffness_f * by * cos);
        let front = [front[0], front[1], front[2] - force_f * sin];
        let rear = [-turn_r, turn_r * lr, 0.0].map(|by| stiffness_r * by);
        LateralMotion {
            value: [
                (force_f * cos + force_r) / mass - vx * yaw_rate,
                (lf * force_f * cos - lr * force_r) / yaw_inertia,
            ],
            jacobian: [
                std::array::from_fn(|i| (front[i] + rear[i]) / mass - if i == 1 { vx } else { 0.0 }),
                std::array::from_fn(|i| (lf * front[i] - lr * rear[i]) / yaw_inertia),
            ],
        }
    }

    /// Yaw error in steady cornering with no lateral error, rad, from the force that the rear axle then carries. A bend
    /// that the rear tyres cannot hold is answered with the yaw error near their peak.
    #[must_use]
    pub fn steady_yaw_error(&self, vx: f64, curvature: f64) -> f64 {
        let SingleTrack { mass, lf, lr, .. } = self.vehicle;
        let mut yaw_error = 0.0_f64;
        // The body's own direction lengthens its way a little: a fixed point that contracts by e2.
        for _ in 0..3 {
            let yaw_rate = curvature * vx / yaw_error.cos();
            let share = mass * vx * yaw_rate * lf / ((lf + lr) * self.rear.peak);
            let vy = lr * yaw_rate - vx * self.rear.slip_angle(share).tan();
            yaw_error = -(vy / vx).atan();
        }
        yaw_error
    }

    /// Steering angle of steady cornering, rad, by the linear tyres: a good first guess.
    #[must_use]
    pub fn steady_steer(&self, vx: f64, curvature: f64) -> f64 {
        let SingleTrack { mass, lf, lr, cf, cr, .. } = self.vehicle;
        let understeer = mass / (lf + lr) * (lr / cf - lf / cr);
        ((lf + lr) * curvature).atan() + understeer * vx * vx * curvature
    }

    /// Steps of Runge-Kutta that a control step needs at a speed: the model is stiff as `vx` goes to 0.
    #[must_use]
    pub fn substeps(&self, vx: f64, sample_time: f64) -> usize {
        let SingleTrack { mass, yaw_inertia, lf, lr, cf, cr } = self.vehicle;
        let pole = ((cf + cr) / mass).max((cf * lf * lf + cr * lr * lr) / yaw_inertia) / vx;
        (pole * sample_time / STEP_LIMIT).ceil().clamp(1.0, 100.0) as usize
    }

    /// `[vy, yaw_rate]` one control step later with speed and steering held, with derivatives: Runge-Kutta of 4th
    /// order on the state and on its derivatives.
    #[must_use]
    pub fn step(&self, vy: f64, yaw_rate: f64, vx: f64, steer: f64, sample_time: f64) -> LateralMotion {
        let count = self.substeps(vx, sample_time);
        let h = sample_time / count as f64;
        let mut at = LateralMotion { value: [vy, yaw_rate], jacobian: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
        for _ in 0..count {
            let slope = |x: &LateralMotion| {
                let rates = self.rates(x.value[0], x.value[1], vx, steer);
                let [vy, yaw_rate] = x.jacobian;
                let jacobian = rates.jacobian.map(|by| {
                    std::array::from_fn(|i| {
                        by[0] * vy[i] + by[1] * yaw_rate[i] + if i == 2 { by[2] } else { 0.0 }
                    })
                });
                LateralMotion { value: rates.value, jacobian }
            };
            let k1 = slope(&at);
            let k2 = slope(&at.plus(0.5 * h, &k1));
            let k3 = slope(&at.plus(0.5 * h, &k2));
            let k4 = slope(&at.plus(h, &k3));
            at = at.plus(h / 6.0, &k1).plus(h / 3.0, &k2).plus(h / 3.0, &k3).plus(h / 6.0, &k4);
        }
        at
    }
}

impl LateralMotion {
    fn plus(&self, factor: f64, slope: &Self) -> Self {
        Self {
            value: std::array::from_fn(|i| self.value[i] + factor * slope.value[i]),
            jacobian: std::array::from_fn(|i| {
                std::array::from_fn(|j| self.jacobian[i][j] + factor * slope.jacobian[i][j])
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nominal::ContinuousErrorModel;

    fn car() -> SingleTrack {
        SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 }
    }

    #[test]
    fn for_small_slip_it_is_the_linear_model() {
        let (bicycle, v) = (Bicycle::new(&car(), 1.0).unwrap(), 12.0);
        let linear = ContinuousErrorModel::new(&car(), v).unwrap();
        let rates = bicycle.rates(0.0, 0.0, v, 0.0);
        // On a straight road e1' = vy + v e2 and e2' = r: the columns of e1' and e2' are those of vy and r.
        let expected = [
            [linear.a[(1, 1)], linear.a[(1, 3)] - v, linear.b[1]],
            [linear.a[(3, 1)], linear.a[(3, 3)], linear.b[3]],
        ];
        for (mine, theirs) in rates.jacobian.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((mine - theirs).abs() < 1e-9 * theirs.abs().max(1.0), "{mine} {theirs}");
        }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let bicycle = Bicycle::new(&car(), 0.8).unwrap();
        for vx in [1.5, 8.0, 25.0] {
            let x = [0.3, 0.4, 0.08];
            let step = |x: [f64; 3]| bicycle.step(x[0], x[1], vx, x[2], 0.02);
            let at = step(x);
            for i in 0..3 {
                let (mut up, mut down) = (x, x);
                (up[i], down[i]) = (x[i] + 1e-6, x[i] - 1e-6);
                for o in 0..2 {
                    let difference = (step(up).value[o] - step(down).value[o]) / 2e-6;
                    assert!((at.jacobian[o][i] - difference).abs() < 1e-6, "{vx} {o} {i}");
                }
            }
        }
    }

    #[test]
    fn steady_cornering_is_an_equilibrium_and_at_small_slip_the_linear_one() {
        let bicycle = Bicycle::new(&car(), 0.8).unwrap();
        for (vx, curvature) in [(4.0, 0.12), (15.0, 0.01), (15.0, -0.02), (15.0, 0.03)] {
            let e2 = bicycle.steady_yaw_error(vx, curvature);
            let (vy, yaw_rate) = (-vx * e2.tan(), curvature * vx / e2.cos());
            // The steering that balances the yaw moment balances the forces as well.
            let mut steer = 0.0;
            for _ in 0..50 {
                let rates = bicycle.rates(vy, yaw_rate, vx, steer);
                steer -= rates.value[1] / rates.jacobian[1][2];
            }
            let rates = bicycle.rates(vy, yaw_rate, vx, steer).value;
            assert!(rates[0].abs() < 1e-3 && rates[1].abs() < 1e-9, "{rates:?} at {vx} {curvature}");
        }
        let linear = crate::nominal::steady_yaw_error(&car(), 15.0) * 1e-4;
        assert!((bicycle.steady_yaw_error(15.0, 1e-4) - linear).abs() < 1e-4 * linear.abs());
    }

    #[test]
    fn the_step_is_accurate_at_walking_speed() {
        let bicycle = Bicycle::new(&car(), 1.0).unwrap();
        let coarse = bicycle.step(0.05, 0.1, 1.5, 0.1, 0.02).value;
        let mut fine = [0.05, 0.1];
        for _ in 0..200 {
            fine = bicycle.step(fine[0], fine[1], 1.5, 0.1, 1e-4).value;
        }
        assert!((coarse[0] - fine[0]).abs() + (coarse[1] - fine[1]).abs() < 2e-3, "{coarse:?} {fine:?}");
    }
}
