//! Cars and trucks as the FMI layer sees them.

use rfl_mpc::fmi::{Causality, Context, Log, Model, ModelError, Severity, Value, Values, VariableKind};
use rfl_mpc::fmu::{PlantFmu, PlantUnit};
use rfl_mpc::signal;
use rfl_mpc::vehicle::{Car, Truck, VehicleInput, VehicleParameters};

#[derive(Default)]
struct Messages(Vec<String>);

impl Log for Messages {
    fn log(&mut self, _: Severity, category: &'static str, message: &str) {
        self.0.push(format!("{category}: {message}"));
    }
}

struct Instance<P: PlantUnit> {
    model: PlantFmu<P>,
    values: Values,
    messages: Messages,
    time: f64,
}

impl<P: PlantUnit> Instance<P> {
    fn new() -> Self {
        let values = Values::starting_from(&PlantFmu::<P>::declaration().variables);
        Self { model: PlantFmu::new(), values, messages: Messages::default(), time: 0.0 }
    }

    /// Packed with these start values of a user's choice.
    fn packed(chosen: &[(&str, &str)]) -> Self {
        let mut declaration = PlantFmu::<P>::declaration();
        for (name, text) in chosen {
            declaration.start_with(name, text).unwrap();
        }
        Self { values: Values::starting_from(&declaration.variables), ..Self::new() }
    }

    /// With some parameters set.
    fn with(parameters: &[(&str, f64)]) -> Self {
        let mut instance = Self::new();
        for (name, value) in parameters {
            instance.set(name, Value::Real(*value));
        }
        instance
    }

    fn set(&mut self, name: &str, value: Value) {
        let declaration = PlantFmu::<P>::declaration();
        let vr = declaration.find(name).unwrap_or_else(|| panic!("no variable {name}"));
        self.values.set_by_host(vr, &declaration.variables[vr], value);
    }

    fn real(&self, name: &str) -> f64 {
        self.values.real(PlantFmu::<P>::declaration().find(name).unwrap())
    }

