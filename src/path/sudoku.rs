//! Courses of our own drawing: a stand-in for the "Changshu Sudoku", and a circuit with a hairpin.
//!
//! The Sudoku is a town of 3 x 3 blocks of 150 m (Zhao et al. drive one; its geometry is not public). Streets have
//! a lane of 3.5 m each way, traffic keeps right, and clothoids lead into every bend. Off the grid lies uneven
//! ground: |curvature| up to 0.05 1/m, friction 0.5 to 0.6, bank and grade up to 5 %.
//!
//! | element | radius | speed limit |
//! |---|---|---|
//! | right turn | 10 to 12 m | 15 km/h |
//! | left turn | 16 to 20 m | 20 km/h |
//! | U-turn | 6.5 to 7 m | 10 km/h |
//! | sweeper | 40 to 60 m | 35 km/h |
//! | straight | | 40 to 50 km/h |
//! | cross-country | 22 m and more | 15 to 25 km/h |
//!
//! No lane (street and direction) of the training route is on the test route, and no radius either.

use super::pen::{Pen, Rounding, corner_tangent};
use super::sample::{RoadClass, Sample};
use super::segment::{Course, Pose};
use super::{Closure, Path, PathError, PathOptions, to_csv, truck_course};
use crate::numerics::Random;
use std::f64::consts::{FRAC_PI_2, PI};

/// Length of a block in m.
const BLOCK: f64 = 150.0;
/// From a street's middle to the middle of its lane in m.
const LANE: f64 = 1.75;
/// Longest step between points of a course's file in m.
pub const SPACING: f64 = 1.0;

/// A course of our own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Route {
    /// Training: about 6 km with every element.
    SudokuTrain,
    /// Testing: other streets, radii and unevenness.
    SudokuTest,
    /// A right turn and a left turn (Zhao et al., Fig. 6).
    SudokuTurns,
    /// A closed circuit with a hairpin of 10 m radius.
    HairpinCircuit,
    /// An unseen off-road path.
    OffRoad,
    /// Training a truck: about 6 km with every element.
    TruckTrain,
    /// Testing a truck: other streets, radii and unevenness.
    TruckTest,
    /// An unseen off-road path for a truck (the truck paper's Fig. 5).
    TruckOffRoad,
    /// A U-turn for a truck (the truck paper's Fig. 11).
    TruckUTurn,
}

use Move::{Left, Right, Straight, SweepLeft, SweepRight, UTurn};

/// Move of a route at a crossing; radii in m.
#[derive(Debug, Clone, Copy)]
pub(super) enum Move {
    Straight,
    Right(f64),
    Left(f64),
    SweepRight(f64),
    SweepLeft(f64),
    UTurn(f64),
}

/// Lengths of the clothoids into the turns of a kind of vehicle, m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Style {
    pub right: f64,
    pub left: f64,
    pub u_turn: f64,
}

/// A car's.
const CAR: Style = Style { right: 7.0, left: 10.0, u_turn: 8.0 };

/// Training: from crossing (2, 0) northwards.
const TRAIN: [Move; 32] = [
    Left(16.0),
    Straight,
    SweepRight(50.0),
    Straight,
    Right(10.0),
    UTurn(6.5),
    Left(17.5),
    Left(19.0),
    Right(11.0),
    Straight,
    SweepLeft(60.0),
    Straight,
    SweepLeft(40.0),
    Straight,
    Left(20.0),
    Right(12.0),
    Left(16.0),
    Left(17.0),
    Right(10.5),
    Left(18.0),
    Straight,
    Left(19.5),
    Left(20.0),
    Right(11.5),
    Left(16.5),
    Left(17.5),
    Right(12.0),
    Right(10.0),
    SweepRight(60.0),
    Straight,
    SweepLeft(50.0),
    Right(11.0),
];

/// Testing: from crossing (0, 1) eastwards.
const TEST: [Move; 12] = [
    Left(18.5),
    SweepRight(55.0),
    Straight,
    SweepLeft(45.0),
    Left(16.8),
    UTurn(6.75),
    Right(10.2),
    Straight,
    Right(11.8),
    Left(19.3),
    Right(10.7),
    Straight,
];

impl Route {
    /// All courses.
    pub const ALL: [Route; 9] = [
        Self::SudokuTrain,
        Self::SudokuTest,
        Self::SudokuTurns,
        Self::HairpinCircuit,
        Self::OffRoad,
        Self::TruckTrain,
        Self::TruckTest,
        Self::TruckOffRoad,
        Self::TruckUTurn,
    ];

