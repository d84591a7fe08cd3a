//! The hypotheses of the bank: a grid of dead times and lags, the file's actuator, and gaps of the linkage.

use crate::nominal::{Actuator, DeadTimeModel};

/// Longest dead time of a hypothesis, s, and the spacing of dead times.
const LONGEST_DEAD_TIME: f64 = 0.36;
const DEAD_TIME_SPACING: f64 = 0.02;
/// Time constants of the hypotheses, s.
const LAGS: [f64; 7] = [0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3];
/// The widest gap of a hypothesis, rad.
pub const WIDEST_GAP: f64 = 0.065;
/// Share of its width by which a gap is the same as the file's.
const SAME_GAP: f64 = 0.2;
/// Widths of gaps of the hypotheses, rad, and the dead times, s, and lags that they are combined with beside the file's.
const GAPS: [f64; 11] = [0.0015, 0.0025, 0.004, 0.0055, 0.0075, 0.01, 0.014, 0.02, 0.03, 0.045, WIDEST_GAP];
const GAP_DEAD_TIMES: [f64; 3] = [0.0, 0.06, 0.14];
const GAP_LAGS: [usize; 3] = [0, 2, 4];
/// Prior odds of a gap that the file does not know.
const PRIOR_OF_GAP: f64 = 0.1;
/// Prior probability that the actuator is the file's. A file deserves it if nobody has looked up its dead time and lag.
const PRIOR_OF_FILE: f64 = 0.8;

/// The hypothesis that looks back farthest.
#[must_use]
pub(in crate::control) fn slowest() -> Actuator {
    let time_constant = LAGS[LAGS.len() - 1];
    Actuator { dead_time: LONGEST_DEAD_TIME, time_constant, dead_time_model: DeadTimeModel::Exact }
}

/// A first-order lag behind a dead time of a fraction of a step, sampled just before each command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lag {
    /// Time constant, s.
    pub lag: f64,
    pub decay: f64,
    pub newer: f64,
    pub older: f64,
}

/// A hypothesis of the actuator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ActuatorHypothesis {
    pub lag: usize,
    /// Ring of its angle.
    pub ring: usize,
    /// Width of the gap, rad.
    pub gap: f64,
    /// Whole steps of the dead time.
    pub delay: usize,
    /// Dead time, s.
    pub dead_time: f64,
    pub log_prior: f64,
}

/// All hypotheses, and what they share.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hypotheses {
    pub lags: Vec<Lag>,
    /// Lags whose angle passes a gap, and its width: rings behind those of the lags.
    pub gaps: Vec<(usize, f64)>,
    pub each: Vec<ActuatorHypothesis>,
}

impl Lag {
    /// `delta' = (u(t - f Ts) - delta) / tau`, a fraction `f` of a step late.
    fn new(lag: f64, fraction: f64, sample_time: f64) -> Self {
        let kept = |time: f64| if lag > 0.0 { (-time / lag).exp() } else { 0.0 };
        let decay = kept(sample_time);
        // The newer command acts in the last part of the step.
        let newer =
            if lag > 0.0 || fraction < 1.0 { 1.0 - kept((1.0 - fraction) * sample_time) } else { 0.0 };
        Self { lag, decay, newer, older: 1.0 - decay - newer }
    }
}

impl Hypotheses {
    /// The hypotheses beside the file's actuator, whose gap has a width of `backlash`, rad.
    pub fn new(file: Actuator, backlash: f64, sample_time: f64) -> Self {
        let spacing = DEAD_TIME_SPACING.max(sample_time);
        let count = (LONGEST_DEAD_TIME / spacing + 1e-9).floor() as usize + 1;
        let delay = (file.dead_time / sample_time + 1e-9).floor() as usize;
        let fraction = (file.dead_time / sample_time - delay as f64).clamp(0.0, 1.0);
        let fraction = if fraction < 1e-6 { 0.0 } else { fraction };
        let mut lags: Vec<Lag> = LAGS.iter().map(|&lag| Lag::new(lag, 0.0, sample_time)).collect();
        lags.push(Lag::new(file.time_constant, fraction, sample_time));
        let lag_of_file = lags.len() - 1;
        let mut all = Self { lags, gaps: Vec::new(), each: Vec::new() };

        let mut ignorance = ((1.0 - PRIOR_OF_FILE) / (count * LAGS.len()) as f64).ln();
        for k in 0..count {
            for lag in 0..LAGS.len() {
                all.add_whole(lag, backlash, k as f64 * spacing, sample_time, ignorance);
            }
        }
        let ring = all.ring(lag_of_file, backlash);
        let of_file = ActuatorHypothesis {
            lag: lag_of_file,
            ring,
            gap: backlash,
            delay,
            dead_time: file.dead_time,
            log_prior: PRIOR_OF_FILE.ln(),
        };
        all.each.push(of_file);
        // Beside the file's gap: none, and those that differ from it.
        let none = (backlash > 0.0).then_some(0.0);
        let others: Vec<f64> =
            none.into_iter().chain(GAPS).filter(|gap| (gap - backlash).abs() > SAME_GAP * backlash).collect();
        let among = (GAP_LAGS.len() * GAP_DEAD_TIMES.len() * others.len()) as f64;
        let told = (PRIOR_OF_GAP * PRIOR_OF_FILE / others.len() as f64).ln();
        ignorance = (PRIOR_OF_GAP * (1.0 - PRIOR_OF_FILE) / among).ln();
        for gap in others {
            let ring = all.ring(lag_of_file, gap);
            all.each.push(ActuatorHypothesis { ring, gap, log_prior: told, ..of_file });
            for lag in GAP_LAGS {
                for dead_time in GAP_DEAD_TIMES {
                    all.add_whole(lag, gap, dead_time, sample_time, ignorance);
                }
            }
        }
        all
    }

    /// Adds a hypothesis whose dead time is rounded to whole steps.
    fn add_whole(&mut self, lag: usize, gap: f64, dead_time: f64, sample_time: f64, log_prior: f64) {
        let delay = (dead_time / sample_time).round() as usize;
        let (ring, dead_time) = (self.ring(lag, gap), delay as f64 * sample_time);
        self.each.push(ActuatorHypothesis { lag, ring, gap, delay, dead_time, log_prior });
    }

    /// The ring of a lag's angle behind a gap.
    fn ring(&mut self, lag: usize, gap: f64) -> usize {
        if gap == 0.0 {
            return lag;
        }
        let place = self.gaps.iter().position(|it| *it == (lag, gap)).unwrap_or_else(|| {
            self.gaps.push((lag, gap));
            self.gaps.len() - 1
        });
        self.lags.len() + place
    }

    /// Number of rings of past angles.
    pub fn rings(&self) -> usize {
        self.lags.len() + self.gaps.len()
    }

    /// Longest dead time, whole steps.
    pub fn longest_delay(&self) -> usize {
        self.each.iter().map(|hypothesis| hypothesis.delay).max().unwrap_or(0)
    }
}
