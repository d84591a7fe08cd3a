//! The steering actuator's constants from a recorded drive: the knowledge of a delay baseline, instead of the truth.
//!
//! Given the commands `u_k`, held from their instants on, and a response `y_k` measured just before each,
//!
//! ```text
//! min over T, tau, gain   sum_k (y_k - offset - gain y^_k(T, tau))^2
//! ```
//!
//! where `y^` is the response of the model actuator, alone or behind it a vehicle's yaw rate, to `u - u_0` from rest.
//! The offset (a sensor's zero) is measured before the command first changes. The gain (a steering ratio, a stiffness)
//! is linear: it is known for each `(T, tau)`, and the search is over one or two numbers. The search is nested and of
//! golden sections, each within the best interval of a grid. A valley along `T + tau = const` does no harm, nothing is
//! random and no start has to be guessed. The gain of all models is that of dead time and lag. A Pade approximant
//! answers a step at once, and would buy a better beginning with a wrong end.
//!
//! The drive has to begin steady and to contain a change that settles: a step of the command is best. Through a vehicle
//! model the constants absorb that model's errors: measure the road-wheel angle if you can.
//!
//! Source: Golub and Pereyra, Separable nonlinear least squares, Inverse Problems 2003; Ljung, System Identification,
//! ch. 7.

use crate::enumeration;
use crate::nominal::{ActuatedState, Actuator, ContinuousErrorModel, DeadTimeModel};

enumeration! {
    /// Model of the actuator that is fitted.
    pub enum DelayModel {
        DeadTimeLag = 0 "dead_time_lag", "Dead time and first-order lag";
        FirstOrder = 1 "first_order", "First-order inertia, no dead time";
        Pade11 = 2 "pade_1_1", "Dead time by a Pade approximant of order (1, 1)";
        Pade22 = 3 "pade_2_2", "Dead time by a Pade approximant of order (2, 2)";
    }
}

impl DelayModel {
    /// The actuator with a dead time and a time constant in s; parameters that the model lacks are left out.
    #[must_use]
    pub fn actuator(self, dead_time: f64, time_constant: f64) -> Actuator {
        let (dead_time, time_constant, dead_time_model) = match self {
            Self::DeadTimeLag => (dead_time, time_constant, DeadTimeModel::Exact),
            Self::FirstOrder => (0.0, time_constant, DeadTimeModel::FirstOrder),
            Self::Pade11 => (dead_time, 0.0, DeadTimeModel::Pade11),
            Self::Pade22 => (dead_time, 0.0, DeadTimeModel::Pade22),
        };
        Actuator { dead_time, time_constant, dead_time_model }
    }
}

/// Reasons for which an actuator cannot be identified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum IdentifyError {
    #[error(
        "{time} times, {commands} commands and {responses} responses were given: each row needs one of each"
    )]
    Lengths { time: usize, commands: usize, responses: usize },
    #[error(
        "only {rows} rows: give at least {least}, a step of the steering with a second before and after it"
    )]
    TooShort { rows: usize, least: usize },
    #[error(
        "row {row}: the {signal} is {value}; time and command must be finite numbers (only responses may have gaps)"
    )]
    NotFinite { row: usize, signal: &'static str, value: f64 },
    #[error(
        "row {row}: {step} s after the row before it, where the log's step is {sample_time} s: resample the log to even steps"
    )]
    Uneven { row: usize, step: f64, sample_time: f64 },
    #[error("the command does not change: record a step of the steering")]
    NoExcitation,
    #[error("the response does not follow the command: the best fit explains {:.0} % of it; is it the right column?", 100.0 * share)]
    NoResponse { share: f64 },
    #[error(
        "no response is measured before the command first changes, in row {row}: begin the record half a second earlier"
    )]
    NoRest { row: usize },
    #[error("{found} usable responses are too few: at least {least} rows need one")]
    Gaps { found: usize, least: usize },
}

/// A recorded drive with even time steps.
#[derive(Debug, Clone, PartialEq)]
pub struct SteeringRecord {
    sample_time: f64,
    /// Commands less the first one.
    commands: Vec<f64>,
    /// Responses less that at rest; not a number in gaps.
    responses: Vec<f64>,
    offset: f64,
    gain: Option<f64>,
}

/// An actuator identified from a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IdentifiedActuator {
    /// The actuator.
    pub actuator: Actuator,
    /// Steady response to a command of 1 beyond the model's.
    pub gain: f64,
    /// Response before the first change of the command.
    pub offset: f64,
    /// Root of the mean squared error, in the response's unit.
    pub rmse: f64,
    /// Share of the response's variance that the fit explains, at most 1.
    pub explained: f64,
}

