//! Stability margins of the steering loop: closed forms, the closed loop's poles, and the nonlinear plant.

use nalgebra::{DMatrix, SMatrix, SVector, Vector1};
use rfl_mpc::control::{
    ControlledParameters, Controller, ControllerParameters, ControllerParametersFor, LinearController,
    Measurement, PredictionModel, PredictionModelFor, SteeringLoop, TruckControllerParameters,
};
use rfl_mpc::nominal::{ACTUATOR_STATES, Actuator, ContinuousErrorModel, LateralVehicle, SingleTrackError};
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::signal::{self, Signal};
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{Car, CarParameters, Effects, builtin, builtin_truck};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

const TS: f64 = 0.02;

/// `x' = u`: a loop that can be worked out by hand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Integrator;

impl LateralVehicle<1> for Integrator {
    const KIND: &'static str = "integrator";
    const STATES: [Signal; 1] = [signal::E1];

    fn model_at(&self, _: f64) -> Result<ContinuousErrorModel<1>, SingleTrackError> {
        let zero = Vector1::zeros();
        Ok(ContinuousErrorModel { a: SMatrix::zeros(), b: Vector1::new(1.0), d: zero, e: zero })
    }

    fn steady_state(&self, _: f64) -> SVector<f64, 1> {
        Vector1::zeros()
    }

    fn steady_steer(&self, _: f64) -> f64 {
        1.0
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        vec![]
    }
}

fn integrator(gain: f64, dead_time: f64) -> SteeringLoop<Integrator, 1> {
    let controller = LinearController {
        speed: 1.0,
        sample_time: TS,
        state: vec![Vector1::new(-gain)],
        command: vec![0.0],
        tail: None,
        observer: None,
    };
    SteeringLoop::new(controller, Integrator, Actuator { dead_time, ..Actuator::default() }, 1.0).unwrap()
}

#[test]
fn an_integrator_has_the_margins_worked_out_by_hand() {
    // L = k Ts z^-d / (z - 1): |L| = 1 where 2 sin(w Ts/2) = k Ts, its lag there pi/2 + (d + 1/2) w Ts; real and negative
    // where (d + 1/2) w Ts = pi/2.
    for (gain, steps) in [(3.0, 0), (10.0, 0), (3.0, 2), (9.0, 3)] {
        let margins = integrator(gain, steps as f64 * TS).margins().unwrap();
        let crossover = 2.0 / TS * (0.5 * gain * TS).asin();
        let phase = FRAC_PI_2 - (f64::from(steps) + 0.5) * crossover * TS;
        let critical = 2.0 / TS * (FRAC_PI_2 / (2 * steps + 1) as f64).sin();
        assert!((margins.crossover / crossover - 1.0).abs() < 1e-9, "{margins:?}");
        assert!((margins.phase - phase).abs() < 1e-9, "{margins:?}, {phase}");
        assert!((margins.delay - phase / crossover).abs() < 1e-9);
        assert!((margins.gain * gain / critical - 1.0).abs() < 1e-9, "{margins:?}, {critical}");
        assert_eq!(margins.gain_down, 0.0);
    }
    // Beyond the critical gain nothing is left.
    assert_eq!(integrator(101.0, 0.0).margins(), None);
    assert!(integrator(99.0, 0.0).margins().is_some());
}

/// A controller's design: horizon, then the weights of e1, its rate, e2, its rate and the command's rate.
type Design = (usize, [f64; 5]);

const DESIGNS: [Design; 4] = [
    (16, [1.0, 0.4, 1.0, 0.0, 0.03]),
    (30, [0.118, 0.0138, 30.2, 4.88, 0.015]),
    (50, [0.247, 0.112, 0.0604, 0.393, 0.241]),
    (60, [0.046, 0.012, 0.073, 1.83, 0.13]),
];

fn designed<G: Copy>(
    mut parameters: ControllerParametersFor<G>,
    (horizon, [q_e1, q_e1_rate, q_e2, q_e2_rate, r_rate]): Design,
) -> ControllerParametersFor<G> {
    let mpc = &mut parameters.mpc;
    (mpc.horizon, mpc.q_e1, mpc.q_e1_rate, mpc.q_e2) = (horizon, q_e1, q_e1_rate, q_e2);
    (mpc.q_e2_rate, mpc.r_rate) = (q_e2_rate, r_rate);
    parameters
}

/// With the gain at which so much more dead time is just too much, the delay margin is that dead time, or a lesser one
/// where a loop is unstable in between.
fn whole_steps_are_exact<V: LateralVehicle<S>, const S: usize>(of: &SteeringLoop<V, S>) {
    for steps in 1..4 {
        let dead_time = f64::from(steps) * TS;
        let Some(of_delayed) = of.delayed(dead_time).unwrap().margins() else { return };
        let Some(margins) = of.amplified(of_delayed.gain).margins() else { continue };
        assert!(margins.delay < dead_time + 1e-8, "{margins:?}, {dead_time}");
        // A loop that is nearly unstable without more dead time is so in between, too.
        assert!(margins.sensitivity > 4.0 || margins.delay > dead_time - 1e-8, "{margins:?}, {dead_time}");
    }
}

