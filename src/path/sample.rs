//! Material of a road before it is a [`Path`](super::Path): points, in driving order.

use crate::table::Limits;

/// One point of a road, as a file or a generator gives it. Only the position is needed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// East position in m.
    pub x: f64,
    /// North position in m.
    pub y: f64,
    /// Heading of the road in rad, counter-clockwise from east.
    pub yaw: Option<f64>,
    /// Curvature in 1/m, positive in left turns.
    pub curvature: Option<f64>,
    /// Speed limit, or speed driven, in m/s.
    pub speed: Option<f64>,
    /// Bank in rad, positive with the right side low.
    pub bank: Option<f64>,
    /// Grade in rad, positive uphill.
    pub grade: Option<f64>,
    /// Friction coefficient of the road as a factor of the tyre's nominal grip; 1 is a dry road.
    pub friction: Option<f64>,
    /// Class of the road, for results that are split by it.
    pub class: Option<RoadClass>,
}

impl Sample {
    /// A point with a position and nothing else.
    #[must_use]
    pub fn at(x: f64, y: f64) -> Self {
        Self { x, y, ..Self::default() }
    }
}

/// Closure of a road: it ends, or leads back to its start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Closure {
    /// Closed if the last point lies within two spacings and the noise of the first, and leads on into it.
    #[default]
    Detect,
    /// The road ends at its last point.
    Open,
    /// The road leads from its last point back to its first.
    Closed,
}

/// Allowed distance of a path from its points, for a smooth curvature.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Smoothing {
    /// Accuracy of the file. For racetrack-database it is 2 cm RMS: points 5 m apart, drawn from satellite images, that
    /// enter bends without a transition. Else it is the rounding of the coordinates: 1 m points with 3 decimals have a
    /// curvature error of 1e-3 1/m from rounding alone. Coordinates in steps that are coarser, 0.1 m or 1 m, are rounded if
    /// the points lie about as far from a smooth road as rounding puts them, and else drawn by hand, and exact.
    #[default]
    AsAccurate,
    /// No smoothing: the path goes through every point.
    None,
    /// Within a root-mean-square distance in m: for measured points, about their noise (0.02 for a good GPS).
    Within(f64),
}

/// Options of the conversion from points to a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathOptions {
    /// Closure of the road.
    pub closure: Closure,
    /// Allowed distance from its points.
    pub smoothing: Smoothing,
    /// Least radius in m that the vehicle drives ([`ControllerParametersFor::reading`](crate::control::ControllerParametersFor::reading)):
    /// corners of the points are rounded with it. `None`: the path goes through them.
    pub least_radius: Option<f64>,
    /// Limits of reading a file.
    pub limits: Limits,
}

impl Default for PathOptions {
    /// 256 MB unpacked, a million points.
    fn default() -> Self {
        let limits = Limits { bytes: 256 << 20, rows: 1_000_000 };
        Self { closure: Closure::default(), smoothing: Smoothing::default(), least_radius: None, limits }
    }
}

/// The kind of a stretch of road, by which results are split (method: "Reference paths").
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RoadClass {
    /// Straight road.
    Straight,
    /// A tight right turn at a crossing.
    RightTurn,
    /// A left turn at a crossing.
    LeftTurn,
    /// A U-turn.
    UTurn,
    /// A wide bend.
    Sweeper,
    /// Unpaved, uneven road.
    CrossCountry,
}

impl RoadClass {
    /// All classes, in the order in which a table lists them.
    pub const ALL: [RoadClass; 6] =
        [Self::Straight, Self::RightTurn, Self::LeftTurn, Self::UTurn, Self::Sweeper, Self::CrossCountry];

    /// The name in column `class` and in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Straight => "straight",
            Self::RightTurn => "right_turn",
            Self::LeftTurn => "left_turn",
            Self::UTurn => "u_turn",
            Self::Sweeper => "sweeper",
            Self::CrossCountry => "cross_country",
        }
    }

    /// The class of a name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|class| class.name() == name)
    }
}
