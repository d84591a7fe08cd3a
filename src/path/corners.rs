//! Corners of a line of points, as a map has them, rounded for a vehicle.
//!
//! A curve through a corner is as tight as its points are near each other, and no vehicle drives it. Where the curve is tighter than
//! the vehicle's radius, and one point turns, or two in one direction, that is a corner; three and more are a bend that somebody
//! drew, and stay, unless they are so far apart that a vehicle drives each. Corners too near each other for a rounding each have one in
//! common ([`TwoArcs`]):
//!
//! ```text
//!     polyline --- a before the first corner --- arc, straight, arc --- a behind the last --- polyline,    the least a that there is
//! ```

use super::sample::Sample;
use super::segment::Pose;
use super::spline::{QuinticSpline, Vector, distance};
use super::straight::between;
use super::two_arcs::TwoArcs;
use super::{Note, Path, wrap_angle};

/// Least turn of a corner, rad.
const LEAST: f64 = 0.1;
/// Points that turn in one direction, each by this share of the most, and make a bend.
const BEND: usize = 3;
const SHARE: f64 = 0.5;
/// Way over which the curvature of a rounding grows, in radii, and distance of its points.
const WINDOW: f64 = 0.5;
const STEP: f64 = 1.0 / 16.0;
/// Farthest begin of a rounding before its corner, in radii.
const FARTHEST: f64 = 4.0;
/// Steps and halvings in the search for the nearest begin.
const STEPS: u32 = 32;
const HALVINGS: u32 = 40;

/// Corners of a road that were rounded for its vehicle: one, or some near each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoundedCorner {
    /// Line of its first point in the road's file; of a road without a file, the number of the point, from 1 on.
    pub row: u64,
    /// Number of corners that have one rounding.
    pub corners: usize,
    /// East position of the first corner in m.
    pub x: f64,
    /// North position of the first corner in m.
    pub y: f64,
    /// The angle by which the road turns in rad, positive to the left.
    pub turn: f64,
    /// Farthest of its corners from the rounded line in m.
    pub inside: f64,
}

/// Corners that the note names.
const NAMED: usize = 4;

impl Path {
    /// A note on the corners that were rounded.
    pub(super) fn rounded_corners(&self) -> Option<Note> {
        let corners = self.corners();
        let most = corners.iter().map(|corner| corner.inside).reduce(f64::max)?;
        let of = |corner: &RoundedCorner| {
            let RoundedCorner { row, corners, x, y, turn, inside } = *corner;
            let side = if turn > 0.0 { "left" } else { "right" };
            let one = match corners {
                1 => String::new(),
                count => format!(", {count} corners in one"),
            };
            format!(
                "{} ({x:.1}, {y:.1}) {:.0} degrees to the {side}{one}, {inside:.2} m inside",
                self.rows.words(row),
                turn.to_degrees().abs()
            )
        };
        let named: Vec<String> = corners.iter().take(NAMED).map(of).collect();
        let more = match corners.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!("; and {more} more, up to {most:.2} m inside"),
        };
        let number: usize = corners.iter().map(|corner| corner.corners).sum();
        Some(Note::info(format!(
            "{number} corner(s) that the vehicle cannot drive are rounded, and the rounded line is the path: {}{more}",
            named.join("; ")
        )))
    }
}

/// Points of a road with their places in the file.
pub(super) type Placed = (usize, Sample);

/// The points with each corner rounded, of which the drawn curve is tighter than a radius in m; `None` if there is no such one.
/// [`RoundedCorner::row`] is the point's place in the file yet.
pub(super) fn round(
    points: &[Placed],
    curve: &QuinticSpline,
    periodic: bool,
    radius: f64,
) -> Option<(Vec<Placed>, Vec<RoundedCorner>)> {
    let line = CornerLine::new(points, periodic)?;
    let roundings = line.roundings(&line.corners(curve, radius), radius);
    (!roundings.is_empty()).then(|| line.replaced(points, &roundings, radius))
}

/// The straight lines between points.
struct CornerLine {
    points: Vec<Vector>,
    /// Way up to each point in m; of a closed road up to the first again.
    ways: Vec<f64>,
    /// Heading of each chord in rad, not wrapped.
    yaws: Vec<f64>,
    periodic: bool,
}

/// A point that is a corner, and the way up to it in m.
type LineCorner = (usize, f64);

/// A rounding: its corners, and its way.
struct CornerRounding {
    corners: Vec<LineCorner>,
    from: f64,
    to: f64,
    way: TwoArcs,
}

