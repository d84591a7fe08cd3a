//! The steps of a host, and the sample time that they ask of a controller.
//!
//! One step is no habit: a host that is late once, or whose clock trembles, changes nothing. Longer steps are those whose median over the
//! last [`WINDOW`] is longer than the sample time by more than a [`TREMBLE`]. When all are shorter again for
//! [`SETTLED`], so is the sample time: of steps that vary at random a few are short by chance.

use serde::{Deserialize, Serialize};

/// Steps that tell what a host's are.
const WINDOW: usize = 6;
/// Share of the sample time by which a step may be longer for a clock that trembles: the prediction is wrong by no more.
const TREMBLE: f64 = 0.1;
/// Time of shorter steps that is no chance, s.
const SETTLED: f64 = 1.0;

/// The last steps of a host, s, in a ring; as many as there were, up to [`WINDOW`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct HostSteps {
    ring: [f64; WINDOW],
    seen: u64,
    /// Time for which all of the last steps were shorter than the sample time, s.
    shorter: f64,
}

impl HostSteps {
    /// Takes a step; gives the sample time that the host's steps ask of a controller with this one, whose own is `own`, s.
    pub(super) fn observe(&mut self, step: f64, own: f64, present: f64) -> f64 {
        self.ring[(self.seen % WINDOW as u64) as usize] = step;
        self.seen = self.seen.saturating_add(1);
        let count = self.seen.min(WINDOW as u64) as usize;
        let mut sorted = self.ring;
        let sorted = &mut sorted[..count];
        sorted.sort_by(f64::total_cmp);
        let (median, longest) = (sorted[count / 2], sorted[count - 1]);
        let back = longest.max(own);
        let are_shorter = count == WINDOW && back * (1.0 + TREMBLE) < present;
        self.shorter = if are_shorter { self.shorter + step } else { 0.0 };
        if median > present * (1.0 + TREMBLE) {
            median
        } else if self.shorter > SETTLED {
            self.shorter = 0.0;
            back
        } else {
            present
        }
    }
}
