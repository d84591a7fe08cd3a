//! `rfl course`: writes our own courses.

use crate::path::sudoku::{Route, SPACING, off_road};
use crate::path::{to_csv, write_csv};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Lists our courses and writes them as path files
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl course                                         list all, write all to paths/
  rfl course --route sudoku_test                     write paths/sudoku_test.csv
  rfl course --route off_road --seed 12 --out my.csv an off-road path of your own
  rfl course --route hairpin_circuit --out -         to standard output")]
pub struct CourseArgs {
    /// Course to write [default: all]
    #[arg(long, value_name = "NAME", value_parser = route_parser())]
    route: Option<Route>,
    /// File to write; `-` is standard output [default: paths/NAME.csv]
    #[arg(long, value_name = "FILE", requires = "route")]
    out: Option<PathBuf>,
    /// Seed of the off-road path's winding and unevenness [default: that of the committed file]
    #[arg(long, value_name = "NUMBER", requires = "route")]
    seed: Option<u64>,
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
    let Some(route) = args.route else {
        for route in Route::ALL {
            write(route, &default_file(route), &route.samples())?;
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
    match &args.out {
        Some(out) if out.as_os_str() == "-" => std::io::stdout().write_all(to_csv(&samples).as_bytes())?,
        Some(out) => write(route, out, &samples)?,
        None => write(route, &default_file(route), &samples)?,
    }
    Ok(())
}

fn default_file(route: Route) -> PathBuf {
    Path::new("paths").join(format!("{}.csv", route.name()))
}

fn write(route: Route, file: &Path, samples: &[crate::path::Sample]) -> Result<(), Box<dyn Error>> {
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    write_csv(file, samples)?;
    writeln!(std::io::stdout(), "{:28} {:5} points  {}", file.display(), samples.len(), route.summary())?;
    Ok(())
}
