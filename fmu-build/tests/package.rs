//! A packed FMU: the right content, the same bytes every time, libraries that export FMI 2.0 and nothing else and
//! belong to the description; what does not fit is refused by name.

#[path = "../../tests/common/toy.rs"]
#[allow(dead_code)]
mod toy;

use fmu_build::cargo::Builder;
use fmu_build::fmu::{Added, Base, Fmu, FmuError, Resource, initialize};
use fmu_build::library::{FMI2_FUNCTIONS, Library, LibraryError};
use fmu_build::package::{Package, PackageError};
use fmu_build::packing::{Made, Options, Packing};
use fmu_build::standard::Standard;
use rfl_mpc::fmi::Model;
use rfl_mpc::vehicle::VehicleKind;
use std::io::Read;
use std::path::{Path, PathBuf};

const LICENSE: &[Resource] = &[Resource { from: "LICENSE", to: "folder/text.txt" }];

/// The test model as an FMU of its own.
fn toy() -> Fmu {
    Fmu {
        declaration: toy::SteeringLag::declaration(),
        vehicle: VehicleKind::Car,
        description: "tests/common/SteeringLag.xml".to_owned(),
        // It links what this one links.
        package: "fmu-passenger-car",
        // What is built for all tests: a narrower selection has other features, and would be a build of the library apart.
        selection: include_str!("../../scripts/tested.txt").split_whitespace().collect(),
        resources: LICENSE,
        initialize: initialize::<toy::SteeringLag>,
        added: Added::default(),
        base: None,
    }
}

fn options(out: &str) -> Options {
    Options {
        project: Path::new(env!("CARGO_MANIFEST_DIR")).join(".."),
        builder: Builder::Cargo,
        profile: "dev".to_owned(),
        targets: Vec::new(),
        packing: Packing { out: Path::new(env!("CARGO_TARGET_TMPDIR")).join(out), ..Packing::default() },
    }
}

fn packing(out: &str) -> Packing {
    options(out).packing
}

fn toy_library() -> PathBuf {
    Builder::Cargo.build(&options("").project, "dev", &toy().selection, None).unwrap()
}

/// Names of an archive's entries.
fn entries(path: &Path) -> Vec<String> {
    let zip = zip::ZipArchive::new(std::fs::File::open(path).unwrap()).unwrap();
    zip.file_names().map(|name| name.unwrap().into_owned()).collect()
}

fn entry(path: &Path, name: &str) -> Vec<u8> {
    let mut zip = zip::ZipArchive::new(std::fs::File::open(path).unwrap()).unwrap();
    let mut content = Vec::new();
    zip.by_name(name).unwrap().read_to_end(&mut content).unwrap();
    content
}

#[test]
fn an_fmu_has_all_that_the_standard_and_people_want() {
    let options = options("whole");
    let mut steps = Vec::new();
    let made = toy().make(&options, |step| steps.push(step.to_owned())).unwrap();
    assert_eq!(steps, ["building the library", "checking symbols and needs", "packing"]);
    assert_eq!(made.merged, [""; 0]);
    let names = entries(&made.path);
    for wanted in [
        "modelDescription.xml",
        &format!("binaries/{0}/SteeringLag.{1}", made.libraries[0].platform, std::env::consts::DLL_EXTENSION),
        "resources/folder/text.txt",
        "documentation/index.html",
        "documentation/licenses/LICENSE.txt",
        "terminalsAndIcons/terminalsAndIcons.xml",
        "terminalsAndIcons/icon.png",
        "model.png",
        "extra/org.ssp-standard.ssp-traceability.srmd/resourceMetaData.srmd",
    ] {
        assert!(names.iter().any(|name| name == wanted), "{wanted} is missing in {names:?}");
    }
    let html = String::from_utf8(entry(&made.path, "documentation/index.html")).unwrap();
    for wanted in ["steer_cmd", "actuator.tau", "0.001 … 10", "fmi2Discard", "logActuator"] {
        assert!(html.contains(wanted), "{wanted} is missing in the documentation");
    }
    let html = String::from_utf8(entry(&made.path, "documentation/licenses/license.html")).unwrap();
    for wanted in ["nalgebra", "Apache-2.0", "<td>std"] {
        assert!(html.contains(wanted), "{wanted} is missing among the licences");
    }
    let licenses = names.iter().filter(|name| name.starts_with("documentation/licenses/")).count();
    assert!(licenses > 20, "{names:?}");
    for program_only in ["clap", "indicatif", "quick-xml", "zip-"] {
        assert!(!html.contains(&format!("<td>{program_only}")), "{program_only} is linked into an FMU");
    }
    // The same again gives the same bytes.
    let bytes = std::fs::read(&made.path).unwrap();
    toy().make(&options, |_| {}).unwrap();
    assert!(std::fs::read(&made.path).unwrap() == bytes);
}

