//! Bank, grade, friction and speed along a path.

use super::sample::Sample;

/// A station, resolved.
pub(super) struct Spot {
    pub cell: usize,
    pub offset: f64,
    pub lap: f64,
    /// Metres before the start (negative) or beyond the end of an open path.
    pub beyond: f64,
}

/// A quantity along the path, linear between the grid's nodes; empty where it is the default everywhere.
#[derive(Debug, Clone)]
pub(super) struct PathQuantity {
    pub default: f64,
    pub nodes: Vec<f64>,
}

impl PathQuantity {
    pub fn new(
        samples: &[Sample],
        knots: &[f64],
        default: f64,
        value: fn(&Sample) -> Option<f64>,
        stations: impl Iterator<Item = f64>,
    ) -> Self {
        if samples.iter().all(|sample| value(sample).is_none()) {
            return Self { default, nodes: Vec::new() };
        }
        // A closed road's last knot is its first sample.
        let at_knot = |i: usize| value(&samples[i % samples.len()]).unwrap_or(default);
        let mut i = 0;
        let nodes = stations
            .map(|s| {
                while i + 2 < knots.len() && s > knots[i + 1] {
                    i += 1;
                }
                let share = ((s - knots[i]) / (knots[i + 1] - knots[i])).clamp(0.0, 1.0);
                let (a, b) = (at_knot(i), at_knot(i + 1));
                // The end values exactly, and a known value where the other one is missing.
                if share == 0.0 || b.is_nan() {
                    a
                } else if share == 1.0 || a.is_nan() {
                    b
                } else {
                    a + share * (b - a)
                }
            })
            .collect();
        Self { default, nodes }
    }

    #[inline]
    pub fn at(&self, spot: &Spot, inverse_step: f64) -> f64 {
        if self.nodes.is_empty() {
            return self.default;
        }
        let (a, b) = (self.nodes[spot.cell], self.nodes[spot.cell + 1]);
        if a.is_nan() {
            b
        } else if b.is_nan() {
            a
        } else {
            a + spot.offset * inverse_step * (b - a)
        }
    }
}
