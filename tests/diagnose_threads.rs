//! The answer has the same bits on any number of threads.

use crate::diagnose;

use diagnose::{found, log};
use rfl_mpc::diagnose::Options;

#[test]
fn one_and_two_threads_give_the_same_bits() {
    let log = log(5, &[("steer_offset", 0.02)]);
    let on = |threads| {
        let report = found(&log, &Options { threads, ..Options::default() }).report;
        serde_json::to_string(&report).expect("a report is JSON")
    };
    assert_eq!(on(1), on(2));
}
