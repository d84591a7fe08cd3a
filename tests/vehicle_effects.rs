//! Every effect does what its declaration says, and no more.

use rfl_mpc::vehicle::{Car, CarInput, CarOutput, CarParameters, Effects, builtin};

fn parameters() -> CarParameters {
    builtin("c_class").unwrap()
}

fn car(effects: Effects, speed: f64) -> Car {
    let mut car = Car::new(&parameters(), &effects, None).unwrap();
    car.place(0.0, 0.0, 0.0, speed);
    car
}

/// Outputs at each step of 10 ms with constant commands.
fn drive(car: &mut Car, steer_cmd: f64, accel_cmd: f64, seconds: f64) -> Vec<CarOutput> {
    let steps = (seconds / 0.01).round() as usize;
    (0..steps)
        .map(|_| {
            car.step(&CarInput { steer_cmd, accel_cmd }, 0.01).unwrap();
            *car.output()
        })
        .collect()
}

fn last(effects: Effects, speed: f64, steer: f64, seconds: f64) -> CarOutput {
    *drive(&mut car(effects, speed), steer, 0.0, seconds).last().unwrap()
}

fn near(value: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((value - expected).abs() <= tolerance, "{what}: {value}, expected {expected} within {tolerance}");
}

macro_rules! with {
    ($($id:ident: $value:expr),*) => { Effects { $($id: $value,)* ..Effects::default() } };
}

#[test]
fn neutral_is_absent_and_in_range() {
    let neutral = Effects::default();
    neutral.check().unwrap();
    for effect in Effects::ALL {
        assert_eq!(neutral.get(effect.id), Some(effect.neutral), "{}", effect.id);
        let mut changed = neutral;
        *changed.get_mut(effect.id).unwrap() = effect.range.1 + 1.0;
        let message = changed.check().unwrap_err().to_string();
        assert!(message.contains(effect.id) && message.contains("neutral"), "{message}");
        *changed.get_mut(effect.id).unwrap() = f64::NAN;
        assert!(changed.check().is_err());
    }
}

/// The actuator of the c_class has a lag of 50 ms; 0.03 rad stays under its rate limit.
fn lagged(time: f64, from: f64, lag: f64) -> f64 {
    if time <= from { 0.0 } else { 0.03 * (1.0 - (-(time - from) / lag).exp()) }
}

#[test]
fn steer_delay_and_lag_are_exact() {
    for (delay, lag) in [(0.0, 0.0), (0.06, 0.0), (0.0134, 0.0), (0.0, 0.1), (0.1234, 0.07)] {
        let mut car = car(with!(steer_delay: delay, steer_lag: lag), 15.0);
        for (k, out) in drive(&mut car, 0.03, 0.0, 1.0).iter().enumerate() {
            let expected = lagged(0.01 * (k + 1) as f64, delay, 0.05 + lag);
            near(out.steer, expected, 1e-12, "steer");
        }
    }
}

#[test]
fn steer_delay_is_exact_at_any_step_and_for_many_commands_under_way() {
    let command = |t: f64| 0.02 * (3.0 * t).sin();
    for step in [0.0007_f64, 0.003, 0.05] {
        let (mut late, mut prompt) = (car(with!(steer_delay: 0.21), 10.0), car(Effects::default(), 10.0));
        let shift = (0.21 / step).round() as usize;
        let mut history = Vec::new();
        for k in 0..(1.5 / step) as usize {
            let input = CarInput { steer_cmd: command(k as f64 * step), accel_cmd: 0.0 };
            late.step(&input, step).unwrap();
            prompt.step(&input, step).unwrap();
            history.push(prompt.output().steer);
            // Where the delay is a whole number of steps, the late car is the prompt one, later.
            if k >= shift && (shift as f64 * step - 0.21).abs() < 1e-9 {
                near(late.output().steer, history[k - shift], 1e-12, "late");
            }
        }
    }
}

