//! Uncertain parameters of a simulator: every effect, numbers of the vehicle that are known within a tolerance only, sensors, and errors
//! of the model's form.
//!
//! A parameter's coordinate is 0 where it is neutral and 1 at its `unit`; its tolerance is the standard deviation in
//! ordinary simulators. Tolerances are those of careful measurement: a weighed car (3 % with fuel and people), axle
//! stiffnesses from a test rig (4 %), a clock (10 ms), a level road (0.25 deg).
//!
//! | file | idea |
//! |---|---|
//! | `parameter.rs` | one of them: its coordinate, value and bounds |
//! | `list.rs` | which there are, and their tolerances |
//! | `vehicle.rs` | the vehicle at their values |
//! | `sensors.rs` | signals at the values of the sensors' |

mod list;
mod parameter;
mod sensors;
mod vehicle;

pub(super) use list::LOADED;
pub use list::{is_known, level, uncertain_parameters};
pub use parameter::UncertainParameter;
pub use sensors::{receiver_late, sense};
pub use vehicle::{at, own_effects};

#[cfg(test)]
mod tests {
    use super::list::TYRE_LOAD;
    use super::*;
    use crate::diagnose::library::Library;
    use crate::diagnose::replay::ReplayDrive;
    use crate::diagnose::simulated::{Conditions, drive};
    use crate::vehicle::tyre::TyreModel as _;
    use crate::vehicle::{TruckEffects, builtin};

    #[test]
    fn what_load_does_to_a_tyre_changes_no_stiffness_at_the_nominal_load() {
        let car = builtin("c_class").unwrap();
        let conditions = Conditions { seed: 3, duration: 10.0, step: 0.02, ..Conditions::default() };
        let log = drive(&car, &TruckEffects::default(), &conditions).unwrap();
        let uncertain = uncertain_parameters(&car, &ReplayDrive::new(&log, false), Library::default());
        let place = uncertain.iter().position(|uncertain| uncertain.id == TYRE_LOAD).unwrap();
        let stiffness = |x: f64, share: f64| {
            let mut all = vec![0.0; uncertain.len()];
            all[place] = x;
            let tyre = at(&uncertain, &all, &car).0.tyre.front.coefficients.unwrap();
            tyre.cornering_stiffness(share * tyre.fz0, 0.0)
        };
        for x in [-9.0, -1.0, 1.0, 4.0] {
            let (nominal, changed) = (stiffness(0.0, 1.0), stiffness(x, 1.0));
            assert!((changed / nominal - 1.0).abs() < 1e-9, "{x}: {changed} {nominal}");
        }
        // Twice the load gives twice the stiffness of a linear tyre, and less of others.
        let twice = |x: f64| stiffness(x, 2.0) / stiffness(x, 1.0);
        assert!((twice(-9.0) - 2.0).abs() < 1e-4, "{}", twice(-9.0));
        assert!(twice(0.0) > twice(1.0) && twice(-1.0) > twice(0.0));
    }
}
