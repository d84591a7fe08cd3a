//! The system: every signal that controller and car share is connected, settings are typed, and what hosts read
//! stands where they read it.

use fmu_build::shipped;
use fmu_build::system::{SettingError, System};
use rfl_mpc::fmi::{Causality, Value};
use rfl_mpc::path::Path;
use std::collections::BTreeSet;

fn closed_loop() -> System {
    System::new(shipped::SYSTEM, shipped::components())
}

/// Whatever the controller measures comes from the car, whatever the car is told comes from the controller.
#[test]
fn every_input_is_connected() {
    let system = closed_loop();
    let found: BTreeSet<String> = system
        .connections()
        .iter()
        .map(|connection| {
            assert_eq!(connection.output.name, connection.input.name);
            assert_eq!(connection.output.kind, connection.input.kind, "{}", connection.input.name);
            connection.input.name.to_string()
        })
        .collect();
    for declaration in shipped::components() {
        for input in declaration.variables.iter().filter(|variable| variable.causality == Causality::Input) {
            // Wind and the like are the user's.
            let command = ["steer_cmd", "accel_cmd"].contains(&&*input.name);
            let measured = declaration.name == "RflMpc";
            assert!(
                !(command || measured) || found.contains(&*input.name),
                "{} is not connected",
                input.name
            );
        }
    }
    for wanted in ["x", "y", "yaw", "vx", "vy", "yaw_rate", "steer", "steer_cmd", "accel_cmd"] {
        assert!(found.contains(wanted), "{wanted} is not connected: {found:?}");
    }
}

#[test]
fn the_structure_names_fmus_and_step() {
    let xml = closed_loop().structure();
    for wanted in [
        r#"source="resources/PassengerCar.fmu""#,
        r#"source="resources/RflMpc.fmu""#,
        r#"<ssd:Connection startElement="PassengerCar" startConnector="vx" endElement="RflMpc" endConnector="vx"/>"#,
        r#"<osp:FixedStepAlgorithm baseStepSize="#,
    ] {
        assert!(xml.contains(wanted), "{wanted} is missing in\n{xml}");
    }
    assert!(xml.find("\"PassengerCar\"") < xml.find("\"RflMpc\""), "the plant is stepped first");
    assert!(!xml.contains("ParameterBinding"));
    assert_eq!(closed_loop().parameters(), None);
}

#[test]
fn settings_stand_in_the_component_and_in_a_parameter_set() {
    let mut system = closed_loop();
    system.set("PassengerCar.vehicle_file=vehicles/<a&b>.toml").unwrap();
    system.set("RflMpc.mpc.q_e1 = 2.5").unwrap();
    let (structure, parameters) = (system.structure(), system.parameters().unwrap());
    assert!(structure.contains(r#"<ssv:Parameter name="vehicle_file">"#), "{structure}");
    // Ecos takes the sets of all components by one name.
    assert_eq!(structure.matches(r#"version="1.0" name="ClosedLoop">"#).count(), 2, "{structure}");
    assert!(structure.contains(r#"<ssv:String value="vehicles/&lt;a&amp;b&gt;.toml"/>"#), "{structure}");
    assert!(parameters.contains(r#"<ssv:Parameter name="PassengerCar.vehicle_file">"#), "{parameters}");
    assert!(parameters.contains(r#"<ssv:Parameter name="RflMpc.mpc.q_e1">"#), "{parameters}");
    assert!(parameters.contains(r#"<ssv:Real value="2.5"/>"#), "{parameters}");
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

/// The car starts on the controller's path, at its speed, unless the user places it.
#[test]
fn the_car_starts_on_the_path() {
    let project = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let begin = |settings: &[&str]| {
        let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
        let system = shipped::closed_loop(&project, &settings).unwrap();
        ["initial.x", "initial.y", "initial.yaw", "initial.vx"].map(|name| {
            let (_, value) = system.settings_of("PassengerCar").find(|(set, _)| *set == name).unwrap();
            let Value::Real(value) = value else { panic!("{value:?}") };
            *value
        })
    };
    for file in ["paths/sudoku_test.csv", "paths/hairpin_circuit.csv"] {
        let path = Path::read(&project.join(file)).unwrap();
        let at = path.at(0.0);
        let [x, y, yaw, vx] = begin(&[&format!("RflMpc.path_file={file}")]);
        assert_eq!((x, y, yaw), (at.x, at.y, at.yaw));
        assert!(vx > 1.0, "{vx}");
    }
    let sudoku = Path::read(&project.join("paths/sudoku_test.csv")).unwrap().at(0.0);
    let [x, y, _, vx] = begin(&["PassengerCar.initial.vx=3", "PassengerCar.initial.y=7"]);
    assert_eq!((x, y, vx), (sudoku.x, 7.0, 3.0));

    let settings = ["RflMpc.path_file=no/such/road.csv".to_owned()];
    let error = shipped::closed_loop(&project, &settings).unwrap_err().to_string();
    assert!(error.contains("no/such/road.csv"), "{error}");
}
