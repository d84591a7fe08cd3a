//! The steering actuator behind the samples of a residual.
//!
//! Where the logs have the measured angle, it comes from command and angle alone ([`ShownActuator::measured`]).
//! Otherwise it comes from the samples. For a hypothesis, dead time and lag, the issued commands make an angle `delta`. The change of the yaw rate over a
//! step is linear in it and, with the errors of a single-track model, in states and road:
//!
//! ```text
//! eps_4 + b_4 u = g b_4 mean(delta) + c' [1, vy/v, r/v, kappa' v^2, ..] + noise      vy = e1' - v e2, r = e2' + v kappa
//! ```
//!
//! `g` and `c` are fitted for each hypothesis, so that stiffness, mass and payload need not be known. With the noise
//! variance integrated out, `log p = -n/2 log(mean square)`, `n` the number of independent samples. The controller's
//! bank has the same measure; here it takes all samples at once.
//!
//! Source: Gelman and others, Bayesian Data Analysis, ch. 14; variable projection: Golub and Pereyra 1973.

use super::dataset::DataSet;
use super::prior::CommandPrior;
use crate::nominal::{Actuator, Estimate, IdentifiedSteering, LateralVehicle};
use crate::numerics::parallel;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix2, Matrix3, Vector3};

/// Dead times and lags that are tried, s.
const LONGEST_DEAD_TIME: f64 = 0.4;
const DEAD_TIME_SPACING: f64 = 0.02;
const LAGS: [f64; 12] = [0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.13, 0.16, 0.2, 0.25, 0.3, 0.4];
/// Refinements about the best of them, each half as wide as the last.
const REFINEMENTS: usize = 4;
/// Correlation time of a residual, s: errors of a model last.
const CORRELATION: f64 = 0.1;
/// Least noise of the yaw acceleration, rad/s2.
const NOISE: f64 = 0.02;
/// Ends of a 90 % interval from its middle, in standard deviations.
const NINE_OF_TEN: f64 = 1.645;
/// First step from the best in search of the spread, s, and how often it may double: up to 0.4 s.
const FIRST_WIDTH: f64 = 1e-4;
const DOUBLINGS: i32 = 12;
/// Spread of dead time and lag together beyond which a log does not show the actuator, s.
const NOT_SHOWN: f64 = 0.06;

/// Actuator that a log shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShownActuator {
    /// The most probable, with its uncertainty.
    pub prior: CommandPrior,
    /// Standard deviation of dead time and lag together, s, on which a loop's stability depends.
    pub spread: f64,
    /// Width of the steering's gap that shows, rad; 0 if none does.
    pub backlash: f64,
    /// Column that shows it.
    pub by: ShownBy,
}

/// Column that shows the actuator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShownBy {
    /// The measured road-wheel angle.
    Angle,
    /// The yaw rate, through the vehicle.
    YawRate,
}

impl ShownActuator {
    /// The actuator as command and measured angle show it; none if they do not determine the delay.
    #[must_use]
    pub fn measured(found: &IdentifiedSteering) -> Option<Self> {
        let spread = |of: &Estimate| (of.high - of.low) / (2.0 * NINE_OF_TEN);
        let prior = CommandPrior {
            actuator: found.actuator(),
            dead_time_spread: spread(&found.dead_time),
            lag_spread: spread(&found.lag),
        };
        let backlash = found.shown_backlash().map_or(0.0, |width| width.value);
        let shown = Self { prior, spread: spread(&found.delay), backlash, by: ShownBy::Angle };
        (found.delay.excited && shown.is_shown()).then_some(shown)
    }

    /// True if the log shows it at all.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        self.spread < NOT_SHOWN
    }
}

/// One uninterrupted piece.
struct Stretch {
    commands: Vec<f64>,
    /// For each step `b_4` and `eps_4 + b_4 u`; none for a step that does not count.
    steps: Vec<Option<(f64, f64)>>,
}

