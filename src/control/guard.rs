//! The guard: plausibility of the measurements, and their replacement by an estimate.
//!
//! A measurement is plausible if the vehicle can have got there. A Kalman filter carries the motion
//! `z = [x, y, yaw, vx, vy, yaw_rate, articulation, articulation_rate]` from step to step, with the nominal model and
//! the commands in force. Each signal has a gate of its own:
//!
//! ```text
//! z^ = f(z, steer, accel),   P^ = F P F' + Q        (z_i - z^_i)^2 <= GATE^2 (P^_ii + R_i) n_i
//! ```
//!
//! `Q` covers forces of the tyres beyond the model, and `R` the sensors' noise (`observer.*`, twice as much).
//! `n_i >= 1` is the mean of the observed innovations in units of the expected ones: a sensor that is worse than
//! declared widens its own gate. Between two measurements `P` grows, and the gates with it. Poses and velocities come of
//! different sensors: by how much a wheel's radius or an odometer's scale makes them differ is learned, and is no fault.
//!
//! | observation | action |
//! |---|---|
//! | every signal inside its gate | the measurement goes on as it is, bit by bit |
//! | a signal outside, or no number | the filter's estimate from the others replaces it: *bridged* |
//! | the pose, or all of it, to the bit as a step before, in motion | stale: bridged, and never a contradiction |
//! | the place alone to the bit as a step before, in motion | the same of the place: a receiver slower than the other sensors |
//! | a rate that rests to the bit while its pose goes on (`resting.rs`) | dead: the same, until it changes |
//! | sensors that contradict one another for longer (`consistency.rs`) | at fault: the same, until they agree again |
//! | signals contradict one another from the start on | the same, steered by what they say |
//! | outside for `guard.bridge_time`, but a motion of its own, on the road or from standstill | the host has moved the vehicle: a new start |
//! | bridged for longer than `guard.bridge_time` | braking along the road, steered by the estimate |
//! | bridged for longer than `guard.stop_time` | the stop is completed; only a vehicle that the host moves further than it can drive starts anew |
//!
//! A motion of its own: the poses follow from the velocities, and these change no faster than tyres allow; the articulation alone
//! is none. Signals that
//! are all zero are no motion; a dead sensor looks like that. A vehicle in motion is not accepted anew beside its road
//! either. Its position jumps, and steering back from there would leave the road. Bridging what contradicts needs some
//! steps that agree; until then each measurement that contradicts is a new start, for as long as a gap may last.
//!
//! | file | idea |
//! |---|---|
//! | `track.rs` | the filter |
//! | `consistency.rs` | sensors at fault inside their gates |
//! | `new_start.rs` | a motion of its own |
//! | `resting.rs` | rates that rest |
//!
//! Source: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001. It treats the
//! validation gate, innovations as a test of the filter (5.4), and initiation of tracks.

mod consistency;
mod new_start;
mod resting;
mod track;

use self::consistency::{Consistency, Ordinary};
use self::new_start::NewStart;
use self::resting::Resting;
use self::track::{Track, difference};
use super::observer::ObserverParameters;
use super::step::{Measurement, StepError};
use super::vehicle::FurtherState;
use crate::nominal::{ERRORS, LateralVehicle};
use crate::parameters;
use crate::signal::{self, GRAVITY, Signal};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};
use std::ops::Range;

parameters! {
    /// Parameters for implausible measurements and for a poor model.
    pub struct GuardParameters {
        active: usize = 1, ONE in 0.0, 1.0; "guard.active", "Whether measurements and the learned model are checked against the prediction: 1 yes, 0 no"
        bridge_time: f64 = 0.4, SECOND in 0.0, 5.0; "guard.bridge_time", "Longest time for which prediction stands in for a missing or implausible measurement; beyond it the vehicle is braked along the road. Signals that agree among themselves for as long, on the road or at a standstill, are a new start"
        stop_time: f64 = 1.0, SECOND in 0.0, 60.0; "guard.stop_time", "Time without a plausible measurement after which the stop is completed even if measurements come back"
        slow_e1: f64 = 1.0, METRE in 0.1, 3.4; "guard.slow_e1", "Lateral error beyond which the vehicle slows down as long as the error grows"
    }
}

