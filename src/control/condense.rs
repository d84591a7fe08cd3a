//! Condensing: from an affine model over the horizon to `y = free + G U`.
//!
//! The model is linear with known inputs and, if a residual is learned, effects of a window of W commands:
//!
//! ```text
//! x_{j+1} = A x_j + B u_j + w_j + c_j + sum_{i=1..W} beta_{j,i} u_{j-W+i}          j = 0..N-1
//! ```
//!
//! Commands before the first step are known, the others are decisions. Two ways to add the residual:
//!
//! - *propagated* (default): as written, so that the residual of step `j` acts on all later states through `A`. With
//!   one-step labels this is what the model means; it agrees with simulation to rounding.
//! - *direct*: `x^_{j+1}` is the nominal prediction plus the residual of step `j` alone, as Zhao et al. (ITSC 2024)
//!   print it in eq. (9). For comparison.

use super::tracking_qp::TrackingQp;
use crate::enumeration;
use crate::nominal::{ACTUATOR_STATES, ActuatedState, ActuatedTransition};
use crate::numerics::lanes::{FOUR, Lanes, Work, compute};
use nalgebra::{SMatrix, SVector};
use std::ops::{Add, AddAssign, Mul};

enumeration! {
    /// Propagation of a learned residual in the prediction.
    pub enum Propagation {
        Propagated = 0 "propagated", "A step's residual acts on all later states";
        Direct = 1 "direct", "A step's residual acts on the state after it only, as printed by Zhao et al., eq. (9)";
    }
}

/// A state of the prediction: a vector, or one in blocks.
pub trait HorizonState: Copy + Add<Output = Self> + AddAssign + Mul<f64, Output = Self> {
    /// Number of components.
    const COMPONENTS: usize;
    /// All zero.
    fn zero() -> Self;
    /// A component by its number.
    fn component(&self, i: usize) -> f64;
    /// The same, to be changed.
    fn component_mut(&mut self, i: usize) -> &mut f64;
}

impl<const S: usize> HorizonState for SVector<f64, S> {
    const COMPONENTS: usize = S;

    fn zero() -> Self {
        Self::zeros()
    }

    fn component(&self, i: usize) -> f64 {
        self[i]
    }

    fn component_mut(&mut self, i: usize) -> &mut f64 {
        &mut self[i]
    }
}

impl<const S: usize> HorizonState for ActuatedState<S> {
    const COMPONENTS: usize = S + ACTUATOR_STATES;

    fn zero() -> Self {
        Self::zeros()
    }

    fn component(&self, i: usize) -> f64 {
        if i < S { self.vehicle[i] } else { self.actuator[i - S] }
    }

    fn component_mut(&mut self, i: usize) -> &mut f64 {
        if i < S { &mut self.vehicle[i] } else { &mut self.actuator[i - S] }
    }
}

/// Action of a state on the next one.
pub trait Transition<X: HorizonState> {
    /// `A x`.
    fn apply(&self, x: &X) -> X;

    /// Moves the first `count` effects on by a step: `A x`, with the additional terms of the last of them. Component
    /// `i` of effect `k` stands at `i stride + k`, and a stride is a multiple of [`BLOCK`]. Effects behind may be
    /// changed, too.
    fn advance(&self, effects: &mut [f64], stride: usize, count: usize, more: &[X]) {
        for k in 0..count {
            let more = (k + more.len()).checked_sub(count).map_or(X::zero(), |k| more[k]);
            write(&(self.apply(&read(effects, stride, k)) + more), effects, stride, k);
        }
    }
}

/// Effects that are computed at once.
const BLOCK: usize = FOUR;

/// The effect `k` of those that stand component by component.
fn read<X: HorizonState>(effects: &[f64], stride: usize, k: usize) -> X {
    let mut x = X::zero();
    for i in 0..X::COMPONENTS {
        *x.component_mut(i) = effects[i * stride + k];
    }
    x
}

/// Puts the effect `k` among them.
fn write<X: HorizonState>(x: &X, effects: &mut [f64], stride: usize, k: usize) {
    for i in 0..X::COMPONENTS {
        effects[i * stride + k] = x.component(i);
    }
}

impl<const S: usize> Transition<SVector<f64, S>> for SMatrix<f64, S, S> {
    fn apply(&self, x: &SVector<f64, S>) -> SVector<f64, S> {
        self * x
    }
}

impl<const S: usize> Transition<ActuatedState<S>> for ActuatedTransition<S> {
    fn apply(&self, x: &ActuatedState<S>) -> ActuatedState<S> {
        self * x
    }
}

