//! How robust the default controller is: `robustness matrix|ladder|margins|faults [OPTIONS]`, see `--help`.
//!
//! Each part writes one JSON file, the same on every run and any number of threads. `scripts/reproduce robustness` runs all
//! and writes `docs/results/robustness.md`. Files of `../shared` that are not there are left out, and named.

mod faults;
mod ladder;
mod margins;
mod matrix;
mod unknown;

use clap::Parser;
use rfl_mpc::numerics::parallel;
use serde_json::Value;
use std::error::Error;
use std::path::{Path as File, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Examines the default controller: a matrix of drives, what knowing more gives, margins, faults.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:
  robustness matrix --out out/robustness           all drives of the matrix
  robustness matrix --only car-017                 one drive of it again, its log beside the results
  robustness faults --quick                        a few stations only")]
struct Arguments {
    /// matrix, ladder, margins or faults
    part: String,
    /// Folder for the results
    #[arg(long, default_value = "out/robustness")]
    out: PathBuf,
    /// A small part of it
    #[arg(long)]
    quick: bool,
    /// One drive of the matrix, by its name: writes its log as well
    #[arg(long)]
    only: Option<String>,
    /// Threads; 0 for all
    #[arg(long, default_value_t = 0)]
    threads: usize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    std::fs::create_dir_all(&arguments.out)?;
    let results = match arguments.part.as_str() {
        "matrix" => matrix::run(&arguments)?,
        "ladder" => ladder::run(&arguments)?,
        "margins" => margins::run(&arguments)?,
        "faults" => faults::run(&arguments)?,
        "unknown" => unknown::run(&arguments)?,
        other => return Err(format!("'{other}': write matrix, unknown, ladder, margins or faults").into()),
    };
    if arguments.only.is_none() {
        let file = arguments.out.join(format!("{}.json", arguments.part));
        std::fs::write(&file, serde_json::to_string_pretty(&results)? + "\n")?;
        println!("{}", file.display());
    }
    Ok(())
}

/// A file of the folder beside the checkout; none where that is absent, and said so.
fn shared(name: &str) -> Option<PathBuf> {
    let file = File::new("../shared").join(name);
    if !file.exists() {
        eprintln!("left out: {} is not there", file.display());
    }
    file.exists().then_some(file)
}

/// `work(0), .., work(count - 1)` on several threads, in order, with a word of progress now and then.
fn map(threads: usize, title: &str, count: usize, work: impl Fn(usize) -> Value + Sync) -> Vec<Value> {
    let begun = AtomicUsize::new(0);
    parallel::map(parallel::threads(threads), count, |piece| {
        let before = begun.fetch_add(1, Ordering::Relaxed);
        if before > 0 && before.is_multiple_of(50) {
            eprintln!("{title}: {before} of {count}");
        }
        work(piece)
    })
}
