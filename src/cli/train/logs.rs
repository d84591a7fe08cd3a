//! The logs to learn from and to test on, read, with notes on their faults and repairs.

use super::super::diagnose::steady_steering;
use super::super::vehicle::{Commanded, VehicleLinearModel};
use super::TrainArgs;
use crate::control::{ControlledParameters, ControllerParametersFor};
use crate::log::{SteeringLog, drives_of};
use crate::nominal::SteeringDrive;
use crate::path::Path;
use crate::residual::{DataReport, DataSet};
use std::error::Error;
use std::path::PathBuf;

/// The logs as samples, and the angles measured in them.
pub(super) struct TrainLogs<P: Commanded<S, C>, const S: usize, const C: usize> {
    pub data: DataSet<VehicleLinearModel<P, S, C>, S>,
    pub angles: Vec<SteeringDrive>,
    pub test: Option<DataSet<VehicleLinearModel<P, S, C>, S>>,
    pub notes: Vec<String>,
}

impl<P: Commanded<S, C>, const S: usize, const C: usize> TrainLogs<P, S, C> {
    /// Reads all logs for a controller with these parameters.
    pub fn read(
        args: &TrainArgs,
        parameters: &ControllerParametersFor<P::Nominal>,
    ) -> Result<Self, Box<dyn Error>> {
        args.reading.check_distinct(args.logs.iter().chain(&args.test))?;
        let (vehicle, data_config) = (parameters.vehicle.nominal(), parameters.data_config());
        let reading = parameters.reading::<S>(&args.reading.limit.road());
        let road = args.path.as_deref().map(|road| Path::named(road, &reading).map(|read| (read, road)));
        let road = road.transpose()?;
        let steering = |speed: f64| steady_steering(&vehicle, speed);
        let mut notes = Vec::new();
        let mut read = |files: &[PathBuf]| -> Result<_, Box<dyn Error>> {
            let (mut drives, mut angles) = (Vec::new(), Vec::new());
            for file in files {
                let road = road.as_ref().map(|(road, file)| (road, *file));
                let log = args.reading.read(file)?;
                if P::KIND != "truck" && log.is_articulated() {
                    return Err(format!(
                        "{}: the log has an articulation angle, and the vehicle is a car: give the truck with --vehicle",
                        file.display()
                    )
                    .into());
                }
                drives.extend(drives_of(&log, road, &steering, &mut |note| notes.push(note))?);
                // What is wrong with a log was said above.
                angles.extend(SteeringLog::by_angle(&log, &steering).into_iter().flat_map(|log| log.drives));
            }
            let data: DataSet<VehicleLinearModel<P, S, C>, S> = DataSet::new(&drives, &vehicle, data_config)?;
            Ok((data, angles))
        };
        let (data, angles) = read(&args.logs)?;
        let test = if args.test.is_empty() { None } else { Some(read(&args.test)?.0) };
        notes.extend(found(data.report()));
        Ok(Self { data, angles, test, notes })
    }
}

/// Findings and repairs in the logs, in sentences.
fn found(report: &DataReport) -> Vec<String> {
    let mut notes = Vec::new();
    let mut note = |count: usize, text: &str| {
        if count > 0 {
            notes.push(format!("{count} {text}"));
        }
    };
    note(report.not_finite, "rows left out: a value is missing or not a number");
    note(report.implausible, "rows left out: a value cannot be");
    note(report.gaps, "gaps: no window reaches over them");
    let thinned = report.thinned.iter().map(|(drive, factor)| {
        format!("{drive}: recorded {factor} times as fast as the controller steps, and thinned")
    });
    notes.extend(thinned);
    let constant = report.constant.iter();
    notes.extend(constant.map(|column| format!("{column} never changes: its effect cannot be learned")));
    notes
}
