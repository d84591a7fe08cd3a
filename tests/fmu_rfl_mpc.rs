//! The controllers as FMI units: parameters and files, sampling, saved states, errors; the car's and the truck's.

use rfl_mpc::control::{
    ControlStatus, ControlVariant, ControllerFor, NominalTruck, TruckControllerParameters,
};
use rfl_mpc::fmi::call_error::CallError;
use rfl_mpc::fmi::instance::Instance;
use rfl_mpc::fmi::logger::Logger;
use rfl_mpc::fmi::{
    Causality, Context, Initial, Log, Model, ModelError, Severity, Status, Value, Values, v2, v3,
};
use rfl_mpc::fmu::{RflMpc, TruckRflMpc};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::residual::DataSet;
use rfl_mpc::residual::gp::{GpConfig, StateSmoothing, train};
use rfl_mpc::simulate::TruckClosedLoop;
use rfl_mpc::vehicle::TruckEffects;
use std::ffi::{CStr, CString};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// A controller with a road for it, and a vehicle that is built in for it.
trait Controller: Model {
    const ROAD: &'static str;
    const VEHICLE: &'static str;
}

impl Controller for RflMpc {
    const ROAD: &'static str = "paths/sudoku_test.csv";
    const VEHICLE: &'static str = "c_class";
}

impl Controller for TruckRflMpc {
    const ROAD: &'static str = "paths/off_road.csv";
    const VEHICLE: &'static str = "truck_real";
}

