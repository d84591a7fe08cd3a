//! Hosts whose steps are longer than the controller's sample time: the vehicle stays on its road, and the host is told.

use crate::unit::Unit;
use rfl_mpc::control::SHOWN_HORIZON;
use rfl_mpc::fmi::{Model, Severity, Value};
use rfl_mpc::fmu::{PassengerCar, RflMpc, SemiTrailerTruck, TruckRflMpc};
use rfl_mpc::path::{RandomRoad, write_csv};
use std::path::{Path, PathBuf};

/// A controller and a vehicle in a host.
struct Host<C: Model, P: Model> {
    controller: Unit<C>,
    plant: Unit<P>,
    time: f64,
    /// References of what the host passes on: signals of the vehicle, inputs of the controller.
    measured: Vec<(usize, usize)>,
    commands: Vec<(usize, usize)>,
    /// Largest lateral error, m.
    worst: f64,
    /// True for a host that steps the vehicle before the controller.
    vehicle_first: bool,
}

impl<C: Model, P: Model> Host<C, P> {
    fn new(road: &Path, vehicle: &str, settings: &[(&str, Value)]) -> Self {
        let text = |text: &str| Value::String(text.to_owned());
        let (road, vehicle) = (text(road.to_str().unwrap()), text(vehicle));
        let of_controller = [("path_file", road.clone()), ("vehicle_file", vehicle.clone())];
        let controller = Unit::<C>::new(&[&of_controller, settings].concat());
        let start = |name: &str| Value::Real(controller.real(name));
        let plant = Unit::<P>::new(&[
            ("road_file", road),
            ("vehicle_file", vehicle),
            ("initial.x", start("start.x")),
            ("initial.y", start("start.y")),
            ("initial.yaw", start("start.yaw")),
            ("initial.vx", start("start.speed")),
        ]);
        let names = ["x", "y", "yaw", "vx", "vy", "yaw_rate", "steer", "articulation", "articulation_rate"];
        let pair =
            |from: &dyn Fn(&str) -> Option<usize>, to: &dyn Fn(&str) -> Option<usize>, names: &[&str]| {
                names.iter().filter_map(|name| Some((from(name)?, to(name)?))).collect::<Vec<_>>()
            };
        let (of_c, of_p) = (C::declaration(), P::declaration());
        let (of_c, of_p) = (|name: &str| of_c.find(name), |name: &str| of_p.find(name));
        let measured = pair(&of_p, &of_c, &names);
        let commands = pair(&of_c, &of_p, &["steer_cmd", "accel_cmd"]);
        Self { controller, plant, time: 0.0, measured, commands, worst: 0.0, vehicle_first: false }
    }

    fn step(&mut self, step: f64) {
        if self.vehicle_first {
            self.step_vehicle(step);
            self.step_controller(step);
        } else {
            self.step_controller(step);
            self.step_vehicle(step);
        }
        self.time += step;
    }

    fn step_controller(&mut self, step: f64) {
        let Self { controller, plant, .. } = self;
        for &(from, to) in &self.measured {
            controller.values.set_real(to, plant.values.real(from));
        }
        controller.model.step(&mut controller.values, self.time, step, &mut controller.log).unwrap();
        self.worst = self.worst.max(controller.real("e1").abs());
    }

    fn step_vehicle(&mut self, step: f64) {
        let Self { controller, plant, .. } = self;
        for &(from, to) in &self.commands {
            plant.values.set_real(to, controller.values.real(from));
        }
        plant.model.step(&mut plant.values, self.time, step, &mut plant.log).unwrap();
    }

    /// Drives to the road's end with steps by their number; at most three minutes.
    fn drive(&mut self, step: impl Fn(u32) -> f64) -> bool {
        let finished = C::declaration().find("finished").unwrap();
        for k in 0.. {
            self.step(step(k));
            if self.controller.values.boolean(finished) {
                return true;
            }
            if self.time > 180.0 {
                break;
            }
        }
        false
    }

    /// What the host was told of its step.
    fn told(&self) -> Vec<&(Severity, String)> {
        self.controller.log.0.iter().filter(|(_, text)| text.contains("mpc.sample_time")).collect()
    }
}

