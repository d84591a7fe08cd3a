//! Least squares over a dead time and a lag; all other parameters are linear and known for each pair.
//!
//! ```text
//! S(T, tau) = min over beta, a   sum_k (y_k - phi_k(T, tau)' beta - a_p exp(-(t_k - t_p)/tau))^2
//! ```
//!
//! `a_p` is the contribution of the actuator's unknown state at the beginning of a piece `p`. It is eliminated piece by
//! piece, so that a drive may begin in a bend and be broken off anywhere. The search is a grid, then golden sections,
//! one within the other: a valley along `T + tau = const` does no harm. At a lag of nearly nothing the squares have
//! steps, which derivatives do not survive.
//!
//! Source: Golub and Pereyra, Separable nonlinear least squares, Inverse Problems 2003.

use super::record::golden_section;
use super::response::{Answer, Response};
use super::rows::{DriveRows, ranges};
use nalgebra::{SMatrix, SVector};

/// Most columns.
const COLUMNS: usize = 5;
/// Longest dead time that is looked for, s.
pub(super) const LONGEST_DEAD_TIME: f64 = 1.0;
/// Longest lag that is looked for, s.
pub(super) const LONGEST_LAG: f64 = 2.0;
/// Step of the grid's dead times, s.
pub(super) const GRID: f64 = 0.02;
/// Shortest lag of the grid beside none, s, and the ratio of its neighbours.
const SHORT_LAG: f64 = 5e-3;
const GRID_RATIO: f64 = 1.6;
/// Rows that are enough for the grid, and rows of a block of them.
const GRID_ROWS: usize = 6000;
const BLOCK: usize = 500;
/// Windows that follow a valley.
const ON: usize = 12;
/// Rows that are enough for a rough answer, and steps of its grid.
const PART_ROWS: usize = 2000;
pub(super) const ROUGH: u32 = 14;
/// Remainder at which a free response is over.
const OVER: f64 = 1e-7;
/// Lags that are tried before golden sections.
const TRIED: u32 = 8;
/// A residual's standard deviation below this is rounding, rad or rad/s.
pub(super) const LEAST_NOISE: f64 = 1e-6;

/// A dead time, a lag and the linear parameters that belong to them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    pub dead_time: f64,
    pub lag: f64,
    /// Sum of squares.
    pub cost: f64,
    /// Factors of the columns.
    pub beta: [f64; COLUMNS],
}

/// A problem with workspace.
#[derive(Debug, Clone)]
pub(super) struct ActuatorProblem {
    pub rows: DriveRows,
    pub response: Response,
    answer: Answer,
    /// A residual that is asked for.
    pub residual: Vec<f64>,
}

/// Normal equations.
#[derive(Clone, Copy)]
struct Normal {
    xx: SMatrix<f64, COLUMNS, COLUMNS>,
    xy: SVector<f64, COLUMNS>,
    yy: f64,
}

impl Normal {
    fn zeros() -> Self {
        Self { xx: SMatrix::zeros(), xy: SVector::zeros(), yy: 0.0 }
    }

    fn row(&mut self, x: &[f64; COLUMNS], columns: usize, y: f64) {
        for i in 0..columns {
            for j in 0..=i {
                self.xx[(i, j)] += x[i] * x[j];
            }
            self.xy[i] += x[i] * y;
        }
        self.yy += y * y;
    }