/// Makes of each check a test of each controller.
macro_rules! of_each_controller {
    ($($check:ident)*) => {
        mod car {
            $(#[test] fn $check() { super::$check::<super::RflMpc>(); })*
        }

        mod truck {
            $(#[test] fn $check() { super::$check::<super::TruckRflMpc>(); })*
        }
    };
}

of_each_controller! {
    it_steers_towards_the_path
    it_computes_at_its_sample_time_and_holds_between
    a_step_to_an_event_ends_a_sample_after_the_status_changed
    a_saved_state_continues_bit_for_bit
    a_truncated_state_is_refused_and_changes_nothing
    the_controller_s_file_wins_over_the_vehicle_s_and_the_host_over_both
    a_packed_start_value_wins_over_the_controller_s_file_whatever_it_is
    a_measurement_that_is_no_number_reaches_the_guard_and_a_parameter_is_refused
    start_values_that_give_way_to_a_file_are_told_once
    files_that_cannot_be_used_are_named_with_a_remedy
    only_what_a_user_should_act_on_is_a_warning_of_the_road
    bytes_that_are_no_model_are_refused
    a_variant_without_its_model_says_what_is_missing_and_how_to_make_it
    the_known_actuator_is_a_variant
    measurements_that_are_no_numbers_change_nothing_at_first_and_are_bridged_later
}

#[derive(Default)]
struct Messages(Vec<(Severity, String)>);

impl Log for Messages {
    fn log(&mut self, severity: Severity, _category: &'static str, message: &str) {
        self.0.push((severity, message.to_string()));
    }
}

struct Unit<M> {
    model: M,
    values: Values,
    log: Messages,
}

fn road<M: Controller>() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(M::ROAD)
}

impl<M: Controller> Unit<M> {
    fn new() -> Self {
        let declaration = M::declaration();
        let mut unit = Self {
            model: M::new(),
            values: Values::starting_from(&declaration.variables),
            log: Messages::default(),
        };
        unit.set("path_file", Value::String(road::<M>().to_string_lossy().into_owned()));
        unit
    }

    fn vr(name: &str) -> usize {
        M::declaration().find(name).unwrap_or_else(|| panic!("there is no variable {name}"))
    }

    fn set(&mut self, name: &str, value: Value) {
        let vr = Self::vr(name);
        self.values.set_by_host(vr, &M::declaration().variables[vr], value);
    }

    fn real(&self, name: &str) -> f64 {
        self.values.real(Self::vr(name))
    }

    fn initialize(&mut self) -> Result<(), ModelError> {
        self.model.initialize(&mut self.values, 0.0, &Context::default(), &mut self.log)
    }

    /// Puts the vehicle beside the path, a little further at each step, from 1 m after its start.
    fn step(&mut self, k: u32, h: f64) {
        let along = 1.0 + f64::from(k) * h * 5.0;
        let (x, y, yaw) = (self.real("start.x"), self.real("start.y"), self.real("start.yaw"));
        for (name, value) in [
            ("x", x + along * yaw.cos() - 0.2 * yaw.sin()),
            ("y", y + along * yaw.sin() + 0.2 * yaw.cos()),
            ("yaw", yaw + 0.01),
            ("vx", 5.0),
        ] {
            self.set(name, Value::Real(value));
        }
        self.model.step(&mut self.values, f64::from(k) * h, h, &mut self.log).unwrap();
    }

    /// All outputs but the wall clock's.
    fn outputs(&self) -> Vec<Value> {
        let clock = Self::vr("compute_time");
        (0..M::declaration().variables.len())
            .filter(|&vr| vr != clock)
            .map(|vr| self.values.get(vr).unwrap().clone())
            .collect()
    }
}

/// Two hosts stop where initialising ends with a warning.
fn only_what_a_user_should_act_on_is_a_warning_of_the_road<M: Controller>() {
    let folder = tempfile::tempdir().unwrap();
    let doubled: String = (0..100).map(|i| format!("{},0\n", i.min(98))).collect();
    let corner: String = (0..200).map(|i| format!("{},{}\n", i.min(100), (i - 100).max(0))).collect();
    // A half circle of 3 m radius that somebody drew.
    let of_bend = |i: i32| {
        let angle = f64::from((i - 50).clamp(0, 18)) * 10f64.to_radians();
        let along = f64::from((i - 50).min(0)) - f64::from((i - 68).max(0));
        format!("{:.4},{:.4}\n", along + 3.0 * angle.sin(), 3.0 - 3.0 * angle.cos())
    };
    let bend: String = (0..120).map(of_bend).collect();
    for (rows, severity, word) in [
        (doubled, Severity::Info, "1 point(s) dropped"),
        (corner, Severity::Info, "1 corner(s) that the vehicle cannot drive are rounded"),
        (bend, Severity::Warning, "tighter than the vehicle turns"),
    ] {
        let file = folder.path().join("road.csv");
        std::fs::write(&file, format!("x,y\n{rows}")).unwrap();
        let mut unit = Unit::<M>::new();
        unit.set("path_file", Value::String(file.to_string_lossy().into_owned()));
        unit.initialize().unwrap();
        let found = unit.log.0.iter().filter(|message| message.1.contains(word)).collect::<Vec<_>>();
        assert!(matches!(found[..], [(found, _)] if *found == severity), "{:?}", unit.log.0);
    }
}

fn it_steers_towards_the_path<M: Controller>() {
    let mut unit = Unit::<M>::new();
    unit.initialize().unwrap();
    assert_eq!(unit.real("steer_cmd"), 0.0);
    unit.step(0, 0.02);
    assert!((unit.real("e1") - 0.2).abs() < 1e-3, "{}", unit.real("e1"));
    assert!(unit.real("steer_cmd") < 0.0);
    assert_eq!(unit.values.integer(Unit::<M>::vr("status")), 1);
    assert!((unit.real("predicted.e1[16]") - unit.real("e1")).abs() < 0.2);
}

fn it_computes_at_its_sample_time_and_holds_between<M: Controller>() {
    let mut unit = Unit::<M>::new();
    unit.initialize().unwrap();
    let mut changes = 0;
    let mut before = unit.real("station");
    for k in 0..200 {
        unit.step(k, 0.001);
        changes += u32::from(unit.real("station") != before);
        before = unit.real("station");
    }
    assert_eq!(changes, 10);
}

/// A host with long steps gets one computation a step; one that lets them end is told of a change after a sample time.
fn a_step_to_an_event_ends_a_sample_after_the_status_changed<M: Controller>() {
    let mut unit = Unit::<M>::new();
    unit.initialize().unwrap();
    let place = |unit: &mut Unit<M>, along: f64, aside: f64| {
        let (x, y, yaw) = (unit.real("start.x"), unit.real("start.y"), unit.real("start.yaw"));
        let (x, y) = (x + along * yaw.cos(), y + along * yaw.sin());
        let pose = [("x", x - aside * yaw.sin()), ("y", y + aside * yaw.cos()), ("yaw", yaw), ("vx", 5.0)];
        pose.into_iter().for_each(|(name, value)| unit.set(name, Value::Real(value)));
    };
    let mut steps = Vec::new();
    // On the path, on it again, and far from it.
    for (k, aside) in [0.0, 0.0, 50.0].into_iter().enumerate() {
        place(&mut unit, 5.0 * k as f64, aside);
        let Unit { model, values, log } = &mut unit;
        steps.push(model.step_to_event(values, k as f64, 1.0, log).unwrap());
    }
    // The host's step is the sample time, as far as there are any so long.
    assert_eq!(steps, [1.0, 1.0, 0.2]);
}

fn a_saved_state_continues_bit_for_bit<M: Controller>() {
    let mut unit = Unit::<M>::new();
    unit.initialize().unwrap();
    for k in 0..50 {
        unit.step(k, 0.01);
    }
    let (mut bytes, values) = (Vec::new(), unit.values.clone());
    unit.model.save(&mut bytes);
    let mut other = Unit::<M>::new();
    other.initialize().unwrap();
    other.step(0, 0.02);
    other.model.restore(&bytes).unwrap();
    other.values = values;
    for k in 50..150 {
        unit.step(k, 0.01);
        other.step(k, 0.01);
        assert_eq!(unit.outputs(), other.outputs(), "step {k}");
    }
}

fn a_truncated_state_is_refused_and_changes_nothing<M: Controller>() {
    let mut unit = Unit::<M>::new();
    unit.initialize().unwrap();
    unit.step(0, 0.02);
    let mut bytes = Vec::new();
    unit.model.save(&mut bytes);
    for length in 0..bytes.len() {
        assert!(unit.model.restore(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
    }
    let mut after = Vec::new();
    unit.model.save(&mut after);
    assert_eq!(bytes, after);
}

#[test]
fn the_host_s_parameters_win_over_the_vehicle_file() {
    let mut unit = Unit::<RflMpc>::new();
    unit.set("vehicle_file", Value::String("bmw_320i".into()));
    unit.set("vehicle.mass", Value::Real(1234.0));
    unit.initialize().unwrap();
    assert_eq!(unit.real("vehicle.mass"), 1234.0);
    let bmw = rfl_mpc::vehicle::builtin("bmw_320i").unwrap().single_track();
    assert_eq!(unit.real("vehicle.yaw_inertia"), bmw.yaw_inertia);
    assert_eq!(unit.real("tyre.front.stiffness"), bmw.cf);
}

fn the_controller_s_file_wins_over_the_vehicle_s_and_the_host_over_both<M: Controller>() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("controller.toml");
    let text =
        "variant = 'actuator'\n[controller]\nmpc.q_e1 = 0.5\nmpc.r_rate = 0.25\nactuator.dead_time = 0.06\n";
    std::fs::write(&file, text).unwrap();
    let mut unit = Unit::<M>::new();
    unit.set("controller_file", Value::String(file.to_string_lossy().into_owned()));
    unit.set("mpc.r_rate", Value::Real(0.125));
    unit.initialize().unwrap();
    let shown = ["mpc.q_e1", "mpc.r_rate", "actuator.dead_time"].map(|name| unit.real(name));
    assert_eq!(shown, [0.5, 0.125, 0.06]);
    assert_eq!(unit.values.integer(Unit::<M>::vr("variant")), ControlVariant::Actuator as i32);

    // A host that writes every start value before it initialises has chosen nothing.
    let mut unit = Unit::<M>::new();
    for (vr, variable) in M::declaration().variables.iter().enumerate() {
        if variable.initial == Initial::Exact && variable.name != "path_file" {
            unit.values.set_by_host(vr, variable, variable.kind.start());
        }
    }
    unit.set("controller_file", Value::String(file.to_string_lossy().into_owned()));
    unit.initialize().unwrap();
    let shown = ["mpc.q_e1", "mpc.r_rate", "actuator.dead_time"].map(|name| unit.real(name));
    assert_eq!(shown, [0.5, 0.25, 0.06]);
    assert_eq!(unit.values.integer(Unit::<M>::vr("variant")), ControlVariant::Actuator as i32);
}

/// Who packs a value has chosen it, also one that is the library's own start value.
fn a_packed_start_value_wins_over_the_controller_s_file_whatever_it_is<M: Controller>() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("controller.toml");
    let text = "variant = 'actuator'\n[controller]\nmpc.horizon = 25\nactuator.dead_time = 0.06\n";
    std::fs::write(&file, text).unwrap();
    let file = file.to_string_lossy().into_owned();
    let own = M::declaration();
    let start = |name: &str| own.variables[own.find(name).unwrap()].kind.start().to_string();
    let horizon = start("mpc.horizon");
    let shown = |chosen: &[(&str, &str)], set: &[(&str, Value)]| {
        let mut declaration = M::declaration();
        chosen.iter().for_each(|(name, text)| declaration.start_with(name, text).unwrap());
        let mut unit = Unit::<M>::new();
        unit.values = Values::starting_from(&declaration.variables);
        unit.set("path_file", Value::String(road::<M>().to_string_lossy().into_owned()));
        for (name, value) in set {
            let vr = Unit::<M>::vr(name);
            unit.values.set_by_host(vr, &declaration.variables[vr], value.clone());
        }
        unit.initialize().unwrap();
        let integer = |name: &str| unit.values.integer(Unit::<M>::vr(name));
        (unit.real("actuator.dead_time"), integer("mpc.horizon").to_string(), integer("variant"))
    };
    let (actuator, adaptive) = (ControlVariant::Actuator as i32, ControlVariant::Adaptive as i32);
    let named = ("controller_file", &file[..]);
    assert_eq!(shown(&[named], &[]), (0.06, "25".to_owned(), actuator));
    let packed = [named, ("actuator.dead_time", "0"), ("mpc.horizon", &horizon[..]), ("variant", "adaptive")];
    assert_eq!(shown(&packed, &[]), (0.0, horizon.clone(), adaptive));
    // The same file named by the host, over what is packed.
    let by_host = ("controller_file", Value::String(file.clone()));
    assert_eq!(shown(&packed[1..], &[by_host]), (0.0, horizon.clone(), adaptive));
    let of_host = [("actuator.dead_time", Value::Real(0.1)), ("variant", Value::Integer(0))];
    assert_eq!(shown(&packed, &of_host), (0.1, horizon, ControlVariant::None as i32));
}

/// An instance as the FMI layer has it, on its road, and what it says to a host that listens to everything.
fn hosted<M: Controller>(settings: &[(&str, f64)], vehicle: &CStr) -> (Instance<M>, Arc<Mutex<Vec<String>>>) {
    let said = Arc::new(Mutex::new(Vec::new()));
    let heard = said.clone();
    let listener = move |_: &CStr, _: Status, _: &CStr, message: &CStr| {
        heard.lock().unwrap().push(message.to_str().unwrap().to_owned());
    };
    let mut logger = Logger::new(Some(Arc::new(listener)), c"unit");
    logger.enable(vec!["logAll"]);
    let mut unit = Instance::<M>::new(&v2::VERSION, "{}", logger, Context::default()).unwrap();
    let vr = |name: &str| M::declaration().find(name).unwrap() as u32;
    let road = CString::new(road::<M>().to_str().unwrap()).unwrap();
    unit.set_string(&[vr("path_file"), vr("vehicle_file")], &[&road, vehicle]).unwrap();
    for (name, value) in settings {
        unit.set_real(&[vr(name)], &[*value]).unwrap();
    }
    unit.setup_experiment(0.0, None).unwrap();
    unit.enter_initialization_mode().unwrap();
    unit.exit_initialization_mode().unwrap();
    (unit, said)
}

/// One call sets all measurements: without the one that is no number the others count.
fn a_measurement_that_is_no_number_reaches_the_guard_and_a_parameter_is_refused<M: Controller>() {
    let declaration = M::declaration();
    let vr = |name: &str| declaration.find(name).unwrap() as u32;
    let vehicle = CString::new(M::VEHICLE).unwrap();
    for missing in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let (mut unit, said) = hosted::<M>(&[], &vehicle);
        let mut start = [0.0; 3];
        let names = ["start.x", "start.y", "start.yaw"].map(vr);
        unit.get_real(&names, |i, value| start[i] = value).unwrap();
        let [x, y, yaw] = start;
        let names = ["x", "y", "yaw", "vx", "vy"].map(vr);
        let measured = |k: u32, vy: f64| {
            let along = 1.0 + 0.1 * f64::from(k);
            [x + along * yaw.cos(), y + along * yaw.sin(), yaw, 5.0, vy]
        };
        let status = |unit: &mut Instance<M>| {
            let mut status = 0;
            unit.get_integer(&[vr("status")], |_, value| status = value).unwrap();
            status
        };
        for k in 0..10 {
            unit.set_real(&names, &measured(k, 0.0)).unwrap();
            unit.do_step(0.02 * f64::from(k), 0.02).unwrap();
        }
        assert_eq!(status(&mut unit), ControlStatus::Optimal as i32);
        for k in 10..13 {
            unit.set_real(&names, &measured(k, missing)).unwrap();
            let mut taken = 0.0;
            unit.get_real(&[vr("x")], |_, value| taken = value).unwrap();
            assert_eq!(taken, measured(k, 0.0)[0], "the rest of the call");
            unit.do_step(0.02 * f64::from(k), 0.02).unwrap();
            assert_eq!(status(&mut unit), ControlStatus::Bridged as i32);
        }
        let told = said.lock().unwrap().iter().filter(|text| text.contains("`vy`")).count();
        assert_eq!(told, 1, "{:?}", said.lock().unwrap());
        // A state in between is one.
        let state = unit.store(std::ptr::null_mut()).unwrap();
        let bytes = unit.serialize(state).unwrap();
        let again = unit.deserialize(&bytes).unwrap();
        unit.restore(again).unwrap();
        unit.set_real(&names, &measured(13, 0.0)).unwrap();
        unit.do_step(0.02 * 13.0, 0.02).unwrap();
        assert_eq!(status(&mut unit), ControlStatus::Optimal as i32);

        unit.reset().unwrap();
        let refused = unit.set_real(&[vr("mpc.r_rate")], &[missing]).unwrap_err();
        assert!(matches!(refused, CallError::NotFinite { .. }), "{refused:?}");
    }
}

