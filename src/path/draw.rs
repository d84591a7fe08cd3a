//! The curve of a road whose points are checked: from their headings, near them, or through them.

use super::accuracy::Accuracy;
use super::error::{InputPlace, PathError};
use super::noise::{ABOUT, PointNoise, SLIGHT, curvature_error, rounding_error};
use super::note::Note;
use super::sample::{Sample, Smoothing};
use super::smooth::{Goal, smooth};
use super::spline::{Knot, QuinticSpline, Vector, distance, evaluate};
use super::sway::Sway;
use super::wrap_angle;
use crate::numerics::statistics::{MEDIAN_OF_NORMAL, median};

/// Largest disagreement of headings and curvatures with the points at which they still hold (rad).
const DISAGREEMENT: f64 = 0.02;
/// Tolerances of smoothing that are tried on a road that sways, m.
const TOLERANCES: [f64; 7] = [0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0];
/// Tightest bend of a road that noise leaves drivable in m.
const TIGHTEST: f64 = 2.0;

/// The points of a road that are fit to be drawn.
pub(super) struct Outline<'a> {
    samples: Vec<Sample>,
    /// Relative to the road's origin.
    points: Vec<Vector>,
    periodic: bool,
    /// Median, m.
    spacing: f64,
    noise: Option<&'a PointNoise>,
}

impl<'a> Outline<'a> {
    /// Points with their places in the file, of a median spacing in m, relative to the first of them.
    pub fn of(
        placed: &[(usize, Sample)],
        periodic: bool,
        spacing: f64,
        noise: Option<&'a PointNoise>,
    ) -> Self {
        let samples: Vec<Sample> = placed.iter().map(|(_, sample)| *sample).collect();
        let points =
            samples.iter().map(|sample| [sample.x - samples[0].x, sample.y - samples[0].y]).collect();
        Self { samples, points, periodic, spacing, noise }
    }

    /// The curve by the headings and curvatures of the points, if they hold.
    pub fn told(&self, smoothing: Smoothing, notes: &mut Vec<Note>) -> Option<QuinticSpline> {
        let pinned = !matches!(smoothing, Smoothing::Within(_));
        self.poses(notes).filter(|_| pinned)
    }

    /// The curve by the points alone, as near them as is asked for.
    ///
    /// # Errors
    /// Noise leaves bends that nobody drives.
    pub fn curve(
        &self,
        smoothing: Smoothing,
        accuracy: Accuracy,
        notes: &mut Vec<Note>,
    ) -> Result<QuinticSpline, PathError> {
        let near = self.goal(smoothing, accuracy).and_then(|goal| self.near(goal, notes));
        let is_near = near.is_some();
        let curve = near.unwrap_or_else(|| QuinticSpline::through(&self.points, self.periodic));
        let wobbles = wobble(&curve).filter(|_| !is_near).map(|error| {
            format!(
                "the curvature wobbles by {error:.4} 1/m from point to point: the points look noisy; give a smoothing tolerance of about \
                 their noise"
            )
        });
        notes.extend(wobbles.or_else(|| self.sways(&curve)).map(Note::warning));
        if let Some(noise) = self.noise {
            let tightest = tightest(&curve);
            if tightest * TIGHTEST > 1.0 && tightest < noise.bend(self.spacing) {
                return Err(noise.refusal(format!("has bends of {:.2} m radius", 1.0 / tightest)));
            }
        }
        Ok(curve)
    }

