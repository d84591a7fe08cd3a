//! On ice and beyond: wheels spin within the engine's power and stop spinning, brakes lock them and they hold still,
//! and no drive gives a number that is none.

use proptest::prelude::*;
use rfl_mpc::fmu::PlantUnit;
use rfl_mpc::vehicle::tyre::{Coefficients, Contact, TyreModel as _};
use rfl_mpc::vehicle::{
    BUILTIN, BUILTIN_TRUCKS, Car, CarOutput, Effects, PlantStepError, Truck, TruckEffects, Tyre,
    VehicleInput, VehicleParameters, WheelOutput, builtin, builtin_truck,
};

/// What the drive of a vehicle file may do at most: power in W; share of each wheel in the force.
struct Limits {
    power: f64,
    share: Vec<f64>,
}

/// What turns on one side of an axle: its tyre, how many of them, and their spin inertia, kg m2.
struct Side {
    tyre: Coefficients,
    tyres: f64,
    inertia: f64,
}

impl Side {
    /// Rolling resistance moment, N m.
    fn resistance(&self, wheel: &WheelOutput, vx: f64) -> f64 {
        self.tyres * self.tyre.rolling_resistance(wheel.load / self.tyres, wheel.fx / self.tyres, vx)
    }

    /// Force at the wheel's own load and slip on a road, N.
    fn force(&self, wheel: &WheelOutput, friction: f64) -> f64 {
        let (kappa, load) = (wheel.slip, wheel.load / self.tyres);
        self.tyres * self.tyre.forces(&Contact { kappa, load, friction, ..Contact::default() }).fx
    }
}

/// A vehicle whose drive is known.
trait Case: PlantUnit {
    fn limits(parameters: &Self::Parameters) -> Limits;
    /// Of each wheel.
    fn sides(parameters: &Self::Parameters) -> Vec<Side>;
    /// Half the density times the drag area, kg/m.
    fn drag(parameters: &Self::Parameters) -> f64;
    fn drive_force(output: &Self::Output) -> f64;
    fn motion(output: &Self::Output) -> [f64; 3];
}

impl Case for Car {
    fn limits(parameters: &Self::Parameters) -> Limits {
        let front = parameters.drive.front_share;
        let share = [front, front, 1.0 - front, 1.0 - front].map(|share| 0.5 * share).to_vec();
        Limits { power: parameters.drive.max_power, share }
    }

    fn sides(p: &Self::Parameters) -> Vec<Side> {
        let axles = [(&p.tyre.front, p.axle.front.wheel_inertia), (&p.tyre.rear, p.axle.rear.wheel_inertia)];
        let side = |(tyre, inertia): (&Tyre, f64)| Side { tyre: tyre.scaled(), tyres: 1.0, inertia };
        axles.into_iter().flat_map(|axle| [side(axle), side(axle)]).collect()
    }

    fn drag(p: &Self::Parameters) -> f64 {
        0.5 * p.air.density * p.air.drag_area
    }

    fn drive_force(output: &CarOutput) -> f64 {
        output.drive_force
    }

    fn motion(output: &CarOutput) -> [f64; 3] {
        [output.vx, output.vy, output.yaw_rate]
    }
}

impl Case for Truck {
    fn limits(parameters: &Self::Parameters) -> Limits {
        Limits { power: parameters.drive.max_power, share: vec![0.0, 0.0, 0.5, 0.5, 0.0, 0.0] }
    }

    fn sides(p: &Self::Parameters) -> Vec<Side> {
        let (tyre, tyres, axle) = (&p.tyre, &p.tyres_per_side, &p.axle);
        let axles = [
            (&tyre.front, tyres.front, axle.front.wheel_inertia),
            (&tyre.rear, tyres.rear, axle.rear.wheel_inertia),
            (&tyre.trailer, tyres.trailer, axle.trailer.wheel_inertia),
        ];
        let side = |(tyre, tyres, inertia): (&Tyre, f64, f64)| Side { tyre: tyre.scaled(), tyres, inertia };
        axles.into_iter().flat_map(|axle| [side(axle), side(axle)]).collect()
    }

    fn drag(p: &Self::Parameters) -> f64 {
        0.5 * p.air.density * p.air.drag_area
    }

    fn drive_force(output: &Self::Output) -> f64 {
        output.drive_force
    }

    fn motion(output: &Self::Output) -> [f64; 3] {
        [output.vx, output.vy, output.yaw_rate]
    }
}

