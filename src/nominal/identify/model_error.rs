//! Errors of a linear vehicle between actuator and response, as a spread of the constants.
//!
//! For each way in which the vehicle may be off, by a standard deviation, its answer changes by `d(t)`. The constants that
//! fit `y + d` and `y - d` differ from those that fit `y`; over all ways these differences add up as squares. An axle's
//! stiffness is off in three ways, all by its derivative `d_i = dy / d ln C_i`:
//!
//! ```text
//! d = 0.1 d_i                          an axle by itself: steer by roll, camber and forces, load, the tyre
//! d = -|ay| / (3 g) d_i                its tyres lose stiffness with slip (brush model on a dry road), more where load moves
//! d = -0.4 m / v  sum_i d_i'           their force follows a relaxation length
//! ```
//!
//! Yaw inertias are off by 5 %, as in a diagnosis.
//!
//! Sources: Bundorf and Leffert, The Cornering Compliance Concept, SAE 760713 (what the suspension adds to the tyres' share);
//! Pacejka, Tire and Vehicle Dynamics, ch. 3.2 (brush), ch. 7.1 (relaxation lengths).

use super::best_point::BestPoint;
use super::estimate::Estimate;
use super::fit::{ActuatorProblem, Point};
use super::interval::GAUSS;
use crate::nominal::{LateralVehicle, SingleTrackError};
use crate::signal::GRAVITY;

/// Standard deviations: of an axle's stiffness and of a yaw inertia, as shares; of the relaxation length, m.
const STIFFNESS: f64 = 0.1;
const INERTIA: f64 = 0.05;
const RELAXATION: f64 = 0.4;
/// Windows about the best point, s, and rounds that follow it.
const DEAD_TIMES: f64 = 0.01;
const LAGS: f64 = 0.02;
const ROUNDS: usize = 4;
const FINE: f64 = 3e-4;

/// Distances of the truth below and above the best fit, with the confidence of the intervals.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Reach {
    below: f64,
    above: f64,
}

impl Reach {
    /// An interval with this beside it.
    pub fn widen(self, of: Estimate) -> Estimate {
        let Estimate { value, low, high, excited } = of;
        let (low, high) = (value - (value - low).hypot(self.below), value + (high - value).hypot(self.above));
        Estimate { value, low, high, excited }
    }

    fn add(&mut self, [one, other]: [f64; 2]) {
        self.below = self.below.hypot(GAUSS * one.min(other).min(0.0));
        self.above = self.above.hypot(GAUSS * one.max(other).max(0.0));
    }
}

/// The same of each constant; nothing where no vehicle lies between.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ConstantsReach {
    pub dead_time: Reach,
    pub lag: Reach,
    pub delay: Reach,
    pub gain: Reach,
    /// Of the offset at the wheels.
    pub offset: Reach,
}

/// Constants of a point.
fn constants(point: &Point, offset: usize) -> [f64; 5] {
    let Point { dead_time, lag, beta, .. } = *point;
    [dead_time, lag, dead_time + lag, beta[0], beta[offset]]
}

impl BestPoint {
    /// The spread that the vehicle's errors give to the constants.
    ///
    /// # Errors
    /// A vehicle whose model cannot be made.
    pub fn model_error<V: LateralVehicle<S>, const S: usize>(
        &self,
        vehicle: &V,
        slowest: f64,
    ) -> Result<ConstantsReach, SingleTrackError> {
        // A part tells how the constants answer.
        let mut part = self.problem.part();
        let best = part.settle(&self.best);
        part.residuals(&best);
        let rows = &part.rows;
        let answer: Vec<f64> = rows.response.iter().zip(&part.residual).map(|(y, r)| y - r).collect();
        let off = |other: V| -> Result<Vec<f64>, SingleTrackError> {
            let response = part.response.behind(rows, &other, slowest)?;
            let mut problem = ActuatorProblem::new(rows.clone(), response);
            problem.residuals(&best);
            let off = rows.response.iter().zip(&problem.residual).zip(&answer);
            Ok(off.map(|((y, residual), answer)| y - residual - answer).collect())
        };
        let speed = |row: usize| rows.speed[row].max(slowest);
        let accel = |row: usize| (speed(row) * (answer[row] + rows.mean)).abs();
        let mut ways: Vec<Vec<f64>> = Vec::new();
        let mut all = vec![0.0; answer.len()];
        for other in vehicle.stiffness_off(STIFFNESS) {
            let way = off(other)?;
            all.iter_mut().zip(&way).for_each(|(all, way)| *all += way / STIFFNESS);
            let slipping = |(row, way): (usize, &f64)| -accel(row) / (3.0 * GRAVITY) * way / STIFFNESS;
            ways.push(way.iter().enumerate().map(slipping).collect());
            ways.push(way);
        }
        for other in vehicle.inertia_off(INERTIA) {
            ways.push(off(other)?);
        }
        let mut late = vec![0.0; all.len()];
        for stretch in rows.stretches() {
            for row in stretch.clone() {
                let (from, to) = (row.saturating_sub(1).max(stretch.start), (row + 1).min(stretch.end - 1));
                let duration = (rows.time[to] - rows.time[from]).max(1e-9);
                late[row] = -RELAXATION / speed(row) * (all[to] - all[from]) / duration;
            }
        }
        ways.push(late);
        let place = part.response.offset_column();
        let exact = constants(&best, place);
        let mut reaches = [Reach::default(); 5];
        for way in &ways {
            let [one, other] = [1.0, -1.0].map(|sign| {
                let mut changed = part.clone();
                changed.rows.response.iter_mut().zip(way).for_each(|(y, off)| *y += sign * off);
                constants(&changed.settle(&best), place)
            });
            for (i, reach) in reaches.iter_mut().enumerate() {
                reach.add([one[i] - exact[i], other[i] - exact[i]]);
            }
        }
        let [dead_time, lag, delay, gain, offset] = reaches;
        Ok(ConstantsReach { dead_time, lag, delay, gain, offset })
    }
}

impl ActuatorProblem {
    /// The best point near one, followed until it stands.
    fn settle(&mut self, near: &Point) -> Point {
        let mut best = *near;
        for _ in 0..ROUNDS {
            let found = self.refine(&best, DEAD_TIMES, LAGS);
            let moved = (found.dead_time - best.dead_time).abs().max((found.lag - best.lag).abs());
            best = found;
            if moved < FINE {
                break;
            }
        }
        best
    }
}