/// A host that wrote start values and names a vehicle learns in one message which of them are the vehicle's now.
fn start_values_that_give_way_to_a_file_are_told_once<M: Controller>() {
    let declaration = M::declaration();
    let reals = declaration.variables.iter().filter_map(|variable| match variable.kind.start() {
        Value::Real(start) if variable.causality == Causality::Parameter => Some((&*variable.name, start)),
        _ => None,
    });
    let all: Vec<(&str, f64)> = reals.collect();
    let other = if M::VEHICLE == "c_class" { c"genesis" } else { c"truck_real" };
    let told = |settings: &[(&str, f64)], vehicle: &CStr| {
        let (_, said) = hosted::<M>(settings, vehicle);
        let said = said.lock().unwrap();
        said.iter().filter(|text| text.contains("values of a file count")).cloned().collect::<Vec<_>>()
    };
    let one = all.iter().find(|(name, _)| name.ends_with(".mass")).unwrap();
    let [message] = &told(&[*one], other)[..] else { panic!("one message") };
    assert!(message.contains(one.0) && message.contains(&format!("(start {})", one.1)), "{message}");
    assert!(!message.contains("more"), "{message}");
    let [message] = &told(&all, other)[..] else { panic!("one message") };
    assert!(message.len() < 600 && message.contains("more"), "{message}");
    assert_eq!(told(&[], other), [""; 0]);
    // The vehicle that is declared gives the declared values.
    let default = declaration.variables[declaration.find("vehicle_file").unwrap()].kind.start();
    assert_eq!(told(&all, &CString::new(default.to_string()).unwrap()), [""; 0]);
}

