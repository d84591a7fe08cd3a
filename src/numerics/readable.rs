//! Numbers in messages: 1e308 written out has 309 digits, and nobody counts them.

use std::fmt::{Display, Formatter, Result};

/// A number for people: with an exponent where all of its digits would be no help.
pub(crate) struct Readable(pub f64);

impl Display for Readable {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let Self(value) = self;
        let size = value.abs();
        if size >= 1e9 || size > 0.0 && size < 1e-9 { write!(f, "{value:e}") } else { write!(f, "{value}") }
    }
}

#[cfg(test)]
mod tests {
    use super::Readable;

    #[test]
    fn only_long_numbers_have_an_exponent() {
        for (value, text) in [
            (0.0, "0"),
            (-12.5, "-12.5"),
            (1e6, "1000000"),
            (1e308, "1e308"),
            (-2e-12, "-2e-12"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(Readable(value).to_string(), text);
        }
        assert_eq!(Readable(f64::INFINITY).to_string(), "inf");
    }
}
