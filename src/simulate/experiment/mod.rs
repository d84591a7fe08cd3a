//! The comparison of all variants: plants, rows, weights, noise, seeds. Written once for every kind of vehicle.
//!
//! | file | problem |
//! |---|---|
//! | `vehicle.rs` | differences between kinds of vehicles |
//! | `plant.rs` | the vehicles that are driven |
//! | `roads.rs` | the roads |
//! | `row.rs` | the predictors |
//! | `step.rs` | a recorded step, from which delay models are identified |
//! | `learn.rs` | prediction model of a row |
//! | `weights.rs` | search of each row's weights, with one budget |
//! | `tune.rs` | score of weights |
//! | `trial.rs` | one drive |
//! | `fit.rs` | errors of predictions, one step and a horizon ahead |
//! | `response.rs` | the response to a step of the command, recorded and predicted |
//! | `compare.rs` | all of it on one plant: collect, learn, tune, drive |
//! | `edge.rs` | the paper's setting: a nominal MPC at its edge |
//! | `sweep.rs` | the error over the dead time |
//! | `result.rs` | results |

mod compare;
mod edge;
mod fit;
mod learn;
mod plant;
mod response;
mod result;
mod roads;
mod row;
mod step;
mod sweep;
mod trial;
mod tune;
mod vehicle;
mod weights;

pub use compare::{CompareError, Comparison, ComparisonFor};
pub use edge::Edge;
pub use fit::{FitMetrics, steps_ahead};
pub use learn::SHORT_HORIZON;
pub use plant::{CAR_PLANTS, STEER_DELAY, STEER_LAG, TRUCK_PLANTS, TestPlant};
pub use result::{Condition, DriveMetrics, Effort, RowFit, RowResult, vehicle_digest};
pub use roads::Roads;
pub use row::{CAR_ROWS, Predictor, TRUCK_ROWS, TableRow};
pub use step::{Identified, SteeringStep};
pub use sweep::{SweepPoint, SweepSetting, sweep};
pub use trial::{LOST, Trial, TrialError, TrialFor};
pub use vehicle::{Again, CALM, Compared, DITHER, NominalOf, Setting, TRUCK_CALM, TRUCK_DITHER};
pub use weights::{CostWeights, Space, WeightSearch, search};
