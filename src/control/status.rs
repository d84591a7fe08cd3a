//! Result of a control step, in plain words.

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
        FarFromPath = 6 "far_from_path", "The vehicle is too far from the path for the linear model: driving slowly to the path, or stopping if it has left it";
        Finished = 7 "finished", "The end of the path is reached: the vehicle is stopped";
        Bridged = 8 "bridged", "A measurement is missing or implausible: the prediction stands in for it";
        SafeStop = 9 "safe_stop", "Measurements were missing or implausible for too long: braking to a stop along the road";
        ResidualFaded = 10 "residual_faded", "The learned model predicts worse than the nominal one: it is faded out";
        Slowed = 11 "slowed", "The lateral error is large and grows: driving more slowly";
        RolledBack = 12 "rolled_back", "The vehicle rolled back although it was to drive, as on a slope that is too steep for it: the brakes hold it";
    }
}
