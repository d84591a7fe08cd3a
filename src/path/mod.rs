//! Reference paths.
//!
//! A road comes as points, uneven and perhaps noisy; a controller needs, at any arc length `s`,
//!
//! ```text
//!     r(s) with |r'| = 1,   yaw(s) = atan2(y', x'),   curvature(s) = d yaw / ds   (continuous)
//! ```
//!
//! and, for a vehicle at `p` with yaw angle `psi`, the nearest point's station and the errors
//!
//! ```text
//!     e1 = (p - r) . n   (positive to the left),   e2 = psi - yaw(s)   in (-pi, pi]
//! ```
//!
//! ```
//! use rfl_mpc::path::{Closure, Path, Sample, SpeedLimits, SpeedPlan};
//!
//! // A ring road of 50 m radius, from points 5 m apart.
//! let points = (0..63).map(|i| f64::from(i) * 0.1).map(|a| Sample::at(50.0 * a.sin(), 50.0 - 50.0 * a.cos()));
//! let road = Path::from_samples(points.collect(), Closure::Detect)?;
//! assert!(road.is_periodic() && (road.curvature(100.0) - 0.02).abs() < 1e-4);
//!
//! // A vehicle 1 m to the left of the start, that heads along the road.
//! let foot = road.project(0.0, 1.0, 0.0, None);
//! assert!((foot.e1 - 1.0).abs() < 1e-3 && foot.e2.abs() < 1e-3);
//!
//! let plan = SpeedPlan::new(&road, &SpeedLimits { lateral_accel: 2.0, accel: 1.0, decel: 1.0, ..SpeedLimits::default() });
//! assert!((plan.speed(0.0) - 10.0).abs() < 0.05);
//! # Ok::<(), rfl_mpc::path::PathError>(())
//! ```
//!
//! | file | idea |
//! |---|---|
//! | `sample.rs` | the points of a road |
//! | `check.rs` | checks of a road's points: duplicates, gaps |
//! | `corners.rs`, `two_arcs.rs` | corners rounded for a vehicle |
//! | `seam.rs` | whether a road's end leads into its start |
//! | `draw.rs` | the curve of a road whose points are checked |
//! | `sway.rs` | roads that sway with the errors of their points |
//! | `straight.rs` | straights that a map gives no points for |
//! | `spline.rs` | a curve with continuous curvature through them |
//! | `smooth.rs`, `banded.rs` | the same through noisy points, within a tolerance |
//! | `grid.rs`, `quadrature.rs` | arc length: lookups in constant time |
//! | `project.rs` | the nearest point, with a hint and without |
//! | `speed.rs` | a speed plan within lateral and longitudinal limits |
//! | `axle_shares.rs` | what drive and brakes ask of each axle beside its load |
//! | `read.rs`, `write.rs` | files |
//! | `accuracy.rs`, `lap.rs`, `rows.rs` | digits of coordinates; laps of a log; rows of stations |
//! | `segment.rs`, `pen.rs` | roads drawn exactly from straights, arcs and clothoids |
//! | `sudoku.rs`, `truck_course.rs` | our own courses |
//! | `quantity.rs`, `guessed.rs` | bank, grade, friction and speed between points; bends that the points do not tell |
//! | `random.rs` | roads by the seed, to be searched and examined on |
//! | `error.rs` | errors of a road |

mod accuracy;
mod axle_shares;
mod banded;
mod check;
mod corners;
mod draw;
mod error;
mod geodetic;
mod grid;
mod guessed;
mod lap;
mod noise;
mod note;
mod pen;
mod project;
mod quadrature;
mod quantity;
mod random;
mod read;
mod rows;
mod sample;
mod seam;
mod segment;
mod smooth;
mod speed;
mod spline;
mod stops;
mod straight;
pub mod sudoku;
mod sway;
mod truck_course;
mod two_arcs;
mod write;

