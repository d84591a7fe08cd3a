//! Rates of the last steps, and the mean rate over the step ahead by the rule of Adams and Bashforth.

use crate::numerics::lanes::Lanes;

/// A rate, or four of them, at the last two steps, if there were any since the start.
#[derive(Clone, Copy)]
pub(super) struct Past<T>(Option<T>, Option<T>);

impl<T: Copy> Past<T> {
    pub const NONE: Self = Self(None, None);

    /// Mean rate over the step ahead, of second or third order, or the order that the past allows. From then on `now` is
    /// past.
    #[inline(always)]
    pub fn ahead<L: Lanes<Stored = T>>(&mut self, now: L, order: usize) -> L {
        let number = L::splat;
        let ahead = match (&self.0, &self.1) {
            (Some(last), Some(before)) if order > 2 => {
                (number(23.0) * now - number(16.0) * L::load(last) + number(5.0) * L::load(before))
                    / number(12.0)
            }
            (Some(last), _) => number(1.5) * now - number(0.5) * L::load(last),
            _ => now,
        };
        *self = Self(Some(now.store()), self.0);
        ahead
    }
}
