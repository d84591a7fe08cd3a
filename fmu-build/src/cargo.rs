//! Building libraries, and asking what is linked into them.
//!
//! A plain build needs the glibc of the machine it is made on, mostly too new for a host in the field.
//! `cargo-zigbuild` links against an old one; it is used where it is installed. zig's linker exports more than FMI's functions
//! elsewhere: Windows libraries are linked by mingw-w64, those for macOS by Rust's own lld, against zig's stub of the system
//! library (`scripts/darwin_sdk.py`).

use crate::library::Library;
use crate::linker;
use crate::standard::Standard;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A platform that libraries are built for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// Linux on x86-64, with glibc 2.17 (2012: RHEL 7 and later) where `cargo-zigbuild` builds.
    Linux64,
    /// Windows on x86-64.
    Win64,
    /// macOS: one library for x86-64 and ARM.
    Darwin64,
    /// Linux on ARM, 64 bit, with the same glibc. FMI 2.0 has no name for it: FMUs of 3.0 hold its library.
    LinuxArm,
}

impl Target {
    /// All platforms.
    pub const ALL: [Target; 4] = [Target::Linux64, Target::Win64, Target::Darwin64, Target::LinuxArm];

    /// True if a version of FMI has a name for it.
    #[must_use]
    pub fn is_in(self, standard: Standard) -> bool {
        self != Target::LinuxArm || standard == Standard::Fmi3
    }

    /// FMI's name: that of 2.0, where it has one.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Target::Linux64 => "linux64",
            Target::Win64 => "win64",
            Target::Darwin64 => "darwin64",
            Target::LinuxArm => "aarch64-linux",
        }
    }

    /// The builder's name for it.
    #[must_use]
    pub fn triple(self) -> &'static str {
        match self {
            Target::Linux64 => "x86_64-unknown-linux-gnu.2.17",
            Target::Win64 => "x86_64-pc-windows-gnu",
            Target::Darwin64 => "universal2-apple-darwin",
            Target::LinuxArm => "aarch64-unknown-linux-gnu.2.17",
        }
    }

    /// True if it is linked on another system than its own.
    fn is_foreign(self) -> bool {
        Some(self) != Target::here()
    }

    /// Rust's names of the systems that a library for it is compiled for.
    fn compiled_for(self) -> &'static [&'static str] {
        match self {
            Target::Linux64 => &["x86_64-unknown-linux-gnu"],
            Target::Win64 => &["x86_64-pc-windows-gnu"],
            Target::Darwin64 => &["x86_64-apple-darwin", "aarch64-apple-darwin"],
            Target::LinuxArm => &["aarch64-unknown-linux-gnu"],
        }
    }

    /// The platform that this program runs on, if libraries are built for it.
    #[must_use]
    pub fn here() -> Option<Self> {
        match (std::env::consts::OS, std::env::consts::ARCH) {
            ("linux", "x86_64") => Some(Target::Linux64),
            ("linux", "aarch64") => Some(Target::LinuxArm),
            ("windows", "x86_64") => Some(Target::Win64),
            ("macos", _) => Some(Target::Darwin64),
            _ => None,
        }
    }
}

/// Reason for which a library could not be built.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum CargoError {
    #[error("cannot start `{command}`: {source}")]
    Start { command: String, source: std::io::Error },
    #[error(
        "a library for {target} is built by cargo-zigbuild here, which is not installed: run scripts/setup, or leave \
         --builder cargo out"
    )]
    NoCross { target: &'static str },
    #[error(
        "a library for win64 is linked by {MINGW} here, which is not installed. On Debian or Ubuntu: sudo apt-get install \
         gcc-mingw-w64-x86-64"
    )]
    NoMingw,
    #[error("the parts for the processors cannot be joined: {0}")]
    Join(#[from] fat_macho::Error),
    #[error("cannot write {path}: {source}")]
    Write { path: PathBuf, source: std::io::Error },
    #[error("`{command}` failed; its messages stand above")]
    Failed { command: String },
    #[error(
        "a library for darwin64 is linked against zig's stub of macOS' system library here, and there is none: run scripts/setup, \
         which installs ziglang, or set SDKROOT to an SDK of macOS"
    )]
    NoSdk,
    #[error("cannot read {path}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("`{command}` made no shared library. Is the crate's crate-type \"cdylib\"?")]
    NoLibrary { command: String },
    #[error("`{command}` gave something that is no JSON: {source}")]
    Json { command: String, source: serde_json::Error },
    #[error("`{command}` lists the package {package}, which `cargo metadata` does not know")]
    UnknownPackage { command: String, package: String },
}

