//! Plants that explain a log equally well: the best of a range, and others that the log does not rule out.
//!
//! A plant's place `p` holds what its file may have wrong, within a range. Candidates fill the range; from the best of them
//! Levenberg's and Marquardt's method descends to the least misfit. `e_o` are the errors of an output in all windows:
//!
//! ```text
//!     J(p) = sum over o of  ln e_o' e_o,     d = -(H + damping diag H)^-1 g,    H = sum E_o' E_o / e_o' e_o,   g = sum E_o' e_o / e_o' e_o
//! ```
//!
//! Others are drawn by a bootstrap over the `W` windows `w`, linear about the best, in which what the log does not show is
//! drawn from the prior with precision `P`, `z` standard normal:
//!
//! ```text
//!     p* = p - (W H* + P)^-1 (W g* - P^1/2 z),    H*, g* of the windows that are drawn
//! ```
//!
//! Sources: Nocedal and Wright, Numerical Optimization, 2006, ch. 10; randomize-then-optimize, Bardsley et al., SIAM J. Sci.
//! Comput. 36 (2014).

use super::misfit::{LogWindows, OUTPUTS, WindowErrors};
use super::{DRIVES, actuator_about};
use crate::nominal::Actuator;
use crate::numerics::{Random, parallel};
use crate::residual::{DataConfig, DataSet, ShownActuator};
use crate::simulate::experiment::{Compared, NominalOf};
use crate::vehicle::VehicleParameters as _;
use nalgebra::{SMatrix, SVector};
use serde::Serialize;

/// Candidates that fill the range.
const FIRST: usize = 96;
/// Candidates from which a descent begins, its steps, tries of a step, and the gain that ends it.
const STARTS: usize = 3;
const STEPS: usize = 8;
const TRIES: usize = 4;
const ENOUGH: f64 = 1e-3;
/// Damping at first, and its factor at each further try; after a gain it falls by the same factor.
const DAMPING: f64 = 1e-3;
const MORE: f64 = 10.0;
/// Length over which slopes are taken, in standard deviations of the prior.
const STRIDE: f64 = 0.1;
/// Bounds of the actuator's numbers, in standard deviations.
const DEVIATIONS: f64 = 3.0;
/// Error over that of another plant or model from which on most of it is systematic: three quarters of the squares.
const SYSTEMATIC: f64 = 2.0;

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
}

impl PlantRange {
    /// A vehicle that is built as its file says: tyres by temperature, pressure and wear, and a payload of passengers and luggage.
    pub const OF_THE_FILE: Self =
        Self { stiffness: (0.75, 1.2), payload: 0.25, gain: (1.0, 1.0), offset: 0.0 };
    /// A vehicle of the file's kind: half the stiffness where the file has a sport tyre and the vehicle a soft winter tyre, twice the other
    /// way round, and a fifth more; the payload of a laden van; another steering ratio than the file's, and wheels a degree
    /// off.
    pub const OF_THE_KIND: Self =
        Self { stiffness: (0.4, 2.0), payload: 0.5, gain: (0.8, 1.25), offset: 0.02 };

    /// Numbers of a place that change the plant.
    fn free(&self) -> [bool; NUMBERS] {
        [true, true, true, self.gain.0 < self.gain.1, self.offset > 0.0, true, true]
    }
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

/// Share of the motion's errors that the plant leaves which explains the logs best.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlantMisfit {
    /// Its RMS error of sideways velocity and yaw rate, over that of the file's vehicle without an actuator.
    pub left: [f64; OUTPUTS],
}

impl PlantMisfit {
    /// True if the plant explains the logs beside another, or a model, that leaves such shares: what it leaves is not mostly what the
    /// other explains.
    #[must_use]
    pub fn explains(&self, other: [f64; OUTPUTS]) -> bool {
        let mean = |left: [f64; OUTPUTS]| {
            left.iter().map(|left| left.max(f64::MIN_POSITIVE).ln()).sum::<f64>() / OUTPUTS as f64
        };
        let [plant, other] = [self.left, other].map(mean);
        plant <= other + SYSTEMATIC.ln()
    }
}

