//! One axle: the suspension between body and wheels, and the loads of both wheels on the body.

use super::wheel_motion::{WheelFlow, WheelMotion};
use super::{
    BODY, HEAVE, HEAVE_RATE, LIFT, LIFT_RATE, PER_WHEEL, PITCH, PITCH_RATE, ROLL, ROLL_RATE, SPIN, VX, VY,
    YAW_RATE,
};

/// One axle with its two wheels; in a group of axles or with twin tyres each stands for all of its side.
pub(in crate::vehicle) struct UnitAxle<T> {
    pub tyre: T,
    /// Tyres that share the load of one side.
    pub tyres: f64,
    /// Forward of the CG, m; rear negative.
    pub x: f64,
    /// Forward of the sprung mass's CG, m.
    pub x_sprung: f64,
    /// Half the track, m.
    pub half_track: f64,
    /// Both wheels, kg.
    pub unsprung_mass: f64,
    pub spring: f64,
    pub damper: f64,
    pub anti_roll_bar: f64,
    pub roll_centre: f64,
    pub camber_gain: f64,
    pub roll_steer: f64,
    /// Sideways velocity of the contacts for each radian per second of roll, m.
    pub sway: f64,
    /// Factor of the steering on the wheels' angle: 1 for steered wheels, else 0.
    pub steered: f64,
    pub wheel_inertia: f64,
    /// Rolling radius, m.
    pub radius: f64,
    pub lateral_compliance: f64,
    /// Load of one wheel at rest, N.
    pub static_load: f64,
    /// Lateral relaxation length that replaces the tyre file's, m; 0 for none.
    pub relaxation: f64,
    /// Share of one wheel in the drive force and in the brake force.
    pub drive_share: f64,
    pub brake_share: f64,
}

/// Loads of one axle on the body.
#[derive(Clone, Copy, Default)]
pub(in crate::vehicle) struct AxleFlow {
    /// Forces of the tyres in body axes, N, and their moment about the CG, N m.
    pub fx: f64,
    pub fy: f64,
    pub moment: f64,
    /// Overturning moment of the contacts, N m.
    pub overturning: f64,
    /// Moment about the y axis that drive and brakes transmit from the wheels to the body, beyond that of the tyres'
    /// longitudinal forces, N m.
    pub reaction: f64,
    /// Forces of the suspension on the body beyond those at rest, left and right, N.
    pub left: f64,
    pub right: f64,
}

impl<T> UnitAxle<T> {
    /// Angle of the wheels to the body, rad, from its roll and the steering angle.
    #[inline]
    pub fn wheel_angle(&self, roll: f64, steer: f64) -> f64 {
        self.steered * steer + self.roll_steer * roll
    }

    /// The axle's part in the mean speed of the driven wheels' rims, m/s; both wheels' states follow each other.
    #[inline(always)]
    pub fn rim_speed(&self, wheels: &[f64]) -> f64 {
        self.drive_share * self.radius * (wheels[SPIN] + wheels[PER_WHEEL + SPIN])
    }

    /// The suspension's forces on the body, and the motion of both wheels (whose states follow each other). The wheels
    /// are at an angle with this sine and cosine, under a drive force and a greatest brake force of the whole vehicle.
    #[inline(always)]
    pub fn suspension(
        &self,
        body: &[f64; BODY],
        wheels: &[f64],
        (sin, cos): (f64, f64),
        (drive, brake): (f64, f64),
    ) -> (AxleFlow, [WheelMotion; 2]) {
        let mut given = AxleFlow::default();
        let vy = body[VY] + self.x * body[YAW_RATE] + self.sway * body[ROLL_RATE];

        // Springs: how far the body stands over each wheel, beyond rest.
        let centre = body[HEAVE] - self.x_sprung * body[PITCH];
        let centre_rate = body[HEAVE_RATE] - self.x_sprung * body[PITCH_RATE];
        let tilt = self.half_track * body[ROLL];
        let tilt_rate = self.half_track * body[ROLL_RATE];
        let (left, right) = (0, PER_WHEEL);
        let rebound = [centre + tilt - wheels[left + LIFT], centre - tilt - wheels[right + LIFT]];
        let rebound_rate = [
            centre_rate + tilt_rate - wheels[left + LIFT_RATE],
            centre_rate - tilt_rate - wheels[right + LIFT_RATE],
        ];
        let twist = (rebound[0] - rebound[1]) / (2.0 * self.half_track);
        let bar = self.anti_roll_bar * twist / (2.0 * self.half_track);
        given.left = -self.spring * rebound[0] - self.damper * rebound_rate[0] - bar;
        given.right = -self.spring * rebound[1] - self.damper * rebound_rate[1] + bar;

        let motion = |side: usize, sign: f64| {
            let vx = body[VX] - sign * self.half_track * body[YAW_RATE];
            WheelMotion {
                vx: vx * cos + vy * sin,
                vy: vy * cos - vx * sin,
                gamma: body[ROLL] + sign * self.camber_gain * rebound[side],
                drive: drive * self.drive_share * self.radius,
                brake: brake * self.brake_share * self.radius,
            }
        };
        (given, [motion(0, 1.0), motion(1, -1.0)])
    }

    /// Loads of both wheels on the body.
    #[inline(always)]
    pub fn gather(&self, wheels: &[WheelFlow], (sin, cos): (f64, f64), given: &mut AxleFlow) {
        let given_by = |wheel: &WheelFlow| {
            let force = &wheel.forces;
            (
                force.fx * cos - force.fy * sin,
                force.fx * sin + force.fy * cos,
                force.mz,
                force.mx + self.lateral_compliance * wheel.load * force.fy,
                (wheel.torque - self.radius * force.fx) * cos,
            )
        };
        let (l, r) = (given_by(&wheels[0]), given_by(&wheels[1]));
        given.fx = l.0 + r.0;
        given.fy = l.1 + r.1;
        given.moment = self.x * given.fy - self.half_track * (l.0 - r.0) + (l.2 + r.2);
        given.overturning = l.3 + r.3;
        given.reaction = l.4 + r.4;
    }
}
