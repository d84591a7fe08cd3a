//! Plants that explain a log equally well: candidates about the vehicle's file, drawn by a bootstrap over the log's
//! blocks.

use super::{DRIVES, actuator_about};
use crate::nominal::{Actuator, SingleTrackError};
use crate::numerics::{Random, parallel};
use crate::residual::{BlockMisfit, DataConfig, DataSet, ShownActuator};
use crate::simulate::experiment::{Compared, NominalOf};
use crate::vehicle::VehicleParameters as _;
use serde::Serialize;

/// Candidates.
const CANDIDATES: usize = 96;
/// Range of the stiffness of an axle as a factor, and of a payload as a share of the mass.
const STIFFNESS: (f64, f64) = (0.75, 1.2);
const PAYLOAD: f64 = 0.25;
/// Error over that of a model from which on most of it is systematic: three quarters of the squares.
const SYSTEMATIC: f64 = 2.0;
/// Outputs of a misfit: rates of the lateral error and of the yaw error.
const RATES: usize = 2;

/// A plant that the logs do not rule out.
pub struct ExplainedPlant<P: Compared<S, C>, const S: usize, const C: usize> {
    /// Description, in a few words.
    pub name: String,
    /// The vehicle, with the actuator that the log shows.
    pub vehicle: P::Parameters,
    /// Differences from its file.
    pub effects: P::Effects,
    /// Its steering.
    pub actuator: Actuator,
}

/// Plants that explain the logs best, and how well.
pub struct ExplainingPlants<P: Compared<S, C>, const S: usize, const C: usize> {
    /// One for each drive.
    pub plants: Vec<ExplainedPlant<P, S, C>>,
    /// Misfit of the best.
    pub misfit: PlantMisfit,
}

/// What the plant that explains the logs best leaves of their one-step errors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlantMisfit {
    /// Its RMS error of the rates of lateral error and yaw error, over that of the file's vehicle without an actuator.
    pub left: [f64; RATES],
}

impl PlantMisfit {
    /// True if the plant explains the logs beside a model that leaves such shares, held out: what it leaves is not mostly what the
    /// model explains.
    #[must_use]
    pub fn explains(&self, model: [f64; RATES]) -> bool {
        let mean = |left: [f64; RATES]| {
            left.iter().map(|left| left.max(f64::MIN_POSITIVE).ln()).sum::<f64>() / RATES as f64
        };
        let [plant, model] = [self.left, model].map(mean);
        plant <= model + SYSTEMATIC.ln()
    }
}

/// A candidate: factors on front and rear stiffness, payload in kg, actuator.
struct PlantCandidate {
    stiffness: [f64; 2],
    payload: f64,
    actuator: Actuator,
}