fn files_that_cannot_be_used_are_named_with_a_remedy<M: Controller>() {
    let folder = tempfile::tempdir().unwrap();
    let foreign = folder.path().join("foreign.rflm");
    std::fs::write(&foreign, "not a model").unwrap();
    let nan = folder.path().join("nan.csv");
    std::fs::write(&nan, "x,y\n0,0\n1,0\n2,nan\n3,0\n").unwrap();
    for (name, value, words) in [
        ("path_file", "nowhere.csv", &["nowhere.csv", "path_file"][..]),
        ("path_file", nan.to_str().unwrap(), &["nan.csv", "4"]),
        ("vehicle_file", "nowhere.toml", &["nowhere.toml", M::VEHICLE]),
        ("residual.file", "nowhere.rflm", &["nowhere.rflm"]),
        ("residual.file", foreign.to_str().unwrap(), &["foreign.rflm"]),
        ("controller_file", "nowhere.toml", &["nowhere.toml", "rfl tune"]),
        ("controller_file", foreign.to_str().unwrap(), &["foreign.rflm"]),
    ] {
        let mut unit = Unit::<M>::new();
        unit.set(name, Value::String(value.into()));
        let message = unit.initialize().unwrap_err().to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    }
}

/// A model as bytes, where the interface has them, is checked as its file is.
fn bytes_that_are_no_model_are_refused<M: Controller>() {
    for (file, words) in
        [("", &["residual.data", "no residual model", "rfl train"][..]), ("some.rflm", &["give one of them"])]
    {
        let mut declaration = M::declaration();
        declaration.complete(&v3::VERSION);
        let mut unit = Unit::<M>::new();
        let road = unit.values.string(Unit::<M>::vr("path_file")).to_owned();
        unit.values = Values::starting_from(&declaration.variables);
        unit.set("path_file", Value::String(road));
        unit.set("residual.file", Value::String(file.into()));
        let data = declaration.find("residual.data").unwrap();
        unit.values.set_by_host(
            data,
            &declaration.variables[data],
            Value::Binary(b"no model".to_vec().into()),
        );
        let message = unit.initialize().unwrap_err().to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    }
}

