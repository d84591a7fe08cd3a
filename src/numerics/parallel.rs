//! Work on several threads with one result: each piece is done by one thread, and the results come in the order of
//! the pieces.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Number of threads to use: `asked`, or all there are for 0.
#[must_use]
pub fn threads(asked: usize) -> usize {
    if asked == 0 { std::thread::available_parallelism().map_or(1, usize::from) } else { asked }
}

/// `work(0), .., work(count - 1)` on `threads` threads.
///
/// # Panics
/// If a piece of work does.
pub fn map<R: Send>(threads: usize, count: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
    if threads <= 1 || count <= 1 {
        return (0..count).map(work).collect();
    }
    let mut results: Vec<Mutex<Option<R>>> = Vec::new();
    results.resize_with(count, Mutex::default);
    each(threads, count, &|piece| {
        let result = work(piece);
        *results[piece].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
    });
    let result = |it: Mutex<Option<R>>| it.into_inner().unwrap_or_else(PoisonError::into_inner);
    results.into_iter().map(|it| result(it).expect("each piece of work is done")).collect()
}

/// Calls `work` for each piece, on `threads` threads: once in the program, for any work.
fn each(threads: usize, count: usize, work: &(dyn Fn(usize) + Sync)) {
    let next = AtomicUsize::new(0);
    let some = || {
        loop {
            let piece = next.fetch_add(1, Ordering::Relaxed);
            if piece >= count {
                break;
            }
            work(piece);
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.min(count) {
            scope.spawn(some);
        }
    });
}

/// The ranges of at most `size` that make up `0..count`. Sums over them do not depend on the number of threads.
#[must_use]
pub fn chunks(count: usize, size: usize) -> Vec<std::ops::Range<usize>> {
    (0..count).step_by(size).map(|start| start..(start + size).min(count)).collect()
}
