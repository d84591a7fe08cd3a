//! Velocity across and acceleration along the body, told by the other columns.
//!
//! Over spans of the log the point moves as its velocity says, and changes its speed as its accelerometer says:
//!
//! ```text
//!     d(x, y)  = f int vx t dt + k int vy n dt + e int vx n dt + d int yaw_rate n dt        t, n: along and across the heading
//!     d(vy)    = k (int ay dt / (1 + b) - int vx yaw_rate dt) + c dt                        b: roll's part of gravity
//!     int ax dt = k d(vx) - int vy yaw_rate dt + c dt (+ tau d(ax), if vx comes later by tau)
//! ```
//!
//! `1 / k` of the first, `k` of the others is the size of the column's unit. Other numbers are what logs differ in: a gain
//! of the speed, a yaw angle that is off, another point of the body, a grade.

use super::clean_log::CleanLog;
use super::join::JUMP;
use crate::numerics::statistics::independent;
use crate::path::wrap_angle;
use nalgebra::{DMatrix, DVector};

/// Length of the stretches whose means are compared, s.
const BLOCK: f64 = 0.5;
/// Shortest way of a span whose direction tells something, m.
const LEAST_WAY: f64 = 0.5;
/// Largest standard error, as a share of the ratio, of one that tells something.
const SURE: f64 = 0.08;

