//! A bank of hypotheses of the steering actuator, scored while driving: the actuator need not be given.
//!
//! Hypothesis `h` is a dead time `T_h`, a lag `tau_h`, and behind them a gap of the linkage, of width `w_h`. Run over the issued
//! commands it gives an angle `delta_h(k)`, and from that the measurements, each by a linear regression of its own:
//!
//! ```text
//! steer(k)                     = g delta_h(k) + o + e                               gain and zero of the sensor
//! (r(k+1) - r(k)) / Ts         = b mean(delta_h) + c' [1, r/v, vy/v, ..] + e        yaw acceleration of the single track
//! ```
//!
//! The yaw equation's coefficients do not depend on the speed, so no stiffness, mass or payload has to be known. With the
//! coefficients and the noise variance integrated out, a hypothesis has the probability (Student's t)
//!
//! ```text
//! log p_h = log prior_h - 1/2 sum over measurements (n + nu) log(nu s0^2 + n var_h)
//! ```
//!
//! where `var_h` is the mean squared residual and `n` the number of independent samples. A sample counts by the share
//! of its variance on which the hypotheses disagree: a straight road teaches nothing, and nothing is forgotten on it.
//! An unconnected sensor has the same residual under each hypothesis and is uninformative.
//!
//! The prior is that of the vehicle's file, mixed with ignorance. The controller predicts with the mean of the hypotheses, and
//! is the calmer the wider they spread and the less the best one fits. A gap that is more probable than none is taken up:
//! without hypotheses of a gap a vehicle that has one seems to have a dead time, and a calm controller weaves through the gap.
//!
//! Source: multiple-model estimation, Magill 1965; Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking
//! and Navigation, 2001, ch. 11.6; the integrated likelihood: Gelman and others, Bayesian Data Analysis, ch. 14.

mod hypothesis;
mod misfit;
mod regression;

pub use self::hypothesis::WIDEST_GAP;
pub(super) use self::hypothesis::slowest;
use self::hypothesis::{ActuatorHypothesis, Hypotheses};
use self::misfit::ActuatorMisfit;
use self::regression::{BESIDE, Rest, TINY};
use super::step::Measurement;
use crate::nominal::{Actuator, DeadTimeModel};
use serde::{Deserialize, Serialize};

/// Expected size of residuals before any is seen. Noise of an angle sensor with the play of a linkage, rad, and
/// unmodelled yaw acceleration of single-track and sensor, rad/s2.
const STEER_NOISE: f64 = 1e-3;
const YAW_NOISE: f64 = 0.2;
/// Probability, as a logarithm beside the best one's, below which a hypothesis counts for nothing, and steps in which each of
/// those is looked at once.
const IMPROBABLE: f64 = -13.8;
const TURNS: usize = 4;
/// Samples that this expectation is worth.
const PRIOR_SAMPLES: f64 = 3.0;
/// Correlation time of a residual, s: errors of a model last.
const CORRELATION: f64 = 0.1;
/// Time of steering that is remembered, s.
const MEMORY: f64 = 20.0;
/// Speed below which the yaw rate is uninformative, m/s.
const LEAST_SPEED: f64 = 2.0;

/// The actuator, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct KnownActuator {
    /// Mean dead time and lag.
    pub actuator: Actuator,
    /// Standard deviation of the sum of dead time and lag, s, with the misfit of the best hypothesis.
    pub spread: f64,
    /// True once the drive has halved the standard deviation that was before it.
    pub shown: bool,
    /// Width of the steering's gap, rad: the file's, or that which the drive shows.
    pub backlash: f64,
}

/// The hypotheses: the part that steps do not change.
#[derive(Debug, Clone, PartialEq)]
pub struct Bank {
    sample_time: f64,
    hypotheses: Hypotheses,
    file: Actuator,
    /// Width of the file's gap, rad.
    backlash: f64,
    /// Places of each lag's past angles.
    reach: usize,
    /// Standard deviation of the sum of dead time and lag before the drive, s.
    spread_before: f64,
}

/// Everything that steps change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BankState {
    /// The newest and the last but one command, once there are.
    commands: Option<[f64; 2]>,
    /// Past angles of each lag without whole steps of dead time, a ring for each.
    angles: Vec<f64>,
    /// Place of the newest.
    newest: usize,
    steer: Steer,
    misfit: ActuatorMisfit,
    yaw: Yaw,
    /// Motion of the step before.
    before: Option<[f64; 1 + BESIDE]>,
    known: KnownActuator,
    /// The most probable hypothesis.
    best: usize,
    log_likelihood: Vec<f64>,
    /// Turn of the improbable ones.
    turn: usize,
}

