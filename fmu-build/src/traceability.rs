//! Name and version of an archive, and the checksums of its content: Simulation Resource Meta Data (SRMD) of the SSP layered
//! standard for traceability.
//!
//! Tools for credible simulation collect these files: they tell which model, vehicle, controller file and library a result was
//! made with. Keywords are those of SET Level's `model-meta-data`, which the standard's own examples have. The second
//! classification is the archive's table of contents:
//!
//! ```text
//!     <stc:ClassificationEntry keyword="resources/vehicle.toml">sha3-256:93ab...</stc:ClassificationEntry>
//! ```
//!
//! There is no date: the same content has the same bytes.
//!
//! Source: SSP Layered Standard Traceability 1.0, Modelica Association 2025, chapters on SRMD and on packaging.

use crate::GENERATION_TOOL;
use crate::package::{Package, PackageError};
use crate::standard::Standard;
use crate::xml::{Attributes, Xml};
use rfl_mpc::fmi::Declaration;
use sha3::{Digest, Sha3_256};

/// The file's place in an FMU and in an SSP archive.
pub const FILE: &str = "extra/org.ssp-standard.ssp-traceability.srmd/resourceMetaData.srmd";

/// Types of the two classifications.
const MODEL: &str = "de.setlevel.srmd.model-meta-data";
const CONTENT: &str = "rfl_mpc.content";

/// An archive: what its content is checked by, and the words for it.
struct Archive<'a> {
    name: &'a str,
    description: &'a str,
    guid: Option<&'a str>,
    format: String,
    /// Files and folders that make it what it is. Licences, pictures and pages do not.
    content: &'a [&'a str],
}

/// Adds the meta data of an FMU that holds all else; `mark` is its GUID or instantiation token.
///
/// # Errors
/// If the package has them already.
pub fn add_to_fmu(
    package: &mut Package,
    standard: Standard,
    declaration: &Declaration,
    mark: &str,
) -> Result<(), PackageError> {
    let archive = Archive {
        name: declaration.name,
        description: declaration.description,
        guid: Some(mark),
        format: format!("FMI {}", standard.number()),
        content: &["binaries/", "modelDescription.xml", "resources/"],
    };
    package.add(FILE, archive.meta_data(package))
}

/// Adds the meta data of a system that holds all else.
///
/// # Errors
/// If the package has them already.
pub fn add_to_system(package: &mut Package, standard: Standard, name: &str) -> Result<(), PackageError> {
    let archive = Archive {
        name,
        description: "A vehicle and its controller, connected",
        guid: None,
        format: format!("SSP {} of FMI {}", standard.of_systems(), standard.number()),
        content: &["SystemStructure.ssd", "resources/"],
    };
    package.add(FILE, archive.meta_data(package))
}

impl Archive<'_> {
    fn meta_data(&self, package: &Package) -> String {
        const VERSION: &str = env!("CARGO_PKG_VERSION");
        let mut xml = Xml::new();
        xml.open(
            "srmd:SimulationResourceMetaData",
            Attributes::new()
                .with("xmlns:srmd", "http://ssp-standard.org/SSPTraceability1/SimulationResourceMetaData")
                .with("xmlns:stc", "http://ssp-standard.org/SSPTraceability1/SSPTraceabilityCommon")
                .with("version", "1.0.0")
                .with("name", self.name)
                .with("description", self.description)
                .with("author", env!("CARGO_PKG_AUTHORS"))
                .with("fileversion", VERSION)
                .with("license", env!("CARGO_PKG_LICENSE"))
                .with("generationTool", GENERATION_TOOL),
        );
        let told = [
            ("model.manufacturer", Some(env!("CARGO_PKG_AUTHORS"))),
            ("model.name", Some(self.name)),
            ("model.version", Some(VERSION)),
            ("model.guid", self.guid),
            ("model.purpose", Some(self.description)),
            ("model.implementation.format", Some(&self.format)),
        ];
        let told = told.into_iter().filter_map(|(keyword, value)| Some((keyword, value?.to_owned())));
        classification(&mut xml, MODEL, told);
        let files = self.content.iter().flat_map(|part| package.names(part));
        let sums = files.filter_map(|name| Some((name, checksum(package.get(name)?))));
        classification(&mut xml, CONTENT, sums);
        xml.close();
        xml.finish()
    }
}

/// Keywords and values of a type.
fn classification<'a>(xml: &mut Xml, kind: &str, entries: impl Iterator<Item = (&'a str, String)>) {
    xml.open("stc:Classification", Attributes::new().with("type", kind));
    for (keyword, value) in entries {
        xml.text_with("stc:ClassificationEntry", Attributes::new().with("keyword", keyword), &value);
    }
    xml.close();
}

/// Checksum of a file's content, with the algorithm's name.
fn checksum(content: &[u8]) -> String {
    let sum = Sha3_256::digest(content);
    sum.iter().fold("sha3-256:".to_owned(), |text, byte| format!("{text}{byte:02x}"))
}

#[cfg(test)]
mod tests {
    #[test]
    fn checksum_is_that_of_the_standard() {
        // FIPS 202, example of the empty message.
        let empty = "sha3-256:a7ffc6f8bf1ed76651c14756a061d662f580ff4de43b49fa82d80a4b80f8434a";
        assert_eq!(super::checksum(b""), empty);
    }
}
