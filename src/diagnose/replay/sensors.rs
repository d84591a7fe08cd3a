//! A log as the replayed vehicle meets it: late columns, a scaled speed and a turned frame undone, what is driven and the road below.

use super::drive::{LEAST_SPEED, ROAD, ReplayDrive, at, at_within};
use crate::vehicle::{ReducedInput, ReducedStart, ReducedSteer, Surface, TruckEffects};

/// The sensors and commands of a drive under effects, within one stretch.
pub(super) struct Sensors<'a> {
    drive: &'a ReplayDrive,
    vx: &'a [f64],
    yaw: &'a [f64],
    place: [&'a [f64]; 2],
    road: [&'a [f64]; 3],
    /// What lies beyond a stretch may be another drive.
    stretch: (usize, usize),
    /// Factor of the speed, at least a tenth.
    pub scale: f64,
    twist: f64,
    yaw_rate_bias: f64,
    /// Bank of the road besides the column's, rad.
    bank: f64,
    /// Rows by which the receiver's columns are late.
    pub shift: f64,
    /// Rows by which the command is earlier: what is left of a negative delay.
    advance: f64,
}

impl<'a> Sensors<'a> {
    /// Of a drive; lateness of the receiver and `advance` in s.
    pub fn new(drive: &'a ReplayDrive, effects: &TruckEffects, receiver_late: f64, advance: f64) -> Self {
        let effects = &effects.vehicle;
        Self {
            drive,
            vx: drive.column("vx"),
            yaw: drive.column("yaw"),
            place: [drive.column("x"), drive.column("y")],
            road: ROAD.map(|signal| drive.column(signal.name)),
            stretch: (0, 0),
            scale: effects.speed_scale.max(0.1),
            twist: effects.heading_misalignment,
            yaw_rate_bias: effects.yaw_rate_bias,
            bank: effects.road_bank,
            shift: (effects.sensor_delay + receiver_late) / drive.step,
            advance: advance / drive.step,
        }
    }

    /// The same within a stretch.
    pub fn within(&self, stretch: (usize, usize)) -> Self {
        Self { stretch, ..*self }
    }

    fn at(&self, column: &[f64], row: f64) -> f64 {
        at_within(column, row, self.stretch)
    }

    /// True speed, m/s, from the sensor's and the sideways velocity.
    #[inline]
    pub fn speed(&self, row: f64, vy: f64) -> f64 {
        (self.at(self.vx, row + self.shift) / self.scale - self.twist * vy).max(0.5 * LEAST_SPEED)
    }

    /// True heading, rad, if it is known. A sensor that is turned turns its heading; one summed up has gathered the bias
    /// of its rate.
    fn heading(&self, row: f64) -> Option<f64> {
        let Self { drive, stretch: (from, _), .. } = self;
        let off = || {
            if self.yaw.is_empty() {
                self.yaw_rate_bias * drive.step * (row - *from as f64)
            } else {
                self.twist
            }
        };
        (!drive.heading.is_empty()).then(|| self.at(&drive.heading, row + self.shift) - off())
    }

    /// The start of the stretch.
    pub fn start(&self) -> ReducedStart {
        let Self { drive, stretch: (from, _), .. } = *self;
        let first = |name: &str| drive.columns.get(name).map_or(0.0, |column| column[from]);
        let f = from as f64;
        ReducedStart {
            vx: self.speed(f, 0.0),
            vy: first("vy"),
            yaw_rate: first("yaw_rate"),
            yaw: self.heading(f).unwrap_or(0.0),
            steer: if drive.columns.contains_key("steer") { first("steer") } else { drive.steer[from] },
            accel: drive.accel[from],
            articulation: first("articulation"),
            articulation_rate: first("articulation_rate"),
        }
    }

    /// Sideways velocity, m/s, and yaw rate, rad/s, of a row as the model means them; `vy` where none was measured.
    pub fn motion(&self, row: usize, vy: f64) -> (f64, f64) {
        let logged =
            |name: &str| self.drive.columns.get(name).map(|column| self.at(column, row as f64 + self.shift));
        let true_vy =
            logged("vy").map_or(vy, |vy| vy / self.scale + self.twist * self.speed(row as f64, 0.0));
        (true_vy, logged("yaw_rate").map_or(0.0, |rate| rate - self.yaw_rate_bias))
    }

    /// Input of the vehicle in a row, a `share` of it on.
    #[inline]
    pub fn input(&self, row: usize, share: f64, vy: f64) -> ReducedInput {
        let drive = self.drive;
        let r = row as f64 + share;
        let steer = if drive.commanded {
            let now = if drive.holds() { row as f64 } else { r };
            ReducedSteer::Commanded(self.at(&drive.steer, now + self.advance))
        } else {
            ReducedSteer::Measured(self.at(&drive.steer, r))
        };
        let (accel, accel_is_given) = match &drive.accel_cmd {
            Some(asked) if drive.holds() => (asked[row], false),
            Some(asked) => (self.at(asked, r), false),
            None => (drive.accel[row], true),
        };
        let [bank, grade, friction] = self.road.map(|column| column.get(row).copied());
        let surface = Surface {
            bank: bank.unwrap_or(0.0),
            grade: grade.unwrap_or(0.0),
            friction: friction.unwrap_or(1.0),
        };
        ReducedInput { steer, accel, accel_is_given, vx: self.speed(r, vy), yaw: self.heading(r), surface }
    }

    /// Bank of the road below a row, rad.
    pub fn bank(&self, row: usize) -> f64 {
        self.road[0].get(row).map_or(0.0, |bank| *bank) + self.bank
    }

    /// Change of the speed over a row by the log, m/s.
    pub fn speed_gained(&self, row: usize) -> f64 {
        let (here, next) = self.ends(row);
        (self.at(self.vx, next) - self.at(self.vx, here)) / self.scale
    }

    /// Change of the heading over a row by the log, rad.
    pub fn turned(&self, row: usize) -> f64 {
        let (here, next) = self.ends(row);
        self.at(self.yaw, next) - self.at(self.yaw, here)
    }

    /// Way along and across the vehicle over a row by the log, m.
    pub fn moved(&self, row: usize) -> [f64; 2] {
        let (here, next) = self.ends(row);
        let [dx, dy] = self.place.map(|column| self.at(column, next) - self.at(column, here));
        let middle = 0.5 * (self.at(self.yaw, next) + self.at(self.yaw, here)) - self.twist;
        let (sin, cos) = middle.sin_cos();
        [cos * dx + sin * dy, cos * dy - sin * dx]
    }

    /// Begin and end of a row on the receiver's clock.
    fn ends(&self, row: usize) -> (f64, f64) {
        (row as f64 + self.shift, row as f64 + 1.0 + self.shift)
    }
}

/// Shifts a column by a fractional number of rows within each stretch.
pub(super) fn delay(column: &mut [f64], shift: f64, stretches: &[(usize, usize)]) {
    for &(from, to) in stretches {
        let before = column[from..to].to_vec();
        for (i, value) in column[from..to].iter_mut().enumerate() {
            *value = at(&before, i as f64 - shift);
        }
    }
}
