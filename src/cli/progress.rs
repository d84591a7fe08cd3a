//! Progress of a command: a bar on a terminal, otherwise a line now and then.

use super::listen::{Listener, listener};
use indicatif::style::TemplateError;
use indicatif::{
    HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState as Progress, ProgressStyle, TermLike,
};
use std::io::{IsTerminal, Result, Write};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Least time from one line to the next, and from the beginning to the first: quick work prints nothing.
const LEAST: Duration = Duration::from_secs(2);
/// Time after which a line comes even with little progress.
const MOST: Duration = Duration::from_secs(30);
/// Share, %, that is worth a line.
const WORTH: u64 = 10;

/// Template of a line: the share, and the words.
const LINE: &str = "{percent}|{msg}: {percent} %, {left} left";

/// The progress of a part of a command's work; drawn, told to a listener, or hidden.
pub(super) struct Bar {
    drawn: ProgressBar,
    listener: Option<Arc<dyn Listener>>,
}

impl Bar {
    /// So many parts are done.
    pub fn set_position(&self, done: u64) {
        // The next part of the work has a time of its own.
        if done < self.drawn.position() {
            self.drawn.reset_elapsed();
        }
        self.drawn.set_position(done);
        self.tell();
    }

    /// So many parts are done of so many.
    pub fn set_share(&self, done: u64, of: u64) {
        self.drawn.set_length(of);
        self.set_position(done);
    }

    /// Another part is done.
    pub fn step(&self) {
        self.drawn.inc(1);
        self.tell();
    }

    /// Sets the name of the present work.
    pub fn set_message(&self, what: impl Into<String>) {
        self.drawn.set_message(what.into());
    }

    /// The work is done.
    pub fn finish_and_clear(&self) {
        self.drawn.finish_and_clear();
    }

    fn tell(&self) {
        if let Some(listener) = &self.listener {
            let length = self.drawn.length().unwrap_or(0).max(1);
            listener.follow(&self.drawn.message(), (self.drawn.position() as f64 / length as f64).min(1.0));
        }
    }
}

/// A bar of `length` parts with a title, on standard error; lines if that is no terminal; hidden on demand.
pub(super) fn progress_bar(title: &str, length: f64, quiet: bool) -> Bar {
    let listener = listener();
    let drawn = if listener.is_some() {
        let bar = ProgressBar::with_draw_target(Some(length.max(1.0) as u64), ProgressDrawTarget::hidden());
        bar.with_message(title.to_owned())
    } else {
        drawn(title, length, quiet)
    };
    Bar { drawn, listener }
}

fn drawn(title: &str, length: f64, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length.max(1.0) as u64).with_message(title.to_string());
    let template = if std::io::stderr().is_terminal() {
        "{msg} {bar:40} {pos}/{len}, {left} left"
    } else {
        bar.set_draw_target(ProgressDrawTarget::term_like(Box::new(ProgressLines::new(
            std::io::stderr(),
            LEAST,
        ))));
        LINE
    };
    // The templates are ours and right.
    style(template).map_or(bar.clone(), |style| bar.with_style(style))
}

/// A template whose `{left}` is the time left, by the average so far: where a step takes minutes, the latest pace is none.
fn style(template: &str) -> std::result::Result<ProgressStyle, TemplateError> {
    Ok(ProgressStyle::with_template(template)?.with_key(
        "left",
        |progress: &Progress, to: &mut dyn std::fmt::Write| {
            let (done, of) = (progress.pos(), progress.len().unwrap_or(0));
            // Writing to memory does not fail.
            let _ = match time_left(progress.elapsed(), done, of) {
                Some(left) => write!(to, "{:#}", HumanDuration(left)),
                None => write!(to, "?"),
            };
        },
    ))
}

/// Time left of a work of equal parts, of which so many are done; `None` before the first is.
fn time_left(elapsed: Duration, done: u64, of: u64) -> Option<Duration> {
    (done > 0).then(|| elapsed.mul_f64(of.saturating_sub(done) as f64 / done as f64))
}

/// A substitute for a terminal: its drawing becomes a line when enough has changed.
struct ProgressLines<W> {
    state: Mutex<ProgressState<W>>,
}

struct ProgressState<W> {
    writer: W,
    least: Duration,
    /// Output since the last flush.
    drawn: String,
    /// Share of the last line, %, and when it came.
    share: u64,
    time: Instant,
}

