//! `rfl tune`: what it writes and says, and that `rfl drive --controller` takes it.

use crate::command;

use command::{done, refused, rfl, text};
use serde_json::Value;
use std::path::Path;

/// Few short drives.
const SMALL: [&str; 11] = [
    "--budget",
    "4",
    "--scenarios",
    "2",
    "--held-out",
    "2",
    "--quiet",
    "--delay-margin",
    "0.02",
    "--gain-margin",
    "1.5",
];

fn json(folder: &Path, file: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join(file)).unwrap()).unwrap()
}

#[test]
fn a_slow_actuator_is_tuned_for_and_the_file_drives() {
    let folder = tempfile::tempdir().unwrap();
    let slow = ["--set", "effect.steer_lag=0.1", "--set", "effect.steer_delay=0.06"];
    let call = [&["tune", "--threads", "2"][..], &slow, &SMALL].concat();
    let said = done(&rfl(folder.path(), &call));
    let found = json(folder.path(), "out/tune/tune.json");
    // The default is lost behind this actuator: anything that stays on the road is better.
    assert_eq!(found["written"], true, "{said}");
    assert!(found["default"]["held_out"]["cost"].as_f64() > found["tuned"]["held_out"]["cost"].as_f64());
    let file = std::fs::read_to_string(folder.path().join("out/tune/controller.toml")).unwrap();
    assert!(
        file.contains("[controller]\n") && file.contains("mpc.horizon = ") && file.contains("kind = \"car\"")
    );
    let page = std::fs::read_to_string(folder.path().join("out/tune/tune.html")).unwrap();
    assert!(page.contains("Margins of the steering loop") && page.matches("<svg").count() >= 5);

    // The same again on another number of threads.
    let again = [&["tune", "--threads", "1", "--out", "again"][..], &slow, &SMALL].concat();
    done(&rfl(folder.path(), &again));
    assert_eq!(std::fs::read_to_string(folder.path().join("again/controller.toml")).unwrap(), file);

    let road = command::road();
    let drive = [
        "drive",
        "--quiet",
        "--path",
        &road,
        "--json",
        "drive.json",
        "--controller",
        "out/tune/controller.toml",
    ];
    done(&rfl(folder.path(), &[&drive[..], &slow].concat()));
    assert_eq!(json(folder.path(), "drive.json")["finished"], true);
    // What is set beside it counts more.
    let refusal = refused(&rfl(folder.path(), &[&drive[..], &["--set", "mpc.horizon=1"]].concat()));
    assert!(refusal.contains("mpc.horizon"), "{refusal}");
    // A car's is none for a truck.
    let truck = ["drive", "--quiet", "--vehicle", "truck_real", "--controller", "out/tune/controller.toml"];
    assert!(refused(&rfl(folder.path(), &truck)).contains("it is for a car"));
}

#[test]
fn what_is_no_better_is_not_handed_over() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("out/tune")).unwrap();
    std::fs::write(folder.path().join("out/tune/controller.toml"), "an older one").unwrap();
    // One candidate: the default itself.
    let call = ["tune", "--budget", "1", "--scenarios", "2", "--held-out", "2", "--quiet"];
    let said = done(&rfl(folder.path(), &call));
    assert!(said.contains("nothing is written"), "{said}");
    assert!(!folder.path().join("out/tune/controller.toml").exists());
    assert_eq!(json(folder.path(), "out/tune/tune.json")["written"], false);
}

#[test]
fn a_road_of_one_s_own_and_bad_input() {
    let folder = tempfile::tempdir().unwrap();
    let road = command::road();
    let call = ["tune", "--path", &road, "--budget", "2", "--scenarios", "2", "--held-out", "2", "--quiet"];
    done(&rfl(folder.path(), &call));
    assert!(
        json(folder.path(), "out/tune/tune.json")["scenarios"]["training"][0]
            .as_str()
            .unwrap()
            .contains("road 1")
    );
    for (arguments, word) in [
        (&["tune", "--vehicle", "none.toml"][..], "none.toml"),
        (&["tune", "--vehicle", "."], "it is a folder"),
        (&["tune", "--budget", "0"], "--budget"),
        (&["tune", "--delay-margin", "-0.1"], "a time in s that is not below 0"),
        (&["tune", "--delay-margin", "NaN"], "a time in s that is not below 0"),
        (&["tune", "--gain-margin", "0.5"], "a factor of 1 or more"),
        (&["tune", "--set", "mpc.q_e9=1"], "mpc.q_e9"),
        (&["tune", "--path", "none.csv"], "none.csv"),
    ] {
        assert!(refused(&rfl(folder.path(), &[arguments, &["--out", "new"]].concat())).contains(word));
        // What is refused leaves nothing.
        assert!(!folder.path().join("new").exists(), "{arguments:?}");
    }
    let help = text(&rfl(folder.path(), &["tune", "--help"]).stdout);
    assert!(help.contains("rfl drive --vehicle my_car.toml --controller"), "{help}");
}
