//! Unmodelled effects: differences of a real vehicle from its nominal model, one switch each.
//!
//! Each effect is declared once, here: its id is the field of [`Effects`], the FMU parameter `effect.<id>` and the
//! word in a diagnosis. All are neutral by default. Sensor effects act on outputs only, never on the motion.

use crate::numerics::Readable;
use crate::signal::Unit;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Stage of an effect: the place of its action on the way from command to measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Stage {
    Command,
    Actuator,
    Linkage,
    Tyre,
    Body,
    Road,
    Drive,
    Sensor,
}

impl Stage {
    /// The stage's name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Command => "command",
            Self::Actuator => "actuator",
            Self::Linkage => "linkage",
            Self::Tyre => "tyre, road",
            Self::Body => "body",
            Self::Road => "road, air",
            Self::Drive => "drive",
            Self::Sensor => "sensor",
        }
    }
}

/// Rate limit that stands for none, rad/s (a number that every tool can write, unlike infinity).
pub const NO_RATE_LIMIT: f64 = 1e6;

/// One effect's declaration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effect {
    /// Name without the prefix `effect.`.
    pub id: &'static str,
    /// Unit of the value.
    pub unit: Unit,
    /// The value at which the effect is absent.
    pub neutral: f64,
    /// Least and greatest value.
    pub range: (f64, f64),
    /// Stage of its action.
    pub stage: Stage,
    /// Meaning, in one sentence.
    pub meaning: &'static str,
}

/// An effect's value is out of range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("effect.{id} = {} {} is outside {} ... {}; its neutral value is {}", Readable(*value), effect.unit.symbol, effect.range.0, effect.range.1, effect.neutral)]
#[allow(missing_docs)]
pub struct EffectOutOfRange {
    pub id: &'static str,
    pub value: f64,
    pub effect: &'static Effect,
}

macro_rules! effects {
    ($(#[$attribute:meta])* $group:ident: $($id:ident $unit:ident neutral $neutral:expr, in $min:expr, $max:expr; $stage:ident; $meaning:literal)*) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $group { $(#[doc = $meaning] pub $id: f64,)* }

        impl Default for $group {
            fn default() -> Self {
                Self { $($id: $neutral),* }
            }
        }

        impl $group {
            /// The declarations, in the order of the FMU's parameters.
            pub const ALL: &'static [Effect] = &[$(Effect {
                id: stringify!($id), unit: Unit::$unit, neutral: $neutral, range: ($min, $max),
                stage: Stage::$stage, meaning: $meaning,
            }),*];

            /// The value of the effect with this id.
            #[must_use]
            pub fn get(&self, id: &str) -> Option<f64> {
                match id { $(stringify!($id) => Some(self.$id),)* _ => None }
            }

            /// Value of the effect with this id.
            #[must_use]
            pub fn get_mut(&mut self, id: &str) -> Option<&mut f64> {
                match id { $(stringify!($id) => Some(&mut self.$id),)* _ => None }
            }

            /// Looks a declaration up by id.
            #[must_use]
            pub fn find(id: &str) -> Option<&'static Effect> {
                Self::ALL.iter().find(|effect| effect.id == id)
            }

            /// Checks every value against its range.
            ///
            /// # Errors
            /// The first effect out of range.
            pub fn check(&self) -> Result<(), EffectOutOfRange> {
                for effect in Self::ALL {
                    let value = self.get(effect.id).unwrap_or(f64::NAN);
                    if !(value >= effect.range.0 && value <= effect.range.1) {
                        return Err(EffectOutOfRange { id: effect.id, value, effect });
                    }
                }
                Ok(())
            }
        }
    };
}

