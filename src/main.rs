//! The program `rfl`; see `rfl --help`.
use clap::Parser;
#[derive(Parser)]
enum Cli {
    Drive(rfl_mpc::cli::drive::DriveArgs),
}
fn main() {
    let Cli::Drive(a) = Cli::parse();
    if let Err(e) = rfl_mpc::cli::drive::run(&a) {
        eprintln!("{e}");
        std::process::exit(1)
    }
}
