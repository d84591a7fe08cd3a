//! Reading of drive logs and roads, for all commands that read them.

use crate::log::{DriveLog, LogError, Only};
use crate::numerics::fnv;
use crate::path::PathOptions;
use crate::table::Limits;
use clap::Args;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The size of a file from which it is refused.
#[derive(Debug, Clone, Copy, Args)]
pub struct LimitArgs {
    /// Largest log or road in MB, unpacked [default: 512 for a log, 256 for a road]
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..=1 << 20))]
    limit: Option<u64>,
}

impl LimitArgs {
    /// Limits given by the user, in place of the usual ones.
    fn of(self, usual: Limits) -> Limits {
        let bytes = self.limit.map_or(usual.bytes, |megabytes| megabytes << 20);
        // A larger file may have more rows, too.
        Limits { bytes, rows: usual.rows.max(usual.rows.saturating_mul(bytes / usual.bytes)) }
    }

    /// Reading options of roads.
    pub(super) fn road(self) -> PathOptions {
        let usual = PathOptions::default();
        PathOptions { limits: self.of(usual.limits), ..usual }
    }
}

/// Options of reading drive logs.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Logs")]
pub struct LogArgs {
    /// Rate of the rows, for logs without a time column
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Rows of one vehicle in a log of several: those with this value in a column
    #[arg(long, value_name = "COLUMN=VALUE")]
    only: Option<Only>,
    #[command(flatten)]
    pub(super) limit: LimitArgs,
    /// Logs that the calling program has, by the names that stand for files.
    #[arg(skip)]
    given: Vec<DriveLog>,
}

/// The arguments of a command that reads logs.
pub trait ReadsLogs: Args {
    /// Reading options of the command.
    fn reading(&mut self) -> &mut LogArgs;

    /// Gives it logs of the calling program; the command line calls them by their names in place of files.
    #[must_use]
    fn with_logs(mut self, logs: Vec<DriveLog>) -> Self {
        self.reading().given = logs;
        self
    }
}

impl LogArgs {
    /// Reads a log.
    ///
    /// # Errors
    /// The fault, with file, line and column.
    pub(super) fn read(&self, file: &Path) -> Result<DriveLog, LogError> {
        let log = match self.given(file) {
            Some(log) => log.clone(),
            None => DriveLog::read_within(file, self.limit.of(Limits::default()), self.only.as_ref())?,
        };
        match self.rate {
            Some(rate) => log.at_rate(rate),
            None => Ok(log),
        }
    }

    /// Refuses a log that is given twice: what it says would count twice.
    ///
    /// # Errors
    /// Two files with the same content.
    pub(super) fn check_distinct<'a>(
        &self,
        files: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Result<(), String> {
        let files: Vec<&PathBuf> = files.into_iter().collect();
        if files.len() < 2 {
            // A log alone need not be read once more.
            return Ok(());
        }
        let mut seen: BTreeMap<u64, &PathBuf> = BTreeMap::new();
        for file in files {
            // What cannot be read is said by who reads it.
            let Ok(hash) = self.hash(file) else { continue };
            if let Some(first) = seen.insert(hash, file) {
                let (first, file) = (first.display(), file.display());
                return Err(format!(
                    "{file}: the same log as {first}, and what it says would count twice; give it once"
                ));
            }
        }
        Ok(())
    }

    fn given(&self, file: &Path) -> Option<&DriveLog> {
        self.given.iter().find(|log| log.file == file)
    }

    /// A hash of the contents of a log, or of another file.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(super) fn hash(&self, file: &Path) -> std::io::Result<u64> {
        let Some(log) = self.given(file) else { return Ok(fnv(&std::fs::read(file)?)) };
        let mut bytes = Vec::new();
        for (name, values) in log.columns() {
            bytes.extend_from_slice(name.as_bytes());
            values.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
        }
        Ok(fnv(&bytes))
    }
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (1.0..=1e5).contains(&rate) => Ok(rate),
        _ => Err("give a number of rows a second, 1 to 100000".to_owned()),
    }
}
