//! Values between a sensor's samples, which a recorder has filled in.
//!
//! A recorder writes all columns at the rate of the quickest. What comes more slowly it repeats, and a program that brings a
//! log to another rate may lay straight lines between its rows. Neither is a measurement: repeated, a position of once a
//! second is up to a second late; on straight lines, fast motion is cut off.
//!
//! ```text
//!     held, every T seconds:  v[i] - v[i - 1] differs from 0 every T, 2 T, ... only
//!     straight, every k rows: v[i + 1] - 2 v[i] + v[i - 1] differs from 0 every k, 2 k, ... rows only
//! ```
//!
//! Time counts, not rows: a recorder of a bus may write a row for each message, with the last values of all others.
//!
//! What remains is the noise of the samples, which lasts from one to the next ([`Coarseness`]).
//!
//! A coarse number rests for some rows as well, but changes by one step of its resolution, and not on the beat.

use super::clean_log::Coarseness;
use super::differences::noise;
use super::finding::FindingSeverity;
use super::resample::SHORT;
use super::rows::LogRows;
use crate::numerics::statistics::{median, quantile};
use std::ops::Range;

/// Sensors. A command that is held is given so.
const SENSORS: [&str; 14] = [
    "x",
    "y",
    "yaw",
    "vx",
    "vy",
    "yaw_rate",
    "ax",
    "ay",
    "roll",
    "pitch",
    "steer",
    "articulation",
    "articulation_rate",
    "e1",
];
/// Share of changes that lie on the beat.
const ON_BEAT: f64 = 0.9;
/// Time by which a change may be early or late, as a share of a beat: one row of six.
const EARLY: f64 = 0.17;
/// Fewest changes that tell a beat.
const FEWEST: usize = 20;
/// Slowest beat in s.
const SLOWEST: f64 = 2.0;
/// A change of so many steps of a column's resolution may be its coarseness, within this share of a step.
const FEW_STEPS: f64 = 3.5;
const EVEN: f64 = 0.01;
/// Share of a column's bends that lie on the beat, if it is straight between.
const STRAIGHT: f64 = 0.98;
/// Longest straight lines that a whole log is laid on, rows.
pub(super) const LONGEST_LINE: usize = 20;
/// Usual bend on lines, over a large one.
const RARE: f64 = 0.1;

/// Lays lines between samples instead of repeated values. What comes too slowly for that, and columns of which only samples are
/// `wanted`, are left out between them.
pub(super) fn mend(log: &mut LogRows, wanted: &[&str]) {
    for name in SENSORS {
        let (time, spacing) = (&log.time, log.spacing);
        let Some(values) = log.columns.get_mut(name) else { continue };
        let Some(samples) = Samples::of(values, time, &log.spans, spacing) else { continue };
        let apart = samples.apart;
        let only_samples = wanted.contains(&name);
        let is_slow = apart > if name == "vx" { SLOWEST } else { SHORT };
        // Quick lines are what a hole would be filled with.
        if !samples.held && !is_slow {
            continue;
        }
        let words = format!(
            "{name} {} about {} rows: it comes {:.3} times a second; {}",
            if samples.held { "repeats each value for" } else { "lies on straight lines of" },
            (apart / spacing).round(),
            1.0 / apart,
            match (is_slow, only_samples) {
                (true, _) => "too slowly to be compared",
                (false, true) => "values between are left out",
                (false, false) => "values between are laid on lines",
            }
        );
        if is_slow || only_samples {
            let between: Vec<usize> = samples.pairs(time).flat_map(|(from, to)| from + 1..to).collect();
            log.leave_out(name, between);
            let gravity = if is_slow { FindingSeverity::Warning } else { FindingSeverity::Note };
            log.find(gravity, name, words);
            continue;
        }
        // A line between two samples has the errors of both: two thirds of one's variance, on average.
        let own: Vec<Vec<f64>> =
            samples.rows.iter().map(|rows| rows.iter().map(|&row| values[row]).collect()).collect();
        let noise = noise(&own.concat(), &spans_of(&own));
        for (from, to) in samples.pairs(time) {
            let slope = (values[to] - values[from]) / (time[to] - time[from]);
            (from + 1..to).for_each(|row| values[row] = values[from] + slope * (time[row] - time[from]));
        }
        let ends: Vec<usize> = samples
            .rows
            .iter()
            .zip(&log.spans)
            .flat_map(|(rows, span)| rows.last().map_or(span.end, |last| last + 1)..span.end)
            .collect();
        log.leave_out(name, ends);
        log.find(FindingSeverity::Note, name, words);
        if let Some(noise) = noise {
            log.coarse.insert(name, Coarseness { deviation: (2.0_f64 / 3.0).sqrt() * noise, lasting: apart });
        }
    }
}

