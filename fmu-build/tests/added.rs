//! Learned models and a car packed into FMUs: what is added, what the FMU starts with, and what is refused.

use fmu_build::added::{AddError, add_models, add_settings, add_start, add_vehicle, try_added};
use fmu_build::description::{describe, describe_for};
use fmu_build::fmu::Fmu;
use fmu_build::shipped;
use rfl_mpc::control::ControlVariant;
use rfl_mpc::fmi::v2::guid_of;
use rfl_mpc::nominal::LateralVehicle;
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::{DataConfig, DataSet, Drive, Kind, TrainConfig, train};
use rfl_mpc::vehicle::{CarParameters, VehicleKind, builtin, builtin_truck};
use std::path::{Path, PathBuf};

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A model learned from noise, for a car and a sample time.
fn model(folder: &Path, name: &str, kind: Kind, car: &CarParameters, sample_time: f64) -> PathBuf {
    model_of(folder, name, kind, &car.single_track(), sample_time)
}

/// The same for any vehicle.
fn model_of<V: LateralVehicle<S>, const S: usize>(
    folder: &Path,
    name: &str,
    kind: Kind,
    vehicle: &V,
    sample_time: f64,
) -> PathBuf {
    let mut random = Random::new(1);
    let mut log = Drive { name: "noise".into(), ..Drive::default() };
    for k in 0..800 {
        log.time.push(sample_time * f64::from(k));
        log.vx.push(10.0 + random.uniform());
        for column in [&mut log.curvature, &mut log.curvature_rate, &mut log.steer_cmd] {
            column.push(0.01 * random.uniform());
        }
        for column in [&mut log.e1, &mut log.e1_rate, &mut log.e2, &mut log.e2_rate] {
            column.push(0.01 * random.uniform());
        }
        for column in [&mut log.articulation, &mut log.articulation_rate] {
            column.push(0.01 * random.uniform());
        }
    }
    let data = DataConfig { sample_time, ..DataConfig::default() };
    let data = DataSet::new(&[log], vehicle, data).unwrap();
    let config = TrainConfig { trees: 2, depth: 2, threads: 1, ..TrainConfig::new(kind) };
    let file = folder.join(name);
    train(&data, None, &config, &|_| ()).unwrap().model.write(&file).unwrap();
    file
}

fn of<'a>(fmus: &'a [Fmu], name: &str) -> &'a Fmu {
    fmus.iter().find(|fmu| fmu.declaration.name == name).unwrap()
}

