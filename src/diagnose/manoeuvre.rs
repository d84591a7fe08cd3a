//! The next manoeuvre: the drive that best separates the first candidate from the next one, and from one effect less.
//!
//! Each of a small set is replayed as the first candidate was fitted. The expected evidence is the other candidate's
//! excess cost on that drive, each free in its values and with all tolerances besides,
//!
//! ```text
//!     J_b - J_a,    J = min over d  (e - S d)' W (e - S d) + (x + d)' P (x + d),    e: the first's replay less its own
//! ```
//!
//! so that a tolerance that was strained on the log at hand costs its strain. The least of these counts: a drive that
//! separates two partners may leave open whether there is a partner at all.

use super::filter::Filter;
use super::fit::{Fit, Linearisation};
use super::problem::Problem;
use super::profile::SampleWeights;
use super::rank::Ranking;
use super::replay::{Correction, ReplayDrive, ReplayVehicle};
use super::report::Manoeuvre;
use crate::log::CleanLog;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Advice for what no drive of one vehicle can tell: an effect from an error of the model's form that looks like it.
const ALSO: &str = "drive the same before the change, or with a vehicle that drives as modelled, where there is one, and \
                       give that log as --reference: it shows what is the model's own error";

/// Length and sample time, s.
const DURATION: f64 = 30.0;
const STEP: f64 = 0.02;

/// Shares of a car's speed and lateral acceleration for a truck.
const TRUCK: Scale = Scale { speed: 0.75, lateral: 0.4 };
const CAR: Scale = Scale { speed: 1.0, lateral: 1.0 };

/// Shares of speed and lateral acceleration.
#[derive(Clone, Copy)]
struct Scale {
    speed: f64,
    lateral: f64,
}

impl Scale {
    /// A speed in words.
    fn v(self, speed: f64) -> String {
        format!("{:.0} m/s", self.speed * speed)
    }

    /// A lateral acceleration in words.
    fn a(self, lateral: f64) -> String {
        format!("{} m/s2", (10.0 * self.lateral * lateral).round() / 10.0)
    }
}

/// A manoeuvre: name, instructions, and speed (m/s) and wanted lateral acceleration (m/s2) of a car over time.
struct Planned {
    name: &'static str,
    how: fn(Scale) -> String,
    speed: fn(f64) -> f64,
    lateral: fn(f64) -> f64,
}

fn sweep(time: f64) -> f64 {
    // 0.2 to 2.5 Hz.
    let rate = (2.5_f64 / 0.2).ln() / DURATION;
    (TAU * 0.2 * ((rate * time).exp() - 1.0) / rate).sin()
}

