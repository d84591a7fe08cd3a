//! The outcome of a drive: the same word in text, JSON, JUnit file and exit status; log and results are written whatever
//! happens.

use crate::command::{refused, rfl, road, text};
use rfl_mpc::control::{ControlStatus, Controller, ControllerParameters};
use rfl_mpc::log::DriveLog;
use rfl_mpc::path::{Closure, Path as Road, Sample};
use rfl_mpc::simulate::{ClosedLoop, End, LaneLimits, Outcome, SensorNoise, TIME};
use rfl_mpc::vehicle::{Car, Effects, builtin};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;

/// Drives the turns with options, writes log, results and test cases; exit status, text and results.
fn drive(folder: &Path, options: &[&str]) -> (Option<i32>, String, Value) {
    let road = road();
    let files = ["--log", "out/drive.csv", "--json", "out/drive.json", "--junit", "out/drive.xml"];
    let path = if options.contains(&"--path") { vec![] } else { vec!["--path", &road] };
    let output = rfl(folder, &[&["drive", "--quiet"], &path[..], &files, options].concat());
    let said = text(&output.stdout);
    let json =
        std::fs::read(folder.join("out/drive.json")).unwrap_or_else(|_| panic!("{}", text(&output.stderr)));
    (output.status.code(), said, serde_json::from_slice(&json).unwrap())
}

/// Names of the test cases of a JUnit file, and which failed.
fn cases(file: &Path) -> Vec<(String, bool)> {
    use quick_xml::events::Event;
    let xml = std::fs::read_to_string(file).unwrap();
    let mut reader = quick_xml::Reader::from_str(&xml);
    let mut cases: Vec<(String, bool)> = Vec::new();
    loop {
        match reader.read_event().unwrap() {
            Event::Eof => return cases,
            Event::Start(element) if element.name().as_ref() == "testcase" => {
                let name = element.try_get_attribute("name").unwrap().unwrap();
                let name = name.normalized_value(quick_xml::XmlVersion::Implicit1_0).unwrap();
                cases.push((name.into_owned(), true));
            }
            Event::Start(element) if element.name().as_ref() == "failure" => {
                cases.last_mut().unwrap().1 = false;
            }
            _ => {}
        }
    }
}

#[test]
fn a_road_driven_to_its_end_is_completed() {
    let folder = tempfile::tempdir().unwrap();
    let (status, said, json) = drive(folder.path(), &[]);
    assert_eq!(status, Some(0), "{said}");
    assert!(said.contains("outcome: completed: ") && !said.contains("next:"), "{said}");
    assert_eq!((json["outcome"].as_str(), json["finished"].as_bool()), (Some("completed"), Some(true)));
    assert!(json["left_lane"].is_null());
    assert_eq!(
        json["largest"]["lateral_error"].as_f64().unwrap().abs(),
        json["tracking"]["max"].as_f64().unwrap()
    );
    assert_eq!(cases(&folder.path().join("out/drive.xml")), [("outcome".to_owned(), true)]);

    // The last column of the log is the controller's word for each row, and no reader minds it.
    let log = folder.path().join("out/drive.csv");
    let lines = std::fs::read_to_string(&log).unwrap();
    assert!(lines.lines().next().unwrap().ends_with(",status"));
    let last = |line: &str| line.rsplit(',').next().unwrap().to_owned();
    assert!(lines.lines().skip(1).map(last).all(|word| ControlStatus::ALL.iter().any(|s| s.name() == word)));
    assert_eq!(last(lines.lines().last().unwrap()), "finished");
    let read = DriveLog::read(&log).unwrap();
    assert_eq!(read.column("time").unwrap().len(), lines.lines().count() - 1);
    assert!(read.column("status").is_none());
}

