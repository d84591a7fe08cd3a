//! Units that a file gives its columns, and their factors to ours.

use std::sync::LazyLock;

/// A unit that files write: its quantity by our unit, the factor to it, and the spelling in small letters.
type Spelling = (&'static str, f64, &'static str);

/// Quantities that neither a drive nor a road has.
const OTHER: &str = "other";

/// Contents of `units.txt`; `scripts/importing/units.py` reads the same file.
static SPELLINGS: LazyLock<Vec<Spelling>> = LazyLock::new(|| {
    let lines = include_str!("units.txt").lines().filter(|line| !line.starts_with('#'));
    lines
        .flat_map(|line| {
            let mut words = line.split_whitespace();
            let ours = words.next().unwrap_or(OTHER);
            let factor = words.next().and_then(|factor| factor.parse().ok()).unwrap_or(f64::NAN);
            words.map(move |spelling| (ours, factor, spelling))
        })
        .collect()
});

/// Factor from a file's unit to one of ours, by its symbol (`m/s`); `None` where the file's is unknown or of
/// another quantity.
#[must_use]
pub fn factor(unit: &str, ours: &str) -> Option<f64> {
    if unit == ours {
        return Some(1.0);
    }
    let lower = unit.to_lowercase();
    let found = SPELLINGS.iter().find(|(symbol, _, spelling)| *symbol == ours && *spelling == lower);
    found.filter(|_| ours != OTHER).map(|&(_, factor, _)| factor)
}

/// True if a word is a unit of any quantity.
pub(super) fn is_unit(word: &str) -> bool {
    let lower = word.to_lowercase();
    SPELLINGS.iter().any(|(.., spelling)| *spelling == lower)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_spelling_of_the_list_is_one_unit() {
        for (i, &(ours, factor, spelling)) in SPELLINGS.iter().enumerate() {
            assert!(factor.is_finite() && (factor > 0.0) == (ours != OTHER), "{spelling}");
            assert_eq!(spelling, spelling.to_lowercase());
            assert!(SPELLINGS[i + 1..].iter().all(|other| other.2 != spelling), "{spelling} stands twice");
        }
        let known = |(ours, ..): &Spelling| {
            *ours == OTHER || crate::signal::Unit::ALL.iter().any(|unit| unit.symbol == *ours)
        };
        assert!(SPELLINGS.iter().all(known));
    }

    #[test]
    fn units_of_another_quantity_have_no_factor() {
        assert_eq!(factor("Km/H", "m/s"), Some(1.0 / 3.6));
        assert_eq!(factor("deg", "rad"), Some(1f64.to_radians()));
        for (unit, ours) in [("deg", "rad/s"), ("km/h", "m"), ("bar", OTHER), ("", "m"), ("rps", "rad/s")] {
            assert_eq!(factor(unit, ours), None, "{unit}");
        }
        assert!(is_unit("Nm") && is_unit("°/s") && !is_unit("speed"));
    }
}
