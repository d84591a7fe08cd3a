//! Air and a dragging brake: loads on a moving unit beside its tyres.

use super::effects::Effects;

/// Speed over which the steady brake pull builds up, m/s.
const PULLS_FROM: f64 = 1.0;

/// Drag and side force in N of a unit with drag and side constants (half the density times the area, kg/m). It moves
/// with (vx, vy) in m/s in its own axes, at the sine and cosine of its yaw.
#[inline(always)]
pub(super) fn forces(
    effects: &Effects,
    (drag, side): (f64, f64),
    (vx, vy): (f64, f64),
    (sin_yaw, cos_yaw): (f64, f64),
) -> (f64, f64) {
    let air_x = vx - (effects.wind_x * cos_yaw + effects.wind_y * sin_yaw);
    let air_y = vy - (effects.wind_y * cos_yaw - effects.wind_x * sin_yaw);
    let airspeed = (air_x * air_x + air_y * air_y).sqrt();
    (-drag * airspeed * air_x, -side * airspeed * air_y)
}

/// Yaw moment of a dragging brake, N m, at a speed in m/s.
#[inline(always)]
pub(super) fn brake_pull(effects: &Effects, vx: f64) -> f64 {
    effects.brake_pull * (vx.abs() / PULLS_FROM).min(1.0)
}
