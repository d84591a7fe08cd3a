//! The linear model of a tractor with a semi-trailer: a careful engineer's nominal model of a truck.
//!
//! The articulation is `phi = yaw1 - yaw2`, the speed `u`; `h = c1 + a2` and `l2 = a2 + b2`. With the lateral velocity
//! and yaw rate `v`, `r` of the tractor's CG (indices: 1 tractor, 2 semi-trailer):
//!
//! ```text
//!     M [v' + u r; r'; phi''] = G diag(C) alpha,    alpha = [delta; 0; 0] - G' [v; r; phi'] / u - [0; 0; 1] phi
//!
//!         [ m1+m2    -m2 h             m2 a2        ]        [ 1    1    1        ]
//!     M = [ -m2 h    I1+I2+m2 h^2    -(I2+m2 a2 h)  ]    G = [ a1  -b1  -(h + b2) ]
//!         [ m2 a2    -(I2+m2 a2 h)     I2+m2 a2^2   ]        [ 0    0    l2       ]
//! ```

use serde::{Deserialize, Serialize};

/// Parameters of the linear tractor and semi-trailer; axles are the front, the rear and the trailer's axle group.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Articulated {
    /// Mass of the tractor, kg.
    pub mass1: f64,
    /// Mass of the semi-trailer, kg.
    pub mass2: f64,
    /// Yaw inertia of the tractor about its CG, kg m2.
    pub yaw_inertia1: f64,
    /// Yaw inertia of the semi-trailer about its CG, kg m2.
    pub yaw_inertia2: f64,
    /// Distance from the tractor's CG to its front axle, m.
    pub a1: f64,
    /// Distance from the tractor's CG to its rear axle, m.
    pub b1: f64,
    /// Distance from the tractor's CG back to the hitch, m.
    pub c1: f64,
    /// Distance from the semi-trailer's CG forward to the hitch, m.
    pub a2: f64,
    /// Distance from the semi-trailer's CG back to its axle group, m.
    pub b2: f64,
    /// Cornering stiffness of each axle group (all its tyres), N/rad: front, rear, trailer.
    pub stiffness: [f64; 3],
}
