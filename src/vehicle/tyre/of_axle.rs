//! The tyres of an axle, as a vehicle file gives them.

use super::{Coefficients, Contact, TyreModel as _};
use serde::{Deserialize, Serialize};

/// The tyres of one axle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tyre {
    /// The `.tir` file: relative to the vehicle file, or the name of a tyre that is built in.
    pub file: String,
    /// Factor on the cornering stiffness.
    #[serde(default = "unscaled")]
    pub stiffness_scale: f64,
    /// Factor on both friction coefficients.
    #[serde(default = "unscaled")]
    pub friction_scale: f64,
    /// Vertical stiffness in N/m; 0 in a file: the `.tir` file's.
    #[serde(default)]
    pub vertical_stiffness: f64,
    /// Sideways shift of the contact patch for each newton of lateral force, m/N.
    #[serde(default)]
    pub lateral_compliance: f64,
    /// Coefficients of the file.
    #[serde(skip)]
    pub coefficients: Option<Coefficients>,
}

impl Tyre {
    /// The tyre's coefficients with this axle's factors.
    ///
    /// # Panics
    /// Never for parameters that were read: they carry their coefficients.
    #[must_use]
    pub fn scaled(&self) -> Coefficients {
        let mut tyre = self.coefficients.clone().expect("a tyre that was read has its coefficients");
        tyre.lky *= self.stiffness_scale;
        tyre.lmux *= self.friction_scale;
        tyre.lmuy *= self.friction_scale;
        tyre.vertical_stiffness = self.vertical_stiffness;
        tyre
    }

    /// Friction coefficient of an axle's tyres, sideways on the road of their measurement. `load` is that of the axle in N,
    /// carried by this many tyres on each side.
    pub(in crate::vehicle) fn axle_friction(&self, load: f64, per_side: f64) -> f64 {
        self.scaled().lateral_friction(0.5 * load / per_side)
    }

    /// Slope of the lateral force of an axle over slip angle, N/rad. `load` is that of the axle in N, carried by this
    /// many tyres on each side.
    pub(in crate::vehicle) fn axle_stiffness(&self, load: f64, per_side: f64) -> f64 {
        const STEP: f64 = 1e-4;
        let tyre = self.scaled();
        let at = |alpha| {
            let contact =
                Contact { kappa: 0.0, alpha, gamma: 0.0, load: 0.5 * load / per_side, friction: 1.0 };
            tyre.forces(&contact).fy
        };
        // The right wheel carries the mirror image of the left wheel's tyre: Fy_right(alpha) = -Fy_left(-alpha).
        per_side * 2.0 * (at(-STEP) - at(STEP)) / (2.0 * STEP)
    }
}

/// Factor of tyres as their file has them.
fn unscaled() -> f64 {
    1.0
}
