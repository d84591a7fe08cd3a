//! Slow motions of a car.

use super::output::SIGNALS;
use super::plant::{CarPlant, STATES, WHEELS};
use crate::vehicle::reduced::{FIRST_BODY, Relaxed, SprungBody, spring_stiffness};
use crate::vehicle::tyre::TyreModel;
use crate::vehicle::unit::{ROLL, ROLL_RATE, UnitAxle, VY, Wheels, YAW, YAW_RATE};

impl<T: TyreModel> Relaxed<STATES, SIGNALS> for CarPlant<T> {
    type Tyre = T;

    const SLOW: &'static [usize] = &[VY, YAW, YAW_RATE, ROLL, ROLL_RATE];

    const ORDER: usize = 3;

    const FIRST_WHEEL: usize = WHEELS;

    const AXLES: usize = 2;

    fn wheels(&self) -> &[Wheels<T>] {
        &self.wheels
    }

    fn axle(&self, index: usize) -> &UnitAxle<T> {
        &self.unit.axles[index]
    }

    fn bodies(&self) -> Vec<SprungBody> {
        let (heave_stiffness, pitch_stiffness) = spring_stiffness(self.unit.axles.iter());
        vec![SprungBody {
            heave: FIRST_BODY.0,
            pitch: FIRST_BODY.1,
            mass: self.unit.sprung_mass,
            inertia: self.unit.pitch_inertia,
            roll_inertia: 1.0 / self.unit.inverse_inertia[2][2],
            heave_stiffness,
            pitch_stiffness,
        }]
    }

    fn arm(&self) -> f64 {
        self.unit.reference_x
    }

    fn mass(&self) -> f64 {
        self.unit.mass
    }

    fn trailer(&self) -> Option<[usize; 3]> {
        None
    }

    fn measured_articulation(&self, _: &[f64; STATES]) -> (f64, f64) {
        (0.0, 0.0)
    }
}
