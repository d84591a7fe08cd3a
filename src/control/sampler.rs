//! Sample instants of a controller inside a host with steps of its own.
//!
//! Each instant is taken at the communication point that is nearest to it. A point a hair before its instant is due: else the
//! instant would wait for a whole step, and a clock that trembles by 0.1 us would halve the rate of the control.

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

    /// True if a sample is due at `time`, whose step of the host has so many seconds: no later point is nearer to its instant. The
    /// next instant is then the first one that is nearer to a later point. A host whose steps are longer than Ts gets one
    /// sample a step.
    pub fn due(&mut self, time: f64, step: f64, sample_time: f64) -> bool {
        let tolerance = 1e-6 * sample_time + 4.0 * f64::EPSILON * time.abs();
        let nearest = time + 0.5 * step.max(0.0) - self.start;
        if nearest < self.next as f64 * sample_time - tolerance {
            return false;
        }
        self.next = ((nearest + tolerance) / sample_time).floor().max(0.0) as u64 + 1;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples_of(steps: impl Iterator<Item = f64>) -> usize {
        let mut sampler = Sampler::new(0.5);
        let mut time = 0.5;
        let mut due = 0;
        for step in steps {
            due += usize::from(sampler.due(time, step, 0.02));
            time += step;
        }
        due
    }

    fn samples(step: f64, count: usize) -> usize {
        samples_of(std::iter::repeat_n(step, count))
    }

    #[test]
    fn fires_once_a_sample_whatever_the_step() {
        assert_eq!(samples(0.02, 1000), 1000);
        assert_eq!(samples(0.001, 20_000), 1000);
        assert_eq!(samples(0.01, 2000), 1000);
        assert_eq!(samples(0.05, 100), 100);
        // 7 ms steps reach sample instants early or late, but miss none: 7 s are 350 samples.
        assert_eq!(samples(0.007, 1000), 350);
    }

    #[test]
    fn a_clock_that_trembles_misses_no_sample() {
        for off in [1e-7, 1e-6, 1e-4, 2e-3, 9e-3] {
            for first in [off, -off] {
                let steps = (0..1000).map(|k| if k % 2 == 0 { 0.02 + first } else { 0.02 - first });
                assert_eq!(samples_of(steps), 1000, "0.02 +- {first}");
            }
        }
        // Of shorter steps, too.
        let steps = (0..4000).map(|k| if k % 2 == 0 { 0.0050001 } else { 0.0049999 });
        assert_eq!(samples_of(steps), 1000);
    }
}
