//! The car against closed forms, and against itself mirrored.

use rfl_mpc::vehicle::tyre::TyreModel as _;
use rfl_mpc::vehicle::{
    Axle, BUILTIN, Car, CarInput, CarOutput, CarParameters, Effects, PlantStepError, builtin,
};

fn car(parameters: &CarParameters, speed: f64) -> Car {
    let mut car = Car::new(parameters, &Effects::default(), None).unwrap();
    car.place(0.0, 0.0, 0.0, speed);
    car
}

fn drive(car: &mut Car, steer_cmd: f64, accel_cmd: f64, seconds: f64) -> CarOutput {
    for _ in 0..(seconds / 0.01).round() as usize {
        car.step(&CarInput { steer_cmd, accel_cmd }, 0.01).unwrap();
    }
    *car.output()
}

/// Holds a speed in a circle until all is steady.
fn circle(parameters: &CarParameters, speed: f64, steer: f64) -> CarOutput {
    let mut car = car(parameters, speed);
    for _ in 0..1200 {
        let accel_cmd = 2.0 * (speed - car.output().vx);
        car.step(&CarInput { steer_cmd: steer, accel_cmd }, 0.01).unwrap();
    }
    *car.output()
}

fn near(value: f64, expected: f64, relative: f64, what: &str) {
    assert!((value / expected - 1.0).abs() <= relative, "{what}: {value}, expected {expected}");
}

/// A car without what the single-track model does not know: camber thrust and compliances.
fn plain() -> CarParameters {
    let mut car = builtin("bmw_320i").unwrap();
    for tyre in [&mut car.tyre.front, &mut car.tyre.rear] {
        tyre.lateral_compliance = 0.0;
        let coefficients = tyre.coefficients.as_mut().unwrap();
        (coefficients.phy3, coefficients.pvy3, coefficients.pdy3) = (0.0, 0.0, 0.0);
    }
    car
}

#[test]
fn steady_cornering_is_that_of_the_single_track_model() {
    for speed in [8.0, 15.0, 25.0] {
        for (front, rear) in [(1.0, 1.0), (0.8, 1.0)] {
            let mut p = plain();
            p.tyre.front.stiffness_scale *= front;
            p.tyre.rear.stiffness_scale *= rear;
            let s = p.single_track();
            let (length, steer) = (s.lf + s.lr, 0.002);
            let out = circle(&p, speed, steer);
            let gradient = s.mass / length * (s.lr / s.cf - s.lf / s.cr);
            let expected = steer * out.vx / (length + gradient * out.vx * out.vx);
            near(out.yaw_rate, expected, 3e-3, &format!("yaw rate at {speed} m/s"));
            // vy = r (lr - m lf v2 / (L Cr))
            let vy = out.yaw_rate * (s.lr - s.mass * s.lf * out.vx * out.vx / (length * s.cr));
            assert!((out.vy - vy).abs() < 0.01 * out.vx * steer, "vy {}, expected {vy}", out.vy);
        }
    }
}

#[test]
fn single_track_stiffness_is_the_measured_slope() {
    for name in BUILTIN {
        let p = builtin(name).unwrap();
        let s = p.single_track();
        let (front, rear) = p.axle_loads();
        let tyre = p.tyre.front.scaled();
        near(s.cf, 2.0 * tyre.cornering_stiffness(0.5 * front, 0.0), 1e-4, name);
        near(s.cr, 2.0 * p.tyre.rear.scaled().cornering_stiffness(0.5 * rear, 0.0), 1e-4, name);
    }
    let genesis = builtin("genesis").unwrap().single_track();
    near(genesis.cf, 2.0 * 76419.0, 1e-3, "published front stiffness");
    near(genesis.cr, 2.0 * 134_851.0, 1e-3, "published rear stiffness");
    assert_eq!((genesis.lf, genesis.lr, genesis.mass, genesis.yaw_inertia), (1.5213, 1.4987, 2303.1, 5520.1));
}

