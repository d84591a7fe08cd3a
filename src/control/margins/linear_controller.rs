//! The MPC at one speed as a linear feedback, identified by unit states and unit commands.

use super::linear_observer::{LinearObserver, steady_gains};
use super::{MarginError, UNIT};
use crate::control::history::History;
use crate::control::lateral::{LateralInput, LateralMpc};
use crate::control::observer::ObserverNoise;
use crate::control::parameters::{ControllerParametersFor, MpcParameters};
use crate::control::preview::SpeedAhead;
use crate::control::variant::{ExpectedState, PredictionModelFor};
use crate::control::vehicle::{Bound, ControlledParameters, FurtherState};
use crate::path::{Closure, Path, Sample};
use nalgebra::{Complex, SMatrix, SVector};

/// A bound that is never active.
const NEVER: f64 = 1e6;
/// Gains below this share of the largest are negligible.
const NEGLIGIBLE: f64 = 1e-8;
/// The plan with which a learned residual is asked is the plan itself after so many steps.
const PLAN_STEPS: usize = 4;

/// The MPC at one speed as a linear feedback.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearController<const S: usize> {
    /// Speed, m/s.
    pub speed: f64,
    /// Time between steps, s.
    pub sample_time: f64,
    /// Gains on the states of this step, the one before, ..; only a learned residual has more than one.
    pub state: Vec<SVector<f64, S>>,
    /// Gains on the command before this step, the one before that, ..
    pub command: Vec<f64>,
    /// Constant continuation behind these.
    pub tail: Option<Tail>,
    /// The observer before these gains, if it is on.
    pub observer: Option<LinearObserver<S>>,
}

/// Gains that fall by a ratio from command to command: the memory of a lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tail {
    /// Gain on the first command behind those that stand singly.
    pub first: f64,
    /// Ratio of a gain to the one before.
    pub ratio: f64,
}

impl<const S: usize> LinearController<S> {
    /// The controller of these parameters that predicts with this model, at each of these speeds in m/s.
    ///
    /// # Errors
    /// Parameters that no MPC can be made of, or a model that does not fit.
    pub fn at_speeds<G: ControlledParameters<S>>(
        parameters: &ControllerParametersFor<G>,
        model: PredictionModelFor<G::Vehicle, S>,
        speeds: &[f64],
    ) -> Result<Vec<Self>, MarginError> {
        let looks_back = matches!(model, PredictionModelFor::Residual(_));
        let mpc = MpcParameters {
            steer_max: NEVER,
            steer_rate_max: NEVER,
            lateral_jerk_max: NEVER * NEVER,
            e1_max: NEVER,
            dither: 0.0,
            // On a straight road there is nothing to follow, and a residual is looked at alone.
            follow_road: if looks_back { 0 } else { parameters.mpc.follow_road },
            ..parameters.mpc
        };
        let unbounded = |state: FurtherState| FurtherState {
            bound: state.bound.map(|bound| Bound { max: NEVER, ..bound }),
            ..state
        };
        let further: Vec<_> = parameters.vehicle.further_states().into_iter().map(unbounded).collect();
        let lateral = LateralMpc::new(parameters.vehicle.nominal(), mpc, &further, model)?;
        let road = [0.0, 25.0, 50.0, 75.0, 100.0].map(|x| Sample::at(x, 0.0));
        let road = Path::from_samples(road.to_vec(), Closure::Open)?;
        let observer = parameters.observer.is_on().then(|| {
            let further = parameters.vehicle.further_states();
            ObserverNoise::new(&parameters.observer, &further, mpc.sample_time)
        });
        let mut asked = Asked { lateral, road, sample_time: mpc.sample_time, observer };
        speeds.iter().map(|&speed| asked.at(speed, looks_back)).collect()
    }

