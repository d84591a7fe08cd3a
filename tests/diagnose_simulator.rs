//! The calibrated simulator: a vehicle file that is read again, and parameter sets.

use crate::diagnosed::diagnosed;
use quick_xml::events::Event;
use rfl_mpc::diagnose::simulator::{
    CalibratedError, CalibrationExtent, calibrated, changes, differences, parameter_set, write_vehicle,
};
use rfl_mpc::vehicle::{CarParameters, Effects, TruckParameters, VehicleParameters, builtin, builtin_truck};
use std::collections::BTreeMap;

#[test]
fn the_file_holds_what_was_found_and_is_read_again() {
    let (_, diagnosis) = diagnosed();
    let given = builtin("c_class").unwrap();
    let effect = calibrated(&given, &changes(&diagnosis.report, CalibrationExtent::Effect)).unwrap();
    assert_eq!(effect.effect, Effects { steer_delay: 0.118, ..Effects::default() });
    assert_eq!(effect.vehicle, given.vehicle);
    let whole = calibrated(&given, &changes(&diagnosis.report, CalibrationExtent::Whole)).unwrap();
    assert_eq!(
        (whole.vehicle.mass, whole.effect.steer_delay, whole.effect.yaw_rate_bias),
        (1432.0, 0.118, 0.003)
    );
    // Quicker than the file's actuator: the file's lag becomes shorter.
    assert_eq!(whole.effect.steer_lag, 0.0);
    assert!((whole.steering.lag - (given.steering.lag - 0.004).max(0.0)).abs() < 1e-12);

    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("calibrated.toml");
    write_vehicle(&whole, None, "two\nlines", &file).unwrap();
    assert_eq!(CarParameters::read(&file).unwrap(), whole);
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(
        text.starts_with("# two\n# lines\n") && text.contains("[effect]") && !text.contains("wind_x"),
        "{text}"
    );
}

#[test]
fn a_payload_is_put_where_it_was_found() {
    let (_, mut diagnosis) = diagnosed();
    let components = BTreeMap::from([("payload".to_owned(), 300.0), ("payload_x".to_owned(), -0.8)]);
    let found = &mut diagnosis.report.verdict.effects[0];
    (found.id, found.total, found.components) = ("payload".to_owned(), 300.0, components);
    for calibration in [CalibrationExtent::Effect, CalibrationExtent::Whole] {
        let vehicle =
            calibrated(&builtin("c_class").unwrap(), &changes(&diagnosis.report, calibration)).unwrap();
        assert_eq!((vehicle.effect.payload, vehicle.effect.payload_x), (300.0, -0.8));
    }
}

#[test]
fn a_truck_has_its_trailers_effects_too() {
    let given = builtin_truck("truck_simulation").unwrap();
    let found =
        BTreeMap::from([("effect.trailer_payload".to_owned(), 4000.0), ("trailer.mass".to_owned(), 8000.0)]);
    let whole = calibrated(&given, &found).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("calibrated.toml");
    write_vehicle(&whole, None, "", &file).unwrap();
    let read = TruckParameters::read(&file).unwrap();
    assert_eq!(read, whole);
    assert_eq!(read.effects().trailer.trailer_payload, 4000.0);
    let wrong = std::fs::read_to_string(&file).unwrap().replace("trailer_payload", "trailer_paylod");
    std::fs::write(&file, wrong).unwrap();
    assert!(TruckParameters::read(&file).unwrap_err().to_string().contains("trailer_paylod"));
}

