//! Units that a file gives its columns, and their factors to ours.

use std::f64::consts::PI;

/// A unit of ours, and what others write for it or for its multiples: spelling, factor.
const UNITS: [(&str, &[(&str, f64)]); 7] = [
    (
        "m",
        &[
            ("m", 1.0),
            ("metre", 1.0),
            ("meter", 1.0),
            ("mm", 1e-3),
            ("cm", 1e-2),
            ("km", 1e3),
            ("ft", 0.3048),
            ("foot", 0.3048),
            ("feet", 0.3048),
        ],
    ),
    (
        "s",
        &[
            ("s", 1.0),
            ("sec", 1.0),
            ("second", 1.0),
            ("seconds", 1.0),
            ("ms", 1e-3),
            ("us", 1e-6),
            ("ns", 1e-9),
        ],
    ),
    (
        "rad",
        &[
            ("rad", 1.0),
            ("radian", 1.0),
            ("radians", 1.0),
            ("mrad", 1e-3),
            ("deg", PI / 180.0),
            ("°", PI / 180.0),
            ("degree", PI / 180.0),
            ("degrees", PI / 180.0),
        ],
    ),
    (
        "m/s",
        &[
            ("m/s", 1.0),
            ("mps", 1.0),
            ("km/h", 1.0 / 3.6),
            ("kmh", 1.0 / 3.6),
            ("kph", 1.0 / 3.6),
            ("mph", 0.447_04),
            ("knots", 1852.0 / 3600.0),
            ("knot", 1852.0 / 3600.0),
            ("kn", 1852.0 / 3600.0),
            ("kt", 1852.0 / 3600.0),
            ("kts", 1852.0 / 3600.0),
            ("ft/s", 0.3048),
            ("fps", 0.3048),
        ],
    ),
    (
        "rad/s",
        &[
            ("rad/s", 1.0),
            ("radps", 1.0),
            ("deg/s", PI / 180.0),
            ("°/s", PI / 180.0),
            ("degps", PI / 180.0),
            ("dps", PI / 180.0),
        ],
    ),
    ("m/s2", &[("m/s2", 1.0), ("m/s^2", 1.0), ("m/s²", 1.0), ("m/s/s", 1.0), ("mps2", 1.0), ("g", 9.806_65)]),
    ("1/m", &[("1/m", 1.0), ("radpm", 1.0), ("rad/m", 1.0), ("1/km", 1e-3)]),
];

/// Factor from a file's unit to one of ours, by its symbol (`m/s`); `None` where the file's is unknown or of
/// another quantity.
#[must_use]
pub fn factor(unit: &str, ours: &str) -> Option<f64> {
    if unit == ours {
        return Some(1.0);
    }
    let lower = unit.to_lowercase();
    let (_, spellings) = UNITS.iter().find(|(symbol, _)| *symbol == ours)?;
    spellings.iter().find(|(spelling, _)| *spelling == lower).map(|&(_, factor)| factor)
}

/// Whether a word is a unit of any quantity.
pub(super) fn factor_of_any(word: &str) -> bool {
    let others =
        ["%", "n", "nm", "kg", "hz", "rpm", "1/min", "v", "a", "bar", "kpa", "c", "°c", "1/s", "1/m2", "l"];
    UNITS.iter().any(|(ours, _)| factor(word, ours).is_some())
        || others.contains(&word.to_lowercase().as_str())
}

/// Name and unit of `name [unit]` or `name (unit)`; else the name as it is.
///
/// ```
/// use rfl_mpc::table::split_unit;
///
/// assert_eq!(split_unit("vx [km/h]"), ("vx", Some("km/h")));
/// assert_eq!(split_unit("vx"), ("vx", None));
/// ```
#[must_use]
pub fn split_unit(name: &str) -> (&str, Option<&str>) {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((before, unit)) = name.strip_suffix(close).and_then(|rest| rest.rsplit_once(open))
            && !before.trim().is_empty()
        {
            return (before.trim(), Some(unit.trim()));
        }
    }
    (name, None)
}
