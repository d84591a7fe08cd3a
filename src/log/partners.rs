//! Partners of a sensor: other columns that tell of its changes.
//!
//! A vehicle's signals move together. Between two rows of a drive
//!
//! ```text
//!     d(yaw_rate) = k d(ay / vx) + l d(1 / vx)                      = k d(vx steer) + l d(vx^3 steer) + m d(vx)    = k d(yaw')
//!     d(ay)       = k d(vx yaw_rate)                                = k d(roll)
//!     d(roll)     = k d(ay)                                         = k d(vx yaw_rate)
//!     d(vx)       = k int ax dt + l int vy yaw_rate dt + c dt       = k d(speed of x, y along the heading)
//!     d(ax)       = k d(vx')                                        = k d(accel_cmd)
//!     d(vy)       = k d(yaw_rate) + l d(vx^2 yaw_rate)
//!     d(steer)    = k d(yaw_rate / vx) + l d(vx yaw_rate)           = k d(steer_cmd)
//!     d(x), d(y)  = k int vx t dt + l int vx n dt + m int vy t dt + o int vy n dt        t, n: (cos, sin) of yaw
//!     d(yaw)      = k int yaw_rate dt + c dt
//! ```
//!
//! with numbers by least squares over the log itself: neither units nor a vehicle are assumed. A partner's errors there, over
//! each time, bound its trust elsewhere; and it is asked only for changes that it has told before.

use super::clean_log::STANDING;
use super::rows::LogRows;
use crate::numerics::statistics::quantile;
use nalgebra::{DMatrix, DVector};

/// Shortest time between two rows that are compared, s; each further one is twice as long.
pub(super) const SHORTEST: f64 = 0.5;
/// Time over which a slope is taken, to each side, s.
const SLOPE: f64 = 0.1;
/// Most pairs of rows for one time between them.
const MOST_PAIRS: usize = 5000;
/// Shortest time in which a sensor must have lived for its partners to be known, s.
const LIVED: f64 = 2.0;
/// Share of the pairs whose errors bound the others', and that bound over theirs.
const SHARE: f64 = 0.99;
const WIDER: f64 = 2.0;
/// Least change that counts, as a share of the sensor's large ones in the same time: less changes no answer.
const OF_CHANGES: f64 = 0.15;
/// Size of a part that no pair has, against those that they have.
const UNSEEN: f64 = 1e-9;

/// Changes as one partner tells them.
pub(super) struct Partner {
    /// Its column.
    pub name: &'static str,
    /// Parts of the sensor's change: columns of one size, and the factor of each.
    parts: Vec<(Vec<f64>, f64)>,
    /// Inverse of the parts' moments, and the greatest leverage of a pair.
    inverse: DMatrix<f64>,
    leverage: f64,
    /// Bounds of the errors of its changes, by the time in which they happen, s.
    bounds: Vec<(f64, f64)>,
}

impl Partner {
    /// The partners of a column. Only rows that `counts` names are compared, over times of up to `longest` s.
    pub fn all(log: &LogRows, name: &str, counts: &[bool], longest: f64) -> Vec<Self> {
        let Some(values) = log.columns.get(name) else { return Vec::new() };
        let pairs = pairs(log, counts, longest);
        let partners = PartnerColumns(log).partners(name).into_iter();
        partners.filter_map(|(name, parts)| Self::of(name, values, parts?, &pairs)).collect()
    }

    /// True if it feels the road's grade and bank as well.
    pub fn feels_gravity(&self) -> bool {
        matches!(self.name, "ax" | "ay")
    }

    /// The sensor's change between two rows, so many seconds apart, and the bound of its error; `None` where it tells nothing.
    pub fn change(&self, from: usize, to: usize, apart: f64) -> Option<(f64, f64)> {
        let parts = DVector::from_iterator(
            self.parts.len(),
            self.parts.iter().map(|(part, _)| part[to] - part[from]),
        );
        let leverage = parts.dot(&(&self.inverse * &parts));
        let (longest, last) = self.bounds[self.bounds.len() - 1];
        let known = self.bounds.iter().find(|(time, _)| *time >= apart);
        let bound = known.map_or(last * f64::max(apart / longest, 1.0), |(_, bound)| *bound);
        let told = parts.iter().zip(&self.parts).map(|(part, (_, factor))| factor * part).sum();
        (leverage <= self.leverage).then_some((told, bound))
    }