/// Fewest rows.
const LEAST_ROWS: usize = 20;
/// Deviation of a time step that is jitter, as a share of it.
const JITTER: f64 = 0.01;
/// Longest dead time that is looked for, s.
const LONGEST_DEAD_TIME: f64 = 1.0;
/// Shortest and longest time constant of a lag that is looked for, s, beside none.
const TIME_CONSTANTS: [f64; 2] = [1e-3, 2.0];
/// Ratio of a grid's time constants.
const GRID_RATIO: f64 = 1.5;
/// Least explained share of a valid fit.
const LEAST_SHARE: f64 = 0.5;
/// Golden sections of an interval: 2e-6 of it is left.
const SECTIONS: u32 = 27;

impl SteeringRecord {
    /// A record from a log's columns: time in s, command in rad, and the response measured just before each command is
    /// given. A response that is no number is a gap.
    ///
    /// # Errors
    /// The fault that makes the columns unusable.
    pub fn new(time: &[f64], command: &[f64], response: &[f64]) -> Result<Self, IdentifyError> {
        let rows = time.len();
        if command.len() != rows || response.len() != rows {
            return Err(IdentifyError::Lengths {
                time: rows,
                commands: command.len(),
                responses: response.len(),
            });
        }
        if rows < LEAST_ROWS {
            return Err(IdentifyError::TooShort { rows, least: LEAST_ROWS });
        }
        for (signal, values) in [("time", time), ("command", command)] {
            if let Some(row) = values.iter().position(|value| !value.is_finite()) {
                return Err(IdentifyError::NotFinite { row, signal, value: values[row] });
            }
        }
        let sample_time = (time[rows - 1] - time[0]) / (rows - 1) as f64;
        let step = |row: usize| time[row] - time[row - 1];
        let uneven = |row: &usize| (step(*row) - sample_time).abs() > JITTER * sample_time;
        if let Some(row) = (1..rows).find(|row| sample_time <= 0.0 || uneven(row)) {
            // The step of most rows is what a reader expects.
            let mut steps: Vec<f64> = (1..rows).map(step).collect();
            steps.sort_by(f64::total_cmp);
            let sample_time = steps[rows / 2 - 1];
            let odd = |row: &usize| (step(*row) - sample_time).abs() > JITTER * sample_time.abs();
            let row = (1..rows).find(odd).unwrap_or(row);
            return Err(IdentifyError::Uneven { row, step: step(row), sample_time });
        }
        let found = response.iter().filter(|value| value.is_finite()).count();
        if found < LEAST_ROWS {
            return Err(IdentifyError::Gaps { found, least: LEAST_ROWS });
        }
        let commands: Vec<f64> = command.iter().map(|value| value - command[0]).collect();
        let Some(change) = commands.iter().position(|&value| value != 0.0) else {
            return Err(IdentifyError::NoExcitation);
        };
        // The row of the change is measured before it.
        let (sum, count) = response[..=change]
            .iter()
            .filter(|value| value.is_finite())
            .fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
        if count == 0.0 {
            return Err(IdentifyError::NoRest { row: change });
        }
        let offset = sum / count;
        let responses = response.iter().map(|value| value - offset).collect();
        Ok(Self { sample_time, commands, responses, offset, gain: None })
    }

    /// With a known gain, which is not fitted.
    #[must_use]
    pub fn with_gain(self, gain: f64) -> Self {
        Self { gain: Some(gain), ..self }
    }

    /// Time between rows, s.
    #[must_use]
    pub fn sample_time(&self) -> f64 {
        self.sample_time
    }

    /// Fits an actuator to a response that is the road-wheel angle.
    ///
    /// # Errors
    /// A response that does not follow the command.
    pub fn identify(&self, model: DelayModel) -> Result<IdentifiedActuator, IdentifyError> {
        self.fit(model, |actuator, prediction| {
            let sampled = actuator.sample(self.sample_time);
            let mut state = sampled.steady(0.0);
            for (k, prediction) in prediction.iter_mut().enumerate() {
                // The row's own command does not show in it yet.
                *prediction = sampled.output(&state, self.command(k, sampled.delay() + 1));
                let delay = sampled.delay();
                state = sampled.next(&state, self.command(k, delay), self.command(k, delay + 1));
            }
        })
    }

    /// Fits an actuator to a response that is the yaw rate of a vehicle, at the speed of its model. The speed of the record
    /// has to be nearly constant.
    ///
    /// # Errors
    /// A response that does not follow the command.
    pub fn identify_by_yaw_rate<const S: usize>(
        &self,
        model: DelayModel,
        vehicle: &ContinuousErrorModel<S>,
    ) -> Result<IdentifiedActuator, IdentifyError> {
        self.fit(model, |actuator, prediction| {
            let sampled = actuator.discretise(vehicle, self.sample_time);
            let mut state = ActuatedState::zeros();
            for (k, prediction) in prediction.iter_mut().enumerate() {
                // Errors to a straight path: the rate of the yaw error is the yaw rate.
                *prediction = state.vehicle[3];
                state = &sampled.a * &state
                    + sampled.newer * self.command(k, sampled.delay)
                    + sampled.older * self.command(k, sampled.delay + 1);
            }
        })
    }

    /// The command a number of steps before a row, less the first one.
    fn command(&self, row: usize, back: usize) -> f64 {
        row.checked_sub(back).map_or(0.0, |k| self.commands[k])
    }

