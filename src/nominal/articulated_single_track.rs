//! The nonlinear single track of a tractor with a semi-trailer: the prediction model of a careful engineer's nonlinear
//! MPC of a truck.
//!
//! The tractor's forward speed `u` is held. With the lateral velocity `v` and yaw rate `r` of its CG, the articulation
//! `phi = psi1 - psi2`, `r2 = r - phi'`, `l2 = a2 + b2` and axles 1 to 3 (front, rear, trailer):
//!
//! ```text
//! M [v'; r'; r2'] = R
//!
//! M = [m1+m2, -m2 c1, -m2 a2 cos phi;  -m2 c1, I1 + m2 c1^2, m2 c1 a2 cos phi;  -m2 a2 cos phi, m2 c1 a2 cos phi, I2 + m2 a2^2]
//! R = [ F1 cos delta + F2 + F3 cos phi          - (m1+m2) u r + m2 a2 r2^2 sin phi
//!       a1 F1 cos delta - b1 F2 - c1 F3 cos phi + m2 c1 u r   - m2 c1 a2 r2^2 sin phi
//!       m2 a2 (u r cos phi + (c1 r^2 - v r) sin phi) - l2 F3 ]
//!
//! alpha1 = delta - atan((v + a1 r)/u),   alpha2 = -atan((v - b1 r)/u),   alpha3 = -atan(v3/u2)
//! u2 = u cos phi - (v - c1 r) sin phi,   v3 = u sin phi + (v - c1 r) cos phi - l2 r2
//! F = D sin(C atan(B alpha)),   D = mu Fz (static load),   B = cornering stiffness / (C D)
//! ```
//!
//! It is Newton and Euler for each unit, the force at the hitch eliminated. The force that holds the speed drives the
//! tractor along its axis. At small angles it is the linear model of `articulated.rs`, without a trailer the bicycle.
//!
//! Sources: method of the project, section 3 (kinematics of the second unit). Luijten, Lateral Dynamic Behaviour of
//! Articulated Commercial Vehicles, TU Eindhoven 2010; tyres as in `bicycle.rs`.

use super::bicycle::{AxleConstants, STEP_LIMIT};
use super::{LateralVehicle, SingleTrackError, steady_cornering};
use crate::signal::GRAVITY;
use crate::vehicle::Articulated;
use nalgebra::{Matrix3, SMatrix, Vector3};

/// Lower limit of the rolling speed of the trailer's axle, as a share of the tractor's speed. Near a right angle at the
/// hitch its slip angle means nothing.
const LEAST_ROLLING: f64 = 0.2;
/// Steps of Newton for the steady state, and the largest articulation that is one, rad.
const STEADY_STEPS: usize = 4;
const LARGEST_STEADY: f64 = 1.3;

/// The model of one truck on one road.
#[derive(Debug, Clone, PartialEq)]
pub struct ArticulatedSingleTrack {
    truck: Articulated,
    axles: [AxleConstants; 3],
    friction: f64,
    /// Fastest pole of the lateral dynamics at 1 m/s, 1/s.
    pole: f64,
}

/// Rates of the body with derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArticulatedRates {
    /// Of `vy`, m/s2, of the tractor's yaw rate and of the articulation's rate, rad/s2.
    pub value: [f64; 3],
    /// Derivatives of each by `vy`, yaw rate, articulation, its rate, and steering angle.
    pub jacobian: [[f64; 5]; 3],
}

/// Steady cornering at a speed on a curvature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyTurn {
    /// Lateral velocity of the tractor's CG, m/s.
    pub vy: f64,
    /// Articulation, rad.
    pub articulation: f64,
    /// Steering angle, rad.
    pub steer: f64,
}