fn road(folder: &Path, family: &RandomRoad, seed: u64) -> PathBuf {
    let file = folder.join(format!("road_{seed}.csv"));
    write_csv(&file, &family.samples(seed)).unwrap();
    file
}

#[test]
fn a_longer_step_of_the_host_is_the_sample_time() {
    let folder = tempfile::tempdir().unwrap();
    for (seed, car) in [(7101, "bmw_320i"), (7102, "vw_vanagon")] {
        let road = road(folder.path(), &RandomRoad::CAR, seed);
        for step in [0.02, 0.04, 0.05, 0.1, 0.2] {
            let mut host = Host::<RflMpc, PassengerCar>::new(&road, car, &[]);
            assert!(host.drive(|_| step), "{car}, {step} s: {:?}", host.controller.log.0);
            println!("{car}, road {seed}, {step} s: {:.3} m", host.worst);
            assert!(host.worst < 0.5, "{car}, {step} s: {} m", host.worst);
            let told = host.told();
            assert_eq!(told.len(), usize::from(step > 0.02), "{told:?}");
            for (severity, text) in told {
                let said = format!("predicts with a sample time of {step} s");
                assert!(*severity == Severity::Info && text.contains(&said), "{text}");
            }
        }
    }
}

#[test]
fn a_truck_stays_on_its_road_in_a_host_with_long_steps() {
    let folder = tempfile::tempdir().unwrap();
    let road = road(folder.path(), &RandomRoad::TRUCK, 7103);
    for step in [0.05, 0.1] {
        let mut host = Host::<TruckRflMpc, SemiTrailerTruck>::new(&road, "truck_simulation", &[]);
        assert!(host.drive(|_| step), "{step} s: {:?}", host.controller.log.0);
        println!("truck, {step} s: {:.3} m", host.worst);
        assert!(host.worst < 0.5, "{step} s: {} m", host.worst);
    }
}

#[test]
fn steps_that_grow_and_uneven_steps_are_kept_up_with() {
    let folder = tempfile::tempdir().unwrap();
    let road = road(folder.path(), &RandomRoad::CAR, 7104);
    let grow = |k: u32| if k < 500 { 0.02 } else { 0.1 };
    let uneven = |k: u32| [0.005, 0.07, 0.03, 0.05][k as usize % 4];
    let tiny_first = |k: u32| if k == 0 { 1e-6 } else { 0.05 };
    for step in [&grow as &dyn Fn(u32) -> f64, &uneven, &tiny_first] {
        let mut host = Host::<RflMpc, PassengerCar>::new(&road, "c_class", &[]);
        assert!(host.drive(step), "{:?}", host.controller.log.0);
        println!("{:.3} m, {:?}", host.worst, host.told());
        assert!(host.worst < 0.5, "{} m", host.worst);
    }
}

#[test]
fn a_host_that_is_late_once_or_trembles_changes_nothing_and_one_that_is_fast_again_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let road = road(folder.path(), &RandomRoad::CAR, 7108);
    let late = |k: u32| if k == 300 { 0.2 } else { 0.02 };
    let trembling = |k: u32| if k.is_multiple_of(2) { 0.0201 } else { 0.0199 };
    // A tenth of a microsecond before its instant a sample is due: else it would wait for a whole step.
    let barely = |k: u32| if k.is_multiple_of(2) { 0.019_999_9 } else { 0.020_000_1 };
    for step in [&late as &dyn Fn(u32) -> f64, &trembling, &barely] {
        let mut host = Host::<RflMpc, PassengerCar>::new(&road, "c_class", &[]);
        assert!(host.drive(step), "{:?}", host.controller.log.0);
        assert!(host.told().is_empty() && host.worst < 0.1, "{} m, {:?}", host.worst, host.told());
    }
    let for_a_while = |k: u32| if (300..360).contains(&k) { 0.1 } else { 0.02 };
    let mut host = Host::<RflMpc, PassengerCar>::new(&road, "c_class", &[]);
    assert!(host.drive(for_a_while), "{:?}", host.controller.log.0);
    let told = host.told();
    assert_eq!(told.len(), 2, "{told:?}");
    assert!(told[0].1.contains("sample time of 0.1 s") && told[1].1.contains("0.02 s, again"), "{told:?}");
    assert!(host.worst < 0.1, "{} m", host.worst);
}

