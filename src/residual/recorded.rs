//! Drives as recorded, row by row, and the report of their repairs.

use super::ROAD;
use crate::signal::{self, Signal};
use crate::vehicle::Surface;

/// One drive in columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Drive {
    /// Name in messages, e.g. the file's name.
    pub name: String,
    /// Time, s, increasing.
    pub time: Vec<f64>,
    /// Road-wheel angle commanded from this row on, rad.
    pub steer_cmd: Vec<f64>,
    /// Lateral error, m.
    pub e1: Vec<f64>,
    /// Its rate, m/s.
    pub e1_rate: Vec<f64>,
    /// Yaw error, rad.
    pub e2: Vec<f64>,
    /// Its rate, rad/s.
    pub e2_rate: Vec<f64>,
    /// Longitudinal velocity, m/s.
    pub vx: Vec<f64>,
    /// Curvature of the path, 1/m.
    pub curvature: Vec<f64>,
    /// Change of the curvature along the path, 1/m2.
    pub curvature_rate: Vec<f64>,
    /// Articulation angle, rad; empty for a vehicle without one.
    pub articulation: Vec<f64>,
    /// Its rate, rad/s.
    pub articulation_rate: Vec<f64>,
    /// Bank of the road, rad; empty where none is told.
    pub bank: Vec<f64>,
    /// Factor of the road on the tyres' friction; empty where none is told.
    pub friction: Vec<f64>,
}

impl Drive {
    /// Names and columns that every drive has, in order.
    #[must_use]
    pub fn columns(&self) -> [(&'static str, &[f64]); 9] {
        [
            ("time", &self.time),
            ("steer_cmd", &self.steer_cmd),
            ("e1", &self.e1),
            ("e1_rate", &self.e1_rate),
            ("e2", &self.e2),
            ("e2_rate", &self.e2_rate),
            ("vx", &self.vx),
            ("curvature", &self.curvature),
            ("curvature_rate", &self.curvature_rate),
        ]
    }

    /// The columns, in the order of [`columns`](Self::columns), to be filled.
    pub fn columns_mut(&mut self) -> [&mut Vec<f64>; 9] {
        [
            &mut self.time,
            &mut self.steer_cmd,
            &mut self.e1,
            &mut self.e1_rate,
            &mut self.e2,
            &mut self.e2_rate,
            &mut self.vx,
            &mut self.curvature,
            &mut self.curvature_rate,
        ]
    }

    /// The column of a name; empty if drives have none of that name.
    #[must_use]
    pub fn column(&self, name: &str) -> &[f64] {
        let further: [(&str, &[f64]); 4] = [
            ("articulation", &self.articulation),
            ("articulation_rate", &self.articulation_rate),
            (signal::BANK.name, &self.bank),
            (signal::FRICTION.name, &self.friction),
        ];
        let mut all = self.columns().into_iter().chain(further);
        all.find(|(known, _)| *known == name).map_or(&[], |(_, column)| column)
    }
}

/// Recorded quantities of a vehicle with these states.
pub(super) struct Recorded<'a, const S: usize> {
    /// The drive's name.
    pub name: &'a str,
    /// Time, command, states, road.
    pub columns: Vec<(&'static str, &'a [f64])>,
    /// Bank and friction of the road, empty where they are not told.
    surface: [&'a [f64]; 2],
}

impl<'a, const S: usize> Recorded<'a, S> {
    pub fn new(drive: &'a Drive, states: &[Signal; S]) -> Self {
        let states = states.iter().map(|signal| signal.name);
        let names = ["time", "steer_cmd"].into_iter().chain(states).chain(ROAD_NAMES);
        let columns = names.map(|name| (name, drive.column(name))).collect();
        Self { name: &drive.name, columns, surface: [&drive.bank, &drive.friction] }
    }

    pub fn time(&self) -> &'a [f64] {
        self.columns[0].1
    }

    pub fn row(&self, i: usize) -> DriveRow<S> {
        let at = |column: usize| self.columns[column].1[i];
        let level = Surface::default();
        let told = |place: usize, level: f64| {
            self.surface[place].get(i).copied().filter(|value| value.is_finite()).unwrap_or(level)
        };
        DriveRow {
            command: at(1),
            state: std::array::from_fn(|s| at(2 + s)),
            road: std::array::from_fn(|r| at(2 + S + r)),
            surface: Surface { bank: told(0, level.bank), friction: told(1, level.friction), ..level },
        }
    }
}

/// Features of the road and speed by name.
pub(super) const ROAD_NAMES: [&str; ROAD] = ["vx", "curvature", "curvature_rate"];

/// One row of a drive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DriveRow<const S: usize> {
    /// Angle at the wheels that is planned, rad.
    pub command: f64,
    pub state: [f64; S],
    /// Speed, curvature, curvature rate.
    pub road: [f64; ROAD],
    /// The road below.
    pub surface: Surface,
}

/// Findings in the drives, and repairs made.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DataReport {
    /// Rows of all drives.
    pub rows: usize,
    /// Rows left out because a value is not a number.
    pub not_finite: usize,
    /// Rows left out because a value is impossible, e.g. a yaw error of 20 rad.
    pub implausible: usize,
    /// Interruptions within drives, left-out rows among them.
    pub gaps: usize,
    /// Drives sampled faster than the controller, and by which factor they were thinned.
    pub thinned: Vec<(String, usize)>,
    /// Columns that never change: nothing can be learned about their effect.
    pub constant: Vec<&'static str>,
    /// Steps with a next row: labels.
    pub labels: usize,
}
