//! Logs without time stamps, at a constant rate: `--rate`.

use crate::command::{done, refused, rfl, road};
use std::path::Path;

/// A log without its column `time`.
fn timeless(folder: &Path, log: &str, to: &str) {
    let text = std::fs::read_to_string(folder.join(log)).unwrap();
    let time = text.lines().next().unwrap().split(',').position(|name| name == "time").unwrap();
    let rows = text.lines().map(|line| {
        let fields = line.split(',').enumerate().filter(|(place, _)| *place != time);
        fields.map(|(_, field)| field).collect::<Vec<_>>().join(",")
    });
    std::fs::write(folder.join(to), rows.collect::<Vec<_>>().join("\n")).unwrap();
}

#[test]
fn a_rate_stands_in_for_the_clock_in_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| rfl(folder.path(), arguments);
    done(&run(&["collect", "--path", &road(), "--runs", "1", "--out", ".", "--quiet"]));
    timeless(folder.path(), "drive_1.csv", "plain.csv");
    let train = ["train", "--quiet", "--no-proof", "--trees", "3", "--depth", "3"];
    let diagnose = ["diagnose", "--no-pairs", "--quiet", "--out", "report"];
    for command in [&train[..], &["identify"], &diagnose] {
        let of = |more: &[&str]| run(&[command, more].concat());
        let error = refused(&of(&["plain.csv"]));
        assert!(error.contains("time") && error.contains("plain.csv"), "{error}");
        let error = refused(&of(&["drive_1.csv", "--rate", "50"]));
        assert!(error.contains("there is a time column"), "{error}");
        let [with, without] = [of(&["drive_1.csv"]), of(&["plain.csv", "--rate", "50"])];
        assert_eq!(with.status.code(), without.status.code(), "{command:?}");
        let wrong = of(&["plain.csv", "--rate", "0"]);
        assert_eq!(wrong.status.code(), Some(2));
    }
    let said = done(&run(&[&train[..], &["plain.csv", "--rate", "50"]].concat()));
    assert!(said.contains("made from the rate of 50 Hz"), "{said}");
    let log = std::fs::read_to_string(folder.path().join("drive_1.csv")).unwrap();
    let copies = (1 << 20) / log.len() + 1;
    std::fs::write(folder.path().join("large.csv"), log.repeat(copies)).unwrap();
    let error = refused(&run(&["identify", "large.csv", "--limit", "1"]));
    assert!(error.contains("large.csv") && error.contains("1 MB"), "{error}");
}
