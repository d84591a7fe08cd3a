//! `rfl diagnose`: verdict, exit status and files for a log with something in it; honest words for bad logs.

use crate::command::{rfl, road, text};
use rfl_mpc::diagnose::{Report, VerdictKind};
use rfl_mpc::numerics::Random;
use rfl_mpc::vehicle::{CarParameters, TruckEffects};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Noise of a test car's sensors.
const NOISE: [(&str, f64); 10] = [
    ("x", 0.005),
    ("y", 0.005),
    ("yaw", 5e-4),
    ("vx", 0.02),
    ("vy", 0.02),
    ("yaw_rate", 2e-3),
    ("ax", 0.05),
    ("ay", 0.05),
    ("steer", 5e-4),
    ("roll", 5e-4),
];

/// A folder with `late.csv`, the drive of a car that steers 0.12 s late, as a test car would record it.
static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let road = road();
    let late = ["--set", "effect.steer_delay=0.12", "--log", "exact.csv"];
    let output =
        rfl(folder.path(), &[&["drive", "--quiet", "--duration", "45", "--path", &road], &late[..]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let random = std::cell::RefCell::new(Random::new(1));
    // Twelve uniform numbers are nearly Gaussian.
    let normal = || (0..12).map(|_| random.borrow_mut().uniform()).sum::<f64>() - 6.0;
    // What a controller knows of the path, a test car does not record.
    let measured = |_, column: &str, value: f64| match NOISE.iter().find(|(name, _)| *name == column) {
        Some((_, sigma)) => Some(value + sigma * normal()),
        None => ["time", "steer_cmd", "accel_cmd"].contains(&column).then_some(value),
    };
    write_changed(folder.path(), "exact.csv", "late.csv", measured);
    folder
});

/// The late car's log with a change to each row's fields, by header.
fn changed(name: &str, change: impl Fn(usize, &str, f64) -> Option<f64>) -> PathBuf {
    write_changed(FOLDER.path(), "late.csv", name, change)
}

/// A log in the folder as another one, each field changed.
fn write_changed(
    folder: &Path,
    from: &str,
    to: &str,
    change: impl Fn(usize, &str, f64) -> Option<f64>,
) -> PathBuf {
    let text = std::fs::read_to_string(folder.join(from)).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut out = header.join(",") + "\n";
    for (row, line) in lines.enumerate() {
        let fields = header.iter().zip(line.split(',')).map(|(column, field)| {
            field
                .parse()
                .ok()
                .and_then(|value| change(row, column, value))
                .map_or(String::new(), |value| value.to_string())
        });
        out += &(fields.collect::<Vec<_>>().join(",") + "\n");
    }
    let file = folder.join(to);
    std::fs::write(&file, out).unwrap();
    file
}

#[test]
fn a_late_steering_is_named_and_everything_is_written() {
    let folder = FOLDER.path();
    let road = road();
    let output = rfl(folder, &["diagnose", "late.csv", "--quiet", "--no-pairs", "--path", &road]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(3), "{said}\n{}", text(&output.stderr));
    assert!(said.starts_with("effect: steer_delay = 0.1"), "{said}");
    let out = folder.join("out/diagnosis");
    let report: Report = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    assert_eq!(report.verdict.kind, VerdictKind::Effect);
    let named = &report.verdict.effects[0];
    assert!(named.id == "steer_delay" && (named.value - 0.12).abs() < 0.02, "{}", named.value);
    assert_eq!(report.inputs.files["log"].file, "late.csv");
    assert_eq!(report.inputs.files["log"].hash.len(), 16);
    let gap = report.gap_reduction.open_loop["yaw_rate"];
    assert!(gap.effect < 0.5 * gap.before, "{gap:?}");
    let tracking = report.gap_reduction.closed_loop.unwrap()["e1"];
    // Position is known to 5 mm only: what counts is the gap beyond the noise.
    let beyond = |gap: f64| (gap * gap - tracking.noise * tracking.noise).max(0.0).sqrt();
    assert!(tracking.noise > 0.0 && beyond(tracking.effect) < 0.5 * beyond(tracking.before), "{tracking:?}");
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("steer_delay") && page.contains("<svg") && page.contains("With the loop closed"));

    // The calibrated simulator drives.
    let found = CarParameters::read(&out.join("calibrated.toml")).unwrap();
    assert!((found.effect.steer_delay + found.steering.dead_time - 0.12).abs() < 0.03, "{:?}", found.effect);
    let drive = ["drive", "--quiet", "--duration", "5", "--vehicle", "out/diagnosis/calibrated.toml"];
    let output = rfl(folder, &drive);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for (file, name) in
        [("calibrated.ssv", "\"effect.steer_delay\""), ("system.ssv", "\"PassengerCar.effect.steer_delay\"")]
    {
        assert!(std::fs::read_to_string(out.join(file)).unwrap().contains(name), "{file}");
    }
}