#[test]
fn steer_rate_limit_holds_the_rate() {
    let outs = drive(&mut car(with!(steer_rate_limit: 0.1), 5.0), 0.2, 0.0, 1.0);
    for (k, out) in outs.iter().enumerate() {
        near(out.steer, 0.1 * 0.01 * (k + 1) as f64, 1e-12, "ramp");
    }
}

#[test]
fn steer_backlash_lags_by_half_the_gap_on_either_side() {
    let mut car = car(with!(steer_backlash: 0.02), 5.0);
    near(drive(&mut car, 0.1, 0.0, 2.0).last().unwrap().steer, 0.09, 1e-9, "to the left");
    near(drive(&mut car, 0.085, 0.0, 2.0).last().unwrap().steer, 0.09, 1e-9, "within the gap");
    near(drive(&mut car, -0.1, 0.0, 2.0).last().unwrap().steer, -0.09, 1e-9, "to the right");
}

#[test]
fn steer_offset_and_gain_act_behind_the_sensor() {
    let out = last(with!(steer_offset: 0.02), 10.0, 0.0, 1.0);
    near(out.steer, 0.0, 1e-9, "the sensor does not see the offset");
    near(out.road_wheel_angle, 0.02, 1e-9, "real angle");
    assert!(out.yaw_rate > 0.03, "it turns left: {}", out.yaw_rate);
    let out = last(with!(steer_gain: 1.2, steer_offset: -0.01), 10.0, 0.03, 2.0);
    near(out.steer, 0.03, 1e-9, "sensor");
    near(out.road_wheel_angle, 1.2 * 0.03 - 0.01, 1e-9, "real = gain * commanded + offset");
}

#[test]
fn tyre_stiffness_scales_the_axles() {
    // Linear single track: yaw gain v / (L + K v2), K = m (lr/Cf - lf/Cr) / L.
    let gain = |front: f64, rear: f64| {
        let s = parameters().single_track();
        let length = s.lf + s.lr;
        let gradient = s.mass / length * (s.lr / (front * s.cf) - s.lf / (rear * s.cr));
        20.0 / (length + gradient * 400.0)
    };
    let yaw_rate = |effects| last(effects, 20.0, 0.004, 3.0).yaw_rate;
    let neutral = yaw_rate(Effects::default());
    for (front, rear) in [(0.8, 1.0), (1.0, 0.8), (1.2, 1.2)] {
        let ratio = yaw_rate(with!(tyre_stiffness_front: front, tyre_stiffness_rear: rear)) / neutral;
        let expected = gain(front, rear) / gain(1.0, 1.0);
        near(ratio / expected, 1.0, 0.05, "yaw gain");
        assert!((ratio - 1.0) * (expected - 1.0) > 0.0, "direction: {ratio}, {expected}");
    }
}

#[test]
fn road_friction_limits_all_forces() {
    let brake = |friction: f64| {
        let outs = drive(&mut car(with!(road_friction: friction), 25.0), 0.0, -12.0, 1.0);
        (25.0 - outs.last().unwrap().vx) / 1.0
    };
    assert!(brake(1.0) > 8.0 && brake(0.4) < 0.4 * 1.2 * 9.81 && brake(0.4) > 2.0);
    let most = |friction: f64| {
        let outs = drive(&mut car(with!(road_friction: friction), 20.0), 0.15, 0.0, 2.0);
        // The accelerometer leans with the body.
        let level = |out: &CarOutput| (out.ay - 9.81 * out.roll.sin()) / out.roll.cos();
        outs.iter().map(level).fold(0.0, f64::max)
    };
    assert!(most(0.4) < 0.4 * 1.15 * 9.81, "{}", most(0.4));
    assert!(most(1.0) > 0.75 * 9.81, "{}", most(1.0));
}

