//! Correction of the reduced model by the full plant.

use super::channel::{CHANNELS, Channel};
use super::drive::{ROAD, ReplayDrive};
use super::run::{Correction, replay};
use super::vehicle::{Driven, ReplayVehicle};
use crate::vehicle::TruckEffects;

/// Difference of the full plant and the reduced model on a drive, all effects neutral: added to every replay. Both are
/// driven by the acceleration with which the plant keeps the log's speed. Additional forces in the log (a slope, a load
/// that the plant does not have) are no error of the reduced model.
///
/// # Errors
/// As [`replay`].
pub fn neutral<V: ReplayVehicle>(drive: &ReplayDrive, vehicle: &V) -> Result<Correction, String> {
    let mut plant = vehicle.clone();
    plant.set_drive_lag(0.0);
    let rows = drive.time.len();
    let own = |channel: &Channel| channel.corrected() && drive.channels.contains(channel);
    let columns = CHANNELS.iter().map(|channel| if own(channel) { vec![f64::NAN; rows] } else { Vec::new() });
    let mut driven =
        Driven { columns: columns.collect(), vx: drive.column("vx").to_vec(), accel_cmd: vec![0.0; rows] };
    for &stretch in &drive.stretches {
        plant.full(drive, stretch, &mut driven);
    }
    let mut same = ReplayDrive { accel_cmd: Some(driven.accel_cmd), ..drive.clone() };
    same.columns.insert("vx", driven.vx);
    // The plant is driven on a level road.
    ROAD.iter().for_each(|signal| drop(same.columns.remove(signal.name)));
    let reduced = replay(&same, &plant, &TruckEffects::default(), &Correction::default(), None)?;
    let mut columns = driven.columns;
    for (column, reduced) in columns.iter_mut().zip(&reduced.columns) {
        for (full, reduced) in column.iter_mut().zip(reduced) {
            *full = if (*full - reduced).is_finite() { *full - reduced } else { 0.0 };
        }
    }
    Ok(Correction { columns, receiver_late: 0.0 })
}
