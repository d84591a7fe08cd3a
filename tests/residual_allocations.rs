//! The controller asks the residual at each step of the horizon: that allocates nothing.

mod residual_plant;

use residual_plant::{Plant, data};
use rfl_mpc::residual::{Kind, Regressors, TrainConfig, train};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

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

#[test]
fn coefficients_allocate_nothing() {
    let samples = data(&Plant { lag: 0.1, ..Plant::exact() }, &[6.0, 10.0], 800, 1);
    let windows = samples.windows(16);
    for kind in Kind::ALL {
        let regressors = Regressors { road: true, states: 2 };
        let config = TrainConfig { trees: 6, depth: 4, regressors, ..TrainConfig::new(kind) };
        let model = train(&samples, None, &config, &|_| ()).unwrap().model;
        let mut features = vec![0.0; model.features()];
        let mut room = model.room();
        let before = COUNT.get();
        for sample in 0..100 {
            windows.features(sample, &mut features);
            model.coefficients(&features, windows.commands(sample), &mut room);
            std::hint::black_box(room.residual(windows.commands(sample), &[0.0; 8]));
        }
        assert_eq!(COUNT.get() - before, 0, "{kind:?}");
    }
}