#[test]
fn tyre_relaxation_delays_the_slip() {
    let mut p = parameters();
    p.steering.lag = 0.0;
    p.steering.rate_limit = 1e6;
    let mut car = Car::new(&p, &with!(tyre_relaxation: 2.0), None).unwrap();
    car.place(0.0, 0.0, 0.0, 10.0);
    car.step(&CarInput { steer_cmd: 0.01, accel_cmd: 0.0 }, 0.04).unwrap();
    // The car has hardly turned: slip angle -delta (1 - exp(-v t / sigma)).
    let expected = -0.01 * (1.0 - (-10.0_f64 * 0.04 / 2.0).exp());
    near(car.output().wheels[0].slip_angle, expected, 0.05 * expected.abs(), "slip angle");
}

#[test]
fn tyre_relaxation_is_the_front_tyres_at_rest_and_others_follow_their_files() {
    let p = parameters();
    let own = p.relaxation().unwrap();
    let path = |effects: Effects, p: &CarParameters| {
        let mut car = Car::new(p, &effects, None).unwrap();
        car.place(0.0, 0.0, 0.0, 12.0);
        let input = |k: i32| CarInput { steer_cmd: 0.05 * (0.05 * f64::from(k)).sin(), accel_cmd: 0.0 };
        (0..300).for_each(|k| car.step(&input(k), 0.01).unwrap());
        *car.output()
    };
    let bits = |out: &CarOutput| [out.x, out.y, out.yaw_rate].map(f64::to_bits);
    // The file's own length changes nothing; twice that is what a file of twice the length does.
    let same = path(with!(tyre_relaxation: own), &p);
    assert_eq!(bits(&same), bits(&path(Effects::default(), &p)));
    let mut longer = p.clone();
    for tyre in [&mut longer.tyre.front, &mut longer.tyre.rear] {
        tyre.coefficients.as_mut().unwrap().pty1 *= 2.0;
    }
    let (effect, file) = (path(with!(tyre_relaxation: 2.0 * own), &p), path(Effects::default(), &longer));
    near(effect.yaw_rate, file.yaw_rate, 1e-12, "twice the length");
    assert!((effect.yaw_rate - same.yaw_rate).abs() > 1e-3, "{} {}", effect.yaw_rate, same.yaw_rate);
}

#[test]
fn payload_and_cg_shift_load_the_axles() {
    let rest = |effects| {
        let out = last(effects, 0.0, 0.0, 3.0);
        let [fl, fr, rl, rr] = out.wheels.map(|wheel| wheel.load);
        (fl + fr, rl + rr)
    };
    let (m, lf, lr) = (1400.0, 1.11, 1.53);
    let length = lf + lr;
    let (front, rear) = rest(with!(payload: 300.0, payload_x: -1.0));
    near(front, 9.81 * (m * lr + 300.0 * (lr - 1.0)) / length, 1e-3, "front");
    near(rear, 9.81 * (m * lf + 300.0 * (lf + 1.0)) / length, 1e-3, "rear");
    let (front, rear) = rest(with!(cg_shift: 0.2));
    near(front, 9.81 * m * (lr + 0.2) / length, 1e-3, "front");
    near(rear, 9.81 * m * (lf - 0.2) / length, 1e-3, "rear");
    // Outputs stay those of the reference point.
    let placed = car(with!(cg_shift: 0.2, payload: 200.0, payload_x: -0.7), 0.0);
    near(placed.output().x, 0.0, 1e-15, "x");
    assert!(Car::new(&parameters(), &with!(payload: 9000.0, payload_x: -5.0), None).is_err());
}

#[test]
fn yaw_inertia_slows_the_yaw() {
    let early = |factor| last(with!(yaw_inertia: factor), 20.0, 0.01, 0.06).yaw_rate;
    near(early(2.0) / early(1.0), 0.5, 0.04, "yaw rate shortly after a step");
}

#[test]
fn roll_stiffness_reduces_roll() {
    let roll = |factor| last(with!(roll_stiffness: factor), 15.0, 0.03, 4.0).roll;
    // Springs and tyres are in series, so that doubling the springs does not halve the roll.
    let ratio = roll(2.0) / roll(1.0);
    assert!(ratio > 0.48 && ratio < 0.62, "{ratio}");
    let heave = |factor| last(with!(roll_stiffness: factor), 0.0, 0.0, 1.0).wheels[0].load;
    assert_eq!(heave(2.0), heave(1.0));
}