    fn of(
        name: &'static str,
        values: &[f64],
        mut parts: Vec<Vec<f64>>,
        pairs: &[(f64, Vec<(usize, usize)>)],
    ) -> Option<Self> {
        let change = |column: &[f64], (from, to): (usize, usize)| column[to] - column[from];
        let is_known = |pair: &(usize, usize)| {
            change(values, *pair).is_finite() && parts.iter().all(|part| change(part, *pair).is_finite())
        };
        let known: Vec<(usize, usize)> =
            pairs.iter().flat_map(|(_, pairs)| pairs).copied().filter(is_known).collect();
        if known.len() < 10 * parts.len() {
            return None;
        }
        for part in &mut parts {
            let size = known.iter().map(|pair| change(part, *pair).powi(2)).sum::<f64>().sqrt();
            if size > 0.0 {
                part.iter_mut().for_each(|value| *value /= size);
            }
        }
        let count = parts.len();
        let matrix = DMatrix::from_fn(known.len(), count, |i, j| change(&parts[j], known[i]));
        let target = DVector::from_fn(known.len(), |i, _| change(values, known[i]));
        let moments = matrix.transpose() * &matrix + DMatrix::identity(count, count) * UNSEEN;
        let inverse = moments.try_inverse()?;
        let factors = &inverse * matrix.transpose() * target;
        let leverages = (&matrix * &inverse).component_mul(&matrix).column_sum();
        let mut partner = Self {
            name,
            parts: parts.into_iter().zip(factors.iter().copied()).collect(),
            inverse,
            leverage: leverages.max(),
            bounds: Vec::new(),
        };
        let told = |&(from, to): &(usize, usize)| -> f64 {
            partner.parts.iter().map(|(part, factor)| factor * (part[to] - part[from])).sum()
        };
        let bounds = pairs.iter().filter_map(|(seconds, pairs)| {
            let at = |of: &dyn Fn(&(usize, usize)) -> f64| quantile(pairs.iter().map(of).collect(), SHARE);
            let large = at(&|pair| change(values, *pair).abs())?;
            let error = at(&|pair| (change(values, *pair) - told(pair)).abs())?;
            Some((*seconds, f64::max(WIDER * error, OF_CHANGES * large)))
        });
        partner.bounds = bounds.collect();
        (!partner.bounds.is_empty()).then_some(partner)
    }
}

/// Pairs of rows that count within one drive, by the time between them.
fn pairs(log: &LogRows, counts: &[bool], longest: f64) -> Vec<(f64, Vec<(usize, usize)>)> {
    let mut all = Vec::new();
    let mut apart = SHORTEST;
    loop {
        let mut found = Vec::new();
        for span in &log.spans {
            let mut to = span.start;
            for from in span.clone() {
                while to < span.end && log.time[to] < log.time[from] + apart {
                    to += 1;
                }
                if to < span.end && counts[from] && counts[to] {
                    found.push((from, to));
                }
            }
        }
        if found.len() as f64 * log.spacing < LIVED {
            return all;
        }
        let stride = found.len().div_ceil(MOST_PAIRS);
        all.push((apart, found.into_iter().step_by(stride).collect()));
        if apart >= longest {
            return all;
        }
        apart *= 2.0;
    }
}

/// Columns of a log, and what is computed of them.
struct PartnerColumns<'a, 'b>(&'a LogRows<'b>);

impl PartnerColumns<'_, '_> {
    /// Partners of a column: the name of each, and the quantities of which its changes are sums.
    fn partners(&self, name: &str) -> Vec<(&'static str, Option<Vec<Vec<f64>>>)> {
        let alone = |name: &str| Some(vec![self.0.columns.get(name)?.clone()]);
        let slope = |name: &str| Some(vec![self.slope(self.0.columns.get(name)?)]);
        let turning = || self.sums(["vx", "yaw_rate"], |[vx, rate]| [vx * rate]);
        match name {
            "yaw_rate" => vec![
                ("ay", self.sums(["ay", "vx"], |[ay, vx]| [ay / moving(vx), moving(vx).recip()])),
                ("steer", self.sums(["steer", "vx"], |[steer, vx]| [steer * vx, steer * vx.powi(3), vx])),
                ("yaw", slope("yaw")),
            ],
            "ay" => vec![("yaw_rate", turning()), ("roll", alone("roll"))],
            "roll" => vec![("ay", alone("ay")), ("yaw_rate", turning())],
            "vx" => vec![("ax", self.faster()), ("x", self.over_ground())],
            "ax" => vec![("vx", slope("vx")), ("accel_cmd", alone("accel_cmd"))],
            "vy" => {
                vec![("yaw_rate", self.sums(["yaw_rate", "vx"], |[rate, vx]| [rate, rate * vx.powi(2)]))]
            }
            "steer" => vec![
                ("yaw_rate", self.sums(["yaw_rate", "vx"], |[rate, vx]| [rate / moving(vx), rate * vx])),
                ("steer_cmd", alone("steer_cmd")),
            ],
            "yaw" => vec![("yaw_rate", self.turned())],
            "x" | "y" => vec![("vx", self.way())],
            _ => Vec::new(),
        }
    }

