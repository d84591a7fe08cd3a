//! Robust tuning of controllers: a min-max search over an ensemble of vehicles, actuators and roads.
//!
//! ```text
//! min over the controller's numbers p    max_i J_i(p) + share * mean_i J_i(p) + penalty of margins that are missed
//! ```
//!
//! where `J_i` is the tracking error of a closed-loop drive, the scenario `i`. A drive is a whole one: nonlinear vehicle,
//! actuator, road, noise. Searches and examinations have separate seeds. Scenario `i` of the ensemble `n` has the road
//! seed `2000 n + i` for training, and `2000 n + 1000 + i` held out.
//!
//! | file | problem |
//! |---|---|
//! | `scenario.rs` | one drive, and its cost |
//! | `family.rs` | ensembles of scenarios by a seed |
//! | `goal.rs` | margins that the linear loop must have |
//! | `axis.rs` | axes of the search, over decades |
//! | `answer.rs` | the response to an offset, for a page |
//! | `search.rs` | the search: CMA-ES, with early stops of losing candidates |

mod answer;
mod axis;
mod family;
mod goal;
mod scenario;
mod search;

pub use answer::answer_to_offset;
pub use axis::{Axis, ControllerNumbers, number_of, standard_axes};
pub use family::{Actuators, Controlled, Family, FamilyError, Purpose};
pub use goal::{LoopMargins, MarginGoal, SPEEDS, margins_over_speeds};
pub use scenario::{LOST_AT, LOST_COST, Scenario, ScenarioError, ScenarioResult};
pub use search::{Ensemble, SearchSettings, TuneCandidate, search};
