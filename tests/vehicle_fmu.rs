//! The car as the FMI layer sees it.

use rfl_mpc::fmi::{Context, Kind, Log, Model, ModelError, Severity, Value, Values};
use rfl_mpc::fmu::PassengerCar;
use rfl_mpc::signal;
use rfl_mpc::vehicle::{BUILTIN, Car, CarInput, CarParameters, CarStatus, Effects, builtin};

#[derive(Default)]
struct Messages(Vec<String>);

impl Log for Messages {
    fn log(&mut self, _: Severity, category: &'static str, message: &str) {
        self.0.push(format!("{category}: {message}"));
    }
}

struct Instance {
    model: PassengerCar,
    values: Values,
    messages: Messages,
    time: f64,
}

impl Instance {
    fn new() -> Self {
        let values = Values::starting_from(&PassengerCar::declaration().variables);
        Self { model: PassengerCar::new(), values, messages: Messages::default(), time: 0.0 }
    }

    fn set(&mut self, name: &str, value: Value) {
        let vr = PassengerCar::declaration().find(name).unwrap_or_else(|| panic!("no variable {name}"));
        self.values.set_by_host(vr, value);
    }

    fn real(&self, name: &str) -> f64 {
        self.values.real(PassengerCar::declaration().find(name).unwrap())
    }

    fn initialize(&mut self) -> Result<(), ModelError> {
        self.model.initialize(&mut self.values, 0.0, &Context::default(), &mut self.messages)
    }

    fn step(&mut self, steer: f64, accel: f64, step: f64) -> Result<(), ModelError> {
        self.set("steer_cmd", Value::Real(steer));
        self.set("accel_cmd", Value::Real(accel));
        self.model.step(&mut self.values, self.time, step, &mut self.messages)?;
        self.time += step;
        Ok(())
    }
}

#[test]
fn it_declares_the_signals_all_parameters_and_all_effects() {
    let declaration = PassengerCar::declaration();
    for signal in [
        &signal::STEER_CMD,
        &signal::ACCEL_CMD,
        &signal::X,
        &signal::Y,
        &signal::YAW,
        &signal::VX,
        &signal::VY,
        &signal::YAW_RATE,
        &signal::AX,
        &signal::AY,
        &signal::STEER,
        &signal::ROLL,
    ] {
        let variable = &declaration.variables[declaration.find(signal.name).unwrap()];
        assert!(matches!(variable.kind, Kind::Real { unit, .. } if unit == signal.unit), "{}", signal.name);
    }
    for parameter in CarParameters::TABLE {
        assert!(declaration.find(parameter.name).is_some(), "{}", parameter.name);
    }
    for effect in Effects::ALL {
        let variable = &declaration.variables[declaration.find(&format!("effect.{}", effect.id)).unwrap()];
        let neutral = matches!(variable.kind, Kind::Real { start, .. } if start == effect.neutral);
        assert!(neutral, "{} is not neutral at the start", effect.id);
    }
    let vehicle = &declaration.variables[declaration.find("vehicle_file").unwrap()];
    for name in BUILTIN {
        assert!(vehicle.description.contains(name), "{name} is not offered: {}", vehicle.description);
    }
    let status = &declaration.variables[declaration.find("status").unwrap()];
    let Kind::Enumeration { items, .. } = &status.kind else { panic!("an enumeration") };
    assert_eq!(*items, CarStatus::ITEMS);
    for name in &declaration.variables {
        let same = declaration.variables.iter().filter(|other| other.name == name.name).count();
        assert_eq!(same, 1, "{}", name.name);
    }
}

#[test]
fn it_is_the_native_car_bit_for_bit() {
    let mut instance = Instance::new();
    instance.set("vehicle_file", Value::String("bmw_320i".to_string()));
    instance.set("initial.vx", Value::Real(15.0));
    instance.set("initial.yaw", Value::Real(0.3));
    instance.set("effect.steer_delay", Value::Real(0.05));
    instance.initialize().unwrap();
    let effects = Effects { steer_delay: 0.05, ..Effects::default() };
    let mut car = Car::new(&builtin("bmw_320i").unwrap(), &effects, None).unwrap();
    car.place(0.0, 0.0, 0.3, 15.0);
    assert_eq!(instance.real("vehicle.mass"), builtin("bmw_320i").unwrap().vehicle.mass);
    for k in 0..200 {
        let (steer, accel) = (0.04 * (0.03 * f64::from(k)).sin(), 0.5);
        instance.step(steer, accel, 0.01).unwrap();
        car.step(&CarInput { steer_cmd: steer, accel_cmd: accel }, 0.01).unwrap();
        let out = car.output();
        for (name, value) in [("x", out.x), ("yaw_rate", out.yaw_rate), ("ay", out.ay), ("steer", out.steer)]
        {
            assert_eq!(instance.real(name), value, "{name}");
        }
        assert_eq!(instance.real("wheel.rear_right.load"), out.wheels[3].load);
    }
}

