//! Prior of the effects of past commands, before a log is seen.
//!
//! An ordinary closed-loop log hardly excites high frequencies, so that many responses to the window of commands
//! explain it equally well. Shrinkage towards zero picks one that no actuator has. The prior of the effects `beta_i`,
//! `i` steps back, is that of a vehicle behind its actuator. There the residual of the nominal model is known,
//!
//! ```text
//! beta      ~ N(mean, b b' K)        b: effect of the steering over a step
//! mean_i    = response of A, B behind dead time and lag to a command i steps ago  -  B [i = 0]
//! K_ij      = e_i e_j rho^|i-j|      e_i^2 = mean over the actuators that may be of (share of the command that arrives)^2
//! ```
//!
//! `K` is a diagonal-correlated kernel whose envelope is that of the actuator instead of an exponential. With `K = L L'` the
//! coefficients are `mean + L theta`, and a ridge on `theta` is this prior; its scale comes from held-out errors, as any
//! `lambda`.
//!
//! Source: Pillonetto, Dinuzzo, Chen, De Nicolao and Ljung, Kernel methods in system identification, machine learning and
//! function estimation: a survey, Automatica 2014, eq. (40) (DC kernel) and ch. 5.

use super::MAX_WINDOW;
use super::least_squares::Theta;
use crate::nominal::{ActuatedModel, ActuatedState, Actuator, LateralVehicle, SingleTrackError};
use nalgebra::{Cholesky, DMatrix, SVector};
use serde::{Deserialize, Serialize};

/// Prior of the actuator before the effects are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CommandPrior {
    /// Dead time and lag.
    pub actuator: Actuator,
    /// Standard deviation of the dead time, s.
    pub dead_time_spread: f64,
    /// Standard deviation of the lag, s.
    pub lag_spread: f64,
}

/// Correlation of the deviations from the mean of two effects a step apart.
const CORRELATION: f64 = 0.95;
/// Least spread, s: an actuator is never exactly a dead time and a lag.
const LEAST_SPREAD: f64 = 0.02;
/// Least envelope, as a share of the largest: responses outside the family are not ruled out.
const FLOOR: f64 = 0.05;
/// Spacing of the speeds at which the response is known, m/s.
const SPEED_STEP: f64 = 0.5;

/// Effect of the commands of a window on a step's residual, oldest first, for a vehicle behind an actuator at a speed
/// (m/s). It is the difference to the nominal model. Commands before the window count as its oldest.
///
/// # Errors
/// A speed or a parameter of the vehicle that is not positive.
pub fn residual_of_actuator<V: LateralVehicle<S>, const S: usize>(
    vehicle: &V,
    actuator: &Actuator,
    speed: f64,
    sample_time: f64,
    window: usize,
) -> Result<Theta<S>, SingleTrackError> {
    let model = vehicle.model_at(speed)?;
    let mut effects = vec![[0.0; S]; window];
    let steer = model.discretise(sample_time).b;
    write_residual_of_actuator(&steer, &actuator.discretise(&model, sample_time), &mut effects);
    Ok(effects)
}

/// The same of models that are sampled: `steer` is the nominal model's effect of a command over a step.
pub(crate) fn write_residual_of_actuator<const S: usize>(
    steer: &SVector<f64, S>,
    actuated: &ActuatedModel<S>,
    effects: &mut [[f64; S]],
) {
    let delayed = |step: usize| f64::from(u8::from(step == actuated.delay));
    let mut state = ActuatedState::<S>::zeros();
    let mut rest = *steer;
    // A command of 1 for one step, and what it does in the steps that follow.
    for (step, effect) in effects.iter_mut().rev().enumerate() {
        let (newer, older) = (delayed(step), step.checked_sub(1).map_or(0.0, delayed));
        let next = &actuated.a * &state + actuated.newer * newer + actuated.older * older;
        rest -= next.vehicle;
        *effect = next.vehicle.into();
        // The body's own motion is the nominal model's.
        state.actuator = next.actuator;
    }
    let add = |place: Option<&mut [f64; S]>, more: SVector<f64, S>| {
        place.into_iter().flatten().zip(&more).for_each(|(effect, more)| *effect += more);
    };
    add(effects.first_mut(), rest);
    add(effects.last_mut(), -steer);
}

