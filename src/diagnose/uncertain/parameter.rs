//! One uncertain parameter.

use crate::diagnose::form::{FORMS, FormError};
use crate::diagnose::replay::{Channel, ReplayVehicle};
use crate::vehicle::Effect;

/// Action of an uncertain parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Transform {
    /// An effect by its id: neutral + unit * x.
    Effect,
    /// The rate limit: unit / x.
    RateLimit,
    /// An effect of one's own, by its place in the library: neutral + unit * x.
    Own(usize),
    /// The relaxation length: the file's times 1 + x, about unit * (1 + x).
    Relaxation,
    /// A number of the vehicle by its name: times exp(unit * x), so that none changes its sign.
    Factor,
    /// The same: plus unit * x.
    Shift,
    /// A sensor's scale: times 1 + unit * x.
    Scale(Channel),
    /// A sensor's bias: plus unit * x.
    Bias(Channel),
    /// Point at which sideways velocities are given: unit * x forward of the reference point.
    Arm,
    /// Height of that point over the one that the model means: unit * x, m.
    ReferenceHeight,
    /// Lateness by the low pass of the inertial sensors: unit * x, s.
    InertialLag,
    /// Lateness of a satellite receiver's columns: unit * x, s.
    ReceiverLate,
    /// Height of the accelerometer over the vehicle's CG: unit * x, m.
    ImuHeight,
    /// An error of the model's form, by its place in [`FORMS`]: unit * x of its shape.
    Form(usize),
    /// Curve of all tyres between slope and peak: shape factor times exp(unit * x); curvature factor plus unit * x.
    TyreShape,
    TyreCurvature,
    /// Lateral peak of all tyres, whose slope stays: times exp(unit * x).
    TyrePeak,
    /// Early softening of all tyres, as brushes have it: plus unit * x.
    TyreSoftening,
    /// Fall of the tyres' stiffness with load, 1 / PKY2: plus unit * x; the stiffness at the nominal load stays.
    TyreLoad,
}

/// One uncertain parameter.
#[derive(Debug, Clone)]
pub struct UncertainParameter {
    /// The effect's id, the parameter's name, or `sensor.<what>`.
    pub id: &'static str,
    pub(super) turns: Transform,
    /// Value of one unit of the coordinate, in the uncertain parameter's own unit.
    pub unit: f64,
    /// Standard deviation of the background, in units of the coordinate; 0: no background has it.
    pub tolerance: f64,
    /// Least coordinate.
    pub least: f64,
    /// Least coordinate of a named effect: the effect's own range.
    pub named_least: f64,
    /// Greatest coordinate.
    pub greatest: f64,
    /// Coordinates from which a fit starts.
    pub starts: &'static [f64],
    /// The declaration, if it is an effect of the library.
    pub effect: Option<&'static Effect>,
    /// Companion: another uncertain parameter that is free with it, and the standard deviation of that.
    pub companion: Option<(&'static str, f64)>,
    /// True if it may be named: false where the user leaves the effect out.
    pub(super) nameable: bool,
}

impl UncertainParameter {
    /// A coordinate within its bounds; `named`: within the effect's own range (a negative delay is a tolerance, no effect).
    #[must_use]
    pub fn within(&self, x: f64, named: bool) -> f64 {
        x.clamp(if named { self.named_least } else { self.least }, self.greatest)
    }

    /// Change of the coordinate over which a slope is taken.
    #[must_use]
    pub fn stride(&self) -> f64 {
        if self.tolerance > 0.0 { self.tolerance.clamp(0.1, 1.0) } else { 0.2 }
    }

    /// True if it may be named.
    #[must_use]
    pub fn is_candidate(&self) -> bool {
        self.nameable
    }

    /// True if its value replaces the given one instead of adding to it.
    #[must_use]
    pub fn stands_for_the_given(&self) -> bool {
        matches!(self.turns, Transform::RateLimit | Transform::Relaxation)
    }

    /// True if it acts on the sensors' signals, and not on the motion.
    #[must_use]
    pub fn is_sensed(&self) -> bool {
        matches!(
            self.turns,
            Transform::Scale(_)
                | Transform::Bias(_)
                | Transform::Arm
                | Transform::ReferenceHeight
                | Transform::InertialLag
                | Transform::ImuHeight
        )
    }

    /// True for an error of the model's form: no number of the vehicle, and nothing that a simulator can be given.
    #[must_use]
    pub fn is_form(&self) -> bool {
        matches!(
            self.turns,
            Transform::Form(_)
                | Transform::TyreShape
                | Transform::TyreCurvature
                | Transform::TyrePeak
                | Transform::TyreSoftening
                | Transform::TyreLoad
        )
    }