#[test]
fn a_drive_off_the_road_is_lost_though_it_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    // A lane that no controller keeps to: the drive goes on to the road's end, and is lost.
    let (status, said, json) = drive(folder.path(), &["--lane", "0.0002"]);
    assert_eq!(status, Some(4), "{said}");
    assert!(said.contains("outcome: lost: the vehicle was 0.0002") && said.contains("next: "), "{said}");
    assert_eq!((json["outcome"].as_str(), json["finished"].as_bool()), (Some("lost"), Some(false)));
    assert!(json["left_lane"]["time"].as_f64().unwrap() < json["end"]["time"].as_f64().unwrap());
    assert!(json["reason"].as_str().unwrap().contains("later the road was driven to its end"), "{json}");
    assert_eq!(cases(&folder.path().join("out/drive.xml")), [("outcome".to_owned(), false)]);

    // A controller that is far too tight for a very late steering.
    let late = ["effect.steer_delay=0.4", "effect.steer_lag=0.3"];
    let tight = ["horizon=16", "q_e1=1", "q_e1_rate=0", "q_e2=0", "q_e2_rate=0", "r_rate=0.001"];
    let tight = tight.map(|weight| format!("mpc.{weight}"));
    let settings = late.into_iter().chain(tight.iter().map(String::as_str));
    let late: Vec<&str> = settings.flat_map(|setting| ["--set", setting]).collect();
    let (status, said, json) =
        drive(folder.path(), &[&late[..], &["--variant", "none", "--duration", "60"]].concat());
    assert_eq!((status, json["outcome"].as_str()), (Some(4), Some("lost")), "{said}");
}

#[test]
fn a_lost_vehicle_is_not_followed_far_from_its_road() {
    let folder = tempfile::tempdir().unwrap();
    // Ice and a storm: it slides off, and never stands.
    let storm = ["--set", "effect.road_friction=0.05", "--set", "effect.wind_y=40"];
    let (status, said, json) = drive(folder.path(), &storm);
    assert_eq!((status, json["outcome"].as_str()), (Some(4), Some("lost")), "{said}");
    assert!(said.contains("m from its road, and the drive ended there, at "), "{said}");
    let [end, largest] = ["end", "largest"].map(|at| json[at]["lateral_error"].as_f64().unwrap().abs());
    assert!(end == largest && end < 102.0, "{json}");
    let rows = std::fs::read_to_string(folder.path().join("out/drive.csv")).unwrap().lines().count() - 1;
    assert!((rows as f64 * 0.02 - json["end"]["time"].as_f64().unwrap() - 0.02).abs() < 1e-9, "{rows}");
}

#[test]
fn a_plant_that_dies_leaves_log_and_results_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let road = format!("{}/paths/hairpin_circuit.csv", env!("CARGO_MANIFEST_DIR"));
    // A car as high as a wardrobe rolls over in the first hairpin.
    let high = ["--path", &road, "--set", "car.vehicle.cg_height=1.5", "--set", "speed.lateral_accel=8"];
    let (status, said, json) = drive(folder.path(), &high);
    assert_eq!(status, Some(4), "{said}");
    assert_eq!(json["outcome"], "lost");
    assert!(json["reason"].as_str().unwrap().contains("rolled over"), "{json}");
    assert!(said.contains("outcome: lost: ") && said.contains("rolled over"), "{said}");
    let lines = std::fs::read_to_string(folder.path().join("out/drive.csv")).unwrap();
    let rows = lines.lines().count() - 1;
    assert!(rows > 100 && rows as f64 * 0.02 - json["duration"].as_f64().unwrap() < 0.03, "{rows}");
}

#[test]
fn a_vehicle_that_stands_before_the_end_has_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let (status, said, json) = drive(folder.path(), &["--set", "car.drive.max_force=0"]);
    assert_eq!((status, json["outcome"].as_str()), (Some(3), Some("stopped")), "{said}");
    assert!(json["driven"].as_f64().unwrap() < json["length"].as_f64().unwrap() - 5.0);
    assert!(json["duration"].as_f64().unwrap() < 120.0, "the drive ends soon after the stop");
}

