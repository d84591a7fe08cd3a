//! Random roads: for search, tuning and examination of controllers, each by a seed.
//!
//! An open road is a chain of straights, bends, S-bends and hairpins. A bend of radius `R` begins and ends with a clothoid,
//! so that the curvature is continuous; radii are spread evenly over their logarithm. A closed road is a circle whose
//! radius swings,
//!
//! ```text
//! r(t) = R (1 + sum_{k=2..6} a_k cos(k t + phase_k)),
//! ```
//!
//! as large as its tightest bend asks for. Roads of different seeds are different roads, whatever else is the same.

use super::segment::{Course, Pose, Segment};
use super::{Closure, Path, PathError, PathOptions, RoadClass, Sample, Smoothing};
use crate::numerics::Random;
use std::f64::consts::{PI, TAU};

/// A family of random roads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RandomRoad {
    /// Radius of the tightest bend that may be, m.
    pub tightest: f64,
    /// Length, m: an open road ends with the first element that reaches it, a closed one has about this length.
    pub length: f64,
    /// Longest straight, m.
    pub straight: f64,
    /// True if the road is closed.
    pub closed: bool,
}

/// Distance between points, m.
const SPACING: f64 = 1.0;
/// Length of the straight at a road's beginning, m.
const BEGINNING: f64 = 30.0;
/// Widest bend, in radii of the tightest.
const WIDEST: f64 = 10.0;
/// Longest arc of a bend, m.
const LONGEST_ARC: f64 = 120.0;
/// Heading from which on a road turns back, rad.
const TURNED: f64 = 1.3 * PI;
/// Number of closed roads that are drawn to find one of about the right length.
const DRAWS: usize = 60;

impl RandomRoad {
    /// An open road with hairpins of 12 m radius: for cars.
    pub const CAR: Self = Self { tightest: 12.0, length: 400.0, straight: 120.0, closed: false };
    /// An open road with hairpins of 30 m radius: for tractors with a semi-trailer.
    pub const TRUCK: Self = Self { tightest: 30.0, length: 600.0, straight: 150.0, closed: false };

    /// The road of a seed.
    ///
    /// # Errors
    /// Lengths that are not positive make no road.
    pub fn path(&self, seed: u64) -> Result<Path, PathError> {
        let closure = if self.closed { Closure::Closed } else { Closure::Open };
        let options = PathOptions { closure, smoothing: Smoothing::None, ..PathOptions::default() };
        Path::from_samples_with(self.samples(seed), &options)
    }

    /// Its points.
    #[must_use]
    pub fn samples(&self, seed: u64) -> Vec<Sample> {
        let mut random = Random::new(seed);
        // Seeds that follow one another begin alike.
        random.bits();
        if self.closed { self.ring(&mut random) } else { self.chain(&mut random) }
    }

    /// A chain of straights and bends.
    fn chain(&self, random: &mut Random) -> Vec<Sample> {
        let mut road = OpenRoad { segments: vec![], yaw: 0.0, length: 0.0 };
        road.straight(BEGINNING);
        while road.length < self.length {
            let kind = random.between(0.0, 1.0);
            let side = road.side(random);
            let bend = |random: &mut Random| {
                let radius = self.tightest * WIDEST.powf(random.between(0.0, 1.0));
                let angle = random.between(0.25, 1.8).min(LONGEST_ARC / radius);
                (radius, angle)
            };
            if kind < 0.25 {
                road.straight(random.between(15.0, self.straight));
            } else if kind < 0.4 {
                let radius = self.tightest * random.between(1.0, 1.3);
                road.bend(side * radius, random.between(2.6, 3.2), random);
            } else if kind < 0.6 {
                let (radius, angle) = bend(random);
                road.bend(side * radius, angle, random);
                let (radius, _) = bend(random);
                road.bend(-side * radius, angle.min(LONGEST_ARC / radius), random);
            } else {
                let (radius, angle) = bend(random);
                road.bend(side * radius, angle, random);
            }
        }
        let start = Pose { x: 0.0, y: 0.0, yaw: 0.0 };
        let course = Course { start, segments: road.segments, rough: vec![], closed: false };
        let plain = |sample: Sample| Sample { speed: None, class: None, ..sample };
        course.samples(SPACING).into_iter().map(plain).collect()
    }

    /// A ring whose radius swings.
    fn ring(&self, random: &mut Random) -> Vec<Sample> {
        let mut best: Option<(f64, Ring, f64)> = None;
        for _ in 0..DRAWS {
            let swing = random.between(0.1, 0.9);
            let waves = std::array::from_fn(|i| {
                let k = i + 2;
                (swing * random.between(0.0, 0.8) / k as f64, random.between(0.0, TAU))
            });
            let ring = Ring { waves };
            let radius = self.tightest * random.between(1.0, 1.5) * ring.sharpest();
            let off = (radius * ring.length() / self.length).ln().abs();
            if best.as_ref().is_none_or(|(least, ..)| off < *least) {
                best = Some((off, ring, radius));
            }
        }
        let Some((_, ring, radius)) = best else { return vec![] };
        let count = (radius * ring.length() / SPACING).ceil().max(8.0);
        let turn = if random.between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        (0..count as usize)
            .map(|i| {
                let [x, y] = ring.at(TAU * i as f64 / count);
                Sample::at(radius * x, turn * radius * y)
            })
            .collect()
    }
}

