//! What a control step did, in words that a person understands.

use serde::{Deserialize, Serialize};

/// Outcome of the newest control step. The discriminants are the values of the FMU's `status` output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
#[repr(i32)]
pub enum ControlStatus {
    /// No step has been computed yet.
    #[default]
    Waiting = 0,
    /// The optimal plan was found and its first input applied.
    Optimal = 1,
    /// A plan of reduced accuracy was found and applied.
    ReducedAccuracy = 2,
    /// The deadline passed: the last plan goes on.
    DeadlineMissed = 3,
    /// The solver found no solution: the last plan goes on.
    SolverFailed = 4,
    /// The last plan is used up: steering is held and the vehicle is braked.
    SafeHold = 5,
    /// The vehicle is further from the path than the linear model reaches; the controller goes on, slowly.
    FarFromPath = 6,
    /// The end of an open path is reached: steering is held and the vehicle is stopped.
    Finished = 7,
}

impl ControlStatus {
    /// Value, name and meaning of each status, for the FMU's enumeration.
    pub const ITEMS: &[(i32, &'static str, &'static str)] = &[
        (0, "waiting", "No step has been computed yet"),
        (1, "optimal", "The optimal plan was found and its first input applied"),
        (2, "reduced_accuracy", "A plan of reduced accuracy was found and applied"),
        (3, "deadline_missed", "The deadline passed: the last plan goes on"),
        (4, "solver_failed", "The solver found no solution: the last plan goes on"),
        (5, "safe_hold", "The last plan is used up: steering is held and the vehicle is braked"),
        (6, "far_from_path", "The vehicle is too far from the path for the linear model; driving slowly"),
        (7, "finished", "The end of the path is reached: the vehicle is stopped"),
    ];
}
