//! `rfl path`: properties of a road, before anything is driven on it.

use super::files::check_files;
use super::logs::LimitArgs;
use super::vehicle::{Commanded, by_kind, vehicle_named};
use crate::control::SpeedParameters;
use crate::path::{
    Closure, Path, PathOptions, RoadClass, RoundedCorner, Smoothing, SpeedLimits, SpeedPlan, write_csv,
};
use crate::vehicle::BUILTIN;
use clap::Args;
use serde_json::{Value, json};
use std::error::Error;
use std::io::Write;
use std::path::PathBuf;

/// Checks a road: length, bends, speed plan, and what was repaired or assumed
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl path paths/sudoku_test.csv
  rfl path track.csv --closed            the last point leads to the first
  rfl path gps_lap.csv --smooth 0.02     measured points with 2 cm of noise
  rfl path gps_lap.csv --write smooth.csv    the road that is driven, to look at and to drive
  rfl path road.csv --json | jq .least_radius
  rfl path yard.csv --vehicle truck_simulation    whether a truck and its trailer can follow it

A road is a CSV file with columns x and y (m) and, optional, yaw, curvature, speed, bank, grade, friction, class, s;
or a file of the racetrack-database (x_m,y_m,w_tr_right_m,w_tr_left_m); or a racing line (s_m; x_m; y_m; ...; vx_mps).
Commas, semicolons (with decimal commas, too) or tabs; names such as east, north, speed_kmh, bank [deg] are known.
Noise of the points is measured, and smoothed if it would be driven.")]
pub struct PathArgs {
    /// The road's file
    file: PathBuf,
    /// The road leads from its last point to its first
    #[arg(long, conflicts_with = "open")]
    closed: bool,
    /// The road ends at its last point
    #[arg(long)]
    open: bool,
    /// Allowed distance of the path from noisy points, RMS in m [default: as accurate as the file is, or its measured
    /// noise]
    #[arg(long, value_name = "METRES")]
    smooth: Option<f64>,
    #[command(flatten)]
    limit: LimitArgs,
    /// File for the road that is driven: smooth, with heading and curvature (CSV)
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// Vehicle that the corners are rounded for, and whose turning circle is compared with the bends: a vehicle file (TOML) or a
    /// built-in name
    #[arg(long, value_name = "VEHICLE", default_value = BUILTIN[0])]
    vehicle: String,
    /// Lateral acceleration of the speed plan in m/s2
    #[arg(long, value_name = "M_PER_S2", default_value_t = SpeedLimits::default().lateral_accel)]
    lateral_accel: f64,
    /// Greatest speed of the speed plan in m/s
    #[arg(long, value_name = "M_PER_S", default_value_t = SpeedParameters::default().limit)]
    speed: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Step between the stations looked at in m.
const LOOK: f64 = 0.25;

/// Step between the points that are written in m.
const WRITTEN: f64 = 0.5;

/// Properties of a road.
struct Findings {
    length: f64,
    closed: bool,
    /// Curvature of greatest magnitude and its station.
    tightest: (f64, f64),
    sharpest_rate: f64,
    /// Least and greatest planned speed, and the time it takes.
    speed: (f64, f64),
    duration: f64,
    lateral_accel: f64,
    bank: (f64, f64),
    grade: (f64, f64),
    friction: (f64, f64),
    /// Length of each class in m.
    classes: Vec<(RoadClass, f64)>,
}

/// Runs the command.
///
/// # Errors
/// A road that cannot be used: file, line, column and remedy.
pub fn run(args: &PathArgs) -> Result<(), Box<dyn Error>> {
    for (name, value) in [("--lateral-accel", args.lateral_accel), ("--speed", args.speed)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(format!("{name} {value}: give a positive number").into());
        }
    }
    if let Some(file) = &args.write {
        check_files(&[("--write", file)], &[("FILE", &args.file)])?;
    }
    let reading = reading(args.smooth, [args.closed, args.open], &args.limit);
    let (path, too_tight) = by_kind!(&args.vehicle, read_for(&args.vehicle, &args.file, &reading))?;
    let limits =
        SpeedLimits { lateral_accel: args.lateral_accel, speed: args.speed, ..SpeedLimits::default() };
    let findings = look(&path, &limits);
    let text = if args.json {
        findings.json(args, &path, too_tight.as_deref())
    } else {
        findings.text(args, &path, too_tight.as_deref())
    };
    if let Some(file) = &args.write {
        write_csv(file, &path.samples(WRITTEN))?;
    }
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}

/// How `--smooth`, `--closed`, `--open` and `--limit` ask to read a road.
pub(super) fn reading(smooth: Option<f64>, [closed, open]: [bool; 2], limit: &LimitArgs) -> PathOptions {
    let smoothing = smooth.map_or(Smoothing::AsAccurate, Smoothing::Within);
    let closure = match (closed, open) {
        (true, _) => Closure::Closed,
        (_, true) => Closure::Open,
        _ => Closure::Detect,
    };
    PathOptions { closure, smoothing, ..limit.road() }
}

fn rounded_json(corner: &RoundedCorner) -> Value {
    let RoundedCorner { row, corners, x, y, turn, inside } = *corner;
    json!({"row": row, "corners": corners, "x": x, "y": y, "turn": turn, "inside": inside})
}