const PLANNED: [Planned; 6] = [
    Planned {
        name: "speed sweep",
        how: |of| {
            let (slow, quick) = (of.v(6.0), of.v(26.0));
            format!(
                "gentle turns to both sides ({}) while the speed rises from {slow} to {quick} in 30 s",
                of.a(2.0)
            )
        },
        speed: |t| 6.0 + 20.0 * t / DURATION,
        lateral: |t| 2.0 * (TAU * 0.25 * t).sin(),
    },
    Planned {
        name: "step steer",
        how: |of| {
            let (speed, lateral) = (of.v(18.0), of.a(3.0));
            format!(
                "at {speed}, steer to {lateral} within 0.2 s, hold for 3 s, back, then to the other side; repeat"
            )
        },
        speed: |_| 18.0,
        lateral: |t| {
            let phase = t % 12.0;
            if phase < 3.0 {
                3.0
            } else if phase < 6.0 {
                0.0
            } else if phase < 9.0 {
                -3.0
            } else {
                0.0
            }
        },
    },
    Planned {
        name: "sine sweep",
        how: |of| {
            let (speed, lateral) = (of.v(20.0), of.a(2.5));
            format!("at {speed}, steer a sine of {lateral} whose frequency rises from 0.2 to 2.5 Hz in 30 s")
        },
        speed: |_| 20.0,
        lateral: |t| 2.5 * sweep(t),
    },
    Planned {
        name: "there and back",
        how: |of| {
            format!("a straight road at {}, a turn, and the same road in the opposite direction", of.v(15.0))
        },
        speed: |_| 15.0,
        lateral: |t| if (10.0..19.4).contains(&t) { 5.0 } else { 0.0 },
    },
    Planned {
        name: "limit circle",
        how: |of| {
            let (speed, most) = (of.v(14.0), of.a(8.0));
            format!(
                "on a wide, free area, turn ever tighter at {speed}, to {most} or until the tyres slide, to either side"
            )
        },
        speed: |_| 14.0,
        lateral: |t| if t < 15.0 { 8.0 * t / 15.0 } else { -8.0 * (t - 15.0) / 15.0 },
    },
    Planned {
        name: "braking",
        how: |of| {
            let speed = of.v(25.0);
            format!(
                "from {speed}, brake with 4 m/s2 and accelerate again, on a straight and in a gentle turn ({})",
                of.a(1.5)
            )
        },
        speed: |t| {
            let phase = t % 15.0;
            if phase < 3.0 {
                25.0
            } else if phase < 6.0 {
                25.0 - 4.0 * (phase - 3.0)
            } else {
                (13.0 + 1.5 * (phase - 6.0)).min(25.0)
            }
        },
        lateral: |t| if t < 15.0 { 0.0 } else { 1.5 },
    },
];

/// A log of a manoeuvre as the simulator drives it, with the columns of the real log, so that the noise is comparable.
fn log_of<V: ReplayVehicle>(planned: &Planned, scale: Scale, problem: &Problem<V>) -> CleanLog {
    let length = problem.vehicle.reach();
    let rows = (DURATION / STEP) as usize;
    let at = |i: usize| i as f64 * STEP;
    let mut columns: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    let vx: Vec<f64> = (0..rows).map(|i| scale.speed * (planned.speed)(at(i))).collect();
    let mut steer: Vec<f64> = (0..rows)
        .map(|i| {
            let (v, a) = (vx[i], scale.lateral * (planned.lateral)(at(i)));
            a * length / (v * v) * (1.0 + v * v / 700.0)
        })
        .collect();
    // Nobody steers faster than about half a radian a second at the wheels.
    for i in 1..rows {
        steer[i] = steer[i].clamp(steer[i - 1] - 0.5 * STEP, steer[i - 1] + 0.5 * STEP);
    }
    let (mut yaw, mut x, mut y) = (vec![0.0; rows], vec![0.0; rows], vec![0.0; rows]);
    let mut rate = vec![0.0; rows];
    for i in 0..rows {
        rate[i] = vx[i] * steer[i] / (length * (1.0 + vx[i] * vx[i] / 700.0));
        if i > 0 {
            yaw[i] = yaw[i - 1] + STEP * rate[i - 1];
            x[i] = x[i - 1] + STEP * vx[i - 1] * yaw[i - 1].cos();
            y[i] = y[i - 1] + STEP * vx[i - 1] * yaw[i - 1].sin();
        }
    }
    let accel: Vec<f64> = (0..rows).map(|i| (vx[(i + 1).min(rows - 1)] - vx[i]) / STEP).collect();
    let zero = vec![0.0; rows];
    for (name, column) in [
        ("steer_cmd", &steer),
        ("steer", &steer),
        ("accel_cmd", &accel),
        ("vx", &vx),
        ("vy", &zero),
        ("yaw_rate", &rate),
        ("ax", &accel),
        ("ay", &zero),
        ("roll", &zero),
        ("x", &x),
        ("y", &y),
        ("yaw", &yaw),
        ("articulation", &zero),
        ("articulation_rate", &zero),
    ] {
        if problem.drive.columns.contains_key(name) {
            columns.insert(name, column.clone());
        }
    }
    CleanLog {
        commanded: problem.drive.commanded,
        coarse: problem.drive.coarse.clone(),
        ..CleanLog::of_columns(STEP, columns)
    }
}

