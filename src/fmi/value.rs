//! A value of any FMI type.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

/// A value of any FMI type; enumerations are integers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub enum Value {
    Real(f64),
    Integer(i32),
    Boolean(bool),
    String(String),
    Binary(BinaryValue),
}

/// In words for people.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Real(value) => value.fmt(f),
            Value::Integer(value) => value.fmt(f),
            Value::Boolean(value) => value.fmt(f),
            Value::String(value) => value.fmt(f),
            Value::Binary(bytes) => write!(f, "{} bytes", bytes.len()),
        }
    }
}

/// Bytes, shared by their copies: they may be many, and states are stored often.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(from = "Vec<u8>", into = "Vec<u8>")]
pub struct BinaryValue(Arc<[u8]>);

impl Deref for BinaryValue {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}

impl From<Vec<u8>> for BinaryValue {
    fn from(bytes: Vec<u8>) -> Self {
        Self(bytes.into())
    }
}

impl From<BinaryValue> for Vec<u8> {
    fn from(bytes: BinaryValue) -> Self {
        bytes.to_vec()
    }
}
