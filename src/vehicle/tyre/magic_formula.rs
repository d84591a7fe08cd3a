//! The Magic Formula 5.2: forces and moments of one wheel in its contact patch.

use super::coefficients::Coefficients;
use crate::vehicle::trigonometry::{Of, atan, each, sin_or_cos};

/// How a tyre meets the road. The default is a wheel in the air.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
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

/// The arguments of `sin(C atan(B x - E (B x - atan(B x))))`, or of its cosine.
#[derive(Clone, Copy, Default)]
struct Curve {
    x: f64,
    b: f64,
    c: f64,
    e: f64,
}

impl Curve {
    /// Sine or cosine of several curves at once.
    #[inline(always)]
    fn values<const N: usize>(of: Of, curves: [Self; N]) -> [f64; N] {
        let bx: [f64; N] = each(|i| curves[i].b * curves[i].x);
        let inner = if curves.iter().all(|curve| curve.e == 0.0) {
            bx
        } else {
            let atan: [f64; N] = atan(bx);
            each(|i| {
                let e = curves[i].e;
                if e == 0.0 { bx[i] } else { bx[i] - e * (bx[i] - atan[i]) }
            })
        };
        let outer = atan(inner);
        sin_or_cos::<N>([of; N], each(|i| curves[i].c * outer[i]))
    }

    #[inline]
    fn cos(self) -> f64 {
        let [cos] = Self::values(Of::Cos, [self]);
        cos
    }
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

/// Pure longitudinal slip but for the sine of its curve.
#[derive(Clone, Copy, Default)]
struct Longitudinal {
    curve: Curve,
    peak: f64,
    stiffness: f64,
    shift_v: f64,
}

/// Pure lateral slip but for the sine of its curve: what forces and moment need of it.
#[derive(Clone, Copy, Default)]
struct Lateral {
    curve: Curve,
    peak: f64,
    friction: f64,
    stiffness: f64,
    b_times_c: f64,
    shift_h: f64,
    shift_v: f64,
}

/// One wheel before its curves are known.
#[derive(Clone, Copy, Default)]
struct Wheel {
    contact: Contact,
    /// The load at which the formula is taken, its factor and its relative deviation.
    load: f64,
    factor: f64,
    dfz: f64,
    longitudinal: Longitudinal,
    lateral: Lateral,
}

/// Forces in the plane of the road; `induced` is the lateral force that longitudinal slip induces.
#[derive(Clone, Copy, Default)]
struct Planar {
    fx: f64,
    fy: f64,
    induced: f64,
}

/// `sign(alpha) sqrt(tan^2(alpha) + slip^2)`: the tangent of the slip angle that acts on trail and residual moment.
#[inline(always)]
fn equivalent<const N: usize>(alpha: [f64; N], slip: [f64; N]) -> [f64; N] {
    let within: [f64; N] = each(|i| alpha[i].clamp(-1.5, 1.5));
    let (sin, cos): ([f64; N], [f64; N]) =
        (sin_or_cos([Of::Sin; N], within), sin_or_cos([Of::Cos; N], within));
    each(|i| {
        let t = sin[i] / cos[i];
        sign(alpha[i]) * (t * t + slip[i] * slip[i]).sqrt()
    })
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

    #[inline(always)]
    fn pure_longitudinal(&self, contact: &Contact, load: f64, dfz: f64) -> Longitudinal {
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
        let curve = Curve { x: kappa, b: k / (c * d), c, e: e.min(1.0) };
        Longitudinal { curve, peak: d, stiffness: k, shift_v }
    }

    #[inline(always)]
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
        let curve = Curve { x: alpha, b, c, e: e.min(1.0) };
        Lateral { curve, peak: d, friction: mu, stiffness: k, b_times_c: b * c, shift_h, shift_v }
    }

    /// Forces and moments at steady slip. All zero for a wheel in the air. Finite for finite input.
    #[must_use]
    pub fn forces(&self, contact: &Contact) -> TyreForces {
        let [forces] = Self::forces_of([self], &[*contact]);
        forces
    }

