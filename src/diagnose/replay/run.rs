//! One replay.

use super::channel::{CHANNELS, Channel};
use super::drive::{LEAST_SPEED, ROAD, ReplayDrive, at, at_within};
use super::vehicle::ReplayVehicle;
use crate::diagnose::library::OwnEffect;
use crate::vehicle::{
    GRAVITY, ReducedInput, ReducedOutput, ReducedStart, ReducedSteer, Surface, TruckEffects,
};

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
    let scale = effects.vehicle.speed_scale.max(0.1);
    let twist = effects.vehicle.heading_misalignment;
    let yaw_rate_bias = effects.vehicle.yaw_rate_bias;
    let mut within = *effects;
    within.vehicle.sensor_delay = 0.0;
    // The chain holds no negative delay: what is left of it advances the command.
    let dead_time = vehicle.dead_time() + effects.vehicle.steer_delay;
    let advance = (-dead_time).max(0.0) / drive.step;
    within.vehicle.steer_delay = effects.vehicle.steer_delay.max(-vehicle.dead_time());
    within.vehicle.steer_lag = effects.vehicle.steer_lag.max(-vehicle.lag());
    let reduced = vehicle.reduced(&within)?;
    let mut model = own.into_iter().fold(reduced, |model, (effect, value)| effect.act(model, value));

    let felt = if drive.channels.contains(&Channel::Ay) { vec![0.0; rows] } else { Vec::new() };
    let mut trace =
        Trace { columns: vec![Vec::new(); CHANNELS.len()], roll: vec![0.0; rows], felt, sound: true };
    for &channel in &drive.channels {
        trace.columns[channel as usize] = vec![0.0; rows];
    }
    let log_vx = drive.column("vx");
    let road = ROAD.map(|signal| drive.column(signal.name));
    let bank = road[0];
    let (yaw, x, y) = (drive.column("yaw"), drive.column("x"), drive.column("y"));
    let h = drive.step / drive.substeps as f64;
    let by_receiver = late + correction.receiver_late;
    let shift = by_receiver / drive.step;
    let has = |channel: Channel| drive.channels.contains(&channel);
    let (leaks_vx, leaks_yaw, leaks_place) = (has(Channel::Vx), has(Channel::Yaw), has(Channel::Along));

    for &(from, to) in &drive.stretches {
        // What lies beyond a stretch may be another drive.
        let at = |column: &[f64], row: f64| at_within(column, row, (from, to));
        let speed = |row: f64, vy: f64| (at(log_vx, row + shift) / scale - twist * vy).max(0.5 * LEAST_SPEED);
        // A sensor that is turned turns its heading; one summed up has gathered the bias of its rate.
        let off =
            |row: f64| if yaw.is_empty() { yaw_rate_bias * drive.step * (row - from as f64) } else { twist };
        let heading =
            |row: f64| (!drive.heading.is_empty()).then(|| at(&drive.heading, row + shift) - off(row));
        let first = |name: &str| drive.columns.get(name).map_or(0.0, |column| column[from]);
        let f = from as f64;
        model.start(&ReducedStart {
            vx: speed(f, 0.0),
            vy: first("vy"),
            yaw_rate: first("yaw_rate"),
            yaw: heading(f).unwrap_or(0.0),
            steer: if drive.columns.contains_key("steer") { first("steer") } else { drive.steer[from] },
            accel: drive.accel[from],
            articulation: first("articulation"),
            articulation_rate: first("articulation_rate"),
        });
        let (mut lag_vx, mut lag_yaw, mut lag_place) = (0.0, 0.0, [0.0; 2]);
        let mut vy = 0.0;
        for row in from..to {
            if let Some(rows) = horizon
                && row > from
                && (row - from) % rows == 0
            {
                // What the sensors say, as the model means it.
                let logged =
                    |name: &str| drive.columns.get(name).map(|column| at(column, row as f64 + shift));
                let true_vy = logged("vy").map_or(vy, |vy| vy / scale + twist * speed(row as f64, 0.0));
                model.set_motion(true_vy, logged("yaw_rate").map_or(0.0, |rate| rate - yaw_rate_bias));
                (lag_vx, lag_yaw, lag_place) = (0.0, 0.0, [0.0; 2]);
            }
            let mut now = ReducedOutput::default();
            // Over the row, for what is summed up: rate of the speed, yaw rate, velocities.
            let mut means = [0.0; 4];
            for sub in 0..drive.substeps {
                let r = row as f64 + sub as f64 / drive.substeps as f64;
                let steer = if drive.commanded {
                    let now = if drive.holds() { row as f64 } else { r };
                    ReducedSteer::Commanded(at(&drive.steer, now + advance))
                } else {
                    ReducedSteer::Measured(at(&drive.steer, r))
                };
                let (accel, accel_is_given) = match &drive.accel_cmd {
                    Some(asked) if drive.holds() => (asked[row], false),
                    Some(asked) => (at(asked, r), false),
                    None => (drive.accel[row], true),
                };
                let vx = speed(r, vy);
                let [bank, grade, friction] = road.map(|column| column.get(row).copied());
                let surface = Surface {
                    bank: bank.unwrap_or(0.0),
                    grade: grade.unwrap_or(0.0),
                    friction: friction.unwrap_or(1.0),
                };
                let input = ReducedInput { steer, accel, accel_is_given, vx, yaw: heading(r), surface };
                let mut out = model.step(&input, h);
                if sub == 0 {
                    if !(out.true_vy.abs() < ASTRAY * vx && out.true_yaw_rate.abs() < 5.0) {
                        trace.sound = false;
                        out = ReducedOutput::default();
                        model.start(&ReducedStart { vx, steer: drive.steer[row], ..ReducedStart::default() });
                    }
                    now = out;
                    vy = out.true_vy;
                }
                let over = [out.vx_rate, out.true_yaw_rate, out.true_vy, speed(r, out.true_vy)];
                means.iter_mut().zip(over).for_each(|(mean, now)| *mean += now / drive.substeps as f64);
            }
            let [vx_rate, true_yaw_rate, true_vy, true_vx] = means;
            let fix = |channel| correction.at(channel, row);
            let mut put = |channel: Channel, value: f64| {
                if let Some(place) = trace.columns[channel as usize].get_mut(row) {
                    *place = value;
                }
            };
            put(Channel::YawRate, now.yaw_rate + fix(Channel::YawRate));
            put(Channel::Ay, now.ay + fix(Channel::Ay));
            put(Channel::Vy, now.vy + fix(Channel::Vy));
            let roll = now.roll + fix(Channel::Roll);
            put(Channel::Roll, roll);
            put(Channel::Steer, now.steer);
            put(Channel::Ax, now.ax + fix(Channel::Ax));
            put(Channel::Articulation, now.articulation + fix(Channel::Articulation));
            put(Channel::ArticulationRate, now.articulation_rate + fix(Channel::ArticulationRate));
            // Rates of what leaks, less those of the log: over one row by differences.
            let (here, next) = (row as f64 + shift, row as f64 + 1.0 + shift);
            let keep = if horizon.is_some() { 1.0 } else { (-drive.step / LEAK).exp() };
            if leaks_vx {
                put(Channel::Vx, lag_vx * scale);
                let driven = (at(log_vx, next) - at(log_vx, here)) / scale;
                lag_vx = keep * (lag_vx + drive.step * (vx_rate + fix(Channel::Ax)) - driven);
            }
            trace.roll[row] = roll;
            if let Some(felt) = trace.felt.get_mut(row) {
                let bank = bank.get(row).map_or(0.0, |bank| *bank) + effects.vehicle.road_bank;
                *felt = GRAVITY * (now.roll + bank).sin();
            }
            let yaw_rate = true_yaw_rate + fix(Channel::YawRate);
            if leaks_yaw {
                put(Channel::Yaw, lag_yaw);
                lag_yaw = keep * (lag_yaw + drive.step * yaw_rate - (at(yaw, next) - at(yaw, here)));
            }
            if leaks_place {
                put(Channel::Along, lag_place[0]);
                put(Channel::Across, lag_place[1]);
                let (dx, dy) = (at(x, next) - at(x, here), at(y, next) - at(y, here));
                let middle = 0.5 * (at(yaw, next) + at(yaw, here)) - twist;
                let (sin, cos) = middle.sin_cos();
                let moved = [cos * dx + sin * dy, cos * dy - sin * dx];
                let vy = true_vy + fix(Channel::Vy);
                let turn = drive.step * yaw_rate;
                let [a, b] = lag_place;
                lag_place = [
                    keep * (a + turn * b + drive.step * true_vx - moved[0]),
                    keep * (b - turn * a + drive.step * vy - moved[1]),
                ];
            }
        }
    }
    for channel in CHANNELS.into_iter().filter(|channel| *channel != Channel::Steer) {
        let late = if channel.by_receiver() { by_receiver } else { late };
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

/// Shifts a column by a fractional number of rows within each stretch.
fn delay(column: &mut [f64], shift: f64, stretches: &[(usize, usize)]) {
    for &(from, to) in stretches {
        let before = column[from..to].to_vec();
        for (i, value) in column[from..to].iter_mut().enumerate() {
            *value = at(&before, i as f64 - shift);
        }
    }
}