pub use axle_shares::AxleShares;
pub use corners::RoundedCorner;
pub use error::{InputPlace, PathError, WrittenName};
pub use note::Note;
pub use project::{Projection, Where};
pub use random::RandomRoad;
pub use sample::{Closure, PathOptions, RoadClass, Sample, Smoothing};
pub use segment::{Course, Pose, Rough, Segment};
pub use speed::{
    BRAKED_SHARE, CAR_GRIP, DRIVEN_SHARE, SpeedLimits, SpeedPlan, TRUCK_GRIP, TightestTurn, USED_GRIP,
};
pub use write::{to_csv, write_csv};

use crate::table::{self, TableError};
use grid::{Cell, Grid, yaw_at};
use quantity::{PathQuantity, Spot};
use rows::RoadRows;
use speed::SharedPlans;
use spline::evaluate;
use std::f64::consts::{PI, TAU};
use std::io::ErrorKind;

/// Half of a vehicle's length, m.
const REACH: f64 = 2.5;

/// A reference path, immutable; share it in an `Arc`. Lookups take constant time and allocate nothing.
///
/// Stations of a closed path may exceed its length: they wrap, and the yaw angle goes on turning. Beyond the ends of an
/// open path the road goes straight on.
#[derive(Debug, Clone)]
pub struct Path {
    origin: [f64; 2],
    step: f64,
    inverse_step: f64,
    length: f64,
    periodic: bool,
    cells: Vec<Cell>,
    /// Yaw gained in one lap of a closed path in rad: a multiple of 2 pi.
    turn: f64,
    bank: PathQuantity,
    grade: PathQuantity,
    friction: PathQuantity,
    speed: PathQuantity,
    classes: Vec<Option<RoadClass>>,
    notes: Vec<Note>,
    corners: Vec<RoundedCorner>,
    rows: RoadRows,
    hash: u64,
    plans: SharedPlans,
}

/// A path at one station.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint {
    /// East position in m.
    pub x: f64,
    /// North position in m.
    pub y: f64,
    /// Heading in rad, continuous along the path (not wrapped).
    pub yaw: f64,
    /// Curvature in 1/m, positive in left turns.
    pub curvature: f64,
    /// Change of curvature per arc length in 1/m2.
    pub curvature_rate: f64,
    /// Bank in rad, positive with the right side low; 0 where not given.
    pub bank: f64,
    /// Grade in rad, positive uphill; 0 where not given.
    pub grade: f64,
    /// Friction factor; 1 where not given.
    pub friction: f64,
    /// Speed limit, or speed driven, in m/s, if the road's file gives one.
    pub speed: Option<f64>,
    /// Class of the road, if the road's file gives one.
    pub class: Option<RoadClass>,
}

impl Path {
    /// A path through points in driving order, exactly.
    ///
    /// # Errors
    /// The cause and the point: too few points, values that are not finite or out of range, gaps, points out of order.
    pub fn from_samples(samples: Vec<Sample>, closure: Closure) -> Result<Self, PathError> {
        Self::from_samples_with(
            samples,
            &PathOptions { closure, smoothing: Smoothing::None, ..PathOptions::default() },
        )
    }

    /// A path through points in driving order, or near them.
    ///
    /// # Errors
    /// As [`Path::from_samples`], and for a smoothing tolerance that is none.
    pub fn from_samples_with(samples: Vec<Sample>, options: &PathOptions) -> Result<Self, PathError> {
        Ok(Self::from_road(check::check(samples, options, accuracy::Accuracy::Exact)?, None))
    }

    /// Reads a path from a CSV file: ours, the racetrack-database format, or a driven lap (`x_m,y_m,v_driven_mps`).
    ///
    /// Ours has a header and these columns, in any order; all but the first two are optional, and an optional value
    /// may be left empty:
    ///
    /// | column | unit | meaning |
    /// |---|---|---|
    /// | `x`, `y` | m | position, east and north |
    /// | `yaw`, `curvature` | rad, 1/m | heading and curvature, used if both are given |
    /// | `speed` | m/s | speed limit |
    /// | `bank`, `grade` | rad | positive with the right side low, positive uphill |
    /// | `friction` | 1 | factor of the tyre's nominal grip |
    /// | `class` | | [`RoadClass::name`] |
    /// | `s` | m | station; only its order is checked. One that starts anew ends a lap, and one lap is the road |
    ///
    /// If the file gives both `yaw` and `curvature` and they fit the points, they hold. Otherwise a spline through the
    /// points holds, smoothed to the accuracy of the file ([`Smoothing::AsAccurate`]).
    ///
    /// # Errors
    /// The cause, with file, line, column and remedy.
    pub fn read(file: &std::path::Path) -> Result<Self, PathError> {
        Self::read_with(file, &PathOptions::default())
    }