/// Sums for the regression of the measured angle.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
struct Steer {
    /// Weight, sum and sum of squares of the measured angle.
    common: [f64; 3],
    /// Of each hypothesis: sum, sum of squares and product with the measured angle.
    each: Vec<[f64; 3]>,
}

/// Sums for the regression of the yaw acceleration.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
struct Yaw {
    /// Products of the regressors beside the angle and, in the last row, of the yaw acceleration with them and itself.
    common: [[f64; BESIDE + 1]; BESIDE + 1],
    /// Of each hypothesis: products of its angle with those, and its square.
    each: Vec<[f64; BESIDE + 2]>,
}

impl Bank {
    /// The bank beside the file's actuator, whose gap has a width of `backlash`, rad.
    #[must_use]
    pub fn new(file: Actuator, backlash: f64, sample_time: f64) -> Self {
        let hypotheses = Hypotheses::new(file, backlash, sample_time);
        let reach = hypotheses.longest_delay() + 2;
        let mut bank = Self { sample_time, hypotheses, file, backlash, reach, spread_before: 0.0 };
        bank.spread_before = bank.state().known.spread;
        bank
    }

    /// The state before the first step.
    #[must_use]
    pub fn state(&self) -> BankState {
        let count = self.hypotheses.each.len();
        let known = KnownActuator { actuator: self.file, spread: 0.0, shown: false, backlash: self.backlash };
        let mut state = BankState {
            commands: None,
            angles: vec![0.0; self.hypotheses.rings() * self.reach],
            newest: 0,
            steer: Steer { common: [0.0; 3], each: vec![[0.0; 3]; count] },
            misfit: ActuatorMisfit::new(count),
            yaw: Yaw { common: Default::default(), each: vec![[0.0; BESIDE + 2]; count] },
            before: None,
            known,
            best: 0,
            log_likelihood: vec![0.0; count],
            turn: 0,
        };
        self.conclude(&mut state);
        state
    }

    /// True if a state belongs to these hypotheses.
    #[must_use]
    pub fn fits(&self, state: &BankState) -> bool {
        let count = self.hypotheses.each.len();
        state.angles.len() == self.hypotheses.rings() * self.reach
            && state.newest < self.reach
            && state.best < count
            && state.steer.each.len() == count
            && state.misfit.len() == count
            && state.yaw.each.len() == count
            && state.log_likelihood.len() == count
    }

    /// Longest look-back of a dead time, steps: commands that a prediction needs.
    #[must_use]
    pub fn longest_delay(&self) -> usize {
        self.reach - 2
    }

    /// Takes a measurement with the command that was in force until then.
    /// One that is not to be trusted teaches nothing.
    pub fn observe(&self, state: &mut BankState, measurement: &Measurement, command: f64, trusted: bool) {
        let [newer, older] = match state.commands {
            Some([last, _]) => [command, last],
            None => {
                // At rest at the first command.
                state.angles.fill(command);
                [command, command]
            }
        };
        state.commands = Some([newer, older]);
        let before = state.newest;
        state.newest = (before + 1) % self.reach;
        for (lag, angles) in self.hypotheses.lags.iter().zip(state.angles.chunks_exact_mut(self.reach)) {
            angles[state.newest] = lag.decay * angles[before] + lag.newer * newer + lag.older * older;
        }
        let (by_lag, by_gap) = state.angles.split_at_mut(self.hypotheses.lags.len() * self.reach);
        for (&(lag, width), angles) in self.hypotheses.gaps.iter().zip(by_gap.chunks_exact_mut(self.reach)) {
            let driving = by_lag[lag * self.reach + state.newest];
            // The wheels rest while the linkage crosses the gap.
            angles[state.newest] = angles[before].max(driving - 0.5 * width).min(driving + 0.5 * width);
        }
        if !trusted {
            state.before = None;
            state.misfit.interrupt();
            return;
        }
        let learned = self.learn_steer(state, measurement.steer) | self.learn_yaw(state, measurement);
        if learned {
            self.conclude(state);
        }
    }

