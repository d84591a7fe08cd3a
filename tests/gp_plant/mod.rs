//! A nonlinear car to learn from: the bicycle model with softer tyres, a shifted centre of gravity and, if wanted,
//! a lag in its steering and noise on what is recorded. Its residual against the nominal car is smooth and known.
#![allow(dead_code)]

use rfl_mpc::nominal::Bicycle;
use rfl_mpc::residual::{DataConfig, DataSet, Drive, Random};
use rfl_mpc::vehicle::SingleTrack;

pub const TS: f64 = 0.02;
pub const CONFIG: DataConfig = DataConfig { sample_time: TS, min_model_speed: 1.5 };

/// What the controller believes.
pub fn car() -> SingleTrack {
    SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 }
}

/// What the car is.
pub fn truth() -> Bicycle {
    let car = SingleTrack { mass: 1650.0, yaw_inertia: 2700.0, lf: 1.2, lr: 1.5, cf: 85e3, cr: 110e3 };
    Bicycle::new(&car, 0.7).unwrap()
}

#[derive(Debug, Clone, Copy, Default)]
pub struct Plant {
    /// Time constant of the steering, s; 0 for none.
    pub lag: f64,
    /// Noise, relative to 5 mm, 10 mm/s, 1.5 mrad, 4 mrad/s.
    pub noise: f64,
}

pub fn normal(random: &mut Random) -> f64 {
    (-2.0 * (1.0 - random.uniform()).ln()).sqrt() * (std::f64::consts::TAU * random.uniform()).cos()
}

/// A drive along a winding road at changing speed.
pub fn drive(plant: &Plant, rows: usize, seed: u64) -> Drive {
    let mut random = Random::new(seed);
    let truth = truth();
    let mut log = Drive { name: format!("drive {seed}"), ..Drive::default() };
    let (phase, fast) = (6.0 * random.uniform(), 8.0 + 6.0 * random.uniform());
    let [mut e1, mut e2, mut vy, mut yaw_rate, mut steer, mut dither] = [0.0; 6];
    for k in 0..rows {
        let t = k as f64 * TS;
        let vx = fast + 3.0 * (0.21 * t + phase).sin();
        let curvature = 1.6 / (vx * vx) * (0.5 * t + phase).sin();
        let curvature_rate = 0.8 / (vx * vx * vx) * (0.5 * t + phase).cos();
        let (sin, cos) = f64::sin_cos(e2);
        let along = (vx * cos - vy * sin) / (1.0 - curvature * e1);
        let rates = [vx * sin + vy * cos, yaw_rate - curvature * along];
        dither = 0.9 * dither + 0.004 * normal(&mut random);
        let command = 2.9 * curvature - 0.03 * e1 - 0.02 * rates[0] - 0.25 * e2 + dither;
        let mut noisy = |value: f64, scale: f64| value + plant.noise * scale * normal(&mut random);
        let row = [
            t,
            command,
            noisy(e1, 5e-3),
            noisy(rates[0], 10e-3),
            noisy(e2, 1.5e-3),
            noisy(rates[1], 4e-3),
            vx,
            curvature,
            curvature_rate,
        ];
        log.columns_mut().into_iter().zip(row).for_each(|(column, value)| column.push(value));
        // The errors are integrated coarsely: what is learned from is each row's vy and yaw rate.
        e1 += TS * rates[0];
        e2 += TS * rates[1];
        steer = if plant.lag > 0.0 {
            steer + (command - steer) * (1.0 - (-TS / plant.lag).exp())
        } else {
            command
        };
        [vy, yaw_rate] = truth.step(vy, yaw_rate, vx, steer, TS).value;
    }
    log
}

pub fn data(plant: &Plant, drives: u64, rows: usize, seed: u64) -> DataSet {
    let drives: Vec<Drive> = (0..drives).map(|i| drive(plant, rows, 100 * seed + i)).collect();
    DataSet::new(&drives, &car(), CONFIG).unwrap()
}
