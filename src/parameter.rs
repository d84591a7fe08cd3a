//! Numeric parameters of a part, declared once: name, unit, default, range, meaning.
//!
//! The [`parameters!`](crate::parameters) macro makes four things from one table: the struct for the code, its default,
//! its validation, and a list. From the list FMU variables, `--set NAME=VALUE` and documentation are generated.

use crate::numerics::Readable;
use crate::signal::Unit;

/// Description of a numeric parameter.
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
    /// The named values of an enumeration; `integer` is then true, too.
    pub choices: Option<Choices>,
    pub meaning: &'static str,
}

/// The values of a parameter that is one of a few named ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choices {
    /// Name of their type.
    pub type_name: &'static str,
    /// Number, name and meaning of each.
    pub items: &'static [(i32, &'static str, &'static str)],
}

/// A word that is no value of a parameter.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum NoValue {
    #[error("'{text}' is not a number")]
    NotANumber { text: String },
    #[error("'{text}' is no value of {name}: write {}", choices.words())]
    NoSuchName { text: String, name: &'static str, choices: Choices },
}

impl Choices {
    /// The names, as a sentence lists them.
    fn words(&self) -> String {
        let names: Vec<&str> = self.items.iter().map(|item| item.1).collect();
        match names.split_last() {
            Some((last, [])) => (*last).to_owned(),
            Some((last, others)) => format!("{} or {last}", others.join(", ")),
            None => String::new(),
        }
    }
}

/// A parameter that is out of its range or not a number.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name} = {}{} is {}: {meaning}; set {}", Readable(*value), self.unit_words(), self.fault(), self.remedy())]
#[allow(missing_docs)]
pub struct OutOfRange {
    pub name: &'static str,
    pub value: f64,
    pub unit: &'static str,
    pub min: f64,
    pub max: f64,
    pub meaning: &'static str,
}

impl OutOfRange {
    fn is_inside(&self) -> bool {
        self.value >= self.min && self.value <= self.max
    }

    /// The unit behind a blank; nothing for a pure number.
    fn unit_words(&self) -> String {
        if self.unit == "1" { String::new() } else { format!(" {}", self.unit) }
    }

    fn fault(&self) -> String {
        if self.is_inside() {
            "no whole number".to_owned()
        } else {
            format!("outside its range [{}, {}]", self.min, self.max)
        }
    }

    fn remedy(&self) -> &'static str {
        if self.is_inside() { "a whole number" } else { "a value inside the range" }
    }
}

impl Parameter {
    /// The value that a user wrote: a number or, where values have names, a name.
    ///
    /// # Errors
    /// A word that is neither.
    pub fn read(&self, text: &str) -> Result<f64, NoValue> {
        let text = text.trim();
        let of_name = |choices: &Choices| {
            choices.items.iter().find(|item| item.1 == text).map(|item| f64::from(item.0))
        };
        let value = text.parse().ok().or_else(|| self.choices.as_ref().and_then(of_name));
        value.ok_or_else(|| match self.choices {
            Some(choices) => NoValue::NoSuchName { text: text.to_owned(), name: self.name, choices },
            None => NoValue::NotANumber { text: text.to_owned() },
        })
    }

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

/// Type of a parameter: `f64`, `usize` or an enumeration by [`enumeration!`](crate::enumeration!).
pub trait Number: Copy {
    /// True if only whole numbers are meant.
    const INTEGER: bool;
    /// The named values of an enumeration.
    const CHOICES: Option<Choices> = None;
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

/// Declares a struct of numeric parameters; see [`crate::parameter`]. An enumeration's default and range are numbers.
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
                Self { $($field: $crate::parameter::Number::from_f64($default as f64),)* }
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
                    choices: <$type as $crate::parameter::Number>::CHOICES,
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

#[cfg(test)]
mod tests {
    use super::*;

    crate::enumeration! {
        enum Colour {
            Red = 0 "red", "Like blood";
            Blue = 1 "blue", "Like the sky";
            Green = 2 "green", "Like grass";
        }
    }

    parameters! {
        struct Paint {
            colour: Colour = 2, ONE in 0.0, 2.0; "paint.colour", "Colour of the paint"
            layers: usize = 3, ONE in 1.0, 9.0; "paint.layers", "Layers of the paint"
            density: f64 = 1.5, ONE in 0.5, 2.0; "paint.density", "Density of the paint"
        }
    }

    #[test]
    fn an_enumeration_is_a_parameter_by_number_and_by_name() {
        let mut paint = Paint::default();
        assert_eq!((paint.colour, paint.layers, paint.density), (Colour::Green, 3, 1.5));
        let colour = Paint::table()[0];
        assert_eq!(
            (Colour::ALL.len(), Colour::Red.name(), Colour::Blue.meaning()),
            (3, "red", "Like the sky")
        );
        assert!(colour.integer && colour.default == 2.0);
        for (text, number) in [("red", 0.0), (" blue ", 1.0), ("2", 2.0)] {
            assert_eq!(colour.read(text), Ok(number));
        }
        paint.set(0, colour.read("blue").unwrap());
        assert_eq!((paint.colour, paint.get(0)), (Colour::Blue, 1.0));
        assert!(colour.check(0.5).is_err() && colour.check(3.0).is_err());
        let error = colour.read("pink").unwrap_err().to_string();
        assert_eq!(error, "'pink' is no value of paint.colour: write red, blue or green");
        let error = Paint::table()[2].read("thick").unwrap_err().to_string();
        assert_eq!(error, "'thick' is not a number");
    }
}
