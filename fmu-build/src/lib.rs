//! Makes FMUs and SSP systems of the models of `rfl-mpc`.
//!
//! | file | idea |
//! |---|---|
//! | `description.rs` | `modelDescription.xml` from a declaration |
//! | `xml.rs` | elements and attributes |
//! | `package.rs` | the archive, reproducible |

pub mod description;
pub mod package;
pub mod xml;
