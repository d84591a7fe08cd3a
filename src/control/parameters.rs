//! The controller's parameters: one table for code, FMU variables, `--set` and documentation.

use super::guard::GuardParameters;
use super::longitudinal::LongitudinalParameters;
use super::observer::ObserverParameters;
use super::vehicle::ControlledParameters;
use crate::enumeration;
use crate::nominal::{Actuator, DeadTimeModel, LateralVehicle};
use crate::parameter::{OutOfRange, Parameter, ParameterGroup};
use crate::parameters;
use crate::path::{AxleShares, CAR_GRIP, Path, PathOptions, TightestTurn, USED_GRIP};
use crate::residual::DataConfig;
use crate::signal::GRAVITY;
use crate::vehicle::{CarParameters, SingleTrack, Steering, range_of};

/// Share of the steering's lock that a rounded corner takes.
const CORNER_SHARE: f64 = 0.85;

/// Steps of the prediction that the FMU shows as outputs; longer horizons are allowed.
pub const SHOWN_HORIZON: usize = 30;

/// Range of a number that a car's file has, too. A vehicle that a file may hold is one that the controller takes.
const fn of_file(name: &str) -> (f64, f64) {
    range_of(CarParameters::TABLE, name)
}

parameters! {
    /// The nominal vehicle, as a careful engineer knows it: axle stiffnesses at static load.
    pub struct NominalVehicle {
        mass: f64 = 1412.0, KILOGRAM in of_file("vehicle.mass").0, of_file("vehicle.mass").1; "vehicle.mass", "Mass of the nominal model"
        yaw_inertia: f64 = 1536.7, KILOGRAM_METRE2 in of_file("vehicle.yaw_inertia").0, of_file("vehicle.yaw_inertia").1; "vehicle.yaw_inertia", "Yaw moment of inertia of the nominal model"
        lf: f64 = 1.015, METRE in of_file("vehicle.cg_to_front_axle").0, of_file("vehicle.cg_to_front_axle").1; "vehicle.cg_to_front_axle", "Distance from the CG to the front axle"
        lr: f64 = 1.895, METRE in of_file("vehicle.cg_to_rear_axle").0, of_file("vehicle.cg_to_rear_axle").1; "vehicle.cg_to_rear_axle", "Distance from the CG to the rear axle"
        front_stiffness: f64 = 120e3, NEWTON_PER_RADIAN in 1e3, 1e7; "tyre.front.stiffness", "Cornering stiffness of the front axle (both tyres)"
        rear_stiffness: f64 = 110e3, NEWTON_PER_RADIAN in 1e3, 1e7; "tyre.rear.stiffness", "Cornering stiffness of the rear axle (both tyres)"
    }
}

