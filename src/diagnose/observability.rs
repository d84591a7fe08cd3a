//! Observability: effects that a log can and cannot show.
//!
//! The least visible value of an effect is where its evidence reaches the threshold: `x^2 s' (W^-1 + U U')^-1 s = T`, its
//! slope `s` less all that the background imitates.

use super::calibration::Calibration;
use super::fit::Linearisation;
use super::problem::Problem;
use super::rank::Ranking;
use super::replay::{ReplayDrive, ReplayVehicle};
use super::report::Observability;
use crate::numerics::statistics::quantile;
use crate::vehicle::{GRAVITY, Stage, TrailerEffects};

/// Coordinate beyond which an effect is no longer ordinary: an effect seen only beyond counts as not observable.
const ORDINARY: f64 = 10.0;

/// Range of a log in the quantities that make effects visible.
#[derive(Debug, Clone, Copy)]
pub struct Excitation {
    /// Greatest share of the tyres' grip.
    pub grip: f64,
    /// Slowest and fastest speed, m/s (5 % and 95 %).
    pub speed: (f64, f64),
    /// Greatest braking, m/s2.
    pub braking: f64,
    /// Deviation of the steering, rad, and quickest rate, rad/s.
    pub steer: f64,
    #[allow(missing_docs)]
    pub steer_rate: f64,
    /// True if headings of more than half a turn are driven.
    pub turns_about: bool,
}

impl Excitation {
    /// Of a drive.
    #[must_use]
    pub fn of<V: ReplayVehicle>(drive: &ReplayDrive, vehicle: &V) -> Self {
        let rows: Vec<usize> = (0..drive.time.len()).filter(|&i| drive.scored[i]).collect();
        let of = |get: &dyn Fn(usize) -> f64| rows.iter().map(|&i| get(i)).collect::<Vec<f64>>();
        let (vx, rate) = (drive.column("vx"), drive.column("yaw_rate"));
        let lateral = |i: usize| vx[i] * rate.get(i).copied().unwrap_or(0.0);
        let grip = of(&|i| lateral(i).hypot(drive.accel[i]) / (vehicle.friction() * GRAVITY));
        let speed = of(&|i| vx[i]);
        let braking = of(&|i| -drive.accel[i]);
        let steer = of(&|i| drive.steer[i]);
        let mean = steer.iter().sum::<f64>() / steer.len().max(1) as f64;
        let variance = steer.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / steer.len().max(1) as f64;
        let quick = of(&|i| {
            if i > 2 { (drive.steer[i] - drive.steer[i - 2]).abs() / (2.0 * drive.step) } else { 0.0 }
        });
        let below = |values: Vec<f64>, share: f64| quantile(values, share).unwrap_or(0.0);
        let mut heading = 0.0_f64;
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        for &i in &rows {
            heading += rate.get(i).copied().unwrap_or(0.0) * drive.step;
            (low, high) = (low.min(heading), high.max(heading));
        }
        Self {
            grip: below(grip, 0.995),
            speed: (below(speed.clone(), 0.05), below(speed, 0.95)),
            braking: below(braking, 0.99),
            steer: variance.sqrt(),
            steer_rate: below(quick, 0.99),
            turns_about: high - low > std::f64::consts::PI,
        }
    }
}

/// Slopes of all candidates at their own best where the background's are taken elsewhere.
fn slope_of<'a>(ranking: &'a Ranking, linear: &'a Linearisation, uncertain: usize) -> &'a [f64] {
    ranking
        .singles
        .iter()
        .find(|fit| fit.free == [uncertain])
        .and_then(|fit| fit.columns.first())
        .map_or(&linear.slopes[uncertain][..], |(_, column)| column)
}

/// Part of an uncertain parameter's slope that the background does not imitate, in evidence for one unit of its coordinate.
#[must_use]
pub fn information<V: ReplayVehicle>(problem: &Problem<V>, ranking: &Ranking, uncertain: usize) -> f64 {
    let precision = ranking.prior.free_but(problem, &[], &[uncertain]);
    let slope = slope_of(ranking, &ranking.linear, uncertain);
    ranking.linear.marginal(slope, slope, &precision)
}