/// The affine part of the prediction over a horizon, preallocated.
#[derive(Debug, Clone, PartialEq)]
pub struct Affine<X> {
    /// Known inputs `w_j` of each step: the road, a disturbance.
    pub known: Vec<X>,
    /// Constant part `c_j` of the residual of each step.
    pub constant: Vec<X>,
    /// `beta_{j,i}`, `window` vectors for each step, oldest command first; empty without a residual.
    pub command: Vec<X>,
    /// Commands of a window; 0 without a residual.
    pub window: usize,
    /// Place of step 0 in `command`; the others follow, and the last place is followed by the first. Unchanged entries
    /// need not move when the horizon does.
    pub first: usize,
    /// Effect of a command that is held over the whole window, at the same places, if the caller fills it in.
    pub held: Vec<X>,
    /// Residual of each step without decisions: its constant part and that of past commands.
    pub settled: Vec<X>,
    /// Effects of the decisions on the newest state, component by component.
    effects: Vec<f64>,
}

impl<X: HorizonState> Affine<X> {
    /// Room for a horizon and a window.
    #[must_use]
    pub fn new(horizon: usize, window: usize) -> Self {
        Self {
            known: vec![X::zero(); horizon],
            constant: vec![X::zero(); horizon],
            command: vec![X::zero(); horizon * window],
            window,
            first: 0,
            held: vec![X::zero(); horizon],
            settled: vec![X::zero(); horizon],
            effects: vec![0.0; horizon.next_multiple_of(BLOCK) * X::COMPONENTS],
        }
    }

    /// Effects of the window's commands at a step, oldest first.
    #[must_use]
    pub fn commands_of(&self, step: usize) -> &[X] {
        &self.command[self.place(step) * self.window..][..self.window]
    }

    /// Effect at a step of a command that is held over the whole window.
    #[must_use]
    pub fn held_at(&self, step: usize) -> X {
        self.held[self.place(step)]
    }

    fn place(&self, step: usize) -> usize {
        let (place, horizon) = (self.first + step, self.known.len());
        if place < horizon { place } else { place - horizon }
    }

    /// Adds the past commands, the `window - 1` before the first decision, oldest first, to the constant part.
    fn settle(&mut self, past: &[f64]) {
        for j in 0..self.known.len() {
            let mut settled = self.constant[j];
            // The window of step j begins with what is left of the past commands.
            for (effect, command) in self.commands_of(j).iter().zip(past.get(j..).unwrap_or_default()) {
                settled += *effect * *command;
            }
            self.settled[j] = settled;
        }
    }
}

/// The linear model of a horizon: `x_{j+1} = a x_j + b u_j + ..`.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs)]
pub struct HorizonModel<'a, A, X> {
    pub a: &'a A,
    pub b: &'a X,
}

/// `A` of a model in errors to a path: only the lateral error itself depends on the lateral error. So the first column
/// of `A` is that of the identity, and the product skips it.
#[derive(Debug, Clone, Copy)]
pub struct ErrorTransition<'a, const S: usize>(pub &'a SMatrix<f64, S, S>);

impl<const S: usize> Transition<SVector<f64, S>> for ErrorTransition<'_, S> {
    #[inline]
    fn apply(&self, x: &SVector<f64, S>) -> SVector<f64, S> {
        SVector::from(times(&self.0.data.0, &x.data.0[0]))
    }

    fn advance(&self, effects: &mut [f64], stride: usize, count: usize, more: &[SVector<f64, S>]) {
        compute(Advance { a: &self.0.data.0, effects, stride, count, more });
    }
}

/// See [`Transition::advance`].
struct Advance<'a, const S: usize> {
    /// By columns.
    a: &'a [[f64; S]; S],
    effects: &'a mut [f64],
    stride: usize,
    count: usize,
    more: &'a [SVector<f64, S>],
}

impl<const S: usize> Work for Advance<'_, S> {
    type Given = ();

    #[inline(always)]
    fn with<L: Lanes<Stored = [f64; BLOCK]>>(self) {
        let Self { a, effects, stride, count, more } = self;
        let blocks = effects.as_chunks_mut::<BLOCK>().0;
        let stride = stride / BLOCK;
        let first = count - more.len();
        for block in 0..count.div_ceil(BLOCK) {
            let begin = block * BLOCK;
            let whole = begin.checked_sub(first).and_then(|from| more.get(from..)?.first_chunk::<BLOCK>());
            match whole {
                Some(more) => advance_block::<L, S>(a, blocks, stride, block, more),
                // The last block may reach beyond, or some effects have no more.
                None => {
                    let mut part = [SVector::zeros(); BLOCK];
                    for (k, of_effect) in (begin..).zip(&mut part) {
                        if let Some(more) = k.checked_sub(first).and_then(|k| more.get(k)) {
                            *of_effect = *more;
                        }
                    }
                    advance_block::<L, S>(a, blocks, stride, block, &part);
                }
            }
        }
    }
}

