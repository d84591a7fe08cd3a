//! Look-ups over a receding horizon.
//!
//! Row `j` of the horizon asks the trees at the window of states `x_j .. x_{j+W-1}` and at the road of its step. A step
//! later the same row is asked again, one place earlier. Its window differs by the last prediction error, and few trees
//! give another leaf. So each row's leaves and their mean coefficients are kept, and only nodes that a changed value
//! decides are looked up again:
//!
//! ```text
//! thresholds of one quantity, of all nodes, sorted:   t_0 <= t_1 <= .. <= t_p < value <= t_{p+1} <= ..
//! ```
//!
//! A moving value passes the thresholds between its old place and its new one. Each belongs to one node of one tree,
//! which asks at one place of the window and so in one row. If it lies on the way to that row's leaf, that tree is
//! looked up again from there. The newest row, and rows after a jump of many thresholds, are looked up in every tree.
//!
//! A changed leaf takes the old one's place in the row's mean. A row that is looked up in every tree begins with the
//! leaves of the row before it. Such sums are exact ([`Shares`]). Answers are those of
//! [`ResidualModelFor::coefficients`](super::ResidualModelFor::coefficients) to the bit, whatever was asked before.

use super::ROAD;
use super::forest::Forest;
use super::leaf::Shares;
use super::least_squares::Theta;
use std::sync::Arc;

/// A node that asks for a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Question {
    /// At which place of the window it asks; 0 of the road.
    place: u16,
    tree: u16,
    /// Its number, counted from 1 level by level, and its height above the ends. `(end + ends) >> above` is the number
    /// of the node on the way to an end.
    number: u16,
    above: u16,
}

/// Trees that are marked in a word.
const WORD: u16 = u64::BITS as u16;

/// All nodes that ask for one quantity, in order of their thresholds.
#[derive(Debug, Clone, PartialEq)]
struct Quantity {
    /// The thresholds, between minus infinity and infinity.
    bounds: Vec<f64>,
    questions: Vec<Question>,
}

/// Thresholds of the trees, by quantity: components of the states, and the road's. Controllers share it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Questions<const S: usize> {
    of_states: [Quantity; S],
    of_road: [Quantity; ROAD],
}

/// The rows of a horizon with the last look-up; made once, filled at each step.
#[derive(Debug, Clone)]
pub struct Lookahead<const S: usize> {
    shares: Arc<Shares<S>>,
    questions: Arc<Questions<S>>,
    window: usize,
    horizon: usize,
    /// States of the window and the horizon, one behind the other, and the number of thresholds below each value.
    states: Vec<[f64; S]>,
    state_places: Vec<[u32; S]>,
    /// The road of each row, likewise.
    road: Vec<[f64; ROAD]>,
    road_places: Vec<[u32; ROAD]>,
    /// Place of row 0: rows keep their places when the horizon moves on.
    first: usize,
    rows: LeafRows,
    /// Mean coefficients of the rows' leaves, each with the effect of a held command behind them.
    mean: Theta<S>,
    /// Features of a row that is looked up in every tree.
    features: Vec<f64>,
    /// Thresholds that may still be passed in this step; beyond, rows are looked up in every tree.
    budget: usize,
}

/// The leaves of each row.
#[derive(Debug, Clone)]
struct LeafRows {
    trees: usize,
    /// Ends of a tree.
    ends: usize,
    /// For each row and tree the end reached and the leaf there.
    end: Vec<u16>,
    leaf: Vec<u32>,
    /// Trees to be looked up again in each row: a bit for each, in so many words a row. `above` is the number of levels
    /// above the ends at which the look-up starts; the way to there is unchanged.
    marked: Vec<u64>,
    words: usize,
    above: Vec<u16>,
    /// Rows that have to be looked up in every tree.
    anew: Vec<bool>,
}

/// The linear residual of a row, as [`Coefficients`](super::Coefficients) has it.
#[derive(Debug, Clone, Copy)]
pub struct LookedUp<'a, const S: usize> {
    /// Place of the row: the same as long as it is within the horizon.
    pub slot: usize,
    /// True if its leaves may differ from those of the last look-up.
    pub renewed: bool,
    /// Effect of what is known.
    pub constant: [f64; S],
    /// Effect of each command of the window, oldest first; empty for leaves that are constant.
    pub command: &'a [[f64; S]],
    /// Effect of a command that is held over the whole window.
    pub held: [f64; S],
    /// Effect of the newest states, oldest first; empty if the leaves have none.
    pub state: &'a [[f64; S]],
    /// These states.
    pub newest: &'a [f64],
    /// Distance of the worst feature from its range in training, in widths of that range; 0 inside.
    pub excess: f64,
}