/// The linker of Windows libraries on other systems, of mingw-w64.
const MINGW: &str = "x86_64-w64-mingw32-gcc";

/// True if a program can be started.
fn starts(program: &str) -> bool {
    let mut command = Command::new(program);
    command.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// What is to be built.
#[derive(Clone, Copy)]
struct Build<'a> {
    project: &'a Path,
    profile: &'a str,
    selection: &'a [&'a str],
    target: Option<Target>,
    /// Of a library for several processors the system that this one is for.
    part: Option<&'static str>,
}

/// The builder in use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Builder {
    /// `cargo zigbuild`, for any [`Target`].
    Zig,
    /// `cargo build`, for this machine.
    Cargo,
    /// `cargo build` with these arguments, for this machine, beside the programs that they choose. Of a selection of their own the
    /// libraries would have other features, and other flags: all that is in them would be compiled anew.
    Beside(Vec<String>),
}

impl Builder {
    /// `cargo-zigbuild`, where it is on the path and this is Linux on x86-64.
    #[must_use]
    pub fn find() -> Self {
        let here = cfg!(all(target_os = "linux", target_arch = "x86_64"));
        if here && starts("cargo-zigbuild") { Builder::Zig } else { Builder::Cargo }
    }

    /// Builds what `selection` (e.g. `-p`, `fmu-passenger-car`, several times) names, on all processors. Each library is then
    /// there when [`build`](Self::build) asks for it: linking one keeps one processor busy.
    ///
    /// # Errors
    /// If the build fails. Compiler messages go to standard error.
    pub fn prepare(
        &self,
        project: &Path,
        profile: &str,
        selection: &[&str],
        target: Option<Target>,
    ) -> Result<(), CargoError> {
        let build = |part| self.run(Build { project, profile, selection, target, part });
        parts(target).into_iter().try_for_each(|part| build(part).map(drop))
    }

    /// Runs a build; gives cargo's messages, and the command for ours.
    fn run(&self, what: Build<'_>) -> Result<(String, String), CargoError> {
        let Build { project, profile, selection, target, part } = what;
        let mut command = cargo(project);
        match (self, target, part) {
            (_, _, Some(system)) => {
                let name = system.replace('-', "_").to_uppercase();
                command.args(["build", "--target", system]);
                command.env(format!("CARGO_TARGET_{name}_LINKER"), "rust-lld");
                if std::env::var_os("SDKROOT").is_none() {
                    command.env("SDKROOT", darwin_sdk(project)?);
                }
            }
            (_, Some(Target::Win64), _) if Target::Win64.is_foreign() => {
                if !starts(MINGW) {
                    return Err(CargoError::NoMingw);
                }
                command.args(["build", "--target", Target::Win64.triple()]);
            }
            (Builder::Zig, target, _) => {
                let triple = target.unwrap_or(Target::Linux64).triple();
                zig_caches(project, command.args(["zigbuild", "--target", triple]));
            }
            (Builder::Cargo | Builder::Beside(_), Some(target), _) if target.is_foreign() => {
                return Err(CargoError::NoCross { target: target.name() });
            }
            (Builder::Beside(programs), ..) => {
                command.arg("build").args(programs).arg("--lib");
            }
            (Builder::Cargo, ..) => {
                command.arg("build");
            }
        }
        command.args(["--profile", profile, "--message-format", "json-render-diagnostics"]);
        let folder = project.join("target");
        let unwritten = |source| CargoError::Write { path: folder.join("linker"), source };
        match self {
            Builder::Beside(_) => {
                let (linker, real) = linker::install_as_system(&folder).map_err(unwritten)?;
                command.env("PATH", before_path(linker)).env(linker::REAL, real);
            }
            Builder::Zig | Builder::Cargo => {
                command.args(selection);
                // A development build is shared with tests, whose flags must not change.
                if profile != "dev" {
                    let linker = linker::install(&folder).map_err(unwritten)?;
                    command
                        .env("PATH", before_path(linker))
                        .env(linker::REAL, self.real_linker(target, part));
                    command.env("CARGO_ENCODED_RUSTFLAGS", flags(project, target));
                }
            }
        }
        output(&mut command)
    }

