//! Files of a command: what it writes must be no file that it reads or writes beside.

use super::output::check_writable;
use crate::control::MODEL_EXTENSION;
use crate::input;
use std::error::Error;
use std::path::{Path, PathBuf};

/// A file with the option that names it.
pub(super) type Named<F> = (&'static str, F);

/// Checks the files that a command writes, before its work: each can be written, and is none of the others, nor one that
/// the command reads. Of `read`, names that are no files here are passed over; the files that one leads to count, too.
///
/// # Errors
/// The file with its fault.
pub(super) fn check_files<W: AsRef<Path>, R: AsRef<Path>>(
    written: &[Named<W>],
    read: &[Named<R>],
) -> Result<(), Box<dyn Error>> {
    for (index, (option, file)) in written.iter().enumerate() {
        let file = file.as_ref();
        check_writable(file)?;
        let Some(place) = place_of(file) else { continue };
        let same = |other: &Path| place_of(other).is_some_and(|other| is_same(&place, &other));
        let file = file.display();
        if let Some((other, _)) = written[..index].iter().find(|(_, other)| same(other.as_ref())) {
            return Err(format!("{other} and {option} are one file, {file}: name two").into());
        }
        check_not_read(option, &place, file, read)?;
    }
    Ok(())
}

/// Checks that a place is none of the files that are read.
fn check_not_read<R: AsRef<Path>>(
    option: &str,
    place: &Path,
    name: std::path::Display<'_>,
    read: &[Named<R>],
) -> Result<(), Box<dyn Error>> {
    let same = |other: &Path| other.is_file() && place_of(other).is_some_and(|other| is_same(place, &other));
    let over = "and would be written over: name another";
    if let Some((other, _)) = read.iter().find(|(_, other)| same(other.as_ref())) {
        return Err(format!("{option} {name} is the file of {other}, {over}").into());
    }
    let behind = |other: &R| files_behind(other.as_ref()).iter().any(|file| same(file));
    match read.iter().find(|(_, other)| behind(other)) {
        Some((other, named)) => {
            let named = named.as_ref().display();
            Err(format!("{option} {name} is read with {other} {named}, {over}").into())
        }
        None => Ok(()),
    }
}

/// The files that are read with what an option names: a vehicle file's tyres, the models of a folder.
pub(super) fn files_behind(named: &Path) -> Vec<PathBuf> {
    /// More is no file that names others; a log need not be parsed as one.
    const LONGEST: u64 = 1 << 20;
    if named.is_dir() {
        let all = std::fs::read_dir(named).into_iter().flatten().flatten().map(|entry| entry.path());
        return all.filter(|file| file.extension().is_some_and(|of| of == MODEL_EXTENSION)).collect();
    }
    if !std::fs::metadata(named).is_ok_and(|what| what.is_file() && what.len() <= LONGEST) {
        return Vec::new();
    }
    let table = input::read_text(named).ok().and_then(|text| text.parse::<toml::Table>().ok());
    let mut names = Vec::new();
    table.iter().for_each(|table| file_names(table, &mut names));
    let folder = named.parent().unwrap_or(Path::new(""));
    names.into_iter().map(|name| folder.join(name)).collect()
}

/// The values of all keys `file`.
fn file_names(table: &toml::Table, names: &mut Vec<String>) {
    for (key, value) in table {
        match value {
            toml::Value::String(name) if key == "file" => names.push(name.clone()),
            toml::Value::Table(inner) => file_names(inner, names),
            _ => {}
        }
    }
}

/// Checks that none of the files that a command writes to the folder of `--out` is one that it reads.
///
/// # Errors
/// The file with its fault.
pub(super) fn check_folder<N: AsRef<Path>, R: AsRef<Path>>(
    folder: &Path,
    names: &[N],
    read: &[Named<R>],
) -> Result<(), Box<dyn Error>> {
    for file in names.iter().map(|name| folder.join(name)).filter(|file| file.is_file()) {
        let Some(place) = place_of(&file) else { continue };
        check_not_read("--out", &place, file.display(), read)?;
    }
    Ok(())
}

/// The files that are given, of options that need not be.
pub(super) fn given<const N: usize>(options: [Named<&Option<PathBuf>>; N]) -> Vec<Named<&Path>> {
    options.into_iter().filter_map(|(option, file)| Some((option, file.as_deref()?))).collect()
}

/// The place of a file, whatever way leads there; none of a pipe or a device, which may be written twice.
fn place_of(file: &Path) -> Option<PathBuf> {
    if let Ok(place) = std::fs::canonicalize(file) {
        return place.is_file().then_some(place);
    }
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // A folder that is still to be made has no links.
    let folder = std::fs::canonicalize(folder).or_else(|_| std::path::absolute(folder)).ok()?;
    Some(folder.join(file.file_name()?))
}

#[cfg(unix)]
fn is_same(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let number = |file: &Path| std::fs::metadata(file).ok().map(|what| (what.dev(), what.ino()));
    a == b || number(a).is_some_and(|of_a| number(b) == Some(of_a))
}

#[cfg(not(unix))]
fn is_same(a: &Path, b: &Path) -> bool {
    a == b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_vehicle_file_or_a_folder_leads_to_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("cars/tyres")).unwrap();
        let vehicle =
            "name = \"a\"\n[tyre.front]\nfile = \"tyres/a.tir\"\n[deep.er.tyre]\nfile = \"../b.tir\"\n";
        std::fs::write(at("cars/a.toml"), vehicle).unwrap();
        for name in ["cars/tyres/a.tir", "b.tir", "cars/rfl.rflm", "cars/old.csv"] {
            std::fs::write(at(name), "").unwrap();
        }
        let (file, models) = (at("cars/a.toml"), at("cars"));
        let read = [("--vehicle", &*file), ("--models", &*models)];
        for (name, by) in
            [("cars/tyres/a.tir", "--vehicle"), ("cars/../b.tir", "--vehicle"), ("cars/rfl.rflm", "--models")]
        {
            let said = check_files(&[("--log", at(name))], &read).unwrap_err().to_string();
            assert!(said.contains(&format!("is read with {by}")), "{said}");
        }
        assert!(check_folder(folder.path(), &["b.tir"], &read).is_err());
        // What lies beside is another file; a tyre that is built in is none.
        assert!(check_files(&[("--log", at("cars/old.csv")), ("--json", at("cars/c.tir"))], &read).is_ok());
    }

    #[test]
    fn a_file_is_not_written_twice_nor_over_one_that_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let (road, log, deep) = (at("road.csv"), at("log.csv"), at("new/log.csv"));
        std::fs::write(&road, "x,y\n").unwrap();
        let around = folder.path().join("./road.csv");
        let refused = |written: &[Named<&Path>]| {
            check_files(written, &[("--path", &*road), ("--vehicle", Path::new("c_class"))])
                .map_err(|error| error.to_string())
                .err()
                .unwrap_or_default()
        };
        assert_eq!(refused(&[("--log", &log), ("--json", &deep)]), "");
        for file in [&road, &around] {
            let said = refused(&[("--log", file)]);
            assert!(said.contains("--log") && said.contains("the file of --path"), "{said}");
        }
        for file in [&log, &deep] {
            let said = refused(&[("--log", file), ("--json", file)]);
            assert!(said.starts_with("--log and --json are one file"), "{said}");
        }
        let of_folder = |name: &str| check_folder(folder.path(), &[name], &[("--vehicle", &*road)]);
        assert!(
            of_folder("other.csv").is_ok()
                && check_folder(&at("new"), &["road.csv"], &[("LOG", &*road)]).is_ok()
        );
        assert!(of_folder("road.csv").unwrap_err().to_string().contains("road.csv is the file of --vehicle"));
        let null = Path::new("/dev/null");
        if null.exists() {
            assert_eq!(refused(&[("--log", null), ("--json", null)]), "");
        }
        #[cfg(unix)]
        {
            let [soft, hard] = ["soft.csv", "hard.csv"].map(at);
            std::os::unix::fs::symlink(&road, &soft).unwrap();
            std::fs::hard_link(&road, &hard).unwrap();
            for file in [&soft, &hard] {
                assert!(refused(&[("--json", file)]).contains("written over"));
            }
        }
    }
}