#[test]
fn bank_and_grade_are_felt_and_pull() {
    let hold = |effects| *drive(&mut car(effects, 0.0), 0.0, -5.0, 5.0).last().unwrap();
    let out = hold(with!(road_bank: 0.05));
    // An accelerometer at rest reads the reaction to gravity, and leans with the body.
    near(out.ay, 9.81 * (0.05 + out.roll).sin(), 1e-3, "ay");
    assert!(out.roll > 0.0, "it leans to the low side");
    near(
        hold(with!(road_grade: 0.05)).ax,
        9.81 * (0.05 - hold(with!(road_grade: 0.05)).pitch).sin(),
        1e-3,
        "ax",
    );
    assert!(last(with!(road_bank: 0.05), 15.0, 0.0, 2.0).y < -0.05, "drifts to the low side");
    let slower =
        last(Effects::default(), 15.0, 0.0, 2.0).vx - last(with!(road_grade: 0.05), 15.0, 0.0, 2.0).vx;
    near(slower, 9.81 * 0.05_f64.sin() * 2.0, 0.06, "uphill slows down");
}

#[test]
fn wind_is_fixed_in_the_world() {
    let at_start = |effects, yaw: f64| {
        let mut car = Car::new(&parameters(), &effects, None).unwrap();
        car.place(0.0, 0.0, yaw, 20.0);
        *car.output()
    };
    let (rho, m) = (1.2, 1400.0);
    // To the north on an eastbound car: side force to the left.
    let out = at_start(with!(wind_y: 10.0), 0.0);
    near(out.ay, 0.5 * rho * 5.0 * 20.0_f64.hypot(10.0) * 10.0 / m, 1e-9, "side force");
    // The same wind on a northbound car: from behind.
    let out = at_start(with!(wind_y: 10.0), std::f64::consts::FRAC_PI_2);
    near(out.ax, -0.5 * rho * 0.66 * 100.0 / m, 1e-9, "drag");
    near(out.ay, 0.0, 1e-9, "no side force");
    let out = at_start(with!(wind_x: -10.0), 0.0);
    near(out.ax, -0.5 * rho * 0.66 * 900.0 / m, 1e-9, "headwind");
    assert!(last(with!(wind_y: 10.0), 20.0, 0.0, 2.0).y > 0.02);
}

#[test]
fn drag_scales() {
    let ax = |factor| car(with!(drag: factor), 30.0).output().ax;
    near(ax(3.0), 3.0 * ax(1.0), 1e-12, "drag");
    near(ax(1.0), -0.5 * 1.2 * 0.66 * 900.0 / 1400.0, 1e-9, "drag");
}

#[test]
fn drive_lag_and_gain_shape_the_force() {
    let mut car = car(with!(drive_lag: 0.25, drive_gain: 0.8), 10.0);
    for (k, out) in drive(&mut car, 0.0, 1.0, 1.0).iter().enumerate() {
        let time = 0.01 * (k + 1) as f64;
        let expected = 1400.0 * 0.8 * (1.0 - (-time / (0.15 + 0.25)).exp());
        near(out.drive_force, expected, 1e-6, "drive force");
    }
}

#[test]
fn brake_pull_turns_the_moving_car_only() {
    let out = last(with!(brake_pull: 500.0), 20.0, 0.0, 0.02);
    near(out.yaw_rate, 500.0 * 0.02 / 2150.0, 0.05 * out.yaw_rate, "yaw rate");
    assert!(last(with!(brake_pull: -500.0), 20.0, 0.0, 2.0).yaw < -0.01);
    assert_eq!(last(with!(brake_pull: 500.0), 0.0, 0.0, 1.0).yaw, 0.0);
}

