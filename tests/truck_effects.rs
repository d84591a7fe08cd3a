//! Every effect does to the truck what its declaration says, and no more.

use rfl_mpc::vehicle::{
    GRAVITY, Stage, Truck, TruckEffects, TruckError, TruckInput, TruckOutput, TruckParameters, builtin_truck,
};

fn parameters() -> TruckParameters {
    builtin_truck("truck_simulation").unwrap()
}

/// Effects by their ids.
fn with(values: &[(&str, f64)]) -> TruckEffects {
    let mut effects = TruckEffects::default();
    for (id, value) in values {
        *effects.get_mut(id).unwrap_or_else(|| panic!("no effect {id}")) = *value;
    }
    effects
}

fn truck(effects: &[(&str, f64)], speed: f64) -> Truck {
    let mut truck = Truck::new(&parameters(), &with(effects), None).unwrap();
    truck.place(0.0, 0.0, 0.0, speed);
    truck
}

/// Outputs at each step of 10 ms with constant commands.
fn drive(truck: &mut Truck, steer_cmd: f64, accel_cmd: f64, seconds: f64) -> Vec<TruckOutput> {
    (0..(seconds / 0.01).round() as usize)
        .map(|_| {
            truck.step(&TruckInput { steer_cmd, accel_cmd }, 0.01).unwrap();
            *truck.output()
        })
        .collect()
}

fn last(effects: &[(&str, f64)], speed: f64, steer: f64, seconds: f64) -> TruckOutput {
    *drive(&mut truck(effects, speed), steer, 0.0, seconds).last().unwrap()
}

fn near(value: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((value - expected).abs() <= tolerance, "{what}: {value}, expected {expected} within {tolerance}");
}

fn load(out: &TruckOutput, axle: usize) -> f64 {
    out.wheels[2 * axle].load + out.wheels[2 * axle + 1].load
}

#[test]
fn neutral_is_absent_and_in_range() {
    let neutral = TruckEffects::default();
    neutral.check().unwrap();
    for effect in TruckEffects::all() {
        assert_eq!(neutral.get(effect.id), Some(effect.neutral), "{}", effect.id);
        for wrong in [effect.range.1 + 1.0, f64::NAN] {
            let mut changed = neutral;
            *changed.get_mut(effect.id).unwrap() = wrong;
            let error = Truck::new(&parameters(), &changed, None).err().expect("out of range").to_string();
            assert!(error.contains(effect.id) && error.contains("neutral"), "{error}");
        }
    }
    for id in
        ["trailer_payload", "trailer_stiffness", "hitch_offset", "articulation_friction", "articulation_bias"]
    {
        assert!(TruckEffects::all().any(|effect| effect.id == id), "{id}");
    }
}

#[test]
fn every_effect_acts_at_its_stage_and_on_nothing_before() {
    // One lively drive: whatever is not at its neutral value shows somewhere.
    let lively = |effects: &TruckEffects| {
        let mut truck = Truck::new(&parameters(), effects, None).unwrap();
        truck.place(0.0, 0.0, 0.2, 12.0);
        let mut all = Vec::new();
        for k in 0..300 {
            let t = 0.01 * f64::from(k);
            let input = TruckInput { steer_cmd: 0.06 * (2.0 * t).sin(), accel_cmd: 0.8 * (1.3 * t).cos() };
            truck.step(&input, 0.01).unwrap();
            all.push(*truck.output());
        }
        all
    };
    let neutral = lively(&TruckEffects::default());
    for effect in TruckEffects::all() {
        let mut changed = TruckEffects::default();
        let value = match effect.id {
            "payload_x" => 1.0,
            "steer_rate_limit" => 0.02,
            _ if effect.neutral == 0.0 => 0.05 * effect.range.1,
            _ => 1.1 * effect.neutral,
        };
        *changed.get_mut(effect.id).unwrap() = value;
        if effect.id == "payload_x" {
            changed.vehicle.payload = 500.0;
        }
        let changed = lively(&changed);
        let differ = |of: fn(&TruckOutput) -> f64| {
            changed.iter().zip(&neutral).map(|(a, b)| (of(a) - of(b)).abs()).fold(0.0, f64::max)
        };
        let (sensor, wheels) = (differ(|out| out.steer), differ(|out| out.road_wheel_angle));
        let load = differ(|out| out.wheels[0].load).max(differ(|out| out.wheels[4].load));
        let what = format!("{} = {value}: {sensor} {wheels} rad, {load} N", effect.id);
        match effect.stage {
            Stage::Command | Stage::Actuator => {
                assert!(sensor > 1e-3 && wheels > 1e-3 && load > 1.0, "{what}")
            }
            // With an offset the vehicle starts with its wheels straight.
            Stage::Linkage => {
                let late = |out: &[TruckOutput]| out[200..].iter().map(|out| out.steer).collect::<Vec<_>>();
                let seen = late(&changed).iter().zip(late(&neutral)).any(|(a, b)| (a - b).abs() > 1e-6);
                assert!(!seen && wheels > 1e-3 && load > 1.0, "{what}");
            }
            Stage::Tyre | Stage::Body | Stage::Road | Stage::Drive => {
                assert!(sensor == 0.0 && wheels == 0.0 && load > 1.0, "{what}");
            }
            Stage::Sensor => {
                let measured = [
                    differ(|out| out.vx),
                    differ(|out| out.yaw_rate),
                    differ(|out| out.ay),
                    differ(|out| out.yaw),
                    differ(|out| out.articulation),
                ];
                let most = measured.into_iter().fold(0.0, f64::max);
                assert!(sensor == 0.0 && wheels == 0.0 && load == 0.0 && most > 1e-3, "{what}, {most}");
            }
        }
    }
}