    /// The goal of smoothing with the words for its reason; none where the curve goes through the points.
    fn goal(&self, smoothing: Smoothing, accuracy: Accuracy) -> Option<(Goal, String)> {
        let (tolerance, why) = match (smoothing, accuracy) {
            (Smoothing::None, _) | (Smoothing::AsAccurate, Accuracy::Exact) => (None, ""),
            (Smoothing::Within(value), _) => (Some(value), ""),
            (Smoothing::AsAccurate, Accuracy::Rounded { digit, .. }) => {
                let of_digit = digit.and_then(|digit| rounding(digit, self.spacing));
                (of_digit, ", the rounding of the coordinates")
            }
            (Smoothing::AsAccurate, Accuracy::Measured(value)) => {
                (Some(value), ", the accuracy of racetrack-database")
            }
        };
        match self.noise {
            // Unless the file's own accuracy is about that of its points.
            Some(noise)
                if !matches!(smoothing, Smoothing::Within(_))
                    && tolerance.is_none_or(|known| noise.rms() > ABOUT * known) =>
            {
                let why = match noise.step {
                    Some(step) => format!(
                        ", for all coordinates are multiples of {} m (if that is no rounding: --smooth 0)",
                        (step * 1e6).round() / 1e6
                    ),
                    None => ", by their measured noise".to_owned(),
                };
                Some((Goal::Nearest(noise.rms()), why))
            }
            _ => tolerance.map(|tolerance| (Goal::Within(tolerance), why.to_owned())),
        }
    }

    /// The smooth curve near the points, if there is one.
    fn near(&self, (goal, why): (Goal, String), notes: &mut Vec<Note>) -> Option<QuinticSpline> {
        let points = &self.points;
        let along = self.noise.map(|noise| noise.means(points, self.periodic));
        let curve = smooth(points, along.as_deref(), self.periodic, goal)?;
        let at_marks = curve.at_marks();
        let distances = || at_marks.iter().zip(points).map(|(at, point)| distance(*at, *point));
        let farthest = 1e3 * distances().fold(0.0, f64::max);
        let rms = match goal {
            Goal::Within(tolerance) => tolerance,
            Goal::Nearest(_) => (distances().map(|d| d * d).sum::<f64>() / points.len() as f64).sqrt(),
        };
        notes.push(Note::info(format!(
            "smoothed: {:.1} mm RMS from the points{why}; {farthest:.1} mm at most",
            1e3 * rms
        )));
        Some(curve)
    }

    /// Words on a curve that sways, with the tolerance that takes it away.
    fn sways(&self, curve: &QuinticSpline) -> Option<String> {
        let sway = Sway::of(curve)?;
        if let Some((station, turn)) = sway.corner() {
            return Some(format!(
                "the road has a corner at station {station:.0} m, where it turns by {:.0} degrees within a few points: \
                 {sway}; round the corner to take that away",
                turn.to_degrees()
            ));
        }
        let steady = |tolerance: &&f64| {
            let smoother = smooth(&self.points, None, self.periodic, Goal::Within(**tolerance));
            smoother.is_some_and(|curve| Sway::is_none_in(&curve))
        };
        let advice = TOLERANCES.iter().find(steady).map_or_else(
            || "give better points".to_owned(),
            |tolerance| {
                format!("--smooth {tolerance} leaves none of it; look whether what it leaves is the road")
            },
        );
        Some(format!(
            "{sway}: no road does that, but points whose error lasts for some metres, as that of a receiver that drifts; {advice}"
        ))
    }

    /// The curve from heading and curvature, where the road has both and they fit its points.
    fn poses(&self, notes: &mut Vec<Note>) -> Option<QuinticSpline> {
        let (samples, points, periodic) = (&self.samples, &self.points, self.periodic);
        let column =
            |value: fn(&Sample) -> Option<f64>| samples.iter().map(value).collect::<Option<Vec<f64>>>();
        let (yaw, curvature) = match (column(|sample| sample.yaw), column(|sample| sample.curvature)) {
            (Some(yaw), Some(curvature)) => (yaw, curvature),
            (None, None)
                if samples.iter().all(|sample| sample.yaw.is_none() && sample.curvature.is_none()) =>
            {
                return None;
            }
            _ => {
                notes.push(Note::info("columns yaw and curvature are not used: every point must have both"));
                return None;
            }
        };
        let worst = worst_disagreement(points, &yaw, &curvature, periodic);
        if worst < DISAGREEMENT {
            return Some(QuinticSpline::through_poses(points, &yaw, &curvature, periodic));
        }
        notes.push(Note::info(format!(
            "columns yaw and curvature are not used: they disagree with the points by up to {worst:.3} rad between \
             neighbours"
        )));
        None
    }
}