effects! {
    /// The value of every effect that cars and trucks have; [`Default`] is neutral.
    Effects:
    steer_delay SECOND neutral 0.0, in 0.0, 2.0; Command; "Dead time added to the steering command"
    steer_lag SECOND neutral 0.0, in 0.0, 5.0; Actuator; "First-order time constant added to the steering actuator"
    steer_rate_limit RADIAN_PER_SECOND neutral NO_RATE_LIMIT, in 1e-3, NO_RATE_LIMIT; Actuator; "Limit of the road-wheel steering rate; 1e6 and more: none beyond the vehicle's own"
    steer_backlash RADIAN neutral 0.0, in 0.0, 0.5; Actuator; "Full gap width of the steering backlash, added"
    steer_offset RADIAN neutral 0.0, in -0.5, 0.5; Linkage; "Offset behind the steering sensor: real = gain * commanded + offset"
    steer_gain ONE neutral 1.0, in 0.2, 3.0; Linkage; "Ratio error behind the steering sensor: real = gain * commanded + offset"
    tyre_stiffness_front ONE neutral 1.0, in 0.1, 5.0; Tyre; "Factor on the front tyres' cornering stiffness"
    tyre_stiffness_rear ONE neutral 1.0, in 0.1, 5.0; Tyre; "Factor on the rear tyres' cornering stiffness"
    road_friction ONE neutral 1.0, in 0.05, 2.0; Tyre; "Factor on the friction between tyres and road"
    tyre_relaxation METRE neutral 0.0, in 0.0, 5.0; Tyre; "Relaxation length of the lateral slip: the front tyres' at rest, others and loads as in the files; 0: as the files have it"
    payload KILOGRAM neutral 0.0, in 0.0, 20000.0; Body; "Mass loaded on the body at the height of its CG"
    payload_x METRE neutral 0.0, in -10.0, 10.0; Body; "Place of the payload, forward of the unladen CG positive"
    cg_shift METRE neutral 0.0, in -1.0, 1.0; Body; "Shift of the unladen CG against the file, forward positive"
    yaw_inertia ONE neutral 1.0, in 0.2, 5.0; Body; "Factor on the unladen yaw inertia"
    roll_stiffness ONE neutral 1.0, in 0.2, 5.0; Body; "Factor on the roll stiffness of springs and anti-roll bars together"
    road_bank RADIAN neutral 0.0, in -0.5, 0.5; Road; "Bank of the road, right side low positive, added to the road's own"
    road_grade RADIAN neutral 0.0, in -0.5, 0.5; Road; "Grade of the road, uphill positive, added to the road's own"
    wind_x METRE_PER_SECOND neutral 0.0, in -60.0, 60.0; Road; "Wind velocity to the east, fixed in the world"
    wind_y METRE_PER_SECOND neutral 0.0, in -60.0, 60.0; Road; "Wind velocity to the north, fixed in the world"
    drag ONE neutral 1.0, in 0.0, 20.0; Road; "Factor on the aerodynamic drag"
    drive_lag SECOND neutral 0.0, in 0.0, 5.0; Drive; "First-order time constant added to drive and brakes"
    drive_gain ONE neutral 1.0, in 0.0, 3.0; Drive; "Factor from asked to given longitudinal acceleration"
    brake_pull NEWTON_METRE neutral 0.0, in -20000.0, 20000.0; Drive; "Steady yaw moment on the moving car, as one dragging brake gives it, positive to the left"
    yaw_rate_bias RADIAN_PER_SECOND neutral 0.0, in -0.5, 0.5; Sensor; "Bias of the measured yaw rate"
    lateral_accel_bias METRE_PER_SECOND2 neutral 0.0, in -5.0, 5.0; Sensor; "Bias of the measured lateral acceleration"
    sensor_delay SECOND neutral 0.0, in 0.0, 1.0; Sensor; "Latency of all motion signals (pose, velocities, accelerations, attitude; not of the steering sensor)"
    speed_scale ONE neutral 1.0, in 0.5, 2.0; Sensor; "Factor on the measured velocities"
    imu_lever_arm METRE neutral 0.0, in -5.0, 5.0; Sensor; "Place of the accelerometer forward of the point that it is taken for"
    heading_misalignment RADIAN neutral 0.0, in -0.5, 0.5; Sensor; "Mounting angle of the inertial unit to the left: yaw is measured too great, body axes turn with it"
}

effects! {
    /// The value of every effect of a trailer and its hitch; [`Default`] is neutral.
    TrailerEffects:
    trailer_payload KILOGRAM neutral 0.0, in 0.0, 40000.0; Body; "Mass loaded on the trailer at its CG"
    trailer_stiffness ONE neutral 1.0, in 0.1, 5.0; Tyre; "Factor on the trailer tyres' cornering stiffness"
    hitch_offset METRE neutral 0.0, in -1.0, 1.0; Body; "Shift of the hitch on the tractor against the file, forward positive"
    articulation_friction NEWTON_METRE neutral 0.0, in 0.0, 50000.0; Body; "Dry friction moment of the fifth wheel against articulation, added"
    articulation_bias RADIAN neutral 0.0, in -0.5, 0.5; Sensor; "Bias of the measured articulation angle"
}

