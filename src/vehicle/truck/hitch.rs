//! The fifth wheel: the force that keeps tractor and semi-trailer together.
//!
//! In the plane both units share one point. Take the axes of a unit with the hitch at `x`. It is `o = s p` to the left
//! by the roll `p` of the body over the roll axis. The acceleration of the point is
//!
//! ```text
//!     Ax = ax - x r^2 - o r' - 2 r s p'        Ay = ay + x r' - o r^2 + s p''
//! ```
//!
//! and depends linearly on the force `F` in the hitch: `A = A0 + G F`. Equal accelerations of both units give it:
//! `(G1 + R' G2 R) F = R' A20 - A10`, with `R` from the tractor's axes to the semi-trailer's. The semi-trailer's
//! velocity follows from the tractor's, so that nothing drifts apart.
//!
//! Vertically, and in roll, hitch and frames are springs with dampers; in pitch the hitch is free, in yaw it has dry
//! friction.

use crate::vehicle::truck_parameters::Hitch;
use crate::vehicle::tyre::TyreModel;
use crate::vehicle::unit::{
    Acceleration, BODY, DryFriction, Gravity, HEAVE, HEAVE_RATE, PITCH, PITCH_RATE, Push, ROLL, ROLL_RATE,
    UnitConstants, VX, VY, YAW_RATE,
};

/// Natural frequency (rad/s) and damping ratio of the units' yaw on the spring of friction that sticks, and its
/// fastest relaxation (1/s).
const STICK_FREQUENCY: f64 = 30.0;
const STICK_DAMPING: f64 = 0.7;
const STICK_RELAXATION: f64 = 200.0;

/// Place of the hitch on a unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pin {
    /// Forward of the unit's CG and of its body's CG, m.
    pub x: f64,
    x_body: f64,
    /// Height over the body's CG, m.
    over: f64,
    /// Shift to the left for each radian of roll, m.
    sway: f64,
}

impl Pin {
    /// From the place forward of the CG, the heights of hitch and roll axis there, m.
    pub fn new<T, const A: usize>(unit: &UnitConstants<T, A>, x: f64, height: f64, roll_axis: f64) -> Self {
        Self { x, x_body: x - unit.x_sprung, over: height - unit.sprung_height, sway: roll_axis - height }
    }

    /// Shift to the left by the body's roll, m.
    #[inline]
    pub fn offset(&self, body: &[f64; BODY]) -> f64 {
        self.sway * body[ROLL]
    }

    /// Puts the hitch into the plane of CG and roll axis.
    #[cfg(test)]
    pub fn level(&mut self) {
        (self.over, self.sway) = (0.0, 0.0);
    }

    /// Velocity of the hitch in axes of the unit, m/s, less that of the unit's CG.
    #[inline]
    pub fn relative_velocity(&self, body: &[f64; BODY]) -> [f64; 2] {
        [-self.offset(body) * body[YAW_RATE], self.x * body[YAW_RATE] + self.sway * body[ROLL_RATE]]
    }

    /// Height of the hitch over rest, m, and its rate, m/s.
    #[inline]
    fn lift(&self, body: &[f64; BODY]) -> (f64, f64) {
        (body[HEAVE] - self.x_body * body[PITCH], body[HEAVE_RATE] - self.x_body * body[PITCH_RATE])
    }

    /// Part of the hitch's acceleration from accelerations of the unit.
    #[inline]
    fn linear(&self, offset: f64, accel: &Acceleration) -> [f64; 2] {
        [
            accel.specific_x - offset * accel.yaw,
            accel.specific_y + self.x * accel.yaw + self.sway * accel.roll,
        ]
    }

    /// The hitch's acceleration, m/s2.
    #[inline]
    fn acceleration(&self, body: &[f64; BODY], accel: &Acceleration, gravity: &Gravity) -> [f64; 2] {
        let (offset, r) = (self.offset(body), body[YAW_RATE]);
        let [x, y] = self.linear(offset, accel);
        [
            x + gravity.x - self.x * r * r - 2.0 * r * self.sway * body[ROLL_RATE],
            y + gravity.y - offset * r * r,
        ]
    }