    /// [`forces`](Self::forces) of several wheels at once, each with its tyre: much faster than one by one.
    #[must_use]
    pub fn forces_of<const N: usize>(tyres: [&Self; N], contacts: &[Contact; N]) -> [TyreForces; N] {
        let wheels: [Wheel; N] = each(|i| tyres[i].wheel(&contacts[i]));
        let sin_x: [f64; N] = Curve::values(Of::Sin, each(|i| wheels[i].longitudinal.curve));
        let sin_y: [f64; N] = Curve::values(Of::Sin, each(|i| wheels[i].lateral.curve));
        let pure_x: [f64; N] = each(|i| {
            let pure = &wheels[i].longitudinal;
            pure.peak * sin_x[i] + pure.shift_v
        });
        let pure_y: [f64; N] = each(|i| {
            let pure = &wheels[i].lateral;
            pure.peak * sin_y[i] + pure.shift_v
        });

        let (mut weight_x, mut weight_y) = ([1.0; N], [1.0; N]);
        if tyres.iter().any(|tyre| tyre.has_weights()) {
            let weights: [[Curve; 2]; N] = each(|i| tyres[i].weights(&wheels[i]));
            weight_x = Curve::values::<N>(Of::Cos, each(|i| weights[i][0]));
            weight_y = Curve::values::<N>(Of::Cos, each(|i| weights[i][1]));
        }
        let planar: [Planar; N] = each(|i| {
            if tyres[i].has_weights() {
                tyres[i].combined(&wheels[i], [pure_x[i], pure_y[i]], [weight_x[i], weight_y[i]])
            } else {
                tyres[i].friction_ellipse(&wheels[i], pure_x[i], pure_y[i])
            }
        });
        let mz = Self::aligning_moments(tyres, &wheels, &planar);
        each(|i| {
            if contacts[i].load <= LIFTED {
                return TyreForces::default();
            }
            let (tyre, Wheel { contact, load, factor, .. }, Planar { fx, fy, .. }) =
                (tyres[i], wheels[i], planar[i]);
            let mx = tyre.r0
                * load
                * (tyre.qsx1 * tyre.lvmx
                    + (-tyre.qsx2 * contact.gamma + tyre.qsx3 * fy / tyre.fz0) * tyre.lmx);
            TyreForces { fx: factor * fx, fy: factor * fy, mx: factor * mx, mz: factor * mz[i] }
        })
    }

    /// Pure slip of a wheel.
    #[inline(always)]
    fn wheel(&self, contact: &Contact) -> Wheel {
        let (load, factor) = self.range_of_load(contact.load);
        let contact = Contact { gamma: contact.gamma.clamp(self.cammin, self.cammax), ..*contact };
        let dfz = self.dfz(load);
        let longitudinal = self.pure_longitudinal(&contact, load, dfz);
        let lateral = self.pure_lateral(&contact, load, dfz);
        Wheel { contact, load, factor, dfz, longitudinal, lateral }
    }

    /// Whether the file has the coefficients of combined slip.
    #[inline]
    fn has_weights(&self) -> bool {
        self.rbx1 != 0.0 && self.rby1 != 0.0
    }

    /// Combined slip: the curves whose cosines weight the longitudinal and the lateral force.
    #[inline(always)]
    fn weights(&self, wheel: &Wheel) -> [Curve; 2] {
        let Wheel { contact: Contact { kappa, alpha, .. }, dfz, .. } = *wheel;
        [
            Curve {
                x: alpha + self.rhx1,
                b: self.rbx1 * cos_atan(self.rbx2 * kappa) * self.lxal,
                c: self.rcx1,
                e: (self.rex1 + self.rex2 * dfz).min(1.0),
            },
            Curve {
                x: kappa + (self.rhy1 + self.rhy2 * dfz),
                b: self.rby1 * cos_atan(self.rby2 * (alpha - self.rby3)) * self.lyka,
                c: self.rcy1,
                e: (self.rey1 + self.rey2 * dfz).min(1.0),
            },
        ]
    }

    /// Combined slip by weighting functions, from the pure forces and the cosines of the weights' curves.
    #[inline(always)]
    fn combined(&self, wheel: &Wheel, pure: [f64; 2], cosines: [f64; 2]) -> Planar {
        let Wheel { contact, load, dfz, lateral, .. } = wheel;
        let (kappa, alpha) = (contact.kappa, contact.alpha);
        let shift = self.rhy1 + self.rhy2 * dfz;
        let (mut weight_x, mut weight_y) = (cosines[0], cosines[1]);
        if self.rhx1 != 0.0 {
            weight_x /= Curve { x: self.rhx1, ..self.weights(wheel)[0] }.cos();
        }
        if shift != 0.0 {
            weight_y /= Curve { x: shift, ..self.weights(wheel)[1] }.cos();
        }
        let induced = if self.rvy1 == 0.0 && self.rvy2 == 0.0 && self.rvy3 == 0.0 {
            0.0
        } else {
            let [inner] = atan([self.rvy6 * kappa]);
            let [sin] = sin_or_cos([Of::Sin], [self.rvy5 * inner]);
            lateral.friction
                * load
                * (self.rvy1 + self.rvy2 * dfz + self.rvy3 * contact.gamma)
                * cos_atan(self.rvy4 * alpha)
                * sin
                * self.lvyka
        };
        Planar { fx: pure[0] * weight_x, fy: pure[1] * weight_y + induced, induced }
    }

