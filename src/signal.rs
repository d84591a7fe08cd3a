//! The vocabulary: every signal for users, declared once.
//!
//! One word names a signal everywhere, with the same unit and the same sign. It is an FMU's variable, a log's column, a
//! parameter file's key and a report's label. FMU descriptions, log headers and report labels are generated from the
//! tables here, so that they cannot drift apart.
//!
//! Conventions: SI units and radians; ISO 8855 axes (x forward, y left, z up). Steering and yaw are positive to the
//! left; `steer` is the road-wheel angle.

/// Acceleration of free fall in all models, m/s2.
pub const GRAVITY: f64 = 9.81;

/// A unit of measurement with its exponents of SI base units, as FMI 2.0 requires.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// The unit's symbol, e.g. `m/s2`.
    pub symbol: &'static str,
    /// Exponents of `kg`, `m`, `s` and `rad`; all zero for a pure number.
    pub base: BaseExponents,
    /// Factor to SI base units (1 for all units used here, kept for completeness of the FMI unit definition).
    pub factor: f64,
    /// Unit that people read on a plot: symbol and `display = factor * value`.
    pub display: Option<DisplayUnit>,
}

/// Exponents of the SI base units that vehicle dynamics needs (FMI 2.0, element `BaseUnit`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[allow(missing_docs)]
pub struct BaseExponents {
    pub kg: i32,
    pub m: i32,
    pub s: i32,
    pub rad: i32,
}

/// A display unit: `value_in_display_unit = factor * value_in_unit`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct DisplayUnit {
    pub symbol: &'static str,
    pub factor: f64,
}

/// Degrees in one radian.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

