//! Reading vehicle files: what is read, and what is said of those that cannot be.

use rfl_mpc::vehicle::{
    BUILTIN, BUILTIN_TRUCKS, Car, CarParameters, Effects, TruckParameters, VehicleError, VehicleKind,
    VehicleParameters, VehiclePlace, builtin, builtin_truck,
};
use std::path::{Path, PathBuf};

fn vehicles() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles")
}

#[test]
fn built_in_vehicles_are_the_files() {
    for name in BUILTIN {
        let read = CarParameters::read(&vehicles().join(format!("{name}.toml"))).unwrap();
        assert_eq!(read, builtin(name).unwrap(), "{name}");
    }
    let files = std::fs::read_dir(vehicles()).unwrap().filter_map(Result::ok);
    let count = files.filter(|entry| entry.path().extension().is_some_and(|end| end == "toml")).count();
    for name in BUILTIN_TRUCKS {
        let read = TruckParameters::read(&vehicles().join(format!("{name}.toml"))).unwrap();
        assert_eq!(read, builtin_truck(name).unwrap(), "{name}");
    }
    assert_eq!(count, BUILTIN.len() + BUILTIN_TRUCKS.len(), "every vehicle of vehicles/ is built in");
    let message = builtin("trabant").unwrap_err().to_string();
    assert!(message.contains("trabant") && message.contains("bmw_320i"), "{message}");
}

#[test]
fn a_copy_finds_built_in_tyres_and_prefers_those_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    std::fs::copy(vehicles().join("bmw_320i.toml"), &file).unwrap();
    assert_eq!(CarParameters::read(&file).unwrap(), builtin("bmw_320i").unwrap());
    std::fs::create_dir(folder.path().join("tyres")).unwrap();
    let tyre = std::fs::read_to_string(vehicles().join("tyres/commonroad.tir")).unwrap();
    let tyre = tyre.replace("PDY1 = 1.0489", "PDY1 = 0.9");
    std::fs::write(folder.path().join("tyres/commonroad.tir"), tyre).unwrap();
    assert_eq!(CarParameters::read(&file).unwrap().tyre.front.coefficients.unwrap().pdy1, 0.9);
}

#[test]
fn a_vehicle_of_the_other_kind_is_said_to_be_one() {
    let elsewhere = |name: &str| PathBuf::from(name);
    let truck = vehicles().join("truck_real.toml");
    let car = vehicles().join("c_class.toml");
    for said in [
        CarParameters::named("truck_real", elsewhere).unwrap_err().to_string(),
        CarParameters::read(&truck).unwrap_err().to_string(),
    ] {
        assert!(said.contains("truck_real") && said.contains("is a truck, and a car is wanted"), "{said}");
    }
    for said in [
        TruckParameters::named("c_class", elsewhere).unwrap_err().to_string(),
        TruckParameters::read(&car).unwrap_err().to_string(),
    ] {
        assert!(said.contains("c_class") && said.contains("is a car, and a truck is wanted"), "{said}");
    }
    assert_eq!(CarParameters::named("c_class", elsewhere).unwrap(), builtin("c_class").unwrap());
    assert_eq!(TruckParameters::named("t", |_| truck).unwrap(), builtin_truck("truck_real").unwrap());
}

#[test]
fn what_a_program_sets_wrongly_is_not_blamed_on_a_file() {
    let mut car = builtin("c_class").unwrap();
    car.vehicle.mass = 110.0;
    let said = car.check().unwrap_err().to_string();
    assert!(said.starts_with("vehicle 'C-class") && said.contains("correct vehicle.mass"), "{said}");
    assert!(!said.contains("file") && !said.contains("line"), "{said}");
    car.vehicle.mass = 1e308;
    let said = car.check().unwrap_err().to_string();
    assert!(said.contains("vehicle.mass = 1e308 kg is outside 100 ... 100000"), "{said}");
}

