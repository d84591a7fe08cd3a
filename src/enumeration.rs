//! Named values, declared once: the enum for the code and the items of an FMU's enumeration.

/// Declares an enum with, for each value, its number, its name for users and its meaning.
///
/// It gets `ITEMS` (number, name, meaning), `ALL`, `from_number()`, `name()` and `meaning()`, and can be a parameter. The
/// first value is the default.
#[macro_export]
macro_rules! enumeration {
    ($(#[$attribute:meta])* $visibility:vis enum $name:ident {
        $first:ident = $first_number:literal $first_text:literal, $first_meaning:literal;
        $($value:ident = $number:literal $text:literal, $meaning:literal;)*
    }) => {
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
        $(#[$attribute])*
        #[repr(i32)]
        $visibility enum $name {
            #[doc = $first_meaning]
            #[default]
            $first = $first_number,
            $(#[doc = $meaning] $value = $number,)*
        }

        impl $name {
            /// Number, name and meaning of each value.
            pub const ITEMS: &'static [(i32, &'static str, &'static str)] =
                &[($first_number, $first_text, $first_meaning), $(($number, $text, $meaning)),*];

            /// All values, in the order of their numbers.
            pub const ALL: &'static [Self] = &[Self::$first, $(Self::$value),*];

            /// The value of a number, if there is one.
            #[must_use]
            pub fn from_number(number: i32) -> Option<Self> {
                Self::ALL.iter().copied().find(|value| *value as i32 == number)
            }

            /// The name that users see.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    Self::$first => $first_text,
                    $(Self::$value => $text,)*
                }
            }

            /// Meaning, in a sentence.
            #[must_use]
            pub fn meaning(self) -> &'static str {
                match self {
                    Self::$first => $first_meaning,
                    $(Self::$value => $meaning,)*
                }
            }
        }

        impl $crate::parameter::Number for $name {
            const INTEGER: bool = true;
            const CHOICES: Option<$crate::parameter::Choices> =
                Some($crate::parameter::Choices { type_name: stringify!($name), items: Self::ITEMS });

            fn from_f64(value: f64) -> Self {
                // A parameter's range admits no other numbers.
                Self::from_number(value as i32).unwrap_or_default()
            }

            fn to_f64(self) -> f64 {
                f64::from(self as i32)
            }
        }
    };
}
