//! Errors of a drive log: one variant per cause, each with its place and advice.

use crate::signal;
use crate::table::TableError;
use std::path::PathBuf;

/// Reasons for which a log cannot be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum LogError {
    #[error("{}: {source}; check the name and the permission", file.display())]
    Open { file: PathBuf, source: std::io::Error },
    #[error("{}: {source}", file.display())]
    Table { file: PathBuf, source: TableError },
    #[error("{}, line {line}: {found} values for {expected} columns; a drive log has the same number of columns in each line", file.display())]
    RowLength { file: PathBuf, line: u64, found: usize, expected: usize },
    #[error("{}, line {line}, column {column}: the unit '{unit}' is unknown; give the column in {ours}", file.display())]
    Unit { file: PathBuf, line: u64, column: &'static str, unit: String, ours: &'static str },
    #[error("{}: this build reads no compressed files (feature `cli`); unpack it first", file.display())]
    Compressed { file: PathBuf },
    #[error("{}: no column is a signal of a drive log: the header is `{header}`; give columns such as time, steer_cmd, vx, or let scripts/import_log.py \
         find those of other tools", file.display())]
    NoSignal { file: PathBuf, header: String },
    #[error("{}: column '{column}' has {found} values, and the others have {expected}; give columns of one length", file.display())]
    ColumnLength { file: PathBuf, column: String, found: usize, expected: usize },
    #[error("{}: there is a time column; leave the constant rate (--rate) out, or delete the column", file.display())]
    TimeAndRate { file: PathBuf },
    #[error("{}: the column '{column}' stands twice; delete one", file.display())]
    Twice { file: PathBuf, column: &'static str },
    #[error("{}, line {line}, column {column}: '{text}' is not a number{}", file.display(), instead(column, text))]
    NotANumber { file: PathBuf, line: u64, column: &'static str, text: String },
    #[error(
        "{}: rows of {count} vehicles (column {column}: {values}); a log is of one: choose it (--only {column}={first}), or give each \
         in a file of its own",
        file.display()
    )]
    SeveralVehicles { file: PathBuf, column: String, count: usize, values: String, first: String },
    #[error("{}: --only: there is no column '{column}'; the columns are {header}", file.display())]
    NoSuchColumn { file: PathBuf, column: String, header: String },
    #[error("{}: --only: no row has '{value}' in column '{column}'; it has {values}", file.display())]
    NoSuchValue { file: PathBuf, column: String, value: String, values: String },
    #[error("{}: column '{column}' is missing; a log to learn from needs {needed}{}", file.display(), perhaps(column, near))]
    Missing { file: PathBuf, column: &'static str, needed: &'static str, near: Vec<String> },
    #[error(
        "{}: {} missing; give the road that was driven (--path ROAD.csv), and they are computed from x, y, yaw, vx, vy \
         and yaw_rate{}",
        file.display(), listed(columns), lacking(pose)
    )]
    NoErrors { file: PathBuf, columns: Vec<&'static str>, pose: Vec<&'static str> },
    #[error(
        "{}: {} missing; to compute them from the road (--path) takes x, y, yaw, vx, vy and yaw_rate, and {} missing, too: record {}",
        file.display(), listed(columns), listed(pose), if pose.len() > 1 { "them" } else { "it" }
    )]
    NoPose { file: PathBuf, columns: Vec<&'static str>, pose: Vec<&'static str> },
    #[error(
        "{}: the vehicle is more than {limit} m from the road in {share:.0} % of the rows: is {} the road that was \
         driven, and are x and y in metres?",
        file.display(), road.display()
    )]
    FarFromRoad { file: PathBuf, road: PathBuf, limit: f64, share: f64 },
    #[error(
        "{}: the heading is more than {limit} rad off the road's in {share:.0} % of the rows: yaw may be from north; \
         give it from the x axis, counter-clockwise, in radians. Or was the road driven the other way?",
        file.display()
    )]
    Heading { file: PathBuf, limit: f64, share: f64 },
    #[error("{}: yaw changes {factor:.3} times as fast as yaw_rate says; {hint}", file.display())]
    Turn { file: PathBuf, factor: f64, hint: &'static str },
}

/// Advice for a word in place of a number.
fn instead(column: &str, text: &str) -> &'static str {
    if signal::as_written(text) == column {
        "; the line repeats the header: are these two logs in one file? Give each in a file of its own"
    } else if column == "time" {
        ", nor a time such as 2024-05-01T12:00:00.02 or 12:00:00.02; give seconds, or let scripts/import_log.py read it"
    } else {
        "; correct it, or leave the field empty if there is no value"
    }
}

fn listed(columns: &[&str]) -> String {
    match columns {
        [one] => format!("column '{one}' is"),
        many => format!("columns {} are", many.join(", ")),
    }
}

/// A question after a column that is missing, by names of others.
pub(super) fn perhaps(column: &str, near: &[String]) -> String {
    if near.is_empty() {
        let without = "; without a clock, give the rows of a second: --rate HZ";
        return if column == "time" { without.to_owned() } else { String::new() };
    }
    format!("; is it {}? Name it {column} [UNIT], as in vx [km/h]", near.join(" or "))
}

fn lacking(pose: &[&str]) -> String {
    if pose.is_empty() { String::new() } else { format!("; of these, {} also missing", listed(pose)) }
}