/// Share of a command that arrives over each later step: the mean angle of the step, of a command of 1 for one step.
fn arrival(actuator: &Actuator, sample_time: f64, window: usize) -> Vec<f64> {
    let sampled = actuator.sample(sample_time);
    let delay = sampled.delay();
    let at = |step: usize, back: usize| f64::from(u8::from(step == back));
    let mut state = sampled.steady(0.0);
    let mut shares = Vec::with_capacity(window);
    for step in 0..window {
        let begin = sampled.output(&state, at(step, delay));
        state = sampled.next(&state, at(step, delay), at(step, delay + 1));
        shares.push(0.5 * (begin + sampled.output(&state, at(step, delay))));
    }
    shares
}

impl CommandPrior {
    /// A window that covers dead time and four time constants, at least as long as another, steps.
    #[must_use]
    pub fn window(&self, sample_time: f64, least: usize) -> usize {
        let Actuator { dead_time, time_constant, .. } = self.actuator;
        let memory = dead_time + self.dead_time_spread + 4.0 * (time_constant + self.lag_spread);
        ((memory / sample_time).ceil() as usize + 1).clamp(least, MAX_WINDOW.max(least))
    }

    /// The square root of `K`, oldest command first.
    pub(super) fn root(&self, sample_time: f64, window: usize) -> DMatrix<f64> {
        let envelope = self.envelope(sample_time, window);
        let kernel = DMatrix::from_fn(window, window, |i, j| {
            envelope[i] * envelope[j] * CORRELATION.powi((i as i32 - j as i32).abs())
        });
        // Positive definite: a positive envelope about the kernel of an autoregressive process.
        Cholesky::new(kernel).map_or_else(|| DMatrix::identity(window, window), |root| root.l())
    }

    fn envelope(&self, sample_time: f64, window: usize) -> Vec<f64> {
        let Actuator { dead_time, time_constant, dead_time_model } = self.actuator;
        let spreads = [self.dead_time_spread, self.lag_spread].map(|spread| spread.max(LEAST_SPREAD));
        let mut squares = vec![0.0; window];
        let mut total = 0.0;
        let around = [-2.0_f64, -1.0, 0.0, 1.0, 2.0];
        for (of_dead_time, of_lag) in around.into_iter().flat_map(|x| around.map(|y| (x, y))) {
            let weight = (-0.5 * (of_dead_time * of_dead_time + of_lag * of_lag)).exp();
            let actuator = Actuator {
                dead_time: (dead_time + of_dead_time * spreads[0]).max(0.0),
                time_constant: (time_constant + of_lag * spreads[1]).max(0.0),
                dead_time_model,
            };
            let shares = arrival(&actuator, sample_time, window);
            squares.iter_mut().rev().zip(shares).for_each(|(sum, share)| *sum += weight * share * share);
            total += weight;
        }
        let largest = squares.iter().copied().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
        let floor = FLOOR * FLOOR * largest;
        squares.into_iter().map(|square| (square.max(floor) / total).sqrt()).collect()
    }
}

/// Means of the prior at the speeds of a log.
#[derive(Debug, Clone)]
pub(super) struct Means<const S: usize> {
    first: f64,
    /// One after the other, `window` effects each.
    effects: Theta<S>,
    window: usize,
}

impl<const S: usize> Means<S> {
    /// Between two speeds, m/s.
    pub fn new<V: LateralVehicle<S>>(
        prior: &CommandPrior,
        vehicle: &V,
        [least, greatest]: [f64; 2],
        sample_time: f64,
        window: usize,
    ) -> Result<Self, SingleTrackError> {
        let steps = ((greatest - least) / SPEED_STEP).ceil().max(1.0) as usize;
        let mut effects = Theta::with_capacity((steps + 1) * window);
        for step in 0..=steps {
            let speed = least + SPEED_STEP * step as f64;
            effects.extend(residual_of_actuator(vehicle, &prior.actuator, speed, sample_time, window)?);
        }
        Ok(Self { first: least, effects, window })
    }

    /// The mean over some speeds.
    pub fn over(&self, speeds: impl Iterator<Item = f64>) -> Theta<S> {
        let last = self.effects.len() / self.window - 1;
        let mut shares = vec![0.0; last + 1];
        let mut total = 0.0;
        for speed in speeds {
            let place = ((speed - self.first) / SPEED_STEP).clamp(0.0, last as f64);
            let below = (place as usize).min(last.saturating_sub(1));
            let above = place - below as f64;
            shares[below] += 1.0 - above;
            shares[(below + 1).min(last)] += above;
            total += 1.0;
        }
        let mut mean = vec![[0.0; S]; self.window];
        for (effects, share) in self.effects.chunks_exact(self.window).zip(shares) {
            let share = if total > 0.0 { share / total } else { 0.0 };
            for (mean, effect) in mean.as_flattened_mut().iter_mut().zip(effects.as_flattened()) {
                *mean += share * effect;
            }
        }
        mean
    }
}
