//! What a linear model knows of a tractor with a semi-trailer.

/// A tractor with a semi-trailer on three axles, as a single track.
///
/// Distances are positive in the order front axle, CG of the tractor, its rear axle and hitch, CG of the trailer, its
/// axle. Axle groups count as one axle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Articulated {
    /// Mass of the tractor, kg.
    pub mass1: f64,
    /// Mass of the trailer, kg.
    pub mass2: f64,
    /// Yaw inertia of the tractor, kg m2.
    pub yaw_inertia1: f64,
    /// Yaw inertia of the trailer, kg m2.
    pub yaw_inertia2: f64,
    /// Distance from the tractor's CG to its front axle, m.
    pub a1: f64,
    /// Distance from the tractor's CG to its rear axle, m.
    pub b1: f64,
    /// Distance from the tractor's CG back to the hitch, m.
    pub c1: f64,
    /// Distance from the trailer's CG forward to the hitch, m.
    pub a2: f64,
    /// Distance from the trailer's CG back to its axle, m.
    pub b2: f64,
    /// Cornering stiffness of the axles, from front to rear (all tyres of each), N/rad.
    pub stiffness: [f64; 3],
}
