//! Unknown road: bank and grade vary along the way, and are marginalised.
//!
//! Every road has crown and camber. Unless the log or a path file tells them, bank and grade are random profiles
//!
//! ```text
//!     b(s) = sum_k c_k hat((s - s_k) / L),    c_k ~ N(0, sigma^2),
//! ```
//!
//! with hats of a width `L` along the driven way `s`: some ten metres for a bank, for a grade a hundred. With `B` the
//! replay's response to each `c_k`, in units of `sigma`, a gap has the weight
//!
//! ```text
//!     (W^-1 + B B')^-1 = W - W B (1 + B' W B)^-1 B' W,
//! ```
//!
//! so that the response to a road is no evidence of anything else. The roughness of this road, as a share of `sigma`
//! for bank and grade each, maximises the likelihood of the best fit's remainder. A hat's response ends some seconds
//! behind it: one replay serves all hats that are so far apart.
//!
//! The mean bank is as unknown as its variation: `c_k` is about a mean that is `N(0, sigma^2)` itself. It is one more
//! hat, as wide as the road, whose response is the sum of all others. So a crown is no discovery on a road that is
//! crowned and banked here and there. On a road that does not vary a steady bank is not the road's. A grade has no
//! such mean: a road leans one way all along, but goes up and down. So its roughness is that of the variation about a mean of
//! which nothing is known (restricted likelihood, sec. 2.7): a steady climb makes no road rough.
//!
//! Source: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, sec. 2.7; the discrepancy of the
//! specification, after Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001).

use super::problem::Problem;
use super::replay::{Channel, LEAK, ReplayVehicle};
use crate::numerics::parallel;
use crate::signal;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::ops::Range;
use std::sync::Arc;

/// Standard deviations of bank and grade, rad, and the distance of their hats, m. Public roads are crowned by 2 to 3 %
/// and banked by up to 7 % in bends, over transitions of some 20 to 50 m. Grades are designed for a few per cent over
/// crests and sags of more than 100 m. (AASHTO, A Policy on Geometric Design of Highways and Streets, ch. 3.)
const BANK: (f64, f64) = (0.015, 25.0);
const GRADE: (f64, f64) = (0.02, 100.0);
/// Decay of a hat's response, in leak times of the slowest channel.
const FADED: f64 = 4.0;
/// Shares of these deviations that a road may have.
const ROUGHNESS: [f64; 6] = [0.0, 0.1, 0.25, 0.5, 1.0, 2.0];
/// Size of a hat for which the replay's slope is taken, in standard deviations.
const STRIDE: f64 = 0.5;

/// Response of the gap to one hat: sample rows, and values there, block after block.
struct Hat {
    /// Place of its kind in a [`Roughness`].
    kind: usize,
    rows: Range<usize>,
    values: Vec<f64>,
}

impl Hat {
    /// The hat as wide as the road: the sum of all others, over so many blocks of so many samples.
    fn mean(hats: &[Self], kind: usize, (blocks, samples): (usize, usize)) -> Option<Self> {
        let mut values = vec![0.0; blocks * samples];
        for hat in hats {
            let count = hat.rows.len();
            for block in 0..blocks {
                let all = &mut values[block * samples..][hat.rows.clone()];
                all.iter_mut().zip(&hat.values[block * count..]).for_each(|(all, value)| *all += value);
            }
        }
        (!hats.is_empty()).then_some(Self { kind, rows: 0..samples, values })
    }
}

/// Place of the mean bank and of the mean grade among the kinds of slopes, behind those of bank and grade.
const OF_CROWN: usize = 2;
const OF_CLIMB: usize = 3;
/// Roughness of a road: shares of the deviations of bank, grade, mean bank and mean grade.
pub type Roughness = [f64; 4];
/// A road of which nothing is known: as rough as roads are, about no slope.
pub const ORDINARY: Roughness = [1.0, 1.0, 0.0, 0.0];
/// A road that is known.
const KNOWN: Roughness = [0.0; 4];
/// Deviation of a mean of which nothing is known: beyond all roads, in those of [`GRADE`].
const ANY: f64 = 10.0;

/// Response of the gap to all hats of bank and grade.
pub struct Profile {
    hats: Vec<Hat>,
    /// Start of each block of the gap.
    blocks: Vec<usize>,
}

