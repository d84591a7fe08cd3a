//! The closed loop in native code: the controller's and the vehicle's own step functions, no host between them.
//!
//! The master algorithm is that of `scripts/closed_loop.py`, so that both give the same bits. At each communication
//! point `t_k = k h` the controller reads the vehicle's outputs and steps. Then the vehicle takes its commands and
//! steps. (Gauss-Seidel, controller first: no step of delay between them.)

use super::columns::{STATION, STATUS, STEER_CMD, TIME};
use super::metrics::{InputMetrics, StepTimes, TimeMetrics, TrackingMetrics};
use super::noise::SensorNoise;
use super::outcome::{DriveError, End, Ending, LaneLimits, Outcome, Place, Referee};
use super::vehicle::{CAR_COLUMNS, SimulatedVehicle, TRUCK_COLUMNS};
use crate::control::{ControlStatus, ControllerFor, Measurement, Sampler, TRUCK_STATES, Timing};
use crate::nominal::{ERRORS, SteeringDrive};
use crate::numerics::{Random, Readable};
use crate::path::RoadClass;
use crate::residual;
use crate::signal::{self, Signal};
use crate::vehicle::{Car, Truck, VehicleInput};
use std::io::Write;

/// One communication point of a car.
pub type CarRow = [f64; CAR_COLUMNS];

/// A controller and a car, connected.
pub type ClosedLoop = ClosedLoopFor<Car, ERRORS, CAR_COLUMNS>;

/// A controller and a truck, connected.
pub type TruckClosedLoop = ClosedLoopFor<Truck, TRUCK_STATES, TRUCK_COLUMNS>;

/// Fault of the measurements on their way, from the time in s.
type Fault = Box<dyn FnMut(f64, &mut Measurement) + Send>;

/// A controller and a vehicle, connected.
pub struct ClosedLoopFor<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> {
    controller: ControllerFor<P::Nominal, S>,
    vehicle: P,
    sampler: Sampler,
    step: f64,
    count: u32,
    noise: Option<(SensorNoise, Random)>,
    fault: Option<Fault>,
    /// True place at the newest row.
    place: Place,
    referee: Referee,
}

impl<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> ClosedLoopFor<P, S, C> {
    /// Connects the two with a communication step in s. The vehicle stands where it was placed.
    #[must_use]
    pub fn new(controller: ControllerFor<P::Nominal, S>, vehicle: P, step: f64) -> Self {
        let referee = Referee::new(controller.path(), LaneLimits::default());
        Self {
            controller,
            vehicle,
            sampler: Sampler::new(0.0),
            step,
            count: 0,
            noise: None,
            fault: None,
            place: Place::default(),
            referee,
        }
    }

    /// Connects a controller with a vehicle at the start of the controller's path, at the planned speed, on the road
    /// that the path describes.
    ///
    /// # Errors
    /// Parameters or effects of the vehicle out of range.
    pub fn at_start(
        controller: ControllerFor<P::Nominal, S>,
        vehicle: &P::Parameters,
        effects: &P::Effects,
        step: f64,
    ) -> Result<Self, P::Error> {
        let path = controller.path();
        let mut vehicle = P::make(vehicle, effects, Some(path.clone()))?;
        let start = path.at(0.0);
        vehicle.place(start.x, start.y, start.yaw, controller.start_speed());
        Ok(Self::new(controller, vehicle, step))
    }

    /// Places the vehicle anew: x, m, y, m, yaw, rad, and speed, m/s; without a value, that of the path's start and plan.
    #[must_use]
    pub fn placed(mut self, initial: [Option<f64>; 4]) -> Self {
        if initial.iter().any(Option::is_some) {
            let start = self.controller.path().at(0.0);
            let [x, y, yaw, vx] = initial;
            let speed = vx.unwrap_or_else(|| self.controller.start_speed());
            self.vehicle.place(x.unwrap_or(start.x), y.unwrap_or(start.y), yaw.unwrap_or(start.yaw), speed);
        }
        self
    }

