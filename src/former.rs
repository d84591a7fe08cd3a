//! Keys of JSON answers under their former names, for scripts of the version before: each value stands under both.
//!
//! To be used as `#[serde(flatten, with = "crate::former::summary")]`. The new key is read.

macro_rules! former {
    ($($name:ident $former:literal;)*) => {$(
        pub(crate) mod $name {
            use serde::{Deserialize, Deserializer, Serialize, Serializer};

            #[derive(Serialize)]
            struct Both<'a, T> {
                $name: &'a T,
                #[serde(rename = $former)]
                former: &'a T,
            }

            #[derive(Deserialize)]
            struct New<T> {
                $name: T,
            }

            pub(crate) fn serialize<T: Serialize, S: Serializer>(
                value: &T,
                serializer: S,
            ) -> Result<S::Ok, S::Error> {
                Both { $name: value, former: value }.serialize(serializer)
            }

            pub(crate) fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
                deserializer: D,
            ) -> Result<T, D::Error> {
                New::deserialize(deserializer).map(|new| new.$name)
            }
        }
    )*};
}

former! {
    summary "words";
    location "where";
    gap_reduction "shrink";
    also "besides";
}