    /// True for a number of the vehicle, which its file has right within a tolerance.
    #[must_use]
    pub fn is_of_the_file(&self) -> bool {
        !self.is_form() && !self.is_sensed() && self.turns != Transform::ReceiverLate
    }

    /// Its row in [`FORMS`], if it is an error that is added to the replay.
    #[must_use]
    pub fn form(&self) -> Option<&'static FormError> {
        if let Transform::Form(place) = self.turns { FORMS.get(place) } else { None }
    }

    /// Its value at a coordinate, in its own unit; factors and shifts of the vehicle as such.
    #[must_use]
    pub fn value(&self, x: f64) -> f64 {
        match self.turns {
            Transform::Effect | Transform::Own(_) => {
                self.effect.map_or(0.0, |effect| effect.neutral) + self.unit * x
            }
            Transform::RateLimit if x <= 0.0 => crate::vehicle::NO_RATE_LIMIT,
            Transform::RateLimit => self.unit / x,
            Transform::Relaxation if x == 0.0 => 0.0,
            Transform::Relaxation => self.unit * (1.0 + x),
            Transform::Factor | Transform::TyreShape | Transform::TyrePeak => (self.unit * x).exp(),
            Transform::Scale(_) => 1.0 + self.unit * x,
            Transform::Shift
            | Transform::Bias(_)
            | Transform::Arm
            | Transform::ReferenceHeight
            | Transform::InertialLag
            | Transform::ReceiverLate
            | Transform::ImuHeight
            | Transform::Form(_)
            | Transform::TyreCurvature
            | Transform::TyreSoftening
            | Transform::TyreLoad => self.unit * x,
        }
    }

    /// Standard deviation in its own unit for one of the coordinate.
    #[must_use]
    pub fn spread(&self, x: f64, deviation: f64) -> f64 {
        match self.turns {
            Transform::RateLimit => self.unit / x.max(0.1).powi(2) * deviation,
            _ => self.unit * deviation,
        }
    }

    /// The parameter's name in a vehicle file or of a plant, for a recalibration.
    #[must_use]
    pub fn parameter(&self) -> String {
        if self.effect.is_some() { format!("effect.{}", self.id) } else { self.id.to_owned() }
    }

    /// Values of the uncertain parameter before and at a coordinate, as the vehicle file or the plant has them.
    #[must_use]
    pub fn adjusted<V: ReplayVehicle>(&self, x: f64, vehicle: &V) -> (f64, f64) {
        match V::TABLE.iter().find(|parameter| parameter.name == self.id) {
            Some(parameter) => {
                let given = parameter.get(vehicle);
                let factor = matches!(self.turns, Transform::Factor);
                (given, if factor { given * self.value(x) } else { given + self.value(x) })
            }
            // The file's length; the effect's own neutral value, 0, only stands for it.
            None if matches!(self.turns, Transform::Relaxation) => (self.unit, self.unit * (1.0 + x)),
            None => (self.value(0.0), self.value(x)),
        }
    }

    /// Symbol of its unit.
    #[must_use]
    pub fn symbol<V: ReplayVehicle>(&self) -> String {
        let parameter = V::TABLE.iter().find(|parameter| parameter.name == self.id).map(|p| p.unit.symbol);
        let of_sensor = match self.turns {
            Transform::Bias(channel) => crate::signal::find(channel.name()).map(|signal| signal.unit.symbol),
            Transform::Arm | Transform::ReferenceHeight | Transform::ImuHeight => Some("m"),
            Transform::InertialLag | Transform::ReceiverLate => Some("s"),
            _ => None,
        };
        self.effect.map(|effect| effect.unit.symbol).or(parameter).or(of_sensor).unwrap_or("1").to_owned()
    }

    /// A standard deviation as the vehicle file or the plant has it.
    #[must_use]
    pub fn deviation<V: ReplayVehicle>(&self, deviation: f64, vehicle: &V) -> f64 {
        let (given, _) = self.adjusted(0.0, vehicle);
        let of_factor = matches!(self.turns, Transform::Factor) && self.effect.is_none();
        let factor = if of_factor { given.abs().max(1e-12) } else { 1.0 };
        self.spread(1.0, deviation) * factor
    }

    /// True if the coordinate is one over the value.
    #[must_use]
    pub fn is_reciprocal(&self) -> bool {
        matches!(self.turns, Transform::RateLimit)
    }

    /// Increase of the value for one of the coordinate, as the vehicle file or the plant has it, or to one over the value.
    #[must_use]
    pub fn step_of_one<V: ReplayVehicle>(&self, vehicle: &V) -> f64 {
        if self.is_reciprocal() { 1.0 / self.unit } else { self.deviation(1.0, vehicle) }
    }
}