impl CornerLine {
    /// `None` of too few points.
    fn new(samples: &[Placed], periodic: bool) -> Option<Self> {
        let points: Vec<Vector> = samples.iter().map(|(_, sample)| [sample.x, sample.y]).collect();
        let n = points.len();
        if n < 3 {
            return None;
        }
        let chords = if periodic { n } else { n - 1 };
        let (mut ways, mut yaws) = (vec![0.0], Vec::with_capacity(chords));
        for i in 0..chords {
            let (a, b) = (points[i], points[(i + 1) % n]);
            ways.push(ways[i] + distance(a, b));
            let yaw = (b[1] - a[1]).atan2(b[0] - a[0]);
            yaws.push(yaws.last().map_or(yaw, |before| before + wrap_angle(yaw - before)));
        }
        Some(Self { points, ways, yaws, periodic })
    }

    fn length(&self) -> f64 {
        self.ways[self.yaws.len()]
    }

    /// Turn at a point in rad; 0 at the ends of an open road.
    fn turn(&self, i: usize) -> f64 {
        let chords = self.yaws.len();
        if !self.periodic && (i == 0 || i >= chords) {
            return 0.0;
        }
        wrap_angle(self.yaws[i % chords] - self.yaws[(i + chords - 1) % chords])
    }

    /// Points at which the curve is tighter than the radius, and which are no part of a bend.
    fn corners(&self, curve: &QuinticSpline, radius: f64) -> Vec<usize> {
        let n = self.points.len();
        // Between knots, too: a corner may lie in the middle.
        let tight = |from: f64, to: f64| {
            let begin = curve.knots.partition_point(|knot| knot.t <= from).saturating_sub(1);
            let end = curve.knots.partition_point(|knot| knot.t < to).min(curve.pieces());
            (begin..end).any(|piece| curve.tightest_in(piece) * radius > 1.0)
        };
        let marks = &curve.marks;
        let beside = |i: usize| match i {
            0 => tight(marks[0], marks[1]) || tight(marks[n - 1], marks[n.min(marks.len() - 1)]),
            i => tight(marks[i - 1], marks[(i + 1).min(marks.len() - 1)]),
        };
        (0..n).filter(|&i| self.turn(i).abs() > LEAST && !self.is_in_bend(i, radius) && beside(i)).collect()
    }

    /// True of a point that turns as its neighbours do, so near them that they draw a bend of less than the radius.
    fn is_in_bend(&self, i: usize, radius: f64) -> bool {
        let n = self.points.len();
        let own = self.turn(i);
        let near = |chord: usize| {
            let chord = chord % n;
            chord < self.yaws.len() && self.ways[chord + 1] - self.ways[chord] < radius * own.abs()
        };
        let as_much = |k: usize| self.turn(k % n) * own.signum() >= SHARE * own.abs();
        let behind = (0..BEND).take_while(|k| near(i + k) && as_much(i + k + 1)).count();
        let before = (1..=BEND).take_while(|k| near(i + n - k) && as_much(i + n - k)).count();
        1 + before + behind >= BEND
    }

    /// The chord at a way of the first lap.
    fn chord(&self, way: f64) -> usize {
        self.ways[1..self.yaws.len()].partition_point(|end| *end <= way)
    }

    /// Pose of the line at a way; a closed road's goes on.
    fn pose(&self, way: f64) -> Pose {
        let chords = self.yaws.len();
        let laps = if self.periodic { (way / self.length()).floor() } else { 0.0 };
        let inside = way - laps * self.length();
        let i = self.chord(inside);
        let lap = self.yaws[chords - 1] + self.turn(0) - self.yaws[0];
        let yaw = self.yaws[i] + if laps == 0.0 { 0.0 } else { laps * lap };
        let (sin, cos) = self.yaws[i].sin_cos();
        let beyond = inside - self.ways[i];
        Pose { x: self.points[i][0] + beyond * cos, y: self.points[i][1] + beyond * sin, yaw }
    }

    /// Roundings of corners, none of which reaches into another.
    fn roundings(&self, corners: &[usize], radius: f64) -> Vec<CornerRounding> {
        let group = |corners: Vec<LineCorner>| (self.rounding(&corners, radius), corners);
        let mut groups: Vec<_> = corners.iter().map(|&i| group(vec![(i, self.ways[i])])).collect();
        let reach = |(rounding, corners): &(Option<CornerRounding>, Vec<LineCorner>)| match rounding {
            Some(found) => [found.from, found.to],
            None => self.needed(corners, radius),
        };
        let mut k = 0;
        while k < groups.len() {
            let next = (k + 1) % groups.len();
            let lap = if next == 0 { self.length() } else { 0.0 };
            let neighbours = next != k && (next > 0 || self.periodic);
            if neighbours && reach(&groups[k])[1] > reach(&groups[next])[0] + lap {
                let (_, more) = groups.remove(next);
                k -= usize::from(next < k);
                let (_, corners) = &groups[k];
                groups[k] = group(
                    corners.iter().copied().chain(more.iter().map(|(i, way)| (*i, way + lap))).collect(),
                );
                // It may reach into the one before.
                k = k.saturating_sub(1);
            } else {
                k += 1;
            }
        }
        groups.into_iter().filter_map(|(rounding, _)| rounding).collect()
    }

