//! The truck's nominal model: linear single track of a tractor with a semi-trailer, in errors to the path.
//!
//! State `x = [e1, e1', e2, e2', phi, phi']`: the tractor's errors as the car's, and the articulation
//! `phi = psi1 - psi2`. With `q = [e1, e2, phi]`, forward speed `u`, `h = c1 + a2`, `l2 = a2 + b2` and `C = diag(C1, C2, C3)`:
//!
//! ```text
//! M q'' = G C alpha - M [u psi_des'; psi_des''; 0]
//! alpha = [delta; 0; 0] - G' (q' + [0; psi_des'; 0])/u + [1; 1; 1] e2 - [0; 0; 1] phi
//!
//! M = [m1+m2, -m2 h, m2 a2;  -m2 h, I1+I2+m2 h^2, -(I2+m2 a2 h);  m2 a2, -(I2+m2 a2 h), I2+m2 a2^2]
//! G = [1 1 1;  a1 -b1 -(h+b2);  0 0 l2]         where each axle's force acts on each coordinate
//! ```
//!
//! Without a trailer it is the car's model. Speed is constant within a step; the curvature enters by `psi_des' = u kappa`
//! and `psi_des'' = u^2 kappa'`, as for the car.
//!
//! Source: method of the project, section 3; the form is that of Luijten, Lateral Dynamic Behaviour of Articulated
//! Commercial Vehicles, TU Eindhoven 2010.

use super::{ContinuousErrorModel, LateralVehicle, SingleTrackError};
use crate::signal::{ARTICULATION, ARTICULATION_RATE, E1, E1_RATE, E2, E2_RATE, Signal};
use crate::vehicle::Articulated;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// `[e1 m, e1' m/s, e2 rad, e2' rad/s, articulation rad, articulation_rate rad/s]`.
pub type ArticulatedState = SVector<f64, 6>;

/// Steady cornering on the path, with no lateral error of the tractor's CG: angles per unit of curvature, rad m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyCornering {
    /// Steering angle at the road wheels.
    pub steer: f64,
    /// Yaw error of the tractor.
    pub yaw_error: f64,
    /// Articulation.
    pub articulation: f64,
}

/// Action of each axle's lateral force on `e1`, `e2`, `phi`.
fn levers(truck: &Articulated) -> Matrix3<f64> {
    let Articulated { a1, b1, c1, a2, b2, .. } = *truck;
    Matrix3::new(1.0, 1.0, 1.0, a1, -b1, -(c1 + a2 + b2), 0.0, 0.0, a2 + b2)
}

impl LateralVehicle<6> for Articulated {
    const KIND: &'static str = "truck";
    const STATES: [Signal; 6] = [E1, E1_RATE, E2, E2_RATE, ARTICULATION, ARTICULATION_RATE];

