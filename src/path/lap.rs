//! Order of a road's rows by their stations: they rise, and start anew where a lap ends.
//!
//! The log of a closed road has stations that fall by about a lap's length at the lap's end, while the vehicle drives
//! on. One lap is the road: from the first row to the row, after the fall, that is as far as the first. The vehicle has driven
//! about as far as the stations fall by then, and is back where it began, or on its way there; else stations start anew for
//! another reason, such as files that were joined, or are wrong.

use super::spline::{Vector, distance};

/// Distance within which a station, and a point, is the one before in m.
const SAME: f64 = 1e-6;
/// Distance over the largest before it, at which a vehicle has still driven on from row to row.
const DRIVES_ON: f64 = 2.0;
/// Share of the stations' span that a lap's end falls by, and of the rise before it that the vehicle has driven.
const MOST: f64 = 0.5;
/// Distance between the lines of two laps, in m: roads are no wider, and receivers no worse.
const BESIDE: f64 = 15.0;

/// A row's station against those before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Progress {
    /// It rises.
    Rises,
    /// It falls as at the end of a lap.
    StartsAnew,
    /// It lies beyond the end of a whole lap.
    BeyondLap,
    /// It falls where none ends.
    Falls,
}

/// Stations row by row.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stations {
    /// The first station and its point.
    first: (f64, Vector),
    least: f64,
    /// The newest station and its point; none before the first.
    newest: Option<(f64, Vector)>,
    /// Largest step of the stations, and of the points.
    step: f64,
    way: f64,
    /// Way driven, m.
    driven: f64,
    anew: bool,
    beyond: bool,
}

impl Stations {
    /// The newest station.
    pub fn newest(&self) -> f64 {
        self.newest.map_or(f64::NAN, |(station, _)| station)
    }

    /// Takes a row's station and point. One that falls changes nothing.
    pub fn take(&mut self, station: f64, point: Vector) -> Progress {
        let Some((before, last)) = self.newest else {
            (self.first, self.least, self.newest) = ((station, point), station, Some((station, point)));
            return Progress::Rises;
        };
        if self.beyond {
            return Progress::BeyondLap;
        }
        let (rise, way) = (station - before, distance(last, point));
        let stands = rise.abs() <= SAME && way <= SAME;
        if rise <= 0.0 && !stands {
            let ends = -rise > MOST * (before - self.least) && station <= self.least + self.step;
            let (first, begin) = self.first;
            let left = (first - station).abs() + DRIVES_ON * self.way + BESIDE;
            let is_back = self.driven > MOST * (before - first) && distance(point, begin) <= left;
            if self.anew || !ends || !is_back || way > DRIVES_ON * self.way {
                return Progress::Falls;
            }
            self.anew = true;
        } else {
            (self.step, self.way) = (self.step.max(rise), self.way.max(way));
        }
        self.driven += way;
        let falls = rise < 0.0 && !stands;
        self.least = self.least.min(station);
        self.newest = Some((station, point));
        self.beyond = self.anew && station >= self.first.0;
        match (self.beyond, falls) {
            (true, _) => Progress::BeyondLap,
            (false, true) => Progress::StartsAnew,
            (false, false) => Progress::Rises,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What becomes of a circle of 100 m, from a station on, in steps of 1 m.
    fn around(from: u32, count: u32) -> Vec<Progress> {
        let mut stations = Stations::default();
        let point = |s: f64| [(s * 0.0628).cos() * 15.9, (s * 0.0628).sin() * 15.9];
        (from..from + count).map(|s| stations.take(f64::from(s % 100), point(f64::from(s)))).collect()
    }

    #[test]
    fn a_lap_ends_where_it_began() {
        use Progress::{BeyondLap, Rises, StartsAnew};
        assert!(around(0, 100).iter().all(|of| *of == Rises));
        let two = around(0, 250);
        assert!(two[..100].iter().all(|of| *of == Rises) && two[100..].iter().all(|of| *of == BeyondLap));
        let from_30 = around(30, 250);
        assert_eq!(from_30[70], StartsAnew);
        assert!(from_30[..100].iter().all(|of| *of != BeyondLap));
        assert!(from_30[100..].iter().all(|of| *of == BeyondLap));
    }

    #[test]
    fn rows_out_of_order_are_no_lap() {
        let of = |stations: &[f64]| {
            let mut order = Stations::default();
            stations.iter().map(|&s| order.take(s, [s, 0.0])).collect::<Vec<_>>()
        };
        assert_eq!(of(&[0.0, 1.0, 3.0, 2.0])[3], Progress::Falls);
        assert_eq!(of(&[0.0, 1.0, 2.0, 3.0, 0.5])[4], Progress::Falls);
        assert_eq!(of(&[5.0, 4.0])[1], Progress::Falls);
        // Files that were joined, and one wrong station: the points drive straight on.
        let on = |station: fn(u32) -> f64| {
            let mut order = Stations::default();
            (0..300).map(|i| order.take(station(i), [f64::from(i), 0.0])).collect::<Vec<_>>()
        };
        assert_eq!(on(|i| f64::from(i % 200))[200], Progress::Falls);
        assert_eq!(on(|i| if i == 100 { 500.0 } else { f64::from(i) })[101], Progress::Falls);
        // A vehicle that stands.
        assert_eq!(of(&[0.0, 1.0, 1.0, 2.0])[2], Progress::Rises);
    }
}