impl LeafRows {
    /// Marks the tree of a question in a row, if the question lies on the way to its leaf there.
    fn mark(&mut self, slot: usize, question: &Question) {
        let at = slot * self.trees + usize::from(question.tree);
        let on_the_way = (usize::from(self.end[at]) + self.ends) >> question.above;
        // Without a branch: nobody could foretell it.
        let mark = on_the_way == usize::from(question.number);
        self.above[at] = self.above[at].max(u16::from(mark) * question.above);
        let word = &mut self.marked[slot * self.words + usize::from(question.tree / WORD)];
        *word |= u64::from(mark) << (question.tree % WORD);
    }
}

impl<const S: usize> Questions<S> {
    /// Those of a forest with a window.
    pub fn new(forest: &Forest, window: usize) -> Self {
        let (trees, depth) = (forest.trees(), usize::from(forest.depth));
        let mut asked: Vec<Vec<(f64, Question)>> = vec![vec![]; S + ROAD];
        for tree in 0..trees {
            for (node, split) in forest.splits(tree).enumerate() {
                let Some((feature, threshold)) = split else { continue };
                let feature = usize::from(feature);
                let (quantity, place) = match feature.checked_sub(S * window) {
                    Some(road) => (S + road, 0),
                    None => (feature % S, feature / S),
                };
                let above = depth - (node + 1).ilog2() as usize;
                let [place, tree, number, above] = [place, tree, node + 1, above].map(|x| x as u16);
                asked[quantity].push((threshold, Question { place, tree, number, above }));
            }
        }
        let mut quantity = |number: usize| {
            let mut asked = std::mem::take(&mut asked[number]);
            asked.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (thresholds, questions): (Vec<f64>, _) = asked.into_iter().unzip();
            let bounds = [f64::NEG_INFINITY].into_iter().chain(thresholds).chain([f64::INFINITY]);
            Quantity { bounds: bounds.collect(), questions }
        };
        Self {
            of_states: std::array::from_fn(&mut quantity),
            of_road: std::array::from_fn(|i| quantity(S + i)),
        }
    }
}

impl Quantity {
    /// True if a value is certainly still at its place: between the thresholds about it.
    #[inline]
    fn stays(&self, place: u32, x: f64) -> bool {
        let about = self.bounds.get(place as usize..).and_then(|bounds| bounds.first_chunk::<2>());
        about.is_some_and(|&[below, above]| x > below && x <= above)
    }

    /// Number of thresholds below a value.
    fn place(&self, x: f64) -> u32 {
        self.bounds[1..=self.questions.len()].partition_point(|&threshold| x > threshold) as u32
    }

    /// Moves a value's place to where the value is now, with a call for each node whose threshold it passes. False if
    /// there were more than `budget`, and not all were named.
    fn pass(&self, place: &mut u32, x: f64, budget: &mut usize, mut passed: impl FnMut(&Question)) -> bool {
        let count = self.questions.len();
        let mut at = *place as usize;
        // Not a number is above no threshold: such a feature goes to the left.
        let above = |i: usize| x > self.bounds[i + 1];
        while at < count && above(at) {
            if *budget == 0 {
                *place = self.place(x);
                return false;
            }
            *budget -= 1;
            passed(&self.questions[at]);
            at += 1;
        }
        while at > 0 && !above(at - 1) {
            if *budget == 0 {
                *place = self.place(x);
                return false;
            }
            *budget -= 1;
            at -= 1;
            passed(&self.questions[at]);
        }
        *place = at as u32;
        true
    }
}

/// A feature by its number, in a window of states and at a road.
fn feature(states: &[f64], road: &[f64; ROAD]) -> impl Fn(usize) -> f64 {
    move |feature| states.get(feature).copied().unwrap_or_else(|| road[feature - states.len()])
}

