//! Frequency response from one signal to another: gain, phase and coherence.
//!
//! ```text
//!     H(f) = S_ux / S_uu,    coherence(f) = |S_ux|^2 / (S_uu S_xx)       (averaged over overlapping Hann windows)
//! ```
//!
//! Source: Welch, The Use of Fast Fourier Transform for the Estimation of Power Spectra, 1967.

use rustfft::{FftPlanner, num_complex::Complex64};

/// Length of a window, s.
const WINDOW: f64 = 8.0;
/// Fewest windows for an estimate.
const LEAST_WINDOWS: usize = 4;

/// A response at a frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrequencyResponse {
    /// Hz.
    pub frequency: f64,
    pub gain: f64,
    /// rad.
    pub phase: f64,
    pub coherence: f64,
}

/// The response of `output` to `input` below `highest` Hz; empty where the log is too short. Only windows whose rows are
/// all valid count.
pub(super) fn response(
    input: &[f64],
    output: &[f64],
    valid: &[bool],
    step: f64,
    highest: f64,
) -> Vec<FrequencyResponse> {
    let size = (WINDOW / step).round() as usize;
    if size < 16 || input.len() < size {
        return Vec::new();
    }
    let fft = FftPlanner::new().plan_fft_forward(size);
    let hann: Vec<f64> =
        (0..size).map(|i| 0.5 - 0.5 * (std::f64::consts::TAU * i as f64 / size as f64).cos()).collect();
    let spectrum = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / size as f64;
        let weighed =
            values.iter().zip(&hann).map(|(value, weight)| Complex64::new((value - mean) * weight, 0.0));
        let mut buffer: Vec<Complex64> = weighed.collect();
        fft.process(&mut buffer);
        buffer
    };
    let bins = ((highest * WINDOW).floor() as usize).min(size / 2);
    let mut sums = vec![(0.0, Complex64::new(0.0, 0.0), 0.0); bins + 1];
    let mut windows = 0;
    for from in (0..=input.len() - size).step_by(size / 2) {
        let range = from..from + size;
        if !valid[range.clone()].iter().all(|valid| *valid) {
            continue;
        }
        windows += 1;
        let (u, x) = (spectrum(&input[range.clone()]), spectrum(&output[range]));
        for (bin, (uu, ux, xx)) in sums.iter_mut().enumerate() {
            *uu += u[bin].norm_sqr();
            *ux += u[bin].conj() * x[bin];
            *xx += x[bin].norm_sqr();
        }
    }
    if windows < LEAST_WINDOWS {
        return Vec::new();
    }
    let highest_power = sums.iter().map(|(uu, ..)| *uu).fold(0.0, f64::max);
    let responses =
        sums.iter().enumerate().skip(1).filter(|(_, (uu, _, xx))| *uu > 1e-9 * highest_power && *xx > 0.0);
    let mut responses: Vec<FrequencyResponse> = responses
        .map(|(bin, (uu, ux, xx))| FrequencyResponse {
            frequency: bin as f64 / (size as f64 * step),
            gain: ux.norm() / uu,
            phase: ux.arg(),
            coherence: ux.norm_sqr() / (uu * xx),
        })
        .collect();
    for i in 1..responses.len() {
        let turns = ((responses[i].phase - responses[i - 1].phase) / std::f64::consts::TAU).round();
        responses[i].phase -= turns * std::f64::consts::TAU;
    }
    responses
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pure_delay_has_its_gain_and_phase() {
        let (step, delay) = (0.01, 0.1);
        let signal = |t: f64| (1..30).map(|i| (f64::from(i) * (0.37 * t + f64::from(i))).sin()).sum::<f64>();
        let time: Vec<f64> = (0..6000).map(|i| step * f64::from(i)).collect();
        let input: Vec<f64> = time.iter().map(|t| signal(*t)).collect();
        let output: Vec<f64> = time.iter().map(|t| 2.0 * signal(t - delay)).collect();
        let found = response(&input, &output, &vec![true; 6000], step, 1.5);
        assert!(!found.is_empty());
        for at in found.iter().filter(|at| at.coherence > 0.99) {
            assert!((at.gain - 2.0).abs() < 0.15, "{at:?}");
            assert!((at.phase + std::f64::consts::TAU * at.frequency * delay).abs() < 0.1, "{at:?}");
        }
        assert!(response(&input, &output, &vec![false; 6000], step, 1.5).is_empty());
        assert!(response(&input[..9], &output[..9], &[true; 9], step, 1.5).is_empty());
    }
}
