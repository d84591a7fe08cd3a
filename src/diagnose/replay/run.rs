//! One replay.

use super::channel::{CHANNELS, Channel};
use super::drive::ReplayDrive;
use super::sensors::{Sensors, delay};
use super::vehicle::ReplayVehicle;
use crate::diagnose::library::OwnEffect;
use crate::vehicle::{GRAVITY, ReducedOutput, ReducedStart, ReducedVehicle, TruckEffects};

/// Time over which heading, place and speed leak to the log's, s.
pub const LEAK: f64 = 2.0;
/// Limit of a diverged replay: sideways velocity over speed; and the value that then replaces it.
const ASTRAY: f64 = 1.5;

/// Columns of a replay, by channel; those that leak hold the model's less the log's. Rows outside stretches are 0.
#[derive(Debug, Clone)]
pub struct Trace {
    /// One for each of [`CHANNELS`], empty where it is not compared.
    pub columns: Vec<Vec<f64>>,
    /// Roll angle of every row, rad, whether it is compared or not.
    pub roll: Vec<f64>,
    /// Sideways gravity in an accelerometer fixed to the body, which a level frame does not have, m/s2; empty where
    /// `ay` is not compared.
    pub felt: Vec<f64>,
    /// True if the replay stayed within the model's range.
    pub sound: bool,
}

impl Trace {
    /// Of nothing yet.
    fn empty(drive: &ReplayDrive, rows: usize) -> Self {
        let felt = if drive.channels.contains(&Channel::Ay) { vec![0.0; rows] } else { Vec::new() };
        let mut columns = vec![Vec::new(); CHANNELS.len()];
        for &channel in &drive.channels {
            columns[channel as usize] = vec![0.0; rows];
        }
        Self { columns, roll: vec![0.0; rows], felt, sound: true }
    }

    /// The column of a channel.
    #[must_use]
    pub fn column(&self, channel: Channel) -> &[f64] {
        &self.columns[channel as usize]
    }
}

/// Correction of a replay: full plant less reduced model, and the clock of the receiver's columns.
#[derive(Debug, Clone, Default)]
pub struct Correction {
    /// One for each of [`CHANNELS`], empty where there is none.
    pub columns: Vec<Vec<f64>>,
    /// Lateness of the columns of a satellite receiver relative to all others, s.
    pub receiver_late: f64,
}

impl Correction {
    fn at(&self, channel: Channel, row: usize) -> f64 {
        self.columns.get(channel as usize).and_then(|column| column.get(row)).copied().unwrap_or(0.0)
    }
}

/// Drives a vehicle with effects along a log. With a `horizon` in rows the motion starts anew from the log that often, and
/// nothing leaks in between. `effects` need not be in range: a negative delay advances the log's command.
///
/// # Errors
/// A vehicle that cannot be made with these effects (its CG outside the wheelbase).
pub fn replay<V: ReplayVehicle>(
    drive: &ReplayDrive,
    vehicle: &V,
    effects: &TruckEffects,
    correction: &Correction,
    horizon: Option<usize>,
) -> Result<Trace, String> {
    replay_with(drive, vehicle, effects, [], correction, horizon)
}

/// The same with effects of one's own, at their values.
///
/// # Errors
/// As [`replay`].
pub fn replay_with<'a, V: ReplayVehicle>(
    drive: &ReplayDrive,
    vehicle: &V,
    effects: &TruckEffects,
    own: impl IntoIterator<Item = (&'a dyn OwnEffect, f64)>,
    correction: &Correction,
    horizon: Option<usize>,
) -> Result<Trace, String> {
    let rows = drive.time.len();
    // A vehicle file may hold effects that are known already.
    let effects = &effects.on_top_of(&vehicle.known_effects());
    let late = effects.vehicle.sensor_delay;
    let mut within = *effects;
    within.vehicle.sensor_delay = 0.0;
    // The chain holds no negative delay: what is left of it advances the command.
    let dead_time = vehicle.dead_time() + effects.vehicle.steer_delay;
    within.vehicle.steer_delay = effects.vehicle.steer_delay.max(-vehicle.dead_time());
    within.vehicle.steer_lag = effects.vehicle.steer_lag.max(-vehicle.lag());
    let reduced = vehicle.reduced(&within)?;
    let mut model = own.into_iter().fold(reduced, |model, (effect, value)| effect.act(model, value));

    let sensors = Sensors::new(drive, effects, correction.receiver_late, (-dead_time).max(0.0));
    let mut trace = Trace::empty(drive, rows);
    let leaks = [Channel::Vx, Channel::Yaw, Channel::Along].map(|channel| drive.channels.contains(&channel));
    for &stretch in &drive.stretches {
        let sensors = sensors.within(stretch);
        Run { drive, sensors, correction, horizon, leaks, trace: &mut trace }.through(stretch, &mut *model);
    }
    for channel in CHANNELS.into_iter().filter(|channel| *channel != Channel::Steer) {
        let late = if channel.by_receiver() { late + correction.receiver_late } else { late };
        let column = &mut trace.columns[channel as usize];
        if late != 0.0 && !column.is_empty() {
            delay(column, late / drive.step, &drive.stretches);
        }
    }
    if late != 0.0 && !trace.felt.is_empty() {
        delay(&mut trace.felt, late / drive.step, &drive.stretches);
    }
    Ok(trace)
}