/// Signals that are judged, in the order of [`signals`].
const SIGNALS: usize = 8;
/// Their names.
const NAMED: [&Signal; SIGNALS] = [
    &signal::X,
    &signal::Y,
    &signal::YAW,
    &signal::VX,
    &signal::VY,
    &signal::YAW_RATE,
    &signal::ARTICULATION,
    &signal::ARTICULATION_RATE,
];
/// The signals of the pose, and those of its place.
const POSE: Range<usize> = 0..3;
const PLACE: Range<usize> = 0..2;
/// The first signal that only some vehicles have.
const ARTICULATION: usize = 6;

/// One value for each signal.
type Signals = SVector<f64, SIGNALS>;

/// Largest acceleration that tyres give, m/s2.
const GRIP: f64 = GRAVITY;
/// Width of a gate, in standard deviations.
const GATE: f64 = 6.0;
/// Assumed ratio of the sensors' noise to the declared one, before they have shown it.
const NOISE_MARGIN: f64 = 2.0;
/// Largest factor on the variance of a sensor that has shown more noise.
const LARGEST_SPREAD: f64 = 16.0;
/// Averaging time of noise and of the acceleration beyond the command, s.
const MEMORY: f64 = 1.0;
/// Steps in a row that must agree before something is bridged.
const ESTABLISHED: u32 = 5;
/// Way in a step from which on a vehicle moves, m: with the same bits a step later its measurement is stale.
const MOVES: f64 = 1e-3;
/// Way that a vehicle at rest is asked to drive, by which it has set out, m: with the same bits its measurement is stale, too.
const SETS_OUT: f64 = 0.1;
/// Largest share by which the way of the poses may differ from that of the velocities for good: a sensor's scale.
const LARGEST_SCALE: f64 = 0.1;
/// Largest plausible acceleration beyond the command, m/s2: drag and grade.
const LARGEST_DRIFT: f64 = 2.0;

/// What of a measurement is to the bit as a step before, in motion.
#[derive(Debug, Clone, Copy)]
struct OldSignals {
    all: bool,
    /// Place and yaw.
    pose: bool,
    place: bool,
}

impl OldSignals {
    fn has(self, signal: usize) -> bool {
        self.all || POSE.contains(&signal) && self.pose || PLACE.contains(&signal) && self.place
    }
}

/// True if every signal is a number.
fn are_finite(told: &Signals) -> bool {
    told.iter().all(|value| value.is_finite())
}

/// Everything of the guard that steps change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GuardState {
    /// None before the first step.
    track: Option<Track>,
    /// The last measurement, if all of it was finite.
    told: Option<Signals>,
    /// Speed, m/s, and way, m, that the commands ask for since the last measurement that said something new.
    asked: [f64; 2],
    /// True if the place of the last measurement was that of the one before, to the bit.
    rests: bool,
    /// Signals outside their gates in a measurement that was a new start, as long as these contradict one another.
    contradicting: [bool; SIGNALS],
    /// The pose that stayed to the bit while the vehicle moved, as long as it stays: no new start.
    dead_pose: Option<[f64; 3]>,
    resting: Resting,
    consistency: Consistency,
    /// Steps since the start in which everything new agreed.
    agreed: u32,
    /// Time for which measurements have contradicted one another without a start to hold on to, s.
    unsettled: f64,
    /// Time since each signal was last plausible, s.
    age: Signals,
    /// Mean of the squared innovations in units of their variance, half that of their changes, which a drift is not in, and the last
    /// ones.
    spread: Signals,
    scatter: Signals,
    missed: [Option<f64>; SIGNALS],
    candidate: Option<NewStart>,
    /// The last pose that was a number, m, and the way that the vehicle can have driven since then, m.
    place: Option<[f64; 2]>,
    reach: f64,
    /// Acceleration beyond the command, m/s2.
    drift: f64,
    /// True if a stop that has begun is to be completed.
    stops: bool,
}

/// Way from one measurement to the next: of the poses, m, and speed by the velocities, m/s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Way {
    pub by_poses: f64,
    pub speed: f64,
}

/// Judgement of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Judgement {
    /// As it is.
    Believed,
    /// Prediction stands in for some of it.
    Bridged,
    /// Unchanged, and nothing from before holds: the vehicle was moved.
    Moved,
}

/// The guard of a vehicle with `S` states.
#[derive(Debug, Clone)]
pub struct Guard<V, const S: usize> {
    parameters: GuardParameters,
    vehicle: V,
    /// Variance of each signal's noise.
    noise: Signals,
    /// Largest change of yaw rate and articulation rate in time that tyres give, rad/s2.
    yaw_accel: f64,
    min_model_speed: f64,
}

