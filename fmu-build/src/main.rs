//! The program `fmu-build`; see `fmu-build --help`.

use clap::{Parser, ValueEnum};
use fmu_build::added;
use fmu_build::cargo::{Builder, Dependency, Target, dependencies};
use fmu_build::description::describe_in;
use fmu_build::documentation::license_texts;
use fmu_build::fmu::{Base, Fmu, FmuError};
use fmu_build::linker;
use fmu_build::package::Package;
use fmu_build::packing::{Made, Options, Packing, standard_of};
use fmu_build::shipped;
use fmu_build::standard::Standard;
use fmu_build::system::System;
use fmu_build::traceability;
use rfl_mpc::output::write_bytes;
use std::collections::BTreeSet;
use std::error::Error;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Makes the FMUs (FMI 2.0 and 3.0, co-simulation) and the SSP systems that connect them.
///
/// Without options, everything is built into target/fmu/, what is of FMI 3.0 into fmi3/ in it. Where cargo-zigbuild is installed, the libraries run on
/// glibc 2.17 and later; otherwise they need this machine's, and the report says which.
///
/// FMUs given by their files are not built: their resources and start values are changed, which takes a second and no
/// compiler, and the result is written to out/fmu/.
#[derive(Debug, Parser)]
#[command(version, after_help = EXAMPLES)]
struct Arguments {
    /// Change these FMUs, made by this version, instead of building
    #[arg(value_name = "FMU", conflicts_with_all = ["only", "builder", "profile", "beside", "target", "describe"])]
    fmus: Vec<PathBuf>,
    /// Write FMUs and systems here
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Make only this FMU (may be repeated); a system is made when all its FMUs are there
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Build the libraries for these platforms, not for this machine's alone. win64 needs mingw-w64 and `rustup target add
    /// x86_64-pc-windows-gnu`, darwin64 the targets x86_64-apple-darwin and aarch64-apple-darwin, and ziglang (scripts/setup),
    /// aarch64-linux the target aarch64-unknown-linux-gnu
    #[arg(long, value_enum, value_delimiter = ',', value_name = "PLATFORM")]
    target: Vec<TargetChoice>,
    /// How the libraries are built
    #[arg(long, value_enum, default_value_t = BuilderChoice::Auto)]
    builder: BuilderChoice,
    /// Cargo's profile
    #[arg(long, default_value = "shipped")]
    profile: String,
    /// Build the libraries for this machine beside the programs that these arguments of `cargo build` choose: nothing is compiled twice.
    /// For a first try, and for tests
    #[arg(long, value_name = "ARGUMENTS", allow_hyphen_values = true, conflicts_with_all = ["builder", "target"])]
    beside: Option<String>,
    /// Add libraries of other platforms: DIR/win64/NAME.dll, DIR/darwin64/NAME.dylib, for FMI 3.0 DIR/x86_64-windows/NAME.dll, ...
    #[arg(long, value_name = "DIR")]
    binaries: Option<PathBuf>,
    /// Add libraries of other platforms out of an FMU of the same name (may be repeated)
    #[arg(long, value_name = "FMU")]
    merge: Vec<PathBuf>,
    /// Pack learned models into the controller that they are for (RflMpc.fmu, TruckRflMpc.fmu), which then drives with
    /// the first (host's parameter variant: with another)
    #[arg(long, value_name = "FILE", num_args = 1..)]
    residual: Vec<PathBuf>,
    /// The vehicle that the car's or the truck's FMUs are for: a built-in name or a vehicle file (TOML), packed with its
    /// tyres (may be repeated)
    #[arg(long, value_name = "VEHICLE")]
    vehicle: Vec<String>,
    /// Controller file (from rfl tune): its numbers become start values of the controller that it is for; --start counts
    /// more
    #[arg(long, value_name = "FILE")]
    controller: Option<PathBuf>,
    /// Give a parameter of an FMU another start value (may be repeated). A file that it names is packed
    #[arg(long, value_name = "FMU.PARAMETER=VALUE")]
    start: Vec<String>,
    /// Set a parameter in a system (may be repeated). A file that it names is packed into the FMU, as by --start
    #[arg(long, value_name = "COMPONENT.PARAMETER=VALUE")]
    set: Vec<String>,
    /// Only write the licences of what is linked into a package of the workspace, and a list of it (crates.json), to --out
    #[arg(long, value_name = "PACKAGE", requires = "out", conflicts_with_all = ["fmus", "describe"])]
    licenses: Option<String>,
    /// Only write modelDescription/*.xml and modelDescription/fmi3/*.xml from the declarations
    #[arg(long)]
    describe: bool,
}