#[test]
fn two_drives_of_one_vehicle_are_one_log() {
    let [early, late] = [("early.csv", 0..1200), ("rest.csv", 1200..usize::MAX)].map(|(name, rows)| {
        changed(name, |row, _, value| rows.contains(&row).then_some(value)).to_str().unwrap().to_owned()
    });
    let judged = |logs: &[&str]| {
        let more = ["--quiet", "--no-pairs", "--out", "two", "--json"];
        let output = rfl(FOLDER.path(), &[&["diagnose"], logs, &more].concat());
        assert_eq!(output.status.code(), Some(3), "{}", text(&output.stderr));
        let report: Report = serde_json::from_slice(&output.stdout).unwrap();
        let named = &report.verdict.effects[0];
        assert!(named.id == "steer_delay" && (named.value - 0.12).abs() < 0.02, "{named:?}");
        let rival = &report.candidates[1];
        assert!(rival.collinearity.is_some_and(|cosine| cosine.abs() <= 1.0), "{rival:?}");
        assert_eq!(report.inputs.files.contains_key("log 2"), logs.len() == 2);
        report.inputs.duration
    };
    let (apart, both) = (judged(&[&early]) + judged(&[&late]), judged(&[&early, &late]));
    assert!((both - apart).abs() < 0.1, "{both} s of both, {apart} s of each");
    let output = rfl(
        FOLDER.path(),
        &["diagnose", &early, &late, "--quiet", "--no-pairs", "--path", &road(), "--out", "open", "--json"],
    );
    // The road of both is known, the loop is closed along none.
    assert_eq!(output.status.code(), Some(3), "{}", text(&output.stderr));
    let report: Report = serde_json::from_slice(&output.stdout).unwrap();
    let open = report
        .findings
        .iter()
        .any(|it| it.summary.contains("the loop was not closed: it is closed along one drive"));
    assert!(open && report.gap_reduction.closed_loop.is_none(), "{:?}", report.findings);
}

#[test]
fn a_suspect_log_is_never_given_a_name() {
    let other = changed("other.csv", |_, column, value| {
        Some(if column.starts_with("steer") { 2.5 * value } else { value })
    });
    let arguments =
        ["diagnose", other.to_str().unwrap(), "--quiet", "--no-pairs", "--out", "suspect", "--json"];
    let output = rfl(FOLDER.path(), &arguments);
    assert_eq!(output.status.code(), Some(5), "{}", text(&output.stderr));
    let report: Report = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report.verdict.kind, VerdictKind::CannotTell);
    assert!(
        report.verdict.effects.is_empty() && report.verdict.summary.contains("another vehicle"),
        "{}",
        report.verdict.summary
    );
    assert!(!FOLDER.path().join("suspect/calibrated.toml").exists());
    assert!(FOLDER.path().join("suspect/report.html").exists());
}

/// A log without some of its columns.
fn without(folder: &Path, from: &str, to: &str, dropped: &[&str]) {
    let text = std::fs::read_to_string(folder.join(from)).unwrap();
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let keep = |line: &str| {
        let fields = line.split(',').zip(&header).filter(|(_, name)| !dropped.contains(name));
        fields.map(|(field, _)| field).collect::<Vec<_>>().join(",")
    };
    std::fs::write(folder.join(to), text.lines().map(keep).collect::<Vec<_>>().join("\n")).unwrap();
}

