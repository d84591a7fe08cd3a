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
use nalgebra::SVector;
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
            effects: vec![X::zero(); horizon],
        }
    }

    /// Effects of the window's commands at a step, oldest first.
    #[must_use]
    pub fn commands_of(&self, step: usize) -> &[X] {
        &self.command[step * self.window..(step + 1) * self.window]
    }
}

/// The linear model of a horizon: `x_{j+1} = a x_j + b u_j + ..`.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs)]
pub struct Linear<'a, A, X> {
    pub a: &'a A,
    pub b: &'a X,
}

/// Writes `free` and `gain` of a one-input problem whose outputs are the states named in `tracked`.
///
/// `past` holds the `window - 1` commands before the first decision, oldest first.
pub fn condense<A, X: HorizonState>(
    Linear { a, b }: Linear<'_, A, X>,
    start: &X,
    affine: &mut Affine<X>,
    past: &[f64],
    propagation: Propagation,
    tracked: &[usize],
    problem: &mut TrackingQp,
) where
    for<'x> &'x A: Mul<&'x X, Output = X>,
{
    let (horizon, outputs, window) = (problem.shape.horizon, tracked.len(), affine.window);
    debug_assert_eq!((problem.shape.outputs, problem.shape.inputs), (outputs, 1));
    debug_assert_eq!(past.len(), window.saturating_sub(1));
    let mut x = *start;
    let mut effects = std::mem::take(&mut affine.effects);
    for j in 0..horizon {
        let mut residual = affine.constant[j];
        let commands = affine.commands_of(j);
        // The window of step j begins with what is left of the past commands.
        for (effect, command) in commands.iter().zip(past.iter().skip(j)) {
            residual += *effect * *command;
        }
        // Its newest command is u_j; the decision p stands j - p places before it.
        let effect_of = |p: usize| (window + p).checked_sub(j + 1).map(|i| commands[i]);
        x = a * &x + affine.known[j];
        if j == 0 || window > 0 {
            for effect in &mut effects[..j] {
                *effect = a * &*effect;
            }
            effects[j] = *b;
        } else {
            // Without a residual a decision acts as the one before it did a step ago.
            let oldest = a * &effects[0];
            effects.copy_within(..j, 1);
            effects[0] = oldest;
        }
        let propagated = window > 0 && propagation == Propagation::Propagated;
        if propagated {
            x += residual;
            for (p, effect) in effects[..=j].iter_mut().enumerate() {
                if let Some(more) = effect_of(p) {
                    *effect += more;
                }
            }
        }
        let direct = window > 0 && !propagated;
        for (i, &state) in tracked.iter().enumerate() {
            let row = j * outputs + i;
            problem.free[row] = x.component(state) + if direct { residual.component(state) } else { 0.0 };
            for (p, (entry, effect)) in
                problem.gain[row * horizon..][..=j].iter_mut().zip(&effects).enumerate()
            {
                let more = if direct { effect_of(p).map_or(0.0, |more| more.component(state)) } else { 0.0 };
                *entry = effect.component(state) + more;
            }
        }
    }
    affine.effects = effects;
}