impl Default for GuardState {
    fn default() -> Self {
        Self {
            track: None,
            told: None,
            asked: [0.0; 2],
            rests: false,
            contradicting: [false; SIGNALS],
            dead_pose: None,
            resting: Resting::default(),
            consistency: Consistency::default(),
            agreed: 0,
            unsettled: 0.0,
            age: Signals::zeros(),
            spread: Signals::repeat(1.0),
            scatter: Signals::repeat(1.0),
            missed: [None; SIGNALS],
            candidate: None,
            place: None,
            reach: 0.0,
            drift: 0.0,
            stops: false,
        }
    }
}

/// The judged signals of a measurement.
fn signals(measurement: &Measurement) -> Signals {
    let Measurement { x, y, yaw, vx, vy, yaw_rate, articulation, articulation_rate, .. } = *measurement;
    Signals::from([x, y, yaw, vx, vy, yaw_rate, articulation, articulation_rate])
}

impl<V: LateralVehicle<S>, const S: usize> Guard<V, S> {
    /// The guard by its parameters, the sensors' noise, and the states behind the errors to the path.
    #[must_use]
    pub fn new(
        parameters: GuardParameters,
        observer: &ObserverParameters,
        further: &[FurtherState],
        vehicle: V,
        min_model_speed: f64,
    ) -> Self {
        let p = observer;
        let of_further = |i: usize| further.get(i).map_or(0.0, |state| state.noise);
        let noise = Signals::from([
            p.noise_position,
            p.noise_position,
            p.noise_yaw,
            p.noise_velocity,
            p.noise_velocity,
            p.noise_yaw_rate,
            of_further(0),
            of_further(1),
        ]);
        let noise = noise * NOISE_MARGIN;
        Self {
            parameters,
            noise: noise.component_mul(&noise),
            // Both axles at their grip, one each way, turn a body whose radius of inertia is half its wheelbase.
            yaw_accel: 2.0 * GRIP / vehicle.wheelbase(),
            vehicle,
            min_model_speed,
        }
    }

    /// Signals that the vehicle has.
    const JUDGED: usize = if S >= ERRORS + 2 { SIGNALS } else { ARTICULATION };

    /// Judges a measurement, `elapsed` seconds after the last one, with the commands that were in force since (rad,
    /// m/s2). Implausible signals are replaced. `on_road` tells if a pose is on the road.
    ///
    /// # Errors
    /// A first measurement that is not finite.
    pub fn judge(
        &self,
        state: &mut GuardState,
        measurement: &mut Measurement,
        elapsed: f64,
        [steer, accel]: [f64; 2],
        on_road: impl Fn(&Measurement) -> bool,
    ) -> Result<Judgement, StepError> {
        let told = signals(measurement);
        let Some(track) = state.track.filter(|_| self.parameters.active != 0) else {
            measurement.check()?;
            self.begin(state, &told);
            return Ok(Judgement::Believed);
        };
        let finite = are_finite(&told);
        let stale = self.find_stale(state, &told, track.mean[3], accel, elapsed);
        let scale = state.consistency.scale();
        let mut track = self.predict(&track, steer, [accel, state.drift], scale, elapsed);
        let moves = track.mean[3].abs() * elapsed > MOVES;
        let carried = self.is_carried(state, &told, track.mean[3], elapsed);

        let (mut believed, contradicts) = self.gate(state, &mut track, &told, stale, elapsed);
        if carried && state.stops {
            // The longer nothing was heard the wider are the gates; where it cannot have driven it was put.
            believed[POSE].fill(false);
        }
        let all = believed.iter().all(|believed| *believed);
        if contradicts && finite && state.agreed < ESTABLISHED {
            // Nothing to bridge from as yet: what was made of the samples before holds no longer.
            let unsettled = state.unsettled + elapsed;
            self.begin(state, &told);
            state.contradicting = believed.map(|believed| !believed);
            state.unsettled = unsettled;
            state.stops |= unsettled > self.parameters.stop_time;
            return Ok(if self.is_unsettled(state) { Judgement::Bridged } else { Judgement::Moved });
        }
        // Inputs that nobody has written yet are all zero, as a vehicle is that stands at the origin: neither is to hold on to.
        let says_something = told.iter().any(|value| *value != 0.0);
        if !contradicts && !stale.all && says_something {
            state.agreed = state.agreed.saturating_add(1);
            if state.agreed >= ESTABLISHED {
                state.unsettled = 0.0;
            }
        }
        if all {
            state.candidate = None;
        } else {
            // A vehicle that was put down and stands has the same bits at each step, too.
            let stands = (3..ARTICULATION).all(|i| told[i].abs() * elapsed <= MOVES);
            let lives = state.dead_pose.is_none() && !state.has_lost_rate();
            // A host that moves a truck moves more than its trailer.
            let elsewhere = !believed[..ARTICULATION].iter().all(|believed| *believed);
            let there = finite && elsewhere && (!stale.place || stands) && lives;
            state.candidate = self.candidate(state.candidate, &told, there, elapsed, scale, &state.spread);
            if let Some(candidate) = &mut state.candidate {
                candidate.carried |= carried;
            }
            let goes_on = |it: &NewStart| it.age >= self.parameters.bridge_time - 0.5 * elapsed;
            if let Some(start) = state.candidate.filter(goes_on)
                && (!moves || on_road(measurement))
            {
                // A completed stop ends if the host has moved the vehicle, not if it is found to roll on, or elsewhere
                // than signals that contradict one another had it.
                state.stops &= moves || !start.carried;
                self.begin(state, &told);
                return Ok(Judgement::Moved);
            }
        }
        if believed[3] {
            let off = (told[3] - track.mean[3]) / elapsed;
            let drift = state.drift + off * (elapsed / MEMORY).min(1.0);
            state.drift = drift.clamp(-LARGEST_DRIFT, LARGEST_DRIFT);
        }
        for (i, believed) in believed.into_iter().enumerate().take(Self::JUDGED) {
            if believed {
                track.observe(i, told[i], self.noise[i]);
            }
            state.age[i] = if believed { 0.0 } else { state.age[i] + elapsed };
        }
        if !track.is_sound(&self.noise) {
            // Nothing to bridge from, and nothing that rests on it is to be kept.
            measurement.check()?;
            self.begin(state, &told);
            return Ok(Judgement::Moved);
        }
        state.track = Some(track);
        if all {
            return Ok(Judgement::Believed);
        }
        state.stops |= state.lost() > self.parameters.stop_time;
        replace(measurement, &believed, &track.mean);
        Ok(Judgement::Bridged)
    }

