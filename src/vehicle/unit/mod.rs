//! One unit on its axles: the common part of a car, a tractor and a semi-trailer.
//!
//! The frame of the axles moves in the plane of the road. The body rolls about the axis through the roll centres, and
//! pitches and heaves over it on springs. The wheels move vertically between springs and tyres. With the specific force
//! `f = a - g` at the CG, roll `p`, roll arm `h`, and small angles of the body:
//!
//! ```text
//!     m fx                        = sum Fx - drag
//!     m fy - ms h p''             = sum Fy + side wind
//!     Iz r' - ms xs h p''         = sum (x Fy - y Fx + Mz)
//!     Ix p'' + sum (hs - hr) mu (fy + x r') = sum y Fs + ms g h p + sum (hs - hr) Fy
//!     Iy q''                      = -sum x Fs - hs sum Fx + sum (hs - R) mu fx - sum (T - R Fx)
//!     ms z''                      = sum Fs - ms g
//!     mw zw''                     = Fz - Fs - mw g +- G,     G = (hr Fyb + R mu (fy + x r') + sum Mx) / track
//! ```
//!
//! `Fs` are the forces of springs, dampers and anti-roll bars, `T` the torques of drive and brakes. `Fyb` is the side
//! force that an axle passes on to the body through its roll centre. Not modelled: jacking, anti-dive and -squat,
//! longitudinal sway of the body, bump stops.
//!
//! | file | idea |
//! |---|---|
//! | `constants.rs` | masses, inertias and axles of a unit with its effects |
//! | `body.rs` | the equations above |
//! | `axle.rs` | suspension, and loads of both wheels on the body |
//! | `wheel.rs` | one wheel: transient slip, forces, spin, brake |
//! | `dry_friction.rs` | friction that holds at rest |

mod axle;
mod body;
mod constants;
mod dry_friction;
mod wheel;
mod wheel_motion;

pub(super) use axle::UnitAxle;
pub(super) use body::{Acceleration, Push};
pub(super) use constants::{AxleParts, Gravity, Laden, Load, Masses, UnitConstants, gravity, gravity_on};
pub(super) use dry_friction::DryFriction;
pub(super) use wheel::{SHORTEST_RELAXATION, SIDES, Wheels, roll};
pub(super) use wheel_motion::WheelFlow;
pub use wheel_motion::WheelOutput;

/// Place of the CG on the road (under the CG, on the roll axis), m.
pub(super) const X: usize = 0;
pub(super) const Y: usize = 1;
/// rad
pub(super) const YAW: usize = 2;
/// Velocity of that place in body axes, m/s.
pub(super) const VX: usize = 3;
pub(super) const VY: usize = 4;
/// rad/s
pub(super) const YAW_RATE: usize = 5;
/// Attitude of the body against the road, rad and rad/s.
pub(super) const ROLL: usize = 6;
pub(super) const ROLL_RATE: usize = 7;
pub(super) const PITCH: usize = 8;
pub(super) const PITCH_RATE: usize = 9;
/// Height of the body against rest, m and m/s.
pub(super) const HEAVE: usize = 10;
pub(super) const HEAVE_RATE: usize = 11;
/// States of a body.
pub(super) const BODY: usize = 12;

/// Spin of a wheel, rad/s.
pub(super) const SPIN: usize = 0;
/// Longitudinal and lateral deflection of the tyre's contact, m.
pub(super) const DEFLECTION_X: usize = 1;
pub(super) const DEFLECTION_Y: usize = 2;
/// Height of the wheel against rest, m and m/s.
pub(super) const LIFT: usize = 3;
pub(super) const LIFT_RATE: usize = 4;
/// Wind-up of the brake, rad.
pub(super) const WIND_UP: usize = 5;
/// States of one wheel.
pub(super) const PER_WHEEL: usize = 6;