#[test]
fn a_cars_log_is_told_from_that_of_a_truck_whose_trailer_nobody_measured() {
    let drive =
        ["drive", "--quiet", "--duration", "60", "--vehicle", "truck_simulation", "--log", "truck.csv"];
    let output = rfl(FOLDER.path(), &[&drive[..], &["--path", "truck_test"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    without(FOLDER.path(), "truck.csv", "tractor.csv", &["articulation", "articulation_rate"]);
    for (log, is_other) in [("late.csv", true), ("tractor.csv", false)] {
        let with = ["--vehicle", "truck_simulation", "--quiet", "--no-pairs", "--out", "towed", "--json"];
        let output = rfl(FOLDER.path(), &[&["diagnose", log][..], &with].concat());
        let report: Report = serde_json::from_slice(&output.stdout).unwrap();
        let said = report.findings.iter().any(|it| it.summary.contains("another vehicle drove"));
        assert_eq!(said, is_other, "{log}: {:?}", report.findings);
        assert!(!is_other || report.verdict.kind == VerdictKind::CannotTell, "{}", report.verdict.summary);
    }
}

#[test]
fn what_cannot_be_used_is_refused_with_the_reason() {
    let short = changed("short.csv", |row, _, value| (row < 100).then_some(value));
    let turned =
        changed("turned.csv", |_, column, value| Some(if column == "yaw_rate" { -value } else { value }));
    let wheel = changed("wheel.csv", |_, column, value| {
        Some(if column.starts_with("steer") { 15.8 * value } else { value })
    });
    let standing =
        changed("standing.csv", |_, column, value| Some(if column == "time" { value } else { 0.0 }));
    let empty = FOLDER.path().join("empty.csv");
    std::fs::write(&empty, "time,steer_cmd,vx,yaw_rate\n").unwrap();
    for (file, words) in [
        (&short, "at least 10 s"),
        (&turned, "yaw_rate has the opposite sign"),
        (&wheel, "steering-wheel angle"),
        (&standing, "faster than 2 m/s"),
        (&empty, "0 rows"),
        (&FOLDER.path().join("missing.csv"), "missing.csv"),
    ] {
        let output = rfl(FOLDER.path(), &["diagnose", file.to_str().unwrap(), "--quiet", "--out", "refused"]);
        assert_eq!(output.status.code(), Some(1), "{}: {}", file.display(), text(&output.stdout));
        let said = text(&output.stderr);
        assert!(said.starts_with("error: ") && said.contains(words), "{said}");
        assert!(output.stdout.is_empty());
    }
    assert!(!FOLDER.path().join("refused").exists());
}

#[test]
fn usage_is_checked() {
    let folder = FOLDER.path();
    for arguments in [
        &["diagnose"][..],
        &["diagnose", "late.csv", "--controller", "a.rflm"],
        &["diagnose", "late.csv", "--unit", "ship"],
    ] {
        assert_eq!(rfl(folder, arguments).status.code(), Some(2), "{arguments:?}");
    }
    let disagree = ["diagnose", "late.csv", "--quiet", "--unit", "truck", "--vehicle", "c_class"];
    let output = rfl(folder, &disagree);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("is a car"));
    let nothing = rfl(folder, &["diagnose", "late.csv", "--quiet", "--without", "steer_dely"]);
    assert!(text(&nothing.stderr).contains("steer_dely"), "{}", text(&nothing.stderr));
    assert!(text(&rfl(folder, &["diagnose", "--help"]).stdout).contains("4 not_in_library"));
}

#[test]
fn effects_are_explained() {
    let all = text(&rfl(FOLDER.path(), &["diagnose", "--explain"]).stdout);
    assert!(TruckEffects::all().all(|effect| all.contains(&format!("effect.{} of", effect.id))));
    let one = rfl(FOLDER.path(), &["diagnose", "--explain", "effect.steer_delay"]);
    assert_eq!(one.status.code(), Some(0));
    let one = text(&one.stdout);
    assert!(
        one.starts_with("steer_delay ") && one.contains("sensor_delay") && one.contains("PassengerCar"),
        "{one}"
    );
    let output = rfl(FOLDER.path(), &["diagnose", "--explain", "steer_dely"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("did you mean steer_delay?"), "{}", text(&output.stderr));
}
