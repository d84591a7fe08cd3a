//! The Magic Formula 5.2: forces and moments in the contact patch, of one wheel or of several side by side.

use super::coefficients::Coefficients;
use super::contact::{Contact, TyreForces};
use super::model::{FourTyres, TyreModel};
use crate::numerics::lanes::{FOUR, Lanes};
use crate::vehicle::trigonometry::{atan_of, cos_of, sin_of};

/// Slip angle beyond which its tangent grows no more, rad.
const GREATEST_ANGLE: f64 = 1.5;
/// Slip at which softening changes nothing, as a share of a brush's sliding slip: ordinary driving, a fifth to a
/// quarter of the grip.
const SOFTENED_AT: f64 = 0.08;
/// Loads under this carry no force: the wheel has left the road.
const LIFTED: f64 = 1e-3;

/// Takes coefficients out of memory.
macro_rules! take {
    ($tyre:expr; $($name:ident)*) => { $(let $name = L::load(&$tyre.$name);)* };
}

// It uses the macro.
mod aligning;

/// The arguments of `sin(C atan(B x - E (B x - atan(B x))))`, or of its cosine.
#[derive(Clone, Copy)]
struct Curve<L> {
    x: L,
    b: L,
    c: L,
    e: L,
}

impl<L: Lanes> Curve<L> {
    /// `C atan(...)`.
    #[inline(always)]
    fn angle(self) -> L {
        let bx = self.b * self.x;
        let inner = if self.e.is_zero() {
            bx
        } else {
            let bent = bx - self.e * (bx - atan_of(bx));
            // Without a factor an infinite argument stays it.
            L::choose(self.e.equals(L::splat(0.0)), bx, bent)
        };
        self.c * atan_of(inner)
    }

    #[inline(always)]
    fn sin(self) -> L {
        sin_of(self.angle())
    }

    #[inline(always)]
    fn cos(self) -> L {
        cos_of(self.angle())
    }
}

/// `cos(atan(x))` without a call to either.
#[inline(always)]
fn cos_atan<L: Lanes>(x: L) -> L {
    let one = L::splat(1.0);
    one / (one + x * x).sqrt()
}

/// `sin(2 atan(x))` without a call to either.
#[inline(always)]
fn sin_2atan<L: Lanes>(x: L) -> L {
    L::splat(2.0) * x / (L::splat(1.0) + x * x)
}

/// `exp(factor x)`; 1 without a factor, as most tyres have none.
#[inline(always)]
fn growth<L: Lanes>(factor: L, x: L) -> L {
    if factor.is_zero() { L::splat(1.0) } else { (factor * x).each(f64::exp) }
}

/// Pure longitudinal slip except for the sine of its curve.
#[derive(Clone, Copy)]
struct Longitudinal<L> {
    curve: Curve<L>,
    peak: L,
    stiffness: L,
    shift_v: L,
}

/// Pure lateral slip except for the sine of its curve: the common part of forces and moment.
#[derive(Clone, Copy)]
struct LateralSlip<L> {
    curve: Curve<L>,
    peak: L,
    friction: L,
    stiffness: L,
    b_times_c: L,
    shift_h: L,
    shift_v: L,
}

/// A wheel before its curves are known.
#[derive(Clone, Copy)]
struct WheelSlip<L> {
    contact: Contact<L>,
    /// The load at which the formula is taken, its factor and its relative deviation.
    load: L,
    factor: L,
    dfz: L,
    longitudinal: Longitudinal<L>,
    lateral: LateralSlip<L>,
}

/// Forces in the plane of the road; `induced` is the lateral force that longitudinal slip induces.
#[derive(Clone, Copy)]
struct Planar<L> {
    fx: L,
    fy: L,
    induced: L,
}

/// `sign(alpha) sqrt(tan^2(alpha) + slip^2)`: the tangent of the slip angle that acts on trail and residual moment.
#[inline(always)]
fn equivalent<L: Lanes>(alpha: L, slip: L) -> L {
    with_slip(alpha, tan(alpha), slip)
}

/// Tangent of a slip angle.
#[inline(always)]
fn tan<L: Lanes>(alpha: L) -> L {
    let within = Lanes::clamp(alpha, L::splat(-GREATEST_ANGLE), L::splat(GREATEST_ANGLE));
    sin_of(within) / cos_of(within)
}

