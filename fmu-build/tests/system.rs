//! The systems: every signal that controller and vehicle share is connected, settings are typed, and what hosts read
//! stands where they read it.

use fmu_build::added::{add_settings, add_start};
use fmu_build::shipped::{self, ClosedLoop, SYSTEMS};
use fmu_build::standard::Standard;
use fmu_build::system::{SettingError, System};
use rfl_mpc::fmi::{Causality, Value};
use rfl_mpc::path::Path;
use rfl_mpc::vehicle::VehicleKind;
use std::collections::BTreeSet;

fn closed_loop() -> System {
    system(VehicleKind::Car)
}

fn system(vehicle: VehicleKind) -> System {
    let system = ClosedLoop::of(vehicle);
    System::new(system.name, system.components())
}

/// Whatever the controller measures comes from the vehicle, whatever the vehicle is told comes from the controller.
#[test]
fn every_input_is_connected() {
    for shipped in SYSTEMS {
        let found: BTreeSet<String> = system(shipped.vehicle)
            .connections()
            .iter()
            .map(|connection| {
                assert_eq!(connection.output.name, connection.input.name);
                assert_eq!(connection.output.kind, connection.input.kind, "{}", connection.input.name);
                connection.input.name.to_string()
            })
            .collect();
        let components = shipped.components();
        assert_eq!(
            components.iter().map(|one| one.name).collect::<Vec<_>>(),
            [shipped.plant, shipped.controller]
        );
        for declaration in components {
            let inputs =
                declaration.variables.iter().filter(|variable| variable.causality == Causality::Input);
            for input in inputs {
                // Wind and the like are the user's.
                let command = ["steer_cmd", "accel_cmd"].contains(&&*input.name);
                let measured = declaration.name == shipped.controller;
                let connected = found.contains(&*input.name);
                assert!(!(command || measured) || connected, "{} is not connected", input.name);
            }
        }
        for wanted in ["x", "y", "yaw", "vx", "vy", "yaw_rate", "steer", "steer_cmd", "accel_cmd"] {
            assert!(found.contains(wanted), "{wanted} is not connected: {found:?}");
        }
        let truck = shipped.vehicle == VehicleKind::Truck;
        assert_eq!(found.contains("articulation") && found.contains("articulation_rate"), truck);
    }
}

#[test]
fn the_structure_names_fmus_and_step() {
    let xml = closed_loop().structure(Standard::Fmi2);
    for wanted in [
        r#"source="resources/PassengerCar.fmu""#,
        r#"source="resources/RflMpc.fmu""#,
        r#"<ssd:Connection startElement="PassengerCar" startConnector="vx" endElement="RflMpc" endConnector="vx"/>"#,
        r#"<osp:FixedStepAlgorithm baseStepSize="#,
        r#"<oms:FixedStepMaster description="oms-ma" stepSize="#,
    ] {
        assert!(xml.contains(wanted), "{wanted} is missing in\n{xml}");
    }
    assert!(xml.find("\"PassengerCar\"") < xml.find("\"RflMpc\""), "the plant is stepped first");
    assert!(!xml.contains("ParameterBinding"));
    assert_eq!(closed_loop().parameters(Standard::Fmi2), None);
}

