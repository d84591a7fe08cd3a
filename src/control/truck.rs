//! The controller's truck: a tractor with a semi-trailer, its articulation measured.
//!
//! Beside the errors of the tractor the state has the articulation and its rate. They cost nothing by default. The
//! trailer follows the tractor, and pulling the articulation towards a value pulls the tractor off the path in bends. A
//! soft bound keeps it from jack-knifing.

use super::parameters::{
    self, ActuatorParameters, ControllerParametersFor, MpcParameters, SpeedController, SpeedParameters,
};
use super::step::Measurement;
use super::variant::ArticulatedModel;
use super::vehicle::{Bound, ControlledParameters, ControlledVehicle, FurtherState};
use super::{ControllerFor, LongitudinalParameters, ObserverParameters};
use crate::nominal::{ArticulatedState, ErrorState};
use crate::parameter::{OutOfRange, ParameterGroup};
use crate::parameters;
use crate::path::{Path, TRUCK_GRIP};
use crate::vehicle::{Articulated, TruckParameters, range_of};
use std::f64::consts::PI;

/// States of a truck: its errors to the path, the articulation and its rate.
pub const TRUCK_STATES: usize = 6;

/// The controller of a truck.
pub type TruckController = ControllerFor<NominalTruck, TRUCK_STATES>;

/// All parameters of a truck's controller.
pub type TruckControllerParameters = ControllerParametersFor<NominalTruck>;

impl ControlledVehicle<TRUCK_STATES> for Articulated {
    type Nonlinear = ArticulatedModel;

    fn state(errors: &ErrorState, measurement: &Measurement) -> ArticulatedState {
        let Measurement { articulation, articulation_rate, .. } = *measurement;
        let [e1, e1_rate, e2, e2_rate] = (*errors).into();
        ArticulatedState::from([e1, e1_rate, e2, e2_rate, articulation, articulation_rate])
    }
}

/// Range of a number that a truck's file has, too.
const fn of_file(name: &str) -> (f64, f64) {
    range_of(TruckParameters::TABLE, name)
}

parameters! {
    /// The nominal truck of a careful engineer, and the cost of its articulation. Names are those of a truck's file.
    pub struct NominalTruck {
        mass1: f64 = 7180.0, KILOGRAM in of_file("tractor.mass").0, of_file("tractor.mass").1; "tractor.mass", "Mass of the nominal model's tractor"
        yaw_inertia1: f64 = 21_863.0, KILOGRAM_METRE2 in of_file("tractor.yaw_inertia").0, of_file("tractor.yaw_inertia").1; "tractor.yaw_inertia", "Yaw inertia of the nominal model's tractor about its CG"
        a1: f64 = 1.675, METRE in of_file("tractor.cg_to_front_axle").0, of_file("tractor.cg_to_front_axle").1; "tractor.cg_to_front_axle", "Distance from the tractor's CG to the front axle"
        b1: f64 = 1.815, METRE in of_file("tractor.cg_to_rear_axle").0, of_file("tractor.cg_to_rear_axle").1; "tractor.cg_to_rear_axle", "Distance from the tractor's CG to the rear axle"
        c1: f64 = 0.6, METRE in of_file("hitch.cg_to_hitch").0, of_file("hitch.cg_to_hitch").1; "hitch.cg_to_hitch", "Distance from the tractor's CG back to the hitch"
        mass2: f64 = 10_000.0, KILOGRAM in of_file("trailer.mass").0, of_file("trailer.mass").1; "trailer.mass", "Mass of the nominal model's semi-trailer"
        yaw_inertia2: f64 = 141_676.0, KILOGRAM_METRE2 in of_file("trailer.yaw_inertia").0, of_file("trailer.yaw_inertia").1; "trailer.yaw_inertia", "Yaw inertia of the nominal model's semi-trailer about its CG"
        a2: f64 = 4.426, METRE in of_file("trailer.cg_to_hitch").0, of_file("trailer.cg_to_hitch").1; "trailer.cg_to_hitch", "Distance from the semi-trailer's CG forward to the hitch"
        b2: f64 = 3.102, METRE in of_file("trailer.cg_to_axle").0, of_file("trailer.cg_to_axle").1; "trailer.cg_to_axle", "Distance from the semi-trailer's CG back to its axle group"
        front_stiffness: f64 = 289e3, NEWTON_PER_RADIAN in 1e3, 1e7; "tyre.front.stiffness", "Cornering stiffness of the front axle (all tyres)"
        rear_stiffness: f64 = 343e3, NEWTON_PER_RADIAN in 1e3, 1e7; "tyre.rear.stiffness", "Cornering stiffness of the rear axle (all tyres)"
        trailer_stiffness: f64 = 329e3, NEWTON_PER_RADIAN in 1e3, 1e7; "tyre.trailer.stiffness", "Cornering stiffness of the trailer's axle group (all tyres)"
        q_articulation: f64 = 0.0, ONE in 0.0, 1e6; "mpc.q_articulation", "Weight of the squared deviation of the articulation from that of steady cornering, per rad2"
        q_articulation_rate: f64 = 0.0, ONE in 0.0, 1e6; "mpc.q_articulation_rate", "Weight of the squared rate of the articulation, per (rad/s)2"
        articulation_max: f64 = 1.0, RADIAN in 0.05, 3.0; "mpc.articulation_max", "Soft bound of the articulation"
        articulation_slack_quadratic: f64 = 100.0, ONE in 1e-6, 1e9; "mpc.articulation_slack_quadratic", "Weight of the squared excess of the articulation over its soft bound, per rad2"
        articulation_slack_linear: f64 = 10.0, ONE in 0.0, 1e9; "mpc.articulation_slack_linear", "Weight of the excess of the articulation over its soft bound, per rad"
        noise_articulation: f64 = 0.002, RADIAN in 1e-9, 1.0; "observer.noise_articulation", "Noise of the measured articulation (standard deviation)"
        noise_articulation_rate: f64 = 0.005, RADIAN_PER_SECOND in 1e-9, 10.0; "observer.noise_articulation_rate", "Noise of the measured rate of the articulation (standard deviation)"
    }
}