/// A column that tells another's size, and the ratio of the two.
pub(super) type Told = (&'static str, f64);

/// Ratio of `vy` to what places and headings, or else the accelerometer, say it is; `None` where they do not tell.
pub(super) fn vy_factor(log: &CleanLog) -> Option<Told> {
    by_place(log).map(|factor| ("y", factor)).or_else(|| by_acceleration(log).map(|factor| ("ay", factor)))
}

fn by_acceleration(log: &CleanLog) -> Option<f64> {
    let [vx, vy, rate, ay] = ["vx", "vy", "yaw_rate", "ay"].map(|name| log.columns.get(name));
    let (vx, vy, rate, ay) = (vx?, vy?, rate?, ay?);
    let spans = Spans::of(log);
    let (turning, felt) = (spans.integrals(|i| -vx[i] * rate[i]), spans.integrals(|i| ay[i]));
    let rows: Vec<[f64; 3]> = (0..spans.count()).map(|k| [turning[k], felt[k], 1.0]).collect();
    first_coefficient(&spans.changes(|i| vy[i]), &rows)
}

fn by_place(log: &CleanLog) -> Option<f64> {
    let [x, y, yaw, vx, vy, rate] =
        ["x", "y", "yaw", "vx", "vy", "yaw_rate"].map(|name| log.columns.get(name));
    let (x, y, yaw, vx, vy, rate) = (x?, y?, yaw?, vx?, vy?, rate?);
    let spans = Spans::of(log);
    let (mut targets, mut rows) = (Vec::new(), Vec::new());
    for (place, is_x) in [(x, true), (y, false)] {
        let across = |i: usize| if is_x { -yaw[i].sin() } else { yaw[i].cos() };
        let along = |i: usize| if is_x { yaw[i].cos() } else { yaw[i].sin() };
        let moved = spans.changes(|i| place[i]);
        let parts = [
            spans.integrals(|i| vy[i] * across(i)),
            spans.integrals(|i| vx[i] * along(i)),
            spans.integrals(|i| vx[i] * across(i)),
            spans.integrals(|i| rate[i] * across(i)),
        ];
        targets.extend(moved);
        rows.extend((0..spans.count()).map(|k| parts.each_ref().map(|part| part[k])));
    }
    first_coefficient(&targets, &rows).map(f64::recip)
}

/// Ratio of `ax` to what the change of the speed says it is; `None` where it does not tell.
pub(super) fn ax_factor(log: &CleanLog) -> Option<Told> {
    let (vx, ax) = (log.columns.get("vx")?, log.columns.get("ax")?);
    let spans = Spans::of(log);
    let (faster, [sliding, outward]) = (spans.changes(|i| vx[i]), turning(log, &spans));
    let rows: Vec<[f64; 4]> = (0..spans.count()).map(|k| [faster[k], 1.0, sliding[k], outward[k]]).collect();
    first_coefficient(&spans.integrals(|i| ax[i]), &rows).map(|factor| ("vx", factor))
}

/// Integrals of `vy yaw_rate`, the part of the acceleration along a body that turns. Without `vy` those of the two parts of steady
/// cornering, of any size: `vy = (b - K vx^2) yaw_rate`.
fn turning(log: &CleanLog, spans: &Spans<'_>) -> [Vec<f64>; 2] {
    let none = || vec![0.0; spans.count()];
    match ["vx", "vy", "yaw_rate"].map(|name| log.columns.get(name)) {
        [_, Some(vy), Some(rate)] => [spans.integrals(|i| vy[i] * rate[i]), none()],
        [Some(vx), None, Some(rate)] => {
            [spans.integrals(|i| rate[i].powi(2)), spans.integrals(|i| (vx[i] * rate[i]).powi(2))]
        }
        _ => [none(), none()],
    }
}

/// Angle by which yaw is less than the course of x and y says, rad, and its standard error: without `vy` nothing tells it from the slip.
///
/// ```text
///     course(x, y) = yaw + atan2(vy, vx) + angle + d yaw_rate / vx        d: from the point of vy to that of x and y
/// ```
pub(super) fn yaw_offset(log: &CleanLog) -> Option<(f64, f64)> {
    let [x, y, yaw, vx, vy, rate] =
        ["x", "y", "yaw", "vx", "vy", "yaw_rate"].map(|name| log.columns.get(name));
    let (x, y, yaw, vx, vy, rate) = (x?, y?, yaw?, vx?, vy?, rate?);
    let spans = Spans::of(log);
    let (east, north) = (spans.changes(|i| x[i]), spans.changes(|i| y[i]));
    let ways = |direction: fn(f64) -> f64| {
        spans.integrals(|i| vx[i].hypot(vy[i]) * direction(yaw[i] + vy[i].atan2(vx[i])))
    };
    let (said_east, said_north, turns) = (ways(f64::cos), ways(f64::sin), spans.integrals(|i| rate[i]));
    let (mut angles, mut rows) = (Vec::new(), Vec::new());
    for k in 0..spans.count() {
        let way = said_east[k].hypot(said_north[k]);
        let angle = wrap_angle(north[k].atan2(east[k]) - said_north[k].atan2(said_east[k]));
        angles.push(if way > LEAST_WAY { angle } else { f64::NAN });
        rows.push([1.0, turns[k] / way.max(LEAST_WAY)]);
    }
    first_coefficient_within(&angles, &rows)
}

/// Least way from the rear axle to the point whose course stands for yaw, m, and in standard errors.
const LEVER: f64 = 0.3;
pub(super) const SURE_LEVER: f64 = 5.0;
/// Least amount by which a sideslip leaves less than a lateness, in variances.
const BETTER: f64 = 25.0;
/// Least amount by which a lateness leaves less than another place, in variances.
const APART: f64 = 16.0;

/// Way from the rear axle forward to the point whose course, with its sideslip, stands for yaw, m; `None` if yaw is a heading.
///
/// ```text
///     d(yaw) = g int yaw_rate dt + b d(yaw_rate / vx) - K d(vx yaw_rate) + c dt        a course: steady cornering's sideslip
///     d(yaw) = g int yaw_rate dt + tau d(yaw_rate) + c dt                              a heading, one of the two late
/// ```
pub(super) fn course_as_yaw(log: &CleanLog) -> Option<f64> {
    let [yaw, rate, vx] = ["yaw", "yaw_rate", "vx"].map(|name| log.columns.get(name));
    let (yaw, rate, vx) = (yaw?, rate?, vx?);
    let spans = Spans::of(log);
    let (turned, faster) = (spans.integrals(|i| rate[i]), spans.changes(|i| rate[i]));
    let (bend, outward) = (spans.changes(|i| rate[i] / vx[i]), spans.changes(|i| rate[i] * vx[i]));
    let course: Vec<[f64; 4]> = (0..spans.count()).map(|k| [bend[k], -outward[k], turned[k], 1.0]).collect();
    let heading: Vec<[f64; 3]> = (0..spans.count()).map(|k| [faster[k], turned[k], 1.0]).collect();
    let changes = spans.changes(|i| yaw[i]);
    let (course, heading) = (LeastSquares::of(&changes, &course)?, LeastSquares::of(&changes, &heading)?);
    let (lever, softness) = (course.solution[0], *course.solution.get(1)?);
    let is_sure = lever > LEVER && lever > SURE_LEVER * course.error && softness > 0.0;
    (is_sure && heading.left - course.left > BETTER * course.variance()).then_some(lever)
}

/// Lateral acceleration up to which an axle's slip is linear in its force, m/s2.
const LINEAR: f64 = 4.0;

/// Way from the rear axle forward to the point whose velocity is `vy`, m, and its standard error. The slip of the rear axle goes with
/// its force, so with the accelerations; a point before it is moved by the yaw rate alone:
///
/// ```text
///     vy = b yaw_rate - K vx ay + J vx d(yaw_rate)/dt + a vx + c        a: a turned sensor; c: wind
/// ```
pub(super) fn vy_point(log: &CleanLog) -> Option<(f64, f64)> {
    let (vx, vy, rate) = (log.columns.get("vx")?, log.columns.get("vy")?, log.columns.get("yaw_rate")?);
    let (spans, felt) = (Spans::of(log), felt(log)?);
    let (faster, speed) = (spans.changes(|i| rate[i]), spans.means(|i| vx[i]));
    let parts = [
        spans.integrals(|i| rate[i]),
        spans.integrals(|i| -vx[i] * felt[i]),
        (0..spans.count()).map(|k| speed[k] * faster[k]).collect(),
        spans.integrals(|i| vx[i]),
        vec![1.0; spans.count()],
    ];
    let rows: Vec<[f64; 5]> = (0..spans.count()).map(|k| parts.each_ref().map(|part| part[k])).collect();
    first_coefficient_of_neighbours(&mild(&spans, &felt, spans.integrals(|i| vy[i])), &rows)
}

/// The same of the point whose place is `x`, `y`, for its velocity across the heading moves it; and how far it lies to the left of
/// that whose speed is `vx`, as the yaw rate moves it back and forth.
pub(super) fn place_point(log: &CleanLog) -> Option<[(f64, f64); 2]> {
    let [x, y, yaw, vx, rate] = ["x", "y", "yaw", "vx", "yaw_rate"].map(|name| log.columns.get(name));
    let (x, y, yaw, vx, rate) = (x?, y?, yaw?, vx?, rate?);
    let (spans, felt) = (Spans::of(log), felt(log)?);
    let faster = spans.changes(|i| rate[i]);
    let (mut targets, mut rows) = (Vec::new(), Vec::new());
    for (place, is_x) in [(x, true), (y, false)] {
        let across = |i: usize| if is_x { -yaw[i].sin() } else { yaw[i].cos() };
        let along = |i: usize| if is_x { yaw[i].cos() } else { yaw[i].sin() };
        let speed = spans.means(|i| vx[i] * across(i));
        let parts = [
            spans.integrals(|i| rate[i] * across(i)),
            spans.integrals(|i| -vx[i] * felt[i] * across(i)),
            (0..spans.count()).map(|k| speed[k] * faster[k]).collect(),
            spans.integrals(|i| vx[i] * across(i)),
            spans.integrals(across),
            spans.integrals(|i| vx[i] * along(i)),
            spans.integrals(|i| -rate[i] * along(i)),
        ];
        targets.extend(mild(&spans, &felt, spans.changes(|i| place[i])));
        rows.extend((0..spans.count()).map(|k| parts.each_ref().map(|part| part[k])));
    }
    let forward = first_coefficient_of_neighbours(&targets, &rows)?;
    rows.iter_mut().for_each(|row| row.swap(0, 6));
    Some([forward, first_coefficient_of_neighbours(&targets, &rows)?])
}

/// Lateral acceleration of a log: the measured one, or that of its turns.
fn felt(log: &CleanLog) -> Option<Vec<f64>> {
    let (vx, rate) = (log.columns.get("vx")?, log.columns.get("yaw_rate")?);
    let turning = || vx.iter().zip(rate).map(|(vx, rate)| vx * rate).collect();
    Some(log.columns.get("ay").cloned().unwrap_or_else(turning))
}

/// Numbers of the spans with a mild lateral acceleration; NaN elsewhere.
fn mild(spans: &Spans<'_>, felt: &[f64], values: Vec<f64>) -> Vec<f64> {
    let sizes = spans.means(|i| felt[i].abs());
    let each = values.into_iter().zip(sizes);
    each.map(|(value, size)| if size < LINEAR { value } else { f64::NAN }).collect()
}

/// Time by which `ay` comes later than yaw rate and `vy` tell, s, and its standard error; `None` where another place of the
/// accelerometer, `l` before that of `vy`, explains it about as well: at one speed the two are alike. `likely`: where it explains it
/// no better.
///
/// ```text
///     int ay dt = g (int vx yaw_rate dt + d(vy)) - tau d(ay) + c dt             late; g: roll's part of gravity
///     int ay dt = g (int vx yaw_rate dt + d(vy)) + l d(yaw_rate) + c dt         in another place
/// ```
pub(super) fn ay_late(log: &CleanLog, likely: bool) -> Option<(f64, f64)> {
    let [vx, vy, rate, ay] = ["vx", "vy", "yaw_rate", "ay"].map(|name| log.columns.get(name));
    let (vx, vy, rate, ay) = (vx?, vy?, rate?, ay?);
    let spans = Spans::of(log);
    let (turning, sliding) = (spans.integrals(|i| vx[i] * rate[i]), spans.changes(|i| vy[i]));
    let felt = spans.integrals(|i| ay[i]);
    let by = |part: Vec<f64>| {
        let rows: Vec<[f64; 3]> =
            (0..spans.count()).map(|k| [part[k], turning[k] + sliding[k], 1.0]).collect();
        LeastSquares::of(&felt, &rows)
    };
    let late = by(spans.changes(|i| -ay[i]))?;
    let elsewhere = by(spans.changes(|i| rate[i]))?;
    let apart = if likely { 0.0 } else { APART };
    let told_apart = elsewhere.left - late.left > apart * late.variance();
    told_apart.then(|| (late.solution[0], late.error))
}

/// Time by which the yaw rate comes later than the yaw angle tells, s, and its standard error.
pub(super) fn yaw_rate_late(log: &CleanLog) -> Option<(f64, f64)> {
    let (yaw, rate) = (log.columns.get("yaw")?, log.columns.get("yaw_rate")?);
    let spans = Spans::of(log);
    let (faster, turned) = (spans.changes(|i| rate[i]), spans.integrals(|i| rate[i]));
    let rows: Vec<[f64; 3]> = (0..spans.count()).map(|k| [faster[k], turned[k], 1.0]).collect();
    first_coefficient_within(&spans.changes(|i| yaw[i]), &rows)
}

/// Ratio of `e1_rate` to what speed and `e2` say it is, for a log without `vy`: the slip is that of steady cornering, of any size.
/// Noise of a small `e2` makes it less than it is.
///
/// ```text
///     d(e1_rate) = k d(vx e2) + a d(r) + b d(vx^2 r)        r = e2_rate + vx curvature
/// ```
pub(super) fn drift_factor(log: &CleanLog) -> Option<f64> {
    let [rate, vx, e2, e2_rate, curvature] =
        ["e1_rate", "vx", "e2", "e2_rate", "curvature"].map(|name| log.columns.get(name));
    let (rate, vx, e2, e2_rate, curvature) = (rate?, vx?, e2?, e2_rate?, curvature?);
    let spans = Spans::of(log);
    let turn = |i: usize| e2_rate[i] + vx[i] * curvature[i];
    let parts =
        [spans.changes(|i| vx[i] * e2[i]), spans.changes(turn), spans.changes(|i| vx[i].powi(2) * turn(i))];
    let rows: Vec<[f64; 3]> = (0..spans.count()).map(|k| parts.each_ref().map(|part| part[k])).collect();
    first_coefficient(&spans.changes(|i| rate[i]), &rows)
}

/// Time by which the speed comes later than the acceleration tells, s, and its standard error.
pub(super) fn vx_late(log: &CleanLog) -> Option<(f64, f64)> {
    let (vx, ax) = (log.columns.get("vx")?, log.columns.get("ax")?);
    let spans = Spans::of(log);
    let (quicker, faster) = (spans.changes(|i| ax[i]), spans.changes(|i| vx[i]));
    let [sliding, outward] = turning(log, &spans);
    let rows: Vec<[f64; 5]> =
        (0..spans.count()).map(|k| [quicker[k], faster[k], sliding[k], outward[k], 1.0]).collect();
    first_coefficient_within(&spans.integrals(|i| ax[i]), &rows)
}

/// Time by which places come later than velocities and headings tell, s, and its standard error. Without `vy` it is told along the
/// heading only: across it the slip moves a place as well, and where the speed is the same in all bends, as far as a lateness does.
pub(super) fn place_late(log: &CleanLog) -> Option<(f64, f64)> {
    let [x, y, yaw, vx] = ["x", "y", "yaw", "vx"].map(|name| log.columns.get(name));
    let (x, y, yaw, vx) = (x?, y?, yaw?, vx?);
    let (told, none) = (log.columns.get("vy"), vec![0.0; vx.len()]);
    let vy = told.unwrap_or(&none);
    let spans = Spans::of(log);
    let (cos, sin) = (spans.changes(|i| yaw[i].cos()), spans.changes(|i| yaw[i].sin()));
    let moved = [spans.changes(|i| x[i]), spans.changes(|i| y[i])];
    let east = |i: usize| vx[i] * yaw[i].cos() - vy[i] * yaw[i].sin();
    let north = |i: usize| vx[i] * yaw[i].sin() + vy[i] * yaw[i].cos();
    let ways = [spans.integrals(east), spans.integrals(north)];
    let changes = [spans.changes(east), spans.changes(north)];
    if told.is_none() {
        // By the heading in the middle of each span, about which the slip's part is odd.
        let [toward_x, toward_y] = [spans.means(|i| yaw[i].cos()), spans.means(|i| yaw[i].sin())];
        let along =
            |k: usize, x: f64, y: f64| (toward_x[k] * x + toward_y[k] * y) / toward_x[k].hypot(toward_y[k]);
        let targets: Vec<f64> = (0..spans.count()).map(|k| along(k, moved[0][k], moved[1][k])).collect();
        let row = |k: usize| {
            [
                -along(k, changes[0][k], changes[1][k]),
                along(k, ways[0][k], ways[1][k]),
                along(k, -sin[k], cos[k]),
            ]
        };
        let rows: Vec<[f64; 3]> = (0..spans.count()).map(row).collect();
        return first_coefficient_within(&targets, &rows);
    }
    let (mut targets, mut rows) = (Vec::new(), Vec::new());
    for (place, is_x) in moved.into_iter().zip([true, false]) {
        targets.extend(place);
        let (own, other) = if is_x { (0, 1) } else { (1, 0) };
        let (along, across) = if is_x { (&cos, &sin) } else { (&sin, &cos) };
        let side = if is_x { -1.0 } else { 1.0 };
        rows.extend(
            (0..spans.count())
                .map(|k| [-changes[own][k], ways[own][k], side * ways[other][k], along[k], side * across[k]]),
        );
    }
    first_coefficient_within(&targets, &rows)
}

impl CleanLog {
    /// Wheelbase that the turns show, m, and its standard error; a gain of the steering is in it.
    ///
    /// ```text
    ///     d(steer) = L d(yaw_rate / vx) + K d(vx yaw_rate) + c dt
    /// ```
    #[must_use]
    pub fn wheelbase_shown(&self) -> Option<(f64, f64)> {
        let [steer, vx, rate] = ["steer", "vx", "yaw_rate"].map(|name| self.columns.get(name));
        let (steer, vx, rate) = (steer.or_else(|| self.columns.get("steer_cmd"))?, vx?, rate?);
        let spans = Spans::of(self);
        let (bend, outward) = (spans.changes(|i| rate[i] / vx[i]), spans.changes(|i| rate[i] * vx[i]));
        let rows: Vec<[f64; 3]> = (0..spans.count()).map(|k| [bend[k], outward[k], 1.0]).collect();
        first_coefficient_within(&spans.changes(|i| steer[i]), &rows)
    }
}

/// Pairs of neighbouring stretches of a log.
struct Spans<'a> {
    log: &'a CleanLog,
    size: usize,
}

