//! Saved states come from disks and networks: their checksum may be right and their numbers not finite.
//!
//! One infinity in a covariance makes a non-finite command some steps later, far from its cause. So the numbers of a
//! saved state are checked before its use: each must be one that a drive can have. The state is written once more, to a
//! serializer that keeps nothing and looks at the floating-point numbers that pass.

use serde::ser::{self, Serialize};
use std::fmt::{self, Display};

/// Largest magnitude of a number in a state: the square of a way around the earth in metres, with room for sums. Products of ten such
/// numbers stay in the range of `f64`; of 1e29 in a saved covariance, one of a million damaged states drove to a NaN.
const LARGEST: f64 = 1e20;

/// A number that no drive can have.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NotFinite {
    /// Name of the field that it stands in.
    field: &'static str,
    value: f64,
}

impl Display for NotFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.field, self.value)
    }
}

impl std::error::Error for NotFinite {}

impl ser::Error for NotFinite {
    /// Never called: no type here refuses to be written.
    fn custom<T: Display>(_: T) -> Self {
        Self { field: "unknown", value: f64::NAN }
    }
}

/// Checks every floating-point number in `state`.
///
/// # Errors
/// The first that is not finite, or too large.
pub(crate) fn check_finite<T: Serialize + ?Sized>(state: &T) -> Result<(), NotFinite> {
    state.serialize(Look { field: "state" })
}

/// Checks numbers on their way; `field` is the name of the innermost field.
#[derive(Clone, Copy)]
struct Look {
    field: &'static str,
}

/// Types without floating-point numbers pass.
macro_rules! passes {
    ($($method:ident: $type:ty),*) => {
        $(fn $method(self, _: $type) -> Result<(), NotFinite> { Ok(()) })*
    };
}

/// Compound types are checked part by part.
macro_rules! opens {
    ($($method:ident($($of:ty),*)),*) => {
        $(fn $method(self, $(_: $of),*) -> Result<Self, NotFinite> { Ok(self) })*
    };
}

impl ser::Serializer for Look {
    type Ok = ();
    type Error = NotFinite;
    type SerializeSeq = Self;
    type SerializeTuple = Self;
    type SerializeTupleStruct = Self;
    type SerializeTupleVariant = Self;
    type SerializeMap = Self;
    type SerializeStruct = Self;
    type SerializeStructVariant = Self;

    passes! {
        serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64, serialize_char: char,
        serialize_str: &str, serialize_bytes: &[u8], serialize_unit_struct: &'static str
    }

    fn serialize_f32(self, value: f32) -> Result<(), NotFinite> {
        self.serialize_f64(f64::from(value))
    }

    fn serialize_f64(self, value: f64) -> Result<(), NotFinite> {
        if value.abs() <= LARGEST { Ok(()) } else { Err(NotFinite { field: self.field, value }) }
    }

    fn serialize_none(self) -> Result<(), NotFinite> {
        Ok(())
    }

    fn serialize_unit(self) -> Result<(), NotFinite> {
        Ok(())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), NotFinite> {
        value.serialize(self)
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, _: &'static str) -> Result<(), NotFinite> {
        Ok(())
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<(), NotFinite> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        value: &T,
    ) -> Result<(), NotFinite> {
        value.serialize(self)
    }

    opens! {
        serialize_seq(Option<usize>), serialize_tuple(usize), serialize_tuple_struct(&'static str, usize),
        serialize_tuple_variant(&'static str, u32, &'static str, usize), serialize_map(Option<usize>),
        serialize_struct(&'static str, usize), serialize_struct_variant(&'static str, u32, &'static str, usize)
    }
}

/// The elements of a type without names inside.
macro_rules! elements {
    ($($of:ident: $method:ident),*) => {
        $(impl ser::$of for Look {
            type Ok = ();
            type Error = NotFinite;

            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), NotFinite> {
                value.serialize(*self)
            }

            fn end(self) -> Result<(), NotFinite> {
                Ok(())
            }
        })*
    };
}

elements!(
    SerializeSeq: serialize_element,
    SerializeTuple: serialize_element,
    SerializeTupleStruct: serialize_field,
    SerializeTupleVariant: serialize_field
);

/// The fields of what has names.
macro_rules! fields {
    ($($of:ident),*) => {
        $(impl ser::$of for Look {
            type Ok = ();
            type Error = NotFinite;

            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                field: &'static str,
                value: &T,
            ) -> Result<(), NotFinite> {
                value.serialize(Look { field })
            }

            fn end(self) -> Result<(), NotFinite> {
                Ok(())
            }
        })*
    };
}

fields!(SerializeStruct, SerializeStructVariant);

impl ser::SerializeMap for Look {
    type Ok = ();
    type Error = NotFinite;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), NotFinite> {
        key.serialize(*self)
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), NotFinite> {
        value.serialize(*self)
    }

    fn end(self) -> Result<(), NotFinite> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;
    use serde::Serialize;

    #[derive(Serialize, Clone)]
    struct Inner {
        matrix: Matrix2<f64>,
        maybe: Option<f64>,
        pairs: Vec<(f64, bool)>,
    }

    #[derive(Serialize, Clone)]
    struct Outer {
        count: u64,
        inner: [Inner; 2],
    }

    #[test]
    fn the_field_of_a_number_that_is_none_is_named_wherever_it_stands() {
        let inner = Inner { matrix: Matrix2::identity(), maybe: Some(1.0), pairs: vec![(0.5, true)] };
        let sound = Outer { count: 3, inner: [inner.clone(), inner] };
        assert_eq!(check_finite(&sound), Ok(()));
        let said = |change: &dyn Fn(&mut Inner)| {
            let mut state = sound.clone();
            change(&mut state.inner[1]);
            check_finite(&state).unwrap_err().to_string()
        };
        assert_eq!(said(&|inner| inner.matrix[(1, 0)] = f64::INFINITY), "matrix = inf");
        assert_eq!(said(&|inner| inner.maybe = Some(f64::NAN)), "maybe = NaN");
        assert_eq!(said(&|inner| inner.pairs[0].0 = -1e31), "pairs = -10000000000000000000000000000000");
    }
}
