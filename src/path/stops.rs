//! Stops in the log of a drive that is taken for a road.
//!
//! A receiver wanders while its vehicle stands or crawls: points without an order, between which the road turns back.
//! A walk through the points begins a heap anew where a point lies farther than half a `width` from the mean of the heap so far.
//! A heap of many more points than the usual spacing `s` puts there, without an order, is a stop, and becomes one point, its mean:
//!
//! ```text
//!     count > 4 (width / s + 1),      length from point to point > 2.5 width
//! ```
//!
//! A hairpin that is driven slowly has many points, too, and is as long as it is wide.
//!
//! How far a receiver wanders, a moving vehicle does not tell. The width grows until the road no longer turns back.

use super::sample::Sample;
use super::spline::{Vector, distance};
use crate::numerics::statistics::upper_median;

/// Points of a stop, as a multiple of those that a vehicle of the usual speed leaves.
const SLOWER: f64 = 4.0;
/// Length of the way through a stop's points, as a multiple of its width.
const WITHOUT_ORDER: f64 = 2.5;
/// Room around a stop without other points, as a multiple of its width.
const CLEAR: f64 = 2.0;
/// Widths that are tried, m: from the rounding of coordinates to the wander of poor receivers.
pub(super) const WIDTHS: [f64; 15] =
    [0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];

/// Median distance from point to point in m.
pub(super) fn usual_spacing(points: &[(usize, Sample)]) -> f64 {
    let apart =
        points.windows(2).map(|pair| distance([pair[0].1.x, pair[0].1.y], [pair[1].1.x, pair[1].1.y]));
    upper_median(&mut apart.collect::<Vec<_>>())
}

/// Points with their places in the file, with each stop as one; `None` if there is no stop. `spacing` is the usual one.
pub(super) fn without_stops(
    points: &[(usize, Sample)],
    width: f64,
    spacing: f64,
) -> Option<Vec<(usize, Sample)>> {
    let at = |i: usize| [points[i].1.x, points[i].1.y];
    let many = SLOWER * (width / spacing.max(1e-6) + 1.0);
    let mut kept: Vec<(usize, Sample)> = Vec::with_capacity(points.len());
    let mut first = 0;
    while first < points.len() {
        let (mut sum, mut end): (Vector, usize) = (at(first), first + 1);
        let mean = |sum: Vector, count: usize| sum.map(|sum| sum / count as f64);
        while end < points.len() && distance(at(end), mean(sum, end - first)) < 0.5 * width {
            sum = [sum[0] + at(end)[0], sum[1] + at(end)[1]];
            end += 1;
        }
        let heap = &points[first..end];
        let way: f64 = (first + 1..end).map(|i| distance(at(i - 1), at(i))).sum();
        if (heap.len() as f64) < many || way < WITHOUT_ORDER * width {
            kept.extend_from_slice(heap);
        } else {
            let [x, y] = mean(sum, heap.len());
            let (index, middle) = &heap[heap.len() / 2];
            // The stop is the drive's, not the road's.
            let speed = heap.iter().filter_map(|(_, sample)| sample.speed).reduce(f64::max);
            let stop = (*index, Sample { x, y, speed, ..*middle });
            // What leads to it and from it is off by as much.
            let is_near = |sample: &Sample| distance([sample.x, sample.y], [x, y]) < CLEAR * width;
            while kept.last().is_some_and(|(_, sample)| is_near(sample)) {
                kept.pop();
            }
            kept.push(stop);
            while end < points.len() && is_near(&points[end].1) {
                end += 1;
            }
        }
        first = end;
    }
    (kept.len() < points.len()).then_some(kept)
}