/// The same where the tangent is known.
#[inline(always)]
fn with_slip<L: Lanes>(alpha: L, tangent: L, slip: L) -> L {
    alpha.sign() * (tangent * tangent + slip * slip).sqrt()
}

impl TyreModel for Coefficients {
    type Four = Coefficients<[f64; FOUR]>;

    fn side_by_side(tyres: [&Self; FOUR]) -> Self::Four {
        Self::beside(tyres)
    }

    fn rolling_radius(&self) -> f64 {
        let deflection = self.fz0 / self.vertical_stiffness;
        self.r0 - deflection * (self.dreff * self.breff.atan() + self.freff)
    }

    fn vertical_stiffness(&self) -> f64 {
        self.vertical_stiffness
    }

    fn vertical_damping(&self) -> f64 {
        self.vertical_damping
    }

    /// That of the pure lateral characteristic at its zero.
    fn cornering_stiffness(&self, load: f64, gamma: f64) -> f64 {
        let (at, factor) = self.range_of_load(load);
        -factor * self.lateral_stiffness(at, gamma)
    }

    /// That of the pure longitudinal characteristic at its zero.
    fn slip_stiffness(&self, load: f64) -> f64 {
        self.stiffness_at_no_slip(load)
    }

    /// That of a brush of this stiffness `K` and grip `D`, `3 D / K` (Pacejka, section 3.2), on the road of the tyre's
    /// measurement.
    fn sliding(&self, load: f64) -> [f64; 2] {
        let wheel = self.wheel::<f64>(&Contact { load, friction: 1.0, ..Contact::default() });
        let WheelSlip { longitudinal, lateral, .. } = wheel;
        [3.0 * longitudinal.peak / longitudinal.stiffness, 3.0 * lateral.peak / lateral.stiffness]
            .map(f64::abs)
    }

    fn lateral_relaxation(&self, load: f64, gamma: f64) -> f64 {
        self.relaxation_y(load, gamma)
    }

    fn longitudinal_relaxation(&self, load: f64) -> f64 {
        self.relaxation_x(load)
    }

    fn rolling_resistance(&self, load: f64, fx: f64, speed: f64) -> f64 {
        self.resistance(load, fx, speed)
    }

    fn forces(&self, contact: &Contact) -> TyreForces {
        self.forces_at(*contact, tan(contact.alpha))
    }

    fn scale_cornering_stiffness(&mut self, factor: f64) {
        self.lky *= factor;
    }

    fn scale_lateral_relaxation(&mut self, factor: f64) {
        self.pty1 *= factor;
    }
}

impl FourTyres for Coefficients<[f64; FOUR]> {
    #[inline(always)]
    fn vertical_stiffness<L: Lanes<Stored = [f64; FOUR]>>(&self) -> L {
        L::load(&self.vertical_stiffness)
    }

    #[inline(always)]
    fn vertical_damping<L: Lanes<Stored = [f64; FOUR]>>(&self) -> L {
        L::load(&self.vertical_damping)
    }

    #[inline(always)]
    fn slip_stiffness<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L) -> L {
        self.stiffness_at_no_slip(load)
    }

    #[inline(always)]
    fn lateral_relaxation<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L, gamma: L) -> L {
        self.relaxation_y(load, gamma)
    }

    #[inline(always)]
    fn longitudinal_relaxation<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L) -> L {
        self.relaxation_x(load)
    }

    #[inline(always)]
    fn rolling_resistance<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L, fx: L, speed: L) -> L {
        self.resistance(load, fx, speed)
    }

    #[inline(always)]
    fn forces<L: Lanes<Stored = [f64; FOUR]>>(&self, contact: Contact<L>, tangent: L) -> TyreForces<L> {
        self.forces_at(contact, tangent)
    }
}

/// The formula, of one tyre or of several side by side.
impl Coefficients {
    /// Friction coefficient sideways at a load, N, on the road of the tyre's measurement.
    pub(super) fn lateral_friction(&self, load: f64) -> f64 {
        let contact = Contact { load, friction: 1.0, ..Contact::default() };
        (self.wheel::<f64>(&contact).lateral.peak / load).abs()
    }
}

impl<T: Copy> Coefficients<T> {
    /// Nominal load with its scaling factor, N.
    #[inline(always)]
    fn nominal<L: Lanes<Stored = T>>(&self) -> L {
        take!(self; fz0 lfzo);
        fz0 * lfzo
    }