/// Moves the effects of a block on.
#[inline(always)]
fn advance_block<L: Lanes<Stored = [f64; BLOCK]>, const S: usize>(
    a: &[[f64; S]; S],
    blocks: &mut [[f64; BLOCK]],
    stride: usize,
    block: usize,
    [b, c, d, e]: &[SVector<f64, S>; BLOCK],
) {
    let [b, c, d, e] = [&b.data.0[0], &c.data.0[0], &d.data.0[0], &e.data.0[0]];
    // One look whether all are there.
    let rows = &mut blocks[block..=block + (S - 1) * stride];
    let mut x = [L::splat(0.0); S];
    for i in 0..S {
        x[i] = L::load(&rows[i * stride]);
    }
    let next = times(a, &x);
    for i in 0..S {
        rows[i * stride] = (next[i] + L::load(&[b[i], c[i], d[i], e[i]])).store();
    }
}

/// `A x` for an `A` by columns whose first is that of the identity.
#[inline(always)]
fn times<L: Lanes, const S: usize>(a: &[[f64; S]; S], x: &[L; S]) -> [L; S] {
    crate::invariant!(a[0].iter().enumerate().all(|(i, &a)| a == f64::from(u8::from(i == 0))));
    let mut product = [L::splat(0.0); S];
    product[0] = x[0];
    // By numbers, which the compiler unrolls.
    #[allow(clippy::needless_range_loop)]
    for k in 1..S {
        for i in 0..S {
            product[i] = product[i] + L::splat(a[k][i]) * x[k];
        }
    }
    product
}

/// Writes `free` and `gain` of a one-input problem whose outputs are the states named in `tracked`.
///
/// `past` holds the `window - 1` commands before the first decision, oldest first.
pub fn condense<A: Transition<X>, X: HorizonState>(
    linear: HorizonModel<'_, A, X>,
    start: &X,
    affine: &mut Affine<X>,
    past: &[f64],
    propagation: Propagation,
    tracked: &[usize],
    problem: &mut TrackingQp,
) {
    crate::invariant!(past.len() == affine.window.saturating_sub(1));
    affine.settle(past);
    condense_settled(linear, start, affine, propagation, tracked, problem);
}

/// Response to one command in a horizon whose steps differ by time alone.
#[derive(Debug, Clone, PartialEq)]
pub struct CommandResponse<X> {
    /// Effects on each state component by component, the latest first: the response to a command `k` steps later stands
    /// at `horizon - k`.
    effects: Vec<f64>,
    horizon: usize,
    of: std::marker::PhantomData<X>,
}

impl<X: HorizonState> CommandResponse<X> {
    /// Room for a horizon.
    #[must_use]
    pub fn new(horizon: usize) -> Self {
        Self { effects: vec![0.0; horizon * X::COMPONENTS], horizon, of: std::marker::PhantomData }
    }

    /// Computes the effects of a command that acts by `newer` after `delay` steps and by `older` a step later. Writes
    /// `free` and `gain` of a one-input problem. `known` are the known inputs of each step; `past` is the command so
    /// many steps before the first decision.
    #[allow(clippy::too_many_arguments)]
    pub fn condense<A: Transition<X>>(
        &mut self,
        a: &A,
        [newer, older]: [&X; 2],
        delay: usize,
        start: &X,
        known: &[X],
        past: impl Fn(usize) -> f64,
        tracked: &[usize],
        problem: &mut TrackingQp,
    ) {
        let (horizon, outputs) = (self.horizon, tracked.len());
        let shape = (problem.shape.horizon, problem.shape.outputs, problem.shape.inputs);
        crate::invariant!(shape == (horizon, outputs, 1));
        let (mut effect, mut x) = (X::zero(), *start);
        for (j, known) in known.iter().enumerate() {
            // A command of the past acts in step j by what of it arrives then.
            let arriving = |delay: usize| if delay > j { past(delay - j) } else { 0.0 };
            x = a.apply(&x) + *known + *newer * arriving(delay) + *older * arriving(delay + 1);
            effect = a.apply(&effect);
            if j == delay {
                effect += *newer;
            } else if j == delay + 1 {
                effect += *older;
            }
            write(&effect, &mut self.effects, horizon, horizon - 1 - j);
            for (i, &state) in tracked.iter().enumerate() {
                let row = j * outputs + i;
                problem.free[row] = x.component(state);
                let entries = &mut problem.gain[row * horizon..][..=j];
                entries.copy_from_slice(&self.effects[state * horizon..][horizon - 1 - j..horizon]);
            }
        }
        problem.shift_invariant = true;
    }
}

