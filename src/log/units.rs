//! Units of columns from their relations: the fewest foreign units that explain every ratio, or none.
//!
//! ```text
//!     |d(x, y)| / (vx dt)          positions over speed
//!     d(station) / (vx dt)         station over speed
//!     ay / (vx yaw_rate)           acceleration over speed and yaw rate
//!     (yaw_rate - e2_rate) / (vx curvature)
//!     d(curvature) / (curvature_rate vx dt)
//! ```
//!
//! A ratio that no unit explains is left alone: the vehicle's speed sensor may be wrong, which is for a diagnosis to
//! find.

use crate::table;

/// Radians in a degree.
pub(super) const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// A unit: its name and how many of it the SI unit is.
pub(super) type LogUnit = (&'static str, f64);

/// Units that a log may have without stating them, by our unit; ours first.
pub(super) const SPEEDS: (&str, [&str; 5]) = ("m/s", ["m/s", "km/h", "mph", "knots", "ft/s"]);
pub(super) const LENGTHS: (&str, [&str; 5]) = ("m", ["m", "mm", "cm", "ft", "km"]);
pub(super) const ACCELERATIONS: (&str, [&str; 2]) = ("m/s2", ["m/s2", "g"]);
/// The last are those of a file that names another unit than its own, or were converted twice.
const TURNS: [LogUnit; 3] =
    [("rad/s", 1.0), ("deg/s", 1.0 / DEGREE), ("rad/s that were converted from degrees as well", DEGREE)];
const BENDS: (&str, [&str; 2]) = ("1/m", ["1/m", "1/km"]);
/// Changes of curvature along the way; of those in 1/km only the curvature is.
const WINDINGS: [LogUnit; 2] = [("1/m2", 1.0), ("1/km per m", 1000.0)];
pub(super) const ANGLES: (&str, [&str; 2]) = ("rad", ["rad", "degrees"]);

/// The units of a list with their sizes.
pub(super) fn sized<const N: usize>((ours, names): (&str, [&'static str; N])) -> [LogUnit; N] {
    // A test finds each of them.
    names.map(|name| (name, table::factor(name, ours).map_or(f64::NAN, f64::recip)))
}

/// An error of a ratio beyond which a unit does not explain it, as a logarithm.
const FAR: f64 = 0.14;
/// Largest change of a ratio in SI units by effects, a roll angle or a bank, as a logarithm.
const EFFECT: f64 = 0.36;
/// Gravity in the accelerometer of a leaning body: the range of its ratio, in SI units.
const LEANING: (f64, f64) = (0.98, 1.12);
/// Usual error of a ratio, as a logarithm, and of ay above its range: bodies lean, and roads have banks.
const USUAL: f64 = 0.03;
const USUAL_LEANING: f64 = 0.08;
/// Difference of two explanations below which both are possible, in usual errors.
const APART: f64 = 0.4;

/// Ratios of columns that a log allows.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Shown {
    /// Of x, y over speed.
    pub way: Option<f64>,
    /// Of station over speed.
    pub station: Option<f64>,
    /// Of ay over speed times yaw rate.
    pub lateral: Option<f64>,
    /// Of the path's yaw rate over speed times curvature.
    pub bend: Option<f64>,
    /// Of the curvature's change over speed times curvature_rate.
    pub winding: Option<f64>,
}

/// Units of the columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Units {
    pub speed: LogUnit,
    pub position: LogUnit,
    pub station: LogUnit,
    pub acceleration: LogUnit,
    pub turn: LogUnit,
    pub curvature: LogUnit,
    pub curvature_rate: LogUnit,
}

/// Conclusion from the ratios about the units.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum UnitConclusion {
    /// SI units, or ratios that no unit explains.
    Si,
    /// These are they.
    Units(Units),
    /// One or the other.
    Either(Units, Units),
}

impl Units {
    const SI: Self = Self {
        speed: ("m/s", 1.0),
        position: ("m", 1.0),
        station: ("m", 1.0),
        acceleration: ("m/s2", 1.0),
        turn: ("rad/s", 1.0),
        curvature: ("1/m", 1.0),
        curvature_rate: WINDINGS[0],
    };