parameters! {
    /// The lateral MPC.
    pub struct MpcParameters {
        sample_time: f64 = 0.02, SECOND in 0.001, 0.2; "mpc.sample_time", "Time between control steps, Ts"
        horizon: usize = 50, ONE in 2.0, 120.0; "mpc.horizon", "Steps of the prediction and control horizon, N"
        q_e1: f64 = 1.0, ONE in 0.0, 1e6; "mpc.q_e1", "Weight of the squared lateral error, per m2"
        q_e1_rate: f64 = 1.4, ONE in 0.0, 1e6; "mpc.q_e1_rate", "Weight of the squared rate of the lateral error, per (m/s)2"
        q_e2: f64 = 0.0, ONE in 0.0, 1e6; "mpc.q_e2", "Weight of the squared deviation of the yaw error from that of steady cornering, per rad2"
        q_e2_rate: f64 = 0.4, ONE in 0.0, 1e6; "mpc.q_e2_rate", "Weight of the squared rate of the yaw error, per (rad/s)2"
        terminal_factor: f64 = 1.0, ONE in 1.0, 1e4; "mpc.terminal_factor", "Factor on the weights at the end of the horizon"
        r_rate: f64 = 0.0015, ONE in 1e-9, 1e6; "mpc.r_rate", "Weight of the squared rate of the steering command, per (rad/s)2"
        r_lateral_jerk: f64 = 0.001, ONE in 0.0, 1e6; "mpc.r_lateral_jerk", "Weight of the squared lateral jerk that the rate of the steering command asks for, v^2/L times that rate, per (m/s3)2"
        tightening: f64 = 2.0, ONE in 1.0, 10.0; "mpc.tightening", "Factor on the loop's bandwidth once the drive has shown the steering actuator: weights of rates fall with its square, that of the steering's rate with its sixth power"
        follow_road: usize = 1, ONE in 0.0, 1.0; "mpc.follow_road", "What the cost is on: 1 for the deviation from the steering and the motion that following the road asks for; 0 for the steering's own rate, and the deviation from steady cornering"
        steer_max: f64 = 0.6, RADIAN in of_file("steering.angle_limit").0, of_file("steering.angle_limit").1; "mpc.steer_max", "Largest road-wheel angle that is commanded"
        steer_rate_max: f64 = 0.8, RADIAN_PER_SECOND in of_file("steering.rate_limit").0, 20.0; "mpc.steer_rate_max", "Largest rate of the road-wheel angle that is commanded"
        lateral_jerk_max: f64 = 15.0, METRE_PER_SECOND3 in 0.1, 1e6; "mpc.lateral_jerk_max", "Largest lateral jerk that the rate of the steering command asks for, v^2/L times that rate: the bound of the rate falls with the speed"
        lateral_accel_max: f64 = 15.0, METRE_PER_SECOND2 in 0.5, 1e6; "mpc.lateral_accel_max", "Largest lateral acceleration that the steering asks for beyond that of the road: a truck's tyres hold more than rolls it over"
        e1_max: f64 = 0.5, METRE in 0.01, 100.0; "mpc.e1_max", "Soft bound of the lateral error"
        slack_quadratic: f64 = 100.0, ONE in 1e-6, 1e9; "mpc.slack_quadratic", "Weight of the squared excess over the soft bound, per m2"
        slack_linear: f64 = 1.0, ONE in 0.0, 1e9; "mpc.slack_linear", "Weight of the excess over the soft bound, per m"
        dither: f64 = 0.0, RADIAN in 0.0, 0.1; "mpc.dither", "Amplitude of a random steering dither, for collecting drives to learn from"
        dither_seed: usize = 1, ONE in 0.0, 1e6; "mpc.dither_seed", "Seed of the dither"
        min_model_speed: f64 = 1.5, METRE_PER_SECOND in 0.3, 10.0; "mpc.min_model_speed", "Speed below which the prediction model is held, for it is stiff at standstill"
        solver: usize = 0, ONE in 0.0, 1.0; "mpc.solver", "Solver of the QP: 0 for the active-set method, and Clarabel where it does not get through; 1 for Clarabel alone"
        max_iterations: usize = 50, ONE in 1.0, 1000.0; "mpc.max_iterations", "Iterations after which Clarabel gives up (the active-set method has a bound of its own)"
        deadline: f64 = 0.0, SECOND in 0.0, 10.0; "mpc.deadline", "Wall-clock time after which the solver gives up and the last plan goes on; 0 for none (results then depend on nothing but inputs)"
    }
}

enumeration! {
    /// Tracking of the speed plan.
    pub enum SpeedController {
        Pi = 0 "pi", "Feedforward of the plan and a PI on the speed error (speed.gain, speed.integral)";
        Mpc = 1 "mpc", "MPC of speed and lag error (longitudinal.*)";
    }
}