#[test]
fn models_are_packed_by_kind_and_the_first_drives() {
    let folder = tempfile::tempdir().unwrap();
    let car = builtin("c_class").unwrap();
    let files = [
        model(folder.path(), "b.rflm", Kind::RflS, &car, 0.02),
        model(folder.path(), "a.rflm", Kind::Linear, &car, 0.02),
    ];
    let mut fmus = shipped::fmus();
    assert_eq!(
        add_models(&mut fmus, &project(), &files).unwrap(),
        [("RflMpc", ControlVariant::RflS), ("RflMpc", ControlVariant::Linear)]
    );
    let controller = of(&fmus, "RflMpc");
    let packed: Vec<_> = controller.added.files.iter().map(|(entry, file)| (entry.as_str(), file)).collect();
    assert_eq!(packed, [("residual/linear.rflm", &files[1]), ("residual/rfl_s.rflm", &files[0])]);
    assert_eq!(
        controller.added.start.iter().collect::<Vec<_>>(),
        [(&"variant".to_owned(), &"rfl_s".to_owned())]
    );
    assert!(of(&fmus, "PassengerCar").added.start.is_empty());

    // A host sees the start value, and the library knows the GUID.
    let mut declaration = controller.declaration.clone();
    declaration.start_with("variant", "rfl_s").unwrap();
    let (plain, xml) =
        (describe(&controller.declaration), describe_for(&controller.declaration, &declaration));
    assert!(plain.contains(r#"<Enumeration declaredType="Variant" start="10"/>"#));
    assert!(xml.contains(r#"<Enumeration declaredType="Variant" start="6"/>"#));
    assert_eq!(guid_of(&plain), guid_of(&xml));
    assert!(guid_of(&describe(&declaration)) != guid_of(&plain));
}

#[test]
fn models_that_cannot_drive_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let car = builtin("c_class").unwrap();
    let good = model(folder.path(), "good.rflm", Kind::Linear, &car, 0.02);
    let again = model(folder.path(), "again.rflm", Kind::Linear, &car, 0.02);
    let slow = model(folder.path(), "slow.rflm", Kind::Linear, &car, 0.04);
    let bmw = model(folder.path(), "bmw.rflm", Kind::Linear, &builtin("bmw_320i").unwrap(), 0.02);
    let bytes = std::fs::read(&good).unwrap();
    std::fs::write(at("half.rflm"), &bytes[..bytes.len() / 2]).unwrap();
    std::fs::write(at("foreign.rflm"), "x,y\n0,0\n").unwrap();
    for (files, words) in [
        (vec![good.clone(), again], &["good.rflm", "again.rflm", "both of kind linear"][..]),
        (vec![slow.clone()], &["slow.rflm", "0.04 s", "0.02 s", "--start"]),
        (vec![bmw.clone()], &["bmw.rflm", "mass", "c_class", "--vehicle"]),
        (vec![at("half.rflm")], &["half.rflm", "cut"]),
        (vec![at("foreign.rflm")], &["foreign.rflm", "rfl train"]),
        (vec![at("nowhere.rflm")], &["nowhere.rflm"]),
    ] {
        let error = add_models(&mut shipped::fmus(), &project(), &files).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    }
    // With its sample time it fits, and with its car.
    let mut fmus = shipped::fmus();
    add_start(&mut fmus, "RflMpc.mpc.sample_time=0.04").unwrap();
    add_models(&mut fmus, &project(), &[slow]).unwrap();
    assert_eq!(of(&fmus, "RflMpc").added.start["mpc.sample_time"], "0.04");
    for (text, words) in [
        ("mpc.sample_time=0.04", "write RflMpc.mpc.sample_time=0.04 or TruckRflMpc.mpc.sample_time=0.04"),
        ("Other.mpc.sample_time=0.04", "is for Other, which is not among"),
        ("RflMpc.mpc.q_e9=1", "no parameter `mpc.q_e9`; there are mpc.q_e1, "),
        ("sample_time=0.04", "RflMpc.mpc.sample_time"),
        ("RflMpc.mpc.sample_time", "FMU.PARAMETER=VALUE"),
        ("RflMpc.mpc.sample_time=fast", "a number in"),
        ("RflMpc.steer_cmd=0", "no parameter `steer_cmd`"),
    ] {
        let error = add_start(&mut fmus, text).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let mut fmus = shipped::fmus();
    add_vehicle(&mut fmus, "bmw_320i").unwrap();
    add_models(&mut fmus, &project(), &[bmw]).unwrap();
    assert_eq!(of(&fmus, "PassengerCar").added.start["vehicle_file"], "bmw_320i");
}

#[test]
fn a_car_is_packed_with_its_tyres() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let text = std::fs::read_to_string(project().join("vehicles/bmw_320i.toml")).unwrap();
    std::fs::create_dir(at("tyres")).unwrap();
    std::fs::copy(project().join("vehicles/tyres/commonroad.tir"), at("tyres/mine.tir")).unwrap();
    std::fs::write(at("mine.toml"), text.replace("commonroad.tir", "mine.tir").replace("1093.295", "1200"))
        .unwrap();
    let mut fmus = shipped::fmus();
    add_vehicle(&mut fmus, at("mine.toml").to_str().unwrap()).unwrap();
    for fmu in fmus.iter().filter(|fmu| fmu.vehicle == VehicleKind::Car) {
        assert_eq!(fmu.added.start["vehicle_file"], "car/mine.toml");
        assert_eq!(fmu.added.files.keys().collect::<Vec<_>>(), ["car/mine.toml", "car/tyres/mine.tir"]);
    }
    assert!(of(&fmus, "SemiTrailerTruck").added.start.is_empty(), "a car is nothing to a truck");
    let mine = CarParameters::read(&at("mine.toml")).unwrap();
    let learned = model(folder.path(), "mine.rflm", Kind::Linear, &mine, 0.02);
    add_models(&mut fmus, &project(), &[learned]).unwrap();

    std::fs::create_dir(at("below")).unwrap();
    std::fs::write(at("below/far.toml"), text.replace("tyres/commonroad.tir", "../tyres/mine.tir")).unwrap();
    let error = add_vehicle(&mut fmus, at("below/far.toml").to_str().unwrap()).unwrap_err();
    assert!(matches!(&error, AddError::Tyre { tyre, .. } if tyre == "../tyres/mine.tir"), "{error}");
    assert!(add_vehicle(&mut fmus, "batmobile").unwrap_err().to_string().contains("c_class"));
}

/// The shipped FMUs have no start file: what they declare is what they drive with.
#[test]
fn an_fmu_drives_with_what_it_declares() {
    for fmu in shipped::fmus() {
        let start = fmu.start_values(&fmu.resources_in(&project()).unwrap()).unwrap();
        assert!(start.is_empty(), "{}: {start:?}", fmu.declaration.name);
    }
}

/// With another vehicle, the numbers of its file are the declared ones, but for those of a user's choice.
#[test]
fn the_numbers_of_a_packed_file_are_declared() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let text = std::fs::read_to_string(project().join("vehicles/c_class.toml")).unwrap();
    let text = text.replace("mass = 1400.0 ", "mass = 1800.0 ").replace("tyres/c_class.tir", "c_class.tir");
    std::fs::write(at("mine.toml"), text + "\n[effect]\nsteer_lag = 0.1\n").unwrap();
    std::fs::copy(project().join("vehicles/tyres/c_class.tir"), at("c_class.tir")).unwrap();
    std::fs::write(at("controller.toml"), "kind = 'car'\nvariant = 'none'\n[controller]\nmpc.q_e1 = 3\n")
        .unwrap();
    let mut fmus = shipped::fmus();
    add_vehicle(&mut fmus, &at("mine.toml")).unwrap();
    add_start(&mut fmus, &format!("RflMpc.controller_file={}", at("controller.toml"))).unwrap();
    let start = |fmus: &[Fmu], name: &str| {
        let fmu = of(fmus, name);
        fmu.start_values(&fmu.resources_in(&project()).unwrap()).unwrap()
    };
    let (car, controller) = (start(&fmus, "PassengerCar"), start(&fmus, "RflMpc"));
    assert_eq!((&*car.from_files["vehicle.mass"], &*car.from_files["effect.steer_lag"]), ("1800", "0.1"));
    assert_eq!(controller.from_files["vehicle.mass"], "1800");
    assert_eq!((&*controller.from_files["mpc.q_e1"], &*controller.from_files["variant"]), ("3", "none"));
    assert_eq!(
        car.chosen.into_iter().collect::<Vec<_>>(),
        [("vehicle_file".to_owned(), "car/mine.toml".to_owned())]
    );

    // A choice is one, also of the library's own start value.
    for chosen in
        ["PassengerCar.vehicle.mass=1400", "PassengerCar.effect.steer_lag=0", "RflMpc.variant=adaptive"]
    {
        add_start(&mut fmus, chosen).unwrap();
    }
    let (car, controller) = (start(&fmus, "PassengerCar"), start(&fmus, "RflMpc"));
    assert_eq!((&*car.chosen["vehicle.mass"], &*car.chosen["effect.steer_lag"]), ("1400", "0"));
    assert!(!car.from_files.contains_key("vehicle.mass") && !car.from_files.contains_key("effect.steer_lag"));
    assert!(
        !controller.from_files.contains_key("variant") && controller.from_files.contains_key("vehicle.mass")
    );
}

/// A start value that names a file brings the file with it, by its name in the resources.
#[test]
fn a_file_that_a_start_value_names_is_packed() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::copy(project().join("paths/hairpin_circuit.csv"), at("my road.csv")).unwrap();
    std::fs::write(at("controller.toml"), "kind = 'car'\n[controller]\nmpc.q_e1 = 3\n").unwrap();
    std::fs::copy(project().join("vehicles/bmw_320i.toml"), at("mine.toml")).unwrap();
    std::fs::create_dir(at("tyres")).unwrap();
    std::fs::copy(project().join("vehicles/tyres/commonroad.tir"), at("tyres/commonroad.tir")).unwrap();
    model(folder.path(), "learned.rflm", Kind::Linear, &builtin("bmw_320i").unwrap(), 0.02);
    let mut fmus = shipped::fmus();
    for (parameter, file, name) in [
        ("RflMpc.path_file", "my road.csv", "roads/my road.csv"),
        ("PassengerCar.road_file", "my road.csv", "roads/my road.csv"),
        ("RflMpc.vehicle_file", "mine.toml", "car/mine.toml"),
        ("RflMpc.residual.file", "learned.rflm", "models/learned.rflm"),
        ("RflMpc.controller_file", "controller.toml", "controllers/controller.toml"),
    ] {
        add_start(&mut fmus, &format!("{parameter}={}", at(file))).unwrap();
        let (fmu, parameter) = parameter.split_once('.').unwrap();
        let added = &of(&fmus, fmu).added;
        assert_eq!(added.start[parameter], name);
        assert_eq!(added.files[name], Path::new(&at(file)));
    }
    assert!(of(&fmus, "RflMpc").added.files.contains_key("car/tyres/commonroad.tir"));
    try_added(&fmus, &project()).unwrap();
    let controller = of(&fmus, "RflMpc");
    let start = controller.start_values(&controller.resources_in(&project()).unwrap()).unwrap();
    assert_eq!((&*start.from_files["variant"], &*start.from_files["mpc.q_e1"]), ("linear", "3"));
    // What is in the FMU stays a name, and so does a built-in vehicle.
    for text in [
        "RflMpc.path_file=path.csv",
        "RflMpc.vehicle_file=vehicles/genesis.toml",
        "RflMpc.vehicle_file=genesis",
    ] {
        let mut fmus = shipped::fmus();
        add_start(&mut fmus, text).unwrap();
        assert!(of(&fmus, "RflMpc").added.files.is_empty());
        try_added(&fmus, &project()).unwrap();
    }
    // What is no such file is refused, by its own name.
    for (parameter, file) in [
        ("PassengerCar.road_file", "none.csv"),
        ("PassengerCar.road_file", "mine.toml"),
        ("PassengerCar.vehicle_file", "none.toml"),
        ("PassengerCar.vehicle_file", "controller.toml"),
        ("SemiTrailerTruck.vehicle_file", "mine.toml"),
        ("RflMpc.path_file", "none.csv"),
        ("RflMpc.path_file", "controller.toml"),
        ("RflMpc.residual.file", "my road.csv"),
        ("RflMpc.controller_file", "none.toml"),
    ] {
        let error = add_start(&mut shipped::fmus(), &format!("{parameter}={}", at(file))).unwrap_err();
        assert!(error.to_string().contains(&at(file)), "{parameter} {file}: {error}");
    }
    // What may name no file is empty; what must name one says so.
    for (text, words) in [
        ("RflMpc.residual.file=", None),
        ("RflMpc.controller_file=", None),
        ("PassengerCar.road_file=", None),
        ("RflMpc.path_file=", Some("path_file is empty")),
        ("RflMpc.vehicle_file=", Some("vehicle_file is empty")),
    ] {
        let mut fmus = shipped::fmus();
        add_start(&mut fmus, text).unwrap();
        let error = try_added(&fmus, &project()).err().map(|error| error.to_string());
        assert!(error.as_ref().map(|_| true) == words.map(|_| true), "{text}: {error:?}");
        assert!(words.is_none_or(|words| error.unwrap().contains(words)), "{text}");
    }
    // A name below a folder of the resources that is none of theirs shows when the FMU is tried.
    let mut fmus = shipped::fmus();
    add_start(&mut fmus, "PassengerCar.vehicle_file=vehicles/none.toml").unwrap();
    let error = try_added(&fmus, &project()).unwrap_err().to_string();
    assert!(error.contains("PassengerCar cannot start") && error.contains("vehicles/none.toml"), "{error}");
}

/// A system has no texts: what they name goes into the FMUs.
#[test]
fn texts_of_a_system_s_settings_go_into_its_fmus() {
    let road = project().join("paths/hairpin_circuit.csv");
    let settings = [
        format!("RflMpc.path_file={}", road.display()),
        "RflMpc.mpc.q_e1=2".to_owned(),
        "PassengerCar.vehicle_file = genesis".to_owned(),
    ];
    let mut fmus = shipped::fmus();
    assert_eq!(add_settings(&mut fmus, &settings).unwrap(), ["RflMpc.mpc.q_e1=2"]);
    assert_eq!(of(&fmus, "RflMpc").added.start["path_file"], "roads/hairpin_circuit.csv");
    assert_eq!(of(&fmus, "PassengerCar").added.start["vehicle_file"], "genesis");
    let error = add_settings(&mut fmus[..1], &settings).unwrap_err().to_string();
    let wanted = ["RflMpc.path_file", "PassengerCar and RflMpc", "--start"];
    assert!(wanted.iter().all(|words| error.contains(words)), "{error}");
    assert!(add_settings(&mut fmus, &["RflMpc.path_file=none.csv".to_owned()]).is_err());
}

#[test]
fn a_truck_is_packed_into_the_trucks_fmus_only() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    std::fs::copy(project().join("vehicles/truck_real.toml"), &file).unwrap();
    let mut fmus = shipped::fmus();
    add_vehicle(&mut fmus, file.to_str().unwrap()).unwrap();
    add_vehicle(&mut fmus, "bmw_320i").unwrap();
    assert_eq!(of(&fmus, "TruckRflMpc").added.start["vehicle_file"], "truck/mine.toml");
    // Its tyre is a built-in one.
    assert_eq!(of(&fmus, "SemiTrailerTruck").added.files.keys().collect::<Vec<_>>(), ["truck/mine.toml"]);
    assert_eq!(of(&fmus, "SemiTrailerTruck").added.start["vehicle_file"], "truck/mine.toml");
    assert_eq!(of(&fmus, "PassengerCar").added.start["vehicle_file"], "bmw_320i");
    add_vehicle(&mut fmus, "truck_real").unwrap();
    assert_eq!(of(&fmus, "SemiTrailerTruck").added.start["vehicle_file"], "truck_real");
}

