//! The truck as the FMI layer sees it.

use rfl_mpc::fmi::{Context, Kind, Log, Model, ModelError, Severity, Value, Values};
use rfl_mpc::fmu::SemiTrailerTruck;
use rfl_mpc::signal;
use rfl_mpc::vehicle::{
    BUILTIN_TRUCKS, Truck, TruckEffects, TruckInput, TruckParameters, TruckStatus, builtin_truck,
};

#[derive(Default)]
struct Messages(Vec<String>);

impl Log for Messages {
    fn log(&mut self, _: Severity, category: &'static str, message: &str) {
        self.0.push(format!("{category}: {message}"));
    }
}

struct Instance {
    model: SemiTrailerTruck,
    values: Values,
    messages: Messages,
    time: f64,
}

impl Instance {
    fn new() -> Self {
        let values = Values::starting_from(&SemiTrailerTruck::declaration().variables);
        Self { model: SemiTrailerTruck::new(), values, messages: Messages::default(), time: 0.0 }
    }

    fn set(&mut self, name: &str, value: Value) {
        let vr = SemiTrailerTruck::declaration().find(name).unwrap_or_else(|| panic!("no variable {name}"));
        self.values.set_by_host(vr, value);
    }

    fn real(&self, name: &str) -> f64 {
        self.values.real(SemiTrailerTruck::declaration().find(name).unwrap())
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
    let declaration = SemiTrailerTruck::declaration();
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
        &signal::ARTICULATION,
        &signal::ARTICULATION_RATE,
    ] {
        let variable = &declaration.variables[declaration.find(signal.name).unwrap()];
        assert!(matches!(variable.kind, Kind::Real { unit, .. } if unit == signal.unit), "{}", signal.name);
    }
    for parameter in TruckParameters::TABLE {
        assert!(declaration.find(parameter.name).is_some(), "{}", parameter.name);
    }
    for effect in TruckEffects::all() {
        let variable = &declaration.variables[declaration.find(&format!("effect.{}", effect.id)).unwrap()];
        let neutral = matches!(variable.kind, Kind::Real { start, .. } if start == effect.neutral);
        assert!(neutral, "{} is not neutral at the start", effect.id);
    }
    let vehicle = &declaration.variables[declaration.find("vehicle_file").unwrap()];
    for name in BUILTIN_TRUCKS {
        assert!(vehicle.description.contains(name), "{name} is not offered: {}", vehicle.description);
    }
    let status = &declaration.variables[declaration.find("status").unwrap()];
    let Kind::Enumeration { items, .. } = &status.kind else { panic!("an enumeration") };
    assert_eq!(*items, TruckStatus::ITEMS);
    for name in
        ["trailer.x", "trailer.y", "trailer.yaw", "wheel.trailer_left.load", "wheel.trailer_right.slip"]
    {
        assert!(declaration.find(name).is_some(), "{name}");
    }
    for name in &declaration.variables {
        let same = declaration.variables.iter().filter(|other| other.name == name.name).count();
        assert_eq!(same, 1, "{}", name.name);
    }
}

#[test]
fn it_is_the_native_truck_bit_for_bit() {
    let mut instance = Instance::new();
    instance.set("vehicle_file", Value::String("truck_real".to_string()));
    instance.set("initial.vx", Value::Real(15.0));
    instance.set("initial.yaw", Value::Real(0.3));
    instance.set("effect.steer_delay", Value::Real(0.3));
    instance.set("effect.articulation_bias", Value::Real(0.01));
    instance.initialize().unwrap();
    let mut effects = TruckEffects::default();
    (effects.vehicle.steer_delay, effects.trailer.articulation_bias) = (0.3, 0.01);
    let mut truck = Truck::new(&builtin_truck("truck_real").unwrap(), &effects, None).unwrap();
    truck.place(0.0, 0.0, 0.3, 15.0);
    assert_eq!(instance.real("trailer.mass"), builtin_truck("truck_real").unwrap().trailer.mass);
    for k in 0..200 {
        let (steer, accel) = (0.04 * (0.03 * f64::from(k)).sin(), 0.5);
        instance.step(steer, accel, 0.01).unwrap();
        truck.step(&TruckInput { steer_cmd: steer, accel_cmd: accel }, 0.01).unwrap();
        let out = truck.output();
        for (name, value) in [
            ("x", out.x),
            ("yaw_rate", out.yaw_rate),
            ("ay", out.ay),
            ("steer", out.steer),
            ("articulation", out.articulation),
            ("articulation_rate", out.articulation_rate),
            ("trailer.yaw", out.trailer.yaw),
            ("hitch.load", out.hitch[2]),
            ("wheel.trailer_right.load", out.wheels[5].load),
        ] {
            assert_eq!(instance.real(name), value, "{name}");
        }
    }
}

#[test]
fn what_the_host_sets_wins_over_the_file_and_the_rest_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let text = include_str!("../vehicles/truck_real.toml").replace("mass = 8000.0", "mass = 9000.0");
    std::fs::write(&file, text).unwrap();
    let mut instance = Instance::new();
    instance.set("vehicle_file", Value::String(file.display().to_string()));
    instance.set("tractor.yaw_inertia", Value::Real(25000.0));
    instance.initialize().unwrap();
    assert_eq!(instance.real("trailer.mass"), 9000.0);
    assert_eq!(instance.real("tractor.yaw_inertia"), 25000.0);
    assert_eq!(instance.real("hitch.friction"), 1000.0);
    assert!(instance.messages.0.iter().any(|message| message.contains("tractor and semi-trailer, real")));
    // Initialised again after a reset with another truck: values of the file do not stay.
    let mut again = Instance { values: Instance::new().values, ..instance };
    again.initialize().unwrap();
    assert_eq!(again.real("trailer.mass"), 10000.0);
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
    instance.set("effect.payload", Value::Real(15000.0));
    instance.set("effect.payload_x", Value::Real(-6.0));
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
fn the_status_says_what_the_truck_does() {
    let mut instance = Instance::new();
    instance.initialize().unwrap();
    let status = |instance: &Instance| {
        TruckStatus::ALL
            [instance.values.integer(SemiTrailerTruck::declaration().find("status").unwrap()) as usize]
    };
    assert_eq!(status(&instance), TruckStatus::Standstill);
    for _ in 0..300 {
        instance.step(0.0, 1.0, 0.01).unwrap();
    }
    assert_eq!(status(&instance), TruckStatus::Driving);
    instance.step(0.8, 0.0, 0.01).unwrap();
    assert_eq!(status(&instance), TruckStatus::SteeringLimited);
    assert!(instance.messages.0.iter().any(|message| message.contains("steering_limited")));
}

#[test]
fn a_jack_knife_ends_the_instance_with_a_message() {
    let mut instance = Instance::new();
    instance.set("initial.vx", Value::Real(22.0));
    instance.set("brake.front_share", Value::Real(0.0));
    instance.set("brake.trailer_share", Value::Real(0.0));
    instance.set("effect.road_friction", Value::Real(0.35));
    instance.initialize().unwrap();
    let error = (0..3000).find_map(|k| instance.step(0.08, if k < 50 { 0.0 } else { -5.0 }, 0.01).err());
    let Some(ModelError::Failed(message)) = error else { panic!("it jack-knifes: {error:?}") };
    assert!(message.contains("jack-knifed") && message.contains("hitch.articulation_limit"), "{message}");
    assert!(instance.messages.0.iter().any(|message| message.contains("jack_knifing")));
}