impl Profile {
    /// Profile of a problem at its neutral replay; None for a known road, or one without a response.
    pub(super) fn of<V: ReplayVehicle>(problem: &Problem<V>) -> Option<Self> {
        let drive = problem.drive;
        let along = [Channel::Vx, Channel::Ax];
        let has_along = along.iter().any(|channel| drive.channels.contains(channel));
        let kinds = [(signal::BANK.name, BANK, true), (signal::GRADE.name, GRADE, has_along)];
        let way = way(drive.column("vx"), drive.step);
        let neutral = vec![0.0; problem.uncertain.len()];
        let here = problem.residual(&neutral)?;
        let mut hats = Vec::new();
        for (kind, (name, (deviation, spacing), seen)) in kinds.into_iter().enumerate() {
            if !seen || !drive.column(name).is_empty() {
                continue;
            }
            // Rows of the log and sample rows of each hat; a hat that no sample sees is none.
            let spans: Vec<Span> = Span::all(problem, &way, spacing);
            let colours = coloured(&spans);
            let found = parallel::map(problem.threads(), colours.len(), |k| {
                let mut column = vec![0.0; way.len()];
                colours[k].iter().for_each(|&span| spans[span].raise(&way, STRIDE * deviation, &mut column));
                let gap = problem.residual_on(&neutral, name, column)?;
                let hat = |&span: &usize| {
                    let rows = spans[span].samples.clone();
                    let values = problem.blocks.iter().flat_map(|(_, block)| {
                        let (here, gap) =
                            (&here[block.clone()][rows.clone()], &gap[block.clone()][rows.clone()]);
                        here.iter().zip(gap).map(|(here, gap)| (here - gap) / STRIDE)
                    });
                    Hat { kind, values: values.collect(), rows: rows.clone() }
                };
                Some(colours[k].iter().map(hat).collect::<Vec<_>>())
            });
            let found: Vec<Hat> = found.into_iter().flatten().flatten().collect();
            let of_mean = [OF_CROWN, OF_CLIMB][kind];
            hats.extend(Hat::mean(&found, of_mean, (problem.blocks.len(), problem.rows.len())));
            hats.extend(found);
        }
        let is_sound = hats.iter().all(|hat| hat.values.iter().all(|value| value.is_finite()));
        let blocks = problem.blocks.iter().map(|(_, block)| block.start).collect();
        (is_sound && !hats.is_empty()).then_some(Self { hats, blocks })
    }

    /// `B' a`.
    fn seen(&self, gap: &[f64]) -> DVector<f64> {
        let of = |hat: &Hat| {
            let count = hat.rows.len();
            let block = |(block, from): (usize, &usize)| -> f64 {
                let gap = &gap[from + hat.rows.start..from + hat.rows.end];
                gap.iter().zip(&hat.values[block * count..]).map(|(gap, value)| gap * value).sum()
            };
            self.blocks.iter().enumerate().map(block).sum::<f64>()
        };
        DVector::from_iterator(self.hats.len(), self.hats.iter().map(of))
    }

    /// `B c`.
    fn of_heights(&self, heights: &DVector<f64>, rows: usize) -> Vec<f64> {
        let mut gap = vec![0.0; rows];
        for (hat, height) in self.hats.iter().zip(heights.iter()) {
            let count = hat.rows.len();
            for (block, from) in self.blocks.iter().enumerate() {
                let gap = &mut gap[from + hat.rows.start..from + hat.rows.end];
                let values = &hat.values[block * count..];
                gap.iter_mut().zip(values).for_each(|(gap, value)| *gap += height * value);
            }
        }
        gap
    }

    /// `B' W B`.
    fn gram(&self, each: &[f64]) -> DMatrix<f64> {
        let count = self.hats.len();
        let mut gram = DMatrix::zeros(count, count);
        for (k, a) in self.hats.iter().enumerate() {
            for (l, b) in self.hats.iter().enumerate().take(k + 1) {
                let (from, to) = (a.rows.start.max(b.rows.start), a.rows.end.min(b.rows.end));
                if from >= to {
                    continue;
                }
                let mut sum = 0.0;
                for (block, begin) in self.blocks.iter().enumerate() {
                    let of = |hat: &Hat| block * hat.rows.len() + from - hat.rows.start;
                    let (of_a, of_b) = (&a.values[of(a)..], &b.values[of(b)..]);
                    let weights = &each[begin + from..begin + to];
                    sum +=
                        weights.iter().zip(of_a.iter().zip(of_b)).map(|(w, (a, b))| w * a * b).sum::<f64>();
                }
                gram[(k, l)] = sum;
                gram[(l, k)] = sum;
            }
        }
        gram
    }

