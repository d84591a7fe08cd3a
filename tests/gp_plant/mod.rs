//! A nonlinear vehicle to learn from: the model that a controller has of it with softer tyres, other masses and, if
//! wanted, a lag in its steering and noise on what is recorded. Its residual against the nominal vehicle is smooth and known.
#![allow(dead_code)]

use rfl_mpc::nominal::{ArticulatedSingleTrack, Bicycle};
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::gp::{GP_OUTPUTS, GpVehicle, INPUTS, TRUCK_GP_OUTPUTS, TRUCK_INPUTS};
use rfl_mpc::residual::{DataConfig, DataSet, Drive};
use rfl_mpc::vehicle::{Articulated, SingleTrack, builtin_truck};

pub const TS: f64 = 0.02;
pub const CONFIG: DataConfig =
    DataConfig { sample_time: TS, min_model_speed: 1.5, steer_gain: 1.0, steer_offset: 0.0 };

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

/// What the controller believes of a truck.
pub fn truck() -> Articulated {
    builtin_truck("truck_simulation").unwrap().articulated()
}

/// What the truck is: loaded otherwise, and softer in its tyres.
pub fn true_truck() -> ArticulatedSingleTrack {
    let truck = truck();
    let stiffness = [0.75, 0.85, 0.7].map(|share| share * truck.stiffness[0]);
    let loaded = Articulated { mass2: 1.3 * truck.mass2, a2: 1.1 * truck.a2, stiffness, ..truck };
    ArticulatedSingleTrack::new(&loaded, 0.6).unwrap()
}

/// A vehicle of which both are known, and how it is driven: the steering angle for each 1/m of curvature and the lateral
/// acceleration of the bends, m/s2.
pub trait Known<const S: usize, const D: usize, const O: usize>: GpVehicle<S, D, O> {
    const STEER: f64;
    const ACROSS: f64;
    fn believed() -> Self;
    fn truth() -> Self::Model;
}

impl Known<4, INPUTS, GP_OUTPUTS> for SingleTrack {
    const STEER: f64 = 2.9;
    const ACROSS: f64 = 1.6;
    fn believed() -> Self {
        car()
    }
    fn truth() -> Bicycle {
        truth()
    }
}

impl Known<6, TRUCK_INPUTS, TRUCK_GP_OUTPUTS> for Articulated {
    const STEER: f64 = 3.6;
    const ACROSS: f64 = 1.0;
    fn believed() -> Self {
        truck()
    }
    fn truth() -> ArticulatedSingleTrack {
        true_truck()
    }
}

/// A drive of a car along a winding road at changing speed.
pub fn drive(plant: &Plant, rows: usize, seed: u64) -> Drive {
    drive_of::<SingleTrack, 4, INPUTS, GP_OUTPUTS>(plant, rows, seed)
}

/// A drive of a vehicle along a winding road at changing speed.
pub fn drive_of<V, const S: usize, const D: usize, const O: usize>(
    plant: &Plant,
    rows: usize,
    seed: u64,
) -> Drive
where
    V: Known<S, D, O>,
{
    let mut random = Random::new(seed);
    let truth = V::truth();
    let mut log = Drive { name: format!("drive {seed}"), ..Drive::default() };
    let (phase, fast) = (6.0 * random.uniform(), 8.0 + 6.0 * random.uniform());
    let [mut e1, mut e2, mut steer, mut dither] = [0.0; 4];
    // Speed, the body's states, command, acceleration.
    let mut at = [0.0; D];
    for k in 0..rows {
        let t = k as f64 * TS;
        let vx = fast + 3.0 * (0.21 * t + phase).sin();
        let curvature = V::ACROSS / (vx * vx) * (0.5 * t + phase).sin();
        let curvature_rate = 0.5 * V::ACROSS / (vx * vx * vx) * (0.5 * t + phase).cos();
        let [vy, yaw_rate] = [at[1], at[2]];
        let (sin, cos) = f64::sin_cos(e2);
        let along = (vx * cos - vy * sin) / (1.0 - curvature * e1);
        let rates = [vx * sin + vy * cos, yaw_rate - curvature * along];
        dither = 0.9 * dither + 0.004 * normal(&mut random);
        let command = V::STEER * curvature - 0.03 * e1 - 0.02 * rates[0] - 0.25 * e2 + dither;
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
        if S > 4 {
            log.articulation.push(noisy(at[3], 2e-3));
            log.articulation_rate.push(noisy(at[4], 5e-3));
        }
        log.columns_mut().into_iter().zip(row).for_each(|(column, value)| column.push(value));
        // The errors are integrated coarsely: what is learned from is each row's vy and yaw rate.
        e1 += TS * rates[0];
        e2 += TS * rates[1];
        steer = if plant.lag > 0.0 {
            steer + (command - steer) * (1.0 - (-TS / plant.lag).exp())
        } else {
            command
        };
        at[D - 2] = steer;
        at = V::step(&truth, &at, vx, TS);
    }
    log
}

pub fn data(plant: &Plant, drives: u64, rows: usize, seed: u64) -> DataSet {
    data_of(plant, drives, rows, seed)
}

pub fn data_of<V, const S: usize, const D: usize, const O: usize>(
    plant: &Plant,
    drives: u64,
    rows: usize,
    seed: u64,
) -> DataSet<V, S>
where
    V: Known<S, D, O>,
{
    let drives: Vec<Drive> =
        (0..drives).map(|i| drive_of::<V, S, D, O>(plant, rows, 100 * seed + i)).collect();
    DataSet::new(&drives, &V::believed(), CONFIG).unwrap()
}