    /// Combined slip for files without combined coefficients: the friction ellipse, as `PAC2002` has it.
    #[inline]
    fn friction_ellipse(&self, wheel: &Wheel, fx0: f64, fy: f64) -> Planar {
        let Wheel { contact, dfz, longitudinal, lateral, .. } = wheel;
        let kappa = (contact.kappa + (self.phx1 + self.phx2 * dfz) * self.lhx).abs();
        let angle = contact.alpha + lateral.shift_h + lateral.shift_v / lateral.stiffness;
        let [sin] = sin_or_cos([Of::Sin], [angle]);
        let alpha = sin.abs();
        if kappa == 0.0 || alpha == 0.0 {
            return Planar { fx: fx0, fy, induced: 0.0 };
        }
        let fy0 = fy - lateral.shift_v;
        let slope = alpha / kappa;
        let (x, y) = (fx0 * slope / lateral.peak, fy0 / (longitudinal.peak * slope));
        let fy = fy0 / (1.0 + y * y).sqrt() + lateral.shift_v;
        Planar { fx: fx0 / (1.0 + x * x).sqrt(), fy, induced: 0.0 }
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

    /// Self-aligning moments from pneumatic trail, residual torque and the arm of the longitudinal force.
    #[inline(always)]
    fn aligning_moments<const N: usize>(
        tyres: [&Self; N],
        wheels: &[Wheel; N],
        planar: &[Planar; N],
    ) -> [f64; N] {
        if !tyres.iter().any(|tyre| tyre.has_aligning_moment()) {
            return [0.0; N];
        }
        let slip: [f64; N] = each(|i| {
            // Longitudinal slip acts on the trail like slip angle.
            wheels[i].longitudinal.stiffness / wheels[i].lateral.stiffness * wheels[i].contact.kappa
        });
        let shifted: [f64; N] = each(|i| {
            let (tyre, Wheel { contact, dfz, .. }) = (tyres[i], &wheels[i]);
            let gamma = contact.gamma * tyre.lgaz;
            contact.alpha + (tyre.qhz1 + tyre.qhz2 * dfz + (tyre.qhz3 + tyre.qhz4 * dfz) * gamma)
        });
        let alpha_t: [f64; N] = atan(equivalent(shifted, slip));
        let curves: [Curve; N] = each(|i| tyres[i].trail_curve(&wheels[i], alpha_t[i]));
        let cos: [f64; N] = Curve::values(Of::Cos, curves);
        let cos_alpha: [f64; N] = sin_or_cos([Of::Cos; N], each(|i| wheels[i].contact.alpha));
        each(|i| {
            if !tyres[i].has_aligning_moment() {
                return 0.0;
            }
            let (tyre, Wheel { contact, load, dfz, .. }, forces) = (tyres[i], &wheels[i], &planar[i]);
            let gamma = contact.gamma * tyre.lgaz;
            let dt = load
                * (tyre.qdz1 + tyre.qdz2 * dfz)
                * (1.0 + tyre.qdz3 * gamma + tyre.qdz4 * gamma * gamma)
                * (tyre.r0 / tyre.fz0)
                * tyre.ltr;
            let trail = dt * cos[i] * cos_alpha[i];
            let residual = tyre.residual_moment(&wheels[i], slip[i]) * cos_alpha[i];
            let arm = (tyre.ssz1
                + tyre.ssz2 * forces.fy / tyre.fz0
                + (tyre.ssz3 + tyre.ssz4 * dfz) * contact.gamma)
                * tyre.r0
                * tyre.ls;
            -trail * (forces.fy - forces.induced) + residual + arm * forces.fx
        })
    }

    /// The curve whose cosine is the pneumatic trail's.
    #[inline(always)]
    fn trail_curve(&self, wheel: &Wheel, alpha_t: f64) -> Curve {
        let Wheel { contact, dfz, .. } = wheel;
        let gamma = contact.gamma * self.lgaz;
        let friction = self.lmuy * contact.friction;
        let b = (self.qbz1 + self.qbz2 * dfz + self.qbz3 * dfz * dfz)
            * (1.0 + self.qbz4 * gamma + self.qbz5 * gamma.abs())
            * self.lky
            / friction;
        let mut e = self.qez1 + self.qez2 * dfz + self.qez3 * dfz * dfz;
        if self.qez4 != 0.0 || self.qez5 != 0.0 {
            let [angle] = atan([b * self.qcz1 * alpha_t]);
            e *= 1.0 + (self.qez4 + self.qez5 * gamma) * std::f64::consts::FRAC_2_PI * angle;
        }
        Curve { x: alpha_t, b, c: self.qcz1, e: e.min(1.0) }
    }

    /// Residual moment at zero slip angle's cosine of 1, N m.
    #[inline]
    fn residual_moment(&self, wheel: &Wheel, slip: f64) -> f64 {
        if self.qdz6 == 0.0 && self.qdz7 == 0.0 && self.qdz8 == 0.0 && self.qdz9 == 0.0 {
            return 0.0;
        }
        let Wheel { contact, load, dfz, lateral, .. } = wheel;
        let gamma = contact.gamma * self.lgaz;
        let friction = self.lmuy * contact.friction;
        let shift_f = lateral.shift_h + lateral.shift_v / lateral.stiffness;
        let br = self.qbz9 * self.lky / friction + self.qbz10 * lateral.b_times_c;
        let dr = load
            * ((self.qdz6 + self.qdz7 * dfz) * self.lres + (self.qdz8 + self.qdz9 * dfz) * gamma)
            * self.r0
            * friction;
        let [angle] = atan(equivalent([contact.alpha + shift_f], [slip]));
        dr * cos_atan(br * angle)
    }
}
