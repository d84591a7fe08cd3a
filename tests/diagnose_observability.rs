//! What a log is said to show is what it shows: effects clearly larger than the least that is announced are named, clearly
//! smaller ones are left to the tolerances.

use crate::diagnose::{found, log, singles};

#[test]
fn what_is_announced_is_named_and_less_is_not() {
    const SEED: u64 = 12;
    let sound = found(&log(SEED, &[]), &singles()).report;
    for id in ["steer_offset", "yaw_rate_bias", "lateral_accel_bias", "road_bank"] {
        let entry = sound.observability.iter().find(|entry| entry.effect == id).unwrap();
        let (least, from) = (entry.least.unwrap(), entry.named_from.unwrap());
        // Evidence is at most the square of how many tolerances an effect is off: ten of it ask for three at least.
        let tolerance = sound.inputs.tolerances[&format!("effect.{id}")];
        assert!(
            entry.observable && from > least && from > 3.0 * tolerance && from < 6.0 * tolerance,
            "{entry:?}"
        );
        assert!(entry.why.contains("named from"), "{entry:?}");
        for (times, is_named) in [(0.4, false), (1.6, true)] {
            let verdict = found(&log(SEED, &[(id, times * from)]), &singles()).report.verdict;
            let named = verdict.effects.iter().any(|effect| effect.id == id);
            assert_eq!(named, is_named, "{times} times {from}: {verdict:?}");
        }
    }
}