impl<V: LateralVehicle<S>, const S: usize> DataSet<V, S> {
    /// The actuator that the samples show; none if there are too few.
    #[must_use]
    pub fn actuator(&self, threads: usize) -> Option<ShownActuator> {
        let fit = ActuatorRegression::new(self)?;
        let dead_times =
            (0..).map(|k| DEAD_TIME_SPACING * f64::from(k)).take_while(|t| *t <= LONGEST_DEAD_TIME);
        let grid: Vec<(f64, f64)> = dead_times.flat_map(|t| LAGS.map(|lag| (t, lag))).collect();
        let scores = parallel::map(threads, grid.len(), |i| fit.log_likelihood(grid[i]));
        let best = (0..grid.len()).max_by(|&a, &b| scores[a].total_cmp(&scores[b]))?;
        let (mut at, mut score) = (grid[best], scores[best]);
        let mut step = DEAD_TIME_SPACING;
        for _ in 0..REFINEMENTS {
            step *= 0.5;
            for (x, y) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (-1.0, 1.0), (1.0, -1.0)] {
                loop {
                    let near = (at.0 + x * step, at.1 + y * step);
                    if near.0 < 0.0 || near.1 < 0.0 {
                        break;
                    }
                    let found = fit.log_likelihood(near);
                    if found <= score {
                        break;
                    }
                    (at, score) = (near, found);
                }
            }
        }
        // The spread about the best: of all that was tried, where several hypotheses compete; of the likelihood's fall close
        // by, where it is narrower than what was tried.
        let mut moments = [0.0; 4];
        for (&(dead_time, lag), found) in grid.iter().zip(&scores) {
            let weight = (found - score).exp();
            let off = [dead_time - at.0, lag - at.1];
            let squares = [1.0, off[0] * off[0], off[1] * off[1], (off[0] + off[1]).powi(2)];
            moments.iter_mut().zip(squares).for_each(|(sum, square)| *sum += weight * square);
        }
        let weight = moments[0].max(1.0);
        let near = fit.variances(at, score);
        let [dead_time_spread, lag_spread, spread] =
            [0, 1, 2].map(|i: usize| (moments[i + 1] / weight).max(near[i]).sqrt());
        let actuator = Actuator { dead_time: at.0, time_constant: at.1, ..Actuator::default() };
        let prior = CommandPrior { actuator, dead_time_spread, lag_spread };
        Some(ShownActuator { prior, spread, backlash: 0.0, by: ShownBy::YawRate })
    }
}

/// The samples, and the part of the regression that hypotheses do not change.
struct ActuatorRegression {
    sample_time: f64,
    stretches: Vec<Stretch>,
    /// Other regressors of each step that counts.
    beside: DMatrix<f64>,
    projection: Cholesky<f64, nalgebra::Dyn>,
    /// `t' t` less the part that the others explain, and `Z' t`.
    rest: f64,
    of_target: DVector<f64>,
    independent: f64,
}

impl ActuatorRegression {
    fn new<V: LateralVehicle<S>, const S: usize>(data: &DataSet<V, S>) -> Option<Self> {
        let sample_time = data.config.sample_time;
        let mut model: Option<(f64, f64)> = None;
        let mut stretches = vec![];
        let mut rows: Vec<f64> = vec![];
        let mut targets = vec![];
        for (stretch, labels) in data.labelled_stretches() {
            let mut steps = vec![];
            for (row, label) in stretch.iter().zip(&labels) {
                let speed = row.road[0].max(data.config.min_model_speed);
                let effect = match model {
                    Some((of, effect)) if of == speed => effect,
                    _ => data.vehicle.model_at(speed).ok()?.discretise(sample_time).b[3],
                };
                model = Some((speed, effect));
                let step = label.map(|label| (effect, label[3] + effect * row.command));
                if let Some((_, target)) = step {
                    let [v, curvature, curvature_rate] = row.road;
                    let [_, e1_rate, e2, e2_rate] = row.state.first_chunk::<4>().copied().unwrap_or_default();
                    rows.extend([
                        1.0,
                        e1_rate / speed - e2,
                        e2_rate / speed + curvature,
                        curvature_rate * v * v,
                    ]);
                    rows.extend(&row.state[4..]);
                    rows.extend(row.state[4..].iter().map(|x| x / speed));
                    targets.push(target);
                }
                steps.push(step);
            }
            stretches.push(Stretch { commands: stretch.iter().map(|row| row.command).collect(), steps });
        }
        let width = 4 + 2 * (S - 4);
        if targets.len() < 20 * width {
            return None;
        }
        let mut beside = DMatrix::from_row_slice(targets.len(), width, &rows);
        for mut column in beside.column_iter_mut() {
            let norm = column.norm();
            column /= if norm > 0.0 { norm } else { 1.0 };
        }
        let target = DVector::from_vec(targets);
        let gram = beside.transpose() * &beside + DMatrix::identity(width, width) * 1e-9;
        let projection = Cholesky::new(gram)?;
        let of_target = beside.transpose() * &target;
        let rest = target.norm_squared() - of_target.dot(&projection.solve(&of_target));
        let independent = target.len() as f64 * (sample_time / CORRELATION).min(1.0);
        Some(Self { sample_time, stretches, beside, projection, rest, of_target, independent })
    }