#[test]
fn an_outcome_that_is_asked_for_is_no_failure() {
    let folder = tempfile::tempdir().unwrap();
    let stands = ["--set", "car.drive.max_force=0", "--require"];
    for (asked, more, status, met) in [
        ("outcome=stopped", "max_e1<=1", 0, [true; 3]),
        ("outcome=stopped", "max_e1<=1e-9", 6, [true, true, false]),
        ("outcome=completed", "max_e1<=1", 3, [false, false, true]),
    ] {
        let (found, said, json) = drive(folder.path(), &[&stands[..], &[asked, "--require", more]].concat());
        assert_eq!((found, json["outcome"].as_str()), (Some(status), Some("stopped")), "{said}");
        assert_eq!(json["exit_status"], status);
        let cases = cases(&folder.path().join("out/drive.xml"));
        assert_eq!(cases.iter().map(|(_, met)| *met).collect::<Vec<_>>(), met, "{asked}");
    }
    let (found, said, _) = drive(folder.path(), &["--require", "outcome=stopped"]);
    assert_eq!(found, Some(6), "{said}");
}

#[test]
fn a_start_beside_the_lane_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let road = "x,y\n".to_owned() + &(0..200).map(|k| format!("{k},0\n")).collect::<String>();
    std::fs::write(folder.path().join("straight.csv"), road).unwrap();
    let start = ["--path", "straight.csv", "--set", "initial.y=2.6", "--set", "initial.vx=4"];
    let (_, said, json) = drive(folder.path(), &start);
    assert_eq!(json["outcome"], "completed", "{said}");
    assert!(
        said.contains("it began 2.60 m left of its path, beyond the lane's 2 m, and was in its lane from"),
        "{said}"
    );
    assert!(json["tracking"]["max"].as_f64().unwrap() >= 2.6, "{json}");
    assert!(json["entered_lane"]["time"].as_f64().unwrap() > 0.0 && json["left_lane"].is_null(), "{json}");
}

#[test]
fn times_out_of_range_are_refused_with_the_range() {
    let folder = tempfile::tempdir().unwrap();
    for (option, value, words) in [
        ("--step", "1e-9", "--step 0.000000001: give a time between 0.001 and 0.2 s"),
        ("--step", "0", "--step 0: give a time between 0.001 and 0.2 s"),
        ("--step", "nan", "--step NaN: give a time"),
        ("--step", "inf", "--step inf: give a time"),
        ("--duration", "0", "--duration 0: give a time between 0.001 and 86400 s"),
        ("--duration", "1e12", "and 86400 s"),
        ("--lane", "-1", "--lane -1: give a width in m"),
    ] {
        let value = format!("{option}={value}");
        let refusal = refused(&rfl(folder.path(), &["drive", "--quiet", "--path", &road(), &value]));
        assert!(refusal.contains(words), "{refusal}");
    }
}

#[test]
fn files_that_are_one_are_refused_before_anything_is_driven() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..100).map(|k| format!("{k},0\n")).collect();
    let road = format!("x,y\n{rows}");
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("road.csv"), &road).unwrap();
    std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/vehicles/c_class.toml"), at("car.toml")).unwrap();
    let drive = ["drive", "--quiet", "--path", "road.csv"];
    for (more, words) in [
        (&["--log", "x", "--json", "x"][..], "--log and --json are one file, x"),
        (&["--log", "a/x", "--junit", "a/x"], "--log and --junit are one file"),
        (&["--log", "road.csv"], "--log road.csv is the file of --path"),
        (&["--json", "./road.csv"], "is the file of --path"),
        (&["--vehicle", "car.toml", "--json", "car.toml"], "is the file of --vehicle"),
    ] {
        let refusal = refused(&rfl(folder.path(), &[&drive[..], more].concat()));
        assert!(refusal.contains(words), "{refusal}");
    }
    let refusal = refused(&rfl(folder.path(), &["path", "road.csv", "--write", "road.csv"]));
    assert!(refusal.contains("--write road.csv is the file of FILE"), "{refusal}");
    let refusal = refused(&rfl(folder.path(), &["train", "road.csv", "--json", "road.csv"]));
    assert!(refusal.contains("--json road.csv is the file of LOG"), "{refusal}");
    let refusal = refused(&rfl(folder.path(), &["identify", "road.csv", "--json", "road.csv"]));
    assert!(refusal.contains("--json road.csv is the file of LOG"), "{refusal}");
    assert_eq!(std::fs::read_to_string(at("road.csv")).unwrap(), road);
}

