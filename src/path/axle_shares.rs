//! Shares of the axles in weight, drive and brakes: the axle that is asked for most beside its load slides first.
//!
//! With the share `w` of the weight on an axle, the share `s` of the force at it, and `h` of the weight that moves to it for
//! each m/s2, the axle holds an acceleration `a` on a grip `G` that is left beside steering, as long as
//!
//! ```text
//!     s a <= (w + h a) G,      a <= G w / (s - h G)
//! ```
//!
//! In a bend the axles' lateral forces are as their loads, so that `G` is the same for all.

/// Axles at most: front, rear, and a trailer's group.
const AXLES: usize = 3;

/// Shares of the axles in weight, drive and brakes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxleShares {
    /// In the weight at rest, on a level road.
    weight: [f64; AXLES],
    /// In the drive's force.
    drive: [f64; AXLES],
    /// In the brakes' force.
    brake: [f64; AXLES],
    /// Share of the weight that braking moves from the rear axle to the front one, for each m/s2.
    moved: f64,
}

impl Default for AxleShares {
    fn default() -> Self {
        Self::UNKNOWN
    }
}

impl AxleShares {
    /// Forces that are as the loads.
    pub const UNKNOWN: Self =
        Self { weight: [0.0; AXLES], drive: [0.0; AXLES], brake: [0.0; AXLES], moved: 0.0 };

    /// Of axle loads in N and shares of forces. `moved` is the share of the weight that braking moves from the rear axle
    /// to the front one, for each m/s2.
    #[must_use]
    pub fn new(loads: [f64; AXLES], drive: [f64; AXLES], brake: [f64; AXLES], moved: f64) -> Self {
        let weight: f64 = loads.iter().sum();
        Self { weight: loads.map(|load| load / weight), drive, brake, moved }
    }

    /// Share of a grip, m/s2, that drives, `usual` at most.
    #[must_use]
    pub fn driving(&self, grip: f64, usual: f64) -> f64 {
        self.held(&self.drive, -self.moved * grip).min(usual)
    }

    /// Share of a grip, m/s2, that brakes, `usual` at most.
    #[must_use]
    pub fn braking(&self, grip: f64, usual: f64) -> f64 {
        self.held(&self.brake, self.moved * grip).min(usual)
    }

    /// Least `w / (s - h G)` of the axles; `gained` is that of the front axle's `h G`, which the rear one loses.
    fn held(&self, shares: &[f64; AXLES], gained: f64) -> f64 {
        let held = |axle: usize| match shares[axle] - [gained, -gained, 0.0][axle] {
            needed if needed > 0.0 => self.weight[axle] / needed,
            _ => f64::INFINITY,
        };
        let used = (0..AXLES).filter(|&axle| shares[axle] > 0.0);
        used.map(held).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axle_that_slides_first_bounds_the_acceleration() {
        let car = AxleShares::new([3e3, 7e3, 0.0], [1.0, 0.0, 0.0], [0.6, 0.4, 0.0], 0.02);
        // Front: 0.6 a = (0.3 + 0.02 a) 2.
        let a = 2.0 * car.braking(2.0, 1.0);
        assert!((0.6 * a - (0.3 + 0.02 * a) * 2.0).abs() < 1e-12, "{a}");
        // Driven at the front, which loses weight.
        let a = 2.0 * car.driving(2.0, 1.0);
        assert!((a - (0.3 - 0.02 * a) * 2.0).abs() < 1e-12, "{a}");
        // Brakes at the rear alone: on much grip the rear axle loses its weight.
        let rear = AxleShares::new([5e3, 5e3, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.05);
        assert!(rear.braking(8.0, 1.0) < rear.braking(2.0, 1.0));
        // Unknown, or as the loads: the usual share.
        assert_eq!(AxleShares::default().braking(2.0, 0.85), 0.85);
        let fitting = AxleShares::new([4e3, 3e3, 3e3], [0.0, 1.0, 0.0], [0.4, 0.3, 0.3], 0.0);
        assert_eq!(fitting.braking(2.0, 0.85), 0.85);
        assert!((fitting.driving(2.0, 0.5) - 0.3).abs() < 1e-12);
    }
}