    fn log_likelihood(&self, (dead_time, time_constant): (f64, f64)) -> f64 {
        let sampled = Actuator { dead_time, time_constant, ..Actuator::default() }.sample(self.sample_time);
        let delay = sampled.delay();
        let (mut of_angle, mut square, mut with_target) = (DVector::zeros(self.beside.ncols()), 0.0, 0.0);
        let mut row = 0;
        for Stretch { commands, steps } in &self.stretches {
            let at = |k: usize, back: usize| commands[k.saturating_sub(back)];
            let mut state = sampled.steady(commands.first().copied().unwrap_or(0.0));
            for (k, step) in steps.iter().enumerate() {
                let begin = sampled.output(&state, at(k, delay));
                state = sampled.next(&state, at(k, delay), at(k, delay + 1));
                let Some((effect, target)) = step else { continue };
                let angle = 0.5 * effect * (begin + sampled.output(&state, at(k, delay)));
                square += angle * angle;
                with_target += angle * target;
                of_angle.iter_mut().zip(self.beside.row(row).iter()).for_each(|(sum, z)| *sum += angle * z);
                row += 1;
            }
        }
        let solved = self.projection.solve(&of_angle);
        let own = square - of_angle.dot(&solved);
        let explained = with_target - self.of_target.dot(&solved);
        let noise = (NOISE * self.sample_time).powi(2);
        let rest = if own > 1e-12 * square { self.rest - explained * explained / own } else { self.rest };
        -0.5 * self.independent * (rest.max(0.0) / row.max(1) as f64 + noise).ln()
    }

    /// Variances of dead time, lag and their sum about the best, s2. The log-likelihood falls by a half where a parabola of
    /// curvature `H` has `d' H d = 1`; three directions give the three numbers of `H`. A direction in which it does not fall
    /// tells nothing.
    fn variances(&self, best: (f64, f64), score: f64) -> [f64; 3] {
        let directions = [(1.0, 0.0), (0.0, 1.0), (1.0, -1.0)];
        let curvatures = directions.map(|direction| {
            let width = [1.0, -1.0]
                .into_iter()
                .filter_map(|sign| self.width(best, score, (sign * direction.0, sign * direction.1)));
            width.map(|width| 1.0 / (width * width)).reduce(f64::min).unwrap_or(0.0)
        });
        // d' H d of each direction, in H11, H22, H12.
        let system = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, -2.0);
        let solved = system.lu().solve(&Vector3::from(curvatures)).unwrap_or_default();
        let inverse = Matrix2::new(solved[0], solved[2], solved[2], solved[1])
            .cholesky()
            .map(|root| root.inverse())
            .filter(|inverse| inverse.iter().all(|value| value.is_finite()));
        inverse.map_or([0.0; 3], |c| [c[(0, 0)], c[(1, 1)], c[(0, 0)] + c[(1, 1)] + 2.0 * c[(0, 1)]])
    }

    /// Distance from the best at which the log-likelihood has fallen by a half; none if it does not, or where dead time or lag
    /// would be negative before.
    fn width(&self, best: (f64, f64), score: f64, direction: (f64, f64)) -> Option<f64> {
        let fallen = |width: f64| {
            let at = (best.0 + width * direction.0, best.1 + width * direction.1);
            (at.0 >= 0.0 && at.1 >= 0.0).then(|| score - self.log_likelihood(at) >= 0.5)
        };
        let mut high = FIRST_WIDTH;
        for _ in 0..DOUBLINGS {
            if fallen(high)? {
                let mut low = 0.5 * high;
                for _ in 0..4 {
                    let middle = 0.5 * (low + high);
                    *(if fallen(middle)? { &mut high } else { &mut low }) = middle;
                }
                return Some(high);
            }
            high *= 2.0;
        }
        None
    }
}
