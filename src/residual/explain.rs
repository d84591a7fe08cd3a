//! Explanation of the samples by a linear vehicle behind an actuator, block by block: the criterion for choosing a
//! plant.
//!
//! ```text
//! J_block = sum_k |(x_{k+1} - f(x_k, u_k, u_{k-1}, ..))_{2, 4}|^2         rates of lateral and yaw error, one step ahead
//! ```

use super::ROAD;
use super::dataset::{DataSet, acceleration};
use crate::nominal::{ActuatedModel, ActuatedState, Actuator, LateralVehicle, SingleTrackError};
use nalgebra::SVector;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Rows of a block, s.
const BLOCK: f64 = 2.0;
/// Lateral acceleration above which tyres are not linear, m/s2.
const LINEAR: f64 = 3.0;
/// Speeds that have one model, m/s.
const SPEED_STEP: f64 = 0.5;

/// Misfit of one block.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BlockMisfit {
    /// Steps.
    pub steps: usize,
    /// Sums of squares: of the rate of the lateral error, m2/s2, and of the yaw error, rad2/s2.
    pub squares: [f64; 2],
}

impl<V: LateralVehicle<S>, const S: usize> DataSet<V, S> {
    /// One-step misfit of a vehicle behind an actuator and a linkage, which turns the wheels by `gain` times the angle that was commanded, and
    /// `offset`, rad.
    /// Steps beyond the linear range of tyres are left out.
    ///
    /// # Errors
    /// Vehicle parameters that are not positive.
    pub fn misfit(
        &self,
        vehicle: &V,
        actuator: &Actuator,
        [gain, offset]: [f64; 2],
    ) -> Result<Vec<BlockMisfit>, SingleTrackError> {
        let sample_time = self.config.sample_time;
        let rows = (BLOCK / sample_time).ceil() as usize;
        let mut models: BTreeMap<u32, ActuatedModel<S>> = BTreeMap::new();
        let sampled = actuator.sample(sample_time);
        let delay = sampled.delay();
        let mut blocks = vec![];
        for stretch in self.stretches() {
            let command = |k: usize, back: usize| gain * stretch[k.saturating_sub(back)].command + offset;
            let mut inner = sampled.steady(command(0, 0));
            for (k, pair) in stretch.windows(2).enumerate() {
                if k % rows == 0 {
                    blocks.push(BlockMisfit::default());
                }
                let (now, next) = (&pair[0], &pair[1]);
                let place =
                    (now.road[0].max(self.config.min_model_speed) / SPEED_STEP).round().max(1.0) as u32;
                if let Entry::Vacant(free) = models.entry(place) {
                    let model = vehicle.model_at(SPEED_STEP * f64::from(place))?;
                    free.insert(actuator.discretise(&model, sample_time));
                }
                let model = &models[&place];
                let [v, curvature, curvature_rate]: [f64; ROAD] =
                    std::array::from_fn(|r| 0.5 * (now.road[r] + next.road[r]));
                let accel = acceleration(&stretch, k, sample_time);
                let state = ActuatedState { vehicle: SVector::from(now.state), actuator: inner };
                let (newer, older) = (command(k, delay), command(k, delay + 1));
                let predicted = &model.a * &state
                    + model.newer * newer
                    + model.older * older
                    + model.d * (v * curvature)
                    + model.e * (v * v * curvature_rate + accel * curvature);
                inner = predicted.actuator;
                if (v * v * curvature).abs() > LINEAR {
                    continue;
                }
                if let Some(block) = blocks.last_mut() {
                    block.steps += 1;
                    for (sum, place) in block.squares.iter_mut().zip([1, 3]) {
                        *sum += (next.state[place] - predicted.vehicle[place]).powi(2);
                    }
                }
            }
        }
        blocks.retain(|block| block.steps > 0);
        Ok(blocks)
    }
}