#[test]
fn models_go_into_the_controller_that_they_are_for() {
    let folder = tempfile::tempdir().unwrap();
    let car = model(folder.path(), "car.rflm", Kind::Linear, &builtin("c_class").unwrap(), 0.02);
    let truck = |name: &str, vehicle: &str, kind| {
        let vehicle = builtin_truck(vehicle).unwrap().articulated();
        model_of(folder.path(), name, kind, &vehicle, 0.02)
    };
    let files = [truck("truck.rflm", "truck_simulation", Kind::Rfl), car];
    let mut fmus = shipped::fmus();
    let packed = add_models(&mut fmus, &project(), &files).unwrap();
    assert_eq!(packed, [("TruckRflMpc", ControlVariant::Rfl), ("RflMpc", ControlVariant::Linear)]);
    assert_eq!(of(&fmus, "TruckRflMpc").added.files["residual/rfl.rflm"], files[0]);
    assert_eq!(of(&fmus, "TruckRflMpc").added.start["variant"], "rfl");
    assert_eq!(of(&fmus, "RflMpc").added.files["residual/linear.rflm"], files[1]);

    let real = [truck("real.rflm", "truck_real", Kind::Linear)];
    let error = add_models(&mut shipped::fmus(), &project(), &real).unwrap_err().to_string();
    assert!(
        ["real.rflm", "truck_simulation", "--vehicle"].iter().all(|word| error.contains(word)),
        "{error}"
    );
    let mut fmus = shipped::fmus();
    add_vehicle(&mut fmus, "truck_real").unwrap();
    add_models(&mut fmus, &project(), &real).unwrap();
    assert_eq!(of(&fmus, "TruckRflMpc").added.start["vehicle_file"], "truck_real");
}
