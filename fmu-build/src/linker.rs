//! One compiled library, linked for each version of FMI.
//!
//! An FMU's library holds one model behind the functions of FMI 2.0 and of 3.0. Nearly all of its build is the optimisation of
//! the whole; a library for each version would cost that twice. But an FMU of 2.0 must export `fmi2*` and nothing else, one of
//! 3.0 `fmi3*`. So this program stands between rustc and the linker: it runs the linker once for each version, with that
//! version's part of the list of exports that rustc made. What the version does not need, the linker leaves out.
//!
//! The result for 2.0 is what rustc asked for; that for 3.0 lies beside it, as `NAME.fmi3.SUFFIX`.

use crate::standard::Standard;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// The name by which rustc starts this program as its linker.
pub const NAME: &str = "rfl-fmu-linker";

/// The name by which rustc starts the system's linker.
const SYSTEM: &str = "cc";

/// The variable of the environment with the real linker, or the name of the variable that has it.
pub const REAL: &str = "RFL_FMU_LINKER";

/// Puts this program under its name as a linker into a folder, which it gives.
///
/// # Errors
/// If the folder cannot be written.
pub fn install(target: &Path) -> std::io::Result<PathBuf> {
    install_under(NAME, target.join("linker"))
}

/// Puts this program under the name of the system's linker into a folder, which it gives, with the place of the system's own. By its
/// name it is no other linker to cargo, which would build all anew.
///
/// # Errors
/// If the folder cannot be written.
pub fn install_as_system(target: &Path) -> std::io::Result<(PathBuf, PathBuf)> {
    let folder = install_under(SYSTEM, target.join("linker").join("system"))?;
    let path = std::env::var_os("PATH").unwrap_or_default();
    let places = std::env::split_paths(&path).filter(|place| *place != folder);
    let real = places.map(|place| place.join(SYSTEM)).find(|place| place.is_file());
    Ok((folder, real.unwrap_or_else(|| SYSTEM.into())))
}

fn install_under(name: &str, folder: PathBuf) -> std::io::Result<PathBuf> {
    let place = folder.join(name).with_extension(std::env::consts::EXE_EXTENSION);
    std::fs::create_dir_all(&folder)?;
    let own = std::env::current_exe()?;
    // Anew each time: it may be that of a program since deleted. Moved into place, for another build may start it just now.
    let new = folder.join(format!("{name}.{}", std::process::id()));
    #[cfg(unix)]
    std::os::unix::fs::symlink(own, &new)?;
    #[cfg(not(unix))]
    std::fs::copy(own, &new)?;
    std::fs::rename(new, place)?;
    Ok(folder)
}

/// True if this program was started as a linker.
#[must_use]
pub fn is_called() -> bool {
    let own = std::env::args_os().next().unwrap_or_default();
    Path::new(&own).file_stem().is_some_and(|stem| stem == NAME || stem == SYSTEM)
}

/// Links what rustc asks for, and the library of 3.0 beside it.
#[must_use]
pub fn run() -> ExitCode {
    match link(std::env::args_os().skip(1).collect()) {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            eprintln!("{NAME}: {error}");
            ExitCode::FAILURE
        }
    }
}

fn link(arguments: Vec<OsString>) -> std::io::Result<u8> {
    let here = std::env::current_dir()?;
    let arguments: Vec<_> = arguments.into_iter().map(|argument| from_here(argument, &here)).collect();
    let real = std::env::var_os(REAL).unwrap_or_else(|| "cc".into());
    let real = real.to_str().and_then(std::env::var_os).unwrap_or(real);
    let run = |arguments: &[OsString]| -> std::io::Result<u8> {
        let status = Command::new(&real).args(arguments).status()?;
        Ok(status.code().map_or(1, |code| u8::try_from(code).unwrap_or(1)))
    };
    let place = arguments.iter().position(|argument| list_in(argument).is_some());
    let output = arguments.iter().position(|argument| argument == "-o").map(|flag| flag + 1);
    let (Some(place), Some(output)) = (place, output.filter(|at| *at < arguments.len())) else {
        return run(&arguments);
    };
    let (before, list) = list_in(&arguments[place]).unwrap_or_default();
    let exports = std::fs::read_to_string(&list)?;
    for standard in Standard::ALL {
        let own = list.with_file_name(with_version(&list, standard));
        std::fs::write(&own, exports_of(&exports, standard))?;
        let mut arguments = arguments.clone();
        arguments[place] = format!("{before}{}", own.display()).into();
        let library = linked_as(Path::new(&arguments[output]), standard);
        arguments.extend(strip(&library, &arguments[0]));
        arguments[output] = library.into();
        let code = run(&arguments)?;
        if code != 0 {
            return Ok(code);
        }
    }
    Ok(0)
}

/// A file below this folder by its relative path. The linker for Windows sorts imports by the paths of the files that ask for
/// them, and where the project lies is not to be seen in a library.
fn from_here(argument: OsString, here: &Path) -> OsString {
    match Path::new(&argument).strip_prefix(here) {
        Ok(relative) if !relative.as_os_str().is_empty() => relative.into(),
        _ => argument,
    }
}

/// What takes this machine's folders and local symbols out of a library for macOS. rustc does it after the linker, to the library
/// that it knows; by then the linker has taken the library's UUID from the whole, folders and all. For other systems rustc
/// tells the linker itself.
fn strip(library: &Path, first: &OsString) -> Vec<OsString> {
    if library.extension().is_none_or(|suffix| suffix != "dylib") {
        return Vec::new();
    }
    // The linker itself, or a compiler before it.
    let before = if first == "-flavor" { "" } else { "-Wl," };
    ["-S", "-x"].map(|option| format!("{before}{option}").into()).into()
}

