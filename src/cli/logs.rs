//! How drive logs and roads are read, for all commands that read them.

use crate::log::{DriveLog, LogError};
use crate::path::Options;
use crate::table::Limits;
use clap::Args;
use std::path::Path;

/// The size of a file from which it is refused.
#[derive(Debug, Clone, Copy, Args)]
pub struct LimitArgs {
    /// Largest log or road in MB, unpacked [default: 512 for a log, 256 for a road]
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..=1 << 20))]
    limit: Option<u64>,
}

impl LimitArgs {
    /// What is asked for, in place of what is usual.
    fn of(self, usual: Limits) -> Limits {
        let bytes = self.limit.map_or(usual.bytes, |megabytes| megabytes << 20);
        // A larger file may have more rows, too.
        Limits { bytes, rows: usual.rows.max(usual.rows.saturating_mul(bytes / usual.bytes)) }
    }

    /// How roads are read.
    pub(super) fn road(self) -> Options {
        let usual = Options::default();
        Options { limits: self.of(usual.limits), ..usual }
    }
}

/// Options of reading drive logs.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Logs")]
pub struct LogArgs {
    /// Rate of the rows, for logs without a time column
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    #[command(flatten)]
    pub(super) limit: LimitArgs,
}

impl LogArgs {
    /// Reads a log.
    ///
    /// # Errors
    /// What is wrong, with file, line and column.
    pub(super) fn read(&self, file: &Path) -> Result<DriveLog, LogError> {
        let log = DriveLog::read_within(file, self.limit.of(Limits::default()))?;
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
