//! `rfl train`: a residual model from drive logs.

use super::drive::car_named;
use super::progress_bar;
use crate::control::ControllerParameters;
use crate::residual::{DataConfig, DataSet, Drive, Fit, Kind, TrainConfig, train};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};

/// Learns what the nominal model misses from drive logs
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl train out/collect/*.csv                         RFL+S for the C-class car, to out/residual.rflm
  rfl train drives/*.csv --vehicle my_car.toml --kind rfl --test other_day.csv
  rfl drive --residual out/residual.rflm              drive with it

A log needs the columns time, steer_cmd, vx, e1, e1_rate, e2, e2_rate, curvature, curvature_rate.")]
pub struct TrainArgs {
    /// Drive logs (CSV)
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Logs to measure the fit on, not learned from
    #[arg(long)]
    test: Vec<PathBuf>,
    /// Car whose nominal model is corrected: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = crate::vehicle::BUILTIN[0])]
    vehicle: String,
    /// Kind of residual
    #[arg(long, default_value = "rfl_s", value_parser = kind_parser())]
    kind: Kind,
    /// Window of commands in steps: it should cover the actuator's delay and four of its time constants
    #[arg(long, default_value_t = 28)]
    window: usize,
    /// Seed of the forest
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// File for the model
    #[arg(long, default_value = "out/residual.rflm")]
    out: PathBuf,
    /// File for the fit (JSON)
    #[arg(long)]
    json: Option<PathBuf>,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

fn kind_parser() -> impl TypedValueParser<Value = Kind> {
    let learned = || Kind::ALL.iter().copied().filter(|&kind| kind != Kind::None);
    PossibleValuesParser::new(learned().map(|kind| PossibleValue::new(kind.name()).help(kind.meaning())))
        .try_map(move |name| learned().find(|kind| kind.name() == name).ok_or("no such kind"))
}

/// Reads the columns of a drive log that learning needs.
fn read_log(file: &Path) -> Result<Drive, Box<dyn Error>> {
    let name = file.display().to_string();
    let mut reader = csv::Reader::from_path(file).map_err(|error| format!("{name}: {error}"))?;
    let header = reader.headers().map_err(|error| format!("{name}: {error}"))?.clone();
    let mut drive = Drive { name: name.clone(), ..Drive::default() };
    let wanted = drive.columns().map(|(column, _)| column);
    let mut places = [0; 9];
    for (place, column) in places.iter_mut().zip(wanted) {
        *place = header.iter().position(|name| name.trim() == column).ok_or_else(|| {
            format!("{name}: column '{column}' is missing; a log to learn from needs {}", wanted.join(", "))
        })?;
    }
    for (index, record) in reader.records().enumerate() {
        let record = record.map_err(|error| format!("{name}: {error}"))?;
        let mut row = [0.0; 9];
        for ((value, place), column) in row.iter_mut().zip(places).zip(wanted) {
            let text = record.get(place).unwrap_or_default().trim();
            // An empty field is a gap, which the data set leaves out and counts.
            *value = if text.is_empty() {
                f64::NAN
            } else {
                text.parse().map_err(|_| {
                    format!("{name}, line {}, column {column}: '{text}' is not a number", index + 2)
                })?
            };
        }
        drive.columns_mut().into_iter().zip(row).for_each(|(column, value)| column.push(value));
    }
    Ok(drive)
}

/// Runs the command.
///
/// # Errors
/// What was wrong, where, and what to do.
pub fn run(args: &TrainArgs) -> Result<(), Box<dyn Error>> {
    let parameters = ControllerParameters::for_car(&car_named(&args.vehicle)?);
    let vehicle = parameters.vehicle.single_track();
    let data_config = DataConfig {
        sample_time: parameters.mpc.sample_time,
        min_model_speed: parameters.mpc.min_model_speed,
    };
    let read = |files: &[PathBuf]| -> Result<DataSet, Box<dyn Error>> {
        let drives = files.iter().map(|file| read_log(file)).collect::<Result<Vec<_>, _>>()?;
        Ok(DataSet::new(&drives, &vehicle, data_config)?)
    };
    let data = read(&args.logs)?;
    let test = if args.test.is_empty() { None } else { Some(read(&args.test)?) };
    let found = data.report();
    println!("{} rows, {} samples; {} gaps", found.rows, found.labels, found.gaps);
    let left_out = found.not_finite + found.implausible;
    if left_out > 0 {
        println!(
            "left out: {} rows that are not numbers, {} that cannot be",
            found.not_finite, found.implausible
        );
    }

    let mut config = TrainConfig::new(args.kind);
    config.seed = args.seed;
    config.window = args.window;
    let bar = progress_bar("training", 1.0, args.quiet);
    let trained = train(&data, test.as_ref(), &config, &|progress| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
    })?;
    bar.finish_and_clear();

    if let Some(folder) = args.out.parent() {
        std::fs::create_dir_all(folder)?;
    }
    trained.model.write(&args.out)?;
    let report = &trained.report;
    println!(
        "{:<24} {:>10} {:>10} {:>10} {:>10}",
        "RMS of one step", "e1 m", "e1' m/s", "e2 rad", "e2' rad/s"
    );
    let line = |name: &str, values: [f64; 4]| {
        let [a, b, c, d] = values;
        println!("{name:<24} {a:>10.2e} {b:>10.2e} {c:>10.2e} {d:>10.2e}");
    };
    line("nominal, training", report.train.nominal_rmse);
    line("with residual, training", report.train.rmse);
    if let Some(fit) = &report.held_out {
        line("with residual, held out", fit.rmse);
    }
    if let Some(fit) = &report.test {
        line("nominal, test", fit.nominal_rmse);
        line("with residual, test", fit.rmse);
    }
    println!("model: {}", args.out.display());
    if let Some(file) = &args.json {
        let value = json!({
            "train": as_json(&report.train),
            "held_out": report.held_out.as_ref().map(as_json),
            "test": report.test.as_ref().map(as_json),
            "leaves": report.leaves,
        });
        std::fs::write(file, serde_json::to_string_pretty(&value)?)?;
    }
    Ok(())
}

fn as_json(fit: &Fit) -> Value {
    json!({"samples": fit.samples, "rmse": fit.rmse, "max": fit.max, "nominal_rmse": fit.nominal_rmse})
}