impl<const S: usize> Lookahead<S> {
    /// Room for a horizon, with nothing looked up.
    pub(super) fn new(
        forest: &Forest,
        shares: &Arc<Shares<S>>,
        questions: &Arc<Questions<S>>,
        window: usize,
        horizon: usize,
    ) -> Self {
        let (trees, depth) = (forest.trees(), usize::from(forest.depth));
        let states = window + horizon - 1;
        Self {
            shares: Arc::clone(shares),
            questions: Arc::clone(questions),
            window,
            horizon,
            // Not a number is above no threshold, and is no value that comes.
            states: vec![[f64::NAN; S]; states],
            state_places: vec![[0; S]; states],
            road: vec![[f64::NAN; ROAD]; horizon],
            road_places: vec![[0; ROAD]; horizon],
            first: 0,
            rows: LeafRows {
                trees,
                ends: 1 << depth,
                end: vec![0; horizon * trees],
                leaf: vec![shares.none(); horizon * trees],
                marked: vec![0; horizon * trees.div_ceil(WORD.into())],
                words: trees.div_ceil(WORD.into()),
                above: vec![0; horizon * trees],
                anew: vec![true; horizon],
            },
            mean: vec![[0.0; S]; horizon * shares.entries()],
            features: vec![0.0; S * window + ROAD],
            budget: 0,
        }
    }

    /// True if it was made for these leaves.
    pub(super) fn is_of(&self, shares: &Arc<Shares<S>>) -> bool {
        Arc::ptr_eq(&self.shares, shares)
    }

    /// Place of row 0; the others follow, and the last place is followed by the first.
    #[must_use]
    pub fn first(&self) -> usize {
        self.first
    }

    fn slot(&self, row: usize) -> usize {
        let slot = self.first + row;
        if slot < self.horizon { slot } else { slot - self.horizon }
    }

    /// Moves on by a step: what was row `j + 1` is row `j`. Better before each step, but no answer depends on it.
    pub fn advance(&mut self) {
        self.states.copy_within(1.., 0);
        self.state_places.copy_within(1.., 0);
        self.first = if self.first + 1 == self.horizon { 0 } else { self.first + 1 };
        let last = self.slot(self.horizon - 1);
        let before = self.slot(self.horizon.saturating_sub(2));
        self.rows.anew[last] = true;
        (self.road[last], self.road_places[last]) = (self.road[before], self.road_places[before]);
        // Half of what it takes to look all rows up in every tree.
        self.budget = (self.rows.trees * self.rows.ends.ilog2() as usize * self.horizon / 2).max(64);
    }

    /// Takes the state at a place of window and horizon: row `j` ends with the state at `j + W - 1`.
    #[inline(always)]
    pub fn set_state(&mut self, at: usize, state: &[f64; S]) {
        // Most are known: what was measured before. Without a branch for each component, so that they are compared at once.
        let kept = &mut self.states[at];
        let mut differs = 0;
        for c in 0..S {
            differs |= kept[c].to_bits() ^ state[c].to_bits();
        }
        if differs == 0 {
            return;
        }
        *kept = *state;
        let places = self.state_places[at];
        for c in 0..S {
            if !self.questions.of_states[c].stays(places[c], state[c]) {
                self.pass(at, c);
            }
        }
    }

    /// Marks the look-ups that a value decides anew by passing thresholds.
    #[inline(never)]
    fn pass(&mut self, at: usize, c: usize) {
        let (rows, first, horizon) = (&mut self.rows, self.first, self.horizon);
        let slot = |row: usize| if first + row < horizon { first + row } else { first + row - horizon };
        let (place, x) = (&mut self.state_places[at][c], self.states[at][c]);
        let all = self.questions.of_states[c].pass(place, x, &mut self.budget, |question| {
            if let Some(row) = at.checked_sub(usize::from(question.place))
                && row < horizon
            {
                rows.mark(slot(row), question);
            }
        });
        if !all {
            for row in (at + 1).saturating_sub(self.window)..horizon.min(at + 1) {
                rows.anew[slot(row)] = true;
            }
        }
    }

