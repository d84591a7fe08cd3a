//! Numerical tools that know nothing of vehicles: all other folders may use them, they use none.
//!
//! | file | idea |
//! |---|---|
//! | `random.rs` | SplitMix64: the same bits for the same seed on every machine |
//! | `parallel.rs` | work on several threads with the same bits on any number of them |
//! | `hash.rs` | FNV-1a: tells files and data sets apart |
//! | `statistics.rs` | quantiles, medians, slopes |
//! | `readable.rs` | numbers in messages |
//! | `lanes.rs` | four wheels computed side by side |

mod hash;
pub(crate) mod lanes;
pub mod parallel;
mod random;
mod readable;
pub(crate) mod statistics;

pub(crate) use hash::Fnv;
pub use hash::fnv;
pub use random::Random;
pub(crate) use readable::Readable;