impl PointNoise {
    /// The refusal of a road that noise has given a shape.
    pub(super) fn refusal(&self, shape: String) -> PathError {
        PathError::Noise { place: InputPlace::default(), rms: self.rms(), shape }
    }
}

/// Largest curvature at the knots in 1/m.
pub(super) fn tightest(curve: &QuinticSpline) -> f64 {
    curve.knots.iter().map(|knot| curvature(knot).abs()).fold(0.0, f64::max)
}

impl QuinticSpline {
    /// Largest curvature of a piece in 1/m, its knots and places between them.
    pub(super) fn tightest_in(&self, piece: usize) -> f64 {
        const PLACES: u32 = 4;
        let length = self.knots[piece + 1].t - self.knots[piece].t;
        let [x, y] = self.piece(piece);
        let places = (0..=PLACES).map(|k| {
            let u = length * f64::from(k) / f64::from(PLACES);
            let ([_, dx, ddx], [_, dy, ddy]) = (evaluate(&x, u), evaluate(&y, u));
            (dx * ddy - dy * ddx).abs() / dx.hypot(dy).max(1e-9).powi(3)
        });
        places.fold(0.0, f64::max)
    }
}

/// Curvature at a knot in 1/m.
pub(super) fn curvature(knot: &Knot) -> f64 {
    let speed = knot.d1[0].hypot(knot.d1[1]).max(1e-9);
    (knot.d1[0] * knot.d2[1] - knot.d1[1] * knot.d2[0]) / speed.powi(3)
}

/// RMS curvature error of an interpolating curve in 1/m, if it looks like noise: large, and of alternating sign.
fn wobble(curve: &QuinticSpline) -> Option<f64> {
    let seconds: Vec<f64> = curve
        .knots
        .windows(3)
        .map(|k| curvature(&k[0]) - 2.0 * curvature(&k[1]) + curvature(&k[2]))
        .collect();
    if seconds.len() < 20 {
        return None;
    }
    let count = seconds.len() as f64;
    // White noise has second differences of 6 times its variance, which change sign four times of five. By the median: where
    // a straight meets an arc, an exact road has a few large ones.
    let error =
        median(seconds.iter().map(|second| second.abs()).collect())? / (MEDIAN_OF_NORMAL * 6f64.sqrt());
    let changes = seconds.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count() as f64 / count;
    (error > 0.005 && changes > 0.65).then_some(error)
}

/// RMS distance by which rounding to `digit` moves points, if that matters at their spacing.
fn rounding(digit: f64, spacing: f64) -> Option<f64> {
    let sigma = rounding_error(digit);
    (curvature_error(sigma, spacing) > SLIGHT).then_some(sigma * 2f64.sqrt())
}

/// Largest error of headings and curvatures against the chords between neighbouring points, in rad.
fn worst_disagreement(points: &[Vector], yaw: &[f64], curvature: &[f64], periodic: bool) -> f64 {
    let n = points.len();
    let last = if periodic { n } else { n - 1 };
    (0..last).fold(0.0, |worst: f64, i| {
        let j = (i + 1) % n;
        let (a, b) = (points[i], points[j]);
        let turn = wrap_angle(yaw[j] - yaw[i]);
        let chord = distance(a, b);
        let half = 0.5 * turn;
        let arc = if half.abs() < 1e-6 { chord } else { chord * half / half.sin() };
        // Of a clothoid: turn = mean curvature * arc, and the chord's direction is the mean heading less
        // arc * (difference of curvature) / 12.
        let from_turn = (turn - 0.5 * arc * (curvature[i] + curvature[j])).abs();
        let chord_yaw = yaw[i] + half - arc * (curvature[j] - curvature[i]) / 12.0;
        let from_chord = wrap_angle((b[1] - a[1]).atan2(b[0] - a[0]) - chord_yaw).abs();
        worst.max(from_turn).max(from_chord)
    })
}