    /// Looks a row up: its slot, and true if its leaves have changed.
    pub(super) fn look_up(&mut self, forest: &Forest, row: usize, road: &[f64; ROAD]) -> (usize, bool) {
        let slot = self.slot(row);
        self.road[slot] = *road;
        let places = self.road_places[slot];
        for c in 0..ROAD {
            if !self.questions.of_road[c].stays(places[c], road[c]) {
                self.pass_on_road(slot, c);
            }
        }
        let marked = &self.rows.marked[slot * self.rows.words..][..self.rows.words];
        let renewed = if self.rows.anew[slot] {
            self.look_up_all(forest, row, slot);
            true
        } else {
            marked.iter().any(|&word| word != 0) && self.look_up_marked(forest, row, slot)
        };
        (slot, renewed)
    }

    /// Marks the look-ups that a value of the road decides anew by passing thresholds.
    #[inline(never)]
    fn pass_on_road(&mut self, slot: usize, c: usize) {
        let (rows, place) = (&mut self.rows, &mut self.road_places[slot][c]);
        let value = self.road[slot][c];
        if !self.questions.of_road[c].pass(place, value, &mut self.budget, |question| {
            rows.mark(slot, question);
        }) {
            rows.anew[slot] = true;
        }
    }

    fn look_up_marked(&mut self, forest: &Forest, row: usize, slot: usize) -> bool {
        let value = feature(self.states[row..][..self.window].as_flattened(), &self.road[slot]);
        let mean = &mut self.mean[slot * self.shares.entries()..][..self.shares.entries()];
        let LeafRows { trees, ends, end, leaf, marked, words, above, .. } = &mut self.rows;
        let mut renewed = false;
        for (i, word) in marked[slot * *words..][..*words].iter_mut().enumerate() {
            while *word != 0 {
                let tree = i * usize::from(WORD) + word.trailing_zeros() as usize;
                // Its lowest bit.
                *word &= *word - 1;
                let at = slot * *trees + tree;
                let above = std::mem::take(&mut above[at]);
                let node = (usize::from(end[at]) + *ends) >> above;
                let (new_end, new_leaf) = forest.descend(tree, node, above, &value);
                end[at] = new_end;
                let old_leaf = std::mem::replace(&mut leaf[at], new_leaf);
                if old_leaf != new_leaf {
                    self.shares.exchange(mean, old_leaf, new_leaf);
                    renewed = true;
                }
            }
        }
        renewed
    }

    fn look_up_all(&mut self, forest: &Forest, row: usize, slot: usize) {
        let (trees, entries) = (self.rows.trees, self.shares.entries());
        if let Some(before) = row.checked_sub(1).map(|row| self.slot(row)) {
            self.rows.leaf.copy_within(before * trees..(before + 1) * trees, slot * trees);
            self.mean.copy_within(before * entries..(before + 1) * entries, slot * entries);
        }
        let (states, asked_road) = self.features.split_at_mut(S * self.window);
        states.copy_from_slice(self.states[row..][..self.window].as_flattened());
        asked_road.copy_from_slice(&self.road[slot]);
        let mean = &mut self.mean[slot * entries..][..entries];
        let LeafRows { end, leaf, marked, words, above, anew, .. } = &mut self.rows;
        anew[slot] = false;
        marked[slot * *words..][..*words].fill(0);
        let of_row = slot * trees..(slot + 1) * trees;
        above[of_row.clone()].fill(0);
        let (ends, leaves) = (&mut end[of_row.clone()], &mut leaf[of_row]);
        forest.reach(&self.features, |tree, new_end, new_leaf| {
            ends[tree] = new_end as u16;
            let old_leaf = std::mem::replace(&mut leaves[tree], new_leaf);
            if old_leaf != new_leaf {
                self.shares.exchange(mean, old_leaf, new_leaf);
            }
        });
    }

    /// Mean coefficients of the row in a slot: constant, commands, states, road, held command.
    pub(super) fn mean(&self, slot: usize) -> &[[f64; S]] {
        let entries = self.shares.entries();
        &self.mean[slot * entries..][..entries]
    }

    /// The state at a place of window and horizon.
    pub(super) fn state(&self, at: usize) -> &[f64; S] {
        &self.states[at]
    }

    /// The last `count` states of a row's window.
    pub(super) fn newest(&self, row: usize, count: usize) -> &[f64] {
        let end = row + self.window;
        self.states[end - count..end].as_flattened()
    }
}
