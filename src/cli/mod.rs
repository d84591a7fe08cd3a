//! The commands of `rfl`, a file or a folder each.
//!
//! A command is its arguments and a `run`. Any error is one line on standard error with the fault, its place and
//! advice. Exit status: 0 done, 1 bad input or a failure, 2 wrong usage; a drive's outcome and a diagnosis' verdict
//! have numbers of their own.

/// Prints a line; exits quietly when the pipe is closed (`rfl diagnose drive.csv | head -1`).
macro_rules! say {
    ($($words:tt)*) => { $crate::cli::line(format_args!($($words)*)) };
}

/// Prints a line on standard error; a closed pipe is ignored.
macro_rules! warn {
    ($($words:tt)*) => { $crate::cli::warning(format_args!($($words)*)) };
}

pub mod collect;
pub mod completions;
pub mod course;
pub mod diagnose;
pub mod drive;
pub mod evaluate;
mod files;
pub mod fleet;
pub mod identify;
pub mod learn;
mod listen;
mod logs;
mod output;
pub mod parameters;
pub mod path;
mod progress;
mod require;
mod results_file;
mod results_table;
pub mod train;
mod train_gp;
pub mod tune;
mod vehicle;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
pub use listen::{Listener, heard};
pub use logs::ReadsLogs;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use progress::progress_bar;
use std::error::Error;
use std::ffi::OsString;

/// Path-tracking MPC for cars and trucks, its vehicles and its roads, natively and without an FMI host.
#[derive(Debug, Parser)]
#[command(
    name = "rfl",
    version,
    after_help = "Examples:
  rfl path road.csv           check a road before driving it
  rfl drive --path road.csv   drive it
  rfl collect                 drive to learn from
  rfl train LOG...            learn what the nominal model misses
  rfl learn                   drive, identify, collect, train and prove in one go
  rfl tune --vehicle my_car.toml   weights and horizon for a vehicle
  rfl identify LOG...         the steering's delay, into a vehicle file
  rfl evaluate --quick        all variants, compared
  rfl diagnose LOG            why a log and the simulator disagree
  rfl fleet LOGS              what changed in which vehicle of a fleet (Python package)
  rfl parameters              what --set can change
  rfl course                  write our own courses to paths/
  rfl completions bash        completion of commands and options in a shell

Exit status: 0 done, 1 bad input or a failure, 2 wrong usage; rfl drive, rfl train, rfl learn and rfl diagnose have more."
)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// Exit status of learning that ends without anything better than the default controller.
const NOT_BETTER: u8 = 3;

/// Commands of `rfl`.
#[derive(Debug, Subcommand)]
enum Command {
    Drive(drive::DriveArgs),
    Collect(collect::CollectArgs),
    Train(train::TrainArgs),
    Learn(learn::LearnArgs),
    Tune(tune::TuneArgs),
    Evaluate(evaluate::EvaluateArgs),
    Identify(identify::IdentifyArgs),
    Diagnose(diagnose::DiagnoseArgs),
    Fleet(fleet::FleetArgs),
    Path(path::PathArgs),
    Parameters(parameters::ParametersArgs),
    Course(course::CourseArgs),
    Completions(completions::CompletionsArgs),
}

impl Cli {
    /// Runs the command; gives its exit status.
    ///
    /// # Errors
    /// The fault, its place, and advice.
    pub fn run(&self) -> Result<u8, Box<dyn Error>> {
        match &self.command {
            Command::Drive(args) => return drive::run(args),
            Command::Collect(args) => collect::run(args)?,
            Command::Train(args) => return train::run(args),
            Command::Learn(args) => return learn::run(args),
            Command::Tune(args) => tune::run(args)?,
            Command::Evaluate(args) => evaluate::run(args)?,
            Command::Identify(args) => identify::run(args)?,
            Command::Diagnose(args) => return diagnose::run(args),
            Command::Fleet(args) => fleet::run(args)?,
            Command::Path(args) => path::run(args)?,
            Command::Parameters(args) => parameters::run(args)?,
            Command::Course(args) => course::run(args)?,
            Command::Completions(args) => completions::run(args)?,
        }
        Ok(0)
    }
}

