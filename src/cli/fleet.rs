//! `rfl fleet`: only says where it is. The command is Python, on Dask; the package's own `rfl` runs it before it comes here.

use clap::Args;
use std::error::Error;

/// Changes of the vehicles of a fleet: which, in which, since when (Python package, with its extra `fleet`)
#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub struct FleetArgs {
    /// Words passed on
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    words: Vec<String>,
}

/// Says where the command is.
///
/// # Errors
/// Always.
pub fn run(_: &FleetArgs) -> Result<(), Box<dyn Error>> {
    Err(elsewhere("rfl fleet").into())
}

/// Words for what only the package's program does.
pub(super) fn elsewhere(what: &str) -> String {
    format!(
        "{what} is done by the Python package, whose program is called rfl as well: pip install 'rfl-mpc[fleet]'"
    )
}