#[test]
fn coasting_slows_by_drag_and_rolling_resistance() {
    let mut p = builtin("c_class").unwrap();
    let radius = p.tyre.front.scaled().rolling_radius();
    let free_radius = p.tyre.front.scaled().r0;
    let mass = p.vehicle.mass;
    // Wheels turn with the car: their inertia adds to the mass.
    let moved = mass + 4.0 / (radius * radius);
    let set_rolling = |p: &mut CarParameters, value| {
        for tyre in [&mut p.tyre.front, &mut p.tyre.rear] {
            tyre.coefficients.as_mut().unwrap().qsy1 = value;
        }
    };
    set_rolling(&mut p, 0.0);
    let out = drive(&mut car(&p, 40.0), 0.0, 0.0, 20.0);
    let k = 0.5 * 1.2 * 0.66;
    near(out.vx, 40.0 / (1.0 + k * 40.0 * 20.0 / moved), 1e-4, "drag alone");
    near(out.x, moved / k * (1.0 + k * 40.0 * 20.0 / moved).ln(), 1e-4, "and the way");

    set_rolling(&mut p, 0.01);
    p.air.drag_area = 0.0;
    let out = drive(&mut car(&p, 20.0), 0.0, 0.0, 20.0);
    let decel = 0.01 * 9.81 * mass / moved * free_radius / radius;
    near(out.vx, 20.0 - 20.0 * decel, 1e-4, "rolling resistance alone");
    let out = drive(&mut car(&p, 1.0), 0.0, 0.0, 60.0);
    assert!(out.vx.abs() < 1e-3, "it stops: {}", out.vx);
}

#[test]
fn braking_loads_the_front_axle() {
    let p = builtin("bmw_320i").unwrap();
    let out = drive(&mut car(&p, 30.0), 0.0, -3.0, 2.0);
    let before = drive(&mut car(&p, 30.0), 0.0, -3.0, 1.99);
    let decel = (before.vx - out.vx) / 0.01;
    let load = |axle: usize| out.wheels[2 * axle].load + out.wheels[2 * axle + 1].load;
    let wheels = 4.0 * 1.7 * decel / 0.344;
    let transfer = (p.vehicle.mass * decel * p.vehicle.cg_height + wheels) / p.wheelbase();
    near(load(0) - p.axle_loads().0, transfer, 5e-3, "front");
    near(p.axle_loads().1 - load(1), transfer, 5e-3, "rear");
    assert!(out.pitch > 0.0, "nose down");
}

#[test]
fn cornering_rolls_the_body_and_loads_the_outer_wheels() {
    let mut p = plain();
    p.axle.front.track = 1.4;
    p.axle.rear.track = 1.4;
    let out = circle(&p, 15.0, 0.03);
    let ay = out.vx * out.yaw_rate;
    let (radius, g) = (0.344, 9.81);
    let (unsprung, mass) = (p.axle.front.unsprung_mass + p.axle.rear.unsprung_mass, p.vehicle.mass);
    let sprung = mass - unsprung;
    let arm = (mass * p.vehicle.cg_height - unsprung * radius) / sprung;
    // Springs and tyres in series carry the body's moment; sum K (roll - axle roll) = ms h (ay + g roll).
    let tyre = 0.5 * 1.4 * 1.4 * p.tyre.front.vertical_stiffness;
    let (mut stiffness, mut moment) = (-sprung * g * arm, sprung * arm * ay);
    for axle in [&p.axle.front, &p.axle.rear] {
        let spring = 0.5 * 1.4 * 1.4 * axle.spring_rate + axle.anti_roll_bar;
        stiffness += spring * tyre / (spring + tyre);
        moment += spring / (spring + tyre) * axle.unsprung_mass * radius * ay;
    }
    near(out.roll, moment / stiffness, 0.01, "roll");
    let [fl, fr, rl, rr] = out.wheels.map(|wheel| wheel.load);
    let transfer = mass * ay * p.vehicle.cg_height + sprung * g * arm * out.roll;
    near((fr + rr - fl - rl) * 0.7, transfer, 0.01, "load transfer");
}