/// Largest reference of the articulation, rad: that of a U-turn; the linear steady state means nothing beyond.
const LARGEST_ARTICULATION_REFERENCE: f64 = 0.6;
/// Unmodelled rate of the articulation for each m/s of unmodelled lateral velocity, rad/m: both come from the axles'
/// forces.
const ARTICULATION_SHARE: f64 = 0.5;
/// Largest plausible disturbing articulation acceleration, rad/s2: as for the yaw.
const LARGEST_DISTURBANCE: f64 = 3.0;
/// Turn of the sharpest corner that is rounded, rad, and the step by which its radius is made wider, so many times at most.
const SHARPEST_CORNER: f64 = 2.0;
const WIDER: f64 = 1.05;
const MOST_WIDER: i32 = 60;
/// Share of the angle at which trailer and cab touch that the soft bound leaves.
const SAFE_SHARE: f64 = 2.0 / 3.0;
/// Lateral acceleration of steering that returns a truck to its road, m/s2. A loaded semi-trailer rolls over at 0.35 g (Winkler and
/// Ervin, Rollover of Heavy Commercial Vehicles, UMTRI-99-19), and a transient raises the trailer's part of it.
const TRUCK_LATERAL_ACCEL: f64 = 3.0;

impl ControlledParameters<TRUCK_STATES> for NominalTruck {
    type Vehicle = Articulated;

    fn nominal(&self) -> Articulated {
        self.articulated()
    }

    fn further_states(&self) -> Vec<FurtherState> {
        let bound = Bound {
            max: self.articulation_max,
            quadratic: self.articulation_slack_quadratic,
            linear: self.articulation_slack_linear,
        };
        let angle = FurtherState {
            weight: self.q_articulation,
            bound: Some(bound),
            largest_reference: LARGEST_ARTICULATION_REFERENCE,
            noise: self.noise_articulation,
            process_noise_gain: 0.0,
            largest_disturbance: 0.0,
        };
        let rate = FurtherState {
            weight: self.q_articulation_rate,
            bound: None,
            largest_reference: 0.0,
            noise: self.noise_articulation_rate,
            process_noise_gain: ARTICULATION_SHARE,
            largest_disturbance: LARGEST_DISTURBANCE,
        };
        vec![angle, rate]
    }

    fn least_radius_behind(&self, radius: f64) -> f64 {
        let wider = |times: i32| radius * WIDER.powi(times);
        let fits = |radius: &f64| {
            let arc = |_: f64| 1.0 / radius;
            largest_articulation(&self.articulated(), SHARPEST_CORNER * radius, arc).1
                <= self.articulation_max
        };
        (0..MOST_WIDER).map(wider).find(fits).unwrap_or_else(|| wider(MOST_WIDER))
    }

    fn too_tight_behind(&self, road: &Path) -> Option<String> {
        let bend = |station: f64| road.curvature(station);
        let (station, angle) = largest_articulation(&self.articulated(), road.length(), bend);
        let most = self.articulation_max;
        (angle > most).then(|| {
            format!(
                "the road's bend at station {station:.1} m turns the trailer {angle:.2} rad against the tractor, and \
                 mpc.articulation_max is {most:.2} rad: the truck may leave the road there, or jack-knife"
            )
        })
    }

    fn set_by_name(&mut self, name: &str, value: f64) -> Result<bool, OutOfRange> {
        parameters::set(self, name, value)
    }