    /// The linker behind ours, or the variable of the environment that names it.
    fn real_linker(&self, target: Option<Target>, part: Option<&str>) -> &'static str {
        match (self, target, part) {
            (_, _, Some(_)) => "rust-lld",
            (_, Some(Target::Win64), _) if Target::Win64.is_foreign() => MINGW,
            // cargo-zigbuild's own programs.
            (Builder::Zig, Some(Target::LinuxArm), _) => "CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER",
            (Builder::Zig, ..) => "CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_LINKER",
            _ => "cc",
        }
    }

    /// Builds the one shared library that `selection` (e.g. `-p`, `fmu-passenger-car`) names, for a platform or for this
    /// machine; gives its path.
    ///
    /// # Errors
    /// If the build fails or makes no shared library. Compiler messages go to standard error.
    pub fn build(
        &self,
        project: &Path,
        profile: &str,
        selection: &[&str],
        target: Option<Target>,
    ) -> Result<PathBuf, CargoError> {
        let build = |part| self.build_part(Build { project, profile, selection, target, part });
        let built = parts(target).into_iter().map(build).collect::<Result<Vec<_>, _>>()?;
        match &built[..] {
            [one] => Ok(one.clone()),
            several => join(project, several),
        }
    }

    fn build_part(&self, what: Build<'_>) -> Result<PathBuf, CargoError> {
        let library = self.library(what)?;
        if !matches!(self, Builder::Beside(_)) || is_divided(&library) {
            return Ok(library);
        }
        // Linked without us, by a build before. Cargo makes anew what is gone.
        for place in [library.clone(), linker::place(&library, Standard::Fmi2)] {
            std::fs::remove_file(&place).map_err(|source| CargoError::Write { path: place, source })?;
        }
        let library = self.library(what)?;
        // Another linker than the system's is set on this machine.
        if is_divided(&library) { Ok(library) } else { Builder::Cargo.library(what) }
    }

    /// The shared library that a build of `selection` makes.
    fn library(&self, what: Build<'_>) -> Result<PathBuf, CargoError> {
        let (text, command) = self.run(what)?;
        // Beside others a library is told by its package's name.
        let name = match self {
            Builder::Beside(_) => what.selection.last().map(|package| package.replace('-', "_")),
            Builder::Zig | Builder::Cargo => None,
        };
        let mut library = None;
        for line in text.lines() {
            let message: Value = serde_json::from_str(line)
                .map_err(|source| CargoError::Json { command: command.clone(), source })?;
            let kinds = message["target"]["crate_types"].as_array();
            let is_it = name.as_ref().is_none_or(|name| message["target"]["name"] == name.as_str());
            if is_it && kinds.is_some_and(|kinds| kinds.iter().any(|kind| kind == "cdylib")) {
                let files = message["filenames"].as_array().into_iter().flatten().filter_map(Value::as_str);
                let shared =
                    |file: &&str| [".so", ".dll", ".dylib"].iter().any(|suffix| file.ends_with(suffix));
                library = files.map(|file| file.to_owned()).find(|file| shared(&file.as_str())).or(library);
            }
        }
        library.map(PathBuf::from).ok_or(CargoError::NoLibrary { command })
    }
}

/// `PATH` with a folder before all others.
fn before_path(folder: PathBuf) -> OsString {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::join_paths([folder].into_iter().chain(std::env::split_paths(&path))).unwrap_or_default()
}

/// True if a library was linked for each version of FMI.
fn is_divided(library: &Path) -> bool {
    let of =
        |standard: &Standard| Library::check_for(&linker::linked_for(library, *standard), *standard).is_ok();
    Standard::ALL.iter().all(of)
}

/// The systems that a library is built for one by one, and joined; otherwise there is one build, which needs no such name.
fn parts(target: Option<Target>) -> Vec<Option<&'static str>> {
    match target {
        Some(Target::Darwin64) if Target::Darwin64.is_foreign() => {
            Target::Darwin64.compiled_for().iter().copied().map(Some).collect()
        }
        _ => vec![None],
    }
}

/// Joins libraries for several processors into one, for each version of FMI; gives it as cargo gives a library.
fn join(project: &Path, parts: &[PathBuf]) -> Result<PathBuf, CargoError> {
    let library =
        project.join("target").join(Target::Darwin64.triple()).join(parts[0].file_name().unwrap_or_default());
    for standard in Standard::ALL {
        let mut whole = fat_macho::FatWriter::new();
        for part in parts {
            let path = linker::linked_for(part, standard);
            let bytes = std::fs::read(&path).map_err(|source| CargoError::Read { path, source })?;
            whole.add(bytes)?;
        }
        let path = linker::place(&library, standard);
        let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        made.map_err(|source| CargoError::Write { path: path.clone(), source })?;
        whole.write_to_file(&path)?;
    }
    Ok(library)
}

