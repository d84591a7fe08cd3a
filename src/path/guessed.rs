//! Bends between two points of a road that are too far apart to tell them.

use super::{Note, Path};

/// Distance between a road and the straight line between two neighbouring points, m and share of theirs, from which on the
/// points do not tell the road: a turn of 45 degrees, and most of a lane.
const GUESSED: f64 = 2.0;
const GUESSED_SHARE: f64 = 0.1;
/// Parts of the road between two points that are looked at.
const GUESSED_AT: u32 = 16;

impl Path {
    /// A warning where the smooth line between two neighbouring points bends far from the straight line between them: the
    /// points do not tell the road there.
    pub(super) fn guessed_bend(&self, marks: &[f64]) -> Option<Note> {
        let place = |station: f64| {
            let at = self.at(station);
            [at.x, at.y]
        };
        let of_pair = |pair: &[f64]| {
            let (from, to) = (place(pair[0]), place(pair[1]));
            let chord = [to[0] - from[0], to[1] - from[1]];
            let length = chord[0].hypot(chord[1]);
            let beside = |k: u32| {
                let at = place(pair[0] + (pair[1] - pair[0]) * f64::from(k) / f64::from(GUESSED_AT));
                (chord[0] * (at[1] - from[1]) - chord[1] * (at[0] - from[0])).abs() / length
            };
            ((1..GUESSED_AT).map(beside).fold(0.0, f64::max), length, pair[0])
        };
        // Most roads' points are too near each other for it.
        let pairs = marks.windows(2).filter(|pair| pair[1] - pair[0] > GUESSED / GUESSED_SHARE).map(of_pair);
        let bent = pairs.filter(|(off, length, _)| *off > GUESSED && *off > GUESSED_SHARE * length);
        let (off, length, station) = bent.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Note::warning(format!(
            "the road between two points {length:.0} m apart, from station {station:.0} m on, bends {off:.1} m from the straight \
             line between them: too few points tell where it bends; give more of them there"
        )))
    }
}