parameters! {
    /// Speed plan and speed control.
    pub struct SpeedParameters {
        limit: f64 = 30.0, METRE_PER_SECOND in 0.5, 80.0; "speed.limit", "Speed that is never exceeded, whatever the path allows"
        lateral_accel: f64 = 2.25, METRE_PER_SECOND2 in 0.1, 15.0; "speed.lateral_accel", "Lateral acceleration that the speed plan allows"
        accel: f64 = 1.5, METRE_PER_SECOND2 in 0.1, 10.0; "speed.accel", "Acceleration that the speed plan allows"
        decel: f64 = 2.0, METRE_PER_SECOND2 in 0.1, 12.0; "speed.decel", "Deceleration that the speed plan allows"
        brake_decel: f64 = 100.0, METRE_PER_SECOND2 in 0.01, 100.0; "speed.brake_decel", "Largest deceleration that the brakes give on a level road, their force over the mass: the speed plan asks for less"
        controller: usize = 0, ONE in 0.0, 1.0; "speed.controller", "How the speed plan is tracked: 0 by feedforward and PI; 1 by MPC of speed and lag error (longitudinal.*)"
        gain: f64 = 1.0, ONE in 0.0, 20.0; "speed.gain", "Proportional gain from the speed error to the acceleration, 1/s"
        integral: f64 = 0.2, ONE in 0.0, 20.0; "speed.integral", "Integral gain of the speed error, 1/s2"
        grip: f64 = CAR_GRIP, METRE_PER_SECOND2 in 0.1, 30.0; "speed.grip", "Largest part of the tyres' grip that plan, drive and brakes use where the road's friction factor is 1"
        accel_cmd_max: f64 = 3.0, METRE_PER_SECOND2 in 0.1, 15.0; "speed.accel_cmd_max", "Largest acceleration that is commanded; what holds the vehicle on a slope that the road tells of comes on top"
        decel_cmd_max: f64 = 6.0, METRE_PER_SECOND2 in 0.1, 15.0; "speed.decel_cmd_max", "Largest deceleration that is commanded; what holds the vehicle on such a slope comes on top"
        safe_decel: f64 = 3.0, METRE_PER_SECOND2 in 0.1, 12.0; "speed.safe_decel", "Deceleration of the safe hold"
    }
}

parameters! {
    /// The given steering actuator: of the variant `actuator`, and to begin with of `adaptive`.
    pub struct ActuatorParameters {
        dead_time: f64 = 0.0, SECOND in of_file("steering.dead_time").0, of_file("steering.dead_time").1; "actuator.dead_time", "Dead time of the steering actuator that the variant actuator predicts with"
        dead_time_model: DeadTimeModel = 0, ONE in 0.0, 3.0; "actuator.dead_time_model", "How the variant actuator predicts with that dead time"
        time_constant: f64 = 0.0, SECOND in of_file("steering.lag").0, of_file("steering.lag").1; "actuator.time_constant", "Time constant of the first-order lag of the steering actuator that the variant actuator predicts with"
        backlash: f64 = 0.0, RADIAN in of_file("steering.backlash").0, of_file("steering.backlash").1; "actuator.backlash", "Full width of the steering's gap: the command takes it up where the plan reverses"
        gain: f64 = 1.0, ONE in of_file("steering.gain").0, of_file("steering.gain").1; "actuator.gain", "Known ratio of the angle at the wheels to the command: wheels = gain * steer_cmd + offset"
        offset: f64 = 0.0, RADIAN in of_file("steering.offset").0, of_file("steering.offset").1; "actuator.offset", "Known angle at the wheels without a command: wheels = gain * steer_cmd + offset"
    }
}

parameters! {
    /// The nonlinear MPC of the variants `nmpc` and `gp_nmpc`.
    pub struct NmpcParameters {
        friction: f64 = 1.0, ONE in 0.1, 2.0; "nmpc.friction", "Friction coefficient of the tyres that the variants nmpc and gp_nmpc predict with: given, for ordinary driving does not show it"
        max_iterations: usize = 30, ONE in 1.0, 200.0; "nmpc.max_iterations", "Most quadratic programs of a step of the variants nmpc and gp_nmpc"
    }
}

/// All of it for a car.
pub type ControllerParameters = ControllerParametersFor<NominalVehicle>;

/// All of it for a kind of vehicle with parameters `G` of its own.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[allow(missing_docs)]
pub struct ControllerParametersFor<G> {
    pub vehicle: G,
    pub mpc: MpcParameters,
    pub observer: ObserverParameters,
    pub speed: SpeedParameters,
    pub longitudinal: LongitudinalParameters,
    pub actuator: ActuatorParameters,
    pub nmpc: NmpcParameters,
    pub guard: GuardParameters,
    /// Of the vehicle's file, and no parameter of its own.
    pub axles: AxleShares,
}