/// The list of exports that an argument names, if it has functions of several versions: what stands before its path, and the
/// path.
fn list_in(argument: &OsString) -> Option<(String, PathBuf)> {
    let text = argument.to_str()?;
    let at = text.rfind(['=', ',']).map_or(0, |at| at + 1);
    let path = Path::new(&text[at..]);
    // rustc's names for it, on any system.
    if !path.file_name().is_some_and(|name| name == "list" || name == "list.def") {
        return None;
    }
    let exports = std::fs::read_to_string(path).ok()?;
    let all = Standard::ALL.iter().all(|standard| exports.contains(prefix(*standard)));
    all.then(|| (text[..at].to_owned(), path.to_owned()))
}

/// What stands in the place of a function of Windows (`rfl_mpc::fmi::no_random_seed`), and is for the library alone.
const OWN: &str = "ProcessPrng";

/// A list of exports without the functions of other versions: rustc writes one on a line, for each kind of linker.
fn exports_of(exports: &str, standard: Standard) -> String {
    let mut others: Vec<_> =
        Standard::ALL.into_iter().filter(|other| *other != standard).map(prefix).collect();
    others.push(OWN);
    let lines = exports.lines().filter(|line| !others.iter().any(|other| line.contains(other)));
    lines.fold(String::new(), |list, line| list + line + "\n")
}

fn prefix(standard: Standard) -> &'static str {
    match standard {
        Standard::Fmi2 => "fmi2",
        Standard::Fmi3 => "fmi3",
    }
}

/// The library of a version, for the one that cargo gives. Without it, the one that cargo gives: what is wrong with that is found
/// when it is checked.
#[must_use]
pub fn linked_for(library: &Path, standard: Standard) -> PathBuf {
    let written = place(library, standard);
    if written.is_file() { written } else { library.to_owned() }
}

/// Where the library of a version lies: cargo puts what is asked for a folder above what rustc wrote.
#[must_use]
pub fn place(library: &Path, standard: Standard) -> PathBuf {
    let name = linked_as(library, standard);
    library.with_file_name("deps").join(name.file_name().unwrap_or_default())
}

fn linked_as(output: &Path, standard: Standard) -> PathBuf {
    match standard {
        Standard::Fmi2 => output.to_owned(),
        Standard::Fmi3 => output.with_file_name(with_version(output, standard)),
    }
}

fn with_version(path: &Path, standard: Standard) -> String {
    let (stem, suffix) = (path.file_stem().unwrap_or_default(), path.extension().unwrap_or_default());
    let name = format!("{}.{}", stem.to_string_lossy(), prefix(standard));
    if suffix.is_empty() { name } else { format!("{name}.{}", suffix.to_string_lossy()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_version_gets_its_functions_in_the_words_of_any_linker() {
        for (list, wanted) in [
            ("{\n  global:\n    fmi2DoStep;\n    fmi3DoStep;\n\n  local:\n    *;\n};\n", "    fmi3DoStep;"),
            ("EXPORTS\n    fmi2DoStep\n    fmi3DoStep\n", "    fmi3DoStep"),
            ("_fmi2DoStep\n_fmi3DoStep\n", "_fmi3DoStep"),
        ] {
            let own = exports_of(list, Standard::Fmi3);
            assert!(own.lines().any(|line| line == wanted) && !own.contains("fmi2"), "{own}");
            assert!(!exports_of(list, Standard::Fmi2).contains("fmi3"));
            assert_eq!(own.lines().count() + 1, list.lines().count());
        }
    }

    #[test]
    fn a_list_of_exports_is_found_where_each_linker_has_it() {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("list");
        std::fs::write(&list, "fmi2DoStep\nfmi3DoStep\n").unwrap();
        for before in ["-Wl,--version-script=", "", "-Wl,-exported_symbols_list,"] {
            let argument = format!("{before}{}", list.display()).into();
            assert_eq!(list_in(&argument), Some((before.to_owned(), list.clone())));
        }
        std::fs::write(&list, "fmi2DoStep\n").unwrap();
        assert_eq!(list_in(&list.clone().into()), None, "of one version only: linked as it is");
        assert_eq!(list_in(&"-lm".into()), None);
    }

    #[test]
    fn folders_of_a_library_for_macos_are_taken_out_by_the_linker() {
        let (mac, linux) = (Path::new("libfmu.fmi3.dylib"), Path::new("libfmu.fmi3.so"));
        assert_eq!(strip(mac, &"-flavor".into()), ["-S", "-x"]);
        assert_eq!(strip(Path::new("libfmu.dylib"), &"-arch".into()), ["-Wl,-S", "-Wl,-x"]);
        assert!(strip(linux, &"-m64".into()).is_empty());
    }

    #[test]
    fn files_of_the_project_are_named_without_its_folder() {
        let here = Path::new("/home/me/rfl");
        for (given, wanted) in [
            ("/home/me/rfl/target/deps/a.rlib", "target/deps/a.rlib"),
            ("/usr/lib/libm.a", "/usr/lib/libm.a"),
            ("/home/me/rfl", "/home/me/rfl"),
            ("-Wl,--version-script=/home/me/rfl/list", "-Wl,--version-script=/home/me/rfl/list"),
        ] {
            assert_eq!(from_here(given.into(), here), wanted);
        }
    }

    #[test]
    fn libraries_lie_beside_each_other() {
        let path = Path::new("deps/libfmu.so");
        assert_eq!(linked_as(path, Standard::Fmi2), path);
        assert_eq!(linked_as(path, Standard::Fmi3), Path::new("deps/libfmu.fmi3.so"));
    }
}