    /// `K(z)` applied to a state, and `h(z)`.
    pub(super) fn response(&self, z_inverse: Complex<f64>, state: &[Complex<f64>; S]) -> [Complex<f64>; 2] {
        let zero = Complex::new(0.0, 0.0);
        // What is behind a gain of this step: Horner, from the oldest.
        let mut by_state = zero;
        for gain in self.state.iter().skip(1).rev() {
            by_state = (by_state + applied(gain, state)) * z_inverse;
        }
        let mut by_command = self.tail.map_or(zero, |tail| (1.0 - z_inverse * tail.ratio).inv() * tail.first);
        for gain in self.command.iter().rev() {
            by_command = by_command * z_inverse + gain;
        }
        by_command *= z_inverse;
        let Some(observer) = &self.observer else {
            return [by_state + applied(&self.state[0], state), by_command];
        };
        let [by_seen, by_issued] = observer.response(z_inverse, state, &self.state[0]);
        [by_state + by_seen, by_command + by_issued]
    }
}

/// A gain applied to a state.
fn applied<const S: usize>(gain: &SVector<f64, S>, state: &[Complex<f64>; S]) -> Complex<f64> {
    gain.iter().zip(state).map(|(gain, state)| state * *gain).sum()
}

/// An MPC without active bounds on a straight road.
struct Asked<const S: usize> {
    lateral: LateralMpc<S>,
    road: Path,
    sample_time: f64,
    observer: Option<ObserverNoise<S>>,
}

/// Answer of the MPC in a situation: its command, and the state that it expects after a given one.
type LinearAnswer<const S: usize> = (f64, Option<ExpectedState<S>>);

impl<const S: usize> Asked<S> {
    fn at(&mut self, speed: f64, looks_back: bool) -> Result<LinearController<S>, MarginError> {
        let window = self.lateral.window();
        let states = if looks_back { window.max(1) } else { 1 };
        let commands = window.saturating_sub(1).max(1);
        let zero = vec![SVector::zeros(); states];
        let still = vec![0.0; commands];
        let nothing = SVector::zeros();
        let rest = self.answer(speed, &zero, &still, &nothing, 0.0)?;
        let next_from_rest = |next: &LinearAnswer<S>| match (next.1, rest.1) {
            (Some(next), Some(rest)) => (next.state - rest.state) / UNIT,
            _ => SVector::zeros(),
        };
        let mut state = Vec::with_capacity(states);
        let mut next_by_state = Vec::with_capacity(states);
        for back in 0..states {
            let mut gain = SVector::zeros();
            let mut next = SMatrix::<f64, S, S>::zeros();
            for i in 0..S {
                let mut asked = zero.clone();
                asked[back][i] = UNIT;
                let answer = self.answer(speed, &asked, &still, &nothing, 0.0)?;
                gain[i] = (answer.0 - rest.0) / UNIT;
                next.set_column(i, &next_from_rest(&answer));
            }
            state.push(gain);
            next_by_state.push(next);
        }
        let mut next_by_command = vec![next_from_rest(&self.answer(speed, &zero, &still, &nothing, UNIT)?)];
        let mut command = Vec::with_capacity(commands);
        for back in 0..commands {
            let mut asked = still.clone();
            asked[back] = UNIT;
            let answer = self.answer(speed, &zero, &asked, &nothing, 0.0)?;
            command.push((answer.0 - rest.0) / UNIT);
            next_by_command.push(next_from_rest(&answer));
        }
        if let (Some(noise), Some(expected)) = (self.observer.clone(), rest.1) {
            let [of_state, of_disturbance] = steady_gains(&noise, speed, &expected.transition);
            let effect = *noise.effect();
            let mut by_disturbance = SVector::zeros();
            for i in 0..S {
                let unit = effect.column(i) * UNIT;
                by_disturbance[i] = (self.answer(speed, &zero, &still, &unit, 0.0)?.0 - rest.0) / UNIT;
            }
            let observer = Some(LinearObserver {
                of_state,
                of_disturbance,
                effect,
                by_disturbance,
                next_by_state,
                next_by_command,
            });
            let sample_time = self.sample_time;
            return Ok(LinearController { speed, sample_time, state, command, tail: None, observer });
        }
        let size = state.iter().map(SVector::amax).fold(0.0, f64::max);
        while state.len() > 1
            && state.last().is_some_and(|gain: &SVector<f64, S>| gain.amax() <= NEGLIGIBLE * size)
        {
            state.pop();
        }
        let tail = cut_tail(&mut command);
        Ok(LinearController { speed, sample_time: self.sample_time, state, command, tail, observer: None })
    }

