//! A zero-phase low pass of 3 Hz and a clock of 10 Hz: the band of a vehicle's handling.
//!
//! ```text
//!     y(t_k) = sum_i h(t_i - t_k) x_i / sum_i h(t_i - t_k),    h = sinc(2 f t) (windowed by a raised cosine)
//! ```

/// Corner of the low pass, Hz; clock, 1/s; half the filter's length, s.
const CORNER: f64 = 3.0;
const CLOCK: f64 = 10.0;
const HALF: f64 = 0.3;

/// The filter on a log's clock.
#[derive(Debug, Clone)]
pub struct Filter {
    taps: Vec<f64>,
    half: usize,
    /// Rows of the log in one sample of the new clock.
    pub every: usize,
}

impl Filter {
    /// For a sample time in s.
    #[must_use]
    pub fn new(step: f64) -> Self {
        let half = (HALF / step).round() as usize;
        let sinc = |x: f64| {
            if x.abs() < 1e-12 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) }
        };
        let mut taps: Vec<f64> = (0..=2 * half)
            .map(|i| {
                let t = (i as f64 - half as f64) * step;
                let window = 0.5 + 0.5 * (std::f64::consts::PI * t / (HALF + step)).cos();
                sinc(2.0 * CORNER * t) * window
            })
            .collect();
        let sum: f64 = taps.iter().sum();
        taps.iter_mut().for_each(|tap| *tap /= sum);
        Self { taps, half, every: (1.0 / (CLOCK * step)).round().max(1.0) as usize }
    }

    /// Factor from the standard deviation of white noise on the log's clock to that after the filter.
    #[must_use]
    pub fn gain(&self) -> f64 {
        self.taps.iter().map(|tap| tap * tap).sum::<f64>().sqrt()
    }

    /// Rows on which the filter only sees rows that count.
    #[must_use]
    pub fn rows(&self, counts: &[bool]) -> Vec<usize> {
        let rows = counts.len();
        (self.half..rows.saturating_sub(self.half))
            .step_by(self.every)
            .filter(|&row| counts[row - self.half..=row + self.half].iter().all(|&counts| counts))
            .collect()
    }

    /// The filtered column at rows.
    pub fn apply(&self, column: &[f64], rows: &[usize], into: &mut Vec<f64>) {
        into.extend(rows.iter().map(|&row| {
            let from = row - self.half;
            self.taps.iter().zip(&column[from..]).map(|(tap, value)| tap * value).sum::<f64>()
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Random;

    /// A column through the filter, at all rows that it reaches.
    fn filtered(filter: &Filter, column: &[f64]) -> Vec<f64> {
        let rows: Vec<usize> = (filter.half..column.len() - filter.half).collect();
        let mut out = Vec::new();
        filter.apply(column, &rows, &mut out);
        out
    }

    #[test]
    fn handling_passes_without_delay_and_vibration_does_not() {
        for step in [0.01, 0.02] {
            let filter = Filter::new(step);
            for (frequency, least, most) in
                [(0.0, 1.0 - 1e-12, 1.0 + 1e-12), (1.0, 0.9, 1.0), (3.0, 0.4, 0.6), (7.0, -0.01, 0.01)]
            {
                let wave = |row: usize| (std::f64::consts::TAU * frequency * row as f64 * step).cos();
                let column: Vec<f64> = (0..500).map(wave).collect();
                // In phase: what is left is a share of the wave itself.
                let out = filtered(&filter, &column);
                let own: Vec<f64> = (filter.half..500 - filter.half).map(wave).collect();
                let share = out.iter().zip(&own).map(|(a, b)| a * b).sum::<f64>()
                    / own.iter().map(|own| own * own).sum::<f64>();
                assert!((least..=most).contains(&share), "{frequency} Hz: {share}");
                let apart = out.iter().zip(&own).map(|(a, b)| (a - share * b).abs()).fold(0.0, f64::max);
                assert!(apart < 1e-9, "{frequency} Hz: {apart} out of phase");
            }
        }
    }

    #[test]
    fn white_noise_is_left_with_the_share_that_is_said() {
        let filter = Filter::new(0.02);
        let mut random = Random::new(7);
        let noise: Vec<f64> = (0..50_000).map(|_| 12.0_f64.sqrt() * (random.uniform() - 0.5)).collect();
        let left = super::super::problem::rms(&filtered(&filter, &noise));
        assert!((left / filter.gain() - 1.0).abs() < 0.03, "{left} of {}", filter.gain());
    }

    #[test]
    fn a_row_that_does_not_count_is_in_no_sample() {
        let filter = Filter::new(0.02);
        let mut counts = [true; 300];
        counts[150] = false;
        let rows = filter.rows(&counts);
        assert!(
            rows.iter().all(|&row| row.abs_diff(150) > filter.half && row % filter.every == 0),
            "{rows:?}"
        );
        assert_eq!(rows.len(), filter.rows(&[true; 300]).len() - (2 * filter.half / filter.every + 1));
        assert!(filter.rows(&[true; 20]).is_empty());
    }
}