/// Margins agree with the poles, for each speed and for plants behind several actuators. Gives how many loops were stable.
fn agrees<G: ControlledParameters<S>, const S: usize>(
    parameters: &ControllerParametersFor<G>,
    model: &PredictionModelFor<G::Vehicle, S>,
) -> usize {
    let speeds = [3.0, 9.0, 20.0];
    let controllers = LinearController::at_speeds(parameters, model.clone(), &speeds).unwrap();
    let mut stable = 0;
    for controller in controllers {
        for (dead_time, time_constant) in [(0.0, 0.0), (0.06, 0.1), (0.05, 0.0)] {
            let actuator = Actuator { dead_time, time_constant, ..Actuator::default() };
            let of =
                SteeringLoop::new(controller.clone(), parameters.vehicle.nominal(), actuator, 1.5).unwrap();
            let Some(margins) = of.margins() else {
                assert!(of.spectral_radius() >= 1.0);
                continue;
            };
            stable += 1;
            whole_steps_are_exact(&of);
            // On either side of the critical gain the poles say the opposite.
            let radius = |factor: f64| of.amplified(factor).spectral_radius();
            assert!(margins.gain > 1.0 && margins.gain < 1e4, "{margins:?}");
            let around = [radius(margins.gain * (1.0 - 1e-4)), radius(margins.gain * (1.0 + 1e-4))];
            assert!(around[0] < 1.0 && around[1] > 1.0, "{margins:?}: {around:?}");
            let exact = of.dead_time_to_instability(2.0).unwrap();
            match exact {
                // A fraction of a step acts on a held command a little otherwise than a pure lag of the phase does.
                Some(exact) => assert!(
                    (margins.delay - exact).abs() < 0.2 * TS,
                    "{} m/s, {actuator:?}: {margins:?}, by poles {exact}",
                    controller.speed
                ),
                None => assert!(margins.delay > 1.9, "{margins:?}"),
            }
        }
    }
    stable
}

#[test]
fn a_car_s_margins_agree_with_the_closed_loop_s_poles() {
    let car = builtin("c_class").unwrap();
    let mut stable = 0;
    for design in DESIGNS {
        let parameters = designed(ControllerParameters::of_the_papers(&car), design);
        stable += agrees(&parameters, &PredictionModelFor::Nominal);
    }
    assert!(stable > 18, "{stable}");
}

#[test]
fn a_truck_s_margins_agree_with_the_closed_loop_s_poles() {
    let truck = builtin_truck("truck_simulation").unwrap();
    let mut stable = 0;
    for design in DESIGNS {
        let parameters = designed(TruckControllerParameters::of_the_papers(&truck), design);
        stable += agrees(&parameters, &PredictionModelFor::Nominal);
    }
    assert!(stable > 18, "{stable}");
}

#[test]
fn who_knows_the_actuator_has_margins_too() {
    let car = builtin("c_class").unwrap();
    let parameters = designed(ControllerParameters::of_the_papers(&car), DESIGNS[1]);
    let actuator = Actuator { dead_time: 0.06, time_constant: 0.1, ..Actuator::default() };
    agrees(&parameters, &PredictionModelFor::Actuator(actuator));
    // On the actuator that it knows it has more of a margin than without.
    let at = |model| {
        let controller = LinearController::at_speeds(&parameters, model, &[15.0]).unwrap().remove(0);
        SteeringLoop::new(controller, car.single_track(), actuator, 1.5).unwrap().margins()
    };
    let [blind, knowing] = [PredictionModelFor::Nominal, PredictionModelFor::Actuator(actuator)].map(at);
    assert!(knowing.unwrap().sensitivity < blind.map_or(f64::INFINITY, |margins| margins.sensitivity));
}

#[test]
fn the_poles_are_those_that_nalgebra_finds() {
    let car = builtin("c_class").unwrap();
    let parameters = designed(ControllerParameters::of_the_papers(&car), DESIGNS[2]);
    let controllers =
        LinearController::at_speeds(&parameters, PredictionModelFor::Nominal, &[4.0, 25.0]).unwrap();
    for controller in controllers {
        let of = SteeringLoop::new(controller, car.single_track(), Actuator::default(), 1.5).unwrap();
        let closed: DMatrix<f64> = of.closed();
        let largest = closed.complex_eigenvalues().iter().map(|pole| pole.norm()).fold(0.0, f64::max);
        assert!((of.spectral_radius() - largest).abs() < 1e-9, "{largest}");
    }
}

