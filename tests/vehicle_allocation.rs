//! A step of the car does not allocate.

use rfl_mpc::vehicle::{BUILTIN, Car, CarInput, Effects, builtin};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    // Of this thread only: the test harness allocates in its own.
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: all calls go on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: by the caller's contract.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: by the caller's contract.
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: by the caller's contract.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn steps_do_not_allocate() {
    let delayed = Effects { steer_delay: 0.5, sensor_delay: 0.4, ..Effects::default() };
    for (name, effects) in BUILTIN.iter().flat_map(|name| [(name, Effects::default()), (name, delayed)]) {
        let mut car = Car::new(&builtin(name).unwrap(), &effects, None).unwrap();
        car.place(0.0, 0.0, 0.0, 15.0);
        let mut saved = Vec::new();
        for restored in [false, true] {
            if restored {
                car.save(&mut saved);
                car.restore(&saved).unwrap();
            }
            let before = ALLOCATIONS.get();
            for k in 0..3000 {
                let input = CarInput { steer_cmd: 0.02 * (0.01 * f64::from(k)).sin(), accel_cmd: 0.1 };
                car.step(&input, if k % 2 == 0 { 0.0005 } else { 0.01 }).unwrap();
            }
            // Errors give back the state before, and do not allocate either.
            assert!(car.step(&CarInput::default(), -1.0).is_err());
            assert_eq!(ALLOCATIONS.get() - before, 0, "{name}, restored: {restored}");
        }
    }
}
