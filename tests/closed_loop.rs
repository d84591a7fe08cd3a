//! The closed loop of controller and car: how well it tracks, that it does so again, and what it survives.

use crate::unit::{Silent, Unit};
use rfl_mpc::control::{Controller, ControllerParameters};
use rfl_mpc::fmi::{Model, Value};
use rfl_mpc::fmu::{PassengerCar, RflMpc};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::signal;
use rfl_mpc::simulate::{COLUMNS, CarDrive, CarRow, ClosedLoop};
use rfl_mpc::vehicle::{BUILTIN, Car, Effects, builtin};
use std::sync::Arc;

fn course(route: Route) -> Arc<Path> {
    Arc::new(Path::from_samples(route.samples(), Closure::Detect).unwrap())
}

fn closed_loop(route: Route, car: &str, effects: &Effects, step: f64) -> ClosedLoop {
    let path = course(route);
    let parameters = builtin(car).unwrap();
    let controller = Controller::new(ControllerParameters::for_car(&parameters), path.clone()).unwrap();
    ClosedLoop::at_start(controller, &parameters, effects, step).unwrap()
}

fn drive(route: Route, car: &str, effects: &Effects) -> CarDrive {
    closed_loop(route, car, effects, 0.02).drive(600.0, |_| ()).unwrap()
}

/// Mean and largest lateral error in m of the right and left turn of the Sudoku course, as first measured. They hold
/// to a fiftieth of a millimetre on every machine; a change of plant or controller that moves them is seen, and says so.
const GOLDEN: [(&str, f64, f64); 5] = [
    ("c_class", 0.00034, 0.00173),
    ("bmw_320i", 0.00075, 0.00583),
    ("ford_escort", 0.00066, 0.00603),
    ("vw_vanagon", 0.00072, 0.00584),
    ("genesis", 0.00050, 0.00259),
];

#[test]
fn every_car_tracks_as_it_did() {
    assert_eq!(GOLDEN.map(|golden| golden.0), BUILTIN, "every built-in car has its figures");
    let mut moved = Vec::new();
    for (car, mae, max) in GOLDEN {
        let drive = drive(Route::SudokuTurns, car, &Effects::default());
        assert!(drive.finished, "{car} does not reach the end");
        let tracking = drive.tracking();
        let near = |a: f64, b: f64| (a - b).abs() < 2e-5;
        if !(near(tracking.mae, mae) && near(tracking.max, max)) {
            let (now_mae, now_max) = (tracking.mae, tracking.max);
            moved.push(format!("{car}: mean {now_mae:.5} m, max {now_max:.5} m; was {mae}, {max}"));
        }
    }
    assert!(moved.is_empty(), "{moved:#?}");
}

#[test]
fn the_nominal_controller_is_a_good_one() {
    let drive = drive(Route::SudokuTest, "c_class", &Effects::default());
    assert!(drive.finished);
    assert!(drive.tracking().mae <= 0.05, "mean lateral error {} m", drive.tracking().mae);
}

#[test]
fn what_real_cars_have_does_not_make_it_diverge() {
    let effects = [
        ("lag", Effects { steer_lag: 0.1, ..Effects::default() }),
        ("lag and dead time", Effects { steer_lag: 0.1, steer_delay: 0.06, ..Effects::default() }),
        ("payload", Effects { payload: 300.0, payload_x: -1.0, ..Effects::default() }),
        ("low friction", Effects { road_friction: 0.5, ..Effects::default() }),
        ("soft rear", Effects { tyre_stiffness_rear: 0.8, ..Effects::default() }),
        ("offset", Effects { steer_offset: 0.01, ..Effects::default() }),
        ("crosswind", Effects { wind_y: 10.0, ..Effects::default() }),
    ];
    for (name, effects) in effects {
        let drive = drive(Route::SudokuTurns, "c_class", &effects);
        assert!(drive.finished, "{name}");
        assert!(drive.tracking().max < 0.6, "{name}: {} m", drive.tracking().max);
    }
}

#[test]
fn closed_roads_are_driven_for_a_lap() {
    let drive = drive(Route::HairpinCircuit, "c_class", &Effects::default());
    assert!(drive.finished);
    let length = course(Route::HairpinCircuit).length();
    let speed = drive.column("vx").iter().sum::<f64>() * 0.02;
    assert!((speed - length).abs() < 0.01 * length, "{speed} m driven on a lap of {length} m");
}

#[test]
fn it_starts_from_standstill_and_beside_the_path() {
    let path = course(Route::SudokuTest);
    let parameters = builtin("c_class").unwrap();
    let controller = Controller::new(ControllerParameters::for_car(&parameters), path.clone()).unwrap();
    let mut car = Car::new(&parameters, &Effects::default(), None).unwrap();
    // 3 m to the left of the first straight, 20 degrees off, standing.
    let start = path.at(30.0);
    let (sin, cos) = start.yaw.sin_cos();
    car.place(start.x - 3.0 * sin, start.y + 3.0 * cos, start.yaw + 0.35, 0.0);
    let drive = ClosedLoop::new(controller, car, 0.02).drive(20.0, |_| ()).unwrap();
    let error = drive.column("e1");
    assert!((error[0] - 3.0).abs() < 0.05, "{}", error[0]);
    assert!(error.iter().all(|e1| (-0.1..3.2).contains(e1)), "it comes back without crossing the path");
    assert!(error[error.len() - 100..].iter().all(|e1| e1.abs() < 0.1), "it is on the path in the end");
}