/// A folder with what libraries for macOS are linked against.
fn darwin_sdk(project: &Path) -> Result<PathBuf, CargoError> {
    let folder = project.join("target").join("darwin-sdk");
    let mut command = Command::new("python3");
    command.current_dir(project).arg("scripts/darwin_sdk.py").arg(&folder).stdout(Stdio::null());
    match command.status() {
        Ok(status) if status.success() => Ok(folder),
        _ => Err(CargoError::NoSdk),
    }
}

/// Keeps what `cargo-zigbuild` and zig store in the checkout's `target/zig`, where the user says nothing else.
///
/// By itself `cargo-zigbuild` 0.24 puts links to its own program into the user's cache folder. One that points into a
/// checkout since deleted stops every build of any other: "File exists (os error 17)".
fn zig_caches(project: &Path, command: &mut Command) {
    let zig = project.join("target").join("zig");
    let links = zig.join("links");
    // A checkout that was moved has such links too.
    remove_dangling_links(&links);
    for (variable, folder) in [("CARGO_ZIGBUILD_CACHE_DIR", links), ("ZIG_GLOBAL_CACHE_DIR", zig)] {
        if std::env::var_os(variable).is_none() {
            command.env(variable, folder);
        }
    }
}

/// Removes links to nothing from a folder and from those below it.
fn remove_dangling_links(folder: &Path) {
    for path in std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
        if path.is_symlink() && !path.exists() {
            // Failing here is no worse than leaving it: the build then says so.
            std::fs::remove_file(&path).ok();
        } else if path.is_dir() && !path.is_symlink() {
            remove_dangling_links(&path);
        }
    }
}

/// The user's compiler flags, and those that take this machine's folders and its clock out of the library: the same
/// sources give the same library anywhere.
fn flags(project: &Path, target: Option<Target>) -> OsString {
    let separator = "\u{1f}";
    let mut flags = std::env::var_os("CARGO_ENCODED_RUSTFLAGS").unwrap_or_else(|| {
        let plain = std::env::var("RUSTFLAGS").unwrap_or_default();
        plain.split_whitespace().collect::<Vec<_>>().join(separator).into()
    });
    let home = std::env::var_os("CARGO_HOME")
        .map(PathBuf::from)
        .or_else(|| Some(std::env::home_dir()?.join(".cargo")));
    let sources = home.map(|home| (home.join("registry").join("src"), "crates"));
    for (folder, name) in sources.into_iter().chain([(project.to_owned(), "rfl-mpc")]) {
        if !flags.is_empty() {
            flags.push(separator);
        }
        flags.push("--remap-path-prefix=");
        flags.push(folder);
        flags.push(format!("={name}"));
    }
    // By its name alone: where it lies is this machine's matter, and must not be seen in the library.
    flags.push(format!("{separator}-Clinker={}", linker::NAME));
    let more = match target {
        Some(Target::Win64) => "-Clink-arg=-Wl,--no-insert-timestamp",
        // The name by which others would link it, otherwise its place on this machine. Hosts load it by its path.
        Some(Target::Darwin64) if Target::Darwin64.is_foreign() => {
            "-Clinker-flavor=ld64.lld\u{1f}-Clink-arg=-install_name\u{1f}-Clink-arg=@rpath/fmu.dylib"
        }
        Some(Target::Darwin64) => "-Clink-arg=-Wl,-install_name,@rpath/fmu.dylib",
        _ => return flags,
    };
    flags.push(separator);
    flags.push(more);
    flags
}

/// A crate that is linked into a library.
#[derive(Debug, Clone, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct Dependency {
    pub name: String,
    pub version: String,
    /// SPDX expression, as the crate states it.
    pub license: String,
    pub repository: String,
    /// Licence files in the crate's folder.
    pub files: Vec<PathBuf>,
}

