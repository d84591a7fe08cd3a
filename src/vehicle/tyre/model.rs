//! The formula of a tyre, as a vehicle asks for it.
//!
//! The Magic Formula is one [`TyreModel`], and the only one that files have. Another is written for one wheel at a time, and drives
//! with [`CarFor::with_tyres`](crate::vehicle::car::CarFor::with_tyres). The equations of motion ask four tyres side by side
//! ([`FourTyres`]); [`OneByOne`] asks a model of single tyres four times.

use super::contact::{Contact, TyreForces};
use crate::numerics::lanes::{FOUR, Lanes};

/// A tyre in SI units and ISO axes of the wheel. The road's friction comes with each contact.
pub trait TyreModel: Clone + Send + Sync + 'static {
    /// Four of them side by side; [`OneByOne<Self>`](OneByOne) for a model of single tyres.
    type Four: FourTyres + Send + Sync;

    /// Puts four tyres side by side.
    fn side_by_side(tyres: [&Self; FOUR]) -> Self::Four;

    /// Effective rolling radius at the nominal load, m.
    fn rolling_radius(&self) -> f64;

    /// Vertical stiffness, N/m.
    fn vertical_stiffness(&self) -> f64;

    /// Vertical damping, N s/m.
    fn vertical_damping(&self) -> f64;

    /// Longitudinal slip, and tangent of the slip angle, at which the tyre slides under a load in N.
    fn sliding(&self, load: f64) -> [f64; 2];

    /// Cornering stiffness `-dFy/dalpha` at no slip, N/rad, positive, for a load in N and an inclination in rad.
    fn cornering_stiffness(&self, load: f64, gamma: f64) -> f64;

    /// Slip stiffness `dFx/dkappa` at no slip, N, for a load in N.
    fn slip_stiffness(&self, load: f64) -> f64;

    /// Relaxation length of the lateral slip, m, for a load in N and an inclination in rad; 0 for none.
    fn lateral_relaxation(&self, load: f64, gamma: f64) -> f64;

    /// Relaxation length of the longitudinal slip, m, for a load in N; 0 for none.
    fn longitudinal_relaxation(&self, load: f64) -> f64;

    /// Rolling resistance moment, N m, positive, for a load in N, a longitudinal force in N and a speed in m/s.
    fn rolling_resistance(&self, load: f64, fx: f64, speed: f64) -> f64;

    /// Forces and moments at steady slip: all zero for a wheel in the air, finite for finite input. A right wheel has the left
    /// one's tyre mirrored; the model need not know.
    fn forces(&self, contact: &Contact) -> TyreForces;

    /// Multiplies the cornering stiffness: the effects `tyre_stiffness_*`.
    fn scale_cornering_stiffness(&mut self, factor: f64);

    /// Multiplies the relaxation length of the lateral slip: the effect `tyre_relaxation`.
    fn scale_lateral_relaxation(&mut self, factor: f64);
}

/// Four tyres side by side. Methods are those of [`TyreModel`], in numbers for four wheels.
#[allow(missing_docs)]
pub trait FourTyres {
    fn vertical_stiffness<L: Lanes<Stored = [f64; FOUR]>>(&self) -> L;
    fn vertical_damping<L: Lanes<Stored = [f64; FOUR]>>(&self) -> L;
    fn slip_stiffness<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L) -> L;
    fn lateral_relaxation<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L, gamma: L) -> L;
    fn longitudinal_relaxation<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L) -> L;
    fn rolling_resistance<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L, fx: L, speed: L) -> L;
    /// With the tangent of the slip angle, which the wheel knows.
    fn forces<L: Lanes<Stored = [f64; FOUR]>>(&self, contact: Contact<L>, tangent: L) -> TyreForces<L>;
}

/// Four tyres that are asked one after the other.
#[derive(Debug, Clone)]
pub struct OneByOne<T>([T; FOUR]);

impl<T: TyreModel> OneByOne<T> {
    /// Four tyres.
    #[must_use]
    pub fn new(tyres: [&T; FOUR]) -> Self {
        Self(tyres.map(T::clone))
    }

    fn each<L: Lanes<Stored = [f64; FOUR]>>(&self, of: impl Fn(&T, usize) -> f64) -> L {
        L::load(&std::array::from_fn(|wheel| of(&self.0[wheel], wheel)))
    }
}

impl<T: TyreModel> FourTyres for OneByOne<T> {
    fn vertical_stiffness<L: Lanes<Stored = [f64; FOUR]>>(&self) -> L {
        self.each(|tyre, _| tyre.vertical_stiffness())
    }

    fn vertical_damping<L: Lanes<Stored = [f64; FOUR]>>(&self) -> L {
        self.each(|tyre, _| tyre.vertical_damping())
    }

    fn slip_stiffness<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L) -> L {
        let load = load.store();
        self.each(|tyre, i| tyre.slip_stiffness(load[i]))
    }

    fn lateral_relaxation<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L, gamma: L) -> L {
        let (load, gamma) = (load.store(), gamma.store());
        self.each(|tyre, i| tyre.lateral_relaxation(load[i], gamma[i]))
    }

    fn longitudinal_relaxation<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L) -> L {
        let load = load.store();
        self.each(|tyre, i| tyre.longitudinal_relaxation(load[i]))
    }

    fn rolling_resistance<L: Lanes<Stored = [f64; FOUR]>>(&self, load: L, fx: L, speed: L) -> L {
        let (load, fx, speed) = (load.store(), fx.store(), speed.store());
        self.each(|tyre, i| tyre.rolling_resistance(load[i], fx[i], speed[i]))
    }

    fn forces<L: Lanes<Stored = [f64; FOUR]>>(&self, contact: Contact<L>, _: L) -> TyreForces<L> {
        let Contact { kappa, alpha, gamma, load, friction } = contact;
        let [kappa, alpha, gamma, load, friction] = [kappa, alpha, gamma, load, friction].map(L::store);
        let forces: [TyreForces; FOUR] = std::array::from_fn(|i| {
            let (kappa, alpha, gamma) = (kappa[i], alpha[i], gamma[i]);
            self.0[i].forces(&Contact { kappa, alpha, gamma, load: load[i], friction: friction[i] })
        });
        let of = |part: fn(&TyreForces) -> f64| L::load(&forces.each_ref().map(part));
        TyreForces { fx: of(|f| f.fx), fy: of(|f| f.fy), mx: of(|f| f.mx), mz: of(|f| f.mz) }
    }
}