impl<'a> Spans<'a> {
    fn of(log: &'a CleanLog) -> Self {
        Self { log, size: log.rows_in(BLOCK) }
    }

    fn count(&self) -> usize {
        (self.log.time.len() / self.size).saturating_sub(1)
    }

    /// Changes of a quantity's mean from stretch to stretch; NaN where rows do not count.
    fn changes(&self, of: impl Fn(usize) -> f64) -> Vec<f64> {
        let mean = |block: usize| {
            let rows = block * self.size..(block + 1) * self.size;
            let counts = rows.clone().all(|i| self.log.valid[i]);
            if counts { rows.map(&of).sum::<f64>() / self.size as f64 } else { f64::NAN }
        };
        let means: Vec<f64> = (0..=self.count()).map(mean).collect();
        // Two drives have no change between them.
        let time = |row: usize| self.log.time[row];
        let is_one = |k: usize| time((k + 2) * self.size - 1) - time(k * self.size) < 0.9 * JUMP;
        let change = |(k, pair): (usize, &[f64])| if is_one(k) { pair[1] - pair[0] } else { f64::NAN };
        means.windows(2).enumerate().map(change).collect()
    }

    /// A quantity's mean over both stretches of each span.
    fn means(&self, of: impl Fn(usize) -> f64) -> Vec<f64> {
        let both = |k: usize| k * self.size..(k + 2) * self.size;
        (0..self.count()).map(|k| both(k).map(&of).sum::<f64>() / (2 * self.size) as f64).collect()
    }

