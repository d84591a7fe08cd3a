//! Measured signals of a truck.

use super::plant::{STATES, TruckPlant};
use crate::enumeration;
use crate::vehicle::sensors::{self, BODY_SIGNALS};
use crate::vehicle::status;
use crate::vehicle::stepper::State;
use crate::vehicle::tyre::TyreModel;
use crate::vehicle::unit::{VX, VY, WheelFlow, WheelOutput};

enumeration! {
    /// Motion of the truck, in words.
    pub enum TruckStatus {
        Driving = 0 "driving", "The truck drives within the grip of its tyres";
        Standstill = 1 "standstill", "The truck stands";
        SteeringLimited = 2 "steering_limited", "The angle or rate limit of the steering holds the actuator back";
        WheelSlip = 3 "wheel_slip", "A wheel is locked or spinning";
        Sliding = 4 "sliding", "An axle slides sideways";
        WheelLifted = 5 "wheel_lifted", "A wheel has left the road";
        JackKnifing = 6 "jack_knifing", "The articulation is beyond two thirds of the angle at which trailer and cab touch";
    }
}

/// Share of the articulation limit from which on the truck counts as jack-knifing.
const JACK_KNIFING: f64 = 2.0 / 3.0;

/// All measured signals, with effects of the sensors; of the tractor unless stated otherwise. Units as in `signal`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[allow(missing_docs)]
pub struct TruckOutput {
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
    pub articulation: f64,
    pub articulation_rate: f64,
    /// Pose and motion of the semi-trailer's CG.
    pub trailer: TrailerOutput,
    /// Real angle of the road wheels, rad.
    pub road_wheel_angle: f64,
    /// Front, rear and trailer, left and right of each; a wheel stands for all tyres of its side.
    pub wheels: [WheelOutput; 6],
    /// Force of the semi-trailer on the tractor, N: forward, to the left, and downwards.
    pub hitch: [f64; 3],
    /// Force that drive (positive) or brakes (negative, at most) are set to, N.
    pub drive_force: f64,
    /// Arc length on the road, m; 0 without a road.
    pub station: f64,
    pub status: TruckStatus,
}

/// The semi-trailer, as outputs: its CG in m and rad, velocities in its axes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[allow(missing_docs)]
pub struct TrailerOutput {
    pub x: f64,
    pub y: f64,
    pub yaw: f64,
    pub vx: f64,
    pub vy: f64,
    pub yaw_rate: f64,
    pub roll: f64,
}

/// Motion signals.
pub(super) const SIGNALS: usize = BODY_SIGNALS + 9;

/// Forces and accelerations at an instant, for outputs.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TruckFlow {
    pub wheels: [WheelFlow; 6],
    /// As outputs, once observed.
    pub outputs: [WheelOutput; 6],
    /// Specific force at the tractor's CG in the plane of the road and out of it, m/s2.
    pub specific: [f64; 3],
    /// Force of the semi-trailer on the tractor in the tractor's axes; the vertical one downwards, N.
    pub hitch: [f64; 3],
    /// Drive force asked of the wheels (brakes negative), N.
    pub drive_force: f64,
}

/// The output from the (delayed) motion, and signals without latency.
pub(super) fn measure<T: TyreModel>(
    plant: &TruckPlant<T>,
    state: &State<STATES, SIGNALS>,
    flow: &TruckFlow,
    delayed: &[f64; SIGNALS],
) -> TruckOutput {
    let [x, y, yaw, vx, vy, yaw_rate, ax, ay, roll, pitch, roll_rate] =
        sensors::measured(&plant.effects.vehicle, delayed);
    let more: [f64; SIGNALS - BODY_SIGNALS] = std::array::from_fn(|i| delayed[BODY_SIGNALS + i]);
    let [articulation, articulation_rate, of_trailer @ ..] = more;
    let [trailer_x, trailer_y, trailer_yaw, trailer_vx, trailer_vy, trailer_yaw_rate, trailer_roll] =
        of_trailer;
    TruckOutput {
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
        articulation: articulation + plant.effects.trailer.articulation_bias,
        articulation_rate,
        trailer: TrailerOutput {
            x: trailer_x,
            y: trailer_y,
            yaw: trailer_yaw,
            vx: trailer_vx,
            vy: trailer_vy,
            yaw_rate: trailer_yaw_rate,
            roll: trailer_roll,
        },
        road_wheel_angle: state.steering.road_wheel(&plant.steering),
        wheels: flow.outputs,
        hitch: flow.hitch,
        drive_force: flow.drive_force,
        station: state.station,
        status: status(plant, state, flow),
    }
}

fn status<T: TyreModel>(
    plant: &TruckPlant<T>,
    state: &State<STATES, SIGNALS>,
    flow: &TruckFlow,
) -> TruckStatus {
    let wheels = &flow.outputs;
    if plant.articulation(&state.y).abs() > JACK_KNIFING * plant.hitch.articulation_limit {
        TruckStatus::JackKnifing
    } else if status::lifted(wheels) {
        TruckStatus::WheelLifted
    } else if status::stands(state.y[VX].hypot(state.y[VY]), wheels) {
        TruckStatus::Standstill
    } else if status::slides(wheels) {
        TruckStatus::Sliding
    } else if status::slips(wheels) {
        TruckStatus::WheelSlip
    } else if state.steering.is_limited() {
        TruckStatus::SteeringLimited
    } else {
        TruckStatus::Driving
    }
}