impl ControllerParameters {
    /// The default controller for a car: its single-track model and steering limits.
    #[must_use]
    pub fn for_car(car: &CarParameters) -> Self {
        let vehicle = NominalVehicle::from_single_track(&car.single_track());
        let mut parameters = Self { vehicle, ..Self::default() };
        parameters.longitudinal.drive_lag = car.drive.lag;
        parameters.actuator = ActuatorParameters::of(&car.steering);
        parameters.mpc.steer_max = car.steering.angle_limit;
        parameters.speed.brake_decel = SpeedParameters::braked_by(car.brake.max_force, car.vehicle.mass);
        parameters.speed.grip = SpeedParameters::gripped_by(car.least_friction(), CAR_GRIP);
        parameters.mpc.steer_rate_max = parameters.mpc.steer_rate_max.min(car.steering.rate_limit);
        parameters.axles = car.axle_shares();
        parameters
    }
}

impl<G> ControllerParametersFor<G> {
    /// Sets the parameter of a name; says whether there is one.
    ///
    /// # Errors
    /// A value out of its range; nothing has changed then.
    pub fn set<const S: usize>(&mut self, name: &str, value: f64) -> Result<bool, OutOfRange>
    where
        G: ControlledParameters<S>,
    {
        Ok(self.vehicle.set_by_name(name, value)?
            || set(&mut self.mpc, name, value)?
            || set(&mut self.observer, name, value)?
            || set(&mut self.speed, name, value)?
            || set(&mut self.longitudinal, name, value)?
            || set(&mut self.actuator, name, value)?
            || set(&mut self.nmpc, name, value)?
            || set(&mut self.guard, name, value)?)
    }

    /// The declaration of a parameter that every vehicle's controller has, if it is one.
    #[must_use]
    pub fn declared(name: &str) -> Option<&'static Parameter> {
        let tables = [
            MpcParameters::table(),
            ObserverParameters::table(),
            SpeedParameters::table(),
            LongitudinalParameters::table(),
            ActuatorParameters::table(),
            NmpcParameters::table(),
            GuardParameters::table(),
        ];
        tables.into_iter().flatten().find(|parameter| parameter.name == name)
    }

    /// How tightly the vehicle turns, by the nominal model in steady cornering.
    #[must_use]
    pub fn tightest_turn<const S: usize>(&self) -> TightestTurn
    where
        G: ControlledParameters<S>,
    {
        const FAST: f64 = 10.0;
        let vehicle = self.vehicle.nominal();
        TightestTurn {
            lock: self.mpc.steer_max,
            wheelbase: vehicle.wheelbase(),
            rear: -vehicle.steady_state(0.0)[2],
            understeer: (vehicle.steady_steer(FAST) - vehicle.steady_steer(0.0)) / (FAST * FAST),
        }
    }

    /// How a road is read for the vehicle: corners of its points are rounded with the least radius that leaves the steering a share
    /// of its lock for errors, and the trailer its articulation.
    #[must_use]
    pub fn reading<const S: usize>(&self, options: &PathOptions) -> PathOptions
    where
        G: ControlledParameters<S>,
    {
        let radius = self.tightest_turn::<S>().radius_at(CORNER_SHARE);
        PathOptions { least_radius: Some(self.vehicle.least_radius_behind(radius)), ..*options }
    }

    /// A warning, if a road bends more tightly than the vehicle can turn.
    #[must_use]
    pub fn too_tight<const S: usize>(&self, road: &Path) -> Option<String>
    where
        G: ControlledParameters<S>,
    {
        let circle = self.tightest_turn::<S>().radius();
        let tight = road.tighter_than(circle).map(|(station, radius, length)| {
            format!(
                "the road has {radius:.2} m radius at station {station:.1} m ({}), and {length:.1} m of it are tighter than \
                 the vehicle turns ({circle:.2} m at mpc.steer_max): it may leave the road there",
                road.row(station)
            )
        });
        tight.or_else(|| self.vehicle.too_tight_behind(road))
    }

    /// A note where a road tells of speeds above `speed.limit`, such as those of a racing line.
    #[must_use]
    pub fn slower_than_told(&self, road: &Path) -> Option<String> {
        let speeds = (0..=road.length() as usize).filter_map(|station| road.at(station as f64).speed);
        let fastest = speeds.fold(0.0, f64::max);
        let limit = self.speed.limit;
        (fastest > limit).then(|| {
            format!(
                "the road tells of up to {fastest:.1} m/s, and speed.limit is {limit} m/s: it is driven no faster \
                 (--set speed.limit={})",
                fastest.ceil()
            )
        })
    }

    /// Checks all values against their ranges.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn check<const S: usize>(&self) -> Result<(), OutOfRange>
    where
        G: ControlledParameters<S>,
    {
        self.vehicle.check_all()?;
        self.mpc.check()?;
        self.observer.check()?;
        self.speed.check()?;
        self.longitudinal.check()?;
        self.actuator.check()?;
        self.nmpc.check()?;
        self.guard.check()
    }
}

