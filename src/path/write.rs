//! Roads to files, in our format.

use super::error::PathError;
use super::sample::Sample;
use std::fmt::Write as _;

/// A column: its name, its decimals, its value.
type WrittenColumn = (&'static str, usize, fn(&Sample) -> Option<f64>);

/// Points as the text of a path file: `x,y` and those of the optional columns that any point has. Positions have a
/// resolution of 1e-6 m, yaw 1e-7 rad, curvature 1e-8 1/m. The resolution is finer than their accuracy, so that reading
/// the file gives the same curvature.
#[must_use]
pub fn to_csv(samples: &[Sample]) -> String {
    const COLUMNS: [WrittenColumn; 8] = [
        ("x", 6, |sample| Some(sample.x)),
        ("y", 6, |sample| Some(sample.y)),
        ("yaw", 7, |sample| sample.yaw),
        ("curvature", 8, |sample| sample.curvature),
        ("speed", 4, |sample| sample.speed),
        ("bank", 5, |sample| sample.bank),
        ("grade", 5, |sample| sample.grade),
        ("friction", 4, |sample| sample.friction),
    ];
    let columns: Vec<&WrittenColumn> =
        COLUMNS.iter().filter(|(_, _, value)| samples.iter().any(|sample| value(sample).is_some())).collect();
    let classes = samples.iter().any(|sample| sample.class.is_some());
    let mut names: Vec<&str> = columns.iter().map(|column| column.0).collect();
    if classes {
        names.push("class");
    }
    let mut text = names.join(",") + "\n";
    let mut number = String::new();
    for sample in samples {
        for (i, (_, decimals, value)) in columns.iter().enumerate() {
            if i > 0 {
                text.push(',');
            }
            if let Some(value) = value(sample) {
                number.clear();
                // Writing to a String cannot fail.
                let _ = write!(number, "{value:.decimals$}");
                let short = number.trim_end_matches('0').trim_end_matches('.');
                text.push_str(if short == "-0" { "0" } else { short });
            }
        }
        if classes {
            text.push(',');
            text.push_str(sample.class.map_or("", super::RoadClass::name));
        }
        text.push('\n');
    }
    text
}

/// Writes points to a path file, whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn write_csv(file: &std::path::Path, samples: &[Sample]) -> Result<(), PathError> {
    crate::output::write_bytes(file, to_csv(samples))
        .map_err(|source| PathError::Write { file: file.to_path_buf(), source })
}
