//! Extensions by a user: each in a file of its own, without a change in the library. They are the worked examples of
//! docs/development.md.

mod cost_term;
mod effect;
mod residual_kind;
mod tyre_model;
mod vehicle_kind;
