//! Courses for a tractor with a semi-trailer: the Sudoku's streets with wider turns, and ground off them.
//!
//! | element | radius | speed limit |
//! |---|---|---|
//! | right turn | 15 to 18 m | 15 km/h |
//! | left turn | 19 to 25 m | 20 km/h |
//! | U-turn | 12.5 to 15 m | 10 km/h |
//! | sweeper | 40 to 60 m | 35 km/h |
//! | cross-country | 22 m and more | 15 to 25 km/h |
//!
//! The routes are the mirror images of the car's in their streets, with radii of their own. Test route and training
//! route share no lane and no radius.

use super::pen::Pen;
use super::segment::{Course, Pose};
use super::sudoku::{Move, Style, Winding, cross_country, drive, off_road_of, street, u_turn};
use Move::{Left, Right, Straight, SweepLeft, SweepRight, UTurn};

/// Clothoids of a truck, longer than a car's: it turns its wheels more slowly.
const STYLE: Style = Style { right: 12.0, left: 14.0, u_turn: 10.0 };

/// Training: from crossing (1, 0) northwards.
const TRAIN: [Move; 32] = [
    Right(15.0),
    Straight,
    SweepLeft(50.0),
    Straight,
    Left(19.0),
    UTurn(12.5),
    Right(16.0),
    Right(17.0),
    Left(20.0),
    Straight,
    SweepRight(60.0),
    Straight,
    SweepRight(40.0),
    Straight,
    Right(18.0),
    Left(21.0),
    Right(15.5),
    Right(16.5),
    Left(22.0),
    Right(17.5),
    Straight,
    Right(15.0),
    Right(16.0),
    Left(23.0),
    Right(17.0),
    Right(18.0),
    Left(24.0),
    Left(25.0),
    SweepLeft(60.0),
    Straight,
    SweepRight(50.0),
    Left(21.0),
];

/// Testing: from crossing (3, 1) westwards.
const TEST: [Move; 12] = [
    Right(15.8),
    SweepLeft(55.0),
    Straight,
    SweepRight(45.0),
    Right(16.7),
    UTurn(13.5),
    Left(19.6),
    Straight,
    Left(22.4),
    Right(17.3),
    Left(20.7),
    Straight,
];

pub(super) fn train() -> Course {
    let mut pen = drive([1.0, 0.0], 1, &TRAIN, STYLE);
    pen.straight(60.0);
    let from = pen.length();
    cross_country(&mut pen, &Winding { length: 400.0, amplitude: 4.0, seed: 21 });
    // Back on the right, on the same ground.
    pen.u_turn(-22.0, u_turn(15.0, STYLE));
    cross_country(&mut pen, &Winding { length: 400.0, amplitude: 4.0, seed: 22 });
    pen.roughen(from, 121);
    pen.finish(false)
}

pub(super) fn test() -> Course {
    let mut pen = drive([3.0, 1.0], 2, &TEST, STYLE);
    pen.straight(60.0);
    let from = pen.length();
    cross_country(&mut pen, &Winding { length: 400.0, amplitude: 4.0, seed: 23 });
    pen.roughen(from, 123);
    pen.straight = street(1);
    pen.straight(40.0);
    pen.finish(false)
}

pub(super) fn off_road() -> Course {
    off_road_of(&Winding { length: 800.0, amplitude: 5.0, seed: 27 })
}

pub(super) fn u_turn_course() -> Course {
    let mut pen = Pen::new(Pose { x: 0.0, y: 0.0, yaw: 0.0 }, street(1));
    pen.straight(80.0);
    pen.u_turn(20.0, u_turn(12.5, STYLE));
    pen.straight(80.0);
    pen.finish(false)
}