fn a_variant_without_its_model_says_what_is_missing_and_how_to_make_it<M: Controller>() {
    let mut unit = Unit::<M>::new();
    unit.set("variant", Value::Integer(6));
    let resources = tempfile::tempdir().unwrap();
    let context = Context { resources: Some(resources.path().to_owned()), ..Context::default() };
    let error =
        unit.model.initialize(&mut unit.values, 0.0, &context, &mut unit.log).unwrap_err().to_string();
    let file = resources.path().join("residual/rfl_s.rflm");
    for words in [file.to_str().unwrap(), "rfl collect", "rfl train", "fmu-build --residual", "residual.file"]
    {
        assert!(error.contains(words), "{error}");
    }
}

fn the_known_actuator_is_a_variant<M: Controller>() {
    let steered = |parameters: &[(&str, Value)]| {
        let mut unit = Unit::<M>::new();
        // Who is told the actuator is sure of it, and tightens.
        unit.set("mpc.tightening", Value::Real(1.0));
        parameters.iter().for_each(|(name, value)| unit.set(name, value.clone()));
        unit.initialize().unwrap();
        (0..20).for_each(|k| unit.step(k, 0.02));
        (unit.real("steer_cmd"), unit.real("actuator.dead_time"))
    };
    let variant = ("variant", Value::Integer(7));
    let nominal = steered(&[("variant", Value::Integer(0))]).0;
    // The start value, 0, would be no choice, and the vehicle's own steering stand.
    let nothing = Value::Real(1e-12);
    // Without dead time and lag it is the nominal controller.
    let none = [
        variant.clone(),
        ("actuator.dead_time", nothing.clone()),
        ("actuator.time_constant", nothing.clone()),
    ];
    assert!((steered(&none).0 - nominal).abs() < 1e-9);
    let slow = steered(&[
        variant,
        ("actuator.dead_time", Value::Real(0.06)),
        ("actuator.time_constant", Value::Real(0.1)),
    ]);
    assert_eq!(slow.1, 0.06);
    assert!((slow.0 - nominal).abs() > 1e-4, "{} {nominal}", slow.0);
    // How the dead time is represented: exact, the approximants, not at all.
    let represented = [0, 1, 2, 3].map(|model| {
        let dead_time = [
            ("variant", Value::Integer(7)),
            ("actuator.dead_time", Value::Real(0.06)),
            ("actuator.time_constant", nothing.clone()),
            ("actuator.dead_time_model", Value::Integer(model)),
        ];
        steered(&dead_time).0
    });
    assert!((represented[3] - nominal).abs() < 1e-9, "{represented:?} {nominal}");
    for (i, one) in represented.iter().enumerate() {
        assert!(represented[i + 1..].iter().all(|other| (one - other).abs() > 1e-6), "{represented:?}");
    }
}