    /// Factors and sum of squares; redundant columns have the factor 0.
    fn solve(mut self, left_out: Option<usize>) -> ([f64; COLUMNS], f64) {
        for i in 0..COLUMNS {
            for j in i + 1..COLUMNS {
                self.xx[(i, j)] = self.xx[(j, i)];
            }
        }
        let scale: [f64; COLUMNS] = std::array::from_fn(|i| self.xx[(i, i)].sqrt());
        let mut beta = [0.0; COLUMNS];
        // Elimination in order: each pivot is the share of a column that those before it do not explain.
        let (mut l, mut d) = ([[0.0; COLUMNS]; COLUMNS], [0.0; COLUMNS]);
        let mut z = [0.0; COLUMNS];
        let mut cost = self.yy;
        for i in 0..COLUMNS {
            let mut pivot = self.xx[(i, i)];
            for j in 0..i {
                if d[j] > 0.0 {
                    let sum: f64 = (0..j).filter(|&k| d[k] > 0.0).map(|k| l[i][k] * d[k] * l[j][k]).sum();
                    l[i][j] = (self.xx[(i, j)] - sum) / d[j];
                    pivot -= l[i][j] * l[i][j] * d[j];
                }
            }
            let known = (0..i).map(|j| l[i][j] * z[j]).sum::<f64>();
            if left_out == Some(i) || pivot.is_nan() || pivot <= 1e-10 * scale[i] * scale[i] {
                continue;
            }
            d[i] = pivot;
            z[i] = self.xy[i] - known;
            cost -= z[i] * z[i] / d[i];
        }
        for i in (0..COLUMNS).rev().filter(|&i| d[i] > 0.0) {
            let later: f64 = (i + 1..COLUMNS).filter(|&j| d[j] > 0.0).map(|j| l[j][i] * beta[j]).sum();
            beta[i] = z[i] / d[i] - later;
        }
        (beta, cost.max(0.0))
    }
}

impl ActuatorProblem {
    pub fn new(rows: DriveRows, response: Response) -> Self {
        let room = vec![0.0; rows.time.len()];
        let answer = Answer { angle: room.clone(), by_gap: room.clone() };
        Self { rows, response, answer, residual: room }
    }

    fn columns(&self, row: usize) -> [f64; COLUMNS] {
        let mut x = [0.0; COLUMNS];
        x[0] = self.answer.angle[row];
        let mut place = 1;
        if let Some(varies) = self.response.varies.get(row) {
            x[1] = x[0] * varies;
            place = 2;
        }
        if self.response.half_gap.is_some() {
            x[place] = self.answer.by_gap[row];
            place += 1;
        }
        for fixed in &self.response.fixed {
            x[place] = fixed[row];
            place += 1;
        }
        x
    }

    /// Decay of a piece's free response.
    fn decay(&self, lag: f64, since: f64) -> f64 {
        if self.response.free && lag > 1e-6 {
            let decay = (-since / lag).exp();
            if decay > OVER { decay } else { 0.0 }
        } else {
            0.0
        }
    }

    /// The squares at a dead time and a lag.
    pub fn at(&mut self, dead_time: f64, lag: f64) -> Point {
        self.response.fill(&self.rows, dead_time, lag, &mut self.answer);
        let (beta, cost) = self.normal(lag, |problem, row| problem.rows.response[row]).solve(None);
        Point { dead_time, lag, cost, beta }
    }

    /// Normal equations of the columns as they are filled, for a target.
    fn normal(&self, lag: f64, target: impl Fn(&Self, usize) -> f64) -> Normal {
        let mut all = Normal::zeros();
        let columns = self.response.columns();
        for piece in ranges(&self.rows.pieces, self.rows.time.len()) {
            let begin = self.rows.time[piece.start];
            let (mut ee, mut ex, mut ey) = (0.0, SVector::<f64, COLUMNS>::zeros(), 0.0);
            let mut decaying = true;
            for row in piece {
                if !self.rows.counts[row] {
                    continue;
                }
                let (x, y) = (self.columns(row), target(self, row));
                all.row(&x, columns, y);
                if decaying {
                    let decay = self.decay(lag, self.rows.time[row] - begin);
                    decaying = decay > 0.0;
                    ee += decay * decay;
                    ex += SVector::from(x) * decay;
                    ey += y * decay;
                }
            }
            if ee > 1e-12 {
                all.xx -= ex * ex.transpose() / ee;
                all.xy -= ex * (ey / ee);
                all.yy -= ey * ey / ee;
            }
        }
        all
    }