/// The third-party crates that are linked into a package of the workspace for these platforms (none: this machine), by
/// name and version.
///
/// # Errors
/// If cargo cannot tell.
pub fn dependencies(
    project: &Path,
    package: &str,
    targets: &[Target],
) -> Result<Vec<Dependency>, CargoError> {
    let mut tree = cargo(project);
    tree.args(["tree", "--locked", "-e", "normal,no-proc-macro", "--prefix", "none", "--no-dedupe"]);
    for system in targets.iter().flat_map(|target| target.compiled_for()) {
        tree.args(["--target", system]);
    }
    let (text, command) = output(tree.args(["-f", "{p}", "-p", package]))?;
    let mut metadata = cargo(project);
    let (json, _) = output(metadata.args(["metadata", "--locked", "--format-version", "1"]))?;
    let json: Value = serde_json::from_str(&json)
        .map_err(|source| CargoError::Json { command: command.clone(), source })?;
    let packages = json["packages"].as_array().map(Vec::as_slice).unwrap_or_default();
    let mut found = BTreeMap::new();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let (Some(name), Some(version)) = (words.next(), words.next()) else { continue };
        let version = version.trim_start_matches('v');
        let known = packages.iter().find(|package| package["name"] == name && package["version"] == version);
        let known = known.ok_or_else(|| CargoError::UnknownPackage {
            command: command.clone(),
            package: format!("{name} {version}"),
        })?;
        // The workspace's own crates have no source.
        if known["source"].is_null() {
            continue;
        }
        let text = |key: &str| known[key].as_str().unwrap_or_default().to_owned();
        let folder = PathBuf::from(text("manifest_path")).parent().map(Path::to_path_buf).unwrap_or_default();
        let dependency = Dependency {
            name: name.to_owned(),
            version: version.to_owned(),
            license: text("license"),
            repository: text("repository"),
            files: license_files(&folder),
        };
        found.insert((name.to_owned(), version.to_owned()), dependency);
    }
    Ok(std::iter::once(standard_library()).chain(found.into_values()).collect())
}

/// Rust's standard library, which every library of ours holds: with the texts that the toolchain brings. Where the toolchain brings
/// none, the entry says whose work it is.
fn standard_library() -> Dependency {
    let rustc = |arguments: &[&str]| {
        let command = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let told = Command::new(command).args(arguments).output().ok().filter(|told| told.status.success());
        told.map(|told| String::from_utf8_lossy(&told.stdout).trim().to_owned()).unwrap_or_default()
    };
    let folder = Path::new(&rustc(&["--print", "sysroot"])).join("share/doc/rust");
    let texts = [
        "COPYRIGHT-library.html",
        "licenses/MIT.txt",
        "licenses/Apache-2.0.txt",
        "licenses/LLVM-exception.txt",
    ];
    Dependency {
        name: "std".to_owned(),
        version: rustc(&["--version"]).split(' ').nth(1).unwrap_or("unknown").to_owned(),
        license: "MIT OR Apache-2.0; its unwinder, where it is linked in (LLVM's libunwind): Apache-2.0 WITH LLVM-exception"
            .to_owned(),
        repository: "https://github.com/rust-lang/rust".to_owned(),
        files: texts.map(|text| folder.join(text)).into_iter().filter(|file| file.is_file()).collect(),
    }
}

/// Files of a crate that state its licence, sorted.
fn license_files(folder: &Path) -> Vec<PathBuf> {
    let is_license = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_ascii_uppercase();
        path.is_file()
            && ["LICENSE", "LICENCE", "COPYING", "NOTICE"].iter().any(|word| name.starts_with(word))
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_license).collect();
    files.sort();
    files
}

/// The project's folder: the workspace around the working directory.
///
/// # Errors
/// If there is none.
pub fn project() -> Result<PathBuf, CargoError> {
    let mut command = cargo(Path::new("."));
    let (text, _) = output(command.args(["locate-project", "--workspace", "--message-format", "plain"]))?;
    Ok(Path::new(text.trim()).parent().map(Path::to_path_buf).unwrap_or_default())
}

fn cargo(project: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(project);
    command
}

/// Runs a command; gives what it wrote to standard output, and the command for messages.
fn output(command: &mut Command) -> Result<(String, String), CargoError> {
    let words: Vec<_> = command.get_args().map(|word| word.to_string_lossy().into_owned()).collect();
    let shown = format!("cargo {}", words.join(" "));
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .map_err(|source| CargoError::Start { command: shown.clone(), source })?;
    if !output.status.success() {
        return Err(CargoError::Failed { command: shown });
    }
    Ok((String::from_utf8_lossy(&output.stdout).into_owned(), shown))
}