    /// Push on the unit by a force in the hitch in its axes, N.
    #[inline]
    pub fn push(&self, body: &[f64; BODY], [fx, fy]: [f64; 2]) -> Push {
        Push {
            longitudinal: fx,
            lateral: fy,
            yawing: self.x * fy - self.offset(body) * fx,
            rolling: -self.over * fy,
        }
    }

    /// Acceleration of the hitch for a force of 1 N along either axis, by columns.
    #[inline]
    fn compliance<T: TyreModel, const A: usize>(
        &self,
        unit: &UnitConstants<T, A>,
        body: &[f64; BODY],
    ) -> [[f64; 2]; 2] {
        [[1.0, 0.0], [0.0, 1.0]]
            .map(|force| self.linear(self.offset(body), &unit.acceleration(&self.push(body, force))))
    }

    /// Moment about the body's y axis, N m, of a force in the hitch: longitudinal, and vertical beyond that at rest.
    #[inline]
    pub fn pitching(&self, fx: f64, fz: f64) -> f64 {
        self.over * fx - self.x_body * fz
    }
}

/// Constants of the hitch.
pub(super) struct HitchPlant {
    /// On the tractor and on the semi-trailer.
    pub pins: [Pin; 2],
    /// Load at rest, N.
    load: f64,
    vertical_stiffness: f64,
    vertical_damping: f64,
    roll_stiffness: f64,
    roll_damping: f64,
    friction: DryFriction,
    /// Greatest friction moment, N m.
    friction_moment: f64,
    /// rad
    pub articulation_limit: f64,
}

/// Loads from the hitch, beyond the forces in the plane.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct HitchFlow {
    /// Load on the tractor, N, and the part of it beyond that at rest.
    pub load: f64,
    pub more: f64,
    /// Moment about the tractor's x axis against its roll, N m.
    pub rolling: f64,
    /// Moment against the articulation, N m, and the rate of its wind-up.
    pub friction: f64,
    pub wind_up_rate: f64,
}

/// From axes of the tractor to those of the semi-trailer, by the sine and cosine of the articulation.
#[inline]
pub(super) fn to_trailer([x, y]: [f64; 2], (sin, cos): (f64, f64)) -> [f64; 2] {
    [cos * x - sin * y, sin * x + cos * y]
}

/// And back.
#[inline]
fn to_tractor(vector: [f64; 2], (sin, cos): (f64, f64)) -> [f64; 2] {
    to_trailer(vector, (-sin, cos))
}

/// Both units' states, tractor first.
pub(super) type Bodies<'a> = [&'a [f64; BODY]; 2];

impl HitchPlant {
    /// Load at rest in N, friction moment in N m, yaw inertias of both units in kg m2.
    pub fn new(hitch: &Hitch, pins: [Pin; 2], load: f64, friction: f64, inertias: [f64; 2]) -> Self {
        let inertia = inertias[0] * inertias[1] / (inertias[0] + inertias[1]);
        Self {
            pins,
            load,
            vertical_stiffness: hitch.vertical_stiffness,
            vertical_damping: hitch.vertical_damping,
            roll_stiffness: hitch.roll_stiffness,
            roll_damping: hitch.roll_damping,
            friction: DryFriction {
                stiffness: inertia * STICK_FREQUENCY * STICK_FREQUENCY,
                damping: 2.0 * STICK_DAMPING * STICK_FREQUENCY * inertia,
                fastest: STICK_RELAXATION,
            },
            friction_moment: friction,
            articulation_limit: hitch.articulation_limit,
        }
    }

    /// Vertical stiffness, N/m, and the places of the hitch forward of the bodies' CGs, m.
    pub fn vertical(&self) -> (f64, [f64; 2]) {
        (self.vertical_stiffness, [self.pins[0].x_body, self.pins[1].x_body])
    }

