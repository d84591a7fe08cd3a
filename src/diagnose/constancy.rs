//! Constancy of an effect's value over the drive: an effect of the library has one value; a look-alike needs a varying
//! one.
//!
//! A ratio that varies with the angle looks like a ratio error, a gust like wind, a patch like friction. Their values
//! follow the angle or the time. So an effect `i` of a fit, off by `d_i` and with slopes `s_i`, may vary with
//! standardised quantities `z_k` of the drive,
//!
//! ```text
//!     e(t) - s_i(t) d_i sum_k c_k z_k(t),      c_k ~ N(0, VARY^2),
//! ```
//!
//! The cost is compared with all tolerances marginalised and the effect's own mean free as before. A better explanation
//! is evidence that the value is not constant. With `D` the columns `s_i d_i z_k`, `e_0` the linearised gap at the
//! expected tolerances, and `<a, b> = a' (W^-1 + U U')^-1 b`,
//!
//! ```text
//!     gain = b' (G + 1 / VARY^2)^-1 b,      b_k = <D_k, e_0>,  G_kl = <D_k, D_l>.
//! ```
//!
//! Source: the Lagrange multiplier test of constancy of parameters, e.g. Nyblom, Testing for the constancy of parameters
//! over time, J. Am. Stat. Assoc. 84 (1989).

use super::fit::{Converged, Fit, Linearisation, Precision, Prior};
use super::problem::Problem;
use super::rank::expected;
use super::replay::ReplayVehicle;
use crate::numerics::parallel;
use crate::vehicle::Stage;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// Standard deviation of an effect's relative change, for one standard deviation of the quantity that it varies with.
const VARY: f64 = 0.5;
/// Shortest part of a log that may have a value of its own, s, and most of them.
const PART: f64 = 8.0;
const PARTS: usize = 10;
/// Lateral acceleration that is certainly of one side, m/s2.
const SIDE: f64 = 0.5;

/// Quantity that a value may follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Cause {
    SteeringAngle,
    Side,
    LateralAcceleration,
    Speed,
    Acceleration,
    /// Time, and so the place on the road.
    Time,
}

impl Cause {
    /// As it stands behind "changes".
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::SteeringAngle => "with the steering angle",
            Self::Side => "from left to right",
            Self::LateralAcceleration => "with the lateral acceleration",
            Self::Speed => "with the speed",
            Self::Acceleration => "between driving and braking",
            Self::Time => "with time or place",
        }
    }
}

/// Variation of the value of one effect of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variation {
    /// The effect's uncertain parameter.
    pub effect: usize,
    /// With what.
    pub with: Cause,
    /// By how much: standard deviation over the drive, of the uncertain parameter's coordinate.
    pub deviation: f64,
    /// Gain in explanation of the log, and cost of the freedom.
    pub gain: f64,
    #[allow(missing_docs)]
    pub narrowing: f64,
}

/// A cause with one or more columns over the rows that are compared.
pub type CauseColumns = (Cause, Vec<Vec<f64>>);

/// Quantities that values may follow on a drive.
#[must_use]
pub fn causes<V: ReplayVehicle>(problem: &Problem<V>) -> Vec<CauseColumns> {
    let drive = problem.drive;
    let (vx, rate) = (drive.column("vx"), drive.column("yaw_rate"));
    let lateral: Vec<f64> = vx.iter().zip(rate).map(|(vx, rate)| vx * rate).collect();
    let signals = [
        (Cause::SteeringAngle, drive.steer.iter().map(|steer| steer.abs()).collect()),
        (Cause::Side, lateral.iter().map(|a| (a / SIDE).tanh()).collect()),
        (Cause::LateralAcceleration, lateral.iter().map(|a| a.abs()).collect()),
        (Cause::Speed, vx.to_vec()),
        (Cause::Acceleration, drive.accel.clone()),
    ];
    let mut all: Vec<CauseColumns> = Vec::new();
    for (cause, signal) in signals {
        let mut smooth = Vec::new();
        problem.filter.apply(&signal, &problem.rows, &mut smooth);
        all.extend(standardised(smooth).map(|column| (cause, vec![column])));
    }
    let count = problem.rows.len();
    let length = count as f64 * problem.filter.every as f64 * drive.step;
    let parts = ((length / PART) as usize).min(PARTS);
    if parts >= 2 {
        let share = 1.0 / parts as f64;
        let inside = |i: usize, part: usize| f64::from(u8::from(i * parts / count == part));
        let column = |part: usize| (0..count).map(|i| inside(i, part) - share).collect();
        all.push((Cause::Time, (0..parts).map(column).collect()));
    }
    all
}