/// The program: reads the command line, the program's name first; runs the command, reports an error, gives the exit status.
#[must_use]
pub fn main(words: impl IntoIterator<Item = OsString>) -> u8 {
    // Numbers may be negative, in every command: `--runs -1` is a wrong number, and no option `-1`.
    let mut command = Cli::command().mut_subcommands(|command| command.allow_negative_numbers(true));
    let words: Vec<OsString> = words.into_iter().collect();
    let matches = command.try_get_matches_from_mut(&words);
    let cli = matches.and_then(|found| Cli::from_arg_matches(&found));
    let cli = cli.unwrap_or_else(|error| {
        let name = words.get(1).and_then(|word| word.to_str()).unwrap_or_default();
        let error = match command.find_subcommand_mut(name) {
            Some(own) => worded(error, own),
            None => error,
        };
        if name == drive::NAME && error.use_stderr() {
            drive::report_usage(&words, &error);
        }
        error.exit()
    });
    match cli.run() {
        Ok(status) => status,
        // Who reads our output has read enough (`rfl path road.csv | head -1`).
        Err(error) if is_broken_pipe(error.as_ref()) => 0,
        Err(error) => {
            warn!("error: {error}");
            1
        }
    }
}

/// An error of a command's options; of a number, with what is wanted and what it means.
fn worded(error: clap::Error, command: &mut clap::Command) -> clap::Error {
    let Some(wanted) = error.source().and_then(number_wanted) else { return error };
    let of = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    let (option, value) = (of(ContextKind::InvalidArg), of(ContextKind::InvalidValue));
    let argument = command.get_arguments().find(|argument| argument.to_string() == option);
    let meaning = argument.and_then(|argument| argument.get_help()).map(|help| format!(": {help}"));
    let words = format!("{option}: '{value}' is not {wanted}{}", meaning.unwrap_or_default());
    command.error(ErrorKind::ValueValidation, words)
}

/// The number that a failed reading wanted.
fn number_wanted(error: &(dyn Error + 'static)) -> Option<&'static str> {
    if error.is::<std::num::ParseFloatError>() {
        return Some("a number without a unit");
    }
    error.is::<std::num::ParseIntError>().then_some("a whole number from 0 on, without a unit")
}

/// A command's arguments as another program gives them, in the words of the command line.
///
/// # Errors
/// A fault of them, in the words of the command line.
pub fn arguments<T: Args>(command: &'static str, words: &[String]) -> Result<T, Box<dyn Error>> {
    let options = clap::Command::new(command).no_binary_name(true).disable_help_flag(true);
    let mut command = T::augment_args(options).allow_negative_numbers(true);
    let read = command.try_get_matches_from_mut(words).and_then(|found| T::from_arg_matches(&found));
    read.map_err(|error| said(&worded(error, &mut command)).into())
}

/// The words of an error, without those on the usage.
fn said(error: &clap::Error) -> String {
    let said = error.to_string();
    let words = said.split("\n\nUsage:").next().unwrap_or_default();
    words.trim().trim_start_matches("error: ").to_owned()
}

/// Output of `warn!`.
fn warning(words: std::fmt::Arguments) {
    use std::io::Write;
    if let Some(listener) = listen::listener() {
        return listener.warn(words.to_string());
    }
    let _ = writeln!(std::io::stderr(), "{words}");
}

/// Output of `say!`. A full disk is a failure; a reader that has gone is none.
fn line(words: std::fmt::Arguments) {
    use std::io::Write;
    if let Some(listener) = listen::listener() {
        return listener.say(words.to_string());
    }
    if let Err(error) = writeln!(std::io::stdout(), "{words}") {
        if !is_broken_pipe(&error) {
            warn!("error: standard output: {error}");
            std::process::exit(1);
        }
        std::process::exit(0);
    }
}

fn is_broken_pipe(error: &(dyn Error + 'static)) -> bool {
    error.downcast_ref::<std::io::Error>().is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}

/// Reads one of some named values, whose names and meanings the help shows.
fn named<T: Copy + Send + Sync + 'static>(
    values: &'static [T],
    name: fn(T) -> &'static str,
    meaning: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let shown = values.iter().map(move |&value| PossibleValue::new(name(value)).help(meaning(value)));
    PossibleValuesParser::new(shown)
        .try_map(move |text| values.iter().copied().find(|&value| name(value) == text).ok_or("no such value"))
}
