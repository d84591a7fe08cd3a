//! Gaps that are known already: a search comes back to coordinates at which the vehicle was replayed before.

use std::collections::{HashMap, VecDeque};

/// Room for gaps, in numbers: 128 MB.
const ROOM: usize = 16 << 20;

/// Gaps by the bits of their coordinates; the oldest go first where the room is used up.
#[derive(Debug, Default)]
pub(super) struct Memo {
    gaps: HashMap<Box<[u64]>, Vec<f64>>,
    order: VecDeque<Box<[u64]>>,
    used: usize,
}

fn key(x: &[f64]) -> Box<[u64]> {
    x.iter().map(|x| x.to_bits()).collect()
}

impl Memo {
    /// The gap at these coordinates, if it is known.
    pub fn find(&self, x: &[f64]) -> Option<Vec<f64>> {
        self.gaps.get(&key(x)).cloned()
    }

    /// Keeps a gap.
    pub fn keep(&mut self, x: &[f64], gap: &[f64]) {
        let key = key(x);
        if self.gaps.insert(key.clone(), gap.to_vec()).is_some() {
            return;
        }
        self.used += gap.len() + 2 * key.len();
        self.order.push_back(key);
        while self.used > ROOM
            && let Some(oldest) = self.order.pop_front()
        {
            let gap = self.gaps.remove(&oldest).unwrap_or_default();
            self.used -= gap.len() + 2 * oldest.len();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_gaps_make_room() {
        let mut memo = Memo::default();
        let gap = vec![1.0; ROOM / 3];
        for i in 0..4 {
            memo.keep(&[f64::from(i)], &gap);
            memo.keep(&[f64::from(i)], &gap);
        }
        assert_eq!([0.0, 1.0, 2.0, 3.0].map(|x| memo.find(&[x]).is_some()), [false, false, true, true]);
        assert!(memo.used <= ROOM && memo.order.len() == 2);
        // Another sign of nothing is another place.
        assert!(Memo::default().find(&[-0.0]).is_none());
    }
}
