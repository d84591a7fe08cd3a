//! Commands that another program calls: their words and progress go to a listener in place of the terminal.

use std::cell::RefCell;
use std::sync::Arc;

/// Who hears what a command says.
pub trait Listener: Send + Sync {
    /// A line of the answer.
    fn say(&self, line: String);

    /// A line beside the answer: a note or a warning.
    fn warn(&self, line: String);

    /// The share, 0 to 1, of a part of the work that is done. To stop the work, unwind
    /// ([`resume_unwind`](std::panic::resume_unwind)); may be called from several threads.
    fn follow(&self, part: &str, share: f64);
}

thread_local! {
    static LISTENER: RefCell<Option<Arc<dyn Listener>>> = const { RefCell::new(None) };
}

/// Calls commands on this thread, heard by a listener.
pub fn heard<T>(listener: Arc<dyn Listener>, work: impl FnOnce() -> T) -> T {
    /// Removes the listener, however the work ends.
    struct Forget;
    impl Drop for Forget {
        fn drop(&mut self) {
            LISTENER.set(None);
        }
    }
    LISTENER.set(Some(listener));
    let _forget = Forget;
    work()
}

/// Who hears this thread.
pub(super) fn listener() -> Option<Arc<dyn Listener>> {
    LISTENER.with_borrow(Clone::clone)
}