    /// Finds out what of a measurement is old: a receiver may be slower than the other sensors, and what is old is no contradiction
    /// to what is new. `speed`: by the filter, m/s.
    fn find_stale(
        &self,
        state: &mut GuardState,
        told: &Signals,
        speed: f64,
        accel: f64,
        elapsed: f64,
    ) -> OldSignals {
        let finite = are_finite(told);
        // Brakes bring a vehicle to rest, and hold it there.
        let gained = (accel + state.drift) * elapsed;
        let speed = if accel < 0.0 { (speed.abs() + gained).max(0.0) } else { (speed + gained).abs() };
        let moves_on = speed * elapsed > MOVES;
        let same = |signals: Range<usize>| {
            state.told.is_some_and(|before| signals.into_iter().all(|i| before[i] == told[i]))
        };
        let unchanged = same(0..SIGNALS);
        let [speed, way] = state.asked;
        let speed = (speed + accel * elapsed).max(0.0);
        state.asked = if unchanged { [speed, way + speed * elapsed] } else { [0.0; 2] };
        let all = unchanged && (moves_on || state.asked[1] > SETS_OUT);
        let drives = told[3].hypot(told[4]) * elapsed > MOVES;
        let (frozen_pose, frozen_place) = (drives && same(POSE), drives && same(PLACE));
        let stale = OldSignals { all, pose: all || frozen_pose, place: all || frozen_place };
        let pose = [told[0], told[1], told[2]];
        state.dead_pose = if frozen_pose { Some(pose) } else { state.dead_pose.filter(|dead| *dead == pose) };
        state.rests = same(PLACE);
        state.told = finite.then_some(*told);
        stale
    }

