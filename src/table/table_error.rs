//! Limits of reading a table, and the reasons for which a file gives none.

/// Limits of reading a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Greatest size in bytes, unpacked.
    pub bytes: u64,
    /// Most rows of values.
    pub rows: u64,
}

impl Default for Limits {
    /// 512 MB unpacked, 5 million rows: 14 hours at 100 Hz.
    fn default() -> Self {
        Self { bytes: 512 << 20, rows: 5_000_000 }
    }
}

/// Bytes that a line may have.
pub(super) const LONGEST_LINE: u64 = 1 << 20;

/// Reasons for which a file gives no table. Messages name no file: the caller that opened it does.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file cannot be opened.
    #[error("{0}; check the name and the permission")]
    Io(#[from] std::io::Error),
    /// The file cannot be read to its end.
    #[error(
        "line {line}: cannot be read on: {source}; copy or pack it again (what stands above may be damaged, too)"
    )]
    Broken {
        /// The line, counted from 1.
        line: u64,
        /// The fault.
        source: std::io::Error,
    },
    /// A packed file ends before its end: its recorder or a copy was stopped.
    #[error("line {line}: the packed file is cut off here; copy or pack it again")]
    CutOff {
        /// The first line that is not whole, counted from 1.
        line: u64,
    },
    /// A folder, a device or a pipe.
    #[error("is {kind}, not a file; give a CSV file")]
    NotAFile {
        /// Kind, with its article.
        kind: &'static str,
    },
    /// More bytes than the limit.
    #[error("has more than {} MB{}, the limit of a table; cut it into several files", limit >> 20, if *unpacked { " unpacked" } else { "" })]
    TooLarge {
        /// The limit in bytes.
        limit: u64,
        /// True if the file was packed.
        unpacked: bool,
    },
    /// More rows than the limit.
    #[error("line {line}: has more than {limit} rows, the limit of a table; cut it into several files")]
    TooManyRows {
        /// The first line too many, counted from 1.
        line: u64,
        /// The limit.
        limit: u64,
    },
    /// A line that no table has.
    #[error("line {line}: has more than {} MB; a table is a text file with a line for each row", LONGEST_LINE >> 20)]
    LongLine {
        /// The line, counted from 1.
        line: u64,
    },
    /// gzip, in a build without it.
    #[error("this build reads no compressed files (feature `cli`); unpack it first")]
    Compressed,
    /// A known format that is no text.
    #[error("is {kind}; {advice}")]
    Foreign {
        /// The kind.
        kind: &'static str,
        /// How to make a table of it.
        advice: &'static str,
    },
}