    /// The name of the status.
    fn status(&self) -> &'static str {
        let number = self.values.integer(PlantFmu::<P>::declaration().find("status").unwrap());
        P::STATUS.1.iter().find(|item| item.0 == number).unwrap().1
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

/// What differs between the vehicles.
trait Case: PlantUnit {
    /// A built-in vehicle, its file, and a parameter of the file: name, line, another line.
    const BUILTIN: &'static str;
    const FILE: &'static str;
    const MASS: (&'static str, &'static str, &'static str);
    /// A parameter that the host sets, and its value.
    const INERTIA: (&'static str, f64);
    /// Effects that are switched on.
    const EFFECTS: &'static [(&'static str, f64)];
    /// A payload where no vehicle can carry it: kg, m.
    const TOO_MUCH: (f64, f64);
}

impl Case for Car {
    const BUILTIN: &'static str = "genesis";
    const FILE: &'static str = include_str!("../vehicles/genesis.toml");
    const MASS: (&'static str, &'static str, &'static str) =
        ("vehicle.mass", "mass = 2303.1", "mass = 2000.0");
    const INERTIA: (&'static str, f64) = ("vehicle.yaw_inertia", 5000.0);
    const EFFECTS: &'static [(&'static str, f64)] = &[("steer_delay", 0.05)];
    const TOO_MUCH: (f64, f64) = (9000.0, -5.0);
}

impl Case for Truck {
    const BUILTIN: &'static str = "truck_real";
    const FILE: &'static str = include_str!("../vehicles/truck_real.toml");
    const MASS: (&'static str, &'static str, &'static str) =
        ("trailer.mass", "mass = 8000.0", "mass = 2000.0");
    const INERTIA: (&'static str, f64) = ("tractor.yaw_inertia", 25000.0);
    const EFFECTS: &'static [(&'static str, f64)] = &[("steer_delay", 0.3), ("articulation_bias", 0.01)];
    const TOO_MUCH: (f64, f64) = (15000.0, -6.0);
}

fn declares_the_signals_all_parameters_and_all_effects<P: Case>() {
    let declaration = PlantFmu::<P>::declaration();
    let variable =
        |name: &str| &declaration.variables[declaration.find(name).unwrap_or_else(|| panic!("{name}"))];
    let known = P::SIGNALS.iter().map(|(signal, _)| *signal);
    for signal in [&signal::STEER_CMD, &signal::ACCEL_CMD].into_iter().chain(known) {
        let kind = &variable(signal.name).kind;
        assert!(matches!(kind, VariableKind::Real { unit, .. } if *unit == signal.unit), "{}", signal.name);
    }
    for signal in ["x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "steer", "roll"] {
        variable(signal);
    }
    for parameter in P::Parameters::TABLE {
        variable(parameter.name);
    }
    for effect in P::all_effects() {
        let kind = &variable(&format!("effect.{}", effect.id)).kind;
        let neutral = matches!(kind, VariableKind::Real { start, .. } if *start == effect.neutral);
        assert!(neutral, "{} is not neutral at the start", effect.id);
    }
    for name in P::Parameters::BUILTIN {
        let description = &variable("vehicle_file").description;
        assert!(description.contains(name), "{name} is not offered: {description}");
    }
    let VariableKind::Enumeration { items, .. } = &variable("status").kind else { panic!("an enumeration") };
    assert_eq!(*items, P::STATUS.1);
    for name in &declaration.variables {
        let same = declaration.variables.iter().filter(|other| other.name == name.name).count();
        assert_eq!(same, 1, "{}", name.name);
    }
}

fn is_the_native_vehicle_bit_for_bit<P: Case>() {
    let mut instance = Instance::<P>::with(&[("initial.vx", 15.0), ("initial.yaw", 0.3)]);
    instance.set("vehicle_file", Value::String(P::BUILTIN.to_string()));
    let mut effects = P::Effects::default();
    for (id, value) in P::EFFECTS {
        instance.set(&format!("effect.{id}"), Value::Real(*value));
        *P::effect(&mut effects, id).unwrap() = *value;
    }
    instance.initialize().unwrap();
    let mut native = P::make(&P::Parameters::builtin(P::BUILTIN).unwrap(), &effects, None).unwrap();
    native.place(0.0, 0.0, 0.3, 15.0);
    for k in 0..200 {
        let (steer_cmd, accel_cmd) = (0.04 * (0.03 * f64::from(k)).sin(), 0.5);
        instance.step(steer_cmd, accel_cmd, 0.01).unwrap();
        native.step(&VehicleInput { steer_cmd, accel_cmd }, 0.01).unwrap();
        let out = native.output();
        for (signal, value) in P::SIGNALS {
            assert_eq!(instance.real(signal.name), value(out), "{}", signal.name);
        }
        for (name, _, _, value) in P::MORE {
            assert_eq!(instance.real(name), value(out), "{name}");
        }
        for ((name, _), wheel) in P::WHEELS.iter().zip(P::wheels(out)) {
            assert_eq!(instance.real(&format!("wheel.{name}.load")), wheel.load);
        }
    }
}

fn what_the_host_sets_wins_over_the_file_and_the_rest_is_shown<P: Case>() {
    let (mass, line, other) = P::MASS;
    assert!(P::FILE.contains(line));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    std::fs::write(&file, P::FILE.replace(line, other)).unwrap();
    let mut instance = Instance::<P>::with(&[P::INERTIA]);
    instance.set("vehicle_file", Value::String(file.display().to_string()));
    instance.initialize().unwrap();
    assert_eq!(instance.real(mass), 2000.0);
    assert_eq!(instance.real(P::INERTIA.0), P::INERTIA.1);
    let named = P::Parameters::builtin(P::BUILTIN).unwrap();
    let told = |message: &String| message.contains(named.name());
    assert!(instance.messages.0.iter().any(told), "{:?}", instance.messages.0);
    // A host that writes every start value has chosen nothing: the file's mass stands.
    let mut plain = Instance::<P>::new();
    for (vr, variable) in PlantFmu::<P>::declaration().variables.iter().enumerate() {
        if variable.causality == Causality::Parameter {
            plain.values.set_by_host(vr, variable, variable.kind.start());
        }
    }
    plain.set("vehicle_file", Value::String(file.display().to_string()));
    plain.initialize().unwrap();
    assert_eq!(plain.real(mass), 2000.0);
    // Initialised again after a reset with another vehicle: values of the file do not stay.
    let mut again = Instance { values: Instance::<P>::new().values, ..instance };
    again.initialize().unwrap();
    let default = P::Parameters::builtin(P::Parameters::BUILTIN[0]).unwrap();
    let parameter = P::Parameters::TABLE.iter().find(|parameter| parameter.name == mass).unwrap();
    assert_eq!(again.real(mass), parameter.get(&default));
}

/// Who packs a value has chosen it, also one that is the library's own start value.
fn a_packed_start_value_counts_whatever_it_is<P: Case>() {
    let (mass, line, other) = P::MASS;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let text = P::FILE.replace(line, other) + "\n[effect]\nsteer_lag = 0.1\n";
    std::fs::write(&file, text).unwrap();
    let file = file.to_str().unwrap();
    let default = P::Parameters::builtin(P::Parameters::BUILTIN[0]).unwrap();
    let parameter = P::Parameters::TABLE.iter().find(|parameter| parameter.name == mass).unwrap();
    let own = parameter.get(&default);
    let shown = |mut instance: Instance<P>| {
        instance.initialize().unwrap();
        (instance.real(mass), instance.real("effect.steer_lag"))
    };
    let start = |mass_text: &str| {
        Instance::<P>::packed(&[("vehicle_file", file), (mass, mass_text), ("effect.steer_lag", "0")])
    };
    assert_eq!(shown(Instance::packed(&[("vehicle_file", file)])), (2000.0, 0.1));
    assert_eq!(shown(start(&own.to_string())), (own, 0.0));
    assert_eq!(shown(start("3001")), (3001.0, 0.0));
    // The host has the last word, and one that names another file has said nothing of the mass.
    let mut instance = start(&own.to_string());
    instance.set(mass, Value::Real(own + 1.0));
    instance.set("effect.steer_lag", Value::Real(0.2));
    assert_eq!(shown(instance), (own + 1.0, 0.2));
    let mut instance = start(&own.to_string());
    instance.set("vehicle_file", Value::String(P::BUILTIN.to_string()));
    assert_eq!(shown(instance), (own, 0.0));
}

fn files_that_cannot_be_used_are_named<P: Case>() {
    for (parameter, name) in [("vehicle_file", "no_such.toml"), ("road_file", "no_such.csv")] {
        let mut instance = Instance::<P>::new();
        instance.set(parameter, Value::String(name.to_string()));
        let message = instance.initialize().unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
        assert!(instance.step(0.0, 0.0, 0.01).is_err(), "it is not initialised");
    }
    let (payload, place) = P::TOO_MUCH;
    let mut instance = Instance::<P>::with(&[("effect.payload", payload), ("effect.payload_x", place)]);
    let message = instance.initialize().unwrap_err().to_string();
    assert!(message.contains("effect.payload"), "{message}");
}

fn states_restore_and_foreign_ones_are_refused<P: Case>() {
    let mut instance = Instance::<P>::with(&[("effect.sensor_delay", 0.1)]);
    instance.initialize().unwrap();
    for k in 0..100 {
        instance.step(0.01 * f64::from(k % 7), 2.0, 0.01).unwrap();
    }
    let mut bytes = Vec::new();
    instance.model.save(&mut bytes);
    let values = instance.values.clone();
    let drive = |instance: &mut Instance<P>| -> Vec<f64> {
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

fn the_status_says_what_it_does<P: Case>() {
    let mut instance = Instance::<P>::new();
    instance.initialize().unwrap();
    assert_eq!(instance.status(), "standstill");
    for _ in 0..300 {
        instance.step(0.0, 1.0, 0.01).unwrap();
    }
    assert_eq!(instance.status(), "driving");
    instance.step(0.8, 0.0, 0.01).unwrap();
    assert_eq!(instance.status(), "steering_limited");
    assert!(instance.messages.0.iter().any(|message| message.contains("steering_limited")));
}

/// A long step ends where the status changes: there a host with short steps sees the change, too.
fn a_step_to_an_event_ends_where_the_status_changes<P: Case>() {
    let rolls = |instance: &mut Instance<P>| {
        instance.initialize().unwrap();
        instance.set("accel_cmd", Value::Real(1.0));
    };
    let (mut long, mut short) = (Instance::<P>::new(), Instance::<P>::new());
    rolls(&mut long);
    rolls(&mut short);
    let made = long.model.step_to_event(&mut long.values, 0.0, 1.0, &mut long.messages).unwrap();
    assert_eq!(long.status(), "driving");
    while short.status() == "standstill" {
        short.step(0.0, 1.0, 0.001).unwrap();
    }
    assert!((made - short.time).abs() < 1e-9 && made < 0.5, "{made} {}", short.time);
    assert!((long.real("vx") - short.real("vx")).abs() < 1e-12);
    // Without an event the step is made as a whole.
    let rest = long.model.step_to_event(&mut long.values, made, 0.1, &mut long.messages).unwrap();
    assert_eq!(rest, 0.1);
}

/// Without a change of the status, one that may end has the bits of one that may not.
fn a_step_without_an_event_has_the_same_bits<P: Case>() {
    let drive = |to_event: bool| {
        let mut instance = Instance::<P>::with(&[("initial.vx", 10.0), ("effect.sensor_delay", 0.013)]);
        instance.initialize().unwrap();
        instance.set("accel_cmd", Value::Real(0.5));
        for k in 0..20 {
            let Instance { model, values, messages, .. } = &mut instance;
            let time = 0.05 * f64::from(k);
            let made = match to_event {
                true => model.step_to_event(values, time, 0.05, messages).unwrap(),
                false => model.step(values, time, 0.05, messages).map(|()| 0.05).unwrap(),
            };
            assert_eq!(made, 0.05);
        }
        instance.values
    };
    assert_eq!(drive(true), drive(false));
}

/// Each behaviour for each vehicle.
macro_rules! for_each_vehicle {
    ($($behaviour:ident)*) => {
        mod car { $(#[test] fn $behaviour() { super::$behaviour::<super::Car>() })* }
        mod truck { $(#[test] fn $behaviour() { super::$behaviour::<super::Truck>() })* }
    };
}

for_each_vehicle! {
    declares_the_signals_all_parameters_and_all_effects
    is_the_native_vehicle_bit_for_bit
    what_the_host_sets_wins_over_the_file_and_the_rest_is_shown
    a_packed_start_value_counts_whatever_it_is
    files_that_cannot_be_used_are_named
    states_restore_and_foreign_ones_are_refused
    the_status_says_what_it_does
    a_step_to_an_event_ends_where_the_status_changes
    a_step_without_an_event_has_the_same_bits
}

/// A truck whose rear axle alone brakes, on a road with little grip.
fn on_ice() -> Instance<Truck> {
    let mut instance = Instance::<Truck>::with(&[
        ("initial.vx", 22.0),
        ("brake.front_share", 0.0),
        ("brake.trailer_share", 0.0),
        ("effect.road_friction", 0.35),
    ]);
    instance.initialize().unwrap();
    instance
}

#[test]
fn a_jack_knife_ends_the_instance_with_a_message() {
    let mut instance = on_ice();
    let error = (0..3000).find_map(|k| instance.step(0.08, if k < 50 { 0.0 } else { -5.0 }, 0.01).err());
    let Some(ModelError::Failed(message)) = error else { panic!("it jack-knifes: {error:?}") };
    assert!(message.contains("jack-knifed") && message.contains("hitch.articulation_limit"), "{message}");
    assert!(instance.messages.0.iter().any(|message| message.contains("jack_knifing")));
}

/// A host that lets steps end early learns of a jack-knife before it is one; one step too long fails and shows nothing of it.
#[test]
fn a_host_that_lets_steps_end_learns_of_a_jack_knife_in_time() {
    let mut instance = on_ice();
    (0..50).for_each(|_| instance.step(0.08, 0.0, 0.01).unwrap());
    let before = instance.values.clone();
    assert!(matches!(instance.step(0.08, -5.0, 30.0), Err(ModelError::Failed(_))));
    let commands =
        ["steer_cmd", "accel_cmd"].map(|name| PlantFmu::<Truck>::declaration().find(name).unwrap());
    let shown = (0..PlantFmu::<Truck>::declaration().variables.len()).filter(|vr| !commands.contains(vr));
    shown.for_each(|vr| assert_eq!(instance.values.get(vr), before.get(vr)));
    let mut end = instance.time;
    while instance.status() != "jack_knifing" {
        let Instance { model, values, messages, .. } = &mut instance;
        end += model.step_to_event(values, end, 30.0, messages).unwrap();
    }
    assert!(end < 29.0, "{end}");
}

#[test]
fn effects_of_the_vehicle_file_are_in_effect_unless_the_host_sets_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("calibrated.toml");
    let given = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles/c_class.toml");
    let text =
        std::fs::read_to_string(given).unwrap() + "\n[effect]\nsteer_delay = 0.12\nroad_friction = 0.6\n";
    std::fs::write(&file, text).unwrap();
    let with_friction = |friction: f64| {
        let mut instance = Instance::<Car>::new();
        instance.set("vehicle_file", Value::String(file.to_str().unwrap().to_string()));
        instance.set("effect.road_friction", Value::Real(friction));
        instance.initialize().unwrap();
        instance
    };
    // The start value is no choice.
    assert_eq!(with_friction(1.0).real("effect.road_friction"), 0.6);
    let mut instance = with_friction(0.9);
    let of = |name: &str| instance.real(&format!("effect.{name}"));
    assert_eq!((of("steer_delay"), of("road_friction"), of("wind_x")), (0.12, 0.9, 0.0));
    instance.step(0.05, 0.0, 0.1).unwrap();
    assert_eq!(instance.real("steer"), 0.0, "the command is on its way");
}
