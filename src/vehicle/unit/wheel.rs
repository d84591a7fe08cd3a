//! One wheel: transient slip, forces, spin and brake.
//!
//! The contact's deflections `u`, `v` (m) follow the slip velocities with the relaxation lengths `s`:
//!
//! ```text
//!     u' = -Vsx - V u / sx,   kappa = u / sx          v' = Vsy - V v / sy,   tan(alpha) = v / sy
//! ```
//!
//! At speed this is first-order relaxation; at rest `V = 0` it is a spring (Pacejka, section 8.6). So nothing divides
//! by the speed, and a braked car holds on a slope. `V` is the rolling speed, but at least a share of the slip
//! velocity, which bounds the slip of a spinning or sideways wheel. At speed this slip is a large one, at rest that at
//! which the tyre slides on this road. A deflection beyond it holds no force, and would push a wheel that has slid to
//! rest back by the whole of its relaxation length. `s` is no less than a step of the integration can follow at `V`.

use super::axle::UnitAxle;
use super::dry_friction::DryFriction;
use super::wheel_motion::{WheelFlow, WheelMotion};
use super::{DEFLECTION_X, DEFLECTION_Y, LIFT, LIFT_RATE, PER_WHEEL, SPIN, WIND_UP};
use crate::numerics::lanes::{FOUR, Lanes};
use crate::vehicle::trigonometry::atan_of;
use crate::vehicle::tyre::{Contact, FourTyres as _, TyreForces, TyreModel};

/// Shortest relaxation length, m: that of a file without one, and of a wheel that lifts.
pub(in crate::vehicle) const SHORTEST_RELAXATION: f64 = 0.1;
/// Fastest relaxation of a deflection, 1/s: the classic Runge-Kutta method is stable up to 2.78 for each step, of at most a
/// millisecond. The shortest length reaches it at 150 m/s: only a wheel that spins does.
const FASTEST_RELAXATION: f64 = 1500.0;
/// Greatest longitudinal slip and greatest tangent of the slip angle.
const GREATEST_SLIP: f64 = 1.5;
const GREATEST_TANGENT: f64 = 3.0;
/// Damping of the deflections at rest, s/m, and the speed at which it has vanished, m/s.
const DAMPING_AT_REST: f64 = 0.15;
const DAMPED_BELOW: f64 = 2.5;
/// Speed below which a slide comes to rest on a road with a friction of 1, m/s.
const SLIDES_OUT_BELOW: f64 = 4.0;
/// The brake's wind-up is a spring: natural frequency of the wheel on it (rad/s) and damping ratio.
const BRAKE_FREQUENCY: f64 = 300.0;
const BRAKE_DAMPING: f64 = 0.7;
/// Fastest relaxation of the wind-up, 1/s.
const BRAKE_RELAXATION: f64 = 500.0;
/// Rolling speed over which rolling resistance builds up, m/s.
const ROLLING_FROM: f64 = 0.1;

/// +1 on the left, -1 on the right, where the tyre is mounted mirrored.
pub(in crate::vehicle) const SIDES: [f64; FOUR] = [1.0, -1.0, 1.0, -1.0];

/// The constants of the wheels of two axles, left and right of each.
pub(in crate::vehicle) struct Wheels<T: TyreModel> {
    tyre: T::Four,
    tyres: [f64; FOUR],
    static_load: [f64; FOUR],
    radius: [f64; FOUR],
    inertia: [f64; FOUR],
    relaxation: [f64; FOUR],
    /// One over the longitudinal slip, and over the tangent of the slip angle, at which tyres slide under the load at rest.
    sliding: [[f64; FOUR]; 2],
}

impl<T: TyreModel> Wheels<T> {
    /// Those of two axles; a last one may stand alone, and is then named twice.
    pub fn new([first, second]: [&UnitAxle<T>; 2]) -> Self {
        let axles = [first, first, second, second];
        let slides = axles.map(|axle| axle.tyre.sliding(axle.static_load / axle.tyres));
        Self {
            tyre: T::side_by_side(axles.map(|axle| &axle.tyre)),
            tyres: axles.map(|axle| axle.tyres),
            static_load: axles.map(|axle| axle.static_load),
            radius: axles.map(|axle| axle.radius),
            inertia: axles.map(|axle| axle.wheel_inertia),
            relaxation: axles.map(|axle| axle.relaxation),
            sliding: [0, 1].map(|way| slides.map(|slip| 1.0 / slip[way])),
        }
    }
}

/// All wheels of a vehicle: their motion and forces, and the rates of their spins, deflections and brakes. States of
/// the wheels follow each other, left and right of each axle; `groups` are four of them each.
#[inline(always)]
pub(in crate::vehicle) fn roll<L: Lanes<Stored = [f64; FOUR]>, T: TyreModel, const W: usize>(
    groups: &[Wheels<T>],
    states: &[f64],
    motions: &[WheelMotion; W],
    friction: [f64; W],
    rates: &mut [f64],
) -> [WheelFlow; W] {
    let mut flows = [WheelFlow::default(); W];
    for (group, wheels) in groups.iter().enumerate() {
        let all = FOUR * group..W.min(FOUR * (group + 1));
        let of_states = PER_WHEEL * all.start..PER_WHEEL * all.end;
        wheels.roll::<L>(
            &states[of_states.clone()],
            &motions[all.clone()],
            &friction[all.clone()],
            &mut rates[of_states],
            &mut flows[all],
        );
    }
    flows
}

