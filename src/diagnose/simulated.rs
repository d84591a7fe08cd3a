//! Logs of our own plants with an effect put in, for the calibration of thresholds and for tests.
//!
//! The full plant drives a random winding road at a random, changing speed, steered by a driver who follows a wanted
//! yaw rate. Every log has its own background: all errors of ordinary simulators are drawn from their tolerances.

use super::library::Library;
use super::replay::{ReplayDrive, ReplayVehicle};
use super::uncertain::{self, UncertainParameter};
use crate::log::CleanLog;
use crate::numerics::Random;
use crate::vehicle::{
    Car, CarParameters, PlantStepError, Truck, TruckEffects, TruckParameters, VehicleInput,
};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Conditions under which a log is driven and measured.
#[derive(Debug, Clone, Copy)]
pub struct Conditions {
    /// Seed of road, background and noise.
    pub seed: u64,
    /// Length, s.
    pub duration: f64,
    /// Sample time, s.
    pub step: f64,
    /// Slowest and fastest speed, m/s.
    pub speed: (f64, f64),
    /// Greatest lateral acceleration that the driver wants, m/s2.
    pub lateral: f64,
    /// Factor on the background's tolerances.
    pub background: f64,
    /// Factor on the noise of ordinary sensors.
    pub noise: f64,
    /// Share of the steering that is quick (about 1 Hz).
    pub quick: f64,
}

impl Default for Conditions {
    fn default() -> Self {
        Self {
            seed: 1,
            duration: 60.0,
            step: 0.01,
            speed: (9.0, 24.0),
            lateral: 4.0,
            background: 1.0,
            noise: 1.0,
            quick: 0.25,
        }
    }
}

/// A vehicle that can be driven here.
pub trait DrivableVehicle: ReplayVehicle {
    /// The full plant.
    type Plant;
    /// Makes it, at a speed in m/s.
    fn make(&self, effects: &TruckEffects, vx: f64) -> Option<Self::Plant>;
    #[allow(missing_docs)]
    fn drive(plant: &mut Self::Plant, input: &VehicleInput, step: f64) -> Result<(), PlantStepError>;
    /// `x, y, yaw, vx, vy, yaw_rate, ax, ay, steer, roll, articulation, articulation_rate`.
    fn sensed(plant: &Self::Plant) -> [f64; 12];
}

impl DrivableVehicle for CarParameters {
    type Plant = Car;

    fn make(&self, effects: &TruckEffects, vx: f64) -> Option<Car> {
        let mut car = Car::new(self, &effects.vehicle, None).ok()?;
        car.place(0.0, 0.0, 0.0, vx);
        Some(car)
    }

    fn drive(plant: &mut Car, input: &VehicleInput, step: f64) -> Result<(), PlantStepError> {
        plant.step(input, step)
    }

    fn sensed(plant: &Car) -> [f64; 12] {
        let o = plant.output();
        [o.x, o.y, o.yaw, o.vx, o.vy, o.yaw_rate, o.ax, o.ay, o.steer, o.roll, 0.0, 0.0]
    }
}

impl DrivableVehicle for TruckParameters {
    type Plant = Truck;

    fn make(&self, effects: &TruckEffects, vx: f64) -> Option<Truck> {
        let mut truck = Truck::new(self, effects, None).ok()?;
        truck.place(0.0, 0.0, 0.0, vx);
        Some(truck)
    }

    fn drive(plant: &mut Truck, input: &VehicleInput, step: f64) -> Result<(), PlantStepError> {
        plant.step(input, step)
    }

    fn sensed(plant: &Truck) -> [f64; 12] {
        let o = plant.output();
        [
            o.x,
            o.y,
            o.yaw,
            o.vx,
            o.vy,
            o.yaw_rate,
            o.ax,
            o.ay,
            o.steer,
            o.roll,
            o.articulation,
            o.articulation_rate,
        ]
    }
}

const NAMES: [&str; 12] = [
    "x",
    "y",
    "yaw",
    "vx",
    "vy",
    "yaw_rate",
    "ax",
    "ay",
    "steer",
    "roll",
    "articulation",
    "articulation_rate",
];
/// Ordinary noise of one sample of each.
const NOISE: [f64; 12] = [0.01, 0.01, 0.001, 0.01, 0.02, 0.003, 0.05, 0.05, 5e-4, 0.002, 0.002, 0.004];

/// A smooth random course of a number between -1 and 1: sines with random phases.
struct RandomSignal(Vec<(f64, f64, f64)>);