/// A lively drive, with and without a sensor effect.
fn lively(effects: Effects) -> Vec<CarOutput> {
    let mut car = car(effects, 15.0);
    let command =
        |k: usize| CarInput { steer_cmd: 0.03 * (0.05 * k as f64).sin(), accel_cmd: (0.03 * k as f64).cos() };
    (0..400)
        .map(|k| {
            car.step(&command(k), 0.01).unwrap();
            *car.output()
        })
        .collect()
}

#[test]
fn sensor_biases_and_scale_act_on_their_signal_only() {
    let truth = lively(Effects::default());
    let biased = lively(with!(yaw_rate_bias: 0.02, lateral_accel_bias: -0.3, speed_scale: 1.03));
    for (t, b) in truth.iter().zip(&biased) {
        near(b.yaw_rate, t.yaw_rate + 0.02, 1e-15, "yaw rate");
        near(b.ay, t.ay - 0.3, 1e-14, "ay");
        near(b.vx, 1.03 * t.vx, 1e-13, "vx");
        near(b.vy, 1.03 * t.vy, 1e-13, "vy");
        assert_eq!((b.x, b.y, b.yaw, b.ax, b.steer, b.roll), (t.x, t.y, t.yaw, t.ax, t.steer, t.roll));
        assert_eq!(b.wheels, t.wheels);
    }
}

#[test]
fn sensor_delay_is_a_pure_latency_of_motion_signals() {
    let truth = lively(Effects::default());
    for (delay, shift) in [(0.05, 5), (0.3, 30)] {
        let late = lively(with!(sensor_delay: delay));
        for k in shift..late.len() {
            let (l, t) = (&late[k], &truth[k - shift]);
            for (late, truth) in
                [(l.x, t.x), (l.yaw_rate, t.yaw_rate), (l.ay, t.ay), (l.roll, t.roll), (l.vx, t.vx)]
            {
                near(late, truth, 1e-9, "late signal");
            }
            assert_eq!(l.steer, truth[k].steer, "the steering sensor is prompt");
        }
        assert_eq!(late[0].x, 0.0, "before the first signal arrives, the start stands");
    }
    // Between samples the signal is interpolated.
    let late = lively(with!(sensor_delay: 0.0055));
    for k in 1..late.len() {
        let expected = truth[k].x - 0.0055 * truth[k].vx;
        near(late[k].x, expected, 2e-3, "x");
    }
}

#[test]
fn imu_lever_arm_adds_yaw_acceleration() {
    let (truth, shifted) = (lively(Effects::default()), lively(with!(imu_lever_arm: 0.5)));
    for k in 1..truth.len() - 1 {
        let yaw_accel = (truth[k + 1].yaw_rate - truth[k - 1].yaw_rate) / 0.02;
        near(shifted[k].ay - truth[k].ay, 0.5 * yaw_accel * truth[k].roll.cos(), 0.01, "ay");
        let expected = -0.5 * truth[k].yaw_rate.powi(2) * truth[k].pitch.cos();
        near(shifted[k].ax - truth[k].ax, expected, 1e-9, "ax");
        assert_eq!(shifted[k].vy, truth[k].vy);
    }
}

#[test]
fn heading_misalignment_turns_the_measured_axes() {
    let (truth, turned) = (lively(Effects::default()), lively(with!(heading_misalignment: 0.02)));
    for (t, m) in truth.iter().zip(&turned) {
        near(m.yaw, t.yaw + 0.02, 1e-15, "yaw");
        near(m.vx, t.vx * 0.02_f64.cos() + t.vy * 0.02_f64.sin(), 1e-13, "vx");
        near(m.vy, t.vy * 0.02_f64.cos() - t.vx * 0.02_f64.sin(), 1e-13, "vy");
        near(m.ay, t.ay * 0.02_f64.cos() - t.ax * 0.02_f64.sin(), 1e-13, "ay");
        assert_eq!((m.x, m.y, m.yaw_rate), (t.x, t.y, t.yaw_rate));
    }
}
