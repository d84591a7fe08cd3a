//! Measured signals of a car.

use super::plant::{CarPlant, STATES};
use crate::enumeration;
use crate::vehicle::sensors::{self, BODY_SIGNALS};
use crate::vehicle::status;
use crate::vehicle::stepper::State;
use crate::vehicle::tyre::TyreModel;
use crate::vehicle::unit::{VX, VY, WheelFlow, WheelOutput};

enumeration! {
    /// Motion of the car, in words.
    pub enum CarStatus {
        Driving = 0 "driving", "The car drives within the grip of its tyres";
        Standstill = 1 "standstill", "The car stands";
        SteeringLimited = 2 "steering_limited", "The angle or rate limit of the steering holds the actuator back";
        WheelSlip = 3 "wheel_slip", "A wheel is locked or spinning";
        Sliding = 4 "sliding", "An axle slides sideways";
        WheelLifted = 5 "wheel_lifted", "A wheel has left the road";
    }
}

/// All measured signals, with effects of the sensors. Units as in `signal`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[allow(missing_docs)]
pub struct CarOutput {
    pub x: f64,
    pub y: f64,
    pub yaw: f64,
    pub vx: f64,
    pub vy: f64,
    pub yaw_rate: f64,
    pub ax: f64,
    pub ay: f64,
    /// Road-wheel angle at the sensor, before gain and offset of the linkage.
    pub steer: f64,
    pub roll: f64,
    pub pitch: f64,
    pub roll_rate: f64,
    /// Real angle of the road wheels, rad.
    pub road_wheel_angle: f64,
    /// Front left, front right, rear left, rear right.
    pub wheels: [WheelOutput; 4],
    /// Force that drive (positive) or brakes (negative, at most) are set to, N.
    pub drive_force: f64,
    /// Arc length on the road, m; 0 without a road.
    pub station: f64,
    pub status: CarStatus,
}

/// Motion signals.
pub(super) const SIGNALS: usize = BODY_SIGNALS;

/// Forces and accelerations at an instant, for outputs.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct CarFlow {
    pub wheels: [WheelFlow; 4],
    /// As outputs, once observed.
    pub outputs: [WheelOutput; 4],
    /// Specific force at the CG in the plane of the road and out of it, m/s2.
    pub specific: [f64; 3],
    /// Drive force asked of the wheels (brakes negative), N.
    pub drive_force: f64,
}

/// The output from the (delayed) motion, and signals without latency.
pub(super) fn measure<T: TyreModel>(
    plant: &CarPlant<T>,
    state: &State<STATES, SIGNALS>,
    flow: &CarFlow,
    delayed: &[f64; SIGNALS],
) -> CarOutput {
    let [x, y, yaw, vx, vy, yaw_rate, ax, ay, roll, pitch, roll_rate] =
        sensors::measured(&plant.effects, delayed);
    CarOutput {
        x,
        y,
        yaw,
        vx,
        vy,
        yaw_rate,
        ax,
        ay,
        steer: state.steering.measured(),
        roll,
        pitch,
        roll_rate,
        road_wheel_angle: state.steering.road_wheel(&plant.steering),
        wheels: flow.outputs,
        drive_force: flow.drive_force,
        station: state.station,
        status: status(state, &flow.outputs),
    }
}

fn status(state: &State<STATES, SIGNALS>, wheels: &[WheelOutput; 4]) -> CarStatus {
    if status::lifted(wheels) {
        CarStatus::WheelLifted
    } else if status::stands(state.y[VX].hypot(state.y[VY]), wheels) {
        CarStatus::Standstill
    } else if status::slides(wheels) {
        CarStatus::Sliding
    } else if status::slips(wheels) {
        CarStatus::WheelSlip
    } else if state.steering.is_limited() {
        CarStatus::SteeringLimited
    } else {
        CarStatus::Driving
    }
}