/// Places of parts that follow one another.
fn spans_of(parts: &[Vec<f64>]) -> Vec<Range<usize>> {
    let ends = parts.iter().scan(0, |end, part| {
        *end += part.len();
        Some(*end)
    });
    ends.zip(parts).map(|(end, part)| end - part.len()..end).collect()
}

/// Samples in a column that is filled in between.
struct Samples {
    /// Time from one to the next, about, s.
    apart: f64,
    /// True if each is repeated up to the next; else lines are laid.
    held: bool,
    /// Their rows, in each span.
    rows: Vec<Vec<usize>>,
}

impl Samples {
    /// Samples at most [`SLOWEST`] apart; `None` if each row is one.
    fn of(values: &[f64], time: &[f64], spans: &[Range<usize>], spacing: f64) -> Option<Self> {
        let rows = |is_sample: &dyn Fn(usize, usize) -> bool| {
            let of_span =
                |span: &Range<usize>| span.clone().filter(|&row| is_sample(row, span.start)).collect();
            spans.iter().map(of_span).collect()
        };
        if let Some(apart) = beat_of_holding(values, time, spans, spacing).filter(|apart| *apart <= SLOWEST) {
            let is_new = |row: usize, start: usize| row == start || values[row] != values[row - 1];
            return Some(Self { apart, held: true, rows: rows(&is_new) });
        }
        let (beat, knot) = beat_of_lines(&[values], (SLOWEST / spacing) as usize)?;
        Some(Self { apart: spacing * beat as f64, held: false, rows: rows(&|row, _| row % beat == knot) })
    }

    /// Neighbouring samples. Of those that are farther apart the later ones have measured the same: it rested.
    fn pairs<'a>(&'a self, time: &'a [f64]) -> impl Iterator<Item = (usize, usize)> + 'a {
        let most = (1.0 + EARLY) * self.apart;
        self.rows.iter().flat_map(move |rows| {
            rows.windows(2).map(move |pair| {
                let (from, to) = (pair[0], pair[1]);
                let rested = time[from..to].partition_point(|since| time[to] - since > most);
                (from + rested.min(to - from - 1), to)
            })
        })
    }
}

/// Time from one value to the next of a column that holds each, s; `None` if it does not.
fn beat_of_holding(values: &[f64], time: &[f64], spans: &[Range<usize>], spacing: f64) -> Option<f64> {
    let (mut apart, mut sizes) = (Vec::new(), Vec::new());
    for span in spans {
        let mut last = None;
        for row in span.clone().skip(1) {
            let change = (values[row] - values[row - 1]).abs();
            if change != 0.0 && change.is_finite() {
                apart.extend(last.map(|last: usize| time[row] - time[last]));
                last = Some(row);
                sizes.push(change);
            }
        }
    }
    if apart.len() < FEWEST {
        return None;
    }
    let beat = median(apart.clone())?;
    let resolution = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    let is_even = |size: &&f64| {
        let steps = **size / resolution;
        steps < FEW_STEPS && (steps - steps.round()).abs() < EVEN
    };
    if 2 * sizes.iter().filter(is_even).count() > sizes.len() {
        return None;
    }
    let is_on = |apart: &&f64| {
        let beats = **apart / beat;
        beats > 0.5 && (beats - beats.round()).abs() <= EARLY
    };
    let on_beat = apart.iter().filter(is_on).count();
    (beat > 1.5 * spacing && on_beat as f64 >= ON_BEAT * apart.len() as f64).then_some(beat)
}