    /// The answer to a situation, states and commands newest first, and to the disturbance's effect in a step; `steer` is
    /// the command that the next state is expected with.
    fn answer(
        &mut self,
        speed: f64,
        states: &[SVector<f64, S>],
        commands: &[f64],
        disturbance: &SVector<f64, S>,
        steer: f64,
    ) -> Result<LinearAnswer<S>, MarginError> {
        let window = self.lateral.window();
        let mut history = History::new(window);
        for back in (0..window).rev() {
            let state = states.get(back).copied().unwrap_or_else(SVector::zeros);
            history.observe(&state, commands.get(back).copied().unwrap_or(0.0));
        }
        let mut plan = Vec::new();
        for _ in 0..if states.len() > 1 { PLAN_STEPS } else { 1 } {
            let input = LateralInput {
                state: &states[0],
                vy: states[0][1] - speed * states[0][2],
                yaw_rate: states[0][3],
                history: &history,
                last_plan: &plan,
                station: 0.0,
                ahead: SpeedAhead { speed, accel: 0.0, predicted: &[] },
                previous: commands[0],
                rate_max: NEVER,
                path: &self.road,
                disturbance,
                residual_share: 1.0,
                time_limit: f64::INFINITY,
                actuator: None,
                tightness: 0.0,
                lateral_accel: f64::INFINITY,
            };
            self.lateral.step(&input).map_err(|error| MarginError::NoPlan { speed, error })?;
            plan.clear();
            plan.extend_from_slice(self.lateral.plan());
        }
        Ok((plan[0], self.lateral.next_state(&states[0], history.commands(), steer)))
    }
}

/// Cuts gains that fall by one ratio to the end off the end. The last of them stands for all before it, so it is not
/// compared.
fn cut_tail(gains: &mut Vec<f64>) -> Option<Tail> {
    let size = gains.iter().fold(0.0, |size: f64, gain| size.max(gain.abs()));
    let same = |i: usize, ratio: f64| (gains[i + 1] - ratio * gains[i]).abs() <= NEGLIGIBLE * size;
    let last = gains.len().checked_sub(2)?;
    let begins = (0..last).find(|&begin| {
        let ratio = gains[begin + 1] / gains[begin];
        last - begin >= 8 && ratio.abs() < 1.0 && (begin..last).all(|i| same(i, ratio))
    })?;
    let tail = Tail { first: gains[begins], ratio: gains[begins + 1] / gains[begins] };
    gains.truncate(begins);
    Some(tail)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tail_is_cut_where_it_begins() {
        let mut gains: Vec<f64> =
            [0.7, -0.2].into_iter().chain((0..30).map(|i| 0.5 * 0.8_f64.powi(i))).collect();
        // What was before the oldest.
        gains.push(1e-3);
        let tail = cut_tail(&mut gains).unwrap();
        assert_eq!(gains, [0.7, -0.2]);
        assert!((tail.first - 0.5).abs() < 1e-15 && (tail.ratio - 0.8).abs() < 1e-12);
        assert_eq!(cut_tail(&mut vec![0.4]), None);
        assert_eq!(cut_tail(&mut vec![0.4, 0.1, 0.3, 0.7, -0.2, 0.0, 0.1, 0.2, 0.3, 0.5, 0.2]), None);
    }
}
