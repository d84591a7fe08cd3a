//! Sample instants of a controller inside a host with steps of its own.

use serde::{Deserialize, Serialize};

/// Sample instants `start + k Ts`. Time comparisons tolerate the rounding of a host that adds up its steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sampler {
    start: f64,
    next: u64,
}

impl Sampler {
    /// True if a host with steps of so many seconds asks for fewer samples than there are instants.
    #[must_use]
    pub fn is_outpaced(step: f64, sample_time: f64) -> bool {
        step > sample_time * (1.0 + 1e-6)
    }

    /// The first sample is at `start`, s.
    #[must_use]
    pub fn new(start: f64) -> Self {
        Self { start, next: 0 }
    }

    /// True if a sample is due at `time`. If so, the next one is the first instant after `time`: a host whose steps are
    /// longer than Ts gets one sample a step.
    pub fn due(&mut self, time: f64, sample_time: f64) -> bool {
        let tolerance = 1e-6 * sample_time + 4.0 * f64::EPSILON * time.abs();
        if time < self.start + self.next as f64 * sample_time - tolerance {
            return false;
        }
        self.next = ((time - self.start + tolerance) / sample_time).floor().max(0.0) as u64 + 1;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(step: f64, count: usize) -> usize {
        let mut sampler = Sampler::new(0.5);
        let mut time = 0.5;
        let mut due = 0;
        for _ in 0..count {
            due += usize::from(sampler.due(time, 0.02));
            time += step;
        }
        due
    }

    #[test]
    fn fires_once_a_sample_whatever_the_step() {
        assert_eq!(samples(0.02, 1000), 1000);
        assert_eq!(samples(0.001, 20_000), 1000);
        assert_eq!(samples(0.01, 2000), 1000);
        assert_eq!(samples(0.05, 100), 100);
        // 7 ms steps reach sample instants late, but miss none: 7 s are 350 samples.
        assert_eq!(samples(0.007, 1000), 350);
    }
}
