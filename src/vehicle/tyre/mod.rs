//! Tyres: force of the road on a wheel by its slip, load and inclination.
//!
//! Vehicles ask a [`TyreModel`]. The one of files is the Magic Formula 5.2 (`PAC2002` in Adams), its coefficients in `.tir` files:
//!
//! ```text
//!     y = D sin(C atan(B x - E (B x - atan(B x)))) + S_V,    x = slip + S_H,    B C D = slip stiffness
//! ```
//!
//! for pure longitudinal and lateral slip, weighted by `G = cos(C atan(...))` where both occur.
//!
//! | file | idea |
//! |---|---|
//! | `contact.rs` | slip, load and friction of a contact; its forces |
//! | `model.rs` | the trait of a formula, and four tyres side by side |
//! | `coefficients.rs` | the names of the standard's coefficients, their defaults |
//! | `tir.rs` | reading a `.tir` file |
//! | `magic_formula.rs`, `magic_formula/` | the formula; its self-aligning moment |
//! | `of_axle.rs` | the tyres of an axle: a file and factors on it |
//!
//! Source: H. B. Pacejka, Tyre and Vehicle Dynamics, 2nd ed., section 4.3.2 (signs: ISO; `PKY1 < 0`).

mod coefficients;
mod contact;
mod magic_formula;
mod model;
mod of_axle;
mod tir;

pub use coefficients::Coefficients;
pub use contact::{Contact, TyreForces};
pub use model::{FourTyres, OneByOne, TyreModel};
pub use of_axle::Tyre;
pub use tir::TirError;
