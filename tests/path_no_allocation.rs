//! Lookups, projections and the speed plan allocate nothing: they run inside a controller's step.

use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path, SpeedLimits, SpeedPlan};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator with the arguments unchanged; counting touches a const-initialised
// thread-local without a destructor, which does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = COUNT.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps `alloc`'s contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `alloc` above, that is, from `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(work: impl FnOnce()) -> usize {
    let before = COUNT.with(Cell::get);
    work();
    COUNT.with(Cell::get) - before
}

#[test]
fn nothing_is_allocated_after_loading() {
    for (route, closure) in [(Route::SudokuTest, Closure::Open), (Route::HairpinCircuit, Closure::Closed)] {
        let path = Path::from_samples(route.samples(), closure).unwrap();
        let plan = SpeedPlan::new(&path, &SpeedLimits::default());
        let count = allocations(|| {
            for i in 0..200 {
                let s = 3.0 * f64::from(i);
                let point = path.at(s);
                for hint in [None, Some(s), Some(s + 300.0)] {
                    black_box(path.project(point.x + 1.0, point.y, point.yaw, hint));
                }
                black_box(path.project(1e4, 1e4, 0.0, Some(s)));
                black_box((path.curvature(s), path.curvature_rate(s), plan.speed(s), plan.accel(s)));
            }
        });
        assert_eq!(count, 0, "{}", route.name());
    }
    // The counter counts.
    assert!(allocations(|| drop(black_box(vec![1]))) > 0);
}
