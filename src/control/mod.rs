//! The controller: from a measurement to steering and acceleration commands.
//!
//! | file | problem |
//! |---|---|
//! | `parameters.rs` | every weight, bound and gain, declared once |
//! | `tracking_qp.rs` | the quadratic program of one step, and the trait of its solvers |
//! | `condense.rs` | from an affine model over the horizon to that program |
//! | `condensed_cost.rs` | that program's cost over the inputs alone |
//! | `cost_term.rs` | further terms of that cost |
//! | `active_set/`, `cholesky.rs` | its solution by a dual active-set method: fast where few bounds are active |
//! | `clarabel_solver.rs` | its solution by an interior-point method, updated in place: always works |
//! | `fast_solver.rs` | the first, and where it fails the second |
//! | `solve.rs` | a linear system of a few equations |
//! | `bank.rs` | hypotheses of the steering actuator, scored while driving |
//! | `history.rs` | the window of states and commands of a learned residual |
//! | `observer.rs` | state and disturbance from noisy measurements: offset-free tracking |
//! | `rate_sensor.rs` | bias and scale of the yaw-rate sensor, by the yaw angle |
//! | `yaw_sensor.rs` | offset of the yaw angle, by the place |
//! | `sensor_filter.rs` | the filter of both |
//! | `preview.rs` | the road over the horizon |
//! | `reference.rs` | states and steering of following the road |
//! | `lateral.rs` | the MPC: road ahead, cost, bounds |
//! | `variant/` | prediction models: nominal, learned residual, known actuator, nonlinear |
//! | `choice.rs` | choice of the variant: from a user's word, parameters and files |
//! | `controller_file.rs` | parameters from a file |
//! | `speed.rs` | speed tracking |
//! | `longitudinal.rs` | speed and lag error by MPC |
//! | `grip.rs` | what the road leaves to drive and brakes: grip beside steering, slopes |
//! | `guard.rs`, `guard/` | plausibility of measurements, and their replacement |
//! | `fading.rs` | comparison of a learned model with the nominal one |
//! | `controller.rs` | one step from measurement to commands; fallback |
//! | `controller/` | its place on the path, acceleration, steering command, status, saved state |
//! | `vehicle.rs` | differences between kinds of vehicles |
//! | `truck.rs` | the truck's part, and its defaults |
//! | `margins/` | stability margins of the loop: gain, phase and delay |
//! | `sampler.rs` | sample instants |
//! | `step.rs` | what a step is given, and what it says |
//! | `status.rs` | result of a step, in words |

mod active_set;
mod bank;
mod choice;
mod cholesky;
mod clarabel_solver;
mod condense;
mod condensed_cost;
mod controller;
mod controller_file;
mod cost_term;
mod fading;
mod fast_solver;
mod grip;
mod guard;
mod history;
mod lateral;
mod longitudinal;
mod margins;
mod observer;
mod parameters;
mod preview;
mod rate_sensor;
mod reference;
mod sampler;
mod sensor_filter;
mod solve;
mod speed;
mod status;
mod step;
mod tracking_qp;
mod truck;
mod variant;
mod vehicle;
mod yaw_sensor;

pub use active_set::ActiveSetSolver;
pub use bank::{Bank, BankState, KnownActuator, WIDEST_GAP};
pub use choice::{Choice, ChoiceError, ControlVariant, LearnedModel, LearnedModelFor, MODEL_EXTENSION};
pub use clarabel_solver::{BuildError, ClarabelSolver};
pub use condense::{Affine, HorizonModel, HorizonState, Propagation, condense};
pub use controller::{Controller, ControllerError, ControllerFor, ControllerState};
pub use controller_file::{ControllerFile, ControllerFileError};
pub use cost_term::{CostTerm, HorizonStep};
pub use fast_solver::{FastSolver, build_solver};
pub use guard::GuardParameters;
pub use history::History;
pub use lateral::{LateralError, LateralInput, LateralMpc};
pub use longitudinal::{
    LongitudinalInput, LongitudinalMpc, LongitudinalParameters, LongitudinalState, LongitudinalStep,
};
pub use margins::{LinearController, LinearObserver, MarginError, Margins, SteeringLoop, Tail};
pub use observer::{Observer, ObserverNoise, ObserverParameters};
pub use parameters::{
    ActuatorParameters, ControllerParameters, ControllerParametersFor, MpcParameters, NmpcParameters,
    NominalVehicle, SHOWN_HORIZON, SpeedController, SpeedParameters,
};
pub use preview::SpeedAhead;
pub use sampler::Sampler;
pub use speed::{SpeedCommand, track_speed};
pub use status::ControlStatus;
pub use step::{Measurement, StepError, StepReport};
pub use tracking_qp::{QpEnd, QpError, QpReport, QpShape, QpSolver, SoftBound, TrackingQp};
pub use truck::{NominalTruck, TRUCK_STATES, TruckController, TruckControllerParameters};
pub use variant::{
    ArticulatedModel, ArticulatedRollOut, BicycleModel, BicycleRollOut, ExpectedState, NonlinearModel,
    NonlinearRollOut, PredictionModel, PredictionModelFor, Residual, RollOut, StepSpeed, Timing,
};
pub use vehicle::{Bound, ControlledParameters, ControlledVehicle, FurtherState, GpOf, Nonlinear};
