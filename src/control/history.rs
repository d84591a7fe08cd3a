//! Recent measurements and commands of the controller: the window of a learned residual.

use crate::nominal::ERRORS;
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// The last `W` measured states and the last `W - 1` commands, oldest first.
///
/// Until there are as many, the window is filled with known values: the first state, and the command in force. "No
/// residual until the window is full" would leave a vehicle with a slow actuator to the nominal model for W steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct History<const S: usize = ERRORS> {
    states: Vec<SVector<f64, S>>,
    commands: Vec<f64>,
    filled: bool,
}

impl<const S: usize> History<S> {
    /// A window of `window` steps; 0 for none.
    #[must_use]
    pub fn new(window: usize) -> Self {
        Self {
            states: vec![SVector::zeros(); window],
            commands: vec![0.0; window.saturating_sub(1)],
            filled: false,
        }
    }

    /// Takes the state of this step, with the command in force before it.
    pub fn observe(&mut self, state: &SVector<f64, S>, command: f64) {
        if !self.filled {
            self.states.fill(*state);
            self.commands.fill(command);
            self.filled = true;
            return;
        }
        shift(&mut self.states, *state);
        shift(&mut self.commands, command);
    }

    /// Forgets the states, not the commands: the vehicle was moved.
    pub fn forget_states(&mut self) {
        self.filled = false;
    }

    /// States, oldest first; the last is this step's.
    #[must_use]
    pub fn states(&self) -> &[SVector<f64, S>] {
        &self.states
    }

    /// Commands before this step, oldest first.
    #[must_use]
    pub fn commands(&self) -> &[f64] {
        &self.commands
    }
}

fn shift<T: Copy>(values: &mut [T], newest: T) {
    if values.is_empty() {
        return;
    }
    values.rotate_left(1);
    values[values.len() - 1] = newest;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nominal::ErrorState;

    #[test]
    fn it_is_filled_at_once_and_then_moves() {
        let mut history = History::new(3);
        let state = |e1: f64| ErrorState::new(e1, 0.0, 0.0, 0.0);
        history.observe(&state(1.0), 0.1);
        assert_eq!((history.states()[0][0], history.commands()), (1.0, &[0.1, 0.1][..]));
        history.observe(&state(2.0), 0.2);
        history.observe(&state(3.0), 0.3);
        assert_eq!(history.states().iter().map(|x| x[0]).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
        assert_eq!(history.commands(), [0.2, 0.3]);
    }

    #[test]
    fn no_window_is_no_history() {
        let mut history = History::new(0);
        history.observe(&ErrorState::zeros(), 0.1);
        assert!(history.states().is_empty() && history.commands().is_empty());
    }
}
