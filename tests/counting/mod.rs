//! A global allocator that counts what the calling thread allocates (the test harness allocates in threads of its
//! own).

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::time::{Duration, Instant};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
    static BYTES: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

fn count(allocations: usize, bytes: isize) {
    // A thread that is ending has no counters any more, and nobody who asks for them.
    let _ = ALLOCATIONS.try_with(|counter| counter.set(counter.get() + allocations));
    let now = BYTES.try_with(|counter| {
        counter.set(counter.get() + bytes);
        counter.get()
    });
    let _ = MOST.try_with(|most| most.set(most.get().max(now.unwrap_or(0))));
}

// SAFETY: every call goes to the system's allocator with the arguments unchanged; counting touches const-initialised
// thread-locals without destructors, which does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(1, layout.size() as isize);
        // SAFETY: the caller keeps `alloc`'s contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(0, -(layout.size() as isize));
        // SAFETY: the pointer came from `alloc` above, that is, from `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Number of allocations that `work` makes in this thread, and by how many bytes it grows what is allocated.
pub fn allocated(work: impl FnOnce()) -> (usize, isize) {
    let before = (ALLOCATIONS.get(), BYTES.get());
    work();
    (ALLOCATIONS.get() - before.0, BYTES.get() - before.1)
}

/// Most bytes that `work` holds at once in this thread.
pub fn peak(work: impl FnOnce()) -> isize {
    let before = BYTES.get();
    MOST.set(before);
    work();
    MOST.get() - before
}

/// Processor time of this thread, where the system tells (Linux); to 4 ms.
fn processor_time() -> Option<Duration> {
    let said = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(Duration::from_nanos(said.split(' ').next()?.parse().ok()?))
}

/// How long `work` takes, without what a busy machine gives to others meanwhile.
pub fn took(work: impl FnOnce()) -> Duration {
    let (start, before) = (Instant::now(), processor_time());
    work();
    let elapsed = start.elapsed();
    match (before, processor_time()) {
        (Some(before), Some(after)) => elapsed.min(after - before + Duration::from_millis(4)),
        _ => elapsed,
    }
}

#[test]
fn the_counter_counts() {
    let mut kept = None;
    assert_eq!(allocated(|| kept = Some(std::hint::black_box(vec![1_u8; 100]))), (1, 100));
    assert_eq!(allocated(|| drop(kept)), (0, -100));
    let both = || {
        for size in [500, 300] {
            drop(std::hint::black_box(vec![1_u8; size]));
        }
    };
    assert_eq!(peak(both), 500);
}