/// A host's order of its units shows where its steps vary: the pose of a vehicle that is stepped first is newer than its time.
#[test]
fn steps_that_vary_are_kept_up_with_in_either_order_of_units() {
    let folder = tempfile::tempdir().unwrap();
    let road = road(folder.path(), &RandomRoad::CAR, 7109);
    let in_turn = |pair: [f64; 2]| move |k: u32| pair[k as usize % 2];
    let mixed = |k: u32| [0.005, 0.05, 0.02, 0.03, 0.011][k as usize % 5];
    let paused = |k: u32| if k % 50 == 49 { 0.1 } else { 0.02 };
    let cases: [&dyn Fn(u32) -> f64; 4] = [&in_turn([0.02, 0.05]), &in_turn([0.01, 0.03]), &mixed, &paused];
    for (case, step) in cases.into_iter().enumerate() {
        for vehicle_first in [false, true] {
            let mut host = Host::<RflMpc, PassengerCar>::new(&road, "c_class", &[]);
            host.vehicle_first = vehicle_first;
            assert!(host.drive(step), "{case}, {vehicle_first}: {:?}", host.controller.log.0);
            assert!(host.worst < 0.5, "{case}, {vehicle_first}: {} m", host.worst);
            let stopped = host.controller.log.0.iter().find(|(_, text)| text.contains("safe_stop"));
            assert_eq!(stopped, None, "{case}, {vehicle_first}");
        }
    }
}

#[test]
fn a_step_beyond_every_sample_time_is_warned_of_once() {
    let folder = tempfile::tempdir().unwrap();
    let road = road(folder.path(), &RandomRoad::CAR, 7105);
    for settings in [&[][..], &[("mpc.sample_time", Value::Real(0.2))]] {
        let mut host = Host::<RflMpc, PassengerCar>::new(&road, "c_class", settings);
        (0..4).for_each(|_| host.step(0.5));
        let told = host.told();
        assert!(matches!(told[..], [(Severity::Warning, _)]), "{told:?}");
        assert!(told[0].1.contains("0.2 s or shorter"), "{told:?}");
    }
}

#[test]
fn a_state_of_a_longer_step_goes_on_bit_for_bit_and_one_of_another_road_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let road_file = road(folder.path(), &RandomRoad::CAR, 7106);
    let mut host = Host::<RflMpc, PassengerCar>::new(&road_file, "c_class", &[]);
    (0..40).for_each(|_| host.step(0.05));
    let (mut of_controller, mut of_plant) = (Vec::new(), Vec::new());
    host.controller.model.save(&mut of_controller);
    host.plant.model.save(&mut of_plant);

    let mut other = Host::<RflMpc, PassengerCar>::new(&road_file, "c_class", &[]);
    other.controller.model.restore(&of_controller).unwrap();
    other.plant.model.restore(&of_plant).unwrap();
    other.controller.values = host.controller.values.clone();
    other.plant.values = host.plant.values.clone();
    other.time = host.time;
    for _ in 0..100 {
        host.step(0.05);
        other.step(0.05);
        for name in ["steer_cmd", "accel_cmd", &format!("predicted.e1[{SHOWN_HORIZON}]")] {
            assert_eq!(host.controller.real(name), other.controller.real(name), "{name}");
        }
        assert_eq!(host.plant.real("x"), other.plant.real("x"));
    }

    // The same name, another road.
    write_csv(&road_file, &RandomRoad::CAR.samples(7107)).unwrap();
    let mut changed = Host::<RflMpc, PassengerCar>::new(&road_file, "c_class", &[]);
    let refused = [
        (changed.controller.model.restore(&of_controller), "path_file"),
        (changed.plant.model.restore(&of_plant), "road_file"),
    ];
    for (result, word) in refused {
        let message = result.unwrap_err().to_string();
        assert!(message.contains("another road") && message.contains(word), "{message}");
    }
    changed.step(0.02);
}
