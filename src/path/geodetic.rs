//! Latitude and longitude to metres: the plane that touches the earth at the road's first point.
//!
//! The ellipsoid's (WGS 84) radius of curvature across the meridian is `N = a / sqrt(1 - e^2 sin^2 lat)`. A point
//! stands in space at `[N cos lat cos lon, N cos lat sin lon, N (1 - e^2) sin lat]`; east and north of it, seen from
//! the origin, are `x` and `y`. Lengths on the plane are too short by `d^3 / 6 R^2`: 4 mm in 10 km.

/// Semi-major axis of WGS 84, m.
const A: f64 = 6_378_137.0;
/// Its first eccentricity, squared.
const E2: f64 = 6.694_379_990_14e-3;
/// A degree of latitude, m.
pub(super) const DEGREE: f64 = 111_195.0;

/// The plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct TangentPlane {
    origin: [f64; 3],
    east: [f64; 3],
    north: [f64; 3],
}

/// A point of the ellipsoid in space, m.
fn in_space(latitude: f64, longitude: f64) -> [f64; 3] {
    let (sin, cos) = latitude.sin_cos();
    let across = A / (1.0 - E2 * sin * sin).sqrt();
    [across * cos * longitude.cos(), across * cos * longitude.sin(), across * (1.0 - E2) * sin]
}

impl TangentPlane {
    /// At a point, rad.
    pub fn at(latitude: f64, longitude: f64) -> Self {
        let ((sin, cos), (sin_lon, cos_lon)) = (latitude.sin_cos(), longitude.sin_cos());
        Self {
            origin: in_space(latitude, longitude),
            east: [-sin_lon, cos_lon, 0.0],
            north: [-sin * cos_lon, -sin * sin_lon, cos],
        }
    }

    /// East and north of the origin, m.
    pub fn local(&self, latitude: f64, longitude: f64) -> [f64; 2] {
        let point = in_space(latitude, longitude);
        let along = |axis: &[f64; 3]| (0..3).map(|i| axis[i] * (point[i] - self.origin[i])).sum();
        [along(&self.east), along(&self.north)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arcs_of_meridian_and_parallel_have_their_lengths() {
        // WGS 84 at 45 degrees: 1852.3 m a minute of latitude, 1314.2 m a minute of longitude (parallel N cos lat).
        let (latitude, minute) = (std::f64::consts::FRAC_PI_4, 1f64.to_radians() / 60.0);
        let plane = TangentPlane::at(latitude, 0.2);
        let [x, y] = plane.local(latitude + minute, 0.2);
        assert!(x.abs() < 1e-6 && (y - 1852.26).abs() < 0.3, "{x} {y}");
        let [x, y] = plane.local(latitude, 0.2 + minute);
        let across = A / (1.0 - E2 * 0.5_f64).sqrt() * 0.5_f64.sqrt();
        // The parallel bends away from the east axis.
        assert!((x - across * minute).abs() < 1e-3 && y > 0.0 && y < 0.3, "{x} {y}");
        assert_eq!(plane.local(latitude, 0.2), [0.0, 0.0]);
    }
}
