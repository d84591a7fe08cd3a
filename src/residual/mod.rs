//! Errors of the nominal model, learned from drives: constant or linear in the commands, chosen by trees.
//!
//! The controller predicts with `x_{k+1} = A x_k + B u_k + D psi_des' + E psi_des'' + r_k`. A tree looks at quantities
//! that are already decided (past errors, speed, road) and finds a leaf. The leaf's model is linear in the window of
//! the last W commands, so that the controller's problem stays a quadratic program:
//!
//! ```text
//! r_k = beta_0 + sum_{i=1..W} beta_i u_{k-W+i}          beta: mean over the T trees of their leaves' coefficients
//! ```
//!
//! (Zhao et al., Learning Residual Model of Model Predictive Control via Random Forests, ITSC 2024.)
//!
//! ```text
//! drives -> DataSet (checks, labels) -> train -> ResidualModel <-> file
//!                                                   | coefficients(), each step of the horizon
//!                                                   v
//!                                               controller
//! ```
//!
//! ```
//! use rfl_mpc::numerics::Random;
//! use rfl_mpc::residual::{DataConfig, DataSet, Drive, Kind, ResidualModel, TrainConfig, train};
//! use rfl_mpc::vehicle::SingleTrack;
//!
//! let car = SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 };
//! let mut random = Random::new(1);
//! let mut log = Drive { name: "noise".into(), ..Drive::default() };
//! for k in 0..600 {
//!     log.time.push(0.02 * f64::from(k));
//!     log.vx.push(10.0);
//!     for column in [&mut log.curvature, &mut log.curvature_rate] {
//!         column.push(0.0);
//!     }
//!     for column in [&mut log.steer_cmd, &mut log.e1, &mut log.e1_rate, &mut log.e2, &mut log.e2_rate] {
//!         column.push(0.01 * random.uniform());
//!     }
//! }
//! let data = DataSet::new(&[log], &car, DataConfig::default())?;
//! let trained = train(&data, None, &TrainConfig::new(Kind::Rfl), &|_| ())?;
//! assert!(trained.report.train.rmse[0] < trained.report.train.nominal_rmse[0]);
//!
//! let model = ResidualModel::from_bytes(&trained.model.to_bytes()?)?;
//! let (features, mut workspace) = (vec![0.0; model.features()], model.workspace());
//! model.coefficients(&features, &[], &mut workspace);
//! assert_eq!(workspace.command().len(), 16);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | file | idea |
//! |---|---|
//! | `recorded.rs` | drives as recorded, row by row, and the report of their repairs |
//! | `dataset.rs` | labels and windows from drives |
//! | `checks.rs` | faults of recorded drives |
//! | `table.rs`, `tree.rs`, `forest.rs` | binning, CART, random forests and their look-up |
//! | `least_squares.rs` | QR and normal equations, ridge |
//! | `actuator.rs`, `prior.rs` | the actuator that the samples show, and the prior that it gives the effects of commands |
//! | `global.rs`, `leaf.rs` | one linear model for all; models in leaves |
//! | `train_config.rs`, `train.rs` | from a data set to a model and a report of its fit |
//! | `stages.rs` | the training's stages: global fit, trees, leaves |
//! | `measure.rs` | one-step errors of a model |
//! | `schema.rs` | description of a model |
//! | `model.rs` | the model: its coefficients at any features |
//! | `linear.rs` | the trait of a residual, as a controller asks for it |
//! | `fits.rs` | the check that a model fits a controller |
//! | `lookahead.rs` | the same over the receding horizon of the controller |
//! | `file.rs`, `rows.rs` | the model's file |
//! | `gp/` | the Gaussian process of GP-NMPC |

mod actuator;
mod checks;
mod dataset;
mod file;
mod fits;
mod forest;
mod global;
pub mod gp;
mod leaf;
mod least_squares;
mod linear;
mod lookahead;
mod measure;
mod model;
mod prior;
mod recorded;
mod rows;
mod schema;
mod stages;
mod table;
mod train;
mod train_config;
mod tree;

pub use actuator::{ShownActuator, ShownBy};
pub use checks::DataError;
pub(crate) use dataset::acceleration;
pub use dataset::{DataConfig, DataSet, Windows};
pub(crate) use file::in_file;
pub use file::{FORMAT, FileError, FileKind};
pub use fits::{Expected, ModelMismatch};
pub use forest::{Block, Forest, ForestConfig, GrownForest, grow};
pub use leaf::{LeafFit, LeafModels};
pub use least_squares::{Decomposed, Gram, Theta, Triangle};
pub use linear::{EachRow, LinearResidual, ResidualRows, RowResidual};
pub use lookahead::{Lookahead, LookedUp};
pub use measure::FitErrors;
pub use model::{Coefficients, ResidualModel, ResidualModelFor};
pub(crate) use prior::write_residual_of_actuator;
pub use prior::{CommandPrior, residual_of_actuator};
pub(crate) use recorded::DriveRow;
pub use recorded::{DataReport, Drive};
pub use schema::{Kind, Range, Regressors, Schema, Training, TreeFeatures};
pub use stages::{Progress, TrainingStage};
pub use table::{Columns, Dense, Resolution};
pub use train::{TrainError, TrainReport, Trained, train};
pub use train_config::{ConfigError, LambdaChoice, TrainConfig};
pub use tree::MAX_DEPTH;

/// Components of a car's state and so of its residual: e1, e1', e2, e2'.
pub const OUTPUTS: usize = crate::nominal::ERRORS;

/// Features of the road and speed: vx, curvature, curvature rate.
pub const ROAD: usize = 3;

/// Longest window, in steps.
pub const MAX_WINDOW: usize = 128;