/// Sets the parameter of a name in a group; says whether there is one.
pub(super) fn set<G: ParameterGroup>(group: &mut G, name: &str, value: f64) -> Result<bool, OutOfRange> {
    let Some(index) = G::table().iter().position(|parameter| parameter.name == name) else {
        return Ok(false);
    };
    G::table()[index].check(value)?;
    group.set(index, value);
    Ok(true)
}

impl ActuatorParameters {
    /// Dead time, lag, backlash, gain and offset of a vehicle's file.
    #[must_use]
    pub fn of(steering: &Steering) -> Self {
        Self {
            dead_time: steering.dead_time,
            time_constant: steering.lag,
            backlash: steering.backlash,
            gain: steering.gain,
            offset: steering.offset,
            ..Self::default()
        }
    }

    /// Angle at the wheels that a steering angle before the linkage makes, rad.
    #[must_use]
    pub fn at_wheels(&self, steer: f64) -> f64 {
        self.gain * steer + self.offset
    }

    /// Steering angle before the linkage for an angle at the wheels, rad.
    #[must_use]
    pub fn before_linkage(&self, angle: f64) -> f64 {
        (angle - self.offset) / self.gain
    }

    /// The actuator of the variant's prediction.
    #[must_use]
    pub fn actuator(&self) -> Actuator {
        let Self { dead_time, dead_time_model, time_constant, .. } = *self;
        Actuator { dead_time, time_constant, dead_time_model }
    }
}

impl MpcParameters {
    /// Largest rate of the steering at a speed in m/s for a wheelbase in m, rad/s, with the lateral error in m and its rate.
    ///
    /// ```text
    /// L / v^2 jerk (1 + min(1, sqrt(e1^2 + (e1' 1 s)^2) / e1_max))
    /// ```
    ///
    /// A loop that swings needs a rate in proportion to its swing. A bound that holds it back makes it lag, and the swing
    /// grows. So a swing as large as the soft bound of the error has twice the rate of a vehicle on its path.
    #[must_use]
    pub fn steer_rate_at(&self, speed: f64, wheelbase: f64, [e1, e1_rate]: [f64; 2]) -> f64 {
        const SWING_TIME: f64 = 1.0;
        let swing = (e1.hypot(SWING_TIME * e1_rate) / self.e1_max).min(1.0);
        let jerk = (1.0 + swing) * self.lateral_jerk_max;
        self.steer_rate_max.min(jerk * wheelbase / (speed * speed).max(1e-9))
    }

