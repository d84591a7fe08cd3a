//! Order of candidates by their costs.

use crate::diagnose::fit::Fit;

/// Evidence that no further search turns into an effect: a third of the least required.
pub(super) const LITTLE: f64 = 4.0;
/// Evidence within which candidates are fitted to convergence.
pub(super) const NEAR: f64 = 60.0;

/// True if a cost is so much below that of nothing that a single effect may be informative.
pub(super) fn may_tell(cost: f64, none: &Fit) -> bool {
    cost < none.cost - LITTLE
}

/// True if a cost is so near the best that a candidate is fitted to convergence.
pub(super) fn is_near(cost: f64, best: f64) -> bool {
    cost < best + 0.25 * best.abs() + NEAR
}

/// True if the best candidate of one effect more gains so much over the best one without it.
pub(super) fn is_ahead(more: &[Fit], fewer: &[Fit], by: f64) -> bool {
    matches!((more.first(), fewer.first()), (Some(more), Some(fewer)) if fewer.cost - more.cost > by)
}

/// True if both free the same effects.
pub(super) fn of_the_same(one: &Fit, other: &Fit) -> bool {
    one.free.len() == other.free.len() && one.free.iter().all(|i| other.free.contains(i))
}

/// Adds fits to others; for equal effects the better one stays.
pub(super) fn take(known: &mut Vec<Fit>, more: impl IntoIterator<Item = Fit>) {
    for new in more {
        match known.iter_mut().find(|old| of_the_same(old, &new)) {
            Some(old) if old.cost <= new.cost => {}
            Some(old) => *old = new,
            None => known.push(new),
        }
    }
    sort(known);
}

pub(super) fn sort(fits: &mut [Fit]) {
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.free.cmp(&b.free)));
}
