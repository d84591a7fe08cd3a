//! What the road leaves to drive and brakes: grip beside steering, and gravity along a slope.
//!
//! A wheel that is asked for more than its tyre gives locks or spins, and no longer steers. The tyres' acceleration is
//! within a circle of the road's friction factor times the grip on a dry road, and steering comes first:
//!
//! ```text
//! a_x^2 + (v^2 kappa + g sin bank)^2 <= (mu grip)^2
//! ```
//!
//! Of what is left an axle gives as much as its load allows, and drive and brakes ask each axle for its share
//! ([`AxleShares`]).
//!
//! Drive and brakes have a lag: a vehicle that accelerates onto ice still does on it. So the drive is bounded by the
//! least grip of the road over the next [`PREVIEW`].

use super::preview::bank_accel;
use crate::path::{AxleShares, BRAKED_SHARE, DRIVEN_SHARE, Path};
use crate::signal::GRAVITY;

/// Least share of the grip, and of the safe stop's deceleration, however much of it the steering needs.
pub(super) const LEAST_SHARE: f64 = 0.3;
/// Time of the road ahead that counts, s.
const PREVIEW: f64 = 0.5;
/// Number of points on the road over that time.
const POINTS: u32 = 5;

/// Longitudinal acceleration that a grip leaves beside a lateral one, m/s2.
pub(super) fn beside(lateral: f64, grip: f64) -> f64 {
    (grip * grip - lateral * lateral).max(0.0).sqrt()
}

/// The road at a vehicle and shortly before it; m/s2.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoadAhead {
    /// Largest lateral acceleration that its bends ask for.
    pub lateral: f64,
    /// Deceleration that the axles hold beside that.
    pub brakes: f64,
    /// Acceleration that they hold.
    pub drives: f64,
    /// Acceleration that holds the vehicle on the slope that the path tells of; negative downhill.
    pub holding: f64,
}

impl RoadAhead {
    /// The road from a station on, at a speed, for a vehicle with this grip on a dry road and these axles.
    pub fn look(path: &Path, station: f64, speed: f64, grip: f64, axles: &AxleShares) -> Self {
        let mut ahead =
            Self { lateral: 0.0, brakes: 0.0, drives: f64::INFINITY, holding: holding(path, station) };
        for k in 0..POINTS {
            let time = PREVIEW * f64::from(k) / f64::from(POINTS - 1);
            let there = station + time * speed.max(0.0);
            let bend = speed * speed * path.curvature(there);
            ahead.lateral = ahead.lateral.max(bend.abs());
            let grip = grip * path.friction(there);
            let left = beside(bend - bank_accel(path, there), grip).max(LEAST_SHARE * grip);
            ahead.drives = ahead.drives.min(axles.driving(left, DRIVEN_SHARE) * left);
        }
        let grip = grip * path.friction(station);
        let lateral = ahead.lateral.max(bank_accel(path, station).abs());
        let left = beside(lateral, grip).max(LEAST_SHARE * grip);
        ahead.brakes = axles.braking(left, BRAKED_SHARE) * left;
        ahead
    }
}

/// Acceleration that holds a vehicle on the slope at a station, m/s2.
pub(super) fn holding(path: &Path, station: f64) -> f64 {
    GRAVITY * path.grade(station).sin()
}
