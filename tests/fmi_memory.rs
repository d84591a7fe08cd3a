//! Memory: 2000 instances come and go without growth, and steps, sets and gets allocate nothing.

use crate::common::*;
use crate::counting::allocated;
use rfl_mpc::fmi::v2::Status;

/// A short life with everything that owns memory; states are left to the instance.
fn live() {
    let host = Host::new();
    assert_eq!(host.set_string(vr::FILE, c""), Status::Ok);
    host.initialize();
    assert_eq!(host.step(0.0, 0.1), Status::Ok);
    let state = host.store();
    let (status, other) = host.deserialize(&host.serialize(state));
    assert_eq!((status, host.restore(other)), (Status::Ok, Status::Ok));
    assert_eq!(host.string(vr::SOURCE), "parameter");
    assert_eq!(host.set_real(vr::COUNT, 0.0), Status::Error);
    assert_eq!(host.free_state(state), Status::Ok);
}

#[test]
fn two_thousand_instances_leave_nothing_behind() {
    live();
    assert_eq!(allocated(|| (0..2000).for_each(|_| live())).1, 0);
}

#[test]
fn steps_sets_and_gets_allocate_nothing() {
    let host = Host::ready();
    assert_eq!(host.step(0.0, 0.01), Status::Ok);
    let (count, _) = allocated(|| {
        for k in 1..1000 {
            assert_eq!(host.set_real(vr::STEER_CMD, 0.001 * f64::from(k)), Status::Ok);
            assert_eq!(host.set_boolean(vr::ENABLED, 1), Status::Ok);
            assert_eq!(host.step(f64::from(k) * 0.01, 0.01), Status::Ok);
            assert!(
                host.real(vr::STEER) > 0.0 && host.integer(vr::STEPS) > 0 && host.boolean(vr::MOVING) == 1
            );
        }
    });
    assert_eq!(count, 0);
}
