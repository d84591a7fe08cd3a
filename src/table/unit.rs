//! Units that a file gives its columns, and their factors to ours.

use std::sync::LazyLock;

/// A unit that files write: its quantity by our unit, the factor to it, and the [plain] spelling.
type Spelling = (&'static str, f64, String);

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
            words.map(move |spelling| (ours, factor, plain(spelling)))
        })
        .collect()
});

/// A unit in small letters, its products and powers in one way of writing: `M s⁻¹`, `m/sec.`, `m per second` are `m/s`.
fn plain(unit: &str) -> String {
    let signs = |sign: char| match sign {
        '⁻' | '−' => Some('-'),
        '¹' => Some('1'),
        '²' => Some('2'),
        '^' | '*' | '·' | '.' => None,
        _ => Some(sign),
    };
    let mut plain: String = unit.to_lowercase().replace(" per ", "/").chars().filter_map(signs).collect();
    plain.retain(|sign| !sign.is_whitespace());
    for word in ["seconds", "second", "sec"] {
        if let Some(at) = plain.find(&format!("/{word}")) {
            plain.replace_range(at + 1..at + 1 + word.len(), "s");
        }
    }
    for (power, divided) in [("s-1", "/s"), ("s-2", "/s2")] {
        if let Some(before) = plain.strip_suffix(power).filter(|before| !before.is_empty()) {
            plain = format!("{before}{divided}");
        }
    }
    plain
}

/// Factor from a file's unit to one of ours, by its symbol (`m/s`); `None` where the file's is unknown or of
/// another quantity.
#[must_use]
pub fn factor(unit: &str, ours: &str) -> Option<f64> {
    if unit == ours {
        return Some(1.0);
    }
    let plain = plain(unit);
    let found = SPELLINGS.iter().find(|(symbol, _, spelling)| *symbol == ours && *spelling == plain);
    found.filter(|_| ours != OTHER).map(|(_, factor, _)| *factor)
}

/// True if a word is a unit of any quantity.
pub(super) fn is_unit(word: &str) -> bool {
    let plain = plain(word);
    SPELLINGS.iter().any(|(.., spelling)| *spelling == plain)
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
        for (i, (ours, factor, spelling)) in SPELLINGS.iter().enumerate() {
            assert!(factor.is_finite() && (*factor > 0.0) == (*ours != OTHER), "{spelling}");
            assert!(SPELLINGS[i + 1..].iter().all(|other| other.2 != *spelling), "{spelling} stands twice");
        }
        let known = |(ours, ..): &Spelling| {
            *ours == OTHER || crate::signal::Unit::ALL.iter().any(|unit| unit.symbol == *ours)
        };
        assert!(SPELLINGS.iter().all(known));
    }

    #[test]
    fn units_of_another_quantity_have_no_factor() {
        assert_eq!(factor("Km/H", "m/s"), Some(1.0 / 3.6));
        for unit in
            ["m/sec.", "m s^-1", "m·s⁻¹", "m / s", "M.s-1", "ms-1", "m per second", "metre/second", "m*s**-1"]
        {
            assert_eq!(factor(unit, "m/s"), Some(1.0), "{unit}");
        }
        let degree = Some(1f64.to_radians());
        for unit in ["°/sec", "deg s^-1", "°s-1", "Grad/s", "degree/second", "degrees per second", "deg·s⁻¹"]
        {
            assert_eq!(factor(unit, "rad/s"), degree, "{unit}");
        }
        assert_eq!((factor("ms", "s"), factor("m s⁻²", "m/s2")), (Some(1e-3), Some(1.0)));
        assert_eq!(factor("deg", "rad"), Some(1f64.to_radians()));
        for (unit, ours) in [("deg", "rad/s"), ("km/h", "m"), ("bar", OTHER), ("", "m"), ("rps", "rad/s")] {
            assert_eq!(factor(unit, ours), None, "{unit}");
        }
        assert!(is_unit("Nm") && is_unit("°/s") && !is_unit("speed"));
    }
}
