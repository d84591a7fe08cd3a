//! Rows of two recordings that alternate in one file.
//!
//! A quantity of one vehicle moves on from row to row. Of two vehicles in turn it jumps to and fro: its differences turn back at
//! once, as those of noise do and those of a slow sensor's held or interpolated values do not. And its third differences, which
//! motion hardly has, recur with the turn of `p` rows, as those of noise do not,
//!
//! ```text
//!     correlation of differences over one row < -0.3,     of third differences over p rows > 0.7
//! ```

use super::differences::Correlation;
use super::rows::LogColumns;

/// Quantities that tell two vehicles apart. A vibration that acceleration sensors feel may recur as well.
const COLUMNS: [&str; 7] = ["x", "y", "yaw", "vx", "yaw_rate", "steer", "steer_cmd"];
/// Turns that are looked for, rows.
const TURNS: std::ops::RangeInclusive<usize> = 2..=6;
/// Correlation of third differences over a turn, and of differences over one row.
const RECURS: f64 = 0.7;
const BACK: f64 = -0.3;
/// Fewest columns that say so; one is enough where stamps stand twice in this share of the rows.
const AGREE: usize = 2;
const TWICE: f64 = 0.3;
/// Fewest rows.
const FEWEST: usize = 50;

/// Columns by which the rows, in the order of their stamps, are of two recordings in turn.
pub(super) fn columns(columns: &LogColumns, rows: &[usize], stamps: &[f64]) -> Option<Vec<&'static str>> {
    let is_mixed = |name: &&'static str| {
        let Some(column) = columns.get(name) else { return false };
        let values: Vec<f64> =
            rows.iter().map(|&row| column[row]).filter(|value| value.is_finite()).collect();
        values.len() >= FEWEST && recurs(&values)
    };
    let found: Vec<&'static str> = COLUMNS.into_iter().filter(is_mixed).collect();
    let twice = rows.windows(2).filter(|pair| stamps[pair[0]] == stamps[pair[1]]).count();
    let fewest = if twice as f64 > TWICE * rows.len() as f64 { 1 } else { AGREE };
    (found.len() >= fewest).then_some(found)
}

fn recurs(values: &[f64]) -> bool {
    let Some(correlation) = Correlation::of(values, std::slice::from_ref(&(0..values.len()))) else {
        return false;
    };
    turns_back(values) && TURNS.into_iter().any(|turn| correlation.at(turn) > RECURS)
}

fn turns_back(values: &[f64]) -> bool {
    let steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let power: f64 = steps.iter().map(|step| step * step).sum();
    let product: f64 = steps.windows(2).map(|pair| pair[0] * pair[1]).sum();
    product < BACK * power
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Random;

    fn drive(seed: u64, of: fn(f64) -> f64) -> Vec<f64> {
        let mut random = Random::new(seed);
        (0..2000).map(|row| of(0.02 * f64::from(row)) + 0.02 * (random.uniform() - 0.5)).collect()
    }

    fn mixed(values: &[Vec<f64>]) -> Option<Vec<&'static str>> {
        let all = ["vx", "yaw_rate"].into_iter().zip(values.iter().cloned()).collect();
        let rows: Vec<usize> = (0..values[0].len()).collect();
        columns(&all, &rows, &rows.iter().map(|&row| row as f64).collect::<Vec<_>>())
    }

    #[test]
    fn rows_in_turn_are_found_and_one_drive_is_not() {
        let one = [drive(1, |t| 12.0 + (0.2 * t).sin()), drive(2, |t| 0.3 * (0.5 * t).sin())];
        let other = [drive(3, |t| 12.5 + (0.2 * t + 0.4).sin()), drive(4, |t| 0.3 * (0.5 * t + 0.4).sin())];
        assert_eq!(mixed(&one), None);
        let noise = [drive(5, |_| 0.0), drive(6, |_| 0.0)];
        assert_eq!(mixed(&noise), None);
        let woven = |every: usize| -> Vec<Vec<f64>> {
            let of = |(one, other): (&Vec<f64>, &Vec<f64>)| {
                let rows = one.iter().zip(other).enumerate();
                rows.flat_map(|(row, (a, b))| if row % every == 0 { vec![*a, *b] } else { vec![*a] })
                    .collect()
            };
            one.iter().zip(&other).map(of).collect()
        };
        for every in [1, 2, 3] {
            assert_eq!(mixed(&woven(every)), Some(vec!["vx", "yaw_rate"]), "{every}");
        }
        let rests: Vec<Vec<f64>> =
            one.iter().map(|column| (0..2000).map(|row| column[row / 4 * 4]).collect()).collect();
        assert_eq!(mixed(&rests), None);
        let lines = |column: &Vec<f64>| -> Vec<f64> {
            let at = |row: usize| column[row.min(1999)];
            let between = |row: usize| {
                let (from, share) = (row / 5 * 5, (row % 5) as f64 / 5.0);
                at(from) + share * (at(from + 5) - at(from))
            };
            (0..2000).map(between).collect()
        };
        let smooth =
            [(0..2000).map(|row| (0.004 * f64::from(row)).sin()).collect::<Vec<f64>>(), one[1].clone()];
        for slow in [&one, &smooth] {
            assert_eq!(mixed(&slow.iter().map(lines).collect::<Vec<_>>()), None);
        }
    }
}