    /// Angle at the wheels by the most probable hypothesis; none before the first step.
    #[must_use]
    pub fn angle_now(&self, state: &BankState) -> Option<f64> {
        state.commands.map(|_| self.angle(state, &self.hypotheses.each[state.best], 0))
    }

    /// Angle of a hypothesis, so many steps ago.
    fn angle(&self, state: &BankState, hypothesis: &ActuatorHypothesis, ago: usize) -> f64 {
        let back = hypothesis.delay + ago;
        let place = (state.newest + self.reach - back % self.reach) % self.reach;
        state.angles[hypothesis.ring * self.reach + place]
    }

    /// Mean and variance over the hypotheses.
    fn spread(&self, angle: impl Fn(&ActuatorHypothesis) -> f64) -> f64 {
        let count = self.hypotheses.each.len() as f64;
        let (sum, square) = self
            .hypotheses
            .each
            .iter()
            .map(&angle)
            .fold((0.0, 0.0), |(sum, square), x| (sum + x, square + x * x));
        (square / count - (sum / count).powi(2)).max(0.0)
    }

    fn learn_steer(&self, state: &mut BankState, steer: f64) -> bool {
        let spread = self.spread(|h| self.angle(state, h, 0));
        let share = spread / (spread + STEER_NOISE * STEER_NOISE);
        if share < LEAST_SHARE {
            state.misfit.interrupt();
            return false;
        }
        let keep = 1.0 - share * (self.sample_time / MEMORY).min(1.0);
        let mut sums = std::mem::take(&mut state.steer);
        let [weight, sum, square] = &mut sums.common;
        *weight = *weight * keep + share;
        *sum = *sum * keep + share * steer;
        *square = *square * keep + share * steer * steer;
        let mut misfit = std::mem::take(&mut state.misfit);
        let each = self.hypotheses.each.iter().zip(&mut sums.each);
        let angles = each.map(|(hypothesis, [sum, square, product])| {
            let angle = self.angle(state, hypothesis, 0);
            *sum = *sum * keep + share * angle;
            *square = *square * keep + share * angle * angle;
            *product = *product * keep + share * angle * steer;
            angle
        });
        misfit.observe(steer, angles, [keep, share], self.sample_time);
        (state.steer, state.misfit) = (sums, misfit);
        true
    }

    fn learn_yaw(&self, state: &mut BankState, now: &Measurement) -> bool {
        let fast = now.vx.abs() > LEAST_SPEED;
        let v = now.vx;
        let motion =
            [now.yaw_rate, 1.0, now.yaw_rate / v, now.vy / v, now.articulation, now.articulation_rate / v];
        let Some(before) = state.before.replace(motion).filter(|_| fast) else {
            if !fast {
                state.before = None;
            }
            return false;
        };
        // The angle acts over the whole step.
        let angle = |h: &ActuatorHypothesis| 0.5 * (self.angle(state, h, 0) + self.angle(state, h, 1));
        let spread = self.spread(angle) * YAW_PER_ANGLE * YAW_PER_ANGLE;
        let share = spread / (spread + YAW_NOISE * YAW_NOISE);
        if share < LEAST_SHARE {
            return false;
        }
        let accel = (now.yaw_rate - before[0]) / self.sample_time;
        let mut row = [0.0; BESIDE + 1];
        row[..BESIDE].copy_from_slice(&before[1..]);
        row[BESIDE] = accel;
        let keep = 1.0 - share * (self.sample_time / MEMORY).min(1.0);
        let mut sums = std::mem::take(&mut state.yaw);
        for i in 0..=BESIDE {
            for j in 0..=BESIDE {
                sums.common[i][j] = sums.common[i][j] * keep + share * row[i] * row[j];
            }
        }
        for (hypothesis, sums) in self.hypotheses.each.iter().zip(&mut sums.each) {
            let angle = 0.5 * (self.angle(state, hypothesis, 0) + self.angle(state, hypothesis, 1));
            for (sum, value) in sums.iter_mut().zip(row.iter().chain([&angle])) {
                *sum = *sum * keep + share * angle * value;
            }
        }
        state.yaw = sums;
        true
    }