#[test]
fn tyres_and_models_that_are_read_are_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir_all(at("v/tyres")).unwrap();
    std::fs::create_dir_all(at("m")).unwrap();
    let vehicles = Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles");
    for (file, to) in [("c_class.toml", "v/car.toml"), ("tyres/c_class.tir", "v/tyres/c_class.tir")] {
        std::fs::copy(vehicles.join(file), at(to)).unwrap();
    }
    std::fs::write(at("m/rfl.rflm"), "a model").unwrap();
    let tyre = std::fs::read(at("v/tyres/c_class.tir")).unwrap();
    let (tir, road) = ("v/tyres/c_class.tir", road());
    for words in [
        &["drive", "--quiet", "--path", &road, "--vehicle", "v/car.toml", "--json", tir][..],
        &["drive", "--quiet", "--path", &road, "--variant", "rfl", "--models", "m", "--log", "m/rfl.rflm"],
        &["train", &road, "--vehicle", "v/car.toml", "--json", tir],
        &["identify", &road, "--vehicle", "v/car.toml", "--json", tir],
        &["identify", &road, "--vehicle", "v/car.toml", "--into", tir],
    ] {
        let refusal = refused(&rfl(folder.path(), words));
        assert!(refusal.contains("would be written over"), "{words:?}: {refusal}");
    }
    assert!(
        std::fs::read(at(tir)).unwrap() == tyre && std::fs::read(at("m/rfl.rflm")).unwrap() == b"a model"
    );
}

#[test]
fn a_call_that_is_wrong_leaves_no_older_junit_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("drive.xml");
    let named = format!("--junit={}", file.display());
    for words in [
        &["--require", "max_e9<=1", "--junit", "drive.xml"][..],
        &["--junit", "drive.xml", "--no-such-option"],
        &[&named, "--step", "0.02s"],
    ] {
        std::fs::write(&file, "<testsuites><testsuite/></testsuites>").unwrap();
        let output = rfl(folder.path(), &[&["drive", "--path", "road.csv"], words].concat());
        assert_eq!(output.status.code(), Some(2));
        let xml = std::fs::read_to_string(&file).unwrap();
        assert!(
            xml.contains("<error ") && xml.contains("rfl.drive.c_class.road") && !xml.contains("Usage"),
            "{xml}"
        );
    }
    // Nobody knows what a wrong call means to name.
    std::fs::write(&file, "x,y\n").unwrap();
    assert_eq!(
        rfl(folder.path(), &["drive", "--junit", "drive.xml", "--no-such-option"]).status.code(),
        Some(2)
    );
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "x,y\n");
}

#[test]
fn a_drive_that_could_not_be_made_is_an_error_in_the_junit_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let xml = || std::fs::read_to_string(at("s.xml")).unwrap();
    let road = road();
    let short = ["drive", "--quiet", "--duration", "0.1", "--junit", "s.xml"];
    let run = |more: &[&str]| rfl(folder.path(), &[&short[..], more].concat());
    assert_eq!(run(&["--path", &road]).status.code(), Some(0));
    // The class names vehicle and road, the folder of a file with it.
    assert!(xml().contains("classname=\"rfl.drive.c_class.paths.sudoku_turns\""), "{}", xml());
    for (more, words) in [
        (&["--path", "none.csv"][..], "none.csv"),
        (&["--path", &road, "--step", "9"], "--step 9"),
        (&["--path", &road, "--log", "x", "--json", "x"], "--log and --json are one file"),
    ] {
        std::fs::write(at("s.xml"), "failures=\"0\"").unwrap();
        refused(&run(more));
        assert!(xml().contains("failures=\"0\" errors=\"1\"") && xml().contains("<error "), "{}", xml());
        assert!(xml().contains(words), "{}", xml());
    }
    assert_eq!(run(&["--path", &road, "--junit-name", "mine"]).status.code(), Some(0));
    assert!(xml().contains("classname=\"mine\"") && xml().contains("errors=\"0\""), "{}", xml());
    // What is a file of another option keeps its content.
    std::fs::write(at("road.csv"), "x,y\n0,0\n").unwrap();
    refused(&rfl(folder.path(), &["drive", "--quiet", "--path", "road.csv", "--junit", "road.csv"]));
    assert_eq!(std::fs::read_to_string(at("road.csv")).unwrap(), "x,y\n0,0\n");
}

