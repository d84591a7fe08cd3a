//! Place of a log on a road, and the road's properties there.
//!
//! The station of each row is the log's own, or that of the foot of its pose on the road. From it follow bank, grade
//! and friction, which act on a vehicle and are in no sensor's signal.

use super::clean_log::CleanLog;
use crate::path::{Path, Projection};
use crate::signal;

/// Distance from a road beyond which the log belongs to another one, m.
pub(super) const FAR: f64 = 10.0;

/// Reasons for which a log does not lie on a road.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum NotOnRoad {
    #[error("the log has neither e1 and station nor x, y and yaw: where on the path it was cannot be told")]
    NoPlace,
    #[error(
        "the log lies more than {FAR} m from the path in {share:.0} % of its rows: is this the path that was driven?"
    )]
    FarFromPath { share: f64 },
}

/// Projects one pose (m, m, rad) of a drive after the other, each near the last. One farther away than `lost`, m, is
/// searched on the whole road.
pub(super) fn follow(road: &Path, lost: f64) -> impl FnMut([f64; 3]) -> Projection + use<'_> {
    let mut last = None;
    move |[x, y, yaw]| {
        let mut at = road.project(x, y, yaw, last);
        if last.is_some() && at.e1.abs() > lost {
            at = road.project(x, y, yaw, None);
        }
        last = Some(at.station);
        at
    }
}

impl CleanLog {
    /// Station and lateral error of each row, m, as recorded or by projection of the pose onto `road`.
    ///
    /// # Errors
    /// A log without either; a road that it did not drive.
    pub fn places(&self, road: &Path) -> Result<Vec<(f64, f64)>, NotOnRoad> {
        let column = |name: &str| self.columns.get(name);
        let rows = 0..self.time.len();
        let places: Vec<(f64, f64)> =
            match (column("station"), column("e1"), column("x"), column("y"), column("yaw")) {
                (Some(station), Some(e1), ..) => rows.map(|row| (station[row], e1[row])).collect(),
                (_, _, Some(x), Some(y), Some(yaw)) => {
                    let mut follow = follow(road, FAR);
                    rows.map(|row| follow([x[row], y[row], yaw[row]])).map(|at| (at.station, at.e1)).collect()
                }
                _ => return Err(NotOnRoad::NoPlace),
            };
        let valid = || places.iter().zip(&self.valid).filter(|(_, valid)| **valid);
        let far = valid().filter(|((_, error), _)| error.abs() > FAR).count();
        if 2 * far > valid().count() {
            return Err(NotOnRoad::FarFromPath { share: 100.0 * far as f64 / valid().count() as f64 });
        }
        Ok(places)
    }

    /// Gives each row bank, grade and friction of `road` where it was driven, in place of the log's own.
    ///
    /// # Errors
    /// As [`places`](Self::places).
    pub fn lay_on(&mut self, road: &Path) -> Result<(), NotOnRoad> {
        let places = self.places(road)?;
        let points: Vec<_> = places.iter().map(|(station, _)| road.at(*station)).collect();
        for (signal, of) in [
            (signal::BANK, (|point| point.bank) as fn(&crate::path::PathPoint) -> f64),
            (signal::GRADE, |point| point.grade),
            (signal::FRICTION, |point| point.friction),
        ] {
            self.columns.insert(signal.name, points.iter().map(of).collect());
        }
        Ok(())
    }
}