    /// Quantities of two columns, row by row.
    fn sums<const N: usize>(
        &self,
        names: [&str; 2],
        of: impl Fn([f64; 2]) -> [f64; N],
    ) -> Option<Vec<Vec<f64>>> {
        let [a, b] = names.map(|name| self.0.columns.get(name));
        let rows: Vec<[f64; N]> = a?.iter().zip(b?).map(|(&a, &b)| of([a, b])).collect();
        Some((0..N).map(|part| rows.iter().map(|row| row[part]).collect()).collect())
    }

    fn integrals(&self, parts: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        parts.iter().map(|part| self.integral(part)).collect()
    }

    fn turned(&self) -> Option<Vec<Vec<f64>>> {
        Some(vec![self.integral(self.0.columns.get("yaw_rate")?), self.0.time.clone()])
    }

    /// Without `vy` that of steady cornering, of any size.
    fn faster(&self) -> Option<Vec<Vec<f64>>> {
        let mut parts = vec![self.integral(self.0.columns.get("ax")?), self.0.time.clone()];
        let turning = self
            .sums(["vy", "yaw_rate"], |[vy, rate]| [vy * rate])
            .or_else(|| self.sums(["vx", "yaw_rate"], |[vx, rate]| [rate.powi(2), (vx * rate).powi(2)]));
        parts.extend(self.integrals(turning.unwrap_or_default()));
        Some(parts)
    }

    fn over_ground(&self) -> Option<Vec<Vec<f64>>> {
        let [x, y] = ["x", "y"].map(|name| Some(self.slope(self.0.columns.get(name)?)));
        let ways = x?.into_iter().zip(y?);
        let along = match self.0.columns.get("yaw") {
            Some(yaw) => ways.zip(yaw).map(|((x, y), yaw)| x * yaw.cos() + y * yaw.sin()).collect(),
            None => ways.map(|(x, y)| x.hypot(y)).collect(),
        };
        Some(vec![along])
    }

    fn way(&self) -> Option<Vec<Vec<f64>>> {
        let across = if self.0.columns.contains_key("vy") { "vy" } else { "yaw_rate" };
        let by_yaw = |name| self.sums([name, "yaw"], |[v, yaw]| [v * yaw.cos(), v * yaw.sin()]);
        let parts = [by_yaw("vx")?, by_yaw(across).unwrap_or_default()].concat();
        Some(self.integrals(parts))
    }

    /// Integral over time; a missing value is taken to lie between its neighbours.
    fn integral(&self, values: &[f64]) -> Vec<f64> {
        let (mut sum, mut last) = (0.0, None);
        let each = values.iter().zip(&self.0.time).map(|(&value, &time)| {
            if !value.is_finite() {
                return f64::NAN;
            }
            let (before, since) = last.unwrap_or((value, time));
            sum += 0.5 * (value + before) * (time - since);
            last = Some((value, time));
            sum
        });
        each.collect()
    }

    fn slope(&self, values: &[f64]) -> Vec<f64> {
        let half = self.0.lasting(SLOPE, 1);
        let mut slopes = vec![f64::NAN; values.len()];
        for span in &self.0.spans {
            for from in span.start..span.end.saturating_sub(2 * half) {
                let to = from + 2 * half;
                slopes[from + half] = (values[to] - values[from]) / (self.0.time[to] - self.0.time[from]);
            }
        }
        slopes
    }
}

/// A speed to divide by.
fn moving(vx: f64) -> f64 {
    if vx.abs() > STANDING { vx } else { f64::NAN }
}
