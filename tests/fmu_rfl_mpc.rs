//! The controller as an FMI unit: parameters and files, sampling, saved states, errors.

use rfl_mpc::fmi::{Context, Log, Model, ModelError, Severity, Value, Values};
use rfl_mpc::fmu::RflMpc;
use std::path::{Path, PathBuf};

#[derive(Default)]
struct Messages(Vec<(Severity, String)>);

impl Log for Messages {
    fn log(&mut self, severity: Severity, _category: &'static str, message: &str) {
        self.0.push((severity, message.to_string()));
    }
}

struct Unit {
    model: RflMpc,
    values: Values,
    log: Messages,
}

fn course() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("paths/sudoku_test.csv")
}

impl Unit {
    fn new() -> Self {
        let declaration = RflMpc::declaration();
        let mut unit = Self {
            model: RflMpc::new(),
            values: Values::starting_from(&declaration.variables),
            log: Messages::default(),
        };
        unit.set("path_file", Value::String(course().to_string_lossy().into_owned()));
        unit
    }

    fn vr(name: &str) -> usize {
        RflMpc::declaration().find(name).unwrap_or_else(|| panic!("there is no variable {name}"))
    }

    fn set(&mut self, name: &str, value: Value) {
        self.values.set_by_host(Self::vr(name), value);
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
        (0..RflMpc::declaration().variables.len())
            .filter(|&vr| vr != clock)
            .map(|vr| self.values.get(vr).unwrap().clone())
            .collect()
    }
}

#[test]
fn it_steers_towards_the_path() {
    let mut unit = Unit::new();
    unit.initialize().unwrap();
    assert_eq!(unit.real("steer_cmd"), 0.0);
    unit.step(0, 0.02);
    assert!((unit.real("e1") - 0.2).abs() < 1e-3, "{}", unit.real("e1"));
    assert!(unit.real("steer_cmd") < 0.0);
    assert_eq!(unit.values.integer(Unit::vr("status")), 1);
    assert!((unit.real("predicted.e1[16]") - unit.real("e1")).abs() < 0.2);
}

#[test]
fn it_computes_at_its_sample_time_and_holds_between() {
    let mut unit = Unit::new();
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

#[test]
fn a_saved_state_continues_bit_for_bit() {
    let mut unit = Unit::new();
    unit.initialize().unwrap();
    for k in 0..50 {
        unit.step(k, 0.01);
    }
    let (mut bytes, values) = (Vec::new(), unit.values.clone());
    unit.model.save(&mut bytes);
    let mut other = Unit::new();
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

#[test]
fn a_truncated_state_is_refused_and_changes_nothing() {
    let mut unit = Unit::new();
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
    let mut unit = Unit::new();
    unit.set("vehicle_file", Value::String("bmw_320i".into()));
    unit.set("vehicle.mass", Value::Real(1234.0));
    unit.initialize().unwrap();
    assert_eq!(unit.real("vehicle.mass"), 1234.0);
    let bmw = rfl_mpc::vehicle::builtin("bmw_320i").unwrap().single_track();
    assert_eq!(unit.real("vehicle.yaw_inertia"), bmw.yaw_inertia);
    assert_eq!(unit.real("tyre.front.stiffness"), bmw.cf);
}

#[test]
fn files_that_cannot_be_used_are_named_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let foreign = folder.path().join("foreign.rflm");
    std::fs::write(&foreign, "not a model").unwrap();
    let nan = folder.path().join("nan.csv");
    std::fs::write(&nan, "x,y\n0,0\n1,0\n2,nan\n3,0\n").unwrap();
    for (name, value, words) in [
        ("path_file", "nowhere.csv", &["nowhere.csv", "path_file"][..]),
        ("path_file", nan.to_str().unwrap(), &["nan.csv", "4"]),
        ("vehicle_file", "nowhere.toml", &["nowhere.toml", "c_class"]),
        ("residual.file", "nowhere.rflm", &["nowhere.rflm"]),
        ("residual.file", foreign.to_str().unwrap(), &["foreign.rflm"]),
    ] {
        let mut unit = Unit::new();
        unit.set(name, Value::String(value.into()));
        let message = unit.initialize().unwrap_err().to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    }
}

#[test]
fn a_variant_without_its_model_says_what_is_missing_and_how_to_make_it() {
    let mut unit = Unit::new();
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

#[test]
fn the_known_actuator_is_a_variant() {
    let steered = |parameters: &[(&str, Value)]| {
        let mut unit = Unit::new();
        parameters.iter().for_each(|(name, value)| unit.set(name, value.clone()));
        unit.initialize().unwrap();
        (0..20).for_each(|k| unit.step(k, 0.02));
        (unit.real("steer_cmd"), unit.real("actuator.dead_time"))
    };
    let variant = ("variant", Value::Integer(7));
    let nominal = steered(&[]).0;
    // Without dead time and lag it is the nominal controller.
    assert!((steered(std::slice::from_ref(&variant)).0 - nominal).abs() < 1e-9);
    let slow = steered(&[
        variant,
        ("actuator.dead_time", Value::Real(0.06)),
        ("actuator.time_constant", Value::Real(0.1)),
    ]);
    assert_eq!(slow.1, 0.06);
    assert!((slow.0 - nominal).abs() > 1e-4, "{} {nominal}", slow.0);
}
