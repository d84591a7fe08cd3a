//! How drive logs are read, for all commands that read them.

use crate::log::{DriveLog, LogError};
use crate::table::Limits;
use clap::Args;
use std::path::Path;

/// Options of reading drive logs.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Logs")]
pub struct LogArgs {
    /// Rate of the rows, for logs without a time column
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Largest log in MB, unpacked
    #[arg(long, value_name = "MB", default_value_t = Limits::default().bytes >> 20, value_parser = clap::value_parser!(u64).range(1..=1 << 20))]
    limit: u64,
}

impl LogArgs {
    /// Reads a log.
    ///
    /// # Errors
    /// What is wrong, with file, line and column.
    pub(super) fn read(&self, file: &Path) -> Result<DriveLog, LogError> {
        let least = Limits::default();
        let bytes = self.limit << 20;
        // A larger log may have more rows, too.
        let rows = least.rows.max(least.rows.saturating_mul(bytes / least.bytes));
        let log = DriveLog::read_within(file, Limits { bytes, rows })?;
        match self.rate {
            Some(rate) => log.at_rate(rate),
            None => Ok(log),
        }
    }
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (1.0..=1e5).contains(&rate) => Ok(rate),
        _ => Err("give a number of rows a second, 1 to 100000".to_owned()),
    }
}