#[test]
fn steer_delay_and_lag_are_exact() {
    for (delay, lag) in [(0.04, 0.05), (0.3, 0.2), (0.0134, 0.0)] {
        let mut truck = truck(&[("steer_delay", delay), ("steer_lag", lag)], 12.0);
        for (k, out) in drive(&mut truck, 0.03, 0.0, 1.5).iter().enumerate() {
            let time = 0.01 * (k + 1) as f64;
            // Without a lag the rate limit holds: 0.6 rad/s.
            let expected = if time <= delay {
                0.0
            } else if lag > 0.0 {
                0.03 * (1.0 - (-(time - delay) / lag).exp())
            } else {
                (0.6 * (time - delay)).min(0.03)
            };
            near(out.steer, expected, 1e-12, "steer");
        }
    }
}

#[test]
fn trailer_payload_loads_hitch_and_axles() {
    let out = last(&[("trailer_payload", 8000.0)], 0.0, 0.0, 4.0);
    let weight = 18000.0 * GRAVITY;
    near(out.hitch[2], weight * 3.102 / 7.528, 1.0, "hitch");
    near(load(&out, 2), weight * 4.426 / 7.528, 1.0, "trailer's axles");
    let total: f64 = (0..3).map(|axle| load(&out, axle)).sum();
    near(total, 25180.0 * GRAVITY, 1.0, "all");
    // The drive is laid out for the empty truck: it accelerates less.
    let speed =
        |effects: &[(&str, f64)]| drive(&mut truck(effects, 10.0), 0.0, 0.6, 3.0).last().unwrap().vx - 10.0;
    let ratio = speed(&[("trailer_payload", 8000.0), ("drag", 0.0)]) / speed(&[("drag", 0.0)]);
    near(ratio, 17180.0 / 25180.0, 0.04, "acceleration");
}

#[test]
fn hitch_offset_moves_load_between_the_tractors_axles() {
    let rest = |offset: f64| last(&[("hitch_offset", offset)], 0.0, 0.0, 4.0);
    let (plain, moved) = (rest(0.0), rest(0.3));
    let shift = moved.hitch[2] * 0.3 / 3.49;
    near(load(&moved, 0) - load(&plain, 0), shift, 1.0, "front");
    near(load(&plain, 1) - load(&moved, 1), shift, 1.0, "rear");
    near(moved.trailer.x - plain.trailer.x, 0.3, 1e-5, "the trailer stands further ahead");
}

#[test]
fn trailer_stiffness_changes_the_articulation_in_a_fast_turn() {
    // On a circle the trailer's axles run wide by their slip angle, m2 ay a2 / l2 / C3.
    let articulation = |factor: f64| {
        let mut truck = truck(&[("trailer_stiffness", factor), ("drag", 0.0)], 18.0);
        for _ in 0..3000 {
            let accel_cmd = 2.0 * (18.0 - truck.output().vx);
            truck.step(&TruckInput { steer_cmd: 0.01, accel_cmd }, 0.01).unwrap();
        }
        let out = *truck.output();
        (out.articulation, 10000.0 * out.vx * out.yaw_rate * 4.426 / 7.528 / 329e3)
    };
    let ((stiff, _), (soft, slip)) = (articulation(1.0), articulation(0.5));
    near(soft - stiff, -slip * 2.0 / 2.0, 0.15 * slip, "difference of the articulation");
}