impl ArticulatedSingleTrack {
    /// The model with a friction coefficient.
    ///
    /// # Errors
    /// A parameter that is not positive; a hitch so far back that an axle carries no load.
    pub fn new(truck: &Articulated, friction: f64) -> Result<Self, SingleTrackError> {
        let positive = |name: &'static str, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(value)
            } else {
                Err(SingleTrackError::NotPositive { name, value })
            }
        };
        positive("friction", friction)?;
        // Refuses parameters that are no truck's.
        truck.model_at(1.0)?;
        let Articulated { mass1, mass2, a1, b1, c1, a2, b2, stiffness, .. } = *truck;
        let trailer = mass2 * a2 / (a2 + b2);
        let hitch = mass2 - trailer;
        let front = (b1 * mass1 + (b1 - c1) * hitch) / (a1 + b1);
        let rear = (a1 * mass1 + (a1 + c1) * hitch) / (a1 + b1);
        let axle = |name, carried: f64, stiffness: f64| {
            Ok(AxleConstants::new(friction * GRAVITY * positive(name, carried)?, stiffness))
        };
        let axles = [
            axle("mass on the front axle", front, stiffness[0])?,
            axle("mass on the rear axle", rear, stiffness[1])?,
            axle("mass on the trailer's axle", trailer, stiffness[2])?,
        ];
        let mut model = Self { truck: *truck, axles, friction, pole: 0.0 };
        model.pole = model.fastest_pole();
        Ok(model)
    }

    /// The truck.
    #[must_use]
    pub fn truck(&self) -> &Articulated {
        &self.truck
    }

    /// Largest eigenvalue of `M^-1 G C G'`, with the levers of `[v, r, r2]`.
    fn fastest_pole(&self) -> f64 {
        let Articulated { a1, b1, c1, a2, b2, stiffness, .. } = self.truck;
        let levers = Matrix3::new(1.0, 1.0, 1.0, a1, -b1, -c1, 0.0, 0.0, -(a2 + b2));
        let damping = levers * Matrix3::from_diagonal(&Vector3::from(stiffness)) * levers.transpose();
        let Some(root) = self.inertia(1.0).cholesky().map(|root| root.l()) else { return f64::INFINITY };
        let half = root.solve_lower_triangular(&damping).unwrap_or_default();
        let whole = root.solve_lower_triangular(&half.transpose()).unwrap_or_default();
        whole.symmetric_eigenvalues().max()
    }

    /// `M` at a cosine of the articulation.
    fn inertia(&self, cos: f64) -> Matrix3<f64> {
        let Articulated { mass1, mass2, yaw_inertia1, yaw_inertia2, c1, a2, .. } = self.truck;
        let (tractor, across) = (-mass2 * c1, -mass2 * a2 * cos);
        #[rustfmt::skip]
        let inertia = Matrix3::new(
            mass1 + mass2, tractor,                           across,
            tractor,       yaw_inertia1 + mass2 * c1 * c1,    -c1 * across,
            across,        -c1 * across,                      yaw_inertia2 + mass2 * a2 * a2,
        );
        inertia
    }

    /// Rates of the body `[vy m/s, yaw rate rad/s, articulation rad, its rate rad/s]` at a positive speed, m/s.
    #[must_use]
    pub fn rates(&self, body: [f64; 4], speed: f64, steer: f64) -> ArticulatedRates {
        let [vy, yaw_rate, articulation, articulation_rate] = body;
        let Articulated { mass1, mass2, a1, b1, c1, a2, b2, .. } = self.truck;
        let (length, trailer_rate) = (a2 + b2, yaw_rate - articulation_rate);
        let (sin, cos) = articulation.sin_cos();
        let (sin_steer, cos_steer) = steer.sin_cos();
        let hitch = vy - c1 * yaw_rate;

        // Slopes of the motion at the axles, with derivatives by the body's four.
        let slopes = [(vy + a1 * yaw_rate) / speed, (vy - b1 * yaw_rate) / speed];
        let rolling = speed * cos - hitch * sin;
        let sideways = speed * sin + hitch * cos - length * trailer_rate;
        let held = rolling < LEAST_ROLLING * speed;
        let rolls = rolling.max(LEAST_ROLLING * speed);
        let slope3 = sideways / rolls;
        let by_sideways = [cos, -c1 * cos - length, rolling, length];
        let by_rolling = if held { [0.0; 4] } else { [-sin, c1 * sin, -speed * sin - hitch * cos, 0.0] };
        let by3: [f64; 4] = std::array::from_fn(|i| (by_sideways[i] - slope3 * by_rolling[i]) / rolls);

        // Forces, with derivatives by the body's four and the steering.
        let [front, rear, trailer] = &self.axles;
        let (force1, stiffness1) = front.force(steer - slopes[0].atan());
        let (force2, stiffness2) = rear.force(-slopes[1].atan());
        let (force3, stiffness3) = trailer.force(-slope3.atan());
        let turn1 = stiffness1 / (speed * (1.0 + slopes[0] * slopes[0]));
        let turn2 = stiffness2 / (speed * (1.0 + slopes[1] * slopes[1]));
        let turn3 = stiffness3 / (1.0 + slope3 * slope3);
        let across1 = force1 * cos_steer;
        let by1 = [-turn1, -turn1 * a1, 0.0, 0.0, stiffness1].map(|by| by * cos_steer);
        let by1 = [by1[0], by1[1], by1[2], by1[3], by1[4] - force1 * sin_steer];
        let by2 = [-turn2, turn2 * b1, 0.0, 0.0, 0.0];
        let by3 = [-turn3 * by3[0], -turn3 * by3[1], -turn3 * by3[2], -turn3 * by3[3], 0.0];

        // What the turning trailer pulls at the hitch, and what turns it there.
        let swing = mass2 * a2 * trailer_rate * trailer_rate;
        let swing_by_rate = 2.0 * mass2 * a2 * trailer_rate;
        let drag = c1 * yaw_rate * yaw_rate - vy * yaw_rate;
        let right = Vector3::new(
            across1 + force2 + force3 * cos - (mass1 + mass2) * speed * yaw_rate + swing * sin,
            a1 * across1 - b1 * force2 - c1 * force3 * cos + mass2 * c1 * speed * yaw_rate - c1 * swing * sin,
            mass2 * a2 * (speed * yaw_rate * cos + drag * sin) - length * force3,
        );
        let inverse = self.inertia(cos).try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN));
        let accelerations = inverse * right;

        let mut by = SMatrix::<f64, 3, 5>::zeros();
        for i in 0..5 {
            by[(0, i)] = by1[i] + by2[i] + by3[i] * cos;
            by[(1, i)] = a1 * by1[i] - b1 * by2[i] - c1 * by3[i] * cos;
            by[(2, i)] = -length * by3[i];
        }
        by[(0, 1)] += -(mass1 + mass2) * speed + swing_by_rate * sin;
        by[(1, 1)] += mass2 * c1 * speed - c1 * swing_by_rate * sin;
        by[(0, 3)] -= swing_by_rate * sin;
        by[(1, 3)] += c1 * swing_by_rate * sin;
        by[(2, 0)] -= mass2 * a2 * yaw_rate * sin;
        by[(2, 1)] += mass2 * a2 * (speed * cos + (2.0 * c1 * yaw_rate - vy) * sin);
        by[(0, 2)] += swing * cos - force3 * sin;
        by[(1, 2)] += c1 * (force3 * sin - swing * cos);
        by[(2, 2)] += mass2 * a2 * (drag * cos - speed * yaw_rate * sin);
        // M depends on the articulation, too.
        let turned = mass2 * a2 * sin;
        by[(0, 2)] -= turned * accelerations[2];
        by[(1, 2)] += c1 * turned * accelerations[2];
        by[(2, 2)] -= turned * (accelerations[0] - c1 * accelerations[1]);
        let by = inverse * by;

        // The articulation turns with the difference of the units.
        let [v, r, r2] = accelerations.into();
        ArticulatedRates {
            value: [v, r, r - r2],
            jacobian: [
                std::array::from_fn(|i| by[(0, i)]),
                std::array::from_fn(|i| by[(1, i)]),
                std::array::from_fn(|i| by[(1, i)] - by[(2, i)]),
            ],
        }
    }

    /// Steady cornering with no lateral error of the tractor's CG. A bend that the tyres cannot hold is answered with the
    /// angles near their peak.
    #[must_use]
    pub fn steady_turn(&self, speed: f64, curvature: f64) -> SteadyTurn {
        let first = self.nearly_steady(speed, curvature);
        let mut turn = first;
        for _ in 0..STEADY_STEPS {
            let SteadyTurn { vy, articulation, steer } = turn;
            // The CG's way is the path's: its speed along it is the whole one.
            let whole = speed.hypot(vy);
            let rates = self.rates([vy, curvature * whole, articulation, 0.0], speed, steer);
            let mut by = Matrix3::zeros();
            for (row, jacobian) in rates.jacobian.iter().enumerate() {
                by[(row, 0)] = jacobian[0] + jacobian[1] * curvature * vy / whole;
                by[(row, 1)] = jacobian[2];
                by[(row, 2)] = jacobian[4];
            }
            let Some(inverse) = by.try_inverse() else { return first };
            let change = inverse * Vector3::from(rates.value);
            turn = SteadyTurn {
                vy: vy - change[0],
                articulation: articulation - change[1],
                steer: steer - change[2],
            };
        }
        let near = |value: f64, first: f64, by: f64| (value - first).abs() <= by;
        let is_turn = turn.articulation.abs() <= LARGEST_STEADY
            && near(turn.articulation, first.articulation, 0.3)
            && near(turn.vy, first.vy, 0.2 * speed)
            && near(turn.steer, first.steer, 0.3);
        if is_turn { turn } else { first }
    }

    /// The same by the forces that the axles carry at small angles, exact in the geometry.
    fn nearly_steady(&self, speed: f64, curvature: f64) -> SteadyTurn {
        let Articulated { b1, c1, a2, b2, .. } = self.truck;
        let [_, rear, trailer] = &self.axles;
        let mut vy = 0.0_f64;
        let mut yaw_rate = curvature * speed;
        // Every axle carries its share of the load across: the same share of its peak.
        let mut share = 0.0;
        for _ in 0..3 {
            yaw_rate = curvature * speed.hypot(vy);
            share = speed * yaw_rate / (self.friction * GRAVITY);
            vy = b1 * yaw_rate - speed * rear.slip_angle(share).tan();
        }
        let slip3 = trailer.slip_angle(share);
        let hitch = vy - c1 * yaw_rate;
        let turn = (a2 + b2) * yaw_rate * slip3.cos() / speed.hypot(hitch);
        let articulation = turn.clamp(-0.97, 0.97).asin() - hitch.atan2(speed) - slip3;
        SteadyTurn { vy, articulation, steer: steady_cornering(&self.truck, speed).steer * curvature }
    }

    /// Steps of Runge-Kutta that a control step needs at a speed: the model is stiff as the speed goes to 0.
    #[must_use]
    pub fn substeps(&self, speed: f64, sample_time: f64) -> usize {
        (self.pole / speed * sample_time / STEP_LIMIT).ceil().clamp(1.0, 100.0) as usize
    }
}