/// Whatever unit a connector names is defined in the system, as the text of SSP 1.0 asks. An enumeration is no connector:
/// libcosim ends at one, and as an integer it would be no SSP.
#[test]
fn units_of_connectors_are_defined_and_enumerations_are_none() {
    let named = |xml: &str, before: &str| -> BTreeSet<String> {
        xml.split(before).skip(1).map(|rest| rest.split('"').next().unwrap().to_owned()).collect()
    };
    for shipped in SYSTEMS {
        for (standard, real) in [(Standard::Fmi2, "Real"), (Standard::Fmi3, "Float64")] {
            let xml = system(shipped.vehicle).structure(standard);
            let used = named(&xml, &format!("<ssc:{real} unit=\""));
            let defined = named(&xml, r#"<ssc:Unit name=""#);
            assert!(used.contains("m/s") && used == defined, "{used:?} {defined:?}");
            assert!(!xml.contains("Enumeration") && !xml.contains(r#"name="status""#));
            assert!(xml.contains(r#"name="finished" kind="output""#));
        }
    }
}

#[test]
fn settings_stand_in_the_component_and_in_a_parameter_set() {
    let mut system = closed_loop();
    system.set("PassengerCar.vehicle_file=vehicles/<a&b>.toml").unwrap();
    system.set("RflMpc.mpc.q_e1 = 2.5").unwrap();
    let (structure, parameters) =
        (system.structure(Standard::Fmi2), system.parameters(Standard::Fmi2).unwrap());
    assert!(structure.contains(r#"<ssv:Parameter name="vehicle_file">"#), "{structure}");
    // Ecos takes the sets of all components by one name.
    assert_eq!(structure.matches(r#"version="1.0" name="ClosedLoop">"#).count(), 2, "{structure}");
    assert!(structure.contains(r#"<ssv:String value="vehicles/&lt;a&amp;b&gt;.toml"/>"#), "{structure}");
    assert!(parameters.contains(r#"<ssv:Parameter name="PassengerCar.vehicle_file">"#), "{parameters}");
    assert!(parameters.contains(r#"<ssv:Parameter name="RflMpc.mpc.q_e1">"#), "{parameters}");
    assert!(parameters.contains(r#"<ssv:Real value="2.5"/>"#), "{parameters}");
}

/// SSP 2.0 has the types of FMI 3.0, and its arrays.
#[test]
fn a_system_of_3_0_has_its_types_and_arrays() {
    let mut system = closed_loop();
    system.set("PassengerCar.vehicle.mass=1500").unwrap();
    system.set("RflMpc.mpc.horizon=20").unwrap();
    let (structure, parameters) =
        (system.structure(Standard::Fmi3), system.parameters(Standard::Fmi3).unwrap());
    for wanted in [
        r#"version="2.0" name="ClosedLoop""#,
        r#"<ssc:Float64 unit="m/s"/>"#,
        "<ssc:Int32/>",
        r#"<ssd:Connector name="wheel.load" kind="output">"#,
        r#"<ssc:Dimension size="4"/>"#,
        r#"<ssv:Float64 value="1500"/>"#,
        r#"<ssv:Int32 value="20"/>"#,
    ] {
        assert!(structure.contains(wanted), "{wanted} is missing in\n{structure}");
    }
    assert!(parameters.contains("version=\"2.0\"") && parameters.contains("ssv:Float64"), "{parameters}");
    let both = structure + &parameters;
    for old in ["ssc:Real", "ssc:Integer", "ssv:Real", "ssv:Integer", "version=\"1.0\" name", "wheel.front"] {
        assert!(!both.contains(old), "{old} in\n{both}");
    }
}

#[test]
fn settings_that_cannot_be_are_refused() {
    let mut system = closed_loop();
    for (text, word) in [
        ("nonsense", "COMPONENT.PARAMETER=VALUE"),
        ("Truck.mass=1", "PassengerCar, RflMpc"),
        ("PassengerCar.no_such=1", "no component"),
        ("PassengerCar.steer=1", "no component"),
        ("PassengerCar.effect.steer_delay=much", "a number in"),
        ("PassengerCar.effect.steer_delay=NaN", "a number in"),
        ("PassengerCar.effect.steer_delay=-1", "a number in"),
    ] {
        let error: SettingError = system.set(text).unwrap_err();
        assert!(error.to_string().contains(word), "{text}: {error}");
    }
}

/// A vehicle starts on its controller's path, at its speed, unless the user places it.
#[test]
fn vehicles_start_on_the_path() {
    let project = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let begin = |vehicle: VehicleKind, settings: &[&str]| {
        let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
        let mut fmus = shipped::fmus();
        let settings = add_settings(&mut fmus, &settings).unwrap();
        let systems = shipped::systems(&fmus, &project, &settings).unwrap();
        let shipped = ClosedLoop::of(vehicle);
        let system = systems.iter().find(|system| system.name() == shipped.name).unwrap();
        ["initial.x", "initial.y", "initial.yaw", "initial.vx"].map(|name| {
            let (_, value) = system.settings_of(shipped.plant).find(|(set, _)| *set == name).unwrap();
            let Value::Real(value) = value else { panic!("{value:?}") };
            *value
        })
    };
    let at = |file: &str| Path::read(&project.join(file)).unwrap().at(0.0);
    for (vehicle, file) in [
        (VehicleKind::Car, "paths/sudoku_test.csv"),
        (VehicleKind::Car, "paths/hairpin_circuit.csv"),
        (VehicleKind::Truck, "paths/truck_off_road.csv"),
        (VehicleKind::Truck, "paths/sudoku_test.csv"),
    ] {
        let controller = ClosedLoop::of(vehicle).controller;
        let named = format!("{controller}.path_file={}", project.join(file).display());
        let [x, y, yaw, vx] = begin(vehicle, &[&named]);
        assert_eq!((x, y, yaw), (at(file).x, at(file).y, at(file).yaw));
        assert!(vx > 1.0, "{vx}");
    }
    let [x, y, _, vx] = begin(VehicleKind::Car, &["PassengerCar.initial.vx=3", "PassengerCar.initial.y=7"]);
    assert_eq!((x, y, vx), (at("paths/sudoku_test.csv").x, 7.0, 3.0));
    // What is set for one system is nothing to the other.
    let [x, y, ..] = begin(VehicleKind::Truck, &["PassengerCar.initial.y=7", "RflMpc.mpc.horizon=5"]);
    assert_eq!((x, y), (at("paths/truck_off_road.csv").x, at("paths/truck_off_road.csv").y));

    // A road that is packed into the controller counts, too, and so does a start that is packed into the vehicle.
    let mut fmus = shipped::fmus();
    let road = project.join("paths/hairpin_circuit.csv");
    add_start(&mut fmus, &format!("RflMpc.path_file={}", road.display())).unwrap();
    add_start(&mut fmus, "PassengerCar.initial.vx=3").unwrap();
    let systems = shipped::systems(&fmus, &project, &[]).unwrap();
    let values: Vec<_> = systems[0].settings_of("PassengerCar").collect();
    let x = Value::Real(at("paths/hairpin_circuit.csv").x);
    assert!(values.contains(&("initial.x", &x)) && values.iter().all(|(name, _)| *name != "initial.vx"));
    // No system without both of its FMUs.
    assert_eq!(shipped::systems(&fmus[..1], &project, &[]).unwrap().len(), 0);
    let error =
        shipped::systems(&fmus[..2], &project, &["TruckRflMpc.mpc.horizon=9".to_owned()]).unwrap_err();
    assert!(error.to_string().contains("components: PassengerCar, RflMpc"), "{error}");

    for (setting, words) in [
        ("RflMpc.path_file=no/such/road.csv", &["no/such/road.csv"][..]),
        ("TruckRflMpc.path_file=no/such/road.csv", &["no/such/road.csv"]),
        ("Truck.mass=1", &["Truck.mass", "PassengerCar", "TruckRflMpc"]),
        ("SemiTrailerTruck.no_such=1", &["SemiTrailerTruck.no_such"]),
        ("nonsense", &["COMPONENT.PARAMETER=VALUE"]),
    ] {
        let error =
            shipped::systems(&shipped::fmus(), &project, &[setting.to_owned()]).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    }
}