/// Column less its mean, over its standard deviation; none for a column that is nearly constant.
fn standardised(mut column: Vec<f64>) -> Option<Vec<f64>> {
    let count = column.len().max(1) as f64;
    let mean = column.iter().sum::<f64>() / count;
    column.iter_mut().for_each(|value| *value -= mean);
    let deviation = (column.iter().map(|value| value * value).sum::<f64>() / count).sqrt();
    if deviation.is_nan() || deviation < 1e-3 {
        return None;
    }
    column.iter_mut().for_each(|value| *value /= deviation);
    Some(column)
}

/// Root mean square of a sum of columns, each with its share.
fn root_mean_square(columns: &[Vec<f64>], share: &DVector<f64>) -> f64 {
    let count = columns.first().map_or(0, Vec::len);
    let at =
        |i: usize| columns.iter().zip(share.iter()).map(|(column, share)| share * column[i]).sum::<f64>();
    ((0..count).map(|i| at(i).powi(2)).sum::<f64>() / count.max(1) as f64).sqrt()
}

/// Response to an effect that is `size` times as large as `z` in each row; `does` and the result in all channels.
#[must_use]
pub fn following<V>(problem: &Problem<V>, does: &[f64], z: &[f64], size: f64) -> Vec<f64> {
    let mut varied = does.to_vec();
    for (_, block) in &problem.blocks {
        varied[block.clone()].iter_mut().zip(z).for_each(|(varied, z)| *varied *= size * z);
    }
    varied
}

/// Effects of the vehicle's body and of its sensors do not vary.
fn may_vary<V: ReplayVehicle>(problem: &Problem<V>, uncertain: usize) -> bool {
    let effect = problem.uncertain[uncertain].effect;
    effect.is_some_and(|effect| !matches!(effect.stage, Stage::Body | Stage::Sensor))
}

/// Gain of each cause for each free effect of a fit that may vary; `linear` holds slopes at the fit.
#[must_use]
pub fn variations<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    causes: &[CauseColumns],
    (linear, precision): (&Linearisation, &Precision),
    fit: &Fit,
) -> Vec<Variation> {
    let may_vary: Vec<usize> = fit.free.iter().copied().filter(|&i| may_vary(problem, i)).collect();
    if may_vary.is_empty() {
        return Vec::new();
    }
    let off = prior.off(&fit.x);
    let Some(background) = linear.marginalised(precision) else { return Vec::new() };
    let expected = background.reduced(expected(linear, prior, fit));
    let mut all = Vec::new();
    for effect in may_vary {
        for (with, columns) in causes {
            let varied = columns.iter().map(|z| following(problem, &linear.slopes[effect], z, off[effect]));
            if let Some(found) = background.explained(&expected, varied, VARY) {
                let deviation = off[effect].abs() * root_mean_square(columns, &found.shares);
                let (gain, narrowing) = (found.gain, found.narrowing);
                all.push(Variation { effect, with: *with, deviation, gain, narrowing });
            }
        }
    }
    all
}

/// The single effect that gains most from a varying value: its place among `singles` and its variation. Each single
/// comes with slopes and precision at its fit, and its cost.
#[must_use]
pub fn best_single<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    causes: &[CauseColumns],
    singles: &[(&Fit, &Linearisation, &Converged)],
) -> Option<(usize, Variation)> {
    let of_each = parallel::map(problem.threads(), singles.len(), |place| {
        let (fit, linear, at) = singles[place];
        variations(problem, prior, causes, (linear, &at.precision), fit)
    });
    let all =
        of_each.into_iter().enumerate().flat_map(|(place, all)| all.into_iter().map(move |it| (place, it)));
    all.max_by(|a, b| {
        let total = |(place, it): &(usize, Variation)| it.gain - singles[*place].2.cost;
        total(a).total_cmp(&total(b)).then(b.0.cmp(&a.0))
    })
}
