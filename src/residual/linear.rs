//! A residual that is linear in the commands, as a controller asks for it.
//!
//! In each step `j` of the horizon a controller needs
//!
//! ```text
//! r_j = constant + sum_{i=1..W} beta_i u_{j-W+i} + sum_s gamma_s x_s
//! ```
//!
//! at the window of states that ends with `x_j` and the road there. A kind of residual is a [`LinearResidual`]. One that is
//! cheap to ask implements [`RowResidual`] and gives its rows by [`EachRow`]; the forest keeps its rows from step to step
//! (`lookahead.rs`).

use super::ROAD;
use super::fits::{Expected, ModelMismatch};
use super::lookahead::LookedUp;
use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;

/// A learned residual of a vehicle `V` with `S` states.
pub trait LinearResidual<V, const S: usize>: Any + Debug + Send + Sync {
    /// Commands and states of its window, at least 1.
    fn window(&self) -> usize;

    /// Checks that it was learned for such a controller.
    ///
    /// # Errors
    /// The first difference that matters.
    fn check_fits(&self, expected: &Expected<V>) -> Result<(), ModelMismatch>;

    /// Its rows over a horizon of so many steps. They have all room that they need.
    fn rows(self: Arc<Self>, horizon: usize) -> Box<dyn ResidualRows<S>>;
}

/// A residual over the receding horizon of a controller.
pub trait ResidualRows<const S: usize>: Send {
    /// Moves on by a step: what was row `j + 1` is row `j`.
    fn advance(&mut self);

    /// Place of row 0 ([`LookedUp::slot`]); the others follow, and the last place is followed by the first.
    fn first(&self) -> usize;

    /// Takes the state at a place of window and horizon: row `j` ends with the state at `j + W - 1`.
    fn set_state(&mut self, at: usize, state: &[f64; S]);

    /// The residual of a row on a road: speed in m/s, curvature in 1/m, curvature rate in 1/m2.
    fn row(&mut self, row: usize, road: &[f64; ROAD]) -> LookedUp<'_, S>;
}

/// The residual of one row, without regard to the others.
pub trait RowResidual<const S: usize>: Send + Sync {
    /// Commands and states of its window, at least 1.
    fn window(&self) -> usize;

    /// Writes the effects of the window's commands, oldest first, per rad (`command` comes with zeros). Gives the constant part,
    /// and the distance from its training: 0 inside, from 0.5 on the controller does not use it. `states` are the
    /// window's, oldest first.
    fn row(&self, states: &[[f64; S]], road: &[f64; ROAD], command: &mut [[f64; S]]) -> ([f64; S], f64);
}

/// Rows of a residual that is asked anew for each.
#[derive(Debug)]
pub struct EachRow<M, const S: usize> {
    model: Arc<M>,
    horizon: usize,
    window: usize,
    states: Vec<[f64; S]>,
    command: Vec<[f64; S]>,
}

impl<M: RowResidual<S>, const S: usize> EachRow<M, S> {
    /// Rows over a horizon.
    #[must_use]
    pub fn new(model: Arc<M>, horizon: usize) -> Self {
        let window = model.window();
        let (states, command) = (vec![[0.0; S]; window + horizon], vec![[0.0; S]; window]);
        Self { model, horizon, window, states, command }
    }
}

impl<M: RowResidual<S>, const S: usize> ResidualRows<S> for EachRow<M, S> {
    fn advance(&mut self) {
        self.states.copy_within(1.., 0);
    }

    fn first(&self) -> usize {
        0
    }

    fn set_state(&mut self, at: usize, state: &[f64; S]) {
        self.states[at] = *state;
    }

    fn row(&mut self, row: usize, road: &[f64; ROAD]) -> LookedUp<'_, S> {
        crate::invariant!(row < self.horizon);
        self.command.fill([0.0; S]);
        let states = &self.states[row..][..self.window];
        let (constant, excess) = self.model.row(states, road, &mut self.command);
        let mut held = [0.0; S];
        for effect in &self.command {
            held.iter_mut().zip(effect).for_each(|(held, effect)| *held += effect);
        }
        LookedUp {
            slot: row,
            renewed: true,
            constant,
            command: &self.command,
            held,
            state: &[],
            newest: &[],
            excess,
        }
    }
}
