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