#[test]
fn roll_centres_take_their_share_directly() {
    // With both roll centres at the body's CG the springs carry nothing: all roll is that of the axles on their tyres.
    let mut p = plain();
    let height = 0.61373;
    p.axle.front.roll_centre_height = height;
    p.axle.rear.roll_centre_height = height;
    let out = circle(&p, 15.0, 0.02);
    let ay = out.vx * out.yaw_rate;
    let tyres = |axle: &Axle| 0.5 * axle.track * axle.track * p.tyre.front.vertical_stiffness;
    let stiffness = tyres(&p.axle.front) + tyres(&p.axle.rear);
    near(out.roll, p.vehicle.mass * ay * p.vehicle.cg_height / stiffness, 0.03, "roll");
    let [fl, fr, rl, rr] = out.wheels.map(|wheel| wheel.load);
    let moment = (fr - fl) * 0.5 * p.axle.front.track + (rr - rl) * 0.5 * p.axle.rear.track;
    near(moment, p.vehicle.mass * ay * p.vehicle.cg_height, 0.01, "load transfer");
}

#[test]
fn left_and_right_are_mirror_images_to_the_bit() {
    for name in BUILTIN {
        let p = builtin(name).unwrap();
        let (mut left, mut right) = (car(&p, 18.0), car(&p, 18.0));
        for k in 0..600 {
            let steer = 0.06 * (0.02 * f64::from(k)).sin();
            let accel = if k % 200 < 120 { 1.0 } else { -5.0 };
            left.step(&CarInput { steer_cmd: steer, accel_cmd: accel }, 0.01).unwrap();
            right.step(&CarInput { steer_cmd: -steer, accel_cmd: accel }, 0.01).unwrap();
            let (l, r) = (left.output(), right.output());
            assert_eq!((l.x, l.y, l.yaw, l.vx, l.vy), (r.x, -r.y, -r.yaw, r.vx, -r.vy), "{name} step {k}");
            assert_eq!((l.yaw_rate, l.roll, l.ay), (-r.yaw_rate, -r.roll, -r.ay), "{name} step {k}");
            assert_eq!(l.wheels[0].load, r.wheels[1].load);
        }
    }
}

#[test]
fn halving_the_step_shows_fourth_order() {
    // A step of the command through a lag is a smooth manoeuvre; all constants of the model are then smooth.
    let effects = Effects { steer_lag: 0.2, ..Effects::default() };
    let run = |step: f64| {
        let mut car = Car::new(&builtin("bmw_320i").unwrap(), &effects, None).unwrap();
        car.place(0.0, 0.0, 0.0, 20.0);
        for _ in 0..(0.8 / step).round() as usize {
            car.step(&CarInput { steer_cmd: 0.03, accel_cmd: 0.0 }, step).unwrap();
        }
        let o = car.output();
        [o.y, o.vy, o.yaw_rate, o.roll, o.wheels[0].slip_angle]
    };
    let (coarse, middle, fine) = (run(1e-3), run(5e-4), run(2.5e-4));
    for i in 0..coarse.len() {
        let (first, second) = ((coarse[i] - middle[i]).abs(), (middle[i] - fine[i]).abs());
        let order = (first / second).log2();
        eprintln!("signal {i}: differences {first:.3e}, {second:.3e}, order {order:.2}");
        // Above rounding the order is 4; differences below it say nothing.
        assert!(second < 1e-13 || (order > 3.7 && order < 4.5), "signal {i}: order {order}");
    }
    assert!((coarse[2] - middle[2]).abs() > 1e-13, "the test must see a difference");
}

#[test]
fn host_steps_do_not_matter() {
    let run = |step: f64| {
        let mut car = car(&builtin("c_class").unwrap(), 15.0);
        for _ in 0..(2.0 / step).round() as usize {
            car.step(&CarInput { steer_cmd: 0.02, accel_cmd: 0.5 }, step).unwrap();
        }
        *car.output()
    };
    let reference = run(0.001);
    for step in [0.002, 0.01, 0.05, 0.1] {
        let out = run(step);
        assert!(
            (out.y - reference.y).abs() < 1e-9 && (out.yaw_rate - reference.yaw_rate).abs() < 1e-9,
            "{step}"
        );
    }
}

#[test]
fn from_standstill_to_fifty_metres_a_second() {
    for name in BUILTIN {
        let mut p = builtin(name).unwrap();
        p.drive.max_power = 1e7;
        let mut car = car(&p, 0.0);
        let mut before = 0.0;
        for k in 0..2600 {
            car.step(&CarInput { steer_cmd: 0.0, accel_cmd: 2.6 }, 0.01).unwrap();
            let out = car.output();
            assert!(out.vx > before - 1e-9, "{name}: {} after {before} at step {k}", out.vx);
            assert!(out.vy == 0.0 && out.yaw == 0.0, "{name}");
            before = out.vx;
        }
        assert!(before > 50.0, "{name}: {before}");
        for k in 0..400 {
            let steer_cmd = 0.01 * (0.05 * f64::from(k)).sin();
            car.step(&CarInput { steer_cmd, accel_cmd: 0.0 }, 0.01).unwrap();
            assert!(car.output().vy.abs() < 5.0, "{name}");
        }
    }
}

