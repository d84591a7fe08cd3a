//! The road below a vehicle.

/// A road where a vehicle is, its effects apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Right side low positive, rad.
    pub bank: f64,
    /// Uphill positive, rad.
    pub grade: f64,
    /// Factor on the friction of the tyres.
    pub friction: f64,
}

impl Default for Surface {
    /// Level, of the tyres' own friction.
    fn default() -> Self {
        Self { bank: 0.0, grade: 0.0, friction: 1.0 }
    }
}