/// Numbers of four wheels.
#[inline(always)]
fn gather<L: Lanes<Stored = [f64; FOUR]>>([a, b, c, d]: [usize; FOUR], of: impl Fn(usize) -> f64) -> L {
    L::load(&[of(a), of(b), of(c), of(d)])
}

impl<T: TyreModel> Wheels<T> {
    /// Four wheels, or two and these once more.
    #[inline(always)]
    fn roll<L: Lanes<Stored = [f64; FOUR]>>(
        &self,
        states: &[f64],
        motions: &[WheelMotion],
        friction: &[f64],
        rates: &mut [f64],
        flows: &mut [WheelFlow],
    ) {
        // Which wheel is in a lane.
        let lanes = if motions.len() < FOUR { [0, 1, 0, 1] } else { [0, 1, 2, 3] };
        let (states, _) = states.as_chunks::<PER_WHEEL>();
        let side = L::load(&SIDES);
        let spin: L = gather(lanes, |wheel| states[wheel][SPIN]);
        let motion = WheelMotionLanes {
            vx: gather(lanes, |wheel| motions[wheel].vx),
            vy: gather(lanes, |wheel| motions[wheel].vy),
            gamma: gather(lanes, |wheel| motions[wheel].gamma),
            drive: gather(lanes, |wheel| motions[wheel].drive),
            brake: gather(lanes, |wheel| motions[wheel].brake),
        };
        let lift = gather(lanes, |wheel| states[wheel][LIFT]);
        let lift_rate = gather(lanes, |wheel| states[wheel][LIFT_RATE]);
        let u = gather(lanes, |wheel| states[wheel][DEFLECTION_X]);
        let v = gather(lanes, |wheel| states[wheel][DEFLECTION_Y]);
        let friction = gather(lanes, |wheel| friction[wheel]);
        let slip = self.slip(self.load(lift, lift_rate), spin, [u, v], &motion, friction);
        let contact = Contact {
            kappa: slip.kappa,
            alpha: side * atan_of(slip.tangent),
            gamma: side * motion.gamma,
            load: slip.load / L::load(&self.tyres),
            friction,
        };
        let forces = self.tyre.forces(contact, side * slip.tangent);
        let wind_up = gather(lanes, |wheel| states[wheel][WIND_UP]);
        let given = self.wheel(spin, wind_up, &motion, &contact, forces);

        let (du, dv) = (slip.rates[0].store(), slip.rates[1].store());
        let (spin_rate, wind_up_rate) = (given.rates[0].store(), given.rates[1].store());
        let (load, torque) = (given.load.store(), given.torque.store());
        let TyreForces { fx, fy, mx, mz } = given.forces;
        let (fx, fy, mx, mz) = (fx.store(), fy.store(), mx.store(), mz.store());
        let (kappa, alpha) = (contact.kappa.store(), (side * contact.alpha).store());
        let (rates, _) = rates.as_chunks_mut::<PER_WHEEL>();
        for (i, (flow, rates)) in flows.iter_mut().zip(rates).enumerate().take(FOUR) {
            (rates[DEFLECTION_X], rates[DEFLECTION_Y]) = (du[i], dv[i]);
            (rates[SPIN], rates[WIND_UP]) = (spin_rate[i], wind_up_rate[i]);
            let forces = TyreForces { fx: fx[i], fy: fy[i], mx: mx[i], mz: mz[i] };
            *flow = WheelFlow { load: load[i], forces, kappa: kappa[i], alpha: alpha[i], torque: torque[i] };
        }
    }
}

/// [`WheelMotion`]s side by side.
struct WheelMotionLanes<L> {
    vx: L,
    vy: L,
    gamma: L,
    drive: L,
    brake: L,
}

/// Load and transient slip of wheels, the lateral one by its tangent in axes of the wheel; rates of the deflections.
struct Slip<L> {
    load: L,
    kappa: L,
    tangent: L,
    rates: [L; 2],
}

/// Response of wheels; rates of spin and wind-up.
struct WheelResponse<L> {
    load: L,
    forces: TyreForces<L>,
    torque: L,
    rates: [L; 2],
}

impl<T: TyreModel> Wheels<T> {
    /// Loads of wheels from their heights over rest, N; a tyre does not pull.
    #[inline(always)]
    pub fn load<L: Lanes<Stored = [f64; FOUR]>>(&self, lift: L, lift_rate: L) -> L {
        let (zero, tyres) = (L::splat(0.0), L::load(&self.tyres));
        let elastic = L::load(&self.static_load) - tyres * self.tyre.vertical_stiffness() * lift;
        let damping = tyres * self.tyre.vertical_damping() * lift_rate;
        L::choose(elastic.up_to(zero), zero, (elastic - damping).max(zero))
    }

