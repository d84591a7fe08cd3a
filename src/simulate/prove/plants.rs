//! Plants that explain a log equally well: candidates about the vehicle's file, drawn by a bootstrap over the log's
//! blocks.
//!
//! A vehicle is close to its file: one generation of candidates fills the range of a file's errors. Where none of them explains
//! the logs, candidates narrow down from the range of all vehicles of the kind. Those of each later generation lie about the
//! best on resampled logs, as far from them and in the directions in which the best of all lie apart.
//!
//! Source: Rubinstein and Kroese, The Cross-Entropy Method, 2004, ch. 5.

use super::{DRIVES, actuator_about};
use crate::nominal::{Actuator, SingleTrackError};
use crate::numerics::{Random, parallel};
use crate::residual::{BlockMisfit, DataConfig, DataSet, ShownActuator};
use crate::simulate::experiment::{Compared, NominalOf};
use crate::vehicle::VehicleParameters as _;
use serde::Serialize;

/// Candidates of the first generation, and of each later one.
const FIRST: usize = 96;
const LATER: usize = 64;
/// Candidates that are best on the log, and as many on resampled logs, about which the next lie.
const BEST: usize = 8;
/// Standard deviations of the actuator's numbers.
const DEVIATIONS: f64 = 3.0;
/// Error over that of a model from which on most of it is systematic: three quarters of the squares.
const SYSTEMATIC: f64 = 2.0;
/// Outputs of a misfit: rates of the lateral error and of the yaw error.
const RATES: usize = 2;

/// Plants that are thought possible before the logs are seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantRange {
    /// Least and greatest stiffness of an axle as a factor.
    stiffness: (f64, f64),
    /// Greatest payload as a share of the mass.
    payload: f64,
    /// Least and greatest gain of the steering's linkage, and greatest offset, rad.
    gain: (f64, f64),
    offset: f64,
    /// Generations of candidates after the first.
    generations: usize,
}

impl PlantRange {
    /// A vehicle that is built as its file says: tyres by temperature, pressure and wear, and a payload of passengers and luggage.
    pub const OF_THE_FILE: Self =
        Self { stiffness: (0.75, 1.2), payload: 0.25, gain: (1.0, 1.0), offset: 0.0, generations: 0 };
    /// A vehicle of the file's kind: half the stiffness where the file has a sport tyre and the vehicle a soft winter tyre, twice the other
    /// way round, and a fifth more; the payload of a laden van; another steering ratio than the file's, and wheels a degree
    /// off. Where the best eighth of a generation spans the next, each is three quarters as wide in seven directions.
    pub const OF_THE_KIND: Self =
        Self { stiffness: (0.4, 2.0), payload: 0.5, gain: (0.8, 1.25), offset: 0.02, generations: 8 };
}

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

/// A candidate: places of front and rear stiffness, payload, gain and offset in their ranges, 0 to 1, and standard deviations of the
/// actuator's sum and parts. The file's vehicle has none.
type PlantPlace = Option<[f64; 7]>;

/// A candidate's numbers.
struct PlantCandidate {
    /// Factors on front and rear stiffness.
    stiffness: [f64; 2],
    /// kg.
    payload: f64,
    /// Gain and offset of the linkage, the latter in rad.
    linkage: [f64; 2],
    actuator: Actuator,
}

/// Candidates and their misfits.
struct PlantFamily<'a> {
    range: PlantRange,
    shown: &'a ShownActuator,
    mass: f64,
    places: Vec<PlantPlace>,
    misfits: Vec<Vec<BlockMisfit>>,
}