    fn check_all(&self) -> Result<(), OutOfRange> {
        ParameterGroup::check(self)
    }
}

/// Station, m, and magnitude, rad, of the largest articulation along a road, by its length and curvature, at walking pace, without slip.
///
/// ```text
/// phi' = kappa - (sin phi - d kappa cos phi) / l2      per metre of the tractor's way; hitch d behind its rear axle
/// ```
fn largest_articulation(truck: &Articulated, road: f64, curvature: impl Fn(f64) -> f64) -> (f64, f64) {
    const STEP: f64 = 0.1;
    let Articulated { b1, c1, a2, b2, .. } = *truck;
    let (behind, length) = (c1 - b1, a2 + b2);
    let (mut articulation, mut largest) = (0.0_f64, (0.0, 0.0));
    for i in 0..=(road / STEP) as usize {
        let station = i as f64 * STEP;
        let curvature = curvature(station);
        let (sin, cos) = articulation.sin_cos();
        articulation += STEP * (curvature - (sin - behind * curvature * cos) / length);
        articulation = articulation.clamp(-PI, PI);
        if articulation.abs() > largest.1 {
            largest = (station, articulation.abs());
        }
    }
    largest
}

impl NominalTruck {
    /// The nominal model's parameters.
    #[must_use]
    pub fn articulated(&self) -> Articulated {
        Articulated {
            mass1: self.mass1,
            mass2: self.mass2,
            yaw_inertia1: self.yaw_inertia1,
            yaw_inertia2: self.yaw_inertia2,
            a1: self.a1,
            b1: self.b1,
            c1: self.c1,
            a2: self.a2,
            b2: self.b2,
            stiffness: [self.front_stiffness, self.rear_stiffness, self.trailer_stiffness],
        }
    }

    /// From a truck's linear model; the articulation has its default cost.
    #[must_use]
    pub fn from_articulated(truck: &Articulated) -> Self {
        let [front_stiffness, rear_stiffness, trailer_stiffness] = truck.stiffness;
        Self {
            mass1: truck.mass1,
            mass2: truck.mass2,
            yaw_inertia1: truck.yaw_inertia1,
            yaw_inertia2: truck.yaw_inertia2,
            a1: truck.a1,
            b1: truck.b1,
            c1: truck.c1,
            a2: truck.a2,
            b2: truck.b2,
            front_stiffness,
            rear_stiffness,
            trailer_stiffness,
            ..Self::default()
        }
    }
}

impl TruckControllerParameters {
    /// The settings of the truck paper's tables for a truck.
    #[must_use]
    pub fn of_the_papers(truck: &TruckParameters) -> Self {
        let parameters = Self::for_truck(truck).plain();
        let mpc = parameters.mpc.of_the_papers();
        Self {
            mpc: MpcParameters { horizon: 60, q_e1_rate: 0.4, q_e2: 0.0, r_rate: 0.1, ..mpc },
            ..parameters
        }
    }

    /// The default controller for a truck: its linear model, its limits of steering and articulation, the lag of its drive.
    #[must_use]
    pub fn for_truck(truck: &TruckParameters) -> Self {
        let mut vehicle = NominalTruck::from_articulated(&truck.articulated());
        vehicle.articulation_max = vehicle.articulation_max.min(SAFE_SHARE * truck.hitch.articulation_limit);
        let mpc = MpcParameters {
            horizon: 60,
            q_e1_rate: 6.0,
            q_e2_rate: 3.5,
            r_rate: 0.002,
            r_lateral_jerk: 0.027,
            steer_max: truck.steering.angle_limit,
            steer_rate_max: truck.steering.rate_limit.min(0.6),
            lateral_accel_max: TRUCK_LATERAL_ACCEL,
            ..MpcParameters::default()
        };
        let speed = SpeedParameters {
            controller: SpeedController::Mpc as usize,
            lateral_accel: 1.0,
            accel: 0.5,
            decel: 0.8,
            accel_cmd_max: 1.5,
            decel_cmd_max: 4.0,
            brake_decel: SpeedParameters::braked_by(
                truck.brake.max_force,
                truck.tractor.mass + truck.trailer.mass,
            ),
            grip: SpeedParameters::gripped_by(truck.least_friction(), TRUCK_GRIP),
            ..SpeedParameters::default()
        };
        let longitudinal =
            LongitudinalParameters { drive_lag: truck.drive.lag, ..LongitudinalParameters::default() };
        let actuator = ActuatorParameters::of(&truck.steering);
        let observer = ObserverParameters { disturbance_noise: 0.15, ..ObserverParameters::default() };
        let axles = truck.axle_shares();
        Self { vehicle, mpc, observer, speed, longitudinal, actuator, axles, ..Self::default() }
    }
}