/// Likeness of two effects on this log beside others, `beside`, and the background. It is the cosine of their slopes
/// less the parts that these imitate,
///
/// ```text
///     cos(a, b) = m(a, b) / sqrt(m(a, a) m(b, b)),        m(a, b) = s_a' (W^-1 + U U')^-1 s_b
/// ```
#[must_use]
pub fn collinearity<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    beside: &[usize],
    [a, b]: [usize; 2],
) -> f64 {
    let precision = ranking.prior.free_but(problem, beside, &[a, b]);
    let [s_a, s_b] = [a, b].map(|uncertain| slope_of(ranking, &ranking.linear, uncertain));
    let of = |a, b| ranking.linear.marginal(a, b, &precision);
    let size = (of(s_a, s_a) * of(s_b, s_b)).sqrt();
    if size > 0.0 { (of(s_a, s_b) / size).clamp(-1.0, 1.0) } else { 0.0 }
}

/// Every effect of the library, and those of one's own.
#[must_use]
pub fn observability<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    calibration: &Calibration,
) -> Vec<Observability> {
    let drive = problem.drive;
    let excitation = Excitation::of(drive, problem.vehicle);
    let mut all = Vec::new();
    for effect in problem.library.effects() {
        let of_trailer = TrailerEffects::find(effect.id).is_some();
        if of_trailer && !V::TRUCK || effect.id == "payload_x" {
            continue;
        }
        let before_sensor = matches!(effect.stage, Stage::Command | Stage::Actuator);
        let entry = |observable, least, named_from, why: String| Observability {
            effect: effect.id.to_owned(),
            observable,
            least,
            named_from,
            why,
        };
        if before_sensor && !drive.commanded {
            let why = "the log holds the measured steering angle, not the command: what lies before the sensor is not seen";
            all.push(entry(false, None, None, why.to_owned()));
            continue;
        }
        if effect.id == "wind_y" && !drive.compass {
            let why = "without yaw, or x and y, a wind has no direction: it is named wind_x, by its speed";
            all.push(entry(false, None, None, why.to_owned()));
            continue;
        }
        let Some(uncertain) =
            problem.find(effect.id).filter(|&uncertain| problem.uncertain[uncertain].is_candidate())
        else {
            all.push(entry(false, None, None, "left out of the library for this diagnosis".to_owned()));
            continue;
        };
        let information = information(problem, ranking, uncertain);
        let threshold = calibration.telling();
        let least = (information > 0.0).then(|| (threshold / information).sqrt());
        let it = &problem.uncertain[uncertain];
        // A value x gives evidence x^2 / (1 / information + tolerance^2); with a reference log the tolerance is what it left.
        let tolerance = ranking.prior.covariance[(uncertain, uncertain)].max(0.0).sqrt();
        let named_from = least.map(|least| it.spread(1.0, least.hypot(threshold.sqrt() * tolerance)));
        let (tolerance, unit) = (it.spread(1.0, tolerance), it.symbol::<V>());
        let reason = reason(effect.id, drive, &excitation);
        match least {
            Some(x) if x < ORDINARY => {
                let value = it.spread(1.0, x);
                let within = match named_from {
                    Some(named) if named > 1.05 * value => {
                        format!(
                            " and named from {} on, as a sound vehicle may be off by {}",
                            short(named),
                            short(tolerance)
                        )
                    }
                    _ => String::new(),
                };
                all.push(entry(
                    true,
                    Some(value),
                    named_from,
                    format!("seen from {} {unit} on{within}; {reason}", short(value)),
                ));
            }
            Some(x) => {
                let value = it.spread(1.0, x);
                all.push(entry(
                    false,
                    Some(value),
                    named_from,
                    format!("{reason}: it would show from {} {unit} on only", short(value)),
                ));
            }
            None => {
                all.push(entry(false, None, None, format!("{reason}: it changes nothing that was compared")))
            }
        }
    }
    all
}

/// A number with two figures.
#[must_use]
pub fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = |value: f64| (1 - value.abs().log10().floor() as i32).max(0) as usize;
    // What is rounded up may have a place more: 9.99 is 10.
    let places = 10_f64.powi(digits(value) as i32);
    let rounded = (value * places).round() / places;
    format!("{rounded:.0$}", digits(rounded))
}