    /// Relative deviation from the nominal load.
    #[inline(always)]
    fn dfz<L: Lanes<Stored = T>>(&self, load: L) -> L {
        (load - self.nominal()) / self.nominal()
    }

    /// The load for the formula, and the factor from its force to the force at the real load. Above the file's range it
    /// is clamped, below it forces vanish in proportion to the load.
    #[inline(always)]
    fn range_of_load<L: Lanes<Stored = T>>(&self, load: L) -> (L, L) {
        take!(self; fzmin fzmax);
        let below = load.below(fzmin);
        (L::choose(below, fzmin, load.min(fzmax)), L::choose(below, load / fzmin, L::splat(1.0)))
    }

    /// Relaxation length of the lateral slip.
    #[inline(always)]
    fn relaxation_y<L: Lanes<Stored = T>>(&self, load: L, gamma: L) -> L {
        take!(self; pty1 pty2 pky3 lgay r0 lfzo lsgal);
        let zero = L::splat(0.0);
        let length = pty1
            * sin_2atan(load / (pty2 * self.nominal()))
            * (L::splat(1.0) - pky3 * (gamma * lgay).abs())
            * r0
            * lfzo
            * lsgal;
        L::choose(pty1.abs().min(pty2.abs()).equals(zero), zero, length)
    }

    /// Relaxation length of the longitudinal slip.
    #[inline(always)]
    fn relaxation_x<L: Lanes<Stored = T>>(&self, load: L) -> L {
        take!(self; ptx1 ptx2 ptx3 r0 fz0 lsgkp);
        let zero = L::splat(0.0);
        let dfz = self.dfz(load);
        let length = load * (ptx1 + ptx2 * dfz) * growth(-ptx3, dfz) * (r0 / fz0) * lsgkp;
        L::choose(ptx1.equals(zero), zero, length)
    }

    /// Rolling resistance moment.
    #[inline(always)]
    fn resistance<L: Lanes<Stored = T>>(&self, load: L, fx: L, speed: L) -> L {
        take!(self; longvl qsy1 qsy2 qsy3 qsy4 fz0 r0 lmy);
        let v = (speed / longvl).abs();
        let share = qsy1 + qsy2 * fx / fz0 + qsy3 * v + qsy4 * (v * v) * (v * v);
        r0 * load * share * lmy
    }

    /// Slip stiffness at no slip.
    #[inline(always)]
    fn stiffness_at_no_slip<L: Lanes<Stored = T>>(&self, load: L) -> L {
        let (at, factor) = self.range_of_load(load);
        factor * self.longitudinal_stiffness(at, self.dfz(at))
    }

    #[inline(always)]
    fn longitudinal_stiffness<L: Lanes<Stored = T>>(&self, load: L, dfz: L) -> L {
        take!(self; pkx1 pkx2 pkx3 lkx);
        load * (pkx1 + pkx2 * dfz) * growth(pkx3, dfz) * lkx
    }

    #[inline(always)]
    fn lateral_stiffness<L: Lanes<Stored = T>>(&self, load: L, gamma: L) -> L {
        take!(self; pky1 pky2 pky3 lky lgay);
        let fz0 = self.nominal();
        pky1 * fz0 * sin_2atan(load / (pky2 * fz0)) * lky * (L::splat(1.0) - pky3 * (gamma * lgay).abs())
    }

    #[inline(always)]
    fn pure_longitudinal<L: Lanes<Stored = T>>(
        &self,
        contact: &Contact<L>,
        load: L,
        dfz: L,
    ) -> Longitudinal<L> {
        take!(self; lgax phx1 phx2 lhx lmux pdx1 pdx2 pdx3 pcx1 lcx pex1 pex2 pex3 pex4 lex pvx1 pvx2 lvx);
        let one = L::splat(1.0);
        let gamma = contact.gamma * lgax;
        let shift_h = (phx1 + phx2 * dfz) * lhx;
        let kappa = contact.kappa + shift_h;
        let friction = lmux * contact.friction;
        let mu = (pdx1 + pdx2 * dfz) * (one - pdx3 * gamma * gamma) * friction;
        let (c, d) = (pcx1 * lcx, mu * load);
        let e = (pex1 + pex2 * dfz + pex3 * dfz * dfz) * (one - pex4 * kappa.sign()) * lex;
        let k = self.longitudinal_stiffness(load, dfz);
        let shift_v = load * (pvx1 + pvx2 * dfz) * lvx * friction;
        let curve = Curve { x: kappa, b: k / (c * d), c, e: e.min(one) };
        Longitudinal { curve, peak: d, stiffness: k, shift_v }
    }