/// Numbers of a place.
const NUMBERS: usize = 7;
/// Places of front and rear stiffness, payload, gain and offset in their ranges, 0 to 1, and standard deviations of the
/// actuator's sum and parts.
type PlantPlace = SVector<f64, NUMBERS>;
/// Standard deviations of the prior: of uniform numbers, and of normal ones.
const UNIFORM: f64 = 0.289;
const PRIOR: [f64; NUMBERS] = [UNIFORM, UNIFORM, UNIFORM, UNIFORM, UNIFORM, 1.0, 1.0];

/// The least and the greatest of a number of a place.
fn bounds(number: usize) -> (f64, f64) {
    if PRIOR[number] == UNIFORM { (0.0, 1.0) } else { (-DEVIATIONS, DEVIATIONS) }
}

/// The place within its bounds.
fn within(place: PlantPlace) -> PlantPlace {
    PlantPlace::from_fn(|i, _| place[i].clamp(bounds(i).0, bounds(i).1))
}

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

/// What is thought possible, as places.
struct PlantPrior<'a> {
    range: PlantRange,
    shown: &'a ShownActuator,
    mass: f64,
}

impl PlantPrior<'_> {
    fn candidate(&self, place: &PlantPlace) -> PlantCandidate {
        let prior = &self.shown.prior;
        let [front, rear, payload, gain, offset, sum, parts] = (*place).into();
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

    /// Place of the file's vehicle, with the actuator that the logs show.
    fn of_the_file(&self) -> PlantPlace {
        let share = |(low, high): (f64, f64)| if low < high { -low.ln() / (high / low).ln() } else { 0.5 };
        let stiffness = share(self.range.stiffness);
        [stiffness, stiffness, 0.5, share(self.range.gain), 0.5, 0.0, 0.0].into()
    }

    /// Places that fill the range; the first is the file's vehicle.
    fn filled(&self, random: &mut Random) -> Vec<PlantPlace> {
        let mut places = vec![self.of_the_file()];
        places.resize_with(FIRST, || {
            PlantPlace::from_fn(|i, _| if PRIOR[i] == UNIFORM { random.uniform() } else { random.normal() })
        });
        places
    }
}

/// Sums of squares of all windows.
fn squares(windows: &[WindowErrors]) -> [f64; OUTPUTS] {
    let of = |o: usize| windows.iter().flat_map(|window| &window[o]).map(|error| error * error).sum::<f64>();
    std::array::from_fn(|o| of(o).max(f64::MIN_POSITIVE))
}

/// Sum of the logarithms of [`squares`].
fn score(windows: &[WindowErrors]) -> f64 {
    squares(windows).map(f64::ln).iter().sum()
}

/// Normal matrix and gradient of the score in one window.
type WindowNormal = (SMatrix<f64, NUMBERS, NUMBERS>, PlantPlace);

/// A place with its errors, on its way to the least misfit.
struct PlantDescent<F> {
    place: PlantPlace,
    errors: Vec<WindowErrors>,
    /// Numbers that change the plant.
    free: [bool; NUMBERS],
    /// Errors at a place.
    at: F,
}

impl<E, F: Fn(&PlantPlace) -> Result<Vec<WindowErrors>, E>> PlantDescent<F> {
    /// Normal matrices and gradients of the windows, by difference quotients.
    fn normals(&self) -> Result<Vec<WindowNormal>, E> {
        let mut slopes = Vec::with_capacity(NUMBERS);
        for (i, deviation) in PRIOR.into_iter().enumerate() {
            let stride = STRIDE * deviation;
            let stride = if self.place[i] + stride > bounds(i).1 { -stride } else { stride };
            let mut there = self.place;
            there[i] += stride;
            slopes.push(if self.free[i] { Some(((self.at)(&there)?, stride)) } else { None });
        }
        let squares = squares(&self.errors);
        let of_window = |(w, here): (usize, &WindowErrors)| {
            let mut normal: WindowNormal = (SMatrix::zeros(), PlantPlace::zeros());
            for (o, square) in squares.into_iter().enumerate() {
                for (k, error) in here[o].iter().enumerate() {
                    let slope = PlantPlace::from_fn(|i, _| {
                        slopes[i].as_ref().map_or(0.0, |(there, stride)| (there[w][o][k] - error) / stride)
                    });
                    normal.0 += slope * slope.transpose() / square;
                    normal.1 += slope * (error / square);
                }
            }
            normal
        };
        Ok(self.errors.iter().enumerate().map(of_window).collect())
    }