    /// The deviation of each hat's height on a road so rough.
    fn deviations(&self, roughness: Roughness) -> DVector<f64> {
        DVector::from_iterator(self.hats.len(), self.hats.iter().map(|hat| roughness[hat.kind]))
    }

    /// `1 + D B' W B D`.
    fn normal(gram: &DMatrix<f64>, deviations: &DVector<f64>) -> DMatrix<f64> {
        let count = gram.nrows();
        DMatrix::from_fn(count, count, |k, l| {
            deviations[k] * gram[(k, l)] * deviations[l] + if k == l { 1.0 } else { 0.0 }
        })
    }

    /// The roughness that maximises the likelihood of a gap with the additional weights `each`.
    #[must_use]
    pub fn roughness(&self, each: &[f64], gap: &[f64]) -> Roughness {
        let weighted: Vec<f64> = gap.iter().zip(each).map(|(gap, weight)| gap * weight).collect();
        let (gram, seen) = (self.gram(each), self.seen(&weighted));
        let of_kind = |kind: usize| {
            let has = self.hats.iter().any(|hat| hat.kind == kind);
            if has { &ROUGHNESS[..] } else { &ROUGHNESS[..1] }
        };
        let mut best = (f64::NEG_INFINITY, KNOWN);
        for &bank in of_kind(0) {
            for &grade in of_kind(1) {
                // A bank's mean is as large as its variation, and is counted with it. A climb tells nothing of a grade's.
                let deviations = self.deviations([bank, grade, 0.0, ANY]);
                let Some(factor) = Self::normal(&gram, &deviations).cholesky() else { continue };
                let seen = seen.component_mul(&deviations);
                let narrower: f64 = factor.l_dirty().diagonal().iter().map(|it| it.ln()).sum();
                let likelihood = 0.5 * seen.dot(&factor.solve(&seen)) - narrower;
                if likelihood > best.0 {
                    best = (likelihood, [bank, grade, bank, 0.0]);
                }
            }
        }
        best.1
    }
}

/// A hat: its middle along the way and its half width, m, and the samples of its response in the replay.
struct Span {
    middle: f64,
    spacing: f64,
    samples: Range<usize>,
    /// Rows of the log, from the first that is raised on.
    first: usize,
    end: usize,
}

impl Span {
    fn all<V: ReplayVehicle>(problem: &Problem<V>, way: &[f64], spacing: f64) -> Vec<Self> {
        let drive = problem.drive;
        let fading = (FADED * LEAK / drive.step).ceil() as usize;
        let length = way.last().copied().unwrap_or(0.0);
        let count = (length / spacing).ceil() as usize + 1;
        let span = |k: usize| {
            let middle = k as f64 * spacing;
            let first = way.partition_point(|s| *s <= middle - spacing);
            let end = way.partition_point(|s| *s < middle + spacing) + fading;
            let from = problem.rows.partition_point(|row| row + 1 < first);
            let to = problem.rows.partition_point(|row| *row < end);
            (from < to).then_some(Self { middle, spacing, samples: from..to, first, end })
        };
        (0..count).filter_map(span).collect()
    }

    /// Raises a column by the hat.
    fn raise(&self, way: &[f64], by: f64, column: &mut [f64]) {
        let rows = way.iter().zip(column).skip(self.first);
        for (s, value) in rows.take_while(|(s, _)| **s < self.middle + self.spacing) {
            *value += by * (1.0 - (s - self.middle).abs() / self.spacing).max(0.0);
        }
    }
}

/// Hats that one replay can serve together: none begins before the response of another has faded.
fn coloured(spans: &[Span]) -> Vec<Vec<usize>> {
    let mut colours: Vec<Vec<usize>> = Vec::new();
    for (place, span) in spans.iter().enumerate() {
        let free = |colour: &&mut Vec<usize>| colour.last().is_none_or(|&last| spans[last].end <= span.first);
        match colours.iter_mut().find(free) {
            Some(colour) => colour.push(place),
            None => colours.push(vec![place]),
        }
    }
    colours
}

