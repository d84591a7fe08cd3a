//! Roads drawn exactly: a chain of segments whose curvature is linear in arc length (straights, arcs, clothoids).
//!
//! ```text
//!     curvature(u) = k0 + (k1 - k0) u / L,   yaw(u) = yaw0 + k0 u + (k1 - k0) u^2 / (2 L),   r' = (cos yaw, sin yaw)
//! ```
//!
//! Curvature and yaw are known in closed form; the position is an integral (Fresnel's), taken by Gauss-Legendre
//! quadrature to rounding.

use super::quadrature::integrate;
use super::sample::{RoadClass, Sample};
use crate::numerics::Random;
use std::f64::consts::TAU;

/// Place on a road, and heading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// East position in m.
    pub x: f64,
    /// North position in m.
    pub y: f64,
    /// Heading in rad, not wrapped.
    pub yaw: f64,
}

/// A stretch of road with linear curvature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Length in m.
    pub length: f64,
    /// Curvature at the start in 1/m.
    pub start_curvature: f64,
    /// Curvature at the end in 1/m.
    pub end_curvature: f64,
    /// Class of the road.
    pub class: RoadClass,
    /// Speed limit in m/s.
    pub speed: f64,
}

impl Segment {
    /// Curvature at `u` metres from the start, in 1/m.
    #[must_use]
    pub fn curvature(&self, u: f64) -> f64 {
        self.start_curvature + self.curvature_rate() * u
    }

    /// Change of curvature per arc length in 1/m2.
    #[must_use]
    pub fn curvature_rate(&self) -> f64 {
        if self.length > 0.0 { (self.end_curvature - self.start_curvature) / self.length } else { 0.0 }
    }

    /// The angle by which the road turns over the first `u` metres, in rad.
    #[must_use]
    pub fn turn(&self, u: f64) -> f64 {
        u * (self.start_curvature + 0.5 * self.curvature_rate() * u)
    }

    /// The pose `u` metres from the start.
    #[must_use]
    pub fn pose(&self, start: Pose, u: f64) -> Pose {
        if self.start_curvature == 0.0 && self.end_curvature == 0.0 {
            let (sin, cos) = start.yaw.sin_cos();
            return Pose { x: start.x + u * cos, y: start.y + u * sin, yaw: start.yaw };
        }
        let parts = u.ceil().max(1.0) as usize;
        let width = u / parts as f64;
        let (mut x, mut y) = (start.x, start.y);
        for part in 0..parts {
            let tangent = |u: f64| {
                let (sin, cos) = (start.yaw + self.turn(u)).sin_cos();
                [cos, sin]
            };
            let [dx, dy] = integrate(part as f64 * width, (part + 1) as f64 * width, tangent);
            (x, y) = (x + dx, y + dy);
        }
        Pose { x, y, yaw: start.yaw + self.turn(u) }
    }
}

/// An uneven stretch: bank, grade, friction and driven speed vary along it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rough {
    /// Station of its start in m.
    pub from: f64,
    /// Station of its end in m.
    pub to: f64,
    /// Seed of its waves.
    pub seed: u64,
}

/// Steepest bank and grade of an uneven stretch in rad (5 %).
const STEEPEST: f64 = 0.05;
/// Length over which an uneven stretch begins and ends in m.
const RAMP: f64 = 10.0;

impl Rough {
    /// Bank, grade, friction and speed at a station inside.
    fn surface(&self, station: f64) -> [f64; 4] {
        let u = station - self.from;
        let ramp = (u.min(self.to - station) / RAMP).clamp(0.0, 1.0);
        let ramp = ramp * ramp * (3.0 - 2.0 * ramp);
        let mut random = Random::new(self.seed);
        // Each quantity: three waves, their amplitudes summing to one.
        let mut waves = |lengths: [f64; 3]| {
            [0.5, 0.3, 0.2]
                .iter()
                .zip(lengths)
                .map(|(amplitude, length)| {
                    let length = length * random.between(0.85, 1.15);
                    amplitude * (TAU * (u / length + random.between(0.0, 1.0))).sin()
                })
                .sum::<f64>()
        };
        let bank = STEEPEST * waves([60.0, 23.0, 9.0]);
        let grade = STEEPEST * waves([90.0, 37.0, 14.0]);
        let friction = 0.55 + 0.05 * waves([40.0, 15.0, 6.0]);
        let speed = (20.0 + 5.0 * waves([120.0, 70.0, 50.0])) / 3.6;
        [ramp * bank, ramp * grade, 1.0 + ramp * (friction - 1.0), speed]
    }
}

/// A course: segments from a start pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// Pose of the start.
    pub start: Pose,
    /// The road.
    pub segments: Vec<Segment>,
    /// Uneven stretches, in order, disjoint.
    pub rough: Vec<Rough>,
    /// True if the end is the start.
    pub closed: bool,
}

impl Course {
    /// Length in m.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.segments.iter().map(|segment| segment.length).sum()
    }

    /// Pose at the end.
    #[must_use]
    pub fn end(&self) -> Pose {
        self.segments.iter().fold(self.start, |pose, segment| segment.pose(pose, segment.length))
    }

    /// Pose and curvature at a station in m, in closed form.
    #[must_use]
    pub fn at(&self, station: f64) -> (Pose, f64) {
        let mut pose = self.start;
        let mut rest = station.max(0.0);
        let last = self.segments.len().saturating_sub(1);
        for (i, segment) in self.segments.iter().enumerate() {
            if rest <= segment.length || i == last {
                let u = rest.min(segment.length);
                return (segment.pose(pose, u), segment.curvature(u));
            }
            rest -= segment.length;
            pose = segment.pose(pose, segment.length);
        }
        (pose, 0.0)
    }

    /// The course as points, each segment in equal steps of at most `spacing` m, so that every change of its
    /// curvature's slope is a point. A closed course's last point comes a step before its first.
    #[must_use]
    pub fn samples(&self, spacing: f64) -> Vec<Sample> {
        let mut samples = Vec::new();
        let mut pose = self.start;
        let mut station = 0.0;
        for segment in &self.segments {
            let steps = (segment.length / spacing).ceil().max(1.0) as usize;
            for step in 0..steps {
                let u = segment.length * step as f64 / steps as f64;
                samples.push(self.sample(segment.pose(pose, u), segment, u, station + u));
            }
            pose = segment.pose(pose, segment.length);
            station += segment.length;
        }
        if let (false, Some(last)) = (self.closed, self.segments.last()) {
            samples.push(self.sample(pose, last, last.length, station));
        }
        samples
    }

    fn sample(&self, pose: Pose, segment: &Segment, u: f64, station: f64) -> Sample {
        let mut sample = Sample {
            yaw: Some(pose.yaw),
            curvature: Some(segment.curvature(u)),
            speed: Some(segment.speed),
            class: Some(segment.class),
            ..Sample::at(pose.x, pose.y)
        };
        if !self.rough.is_empty() {
            let inside = self.rough.iter().find(|rough| (rough.from..rough.to).contains(&station));
            let [bank, grade, friction, speed] =
                inside.map_or([0.0, 0.0, 1.0, f64::INFINITY], |rough| rough.surface(station));
            (sample.bank, sample.grade, sample.friction) = (Some(bank), Some(grade), Some(friction));
            sample.speed = Some(segment.speed.min(speed));
        }
        sample
    }
}
