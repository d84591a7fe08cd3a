//! Tracking errors of a drive.

use serde::Serialize;

/// Lateral tracking error over a drive, in m.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct TrackingMetrics {
    /// Mean absolute error.
    pub mae: f64,
    /// Root mean square error.
    pub rmse: f64,
    /// Largest absolute error.
    pub max: f64,
    /// Number of samples.
    pub count: usize,
}

impl TrackingMetrics {
    /// Over lateral errors in m, sampled evenly in time. Zeros for no sample.
    pub fn of(errors: impl IntoIterator<Item = f64>) -> Self {
        let (mut sum, mut square, mut max, mut count) = (0.0, 0.0, 0.0_f64, 0_usize);
        for error in errors {
            sum += error.abs();
            square += error * error;
            max = max.max(error.abs());
            count += 1;
        }
        if count == 0 {
            return Self::default();
        }
        let n = count as f64;
        Self { mae: sum / n, rmse: (square / n).sqrt(), max, count }
    }
}

/// Roughness of a steering command.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct InputMetrics {
    /// Root mean square of the command's rate, rad/s.
    pub rate_rms: f64,
    /// Root mean square of the change of that rate from step to step, rad/s: chatter.
    pub chatter_rms: f64,
}

impl InputMetrics {
    /// Over times in s and commands in rad, one for each control step. Zeros for fewer than two.
    pub fn of(commands: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut last: Option<(f64, f64)> = None;
        let mut rate_before = None;
        let (mut rates, mut changes, mut count) = (0.0, 0.0, 0_usize);
        for (time, command) in commands {
            if let Some((time_before, before)) = last {
                let rate = (command - before) / (time - time_before);
                rates += rate * rate;
                changes += rate_before.map_or(0.0, |before: f64| (rate - before) * (rate - before));
                rate_before = Some(rate);
                count += 1;
            }
            last = Some((time, command));
        }
        let n = count.max(1) as f64;
        Self { rate_rms: (rates / n).sqrt(), chatter_rms: (changes / n).sqrt() }
    }
}

/// Wall-clock times of control steps, in s.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[allow(missing_docs)]
pub struct TimeMetrics {
    pub mean_s: f64,
    pub median_s: f64,
    /// The least time that 99 % of the steps do not exceed (nearest rank): of fewer than 100 steps the longest.
    pub p99_s: f64,
    pub max_s: f64,
    /// Steps that took longer than the sample time.
    pub missed: usize,
}

/// Wall-clock times of a drive's control steps, whole and in parts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[allow(missing_docs)]
pub struct StepTimes {
    pub step: TimeMetrics,
    pub look_up: TimeMetrics,
    pub condense: TimeMetrics,
    pub solve: TimeMetrics,
}

impl TimeMetrics {
    /// Over the times of all steps; `times` is sorted in place. Zeros for no step.
    #[must_use]
    pub fn of(times: &mut [f64], sample_time: f64) -> Self {
        if times.is_empty() {
            return Self::default();
        }
        times.sort_by(f64::total_cmp);
        let mean_s = times.iter().sum::<f64>() / times.len() as f64;
        Self {
            mean_s,
            median_s: times[(times.len() - 1) / 2],
            p99_s: times[(times.len() * 99).div_ceil(100) - 1],
            max_s: times[times.len() - 1],
            missed: times.iter().filter(|&&time| time > sample_time).count(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_of_a_known_series() {
        let metrics = TrackingMetrics::of([3.0, -4.0, 0.0, 0.0]);
        assert_eq!(metrics, TrackingMetrics { mae: 1.75, rmse: 2.5, max: 4.0, count: 4 });
        assert_eq!(TrackingMetrics::of([]), TrackingMetrics::default());
    }

    #[test]
    fn roughness_of_a_known_command() {
        let commands = [0.0, 0.1, 0.0, 0.1].iter().enumerate().map(|(k, &u)| (k as f64, u));
        let metrics = InputMetrics::of(commands);
        assert!((metrics.rate_rms - 0.1).abs() < 1e-15);
        assert!((metrics.chatter_rms - (2.0 * 0.04 / 3.0_f64).sqrt()).abs() < 1e-15);
        assert_eq!(InputMetrics::of([]), InputMetrics::default());
    }

    #[test]
    fn times_are_ranked() {
        let mut times: Vec<f64> = (1..=200).rev().map(|k| f64::from(k) * 1e-4).collect();
        let metrics = TimeMetrics::of(&mut times, 0.0195);
        assert_eq!((metrics.p99_s, metrics.max_s, metrics.missed), (0.0198, 0.02, 5));
        assert_eq!(metrics.median_s, 0.01);
    }

    #[test]
    fn no_step_of_a_short_drive_is_beyond_99_percent_of_the_steps() {
        for count in [1, 2, 50, 99, 100, 101, 1000] {
            let mut times: Vec<f64> = (1..=count).map(f64::from).collect();
            let metrics = TimeMetrics::of(&mut times, 1.0);
            let within = times.iter().filter(|time| **time <= metrics.p99_s).count();
            assert!(100 * within >= 99 * times.len(), "{count}: {within}");
        }
        // One slow step, the first, of few: it is in the percentile, which is not below the mean.
        let metrics = TimeMetrics::of(&mut [9e-3, 1e-4, 1e-4], 1.0);
        assert_eq!((metrics.p99_s, metrics.p99_s > metrics.mean_s), (9e-3, true));
    }
}
