//! Memory: 2000 instances come and go without growth, and steps, sets and gets allocate nothing.

mod common;

use common::*;
use rfl_mpc::fmi::abi::Status;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Counts what the calling thread allocates.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static BYTES: Cell<i64> = const { Cell::new(0) };
}

// SAFETY: hands everything on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        BYTES.set(BYTES.get() + layout.size() as i64);
        // SAFETY: the caller's contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        BYTES.set(BYTES.get() - layout.size() as i64);
        // SAFETY: the caller's contract.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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
    let before = BYTES.get();
    (0..2000).for_each(|_| live());
    assert_eq!(BYTES.get() - before, 0);
}

#[test]
fn steps_sets_and_gets_allocate_nothing() {
    let host = Host::ready();
    assert_eq!(host.step(0.0, 0.01), Status::Ok);
    let before = ALLOCATIONS.get();
    for k in 1..1000 {
        assert_eq!(host.set_real(vr::STEER_CMD, 0.001 * f64::from(k)), Status::Ok);
        assert_eq!(host.set_boolean(vr::ENABLED, 1), Status::Ok);
        assert_eq!(host.step(f64::from(k) * 0.01, 0.01), Status::Ok);
        assert!(host.real(vr::STEER) > 0.0 && host.integer(vr::STEPS) > 0 && host.boolean(vr::MOVING) == 1);
    }
    assert_eq!(ALLOCATIONS.get() - before, 0);
}
