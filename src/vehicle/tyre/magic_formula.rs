//! The Magic Formula 5.2: forces and moments of one wheel in its contact patch.

use super::coefficients::Coefficients;

/// How a tyre meets the road.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Longitudinal slip `(omega R - Vx) / |Vx|`, positive when driving.
    pub kappa: f64,
    /// Slip angle `atan(Vsy / |Vx|)` in rad, positive when the contact patch slips to the left.
    pub alpha: f64,
    /// Inclination to the road in rad, positive with the wheel's top to the right.
    pub gamma: f64,
    /// Load in N.
    pub load: f64,
    /// Factor on the road's friction; 1 as the tyre was measured.
    pub friction: f64,
}

/// Forces on the wheel in the contact patch, ISO axes of the wheel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TyreForces {
    /// Longitudinal force, N.
    pub fx: f64,
    /// Lateral force, N.
    pub fy: f64,
    /// Overturning moment, N m.
    pub mx: f64,
    /// Self-aligning moment, N m.
    pub mz: f64,
}

/// Loads under this carry no force: the wheel has left the road.
const LIFTED: f64 = 1e-3;

/// `sin(C atan(B x - E (B x - atan(B x))))`.
#[inline]
fn curve_sin(x: f64, b: f64, c: f64, e: f64) -> f64 {
    let bx = b * x;
    let inner = if e == 0.0 { bx } else { bx - e * (bx - bx.atan()) };
    (c * inner.atan()).sin()
}

/// `cos(C atan(B x - E (B x - atan(B x))))`.
#[inline]
fn curve_cos(x: f64, b: f64, c: f64, e: f64) -> f64 {
    let bx = b * x;
    let inner = if e == 0.0 { bx } else { bx - e * (bx - bx.atan()) };
    (c * inner.atan()).cos()
}

/// `cos(atan(x))` without a call to either.
#[inline]
fn cos_atan(x: f64) -> f64 {
    1.0 / (1.0 + x * x).sqrt()
}

/// `sin(2 atan(x))` without a call to either.
#[inline]
fn sin_2atan(x: f64) -> f64 {
    2.0 * x / (1.0 + x * x)
}

/// The sign of `x`, 0 at 0.
#[inline]
fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}

/// Pure lateral slip: the force and what the combined force and the moment need of it.
struct Lateral {
    force: f64,
    peak: f64,
    friction: f64,
    stiffness: f64,
    b_times_c: f64,
    shift_h: f64,
    shift_v: f64,
}

impl Coefficients {
    /// Nominal load with its scaling factor, N.
    #[inline]
    fn nominal(&self) -> f64 {
        self.fz0 * self.lfzo
    }

    /// Relative deviation from the nominal load.
    #[inline]
    fn dfz(&self, load: f64) -> f64 {
        (load - self.nominal()) / self.nominal()
    }

    /// The load at which the formula is taken, and the factor from its force to the force at the real load:
    /// above the file's range it is clamped, below it forces vanish in proportion to the load.
    #[inline]
    fn range_of_load(&self, load: f64) -> (f64, f64) {
        if load < self.fzmin { (self.fzmin, load / self.fzmin) } else { (load.min(self.fzmax), 1.0) }
    }

    /// Effective rolling radius at the nominal load, m.
    #[must_use]
    pub fn rolling_radius(&self) -> f64 {
        let deflection = self.fz0 / self.vertical_stiffness;
        self.r0 - deflection * (self.dreff * self.breff.atan() + self.freff)
    }

    /// Cornering stiffness `-dFy/dalpha` of the pure lateral characteristic at its zero, N/rad, positive.
    #[must_use]
    pub fn cornering_stiffness(&self, load: f64, gamma: f64) -> f64 {
        let (at, factor) = self.range_of_load(load);
        -factor * self.lateral_stiffness(at, gamma)
    }

    /// Slip stiffness `dFx/dkappa` of the pure longitudinal characteristic at its zero, N.
    #[must_use]
    pub fn slip_stiffness(&self, load: f64) -> f64 {
        let (at, factor) = self.range_of_load(load);
        factor * self.longitudinal_stiffness(at, self.dfz(at))
    }

