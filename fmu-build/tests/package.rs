//! A packed FMU: the right content, the same bytes every time, a library that exports FMI 2.0 and nothing else.

#[path = "../../tests/common/toy.rs"]
#[allow(dead_code)]
mod toy;

use fmu_build::cargo::Builder;
use fmu_build::description::describe;
use fmu_build::library::{FMI2_FUNCTIONS, Library};
use fmu_build::package::Package;
use rfl_mpc::fmi::Model;
use std::path::{Path, PathBuf};

/// The test model's library.
fn toy_library() -> PathBuf {
    let project = Path::new(env!("CARGO_MANIFEST_DIR"));
    Builder::Cargo.build(project, "dev", &["-p", "fmu-build", "--example", "toy_fmu"]).unwrap()
}

fn toy_package() -> Package {
    let mut package = Package::default();
    package.add("modelDescription.xml", describe(&toy::SteeringLag::declaration())).unwrap();
    package.add_file("binaries/linux64/SteeringLag.so", &toy_library()).unwrap();
    package.add("resources/tau.txt", "0.25\n").unwrap();
    package
}

#[test]
fn a_library_exports_the_functions_of_fmi2_and_nothing_else() {
    let library = Library::check(&toy_library()).unwrap();
    assert_eq!(library.exports.iter().map(String::as_str).collect::<Vec<_>>(), FMI2_FUNCTIONS);
    assert!(library.glibc.is_some(), "{}", library.requirements());
}

#[test]
fn the_same_content_gives_the_same_bytes() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("SteeringLag.fmu");
    let package = toy_package();
    package.write(&path).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), toy_package().to_bytes().unwrap());
}