const EXAMPLES: &str = "Examples:
  fmu-build                                   all FMUs and systems, into target/fmu/
  fmu-build --only PassengerCar --out /tmp    one FMU
  fmu-build target/fmu/RflMpc.fmu --residual rfl_s.rflm   a learned model into an FMU that is there: no compiler
  fmu-build *.fmu --vehicle my_car.toml --out mine/   your car into FMUs that are there
  fmu-build --target linux64,win64,darwin64   libraries of all platforms
  fmu-build --binaries from-ci/               with win64 and darwin64 libraries built elsewhere
  fmu-build --residual out/residual/rfl_s.rflm   a controller that drives with what `rfl train` learned
  fmu-build --residual out/residual/*.rflm    with all that it learned, to choose by the parameter variant
  fmu-build --vehicle my_car.toml --residual out/residual/rfl_s.rflm     the same for a car of yours
  fmu-build --vehicle my_car.toml --controller out/tune/controller.toml   with what `rfl tune` found
  fmu-build --residual fast.rflm --start RflMpc.mpc.sample_time=0.01     a model of another controller
  fmu-build --set RflMpc.path_file=road.csv   a system with a parameter set
  fmu-build --describe                        after a change of variables: the descriptions, to be committed";

#[derive(Debug, Clone, Copy, ValueEnum)]
enum BuilderChoice {
    /// cargo-zigbuild where it is installed, else cargo
    Auto,
    /// cargo-zigbuild: runs on glibc 2.17 and later
    Zig,
    /// cargo: needs this machine's glibc
    Cargo,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum TargetChoice {
    /// Linux on x86-64
    Linux64,
    /// Windows on x86-64
    Win64,
    /// macOS on x86-64 and ARM
    Darwin64,
    /// Linux on ARM, 64 bit: in FMUs of FMI 3.0 only
    #[value(name = "aarch64-linux")]
    LinuxArm,
}

impl From<TargetChoice> for Target {
    fn from(choice: TargetChoice) -> Self {
        match choice {
            TargetChoice::Linux64 => Target::Linux64,
            TargetChoice::Win64 => Target::Win64,
            TargetChoice::Darwin64 => Target::Darwin64,
            TargetChoice::LinuxArm => Target::LinuxArm,
        }
    }
}

/// Prints a line. A reader that has read enough (`fmu-build ... | head -1`) does not end the work.
macro_rules! say {
    ($($words:tt)*) => { line(format_args!($($words)*)) };
}

fn line(words: std::fmt::Arguments) {
    if let Err(error) = writeln!(std::io::stdout(), "{words}")
        && error.kind() != ErrorKind::BrokenPipe
    {
        let _ = writeln!(std::io::stderr(), "fmu-build: standard output: {error}");
        std::process::exit(1);
    }
}

fn main() -> ExitCode {
    if linker::is_called() {
        return linker::run();
    }
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "fmu-build: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    if arguments.fmus.is_empty() { build(arguments) } else { change(arguments) }
}

/// Makes FMUs from source.
fn build(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let project = fmu_build::cargo::project()?;
    let mut all = shipped::fmus();
    if arguments.describe {
        return write_descriptions(&project, &all);
    }
    if let (Some(package), Some(out)) = (&arguments.licenses, &arguments.out) {
        let targets: Vec<_> = arguments.target.iter().copied().map(Target::from).collect();
        return write_licenses(&project, package, &targets, out);
    }
    let options = Options {
        builder: match (&arguments.beside, arguments.builder) {
            (Some(programs), _) => Builder::Beside(programs.split_whitespace().map(str::to_owned).collect()),
            (None, BuilderChoice::Auto) => Builder::find(),
            (None, BuilderChoice::Zig) => Builder::Zig,
            (None, BuilderChoice::Cargo) => Builder::Cargo,
        },
        profile: arguments.profile.clone(),
        targets: arguments
            .target
            .iter()
            .copied()
            .map(Target::from)
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect(),
        packing: packing(arguments, project.join("target/fmu")),
        project,
    };
    match options.builder {
        Builder::Zig if options.targets.is_empty() => {
            say!("libraries are built by cargo-zigbuild for {}", Target::Linux64.triple());
        }
        Builder::Zig => say!("libraries are built by cargo-zigbuild"),
        Builder::Cargo | Builder::Beside(_) => {
            say!("libraries are built by cargo, and need this machine's glibc or a newer one");
        }
    }
    // What the user gives is checked first: a build takes minutes.
    let has_platform = |standard: &Standard| {
        options.platforms().any(|target| target.is_none_or(|target| target.is_in(*standard)))
    };
    let standards: Vec<_> = Standard::ALL.into_iter().filter(has_platform).collect();
    let settings = add(&mut all, &options.project, &standards, arguments)?;
    let systems = shipped::systems(&all, &options.project, &settings)?;
    let chosen = choose(&all, &arguments.only)?;
    if chosen.len() > 1 {
        say!("building {} libraries", chosen.len());
        let selection: Vec<&str> = chosen.iter().flat_map(|fmu| &fmu.selection).copied().collect();
        for target in options.platforms() {
            options.builder.prepare(&options.project, &options.profile, &selection, target)?;
        }
    }
    for (i, fmu) in chosen.iter().enumerate() {
        for standard in &standards {
            let title =
                format!("[{}/{}] {} {}", i + 1, chosen.len(), fmu.declaration.name, standard.number());
            let options = Options { packing: options.packing.for_standard(*standard), ..options.clone() };
            report(&title, || fmu.make(&options, |step| say!("{title}: {step}")))?;
        }
    }
    for system in &systems {
        Standard::ALL
            .iter()
            .try_for_each(|standard| connect(system, &options.packing.for_standard(*standard)))?;
    }
    Ok(())
}

/// Makes FMUs out of others: other resources and start values, the same libraries.
fn change(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let all = shipped::fmus();
    let mut given: Vec<Fmu> = Vec::new();
    for file in &arguments.fmus {
        let fmu = Base::read(file, &all)?;
        let name = fmu.declaration.name;
        let standard = |fmu: &Fmu| fmu.base.as_ref().map(|base| base.standard);
        if let Some(one) = given.first()
            && standard(one) != standard(&fmu)
        {
            let found = standard(&fmu).unwrap_or_default().number();
            return Err(FmuError::Mixed { path: file.clone(), found }.into());
        }
        if given.iter().any(|one| one.declaration.name == name) {
            return Err(format!("{name} is given twice, the second time as {}", file.display()).into());
        }
        given.push(fmu);
    }
    let nowhere = Path::new("");
    let packing = packing(arguments, PathBuf::from("out/fmu"));
    let standard =
        given.first().and_then(|fmu| fmu.base.as_ref()).map_or(Standard::default(), |base| base.standard);
    let settings = add(&mut given, nowhere, &[standard], arguments)?;
    let systems = shipped::systems(&given, nowhere, &settings)?;
    for fmu in &given {
        if let Some(base) = &fmu.base {
            report(fmu.declaration.name, || fmu.change(base, &packing.for_standard(base.standard)))?;
        }
    }
    systems.iter().try_for_each(|system| connect(system, &packing.for_standard(standard)))
}

fn packing(arguments: &Arguments, out: PathBuf) -> Packing {
    Packing {
        out: arguments.out.clone().unwrap_or(out),
        binaries: arguments.binaries.clone(),
        merge: arguments.merge.clone(),
        standard: Standard::default(),
    }
}

/// Adds what the user gives to the FMUs that it is for. What none of them takes is an error. Gives the settings that systems
/// are made with.
fn add(
    fmus: &mut [Fmu],
    project: &Path,
    standards: &[Standard],
    arguments: &Arguments,
) -> Result<Vec<String>, Box<dyn Error>> {
    for vehicle in &arguments.vehicle {
        added::add_vehicle(fmus, vehicle)?;
    }
    let names: Vec<_> = fmus.iter().map(|fmu| fmu.declaration.name).collect();
    let is_named = |file: &&PathBuf| {
        names.iter().any(|name| file.file_name().is_some_and(|it| *it == *format!("{name}.fmu")))
    };
    if let Some(file) = arguments.merge.iter().find(|file| !is_named(file)) {
        return Err(format!(
            "{} is none of the FMUs that are made: {}.fmu",
            file.display(),
            names.join(".fmu, ")
        )
        .into());
    }
    for file in &arguments.merge {
        if let Some(found) = standard_of(file)?.filter(|found| !standards.contains(found)) {
            let made: Vec<_> = standards.iter().map(|standard| standard.number()).collect();
            let (file, found, made) = (file.display(), found.number(), made.join(", "));
            return Err(format!(
                "{file} is of FMI {found}, and FMUs of FMI {made} are made: merge one of these"
            )
            .into());
        }
    }
    arguments.controller.iter().try_for_each(|file| added::add_controller(fmus, file))?;
    arguments.start.iter().try_for_each(|text| added::add_start(fmus, text))?;
    let settings = added::add_settings(fmus, &arguments.set)?;
    for (controller, kind) in added::add_models(fmus, project, &arguments.residual)? {
        say!("{controller} is packed with a learned model of kind {}", kind.name());
    }
    added::try_added(fmus, project)?;
    Ok(settings)
}

fn write_descriptions(project: &Path, all: &[Fmu]) -> Result<(), Box<dyn Error>> {
    for fmu in all {
        for standard in Standard::ALL {
            let file = fmu.description_in(standard);
            let path = project.join(&file);
            let xml = describe_in(standard, &fmu.declaration);
            let same = std::fs::read_to_string(&path).is_ok_and(|old| old == xml);
            if !same {
                write_bytes(&path, xml)?;
            }
            say!("{} {}", if same { "unchanged" } else { "written  " }, file.display());
        }
    }
    Ok(())
}

fn write_licenses(
    project: &Path,
    package: &str,
    targets: &[Target],
    out: &Path,
) -> Result<(), Box<dyn Error>> {
    let linked = dependencies(project, package, targets)?;
    for (name, text) in license_texts(&project.join("LICENSE"), &linked)? {
        write_bytes(&out.join(name), text)?;
    }
    let crates: Vec<_> = linked
        .iter()
        .map(|Dependency { name, version, license, repository, .. }| {
            serde_json::json!({ "name": name, "version": version, "license": license, "repository": repository })
        })
        .collect();
    write_bytes(&out.join("crates.json"), serde_json::to_string_pretty(&crates)? + "\n")?;
    Ok(())
}

fn choose<'a>(all: &'a [Fmu], only: &[String]) -> Result<Vec<&'a Fmu>, String> {
    let names: Vec<_> = all.iter().map(|fmu| fmu.declaration.name).collect();
    if let Some(unknown) = only.iter().find(|name| !names.contains(&name.as_str())) {
        return Err(format!("there is no FMU {unknown}; there are {}", names.join(", ")));
    }
    let wanted = |fmu: &&Fmu| only.is_empty() || only.iter().any(|name| name == fmu.declaration.name);
    Ok(all.iter().filter(wanted).collect())
}

/// Makes an FMU and says what came of it.
fn report(title: &str, make: impl FnOnce() -> Result<Made, FmuError>) -> Result<(), Box<dyn Error>> {
    let begin = Instant::now();
    let made = make()?;
    let seconds = begin.elapsed().as_secs_f64();
    say!("{title}: {} ({} kB, {seconds:.1} s)", made.path.display(), made.size / 1000);
    for library in &made.libraries {
        say!("{title}: {} {}", library.platform, library.requirements());
    }
    for merged in &made.merged {
        say!("{title}: with {merged}, built elsewhere");
    }
    Ok(())
}

/// Packs the system of a version out of the FMUs that lie in its output folder.
fn connect(system: &System, packing: &Packing) -> Result<(), Box<dyn Error>> {
    let Packing { out, standard, .. } = packing;
    let path = |name: &str| out.join(format!("{name}.fmu"));
    let all: Vec<_> = system.components().map(|component| component.name).collect();
    let missing: Vec<_> = all.iter().copied().filter(|name| !path(name).is_file()).collect();
    if !missing.is_empty() {
        say!("{}.ssp is not made: {} not in {}", system.name(), missing.join(", "), out.display());
        return Ok(());
    }
    let mut package = Package::default();
    package.add("SystemStructure.ssd", system.structure(*standard))?;
    if let Some(parameters) = system.parameters(*standard) {
        package.add(format!("resources/{}.ssv", system.name()), parameters)?;
    }
    for name in all {
        package.add_file(format!("resources/{name}.fmu"), &path(name))?;
    }
    traceability::add_to_system(&mut package, *standard, system.name())?;
    let ssp = out.join(format!("{}.ssp", system.name()));
    let size = package.write(&ssp)?;
    say!("{} ({} kB, {} connections)", ssp.display(), size / 1000, system.connections().len());
    Ok(())
}
