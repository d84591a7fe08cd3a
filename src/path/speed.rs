//! Speed plan within lateral and longitudinal limits.
//!
//! ```text
//!     v(s) <= min(limit of the road, limit of the user, sqrt(a_lat / |curvature|))
//!     v |curvature'| <= curvature rate,   v^3 |curvature'| <= lateral jerk              (what steering can follow)
//!     |curvature'| as driven: from lock to lock at most, over LOCK_TO_LOCK              (a kink is rounded)
//!     atan(wheelbase kappa_rear) + understeer v^2 |curvature| <= STEERED_SHARE lock     (or WALKING_PACE)
//!     -decel(v) <= v dv/ds <= accel(v),   both scaled by sqrt(1 - (v^2 curvature / a_lat)^2)   (friction ellipse)
//! ```
//!
//! Each half-axis is the driver's wish, or less where tyres do not give it: the road's friction factor times the grip
//! on a dry road, less what holds the vehicle on a bank or a slope. Not all of it drives or brakes ([`DRIVEN_SHARE`],
//! [`BRAKED_SHARE`], less where an axle has a larger share of the force than of the weight), and brakes give no more than
//! their force.
//!
//! One pass backwards for braking, one forwards for accelerating, in `v^2`, which is linear in `s` at constant
//! acceleration. Last, `v^2` is replaced by a sliding mean of its sliding minimum over [`BLEND`]. The result stays
//! below the limits, is no steeper, and has an acceleration without jumps.

use super::{AxleShares, Path};
use crate::signal::GRAVITY;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Reserved share of the ellipse's longitudinal half-axis, so that a plan can still change speed in a bend that is
/// driven at the limit.
const LEAST_SHARE: f64 = 0.15;
/// Share of the grip that drives at most: that of the weight on the axle that does.
pub const DRIVEN_SHARE: f64 = 0.5;
/// Share of the grip that brakes at most: brakes are shared for a dry road, and elsewhere one axle locks before the
/// other. A locked wheel neither steers nor brakes as well.
pub const BRAKED_SHARE: f64 = 0.85;
/// Share that a plan brakes with: the rest is for a vehicle that is too fast for it.
const PLANNED_BRAKING: f64 = 0.65;

/// Share of the tyres' grip that a plan uses.
pub const USED_GRIP: f64 = 0.8;
/// Largest part of the grip of a car's tyres that a plan uses on a dry road, m/s2.
pub const CAR_GRIP: f64 = USED_GRIP * GRAVITY;
/// ... and of a truck's, whose hard tyres have three quarters of it.
pub const TRUCK_GRIP: f64 = 0.6 * GRAVITY;

/// Way over which the steering goes from lock to lock where the points have a kink, m: none drives tighter than it can turn.
const LOCK_TO_LOCK: f64 = 2.0;
/// Share of the steering's lock that a bend may take: the rest is for errors.
const STEERED_SHARE: f64 = 0.95;
/// Speed in a bend that takes all of the lock and more, m/s.
const WALKING_PACE: f64 = 1.4;
/// Length over which the acceleration changes from one value to the next in m.
const BLEND: f64 = 4.0;

/// Limits of a speed plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedLimits {
    /// Lateral acceleration in m/s2.
    pub lateral_accel: f64,
    /// Acceleration in m/s2.
    pub accel: f64,
    /// Deceleration in m/s2, positive.
    pub decel: f64,
    /// Largest deceleration that the brakes give on a level road in m/s2; infinite for no limit.
    pub brake_decel: f64,
    /// Speed in m/s.
    pub speed: f64,
    /// Rate of the driven curvature in 1/(m s): about the steering's rate over the wheelbase; infinite for no limit.
    pub curvature_rate: f64,
    /// How tightly the vehicle turns; `None` for no limit.
    pub turn: Option<TightestTurn>,
    /// Lateral jerk in m/s3; infinite for no limit.
    pub lateral_jerk: f64,
    /// Largest part of the tyres' grip that a plan uses where the friction factor is 1, in m/s2.
    pub grip: f64,
    /// What of that the axles hold.
    pub axles: AxleShares,
}

impl Default for SpeedLimits {
    /// A calm driver: 2.25 m/s2 sideways, 1.2 forward, 1.8 braking, 50 m/s; steering that is fast enough, a car's tyres.
    fn default() -> Self {
        let without = f64::INFINITY;
        Self {
            lateral_accel: 2.25,
            accel: 1.2,
            decel: 1.8,
            brake_decel: without,
            speed: 50.0,
            curvature_rate: without,
            turn: None,
            lateral_jerk: without,
            grip: CAR_GRIP,
            axles: AxleShares::UNKNOWN,
        }
    }
}

