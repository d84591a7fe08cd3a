//! `rfl learn`: the whole ladder in one command, and what it leaves behind.

use crate::command::{rfl, road, text};
use serde_json::Value;

#[test]
fn one_command_leaves_logs_controller_file_and_report() {
    let folder = tempfile::tempdir().unwrap();
    let road = road();
    let more = ["--set", "effect.steer_lag=0.1", "--set", "effect.steer_delay=0.06"];
    let known = ["learn", "--quiet", "--roads", "0", "--path", &road, "--test", &road, "--out", "out"];
    let output = rfl(folder.path(), &[&known[..], &more].concat());
    let out = folder.path().join("out");
    let report: Value = serde_json::from_slice(&std::fs::read(out.join("learn.json")).unwrap()).unwrap();
    // A model, or the reason for which there is none: never both; the exit status says whether anything is better.
    let written = out.join("model.rflm").is_file();
    let better = report["recommended"] != "default";
    assert_eq!(output.status.code(), Some(if better { 0 } else { 3 }), "{report}");
    assert_eq!(written, report["refused"].is_null(), "{report}");
    assert!(out.join("controller.toml").is_file() && out.join("collect_1.csv").is_file());
    let both = ["dead_time", "lag"].map(|name| report["steering"][name].as_f64().unwrap());
    // 0.06 s of dead time, 0.1 s of lag and the file's own 0.05 s.
    assert!((both[0] + both[1] - 0.21).abs() < 0.03, "{both:?}");
    // What comes next is of the vehicle that was learned.
    let said = text(&output.stdout);
    let next = said.lines().find(|line| line.contains("rfl drive --vehicle")).unwrap();
    assert!(next.contains("--set effect.steer_lag=0.1 --set effect.steer_delay=0.06"), "{said}");
}

#[test]
fn a_straight_road_alone_is_refused_and_beside_others_left_out() {
    let folder = tempfile::tempdir().unwrap();
    // Along the x axis, and at an angle with rounded points.
    for (name, [dx, dy]) in [("east.csv", [1.0, 0.0]), ("north_east.csv", [0.6, 0.8])] {
        let points: String =
            (0..200).map(f64::from).map(|s| format!("{:.3},{:.3}\n", s * dx, s * dy)).collect();
        std::fs::write(folder.path().join(name), format!("x,y\n{points}")).unwrap();
        let output = rfl(folder.path(), &["learn", "--quiet", "--roads", "0", "--path", name]);
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(
            error.contains(&format!("{name}: the road is straight")) && error.contains("--roads"),
            "{error}"
        );
        assert!(!folder.path().join("out").exists());
    }
    let road = road();
    let slow = ["--set", "effect.steer_lag=0.1", "--set", "effect.steer_delay=0.06"];
    let known = ["learn", "--quiet", "--roads", "1", "--path", "east.csv", "--test", &road];
    let output = rfl(folder.path(), &[&known[..], &slow].concat());
    let said = text(&output.stdout);
    assert!(
        said.contains("the first drive is left out: out/learn/drive.csv: yaw_rate never changes"),
        "{said}"
    );
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("out/learn/learn.json")).unwrap()).unwrap();
    assert!(!report["refused"].to_string().contains("yaw_rate"), "{report}");
}
