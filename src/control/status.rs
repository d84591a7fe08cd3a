//! What a control step did, in words that a person understands.

use crate::enumeration;

enumeration! {
    /// Outcome of the newest control step.
    pub enum ControlStatus {
        Waiting = 0 "waiting", "No step has been computed yet";
        Optimal = 1 "optimal", "The optimal plan was found and its first input applied";
        ReducedAccuracy = 2 "reduced_accuracy", "A plan of reduced accuracy was found and applied";
        DeadlineMissed = 3 "deadline_missed", "The deadline passed: the last plan goes on";
        SolverFailed = 4 "solver_failed", "The solver found no solution: the last plan goes on";
        SafeHold = 5 "safe_hold", "The last plan is used up: steering is held and the vehicle is braked";
        FarFromPath = 6 "far_from_path", "The vehicle is too far from the path for the linear model; driving slowly";
        Finished = 7 "finished", "The end of the path is reached: the vehicle is stopped";
    }
}