/// Plants about a vehicle that explain the samples, one for each drive: the best on resampled logs, each as often as it is
/// the best. `loaded` gives the linear model of the vehicle with other stiffness and a
/// payload in kg.
///
/// # Errors
/// Vehicle parameters that are not positive.
pub fn explaining_plants<P: Compared<S, C>, const S: usize, const C: usize>(
    data: &DataSet<NominalOf<P, S, C>, S>,
    shown: &ShownActuator,
    vehicle: &P::Parameters,
    mass: f64,
    loaded: &(dyn Fn([f64; 2], f64) -> NominalOf<P, S, C> + Sync),
    [seed, threads]: [u64; 2],
) -> Result<ExplainingPlants<P, S, C>, SingleTrackError> {
    let mut random = Random::stream(seed, 37);
    let candidates: Vec<PlantCandidate> = (0..CANDIDATES)
        .map(|number| {
            // The first is the file's vehicle.
            let share = f64::from(u8::from(number > 0));
            let mut between =
                |(low, high): (f64, f64)| 1.0 + share * (low * (high / low).powf(random.uniform()) - 1.0);
            let stiffness = [between(STIFFNESS), between(STIFFNESS)];
            let payload = share * PAYLOAD * mass * (2.0 * random.uniform() - 1.0).max(0.0);
            let mut normal = || share * (0..12).map(|_| random.uniform() - 0.5).sum::<f64>();
            let of_parts = shown.prior.dead_time_spread.max(shown.prior.lag_spread);
            let actuator =
                actuator_about(&shown.prior.actuator, [shown.spread, of_parts], [normal(), normal()]);
            PlantCandidate { stiffness, payload, actuator }
        })
        .collect();
    let misfits = parallel::map(parallel::threads(threads as usize), CANDIDATES, |i| {
        let candidate = &candidates[i];
        data.misfit(&loaded(candidate.stiffness, candidate.payload), &candidate.actuator)
    });
    let misfits: Vec<Vec<BlockMisfit>> = misfits.into_iter().collect::<Result<_, _>>()?;
    let blocks = misfits[0].len();
    let best_on = |sample: &[usize]| {
        let score = |of: &[BlockMisfit]| {
            let sum = |o: usize| sample.iter().map(|&block| of[block].squares[o]).sum::<f64>();
            sum(0).max(f64::MIN_POSITIVE).ln() + sum(1).max(f64::MIN_POSITIVE).ln()
        };
        let scores: Vec<f64> = misfits.iter().map(|misfit| score(misfit)).collect();
        (0..CANDIDATES).min_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0)
    };
    // A log with nothing to compare has the file's vehicle.
    let mut resampled = || -> Vec<usize> {
        (0..blocks).map(|_| ((random.uniform() * blocks as f64) as usize).min(blocks - 1)).collect()
    };
    let chosen: Vec<usize> = (0..DRIVES).map(|_| best_on(&resampled())).collect();
    let nominal = root_mean_square(&data.misfit(&loaded([1.0; 2], 0.0), &Actuator::default())?);
    let best = root_mean_square(&misfits[best_on(&(0..blocks).collect::<Vec<_>>())]);
    let left = std::array::from_fn(|o| if nominal[o] > 0.0 { best[o] / nominal[o] } else { 1.0 });
    let plants = chosen.into_iter().map(|place| plant(vehicle, data.config(), &candidates[place])).collect();
    Ok(ExplainingPlants { plants, misfit: PlantMisfit { left } })
}

/// Over all blocks.
fn root_mean_square(blocks: &[BlockMisfit]) -> [f64; RATES] {
    let steps = blocks.iter().map(|block| block.steps).sum::<usize>().max(1) as f64;
    std::array::from_fn(|o| (blocks.iter().map(|block| block.squares[o]).sum::<f64>() / steps).sqrt())
}

fn plant<P: Compared<S, C>, const S: usize, const C: usize>(
    vehicle: &P::Parameters,
    told: &DataConfig,
    candidate: &PlantCandidate,
) -> ExplainedPlant<P, S, C> {
    let PlantCandidate { stiffness, payload, actuator } = candidate;
    let mut vehicle = vehicle.clone();
    for parameter in P::Parameters::TABLE {
        match parameter.name {
            "steering.lag" => parameter.set(&mut vehicle, actuator.time_constant),
            "steering.dead_time" => parameter.set(&mut vehicle, actuator.dead_time),
            "steering.gain" => parameter.set(&mut vehicle, told.steer_gain),
            "steering.offset" => parameter.set(&mut vehicle, told.steer_offset),
            _ => {}
        }
    }
    let mut effects = vehicle.effects().clone();
    let values = [("tyre_stiffness_front", stiffness[0]), ("tyre_stiffness_rear", stiffness[1])];
    for (id, factor) in values {
        if let Some(value) = P::effect(&mut effects, id) {
            *value *= factor;
        }
    }
    if let Some(value) = P::effect(&mut effects, "payload") {
        *value += payload;
    }
    let name = format!(
        "stiffness {:.2}/{:.2}, payload {payload:.0} kg, dead time {:.3} s, lag {:.3} s",
        stiffness[0], stiffness[1], actuator.dead_time, actuator.time_constant
    );
    ExplainedPlant { name, vehicle, effects, actuator: *actuator }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plant_that_leaves_what_a_model_explains_does_not_explain_the_logs() {
        let explains = |plant: f64, model: f64| PlantMisfit { left: [plant; RATES] }.explains([model; RATES]);
        assert!(explains(0.02, 0.03) && explains(0.05, 0.03));
        assert!(!explains(0.13, 0.04) && !explains(0.9, 0.2));
        // Noise, of which neither explains anything.
        assert!(explains(0.99, 0.9) && explains(1.0, 0.6));
        // One rate explained for the other.
        let misfit = PlantMisfit { left: [0.05, 0.9] };
        assert!(!misfit.explains([0.02, 0.02]) && misfit.explains([0.05, 0.5]));
    }
}