    #[inline(always)]
    fn pure_lateral<L: Lanes<Stored = T>>(&self, contact: &Contact<L>, load: L, dfz: L) -> LateralSlip<L> {
        take!(self; lgay lmuy pdy1 pdy2 pdy3 pcy1 lcy phy1 phy2 lhy phy3 pvy1 pvy2 lvy pvy3 pvy4 pey1 pey2 pey3 pey4 ley);
        let one = L::splat(1.0);
        let gamma = contact.gamma * lgay;
        let friction = lmuy * contact.friction;
        let mu = (pdy1 + pdy2 * dfz) * (one - pdy3 * gamma * gamma) * friction;
        let (c, d) = (pcy1 * lcy, mu * load);
        let k = self.lateral_stiffness(load, contact.gamma);
        let shift_h = (phy1 + phy2 * dfz) * lhy + phy3 * gamma;
        let shift_v = load * ((pvy1 + pvy2 * dfz) * lvy + (pvy3 + pvy4 * dfz) * gamma) * friction;
        let alpha = contact.alpha + shift_h;
        let e = (pey1 + pey2 * dfz) * (one - (pey3 + pey4 * gamma) * alpha.sign()) * ley;
        let b = k / (c * d);
        let curve = Curve { x: alpha, b, c, e: e.min(one) };
        LateralSlip { curve, peak: d, friction: mu, stiffness: k, b_times_c: b * c, shift_h, shift_v }
    }

    /// Forces, with the tangent of the slip angle, up to that of [`GREATEST_ANGLE`].
    #[inline(always)]
    fn forces_at<L: Lanes<Stored = T>>(&self, contact: Contact<L>, tangent: L) -> TyreForces<L> {
        take!(self; r0 fz0 qsx1 qsx2 qsx3 lvmx lmx);
        let wheel = &self.wheel(&contact);
        let WheelSlip { longitudinal, lateral, load, factor, .. } = wheel;
        let pure_x = longitudinal.peak * longitudinal.curve.sin() + longitudinal.shift_v;
        let pure_y = lateral.peak * lateral.curve.sin() * self.softened(lateral) + lateral.shift_v;
        let planar = self.planar(wheel, pure_x, pure_y);
        let Planar { fx, fy, .. } = planar;
        let mz = self.aligning_moment(wheel, tangent, &planar);
        let mx = r0 * *load * (qsx1 * lvmx + (-qsx2 * wheel.contact.gamma + qsx3 * fy / fz0) * lmx);
        let zero = L::splat(0.0);
        let lifted = contact.load.up_to(L::splat(LIFTED));
        let on_road = |force: L| L::choose(lifted, zero, *factor * force);
        TyreForces { fx: on_road(fx), fy: on_road(fy), mx: on_road(mx), mz: on_road(mz) }
    }

    /// Factor of early softening on the lateral force. Brushes yield from the first slip on: `1 - u` of their slope at
    /// a share `u` of the slip at which they slide, for the same slope in between.
    #[inline(always)]
    fn softened<L: Lanes<Stored = T>>(&self, lateral: &LateralSlip<L>) -> L {
        take!(self; softening);
        let one = L::splat(1.0);
        if softening.is_zero() {
            return one;
        }
        let share = (lateral.b_times_c * lateral.curve.x).abs() * L::splat(1.0 / 3.0);
        (one + softening * L::splat(SOFTENED_AT)) / (one + softening * share)
    }

    /// Pure slip of a wheel.
    #[inline(always)]
    fn wheel<L: Lanes<Stored = T>>(&self, contact: &Contact<L>) -> WheelSlip<L> {
        take!(self; cammin cammax);
        let (load, factor) = self.range_of_load(contact.load);
        let contact = Contact { gamma: contact.gamma.clamp(cammin, cammax), ..*contact };
        let dfz = self.dfz(load);
        let longitudinal = self.pure_longitudinal(&contact, load, dfz);
        let lateral = self.pure_lateral(&contact, load, dfz);
        WheelSlip { contact, load, factor, dfz, longitudinal, lateral }
    }