/// How tightly a vehicle turns: its steering's lock, and what of it understeer takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TightestTurn {
    /// Steering angle at the lock in rad.
    pub lock: f64,
    /// Distance between the axles in m.
    pub wheelbase: f64,
    /// Distance of the rear axle behind the point that follows the path in m.
    pub rear: f64,
    /// Understeer gradient: steering angle for each m/s2 of lateral acceleration in rad s2/m.
    pub understeer: f64,
}

impl TightestTurn {
    /// Radius in m of the circle at the lock, of the point that follows the path, without slip.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius_at(1.0)
    }

    /// Radius in m of the circle at a share of the lock, of the point that follows the path, without slip.
    #[must_use]
    pub fn radius_at(&self, share: f64) -> f64 {
        (self.wheelbase / (share * self.lock).tan()).hypot(self.rear)
    }

    /// Largest squared speed in a bend in m2/s2.
    fn largest_square(&self, curvature: f64) -> f64 {
        let bend = curvature.abs();
        if bend == 0.0 {
            return f64::INFINITY;
        }
        // The rear axle's circle is the smaller one; none at all is as good as a tight one.
        let at_rear = (1.0 / (bend * bend) - self.rear * self.rear).max(0.0).sqrt();
        let left = STEERED_SHARE * self.lock - self.wheelbase.atan2(at_rear);
        let least = WALKING_PACE * WALKING_PACE;
        if left > 0.0 { (left / (self.understeer.max(0.0) * bend)).max(least) } else { least }
    }
}

/// The plans in use on a path: controllers on one road share one. Locked during their set-up, never during steps.
#[derive(Debug, Default)]
pub(super) struct SharedPlans(Mutex<Vec<(SpeedLimits, Weak<SpeedPlan>)>>);

impl Clone for SharedPlans {
    /// Plans are made anew.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Path {
    /// The speed plan along the path that comes to a stop at the end of an open one; shared by all callers.
    #[must_use]
    pub fn plan_to_the_end(&self, limits: &SpeedLimits) -> Arc<SpeedPlan> {
        let mut plans = self.plans.0.lock().unwrap_or_else(PoisonError::into_inner);
        plans.retain(|(_, plan)| plan.strong_count() > 0);
        let known = plans.iter().find(|(of, _)| of == limits).and_then(|(_, plan)| plan.upgrade());
        known.unwrap_or_else(|| {
            let plan = Arc::new(SpeedPlan::between(self, limits, None, true));
            plans.push((*limits, Arc::downgrade(&plan)));
            plan
        })
    }
}

/// Speed over station; lookups take constant time.
#[derive(Debug, Clone)]
pub struct SpeedPlan {
    inverse_step: f64,
    step: f64,
    length: f64,
    periodic: bool,
    /// Squared speed at the nodes.
    squares: Vec<f64>,
}

impl SpeedPlan {
    /// Plans the speed along a path. An open path's plan starts and ends at whatever speed the limits allow.
    #[must_use]
    pub fn new(path: &Path, limits: &SpeedLimits) -> Self {
        Self::between(path, limits, None, false)
    }

    /// Plans the speed along a path. An open path's plan starts at `start` (m/s), if given, or slower where the road
    /// requires it. It comes to a stop at the end, if asked to.
    #[must_use]
    pub fn between(path: &Path, limits: &SpeedLimits, start: Option<f64>, stop_at_end: bool) -> Self {
        let count = path.cells.len();
        let step = path.step;
        let curvature: Vec<f64> = (0..=count).map(|i| path.curvature(i as f64 * step)).collect();
        let mut lateral = Vec::with_capacity(count + 1);
        let mut along = Vec::with_capacity(count + 1);
        let driven = limits.turn.map_or(f64::INFINITY, |turn| 2.0 / (turn.radius() * LOCK_TO_LOCK));
        let mut squares: Vec<f64> = (0..=count)
            .map(|i| {
                let spot = path.locate(i as f64 * step);
                let friction = path.friction.at(&spot, path.inverse_step);
                let road = path.speed.at(&spot, path.inverse_step);
                // Gravity in the road's plane: down its bank, and down its slope.
                let [to_right, back] =
                    [&path.bank, &path.grade].map(|q| GRAVITY * q.at(&spot, path.inverse_step).sin());
                let grip = limits.grip * friction;
                let outwards = to_right * curvature[i].signum();
                let limit = limits.lateral_accel.min(grip - outwards).max(1e-3);
                lateral.push(limit);
                // Plans keep their distance to what the axles hold.
                let all_held = limits.axles.braking(grip, BRAKED_SHARE) / BRAKED_SHARE;
                let braked = (all_held * grip).min(limits.brake_decel);
                let drive = limits.axles.driving(grip, DRIVEN_SHARE) * grip;
                along.push([
                    limits
                        .decel
                        .min(PLANNED_BRAKING * braked + back)
                        .max(LEAST_SHARE * limits.decel.min(braked)),
                    limits.accel.min(drive - back).max(LEAST_SHARE * limits.accel.min(grip)),
                ]);
                let top = if road.is_nan() { limits.speed } else { limits.speed.min(road) };
                let change = path.curvature_rate(i as f64 * step).abs().min(driven).max(1e-12);
                let steered = (limits.curvature_rate / change).min((limits.lateral_jerk / change).cbrt());
                let turned = limits.turn.map_or(f64::INFINITY, |turn| turn.largest_square(curvature[i]));
                (top * top).min(limit / curvature[i].abs().max(1e-9)).min(steered * steered).min(turned)
            })
            .collect();
        if !path.periodic {
            if let Some(start) = start {
                squares[0] = squares[0].min(start * start);
            }
            if stop_at_end {
                squares[count] = 0.0;
            }
        }
        let share = |i: usize, square: f64| {
            let used = square * curvature[i].abs() / lateral[i];
            (1.0 - used * used).max(0.0).sqrt().max(LEAST_SHARE)
        };
        // A closed path's limits reach over its start: a second round carries them.
        for _ in 0..if path.periodic { 2 } else { 1 } {
            if path.periodic {
                let both = squares[0].min(squares[count]);
                (squares[0], squares[count]) = (both, both);
            }
            for i in (0..count).rev() {
                let reachable = squares[i + 1] + 2.0 * along[i + 1][0] * share(i + 1, squares[i + 1]) * step;
                squares[i] = squares[i].min(reachable);
            }
            for i in 0..count {
                let reachable = squares[i] + 2.0 * along[i][1] * share(i, squares[i]) * step;
                squares[i + 1] = squares[i + 1].min(reachable);
            }
        }
        let ends = if path.periodic { None } else { Some((start.is_some(), stop_at_end)) };
        let squares = blend(&squares, (0.5 * BLEND / step).round() as usize, ends);
        Self { inverse_step: path.inverse_step, step, length: path.length, periodic: path.periodic, squares }
    }

