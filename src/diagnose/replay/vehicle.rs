//! Vehicles that can be replayed.

use super::channel::Channel;
use super::drive::ReplayDrive;
use crate::control::{SpeedParameters, track_speed};
use crate::vehicle::{
    Car, CarParameters, NO_RATE_LIMIT, ReducedVehicle, Stage, Steering, Truck, TruckEffects, TruckParameters,
    VehicleInput, VehicleParameters, car, truck,
};

/// Gain of the speed control of the full plant's replay, 1/s.
const SPEED_GAIN: f64 = 4.0;

/// Relaxation length of tyres whose files have none, m.
const SHORTEST_RELAXATION: f64 = 0.1;

/// A vehicle that can be replayed.
pub trait ReplayVehicle: VehicleParameters + Clone + Sync + Send {
    /// True if it has a trailer.
    const TRUCK: bool;

    /// Without its fast motions.
    ///
    /// # Errors
    /// Effects that leave no vehicle (CG outside the wheelbase), in words.
    fn reduced(&self, effects: &TruckEffects) -> Result<Box<dyn ReducedVehicle>, String>;

    /// The effects of the vehicle file.
    fn known_effects(&self) -> TruckEffects;
    /// The steering of the vehicle file.
    fn steering(&mut self) -> &mut Steering;
    /// Dead time and lag of the steering in the vehicle file, s.
    fn dead_time(&self) -> f64;
    #[allow(missing_docs)]
    fn lag(&self) -> f64;
    /// Sets the lag of drive and brakes, s.
    fn set_drive_lag(&mut self, lag: f64);
    /// Mass of the whole vehicle, kg; half the air's density times the drag area, kg/m.
    fn mass_and_drag(&self) -> (f64, f64);
    /// Wheelbase of what is steered, m.
    fn reach(&self) -> f64;
    /// Way from its rear axle forward to its centre of gravity, m.
    fn rear(&self) -> f64;
    /// Friction coefficient of the tyres, front.
    fn friction(&self) -> f64;
    /// Lateral relaxation length of the front tyres at rest, m.
    fn relaxation(&self) -> f64;

    /// Drives the full plant, with the effects of its file, along a stretch of rows of a drive, at its speed. Steering
    /// commands are the drive's, accelerations its own.
    fn full(&self, drive: &ReplayDrive, stretch: (usize, usize), driven: &mut Driven);
}

/// Motion of the full plant along a drive, and the acceleration that keeps its speed there.
pub struct Driven {
    /// Corrected signals, by channel.
    pub(super) columns: Vec<Vec<f64>>,
    /// Its speed, m/s, and the acceleration asked of drive and brakes, m/s2.
    pub(super) vx: Vec<f64>,
    pub(super) accel_cmd: Vec<f64>,
}

impl Driven {
    fn put(&mut self, row: usize, values: &[(Channel, f64)]) {
        for &(channel, value) in values {
            if let Some(place) = self.columns[channel as usize].get_mut(row) {
                *place = value;
            }
        }
    }
}

/// Acceleration that keeps the full plant at the log's speed, m/s2. The cost of turning is in no column and is left to
/// the integral. Otherwise a plant in a bend would be slower than the log by that over the gain.
fn keep_speed<V: ReplayVehicle>(
    vehicle: &V,
    drive: &ReplayDrive,
    row: usize,
    vx: f64,
    integral: &mut f64,
) -> f64 {
    let parameters = SpeedParameters {
        gain: SPEED_GAIN,
        integral: 0.25 * SPEED_GAIN * SPEED_GAIN,
        accel_cmd_max: f64::INFINITY,
        decel_cmd_max: f64::INFINITY,
        ..SpeedParameters::default()
    };
    let (mass, drag) = vehicle.mass_and_drag();
    let target = (drive.column("vx")[row], drive.accel[row] + drag * vx * vx / mass);
    let command = track_speed(&parameters, target, vx, *integral, drive.step);
    *integral = command.integral;
    command.accel_cmd
}

macro_rules! common {
    ($tyre:ident) => {
        fn steering(&mut self) -> &mut Steering {
            &mut self.steering
        }

        fn dead_time(&self) -> f64 {
            self.steering.dead_time
        }

        fn lag(&self) -> f64 {
            self.steering.lag
        }

        fn set_drive_lag(&mut self, lag: f64) {
            self.drive.lag = lag;
        }

        fn relaxation(&self) -> f64 {
            let known = Some(self.known_effects().vehicle.tyre_relaxation).filter(|&length| length > 0.0);
            // Without one a tyre follows at once, or nearly so.
            known.or(Self::relaxation(self)).unwrap_or(SHORTEST_RELAXATION)
        }

        fn friction(&self) -> f64 {
            let tyre = self.tyre.front.scaled();
            (tyre.pdy1 * tyre.lmuy).abs()
        }
    };
}