impl RandomSignal {
    fn new(random: &mut Random, frequencies: (f64, f64)) -> Self {
        let sines = (0..6)
            .map(|_| {
                let frequency = frequencies.0 * (frequencies.1 / frequencies.0).powf(random.uniform());
                (frequency, TAU * random.uniform(), 0.4 + 0.4 * random.uniform())
            })
            .collect();
        Self(sines)
    }

    fn at(&self, time: f64) -> f64 {
        let sum: f64 = self.0.iter().map(|(f, phase, size)| size * (TAU * f * time + phase).sin()).sum();
        (sum / 1.6).clamp(-1.0, 1.0)
    }
}

/// Drives a vehicle with effects. `None` if it cannot be made, or falls over.
#[must_use]
pub fn drive<V: DrivableVehicle>(
    vehicle: &V,
    effects: &TruckEffects,
    conditions: &Conditions,
) -> Option<CleanLog> {
    let Conditions { seed, duration, step, speed, lateral, .. } = *conditions;
    let mut random = Random::stream(seed, 1);
    let (turning, quick, pace) = (
        RandomSignal::new(&mut random, (0.04, 0.25)),
        RandomSignal::new(&mut random, (0.5, 1.6)),
        RandomSignal::new(&mut random, (0.01, 0.05)),
    );
    let wanted_speed = |time: f64| speed.0 + (speed.1 - speed.0) * (0.5 + 0.5 * pace.at(time));
    let (real, real_effects) = background(vehicle, effects, conditions);
    let mut plant = real.make(&real_effects, wanted_speed(0.0))?;
    let rows = (duration / step) as usize;
    let mut columns: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    let mut noise = Random::stream(seed, 3);
    let count = if V::TRUCK { 12 } else { 10 };
    let mut wander = 0.0;
    for row in 0..rows {
        let t = row as f64 * step;
        let sensed = V::sensed(&plant);
        let vx = sensed[3];
        let v = vx.max(3.0);
        let yaw_rate = (1.0 - conditions.quick) * lateral * turning.at(t) / v;
        let ideal = vehicle.reach() * yaw_rate / v * (1.0 + v * v / 700.0);
        wander += step * 0.3 * (yaw_rate - sensed[5]) * vehicle.reach() / v;
        let shake =
            conditions.quick * lateral * quick.at(t) * vehicle.reach() / (v * v) * (1.0 + v * v / 700.0);
        let steer_cmd =
            (ideal + wander + shake + 0.2 * (yaw_rate - sensed[5]) * vehicle.reach() / v).clamp(-0.3, 0.3);
        let accel_cmd = (0.8 * (wanted_speed(t) - vx) + 0.3 * quick.at(0.5 * t)).clamp(-3.5, 2.0);
        columns.entry("steer_cmd").or_default().push(steer_cmd);
        columns.entry("accel_cmd").or_default().push(accel_cmd);
        for i in 0..count {
            let value = sensed[i] + conditions.noise * NOISE[i] * noise.normal();
            columns.entry(NAMES[i]).or_default().push(value);
        }
        V::drive(&mut plant, &VehicleInput { steer_cmd, accel_cmd }, step).ok()?;
    }
    Some(CleanLog::of_columns(step, columns))
}

/// The vehicle and its effects with a background drawn from the tolerances.
fn background<V: ReplayVehicle>(
    vehicle: &V,
    effects: &TruckEffects,
    conditions: &Conditions,
) -> (V, TruckEffects) {
    let log = CleanLog::of_columns(0.01, BTreeMap::new());
    let uncertain: Vec<UncertainParameter> =
        uncertain::uncertain_parameters(vehicle, &ReplayDrive::new(&log, V::TRUCK), Library::default());
    let mut random = Random::stream(conditions.seed, 2);
    let mut x: Vec<f64> = uncertain
        .iter()
        .map(|uncertain| {
            let drawn = random.normal().clamp(-2.5, 2.5);
            let one_sided = matches!(
                uncertain.id,
                "steer_delay" | "sensor_delay" | "steer_lag" | "drive_lag" | "articulation_friction"
            );
            conditions.background * uncertain.tolerance * if one_sided { drawn.abs() } else { drawn }
        })
        .collect();
    // An effect that is put in takes the place of its background.
    for (i, uncertain) in uncertain.iter().enumerate() {
        if let Some(effect) = uncertain.effect
            && effects.get(uncertain.id) != Some(effect.neutral)
        {
            x[i] = 0.0;
        }
    }
    let (vehicle, drawn) = uncertain::at(&uncertain, &x, vehicle);
    let mut all = drawn;
    for effect in TruckEffects::all() {
        if let (Some(value), Some(place)) = (effects.get(effect.id), all.get_mut(effect.id))
            && value != effect.neutral
        {
            *place = value;
        }
    }
    (vehicle, all)
}
