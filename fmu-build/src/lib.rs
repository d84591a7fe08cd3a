//! Makes FMUs and SSP systems of the models of `rfl-mpc`.
//!
//! | file | idea |
//! |---|---|
//! | `shipped.rs` | the FMUs and systems that we ship |
//! | `fmu.rs` | an FMU to be made |
//! | `base.rs` | an FMU that was made before, read and checked |
//! | `packing.rs` | the steps from a model to an FMU's file |
//! | `added.rs` | what a user has packed in: learned models, a vehicle |
//! | `system.rs` | FMUs connected, as an SSP archive |
//! | `description.rs` | `modelDescription.xml` from a declaration |
//! | `standard.rs` | the versions of FMI |
//! | `terminals.rs` | what is connected together: `terminalsAndIcons.xml` |
//! | `traceability.rs` | what an archive is and holds, for tools: SRMD |
//! | `documentation.rs` | what an FMU says of itself to people |
//! | `cargo.rs` | building libraries, and what is linked into them |
//! | `linker.rs` | one compiled library, linked for each version of FMI |
//! | `library.rs` | what a shared library exports and needs |
//! | `package.rs` | the archive, reproducible |
//! | `xml.rs` | elements and attributes |

/// The tool that wrote a description, as the attribute `generationTool` names it.
pub(crate) const GENERATION_TOOL: &str = concat!("fmu-build ", env!("CARGO_PKG_VERSION"));

pub mod added;
pub mod base;
pub mod cargo;
pub mod description;
pub mod documentation;
pub mod fmu;
pub mod library;
pub mod linker;
pub mod package;
pub mod packing;
pub mod shipped;
pub mod standard;
pub mod system;
pub mod terminals;
pub mod traceability;
pub mod xml;