/// A truck has no effect of this id.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no effect '{id}' of a truck; 'rfl diagnose --explain' lists all")]
#[allow(missing_docs)]
pub struct UnknownEffect {
    pub id: String,
}

/// The effects of a truck. Those that cars have too act on the tractor (`payload`, `cg_shift`, `yaw_inertia`, sensors)
/// or on all of it: `road_*`, `wind_*`, `drag`, `drive_*`, `tyre_relaxation`, `roll_stiffness`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<String, f64>", into = "BTreeMap<String, f64>")]
pub struct TruckEffects {
    /// Those that cars have too.
    pub vehicle: Effects,
    /// Those of trailer and hitch.
    pub trailer: TrailerEffects,
}

/// From a table of ids, as files hold it.
impl TryFrom<BTreeMap<String, f64>> for TruckEffects {
    type Error = UnknownEffect;

    fn try_from(table: BTreeMap<String, f64>) -> Result<Self, UnknownEffect> {
        let mut effects = Self::default();
        for (id, value) in table {
            let Some(place) = effects.get_mut(&id) else { return Err(UnknownEffect { id }) };
            *place = value;
        }
        Ok(effects)
    }
}

impl From<TruckEffects> for BTreeMap<String, f64> {
    fn from(effects: TruckEffects) -> Self {
        let value = |effect: &Effect| effects.get(effect.id).unwrap_or(effect.neutral);
        TruckEffects::all().map(|effect| (effect.id.to_owned(), value(effect))).collect()
    }
}

impl TruckEffects {
    /// All declarations, in the order of the FMU's parameters.
    pub fn all() -> impl Iterator<Item = &'static Effect> {
        Effects::ALL.iter().chain(TrailerEffects::ALL)
    }

    /// The value of the effect with this id.
    #[must_use]
    pub fn get(&self, id: &str) -> Option<f64> {
        self.vehicle.get(id).or_else(|| self.trailer.get(id))
    }

    /// Value of the effect with this id.
    #[must_use]
    pub fn get_mut(&mut self, id: &str) -> Option<&mut f64> {
        self.vehicle.get_mut(id).or_else(|| self.trailer.get_mut(id))
    }

    /// Both sets of effects together: additive ones are added, factors are multiplied, the narrower rate limit counts.
    /// A relaxation length replaces that of `base`.
    #[must_use]
    pub fn on_top_of(&self, base: &Self) -> Self {
        let mut both = *self;
        for effect in Self::all() {
            let (Some(value), Some(base)) = (both.get_mut(effect.id), base.get(effect.id)) else { continue };
            *value = match effect.id {
                "steer_rate_limit" => value.min(base),
                "tyre_relaxation" => {
                    if *value == effect.neutral {
                        base
                    } else {
                        *value
                    }
                }
                _ if effect.neutral == 1.0 => *value * base,
                _ => *value + base,
            };
        }
        let (load, below) = (self.vehicle.payload, base.vehicle.payload);
        if load + below > 0.0 {
            // The place of both loads together.
            let moment = load * self.vehicle.payload_x + below * base.vehicle.payload_x;
            both.vehicle.payload_x = moment / (load + below);
        }
        both
    }

    /// Checks every value against its range.
    ///
    /// # Errors
    /// The first effect out of range.
    pub fn check(&self) -> Result<(), EffectOutOfRange> {
        self.vehicle.check()?;
        self.trailer.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_come_on_top_of_each_other() {
        let mut base = TruckEffects::default();
        (base.vehicle.steer_delay, base.vehicle.steer_gain, base.vehicle.payload) = (0.05, 1.1, 100.0);
        let mut more = TruckEffects::default();
        (more.vehicle.steer_delay, more.vehicle.steer_gain, more.vehicle.steer_rate_limit) = (0.02, 0.5, 0.4);
        (more.vehicle.payload, more.vehicle.payload_x, more.trailer.trailer_payload) = (300.0, -1.0, 7.0);
        let both = more.on_top_of(&base);
        assert!(
            (both.vehicle.steer_delay - 0.07).abs() < 1e-15 && (both.vehicle.steer_gain - 0.55).abs() < 1e-15
        );
        assert_eq!(
            (both.vehicle.steer_rate_limit, both.vehicle.payload, both.vehicle.payload_x),
            (0.4, 400.0, -0.75)
        );
        assert_eq!(both.trailer.trailer_payload, 7.0);
        assert_eq!(more.on_top_of(&TruckEffects::default()), more);
        assert_eq!(TruckEffects::default().on_top_of(&base), base);
    }
}