    /// Time to drive the path, or one lap of it, by this plan in s; infinite if the plan stands still on the way.
    #[must_use]
    pub fn duration(&self) -> f64 {
        // At constant acceleration the mean speed of a step is the mean of its ends.
        let time = |pair: &[f64]| 2.0 * self.step / (pair[0].max(0.0).sqrt() + pair[1].max(0.0).sqrt());
        self.squares.windows(2).map(time).sum()
    }

    /// Speed at a station in m/s. Beyond the ends of an open path: as at the end.
    #[must_use]
    #[inline]
    pub fn speed(&self, station: f64) -> f64 {
        let (i, offset, _) = self.locate(station);
        let (a, b) = (self.squares[i], self.squares[i + 1]);
        (a + offset * self.inverse_step * (b - a)).max(0.0).sqrt()
    }

    /// Acceleration at a station in m/s2; 0 beyond the ends of an open path.
    #[must_use]
    #[inline]
    pub fn accel(&self, station: f64) -> f64 {
        let (i, _, beyond) = self.locate(station);
        if beyond { 0.0 } else { 0.5 * (self.squares[i + 1] - self.squares[i]) * self.inverse_step }
    }

    #[inline]
    fn locate(&self, station: f64) -> (usize, f64, bool) {
        let s = if station.is_finite() { station } else { 0.0 };
        let inside = if self.periodic {
            (s - (s / self.length).floor() * self.length).clamp(0.0, self.length)
        } else {
            s.clamp(0.0, self.length)
        };
        let i = ((inside * self.inverse_step) as usize).min(self.squares.len() - 2);
        (i, inside - i as f64 * self.step, !self.periodic && inside != s)
    }
}

/// Sliding mean of the sliding minimum over `reach` nodes to each side. At an end of an open path with a fixed speed
/// (`ends`: at the start, at the end) it blends into the original plan. So the speed is met.
fn blend(squares: &[f64], reach: usize, ends: Option<(bool, bool)>) -> Vec<f64> {
    let last = squares.len() - 1;
    let reach = reach as isize;
    let window = |i: usize| i as isize - reach..=i as isize + reach;
    // Closed: the last node is the first one.
    let index = |j: isize| match ends {
        None => j.rem_euclid(last as isize) as usize,
        Some(_) => j.clamp(0, last as isize) as usize,
    };
    let least: Vec<f64> =
        (0..=last).map(|i| window(i).map(|j| squares[index(j)]).fold(f64::INFINITY, f64::min)).collect();
    let count = (2 * reach + 1) as f64;
    (0..=last)
        .map(|i| {
            let mean = window(i).map(|j| least[index(j)]).sum::<f64>() / count;
            let (start, end) = ends.unwrap_or((false, false));
            // Over 10 reaches, so that giving way itself hardly accelerates.
            let share = |nodes: usize| (nodes as f64 / (10 * reach).max(1) as f64).min(1.0);
            let share = if start { share(i) } else { 1.0 }.min(if end { share(last - i) } else { 1.0 });
            squares[i] + share * (mean - squares[i])
        })
        .collect()
}