    fn foreign(&self) -> usize {
        let Self { speed, position, station, acceleration, turn, curvature, curvature_rate } = self;
        let all = [speed, position, station, acceleration, turn, curvature, curvature_rate];
        all.iter().filter(|unit| unit.1 != 1.0).count()
    }

    /// Errors of the ratios, as logarithms; that of ay comes last, above its range positive.
    fn errors(&self, shown: &Shown) -> [f64; 5] {
        let speed = self.speed.1;
        let off = |shown: Option<f64>, expected: f64| {
            // A turned sign is looked for elsewhere.
            shown.map_or(0.0, |shown| (shown.abs() / expected).ln())
        };
        [
            off(shown.way, self.position.1 / speed),
            off(shown.station, self.station.1 / speed),
            off(shown.bend, self.turn.1 / (speed * self.curvature.1)),
            off(shown.winding, self.curvature.1 / (speed * self.curvature_rate.1)),
            shown.lateral.map_or(0.0, |shown| {
                let ratio = shown.abs() * speed * self.turn.1 / self.acceleration.1;
                (ratio / ratio.clamp(LEANING.0, LEANING.1)).ln()
            }),
        ]
    }

    /// Largest error of a ratio, as a logarithm.
    fn error(&self, shown: &Shown) -> f64 {
        self.errors(shown).into_iter().fold(0.0, |most, error| most.max(error.abs()))
    }

    /// Root of the squares of all errors, in usual ones.
    fn misfit(&self, shown: &Shown) -> f64 {
        let [way @ .., lateral] = self.errors(shown);
        let leaning = lateral / if lateral > 0.0 { USUAL_LEANING } else { USUAL };
        way.iter().fold(leaning.abs(), |sum, error| sum.hypot(error / USUAL))
    }

    /// The foreign ones, in words.
    pub fn words(&self) -> String {
        [
            ("vx", self.speed),
            ("x, y", self.position),
            ("station", self.station),
            ("ay", self.acceleration),
            ("yaw_rate", self.turn),
            ("curvature", self.curvature),
            ("curvature_rate", self.curvature_rate),
        ]
        .into_iter()
        .filter(|(_, unit)| unit.1 != 1.0)
        .map(|(name, unit)| format!("{name} in {}", unit.0))
        .collect::<Vec<_>>()
        .join(" and ")
    }
}

/// The units that explain the ratios.
pub(super) fn told(shown: &Shown) -> UnitConclusion {
    if Units::SI.error(shown) < EFFECT {
        return UnitConclusion::Si;
    }
    let (lengths, bends) = (sized(LENGTHS), sized(BENDS));
    let (speeds, accelerations) = (sized(SPEEDS), sized(ACCELERATIONS));
    let mut all = Vec::new();
    // A column that nothing is known of is in SI units.
    fn known(units: &[LogUnit], shown: bool) -> &[LogUnit] {
        if shown { units } else { &units[..1] }
    }
    for &speed in &speeds {
        for &position in known(&lengths, shown.way.is_some()) {
            for &station in known(&lengths, shown.station.is_some()) {
                for &acceleration in known(&accelerations, shown.lateral.is_some()) {
                    for &turn in known(&TURNS, shown.lateral.is_some()) {
                        for &curvature in known(&bends, shown.bend.is_some()) {
                            for &curvature_rate in known(&WINDINGS, shown.winding.is_some()) {
                                let units = Units {
                                    speed,
                                    position,
                                    station,
                                    acceleration,
                                    turn,
                                    curvature,
                                    curvature_rate,
                                };
                                if units.error(shown) < FAR {
                                    all.push((units.foreign(), units.misfit(shown), units));
                                }
                            }
                        }
                    }
                }
            }
        }
    }
    // One ratio cannot tell two units.
    let Shown { way, station, lateral, bend, winding } = shown;
    let ratios = [way, station, lateral, bend, winding].iter().filter(|ratio| ratio.is_some()).count();
    all.retain(|(foreign, ..)| *foreign <= ratios);
    all.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    // By ay alone feet a second are km/h of a body that leans, and km/h are the common ones.
    let common = |units: &Units| units.speed.0 == "km/h" && shown.way.is_none() && shown.station.is_none();
    match all[..] {
        [] => UnitConclusion::Si,
        [(_, misfit, units), ..] if misfit == 0.0 && common(&units) => UnitConclusion::Units(units),
        [(foreign, misfit, units), (others, next, other), ..]
            if foreign == others && next - misfit < APART =>
        {
            UnitConclusion::Either(units, other)
        }
        [(_, _, units), ..] => UnitConclusion::Units(units),
    }
}