    /// Adds noise to the controller's measurements; the log holds the noisy ones.
    #[must_use]
    pub fn with_noise(self, noise: SensorNoise, seed: u64) -> Self {
        Self { noise: Some((noise, Random::new(seed))), ..self }
    }

    /// Sets the limits beyond which the vehicle counts as lost. Before the first step.
    #[must_use]
    pub fn with_limits(self, limits: LaneLimits) -> Self {
        let referee = Referee::new(self.controller.path(), limits);
        Self { referee, ..self }
    }

    /// Adds a fault to the measurements on their way to the controller: `fault` gets the time, s. The log holds the
    /// faulty ones.
    #[must_use]
    pub fn with_fault(self, fault: impl FnMut(f64, &mut Measurement) + Send + 'static) -> Self {
        Self { fault: Some(Box::new(fault)), ..self }
    }

    /// The controller.
    #[must_use]
    pub fn controller(&self) -> &ControllerFor<P::Nominal, S> {
        &self.controller
    }

    /// The vehicle.
    #[must_use]
    pub fn vehicle(&self) -> &P {
        &self.vehicle
    }

    /// True lateral error at the newest row, m: that of the vehicle, not that of a noisy measurement.
    #[must_use]
    pub fn lateral_error(&self) -> f64 {
        self.place.lateral_error
    }

    /// Makes one communication step and gives the row of its beginning, with the wall-clock time of the control
    /// step if one was due.
    ///
    /// # Errors
    /// Controller or vehicle cannot go on.
    pub fn advance(&mut self) -> Result<([f64; C], Option<f64>), DriveError> {
        let (row, computed, input) = self.decide()?;
        self.follow(&input)?;
        Ok((row, computed))
    }

    /// Row of the newest communication point, time of the control step if one was due, and commands.
    fn decide(&mut self) -> Result<([f64; C], Option<f64>, VehicleInput), DriveError> {
        let time = f64::from(self.count) * self.step;
        let truth = self.vehicle.measured();
        let [ax, ay, roll] = self.vehicle.recorded();
        let sample_time = self.controller.parameters().mpc.sample_time;
        let mut computed = None;
        let mut seen = truth;
        if let Some((noise, random)) = &mut self.noise {
            noise.disturb(&mut seen, random);
        }
        if let Some(fault) = &mut self.fault {
            fault(time, &mut seen);
        }
        if self.sampler.due(time, self.step, sample_time) {
            let report = self
                .controller
                .step_at(time, &seen)
                .map_err(|source| DriveError::Controller { time, source })?;
            computed = Some(report.compute_time);
        }
        let report = self.controller.report();
        // The controller may be told something else, or bridge what it is told.
        self.place = self.referee.place(self.controller.path(), time, [truth.x, truth.y, truth.yaw]);
        self.referee.see(self.place, truth.vx);
        let input = VehicleInput { steer_cmd: report.steer_cmd, accel_cmd: report.accel_cmd };
        let road = self.controller.path().at(report.station);
        let common = [
            time,
            report.steer_cmd,
            report.accel_cmd,
            seen.x,
            seen.y,
            seen.yaw,
            seen.vx,
            seen.vy,
            seen.yaw_rate,
            ax,
            ay,
            truth.steer,
            roll,
            report.e1,
            report.e1_rate,
            report.e2,
            report.e2_rate,
            report.station,
            report.curvature,
            report.curvature_rate,
            road.bank,
            road.grade,
            road.friction,
        ];
        Ok((P::row(&common, &seen), computed, input))
    }

    /// Lets the vehicle follow commands to the next communication point.
    fn follow(&mut self, input: &VehicleInput) -> Result<(), DriveError> {
        let time = f64::from(self.count) * self.step;
        self.vehicle.advance(input, self.step).map_err(|source| DriveError::Vehicle {
            time,
            vehicle: P::KIND,
            source,
        })?;
        self.count += 1;
        Ok(())
    }

