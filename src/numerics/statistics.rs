//! Numbers that describe a column: quantiles, medians, slopes.

/// The median, if there is any number.
pub(crate) fn median(values: Vec<f64>) -> Option<f64> {
    quantile(values, 0.5)
}

/// The number below which this share of the finite ones lies.
pub(crate) fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.retain(|value| value.is_finite());
    let last = values.len().checked_sub(1)?;
    let place = ((share * last as f64).round() as usize).min(last);
    Some(*values.select_nth_unstable_by(place, f64::total_cmp).1)
}

/// The upper of the two numbers in the middle; 0 of nothing.
pub(crate) fn upper_median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// Slope of `y` over `x`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Slope {
    /// `y = factor * x`, in the mean of squares, both without their means.
    pub factor: f64,
    /// Share of the spread of `y` that this explains.
    pub explained: f64,
}

/// Slope of the second over the first of each pair; `None` where they hardly correlate.
pub(crate) fn slope(pairs: impl Iterator<Item = (f64, f64)>) -> Option<Slope> {
    let (mut n, mut mx, mut my, mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    // Not a number makes the pair count as none.
    for (x, y) in pairs.filter(|(x, y)| x.is_finite() && y.is_finite()) {
        n += 1.0;
        let (dx, dy) = (x - mx, y - my);
        mx += dx / n;
        my += dy / n;
        xx += dx * (x - mx);
        xy += dx * (y - my);
        yy += dy * (y - my);
    }
    let explained = xy * xy / (xx * yy);
    (explained >= 0.5 && xx > 0.0).then_some(Slope { factor: xy / xx, explained })
}

/// Number of independent values in a sequence whose neighbours are alike; what is no number is left out.
pub(crate) fn independent(values: &[f64]) -> f64 {
    let values: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count.max(1.0);
    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let product: f64 = values.windows(2).map(|pair| (pair[0] - mean) * (pair[1] - mean)).sum();
    let alike = (product / square.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    count * (1.0 - alike) / (1.0 + alike)
}

/// Median of the magnitude of a normal variable, in standard deviations.
pub(crate) const MEDIAN_OF_NORMAL: f64 = 0.6745;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_that_are_alike_count_less() {
        let noise: Vec<f64> = (0..1000).map(|i| (7.3 * f64::from(i * i)).sin()).collect();
        assert!(independent(&noise) > 800.0, "{}", independent(&noise));
        let each_four_times: Vec<f64> = noise.iter().flat_map(|value| [*value; 4]).collect();
        assert!((300.0..900.0).contains(&independent(&each_four_times)), "{}", independent(&each_four_times));
        assert_eq!(independent(&[]), 0.0);
    }

    #[test]
    fn quantiles_leave_gaps_out() {
        assert_eq!(median(vec![3.0, f64::NAN, 1.0, 2.0]), Some(2.0));
        assert_eq!(quantile(vec![f64::NAN], 0.5), None);
    }

    #[test]
    fn a_line_is_found_and_noise_is_none() {
        let line = slope((0..9).map(|i| (f64::from(i), 3.0 - 2.0 * f64::from(i)))).unwrap();
        assert!((line.factor + 2.0).abs() < 1e-12 && (line.explained - 1.0).abs() < 1e-12);
        assert_eq!(slope([(0.0, 1.0), (1.0, -1.0), (2.0, 1.0), (3.0, -1.0)].into_iter()), None);
        assert_eq!(slope(std::iter::empty()), None);
    }
}
