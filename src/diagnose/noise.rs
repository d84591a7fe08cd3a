//! Noise of a log, and errors of the model's form: the measure of a gap.
//!
//! White noise follows from second differences of the gap, `sigma = median |r- - 2 r + r+| / (0.6745 sqrt 6)`, brought
//! through the low pass. Numbers that are written in steps have errors that rest with them ([`Coarseness`]): second
//! differences do not see these, so they are added, of the compared columns and of those that drive the replay. The gap that the best candidate leaves is neither noise nor evidence for any candidate: its
//! variance is added. Its correlation over time reduces the worth of each sample. Moments with many times its ordinary
//! power have a variance of their own, as where a vehicle slides and its replay does not. Otherwise they would drown
//! the rest.

use super::problem::{Problem, rms};
use super::profile::{ORDINARY, Roughness, SampleWeights};
use super::replay::{Channel, LEAK, ReplayVehicle, Trace};
use crate::log::Coarseness;
use crate::numerics::statistics::{MEDIAN_OF_NORMAL, upper_median};
use std::sync::Arc;

/// Errors of the model's form that every simulator has, as a share of the signal.
const FORM: f64 = 0.01;
const HEADING: f64 = 5e-4;
/// Share of the neutral gap that a search takes for noise at first.
const COARSE: f64 = 0.1;
/// Longest correlation in the estimate, samples, and the greatest loss by it.
const CORRELATED: usize = 20;
const GREATEST_LOSS: f64 = 6.0;
/// Errors of the model's form recur with every turn: drives longer than this, s, tell no more about them.
const SAME: f64 = 30.0;
/// Threshold of a lost replay, as where a vehicle slides: a fit leaves so many times its ordinary power. Ordinary is
/// the power of all but the worst tenth. A moment is so many samples to either side.
const LOST: f64 = 10.0;
const MOMENT: usize = 10;

/// Noise of each channel, in its own unit, after the low pass.
#[derive(Debug, Clone)]
pub struct Noise {
    /// Standard deviation by noise alone: white noise, and numbers in steps.
    pub white: Vec<f64>,
    /// Errors of the model's form that every simulator has.
    pub form: Vec<f64>,
    /// Additional remainder of a reference log.
    left: Vec<f64>,
    /// Noise, the model's form, and the remainder of a reference log.
    pub floor: Vec<f64>,
    /// Weights of gaps.
    pub effective: Vec<f64>,
    /// Factor on that variance, sample by sample: more than 1 where the replay is lost.
    lost: Vec<f64>,
    /// Roughness of an unknown road.
    roughness: Roughness,
}

impl Noise {
    /// Noise from the neutral replay; `known` is a reference log's remainder in each channel, the model's form.
    #[must_use]
    pub fn of<V: ReplayVehicle>(problem: &Problem<V>, trace: &Trace, known: &[(Channel, f64)]) -> Self {
        let drive = problem.drive;
        let mut white = Vec::new();
        let (mut floor, mut forms, mut lefts) = (Vec::new(), Vec::new(), Vec::new());
        for (channel, _) in &problem.blocks {
            let simulated = trace.column(*channel);
            let logged = drive.column(channel.name());
            let gap = |i: usize| if channel.leaks() { -simulated[i] } else { logged[i] - simulated[i] };
            let mut bends: Vec<f64> = (1..simulated.len().saturating_sub(1))
                .filter(|&i| drive.scored[i - 1] && drive.scored[i] && drive.scored[i + 1])
                .map(|i| (gap(i - 1) - 2.0 * gap(i) + gap(i + 1)).abs())
                .collect();
            let sample =
                (upper_median(&mut bends) / (MEDIAN_OF_NORMAL * 6.0_f64.sqrt())).max(channel.least_noise());
            let of = |name: &str| rms_of(drive.column(name), &drive.scored);
            // What leaks gathers the form's error of its rate for a while; a place that of the heading, half a milliradian.
            let form = match channel {
                Channel::Yaw => FORM * of("yaw_rate") * LEAK,
                Channel::Vx => FORM * rms_of(&drive.accel, &drive.scored) * LEAK,
                Channel::Along | Channel::Across => HEADING * of("vx") * LEAK,
                _ => FORM * rms_of(logged, &drive.scored),
            };
            let left = known.iter().find(|(of, _)| of == channel).map_or(0.0, |(_, left)| *left);
            let noise = (sample * problem.filter.gain()).hypot(coarse(problem, *channel));
            white.push(noise);
            floor.push(noise.hypot(form).hypot(left));
            forms.push(form);
            lefts.push(left);
        }
        let again = again(problem);
        let effective =
            floor.iter().zip(&lefts).map(|(floor, left)| floor.hypot((again - 1.0).sqrt() * left)).collect();
        let lost = vec![1.0; problem.rows.len()];
        Self { effective, white, form: forms, floor, left: lefts, lost, roughness: ORDINARY }
    }