    fn model_at(&self, v: f64) -> Result<ContinuousErrorModel<6>, SingleTrackError> {
        let Self { mass1: m1, mass2: m2, yaw_inertia1: i1, yaw_inertia2: i2, .. } = *self;
        let Self { a1, b1, c1, a2, b2, stiffness: [cf, cr, ct], .. } = *self;
        let positive = [
            ("mass1", m1),
            ("mass2", m2),
            ("yaw_inertia1", i1),
            ("yaw_inertia2", i2),
            ("a1", a1),
            ("b1", b1),
            ("a2", a2),
            ("b2", b2),
            ("cornering stiffness of axle 1", cf),
            ("cornering stiffness of axle 2", cr),
            ("cornering stiffness of axle 3", ct),
            ("speed", v),
        ];
        if let Some(&(name, value)) = positive.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite()))
        {
            return Err(SingleTrackError::NotPositive { name, value });
        }
        // The hitch may lie ahead of the CG.
        if !c1.is_finite() {
            return Err(SingleTrackError::NotFinite { name: "c1", value: c1 });
        }
        let h = c1 + a2;
        let coupling = -(i2 + m2 * a2 * h);
        #[rustfmt::skip]
        let inertia = Matrix3::new(
            m1 + m2, -m2 * h,               m2 * a2,
            -m2 * h, i1 + i2 + m2 * h * h,  coupling,
            m2 * a2, coupling,              i2 + m2 * a2 * a2,
        );
        let levers = levers(self);
        let forces = levers * Matrix3::from_diagonal(&Vector3::new(cf, cr, ct));
        // Positive definite for positive masses and inertias; rounding alone could say otherwise.
        let accelerations = inertia
            .cholesky()
            .ok_or(SingleTrackError::NotPositive { name: "yaw_inertia2", value: i2 })?
            .solve(&forces);
        let damping = accelerations * levers.transpose() / v;
        let by_yaw_error = accelerations * Vector3::repeat(1.0);
        let mut model = ContinuousErrorModel {
            a: SMatrix::zeros(),
            b: ArticulatedState::zeros(),
            d: ArticulatedState::zeros(),
            e: ArticulatedState::zeros(),
        };
        for i in 0..3 {
            let (value, rate) = (2 * i, 2 * i + 1);
            model.a[(value, rate)] = 1.0;
            for j in 0..3 {
                model.a[(rate, 2 * j + 1)] = -damping[(i, j)];
            }
            model.a[(rate, 2)] = by_yaw_error[i];
            model.a[(rate, 4)] = -accelerations[(i, 2)];
            model.b[rate] = accelerations[(i, 0)];
            model.d[rate] = -damping[(i, 1)];
        }
        model.d[1] -= v;
        model.e[3] = -1.0;
        Ok(model)
    }

    fn steady_state(&self, speed: f64) -> ArticulatedState {
        let SteadyCornering { yaw_error, articulation, .. } = steady_cornering(self, speed);
        ArticulatedState::from([0.0, 0.0, yaw_error, 0.0, articulation, 0.0])
    }

    fn steady_steer(&self, speed: f64) -> f64 {
        steady_cornering(self, speed).steer
    }

    fn stiffness_off(&self, share: f64) -> Vec<Self> {
        let off = |axle: usize| {
            let mut truck = *self;
            truck.stiffness[axle] *= 1.0 + share;
            truck
        };
        (0..self.stiffness.len()).map(off).collect()
    }

    fn inertia_off(&self, share: f64) -> Vec<Self> {
        let times = 1.0 + share;
        vec![
            Self { yaw_inertia1: self.yaw_inertia1 * times, ..*self },
            Self { yaw_inertia2: self.yaw_inertia2 * times, ..*self },
        ]
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        let Self { mass1, mass2, yaw_inertia1, yaw_inertia2, a1, b1, c1, a2, b2, stiffness } = *self;
        vec![
            ("mass1", mass1),
            ("mass2", mass2),
            ("yaw_inertia1", yaw_inertia1),
            ("yaw_inertia2", yaw_inertia2),
            ("a1", a1),
            ("b1", b1),
            ("c1", c1),
            ("a2", a2),
            ("b2", b2),
            ("cornering stiffness of axle 1", stiffness[0]),
            ("cornering stiffness of axle 2", stiffness[1]),
            ("cornering stiffness of axle 3", stiffness[2]),
        ]
    }
}