/// A library of 2.0 is none of 3.0.
#[test]
fn a_library_of_another_version_is_refused() {
    let mut options = options("other version");
    options.packing = options.packing.for_standard(Standard::Fmi3);
    let error = toy().make(&options, |_| {}).unwrap_err();
    assert!(matches!(error, FmuError::Library(LibraryError::Missing { .. })), "{error}");
    assert!(error.to_string().contains("fmi3DoStep"), "{error}");
}

/// Files and start values of a user go into the same library's FMU.
#[test]
fn what_a_user_adds_is_packed() {
    let mut fmu = toy();
    fmu.added.files.insert("added/license.txt".to_owned(), options("").project.join("LICENSE"));
    fmu.added.start.insert("actuator.tau".to_owned(), "0.25".to_owned());
    let made = fmu.make(&options("added"), |_| {}).unwrap();
    assert_eq!(entry(&made.path, "resources/start.toml"), b"\"actuator.tau\" = \"0.25\"\n");
    assert!(entries(&made.path).contains(&"resources/added/license.txt".to_owned()));
    let text = |name: &str| String::from_utf8(entry(&made.path, name)).unwrap();
    let xml = text("modelDescription.xml");
    assert!(xml.contains(r#"start="0.25""#), "{xml}");
    let committed = include_str!("../../tests/common/SteeringLag.xml");
    assert_eq!(rfl_mpc::fmi::v2::guid_of(&xml), rfl_mpc::fmi::v2::guid_of(committed));
    assert!(text("documentation/index.html").contains("0.25"));

    fmu.added.start.insert("actuator.tau".to_owned(), "-1".to_owned());
    let error = fmu.make(&options("added"), |_| {}).unwrap_err();
    assert!(matches!(error, FmuError::Start(_)), "{error}");
}

/// An FMU that is there, changed, is bit for bit the one made from source with the same things added, and a change of a
/// change counts as one.
#[test]
fn a_changed_fmu_is_the_one_made_from_source() {
    let options = options("plain");
    let plain = toy().make(&options, |_| {}).unwrap().path;
    let add = |fmu: &mut Fmu, tau: &str| {
        fmu.added.files.insert("added/license.txt".to_owned(), options.project.join("LICENSE"));
        fmu.added.start.insert("actuator.tau".to_owned(), tau.to_owned());
    };
    let mut wanted = toy();
    add(&mut wanted, "0.25");
    let made = Options { packing: packing("changed_source"), ..options.clone() };
    let wanted = std::fs::read(wanted.make(&made, |_| {}).unwrap().path).unwrap();

    let change = |file: &Path, tau: &str, out: &str| -> Made {
        let mut fmu = Base::read(file, &[toy()]).unwrap();
        add(&mut fmu, tau);
        let base = fmu.base.clone().unwrap();
        fmu.change(&base, &packing(out)).unwrap()
    };
    let changed = change(&plain, "0.25", "changed");
    assert_eq!(changed.libraries, [Library::check(&toy_library()).unwrap()]);
    assert!(std::fs::read(&changed.path).unwrap() == wanted);
    let again = change(&change(&plain, "0.5", "changed_twice").path, "0.25", "changed_again");
    assert!(std::fs::read(&again.path).unwrap() == wanted);
}

/// What is no FMU of this version is refused before anything is written.
#[test]
fn an_fmu_of_others_is_not_changed() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("other.fmu");
    let refused = |entries: &[(&str, &str)], words: &str| {
        let mut package = Package::default();
        entries.iter().for_each(|(name, content)| package.add(*name, *content).unwrap());
        package.write(&file).unwrap();
        let error = Base::read(&file, &[toy()]).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("other.fmu"), "{error}");
    };
    let xml = include_str!("../../tests/common/SteeringLag.xml");
    let older = xml.replace("guid=\"{", "guid=\"{0");
    let description = "modelDescription.xml";
    refused(&[], "is no FMU of this program");
    refused(&[(description, "<fmiModelDescription modelName=\"Other\"")], "one of SteeringLag");
    refused(&[(description, &older)], "another version of fmu-build");
    refused(&[(description, xml), ("resources/start.toml", "tau = 1")], "start values");
    for name in ["../evil", "resources/../../evil", "/etc/evil", "resources\\evil", "C:/evil"] {
        refused(&[(description, xml), (name, "")], name);
    }
    // One that no host could load, and one whose library is of another FMU, or no library.
    let library = "binaries/linux64/SteeringLag.so";
    let guid = rfl_mpc::fmi::v2::guid_of(xml).unwrap();
    refused(&[(description, xml)], "holds no library");
    refused(&[(description, xml), (library, "another's")], "for another description");
    refused(&[(description, xml), ("binaries/linux64/Other.so", guid)], "Other.so");
    refused(&[(description, xml), (library, guid)], "no shared library");
    // What swells is not unpacked: the cause is said, and that one alone.
    let swollen = "0".repeat((64 << 20) + 1);
    refused(
        &[(description, xml), ("resources/a", &swollen)],
        "holds `resources/a`, which is larger than 64 MB unpacked, as",
    );
    refused(&[(description, &swollen)], "holds `modelDescription.xml`, which is larger");
    let part = &swollen[..60 << 20];
    let parts: Vec<_> = ["a", "b", "c", "d", "e"].map(|name| format!("resources/{name}")).into();
    let many: Vec<_> = parts.iter().map(|name| (name.as_str(), part)).chain([(description, xml)]).collect();
    refused(&many, "is larger than 256 MB unpacked, as");
    let names: Vec<_> = (0..=10_000).map(|i| format!("resources/{i}")).collect();
    let many: Vec<_> = names.iter().map(|name| (name.as_str(), "")).chain([(description, xml)]).collect();
    refused(&many, "holds 10002 files, more than 10000, as");
    std::fs::write(&file, "no archive").unwrap();
    assert!(matches!(Base::read(&file, &[toy()]), Err(FmuError::Package(PackageError::Archive { .. }))));
    assert!(matches!(Base::read(Path::new("none.fmu"), &[toy()]), Err(FmuError::Package(_))));
}