fn measurements_that_are_no_numbers_change_nothing_at_first_and_are_bridged_later<M: Controller>() {
    let (mut unit, mut other) = (Unit::<M>::new(), Unit::<M>::new());
    for unit in [&mut unit, &mut other] {
        unit.initialize().unwrap();
    }
    let values = unit.values.clone();
    let declaration = M::declaration();
    let inputs = declaration.variables.iter().filter(|variable| variable.causality == Causality::Input);
    let mut time = 0.0;
    for input in inputs {
        time += 0.02;
        unit.set(&input.name, Value::Real(f64::NAN));
        let error = unit.model.step(&mut unit.values, time, 0.02, &mut unit.log).unwrap_err();
        let named = |text: &str| text.contains(&format!(" {} ", input.name));
        assert!(matches!(&error, ModelError::Discard(text) if named(text)), "{error}");
        unit.values = values.clone();
    }
    unit.step(50, 0.02);
    other.step(50, 0.02);
    assert_eq!(unit.outputs(), other.outputs());
    unit.set("vy", Value::Real(f64::NAN));
    unit.step(51, 0.02);
    assert_eq!(unit.values.integer(Unit::<M>::vr("status")), ControlStatus::Bridged as i32);
}

#[test]
fn the_truck_s_host_parameters_win_over_the_vehicle_file_and_its_defaults_are_a_truck_s() {
    let mut unit = Unit::<TruckRflMpc>::new();
    let default = NominalTruck::default();
    assert_eq!(unit.real("trailer.mass"), default.mass2);
    assert_eq!(unit.values.integer(Unit::<TruckRflMpc>::vr("mpc.horizon")), 60);
    unit.set("vehicle_file", Value::String("truck_real".into()));
    unit.set("tractor.mass", Value::Real(7000.0));
    unit.set("mpc.r_rate", Value::Real(0.5));
    unit.initialize().unwrap();
    let real = rfl_mpc::vehicle::builtin_truck("truck_real").unwrap().articulated();
    assert_eq!((unit.real("tractor.mass"), unit.real("mpc.r_rate")), (7000.0, 0.5));
    assert_eq!(unit.real("trailer.mass"), real.mass2);
    assert_eq!(unit.real("tyre.trailer.stiffness"), real.stiffness[2]);
    assert!(real.mass2 != default.mass2);
}

