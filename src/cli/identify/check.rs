//! Closed-loop check of an identified actuator on our plant: it must drive better than the unchanged vehicle file.
//!
//! The plant has the identified actuator, or those at the ends of the intervals. The controller predicts with the
//! identified one or with that of the file. A short road with turns is enough: a controller that does not know its
//! delay swings there.

use super::super::drive::Setup;
use super::super::vehicle::Commanded;
use crate::control::{ControllerFor, PredictionModelFor};
use crate::nominal::{Actuator, IdentifiedSteering};
use crate::path::sudoku::Route;
use crate::simulate::ClosedLoopFor;
use crate::vehicle::VehicleParameters;
use serde_json::{Value, json};
use std::error::Error;
use std::sync::Arc;

/// Longest drive, s.
const LONGEST: f64 = 40.0;
/// A lane's width: beyond it the vehicle is lost, m.
const LOST: f64 = 3.5;
/// Errors whose means differ by less are the same, m.
const SAME: f64 = 1e-3;

/// One plant, driven with and without the identified actuator.
pub(super) struct CheckRow {
    plant: &'static str,
    actuator: Actuator,
    known: CheckDrive,
    left: CheckDrive,
}

#[derive(Clone, Copy)]
struct CheckDrive {
    mean: f64,
    max: f64,
    lost: bool,
}

/// A number of a vehicle's table.
pub(super) fn number<F: VehicleParameters>(vehicle: &F, name: &str) -> Option<f64> {
    F::TABLE.iter().find(|parameter| parameter.name == name).map(|parameter| parameter.get(vehicle))
}

/// Sets a number of a vehicle's table.
fn set<F: VehicleParameters>(vehicle: &mut F, name: &str, value: f64) {
    if let Some(parameter) = F::TABLE.iter().find(|parameter| parameter.name == name) {
        parameter.set(vehicle, value);
    }
}

/// Drives them.
pub(super) fn drives<P: Commanded<S, C>, const S: usize, const C: usize>(
    setup: &Setup<P, S, C>,
    found: &IdentifiedSteering,
) -> Result<Vec<CheckRow>, Box<dyn Error>> {
    let route = if P::KIND == "truck" { Route::TruckUTurn } else { Route::SudokuTurns };
    let path = Arc::new(route.path()?);
    let mut effects = setup.effects.clone();
    let mut effect = |id: &str| P::effect(&mut effects, id).map_or(0.0, |value| *value);
    let added = [effect("steer_delay"), effect("steer_lag"), effect("steer_backlash")];
    let of_file = |name: &str, added: f64| number(&setup.vehicle, name).unwrap_or(0.0) + added;
    let actuator =
        |dead_time: f64, time_constant: f64| Actuator { dead_time, time_constant, ..Actuator::default() };
    let known = found.actuator();
    let left = actuator(of_file("steering.dead_time", added[0]), of_file("steering.lag", added[1]));
    let (dead_time, lag) = (found.dead_time, found.lag);
    let sample_time = setup.controller.mpc.sample_time;
    let mut informed = setup.controller;
    if let Some(width) = found.backlash {
        informed.actuator.backlash = width.value;
    }
    [
        ("as found", known),
        ("at the lower ends", actuator(dead_time.low.max(0.0), lag.low.max(0.0))),
        ("at the upper ends", actuator(dead_time.high.min(1.0), lag.high.min(1.0))),
    ]
    .into_iter()
    .map(|(plant, truth)| {
        let mut vehicle = setup.vehicle.clone();
        set(&mut vehicle, "steering.dead_time", (truth.dead_time - added[0]).max(0.0));
        set(&mut vehicle, "steering.lag", (truth.time_constant - added[1]).max(0.0));
        if let Some(width) = found.backlash {
            set(&mut vehicle, "steering.backlash", (width.value - added[2]).max(0.0));
        }
        let drive = |parameters: &_, model: Actuator| -> Result<CheckDrive, Box<dyn Error>> {
            let model = PredictionModelFor::Actuator(model);
            let controller = ControllerFor::predicting_with(*parameters, path.clone(), model)?;
            let mut closed =
                ClosedLoopFor::<P, S, C>::at_start(controller, &vehicle, &setup.effects, sample_time)?;
            let drive = closed.drive_until_lost(LONGEST, |_, error| error.abs() < LOST)?;
            let tracking = drive.tracking();
            Ok(CheckDrive { mean: tracking.mae, max: tracking.max, lost: drive.lost })
        };
        Ok(CheckRow {
            plant,
            actuator: truth,
            known: drive(&informed, known)?,
            left: drive(&setup.controller, left)?,
        })
    })
    .collect()
}

impl CheckDrive {
    fn worse_than(self, other: Self) -> bool {
        (self.lost && !other.lost) || (self.lost == other.lost && self.mean > other.mean + SAME)
    }

    fn words(self) -> String {
        if self.lost { "lost".to_owned() } else { format!("{:.4} {:.4}", self.mean, self.max) }
    }
}

/// Prints them; true if the identified actuator loses a vehicle that stays on the road without it.
pub(super) fn print(rows: &[CheckRow]) -> bool {
    say!(
        "{:<22} {:>11} {:>8} {:>18} {:>18}",
        "closed loop, plant",
        "dead time s",
        "lag s",
        "known: mean max m",
        "left: mean max m"
    );
    for CheckRow { plant, actuator, known, left } in rows {
        say!(
            "{plant:<22} {:>11.4} {:>8.4} {:>18} {:>18}",
            actuator.dead_time,
            actuator.time_constant,
            known.words(),
            left.words()
        );
    }
    for row in rows.iter().filter(|row| row.known.worse_than(row.left)) {
        warn!(
            "warning: knowing it does not drive better on the plant {}: {} m against {} m of the vehicle file as it is",
            row.plant,
            row.known.words(),
            row.left.words()
        );
    }
    rows.iter().any(|row| row.known.lost && !row.left.lost)
}

/// The results.
pub(super) fn as_json(rows: &[CheckRow]) -> Value {
    let driven = |driven: CheckDrive| json!({"mean": driven.mean, "max": driven.max, "lost": driven.lost});
    rows.iter()
        .map(|row| {
            json!({
                "plant": row.plant, "dead_time": row.actuator.dead_time, "lag": row.actuator.time_constant,
                "known": driven(row.known), "left": driven(row.left),
                "better": !row.known.worse_than(row.left),
            })
        })
        .collect()
}
