//! Return of a controller to the road from beside it: the response of weights that a page shows.

use super::axis::ControllerNumbers;
use super::scenario::{Scenario, ScenarioError};
use crate::control::ControllerFor;
use crate::path::{Closure, Path, Sample};
use crate::simulate::ClosedLoopFor;
use crate::simulate::experiment::Compared;
use std::sync::Arc;

/// Initial offset of the vehicle, m to the left.
const OFFSET: f64 = 0.3;
/// Duration of the record, s.
const DURATION: f64 = 8.0;

/// Lateral error over time, s and m, from 0.3 m beside a straight road at a speed in m/s; to where the vehicle was lost.
///
/// # Errors
/// Parameters out of range.
pub fn answer_to_offset<P: Compared<S, C>, const S: usize, const C: usize>(
    scenario: &Scenario<P, S, C>,
    values: &ControllerNumbers,
    speed: f64,
) -> Result<Vec<(f64, f64)>, ScenarioError> {
    let mut parameters = scenario.controller_with(values)?;
    parameters.speed.limit = speed;
    let step = parameters.mpc.sample_time;
    // Long enough not to brake for its end.
    let length = 2.0 * speed * DURATION + speed * speed / parameters.speed.decel + 100.0;
    let count = (length / 10.0).ceil() as usize;
    let road = (0..=count).map(|i| Sample::at(10.0 * i as f64, 0.0)).collect();
    let path =
        Path::from_samples(road, Closure::Open).map_err(|error| ScenarioError::Vehicle(Box::new(error)))?;
    let controller = ControllerFor::predicting_with(parameters, Arc::new(path), scenario.model.clone())?;
    let mut vehicle = P::make(&scenario.vehicle, &scenario.effects, None)
        .map_err(|error| ScenarioError::Vehicle(Box::new(error)))?;
    vehicle.place(0.0, OFFSET, 0.0, speed);
    let mut closed = ClosedLoopFor::<P, S, C>::new(controller, vehicle, step);
    let mut answer = vec![];
    for k in 0..(DURATION / step) as u32 {
        // Rolled over, jack-knifed: the curve ends.
        if closed.advance().is_err() {
            break;
        }
        answer.push((f64::from(k) * step, closed.lateral_error()));
    }
    Ok(answer)
}