#[test]
fn a_start_is_within_its_declared_range() {
    let folder = tempfile::tempdir().unwrap();
    for (setting, words) in [
        ("initial.vx=61", "initial.vx = 61 m/s is outside its range [-60, 60]"),
        ("car.initial.vx=-100", "outside its range [-60, 60]"),
        ("initial.yaw=nan", "a finite number is needed"),
    ] {
        let refusal = refused(&rfl(folder.path(), &["drive", "--quiet", "--set", setting]));
        assert!(refusal.contains(words), "{refusal}");
    }
    let refusal = refused(&rfl(folder.path(), &["collect", "--quiet", "--set", "initial.y=50"]));
    assert!(refusal.contains("only 'rfl drive' takes another start"), "{refusal}");
}

#[test]
fn numbers_with_a_unit_and_a_file_named_by_a_dash_are_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    for (words, said) in [
        (
            &["drive", "--step", "0.02s"][..],
            "'0.02s' is not a number without a unit: Communication step in s",
        ),
        (&["train", "log.csv", "--seed", "-1"], "'-1' is not a whole number from 0 on"),
    ] {
        let output = rfl(folder.path(), words);
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains(said), "{}", text(&output.stderr));
    }
    for words in [&["drive", "--quiet", "--log", "-"][..], &["collect", "--quiet", "--out", "-"]] {
        let refusal = refused(&rfl(folder.path(), words));
        assert!(refusal.contains("name a file"), "{refusal}");
    }
    assert!(!folder.path().join("-").exists());
    assert_eq!(
        rfl(folder.path(), &["course", "--route", "hairpin_circuit", "--out", "-"]).status.code(),
        Some(0)
    );
}

#[test]
fn a_duration_that_was_asked_for_is_no_failure() {
    let folder = tempfile::tempdir().unwrap();
    let (status, said, json) = drive(folder.path(), &["--duration", "2"]);
    assert_eq!((status, json["outcome"].as_str()), (Some(0), Some("timed_out")), "{said}");
    assert_eq!(json["finished"], false);
}

#[test]
fn requirements_turn_figures_into_tests() {
    let folder = tempfile::tempdir().unwrap();
    let asked = ["--require", "max_e1<=1", "--require", "mean_e1 = 1e-6", "--require", "outcome=completed"];
    let (status, said, json) = drive(folder.path(), &asked);
    assert_eq!(status, Some(6), "{said}");
    assert!(said.contains("NOT met: mean_e1 is ") && said.contains("met: max_e1 is "), "{said}");
    let found: Vec<_> =
        json["requirements"].as_array().unwrap().iter().map(|of| of["met"].as_bool()).collect();
    assert_eq!(found, [Some(true), Some(false), Some(true)]);
    let names =
        [("outcome", true), ("max_e1<=1", true), ("mean_e1=1e-6", false), ("outcome=completed", true)];
    let expected = names.map(|(name, met)| (name.to_owned(), met));
    assert_eq!(cases(&folder.path().join("out/drive.xml")), expected);
    let (status, said, _) = drive(folder.path(), &["--require", "max_e1=1", "--require", "driven=0.99"]);
    assert_eq!(status, Some(0), "{said}");

    let output = rfl(folder.path(), &["drive", "--require", "max_e9=1"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("there is no figure 'max_e9'; there are outcome, max_e1, "));
    let help = text(&rfl(folder.path(), &["drive", "--help"]).stdout);
    assert!(help.contains("p99_step_time") && help.contains("4 lost"), "{help}");
}

#[test]
fn files_that_cannot_be_written_are_refused_before_the_drive() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("taken"), "").unwrap();
    for file in ["taken/drive.json", "."] {
        let error = refused(&rfl(folder.path(), &["drive", "--json", file]));
        assert!(error.contains(file), "{error}");
    }
}

/// A car on a straight of 100 m, whose controller is told noisy measurements.
fn noisy(noise: SensorNoise) -> ClosedLoop {
    let samples = (0..=50).map(|k| Sample::at(2.0 * f64::from(k), 0.0)).collect();
    let road = Arc::new(Road::from_samples(samples, Closure::Open).unwrap());
    let car = builtin("c_class").unwrap();
    let mut parameters = ControllerParameters::for_car(&car);
    // Told: undeclared, so much noise is a contradiction.
    parameters.observer.noise_position = parameters.observer.noise_position.max(noise.position);
    let controller = Controller::new(parameters, road).unwrap();
    ClosedLoop::at_start(controller, &car, &Effects::default(), 0.02).unwrap().with_noise(noise, 1)
}

