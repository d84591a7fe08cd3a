//! Fast motions of two axles and of the body above them, which follow their equilibrium; four wheels at once.

use super::decay::one_minus_exp_neg_of;
use super::past::Past;
use crate::numerics::lanes::{FOUR, Lanes, Work};
use crate::vehicle::tyre::TyreModel;
use crate::vehicle::unit::{
    DEFLECTION_X, DEFLECTION_Y, LIFT, LIFT_RATE, PER_WHEEL, SIDES, SPIN, UnitAxle, VX, WIND_UP, Wheels,
    YAW_RATE,
};

/// Share of the way to equilibrium in one step of a body's pitch and heave: its springs stand on the tyres'.
const SPRINGS: f64 = 0.7;
/// Greatest longitudinal slip, and the speed (m/s) below which wheels count as rolling at it.
const GREATEST_SLIP: f64 = 0.5;
const LEAST_SPEED: f64 = 1.0;
/// Least slip stiffness of a tyre in the air, N.
const LEAST_STIFFNESS: f64 = 1e3;

/// A body on springs among a plant's states. Places of heave, its rate, pitch, its rate; mass, inertias in pitch and in
/// roll (that with the sideways motion of rolling). Stiffnesses of the springs in heave (N/m) and pitch (N m/rad).
pub(in crate::vehicle) struct SprungBody {
    pub heave: [usize; 2],
    pub pitch: [usize; 2],
    pub mass: f64,
    pub inertia: f64,
    pub roll_inertia: f64,
    pub heave_stiffness: f64,
    pub pitch_stiffness: f64,
}

/// Wheels of two axles, or of the last one twice: constants, and memory of their last step.
pub(super) struct FastWheels {
    /// Place of the first one's states, and the number of wheels.
    at: usize,
    count: usize,
    tyres: [f64; FOUR],
    radius: [f64; FOUR],
    inertia: [f64; FOUR],
    /// To the left of the middle, m.
    aside: [f64; FOUR],
    /// Forward of the body's CG, m.
    x: [f64; FOUR],
    /// Half of an axle's unsprung mass, kg.
    mass: [f64; FOUR],
    spring: [f64; FOUR],
    damper: [f64; FOUR],
    /// Of tyre, spring and anti-roll bar, N/m.
    stiffness: [f64; FOUR],
    /// Share of a push that goes on to the body: of its spring, where tyre and spring share it.
    handed_on: [f64; FOUR],
    kappa: [f64; FOUR],
    /// Lift at the last step, m.
    lift: [f64; FOUR],
    slip: Past<[f64; FOUR]>,
}

impl FastWheels {
    /// Of two axles; the first wheel's states are at a place.
    pub fn new<T: TyreModel>([first, second]: [&UnitAxle<T>; 2], at: usize, count: usize) -> Self {
        let axles = [first, first, second, second];
        let tyre = |axle: &UnitAxle<T>| axle.tyres * axle.tyre.vertical_stiffness();
        let bar = |axle: &UnitAxle<T>| 0.5 * axle.anti_roll_bar / (axle.half_track * axle.half_track);
        Self {
            at,
            count,
            tyres: axles.map(|axle| axle.tyres),
            radius: axles.map(|axle| axle.radius),
            inertia: axles.map(|axle| axle.wheel_inertia),
            aside: std::array::from_fn(|i| SIDES[i] * axles[i].half_track),
            x: axles.map(|axle| axle.x_sprung),
            mass: axles.map(|axle| 0.5 * axle.unsprung_mass),
            spring: axles.map(|axle| axle.spring),
            damper: axles.map(|axle| axle.damper),
            stiffness: axles.map(|axle| tyre(axle) + axle.spring + bar(axle)),
            handed_on: axles.map(|axle| axle.spring / (axle.spring + tyre(axle))),
            kappa: [0.0; FOUR],
            lift: [0.0; FOUR],
            slip: Past::NONE,
        }
    }

    /// Forgets the last step.
    pub fn start(&mut self) {
        (self.kappa, self.slip) = ([0.0; FOUR], Past::NONE);
    }

    /// Force that wheels which turn faster than the vehicle do not have yet, N, and what their inertia adds to its mass, kg.
    /// A wheel that spins or is locked gets no more.
    pub fn add_late(&self, rates: &[f64], (force, mass): (&mut f64, &mut f64)) {
        for wheel in (0..self.count).filter(|wheel| self.kappa[*wheel].abs() < GREATEST_SLIP) {
            let (radius, inertia) = (self.radius[wheel], self.inertia[wheel]);
            let faster = rates[self.at + wheel * PER_WHEEL + SPIN] - rates[VX] / radius;
            *force += inertia * faster / radius;
            *mass += inertia / (radius * radius);
        }
    }
}

