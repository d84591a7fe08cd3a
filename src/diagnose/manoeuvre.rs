//! What to drive next: the manoeuvre that tells the first two candidates apart best.
//!
//! Each of a small set is replayed with the first candidate's value; the evidence expected is what the second candidate,
//! free in its value and with all tolerances besides, cannot imitate: `d' (W^-1 + U U')^-1 d`.

use super::filter::Filter;
use super::fit::{Fit, Linear};
use super::problem::Problem;
use super::rank::Ranking;
use super::replay::{Correction, Drive, ReplayVehicle};
use super::report::Manoeuvre;
use crate::log::CleanLog;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Length and sample time, s.
const DURATION: f64 = 30.0;
const STEP: f64 = 0.02;

/// A manoeuvre: name, how it is driven, and speed (m/s), wanted lateral acceleration (m/s2) and acceleration over time.
struct Planned {
    name: &'static str,
    how: &'static str,
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
        how: "gentle turns to both sides (2 m/s2) while the speed rises from 6 to 26 m/s in 30 s",
        speed: |t| 6.0 + 20.0 * t / DURATION,
        lateral: |t| 2.0 * (TAU * 0.25 * t).sin(),
    },
    Planned {
        name: "step steer",
        how: "at 18 m/s, steer to 3 m/s2 within 0.2 s, hold for 3 s, back, then to the other side; repeat",
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
        how: "at 20 m/s, steer a sine of 2.5 m/s2 whose frequency rises from 0.2 to 2.5 Hz in 30 s",
        speed: |_| 20.0,
        lateral: |t| 2.5 * sweep(t),
    },
    Planned {
        name: "there and back",
        how: "a straight road at 15 m/s, a turn, and the same road in the opposite direction",
        speed: |_| 15.0,
        lateral: |t| if (10.0..19.4).contains(&t) { 5.0 } else { 0.0 },
    },
    Planned {
        name: "limit circle",
        how: "on a wide, free area, turn ever tighter at 14 m/s until the tyres slide, to either side",
        speed: |_| 14.0,
        lateral: |t| if t < 15.0 { 8.0 * t / 15.0 } else { -8.0 * (t - 15.0) / 15.0 },
    },
    Planned {
        name: "braking",
        how: "from 25 m/s, brake with 4 m/s2 and accelerate again, on a straight and in a gentle turn",
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

/// A log of a manoeuvre as the simulator drives it; columns as the real log has them, for the noise to be compared.
fn log_of<V: ReplayVehicle>(planned: &Planned, problem: &Problem<V>, length: f64) -> CleanLog {
    let rows = (DURATION / STEP) as usize;
    let at = |i: usize| i as f64 * STEP;
    let mut columns: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    let vx: Vec<f64> = (0..rows).map(|i| (planned.speed)(at(i))).collect();
    let mut steer: Vec<f64> = (0..rows)
        .map(|i| {
            let (v, a) = (vx[i], (planned.lateral)(at(i)));
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
        step: STEP,
        time: (0..rows).map(at).collect(),
        columns,
        commanded: problem.drive.commanded,
        valid: vec![true; rows],
        findings: Vec::new(),
    }
}

/// The manoeuvre from which most evidence is expected for `first` against `second`, both as fitted.
#[must_use]
pub fn next<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    first: &Fit,
    second: &Fit,
    without: &[String],
) -> Option<Manoeuvre> {
    let nothing = Correction::default();
    let length = problem.vehicle.reach();
    let mut best: Option<(f64, &Planned)> = None;
    for planned in &PLANNED {
        let drive = Drive::new(&log_of(planned, problem, length), V::TRUCK);
        let there = Problem::new(&drive, problem.vehicle, &nothing, without, problem.threads());
        if there.knobs.len() != problem.knobs.len() || there.blocks.len() != problem.blocks.len() {
            continue;
        }
        // The rate limit's coordinate is one of the log's own steering: here the same value is another one.
        let carried = |x: &[f64]| -> Vec<f64> {
            x.iter()
                .zip(&there.knobs)
                .zip(&problem.knobs)
                .map(
                    |((x, here), before)| {
                        if here.id == "steer_rate_limit" { x * here.unit / before.unit } else { *x }
                    },
                )
                .collect()
        };
        let (a, b) = (carried(&first.x), carried(&second.x));
        let (Some(of_first), Some(of_second)) = (there.residual(&a), there.residual(&b)) else { continue };
        // Noise of the log at hand, on the clock of the manoeuvre.
        let factor = Filter::new(STEP).gain() / problem.filter.gain() * (problem.drive.step / STEP).sqrt();
        let mut weights = Vec::new();
        for ((_, block), &deviation) in there.blocks.iter().zip(&ranking.noise.effective) {
            weights.resize(weights.len() + block.len(), (deviation * factor.max(0.1)).powi(-2));
        }
        let linear = Linear::new(there.slopes(&b, &of_second), weights);
        let difference: Vec<f64> = of_second.iter().zip(&of_first).map(|(b, a)| b - a).collect();
        let precision = ranking.prior.freed(problem, &second.freed);
        let evidence = linear.marginal(&difference, &difference, &precision);
        if evidence.is_finite() && best.is_none_or(|(so_far, _)| evidence > so_far) {
            best = Some((evidence, planned));
        }
    }
    let (expected_evidence, planned) = best?;
    let name = |fit: &Fit| fit.freed.iter().map(|&i| problem.knobs[i].id).collect::<Vec<_>>().join(" + ");
    Some(Manoeuvre {
        name: planned.name.to_owned(),
        how: planned.how.to_owned(),
        separates: vec![name(first), name(second)],
        expected_evidence,
    })
}