    /// Logarithm of the likelihood of a hypothesis: what each measurement's regression leaves.
    fn log_likelihood(&self, state: &BankState, k: usize, of_rest: Option<&Rest>) -> f64 {
        let independent = (self.sample_time / CORRELATION).min(1.0);
        let of = |variance: f64, weight: f64, noise: f64| {
            let count = independent * weight;
            -0.5 * (count + PRIOR_SAMPLES) * (PRIOR_SAMPLES * noise * noise + count * variance).ln()
        };
        let mut value = 0.0;
        if let Some(fit) = state.steer.fit(k) {
            value += of(fit.left, state.steer.common[0], STEER_NOISE);
        }
        if let Some(rest) = of_rest {
            value += of(rest.variance(&state.yaw.each[k]), rest.weight, YAW_NOISE);
        }
        value
    }

    /// From the sums to probabilities, and to the known actuator.
    fn conclude(&self, state: &mut BankState) {
        let of_rest = Rest::of(&state.yaw.common);
        let least = state.log_likelihood[state.best] + IMPROBABLE;
        state.turn = (state.turn + 1) % TURNS;
        let mut best = f64::NEG_INFINITY;
        for (k, hypothesis) in self.hypotheses.each.iter().enumerate() {
            let waits = k % TURNS != state.turn && state.log_likelihood[k] < least;
            if !waits {
                state.log_likelihood[k] =
                    hypothesis.log_prior + self.log_likelihood(state, k, of_rest.as_ref());
            }
            let value = state.log_likelihood[k];
            if value > best {
                (best, state.best) = (value, k);
            }
        }
        let (mut total, mut means, mut of_gap) = (0.0, [0.0; 4], [0.0; 2]);
        for (hypothesis, log) in self.hypotheses.each.iter().zip(&state.log_likelihood) {
            if log - best < IMPROBABLE {
                continue;
            }
            let probability = (log - best).exp();
            let lag = self.hypotheses.lags[hypothesis.lag].lag;
            let delay = hypothesis.dead_time + lag;
            total += probability;
            if hypothesis.gap != self.backlash {
                of_gap = [of_gap[0] + probability, of_gap[1] + probability * hypothesis.gap];
            }
            for (mean, value) in means.iter_mut().zip([hypothesis.dead_time, lag, delay, delay * delay]) {
                *mean += probability * value;
            }
        }
        let [dead_time, time_constant, delay, square] = means.map(|mean| mean / total);
        let play = state.steer.common[0] * STEER_NOISE * STEER_NOISE;
        let misfit = |fit: SteerFit| state.misfit.variance(state.best, fit.gain, play);
        let misfit = state.steer.fit(state.best).map_or(0.0, misfit);
        let spread = ((square - delay * delay).max(0.0) + misfit).sqrt();
        // A vehicle that has none is not steered as if it had a small one.
        let backlash = if of_gap[0] > 0.5 * total { of_gap[1] / of_gap[0] } else { self.backlash };
        state.known = KnownActuator {
            actuator: Actuator { dead_time, time_constant, dead_time_model: DeadTimeModel::Exact },
            spread,
            shown: spread <= 0.5 * self.spread_before,
            backlash,
        };
    }
}

/// Regression of the measured angle on that of a hypothesis.
struct SteerFit {
    gain: f64,
    /// Mean squared residual.
    left: f64,
}

impl Steer {
    /// The regression on a hypothesis; none without samples.
    fn fit(&self, k: usize) -> Option<SteerFit> {
        let [weight, sum, square] = self.common;
        if weight <= 0.0 {
            return None;
        }
        let [of_angle, of_square, product] = self.each[k];
        let mean = sum / weight;
        let whole = (square / weight - mean * mean).max(0.0);
        let own = (of_square / weight - (of_angle / weight).powi(2)).max(0.0);
        let both = product / weight - mean * of_angle / weight;
        let (gain, explained) = if own > TINY { (both / own, both * both / own) } else { (0.0, 0.0) };
        Some(SteerFit { gain, left: (whole - explained).max(0.0) })
    }
}

impl BankState {
    /// The actuator, as far as it is known.
    #[must_use]
    pub fn known(&self) -> KnownActuator {
        self.known
    }
}

/// Samples that weigh less teach nothing.
const LEAST_SHARE: f64 = 1e-3;
/// Yaw acceleration by steering of an ordinary vehicle, `Cf lf / Iz`, 1/s2: only how samples are weighted depends on it.
const YAW_PER_ANGLE: f64 = 40.0;