    /// Relaxation length of the lateral slip, m; 0 where the file has none.
    #[must_use]
    #[inline]
    pub fn lateral_relaxation(&self, load: f64, gamma: f64) -> f64 {
        if self.pty1 == 0.0 || self.pty2 == 0.0 {
            return 0.0;
        }
        self.pty1
            * sin_2atan(load / (self.pty2 * self.nominal()))
            * (1.0 - self.pky3 * (gamma * self.lgay).abs())
            * self.r0
            * self.lfzo
            * self.lsgal
    }

    /// Relaxation length of the longitudinal slip, m; 0 where the file has none.
    #[must_use]
    #[inline]
    pub fn longitudinal_relaxation(&self, load: f64) -> f64 {
        if self.ptx1 == 0.0 {
            return 0.0;
        }
        let dfz = self.dfz(load);
        let decay = if self.ptx3 == 0.0 { 1.0 } else { (-self.ptx3 * dfz).exp() };
        load * (self.ptx1 + self.ptx2 * dfz) * decay * (self.r0 / self.fz0) * self.lsgkp
    }

    /// Rolling resistance moment, N m, positive, for a load in N, a longitudinal force in N and a speed in m/s.
    #[must_use]
    #[inline]
    pub fn rolling_resistance(&self, load: f64, fx: f64, speed: f64) -> f64 {
        let v = (speed / self.longvl).abs();
        let share = self.qsy1 + self.qsy2 * fx / self.fz0 + self.qsy3 * v + self.qsy4 * (v * v) * (v * v);
        self.r0 * load * share * self.lmy
    }

    #[inline]
    fn longitudinal_stiffness(&self, load: f64, dfz: f64) -> f64 {
        let growth = if self.pkx3 == 0.0 { 1.0 } else { (self.pkx3 * dfz).exp() };
        load * (self.pkx1 + self.pkx2 * dfz) * growth * self.lkx
    }

    #[inline]
    fn lateral_stiffness(&self, load: f64, gamma: f64) -> f64 {
        let fz0 = self.nominal();
        self.pky1
            * fz0
            * sin_2atan(load / (self.pky2 * fz0))
            * self.lky
            * (1.0 - self.pky3 * (gamma * self.lgay).abs())
    }

    /// Pure longitudinal slip: force, peak and stiffness.
    #[inline]
    fn pure_longitudinal(&self, contact: &Contact, load: f64, dfz: f64) -> (f64, f64, f64) {
        let gamma = contact.gamma * self.lgax;
        let shift_h = (self.phx1 + self.phx2 * dfz) * self.lhx;
        let kappa = contact.kappa + shift_h;
        let friction = self.lmux * contact.friction;
        let mu = (self.pdx1 + self.pdx2 * dfz) * (1.0 - self.pdx3 * gamma * gamma) * friction;
        let (c, d) = (self.pcx1 * self.lcx, mu * load);
        let e = (self.pex1 + self.pex2 * dfz + self.pex3 * dfz * dfz)
            * (1.0 - self.pex4 * sign(kappa))
            * self.lex;
        let k = self.longitudinal_stiffness(load, dfz);
        let shift_v = load * (self.pvx1 + self.pvx2 * dfz) * self.lvx * friction;
        (d * curve_sin(kappa, k / (c * d), c, e.min(1.0)) + shift_v, d, k)
    }

    #[inline]
    fn pure_lateral(&self, contact: &Contact, load: f64, dfz: f64) -> Lateral {
        let gamma = contact.gamma * self.lgay;
        let friction = self.lmuy * contact.friction;
        let mu = (self.pdy1 + self.pdy2 * dfz) * (1.0 - self.pdy3 * gamma * gamma) * friction;
        let (c, d) = (self.pcy1 * self.lcy, mu * load);
        let k = self.lateral_stiffness(load, contact.gamma);
        let shift_h = (self.phy1 + self.phy2 * dfz) * self.lhy + self.phy3 * gamma;
        let shift_v = load
            * ((self.pvy1 + self.pvy2 * dfz) * self.lvy + (self.pvy3 + self.pvy4 * dfz) * gamma)
            * friction;
        let alpha = contact.alpha + shift_h;
        let e =
            (self.pey1 + self.pey2 * dfz) * (1.0 - (self.pey3 + self.pey4 * gamma) * sign(alpha)) * self.ley;
        let b = k / (c * d);
        let force = d * curve_sin(alpha, b, c, e.min(1.0)) + shift_v;
        Lateral { force, peak: d, friction: mu, stiffness: k, b_times_c: b * c, shift_h, shift_v }
    }

