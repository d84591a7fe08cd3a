//! `rfl course`: writes our own courses, and random roads.

use super::output::check_writable;
use crate::path::sudoku::{Route, SPACING, off_road};
use crate::path::{RandomRoad, Sample, to_csv, write_csv};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Lists our courses and writes them as path files; draws random roads
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl course                                         list all, write all to paths/
  rfl course --route sudoku_test                     write paths/sudoku_test.csv
  rfl course --route off_road --seed 12 --out my.csv an off-road path of your own
  rfl course --route hairpin_circuit --out -         to standard output
  rfl course --random car --seed 7 --out road.csv    a random road, tightest bend 12 m; a truck's 30 m
  rfl course --random car --seed 7 --closed          a closed one, to random_7.csv")]
pub struct CourseArgs {
    /// Course to write [default: all]
    #[arg(long, value_name = "NAME", value_parser = route_parser())]
    route: Option<Route>,
    /// Random road for this kind of vehicle, instead of a course
    #[arg(long, value_name = "KIND", conflicts_with = "route")]
    random: Option<RoadFor>,
    /// Close the random road to a lap
    #[arg(long, requires = "random")]
    closed: bool,
    /// File to write; `-` is standard output [default: paths/NAME.csv, random_SEED.csv]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Seed of the off-road path's winding and unevenness [default: that of the committed file], of a random road [default: 1]
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
}

/// Whose bends a random road has.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum RoadFor {
    Car,
    Truck,
}

fn route_parser() -> impl TypedValueParser<Value = Route> {
    let unknown = "no such course";
    PossibleValuesParser::new(Route::ALL.map(Route::name))
        .try_map(move |name| Route::from_name(&name).ok_or(unknown))
}

/// Runs the command.
///
/// # Errors
/// A file that cannot be written; a seed for a course that has none.
pub fn run(args: &CourseArgs) -> Result<(), Box<dyn Error>> {
    if let Some(kind) = args.random {
        return random(kind, args);
    }
    let Some(route) = args.route else {
        if args.out.is_some() || args.seed.is_some() {
            return Err("--out and --seed are for one road: name it with --route or --random".into());
        }
        for route in Route::ALL {
            write(route.summary(), &default_file(route), &route.samples())?;
        }
        return Ok(());
    };
    let samples = match (route, args.seed) {
        (_, None) => route.samples(),
        (Route::OffRoad, Some(seed)) => off_road(seed).samples(SPACING),
        (_, Some(_)) => {
            return Err(format!("--seed: {} has none, only off_road does; leave it out", route.name()).into());
        }
    };
    write_to(args.out.as_deref(), route.summary(), &default_file(route), &samples)
}

fn random(kind: RoadFor, args: &CourseArgs) -> Result<(), Box<dyn Error>> {
    let family = match kind {
        RoadFor::Car => RandomRoad::CAR,
        RoadFor::Truck => RandomRoad::TRUCK,
    };
    let seed = args.seed.unwrap_or(1);
    let road = RandomRoad { closed: args.closed, ..family };
    let summary = format!(
        "random {} road, tightest bend {} m",
        if road.closed { "closed" } else { "open" },
        road.tightest
    );
    write_to(args.out.as_deref(), &summary, Path::new(&format!("random_{seed}.csv")), &road.samples(seed))
}

fn default_file(route: Route) -> PathBuf {
    Path::new("paths").join(format!("{}.csv", route.name()))
}

fn write_to(
    out: Option<&Path>,
    summary: &str,
    default: &Path,
    samples: &[Sample],
) -> Result<(), Box<dyn Error>> {
    match out {
        Some(out) if out.as_os_str() == "-" => Ok(std::io::stdout().write_all(to_csv(samples).as_bytes())?),
        out => write(summary, out.unwrap_or(default), samples),
    }
}

fn write(summary: &str, file: &Path, samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    check_writable(file)?;
    write_csv(file, samples)?;
    writeln!(std::io::stdout(), "{:28} {:5} points  {summary}", file.display(), samples.len())?;
    Ok(())
}
