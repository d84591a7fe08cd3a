//! The vehicle at values of its uncertain parameters.

use super::parameter::{Transform, UncertainParameter};
use crate::diagnose::library::{Library, OwnEffect};
use crate::diagnose::replay::ReplayVehicle;
use crate::vehicle::TruckEffects;

/// Least and greatest fall of stiffness with load, 1 / PKY2: none, and the greatest stiffness at half the nominal load.
const FALL: (f64, f64) = (1e-3, 2.0);

impl UncertainParameter {
    /// Puts a value on the vehicle or its effects.
    fn put<V: ReplayVehicle>(&self, x: f64, vehicle: &mut V, effects: &mut TruckEffects) {
        if x == 0.0 {
            return;
        }
        match self.turns {
            Transform::Relaxation => effects.vehicle.tyre_relaxation = self.value(x),
            Transform::Effect | Transform::RateLimit => {
                if let Some(place) = effects.get_mut(self.id) {
                    *place = self.value(x);
                }
            }
            Transform::Factor | Transform::Shift => {
                if let Some(parameter) = V::TABLE.iter().find(|parameter| parameter.name == self.id) {
                    let before = parameter.get(vehicle);
                    let factor = matches!(self.turns, Transform::Factor);
                    parameter
                        .set(vehicle, if factor { before * self.value(x) } else { before + self.value(x) });
                }
            }
            Transform::TyreShape
            | Transform::TyreCurvature
            | Transform::TyrePeak
            | Transform::TyreSoftening
            | Transform::TyreLoad => {
                for file in vehicle.tyres().into_iter().filter_map(|(_, tyre)| tyre.coefficients.as_mut()) {
                    match self.turns {
                        Transform::TyreShape => file.pcy1 = (file.pcy1 * self.value(x)).clamp(0.9, 1.9),
                        Transform::TyrePeak => file.lmuy *= self.value(x),
                        Transform::TyreSoftening => {
                            file.softening = (file.softening + self.value(x)).clamp(-0.5, 3.0)
                        }
                        Transform::TyreLoad => {
                            let before = 1.0 / file.pky2;
                            let fall = (before + self.value(x)).clamp(FALL.0, FALL.1);
                            // As of a sine of twice an arc tangent: 2 f / (1 + f^2).
                            let at_nominal = |fall: f64| fall / (1.0 + fall * fall);
                            file.pky1 *= at_nominal(before) / at_nominal(fall);
                            file.pky2 = 1.0 / fall;
                        }
                        _ => file.pey1 = (file.pey1 + self.value(x)).clamp(-10.0, 1.0),
                    }
                }
            }
            Transform::Own(_)
            | Transform::Scale(_)
            | Transform::Bias(_)
            | Transform::Arm
            | Transform::ReferenceHeight
            | Transform::InertialLag
            | Transform::ReceiverLate
            | Transform::ImuHeight
            | Transform::Form(_) => {}
        }
    }
}

/// The vehicle and its effects at coordinates.
#[must_use]
pub fn at<V: ReplayVehicle>(uncertain: &[UncertainParameter], x: &[f64], vehicle: &V) -> (V, TruckEffects) {
    let (mut vehicle, mut effects) = (vehicle.clone(), TruckEffects::default());
    for (uncertain, &x) in uncertain.iter().zip(x) {
        uncertain.put(x, &mut vehicle, &mut effects);
    }
    (vehicle, effects)
}

/// Effects of one's own that are not neutral, with their values.
pub fn own_effects<'a>(
    uncertain: &[UncertainParameter],
    x: &[f64],
    library: Library<'a>,
) -> impl Iterator<Item = (&'a dyn OwnEffect, f64)> {
    uncertain.iter().zip(x).filter(|(_, x)| **x != 0.0).filter_map(move |(uncertain, &x)| {
        let Transform::Own(place) = uncertain.turns else { return None };
        Some((library.own.get(place)?.as_ref(), uncertain.value(x)))
    })
}