    /// Drives until the road's end or a stop, or for `duration` seconds at most; a lost vehicle until it is far from its
    /// road.
    ///
    /// # Errors
    /// Controller or vehicle cannot go on.
    pub fn drive(
        &mut self,
        duration: f64,
        mut progress: impl FnMut(&[f64; C]),
    ) -> Result<DriveFor<C>, DriveError> {
        self.drive_while(duration, |row, _| {
            progress(row);
            true
        })
    }

    /// The same, while `go_on` is true of a row and the true lateral error in m.
    ///
    /// # Errors
    /// Controller or vehicle cannot go on.
    pub fn drive_while(
        &mut self,
        duration: f64,
        go_on: impl FnMut(&[f64; C], f64) -> bool,
    ) -> Result<DriveFor<C>, DriveError> {
        let drive = self.record(duration, go_on);
        match drive.ending.end {
            End::Failed(error) => Err(error),
            _ => Ok(drive),
        }
    }

    /// The same; a vehicle that rolls over or jack-knifes is lost, and the drive until then is returned.
    ///
    /// # Errors
    /// Controller or vehicle cannot go on for another reason.
    pub fn drive_until_lost(
        &mut self,
        duration: f64,
        go_on: impl FnMut(&[f64; C], f64) -> bool,
    ) -> Result<DriveFor<C>, DriveError> {
        use crate::vehicle::PlantStepError::{JackKnifed, RolledOver};
        let drive = self.record(duration, go_on);
        match drive.ending.end {
            End::Failed(DriveError::Vehicle { source: JackKnifed { .. } | RolledOver { .. }, .. }) => {
                Ok(drive)
            }
            End::Failed(error) => Err(error),
            _ => Ok(drive),
        }
    }

    /// The same; the drive until its end is returned in any case. `ending` has the reason of the end.
    pub fn record(&mut self, duration: f64, mut go_on: impl FnMut(&[f64; C], f64) -> bool) -> DriveFor<C> {
        let mut drive = DriveFor { columns: P::SIGNALS, ..DriveFor::default() };
        let steps = (duration / self.step).round().max(0.0) as u64;
        let mut end = End::Duration;
        for _ in 0..steps {
            let (row, computed, input) = match self.decide() {
                Ok(decided) => decided,
                Err(error) => {
                    end = End::Failed(error);
                    break;
                }
            };
            let report = self.controller.report();
            drive.classes.push(self.controller.path().at(row[STATION]).class);
            drive.rows.push(row);
            drive.statuses.push(report.status);
            drive.lateral_errors.push(self.place.lateral_error);
            if let Some(time) = computed {
                drive.step_times.push(time);
                drive.timings.push(self.controller.lateral().timing());
            }
            let over = if !go_on(&row, self.place.lateral_error) {
                Some(End::GivenUp)
            } else if report.finished && self.referee.at_end() {
                Some(End::Road)
            } else if self.referee.stands() {
                Some(End::Standing { status: report.status })
            } else {
                self.referee.astray().map(|distance| End::Astray { distance })
            };
            let moved = self.follow(&input).map_err(End::Failed).err();
            if let Some(reason) = over.or(moved) {
                end = reason;
                break;
            }
        }
        drive.ending = self.referee.ending(end);
        drive.lost = drive.ending.outcome == Outcome::Lost;
        drive.finished = drive.ending.outcome == Outcome::Completed;
        drive
    }
}

/// A recorded drive of a car.
pub type CarDrive = DriveFor<CAR_COLUMNS>;

/// A recorded drive of a truck.
pub type TruckDrive = DriveFor<TRUCK_COLUMNS>;

/// A recorded drive, with `C` columns.
#[derive(Debug, Clone, Default)]
pub struct DriveFor<const C: usize> {
    /// Signals of the columns.
    pub columns: &'static [Signal],
    /// One row for each communication step.
    pub rows: Vec<[f64; C]>,
    /// Road class at each row, where the path has classes.
    pub classes: Vec<Option<RoadClass>>,
    /// The controller's status at each row.
    pub statuses: Vec<ControlStatus>,
    /// True lateral error at each row, m.
    pub lateral_errors: Vec<f64>,
    /// Wall-clock time of each control step, s.
    pub step_times: Vec<f64>,
    /// Parts of that time.
    pub timings: Vec<Timing>,
    /// Outcome, place and reason.
    pub ending: Ending,
    /// True if the outcome is `lost`.
    pub lost: bool,
    /// True if the outcome is `completed`: a drive off the road is not.
    pub finished: bool,
}

