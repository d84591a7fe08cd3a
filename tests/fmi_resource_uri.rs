//! The resource locations that hosts pass, right and wrong.

use rfl_mpc::fmi::resource::{ResourceError, folder};
use std::path::{Path, PathBuf};

fn of(location: &str) -> Option<PathBuf> {
    folder(location, |_| true).unwrap()
}

#[test]
fn locations_in_the_field() {
    for (location, wanted) in [
        ("file:///opt/fmu/resources", "/opt/fmu/resources"),
        ("file:///opt/fmu/resources/", "/opt/fmu/resources"),
        ("file:/opt/fmu/resources", "/opt/fmu/resources"),
        ("FILE:///opt/fmu", "/opt/fmu"),
        ("file://localhost/opt/fmu", "/opt/fmu"),
        ("file:///opt/my%20fmu%2Bx/%C3%A4", "/opt/my fmu+x/\u{e4}"),
        ("file:///opt/my fmu", "/opt/my fmu"),
        ("file:///opt/100%/fmu", "/opt/100%/fmu"),
        ("file:///opt/50%zz", "/opt/50%zz"),
        ("file:///opt/a#b?c", "/opt/a#b?c"),
        ("/opt/fmu/resources", "/opt/fmu/resources"),
        ("/opt/my fmu/50%20", "/opt/my fmu/50%20"),
        ("resources", "resources"),
        ("file:///C:/fmu/resources", "C:/fmu/resources"),
        ("file:/C:/fmu", "C:/fmu"),
        ("file://C:/fmu", "C:/fmu"),
        ("/C:/fmu", "C:/fmu"),
        ("C:/fmu", "C:/fmu"),
        ("C:\\fmu\\resources\\", "C:\\fmu\\resources"),
        ("  file:///opt/fmu  ", "/opt/fmu"),
        ("file:///", "/"),
    ] {
        assert_eq!(of(location), Some(PathBuf::from(wanted)), "{location}");
    }
}

#[test]
fn no_location_is_no_folder() {
    assert_eq!(of(""), None);
    assert_eq!(of("  "), None);
}

/// A host that forgot to encode a `%`: what is there decides.
#[test]
fn a_folder_that_exists_decides_over_decoding() {
    let only = |wanted: &'static str| move |path: &Path| path == Path::new(wanted);
    assert_eq!(folder("file:///tmp/a%20b", only("/tmp/a%20b")).unwrap(), Some("/tmp/a%20b".into()));
    assert_eq!(folder("file:///tmp/a%20b", only("/tmp/a b")).unwrap(), Some("/tmp/a b".into()));
    assert_eq!(folder("file:///tmp/a%20b", |_| false).unwrap(), Some("/tmp/a b".into()));
}

#[test]
fn what_cannot_be_used_is_said() {
    let at = |location: &str| folder(location, |_| true).unwrap_err();
    assert_eq!(at("https://example.org/r"), ResourceError::Scheme("https://example.org/r".into()));
    assert!(matches!(at("file://server/share"), ResourceError::RemoteHost { host, .. } if host == "server"));
    assert!(matches!(at("file:///tmp/%ff%fe"), ResourceError::NotUtf8(_)));
}
