//! Our models as FMI units: their variables, and how a step of theirs becomes a step of the FMU.
//!
//! | file | FMU |
//! |---|---|
//! | `passenger_car.rs` | `PassengerCar`: the nonlinear car |

mod passenger_car;

pub use passenger_car::PassengerCar;