#[test]
fn what_is_wrong_is_named_with_file_line_key_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let sound = std::fs::read_to_string(vehicles().join("c_class.toml")).unwrap();
    let line = |part: &str| 1 + sound.lines().position(|line| line.starts_with(part)).unwrap();
    let change = |from: &str, to: &str| {
        assert!(sound.contains(from), "{from}");
        std::fs::write(&file, sound.replacen(from, to, 1)).unwrap();
        let message = CarParameters::read(&file).unwrap_err().to_string();
        assert!(message.contains("mine.toml"), "{message}");
        message
    };
    for (from, to, at, parts) in [
        ("mass = 1400.0", "mass = -1400.0", "mass", vec!["vehicle.mass = -1400 kg", "100 ... 100000"]),
        ("mass = 1400.0", "mass = nan", "mass", vec!["vehicle.mass"]),
        ("mass = 1400.0", "mass = \"heavy\"", "mass", vec!["expected f64", "vehicles/"]),
        ("mass = 1400.0", "mas = 1400.0", "mass", vec!["unknown field `mas`", "`mass`"]),
        ("track = 1.52", "track = 0", "track = 1.52", vec!["axle.rear.track", "outside"]),
        ("cg_height = 0.54", "cg_height = ", "cg_height", vec!["line"]),
    ] {
        let message = change(from, to);
        assert!(message.contains(&format!("line {}", line(at))), "{message}");
        for part in parts {
            assert!(message.contains(part), "'{part}' is not in: {message}");
        }
    }
    assert!(change("yaw_inertia = 2150.0", "").contains("missing field `yaw_inertia`"));
    let message = change("tyres/c_class.tir", "tyres/none.tir");
    assert!(message.contains("tyre.front.file") && message.contains("none.tir"), "{message}");
    let message = change("unsprung_mass = 80.0", "unsprung_mass = 1300.0");
    assert!(message.contains("unsprung"), "{message}");
    std::fs::write(&file, &sound[..sound.len() / 2]).unwrap();
    assert!(CarParameters::read(&file).is_err(), "a file that is cut off");
    std::fs::write(&file, [0xff, 0xfe, 0x00]).unwrap();
    assert!(matches!(CarParameters::read(&file), Err(VehicleError::Unreadable { .. })));
    let message = CarParameters::read(Path::new("no/such.toml")).unwrap_err().to_string();
    assert!(message.contains("no/such.toml") && message.contains("c_class"), "{message}");
    assert!(!message.contains("truck_real"), "a car is wanted: {message}");
}

