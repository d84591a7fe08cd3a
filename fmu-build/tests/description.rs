//! The XML is what the declarations say, stands in the project as generated, and is read by others.

#[path = "../../tests/common/toy.rs"]
#[allow(dead_code)]
mod toy;

use fmu_build::description::describe;
use rfl_mpc::fmi::Model;
use std::path::{Path, PathBuf};

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// `UPDATE_TOY=1` writes the test model's description; those of the shipped FMUs are written by
/// `fmu-build --describe`.
#[test]
fn the_test_models_description_stands_as_generated() {
    let path = project().join("tests/common/SteeringLag.xml");
    let xml = describe(&toy::SteeringLag::declaration());
    if std::env::var_os("UPDATE_TOY").is_some() {
        std::fs::write(&path, &xml).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), xml, "run UPDATE_TOY=1 cargo test -p fmu-build");
}
