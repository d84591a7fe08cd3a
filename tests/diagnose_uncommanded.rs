//! A log without the steering command says that what lies before the sensor is not seen, and names none of it.

use crate::diagnose::{found, log, singles};

#[test]
fn without_a_command_a_delay_is_not_observable() {
    let mut log = log(7, &[("steer_delay", 0.15)]);
    let steer = log.columns["steer"].clone();
    log.columns.insert("steer_cmd", steer);
    log.commanded = false;
    let report = found(&log, &singles()).report;
    for id in ["steer_delay", "steer_lag", "steer_rate_limit", "steer_backlash"] {
        let entry = report.observability.iter().find(|entry| entry.effect == id).expect("listed");
        assert!(!entry.observable && entry.why.contains("not the command"), "{entry:?}");
        assert!(report.candidates.iter().all(|candidate| candidate.effects != [id]));
    }
    assert!(report.verdict.effects.iter().all(|effect| effect.id != "steer_delay"));
}