    /// Goes to the least misfit; the windows' normal matrices there.
    fn run(&mut self) -> Result<Vec<WindowNormal>, E> {
        let (mut damping, mut least) = (DAMPING, score(&self.errors));
        let mut normals = self.normals()?;
        for _ in 0..STEPS {
            let (normal, gradient) = sum(normals.iter());
            let before = least;
            for _ in 0..TRIES {
                let held = normal.diagonal().map(|it| damping * it + f64::MIN_POSITIVE.sqrt());
                let step = (normal + SMatrix::from_diagonal(&held)).cholesky().map(|it| it.solve(&gradient));
                let there = step.map(|step| within(self.place - step));
                if let Some(there) = there.filter(|it| it.iter().all(|it| it.is_finite())) {
                    let errors = (self.at)(&there)?;
                    let new = score(&errors);
                    if new < least {
                        (self.place, self.errors, least) = (there, errors, new);
                        damping /= MORE;
                        break;
                    }
                }
                damping *= MORE;
            }
            if before == least {
                break;
            }
            normals = self.normals()?;
            if before - least < ENOUGH {
                break;
            }
        }
        Ok(normals)
    }
}

fn sum<'a>(normals: impl Iterator<Item = &'a WindowNormal>) -> WindowNormal {
    normals.fold((SMatrix::zeros(), PlantPlace::zeros()), |sum, it| (sum.0 + it.0, sum.1 + it.1))
}

/// Another place that the log does not rule out, about the best.
fn drawn(best: PlantPlace, normals: &[WindowNormal], random: &mut Random) -> PlantPlace {
    // A log with nothing to compare has the file's vehicle.
    if normals.is_empty() {
        return best;
    }
    let count = normals.len();
    let of_random = || &normals[((random.uniform() * count as f64) as usize).min(count - 1)];
    let resampled: Vec<&WindowNormal> = std::iter::repeat_with(of_random).take(count).collect();
    let (normal, gradient) = sum(resampled.into_iter());
    let precision = PlantPlace::from(PRIOR).map(|deviation| deviation.powi(-2));
    let beside = precision.map(|it| it.sqrt() * random.normal());
    let normal = normal * count as f64 + SMatrix::from_diagonal(&precision);
    let step = normal.cholesky().map(|it| it.solve(&(gradient * count as f64 - beside)));
    within(best - step.unwrap_or_default())
}