    /// Integrals of a rate over the same spans.
    fn integrals(&self, rate: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut integral = vec![0.0; self.log.time.len()];
        for i in 1..integral.len() {
            integral[i] = integral[i - 1] + 0.5 * self.log.step * (rate(i - 1) + rate(i));
            // What is missing costs its own stretch only.
            if !integral[i].is_finite() && self.log.valid[i - 1] && self.log.valid[i] {
                return vec![f64::NAN; self.count()];
            }
            if !integral[i].is_finite() {
                integral[i] = integral[i - 1];
            }
        }
        let integral = &integral;
        self.changes(|i| integral[i])
    }
}

/// Coefficient of the first column in a least-squares fit, if its standard error is small.
fn first_coefficient<const N: usize>(targets: &[f64], rows: &[[f64; N]]) -> Option<f64> {
    first_coefficient_within(targets, rows)
        .filter(|(coefficient, error)| *error < SURE * coefficient.abs())
        .map(|(coefficient, _)| coefficient)
}

/// That coefficient and its standard error.
fn first_coefficient_within<const N: usize>(targets: &[f64], rows: &[[f64; N]]) -> Option<(f64, f64)> {
    LeastSquares::of(targets, rows).map(|fit| (fit.solution[0], fit.error))
}

/// The same of spans whose remainders are alike from one to the next, as those of a law that is not quite the vehicle's.
fn first_coefficient_of_neighbours<const N: usize>(targets: &[f64], rows: &[[f64; N]]) -> Option<(f64, f64)> {
    let fit = LeastSquares::of(targets, rows)?;
    let count = (fit.freedom + N) as f64;
    Some((fit.solution[0], fit.error * (count / fit.independent.max(1.0)).sqrt()))
}