/// An open road as it grows.
struct OpenRoad {
    segments: Vec<Segment>,
    yaw: f64,
    length: f64,
}

impl OpenRoad {
    fn segment(&mut self, length: f64, start_curvature: f64, end_curvature: f64) {
        let class = RoadClass::Straight;
        let segment = Segment { length, start_curvature, end_curvature, class, speed: f64::INFINITY };
        self.yaw += segment.turn(length);
        self.length += length;
        self.segments.push(segment);
    }

    fn straight(&mut self, length: f64) {
        self.segment(length, 0.0, 0.0);
    }

    /// A bend by an angle, its radius positive to the left: clothoid, arc, clothoid.
    fn bend(&mut self, radius: f64, angle: f64, random: &mut Random) {
        let curvature = radius.recip();
        let whole = angle * radius.abs();
        // The two clothoids together turn by `clothoid / radius`.
        let clothoid = (random.between(0.3, 0.9) * radius.abs()).clamp(4.0, 40.0).min(0.8 * whole);
        self.segment(clothoid, 0.0, curvature);
        self.segment(whole - clothoid, curvature, curvature);
        self.segment(clothoid, curvature, 0.0);
    }

    /// Side of the next bend: either, but a road that has turned far turns back.
    fn side(&self, random: &mut Random) -> f64 {
        let drawn = if random.between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        if self.yaw.abs() > TURNED { -self.yaw.signum() } else { drawn }
    }
}

/// A ring of mean radius 1: amplitudes and phases of its waves, two to the round and more.
struct Ring {
    waves: [(f64, f64); 5],
}

impl Ring {
    /// Radius and its first two derivatives by the angle.
    fn radius(&self, angle: f64) -> [f64; 3] {
        self.waves.iter().zip(2..).fold([1.0, 0.0, 0.0], |[r, first, second], (&(a, phase), k)| {
            let k = f64::from(k);
            let (sin, cos) = (k * angle + phase).sin_cos();
            [r + a * cos, first - a * k * sin, second - a * k * k * cos]
        })
    }

    fn at(&self, angle: f64) -> [f64; 2] {
        let [r, ..] = self.radius(angle);
        let (sin, cos) = angle.sin_cos();
        [r * cos, r * sin]
    }

    fn angles() -> impl Iterator<Item = f64> {
        (0..720).map(|i| TAU * f64::from(i) / 720.0)
    }

    /// Largest curvature.
    fn sharpest(&self) -> f64 {
        let curvature = |angle| {
            let [r, first, second] = self.radius(angle);
            (r * r + 2.0 * first * first - r * second).abs() / (r * r + first * first).powf(1.5)
        };
        Self::angles().map(curvature).fold(0.0, f64::max)
    }

    fn length(&self) -> f64 {
        let speed = |angle| {
            let [r, first, _] = self.radius(angle);
            r.hypot(first)
        };
        Self::angles().map(speed).sum::<f64>() * TAU / 720.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roads_keep_to_their_family() {
        for closed in [false, true] {
            for family in [RandomRoad::CAR, RandomRoad::TRUCK] {
                let family = RandomRoad { closed, ..family };
                for seed in 0..20 {
                    let road = family.path(seed).unwrap();
                    assert_eq!(road.is_periodic(), closed);
                    let stations = (0..road.length() as usize).map(|s| s as f64);
                    let sharpest = stations.map(|s| road.curvature(s).abs()).fold(0.0, f64::max);
                    assert!(sharpest < 1.03 / family.tightest, "{family:?} {seed}: {}", 1.0 / sharpest);
                    let longest = if closed { 3.0 } else { 2.0 };
                    let share = road.length() / family.length;
                    assert!(share > 1.0 / longest && share < longest, "{family:?} {seed}: {}", road.length());
                }
            }
        }
        assert_eq!(RandomRoad::CAR.samples(3), RandomRoad::CAR.samples(3));
        assert_ne!(RandomRoad::CAR.samples(3), RandomRoad::CAR.samples(4));
    }

    #[test]
    fn roads_turn_to_both_sides() {
        let (mut left, mut right) = (0, 0);
        for seed in 0..10 {
            let road = RandomRoad::CAR.path(seed).unwrap();
            for s in 0..road.length() as usize {
                let curvature = road.curvature(s as f64);
                left += usize::from(curvature > 0.02);
                right += usize::from(curvature < -0.02);
            }
        }
        assert!(left > 300 && right > 300, "{left} {right}");
    }
}