    /// The course's name, and the stem of its file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SudokuTrain => "sudoku_train",
            Self::SudokuTest => "sudoku_test",
            Self::SudokuTurns => "sudoku_turns",
            Self::HairpinCircuit => "hairpin_circuit",
            Self::OffRoad => "off_road",
            Self::TruckTrain => "truck_train",
            Self::TruckTest => "truck_test",
            Self::TruckOffRoad => "truck_off_road",
            Self::TruckUTurn => "truck_u_turn",
        }
    }

    /// Summary of the course, in one line.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::SudokuTrain => "training route through the Sudoku and off its grid, every element",
            Self::SudokuTest => "test route: other lanes, radii and unevenness than the training route",
            Self::SudokuTurns => "a right turn and a left turn between straights",
            Self::HairpinCircuit => "closed circuit with a hairpin of 10 m radius",
            Self::OffRoad => "off-road path that is on no other route",
            Self::TruckTrain => "truck: training route, every element with turns that it can take",
            Self::TruckTest => "truck: test route, other lanes, radii and unevenness than the training route",
            Self::TruckOffRoad => "truck: off-road path that is on no other route",
            Self::TruckUTurn => "truck: a U-turn of 12.5 m radius between straights",
        }
    }

    /// The course of a name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|route| route.name() == name)
    }

    /// The course, exactly.
    #[must_use]
    pub fn course(self) -> Course {
        match self {
            Self::SudokuTrain => train(),
            Self::SudokuTest => test(),
            Self::SudokuTurns => turns(),
            Self::HairpinCircuit => hairpin_circuit(),
            Self::OffRoad => off_road(7),
            Self::TruckTrain => truck_course::train(),
            Self::TruckTest => truck_course::test(),
            Self::TruckOffRoad => truck_course::off_road(),
            Self::TruckUTurn => truck_course::u_turn_course(),
        }
    }

    /// The course as its file has it: through the file's text, so that the numbers have its rounding.
    ///
    /// # Errors
    /// None, unless a course was changed so that it is no path any more.
    pub fn path(self) -> Result<Path, PathError> {
        self.path_with(&PathOptions::default())
    }

    /// As [`path`](Self::path), closed and smoothed as the options say.
    ///
    /// # Errors
    /// Options that do not fit the course.
    pub fn path_with(self, options: &PathOptions) -> Result<Path, PathError> {
        let known = if self.course().closed { Closure::Closed } else { Closure::Open };
        let closure = if options.closure == Closure::Detect { known } else { options.closure };
        let options = PathOptions { closure, ..*options };
        Path::from_csv(to_csv(&self.samples()).as_bytes(), self.name().as_ref(), &options)
    }

    /// The course as points at most 1 m apart.
    #[must_use]
    pub fn samples(self) -> Vec<Sample> {
        self.course().samples(SPACING)
    }
}

/// km/h in m/s.
fn kmh(speed: f64) -> f64 {
    speed / 3.6
}

/// Speed limits of the streets, one after the other, in km/h.
const STREETS: [f64; 5] = [45.0, 40.0, 50.0, 42.5, 47.5];

pub(super) fn street(index: usize) -> (RoadClass, f64) {
    (RoadClass::Straight, kmh(STREETS[index % STREETS.len()]))
}

fn right_turn(radius: f64, style: Style) -> Rounding {
    Rounding { radius, transition: style.right, class: RoadClass::RightTurn, speed: kmh(15.0) }
}

fn left_turn(radius: f64, style: Style) -> Rounding {
    Rounding { radius, transition: style.left, class: RoadClass::LeftTurn, speed: kmh(20.0) }
}

fn sweeper(radius: f64) -> Rounding {
    Rounding { radius, transition: 0.4 * radius, class: RoadClass::Sweeper, speed: kmh(35.0) }
}

pub(super) fn u_turn(radius: f64, style: Style) -> Rounding {
    Rounding { radius, transition: style.u_turn, class: RoadClass::UTurn, speed: kmh(10.0) }
}

/// Unit vector of a heading in quarter turns from east.
fn direction(quarters: i32) -> [f64; 2] {
    [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][quarters.rem_euclid(4) as usize]
}

