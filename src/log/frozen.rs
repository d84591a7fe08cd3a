//! Stretches in which a sensor repeats its last value.
//!
//! A signal of a moving vehicle may rest for a while; when it moves again, it begins as it always moves. A frozen one jumps to
//! where the vehicle has gone meanwhile:
//!
//! ```text
//!     v[i] = v[i - 1] for 0.1 s and longer,   then |v[end] - v[end - 1]| > 6 x the 99th percentile of |v[i] - v[i - 1]|
//! ```
//!
//! One with white noise of its own never rests: where it repeats itself for longer than chance allows it is frozen, with a jump or
//! without.
//!
//! Without noise and without a jump, the others tell: a sensor that rests while its [partners](super::partners) say by how much it must
//! have changed is frozen, be it to the end of the log. One that rests because the vehicle drives straight at one speed is not.
//!
//! A sensor that is held from sample to sample, each a tenth of a second or a second, jumps always: it is none. Nor is one of
//! a vehicle that stands, or one that has not moved before.
//!
//! A command may rest and jump in earnest: [the wheels answer](super::answered) then.

use super::answered::followed;
use super::clean_log::STANDING;
use super::differences::own_noise;
use super::finding::FindingSeverity;
use super::partners::{self, Partner};
use super::rows::{LogRows, repeats};
use crate::numerics::statistics::{median, quantile};
use std::ops::Range;

/// Sensors, and quantities in which a jump at the end can be told: an angle wraps.
const SENSORS: [&str; 9] = ["x", "y", "vx", "vy", "yaw_rate", "ax", "ay", "steer", "steer_cmd"];
/// Shortest stretch, s.
const SHORTEST: f64 = 0.1;
/// Share of rows in which a noisy sensor repeats the last number.
const RESTS: f64 = 0.3;
/// Jump at its end, over the 99th percentile of steps.
const JUMP: f64 = 6.0;

/// Leaves out frozen stretches of all sensors.
pub(super) fn leave_out(log: &mut LogRows) {
    leave_out_of(log, &SENSORS);
    let Some(vx) = log.columns.get("vx").cloned() else { return };
    let shortest = log.lasting(SHORTEST, 3);
    leave_out_still(log, shortest, &|stretch| is_moving(&vx, stretch));
}

/// The same of the speed alone: from a value in the place of none, every unit would be told wrongly.
pub(super) fn leave_out_speeds(log: &mut LogRows) {
    leave_out_of(log, &["vx"]);
}

fn is_moving(vx: &[f64], stretch: &Range<usize>) -> bool {
    median(vx[stretch.clone()].iter().map(|vx| vx.abs()).collect()).is_some_and(|vx| vx > STANDING)
}