macro_rules! units {
    ($($(#[$doc:meta])* $name:ident = $symbol:literal [kg $kg:literal m $m:literal s $s:literal rad $rad:literal] $(display $ds:literal $df:expr)?;)*) => {
        impl Unit {
            $($(#[$doc])* pub const $name: Unit = Unit {
                symbol: $symbol,
                base: BaseExponents { kg: $kg, m: $m, s: $s, rad: $rad },
                factor: 1.0,
                display: units!(@display $($ds $df)?),
            };)*
            /// All units in use, in the order in which a description lists them.
            pub const ALL: &'static [Unit] = &[$(Unit::$name),*];
        }
    };
    (@display) => { None };
    (@display $ds:literal $df:expr) => { Some(DisplayUnit { symbol: $ds, factor: $df }) };
}

units! {
    /// A pure number: factors, ratios, slips.
    ONE = "1" [kg 0 m 0 s 0 rad 0];
    /// Length.
    METRE = "m" [kg 0 m 1 s 0 rad 0];
    /// Curvature of a path, and its like.
    PER_METRE = "1/m" [kg 0 m -1 s 0 rad 0];
    /// Change of a curvature along a path.
    PER_METRE2 = "1/m2" [kg 0 m -2 s 0 rad 0];
    /// Time.
    SECOND = "s" [kg 0 m 0 s 1 rad 0] display "ms" 1e3;
    /// Speed.
    METRE_PER_SECOND = "m/s" [kg 0 m 1 s -1 rad 0] display "km/h" 3.6;
    /// Acceleration and specific force.
    METRE_PER_SECOND2 = "m/s2" [kg 0 m 1 s -2 rad 0];
    /// Rate of an acceleration.
    METRE_PER_SECOND3 = "m/s3" [kg 0 m 1 s -3 rad 0];
    /// Angle.
    RADIAN = "rad" [kg 0 m 0 s 0 rad 1] display "deg" DEGREES;
    /// Angular velocity.
    RADIAN_PER_SECOND = "rad/s" [kg 0 m 0 s -1 rad 1] display "deg/s" DEGREES;
    /// Mass.
    KILOGRAM = "kg" [kg 1 m 0 s 0 rad 0];
    /// Moment of inertia.
    KILOGRAM_METRE2 = "kg.m2" [kg 1 m 2 s 0 rad 0];
    /// Force.
    NEWTON = "N" [kg 1 m 1 s -2 rad 0];
    /// Moment and torque.
    NEWTON_METRE = "N.m" [kg 1 m 2 s -2 rad 0];
    /// Linear stiffness.
    NEWTON_PER_METRE = "N/m" [kg 1 m 0 s -2 rad 0];
    /// Cornering stiffness.
    NEWTON_PER_RADIAN = "N/rad" [kg 1 m 1 s -2 rad -1];
    /// Roll stiffness.
    NEWTON_METRE_PER_RADIAN = "N.m/rad" [kg 1 m 2 s -2 rad -1];
    /// Roll damping.
    NEWTON_METRE_SECOND_PER_RADIAN = "N.m.s/rad" [kg 1 m 2 s -1 rad -1];
    /// Power.
    WATT = "W" [kg 1 m 2 s -3 rad 0] display "kW" 1e-3;
    /// Area.
    METRE2 = "m2" [kg 0 m 2 s 0 rad 0];
    /// Linear damping.
    NEWTON_SECOND_PER_METRE = "N.s/m" [kg 1 m 0 s -1 rad 0];
    /// Change of an angle with a displacement.
    RADIAN_PER_METRE = "rad/m" [kg 0 m -1 s 0 rad 1];
    /// Compliance.
    METRE_PER_NEWTON = "m/N" [kg -1 m 0 s 2 rad 0];
    /// Density of air.
    KILOGRAM_PER_METRE3 = "kg/m3" [kg 1 m -3 s 0 rad 0];
}

/// A quantity that crosses a border: an FMU variable, a log column, a label of a plot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Signal {
    /// The one name of the signal.
    pub name: &'static str,
    /// Its unit.
    pub unit: Unit,
    /// Kind of quantity, in the words of ISO 80000 (FMI attribute `quantity`).
    pub quantity: &'static str,
    /// Meaning, in one sentence.
    pub meaning: &'static str,
    /// A typical magnitude, for scaling.
    pub nominal: f64,
    /// The range outside which a value is certainly wrong (not a limit of the vehicle).
    pub range: (f64, f64),
}

macro_rules! signals {
    ($($const:ident = $name:literal $unit:ident $quantity:literal nominal $nominal:literal in $min:expr, $max:expr; $meaning:literal)*) => {
        $(#[doc = $meaning] pub const $const: Signal = Signal {
            name: $name, unit: Unit::$unit, quantity: $quantity, meaning: $meaning,
            nominal: $nominal, range: ($min, $max),
        };)*
        /// Every signal, in the order of a drive log's columns.
        pub const ALL: &[Signal] = &[$($const),*];
    };
}