/// Place where the lane of heading `quarters` passes the crossing: the crossing's middle, and to the right of it.
fn lane(crossing: [f64; 2], quarters: i32) -> [f64; 2] {
    let to_the_right = direction(quarters - 1);
    [0, 1].map(|k| crossing[k] + LANE * to_the_right[k])
}

/// Drives through the grid; gives the pen at the last crossing, heading off the grid.
pub(super) fn drive(start: [f64; 2], heading: i32, moves: &[Move], style: Style) -> Pen {
    let mut crossing = start.map(|index| index * BLOCK);
    let mut quarters = heading;
    let at = lane(crossing, quarters);
    let mut pen = Pen::new(Pose { x: at[0], y: at[1], yaw: f64::from(quarters) * FRAC_PI_2 }, street(0));
    for (index, &action) in moves.iter().enumerate() {
        let ahead = direction(quarters);
        crossing = [0, 1].map(|k| crossing[k] + BLOCK * ahead[k]);
        let (turn, rounding) = match action {
            Straight => continue,
            Right(radius) => (-1, right_turn(radius, style)),
            Left(radius) => (1, left_turn(radius, style)),
            SweepRight(radius) => (-1, sweeper(radius)),
            SweepLeft(radius) => (1, sweeper(radius)),
            UTurn(radius) => (2, u_turn(radius, style)),
        };
        if turn == 2 {
            // It begins before the crossing and swings out on it.
            let to_go = distance_ahead(&pen, crossing);
            pen.straight(to_go - 12.0);
            pen.u_turn(2.0 * LANE, rounding);
            quarters += 2;
        } else {
            let next = quarters + turn;
            let (here, there) = (lane(crossing, quarters), lane(crossing, next));
            // The crossing point of two perpendicular lanes: one gives x, the other y.
            let vertex = if quarters.rem_euclid(2) == 0 { [there[0], here[1]] } else { [here[0], there[1]] };
            pen.corner(vertex, f64::from(next) * FRAC_PI_2, rounding);
            quarters = next;
        }
        pen.straight = street(index + 1);
    }
    let ahead = direction(quarters);
    crossing = [0, 1].map(|k| crossing[k] + BLOCK * ahead[k]);
    let to_go = distance_ahead(&pen, crossing);
    pen.straight(to_go);
    pen
}

/// Distance of a point ahead of the pen, along its heading.
fn distance_ahead(pen: &Pen, point: [f64; 2]) -> f64 {
    let pose = pen.pose();
    (point[0] - pose.x) * pose.yaw.cos() + (point[1] - pose.y) * pose.yaw.sin()
}

/// Windings of an off-road track.
pub(super) struct Winding {
    pub length: f64,
    /// Greatest distance of a vertex from the middle line in m.
    pub amplitude: f64,
    pub seed: u64,
}

/// Draws a winding track that ends on the pen's line.
pub(super) fn cross_country(pen: &mut Pen, winding: &Winding) {
    let base = pen.pose();
    let (sin, cos) = base.yaw.sin_cos();
    let mut random = Random::new(winding.seed);
    // Vertices along and beside the line; the first and the last lie on it.
    let count = (winding.length / 36.0).round().max(3.0) as usize;
    let pitch = winding.length / count as f64;
    let vertices: Vec<[f64; 2]> = (0..=count)
        .map(|i| {
            let along = pitch * (i as f64 + if i % count == 0 { 0.0 } else { random.between(-0.12, 0.12) });
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            let beside =
                if i % count == 0 { 0.0 } else { side * winding.amplitude * random.between(0.35, 1.0) };
            [base.x + along * cos - beside * sin, base.y + along * sin + beside * cos]
        })
        .collect();
    // The track begins and ends along the line, so its ends are corners, too.
    let mut yaws: Vec<f64> =
        vertices.windows(2).map(|pair| (pair[1][1] - pair[0][1]).atan2(pair[1][0] - pair[0][0])).collect();
    yaws.push(base.yaw);
    let speed = kmh(25.0);
    pen.straight = (RoadClass::CrossCountry, speed);
    // The first vertex lies ahead of the pen by what its rounding wants.
    let lead = 12.0;
    let shift = [lead * cos, lead * sin];
    for (vertex, &yaw) in vertices.iter().zip(&yaws) {
        let vertex = [vertex[0] + shift[0], vertex[1] + shift[1]];
        let angle = super::wrap_angle(yaw - pen.pose().yaw);
        let mut rounding = Rounding {
            radius: random.between(22.0, 45.0),
            transition: 5.0,
            class: RoadClass::CrossCountry,
            speed,
        };
        while corner_tangent(angle, rounding) < 0.1 * pitch && rounding.radius < 90.0 {
            rounding.radius *= 1.1;
        }
        pen.corner(vertex, yaw, rounding);
    }
    let end =
        [base.x + shift[0] * 2.0 + winding.length * cos, base.y + shift[1] * 2.0 + winding.length * sin];
    let to_go = distance_ahead(pen, end);
    pen.straight(to_go);
}