    /// Fills `residual` with that of a point; 0 where rows do not count.
    pub fn residuals(&mut self, point: &Point) {
        self.response.fill(&self.rows, point.dead_time, point.lag, &mut self.answer);
        self.rest(point.lag, &point.beta, |problem, row| problem.rows.response[row]);
    }

    /// Part of this place's column that the others do not explain, at a point: into `residual`.
    pub fn alone(&mut self, point: &Point, place: usize) {
        self.response.fill(&self.rows, point.dead_time, point.lag, &mut self.answer);
        let target = move |problem: &Self, row: usize| problem.columns(row)[place];
        let (beta, _) = self.normal(point.lag, target).solve(Some(place));
        self.rest(point.lag, &beta, target);
    }

    fn rest(&mut self, lag: f64, beta: &[f64; COLUMNS], target: impl Fn(&Self, usize) -> f64) {
        let pieces: Vec<_> = ranges(&self.rows.pieces, self.rows.time.len()).collect();
        for piece in pieces {
            let begin = self.rows.time[piece.start];
            let (mut ee, mut er) = (0.0, 0.0);
            for row in piece.clone() {
                let x = self.columns(row);
                let fitted: f64 = x.iter().zip(beta).map(|(x, beta)| x * beta).sum();
                let rest = target(self, row) - fitted;
                self.residual[row] = rest;
                if self.rows.counts[row] {
                    let decay = self.decay(lag, self.rows.time[row] - begin);
                    ee += decay * decay;
                    er += decay * rest;
                }
            }
            let free = if ee > 1e-12 { er / ee } else { 0.0 };
            for row in piece {
                self.residual[row] -= free * self.decay(lag, self.rows.time[row] - begin);
            }
        }
    }

    /// The best lag near one, for a dead time.
    pub fn lag_for(&mut self, dead_time: f64, near: f64, width: f64) -> Point {
        let range = [(near - width).max(0.0), (near + width).min(LONGEST_LAG)];
        self.least(range, |problem, lag| problem.at(dead_time, lag))
    }

    /// The best dead time near one, for a lag.
    pub fn dead_time_for(&mut self, lag: f64, near: f64, width: f64) -> Point {
        let range = [(near - width).max(0.0), (near + width).min(LONGEST_DEAD_TIME)];
        self.least(range, |problem, dead_time| problem.at(dead_time, lag))
    }

    /// The best pair of a sum.
    pub fn of_sum(&mut self, sum: f64, near: f64, width: f64) -> Point {
        let most = sum.min(LONGEST_LAG);
        let least = (sum - LONGEST_DEAD_TIME).max(0.0);
        let range = [(near - width).clamp(least, most), (near + width).clamp(least, most)];
        self.least(range, |problem, lag| problem.at((sum - lag).max(0.0), lag))
    }

    /// The least squares over a range: some points, then golden sections about the best.
    fn least(&mut self, [low, high]: [f64; 2], mut at: impl FnMut(&mut Self, f64) -> Point) -> Point {
        let value = |i: u32| low + (high - low) * f64::from(i) / f64::from(TRIED);
        let mut best = (0, at(self, low));
        if high <= low {
            return best.1;
        }
        for i in 1..=TRIED {
            let found = at(self, value(i));
            if found.cost < best.1.cost {
                best = (i, found);
            }
        }
        let (from, to) = (value(best.0.saturating_sub(1)), value((best.0 + 1).min(TRIED)));
        let found = golden_section(from, to, 12, |x| at(self, x), |point| point.cost);
        if found.cost < best.1.cost { found } else { best.1 }
    }

