//! What noise is in a log, and what the model's form leaves: what a gap is measured against.
//!
//! White noise is what second differences of the gap say, `sigma = median |r- - 2 r + r+| / (0.6745 sqrt 6)`, brought
//! through the low pass. A gap that the best candidate still leaves is neither noise nor told by any candidate: it is added,
//! and its correlation over time makes many samples worth few.

use super::problem::{Problem, rms};
use super::replay::{Channel, LEAK, ReplayVehicle, Trace};

/// Errors of the model's form that every simulator has, as a share of the signal.
const FORM: f64 = 0.01;
const HEADING: f64 = 5e-4;
/// Gaps of so many times the form's error are worth a name.
const NOTABLE: f64 = 4.0;
/// Share of the neutral gap that a search takes for noise at first.
const COARSE: f64 = 0.1;
/// Longest correlation that is looked at, samples, and the greatest loss by it.
const CORRELATED: usize = 20;
const GREATEST_LOSS: f64 = 6.0;
/// Errors of the model's form come back with every turn: drives longer than this, s, tell no more about them.
const SAME: f64 = 30.0;

/// Noise of each channel, in its own unit, after the low pass.
#[derive(Debug, Clone)]
pub struct Noise {
    /// Standard deviation by noise alone.
    pub white: Vec<f64>,
    /// Errors of the model's form that every simulator has.
    pub form: Vec<f64>,
    /// Gaps beyond noise that are worth a name.
    worth: Vec<f64>,
    /// What a reference log has left besides.
    left: Vec<f64>,
    /// Noise, the model's form, and what a reference log has left.
    pub floor: Vec<f64>,
    /// What gaps are weighed with.
    pub effective: Vec<f64>,
}

impl Noise {
    /// From the neutral replay; `known`: what a reference log has left of each channel, the model's form.
    #[must_use]
    pub fn of<V: ReplayVehicle>(problem: &Problem<V>, trace: &Trace, known: &[(Channel, f64)]) -> Self {
        let drive = problem.drive;
        let mut white = Vec::new();
        let (mut floor, mut forms, mut lefts, mut worth) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (channel, _) in &problem.blocks {
            let simulated = trace.column(*channel);
            let logged = drive.column(channel.name());
            let gap = |i: usize| if channel.leaks() { -simulated[i] } else { logged[i] - simulated[i] };
            let mut bends: Vec<f64> = (1..simulated.len().saturating_sub(1))
                .filter(|&i| drive.scored[i - 1] && drive.scored[i] && drive.scored[i + 1])
                .map(|i| (gap(i - 1) - 2.0 * gap(i) + gap(i + 1)).abs())
                .collect();
            bends.sort_unstable_by(f64::total_cmp);
            let median = bends.get(bends.len() / 2).copied().unwrap_or(0.0);
            let sample = (median / (0.6745 * 6.0_f64.sqrt())).max(channel.least_noise());
            let of = |name: &str| rms_of(drive.column(name), &drive.scored);
            // What leaks gathers the form's error of its rate for a while; a place that of the heading, half a milliradian.
            let form = match channel {
                Channel::Yaw => FORM * of("yaw_rate") * LEAK,
                Channel::Vx => FORM * rms_of(&drive.accel, &drive.scored) * LEAK,
                Channel::Along | Channel::Across => HEADING * of("vx") * LEAK,
                _ => FORM * rms_of(logged, &drive.scored),
            };
            let left = known.iter().find(|(of, _)| of == channel).map_or(0.0, |(_, left)| *left);
            white.push(sample * problem.filter.gain());
            floor.push((sample * problem.filter.gain()).hypot(form).hypot(left));
            forms.push(form);
            // A direction of motion is not known better than a heading.
            let direction = if *channel == Channel::Vy { HEADING * of("vx") } else { 0.0 };
            worth.push(NOTABLE * form.hypot(direction));
            lefts.push(left);
        }
        let again = again(problem);
        let effective =
            floor.iter().zip(&lefts).map(|(floor, left)| floor.hypot((again - 1.0).sqrt() * left)).collect();
        Self { effective, white, form: forms, floor, left: lefts, worth }
    }

    /// Coarser by a share of the neutral gap. Far from the cause, a gap of hundreds of standard deviations pulls every
    /// tolerance to where slopes say nothing any more; a search begins with less trust.
    #[must_use]
    pub fn coarse<V>(&self, problem: &Problem<V>, neutral: &[f64]) -> Self {
        let mut noise = self.clone();
        for ((_, block), effective) in problem.blocks.iter().zip(&mut noise.effective) {
            *effective = effective.hypot(COARSE * rms(&neutral[block.clone()]));
        }
        noise
    }