    /// Slip stiffness of each of a wheel's tyres, N, under a load of each.
    #[inline(always)]
    pub fn slip_stiffness<L: Lanes<Stored = [f64; FOUR]>>(&self, each: L) -> L {
        self.tyre.slip_stiffness(each)
    }

    /// Relaxation lengths of the longitudinal and the lateral slip, m, under a load of each tyre and at an inclination.
    #[inline(always)]
    pub fn relaxation_lengths<L: Lanes<Stored = [f64; FOUR]>>(&self, each: L, gamma: L) -> [L; 2] {
        let (zero, shortest) = (L::splat(0.0), L::splat(SHORTEST_RELAXATION));
        let given = L::load(&self.relaxation);
        let lateral = L::choose(zero.below(given), given, self.tyre.lateral_relaxation(each, gamma));
        [self.tyre.longitudinal_relaxation(each).max(shortest), lateral.max(shortest)]
    }

    /// The slip of wheels under a load, and the rates of their deflections.
    #[inline(always)]
    fn slip<L: Lanes<Stored = [f64; FOUR]>>(
        &self,
        load: L,
        spin: L,
        [u, v]: [L; 2],
        motion: &WheelMotionLanes<L>,
        friction: L,
    ) -> Slip<L> {
        let number = L::splat;
        let (zero, one) = (number(0.0), number(1.0));
        let slip_x = motion.vx - spin * L::load(&self.radius);
        let slip_y = motion.vy;
        let (per_slip, per_tangent) = (number(1.0 / GREATEST_SLIP), number(1.0 / GREATEST_TANGENT));
        let mut speed = (slip_y.abs() * per_tangent).max((slip_x.abs() * per_slip).max(motion.vx.abs()));
        let each = load / L::load(&self.tyres);
        // What depends on the load alone is known early: nothing waits for a division then.
        let [mut relax_x, mut relax_y] =
            self.relaxation_lengths(each, motion.gamma).map(|length| one / length);
        // The tyre's own damping matters only near rest, where the deflections are springs.
        let rest = (one - speed * number(1.0 / DAMPED_BELOW)).max(zero);
        let damping = number(DAMPING_AT_REST) * rest * rest;
        // The less the grip, the longer a slide to rest: from a slower speed on it is long enough to relax.
        let nearly = number(SLIDES_OUT_BELOW) * friction;
        if L::any(speed.below(nearly)) {
            let rest = (one - speed / nearly).max(zero);
            let [x, y] = &self.sliding;
            let more = |sliding: &[f64; FOUR], least: L| (L::load(sliding) / friction - least).max(zero);
            let by_x = slip_x.abs() * (per_slip + rest * more(x, per_slip));
            let by_y = slip_y.abs() * (per_tangent + rest * more(y, per_tangent));
            speed = by_y.max(by_x.max(speed));
        }
        if L::any(number(FASTEST_RELAXATION * SHORTEST_RELAXATION).below(speed)) {
            let fastest = number(FASTEST_RELAXATION) / speed;
            (relax_x, relax_y) = (relax_x.min(fastest), relax_y.min(fastest));
        }
        let (kappa, tangent) = (u * relax_x, v * relax_y);
        let du = -slip_x - speed * kappa;
        let dv = slip_y - speed * tangent;
        Slip { load, kappa: kappa + damping * du, tangent: tangent + damping * dv, rates: [du, dv] }
    }

    /// Response of wheels to the forces on their contacts, and the rates of spin and brake. Contact and forces are
    /// those of each of a wheel's tyres.
    #[inline(always)]
    fn wheel<L: Lanes<Stored = [f64; FOUR]>>(
        &self,
        spin: L,
        wind_up: L,
        motion: &WheelMotionLanes<L>,
        contact: &Contact<L>,
        forces: TyreForces<L>,
    ) -> WheelResponse<L> {
        let number = L::splat;
        let (tyres, radius, inertia) = (L::load(&self.tyres), L::load(&self.radius), L::load(&self.inertia));
        let rolling = tyres
            * self.tyre.rolling_resistance(contact.load, forces.fx, motion.vx)
            * (spin * radius * number(1.0 / ROLLING_FROM)).clamp(number(-1.0), number(1.0));
        let sided = tyres * L::load(&SIDES);
        let forces = TyreForces {
            fx: forces.fx * tyres,
            fy: forces.fy * sided,
            mx: forces.mx * sided,
            mz: forces.mz * sided,
        };
        // The brake against the spin, and the rate of its wind-up.
        let brake = DryFriction {
            stiffness: inertia * number(BRAKE_FREQUENCY) * number(BRAKE_FREQUENCY),
            damping: number(2.0 * BRAKE_DAMPING * BRAKE_FREQUENCY) * inertia,
            fastest: number(BRAKE_RELAXATION),
        }
        .torque(spin, wind_up, motion.brake);
        let torque = motion.drive - brake.0;
        let spin_rate = (torque - forces.fx * radius - rolling) / inertia;
        WheelResponse { load: tyres * contact.load, forces, torque, rates: [spin_rate, brake.1] }
    }
}
