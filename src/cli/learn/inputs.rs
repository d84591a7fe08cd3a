//! Checks before the first drive: the road to learn on has bends, and no result is written over what is read.

use super::super::files::{check_folder, given};
use super::LearnArgs;
use crate::path::Path;
use std::error::Error;
use std::path::PathBuf;

/// Range of headings within which a road is straight, rad.
const STRAIGHT: f64 = 0.02;

/// Checks that there is a bend to learn from.
pub(super) fn check_road(args: &LearnArgs, road: &Path) -> Result<(), Box<dyn Error>> {
    match &args.path {
        Some(file) if args.roads == 0 && is_straight(road) => Err(format!(
            "{}: the road is straight: a drive on it shows no bend to learn from; give another (--path), or random roads beside it \
             (--roads)",
            file.display()
        )
        .into()),
        _ => Ok(()),
    }
}

/// Checks that no file of the folder for results is one of those that are read.
pub(super) fn check_outputs(args: &LearnArgs) -> Result<(), Box<dyn Error>> {
    let mut names = ["drive.csv", "controller.toml", "model.rflm", "train.json", "learn.json"]
        .map(str::to_owned)
        .to_vec();
    names.extend((1..=args.roads.saturating_add(1)).map(|number| format!("collect_{number}.csv")));
    let vehicle = Some(PathBuf::from(&args.vehicle));
    check_folder(
        &args.out,
        &names,
        &given([("--path", &args.path), ("--test", &args.test), ("--vehicle", &vehicle)]),
    )
}

/// True if a road has one heading from its beginning to its end.
fn is_straight(road: &Path) -> bool {
    let stations = (0..=road.length() as usize).map(|station| road.at(station as f64).yaw);
    let [least, most] = stations
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], yaw| [least.min(yaw), most.max(yaw)]);
    most - least < STRAIGHT
}