/// Steady cornering at a speed. The axles carry what the masses need, `G F = u^2 M [1; 0; 0]` per unit of curvature; their
/// slip angles `F/C` and the geometry of the circle give the angles.
#[must_use]
pub fn steady_cornering(truck: &Articulated, v: f64) -> SteadyCornering {
    let Articulated { mass1, mass2, a1, b1, c1, a2, b2, stiffness, .. } = *truck;
    // Trailer: its axle's share, and the hitch's, which the tractor carries.
    let axle3 = mass2 * a2 / (a2 + b2);
    let hitch = mass2 - axle3;
    let axle1 = (b1 * mass1 + (b1 - c1) * hitch) / (a1 + b1);
    let axle2 = (a1 * mass1 + (a1 + c1) * hitch) / (a1 + b1);
    let [slip1, slip2, slip3] = [(axle1, 0), (axle2, 1), (axle3, 2)].map(|(m, i)| m * v * v / stiffness[i]);
    let yaw_error = slip2 - b1;
    SteadyCornering {
        steer: slip1 + a1 - yaw_error,
        yaw_error,
        articulation: yaw_error + c1 + a2 + b2 - slip3,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nominal::steady_yaw_error;
    use crate::numerics::Random;
    use crate::vehicle::SingleTrack;
    use nalgebra::{Matrix4, Vector4};

    /// The second paper's simulated truck.
    fn truck() -> Articulated {
        Articulated {
            mass1: 7180.0,
            mass2: 10_000.0,
            yaw_inertia1: 21_863.0,
            yaw_inertia2: 141_676.0,
            a1: 1.675,
            b1: 1.815,
            c1: 0.6,
            a2: 4.426,
            b2: 3.102,
            stiffness: [289e3, 343e3, 329e3],
        }
    }

    #[test]
    fn one_unit_is_the_car() {
        let truck =
            Articulated { mass2: 1e-6, yaw_inertia2: 1e-6, stiffness: [289e3, 343e3, 1e-6], ..truck() };
        let car = SingleTrack {
            mass: truck.mass1,
            yaw_inertia: truck.yaw_inertia1,
            lf: truck.a1,
            lr: truck.b1,
            cf: truck.stiffness[0],
            cr: truck.stiffness[1],
        };
        for v in [2.0, 10.0, 25.0] {
            let model = ContinuousErrorModel::new(&truck, v).unwrap();
            let reference = ContinuousErrorModel::new(&car, v).unwrap();
            let close = |x: f64, y: f64| (x - y).abs() < 1e-7 * (1.0 + y.abs());
            for i in 0..4 {
                assert!((0..4).all(|j| close(model.a[(i, j)], reference.a[(i, j)])), "{}", model.a);
                // A trailer without mass is not felt.
                assert!((4..6).all(|j| close(model.a[(i, j)], 0.0)), "{}", model.a);
                let pairs = [(&model.b, &reference.b), (&model.d, &reference.d), (&model.e, &reference.e)];
                assert!(pairs.iter().all(|(x, y)| close(x[i], y[i])), "{model:?}");
            }
            let steady = steady_cornering(&truck, v);
            assert!((steady.yaw_error - steady_yaw_error(&car, v)).abs() < 1e-8);
        }
    }

    #[test]
    fn steady_cornering_is_an_equilibrium() {
        for v in [1.5, 8.0, 20.0] {
            let curvature = 1.0 / 50.0;
            let steady = steady_cornering(&truck(), v);
            let x = truck().steady_state(v) * curvature;
            let model = ContinuousErrorModel::new(&truck(), v).unwrap();
            let rate = model.a * x + model.b * (steady.steer * curvature) + model.d * (v * curvature);
            assert!(rate.norm() < 1e-12, "{rate}");
            let next = model.discretise(0.02).step(&x, steady.steer * curvature, v * curvature, 0.0);
            assert!((next - x).norm() < 1e-13, "{next}");
        }
    }

    #[test]
    fn a_slow_circle_is_geometry() {
        // R = 50 m: the angles of a train of rods, to first order in 1/R.
        let truck = truck();
        let steady = steady_cornering(&truck, 1e-3);
        assert!((steady.steer / 50.0 - (truck.a1 + truck.b1) / 50.0).abs() < 1e-9);
        assert!((steady.yaw_error + truck.b1).abs() < 1e-6);
        // The directions of motion of hitch and trailer axle differ by l2/R, those of tractor and hitch by (c1 - b1)/R.
        let length = truck.a2 + truck.b2;
        assert!((steady.articulation - (truck.c1 - truck.b1 + length)).abs() < 1e-6);
    }

    #[test]
    fn damping_at_20_m_per_s() {
        let model = ContinuousErrorModel::new(&truck(), 20.0).unwrap();
        let poles = model.a.complex_eigenvalues();
        let swinging = poles.iter().filter(|p| p.im > 1e-3).max_by(|p, q| p.re.total_cmp(&q.re)).unwrap();
        assert!((swinging.re + 1.36).abs() < 0.01 && (swinging.im - 2.32).abs() < 0.01, "{poles}");
    }

    /// Accelerations `[vy', r1', r2']` by Newton and Euler for each unit, with the hitch force as an unknown: nothing of
    /// the model's own derivation.
    fn newton_euler(truck: &Articulated, u: f64, [vy, r1, r2, phi, steer]: [f64; 5]) -> [f64; 3] {
        let Articulated { mass1, mass2, yaw_inertia1, yaw_inertia2, a1, b1, c1, a2, b2, stiffness } = *truck;
        let vy2 = u * phi + vy - c1 * r1 - a2 * r2;
        let slip = [steer - (vy + a1 * r1) / u, -(vy - b1 * r1) / u, -(vy2 - b2 * r2) / u];
        let [f1, f2, f3]: [f64; 3] = std::array::from_fn(|i| stiffness[i] * slip[i]);
        // Unknowns vy', r1', r2', force of the hitch on the tractor.
        #[rustfmt::skip]
        let matrix = Matrix4::new(
            mass1,  0.0,          0.0,           -1.0,
            0.0,    yaw_inertia1, 0.0,           c1,
            mass2,  -mass2 * c1,  -mass2 * a2,   1.0,
            0.0,    0.0,          yaw_inertia2,  a2,
        );
        let right = Vector4::new(
            f1 + f2 - mass1 * u * r1,
            a1 * f1 - b1 * f2,
            // vy2' + u r2, with vy2' = u phi' + ..
            f3 - mass2 * u * r1,
            -b2 * f3,
        );
        let solution = matrix.lu().solve(&right).unwrap();
        [solution[0], solution[1], solution[2]]
    }

    #[test]
    fn agrees_with_newton_and_euler() {
        let mut random = Random::new(5);
        let mut draw = |half: f64| half * (2.0 * random.uniform() - 1.0);
        for _ in 0..200 {
            let mut vary = |value: f64| value * (1.0 + draw(0.5));
            let base = truck();
            let truck = Articulated {
                mass1: vary(base.mass1),
                mass2: vary(base.mass2),
                yaw_inertia1: vary(base.yaw_inertia1),
                yaw_inertia2: vary(base.yaw_inertia2),
                a1: vary(base.a1),
                b1: vary(base.b1),
                c1: vary(base.c1),
                a2: vary(base.a2),
                b2: vary(base.b2),
                stiffness: base.stiffness.map(&mut vary),
            };
            let u = vary(12.0);
            let x = ArticulatedState::from_fn(|_, _| draw(0.1));
            let (steer, turn, turn_rate) = (draw(0.1), draw(0.2), draw(0.1));
            let model = ContinuousErrorModel::new(&truck, u).unwrap();
            let rate = model.a * x + model.b * steer + model.d * turn + model.e * turn_rate;

            let (vy, r1) = (x[1] - u * x[2], x[3] + turn);
            let [vy_rate, r1_rate, r2_rate] = newton_euler(&truck, u, [vy, r1, r1 - x[5], x[4], steer]);
            let expected = ArticulatedState::from([
                x[1],
                vy_rate + u * x[3],
                x[3],
                r1_rate - turn_rate,
                x[5],
                r1_rate - r2_rate,
            ]);
            assert!((rate - expected).norm() < 1e-10 * (1.0 + expected.norm()), "{rate} {expected}");
        }
    }

    #[test]
    fn names_the_parameter_that_is_wrong() {
        let name = |truck: &Articulated, v| ContinuousErrorModel::new(truck, v).unwrap_err().to_string();
        assert!(name(&Articulated { b2: 0.0, ..truck() }, 10.0).contains("b2"));
        assert!(name(&Articulated { c1: f64::NAN, ..truck() }, 10.0).contains("c1"));
        assert!(name(&truck(), f64::NAN).contains("speed"));
    }
}