    /// The signals inside their gates, and whether a new one is outside.
    fn gate(
        &self,
        state: &mut GuardState,
        track: &mut Track,
        told: &Signals,
        stale: OldSignals,
        elapsed: f64,
    ) -> ([bool; SIGNALS], bool) {
        let old: [bool; SIGNALS] = std::array::from_fn(|i| stale.has(i) || state.resting.is_dead(i, told));
        if state.agreed >= ESTABLISHED {
            let scatter = state.scatter.map(|it| it.clamp(1.0, LARGEST_SPREAD));
            let variance = self.noise.component_mul(&scatter);
            let ordinary = Ordinary { variance: &variance, yaw_accel: self.yaw_accel };
            let outside = state.age.rows_range(PLACE).max();
            state.consistency.observe(told, &old, outside, &ordinary, track, elapsed);
        }
        let mut believed = [true; SIGNALS];
        let mut contradicts = false;
        for (i, believed) in believed.iter_mut().enumerate().take(Self::JUDGED) {
            let off = difference(i, told[i], track.mean[i]);
            let units = off / (track.covariance[(i, i)] + self.noise[i]).sqrt();
            let spread = state.spread[i].clamp(1.0, LARGEST_SPREAD);
            let old = old[i] || state.consistency.is_at_fault(i);
            *believed = !old && units * units <= GATE * GATE * spread;
            contradicts |= !old && !*believed;
            let before = std::mem::replace(&mut state.missed[i], believed.then_some(units));
            if *believed {
                let newer = (elapsed / MEMORY).min(1.0);
                state.spread[i] += (units * units - state.spread[i]) * newer;
                let changed = before.map_or(state.scatter[i], |before| 0.5 * (units - before).powi(2));
                state.scatter[i] += (changed - state.scatter[i]) * newer;
            }
        }
        if are_finite(told) {
            // A value that rests shows no noise: what a rate misses then is no reason to allow it more.
            let mut variance = self.noise;
            for i in POSE {
                variance[i] *= state.spread[i].clamp(1.0, LARGEST_SPREAD);
            }
            state.resting.observe(told, !stale.place, &variance, self.yaw_accel, elapsed);
        }
        (believed, contradicts)
    }

    /// True if the vehicle is to be stopped: measurements were missing for too long.
    #[must_use]
    pub fn stops(&self, state: &GuardState) -> bool {
        self.parameters.active != 0
            && (state.stops || self.is_unsettled(state) || state.lost() > self.parameters.bridge_time)
    }

    /// True if measurements have contradicted one another for too long.
    fn is_unsettled(&self, state: &GuardState) -> bool {
        state.unsettled > self.parameters.bridge_time
    }

    /// Starts with a measurement.
    fn begin(&self, state: &mut GuardState, told: &Signals) {
        let covariance = SMatrix::from_diagonal(&self.noise);
        state.track = Some(Track { mean: *told, covariance });
        state.told = Some(*told);
        (state.agreed, state.unsettled) = (0, 0.0);
        state.age = Signals::zeros();
        state.candidate = None;
        state.missed = [None; SIGNALS];
        state.consistency = Consistency::default();
    }
}

/// Puts the filter's estimates in the place of what is not believed.
fn replace(measurement: &mut Measurement, believed: &[bool; SIGNALS], estimate: &Signals) {
    let places = [
        &mut measurement.x,
        &mut measurement.y,
        &mut measurement.yaw,
        &mut measurement.vx,
        &mut measurement.vy,
        &mut measurement.yaw_rate,
        &mut measurement.articulation,
        &mut measurement.articulation_rate,
    ];
    for (i, place) in places.into_iter().enumerate() {
        if !believed[i] {
            *place = estimate[i];
        }
    }
}

impl GuardState {
    /// The signals that are bridged, or that contradict one another where there is nothing to bridge from.
    pub(super) fn bridged(&self) -> impl Iterator<Item = &'static Signal> {
        let unsettled = self.unsettled > 0.0;
        let of = NAMED.into_iter().zip(&self.age).zip(self.contradicting);
        of.filter(move |((_, age), contradicts)| **age > 0.0 || unsettled && *contradicts)
            .map(|((signal, _), _)| signal)
    }

    /// The way to a measurement from the last one; none without a place that is new in both.
    pub(super) fn way_to(&self, measurement: &Measurement) -> Option<Way> {
        let (told, before) = (signals(measurement), self.told.filter(|_| !self.rests)?);
        let by_poses = (told[0] - before[0]).hypot(told[1] - before[1]);
        let speed = 0.5 * (told[3] + before[3]).hypot(told[4] + before[4]);
        (by_poses > MOVES && speed.is_finite()).then_some(Way { by_poses, speed })
    }

    /// True if a rate is known to be dead, or it and the yaw contradict one another.
    pub(super) fn has_lost_rate(&self) -> bool {
        self.resting.has_dead() || self.consistency.has_fault()
    }

    /// Longest time for which a signal has been implausible, s.
    fn lost(&self) -> f64 {
        self.age.max()
    }
}
