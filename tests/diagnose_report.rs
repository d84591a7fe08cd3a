//! The diagnosis' page: complete, in one file, safe, and drawn from whatever a diagnosis holds.

use crate::diagnosed::{diagnosed, steering};
use quick_xml::events::Event;
use rfl_mpc::diagnose::page::{PageInput, page};
use rfl_mpc::diagnose::{Diagnosis, Report, Series, VerdictKind};
use rfl_mpc::log::CleanLog;

fn shown(log: &CleanLog, diagnosis: &Diagnosis) -> String {
    let files = [("calibrated.toml".to_owned(), "the vehicle".to_owned())];
    page(&PageInput { diagnosis, log, wheelbase: 2.6, steering: &steering, files: &files })
}

/// Checks every drawing of a page, and counts them.
fn drawings(page: &str) -> usize {
    let mut count = 0;
    for (from, _) in page.match_indices("<svg") {
        let to = from + page[from..].find("</svg>").expect("every drawing ends") + 6;
        let mut reader = quick_xml::Reader::from_str(&page[from..to]);
        loop {
            match reader.read_event() {
                Ok(Event::Eof) => break,
                Ok(_) => {}
                Err(error) => panic!("{error}: {}", &page[from..to.min(from + 400)]),
            }
        }
        assert!(!page[from..to].contains("NaN") && !page[from..to].contains("#0100"));
        count += 1;
    }
    count
}

#[test]
fn the_page_tells_everything_and_stands_alone() {
    let (log, diagnosis) = diagnosed();
    let page = shown(&log, &diagnosis);
    std::fs::write(std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("report.html"), &page).unwrap();
    for part in [
        "steer_delay = 0.118 s",
        "93\u{a0}%",
        "cannot tell it from steer_lag",
        "recalibration",
        "noise floor",
        "With the loop closed",
        "class='on'>command",
        "steer rate (rad/s)",
        "Understeer",
        "Yaw gain",
        "Command and angle",
        "coherence",
        "on the way driven",
        "explains the log best",
        "34 % of grip reached",
        "frequency sweep",
        "vehicle.mass",
        "calibrated.toml",
        "3 gaps",
        "00c0ffee00c0ffee",
    ] {
        assert!(page.contains(part), "no '{part}'");
    }
    // Two signals with two drawings each, two ways, three curves, three of frequency.
    assert_eq!(drawings(&page), 12);
    for outside in ["<script", "src=", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    // Links go to sections of the page, and each section has one.
    let links: Vec<&str> = page.split("href='").skip(1).filter_map(|rest| rest.split('\'').next()).collect();
    assert_eq!(page.matches("href=").count(), links.len());
    assert_eq!(page.matches("<section").count(), links.len());
    for link in links {
        let target = link.strip_prefix('#').expect("a place on the page");
        assert!(page.contains(&format!("id='{target}'")), "{link}");
    }
    let addresses = page.matches("http").count();
    assert_eq!(addresses, page.matches("http://www.w3.org/2000/svg").count());
    assert!(
        page.contains("late &lt;script&gt;alert(1)&lt;/script&gt;.csv")
            && page.contains("C-class &quot;car&quot;")
    );
    assert!(page.len() < 2_000_000, "{}", page.len());
}

#[test]
fn every_kind_of_verdict_has_its_page_however_little_is_known() {
    let (log, full) = diagnosed();
    for kind in [VerdictKind::Effect, VerdictKind::None, VerdictKind::NotInLibrary, VerdictKind::CannotTell] {
        let mut report = full.report.clone();
        report.verdict.kind = kind;
        report.verdict.effects.clear();
        (report.stage, report.next_manoeuvre) = (None, None);
        report.location.clear();
        report.candidates.clear();
        report.gap_reduction = Default::default();
        report.observability.clear();
        report.recalibration.clear();
        let diagnosis = Diagnosis { report, series: Series::default() };
        let page = shown(&log, &diagnosis);
        assert_eq!(drawings(&page), 0);
        assert!(page.contains(&format!("class='banner {}'", kind.name())) && page.ends_with("</html>\n"));
    }
}

#[test]
fn gaps_of_nothing_and_of_no_number_are_shown() {
    let (log, mut diagnosis) = diagnosed();
    for gap in diagnosis.report.gap_reduction.open_loop.values_mut() {
        (gap.before, gap.effect, gap.learnable) = (0.0, f64::NAN, Some(f64::INFINITY));
    }
    for column in diagnosis.series.simulated.values_mut() {
        column.iter_mut().step_by(3).for_each(|value| *value = f64::NAN);
    }
    // Position is missing: the way is made from speed and yaw rate.
    diagnosis.series.log.remove("x");
    let page = shown(&log, &diagnosis);
    assert!(drawings(&page) > 8 && page.contains("made from speed and yaw rate"));
}

#[test]
fn report_json_is_the_contract_and_comes_back() {
    let (_, diagnosis) = diagnosed();
    let json = serde_json::to_value(&diagnosis.report).unwrap();
    assert_eq!(json["verdict"]["kind"], "effect");
    assert_eq!(json["verdict"]["effects"][0]["id"], "steer_delay");
    assert_eq!(json["location"][0]["signal"], "yaw_rate");
    assert!(json["gap_reduction"]["open_loop"]["yaw_rate"]["before"].as_f64().unwrap() > 0.0);
    assert!(json["gap_reduction"]["closed_loop"]["e1"]["recalibrated"].is_number());
    // The keys of the version before hold the same.
    for (key, former) in [("location", "where"), ("gap_reduction", "shrink")] {
        assert_eq!(json[key], json[former]);
    }
    assert_eq!(json["verdict"]["summary"], json["verdict"]["words"]);
    assert_eq!(json["findings"][0]["summary"], json["findings"][0]["words"]);
    assert_eq!(json["next_manoeuvre"]["also"], json["next_manoeuvre"]["besides"]);
    let report: Report = serde_json::from_value(json).unwrap();
    assert_eq!(report.verdict.headline(), "effect: steer_delay = 0.118 s (0.111 to 0.126), probability 0.93");
}