/// Rows from sample to sample, and the first one, of a log whose rows between repeat them, in all `columns` alike.
pub(super) fn beat_of_repeats(columns: &[&[f64]]) -> Option<(usize, usize)> {
    let mut found = None;
    for values in columns {
        let rows: Vec<f64> = (0..values.len()).map(|row| row as f64).collect();
        let beat =
            beat_of_holding(values, &rows, std::slice::from_ref(&(0..values.len())), 1.0)?.round() as usize;
        let mut changes = vec![0_usize; beat];
        (1..values.len())
            .filter(|&row| values[row] != values[row - 1])
            .for_each(|row| changes[row % beat] += 1);
        let knot = (0..beat).max_by_key(|&place| changes[place])?;
        if *found.get_or_insert((beat, knot)) != (beat, knot) {
            return None;
        }
    }
    found
}

/// Bend at each row but the first and the last.
fn bends(values: &[f64]) -> Vec<f64> {
    values.windows(3).map(|v| v[0] - 2.0 * v[1] + v[2]).collect()
}

/// True if bends are rare, as they are on lines. Nearly all columns are none, and are told apart by that.
fn is_mostly_straight(values: &[f64]) -> bool {
    let bends: Vec<f64> = bends(values).into_iter().map(f64::abs).collect();
    match (quantile(bends.clone(), 0.4), quantile(bends, 0.99)) {
        (Some(usual), Some(large)) => usual <= RARE * large,
        _ => false,
    }
}