    /// Forces and moments at steady slip. All zero for a wheel in the air. Finite for finite input.
    #[must_use]
    pub fn forces(&self, contact: &Contact) -> TyreForces {
        if contact.load <= LIFTED {
            return TyreForces::default();
        }
        let (load, factor) = self.range_of_load(contact.load);
        let contact = Contact { gamma: contact.gamma.clamp(self.cammin, self.cammax), ..*contact };
        let dfz = self.dfz(load);
        let (fx0, peak_x, stiffness_x) = self.pure_longitudinal(&contact, load, dfz);
        let lateral = self.pure_lateral(&contact, load, dfz);
        let (fx, fy, induced) = if self.rbx1 != 0.0 && self.rby1 != 0.0 {
            self.combined(&contact, load, dfz, fx0, &lateral)
        } else {
            let (fx, fy) = self.friction_ellipse(&contact, dfz, fx0, peak_x, &lateral);
            (fx, fy, 0.0)
        };
        let mz = self.aligning_moment(&contact, load, dfz, fx, fy, induced, stiffness_x, &lateral);
        let mx = self.r0
            * load
            * (self.qsx1 * self.lvmx + (-self.qsx2 * contact.gamma + self.qsx3 * fy / self.fz0) * self.lmx);
        TyreForces { fx: factor * fx, fy: factor * fy, mx: factor * mx, mz: factor * mz }
    }

    /// Combined slip by weighting functions: `(Fx, Fy, SVyk)`.
    #[inline]
    fn combined(
        &self,
        contact: &Contact,
        load: f64,
        dfz: f64,
        fx0: f64,
        lateral: &Lateral,
    ) -> (f64, f64, f64) {
        let (kappa, alpha) = (contact.kappa, contact.alpha);
        let bx = self.rbx1 * cos_atan(self.rbx2 * kappa) * self.lxal;
        let ex = (self.rex1 + self.rex2 * dfz).min(1.0);
        let neutral_x = if self.rhx1 == 0.0 { 1.0 } else { curve_cos(self.rhx1, bx, self.rcx1, ex) };
        let weight_x = curve_cos(alpha + self.rhx1, bx, self.rcx1, ex) / neutral_x;

        let by = self.rby1 * cos_atan(self.rby2 * (alpha - self.rby3)) * self.lyka;
        let ey = (self.rey1 + self.rey2 * dfz).min(1.0);
        let shift = self.rhy1 + self.rhy2 * dfz;
        let neutral_y = if shift == 0.0 { 1.0 } else { curve_cos(shift, by, self.rcy1, ey) };
        let weight_y = curve_cos(kappa + shift, by, self.rcy1, ey) / neutral_y;
        let induced = if self.rvy1 == 0.0 && self.rvy2 == 0.0 && self.rvy3 == 0.0 {
            0.0
        } else {
            lateral.friction
                * load
                * (self.rvy1 + self.rvy2 * dfz + self.rvy3 * contact.gamma)
                * cos_atan(self.rvy4 * alpha)
                * (self.rvy5 * (self.rvy6 * kappa).atan()).sin()
                * self.lvyka
        };
        (fx0 * weight_x, lateral.force * weight_y + induced, induced)
    }

