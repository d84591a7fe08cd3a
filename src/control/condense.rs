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
use crate::nominal::ActuatedState;
use nalgebra::{SMatrix, SVector};
use std::ops::{Add, AddAssign, Mul};

enumeration! {
    /// How a learned residual enters the prediction.
    pub enum Propagation {
        Propagated = 0 "propagated", "A step's residual acts on all later states";
        Direct = 1 "direct", "A step's residual acts on the state after it only, as printed by Zhao et al., eq. (9)";
    }
}

/// A state that a prediction is made of: a vector, or one in blocks.
pub trait HorizonState: Copy + Add<Output = Self> + AddAssign + Mul<f64, Output = Self> {
    /// All zero.
    fn zero() -> Self;
    /// A component by its number.
    fn component(&self, i: usize) -> f64;
}

impl<const S: usize> HorizonState for SVector<f64, S> {
    fn zero() -> Self {
        Self::zeros()
    }

    fn component(&self, i: usize) -> f64 {
        self[i]
    }
}

impl<const S: usize> HorizonState for ActuatedState<S> {
    fn zero() -> Self {
        Self::zeros()
    }

    fn component(&self, i: usize) -> f64 {
        if i < S { self.vehicle[i] } else { self.actuator[i - S] }
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
    /// Step 0 stands at this place of `command`, the others behind it, and behind the last place comes the first: what
    /// stays the same need not move when the horizon does.
    pub first: usize,
    /// Effect of a command that is held over the whole window, at the same places, for whoever fills it in.
    pub held: Vec<X>,
    /// What each step's residual is without decisions: its constant part and that of past commands.
    pub settled: Vec<X>,
    /// Effects of the decisions on the newest state, one vector for each step of the horizon.
    effects: Vec<X>,
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
            effects: vec![X::zero(); horizon],
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
pub struct Linear<'a, A, X> {
    pub a: &'a A,
    pub b: &'a X,
}

/// `A` of a model in errors to a path: nothing depends on the first of them, the lateral error, but itself. So the first
/// column of `A` is that of the identity, and a product is spared it.
#[derive(Debug, Clone, Copy)]
pub struct ErrorTransition<'a, const S: usize>(pub &'a SMatrix<f64, S, S>);

impl<const S: usize> Mul<&SVector<f64, S>> for &ErrorTransition<'_, S> {
    type Output = SVector<f64, S>;

    #[inline]
    fn mul(self, x: &SVector<f64, S>) -> SVector<f64, S> {
        debug_assert!(self.0.column(0).iter().enumerate().all(|(i, &a)| a == f64::from(u8::from(i == 0))));
        let (a, x) = (&self.0.data.0, &x.data.0[0]);
        let mut product = [0.0; S];
        product[0] = x[0];
        // By numbers, which the compiler unrolls.
        #[allow(clippy::needless_range_loop)]
        for k in 1..S {
            for i in 0..S {
                product[i] += a[k][i] * x[k];
            }
        }
        SVector::from(product)
    }
}

/// Writes `free` and `gain` of a one-input problem whose outputs are the states named in `tracked`.
///
/// `past` holds the `window - 1` commands before the first decision, oldest first.
pub fn condense<A, X: HorizonState>(
    linear: Linear<'_, A, X>,
    start: &X,
    affine: &mut Affine<X>,
    past: &[f64],
    propagation: Propagation,
    tracked: &[usize],
    problem: &mut TrackingQp,
) where
    for<'x> &'x A: Mul<&'x X, Output = X>,
{
    debug_assert_eq!(past.len(), affine.window.saturating_sub(1));
    affine.settle(past);
    condense_settled(linear, start, affine, propagation, tracked, problem);
}

/// The same with `settled` as it stands.
pub(super) fn condense_settled<A, X: HorizonState>(
    Linear { a, b }: Linear<'_, A, X>,
    start: &X,
    affine: &mut Affine<X>,
    propagation: Propagation,
    tracked: &[usize],
    problem: &mut TrackingQp,
) where
    for<'x> &'x A: Mul<&'x X, Output = X>,
{
    let (horizon, outputs, window) = (problem.shape.horizon, tracked.len(), affine.window);
    debug_assert_eq!((problem.shape.outputs, problem.shape.inputs), (outputs, 1));
    let propagated = window > 0 && propagation == Propagation::Propagated;
    let direct = window > 0 && !propagated;
    let mut x = *start;
    let mut effects = std::mem::take(&mut affine.effects);
    for j in 0..horizon {
        // The newest command of a step's window is u_j: the window begins at this decision, or so many commands before
        // the first.
        let (begin, before) = ((j + 1).saturating_sub(window), window.saturating_sub(j + 1));
        let decided = &affine.commands_of(j)[before..];
        x = a * &x + affine.known[j];
        if window == 0 && j > 0 {
            // Without a residual a decision acts as the one before it did a step ago.
            let oldest = a * &effects[0];
            effects.copy_within(..j, 1);
            effects[0] = oldest;
        } else {
            let (old, decisions) = effects[..j].split_at_mut(if propagated { begin } else { j });
            for effect in old {
                *effect = a * &*effect;
            }
            for (effect, more) in decisions.iter_mut().zip(decided) {
                *effect = a * &*effect + *more;
            }
            effects[j] = *b;
        }
        if propagated {
            x += affine.settled[j];
            effects[j] += decided[j - begin];
        }
        for (i, &state) in tracked.iter().enumerate() {
            let row = j * outputs + i;
            problem.free[row] = x.component(state);
            let entries = &mut problem.gain[row * horizon..][..=j];
            for (entry, effect) in entries.iter_mut().zip(&effects) {
                *entry = effect.component(state);
            }
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