    /// The best constants for a way to predict the response to the commands.
    fn fit(
        &self,
        model: DelayModel,
        predict: impl Fn(&Actuator, &mut [f64]),
    ) -> Result<IdentifiedActuator, IdentifyError> {
        let mut prediction = vec![0.0; self.commands.len()];
        let mut judge = |model: DelayModel, dead_time: f64, time_constant: f64, gain: Option<f64>| {
            let actuator = model.actuator(dead_time, time_constant);
            predict(&actuator, &mut prediction);
            self.judge(actuator, gain, &prediction)
        };
        let span = 0.5 * self.sample_time * (self.commands.len() - 1) as f64;
        let longest = LONGEST_DEAD_TIME.min(span);
        let steps = (longest / self.sample_time).floor() as u32;
        let dead_times: Vec<f64> = (0..=steps).map(|k| f64::from(k) * self.sample_time).collect();
        let mut time_constants = vec![0.0];
        let mut next = TIME_CONSTANTS[0];
        while next <= TIME_CONSTANTS[1].min(span) {
            time_constants.push(next);
            next *= GRID_RATIO;
        }
        let rmse = |fit: &IdentifiedActuator| fit.rmse;
        let mut dead_time_and_lag = |gain| {
            let lag_of = |dead_time| {
                least(&time_constants, |tau| judge(DelayModel::DeadTimeLag, dead_time, tau, gain), rmse)
            };
            least(&dead_times, lag_of, rmse)
        };
        let best = if model == DelayModel::DeadTimeLag {
            dead_time_and_lag(self.gain)
        } else {
            let gain = Some(self.gain.unwrap_or_else(|| dead_time_and_lag(None).gain));
            match model {
                DelayModel::FirstOrder => least(&time_constants, |tau| judge(model, 0.0, tau, gain), rmse),
                _ => least(&dead_times, |dead_time| judge(model, dead_time, 0.0, gain), rmse),
            }
        };
        // Of a share that is no number this makes zero.
        let share = best.explained.max(0.0);
        if share < LEAST_SHARE {
            return Err(IdentifyError::NoResponse { share });
        }
        Ok(best)
    }

    /// Quality of a prediction with a gain, or with its best one.
    fn judge(&self, actuator: Actuator, gain: Option<f64>, prediction: &[f64]) -> IdentifiedActuator {
        let rows = || prediction.iter().zip(&self.responses).filter(|(_, y)| y.is_finite());
        let (mut pp, mut py, mut yy, mut sum, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (p, y) in rows() {
            pp += p * p;
            py += p * y;
            yy += y * y;
            sum += y;
            count += 1.0;
        }
        let gain = gain.unwrap_or(if pp > 0.0 { py / pp } else { 0.0 });
        let rest = rows().map(|(p, y)| (y - gain * p).powi(2)).sum::<f64>();
        let variance = yy - sum * sum / count;
        IdentifiedActuator {
            actuator,
            gain,
            offset: self.offset,
            rmse: (rest / count).sqrt(),
            explained: if variance > 0.0 { 1.0 - rest / variance } else { 0.0 },
        }
    }
}

/// The least cost over a grid of rising numbers and then, by golden section, between the neighbours of its best one.
/// To each side by itself: at a whole number of steps the cost may have a kink.
fn least<T: Copy>(grid: &[f64], mut at: impl FnMut(f64) -> T, cost: impl Fn(&T) -> f64) -> T {
    let mut best = at(grid[0]);
    let mut place = 0;
    for (i, &x) in grid.iter().enumerate().skip(1) {
        let found = at(x);
        if cost(&found) < cost(&best) {
            (best, place) = (found, i);
        }
    }
    let neighbours = [place.checked_sub(1), Some(place + 1).filter(|&i| i < grid.len())];
    for neighbour in neighbours.into_iter().flatten() {
        let found = golden_section(grid[place], grid[neighbour], SECTIONS, &mut at, &cost);
        if cost(&found) < cost(&best) {
            best = found;
        }
    }
    best
}

/// The least cost between two numbers, if it has one valley there.
pub(super) fn golden_section<T: Copy>(
    mut low: f64,
    mut high: f64,
    sections: u32,
    mut at: impl FnMut(f64) -> T,
    cost: impl Fn(&T) -> f64,
) -> T {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let inner = |low: f64, high: f64| [high - ratio * (high - low), low + ratio * (high - low)];
    let [mut x, mut y] = inner(low, high);
    let (mut of_x, mut of_y) = (at(x), at(y));
    for _ in 0..sections {
        if cost(&of_x) <= cost(&of_y) {
            high = y;
            (y, of_y) = (x, of_x);
            x = inner(low, high)[0];
            of_x = at(x);
        } else {
            low = x;
            (x, of_x) = (y, of_y);
            y = inner(low, high)[1];
            of_y = at(y);
        }
    }
    if cost(&of_x) <= cost(&of_y) { of_x } else { of_y }
}