    /// The weights of a loop that is faster by `tightening` to the power of `tightness`, 0 to 1. In a time shorter by
    /// `f` the weights of rates fall with the square of `f`, those of second derivatives with its fourth power. The
    /// weight of the lateral jerk, which is the steering's rate times `v^2/L`, falls with its sixth.
    #[must_use]
    pub fn tightened(self, tightness: f64) -> Self {
        let faster = self.tightening.powf(tightness);
        Self {
            q_e1_rate: self.q_e1_rate * faster.powi(-2),
            q_e2: self.q_e2 * faster.powi(-2),
            q_e2_rate: self.q_e2_rate * faster.powi(-4),
            r_rate: self.r_rate * faster.powi(-6),
            r_lateral_jerk: self.r_lateral_jerk * faster.powi(-6),
            tightening: 1.0,
            ..self
        }
    }

    /// The settings of the papers' tables, to which a nominal MPC without an actuator model was tuned. They are a
    /// horizon of 0.32 s for a car, a cost on the steering's own rate, and a rate bounded alike at all speeds.
    #[must_use]
    pub fn of_the_papers(self) -> Self {
        Self {
            horizon: 16,
            q_e1: 1.0,
            q_e1_rate: 0.4,
            q_e2: 1.0,
            q_e2_rate: 0.0,
            r_rate: 0.03,
            r_lateral_jerk: 0.0,
            tightening: 1.0,
            follow_road: 0,
            lateral_jerk_max: 1e6,
            lateral_accel_max: 1e6,
            steer_max: self.steer_max.min(0.6),
            ..self
        }
    }
}

impl<G> ControllerParametersFor<G> {
    /// Labelling of drives for a residual of this controller.
    #[must_use]
    pub fn data_config(&self) -> DataConfig {
        let Self { mpc, actuator, .. } = self;
        DataConfig {
            sample_time: mpc.sample_time,
            min_model_speed: mpc.min_model_speed,
            steer_gain: actuator.gain,
            steer_offset: actuator.offset,
        }
    }

    /// Weights without the terms that the papers' controllers lack.
    #[must_use]
    pub(super) fn plain(self) -> Self {
        let observer = ObserverParameters {
            disturbance_noise: 0.0,
            prediction_noise: 0.05,
            yaw_offset: 0.0,
            yaw_rate_bias: 0.0,
            ..self.observer
        };
        let guard = GuardParameters { active: 0, ..self.guard };
        Self { observer, guard, actuator: ActuatorParameters::default(), ..self }
    }
}

impl ControllerParameters {
    /// The settings of the car paper's tables for a car.
    #[must_use]
    pub fn of_the_papers(car: &CarParameters) -> Self {
        let parameters = Self::for_car(car).plain();
        let longitudinal = LongitudinalParameters::default();
        Self { mpc: parameters.mpc.of_the_papers(), longitudinal, ..parameters }
    }
}

impl SpeedParameters {
    /// Deceleration by brakes of a force in N on a mass in kg, within the range of [`brake_decel`](Self::brake_decel).
    #[must_use]
    pub(super) fn braked_by(force: f64, mass: f64) -> f64 {
        (force / mass).clamp(0.01, 100.0)
    }

    /// Grip that is used of tyres with this friction coefficient on a dry road, m/s2: an ordinary vehicle's, or less.
    #[must_use]
    pub(super) fn gripped_by(friction: f64, ordinary: f64) -> f64 {
        (USED_GRIP * friction * GRAVITY).clamp(0.1, ordinary)
    }

    /// Tracking of the speed plan.
    #[must_use]
    pub fn tracked_by(&self) -> SpeedController {
        // The range admits no other numbers.
        SpeedController::from_number(self.controller as i32).unwrap_or_default()
    }
}

impl NominalVehicle {
    /// The nominal model's parameters.
    #[must_use]
    pub fn single_track(&self) -> SingleTrack {
        SingleTrack {
            mass: self.mass,
            yaw_inertia: self.yaw_inertia,
            lf: self.lf,
            lr: self.lr,
            cf: self.front_stiffness,
            cr: self.rear_stiffness,
        }
    }

    /// From a vehicle's single-track parameters.
    #[must_use]
    pub fn from_single_track(car: &SingleTrack) -> Self {
        Self {
            mass: car.mass,
            yaw_inertia: car.yaw_inertia,
            lf: car.lf,
            lr: car.lr,
            front_stiffness: car.cf,
            rear_stiffness: car.cr,
        }
    }
}
