//! A column's values on an even clock, with a mark for guessed ones.

/// Longest gap whose interpolation is as good as a measurement, s.
pub(super) const SHORT: f64 = 0.15;
/// The same in steps, for slow rows.
const SHORT_STEPS: f64 = 2.5;

/// A column on the even clock.
pub(super) struct Resampled {
    /// One value for each point of the clock.
    pub values: Vec<f64>,
    /// True for values within a stretch without any.
    pub guessed: Vec<bool>,
}

/// Interpolation between samples.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Interpolation {
    /// On a straight line.
    Line,
    /// The last value is held: for columns that jump.
    Hold,
}

/// Columns that jump: values between two of theirs are meaningless.
const JUMPING: [&str; 2] = ["station", "e2"];
/// Interpolation of a column between its samples.
pub(super) fn between(column: &str) -> Interpolation {
    if JUMPING.contains(&column) { Interpolation::Hold } else { Interpolation::Line }
}

/// Brings a column onto the clock `first + k * step`; `None` if it holds no finite value. Samples that come faster than the
/// clock are averaged.
pub(super) fn resample(
    time: &[f64],
    values: &[f64],
    (first, step, count): (f64, f64, usize),
    between: Interpolation,
) -> Option<Resampled> {
    let samples: Vec<(f64, f64)> =
        time.iter().copied().zip(values.iter().copied()).filter(|(_, value)| value.is_finite()).collect();
    let (&begin, &end) = (samples.first()?, samples.last()?);
    let limit = SHORT.max(SHORT_STEPS * step);
    let mut resampled = Resampled { values: Vec::with_capacity(count), guessed: Vec::with_capacity(count) };
    // `next`: the first sample after the point; `low`: the first in its averaging window.
    let (mut next, mut low) = (0, 0);
    for k in 0..count {
        let now = first + step * k as f64;
        while next < samples.len() && samples[next].0 <= now {
            next += 1;
        }
        let before = if next > 0 { samples[next - 1] } else { begin };
        let after = samples.get(next).copied().unwrap_or(end);
        let apart = after.0 - before.0;
        let nearest = (now - before.0).abs().min((after.0 - now).abs());
        while low < samples.len() && samples[low].0 < now - 0.5 * step {
            low += 1;
        }
        let window = samples[low..].iter().take_while(|sample| sample.0 < now + 0.5 * step);
        let (sum, number) = window.fold((0.0, 0_u32), |(sum, number), sample| (sum + sample.1, number + 1));
        resampled.values.push(match between {
            Interpolation::Hold => before.1,
            Interpolation::Line if number > 1 => sum / f64::from(number),
            Interpolation::Line if apart > 0.0 => {
                before.1 + (after.1 - before.1) * ((now - before.0) / apart).clamp(0.0, 1.0)
            }
            Interpolation::Line => before.1,
        });
        let outside = now < begin.0 || now > end.0;
        resampled.guessed.push(nearest > 0.75 * step && (apart > limit || outside));
    }
    Some(resampled)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_holes_are_filled_and_long_ones_marked() {
        let time: Vec<f64> =
            (0..100).map(|i| 0.1 * f64::from(i)).filter(|t| !(2.05..4.0).contains(t)).collect();
        let mut values: Vec<f64> = time.iter().map(|t| 2.0 * t).collect();
        values[5] = f64::NAN;
        let on = resample(&time, &values, (0.0, 0.1, 99), Interpolation::Line).unwrap();
        assert!(on.values.iter().enumerate().all(|(k, value)| (value - 0.2 * k as f64).abs() < 1e-9));
        assert!(!on.guessed[5] && on.guessed[30] && !on.guessed[50] && !on.guessed[20]);
    }

    #[test]
    fn fast_samples_are_averaged() {
        // Nine to eleven samples in each window, by rounding.
        let time: Vec<f64> = (0..1000).map(|i| 1e-3 * f64::from(i)).collect();
        let values: Vec<f64> = (0..1000).map(|i| f64::from(i % 2)).collect();
        let on = resample(&time, &values, (0.0, 0.01, 90), Interpolation::Line).unwrap();
        assert!(on.values[1..].iter().all(|value| (value - 0.5).abs() < 0.06));
        assert!(resample(&time, &[f64::NAN; 1000], (0.0, 0.01, 90), Interpolation::Line).is_none());
    }
}