    /// Noise coarser by a share of the neutral gap. Far from the cause, a gap of hundreds of standard deviations pulls
    /// every tolerance beyond the range of its slopes. So a search begins with less trust.
    #[must_use]
    pub fn coarse<V>(&self, problem: &Problem<V>, neutral: &[f64]) -> Self {
        let mut noise = self.clone();
        for ((_, block), effective) in problem.blocks.iter().zip(&mut noise.effective) {
            *effective = effective.hypot(COARSE * rms(&neutral[block.clone()]));
        }
        noise
    }

    /// Noise with a fit's remainder: the part that a road does not explain better.
    #[must_use]
    pub fn with_left<V: ReplayVehicle>(&self, problem: &Problem<V>, left: &[f64]) -> Self {
        let mut noise = self.without_road(problem, left);
        if let Some(profile) = &problem.profile {
            noise.roughness = profile.roughness(&noise.each(), left);
            let rest = noise.weights(problem).rest(left);
            noise = Self { roughness: noise.roughness, ..self.without_road(problem, &rest) };
        }
        noise
    }

    /// The same with a road that explains nothing of it.
    fn without_road<V: ReplayVehicle>(&self, problem: &Problem<V>, left: &[f64]) -> Self {
        let mut noise = self.clone();
        let again = again(problem);
        noise.lost = lost(problem.blocks.iter().map(|(_, block)| &left[block.clone()]), problem.rows.len());
        for (i, (_, block)) in problem.blocks.iter().enumerate() {
            let trusted = |(left, lost): (&f64, &f64)| left / lost.sqrt();
            let part: Vec<f64> = left[block.clone()].iter().zip(&noise.lost).map(trusted).collect();
            let loss = correlation(&part).clamp(1.0, GREATEST_LOSS);
            let base = self.white[i].powi(2) + self.form[i].powi(2);
            let form = (rms(&part).powi(2) - base).max(self.left[i].powi(2));
            noise.effective[i] = ((base + again * form) * loss).sqrt();
        }
        noise
    }

    /// Weight of each sample.
    fn each(&self) -> Vec<f64> {
        let mut each = Vec::new();
        for &deviation in &self.effective {
            each.extend(self.lost.iter().map(|lost| (deviation * deviation * lost).recip()));
        }
        each
    }

    /// Weights of gaps.
    #[must_use]
    pub fn weights<V>(&self, problem: &Problem<V>) -> Arc<SampleWeights> {
        Arc::new(SampleWeights::new(self.each(), problem.profile.as_ref(), self.roughness))
    }

    /// Roughness of an unknown road: shares of the deviations of bank and grade.
    #[must_use]
    pub fn roughness(&self) -> Roughness {
        self.roughness
    }

    /// Part of a gap beyond white noise, channel by channel.
    #[must_use]
    pub fn beyond<V>(&self, problem: &Problem<V>, gap: &[f64]) -> Vec<(Channel, f64)> {
        let of = |((channel, block), white): (&(Channel, std::ops::Range<usize>), &f64)| {
            (*channel, (rms(&gap[block.clone()]).powi(2) - white * white).max(0.0).sqrt())
        };
        problem.blocks.iter().zip(&self.white).map(of).collect()
    }
}

/// Error of a channel by numbers that are written in steps.
fn coarse<V>(problem: &Problem<V>, channel: Channel) -> f64 {
    let drive = problem.drive;
    if drive.coarse.is_empty() {
        return 0.0;
    }
    let size = |name: &str| rms_of(drive.column(name), &drive.scored).max(f64::MIN_POSITIVE);
    let of = |name: &str| drive.coarse.get(name).copied();
    let deviation = |name: &str| of(name).map_or(0.0, |coarse| coarse.deviation);
    // What leaks gathers an error for as long as it rests.
    let gathered =
        |coarse: Coarseness| coarse.deviation * LEAK * (coarse.lasting / (coarse.lasting + LEAK)).sqrt();
    let gathered_of = |name: &str| of(name).map_or(0.0, gathered);
    // A share of the angle and of the speed is about that share of the turn.
    let steering = if drive.commanded { "steer_cmd" } else { "steer" };
    let driving = [steering, "vx"].map(|name| of(name).map(|coarse| (coarse, size(name))));
    let share = |by: &dyn Fn(Coarseness) -> f64| {
        driving.iter().flatten().map(|(coarse, size)| (by(*coarse) / size).powi(2)).sum::<f64>().sqrt()
    };
    let turned = share(&gathered) * size("yaw_rate");
    // Along and across, each is a mixture of x and y.
    let place = deviation("x").max(deviation("y"));
    match channel {
        Channel::Vx => deviation("vx"),
        Channel::Yaw => deviation("yaw").hypot(turned),
        Channel::Along => gathered_of("vx").hypot(place),
        Channel::Across => (size("vx") * LEAK * deviation("yaw").hypot(turned)).hypot(place),
        Channel::Ax => deviation("ax"),
        Channel::Steer if drive.commanded => deviation("steer").hypot(deviation("steer_cmd")),
        _ => deviation(channel.name()).hypot(share(&|coarse| coarse.deviation) * size(channel.name())),
    }
}