/// The manoeuvre with the most expected evidence for `first` against its nearest rival among `others`, all as fitted.
#[must_use]
pub fn next<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    first: &Fit,
    others: &[&Fit],
) -> Option<Manoeuvre> {
    let nothing = Correction::default();
    let scale = if V::TRUCK { TRUCK } else { CAR };
    let mut best: Option<(f64, &Planned, &Fit)> = None;
    for planned in &PLANNED {
        let drive = ReplayDrive::new(&log_of(planned, scale, problem), V::TRUCK);
        let there = Problem::new(&drive, problem.vehicle, &nothing, problem.library, problem.threads());
        if there.uncertain.len() != problem.uncertain.len() || there.blocks.len() != problem.blocks.len() {
            continue;
        }
        // The rate limit's coordinate is one of the log's own steering: here the same value is another one.
        let carried = |x: &[f64]| -> Vec<f64> {
            x.iter()
                .zip(&there.uncertain)
                .zip(&problem.uncertain)
                .map(
                    |((x, here), before)| {
                        if here.id == "steer_rate_limit" { x * here.unit / before.unit } else { *x }
                    },
                )
                .collect()
        };
        let at_first = carried(&first.x);
        let Some(of_first) = there.residual(&at_first) else { continue };
        // Noise of the log at hand, on the clock of the manoeuvre.
        let factor = Filter::new(STEP).gain() / problem.filter.gain() * (problem.drive.step / STEP).sqrt();
        let mut weights = Vec::new();
        for ((_, block), &deviation) in there.blocks.iter().zip(&ranking.noise.effective) {
            weights.resize(weights.len() + block.len(), (deviation * factor.max(0.1)).powi(-2));
        }
        let weights = SampleWeights::new(weights, there.profile.as_ref(), ranking.noise.roughness());
        let linear = Linearisation::new(there.slopes(&at_first, &of_first), Arc::new(weights));
        let explained = |fit: &Fit, at: &[f64], of_fit: &[f64]| {
            let gap: Vec<f64> = of_fit.iter().zip(&of_first).map(|(b, a)| b - a).collect();
            let cost = ranking.prior.step(&linear, at, &gap, &ranking.prior.free(problem, &fit.free)).cost;
            cost.is_finite().then_some(cost)
        };
        let Some(by_first) = explained(first, &at_first, &of_first) else { continue };
        let evidence = |other: &Fit| {
            let at = carried(&other.x);
            let by_other = explained(other, &at, &there.residual(&at)?)?;
            Some((by_other - by_first).max(0.0))
        };
        let all: Option<Vec<_>> = others.iter().map(|&other| Some((evidence(other)?, other))).collect();
        let least = all.and_then(|all| all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)));
        if let Some((evidence, other)) = least
            && best.is_none_or(|(so_far, ..)| evidence > so_far)
        {
            best = Some((evidence, planned, other));
        }
    }
    let (expected_evidence, planned, second) = best?;
    let name = |fit: &Fit| {
        let ids: Vec<&str> = fit.free.iter().map(|&i| problem.uncertain[i].id).collect();
        if ids.is_empty() { "no effect".to_owned() } else { ids.join(" + ") }
    };
    Some(Manoeuvre {
        name: planned.name.to_owned(),
        how: (planned.how)(scale),
        also: ALSO.to_owned(),
        separates: vec![name(first), name(second)],
        expected_evidence,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_say_what_is_driven() {
        for scale in [CAR, TRUCK] {
            for planned in &PLANNED {
                let words = (planned.how)(scale);
                let times = || (0..=1500).map(|i| f64::from(i) * STEP);
                let quickest = times().map(planned.speed).fold(0.0, f64::max);
                assert!(words.contains(&scale.v(quickest)), "{}: {words}", planned.name);
                let most = times().map(|time| (planned.lateral)(time).abs()).fold(0.0, f64::max);
                let told = words.contains(&scale.a(most)) || planned.name == "there and back";
                assert!(told, "{}: {words}", planned.name);
            }
        }
    }
}