/// The unit of a list that is nearest to a ratio; `None` where it is SI, or none.
pub(super) fn foreign(ratio: f64, units: &[LogUnit]) -> Option<LogUnit> {
    let off = |unit: &LogUnit| (ratio.abs() / unit.1).ln().abs();
    let nearest = units.iter().copied().min_by(|a, b| off(a).total_cmp(&off(b)))?;
    (nearest.1 != 1.0 && off(&nearest) < FAR).then_some(nearest)
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = 9.80665;

    #[test]
    fn each_unit_is_in_the_table() {
        let all = [&sized(SPEEDS)[..], &sized(LENGTHS), &sized(ACCELERATIONS), &TURNS, &sized(BENDS)];
        assert!(all.iter().all(|units| units[0].1 == 1.0 && units.iter().all(|unit| unit.1.is_finite())));
    }

    fn words(shown: Shown) -> String {
        match told(&shown) {
            UnitConclusion::Si => "si".into(),
            UnitConclusion::Units(units) => units.words(),
            UnitConclusion::Either(one, other) => format!("{} or {}", one.words(), other.words()),
        }
    }

    #[test]
    fn one_ratio_tells_one_unit() {
        for &(name, factor) in &sized(SPEEDS)[1..] {
            let expected = format!("vx in {name}");
            for effect in [1.06, 1.107] {
                assert_eq!(words(Shown { lateral: Some(effect / factor), ..Shown::default() }), expected);
            }
            for effect in [0.97, 1.0, 1.03] {
                assert_eq!(words(Shown { way: Some(effect / factor), ..Shown::default() }), expected);
            }
        }
        for &(name, factor) in &sized(LENGTHS)[1..] {
            let shown = Shown { way: Some(factor), lateral: Some(1.0), ..Shown::default() };
            assert_eq!(words(shown), format!("x, y in {name}"));
        }
        assert_eq!(words(Shown { lateral: Some(0.1), ..Shown::default() }), "ay in g");
        assert_eq!(words(Shown { lateral: Some(DEGREE), ..Shown::default() }), "yaw_rate in deg/s");
        let small = words(Shown { lateral: Some(1.07 / DEGREE), ..Shown::default() });
        assert_eq!(small, "yaw_rate in rad/s that were converted from degrees as well");
    }

    #[test]
    fn several_ratios_tell_several_units() {
        let shown = Shown { way: Some(1.0 / 3.6), lateral: Some(1.0 / (3.6 * G)), ..Shown::default() };
        assert_eq!(words(shown), "vx in km/h and ay in g");
        let shown = Shown { way: Some(1000.0 / 2.237), lateral: Some(1.0 / 2.237), ..Shown::default() };
        assert_eq!(words(shown), "vx in mph and x, y in mm");
        // Of a car that leans far, the way tells.
        for &(name, factor) in &sized(SPEEDS)[1..] {
            for lean in [1.0, 1.15, 1.26] {
                let shown =
                    Shown { way: Some(1.0 / factor), lateral: Some(lean / factor), ..Shown::default() };
                assert_eq!(words(shown), format!("vx in {name}"));
            }
        }
    }

    #[test]
    fn effects_and_riddles_are_no_units() {
        for factor in [0.75, 0.9, 1.2, 1.4, 0.62, 1.9] {
            assert_eq!(words(Shown { way: Some(factor), ..Shown::default() }), "si", "{factor}");
        }
        // Between km/h and ft/s, and speed against ay.
        let between = Shown { way: Some(1.0 / 3.43), ..Shown::default() };
        assert!(words(between).contains(" or "), "{}", words(between));
        assert_eq!(words(Shown { way: Some(0.5), lateral: Some(1.0), ..Shown::default() }), "si");
    }
}