#[test]
fn numbers_that_contradict_each_other_are_doubted_with_line_key_and_what_was_meant() {
    for name in BUILTIN {
        assert_eq!(builtin(name).unwrap().doubts(), [], "{name}");
    }
    for name in BUILTIN_TRUCKS {
        assert_eq!(builtin_truck(name).unwrap().doubts(), [], "{name}");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let written = |of: &str, changes: &[(&str, &str)]| {
        let mut text = std::fs::read_to_string(vehicles().join(of)).unwrap();
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        std::fs::write(&file, &text).unwrap();
        text
    };
    type Case<'a> = (&'a str, &'a [(&'a str, &'a str)], &'a str, &'a str, &'a [&'a str]);
    let cases: &[Case] = &[
        (
            "c_class.toml",
            &[("max_power = 110000.0", "max_power = 110.0")],
            "max_power",
            "drive.max_power",
            &["= 110 W is 0.079 W for each kilogram of the vehicle", "in kW", "110000 W would be ordinary"],
        ),
        (
            "c_class.toml",
            &[("max_force = 16000.0", "max_force = 16.0")],
            "max_force = 16.0",
            "brake.max_force",
            &["16000 N"],
        ),
        (
            "c_class.toml",
            &[("yaw_inertia = 2150.0", "yaw_inertia = 215")],
            "yaw_inertia",
            "vehicle.yaw_inertia",
            &["2150 kg m2 would be ordinary"],
        ),
        (
            "c_class.toml",
            &[("yaw_inertia = 2150.0", "yaw_inertia = 21500")],
            "yaw_inertia",
            "vehicle.yaw_inertia",
            &["2150 kg m2 would be ordinary"],
        ),
        (
            "c_class.toml",
            &[("axle = 1.11", "axle = 11.1"), ("axle = 1.53", "axle = 15.3")],
            "cg_to_front_axle",
            "vehicle.cg_to_front_axle",
            &["the wheelbase = 26.4 m", "2.64 m would be ordinary"],
        ),
        // A bus on the springs of a car, with the CG of a bus and with that of a car.
        (
            "c_class.toml",
            &[
                ("mass = 1400.0", "mass = 12500.0"),
                ("yaw_inertia = 2150.0", "yaw_inertia = 110000.0"),
                ("axle = 1.11", "axle = 3.78"),
                ("axle = 1.53", "axle = 2.22"),
                ("cg_height = 0.54", "cg_height = 1.2"),
            ],
            "spring_rate = 23000.0",
            "axle.rear.spring_rate",
            &["sags by 1.66 m", "falls over at any speed"],
        ),
        (
            "c_class.toml",
            &[
                ("mass = 1400.0", "mass = 12500.0"),
                ("yaw_inertia = 2150.0", "yaw_inertia = 110000.0"),
                ("axle = 1.11", "axle = 3.78"),
                ("axle = 1.53", "axle = 2.22"),
            ],
            "spring_rate = 23000.0",
            "axle.rear.spring_rate",
            &["sags by 1.66 m", "the body sinks to it"],
        ),
        (
            "truck_real.toml",
            &[("cg_to_hitch = 0.6", "cg_to_hitch = -0.6")],
            "cg_to_hitch = -0.6",
            "hitch.cg_to_hitch",
            &["in front of the tractor's CG", "0.6 m"],
        ),
        (
            "truck_real.toml",
            &[("yaw_inertia = 113341.0", "yaw_inertia = 1133.41")],
            "yaw_inertia = 1133.41",
            "trailer.yaw_inertia",
            &["113341 kg m2 would be ordinary"],
        ),
    ];
    for (of, changes, begins, name, parts) in cases {
        let text = written(of, changes);
        let doubts = match VehicleKind::of(&file.display().to_string()) {
            VehicleKind::Car => CarParameters::read(&file).unwrap().doubts(),
            VehicleKind::Truck => TruckParameters::read(&file).unwrap().doubts(),
        };
        let [doubt] = &doubts[..] else { panic!("{changes:?}: {doubts:?}") };
        assert_eq!(doubt.name, *name);
        for part in *parts {
            assert!(doubt.words.contains(part), "'{part}' is not in: {}", doubt.words);
        }
        let line = 1 + text.lines().position(|line| line.starts_with(begins)).unwrap();
        let place = VehiclePlace::of(&file, doubt.name).to_string();
        assert!(place.ends_with(&format!("line {line}")), "{place}: {doubt:?}");
    }
}

#[test]
fn every_parameter_can_be_read_and_set() {
    let mut car = builtin("c_class").unwrap();
    for parameter in CarParameters::TABLE {
        let value = parameter.range.0 + 0.5 * (parameter.range.1 - parameter.range.0);
        parameter.set(&mut car, value);
        assert_eq!(parameter.get(&car), value, "{}", parameter.name);
        let same = CarParameters::TABLE.iter().filter(|other| other.name == parameter.name).count();
        assert_eq!(same, 1, "{}", parameter.name);
    }
}

#[test]
fn a_car_without_its_tyres_is_refused() {
    let mut car = builtin("c_class").unwrap();
    car.tyre.rear.coefficients = None;
    assert!(matches!(car.check(), Err(VehicleError::NoTyres { .. })));
    assert!(Car::new(&car, &Effects::default(), None).is_err());
}

#[test]
fn what_is_wrong_with_a_truck_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let sound = std::fs::read_to_string(vehicles().join("truck_real.toml")).unwrap();
    for (from, to, parts) in [
        ("cg_to_hitch = 4.426", "cg_to_hitch = -1", vec!["trailer.cg_to_hitch", "outside", "line"]),
        ("trailer_share = 0.34", "trailer_share = 0.8", vec!["brake.front_share", "brake.trailer_share"]),
        ("unsprung_mass = 1500.0", "unsprung_mass = 7900.0", vec!["trailer.mass", "unsprung"]),
        ("[hitch]", "[coupling]", vec!["coupling", "line"]),
        ("tyres/truck.tir", "tyres/none.tir", vec!["tyre.front.file", "none.tir"]),
    ] {
        assert!(sound.contains(from), "{from}");
        std::fs::write(&file, sound.replacen(from, to, 1)).unwrap();
        let message = TruckParameters::read(&file).unwrap_err().to_string();
        for part in parts.into_iter().chain(["mine.toml"]) {
            assert!(message.contains(part), "'{part}' is not in: {message}");
        }
    }
    let message = builtin_truck("c_class").unwrap_err().to_string();
    assert!(message.contains("truck_simulation"), "{message}");
    for parameter in TruckParameters::TABLE {
        let same = TruckParameters::TABLE.iter().filter(|other| other.name == parameter.name).count();
        assert_eq!(same, 1, "{}", parameter.name);
    }
}

#[test]
fn a_files_kind_is_told() {
    for (name, kind) in [
        ("c_class", VehicleKind::Car),
        ("truck_real", VehicleKind::Truck),
        ("no_such_vehicle", VehicleKind::Car),
        (vehicles().join("genesis.toml").to_str().unwrap(), VehicleKind::Car),
        (vehicles().join("truck_simulation.toml").to_str().unwrap(), VehicleKind::Truck),
    ] {
        assert_eq!(VehicleKind::of(name), kind, "{name}");
    }
}