/// Rows from knot to knot, at most `longest`, and the first knot, of a log whose rows between lie on straight lines, in all `columns` alike.
pub(super) fn beat_of_lines(columns: &[&[f64]], longest: usize) -> Option<(usize, usize)> {
    if !columns.iter().all(|values| is_mostly_straight(values)) {
        return None;
    }
    let bends: Vec<Vec<f64>> = columns.iter().map(|values| bends(values)).collect();
    let shares = |beat: usize| -> Option<(f64, usize)> {
        let (mut least, mut knot) = (f64::INFINITY, None);
        for bends in &bends {
            let mut energy = vec![0.0; beat];
            for (i, bend) in bends.iter().enumerate() {
                energy[(i + 1) % beat] += if bend.is_finite() { bend * bend } else { 0.0 };
            }
            let whole: f64 = energy.iter().sum();
            // One that rests tells nothing.
            if whole == 0.0 {
                continue;
            }
            let place = (0..beat).max_by(|a, b| energy[*a].total_cmp(&energy[*b]))?;
            if *knot.get_or_insert(place) != place {
                return None;
            }
            least = least.min(energy[place] / whole);
        }
        knot.filter(|_| least.is_finite()).map(|knot| (least, knot))
    };
    // The longest: on a beat of three all bends of one of six lie as well.
    let (beat, knot) = (2..=longest).rev().find_map(|beat| {
        shares(beat).filter(|(share, _)| *share >= STRAIGHT).map(|(_, knot)| (beat, knot))
    })?;
    let spread_out = |bends: &Vec<f64>| {
        // Bends that only a few rows have are those of a drive with a few manoeuvres, not of a beat.
        let on_beat = bends.iter().enumerate().filter(|(i, _)| (i + 1) % beat == knot);
        let bends: Vec<f64> = on_beat.map(|(_, bend)| bend.abs()).collect();
        let whole: f64 = bends.iter().map(|bend| bend * bend).sum();
        quantile(bends.clone(), 0.9).is_some_and(|large| large * large * bends.len() as f64 > 0.05 * whole)
    };
    bends.iter().any(spread_out).then_some((beat, knot))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(count: usize) -> Vec<f64> {
        (0..count).map(|i| (0.013 * i as f64).sin() + 0.3 * (0.031 * i as f64).sin()).collect()
    }

    fn held(values: &[f64], beat: f64) -> Vec<f64> {
        (0..values.len()).map(|i| values[((i as f64 / beat).floor() * beat).ceil() as usize]).collect()
    }

    fn beat_of(values: &[f64]) -> Option<usize> {
        let rows: Vec<f64> = (0..values.len()).map(|row| row as f64).collect();
        beat_of_holding(values, &rows, std::slice::from_ref(&(0..values.len())), 1.0)
            .map(|beat| beat.round() as usize)
    }

    #[test]
    fn a_slow_sensor_is_told_from_a_coarse_one() {
        let fine = wave(4000);
        assert_eq!(beat_of(&fine), None);
        for beat in [2.0, 5.0, 100.0] {
            assert_eq!(beat_of(&held(&fine, beat)), Some(beat as usize));
        }
        // 15 of 100 a second.
        assert!(matches!(beat_of(&held(&fine, 6.667)), Some(6 | 7)));
        for resolution in [0.01, 0.05, 0.2] {
            let coarse: Vec<f64> =
                fine.iter().map(|value| (value / resolution).round() * resolution).collect();
            assert_eq!(beat_of(&coarse), None, "{resolution}");
        }
        // A place on a straight.
        let way: Vec<f64> = (0..4000).map(|i| 0.3 * f64::from(i) + fine[i as usize]).collect();
        assert_eq!(beat_of(&held(&way, 2.0)), Some(2));
        assert_eq!(beat_of_repeats(&[&held(&fine, 5.0)[3..], &held(&way, 5.0)[3..]]), Some((5, 2)));
        assert_eq!(beat_of_repeats(&[&held(&fine, 5.0), &way]), None);
        // A quantity that grows evenly, coarse, changes on a beat, by one step.
        let ramp: Vec<f64> = (0..4000).map(|i| f64::from(i / 10) * 0.01).collect();
        assert_eq!(beat_of(&ramp), None);
        assert_eq!(beat_of(&[1.0; 100]), None);
    }

    #[test]
    fn what_rests_is_not_laid_on_a_long_line() {
        let mut resting = held(&wave(1000), 5.0);
        let value = resting[300];
        resting[300..500].fill(value);
        let time: Vec<f64> = (0..1000).map(|row| 0.02 * f64::from(row)).collect();
        let samples = Samples::of(&resting, &time, std::slice::from_ref(&(0..1000)), 0.02).unwrap();
        assert!(samples.held && samples.pairs(&time).all(|(from, to)| to - from == 5));
        assert!(samples.pairs(&time).any(|pair| pair == (495, 500)));
    }

    #[test]
    fn a_row_for_each_message_is_no_sample_of_each_column() {
        // Two messages of 20 and 100 ms and a third of random times, each a row with the last values of all.
        let fine = wave(4000);
        let mut random = crate::numerics::Random::new(4);
        let mut events: Vec<f64> = (0..2000).map(|i| 0.02 * f64::from(i)).collect();
        events.extend((0..400).map(|i| 0.1 * f64::from(i) + 0.003));
        events.extend((0..3000).map(|_| 40.0 * random.uniform()));
        events.sort_by(f64::total_cmp);
        let quick: Vec<f64> = events.iter().map(|time| fine[(50.0 * time + 1e-6) as usize]).collect();
        let spacing = median(events.windows(2).map(|pair| pair[1] - pair[0]).collect()).unwrap();
        let whole = std::iter::once(0..events.len()).collect::<Vec<_>>();
        let samples = Samples::of(&quick, &events, &whole, spacing).unwrap();
        assert!(samples.held && (samples.apart - 0.02).abs() < 1e-9, "{}", samples.apart);
        assert!(samples.pairs(&events).all(|(from, to)| (events[to] - events[from] - 0.02).abs() < 1e-9));
    }

    #[test]
    fn straight_lines_between_samples_are_found() {
        let fine = wave(4000);
        let other: Vec<f64> = fine.iter().rev().map(|value| 3.0 * value).collect();
        let rounded = |values: &[f64]| values.iter().map(|v| (v * 1e6).round() / 1e6).collect::<Vec<_>>();
        let lines = |values: &[f64], beat: usize| -> Vec<f64> {
            let at = |i: usize| values[i.min(values.len() - 1)];
            let between = |i: usize| {
                let (from, share) = (i / beat * beat, (i % beat) as f64 / beat as f64);
                at(from) + share * (at(from + beat) - at(from))
            };
            rounded(&(0..values.len()).map(between).collect::<Vec<_>>())
        };
        for beat in [2, 5, 10] {
            assert_eq!(beat_of_lines(&[&lines(&fine, beat), &lines(&other, beat)], 20), Some((beat, 0)));
            // A column with rows of its own says that the rows are measured.
            assert_eq!(beat_of_lines(&[&lines(&fine, beat), &other], 20), None);
        }
        assert_eq!(beat_of_lines(&[&rounded(&fine), &rounded(&other)], 20), None);
        let shifted = &lines(&fine, 10)[3..];
        assert_eq!(beat_of_lines(&[shifted], 20), Some((10, 7)));
        assert_eq!(beat_of_lines(&[&[1.0; 100]], 20), None);
    }
}
