//! What a vehicle asks of the road under it.

/// The road at one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoadPoint {
    /// Heading of the road in rad.
    pub yaw: f64,
    /// Bank in rad, right side low positive.
    pub bank: f64,
    /// Grade in rad, uphill along the heading positive.
    pub grade: f64,
    /// Factor on the friction of the tyres.
    pub friction: f64,
}

impl RoadPoint {
    /// A level road with the friction on which the tyres were measured.
    #[must_use]
    pub fn level(yaw: f64) -> Self {
        Self { yaw, bank: 0.0, grade: 0.0, friction: 1.0 }
    }
}

/// A road with bank, grade and friction along its length.
pub trait Road: Send + Sync {
    /// Arc length in m of the point nearest to a place (m) with a heading (rad), near `hint` if there is one.
    fn station(&self, x: f64, y: f64, yaw: f64, hint: Option<f64>) -> f64;

    /// The road at an arc length in m.
    fn at(&self, station: f64) -> RoadPoint;
}