#[test]
fn effects_of_the_vehicle_file_are_in_effect_unless_the_host_sets_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("calibrated.toml");
    let given = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles/c_class.toml");
    let text =
        std::fs::read_to_string(given).unwrap() + "\n[effect]\nsteer_delay = 0.12\nroad_friction = 0.6\n";
    std::fs::write(&file, text).unwrap();
    let mut instance = Instance::new();
    instance.set("vehicle_file", Value::String(file.to_str().unwrap().to_string()));
    instance.set("effect.road_friction", Value::Real(1.0));
    instance.initialize().unwrap();
    let of = |name: &str| instance.real(&format!("effect.{name}"));
    assert_eq!((of("steer_delay"), of("road_friction"), of("wind_x")), (0.12, 1.0, 0.0));
    instance.step(0.05, 0.0, 0.1).unwrap();
    assert_eq!(instance.real("steer"), 0.0, "the command is on its way");
}

#[test]
fn what_the_host_sets_wins_over_the_file_and_the_rest_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let text = include_str!("../vehicles/genesis.toml").replace("mass = 2303.1", "mass = 2000.0");
    std::fs::write(&file, text).unwrap();
    let mut instance = Instance::new();
    instance.set("vehicle_file", Value::String(file.display().to_string()));
    instance.set("vehicle.yaw_inertia", Value::Real(5000.0));
    instance.initialize().unwrap();
    assert_eq!(instance.real("vehicle.mass"), 2000.0);
    assert_eq!(instance.real("vehicle.yaw_inertia"), 5000.0);
    assert_eq!(instance.real("steering.lag"), 0.1);
    assert!(instance.messages.0.iter().any(|message| message.contains("Hyundai Genesis")));
    // Initialised again after a reset with another car: values of the file do not stay.
    let mut again = Instance { values: Instance::new().values, ..instance };
    again.initialize().unwrap();
    assert_eq!(again.real("vehicle.mass"), 1400.0);
}

#[test]
fn files_that_cannot_be_used_are_named() {
    for (parameter, name) in [("vehicle_file", "no_such.toml"), ("road_file", "no_such.csv")] {
        let mut instance = Instance::new();
        instance.set(parameter, Value::String(name.to_string()));
        let message = instance.initialize().unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
        assert!(instance.step(0.0, 0.0, 0.01).is_err(), "it is not initialised");
    }
    let mut instance = Instance::new();
    instance.set("effect.payload", Value::Real(9000.0));
    instance.set("effect.payload_x", Value::Real(-5.0));
    let message = instance.initialize().unwrap_err().to_string();
    assert!(message.contains("effect.payload"), "{message}");
}

#[test]
fn states_restore_and_foreign_ones_are_refused() {
    let mut instance = Instance::new();
    instance.set("effect.sensor_delay", Value::Real(0.1));
    instance.initialize().unwrap();
    for k in 0..100 {
        instance.step(0.01 * f64::from(k % 7), 2.0, 0.01).unwrap();
    }
    let mut bytes = Vec::new();
    instance.model.save(&mut bytes);
    let values = instance.values.clone();
    let drive = |instance: &mut Instance| -> Vec<f64> {
        (0..50)
            .map(|k| {
                instance.step(0.02, f64::from(k % 3), 0.013).unwrap();
                instance.real("y") + instance.real("yaw_rate")
            })
            .collect()
    };
    let first = drive(&mut instance);
    instance.model.restore(&bytes).unwrap();
    instance.values = values;
    assert_eq!(drive(&mut instance), first);
    for wrong in [&[][..], &[77], &bytes[..bytes.len() - 3]] {
        assert!(instance.model.restore(wrong).is_err());
    }
    assert!(matches!(instance.step(f64::NAN, 0.0, 0.01), Err(ModelError::Discard(_))));
    instance.step(0.0, 0.0, 0.01).unwrap();
}

#[test]
fn the_status_says_what_the_car_does() {
    let mut instance = Instance::new();
    instance.initialize().unwrap();
    let status = |instance: &Instance| {
        CarStatus::ALL[instance.values.integer(PassengerCar::declaration().find("status").unwrap()) as usize]
    };
    assert_eq!(status(&instance), CarStatus::Standstill);
    for _ in 0..300 {
        instance.step(0.0, 3.0, 0.01).unwrap();
    }
    assert_eq!(status(&instance), CarStatus::Driving);
    instance.step(0.7, 0.0, 0.01).unwrap();
    assert_eq!(status(&instance), CarStatus::SteeringLimited);
    assert!(instance.messages.0.iter().any(|message| message.contains("steering_limited")));
}