#[test]
fn the_outcome_is_that_of_the_true_place() {
    // Half a metre of noise: beyond this narrow lane by what the controller is told, within it in truth.
    let limits = LaneLimits { lateral_error: 1.0, ..LaneLimits::default() };
    let noise = SensorNoise { position: 0.5, ..SensorNoise::default() };
    let drive = noisy(noise).with_limits(limits).record(60.0, |_, _| true);
    let told = drive.column("e1").iter().fold(0.0_f64, |most, e1| most.max(e1.abs()));
    assert!(told > 1.0, "{told}");
    assert_eq!(drive.ending.outcome, Outcome::Completed, "{}", drive.ending.reason());
    assert!(drive.tracking().max < 1.0 && drive.statuses.len() == drive.rows.len());
}

#[test]
fn a_car_placed_beside_its_lane_has_to_come_back() {
    let samples = (0..=100).map(|k| Sample::at(2.0 * f64::from(k), 0.0)).collect();
    let road = Arc::new(Road::from_samples(samples, Closure::Open).unwrap());
    let parameters = builtin("c_class").unwrap();
    let controller = Controller::new(ControllerParameters::for_car(&parameters), road).unwrap();
    let mut car = Car::new(&parameters, &Effects::default(), None).unwrap();
    car.place(20.0, 3.0, 0.0, 5.0);
    let drive = ClosedLoop::new(controller, car, 0.02).record(60.0, |_, _| true);
    assert_eq!((drive.ending.outcome, &drive.ending.end), (Outcome::Completed, &End::Road));
    assert!(drive.rows[0][TIME] == 0.0 && drive.finished && !drive.lost);
}

#[test]
fn a_long_communication_step_is_the_controllers_sample_time() {
    let folder = tempfile::tempdir().unwrap();
    let road = road();
    let call = ["drive", "--quiet", "--path", &road, "--step", "0.1", "--json", "drive.json"];
    let output = rfl(folder.path(), &call);
    assert!(text(&output.stderr).contains("note: mpc.sample_time = 0.1 s"), "{}", text(&output.stderr));
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
    let json: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("drive.json")).unwrap()).unwrap();
    assert!(json["tracking"]["max"].as_f64().unwrap() < 0.2, "{json}");
    // Whoever sets it has it, and hears of it.
    let output = rfl(folder.path(), &[&call[..], &["--set", "mpc.sample_time=0.01"]].concat());
    assert!(text(&output.stderr).contains("mpc.sample_time, as set"), "{}", text(&output.stderr));
    let refusal = refused(&rfl(folder.path(), &["drive", "--quiet", "--path", &road, "--step", "0.5"]));
    assert!(refusal.contains("--step 0.5") && refusal.contains("0.2"), "{refusal}");
}

#[test]
fn a_road_with_a_kink_is_driven() {
    let there = (0..=50).map(|i| Sample::at(f64::from(i), 0.0));
    let on = |angle: f64| {
        (1..=50).map(move |i| Sample::at(50.0 + f64::from(i) * angle.cos(), f64::from(i) * angle.sin()))
    };
    for (degrees, most) in [(30.0_f64, 0.15), (45.0, 0.5)] {
        let samples = there.clone().chain(on(degrees.to_radians())).collect();
        let road = Arc::new(Road::from_samples(samples, Closure::Open).unwrap());
        let car = builtin("c_class").unwrap();
        let controller = Controller::new(ControllerParameters::for_car(&car), road).unwrap();
        let mut closed = ClosedLoop::at_start(controller, &car, &Effects::default(), 0.02).unwrap();
        let drive = closed.record(90.0, |_, _| true);
        assert_eq!(drive.ending.outcome, Outcome::Completed, "{degrees} degrees: {}", drive.ending.reason());
        assert!(drive.tracking().max < most, "{degrees} degrees: {} m", drive.tracking().max);
    }
}