    /// With what a fit left.
    #[must_use]
    pub fn with_left<V: ReplayVehicle>(&self, problem: &Problem<V>, left: &[f64]) -> Self {
        let mut noise = self.clone();
        let again = again(problem);
        for (i, (_, block)) in problem.blocks.iter().enumerate() {
            let part = &left[block.clone()];
            let loss = correlation(part).clamp(1.0, GREATEST_LOSS);
            let base = self.white[i].powi(2) + self.form[i].powi(2);
            let form = (rms(part).powi(2) - base).max(self.left[i].powi(2));
            noise.effective[i] = ((base + again * form) * loss).sqrt();
        }
        noise
    }

    /// Weights of all residuals.
    #[must_use]
    pub fn weights<V>(&self, problem: &Problem<V>) -> Vec<f64> {
        let mut weights = Vec::new();
        for ((_, block), &deviation) in problem.blocks.iter().zip(&self.effective) {
            weights.resize(weights.len() + block.len(), deviation.powi(-2));
        }
        weights
    }

    /// Whether a gap is, in any channel, several times what every simulator's form leaves: else there is nothing to explain.
    #[must_use]
    pub fn notable<V>(&self, problem: &Problem<V>, gap: &[f64]) -> bool {
        let beyond = self.beyond(problem, gap);
        beyond.iter().zip(&self.worth).any(|((_, beyond), worth)| beyond > worth)
    }

    /// What a gap is beyond white noise, channel by channel.
    #[must_use]
    pub fn beyond<V>(&self, problem: &Problem<V>, gap: &[f64]) -> Vec<(Channel, f64)> {
        let of = |((channel, block), white): (&(Channel, std::ops::Range<usize>), &f64)| {
            (*channel, (rms(&gap[block.clone()]).powi(2) - white * white).max(0.0).sqrt())
        };
        problem.blocks.iter().zip(&self.white).map(of).collect()
    }

    /// Share of the neutral gap that another gap still has, noise and the model's form apart; of the motion itself.
    #[must_use]
    pub fn remaining<V>(&self, problem: &Problem<V>, neutral: &[f64], gap: &[f64]) -> f64 {
        let mut squares = Vec::new();
        for ((channel, block), floor) in problem.blocks.iter().zip(&self.floor) {
            let told = matches!(
                channel,
                Channel::YawRate | Channel::Ay | Channel::Vy | Channel::Roll | Channel::Articulation
            );
            if told {
                let (before, after) = (rms(&neutral[block.clone()]), rms(&gap[block.clone()]));
                squares.push((after * after - floor * floor).max(0.0) / (before * before).max(floor * floor));
            }
        }
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }

    /// Size of a gap, all channels together, in units of white noise: in the whole drive, and in all but its worst tenth. A
    /// replay that slides for a moment says nothing of the rest.
    #[must_use]
    pub fn sizes<V>(&self, problem: &Problem<V>, gap: &[f64]) -> [f64; 2] {
        let mut squares = vec![0.0; problem.rows.len()];
        for ((_, block), white) in problem.blocks.iter().zip(&self.white) {
            squares.iter_mut().zip(&gap[block.clone()]).for_each(|(sum, gap)| *sum += (gap / white).powi(2));
        }
        squares.sort_unstable_by(f64::total_cmp);
        let mean = |squares: &[f64]| squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        [mean(&squares).sqrt(), mean(&squares[..(squares.len() * 9).div_ceil(10)]).sqrt()]
    }

    /// How much more a gap is than noise and the model's form: 1 where it is no more.
    #[must_use]
    pub fn excess<V>(&self, problem: &Problem<V>, gap: &[f64]) -> f64 {
        let squares: Vec<f64> = problem
            .blocks
            .iter()
            .zip(&self.floor)
            .map(|((_, block), floor)| (rms(&gap[block.clone()]) / floor).powi(2))
            .collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }
}

fn rms_of(column: &[f64], counts: &[bool]) -> f64 {
    let kept: Vec<f64> =
        column.iter().zip(counts).filter(|(_, counts)| **counts).map(|(value, _)| *value).collect();
    rms(&kept)
}

/// `1 + 2 sum rho_k`: how many samples are worth one.
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

/// How often the same errors of the form come back in a drive.
fn again<V: ReplayVehicle>(problem: &Problem<V>) -> f64 {
    (problem.drive.duration() / SAME).max(1.0)
}