#[test]
fn the_articulation_steers_too() {
    let steered = |articulation: f64, rate: f64| {
        let mut unit = Unit::<TruckRflMpc>::new();
        unit.initialize().unwrap();
        unit.set("articulation", Value::Real(articulation));
        unit.set("articulation_rate", Value::Real(rate));
        (0..3).for_each(|k| unit.step(k, 0.02));
        unit.real("steer_cmd")
    };
    let straight = steered(0.0, 0.0);
    assert!((steered(0.2, 0.0) - straight).abs() > 1e-6, "{straight}");
    assert!((steered(0.0, 0.2) - straight).abs() > 1e-6, "{straight}");
}

/// Files of a truck's and of a car's Gaussian process, learned of what their models miss in a minute of driving.
fn processes(folder: &Path) -> [PathBuf; 2] {
    let config = GpConfig {
        smoothing: StateSmoothing::Fixed(0),
        points: 20,
        hyperparameter_samples: 100,
        iterations: 5,
        ..GpConfig::default()
    };
    let [truck, car] = ["truck.rflm", "car.rflm"].map(|name| folder.join(name));
    let file = rfl_mpc::vehicle::builtin_truck("truck_simulation").unwrap();
    let mut parameters = TruckControllerParameters::for_truck(&file);
    parameters.mpc.dither = 0.01;
    let path = Arc::new(Route::TruckUTurn.path().unwrap());
    let controller = ControllerFor::new(parameters, path).unwrap();
    let mut closed = TruckClosedLoop::at_start(controller, &file, &TruckEffects::default(), 0.02).unwrap();
    let log = closed.drive(30.0, |_| ()).unwrap().to_learn_from();
    let nominal = parameters.vehicle.articulated();
    let data = DataSet::new(std::slice::from_ref(&log), &nominal, parameters.data_config()).unwrap();
    train(&data, None, &config, &|_| ()).unwrap().model.write(&truck).unwrap();
    let nominal = rfl_mpc::vehicle::builtin("c_class").unwrap().single_track();
    let data = DataSet::new(&[log], &nominal, parameters.data_config()).unwrap();
    train(&data, None, &config, &|_| ()).unwrap().model.write(&car).unwrap();
    [truck, car]
}