/// Excitation that matters for an effect, in numbers.
fn reason(id: &str, drive: &ReplayDrive, it: &Excitation) -> String {
    match id {
        "road_friction" => format!(
            "{:.0} % of grip reached, and below about a third less grip is like another curve of the tyre",
            100.0 * it.grip
        ),
        "steer_delay" | "steer_lag" | "steer_rate_limit" | "sensor_delay" | "tyre_relaxation"
        | "yaw_inertia" | "steer_backlash" => {
            format!("steering up to {} rad/s, deviation {} rad", short(it.steer_rate), short(it.steer))
        }
        "drive_lag" | "drive_gain" | "drag" | "road_grade" if drive.accel_cmd.is_none() => {
            "accel_cmd was not logged".to_owned()
        }
        "drive_lag" | "drive_gain" => format!("braking up to {} m/s2", short(it.braking)),
        "steer_gain"
        | "tyre_stiffness_front"
        | "tyre_stiffness_rear"
        | "cg_shift"
        | "payload"
        | "speed_scale" => {
            format!(
                "speeds from {:.0} to {:.0} m/s, {:.0} % of grip reached",
                it.speed.0,
                it.speed.1,
                100.0 * it.grip
            )
        }
        "wind_x" | "wind_y" | "road_bank" | "steer_offset" | "yaw_rate_bias" | "brake_pull" => {
            let headings =
                if it.turns_about { "headings all around" } else { "one direction of driving only" };
            format!("{headings}, speeds from {:.0} to {:.0} m/s", it.speed.0, it.speed.1)
        }
        "lateral_accel_bias" | "imu_lever_arm" if drive.column("ay").is_empty() => {
            "ay was not logged".to_owned()
        }
        "roll_stiffness" if drive.column("roll").is_empty() => "roll was not logged".to_owned(),
        _ => format!("{:.0} % of grip reached", 100.0 * it.grip),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::CleanLog;
    use crate::vehicle::builtin;

    /// A drive at 15 m/s with a yaw rate of this size, all to one side or in turn to both.
    fn driven(yaw_rate: f64, to_both: bool) -> ReplayDrive {
        let side = |row: usize| if to_both { (0.01 * std::f64::consts::PI * row as f64).sin() } else { 1.0 };
        let sides: Vec<f64> = (0..2000).map(side).collect();
        let columns = [
            ("vx", vec![15.0; 2000]),
            ("yaw_rate", sides.iter().map(|side| yaw_rate * side).collect()),
            ("steer_cmd", sides.iter().map(|side| 0.03 * side).collect()),
        ];
        let log = CleanLog::of_columns(0.02, columns.into());
        ReplayDrive::new(&log, false)
    }

    #[test]
    fn what_a_log_excites_is_said_in_numbers() {
        let car = builtin("c_class").unwrap();
        let round = Excitation::of(&driven(0.2, false), &car);
        assert!(round.turns_about);
        assert!((round.grip - 15.0 * 0.2 / (car.friction() * GRAVITY)).abs() < 1e-6, "{round:?}");
        assert_eq!(round.speed, (15.0, 15.0));
        assert!(round.steer < 1e-12 && round.steer_rate < 1e-12, "{round:?}");
        // A weave of four seconds turns by little: 0.2 rad/s times 4 s / pi.
        let weave = Excitation::of(&driven(0.2, true), &car);
        assert!(!weave.turns_about);
        assert!((weave.steer / (0.03 / 2.0_f64.sqrt()) - 1.0).abs() < 0.01, "{weave:?}");
        assert!((weave.steer_rate / (0.03 * 0.5 * std::f64::consts::PI) - 1.0).abs() < 0.01, "{weave:?}");
    }

    #[test]
    fn a_number_has_two_figures() {
        for (value, expected) in
            [(0.0123, "0.012"), (-0.0123, "-0.012"), (1.26, "1.3"), (9.99, "10"), (123.4, "123"), (0.0, "0")]
        {
            assert_eq!(short(value), expected, "{value}");
        }
        assert_eq!(short(f64::INFINITY), "inf");
    }
}
