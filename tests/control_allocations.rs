//! A control step allocates nothing beyond the QP solver's own allocation.

use rfl_mpc::control::{Controller, ControllerParameters, Measurement};
use rfl_mpc::path::{Closure, Path, Sample};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system allocator unchanged; counting touches a thread-local integer only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = COUNT.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's contract is passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's contract is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Largest number of allocations of a step among all steps after the first.
fn most_allocations(deadline: f64) -> usize {
    let circle = (0..120).map(|k| {
        let angle = f64::from(k) * std::f64::consts::TAU / 120.0;
        Sample::at(40.0 * angle.cos(), 40.0 * angle.sin())
    });
    let path = Arc::new(Path::from_samples(circle.collect(), Closure::Closed).unwrap());
    let mut parameters = ControllerParameters::default();
    parameters.mpc.deadline = deadline;
    let mut controller = Controller::new(parameters, path).unwrap();
    (0..200)
        .map(|k| {
            let angle = f64::from(k) * 0.005;
            let measurement = Measurement {
                x: 40.2 * angle.cos(),
                y: 40.2 * angle.sin(),
                yaw: angle + std::f64::consts::FRAC_PI_2,
                vx: 8.0,
                yaw_rate: 0.2,
                ..Measurement::default()
            };
            let before = COUNT.with(Cell::get);
            controller.step(&measurement).unwrap();
            COUNT.with(Cell::get) - before
        })
        .skip(1)
        .max()
        .unwrap()
}

#[test]
fn a_control_step_allocates_at_most_once() {
    assert!(most_allocations(0.0) <= 1, "{}", most_allocations(0.0));
}

#[test]
fn a_deadline_costs_no_allocation() {
    assert!(most_allocations(1.0) <= 1, "{}", most_allocations(1.0));
}

#[test]
fn a_missed_deadline_allocates_no_more() {
    assert!(most_allocations(1e-9) <= 1, "{}", most_allocations(1e-9));
}