impl<const C: usize> DriveFor<C> {
    /// A column of the log; empty if it has none of that name.
    #[must_use]
    pub fn column(&self, name: &str) -> Vec<f64> {
        match self.columns.iter().position(|signal| signal.name == name) {
            Some(place) => self.rows.iter().map(|row| row[place]).collect(),
            None => Vec::new(),
        }
    }

    /// This drive as training data of a residual.
    #[must_use]
    pub fn to_learn_from(&self) -> residual::Drive {
        let mut log = residual::Drive::default();
        let names = log.columns().map(|(name, _)| name);
        for (column, name) in log.columns_mut().into_iter().zip(names) {
            *column = self.column(name);
        }
        // Empty for a vehicle without.
        log.articulation = self.column(signal::ARTICULATION.name);
        log.articulation_rate = self.column(signal::ARTICULATION_RATE.name);
        log.bank = self.column(signal::BANK.name);
        log.friction = self.column(signal::FRICTION.name);
        log
    }

    /// This drive as data of its steering: command and measured angle.
    #[must_use]
    pub fn to_identify_from(&self) -> SteeringDrive {
        SteeringDrive {
            name: String::new(),
            time: self.column(signal::TIME.name),
            steer_cmd: self.column(signal::STEER_CMD.name),
            response: self.column(signal::STEER.name),
            ..SteeringDrive::default()
        }
    }

    /// Time of the last row, s; 0 for an empty drive.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.rows.last().map_or(0.0, |row| row[TIME])
    }

    /// Lateral tracking error over the whole drive.
    #[must_use]
    pub fn tracking(&self) -> TrackingMetrics {
        TrackingMetrics::of(self.lateral_errors.iter().copied())
    }

    /// Lateral tracking error on one class of road.
    #[must_use]
    pub fn tracking_on(&self, class: RoadClass) -> TrackingMetrics {
        let errors = self.lateral_errors.iter().zip(&self.classes);
        TrackingMetrics::of(errors.filter(|(_, at)| **at == Some(class)).map(|(error, _)| *error))
    }

    /// Roughness of the steering. Rows are taken as control steps.
    #[must_use]
    pub fn steering(&self) -> InputMetrics {
        let commands = self.rows.iter().map(|row| (row[TIME], row[STEER_CMD]));
        InputMetrics::of(commands)
    }

    /// Wall-clock times of the control steps, whole and in parts.
    #[must_use]
    pub fn times(&self, sample_time: f64) -> StepTimes {
        let part = |of: fn(&Timing) -> f64| {
            TimeMetrics::of(&mut self.timings.iter().map(of).collect::<Vec<_>>(), sample_time)
        };
        StepTimes {
            step: TimeMetrics::of(&mut self.step_times.clone(), sample_time),
            look_up: part(|timing| timing.look_up),
            condense: part(|timing| timing.condense),
            solve: part(|timing| timing.solve),
        }
    }

    /// Writes the drive as a drive log, a CSV file. Numbers keep all their bits. The last column, [`STATUS`], is the
    /// controller's status in a word.
    ///
    /// # Errors
    /// The writer's.
    pub fn write_csv(&self, writer: impl Write) -> Result<(), csv::Error> {
        let mut csv = csv::Writer::from_writer(writer);
        csv.write_record(self.columns.iter().map(|signal| signal.name).chain([STATUS]))?;
        for (row, status) in self.rows.iter().zip(&self.statuses) {
            let numbers = row.iter().map(|value| Readable(*value).to_string());
            csv.write_record(numbers.chain([status.name().to_owned()]))?;
        }
        csv.flush()?;
        Ok(())
    }
}