fn leave_out_of(log: &mut LogRows, names: &[&'static str]) {
    let shortest = log.lasting(SHORTEST, 3);
    let Some(vx) = log.columns.get("vx").cloned() else { return };
    let moves = |stretch: &Range<usize>| is_moving(&vx, stretch);
    for &name in names {
        let Some(values) = log.columns.get(name) else { continue };
        let may_jump = name.starts_with("steer");
        let of_span = |span: &Range<usize>| frozen(&values[span.clone()], shortest, span.start, may_jump);
        let mut found: Vec<Range<usize>> = log.spans.iter().flat_map(of_span).filter(moves).collect();
        if name == "steer_cmd" {
            let mut followed = followed(log, &found).into_iter();
            found.retain(|_| followed.next() != Some(true));
        }
        let found: Vec<(f64, Range<usize>)> =
            found.into_iter().map(|stretch| (values[stretch.start], stretch)).collect();
        for (value, stretch) in found {
            let ends = log.spans.iter().any(|span| span.end == stretch.end);
            let (stays, then) = if ends { ("jumps and stays", "") } else { ("stays", " and jumps then") };
            leave_out_stretch(log, name, value, stretch, [stays, then]);
        }
    }
}

/// Leaves out a frozen stretch; in words, it `stays` at its value, and what else it does.
fn leave_out_stretch(
    log: &mut LogRows,
    name: &'static str,
    value: f64,
    stretch: Range<usize>,
    [stays, more]: [&str; 2],
) {
    let words = format!(
        "{name} {stays} at {value:.4} from row {} to row {}{more}: frozen; left out, like missing values",
        log.number(stretch.start),
        log.number(stretch.end - 1)
    );
    log.find(FindingSeverity::Warning, name, words);
    log.leave_out(name, stretch);
}

/// Sensors whose partners tell of their changes.
const TOLD: [&str; 10] = ["x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "roll", "steer"];

/// Leaves out stretches in which a sensor rests while its partners tell that it must have moved.
pub(super) fn leave_out_contradicted(log: &mut LogRows) {
    let shortest = log.lasting(partners::SHORTEST, 3);
    for name in TOLD {
        let Some((values, vx)) = log.columns.get(name).zip(log.columns.get("vx")) else { continue };
        let rests_of = |span: &Range<usize>| {
            let rests = repeats(values, span.clone(), shortest).into_iter();
            rests.map(|rest| RestingRows { rows: rest, span: span.clone() }).collect::<Vec<_>>()
        };
        let rests: Vec<RestingRows> = log.spans.iter().flat_map(rests_of).collect();
        let lasts = |rest: &RestingRows| log.time[rest.rows.end - 1] - log.time[rest.rows.start];
        let Some(longest) = rests.iter().map(lasts).reduce(f64::max) else { continue };
        let mut counts: Vec<bool> = vx.iter().map(|vx| vx.abs() > STANDING).collect();
        rests.iter().for_each(|rest| counts[rest.rows.clone()].fill(false));
        let partners = Partner::all(log, name, &counts, longest);
        let step = step_of(values);
        let moves = |rest: &RestingRows| values[rest.rows.start].is_finite() && is_moving(vx, &rest.rows);
        let mut found = Vec::new();
        for rest in rests.iter().filter(|rest| moves(rest)) {
            let awake = |partner: &&Partner| {
                let column = &log.columns[partner.name][rest.rows.clone()];
                partner.name.ends_with("_cmd") || column.iter().any(|value| *value != column[0])
            };
            let partners: Vec<&Partner> = partners.iter().filter(awake).collect();
            if let Some(partner) = rest.contradicted(values, &log.time, step, &partners) {
                // The first of them was measured.
                let from = rest.rows.start + usize::from(rest.rows.start > rest.span.start);
                found.push((values[from], from..rest.rows.end, partner));
            }
        }
        for (value, stretch, partner) in found {
            let though = format!(", though {partner} tells that it changes");
            leave_out_stretch(log, name, value, stretch, ["stays", &though]);
        }
    }
}

/// A stretch in which a sensor rests.
struct RestingRows {
    rows: Range<usize>,
    /// The drive.
    span: Range<usize>,
}

impl RestingRows {
    /// The partner that contradicts, whom no other does: it says a change from the last value before, and to the first one after. A
    /// change of up to a `step` of the sensor's numbers is none.
    fn contradicted(
        &self,
        values: &[f64],
        time: &[f64],
        step: f64,
        partners: &[&Partner],
    ) -> Option<&'static str> {
        let Range { start, end } = self.rows;
        let measured: Vec<usize> =
            [start, end].into_iter().filter(|row| *row > self.span.start && *row < self.span.end).collect();
        // The sensor's value less what a partner tells from a measured row on, and the bound of its error.
        let off = |partner: &Partner, from: usize, to: usize| -> Option<(f64, f64)> {
            let (told, bound) = partner.change(from, to, (time[to] - time[from]).abs())?;
            let off = values[to] - values[from] - told;
            off.is_finite().then_some((off, bound + step))
        };
        let beyond = |(off, bound): (f64, f64)| off.abs() - bound;
        let least = |partner: &Partner, row: usize| {
            let each = measured.iter().filter_map(|&from| off(partner, from, row));
            each.min_by(|a, b| beyond(*a).total_cmp(&beyond(*b)))
        };
        let confirmed = |partner: &Partner| match measured[..] {
            [from, to] => off(partner, from, to).is_some_and(|it| beyond(it) <= 0.0),
            _ => !partner.feels_gravity(),
        };
        partners.iter().filter(|partner| confirmed(partner)).find_map(|partner| {
            let rows = self.rows.clone().filter_map(|row| Some((row, least(partner, row)?)));
            let (row, worst) = rows.max_by(|a, b| beyond(a.1).total_cmp(&beyond(b.1)))?;
            let agrees = |other: &&Partner| {
                least(other, row).is_none_or(|it| (it.0 - worst.0).abs() <= it.1 + worst.1)
            };
            (beyond(worst) > 0.0 && partners.iter().all(agrees)).then_some(partner.name)
        })
    }
}

/// Sensors of a moving vehicle that are noisy if any are.
const NOISY: [&str; 8] = ["x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay"];
/// Chance of a repetition so long, in a row.
const CHANCE: f64 = 1e-9;

/// Stretches in which a noisy column repeats itself.
fn still(values: &[f64], span: &Range<usize>, shortest: usize) -> Vec<Range<usize>> {
    let pairs = values[span.clone()].windows(2);
    let (count, same) = pairs.fold((0.0, 0.0), |(count, same), pair| {
        (count + 1.0, same + f64::from(u8::from(pair[0] == pair[1])))
    });
    let share = f64::max(same / f64::max(count, 1.0), 1e-3);
    // More is a number in steps, or a slow sensor.
    if share > RESTS {
        return Vec::new();
    }
    let shortest = shortest.max((CHANCE.ln() / share.ln()).ceil() as usize);
    let found = repeats(values, span.clone(), shortest).into_iter();
    // The first of them was measured.
    found
        .filter(|stretch| values[stretch.start].is_finite())
        .map(|stretch| stretch.start + 1..stretch.end)
        .collect()
}

/// Least difference between two values in a row.
fn step_of(values: &[f64]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0);
    steps.fold(f64::INFINITY, f64::min)
}

