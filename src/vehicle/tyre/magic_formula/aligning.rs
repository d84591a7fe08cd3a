//! The self-aligning moment: pneumatic trail, residual torque, and the arm of the longitudinal force.
//!
//! ```text
//! Mz = -D_t cos(C_t atan(...)) cos(alpha) (Fy - induced) + D_r cos(atan(B_r alpha_r)) cos(alpha) + s Fx
//! ```

use super::{Coefficients, Curve, Planar, WheelSlip, cos_atan, equivalent, with_slip};
use crate::numerics::lanes::Lanes;
use crate::vehicle::trigonometry::atan_of;

impl<T: Copy> Coefficients<T> {
    /// True if a file has a moment at all; most of the cost of one is saved without.
    #[inline(always)]
    fn has_aligning_moment<L: Lanes<Stored = T>>(&self) -> bool {
        take!(self; qdz1 qdz2 qdz6 qdz7 qdz8 qdz9 ssz1 ssz2 ssz3 ssz4);
        let all = [qdz1, qdz2, qdz6, qdz7, qdz8, qdz9, ssz1, ssz2, ssz3, ssz4];
        !all.iter().all(|value| value.is_zero())
    }

    /// Self-aligning moments from pneumatic trail, residual torque and the arm of the longitudinal force.
    #[inline(always)]
    pub(super) fn aligning_moment<L: Lanes<Stored = T>>(
        &self,
        wheel: &WheelSlip<L>,
        tangent: L,
        planar: &Planar<L>,
    ) -> L {
        if !self.has_aligning_moment::<L>() {
            return L::splat(0.0);
        }
        take!(self; lgaz qhz1 qhz2 qhz3 qhz4 qdz1 qdz2 qdz3 qdz4 r0 fz0 ltr ssz1 ssz2 ssz3 ssz4 ls);
        let WheelSlip { contact, load, dfz, longitudinal, lateral, .. } = *wheel;
        // Longitudinal slip acts on the trail like slip angle.
        let slip = longitudinal.stiffness / lateral.stiffness * contact.kappa;
        let gamma = contact.gamma * lgaz;
        let shift = qhz1 + qhz2 * dfz + (qhz3 + qhz4 * dfz) * gamma;
        let tangent_t = if shift.is_zero() {
            with_slip(contact.alpha, tangent, slip)
        } else {
            equivalent(contact.alpha + shift, slip)
        };
        let alpha_t = atan_of(tangent_t);
        let cos_alpha = cos_atan(tangent);
        let dt = load
            * (qdz1 + qdz2 * dfz)
            * (L::splat(1.0) + qdz3 * gamma + qdz4 * gamma * gamma)
            * (r0 / fz0)
            * ltr;
        let trail = dt * self.trail_curve(wheel, alpha_t).cos() * cos_alpha;
        let residual = self.residual_moment(wheel, slip) * cos_alpha;
        let arm = (ssz1 + ssz2 * planar.fy / fz0 + (ssz3 + ssz4 * dfz) * contact.gamma) * r0 * ls;
        -trail * (planar.fy - planar.induced) + residual + arm * planar.fx
    }

    /// The curve whose cosine is the pneumatic trail's.
    #[inline(always)]
    fn trail_curve<L: Lanes<Stored = T>>(&self, wheel: &WheelSlip<L>, alpha_t: L) -> Curve<L> {
        take!(self; lgaz lmuy qbz1 qbz2 qbz3 qbz4 qbz5 lky qez1 qez2 qez3 qez4 qez5 qcz1);
        let one = L::splat(1.0);
        let WheelSlip { contact, dfz, .. } = *wheel;
        let gamma = contact.gamma * lgaz;
        let friction = lmuy * contact.friction;
        let b = (qbz1 + qbz2 * dfz + qbz3 * dfz * dfz) * (one + qbz4 * gamma + qbz5 * gamma.abs()) * lky
            / friction;
        let mut e = qez1 + qez2 * dfz + qez3 * dfz * dfz;
        if !(qez4.is_zero() && qez5.is_zero()) {
            let angle = atan_of(b * qcz1 * alpha_t);
            e = e * (one + (qez4 + qez5 * gamma) * L::splat(std::f64::consts::FRAC_2_PI) * angle);
        }
        Curve { x: alpha_t, b, c: qcz1, e: e.min(one) }
    }

    /// Residual moment at zero slip angle's cosine of 1, N m.
    #[inline(always)]
    fn residual_moment<L: Lanes<Stored = T>>(&self, wheel: &WheelSlip<L>, slip: L) -> L {
        take!(self; qdz6 qdz7 qdz8 qdz9 lgaz lmuy qbz9 qbz10 lky lres r0);
        if qdz6.is_zero() && qdz7.is_zero() && qdz8.is_zero() && qdz9.is_zero() {
            return L::splat(0.0);
        }
        let WheelSlip { contact, load, dfz, lateral, .. } = *wheel;
        let gamma = contact.gamma * lgaz;
        let friction = lmuy * contact.friction;
        let shift_f = lateral.shift_h + lateral.shift_v / lateral.stiffness;
        let br = qbz9 * lky / friction + qbz10 * lateral.b_times_c;
        let dr = load * ((qdz6 + qdz7 * dfz) * lres + (qdz8 + qdz9 * dfz) * gamma) * r0 * friction;
        dr * cos_atan(br * atan_of(equivalent(contact.alpha + shift_f, slip)))
    }
}