    /// A road by the name of a [built-in course](sudoku::Route), or from a file.
    ///
    /// # Errors
    /// As [`Path::read`].
    pub fn named(name: &std::path::Path, options: &PathOptions) -> Result<Self, PathError> {
        match name.to_str().and_then(sudoku::Route::from_name) {
            Some(course) => course.path_with(options),
            None => Self::read_with(name, options).map_err(|error| match error {
                PathError::Io { file, source } if source.kind() == ErrorKind::NotFound => {
                    PathError::Unknown {
                        file,
                        source,
                        builtin: sudoku::Route::ALL.map(sudoku::Route::name).to_vec(),
                    }
                }
                error => error,
            }),
        }
    }

    /// Reads a path with options for its closure and its smoothing.
    ///
    /// # Errors
    /// As [`Path::read`].
    pub fn read_with(file: &std::path::Path, options: &PathOptions) -> Result<Self, PathError> {
        let opened = table::open(file, options.limits).map_err(|error| match error {
            TableError::Io(source) => PathError::Io { file: file.to_path_buf(), source },
            source => PathError::Table { place: InputPlace::default(), source }.in_file(file, &[]),
        })?;
        Self::from_table(opened, file, options)
    }

    /// A path from the bytes of a CSV file; `name` stands for the file in messages.
    ///
    /// # Errors
    /// As [`Path::read`].
    pub fn from_csv(bytes: &[u8], name: &std::path::Path, options: &PathOptions) -> Result<Self, PathError> {
        Self::from_table(bytes, name, options)
    }

    fn from_table(
        reader: impl std::io::Read,
        name: &std::path::Path,
        options: &PathOptions,
    ) -> Result<Self, PathError> {
        let mut table = read::parse(reader, options.limits).map_err(|error| error.in_file(name, &[]))?;
        let mut road = check::check(table.samples, options, table.accuracy)
            .map_err(|error| error.in_file(name, &table.lines).with_columns(&table.columns))?;
        table.notes.append(&mut road.notes);
        road.notes = table.notes;
        Ok(Self::from_road(road, Some(&table.lines)))
    }

    /// `lines`: those of the points in their file.
    fn from_road(road: check::CheckedRoad, lines: Option<&[u64]>) -> Self {
        let check::CheckedRoad { samples, places, periodic, notes, mut corners, curve, origin, hash } = road;
        let grid = Grid::new(&curve);
        let count = grid.cells.len();
        let yaw_end = {
            let last = &grid.cells[count - 1];
            yaw_at(&last.yaw, grid.step)[0]
        };
        let turn = if periodic { ((yaw_end - grid.cells[0].yaw[0]) / TAU).round() * TAU } else { 0.0 };
        let node = |i: usize| i as f64 * grid.step;
        let channel = |default: f64, value: fn(&Sample) -> Option<f64>| {
            PathQuantity::new(&samples, &grid.mark_stations, default, value, (0..=count).map(node))
        };
        let classes = if samples.iter().any(|sample| sample.class.is_some()) {
            let mut index = 0;
            (0..count)
                .map(|i| {
                    let middle = node(i) + 0.5 * grid.step;
                    while index + 1 < samples.len() && grid.mark_stations[index + 1] <= middle {
                        index += 1;
                    }
                    samples[index].class
                })
                .collect()
        } else {
            Vec::new()
        };
        let rows = RoadRows::new(&grid.mark_stations, &places, lines);
        corners.iter_mut().for_each(|corner| corner.row = rows.number(corner.row as usize));
        let told = samples.iter().all(|sample| sample.yaw.is_some() && sample.curvature.is_some());
        let mut path = Self {
            origin,
            step: grid.step,
            inverse_step: 1.0 / grid.step,
            length: grid.length,
            periodic,
            turn,
            bank: channel(0.0, |sample| sample.bank),
            grade: channel(0.0, |sample| sample.grade),
            friction: channel(1.0, |sample| sample.friction),
            speed: channel(f64::NAN, |sample| sample.speed),
            classes,
            notes,
            corners,
            rows,
            hash,
            cells: grid.cells,
            plans: SharedPlans::default(),
        };
        let rounded = path.rounded_corners();
        path.notes.extend(rounded);
        let guessed = path.guessed_bend(&grid.mark_stations).filter(|_| !told);
        path.notes.extend(guessed);
        path
    }