#[test]
fn wheels_lock_and_spin_and_recover() {
    let p = builtin("c_class").unwrap();
    let mut slippery = Car::new(&p, &Effects { road_friction: 0.3, ..Effects::default() }, None).unwrap();
    slippery.place(0.0, 0.0, 0.0, 20.0);
    let locked = drive(&mut slippery, 0.0, -9.0, 1.0);
    for wheel in &locked.wheels {
        assert!(wheel.speed.abs() < 0.5 && (wheel.slip + 1.0).abs() < 0.02, "locked: {wheel:?}");
    }
    let free = drive(&mut slippery, 0.0, 0.0, 1.0);
    for wheel in &free.wheels {
        assert!(wheel.slip.abs() < 0.02, "rolling again: {wheel:?}");
    }
    let spinning = drive(&mut slippery, 0.0, 4.5, 1.0);
    assert!(spinning.wheels[0].slip > 0.3 && spinning.wheels[2].slip.abs() < 0.02, "{:?}", spinning.wheels);
    assert!(spinning.vx > free.vx);
}

#[test]
fn nothing_but_the_engine_adds_energy() {
    for name in BUILTIN {
        let p = builtin(name).unwrap();
        let mut car = car(&p, 25.0);
        let energy = |o: &CarOutput| {
            let spin: f64 = o.wheels.iter().map(|w| p.axle.front.wheel_inertia * w.speed * w.speed).sum();
            0.5 * (p.vehicle.mass * (o.vx * o.vx + o.vy * o.vy)
                + p.vehicle.yaw_inertia * o.yaw_rate.powi(2)
                + spin)
        };
        let mut before = energy(car.output());
        for k in 0..50 {
            let out = drive(&mut car, 0.05 * (0.7 * f64::from(k)).sin(), 0.0, 0.2);
            let now = energy(&out);
            // The body's roll stores and returns a little.
            assert!(now < before + 500.0, "{name}: {now} J after {before} J");
            before = now;
        }
        assert!(before < energy(&drive(&mut self::car(&p, 25.0), 0.0, 0.0, 0.01)));
    }
}

#[test]
fn a_lifted_wheel_is_ordinary_and_a_rolled_car_an_error() {
    let mut p = builtin("vw_vanagon").unwrap();
    p.vehicle.cg_height = 1.15;
    let mut tall = car(&p, 18.0);
    let mut lifted = false;
    let error = (0..800)
        .find_map(|_| {
            let result = tall.step(&CarInput { steer_cmd: 0.2, accel_cmd: 0.0 }, 0.01);
            lifted |= tall.output().wheels.iter().any(|wheel| wheel.load == 0.0);
            result.err()
        })
        .expect("so tall a car rolls over");
    assert!(lifted);
    assert!(matches!(error, PlantStepError::RolledOver { .. }), "{error}");
    assert!(error.to_string().contains("rolled over"));
}

#[test]
fn a_step_that_cannot_be_made_changes_nothing() {
    let mut car = car(&builtin("c_class").unwrap(), 10.0);
    drive(&mut car, 0.02, 0.3, 0.5);
    let (before, time) = (*car.output(), car.time());
    for (steer_cmd, accel_cmd, step, what) in [
        (f64::NAN, 0.0, 0.01, "steer_cmd"),
        (0.0, f64::INFINITY, 0.01, "accel_cmd"),
        (0.0, 0.0, 0.0, "step"),
        (0.0, 0.0, -0.01, "step"),
        (0.0, 0.0, f64::NAN, "step"),
        (0.0, 0.0, 1e9, "step"),
    ] {
        let error = car.step(&CarInput { steer_cmd, accel_cmd }, step).unwrap_err();
        assert!(error.to_string().contains(what), "{error}");
        assert_eq!((*car.output(), car.time()), (before, time));
    }
}