/// Plants of a range that explain the samples, one for each drive: the best, and others that the log does not rule out.
/// `mass` is that which a payload is compared with, kg.
///
/// # Errors
/// A vehicle that cannot be made.
pub fn explaining_plants<P: Compared<S, C>, const S: usize, const C: usize>(
    data: &DataSet<NominalOf<P, S, C>, S>,
    shown: &ShownActuator,
    vehicle: &P::Parameters,
    range: PlantRange,
    mass: f64,
    [seed, threads]: [u64; 2],
) -> Result<ExplainingPlants<P, S, C>, P::Error> {
    let windows = LogWindows::of(data);
    let prior = PlantPrior { range, shown, mass };
    let errors = |candidate: &PlantCandidate| {
        let plant = plant::<P, S, C>(vehicle, data.config(), candidate);
        Ok(windows.errors(&mut *P::reduced(&plant.vehicle, &plant.effects)?))
    };
    let at = |place: &PlantPlace| errors(&prior.candidate(place));
    let mut random = Random::stream(seed, 37);
    let places = prior.filled(&mut random);
    let threads = parallel::threads(threads as usize);
    let scores = parallel::map(threads, FIRST, |i| at(&places[i]).map(|errors| score(&errors)));
    let scores: Vec<f64> = scores.into_iter().collect::<Result<_, _>>()?;
    let mut ranked: Vec<usize> = (0..FIRST).collect();
    ranked.sort_by(|&a, &b| scores[a].total_cmp(&scores[b]));
    let starts = if windows.count() > 0 { STARTS } else { 1 };
    let found = parallel::map(threads, starts, |i| {
        let place = places[ranked[i]];
        let mut descent = PlantDescent { place, errors: at(&place)?, free: range.free(), at };
        let normals = descent.run()?;
        Ok((descent.place, descent.errors, normals))
    });
    let found: Vec<_> = found.into_iter().collect::<Result<_, P::Error>>()?;
    let least = found.iter().enumerate().min_by(|a, b| score(&a.1.1).total_cmp(&score(&b.1.1)));
    let (best, left, normals) = &found[least.map_or(0, |it| it.0)];
    let mut chosen = vec![*best];
    chosen.resize_with(DRIVES, || drawn(*best, normals, &mut random));
    let of_the_file = PlantCandidate {
        stiffness: [1.0; 2],
        payload: 0.0,
        linkage: [1.0, 0.0],
        actuator: Actuator::default(),
    };
    let (left, nominal) = (squares(left), squares(&errors(&of_the_file)?));
    let left = std::array::from_fn(|o| (left[o] / nominal[o]).sqrt());
    let of = |place: &PlantPlace| plant::<P, S, C>(vehicle, data.config(), &prior.candidate(place));
    Ok(ExplainingPlants { plants: chosen.iter().map(of).collect(), misfit: PlantMisfit { left } })
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

    /// Errors of a plant whose outputs are linear in its place, over windows of eight steps; noise of each window.
    fn linear(place: &PlantPlace, truth: &PlantPlace) -> Result<Vec<WindowErrors>, ()> {
        let mut random = Random::new(5);
        let window = |_: usize| -> WindowErrors {
            [1.0, 0.1].map(|size| {
                let step = |_: usize| {
                    let slope = PlantPlace::from_fn(|i, _| if i == 2 { 0.0 } else { size * random.normal() });
                    slope.dot(&(place - truth)) + 0.01 * size * random.normal()
                };
                (0..8).map(step).collect()
            })
        };
        Ok((0..40).map(window).collect())
    }

    #[test]
    fn a_descent_finds_the_plant_and_others_lie_about_it_and_anywhere_where_the_log_shows_nothing() {
        let truth: PlantPlace = [0.2, 0.9, 0.5, 0.4, 0.6, 1.0, -0.5].into();
        let at = |place: &PlantPlace| linear(place, &truth);
        let place = PlantPlace::from([0.8, 0.3, 0.4, 0.5, 0.5, 0.0, 0.0]);
        let mut descent = PlantDescent { place, errors: at(&place).unwrap(), free: [true; NUMBERS], at };
        let normals = descent.run().unwrap();
        let mut random = Random::new(3);
        let places: Vec<_> = (0..50).map(|_| drawn(descent.place, &normals, &mut random)).collect();
        for i in (0..NUMBERS).filter(|&i| i != 2) {
            assert!((descent.place[i] - truth[i]).abs() < 0.01, "{i}: {}", descent.place);
            assert!(places.iter().all(|it| (it[i] - truth[i]).abs() < 0.02), "{i}");
        }
        assert_eq!(descent.place[2], 0.4);
        let of_unseen = |least: bool| places.iter().filter(|it| (it[2] < 0.25) == least).count();
        assert!(of_unseen(true) > 5 && of_unseen(false) > 5, "{}", of_unseen(true));
    }

    #[test]
    fn a_plant_that_leaves_what_a_model_explains_does_not_explain_the_logs() {
        let explains =
            |plant: f64, model: f64| PlantMisfit { left: [plant; OUTPUTS] }.explains([model; OUTPUTS]);
        assert!(explains(0.02, 0.03) && explains(0.05, 0.03));
        assert!(!explains(0.13, 0.04) && !explains(0.9, 0.2));
        // Noise, of which neither explains anything.
        assert!(explains(0.99, 0.9) && explains(1.0, 0.6));
        // One rate explained for the other.
        let misfit = PlantMisfit { left: [0.05, 0.9] };
        assert!(!misfit.explains([0.02, 0.02]) && misfit.explains([0.05, 0.5]));
    }
}