/// Leaves out stretches in which noisy sensors repeat themselves.
fn leave_out_still(log: &mut LogRows, shortest: usize, moves: &dyn Fn(&Range<usize>) -> bool) {
    for name in NOISY {
        let Some(values) = log.columns.get(name) else { continue };
        // Where the numbers' steps are larger than the noise, a quantity that hardly moves repeats itself.
        if own_noise(values, &log.spans).is_none_or(|noise| noise < step_of(values)) {
            continue;
        }
        let of_span = |span: &Range<usize>| still(values, span, shortest);
        let found: Vec<Range<usize>> = log.spans.iter().flat_map(of_span).filter(moves).collect();
        for stretch in found {
            let words = format!(
                "{name} stays at {:.4} from row {} to row {}, though it has noise elsewhere: frozen; left out, like missing values",
                log.columns[name][stretch.start],
                log.number(stretch.start),
                log.number(stretch.end - 1)
            );
            log.find(FindingSeverity::Warning, name, words);
            log.leave_out(name, stretch);
        }
    }
}

/// Frozen stretches of a column; `from` is the place of its first value. The value that stays was measured, if the column does not
/// jump to it as well. A column that may jump may also begin or end at rest.
fn frozen(values: &[f64], shortest: usize, from: usize, may_jump: bool) -> Vec<Range<usize>> {
    let steps: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let moving = steps.iter().copied().filter(|step| *step > 0.0).collect();
    let Some(usual) = quantile(moving, 0.99) else { return Vec::new() };
    let within = |stretch: &Range<usize>| !may_jump || stretch.start > 0 && stretch.end < values.len();
    let jumps = |row: usize| steps[row - 1] > JUMP * usual;
    let is_measured = |row: usize| row > 0 && !jumps(row);
    let is_frozen = |stretch: &Range<usize>| match stretch.end < values.len() {
        true => jumps(stretch.end),
        false => stretch.start > 0 && jumps(stretch.start),
    };
    repeats(values, 0..values.len(), shortest)
        .into_iter()
        .filter(|stretch| within(stretch) && is_frozen(stretch))
        .map(|stretch| from + stretch.start + usize::from(is_measured(stretch.start))..from + stretch.end)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(count: usize) -> Vec<f64> {
        (0..count).map(|i| (0.02 * i as f64).sin()).collect()
    }

    #[test]
    fn a_value_that_is_held_and_jumps_is_found() {
        let mut values = wave(1000);
        let held = values[300];
        values[300..340].fill(held);
        assert_eq!(frozen(&values, 20, 7, false), std::iter::once(308..347).collect::<Vec<_>>());
        values[300..340].fill(9.0);
        assert_eq!(frozen(&values, 20, 7, false), std::iter::once(307..347).collect::<Vec<_>>());
    }

    #[test]
    fn a_value_in_place_of_none_at_an_end_is_found_where_nothing_jumps() {
        let mut values = wave(1000);
        values[..40].fill(9.0);
        values[960..].fill(9.0);
        assert_eq!(frozen(&values, 20, 0, false), [0..40, 960..1000]);
        assert!(frozen(&values, 20, 0, true).is_empty());
    }

    #[test]
    fn a_noisy_sensor_that_repeats_itself_is_found_without_a_jump() {
        let mut random = crate::numerics::Random::new(2);
        let whole = 0..1000;
        for digits in [1e9, 1e3] {
            let mut values: Vec<f64> = wave(1000)
                .into_iter()
                .map(|value| (digits * (value + 2e-3 * (random.uniform() - 0.5))).round() / digits)
                .collect();
            assert!(still(&values, &whole, 5).is_empty());
            let held = values[300];
            values[300..340].fill(held);
            values[700..703].fill(0.0);
            assert_eq!(still(&values, &whole, 5), std::iter::once(301..340).collect::<Vec<_>>());
        }
        let coarse: Vec<f64> = wave(1000).iter().map(|value| (20.0 * value).round() / 20.0).collect();
        assert!(still(&coarse, &whole, 5).is_empty());
    }

    #[test]
    fn rest_short_repeats_and_slow_sensors_are_no_fault() {
        let mut values = wave(1000);
        let held = values[300];
        values[300..310].fill(held);
        assert!(frozen(&values, 20, 0, false).is_empty());
        // A pause without a jump.
        let pause: Vec<f64> = (0..1000).map(|i| (0.02 * (i as f64 - 300.0).max(0.0)).sin()).collect();
        assert!(frozen(&pause, 20, 0, false).is_empty());
        let held: Vec<f64> = (0..1000).map(|i| (0.02 * f64::from(i / 50 * 50)).sin()).collect();
        assert!(frozen(&held, 20, 0, false).is_empty());
        assert!(frozen(&[1.0; 100], 20, 0, false).is_empty());
    }
}