/// Whether the nonlinear car, put beside a straight road, swings more and more behind so much more dead time.
fn swings_up(parameters: &ControllerParameters, car: &CarParameters, speed: f64, dead_time: f64) -> bool {
    let road: Vec<Sample> = (0..200).map(|i| Sample::at(10.0 * f64::from(i), 0.0)).collect();
    let path = Arc::new(Path::from_samples(road, Closure::Open).unwrap());
    let mut parameters = *parameters;
    parameters.speed.limit = speed;
    let controller = Controller::predicting_with(parameters, path, PredictionModel::Nominal).unwrap();
    let effects = Effects { steer_delay: dead_time, ..Effects::default() };
    let mut vehicle = Car::new(car, &effects, None).unwrap();
    vehicle.place(0.0, 0.02, 0.0, speed);
    let mut closed = ClosedLoop::new(controller, vehicle, TS);
    let mut largest = [0.0_f64; 2];
    for k in 0..1500 {
        closed.advance().unwrap();
        let error = closed.lateral_error().abs();
        if error > 0.5 {
            return true;
        }
        let part = match k {
            500..1000 => 0,
            1000.. => 1,
            _ => continue,
        };
        largest[part] = largest[part].max(error);
    }
    // A swing that bounds of the steering hold is one, too.
    largest[1] > largest[0].min(0.02)
}

#[test]
fn the_nonlinear_car_stands_about_the_dead_time_that_the_margin_says() {
    let car = builtin("c_class").unwrap();
    let steering = &car.steering;
    for (design, speed) in [(DESIGNS[1], 15.0), (DESIGNS[2], 8.0), (DESIGNS[2], 20.0)] {
        let parameters = designed(ControllerParameters::of_the_papers(&car), design);
        let actuator =
            Actuator { dead_time: steering.dead_time, time_constant: steering.lag, ..Actuator::default() };
        let controller = LinearController::at_speeds(&parameters, PredictionModelFor::Nominal, &[speed])
            .unwrap()
            .remove(0);
        let of = SteeringLoop::new(controller, car.single_track(), actuator, 1.5).unwrap();
        let margin = of.margins().unwrap().delay;
        let (mut low, mut high) = (0.0, 2.0 * margin);
        for _ in 0..7 {
            let middle = 0.5 * (low + high);
            if swings_up(&parameters, &car, speed, middle) { high = middle } else { low = middle }
        }
        // Tyres answer late, over their relaxation length, and the body rolls: the linear model knows neither.
        let share = high / margin;
        assert!((2.0 / 3.0..1.5).contains(&share), "{speed} m/s: margin {margin} s, the car stands {high} s");
    }
}

/// Commands of the controller itself in front of the linear vehicle, and of the closed loop as a matrix, after a kick.
fn follows_the_controller(set: impl Fn(&mut ControllerParameters)) {
    let (speed, kick) = (15.0, [0.01, 0.0, 0.002, 0.0]);
    let mut parameters = ControllerParameters::for_car(&builtin("c_class").unwrap());
    parameters.speed.limit = speed;
    parameters.mpc.tightening = 1.0;
    // Errors of the sensor are learned in seconds, beyond the loop's bandwidth.
    parameters.observer.yaw_rate_bias = 0.0;
    parameters.observer.yaw_offset = 0.0;
    set(&mut parameters);
    let road = [0.0, 500.0, 1000.0, 1500.0].map(|x| Sample::at(x, 0.0));
    let road = Arc::new(Path::from_samples(road.to_vec(), Closure::Open).unwrap());
    let model = PredictionModel::Actuator(Actuator::default());
    let mut controller = Controller::predicting_with(parameters, road, model.clone()).unwrap();
    let vehicle = parameters.vehicle.nominal();
    let plant = vehicle.model_at(speed).unwrap().discretise(TS);

    let of = LinearController::at_speeds(&parameters, model, &[speed]).unwrap().remove(0);
    assert_eq!(of.observer.is_some(), parameters.observer.is_on());
    let closed = SteeringLoop::new(of, vehicle, Actuator::default(), 1.5).unwrap().closed();
    let mut linear = nalgebra::DVector::zeros(closed.nrows());

    let mut x = SVector::zeros();
    let mut largest: f64 = 0.0;
    // The covariances settle before the kick.
    let settled = 2000;
    for k in 0..settled + 150 {
        if k == settled {
            x = SVector::from(kick);
            linear.rows_mut(0, 4).copy_from(&x);
        }
        let (vy, station) = (x[1] - speed * x[2], 100.0 + speed * TS * k as f64);
        let measurement = Measurement {
            x: station,
            y: x[0],
            yaw: x[2],
            vx: speed,
            vy,
            yaw_rate: x[3],
            ..Measurement::default()
        };
        let steer = controller.step(&measurement).unwrap().steer_cmd;
        x = plant.step(&x, steer, 0.0, 0.0);
        linear = &closed * linear;
        let expected = linear[4 + ACTUATOR_STATES];
        largest = largest.max(expected.abs());
        assert!((steer - expected).abs() < 1e-3 * largest + 1e-9, "step {k}: {steer}, {expected}");
    }
    assert!(largest > 1e-4, "{largest}");
}

#[test]
fn the_linear_loop_is_that_of_the_controller_with_its_observer_and_without() {
    follows_the_controller(|_| ());
    follows_the_controller(|parameters| parameters.observer.disturbance_noise = 0.2);
    follows_the_controller(|parameters| parameters.observer.disturbance_noise = 0.0);
}