/// A least-squares fit.
struct LeastSquares {
    /// Coefficients of the columns that are not nothing.
    solution: DVector<f64>,
    /// Standard error of the first.
    error: f64,
    /// Sum of the squares that it leaves, and their number less that of the coefficients.
    left: f64,
    freedom: usize,
    /// Number of the remainders that are independent.
    independent: f64,
}

impl LeastSquares {
    fn of<const N: usize>(targets: &[f64], rows: &[[f64; N]]) -> Option<Self> {
        let finite =
            |(target, row): &(&f64, &[f64; N])| target.is_finite() && row.iter().all(|v| v.is_finite());
        let kept: Vec<_> = targets.iter().zip(rows).filter(finite).collect();
        if kept.len() < 10 * N {
            return None;
        }
        // A column of nothing tells nothing, and leaves the others to tell.
        let told: Vec<usize> = (0..N).filter(|&j| kept.iter().any(|(_, row)| row[j] != 0.0)).collect();
        if told.first() != Some(&0) {
            return None;
        }
        let matrix = DMatrix::from_fn(kept.len(), told.len(), |i, j| kept[i].1[told[j]]);
        let target = DVector::from_iterator(kept.len(), kept.iter().map(|(target, _)| **target));
        let inverse = (matrix.transpose() * &matrix).try_inverse()?;
        let solution = &inverse * matrix.transpose() * &target;
        let remainders = &target - matrix * &solution;
        let (left, independent) = (remainders.norm_squared(), independent(remainders.as_slice()));
        let fit = Self { solution, error: 0.0, left, freedom: kept.len() - N, independent };
        Some(Self { error: (fit.variance() * inverse[(0, 0)]).sqrt(), ..fit })
    }

    fn variance(&self) -> f64 {
        self.left / self.freedom as f64
    }
}
