//! A time in a message.

use std::fmt;

/// A time in s, without the rounding errors of a sum of steps: `19.08`, not `19.080000000000002`.
#[derive(Debug, Clone, Copy)]
pub struct Seconds(pub f64);

impl fmt::Display for Seconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rounded = (self.0 * 1e9).round() / 1e9;
        // Of a huge time the product is none.
        let shown = if rounded.is_finite() { rounded } else { self.0 };
        write!(f, "{shown} s")
    }
}

#[cfg(test)]
mod tests {
    use super::Seconds;

    #[test]
    fn a_time_is_shown_without_its_rounding_error() {
        for (time, shown) in [
            (19.080000000000002, "19.08 s"),
            (0.1 + 0.2, "0.3 s"),
            (0.0, "0 s"),
            (-1.5, "-1.5 s"),
            (123456.78, "123456.78 s"),
            (1e300, &format!("{} s", 1e300)),
            (f64::MAX, &format!("{} s", f64::MAX)),
            (f64::NAN, "NaN s"),
            (f64::INFINITY, "inf s"),
        ] {
            assert_eq!(Seconds(time).to_string(), shown);
        }
    }
}