#[test]
fn a_library_exports_the_functions_of_fmi2_and_nothing_else() {
    let library = Library::check(&toy_library()).unwrap();
    assert_eq!(library.exports.iter().map(String::as_str).collect::<Vec<_>>(), FMI2_FUNCTIONS);
    if cfg!(target_os = "linux") {
        assert!(library.glibc.is_some(), "{}", library.requirements());
    }
}

/// A C compiler's shared library with these functions.
#[cfg(unix)]
fn library_of(folder: &Path, functions: &[&str]) -> PathBuf {
    let (source, library) = (folder.join("a.c"), folder.join("a.so"));
    let lines: Vec<_> = functions.iter().map(|name| format!("int {name}(void) {{ return 0; }}")).collect();
    std::fs::write(&source, lines.join("\n")).unwrap();
    let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let mut compiler = std::process::Command::new(compiler);
    assert!(compiler.args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&source).status().unwrap().success());
    library
}

#[cfg(unix)]
#[test]
fn libraries_with_other_symbols_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let library = library_of(folder.path(), &FMI2_FUNCTIONS[1..]);
    let error = Library::check(&library).unwrap_err();
    assert!(
        matches!(&error, LibraryError::Missing { missing, .. } if missing == "fmi2CancelStep"),
        "{error}"
    );
    let more: Vec<_> = FMI2_FUNCTIONS.iter().copied().chain(["deflate"]).collect();
    let library = library_of(folder.path(), &more);
    let error = Library::check(&library).unwrap_err();
    assert!(matches!(&error, LibraryError::Surplus { surplus, .. } if surplus == "deflate"), "{error}");
    std::fs::write(&library, "no library").unwrap();
    assert!(matches!(Library::check(&library), Err(LibraryError::Format { .. })));
    assert!(matches!(Library::check(&folder.path().join("none.so")), Err(LibraryError::Read { .. })));
}