fn make<P: Case>(parameters: &P::Parameters, effects: &[(&str, f64)], speed: f64) -> Option<P> {
    let mut chosen = P::Effects::default();
    for &(id, value) in effects {
        if let Some(place) = P::effect(&mut chosen, id) {
            *place = value;
        }
    }
    let mut vehicle = P::make(parameters, &chosen, None).ok()?;
    vehicle.place(0.0, 0.0, 0.0, speed);
    Some(vehicle)
}

fn drive<P: Case>(vehicle: &mut P, accel_cmd: f64, seconds: f64) {
    for _ in 0..(seconds / 0.01).round() as usize {
        vehicle.step(&VehicleInput { steer_cmd: 0.0, accel_cmd }, 0.01).unwrap();
    }
}

/// Power of the drive at the wheels, W; radii are those of wheels that roll at 1 m/s.
fn power<P: Case>(limits: &Limits, radii: &[f64], output: &P::Output) -> f64 {
    let force = P::drive_force(output).max(0.0);
    let wheels = P::wheels(output).iter().zip(radii).zip(&limits.share);
    wheels.map(|((wheel, radius), share)| force * share * radius * wheel.speed).sum()
}

fn radii<P: Case>(parameters: &P::Parameters) -> Vec<f64> {
    let rolling: P = make(parameters, &[], 1.0).unwrap();
    P::wheels(rolling.output()).iter().map(|wheel| 1.0 / wheel.speed).collect()
}

fn near(value: f64, expected: f64, relative: f64, what: &str) {
    assert!((value - expected).abs() <= relative * expected.abs(), "{what}: {value}, expected {expected}");
}

/// With all driven wheels spinning their tyres' sliding friction alone pushes the vehicle. The others roll, and take it for
/// their spin and their rolling resistance `My`. The rims' speed `v` ends where the power meets friction and `My`:
///
/// ```text
///     Fx = Fx(kappa, Fz) of the Magic Formula beyond its peak,
///     (m + sum I/R2) a = sum Fx driven - sum My/R rolling - drag,     P = sum (Fx + My/R) driven v
/// ```
fn creeps_off_with_spinning_wheels<P: Case>(
    name: &str,
    friction: f64,
    seconds: f64,
    (mass, driven): (f64, &[usize]),
) {
    let p = P::Parameters::builtin(name).unwrap();
    let (limits, radii, sides) = (P::limits(&p), radii::<P>(&p), P::sides(&p));
    let what = format!("{name} on {friction}");
    let mut vehicle: P = make(&p, &[("road_friction", friction)], 0.0).unwrap();
    drive(&mut vehicle, 3.0, 2.0);
    let early = P::motion(vehicle.output())[0];
    drive(&mut vehicle, 3.0, 1.0);
    let output = vehicle.output();
    let (wheels, vx) = (P::wheels(output), P::motion(output)[0]);
    let (mut pushed, mut inertia) = (-P::drag(&p) * vx * vx, mass);
    for (i, wheel) in wheels.iter().enumerate() {
        if driven.contains(&i) {
            assert!(wheel.slip > 1.0, "{name}: {wheels:?}");
            near(wheel.fx, sides[i].force(wheel, friction), 0.01, &format!("{what}: sliding friction"));
            pushed += wheel.fx;
        } else {
            pushed -= sides[i].resistance(wheel, vx) / radii[i];
            inertia += sides[i].inertia / (radii[i] * radii[i]);
        }
    }
    near(vx - early, pushed / inertia, 0.02, &format!("{what}: acceleration"));

    // Power and friction balance in the end.
    drive(&mut vehicle, 3.0, seconds);
    let output = vehicle.output();
    let (wheels, vx) = (P::wheels(output), P::motion(output)[0]);
    let rim: f64 = driven.iter().map(|&i| limits.share[i] * radii[i] * wheels[i].speed).sum();
    let taken = |i: &usize| wheels[*i].fx + sides[*i].resistance(&wheels[*i], vx) / radii[*i];
    let taken: f64 = driven.iter().map(taken).sum();
    near(rim, limits.power / taken, 0.02, &format!("{what}: speed of the rims"));
    near(power::<P>(&limits, &radii, output), limits.power, 1e-6, &format!("{name}: power"));
}

#[test]
fn a_car_creeps_off_on_ice_with_spinning_wheels() {
    let p = builtin("c_class").unwrap();
    creeps_off_with_spinning_wheels::<Car>("c_class", 0.2, 17.0, (p.vehicle.mass, &[0, 1]));
}

#[test]
fn a_truck_creeps_off_on_ice_with_spinning_wheels() {
    let p = builtin_truck("truck_real").unwrap();
    creeps_off_with_spinning_wheels::<Truck>(
        "truck_real",
        0.1,
        27.0,
        (p.tractor.mass + p.trailer.mass, &[2, 3]),
    );
}