    /// Velocity of the semi-trailer's CG in its axes, from the other states, m/s.
    #[inline]
    pub fn trailer_velocity(
        &self,
        tractor: &[f64; BODY],
        trailer: &[f64; BODY],
        turn: (f64, f64),
    ) -> [f64; 2] {
        let [x, y] = self.pins[0].relative_velocity(tractor);
        let at_hitch = to_trailer([tractor[VX] + x, tractor[VY] + y], turn);
        let [x, y] = self.pins[1].relative_velocity(trailer);
        [at_hitch[0] - x, at_hitch[1] - y]
    }

    /// Springs and friction of the hitch.
    #[inline]
    pub fn flow(&self, [tractor, trailer]: Bodies, (sin, cos): (f64, f64), wind_up: f64) -> HitchFlow {
        let (low, high) = (self.pins[0].lift(tractor), self.pins[1].lift(trailer));
        let more = self.vertical_stiffness * (low.0 - high.0) + self.vertical_damping * (low.1 - high.1);
        // Roll of the semi-trailer about the tractor's axis.
        let roll = tractor[ROLL] - (trailer[ROLL] * cos + trailer[PITCH] * sin);
        let rate = tractor[ROLL_RATE] - (trailer[ROLL_RATE] * cos + trailer[PITCH_RATE] * sin);
        let articulating = tractor[YAW_RATE] - trailer[YAW_RATE];
        let (friction, wind_up_rate) = self.friction.torque(articulating, wind_up, self.friction_moment);
        HitchFlow {
            load: self.load + more,
            more,
            rolling: self.roll_stiffness * roll + self.roll_damping * rate,
            friction,
            wind_up_rate,
        }
    }

    /// Adds the loads of springs and friction in the plane and in roll to the pushes of both units.
    #[inline]
    pub fn add(
        &self,
        flow: &HitchFlow,
        [tractor, trailer]: Bodies,
        (_, cos): (f64, f64),
        pushes: &mut [Push; 2],
    ) {
        let [on_tractor, on_trailer] = pushes;
        on_tractor.yawing -= flow.friction;
        on_trailer.yawing += flow.friction;
        // The load acts where the hitch has swayed to.
        on_tractor.rolling -= flow.rolling + flow.load * self.pins[0].offset(tractor);
        on_trailer.rolling += flow.rolling * cos + flow.load * self.pins[1].offset(trailer);
    }

    /// The force in the plane that holds the units together: on the tractor, in its axes, N.
    #[inline]
    pub fn force<T: TyreModel>(
        &self,
        (tractor, trailer): (&UnitConstants<T, 2>, &UnitConstants<T, 1>),
        bodies: Bodies,
        pushes: &[Push; 2],
        gravity: &[Gravity; 2],
        turn: (f64, f64),
    ) -> [f64; 2] {
        let [low, high] = &self.pins;
        let first = low.acceleration(bodies[0], &tractor.acceleration(&pushes[0]), &gravity[0]);
        let second = high.acceleration(bodies[1], &trailer.acceleration(&pushes[1]), &gravity[1]);
        let second = to_tractor(second, turn);
        let own = low.compliance(tractor, bodies[0]);
        let other = high.compliance(trailer, bodies[1]);
        // R' G2 R, by columns.
        let (sin, cos) = turn;
        let mix = |[x, y]: [f64; 2]| {
            to_tractor([x * other[0][0] + y * other[1][0], x * other[0][1] + y * other[1][1]], turn)
        };
        let turned = [mix([cos, sin]), mix([-sin, cos])];
        let column = |i: usize| [own[i][0] + turned[i][0], own[i][1] + turned[i][1]];
        let (a, b) = (column(0), column(1));
        let wanted = [second[0] - first[0], second[1] - first[1]];
        let determinant = a[0] * b[1] - b[0] * a[1];
        [
            (wanted[0] * b[1] - b[0] * wanted[1]) / determinant,
            (a[0] * wanted[1] - wanted[0] * a[1]) / determinant,
        ]
    }
}
