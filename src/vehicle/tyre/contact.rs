//! Contact of a tyre with the road, and the forces in it.

/// Contact of a tyre with the road. The default is a wheel in the air.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Contact<T = f64> {
    /// Longitudinal slip `(omega R - Vx) / |Vx|`, positive when driving.
    pub kappa: T,
    /// Slip angle `atan(Vsy / |Vx|)` in rad, positive when the contact patch slips to the left.
    pub alpha: T,
    /// Inclination to the road in rad, positive with the wheel's top to the right.
    pub gamma: T,
    /// Load in N.
    pub load: T,
    /// Factor on the road's friction; 1 as the tyre was measured.
    pub friction: T,
}

/// Forces on the wheel in the contact patch, ISO axes of the wheel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TyreForces<T = f64> {
    /// Longitudinal force, N.
    pub fx: T,
    /// Lateral force, N.
    pub fy: T,
    /// Overturning moment, N m.
    pub mx: T,
    /// Self-aligning moment, N m.
    pub mz: T,
}