    /// The best pair of all.
    pub fn search(&mut self) -> Point {
        let mut coarse = if self.rows.time.len() > 2 * GRID_ROWS {
            let (part, places) = self.rows.most_moved(GRID_ROWS, BLOCK);
            Self::new(part, self.response.of_part(&places))
        } else {
            self.clone()
        };
        let mut lags = vec![0.0];
        let mut next = SHORT_LAG;
        while next <= LONGEST_LAG {
            lags.push(next);
            next *= GRID_RATIO;
        }
        let mut best = coarse.at(0.0, 0.0);
        // Between whole steps, where the squares of a pure dead time have theirs.
        let steps = (LONGEST_DEAD_TIME / GRID) as u32;
        for dead_time in std::iter::once(0.0).chain((0..steps).map(|k| (f64::from(k) + 0.5) * GRID)) {
            for &lag in &lags {
                let found = coarse.at(dead_time, lag);
                if found.cost < best.cost {
                    best = found;
                }
            }
        }
        // Along the valley the grid's best may be far from the bottom: on until it is there.
        for _ in 0..ON {
            let width = (0.6 * best.lag).max(2.0 * GRID);
            let found = self.refine(&best, GRID, width);
            let moved = (found.dead_time - best.dead_time).abs();
            best = found;
            if moved < 0.5 * GRID {
                break;
            }
        }
        best
    }

    /// The blocks that move most, for rough answers.
    pub fn part(&self) -> Self {
        // A block begins as if its command had stood: behind a rate limit that is not soon forgotten.
        if self.rows.time.len() <= 2 * PART_ROWS {
            return self.clone();
        }
        let (rows, places) = self.rows.most_moved(PART_ROWS, BLOCK);
        Self::new(rows, self.response.of_part(&places))
    }

    /// Greatest rate of the response over a tenth of a second, the fastest rows left out.
    pub fn greatest_rate(&self) -> f64 {
        let rows = &self.rows;
        let about = (0.05 / rows.step.max(1e-3)).ceil().max(1.0) as usize;
        let mut rates = Vec::new();
        for stretch in rows.stretches() {
            for row in stretch.start + about..stretch.end.saturating_sub(about) {
                let (from, to) = (row - about, row + about);
                if rows.counts[from] && rows.counts[to] {
                    let rate = (rows.response[to] - rows.response[from]) / (rows.time[to] - rows.time[from]);
                    rates.push(rate.abs());
                }
            }
        }
        rates.sort_by(f64::total_cmp);
        let last = rates.len().saturating_sub(1);
        1.5 * rates.get((0.995 * last as f64) as usize).copied().unwrap_or(0.0)
    }

    /// A rough best pair with no more delay than a point has, and some.
    pub fn coarse(&mut self, near: &Point) -> Point {
        let most = near.dead_time + near.lag + 2.0 * GRID;
        let mut best = self.at(near.dead_time, near.lag);
        for i in 0..ROUGH {
            for j in 0..ROUGH - i {
                let share = |k: u32| most * f64::from(k) / f64::from(ROUGH);
                let found = self.at(share(i).min(LONGEST_DEAD_TIME), share(j).min(LONGEST_LAG));
                if found.cost < best.cost {
                    best = found;
                }
            }
        }
        best
    }

    /// The best pair near a point.
    pub fn refine(&mut self, near: &Point, dead_times: f64, lags: f64) -> Point {
        let mut best = self.at(near.dead_time, near.lag);
        let sum = near.dead_time + near.lag;
        let low = (near.dead_time - dead_times).max(0.0);
        let high = (near.dead_time + dead_times).min(LONGEST_DEAD_TIME);
        for (from, to) in [(low, near.dead_time), (near.dead_time, high)] {
            if to > from {
                let ends =
                    [from, to].map(|dead_time| self.lag_for(dead_time, (sum - dead_time).max(0.0), lags));
                let within = golden_section(
                    from,
                    to,
                    10,
                    |dead_time| self.lag_for(dead_time, (sum - dead_time).max(0.0), lags),
                    |point| point.cost,
                );
                for found in ends.into_iter().chain([within]) {
                    if found.cost < best.cost {
                        best = found;
                    }
                }
            }
        }
        best
    }
}