impl<W: Write> ProgressLines<W> {
    fn new(writer: W, least: Duration) -> Self {
        let state = ProgressState { writer, least, drawn: String::new(), share: 0, time: Instant::now() };
        Self { state: Mutex::new(state) }
    }

    fn with<T>(&self, change: impl FnOnce(&mut ProgressState<W>) -> T) -> T {
        change(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl<W> std::fmt::Debug for ProgressLines<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("Lines")
    }
}

impl<W: Write> ProgressState<W> {
    /// Writes the drawing if it is worth a line now.
    fn flush(&mut self, now: Instant) -> Result<()> {
        let drawn = std::mem::take(&mut self.drawn);
        let Some((share, words)) = drawn.split_once('|') else { return Ok(()) };
        let Ok(share) = share.trim().parse::<u64>() else { return Ok(()) };
        let waited = now.duration_since(self.time);
        // A bar may begin anew, for the next part of the work.
        if waited >= MOST || (waited >= self.least && share.abs_diff(self.share) >= WORTH) {
            (self.share, self.time) = (share, now);
            writeln!(self.writer, "{}", words.trim())?;
        }
        Ok(())
    }
}

impl<W: Write + Send> TermLike for ProgressLines<W> {
    fn width(&self) -> u16 {
        200
    }

    fn move_cursor_up(&self, _: usize) -> Result<()> {
        Ok(())
    }

    fn move_cursor_down(&self, _: usize) -> Result<()> {
        Ok(())
    }

    fn move_cursor_right(&self, _: usize) -> Result<()> {
        Ok(())
    }

    fn move_cursor_left(&self, _: usize) -> Result<()> {
        Ok(())
    }

    fn write_line(&self, text: &str) -> Result<()> {
        self.write_str(text)
    }

    fn write_str(&self, text: &str) -> Result<()> {
        self.with(|state| state.drawn.push_str(text));
        Ok(())
    }

    fn clear_line(&self) -> Result<()> {
        Ok(())
    }

    fn flush(&self) -> Result<()> {
        self.with(|state| state.flush(Instant::now()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_when_enough_has_changed_and_not_too_often() {
        let lines = ProgressLines::new(Vec::new(), LEAST);
        let begin = Instant::now();
        for (seconds, share) in
            [(0, 0), (1, 50), (3, 55), (4, 80), (6, 85), (8, 86), (9, 95), (60, 95), (61, 0)]
        {
            lines.write_str(&format!("{share}|driving: {share} %, 1s left   ")).unwrap();
            lines.with(|state| state.flush(begin + Duration::from_secs(seconds))).unwrap();
        }
        let text = lines.with(|state| String::from_utf8(state.writer.clone()).unwrap());
        let shares: Vec<_> = text.lines().map(|line| line.split(' ').nth(1).unwrap()).collect();
        assert_eq!(shares, ["55", "85", "95", "95"], "{text}");
    }

    #[test]
    fn a_bar_draws_on_lines_what_they_understand() {
        let drawn = Shared::default();
        let lines = ProgressLines::new(drawn.clone(), Duration::ZERO);
        let bar = ProgressBar::with_draw_target(Some(200), ProgressDrawTarget::term_like(Box::new(lines)));
        bar.set_style(style(LINE).unwrap());
        bar.set_message("driving");
        for position in 0..=200 {
            bar.set_position(position);
            bar.tick();
        }
        bar.finish_and_clear();
        let text = String::from_utf8(drawn.0.lock().unwrap().clone()).unwrap();
        let shares: Vec<_> = text.lines().map(|line| line.split(' ').nth(1).unwrap()).collect();
        assert_eq!(shares, ["10", "20", "30", "40", "50", "60", "70", "80", "90", "100"], "{text}");
        assert!(text.starts_with("driving: 10 %"), "{text}");
    }

    #[test]
    fn the_time_left_is_that_of_the_average_pace() {
        let minutes = |count: u64| Duration::from_secs(60 * count);
        assert_eq!(time_left(minutes(10), 1, 4), Some(minutes(30)));
        assert_eq!(time_left(minutes(10), 4, 4), Some(minutes(0)));
        assert_eq!(time_left(minutes(10), 0, 4), None);
    }

    #[derive(Clone, Default)]
    struct Shared(std::sync::Arc<Mutex<Vec<u8>>>);

    impl Write for Shared {
        fn write(&mut self, bytes: &[u8]) -> Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> Result<()> {
            Ok(())
        }
    }
}
