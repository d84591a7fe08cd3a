//! A map's road has points where it bends and none on its straights: it is driven as it is. Rows lost in a bend are refused.

use rfl_mpc::path::{Closure, Path, PathError, PathOptions, Sample};

/// A road of straights and arcs: the points of its arcs, every so many metres, and the first and last point of all.
struct Map {
    points: Vec<Sample>,
    x: f64,
    y: f64,
    yaw: f64,
}

impl Map {
    fn begin() -> Self {
        Self { points: vec![Sample::at(0.0, 0.0)], x: 0.0, y: 0.0, yaw: 0.0 }
    }

    fn straight(mut self, length: f64) -> Self {
        self.x += length * self.yaw.cos();
        self.y += length * self.yaw.sin();
        self.points.push(Sample::at(self.x, self.y));
        self
    }

    /// An arc of a radius in m, positive to the left, through an angle in rad.
    fn arc(mut self, radius: f64, angle: f64, spacing: f64) -> Self {
        let pieces = (radius.abs() * angle / spacing).ceil();
        let turn = angle.copysign(radius) / pieces;
        for _ in 0..pieces as usize {
            let chord = 2.0 * radius * (0.5 * turn).sin();
            self.x += chord * (self.yaw + 0.5 * turn).cos();
            self.y += chord * (self.yaw + 0.5 * turn).sin();
            self.yaw += turn;
            self.points.push(Sample::at(self.x, self.y));
        }
        self
    }

    fn path(self, closure: Closure) -> Result<Path, PathError> {
        Path::from_samples_with(self.points, &PathOptions { closure, ..PathOptions::default() })
    }
}

/// Largest distance of points from a path in m.
fn farthest(path: &Path, points: impl Iterator<Item = [f64; 2]>) -> f64 {
    points.map(|[x, y]| path.project(x, y, f64::NAN, None).e1.abs()).fold(0.0, f64::max)
}

#[test]
fn a_straight_of_two_points_beside_dense_bends_is_straight() {
    for (length, radius, spacing) in
        [(1500.0, 100.0, 5.0), (5000.0, -300.0, 10.0), (400.0, 60.0, 3.0), (80.0, 15.0, 1.0)]
    {
        let map = Map::begin()
            .straight(length)
            .arc(radius, 1.5, spacing)
            .straight(0.7 * length)
            .arc(-radius, 1.2, spacing);
        let path = map.path(Closure::Open).unwrap();
        let along = (0..=1000).map(|k| [length * f64::from(k) / 1000.0, 0.0]);
        let off = farthest(&path, along);
        assert!(off < 0.05, "{length} m beside {radius} m: {off:.3} m off");
        // The curve may swing a little at the ends of a bend, never on the straight.
        let middle = (1..100).map(|k| path.curvature(length * (0.1 + 0.8 * f64::from(k) / 100.0)).abs());
        assert!(middle.fold(0.0, f64::max) < 1e-4);
        let mut said = path.notes().iter().filter(|note| note.text.contains("a straight"));
        assert!(said.clone().count() >= 2 && said.all(|note| !note.warning), "{:?}", path.notes());
    }
}

#[test]
fn a_lap_may_have_its_straight_at_the_seam() {
    let half = std::f64::consts::PI;
    let map = Map::begin().arc(50.0, half, 4.0).straight(600.0).arc(50.0, half, 4.0);
    let path = map.path(Closure::Closed).unwrap();
    assert!((path.length() - 2.0 * (600.0 + 50.0 * half)).abs() < 1.0, "{} m", path.length());
    assert!(farthest(&path, (0..100).map(|k| [-6.0 * f64::from(k), 0.0])) < 0.05);
}

#[test]
fn what_stands_beside_the_points_goes_on_between_them() {
    let mut map = Map::begin().straight(900.0).arc(120.0, 1.0, 5.0);
    let last = map.points.len() - 1;
    for (i, point) in map.points.iter_mut().enumerate() {
        point.bank = Some(if i == 0 { 0.0 } else { 0.06 });
        point.friction = Some(if i == last { 0.5 } else { 1.0 });
    }
    let path = map.path(Closure::Open).unwrap();
    assert!((path.bank(450.0) - 0.03).abs() < 1e-3, "{}", path.bank(450.0));
    assert!((path.friction(450.0) - 1.0).abs() < 1e-6);
}

#[test]
fn rows_lost_in_a_bend_are_refused() {
    // The same length of 400 m is lost in bends of several radii.
    for radius in [150.0, 300.0, 1000.0, 3000.0] {
        let map = Map::begin().straight(200.0).arc(radius, 1600.0 / radius, 5.0);
        let mut points = map.points;
        points.drain(100..180);
        let error = Path::from_samples(points, Closure::Open).unwrap_err();
        assert!(matches!(error, PathError::Gap { .. }), "{radius} m: {error}");
    }
}