#[test]
fn the_communication_step_hardly_matters() {
    let rows = |step: f64| {
        let mut closed = closed_loop(Route::SudokuTurns, "c_class", &Effects::default(), step);
        closed.drive(15.0, |_| ()).unwrap()
    };
    // The controller samples at 0.02 s and the car integrates at 1 ms in each case: the same drive.
    let (coarse, fine) = (rows(0.02), rows(0.005));
    for (k, row) in coarse.rows.iter().enumerate() {
        let other = &fine.rows[4 * k];
        assert!((row[3] - other[3]).abs() < 1e-6 && (row[4] - other[4]).abs() < 1e-6, "at {} s", row[0]);
    }
}

/// The master of `scripts/closed_loop.py` on the FMI units.
fn drive_units(path_file: &str, car: &str, steps: u32) -> Vec<CarRow> {
    let text = |value: &str| Value::String(value.to_string());
    let mut controller = Unit::<RflMpc>::new(&[("path_file", text(path_file)), ("vehicle_file", text(car))]);
    let initial = [("x", "x"), ("y", "y"), ("yaw", "yaw"), ("vx", "speed")].map(|(name, start)| {
        (format!("initial.{name}"), Value::Real(controller.real(&format!("start.{start}"))))
    });
    let mut settings = vec![("vehicle_file", text(car)), ("road_file", text(path_file))];
    settings.extend(initial.iter().map(|(name, value)| (name.as_str(), value.clone())));
    let mut plant = Unit::<PassengerCar>::new(&settings);

    let (of_controller, of_plant) = (RflMpc::declaration(), PassengerCar::declaration());
    let road = rfl_mpc::path::Path::read(std::path::Path::new(path_file)).unwrap();
    let mut rows = Vec::new();
    for k in 0..steps {
        let time = f64::from(k) * 0.02;
        for signal in ["x", "y", "yaw", "vx", "vy", "yaw_rate", "steer"] {
            let value = Value::Real(plant.values.real(of_plant.find(signal).unwrap()));
            let vr = of_controller.find(signal).unwrap();
            controller.values.set_by_host(vr, &of_controller.variables[vr], value);
        }
        controller.model.step(&mut controller.values, time, 0.02, &mut Silent).unwrap();
        // What the road is like there no unit says.
        let here = road.at(controller.values.real(of_controller.find("station").unwrap()));
        rows.push(COLUMNS.map(|signal| match signal.name {
            name if name == signal::TIME.name => time,
            "bank" => here.bank,
            "grade" => here.grade,
            "friction" => here.friction,
            name => match of_plant.find(name).filter(|_| !name.ends_with("_cmd")) {
                Some(vr) => plant.values.real(vr),
                None => controller.values.real(of_controller.find(name).unwrap()),
            },
        }));
        for signal in ["steer_cmd", "accel_cmd"] {
            let value = Value::Real(controller.values.real(of_controller.find(signal).unwrap()));
            let vr = of_plant.find(signal).unwrap();
            plant.values.set_by_host(vr, &of_plant.variables[vr], value);
        }
        plant.model.step(&mut plant.values, time, 0.02, &mut Silent).unwrap();
    }
    rows
}

#[test]
fn the_fmi_units_drive_as_the_native_loop_bit_for_bit() {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("paths/sudoku_turns.csv");
    let path = Arc::new(Path::read(&file).unwrap());
    let parameters = builtin("bmw_320i").unwrap();
    let controller = Controller::new(ControllerParameters::for_car(&parameters), path.clone()).unwrap();
    let mut closed = ClosedLoop::at_start(controller, &parameters, &Effects::default(), 0.02).unwrap();
    let native = closed.drive(20.0, |_| ()).unwrap();
    let units = drive_units(file.to_str().unwrap(), "bmw_320i", 1000);
    assert_eq!(native.rows.len(), units.len());
    for (row, other) in native.rows.iter().zip(&units) {
        assert_eq!(row.map(f64::to_bits), other.map(f64::to_bits), "at {} s", row[0]);
    }
}

#[test]
fn the_same_drive_gives_the_same_bits_on_every_thread() {
    let bits = || -> Vec<u64> {
        let drive = closed_loop(Route::SudokuTurns, "c_class", &Effects::default(), 0.02)
            .drive(10.0, |_| ())
            .unwrap();
        drive.rows.iter().flatten().map(|value| value.to_bits()).collect()
    };
    let expected = bits();
    std::thread::scope(|scope| {
        let others: Vec<_> = (0..4).map(|_| scope.spawn(bits)).collect();
        for other in others {
            assert_eq!(other.join().unwrap(), expected);
        }
    });
}