/// One stretch on its way into the trace.
struct Run<'a> {
    drive: &'a ReplayDrive,
    sensors: Sensors<'a>,
    correction: &'a Correction,
    horizon: Option<usize>,
    /// True for speed, heading and place if they are compared.
    leaks: [bool; 3],
    trace: &'a mut Trace,
}

/// What leaks: the model's less the log's speed, heading and place along and across.
#[derive(Default)]
struct Leaking {
    vx: f64,
    yaw: f64,
    place: [f64; 2],
}

/// Means over a row, for what is summed up.
#[derive(Default)]
struct Means {
    vx_rate: f64,
    yaw_rate: f64,
    vy: f64,
    vx: f64,
}

impl Run<'_> {
    fn through(&mut self, stretch: (usize, usize), model: &mut dyn ReducedVehicle) {
        let (from, to) = stretch;
        model.start(&self.sensors.start());
        let mut leaking = Leaking::default();
        let mut vy = 0.0;
        for row in from..to {
            if let Some(rows) = self.horizon
                && row > from
                && (row - from) % rows == 0
            {
                let (true_vy, yaw_rate) = self.sensors.motion(row, vy);
                model.set_motion(true_vy, yaw_rate);
                leaking = Leaking::default();
            }
            let (now, means) = self.step(row, &mut vy, model);
            self.put(row, &now);
            self.leak(row, &means, &mut leaking);
        }
    }

    /// The motion in a row, and its means until the next.
    fn step(&mut self, row: usize, vy: &mut f64, model: &mut dyn ReducedVehicle) -> (ReducedOutput, Means) {
        let drive = self.drive;
        let parts = drive.substeps as f64;
        let h = drive.step / parts;
        let mut now = ReducedOutput::default();
        let mut means = Means::default();
        for sub in 0..drive.substeps {
            let share = sub as f64 / parts;
            let input = self.sensors.input(row, share, *vy);
            let mut out = model.step(&input, h);
            if sub == 0 {
                if !(out.true_vy.abs() < ASTRAY * input.vx && out.true_yaw_rate.abs() < 5.0) {
                    self.trace.sound = false;
                    out = ReducedOutput::default();
                    let steer = drive.steer[row];
                    model.start(&ReducedStart { vx: input.vx, steer, ..ReducedStart::default() });
                }
                now = out;
                *vy = out.true_vy;
            }
            means.vx_rate += out.vx_rate / parts;
            means.yaw_rate += out.true_yaw_rate / parts;
            means.vy += out.true_vy / parts;
            means.vx += self.sensors.speed(row as f64 + share, out.true_vy) / parts;
        }
        (now, means)
    }

    fn fix(&self, channel: Channel, row: usize) -> f64 {
        self.correction.at(channel, row)
    }

    fn write(&mut self, channel: Channel, row: usize, value: f64) {
        if let Some(place) = self.trace.columns[channel as usize].get_mut(row) {
            *place = value;
        }
    }

    /// What is compared as it is, with the full plant's correction.
    fn put(&mut self, row: usize, now: &ReducedOutput) {
        let roll = now.roll + self.fix(Channel::Roll, row);
        for (channel, value) in [
            (Channel::YawRate, now.yaw_rate),
            (Channel::Ay, now.ay),
            (Channel::Vy, now.vy),
            (Channel::Ax, now.ax),
            (Channel::Articulation, now.articulation),
            (Channel::ArticulationRate, now.articulation_rate),
        ] {
            self.write(channel, row, value + self.fix(channel, row));
        }
        self.write(Channel::Roll, row, roll);
        self.write(Channel::Steer, row, now.steer);
        self.trace.roll[row] = roll;
        if let Some(felt) = self.trace.felt.get_mut(row) {
            *felt = GRAVITY * (now.roll + self.sensors.bank(row)).sin();
        }
    }

    /// What leaks: its rates, less those of the log by differences over one row.
    fn leak(&mut self, row: usize, means: &Means, leaking: &mut Leaking) {
        let step = self.drive.step;
        let keep = if self.horizon.is_some() { 1.0 } else { (-step / LEAK).exp() };
        let [vx, yaw, place] = self.leaks;
        if vx {
            self.write(Channel::Vx, row, leaking.vx * self.sensors.scale);
            let gained = step * (means.vx_rate + self.fix(Channel::Ax, row));
            leaking.vx = keep * (leaking.vx + gained - self.sensors.speed_gained(row));
        }
        let yaw_rate = means.yaw_rate + self.fix(Channel::YawRate, row);
        if yaw {
            self.write(Channel::Yaw, row, leaking.yaw);
            leaking.yaw = keep * (leaking.yaw + step * yaw_rate - self.sensors.turned(row));
        }
        if place {
            let [a, b] = leaking.place;
            self.write(Channel::Along, row, a);
            self.write(Channel::Across, row, b);
            let [along, across] = self.sensors.moved(row);
            let vy = means.vy + self.fix(Channel::Vy, row);
            let turn = step * yaw_rate;
            leaking.place =
                [keep * (a + turn * b + step * means.vx - along), keep * (b - turn * a + step * vy - across)];
        }
    }
}