/// Way driven at each row, m.
fn way(vx: &[f64], step: f64) -> Vec<f64> {
    let mut driven = 0.0;
    let mut way = Vec::with_capacity(vx.len());
    for vx in vx {
        way.push(driven);
        driven += step * if vx.is_finite() { vx.abs() } else { 0.0 };
    }
    way
}

/// Weights of a gap: each sample by itself, less the possible response to the road.
pub struct SampleWeights {
    each: Vec<f64>,
    road: Option<Road>,
}

/// A road of this roughness.
struct Road {
    profile: Arc<Profile>,
    roughness: Roughness,
    deviations: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl SampleWeights {
    /// Weights of each sample, with a road profile marginalised.
    #[must_use]
    pub fn new(each: Vec<f64>, profile: Option<&Arc<Profile>>, roughness: Roughness) -> Self {
        let with = |profile: &Arc<Profile>| {
            let deviations = profile.deviations(roughness);
            let factor = Profile::normal(&profile.gram(&each), &deviations).cholesky()?;
            Some(Road { profile: profile.clone(), roughness, deviations, factor })
        };
        let is_rough = roughness.iter().any(|share| *share > 0.0);
        Self { road: profile.filter(|_| is_rough).and_then(with), each }
    }

    /// The same with so many times the weight.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        self.with_each(self.each.iter().map(|weight| factor * weight))
    }

    /// The same without some samples.
    #[must_use]
    pub fn without(&self, left_out: impl Fn(usize) -> bool) -> Self {
        self.with_each(self.each.iter().enumerate().map(|(i, w)| if left_out(i) { 0.0 } else { *w }))
    }

    fn with_each(&self, each: impl Iterator<Item = f64>) -> Self {
        let (profile, roughness) =
            self.road.as_ref().map_or((None, KNOWN), |road| (Some(&road.profile), road.roughness));
        Self::new(each.collect(), profile, roughness)
    }

    /// `(W^-1 + B B')^-1 a`.
    #[must_use]
    pub fn weighted(&self, gap: &[f64]) -> Vec<f64> {
        match self.road(gap) {
            None => self.of_each(gap.iter().copied()),
            Some(road) => self.of_each(gap.iter().zip(&road).map(|(gap, road)| gap - road)),
        }
    }

    fn of_each(&self, gap: impl Iterator<Item = f64>) -> Vec<f64> {
        gap.zip(&self.each).map(|(gap, weight)| gap * weight).collect()
    }

    /// Part of a gap that the likeliest road explains, `B (1 + B' W B)^-1 B' W a`.
    fn road(&self, gap: &[f64]) -> Option<Vec<f64>> {
        let Road { profile, deviations, factor, .. } = self.road.as_ref()?;
        let seen = profile.seen(&self.of_each(gap.iter().copied())).component_mul(deviations);
        Some(profile.of_heights(&factor.solve(&seen).component_mul(deviations), gap.len()))
    }

    /// Part of a gap that the likeliest road leaves.
    #[must_use]
    pub fn rest(&self, gap: &[f64]) -> Vec<f64> {
        let road = self.road(gap).unwrap_or_else(|| vec![0.0; gap.len()]);
        gap.iter().zip(&road).map(|(gap, road)| gap - road).collect()
    }
}