signals! {
    TIME = "time" SECOND "Time" nominal 1.0 in 0.0, 1e9; "Time since the start of the log; strictly increasing"
    STEER_CMD = "steer_cmd" RADIAN "Angle" nominal 0.1 in -1.2, 1.2; "Road-wheel angle asked of the steering actuator"
    ACCEL_CMD = "accel_cmd" METRE_PER_SECOND2 "Acceleration" nominal 1.0 in -15.0, 15.0; "Longitudinal acceleration asked of drive and brakes"
    X = "x" METRE "Length" nominal 100.0 in -1e7, 1e7; "East position of the CG (truck: of the tractor's CG)"
    Y = "y" METRE "Length" nominal 100.0 in -1e7, 1e7; "North position of the CG (truck: of the tractor's CG)"
    YAW = "yaw" RADIAN "Angle" nominal 1.0 in -1e4, 1e4; "Yaw angle of the body, continuous (not wrapped)"
    VX = "vx" METRE_PER_SECOND "Velocity" nominal 10.0 in -100.0, 100.0; "Longitudinal velocity of the CG in body axes"
    VY = "vy" METRE_PER_SECOND "Velocity" nominal 0.1 in -50.0, 50.0; "Lateral velocity of the CG in body axes"
    YAW_RATE = "yaw_rate" RADIAN_PER_SECOND "AngularVelocity" nominal 0.1 in -10.0, 10.0; "Yaw rate of the body"
    AX = "ax" METRE_PER_SECOND2 "Acceleration" nominal 1.0 in -100.0, 100.0; "Longitudinal specific force at the CG, as an accelerometer in body axes reads it"
    AY = "ay" METRE_PER_SECOND2 "Acceleration" nominal 1.0 in -100.0, 100.0; "Lateral specific force at the CG, as an accelerometer in body axes reads it"
    STEER = "steer" RADIAN "Angle" nominal 0.1 in -1.2, 1.2; "Road-wheel angle as measured"
    ROLL = "roll" RADIAN "Angle" nominal 0.05 in -3.2, 3.2; "Roll angle of the body against the road, positive with the right side down"
    PITCH = "pitch" RADIAN "Angle" nominal 0.05 in -3.2, 3.2; "Pitch angle of the body against the road, positive with the nose down"
    ARTICULATION = "articulation" RADIAN "Angle" nominal 0.1 in -3.2, 3.2; "Tractor yaw minus trailer yaw"
    ARTICULATION_RATE = "articulation_rate" RADIAN_PER_SECOND "AngularVelocity" nominal 0.1 in -10.0, 10.0; "Rate of the articulation angle"
    E1 = "e1" METRE "Length" nominal 0.1 in -1e5, 1e5; "Lateral error of the CG to the path, positive to the left of it"
    E1_RATE = "e1_rate" METRE_PER_SECOND "Velocity" nominal 0.1 in -100.0, 100.0; "Rate of the lateral error"
    E2 = "e2" RADIAN "Angle" nominal 0.1 in -3.2, 3.2; "Yaw error: yaw minus the path's heading"
    E2_RATE = "e2_rate" RADIAN_PER_SECOND "AngularVelocity" nominal 0.1 in -20.0, 20.0; "Rate of the yaw error"
    STATION = "station" METRE "Length" nominal 100.0 in -1e7, 1e7; "Arc length along the path of the point nearest to the CG"
    CURVATURE = "curvature" PER_METRE "Curvature" nominal 0.01 in -10.0, 10.0; "Curvature of the path at the station, positive in left turns"
    CURVATURE_RATE = "curvature_rate" PER_METRE2 "CurvatureRate" nominal 0.001 in -10.0, 10.0; "Change of the curvature along the path at the station"
    BANK = "bank" RADIAN "Angle" nominal 0.02 in -0.8, 0.8; "Bank of the road at the station, right side low positive"
    GRADE = "grade" RADIAN "Angle" nominal 0.02 in -0.8, 0.8; "Grade of the road at the station, uphill positive"
    FRICTION = "friction" ONE "FrictionFactor" nominal 1.0 in 0.01, 3.0; "Factor on the friction between tyres and road at the station"
}

/// Looks a signal up by name.
///
/// ```
/// assert_eq!(rfl_mpc::signal::find("yaw_rate").unwrap().unit.symbol, "rad/s");
/// ```
#[must_use]
pub fn find(name: &str) -> Option<&'static Signal> {
    ALL.iter().find(|signal| signal.name == name)
}

/// A column's name as names of signals are written: `Yaw Rate`, `YAW-RATE`.
pub(crate) fn as_written(name: &str) -> String {
    name.trim().to_ascii_lowercase().replace([' ', '-', '.'], "_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique() {
        for (i, signal) in ALL.iter().enumerate() {
            assert!(
                ALL[i + 1..].iter().all(|other| other.name != signal.name),
                "{} stands twice",
                signal.name
            );
        }
    }

    #[test]
    fn unit_symbols_are_unique() {
        for (i, unit) in Unit::ALL.iter().enumerate() {
            assert!(
                Unit::ALL[i + 1..].iter().all(|other| other.symbol != unit.symbol),
                "{} twice",
                unit.symbol
            );
        }
    }
}
