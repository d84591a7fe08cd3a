//! Relations that the columns of a log must satisfy, whatever the vehicle: otherwise a unit or a sign is wrong.
//!
//! ```text
//!     d(yaw)/dt = yaw_rate       |d(x, y)|/dt = vx       course(x, y) = yaw + slip       ay = vx * yaw_rate + ...
//!     d(e1)/dt = e1_rate = vy cos e2 + vx sin e2       d(e2)/dt = e2_rate = yaw_rate - curvature * vx
//!     steer = (l + K vx^2) * yaw_rate / vx               (steady cornering, Rajamani ch. 3.3)
//! ```
//!
//! | file | problem |
//! |---|---|
//! | `ratios.rs` | ratios among columns |
//! | `convert.rs` | units |
//! | `commands.rs` | commands beside what the vehicle does |
//! | `rate_scale.rs` | scale of the yaw-rate sensor |
//! | `signs.rs` | signs, frames, and ratios that no unit explains |

mod commands;
mod convert;
mod rate_scale;
mod ratios;
mod signs;

pub(super) use commands::{check_order, leave_out_rests, steers_early};
pub(super) use convert::{Factors, mend_steering, mend_units};
pub(super) use ratios::{impossible_yaw_rate, is_yaw_rate_wrong, near, turn_factor, way_factor_of};
pub(super) use signs::{check, check_errors};