    /// Arc length in m (closed: of one lap).
    #[must_use]
    pub fn length(&self) -> f64 {
        self.length
    }

    /// True if the path leads back to its start.
    #[must_use]
    pub fn is_periodic(&self) -> bool {
        self.periodic
    }

    /// Hash of the points that the road was made from: tells roads apart.
    #[must_use]
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// Notes on the road for its user: points dropped, columns not used, assumptions.
    #[must_use]
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// Corners of its points that were rounded for the vehicle ([`PathOptions::least_radius`]), in driving order.
    #[must_use]
    pub fn corners(&self) -> &[RoundedCorner] {
        &self.corners
    }

    /// The row of the road's points at a station in m, in words: `line 12` of a file, or `point 11`.
    #[must_use]
    pub fn row(&self, station: f64) -> String {
        self.rows.words(self.rows.at(station))
    }

    /// Everything at a station in m.
    #[must_use]
    pub fn at(&self, station: f64) -> PathPoint {
        let spot = self.locate(station);
        let cell = &self.cells[spot.cell];
        let mut point = PathPoint {
            x: self.origin[0] + evaluate(&cell.x, spot.offset)[0],
            y: self.origin[1] + evaluate(&cell.y, spot.offset)[0],
            yaw: 0.0,
            curvature: 0.0,
            curvature_rate: 0.0,
            bank: self.bank.at(&spot, self.inverse_step),
            grade: self.grade.at(&spot, self.inverse_step),
            friction: self.friction.at(&spot, self.inverse_step),
            speed: Some(self.speed.at(&spot, self.inverse_step)).filter(|speed| !speed.is_nan()),
            class: self.classes.get(spot.cell).copied().flatten(),
        };
        [point.yaw, point.curvature, point.curvature_rate] = yaw_at(&cell.yaw, spot.offset);
        point.yaw += spot.lap * self.turn;
        if spot.beyond != 0.0 {
            let (sin, cos) = point.yaw.sin_cos();
            point.x += spot.beyond * cos;
            point.y += spot.beyond * sin;
            point.curvature = 0.0;
            point.curvature_rate = 0.0;
        }
        point
    }

    /// Points of the path about `step` m apart, with heading, curvature and all that its file gave. Read again, they
    /// are the same road. A closed path's first point does not stand again at its end.
    #[must_use]
    pub fn samples(&self, step: f64) -> Vec<Sample> {
        let count = (self.length / step.max(1e-3))
            .ceil()
            .clamp(4.0, PathOptions::default().limits.rows as f64 - 1.0) as usize;
        let last = if self.periodic { count - 1 } else { count };
        let given = |channel: &PathQuantity, value: f64| (!channel.nodes.is_empty()).then_some(value);
        (0..=last)
            .map(|i| {
                let point = self.at(self.length * i as f64 / count as f64);
                Sample {
                    x: point.x,
                    y: point.y,
                    yaw: Some(point.yaw),
                    curvature: Some(point.curvature),
                    speed: point.speed,
                    bank: given(&self.bank, point.bank),
                    grade: given(&self.grade, point.grade),
                    friction: given(&self.friction, point.friction),
                    class: point.class,
                }
            })
            .collect()
    }