    /// Combined slip for files without combined coefficients: the friction ellipse, as `PAC2002` has it.
    #[inline]
    fn friction_ellipse(
        &self,
        contact: &Contact,
        dfz: f64,
        fx0: f64,
        peak_x: f64,
        lateral: &Lateral,
    ) -> (f64, f64) {
        let kappa = (contact.kappa + (self.phx1 + self.phx2 * dfz) * self.lhx).abs();
        let alpha = (contact.alpha + lateral.shift_h + lateral.shift_v / lateral.stiffness).sin().abs();
        if kappa == 0.0 || alpha == 0.0 {
            return (fx0, lateral.force);
        }
        let fy0 = lateral.force - lateral.shift_v;
        let slope = alpha / kappa;
        let (x, y) = (fx0 * slope / lateral.peak, fy0 / (peak_x * slope));
        (fx0 / (1.0 + x * x).sqrt(), fy0 / (1.0 + y * y).sqrt() + lateral.shift_v)
    }

    /// Whether the file has a moment at all; most of the cost of one is saved without.
    #[inline]
    fn has_aligning_moment(&self) -> bool {
        [
            self.qdz1, self.qdz2, self.qdz6, self.qdz7, self.qdz8, self.qdz9, self.ssz1, self.ssz2,
            self.ssz3, self.ssz4,
        ]
        .iter()
        .any(|value| *value != 0.0)
    }

    /// Self-aligning moment from pneumatic trail, residual torque and the arm of the longitudinal force.
    #[allow(clippy::too_many_arguments)]
    #[inline]
    fn aligning_moment(
        &self,
        contact: &Contact,
        load: f64,
        dfz: f64,
        fx: f64,
        fy: f64,
        induced: f64,
        stiffness_x: f64,
        lateral: &Lateral,
    ) -> f64 {
        if !self.has_aligning_moment() {
            return 0.0;
        }
        let gamma = contact.gamma * self.lgaz;
        let friction = self.lmuy * contact.friction;
        let shift_t = self.qhz1 + self.qhz2 * dfz + (self.qhz3 + self.qhz4 * dfz) * gamma;
        // Longitudinal slip acts on the trail like slip angle.
        let slip = stiffness_x / lateral.stiffness * contact.kappa;
        let equivalent = |alpha: f64| {
            let t = alpha.clamp(-1.5, 1.5).tan();
            sign(alpha) * (t * t + slip * slip).sqrt().atan()
        };
        let alpha_t = equivalent(contact.alpha + shift_t);
        let cos_alpha = contact.alpha.cos();
        let bt = (self.qbz1 + self.qbz2 * dfz + self.qbz3 * dfz * dfz)
            * (1.0 + self.qbz4 * gamma + self.qbz5 * gamma.abs())
            * self.lky
            / friction;
        let dt = load
            * (self.qdz1 + self.qdz2 * dfz)
            * (1.0 + self.qdz3 * gamma + self.qdz4 * gamma * gamma)
            * (self.r0 / self.fz0)
            * self.ltr;
        let et = (self.qez1 + self.qez2 * dfz + self.qez3 * dfz * dfz)
            * (1.0
                + (self.qez4 + self.qez5 * gamma)
                    * std::f64::consts::FRAC_2_PI
                    * (bt * self.qcz1 * alpha_t).atan());
        let trail = dt * curve_cos(alpha_t, bt, self.qcz1, et.min(1.0)) * cos_alpha;
        let residual = if self.qdz6 == 0.0 && self.qdz7 == 0.0 && self.qdz8 == 0.0 && self.qdz9 == 0.0 {
            0.0
        } else {
            let shift_f = lateral.shift_h + lateral.shift_v / lateral.stiffness;
            let br = self.qbz9 * self.lky / friction + self.qbz10 * lateral.b_times_c;
            let dr = load
                * ((self.qdz6 + self.qdz7 * dfz) * self.lres + (self.qdz8 + self.qdz9 * dfz) * gamma)
                * self.r0
                * friction;
            dr * cos_atan(br * equivalent(contact.alpha + shift_f)) * cos_alpha
        };
        let arm = (self.ssz1 + self.ssz2 * fy / self.fz0 + (self.ssz3 + self.ssz4 * dfz) * contact.gamma)
            * self.r0
            * self.ls;
        -trail * (fy - induced) + residual + arm * fx
    }
}
