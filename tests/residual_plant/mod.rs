//! A linear plant to learn from: the single track in path errors behind a steering actuator with dead time, lag and
//! wrong stiffness, all with closed forms.
#![allow(dead_code)]

use rfl_mpc::nominal::{ContinuousErrorModel, ErrorState};
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::{DataConfig, DataSet, Drive};
use rfl_mpc::vehicle::SingleTrack;

pub const TS: f64 = 0.02;

pub fn car() -> SingleTrack {
    SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 }
}

/// What separates the plant from its nominal model.
#[derive(Debug, Clone, Copy)]
pub struct Plant {
    pub vehicle: SingleTrack,
    /// Dead time of the actuator, samples.
    pub dead_samples: usize,
    /// Time constant of the actuator, s; 0 for none.
    pub lag: f64,
    /// Standard deviation of the noise on the four states, relative to 5 mm, 10 mm/s, 1.5 mrad, 4 mrad/s.
    pub noise: f64,
}

impl Plant {
    pub fn exact() -> Self {
        Self { vehicle: car(), dead_samples: 0, lag: 0.0, noise: 0.0 }
    }
}

/// Normal numbers (Box and Muller).
pub fn normal(random: &mut Random) -> f64 {
    (-2.0 * (1.0 - random.uniform()).ln()).sqrt() * (std::f64::consts::TAU * random.uniform()).cos()
}

/// Drives `rows` samples at one speed and curvature, with a steering of feed-forward, feedback and random dither.
pub fn drive(plant: &Plant, rows: usize, seed: u64, v: f64) -> Drive {
    let mut random = Random::new(seed);
    let mut log = Drive { name: format!("drive {seed}"), ..Drive::default() };
    let mut x = ErrorState::zeros();
    let mut steer = 0.0;
    let mut issued = vec![0.0; plant.dead_samples];
    let mut dither = 0.0;
    let phase = 6.0 * random.uniform();
    let curvature = 0.02 * random.uniform() - 0.01;
    for k in 0..rows {
        let t = k as f64 * TS;
        dither = 0.9 * dither + 0.006 * normal(&mut random);
        let wheelbase = car().lf + car().lr;
        let command = wheelbase * curvature - 0.03 * x[0] - 0.02 * x[1] - 0.25 * x[2]
            + dither
            + 0.01 * (1.3 * t + phase).sin();
        let mut noisy = x;
        for (state, scale) in noisy.iter_mut().zip([5e-3, 10e-3, 1.5e-3, 4e-3]) {
            *state += plant.noise * scale * normal(&mut random);
        }
        log.time.push(t);
        log.steer_cmd.push(command);
        log.e1.push(noisy[0]);
        log.e1_rate.push(noisy[1]);
        log.e2.push(noisy[2]);
        log.e2_rate.push(noisy[3]);
        log.vx.push(v);
        log.curvature.push(curvature);
        log.curvature_rate.push(0.0);
        issued.push(command);
        let delayed = issued.remove(0);
        x = step(plant, &x, &mut steer, delayed, v, curvature);
    }
    log
}

/// One sample of the plant: the actuator's lag is integrated exactly with the vehicle by fine steps.
pub fn step(
    plant: &Plant,
    x: &ErrorState,
    steer: &mut f64,
    command: f64,
    v: f64,
    curvature: f64,
) -> ErrorState {
    let fine = if plant.lag > 0.0 { 20 } else { 1 };
    let model = ContinuousErrorModel::new(&plant.vehicle, v).unwrap().discretise(TS / f64::from(fine));
    let mut x = *x;
    for _ in 0..fine {
        if plant.lag > 0.0 {
            *steer += (command - *steer) * (1.0 - (-TS / f64::from(fine) / plant.lag).exp());
        } else {
            *steer = command;
        }
        x = model.step(&x, *steer, v * curvature, 0.0);
    }
    x
}

/// Samples of a drive at each of these speeds, for the nominal car.
pub fn data(plant: &Plant, speeds: &[f64], rows: usize, seed: u64) -> DataSet {
    let drives = (seed..).zip(speeds).map(|(seed, &v)| drive(plant, rows, seed, v)).collect::<Vec<_>>();
    DataSet::new(&drives, &car(), CONFIG).unwrap()
}

pub const CONFIG: DataConfig =
    DataConfig { sample_time: TS, min_model_speed: 1.5, steer_gain: 1.0, steer_offset: 0.0 };