/// Power of all channels together, sample by sample, each in units of a size of its own.
fn power<'a>(channels: impl Iterator<Item = (&'a [f64], f64)>, rows: usize) -> Vec<f64> {
    let mut power = vec![0.0; rows];
    for (gap, size) in channels {
        power.iter_mut().zip(gap).for_each(|(power, gap)| *power += (gap / size).powi(2));
    }
    power
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Mean of all but the greatest tenth of values, which are sorted.
fn ordinary(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    mean(&values[..(values.len() * 9).div_ceil(10)])
}

/// Ratio of a fit's remaining power to its ordinary power in each moment of a drive. It is given only if it is so large
/// that the replay is lost; else 1.
fn lost<'a>(channels: impl Iterator<Item = &'a [f64]>, rows: usize) -> Vec<f64> {
    let power = power(channels.map(|left| (left, rms(left).max(f64::MIN_POSITIVE))), rows);
    let mut before = Vec::with_capacity(rows + 1);
    before.push(0.0);
    power.iter().for_each(|power| before.push(before[before.len() - 1] + power));
    let moment = |row: usize| {
        let (from, to) = (row.saturating_sub(MOMENT), (row + MOMENT + 1).min(rows));
        (before[to] - before[from]) / (to - from) as f64
    };
    let moments: Vec<f64> = (0..rows).map(moment).collect();
    let ordinary = ordinary(&mut moments.clone());
    moments.iter().map(|moment| if *moment > LOST * ordinary { moment / ordinary } else { 1.0 }).collect()
}

fn rms_of(column: &[f64], counts: &[bool]) -> f64 {
    let kept: Vec<f64> =
        column.iter().zip(counts).filter(|(_, counts)| **counts).map(|(value, _)| *value).collect();
    rms(&kept)
}

/// `1 + 2 sum rho_k`: number of samples that are worth one.
fn correlation(values: &[f64]) -> f64 {
    let power: f64 = values.iter().map(|value| value * value).sum();
    if power <= 0.0 || values.len() < 2 * CORRELATED {
        return 1.0;
    }
    let mut sum = 1.0;
    for k in 1..=CORRELATED {
        let product: f64 = values.iter().zip(&values[k..]).map(|(a, b)| a * b).sum();
        if product <= 0.0 {
            break;
        }
        sum += 2.0 * product / power;
    }
    sum
}

/// Number of times that the same errors of the form recur in a drive.
fn again<V: ReplayVehicle>(problem: &Problem<V>) -> f64 {
    (problem.drive.duration() / SAME).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::{MOMENT, lost};

    #[test]
    fn a_moment_in_which_a_replay_is_lost_counts_less_and_no_other() {
        // Two channels of different sizes, alternating; one moment of 40 samples has ten times their sizes.
        let (rows, from, to) = (1000, 400, 440);
        let channel = |size: f64| -> Vec<f64> {
            let of = |row: usize| if (from..to).contains(&row) { 10.0 } else { 1.0 };
            (0..rows).map(|row| size * of(row) * if row % 2 == 0 { 1.0 } else { -1.0 }).collect()
        };
        let (rate, place) = (channel(0.01), channel(2.0));
        let times = lost([&rate[..], &place].into_iter(), rows);
        let beyond = |row: usize| row + MOMENT < from || row >= to + MOMENT;
        assert!((0..rows).filter(|&row| beyond(row)).all(|row| times[row] == 1.0));
        // A hundred times the ordinary power.
        let middle = times[(from + to) / 2];
        assert!((middle - 100.0).abs() < 1e-9, "{middle}");
    }

    #[test]
    fn a_replay_that_is_off_all_along_is_not_lost() {
        // Turns and straights: nine times the power in every other five seconds.
        let left: Vec<f64> = (0..1000).map(|row| if row / 50 % 2 == 0 { 3.0 } else { 1.0 }).collect();
        assert!(lost(std::iter::once(&left[..]), left.len()).iter().all(|times| *times == 1.0));
        assert!(lost(std::iter::once(&[0.0; 30][..]), 30).iter().all(|times| *times == 1.0));
    }
}