/// A description that was changed and not written anew would give an FMU that refuses every host.
#[test]
fn an_old_description_is_refused() {
    let mut fmu = toy();
    fmu.declaration.variables[0].description = "changed".into();
    let error = fmu.make(&options("old"), |_| {}).unwrap_err();
    assert!(matches!(error, FmuError::Description { name: "SteeringLag", .. }), "{error}");
    assert!(error.to_string().contains("--describe"));
}

/// Libraries of other platforms come from a folder or an FMU, if they are of this description.
#[cfg(target_os = "linux")]
#[test]
fn libraries_of_other_platforms_are_merged() {
    const WIN: &str = "binaries/win64/SteeringLag.dll";
    let folder = tempfile::tempdir().unwrap();
    let guid = rfl_mpc::fmi::v2::guid_of(include_str!("../../tests/common/SteeringLag.xml")).unwrap();
    let other = folder.path().join("SteeringLag.fmu");
    let pack = |entries: &[(&str, &[u8])]| {
        let mut package = Package::default();
        package.add("resources/not_taken.txt", "").unwrap();
        entries.iter().for_each(|(name, content)| package.add(*name, *content).unwrap());
        package.write(&other).unwrap();
    };
    let marked = format!("a library with {guid}").into_bytes();
    pack(&[("binaries/linux64/SteeringLag.so", &marked), (WIN, &marked)]);
    let wanted = ["binaries/linux64/SteeringLag.so", WIN].map(String::from);
    let mut package = Package::default();
    package.add(wanted[0].clone(), "its own").unwrap();
    let merged = package.merge_binaries(&other, &wanted, guid.as_bytes()).unwrap();
    assert_eq!(
        (merged, package.get(&wanted[0]), package.get(WIN)),
        (vec![WIN.to_owned()], Some(&b"its own"[..]), Some(&marked[..]))
    );
    assert!(package.get("resources/not_taken.txt").is_none());

    let mut options = options("merged");
    options.packing.merge.push(other.clone());
    let refused = |entries: &[(&str, &[u8])]| {
        pack(entries);
        toy().make(&options, |_| {}).unwrap_err()
    };
    let error = refused(&[(WIN, b"a library of another description")]);
    assert!(matches!(error, FmuError::Package(PackageError::OtherDescription { .. })), "{error}");
    let error = refused(&[(WIN, &marked)]);
    assert!(matches!(error, FmuError::Library(LibraryError::Format { .. })), "{error}");
    let error = refused(&[(WIN, &std::fs::read(toy_library()).unwrap())]);
    assert!(matches!(error, FmuError::Platform { .. }), "{error}");
    let error = refused(&[]);
    assert!(matches!(error, FmuError::Package(PackageError::NoLibraries { .. })), "{error}");

    // An archive of a stranger: names that climb, or that no host finds, and libraries that swell.
    let mut bomb = marked.clone();
    bomb.resize(bomb.len() + (70 << 20), 0);
    for (name, content) in [
        ("binaries/../../evil.so", &marked),
        ("binaries/linux64/../../../evil.so", &marked),
        ("binaries/win64/a/b.dll", &marked),
        ("binaries/win64\\..\\evil.dll", &marked),
        ("binaries/win64/.dll", &marked),
        ("binaries/win64/SteeringLag.so", &marked),
        ("Binaries/Win64/SteeringLag.dll", &marked),
        ("/binaries/win64/SteeringLag.dll", &marked),
        ("binaries\\win64\\SteeringLag.dll", &marked),
        ("binaries/amiga/SteeringLag.library", &marked),
        (WIN, &bomb),
    ] {
        let error = refused(&[(name, content)]);
        assert!(matches!(error, FmuError::Package(PackageError::NoLibrary { .. })), "{name}: {error}");
    }
    options.packing.merge.clear();

    // From a folder: a library in the wrong place, then one of another description.
    options.packing.binaries = Some(folder.path().to_owned());
    let win = folder.path().join("win64");
    std::fs::create_dir(&win).unwrap();
    std::fs::copy(toy_library(), win.join("SteeringLag.dll")).unwrap();
    let error = toy().make(&options, |_| {}).unwrap_err();
    assert!(matches!(error, FmuError::Platform { .. }), "{error}");
}

#[test]
fn an_entry_stands_once() {
    let mut package = Package::default();
    package.add("a", "1").unwrap();
    assert!(matches!(package.add("a", "2"), Err(PackageError::Twice(name)) if name == "a"));
    assert!(matches!(package.add_file("b", Path::new("none")), Err(PackageError::Read { .. })));
}