    /// Ways from and up to which roundings of the first and the last of some corners would need straight lines.
    fn needed(&self, corners: &[LineCorner], radius: f64) -> [f64; 2] {
        let end = |at: usize, side: f64| {
            let (i, way) = corners[at];
            way + side * radius * (0.5 * WINDOW + (0.5 * self.turn(i).abs()).tan())
        };
        [end(0, -1.0), end(corners.len() - 1, 1.0)]
    }

    /// The rounding of corners that begins nearest to them.
    fn rounding(&self, corners: &[LineCorner], radius: f64) -> Option<CornerRounding> {
        let (&(one, first), &(other, last)) = (corners.first()?, corners.last()?);
        let window = WINDOW * radius;
        let sides = [one, other].map(|i| self.turn(i).signum());
        let at = |before: f64| {
            let (from, to) = (first - before - 0.5 * window, last + before + 0.5 * window);
            let room =
                if self.periodic { to - from < self.length() } else { from >= 0.0 && to <= self.length() };
            let poses = room.then(|| [self.pose(from), self.pose(to)])?;
            let way = TwoArcs::between(poses, sides, poses[1].yaw - poses[0].yaw, radius, window)?;
            Some(CornerRounding { corners: corners.to_vec(), from, to, way })
        };
        let step = FARTHEST * radius / f64::from(STEPS);
        let (mut high, mut found) = (0..=STEPS).find_map(|k| {
            let before = f64::from(k) * step;
            at(before).map(|found| (before, found))
        })?;
        let mut low = (high - step).max(0.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            match at(middle) {
                Some(nearer) => (high, found) = (middle, nearer),
                None => low = middle,
            }
        }
        Some(found)
    }

    /// The points outside of roundings, and those of the roundings.
    fn replaced(
        &self,
        points: &[Placed],
        roundings: &[CornerRounding],
        radius: f64,
    ) -> (Vec<Placed>, Vec<RoundedCorner>) {
        let lap = if self.periodic { self.length() } else { f64::INFINITY };
        let wrapped = |way: f64| if self.periodic { way.rem_euclid(lap) } else { way };
        let step = STEP * radius;
        // No two points are much nearer than a step.
        let is_left = |way: f64| {
            let inside = |rounding: &CornerRounding| {
                let reach = rounding.from - 0.5 * step..rounding.to + 0.5 * step;
                [way - lap, way, way + lap].iter().any(|way| reach.contains(way))
            };
            !roundings.iter().any(inside)
        };
        let mut placed: Vec<(f64, Placed)> = self
            .ways
            .iter()
            .zip(points)
            .filter(|(way, _)| is_left(**way))
            .map(|(way, point)| (*way, *point))
            .collect();
        let mut corners = Vec::new();
        for rounding in roundings {
            let length = rounding.way.length();
            let steps = (length / step).ceil();
            let poses: Vec<Pose> = rounding.corners.iter().map(|corner| self.pose(corner.1)).collect();
            let mut inside = vec![f64::INFINITY; poses.len()];
            for k in 0..=steps as u32 {
                let share = f64::from(k) / steps;
                let [x, y] = rounding.way.at(share * length);
                let way = wrapped(rounding.from + share * (rounding.to - rounding.from));
                let (index, sample) = self.sample(points, way);
                placed.push((way, (index, Sample { x, y, ..sample })));
                for (least, at) in inside.iter_mut().zip(&poses) {
                    *least = least.min(distance([at.x, at.y], [x, y]));
                }
            }
            let (at, before) = (poses[0], self.pose(rounding.from));
            corners.push(RoundedCorner {
                row: points[rounding.corners[0].0].0 as u64,
                corners: rounding.corners.len(),
                x: at.x,
                y: at.y,
                turn: self.pose(rounding.to).yaw - before.yaw,
                inside: inside.into_iter().fold(0.0, f64::max),
            });
        }
        placed.sort_by(|a, b| a.0.total_cmp(&b.0));
        (placed.into_iter().map(|(_, point)| point).collect(), corners)
    }

    /// What the points say at a way, and the place in the file of the one before.
    fn sample(&self, points: &[Placed], way: f64) -> Placed {
        let i = self.chord(way);
        let (index, from) = points[i];
        let (_, to) = points[(i + 1) % points.len()];
        let share = (way - self.ways[i]) / (self.ways[i + 1] - self.ways[i]);
        (index, Sample { yaw: None, curvature: None, ..between(&from, &to, share.clamp(0.0, 1.0)) })
    }
}
