//! Rows of a fixed number of values in files: a sequence of tuples, as serde writes `Vec<[f64; 4]>`. serde itself knows
//! arrays of a few lengths only, not of any.

use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeTuple, Serializer};
use std::marker::PhantomData;

/// One row: an array, or a borrowed one.
pub(super) struct FeatureRow<R>(pub R);

impl<T: Serialize, const S: usize> Serialize for FeatureRow<&[T; S]> {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        let mut tuple = serializer.serialize_tuple(S)?;
        self.0.iter().try_for_each(|value| tuple.serialize_element(value))?;
        tuple.end()
    }
}

impl<'de, T: Deserialize<'de> + Default, const S: usize> Deserialize<'de> for FeatureRow<[T; S]> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Values<T, const S: usize>(PhantomData<T>);

        impl<'de, T: Deserialize<'de> + Default, const S: usize> Visitor<'de> for Values<T, S> {
            type Value = [T; S];

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "{S} values")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut values: A) -> Result<[T; S], A::Error> {
                let mut row: [T; S] = std::array::from_fn(|_| T::default());
                for (i, value) in row.iter_mut().enumerate() {
                    *value = values.next_element()?.ok_or_else(|| A::Error::invalid_length(i, &self))?;
                }
                Ok(row)
            }
        }

        deserializer.deserialize_tuple(S, Values(PhantomData)).map(FeatureRow)
    }
}

pub(super) fn serialize<Z: Serializer, const S: usize>(
    rows: &[[f64; S]],
    serializer: Z,
) -> Result<Z::Ok, Z::Error> {
    serializer.collect_seq(rows.iter().map(FeatureRow))
}

pub(super) fn deserialize<'de, D: Deserializer<'de>, const S: usize>(
    deserializer: D,
) -> Result<Vec<[f64; S]>, D::Error> {
    let rows: Vec<FeatureRow<[f64; S]>> = Vec::deserialize(deserializer)?;
    Ok(rows.into_iter().map(|FeatureRow(row)| row).collect())
}
