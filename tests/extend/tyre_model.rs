//! A car on a tyre of one's own: Fiala's brush, three numbers instead of a hundred.

use rfl_mpc::control::{Controller, ControllerParameters, Measurement};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::vehicle::car::CarFor;
use rfl_mpc::vehicle::tyre::{Contact, OneByOne, TyreForces, TyreModel};
use rfl_mpc::vehicle::{CarInput, CarParameters, Effects, SingleTrack, builtin};
use std::sync::Arc;

/// A brush with parabolic pressure (E. Fiala 1954; Pacejka, section 3.2), for combined slip of one stiffness both ways.
#[derive(Debug, Clone)]
struct Fiala {
    /// Stiffness for each newton of load, 1/rad.
    stiffness: f64,
    friction: f64,
    relaxation: f64,
}

impl TyreModel for Fiala {
    type Four = OneByOne<Self>;

    fn side_by_side(tyres: [&Self; 4]) -> OneByOne<Self> {
        OneByOne::new(tyres)
    }

    fn rolling_radius(&self) -> f64 {
        0.3
    }

    fn vertical_stiffness(&self) -> f64 {
        2e5
    }

    fn vertical_damping(&self) -> f64 {
        50.0
    }

    fn sliding(&self, _: f64) -> [f64; 2] {
        [3.0 * self.friction / self.stiffness; 2]
    }

    fn cornering_stiffness(&self, load: f64, _: f64) -> f64 {
        self.stiffness * load
    }

    fn slip_stiffness(&self, load: f64) -> f64 {
        self.stiffness * load
    }

    fn lateral_relaxation(&self, _: f64, _: f64) -> f64 {
        self.relaxation
    }

    fn longitudinal_relaxation(&self, _: f64) -> f64 {
        self.relaxation
    }

    fn rolling_resistance(&self, _: f64, _: f64, _: f64) -> f64 {
        0.0
    }

    fn forces(&self, contact: &Contact) -> TyreForces {
        let (slip_x, slip_y) = (contact.kappa, contact.alpha.tan());
        let slip = slip_x.hypot(slip_y);
        let grip = self.friction * contact.friction * contact.load;
        // Adhesion up to a share u = 1 of the sliding slip: F = grip (1 - (1 - u)^3).
        let share = (self.stiffness * contact.load * slip / (3.0 * grip)).min(1.0);
        let force = if slip > 0.0 && grip > 0.0 {
            grip * (1.0 - (1.0 - share).powi(3))
        } else {
            return TyreForces::default();
        };
        TyreForces { fx: force * slip_x / slip, fy: -force * slip_y / slip, ..TyreForces::default() }
    }

    fn scale_cornering_stiffness(&mut self, factor: f64) {
        self.stiffness *= factor;
    }

    fn scale_lateral_relaxation(&mut self, factor: f64) {
        self.relaxation *= factor;
    }
}

const FRONT: Fiala = Fiala { stiffness: 14.0, friction: 0.9, relaxation: 0.4 };
const REAR: Fiala = Fiala { stiffness: 17.0, ..FRONT };

/// A car whose wheels stay upright and straight whatever its body does.
fn plain() -> CarParameters {
    let mut car = builtin("c_class").unwrap();
    for axle in [&mut car.axle.front, &mut car.axle.rear] {
        (axle.roll_steer, axle.camber_gain) = (0.0, 0.0);
    }
    for tyre in [&mut car.tyre.front, &mut car.tyre.rear] {
        tyre.lateral_compliance = 0.0;
    }
    (car.steering.dead_time, car.steering.lag) = (0.0, 0.0);
    car
}

/// Yaw rate, rad/s, and lateral acceleration in the plane of the road, m/s2, after some time at a speed and a steering angle.
fn settled(effects: &Effects, speed: f64, steer: f64) -> [f64; 2] {
    let mut car = CarFor::with_tyres(&plain(), [FRONT, REAR], effects, None).unwrap();
    car.place(0.0, 0.0, 0.0, speed);
    for _ in 0..600 {
        let accel_cmd = 2.0 * (speed - car.output().vx);
        car.step(&CarInput { steer_cmd: steer, accel_cmd }, 0.01).unwrap();
    }
    // An accelerometer leans with the body.
    let car = car.output();
    [car.yaw_rate, car.ay - 9.81 * car.roll]
}

#[test]
fn slight_cornering_is_that_of_the_single_track_with_its_stiffness() {
    let parameters = plain();
    let (front, rear) = parameters.axle_loads();
    for (effects, factor) in
        [(Effects::default(), 1.0), (Effects { tyre_stiffness_front: 0.7, ..Effects::default() }, 0.7)]
    {
        let model = SingleTrack {
            cf: factor * FRONT.stiffness * front,
            cr: REAR.stiffness * rear,
            ..parameters.single_track()
        };
        let (speed, steer, wheelbase) = (18.0, 0.002, model.lf + model.lr);
        let understeer = model.mass / wheelbase * (model.lr / model.cf - model.lf / model.cr);
        let expected = speed * steer / (wheelbase + understeer * speed * speed);
        let found = settled(&effects, speed, steer)[0];
        assert!((found / expected - 1.0).abs() < 0.01, "{factor}: {found} {expected}");
    }
}

#[test]
fn no_cornering_is_harder_than_its_grip() {
    for (friction, steer) in [(1.0, 0.3), (0.4, 0.3)] {
        let effects = Effects { road_friction: friction, ..Effects::default() };
        let ay = settled(&effects, 15.0, steer)[1].abs();
        let grip = 9.81 * FRONT.friction * friction;
        assert!(ay < 1.01 * grip && ay > 0.6 * grip, "{ay} of {grip}");
    }
}

#[test]
fn the_controller_drives_it() {
    let road = Arc::new(Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap());
    let mut car =
        CarFor::with_tyres(&plain(), [FRONT, REAR], &Effects::default(), Some(road.clone())).unwrap();
    let mut controller = Controller::new(ControllerParameters::for_car(&plain()), road.clone()).unwrap();
    let start = road.at(0.0);
    car.place(start.x, start.y, start.yaw, 5.0);
    let mut worst = 0.0_f64;
    for _ in 0..3000 {
        let car_now = *car.output();
        let report = *controller
            .step(&Measurement {
                x: car_now.x,
                y: car_now.y,
                yaw: car_now.yaw,
                vx: car_now.vx,
                vy: car_now.vy,
                yaw_rate: car_now.yaw_rate,
                steer: car_now.steer,
                ..Measurement::default()
            })
            .unwrap();
        worst = worst.max(report.e1.abs());
        if report.finished {
            break;
        }
        car.step(&CarInput { steer_cmd: report.steer_cmd, accel_cmd: report.accel_cmd }, 0.02).unwrap();
    }
    assert!(worst < 0.4, "{worst} m beside the road");
}