/// Without drive friction and rolling resistance brake a spinning wheel, `I w' = -Fx R - My`, and then it rolls.
fn stop_spinning_when_the_pedal_is_released<P: Case>(name: &str, driven: usize, friction: f64) {
    let p = P::Parameters::builtin(name).unwrap();
    let side = &P::sides(&p)[driven];
    let radius = radii::<P>(&p)[driven];
    let mut vehicle: P = make(&p, &[("road_friction", friction)], 0.0).unwrap();
    drive(&mut vehicle, 3.0, 4.0);
    // Until the drive's lag is over.
    drive(&mut vehicle, 0.0, 1.5);
    let wheel = |vehicle: &P| P::wheels(vehicle.output())[driven];
    let first = wheel(&vehicle);
    assert!(first.slip > 1.0, "{name}: still spins: {first:?}");
    drive(&mut vehicle, 0.0, 0.1);
    let second = wheel(&vehicle);
    let vx = P::motion(vehicle.output())[0];
    let braked = |wheel: &WheelOutput| wheel.fx * radius + side.resistance(wheel, vx);
    let rate = 0.5 * (braked(&first) + braked(&second)) / side.inertia;
    near(second.speed - first.speed, -0.1 * rate, 0.02, name);
    let left = second.speed / rate;
    drive(&mut vehicle, 0.0, left + 0.5);
    for wheel in P::wheels(vehicle.output()) {
        assert!(wheel.slip.abs() < 0.01, "{name}: rolls again: {wheel:?}");
    }
}

#[test]
fn spinning_wheels_stop_when_the_pedal_is_released() {
    stop_spinning_when_the_pedal_is_released::<Car>("c_class", 0, 0.1);
    stop_spinning_when_the_pedal_is_released::<Truck>("truck_real", 2, 0.1);
}

/// Locked wheels stand, the vehicle slides to rest, and stays there: it is not pushed back by what the tyres stored.
fn slides_to_rest<P: Case>(name: &str, friction: f64, more: &[(&str, f64)]) {
    let p = P::Parameters::builtin(name).unwrap();
    let effects = [&[("road_friction", friction)], more].concat();
    let what = format!("{name} on {friction} with {more:?}");
    let speed = 18.0 * friction.sqrt();
    let mut vehicle: P = make(&p, &effects, speed).unwrap();
    drive(&mut vehicle, -9.0, 1.0);
    let locked = P::wheels(vehicle.output());
    assert!(locked.iter().all(|wheel| wheel.speed.abs() < 0.1 && wheel.slip < -0.9), "{what}: {locked:?}");
    let (mut backwards, mut time, mut stopped) = (0.0_f64, 0.0, f64::INFINITY);
    while time < stopped + 3.0 {
        vehicle.step(&VehicleInput { steer_cmd: 0.0, accel_cmd: -9.0 }, 0.001).unwrap();
        time += 0.001;
        let [vx, ..] = P::motion(vehicle.output());
        backwards = backwards.max(-vx);
        if vx <= 0.0 {
            stopped = stopped.min(time);
        }
        assert!(time < 200.0, "{what}: comes to rest");
    }
    // The springs of tyres, brakes and suspension swing back, and no more.
    assert!(backwards < 0.5, "{what}: {backwards} m/s backwards");
    let [vx, vy, yaw_rate] = P::motion(vehicle.output());
    assert!(vx.abs() < 1e-2 && vy.abs() < 1e-3 && yaw_rate.abs() < 1e-3, "{what}: {vx} {vy} {yaw_rate}");
    // Still: neither a wheel nor a force chatters from one millisecond to the next.
    let mut before: Vec<WheelOutput> = P::wheels(vehicle.output()).to_vec();
    for _ in 0..300 {
        vehicle.step(&VehicleInput { steer_cmd: 0.0, accel_cmd: -9.0 }, 0.001).unwrap();
        let wheels = P::wheels(vehicle.output());
        for (wheel, before) in wheels.iter().zip(&before) {
            assert!(wheel.speed.abs() < 0.05, "{what}: turns: {wheel:?}");
            assert!((wheel.fx - before.fx).abs() < 0.01 * wheel.load, "{what}: chatters: {wheel:?}");
        }
        before = wheels.to_vec();
    }
}

