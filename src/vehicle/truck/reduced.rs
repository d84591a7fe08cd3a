//! Slow motions of a truck.

use super::output::SIGNALS;
use super::plant::{STATES, TRAILER, TruckPlant, WHEELS, WIND_UP};
use crate::vehicle::reduced::{FIRST_BODY, Relaxed, SprungBody, spring_stiffness};
use crate::vehicle::tyre::TyreModel;
use crate::vehicle::unit::{ROLL, ROLL_RATE, UnitAxle, VY, Wheels, YAW, YAW_RATE};

impl<T: TyreModel> Relaxed<STATES, SIGNALS> for TruckPlant<T> {
    type Tyre = T;

    const SLOW: &'static [usize] =
        &[VY, YAW, YAW_RATE, ROLL, ROLL_RATE, TRAILER, TRAILER + 1, TRAILER + 2, TRAILER + 3];

    const ORDER: usize = 2;

    const FIRST_WHEEL: usize = WHEELS;

    const AXLES: usize = 3;

    fn wheels(&self) -> &[Wheels<T>] {
        &self.wheels
    }

    fn axle(&self, index: usize) -> &UnitAxle<T> {
        if index < 2 { &self.tractor.axles[index] } else { &self.trailer.axles[0] }
    }

    fn bodies(&self) -> Vec<SprungBody> {
        let (stiff, arms) = self.hitch.vertical();
        let of_tractor = spring_stiffness(self.tractor.axles.iter());
        let of_trailer = spring_stiffness(self.trailer.axles.iter());
        let (tractor, trailer) = (&self.tractor, &self.trailer);
        vec![
            SprungBody {
                heave: FIRST_BODY.0,
                pitch: FIRST_BODY.1,
                mass: tractor.sprung_mass,
                inertia: tractor.pitch_inertia,
                roll_inertia: 1.0 / tractor.inverse_inertia[2][2],
                heave_stiffness: of_tractor.0 + 2.0 * stiff,
                pitch_stiffness: of_tractor.1 + 2.0 * stiff * arms[0] * arms[0],
            },
            SprungBody {
                heave: [TRAILER + 6, TRAILER + 7],
                pitch: [TRAILER + 4, TRAILER + 5],
                mass: trailer.sprung_mass,
                inertia: trailer.pitch_inertia,
                roll_inertia: 1.0 / trailer.inverse_inertia[2][2],
                heave_stiffness: of_trailer.0 + 2.0 * stiff,
                pitch_stiffness: of_trailer.1 + 2.0 * stiff * arms[1] * arms[1],
            },
        ]
    }

    fn arm(&self) -> f64 {
        self.tractor.reference_x
    }

    fn mass(&self) -> f64 {
        self.tractor.mass + self.trailer.mass
    }

    fn trailer(&self) -> Option<[usize; 3]> {
        Some([TRAILER, TRAILER + 1, WIND_UP])
    }

    fn measured_articulation(&self, y: &[f64; STATES]) -> (f64, f64) {
        let [angle, rate] = self.articulations(y);
        (angle + self.effects.trailer.articulation_bias, rate)
    }
}