/// The same with `settled` as it stands.
pub(super) fn condense_settled<A: Transition<X>, X: HorizonState>(
    HorizonModel { a, b }: HorizonModel<'_, A, X>,
    start: &X,
    affine: &mut Affine<X>,
    propagation: Propagation,
    tracked: &[usize],
    problem: &mut TrackingQp,
) {
    let (horizon, outputs, window) = (problem.shape.horizon, tracked.len(), affine.window);
    crate::invariant!((problem.shape.outputs, problem.shape.inputs) == (outputs, 1));
    problem.shift_invariant = window == 0;
    let propagated = window > 0 && propagation == Propagation::Propagated;
    let direct = window > 0 && !propagated;
    let mut x = *start;
    let mut effects = std::mem::take(&mut affine.effects);
    let stride = horizon.next_multiple_of(BLOCK);
    for j in 0..horizon {
        // The newest command of a step's window is u_j: the window begins at this decision, or so many commands before
        // the first.
        let (begin, before) = ((j + 1).saturating_sub(window), window.saturating_sub(j + 1));
        let decided = &affine.commands_of(j)[before..];
        x = a.apply(&x) + affine.known[j];
        // Without a residual a decision acts as the one before it did a step ago: effects stand at the end, and one more
        // comes before them.
        let oldest = if window == 0 { horizon - 1 - j } else { 0 };
        if window == 0 {
            let effect = if j == 0 { *b } else { a.apply(&read(&effects, stride, oldest + 1)) };
            write(&effect, &mut effects, stride, oldest);
        } else {
            a.advance(&mut effects, stride, j, if propagated { &decided[..j - begin] } else { &[] });
            let newest = if propagated { *b + decided[j - begin] } else { *b };
            write(&newest, &mut effects, stride, j);
        }
        if propagated {
            x += affine.settled[j];
        }
        for (i, &state) in tracked.iter().enumerate() {
            let row = j * outputs + i;
            problem.free[row] = x.component(state);
            let entries = &mut problem.gain[row * horizon..][..=j];
            entries.copy_from_slice(&effects[state * stride + oldest..][..=j]);
            if direct {
                problem.free[row] += affine.settled[j].component(state);
                for (entry, more) in entries[begin..].iter_mut().zip(decided) {
                    *entry += more.component(state);
                }
            }
        }
    }
    affine.effects = effects;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Random;
    use crate::numerics::lanes::compute_portably;

    #[test]
    fn effects_move_on_by_the_same_bits_on_every_processor_and_as_they_do_singly() {
        let mut random = Random::new(3);
        let mut draw = || 2.0 * random.uniform() - 1.0;
        let mut a = SMatrix::<f64, 6, 6>::from_fn(|_, _| draw());
        a.set_column(0, &SVector::<f64, 6>::from_fn(|i, _| f64::from(u8::from(i == 0))));
        let stride = 12;
        for (count, have_more) in [(1, 1), (4, 4), (7, 7), (11, 5), (10, 0)] {
            let more: Vec<_> = (0..have_more).map(|_| SVector::<f64, 6>::from_fn(|_, _| draw())).collect();
            let before: Vec<f64> = (0..6 * stride).map(|_| draw()).collect();
            let moved = |portably: bool| {
                let mut effects = before.clone();
                let work = Advance { a: &a.data.0, effects: &mut effects, stride, count, more: &more };
                if portably {
                    compute_portably(work)
                } else {
                    compute(work)
                }
                effects
            };
            let (effects, portably) = (moved(false), moved(true));
            assert!(effects.iter().zip(&portably).all(|(a, b)| a.to_bits() == b.to_bits()));
            for k in 0..count {
                let mut single = a * read::<SVector<f64, 6>>(&before, stride, k);
                if let Some(k) = (k + have_more).checked_sub(count) {
                    single += more[k];
                }
                assert!((read::<SVector<f64, 6>>(&effects, stride, k) - single).norm() < 1e-14);
            }
        }
    }
}
