//! Rows of a road's file, by station.

/// Stations of a road's points, and where the points stand in its file.
#[derive(Debug, Clone)]
pub(super) struct RoadRows {
    stations: Vec<f64>,
    places: Vec<usize>,
    /// Line of each place in the file, of a road that has one.
    lines: Option<Vec<u64>>,
}

impl RoadRows {
    pub fn new(stations: &[f64], places: &[usize], lines: Option<&[u64]>) -> Self {
        Self { stations: stations.into(), places: places.into(), lines: lines.map(<[u64]>::to_vec) }
    }

    /// The place of the point nearest to a station.
    pub fn at(&self, station: f64) -> u64 {
        let behind = self.stations.partition_point(|other| *other < station).min(self.stations.len() - 1);
        let before = behind.saturating_sub(1);
        let nearer = station - self.stations[before] < self.stations[behind] - station;
        let index = if nearer { before } else { behind };
        self.number(self.places[index % self.places.len()])
    }

    /// Line of a place, or its number from 1 on.
    pub fn number(&self, place: usize) -> u64 {
        let line = self.lines.as_ref().and_then(|lines| lines.get(place).copied());
        line.unwrap_or(place as u64 + 1)
    }

    /// A number in words.
    pub fn words(&self, number: u64) -> String {
        format!("{} {number}", if self.lines.is_some() { "line" } else { "point" })
    }
}