#[test]
fn articulation_friction_holds_and_opposes() {
    // Dry friction: a small moment does not turn the hitch, a large one turns it against the friction.
    let held = |friction: f64| {
        let mut truck = truck(&[("articulation_friction", friction)], 8.0);
        let mut most = 0.0_f64;
        for k in 0..400 {
            let steer_cmd = 0.1 * (0.02 * f64::from(k)).sin();
            truck.step(&TruckInput { steer_cmd, accel_cmd: 0.0 }, 0.01).unwrap();
            most = most.max(truck.output().articulation.abs());
        }
        most
    };
    let (free, tight) = (held(0.0), held(40000.0));
    assert!(tight < 0.97 * free, "{tight} and {free}");
    // Turning on the spot is not possible: no chatter where friction holds.
    let mut standing = truck(&[("articulation_friction", 5000.0)], 0.0);
    let out = drive(&mut standing, 0.2, -1.0, 3.0);
    assert!(out.iter().skip(100).all(|out| out.articulation_rate.abs() < 1e-6));
}

#[test]
fn sensor_effects_act_on_outputs_only() {
    let lively = |effects: &[(&str, f64)]| {
        let mut truck = truck(effects, 14.0);
        (0..300)
            .map(|k| {
                let steer_cmd = 0.03 * (0.05 * f64::from(k)).sin();
                truck.step(&TruckInput { steer_cmd, accel_cmd: 0.3 }, 0.01).unwrap();
                *truck.output()
            })
            .collect::<Vec<_>>()
    };
    let truth = lively(&[]);
    let biased = lively(&[("articulation_bias", 0.02), ("yaw_rate_bias", 0.01), ("speed_scale", 1.03)]);
    let late = lively(&[("sensor_delay", 0.05)]);
    for (k, (t, b)) in truth.iter().zip(&biased).enumerate() {
        near(b.articulation, t.articulation + 0.02, 1e-15, "articulation");
        near(b.yaw_rate, t.yaw_rate + 0.01, 1e-15, "yaw rate");
        near(b.vx, 1.03 * t.vx, 1e-13, "vx");
        assert_eq!((b.x, b.y, b.articulation_rate, b.trailer), (t.x, t.y, t.articulation_rate, t.trailer));
        assert_eq!(b.wheels, t.wheels);
        if k >= 5 {
            let (l, t) = (&late[k], &truth[k - 5]);
            near(l.articulation, t.articulation, 1e-9, "late articulation");
            near(l.trailer.yaw, t.trailer.yaw, 1e-9, "late trailer");
            assert_eq!(l.steer, truth[k].steer, "the steering sensor is prompt");
        }
    }
}

#[test]
fn wind_from_the_side_pushes_both_units() {
    let out = last(&[("wind_y", 15.0)], 22.0, 0.0, 3.0);
    assert!(out.y > 0.02 && out.trailer.y > 0.02, "{} {}", out.y, out.trailer.y);
    // Before the tyres resist, all side forces are the rate of the momentum across. A part of it is in the bodies, which lean
    // with the wind over the place that is measured: less than a third.
    let (rho, speed, time) = (1.2, 22.0_f64, 0.01);
    let force = 0.5 * rho * speed.hypot(15.0) * 15.0 * (8.0 + 28.0);
    let first = last(&[("wind_y", 15.0)], speed, 0.0, time);
    let momentum = 7180.0 * first.vy + 10000.0 * first.trailer.vy;
    near(momentum / (force * time), 0.84, 0.16, "momentum across over the impulse of the wind");
}

#[test]
fn loads_that_lift_an_axle_are_refused() {
    let error = Truck::new(&parameters(), &with(&[("payload", 15000.0), ("payload_x", -6.0)]), None).err();
    assert!(matches!(error, Some(TruckError::AxleLifted { axle: "front", .. })), "{error:?}");
    assert!(error.unwrap().to_string().contains("effect.payload_x"));
}