impl From<Vec<f64>> for SampleWeights {
    fn from(each: Vec<f64>) -> Self {
        Self::new(each, None, KNOWN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two channels of 40 samples, three hats that overlap.
    fn profile() -> Profile {
        let hat = |from: usize, size: f64| {
            let rows = from..from + 15;
            let values = (0..30).map(|i| size * f64::from(i % 7 - 3) + 0.1 * f64::from(i));
            Hat { kind: 0, values: values.collect(), rows }
        };
        Profile { hats: vec![hat(0, 1.0), hat(10, -0.5), hat(20, 2.0)], blocks: vec![0, 40] }
    }

    #[test]
    fn what_a_road_may_do_has_its_variance() {
        let (profile, rows) = (Arc::new(profile()), 80);
        let each: Vec<f64> = (0..rows).map(|i| 0.5 + 0.01 * f64::from(i)).collect();
        let dense = DMatrix::from_columns(
            &(0..3)
                .map(|k| {
                    let mut heights = DVector::zeros(3);
                    heights[k] = 1.0;
                    DVector::from_vec(profile.of_heights(&heights, rows as usize))
                })
                .collect::<Vec<_>>(),
        );
        let covariance = DMatrix::from_diagonal(&DVector::from_iterator(80, each.iter().map(|w| 1.0 / w)))
            + &dense * dense.transpose();
        let gap: Vec<f64> = (0..rows).map(|i| f64::from(i * 7 % 11) - 4.0).collect();
        let expected = covariance.cholesky().unwrap().solve(&DVector::from_vec(gap.clone()));
        let weights = SampleWeights::new(each.clone(), Some(&profile), ORDINARY);
        for (found, expected) in weights.weighted(&gap).iter().zip(expected.iter()) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        // A road of a few deviations leaves little of itself.
        let road = profile.of_heights(&DVector::from_vec(vec![2.0, -1.0, 1.0]), rows as usize);
        let left = weights.rest(&road).iter().map(|x| x * x).sum::<f64>();
        assert!(left < 0.01 * road.iter().map(|x| x * x).sum::<f64>(), "{left}");
        // A road is told from none, and a rough one from one that is not.
        let rough = |times: f64| {
            let gap: Vec<f64> =
                road.iter().zip(&gap).map(|(road, noise)| times * road + 0.01 * noise).collect();
            profile.roughness(&each, &gap)[0]
        };
        assert!(rough(1.5) >= 1.0 && rough(0.0) == 0.0 && rough(0.1) < 0.5, "{} {}", rough(1.5), rough(0.1));
    }

    #[test]
    fn the_mean_of_a_road_that_varies_is_the_roads_and_that_of_an_even_one_is_not() {
        let mut with_mean = profile();
        let mean = Hat::mean(&with_mean.hats, OF_CROWN, (2, 40)).unwrap();
        let steady = with_mean.of_heights(&DVector::from_element(3, 3.0), 80);
        assert!(steady.iter().zip(&mean.values).all(|(all, mean)| (all - 3.0 * mean).abs() < 1e-12));
        with_mean.hats.insert(0, mean);
        let with_mean = Arc::new(with_mean);
        let each = vec![1.0; 80];
        let cost = |roughness: Roughness| {
            let weights = SampleWeights::new(each.clone(), Some(&with_mean), roughness);
            weights.weighted(&steady).iter().zip(&steady).map(|(weighted, gap)| weighted * gap).sum::<f64>()
        };
        let [even, about_none, about_a_mean] = [KNOWN, ORDINARY, [1.0, 0.0, 1.0, 0.0]].map(cost);
        // Three hats, each three deviations high: 27; a mean of three deviations: 9 at most.
        assert!(even > 100.0 && (20.0..27.0).contains(&about_none), "{even} {about_none}");
        assert!(about_a_mean < 9.0, "{about_a_mean}");
        // What is steady does not make a road rough about its mean: both are of one size.
        let [bank, _, mean, _] = with_mean.roughness(&each, &steady);
        assert_eq!(bank, mean);
    }

    #[test]
    fn a_steady_climb_makes_no_road_rough_and_crests_do() {
        let mut of_grade = profile();
        of_grade.hats.iter_mut().for_each(|hat| hat.kind = 1);
        let mean = Hat::mean(&of_grade.hats, OF_CLIMB, (2, 40)).unwrap();
        of_grade.hats.insert(0, mean);
        let noise = |i: usize| 0.1 * (f64::from(u32::try_from(i * 7 % 11).unwrap()) - 5.0);
        let rough = |heights: [f64; 3]| {
            let road = of_grade.of_heights(&DVector::from_vec([[0.0].as_slice(), &heights].concat()), 80);
            let gap: Vec<f64> = road.iter().enumerate().map(|(i, road)| road + noise(i)).collect();
            of_grade.roughness(&vec![100.0; 80], &gap)
        };
        assert!(rough([1.0, 1.0, 1.0])[1] <= 0.1, "{:?}", rough([1.0, 1.0, 1.0]));
        let crests = rough([2.0, -1.0, 1.0]);
        // The mean of the crests is one of them: none of its own is left in the weights.
        assert!(crests[1] >= 0.5 && crests[OF_CLIMB] == 0.0, "{crests:?}");
    }
}
