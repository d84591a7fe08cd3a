//! Makes FMUs and SSP systems of the models of `rfl-mpc`.
//!
//! | file | idea |
//! |---|---|
//! | `description.rs` | `modelDescription.xml` from a declaration |
//! | `xml.rs` | elements and attributes |
//! | `cargo.rs` | building libraries, and what is linked into them |
//! | `library.rs` | what a shared library exports and needs |
//! | `package.rs` | the archive, reproducible |

pub mod cargo;
pub mod description;
pub mod library;
pub mod package;
pub mod xml;