impl ReplayVehicle for CarParameters {
    const TRUCK: bool = false;

    fn reduced(&self, effects: &TruckEffects) -> Result<Box<dyn ReducedVehicle>, String> {
        car::reduced(self, &effects.vehicle).map_err(|error| error.to_string())
    }

    fn known_effects(&self) -> TruckEffects {
        TruckEffects { vehicle: self.effect, ..TruckEffects::default() }
    }

    fn reach(&self) -> f64 {
        self.wheelbase()
    }

    fn rear(&self) -> f64 {
        self.vehicle.cg_to_rear_axle
    }

    fn mass_and_drag(&self) -> (f64, f64) {
        (self.vehicle.mass, 0.5 * self.air.density * self.air.drag_area)
    }

    fn full(&self, drive: &ReplayDrive, (from, to): (usize, usize), driven: &mut Driven) {
        let Ok(mut car) = Car::new(self, &self.effect, None) else { return };
        car.place(0.0, 0.0, 0.0, drive.column("vx")[from]);
        let mut integral = 0.0;
        for row in from..to {
            let o = *car.output();
            let values = [
                (Channel::YawRate, o.yaw_rate),
                (Channel::Ax, o.ax),
                (Channel::Ay, o.ay),
                (Channel::Vy, o.vy),
                (Channel::Roll, o.roll),
            ];
            driven.put(row, &values);
            let accel_cmd = keep_speed(self, drive, row, o.vx, &mut integral);
            (driven.vx[row], driven.accel_cmd[row]) = (o.vx, accel_cmd);
            let input = VehicleInput { steer_cmd: drive.held(row), accel_cmd };
            if car.step(&input, drive.step).is_err() {
                return;
            }
        }
    }

    common!(front);
}

impl ReplayVehicle for TruckParameters {
    const TRUCK: bool = true;

    fn reduced(&self, effects: &TruckEffects) -> Result<Box<dyn ReducedVehicle>, String> {
        truck::reduced(self, effects).map_err(|error| error.to_string())
    }

    fn known_effects(&self) -> TruckEffects {
        self.effect
    }

    fn reach(&self) -> f64 {
        self.tractor.cg_to_front_axle + self.tractor.cg_to_rear_axle
    }

    fn rear(&self) -> f64 {
        self.tractor.cg_to_rear_axle
    }

    fn mass_and_drag(&self) -> (f64, f64) {
        (self.tractor.mass + self.trailer.mass, 0.5 * self.air.density * self.air.drag_area)
    }

    fn full(&self, drive: &ReplayDrive, (from, to): (usize, usize), driven: &mut Driven) {
        let Ok(mut truck) = Truck::new(self, &self.effect, None) else { return };
        truck.place(0.0, 0.0, 0.0, drive.column("vx")[from]);
        let mut integral = 0.0;
        for row in from..to {
            let o = *truck.output();
            let values = [
                (Channel::YawRate, o.yaw_rate),
                (Channel::Ax, o.ax),
                (Channel::Ay, o.ay),
                (Channel::Vy, o.vy),
                (Channel::Roll, o.roll),
                (Channel::Articulation, o.articulation),
                (Channel::ArticulationRate, o.articulation_rate),
            ];
            driven.put(row, &values);
            let accel_cmd = keep_speed(self, drive, row, o.vx, &mut integral);
            (driven.vx[row], driven.accel_cmd[row]) = (o.vx, accel_cmd);
            let input = VehicleInput { steer_cmd: drive.held(row), accel_cmd };
            if truck.step(&input, drive.step).is_err() {
                return;
            }
        }
    }

    common!(front);
}

/// The vehicle for the replay: with a measured angle nothing before the sensor acts.
pub(in crate::diagnose) fn prepared<V: ReplayVehicle>(vehicle: &V, commanded: bool) -> V {
    let mut vehicle = vehicle.clone();
    if !commanded {
        let steering = vehicle.steering();
        (steering.dead_time, steering.lag, steering.backlash) = (0.0, 0.0, 0.0);
        (steering.rate_limit, steering.angle_limit) = (NO_RATE_LIMIT, 1.4);
        let before =
            TruckEffects::all().filter(|effect| matches!(effect.stage, Stage::Command | Stage::Actuator));
        for effect in before {
            if let Some(value) = vehicle.effect_mut(effect.id) {
                *value = effect.neutral;
            }
        }
    }
    vehicle
}
