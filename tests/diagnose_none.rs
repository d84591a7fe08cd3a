//! On logs whose vehicle is within the tolerances of its model nothing is named.

mod diagnose;

use diagnose::{found, log, singles};
use rfl_mpc::diagnose::VerdictKind;

#[test]
fn nothing_is_named_on_a_sound_log() {
    for seed in [11, 12] {
        let verdict = found(&log(seed, &[]), &singles()).report.verdict;
        assert_eq!(verdict.kind, VerdictKind::None, "seed {seed}: {verdict:?}");
        assert!(verdict.effects.is_empty());
    }
}
