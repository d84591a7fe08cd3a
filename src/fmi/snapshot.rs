//! FMU states: a copy of all that an instance is, and its form as bytes.
//!
//! ```text
//! "RFLFMUST" | version u32 | GUID length u32 | GUID | payload length u64 | checksum u64 | payload (postcard)
//! ```
//!
//! All numbers are little-endian; the checksum is FNV-1a (64 bit) over the payload. Reals are stored bit by bit.

use super::call_error::CallError;
use super::instance_state::InstanceState;
use super::values::Values;
use super::variable::Variable;
use serde::{Deserialize, Serialize};

const MARK: &[u8; 8] = b"RFLFMUST";
const VERSION: u32 = 1;

/// A stored FMU state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Snapshot {
    pub life: InstanceState,
    pub start_time: f64,
    pub stop_time: Option<f64>,
    /// The communication point, in s.
    pub time: f64,
    pub values: Values,
    /// Output of [`Model::save`](super::Model::save), if there is a working model.
    pub model: Option<Vec<u8>>,
}

impl Snapshot {
    /// The state as bytes.
    pub fn to_bytes(&self, guid: &str) -> Vec<u8> {
        let payload = postcard::to_allocvec(self).unwrap_or_default();
        let mut bytes = Vec::with_capacity(payload.len() + guid.len() + 32);
        bytes.extend_from_slice(MARK);
        bytes.extend_from_slice(&VERSION.to_le_bytes());
        bytes.extend_from_slice(&(guid.len() as u32).to_le_bytes());
        bytes.extend_from_slice(guid.as_bytes());
        bytes.extend_from_slice(&(payload.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&checksum(&payload).to_le_bytes());
        bytes.extend_from_slice(&payload);
        bytes
    }

    /// A state from bytes. Bytes behind the state are left alone (hosts may pad).
    pub fn from_bytes(bytes: &[u8], guid: &str, variables: &[Variable]) -> Result<Self, CallError> {
        let mut reader = Reader { bytes, position: 0 };
        if reader.take(MARK.len()).map_err(|_| CallError::NotAState)? != MARK {
            return Err(CallError::NotAState);
        }
        let found = u32::from_le_bytes(reader.array()?);
        if found != VERSION {
            return Err(CallError::StateVersion { found, known: VERSION });
        }
        let length = u32::from_le_bytes(reader.array()?) as usize;
        let found = reader.take(length)?;
        if found != guid.as_bytes() {
            let found = String::from_utf8_lossy(found).into_owned();
            return Err(CallError::StateOfOtherFmu { found, own: guid.to_owned() });
        }
        let length = usize::try_from(u64::from_le_bytes(reader.array()?)).unwrap_or(usize::MAX);
        let sum = u64::from_le_bytes(reader.array()?);
        let payload = reader.take(length)?;
        if checksum(payload) != sum {
            return Err(CallError::DamagedState { what: "its checksum is wrong" });
        }
        let mut snapshot: Self = postcard::from_bytes(payload)
            .map_err(|_| CallError::DamagedState { what: "its content cannot be read" })?;
        let times = [snapshot.start_time, snapshot.time, snapshot.stop_time.unwrap_or(0.0)];
        if !snapshot.values.fit(variables)
            || times.iter().any(|time| !time.is_finite())
            || snapshot.life.has_working_model() != snapshot.model.is_some()
        {
            return Err(CallError::DamagedState { what: "its values do not fit this FMU's variables" });
        }
        snapshot.values.mark_packed(variables);
        Ok(snapshot)
    }
}

/// Reads from the front of bytes that may end too early.
struct Reader<'a> {
    bytes: &'a [u8],
    position: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, length: usize) -> Result<&'a [u8], CallError> {
        let needed = self.position.saturating_add(length);
        let taken = self
            .bytes
            .get(self.position..needed)
            .ok_or(CallError::TruncatedState { given: self.bytes.len(), needed })?;
        self.position = needed;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], CallError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }
}

/// FNV-1a, 64 bit.
fn checksum(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}