/// One step of the fast motions. With `h`, the tyres' lateral deflections are integrated; without it they settle.
pub(super) struct Follow<'a, T: TyreModel, const N: usize> {
    pub wheels: &'a mut FastWheels,
    pub constants: &'a Wheels<T>,
    pub body: &'a SprungBody,
    pub y: &'a mut [f64; N],
    pub rates: &'a [f64; N],
    /// Order of integration.
    pub order: usize,
    pub h: Option<f64>,
}

impl<T: TyreModel, const N: usize> Work for Follow<'_, T, N> {
    type Given = ();

    #[inline(always)]
    fn with<L: Lanes<Stored = [f64; FOUR]>>(self) {
        let Self { wheels, constants, body, y, rates, order, h } = self;
        let number = L::splat;
        // Which wheel is in a lane.
        let lanes = if wheels.count < FOUR { [0, 1, 0, 1] } else { [0, 1, 2, 3] };
        let at = |state: usize| lanes.map(|wheel| wheels.at + wheel * PER_WHEEL + state);
        let of_rates = |state: usize| L::load(&at(state).map(|place| rates[place]));

        // What a wheel is pushed up by, it hands on to its body by its spring's share: both are moved together, or stiff
        // springs would throw one to and fro on the other.
        let mass = L::load(&wheels.mass);
        let lift_rate = of_rates(LIFT_RATE);
        let push = (L::load(&wheels.handed_on) * lift_rate * mass).store();
        let (mut lifting, mut pitching) = (0.0, 0.0);
        for (push, x) in push.iter().zip(&wheels.x).take(wheels.count) {
            (lifting, pitching) = (lifting + push, pitching - x * push);
        }
        let [heave, rate] = body.heave;
        let rises = SPRINGS * (rates[rate] * body.mass + lifting) / body.heave_stiffness;
        y[heave] += rises;
        let [pitch, rate] = body.pitch;
        let pitches = SPRINGS * (rates[rate] * body.inertia + pitching) / body.pitch_stiffness;
        y[pitch] += pitches;

        let of_states = |y: &[f64; N], state: usize| L::load(&at(state).map(|place| y[place]));
        let (lift, lifts) = (of_states(y, LIFT), of_states(y, LIFT_RATE));
        let tyres = L::load(&wheels.tyres);
        let each = constants.load(lift, lifts) / tyres;
        let [length_x, length_y] = constants.relaxation_lengths(each, number(0.0));

        let rate = number(y[VX].abs().max(LEAST_SPEED)) / length_y;
        let v = of_states(y, DEFLECTION_Y);
        let slip = of_rates(DEFLECTION_Y) + rate * v;
        let v = match h {
            Some(h) => {
                let ahead = wheels.slip.ahead(slip, order);
                v + one_minus_exp_neg_of(rate * number(h)) * (ahead / rate - v)
            }
            None => {
                wheels.slip = Past::NONE;
                slip / rate
            }
        };

        let radius = L::load(&wheels.radius);
        let stiffness = tyres * constants.slip_stiffness(each).max(number(LEAST_STIFFNESS)) * radius;
        // A wheel keeps pace with the vehicle: what turns it ever faster is taken from its force.
        let lag = of_rates(SPIN) - number(rates[VX]) / radius;
        let wanted = L::load(&wheels.kappa) + lag * L::load(&wheels.inertia) / stiffness;
        let kappa = wanted.clamp(number(-GREATEST_SLIP), number(GREATEST_SLIP));
        wheels.kappa = kappa.store();
        let vx =
            (number(y[VX]) - L::load(&wheels.aside) * number(y[YAW_RATE])).max(number(0.5 * LEAST_SPEED));
        let spin = vx * (number(1.0) + kappa) / radius;

        let (spring, stiffness) = (L::load(&wheels.spring), L::load(&wheels.stiffness));
        let force = lift_rate * mass + spring * (number(rises) - L::load(&wheels.x) * number(pitches));
        let (lift, lifts) = match h {
            Some(h) => {
                let (h, last) = (number(h), L::load(&wheels.lift));
                let damper = L::load(&wheels.damper) / h;
                let now = (force + stiffness * lift + damper * (lifts * h + last)) / (stiffness + damper);
                let moved = now - last;
                wheels.lift = now.store();
                (now + moved, moved / h)
            }
            None => {
                let now = lift + force / stiffness;
                wheels.lift = now.store();
                (now, number(0.0))
            }
        };

        let [u, v, spin] = [kappa * length_x, v, spin].map(L::store);
        let (lift, lifts) = (lift.store(), lifts.store());
        let (states, _) = y[wheels.at..].as_chunks_mut::<PER_WHEEL>();
        for (i, state) in states.iter_mut().enumerate().take(wheels.count) {
            (state[DEFLECTION_X], state[DEFLECTION_Y]) = (u[i], v[i]);
            (state[LIFT], state[LIFT_RATE]) = (lift[i], lifts[i]);
            // A turning wheel's brake has slipped: its wind-up is at its greatest.
            (state[SPIN], state[WIND_UP]) = (spin[i], spin[i]);
        }
    }
}