    /// The bend that is tighter than all others: station and radius, m; and the length, m, of road with less than
    /// `radius`. `None` if there is no such road.
    #[must_use]
    pub fn tighter_than(&self, radius: f64) -> Option<(f64, f64, f64)> {
        let count = (4.0 * self.length).ceil().clamp(1.0, 4e6) as usize;
        let step = self.length / count as f64;
        let bends =
            (0..=count).map(|i| i as f64 * step).map(|station| (station, self.curvature(station).abs()));
        let (mut tightest, mut length) = ((0.0, 1.0 / radius), 0.0);
        for (station, curvature) in bends.filter(|(_, curvature)| curvature * radius > 1.0) {
            length += step;
            if curvature > tightest.1 {
                tightest = (station, curvature);
            }
        }
        (length > 0.0).then(|| (tightest.0, 1.0 / tightest.1, length))
    }

    /// The least angle, rad, to a heading that is turned by `e2` from the road at a station, from the road's directions there and half a
    /// vehicle's length before and behind: at a corner a vehicle heads along one of its sides.
    #[must_use]
    pub(crate) fn least_turn(&self, station: f64, e2: f64) -> f64 {
        let here = self.at(station).yaw;
        let others = [-REACH, REACH].map(|by| wrap_angle(e2 + here - self.at(station + by).yaw));
        others.into_iter().fold(e2, |least, other| if other.abs() < least.abs() { other } else { least })
    }

    /// Curvature at a station in 1/m, positive in left turns; 0 beyond the ends of an open path.
    #[must_use]
    #[inline]
    pub fn curvature(&self, station: f64) -> f64 {
        self.bend(station)[0]
    }

    /// Change of curvature per arc length at a station in 1/m2; 0 beyond the ends of an open path.
    #[must_use]
    #[inline]
    pub fn curvature_rate(&self, station: f64) -> f64 {
        self.bend(station)[1]
    }

    /// Curvature in 1/m and its change per arc length in 1/m2 at a station; 0 beyond the ends of an open path.
    #[must_use]
    #[inline]
    pub fn bend(&self, station: f64) -> [f64; 2] {
        let spot = self.locate(station);
        if spot.beyond != 0.0 {
            return [0.0; 2];
        }
        let [_, curvature, curvature_rate] = yaw_at(&self.cells[spot.cell].yaw, spot.offset);
        [curvature, curvature_rate]
    }

    /// Friction factor at a station; 1 where not given.
    #[must_use]
    #[inline]
    pub fn friction(&self, station: f64) -> f64 {
        self.channel(&self.friction, station)
    }

    /// Bank at a station in rad, right side low positive; 0 where not given.
    #[must_use]
    #[inline]
    pub fn bank(&self, station: f64) -> f64 {
        self.channel(&self.bank, station)
    }

    /// Grade at a station in rad, uphill positive; 0 where not given.
    #[must_use]
    #[inline]
    pub fn grade(&self, station: f64) -> f64 {
        self.channel(&self.grade, station)
    }

    #[inline]
    fn channel(&self, channel: &PathQuantity, station: f64) -> f64 {
        if channel.nodes.is_empty() {
            return channel.default;
        }
        channel.at(&self.locate(station), self.inverse_step)
    }

    /// True if the path has neither bank nor grade anywhere.
    #[must_use]
    #[inline]
    pub fn is_level(&self) -> bool {
        self.bank.nodes.is_empty() && self.grade.nodes.is_empty()
    }

    /// The cell of a station. A station that is not finite counts as the start.
    #[inline]
    fn locate(&self, station: f64) -> Spot {
        let mut s = if station.is_finite() { station } else { 0.0 };
        let (mut lap, mut beyond) = (0.0, 0.0);
        if s < 0.0 || s > self.length {
            if self.periodic {
                lap = (s / self.length).floor();
                s = (s - lap * self.length).clamp(0.0, self.length);
            } else {
                let inside = s.clamp(0.0, self.length);
                beyond = s - inside;
                s = inside;
            }
        }
        let cell = ((s * self.inverse_step) as usize).min(self.cells.len() - 1);
        Spot { cell, offset: s - cell as f64 * self.step, lap, beyond }
    }
}

/// An angle in (-pi, pi].
#[must_use]
#[inline]
pub fn wrap_angle(angle: f64) -> f64 {
    let wrapped = angle - TAU * (angle / TAU).round();
    if wrapped <= -PI {
        wrapped + TAU
    } else if wrapped > PI {
        wrapped - TAU
    } else {
        wrapped
    }
}