#[test]
fn tyres_of_the_users_own_go_with_the_file() {
    let (from, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let project = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles");
    std::fs::create_dir(from.path().join("tyres")).unwrap();
    let tyre = std::fs::read_to_string(project.join("tyres/c_class.tir")).unwrap();
    std::fs::write(from.path().join("tyres/mine.tir"), tyre).unwrap();
    let text =
        std::fs::read_to_string(project.join("c_class.toml")).unwrap().replace("c_class.tir", "mine.tir");
    let source = from.path().join("mine.toml");
    std::fs::write(&source, text).unwrap();
    let vehicle = CarParameters::read(&source).unwrap();
    let file = to.path().join("calibrated.toml");
    write_vehicle(&vehicle, Some(&source), "", &file).unwrap();
    assert_eq!(CarParameters::read(&file).unwrap(), vehicle);
}

#[test]
fn effects_out_of_range_are_kept_within_and_unknown_ones_refused() {
    let given = builtin("c_class").unwrap();
    let one = |name: &str, value: f64| calibrated(&given, &BTreeMap::from([(name.to_owned(), value)]));
    assert_eq!(one("effect.road_friction", -3.0).unwrap().effect.road_friction, 0.05);
    assert_eq!(one("sensor.ay_scale", 1.1).unwrap(), given);
    for name in ["effect.trailer_payload", "vehicle.colour", "effect.nonsense"] {
        assert!(matches!(one(name, 1.0), Err(CalibratedError::Unknown { .. })), "{name}");
    }
}

#[test]
fn what_was_found_comes_on_top_of_what_the_file_knows() {
    let mut given = builtin("c_class").unwrap();
    (given.effect.steer_delay, given.effect.steer_gain) = (0.05, 1.1);
    let found =
        BTreeMap::from([("effect.steer_delay".to_owned(), 0.03), ("effect.steer_gain".to_owned(), 1.1)]);
    let whole = calibrated(&given, &found).unwrap();
    assert!(
        (whole.effect.steer_delay - 0.08).abs() < 1e-12 && (whole.effect.steer_gain - 1.21).abs() < 1e-12
    );
    assert_eq!(calibrated(&given, &BTreeMap::new()).unwrap(), given);
}

#[test]
fn a_file_with_an_effect_out_of_range_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let project = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles/c_class.toml");
    let text = std::fs::read_to_string(project).unwrap();
    std::fs::write(&file, text.clone() + "\n[effect]\nsteer_delay = -1.0\n").unwrap();
    let message = CarParameters::read(&file).unwrap_err().to_string();
    assert!(message.contains("effect.steer_delay = -1") && message.contains("mine.toml"), "{message}");
    std::fs::write(&file, text + "\n[effect]\nsteer_dely = 0.1\n").unwrap();
    let message = CarParameters::read(&file).unwrap_err().to_string();
    assert!(message.contains("steer_dely"), "{message}");
}

#[test]
fn the_parameter_set_holds_the_differences() {
    let (_, diagnosis) = diagnosed();
    let given = builtin("c_class").unwrap();
    let whole = calibrated(&given, &changes(&diagnosis.report, CalibrationExtent::Whole)).unwrap();
    let changed = differences(&given, &whole);
    assert_eq!(changed["effect.steer_delay"], 0.118);
    assert!(!changed.contains_key("sensor.ay_scale") && !changed.contains_key("vehicle.yaw_inertia"));
    let text = parameter_set(Some("PassengerCar"), "a<b>.toml", &changed);
    let mut reader = quick_xml::Reader::from_str(&text);
    let (mut names, mut values) = (Vec::new(), 0);
    loop {
        match reader.read_event().unwrap() {
            Event::Eof => break,
            Event::Start(element) if element.name().as_ref() == "ssv:Parameter" => {
                let name = element.try_get_attribute("name").unwrap().unwrap();
                names.push(name.value.to_string());
            }
            Event::Empty(_) => values += 1,
            _ => {}
        }
    }
    assert_eq!(names.len(), changed.len() + 1);
    assert_eq!(values, names.len());
    assert!(
        names.contains(&"PassengerCar.effect.steer_delay".to_owned())
            && names[0] == "PassengerCar.vehicle_file"
    );
    assert!(text.contains("a&lt;b&gt;.toml"));
    assert!(parameter_set(None, "c_class", &changed).contains("name=\"effect.steer_delay\""));
}