impl PlantFamily<'_> {
    fn candidate(&self, place: &PlantPlace) -> PlantCandidate {
        let prior = &self.shown.prior;
        let Some([front, rear, payload, gain, offset, sum, parts]) = *place else {
            return PlantCandidate {
                stiffness: [1.0; 2],
                payload: 0.0,
                linkage: [1.0, 0.0],
                actuator: prior.actuator,
            };
        };
        let factor = |(low, high): (f64, f64), share: f64| low * (high / low).powf(share);
        let stiffness = self.range.stiffness;
        let of_parts = prior.dead_time_spread.max(prior.lag_spread);
        PlantCandidate {
            stiffness: [factor(stiffness, front), factor(stiffness, rear)],
            // As many without a payload as with one.
            payload: self.range.payload * self.mass * (2.0 * payload - 1.0).max(0.0),
            linkage: [factor(self.range.gain, gain), self.range.offset * (2.0 * offset - 1.0)],
            actuator: actuator_about(&prior.actuator, [self.shown.spread, of_parts], [sum, parts]),
        }
    }

    /// The candidates, the best on a log of these blocks first.
    fn ranked(&self, blocks: &[usize]) -> Vec<usize> {
        let score = |of: &[BlockMisfit]| {
            let sum = |o: usize| blocks.iter().map(|&block| of[block].squares[o]).sum::<f64>();
            sum(0).max(f64::MIN_POSITIVE).ln() + sum(1).max(f64::MIN_POSITIVE).ln()
        };
        let scores: Vec<f64> = self.misfits.iter().map(|misfit| score(misfit)).collect();
        let mut ranked: Vec<usize> = (0..scores.len()).collect();
        ranked.sort_by(|&a, &b| scores[a].total_cmp(&scores[b]));
        ranked
    }

    /// The same on the log itself.
    fn ranked_on_log(&self) -> Vec<usize> {
        self.ranked(&(0..self.misfits[0].len()).collect::<Vec<_>>())
    }

    /// The best on so many resampled logs.
    fn best_of_resampled(&self, count: usize, random: &mut Random) -> Vec<usize> {
        let blocks = self.misfits[0].len();
        // A log with nothing to compare has the file's vehicle.
        let mut resample = || -> Vec<usize> {
            (0..blocks).map(|_| ((random.uniform() * blocks as f64) as usize).min(blocks - 1)).collect()
        };
        (0..count).map(|_| self.ranked(&resample())[0]).collect()
    }

    /// The first generation, whose first is the file's vehicle, with the actuator that the logs show.
    fn first(&self, random: &mut Random) -> Vec<PlantPlace> {
        let has_linkage = self.range.offset > 0.0;
        let mut born: Vec<PlantPlace> = vec![];
        born.resize_with(FIRST, || {
            let uniform = [(); 3].map(|()| random.uniform());
            let normal = [(); 2].map(|()| normal(random));
            let linkage = [(); 2].map(|()| if has_linkage { random.uniform() } else { 0.5 });
            Some([uniform[0], uniform[1], uniform[2], linkage[0], linkage[1], normal[0], normal[1]])
        });
        born[0] = None;
        born
    }

    /// The next generation.
    fn next(&self, random: &mut Random) -> Vec<PlantPlace> {
        let of = |place: usize| self.places[place].unwrap_or([0.5, 0.5, 0.5, 0.5, 0.5, 0.0, 0.0]);
        let parents = self.best_of_resampled(BEST, random);
        let mut best = self.ranked_on_log();
        best.truncate(BEST);
        best.extend(&parents);
        let middle: [f64; 7] =
            std::array::from_fn(|i| best.iter().map(|&place| of(place)[i]).sum::<f64>() / best.len() as f64);
        let born = |number: usize| {
            // A sum of the distances from their mean has their covariance.
            let mut child = of(parents[number % BEST]);
            for &place in &best {
                let by = normal(random) / (best.len() as f64).sqrt();
                for ((to, of), mean) in child.iter_mut().zip(of(place)).zip(middle) {
                    *to += by * (of - mean);
                }
            }
            let [uniform, normal] = [(0.0, 1.0), (-DEVIATIONS, DEVIATIONS)];
            let within = [uniform, uniform, uniform, uniform, uniform, normal, normal];
            Some(std::array::from_fn(|i| child[i].clamp(within[i].0, within[i].1)))
        };
        (0..LATER).map(born).collect()
    }
}

/// A number of about the normal distribution.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.uniform() - 0.5).sum()
}

/// Plants of a range that explain the samples, one for each drive: the best on resampled logs, each as often as it is
/// the best. `loaded` gives the linear model of the vehicle with other stiffness and a
/// payload in kg.
///
/// # Errors
/// Vehicle parameters that are not positive.
pub fn explaining_plants<P: Compared<S, C>, const S: usize, const C: usize>(
    data: &DataSet<NominalOf<P, S, C>, S>,
    shown: &ShownActuator,
    vehicle: &P::Parameters,
    range: PlantRange,
    mass: f64,
    loaded: &(dyn Fn([f64; 2], f64) -> NominalOf<P, S, C> + Sync),
    [seed, threads]: [u64; 2],
) -> Result<ExplainingPlants<P, S, C>, SingleTrackError> {
    let mut random = Random::stream(seed, 37);
    let mut family = PlantFamily { range, shown, mass, places: vec![], misfits: vec![] };
    for generation in 0..=range.generations {
        let born = if generation == 0 { family.first(&mut random) } else { family.next(&mut random) };
        let misfits = parallel::map(parallel::threads(threads as usize), born.len(), |i| {
            let PlantCandidate { stiffness, payload, linkage, actuator } = family.candidate(&born[i]);
            data.misfit(&loaded(stiffness, payload), &actuator, linkage)
        });
        family.places.extend(born);
        family.misfits.extend(misfits.into_iter().collect::<Result<Vec<_>, _>>()?);
    }
    let chosen = family.best_of_resampled(DRIVES, &mut random);
    let nominal = root_mean_square(&data.misfit(&loaded([1.0; 2], 0.0), &Actuator::default(), [1.0, 0.0])?);
    let best = root_mean_square(&family.misfits[family.ranked_on_log()[0]]);
    let left = std::array::from_fn(|o| if nominal[o] > 0.0 { best[o] / nominal[o] } else { 1.0 });
    let of = |&place: &usize| plant(vehicle, data.config(), &family.candidate(&family.places[place]));
    Ok(ExplainingPlants { plants: chosen.iter().map(of).collect(), misfit: PlantMisfit { left } })
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
    let PlantCandidate { stiffness, payload, linkage, actuator } = candidate;
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
    let values = [
        ("tyre_stiffness_front", stiffness[0]),
        ("tyre_stiffness_rear", stiffness[1]),
        ("steer_gain", linkage[0]),
    ];
    for (id, factor) in values {
        if let Some(value) = P::effect(&mut effects, id) {
            *value *= factor;
        }
    }
    for (id, more) in [("payload", *payload), ("steer_offset", linkage[1])] {
        if let Some(value) = P::effect(&mut effects, id) {
            *value += more;
        }
    }
    let name = format!(
        "stiffness {:.2}/{:.2}, payload {payload:.0} kg, steering gain {:.3}, offset {:.4} rad, dead time {:.3} s, lag {:.3} s",
        stiffness[0], stiffness[1], linkage[0], linkage[1], actuator.dead_time, actuator.time_constant
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