/// A turning place off the grid, to the right, on the same ground.
fn turning_place(pen: &mut Pen, radius: f64) {
    pen.u_turn(-11.0, u_turn(radius, CAR));
}

fn train() -> Course {
    let mut pen = drive([2.0, 0.0], 1, &TRAIN, CAR);
    pen.straight(60.0);
    let from = pen.length();
    cross_country(&mut pen, &Winding { length: 400.0, amplitude: 2.6, seed: 1 });
    turning_place(&mut pen, 7.0);
    cross_country(&mut pen, &Winding { length: 400.0, amplitude: 2.6, seed: 2 });
    pen.roughen(from, 101);
    pen.finish(false)
}

fn test() -> Course {
    let mut pen = drive([0.0, 1.0], 0, &TEST, CAR);
    pen.straight(60.0);
    let from = pen.length();
    cross_country(&mut pen, &Winding { length: 400.0, amplitude: 4.0, seed: 3 });
    pen.roughen(from, 103);
    pen.straight = street(1);
    pen.straight(40.0);
    pen.finish(false)
}

fn turns() -> Course {
    let mut pen = Pen::new(Pose { x: 0.0, y: 0.0, yaw: 0.0 }, street(0));
    pen.corner([90.0, 0.0], -FRAC_PI_2, right_turn(11.2, CAR));
    pen.straight = street(1);
    pen.corner([90.0, -110.0], 0.0, left_turn(18.2, CAR));
    pen.straight = street(3);
    pen.straight(90.0);
    pen.finish(false)
}

/// The off-road path of a seed: another seed is another path.
#[must_use]
pub fn off_road(seed: u64) -> Course {
    off_road_of(&Winding { length: 500.0, amplitude: 5.0, seed })
}

/// An off-road path between two short straights.
pub(super) fn off_road_of(winding: &Winding) -> Course {
    let mut pen = Pen::new(Pose { x: 0.0, y: 0.0, yaw: PI / 6.0 }, street(1));
    pen.straight(40.0);
    let from = pen.length();
    cross_country(&mut pen, winding);
    pen.roughen(from, winding.seed.wrapping_add(100));
    pen.straight = street(1);
    pen.straight(40.0);
    pen.finish(false)
}

/// The corners of the hairpin circuit: vertex, radius, transition, speed limit in km/h, class.
const CIRCUIT: [([f64; 2], f64, f64, f64, RoadClass); 6] = [
    ([240.0, 0.0], 35.0, 14.0, 40.0, RoadClass::Sweeper),
    ([270.0, 120.0], 25.0, 12.0, 30.0, RoadClass::LeftTurn),
    ([60.0, 130.0], 10.0, 9.0, 18.0, RoadClass::UTurn),
    ([190.0, 70.0], 14.0, 10.0, 20.0, RoadClass::UTurn),
    ([-40.0, 50.0], 16.0, 9.0, 25.0, RoadClass::LeftTurn),
    ([-60.0, 0.0], 13.0, 9.0, 20.0, RoadClass::LeftTurn),
];

fn hairpin_circuit() -> Course {
    let start = [60.0, 0.0];
    let mut pen = Pen::new(Pose { x: start[0], y: start[1], yaw: 0.0 }, (RoadClass::Straight, kmh(80.0)));
    for (i, &(vertex, radius, transition, speed, class)) in CIRCUIT.iter().enumerate() {
        let next = CIRCUIT.get(i + 1).map_or(start, |corner| corner.0);
        let yaw = (next[1] - vertex[1]).atan2(next[0] - vertex[0]);
        pen.corner(vertex, yaw, Rounding { radius, transition, class, speed: kmh(speed) });
    }
    let to_go = distance_ahead(&pen, start);
    pen.straight(to_go);
    pen.finish(true)
}