    /// Combined slip, by weights where the file has the coefficients of them.
    #[inline(always)]
    fn planar<L: Lanes<Stored = T>>(&self, wheel: &WheelSlip<L>, pure_x: L, pure_y: L) -> Planar<L> {
        take!(self; rbx1 rby1);
        let without = (rbx1 * rby1).equals(L::splat(0.0));
        if L::all(without) {
            return self.friction_ellipse(wheel, pure_x, pure_y);
        }
        let weighted = self.combined(wheel, pure_x, pure_y);
        if L::any(without) {
            let ellipse = self.friction_ellipse(wheel, pure_x, pure_y);
            return Planar {
                fx: L::choose(without, ellipse.fx, weighted.fx),
                fy: L::choose(without, ellipse.fy, weighted.fy),
                induced: L::choose(without, ellipse.induced, weighted.induced),
            };
        }
        weighted
    }

    /// Combined slip: the curves whose cosines weight the longitudinal and the lateral force.
    #[inline(always)]
    fn weights<L: Lanes<Stored = T>>(&self, wheel: &WheelSlip<L>) -> [Curve<L>; 2] {
        take!(self; rbx1 rbx2 lxal rcx1 rex1 rex2 rhx1 rhy1 rhy2 rby1 rby2 rby3 lyka rcy1 rey1 rey2);
        let one = L::splat(1.0);
        let WheelSlip { contact: Contact { kappa, alpha, .. }, dfz, .. } = *wheel;
        [
            Curve {
                x: alpha + rhx1,
                b: rbx1 * cos_atan(rbx2 * kappa) * lxal,
                c: rcx1,
                e: (rex1 + rex2 * dfz).min(one),
            },
            Curve {
                x: kappa + (rhy1 + rhy2 * dfz),
                b: rby1 * cos_atan(rby2 * (alpha - rby3)) * lyka,
                c: rcy1,
                e: (rey1 + rey2 * dfz).min(one),
            },
        ]
    }

    /// Combined slip by weighting functions.
    #[inline(always)]
    fn combined<L: Lanes<Stored = T>>(&self, wheel: &WheelSlip<L>, pure_x: L, pure_y: L) -> Planar<L> {
        take!(self; rhx1 rhy1 rhy2 rvy1 rvy2 rvy3 rvy4 rvy5 rvy6 lvyka);
        let WheelSlip { contact, load, dfz, lateral, .. } = *wheel;
        let (kappa, alpha) = (contact.kappa, contact.alpha);
        let shift = rhy1 + rhy2 * dfz;
        let [of_x, of_y] = self.weights(wheel);
        let (mut weight_x, mut weight_y) = (of_x.cos(), of_y.cos());
        // Without a shift the cosine is exactly 1.
        if !rhx1.is_zero() {
            weight_x = weight_x / Curve { x: rhx1, ..of_x }.cos();
        }
        if !shift.is_zero() {
            weight_y = weight_y / Curve { x: shift, ..of_y }.cos();
        }
        let mut induced = L::splat(0.0);
        if !(rvy1.is_zero() && rvy2.is_zero() && rvy3.is_zero()) {
            induced = lateral.friction
                * load
                * (rvy1 + rvy2 * dfz + rvy3 * contact.gamma)
                * cos_atan(rvy4 * alpha)
                * sin_of(rvy5 * atan_of(rvy6 * kappa))
                * lvyka;
        }
        Planar { fx: pure_x * weight_x, fy: pure_y * weight_y + induced, induced }
    }

    /// Combined slip for files without combined coefficients: the friction ellipse, as `PAC2002` has it.
    #[inline(always)]
    fn friction_ellipse<L: Lanes<Stored = T>>(&self, wheel: &WheelSlip<L>, fx0: L, fy: L) -> Planar<L> {
        take!(self; phx1 phx2 lhx);
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let WheelSlip { contact, dfz, longitudinal, lateral, .. } = *wheel;
        let kappa = (contact.kappa + (phx1 + phx2 * dfz) * lhx).abs();
        let angle = contact.alpha + lateral.shift_h + lateral.shift_v / lateral.stiffness;
        let alpha = sin_of(angle).abs();
        let pure = kappa.min(alpha).equals(zero);
        let fy0 = fy - lateral.shift_v;
        let slope = alpha / kappa;
        let (x, y) = (fx0 * slope / lateral.peak, fy0 / (longitudinal.peak * slope));
        Planar {
            fx: L::choose(pure, fx0, fx0 / (one + x * x).sqrt()),
            fy: L::choose(pure, fy, fy0 / (one + y * y).sqrt() + lateral.shift_v),
            induced: zero,
        }
    }
}