/// The road as a vehicle drives it, and a warning if it bends more tightly than the vehicle turns.
fn read_for<P: Commanded<S, C>, const S: usize, const C: usize>(
    vehicle: &str,
    file: &std::path::Path,
    reading: &PathOptions,
) -> Result<(Path, Option<String>), Box<dyn Error>> {
    let parameters = P::controller(&vehicle_named(vehicle)?);
    let path = Path::named(file, &parameters.reading::<S>(reading))?;
    let too_tight = parameters.too_tight::<S>(&path).map(|words| format!("{vehicle}: {words}"));
    Ok((path, too_tight))
}

fn look(path: &Path, limits: &SpeedLimits) -> Findings {
    let plan = SpeedPlan::new(path, limits);
    let mut found = Findings {
        length: path.length(),
        closed: path.is_periodic(),
        tightest: (0.0, 0.0),
        sharpest_rate: 0.0,
        speed: (f64::INFINITY, 0.0),
        duration: plan.duration(),
        lateral_accel: 0.0,
        bank: (f64::INFINITY, f64::NEG_INFINITY),
        grade: (f64::INFINITY, f64::NEG_INFINITY),
        friction: (f64::INFINITY, f64::NEG_INFINITY),
        classes: Vec::new(),
    };
    let widen = |range: &mut (f64, f64), value: f64| *range = (range.0.min(value), range.1.max(value));
    let mut classes = RoadClass::ALL.map(|class| (class, 0.0));
    let steps = (path.length() / LOOK).ceil().clamp(1.0, 4e6) as usize;
    let step = path.length() / steps as f64;
    for i in 0..=steps {
        let station = i as f64 * step;
        let point = path.at(station);
        let speed = plan.speed(station);
        if point.curvature.abs() > found.tightest.0.abs() {
            found.tightest = (point.curvature, station);
        }
        found.sharpest_rate = found.sharpest_rate.max(point.curvature_rate.abs());
        found.lateral_accel = found.lateral_accel.max(speed * speed * point.curvature.abs());
        widen(&mut found.speed, speed);
        widen(&mut found.bank, point.bank);
        widen(&mut found.grade, point.grade);
        widen(&mut found.friction, point.friction);
        if let (Some(class), true) = (point.class, i < steps) {
            classes.iter_mut().filter(|(other, _)| *other == class).for_each(|(_, length)| *length += step);
        }
    }
    found.classes = classes.into_iter().filter(|(_, length)| *length > 0.0).collect();
    found
}

impl Findings {
    /// Least radius in m; infinite on a straight road.
    fn least_radius(&self) -> f64 {
        1.0 / self.tightest.0.abs()
    }

    fn mean_speed(&self) -> f64 {
        self.length / self.duration
    }

    fn text(&self, args: &PathArgs, path: &Path, too_tight: Option<&str>) -> String {
        let mut lines = vec![format!("{}", args.file.display())];
        let mut row = |label: &str, value: String| lines.push(format!("  {label:16} {value}"));
        let kind = if self.closed { "closed" } else { "open" };
        row("length", format!("{:.1} m, {kind}", self.length));
        row(
            "tightest bend",
            if self.tightest.0 == 0.0 {
                "none: the road is straight".into()
            } else {
                let side = if self.tightest.0 > 0.0 { "left" } else { "right" };
                format!("{:.2} m radius, to the {side}, at {:.1} m", self.least_radius(), self.tightest.1)
            },
        );
        row("curvature rate", format!("up to {:.4} 1/m2", self.sharpest_rate));
        row(
            "speed plan",
            format!(
                "{:.1} to {:.1} km/h, mean {:.1}, {:.0} s; lateral acceleration up to {:.2} m/s2",
                3.6 * self.speed.0,
                3.6 * self.speed.1,
                3.6 * self.mean_speed(),
                self.duration,
                self.lateral_accel
            ),
        );
        if self.bank != (0.0, 0.0) {
            row("bank", format!("{:.4} to {:.4} rad", self.bank.0, self.bank.1));
        }
        if self.grade != (0.0, 0.0) {
            row("grade", format!("{:.4} to {:.4} rad", self.grade.0, self.grade.1));
        }
        if self.friction != (1.0, 1.0) {
            row("friction", format!("{:.2} to {:.2}", self.friction.0, self.friction.1));
        }
        for (class, length) in &self.classes {
            row(class.name(), format!("{length:.0} m"));
        }
        for note in path.notes() {
            row(if note.warning { "warning" } else { "note" }, note.text.clone());
        }
        if let Some(words) = too_tight {
            row("warning", words.to_owned());
        }
        lines.join("\n") + "\n"
    }

    fn json(&self, args: &PathArgs, path: &Path, too_tight: Option<&str>) -> String {
        let classes: serde_json::Map<String, Value> =
            self.classes.iter().map(|(class, length)| (class.name().into(), json!(length))).collect();
        // An infinite radius is null: JSON has no infinity.
        let rounded: Vec<Value> = path.corners().iter().map(rounded_json).collect();
        let report = json!({
            "file": args.file.display().to_string(),
            "length": self.length,
            "closed": self.closed,
            "least_radius": self.least_radius(),
            "tightest_station": self.tightest.1,
            "tightest_curvature": self.tightest.0,
            "greatest_curvature_rate": self.sharpest_rate,
            "speed": {"min": self.speed.0, "mean": self.mean_speed(), "max": self.speed.1},
            "duration": self.duration,
            "lateral_accel": self.lateral_accel,
            "bank": [self.bank.0, self.bank.1],
            "grade": [self.grade.0, self.grade.1],
            "friction": [self.friction.0, self.friction.1],
            "classes": classes,
            "rounded": rounded,
            "notes": path.notes().iter().map(|note| note.text.as_str()).chain(too_tight).collect::<Vec<_>>(),
        });
        format!("{report:#}\n")
    }
}
