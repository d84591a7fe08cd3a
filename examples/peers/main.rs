//! Our side of `scripts/compare_peers`, which compares with other people's software on the same problems:
//!
//! ```text
//! peers forest TABLE ROWS TESTS FITS      trains on ROWS rows of a table, writes what it predicts for TESTS more
//! peers lookup FEATURES LABELS            trains a residual on a drive, times its coefficients, writes its training table
//! peers problems COUNT FILE               drives, writes quadratic programs with our solutions
//! peers nonlinear HORIZON COUNT nmpc|gp   drives, writes nonlinear MPC problems with our solutions
//! peers agreement COUNT                   drives, compares each solution with Clarabel's: COUNT problems a case
//! peers steps                             whole control steps, and the closed loop against real time
//! peers growth                            cost against horizon, window, trees, depth, log
//! peers instances                         cost of a step against the number of controllers in one process
//! peers prepare FOLDER                    records the steps that the next one makes
//! peers counted FOLDER nominal|rfl        makes control steps whose instructions are counted
//! peers training ROWS                     seconds and memory of training on ROWS rows of 64 columns
//! ```
//!
//! Tables are files of little-endian `f64`, row by row. What was measured is printed as JSON.

mod agreement;
mod counted;
mod forest;
mod growth;
mod instances;
mod learned;
mod lookup;
mod nonlinear;
mod problems;
mod speed;
mod steps;

use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// What a part of the comparison gives, or why not.
type Outcome = Result<serde_json::Value, Box<dyn Error>>;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let measured = match arguments[..] {
        ["forest", table, rows, tests, fits] => {
            forest::run(Path::new(table), rows.parse()?, tests.parse()?, Path::new(fits))
        }
        ["lookup", features, labels] => lookup::run(Path::new(features), Path::new(labels)),
        ["problems", count, file] => problems::run(count.parse()?, Path::new(file)),
        ["nonlinear", horizon, count, kind @ ("nmpc" | "gp")] => {
            nonlinear::run(horizon.parse()?, count.parse()?, kind == "gp")
        }
        ["agreement", count] => agreement::run(count.parse()?),
        ["steps"] => speed::run(),
        ["growth"] => growth::run(),
        ["instances"] => instances::run(),
        ["prepare", folder] => counted::prepare(Path::new(folder)),
        ["counted", folder, name] => counted::run(Path::new(folder), name),
        ["training", rows] => growth::training(rows.parse()?),
        _ => Err("unknown arguments; what there is stands at the head of examples/peers/main.rs".into()),
    }?;
    println!("{measured}");
    Ok(())
}

fn read_table(file: &Path) -> Result<Vec<f64>, Box<dyn Error>> {
    let bytes = std::fs::read(file).map_err(|error| format!("{}: {error}", file.display()))?;
    let (values, rest) = bytes.as_chunks::<8>();
    if !rest.is_empty() {
        return Err(
            format!("{}: not a table of f64, {} bytes are left over", file.display(), rest.len()).into()
        );
    }
    Ok(values.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect())
}

fn write_table(file: &Path, values: &[f64]) -> Result<(), Box<dyn Error>> {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(file, bytes).map_err(|error| format!("{}: {error}", file.display()).into())
}

/// Memory of this process, in bytes, where the system says: what is in use (`VmRSS:`), or the most it ever had (`VmHWM:`).
fn memory(name: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024.0 * kib)
}

/// Seconds of one call, the median of several.
fn median_time(repeats: usize, mut call: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..repeats)
        .map(|_| {
            let begin = Instant::now();
            call();
            begin.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[repeats / 2]
}