#[test]
fn locked_wheels_stand_and_the_vehicle_slides_to_rest() {
    for friction in [0.05, 0.2, 0.5] {
        slides_to_rest::<Car>("c_class", friction, &[]);
        slides_to_rest::<Truck>("truck_real", friction, &[]);
    }
    for name in &BUILTIN[1..] {
        slides_to_rest::<Car>(name, 0.3, &[]);
    }
    let laden = [("payload", 250.0), ("tyre_stiffness_front", 0.6), ("tyre_stiffness_rear", 0.6)];
    slides_to_rest::<Car>("c_class", 0.2, &laden);
    slides_to_rest::<Truck>("truck_simulation", 0.2, &laden);
}

/// One drive at low grip. An end with a word of its own (rolled over, jack-knifed) is one; the vehicle is then as before.
struct Conditions {
    friction: f64,
    more: Vec<(&'static str, f64)>,
    speed: f64,
    step: f64,
    seconds: f64,
}

fn is_sound<P: Case>(
    name: &str,
    conditions: &Conditions,
    input: impl Fn(f64) -> (f64, f64),
) -> Result<(), String> {
    let p = P::Parameters::builtin(name).unwrap();
    let (limits, radii) = (P::limits(&p), radii::<P>(&p));
    let effects = [&[("road_friction", conditions.friction)][..], &conditions.more].concat();
    let Some(mut vehicle) = make::<P>(&p, &effects, conditions.speed) else { return Ok(()) };
    let mut time = 0.0;
    while time < conditions.seconds {
        let (steer_cmd, accel_cmd) = input(time);
        match vehicle.step(&VehicleInput { steer_cmd, accel_cmd }, conditions.step) {
            Ok(()) => {}
            Err(PlantStepError::RolledOver { .. } | PlantStepError::JackKnifed { .. }) => return Ok(()),
            Err(error) => return Err(error.to_string()),
        }
        time += conditions.step;
        let output = vehicle.output();
        let values = P::SIGNALS.iter().map(|known| known.1(output));
        let values = values.chain(P::MORE.iter().map(|more| (more.3)(output)));
        let of_wheels = |w: &WheelOutput| [w.load, w.slip, w.slip_angle, w.speed, w.fx, w.fy];
        let mut values = values.chain(P::wheels(output).iter().flat_map(of_wheels));
        if !values.all(f64::is_finite) {
            return Err(format!("not finite at {time} s"));
        }
        let [vx, vy, yaw_rate] = P::motion(output);
        if vx.hypot(vy) > 90.0 || yaw_rate.abs() > 15.0 {
            return Err(format!("{vx} m/s, {vy} m/s, {yaw_rate} rad/s at {time} s"));
        }
        let power = power::<P>(&limits, &radii, output);
        if power > limits.power * (1.0 + 1e-9) {
            return Err(format!("{power} W of {} W at {time} s", limits.power));
        }
    }
    Ok(())
}

/// All corners, each for the time of a start or a stop.
fn corners<P: Case>(name: &str, seconds: f64) {
    for friction in [0.05, 0.3, 1.2] {
        for speed in [0.0, 3.0, 50.0] {
            for (steer, accel) in [(0.0, 5.0), (0.3, 5.0), (0.0, -9.0), (0.3, -9.0), (0.5, 0.0), (-0.05, 2.0)]
            {
                for step in [0.001, 0.0137, 0.1] {
                    let conditions = Conditions { friction, more: Vec::new(), speed, step, seconds };
                    let sound = is_sound::<P>(name, &conditions, |_| (steer, accel));
                    assert_eq!(sound, Ok(()), "{name} {friction} {speed} {steer} {accel} {step}");
                }
            }
        }
    }
}

#[test]
fn every_corner_of_grip_speed_pedal_steering_and_host_step_is_sound() {
    for name in ["c_class", "bmw_320i"] {
        corners::<Car>(name, 2.0);
    }
    corners::<Truck>("truck_real", 1.5);
}

#[test]
fn a_minute_of_full_throttle_on_ice_is_sound() {
    let conditions =
        |friction| Conditions { friction, more: Vec::new(), speed: 0.0, step: 0.1, seconds: 60.0 };
    for friction in [0.05, 0.2] {
        assert_eq!(is_sound::<Car>("genesis", &conditions(friction), |_| (0.0, 5.0)), Ok(()));
    }
    assert_eq!(is_sound::<Truck>("truck_simulation", &conditions(0.05), |_| (0.0, 5.0)), Ok(()));
}

#[test]
fn a_wheel_without_load_or_with_any_engine_spins_and_is_sound() {
    // The most that a vehicle file may hold, on the least grip: rims far beyond the speed of sound.
    let mut p = builtin("c_class").unwrap();
    p.drive.max_power = 1e7;
    p.drive.max_force = 1e6;
    p.tyre.front.friction_scale = 0.05;
    let slippery = Effects { road_friction: 0.05, drive_gain: 3.0, ..Effects::default() };
    let mut car = Car::new(&p, &slippery, None).unwrap();
    for k in 0..1500 {
        let accel_cmd = if k < 1000 { 5.0 } else { -9.0 };
        car.step(&VehicleInput { steer_cmd: 0.0, accel_cmd }, 0.02).unwrap();
        let out = car.output();
        assert!(out.vx.abs() < 20.0 && out.wheels.iter().all(|wheel| wheel.slip.abs() < 3.0), "{out:?}");
    }
    assert!(car.output().wheels.iter().all(|wheel| wheel.speed.abs() < 1.0), "{:?}", car.output().wheels);
}

/// A drive: vehicle, friction, speed, effects' places in their ranges, host step, and what is asked for how long.
type AnyDrive = (usize, f64, f64, Vec<f64>, f64, Vec<(f64, f64, f64)>);

fn any_drive() -> impl Strategy<Value = AnyDrive> {
    (
        0..64_usize,
        0.05..1.2_f64,
        0.0..50.0_f64,
        prop::collection::vec(0.0..1.0_f64, 8),
        prop_oneof![Just(0.001), 0.001..0.1_f64],
        prop::collection::vec((-0.6..0.6_f64, -9.0..5.0_f64, 0.1..2.0_f64), 1..6),
    )
}

fn is_sound_on<P: Case>(names: &[&str], drive: &AnyDrive) -> Result<(), String> {
    let (vehicle, friction, speed, places, step, inputs) = drive;
    // Ranges of a workshop: loads, tyres, springs.
    const EFFECTS: [(&str, f64, f64); 8] = [
        ("payload", 0.0, 400.0),
        ("payload_x", -1.0, 0.5),
        ("tyre_stiffness_front", 0.5, 1.5),
        ("tyre_stiffness_rear", 0.5, 1.5),
        ("tyre_relaxation", 0.05, 1.5),
        ("road_grade", -0.15, 0.15),
        ("trailer_payload", 0.0, 15000.0),
        ("drive_gain", 0.5, 2.0),
    ];
    // A half of the effects is left neutral.
    let chosen = EFFECTS.iter().zip(places).filter(|(_, place)| **place < 0.5);
    let more = chosen.map(|(&(id, low, high), place)| (id, low + 2.0 * place * (high - low))).collect();
    let seconds = inputs.iter().map(|input| input.2).sum();
    let conditions = Conditions { friction: *friction, more, speed: *speed, step: *step, seconds };
    is_sound::<P>(names[vehicle % names.len()], &conditions, |time| {
        let mut left = time;
        for &(steer, accel, held) in inputs {
            if left < held {
                return (steer, accel);
            }
            left -= held;
        }
        (0.0, 0.0)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_drive_of_a_car_is_sound(drive in any_drive()) {
        prop_assert_eq!(is_sound_on::<Car>(BUILTIN, &drive), Ok(()));
    }

    #[test]
    fn any_drive_of_a_truck_is_sound(drive in any_drive()) {
        prop_assert_eq!(is_sound_on::<Truck>(BUILTIN_TRUCKS, &drive), Ok(()));
    }
}

#[test]
fn what_cannot_go_on_says_so_to_a_person() {
    let mut p = builtin("vw_vanagon").unwrap();
    p.vehicle.cg_height = 1.15;
    let mut tall = Car::new(&p, &Effects::default(), None).unwrap();
    tall.place(0.0, 0.0, 0.0, 18.0);
    let steer = VehicleInput { steer_cmd: 0.2, accel_cmd: 0.0 };
    let error = (0..800).find_map(|_| tall.step(&steer, 0.01).err()).unwrap().to_string();
    assert!(error.contains("rolled over") && error.contains("drive slower"), "{error}");

    let icy = TruckEffects {
        vehicle: Effects { road_friction: 0.1, ..Effects::default() },
        ..TruckEffects::default()
    };
    let mut truck = Truck::new(&builtin_truck("truck_simulation").unwrap(), &icy, None).unwrap();
    truck.place(0.0, 0.0, 0.0, 25.0);
    let steer = VehicleInput { steer_cmd: 0.3, accel_cmd: -9.0 };
    let error = (0..2000).find_map(|_| truck.step(&steer, 0.01).err());
    if let Some(error) = error {
        assert!(error.to_string().contains("jack-knifed"), "{error}");
    }
}
