//! A command at work in a thread of its own, while Python's thread waits, reports and checks for an interrupt.

use crate::{InternalError, RflError};
use pyo3::prelude::*;
use rfl_mpc::cli::{Listener, heard};
use std::any::Any;
use std::error::Error;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time after which Python is asked for an interrupt.
const PATIENCE: Duration = Duration::from_millis(50);
/// Stack of the thread: that of a program's first thread.
const STACK: usize = 8 << 20;
/// Least step of the share that is reported.
const STEP: f64 = 0.005;

/// Report of a command while it works.
enum Told {
    Line(String),
    Note(String),
    Share(String, f64),
}

/// Who listens to the command for Python.
struct Ear {
    told: Sender<Told>,
    stop: Arc<AtomicBool>,
    /// The share that was reported last, and its part of the work.
    last: Mutex<(String, f64)>,
}

/// Unwinds from a command that is stopped.
struct Stopped;

impl Listener for Ear {
    // Nobody to tell is no reason to end.
    fn say(&self, line: String) {
        let _ = self.told.send(Told::Line(line));
    }

    fn warn(&self, line: String) {
        let _ = self.told.send(Told::Note(line));
    }

    fn follow(&self, part: &str, share: f64) {
        if self.stop.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Stopped));
        }
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.0 != part || (share - last.1).abs() >= STEP {
            *last = (part.to_owned(), share);
            let _ = self.told.send(Told::Share(part.to_owned(), share));
        }
    }
}

/// Works in another thread. `tell(kind, words, share)` is called with each report, of kind `line`, `note` or `share`.
/// An exception of it, or an interrupt, stops the work and is the answer.
pub fn working<T: Send + 'static>(
    py: Python<'_>,
    tell: &Bound<'_, PyAny>,
    work: impl FnOnce() -> Result<T, Box<dyn Error>> + Send + 'static,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let (told, hears) = channel();
    let ear = Arc::new(Ear { told, stop: stop.clone(), last: Mutex::default() });
    let work = || work().map_err(|error| error.to_string());
    let worker = std::thread::Builder::new()
        .stack_size(STACK)
        .spawn(move || catch_unwind(AssertUnwindSafe(|| heard(ear, work))))?;
    let hears = Mutex::new(hears);
    let wait = || hears.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(PATIENCE);
    let mut interrupt = None;
    loop {
        let answer = match py.detach(wait) {
            _ if interrupt.is_some() && worker.is_finished() => break,
            Err(RecvTimeoutError::Disconnected) => break,
            Ok(told) if interrupt.is_none() => match told {
                Told::Line(words) => tell.call1(("line", words, 0.0)),
                Told::Note(words) => tell.call1(("note", words, 0.0)),
                Told::Share(part, share) => tell.call1(("share", part, share)),
            }
            .map(drop),
            _ => Ok(()),
        };
        if interrupt.is_none()
            && let Err(error) = answer.and_then(|()| py.check_signals())
        {
            stop.store(true, Ordering::Relaxed);
            interrupt = Some(error);
        }
    }
    let ended = py.detach(|| worker.join());
    match (interrupt, ended) {
        (Some(interrupt), _) => Err(interrupt),
        (None, Ok(Ok(Ok(found)))) => Ok(found),
        (None, Ok(Ok(Err(words)))) => Err(RflError::new_err(words)),
        (None, Ok(Err(panic)) | Err(panic)) => Err(internal(panic.as_ref())),
    }
}

/// Works in this thread.
pub fn guarded<T>(work: impl FnOnce() -> Result<T, Box<dyn Error>>) -> PyResult<T> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(found)) => Ok(found),
        Ok(Err(error)) => Err(RflError::new_err(error.to_string())),
        Err(panic) => Err(internal(panic.as_ref())),
    }
}

/// Words and place of the newest panic.
static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Keeps the words of a panic for the exception, in place of the terminal.
pub fn keep_panics() {
    std::panic::set_hook(Box::new(|panic| {
        *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = Some(panic.to_string());
    }));
}

fn internal(panic: &(dyn Any + Send)) -> PyErr {
    let kept = PANIC.lock().unwrap_or_else(PoisonError::into_inner).take();
    let words = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    let what = kept.unwrap_or_else(|| words.unwrap_or("no words").to_owned());
    InternalError::new_err(format!(
        "an error in rfl_mpc itself, please report it with what was called: {what} (rfl_mpc {})",
        env!("CARGO_PKG_VERSION")
    ))
}
