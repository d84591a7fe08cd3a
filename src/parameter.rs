//! Numeric parameters of a part, declared once: name, unit, default, range, meaning.
//!
//! The [`parameters!`](crate::parameters) macro makes from one table the struct that the code uses, its default,
//! its validation and the list from which FMU variables, `--set NAME=VALUE` and documentation are generated.

use crate::signal::Unit;

/// What is known of a numeric parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct Parameter {
    /// Full name as a user writes it, e.g. `mpc.q_e1`.
    pub name: &'static str,
    pub unit: Unit,
    pub default: f64,
    pub min: f64,
    pub max: f64,
    /// Whole numbers only.
    pub integer: bool,
    pub meaning: &'static str,
}

/// A parameter that is out of its range or not a number.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "{name} = {value} {unit} is outside its range [{min}, {max}]: {meaning}; set a value inside the range"
)]
#[allow(missing_docs)]
pub struct OutOfRange {
    pub name: &'static str,
    pub value: f64,
    pub unit: &'static str,
    pub min: f64,
    pub max: f64,
    pub meaning: &'static str,
}

impl Parameter {
    /// Checks a value.
    ///
    /// # Errors
    /// A value that is not a number, not whole where it must be, or out of range.
    pub fn check(&self, value: f64) -> Result<(), OutOfRange> {
        let whole = !self.integer || value.fract() == 0.0;
        if value >= self.min && value <= self.max && whole {
            return Ok(());
        }
        Err(OutOfRange {
            name: self.name,
            value,
            unit: self.unit.symbol,
            min: self.min,
            max: self.max,
            meaning: self.meaning,
        })
    }
}

/// A group of parameters made by [`parameters!`](crate::parameters): access by position in its table.
pub trait ParameterGroup {
    /// The declarations, in order.
    fn table() -> &'static [Parameter];
    /// The value of the parameter at a position of the table.
    fn get(&self, index: usize) -> f64;
    /// Sets the parameter at a position of the table, unchecked.
    fn set(&mut self, index: usize, value: f64);

    /// Checks all values against their ranges.
    ///
    /// # Errors
    /// The first value out of range.
    fn check(&self) -> Result<(), OutOfRange> {
        Self::table().iter().enumerate().try_for_each(|(index, parameter)| parameter.check(self.get(index)))
    }
}

/// A number that a parameter can be: `f64` or `usize`.
pub trait Number: Copy {
    /// Whether only whole numbers are meant.
    const INTEGER: bool;
    /// From the common representation.
    fn from_f64(value: f64) -> Self;
    /// To the common representation.
    fn to_f64(self) -> f64;
}

impl Number for f64 {
    const INTEGER: bool = false;
    fn from_f64(value: f64) -> Self {
        value
    }
    fn to_f64(self) -> f64 {
        self
    }
}

impl Number for usize {
    const INTEGER: bool = true;
    fn from_f64(value: f64) -> Self {
        value as usize
    }
    fn to_f64(self) -> f64 {
        self as f64
    }
}

/// Declares a struct of numeric parameters; see [`crate::parameter`].
#[macro_export]
macro_rules! parameters {
    ($(#[$attribute:meta])* $visibility:vis struct $group:ident {
        $($field:ident: $type:ty = $default:expr, $unit:ident in $min:expr, $max:expr; $name:literal, $meaning:literal)*
    }) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        $visibility struct $group {
            $(#[doc = $meaning] pub $field: $type,)*
        }

        impl Default for $group {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl $crate::parameter::ParameterGroup for $group {
            fn table() -> &'static [$crate::parameter::Parameter] {
                const TABLE: &[$crate::parameter::Parameter] = &[$($crate::parameter::Parameter {
                    name: $name,
                    unit: $crate::signal::Unit::$unit,
                    default: $default as f64,
                    min: $min,
                    max: $max,
                    integer: <$type as $crate::parameter::Number>::INTEGER,
                    meaning: $meaning,
                },)*];
                TABLE
            }

            fn get(&self, index: usize) -> f64 {
                [$($crate::parameter::Number::to_f64(self.$field)),*][index]
            }

            fn set(&mut self, index: usize, value: f64) {
                let fields: &mut [&mut dyn FnMut(f64)] = &mut [$(&mut |value| self.$field = $crate::parameter::Number::from_f64(value)),*];
                fields[index](value);
            }
        }
    };
}