#[test]
fn the_truck_has_nonlinear_mpc_with_and_without_a_process() {
    let folder = tempfile::tempdir().unwrap();
    let [truck, car] = processes(folder.path());
    let unit = |parameters: &[(&str, Value)]| {
        let mut unit = Unit::<TruckRflMpc>::new();
        parameters.iter().for_each(|(name, value)| unit.set(name, value.clone()));
        unit
    };
    let steered = |parameters: &[(&str, Value)]| {
        let mut unit = unit(parameters);
        unit.initialize().unwrap();
        (0..20).for_each(|k| unit.step(k, 0.02));
        unit.real("steer_cmd")
    };
    let nmpc = ("variant", Value::Integer(ControlVariant::Nmpc as i32));
    let gp_nmpc = ("variant", Value::Integer(ControlVariant::GpNmpc as i32));
    let of = |file: &Path| ("residual.file", Value::String(file.display().to_string()));
    let slippery = [nmpc.clone(), ("nmpc.friction", Value::Real(0.2))];
    let (linear, nonlinear, slippery) = (steered(&[]), steered(&[nmpc]), steered(&slippery));
    assert!((nonlinear - linear).abs() < 0.05 && nonlinear != linear, "{nonlinear} {linear}");
    assert_ne!(slippery, nonlinear, "the friction counts");
    let learned = steered(&[gp_nmpc.clone(), of(&truck)]);
    assert!((nonlinear - learned).abs() < 0.05 && nonlinear != learned, "{nonlinear} {learned}");
    assert_eq!(learned, steered(&[of(&truck)]), "the file decides");

    let refused = |parameters: &[(&str, Value)]| unit(parameters).initialize().unwrap_err().to_string();
    let error = refused(std::slice::from_ref(&gp_nmpc));
    assert!(error.contains("gp_nmpc") && error.contains("rfl train"), "{error}");
    let error = refused(&[gp_nmpc, of(&car)]);
    assert!(error.contains("car.rflm") && error.contains("a model for a car"), "{error}");
}
