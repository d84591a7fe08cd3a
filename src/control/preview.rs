//! The road over the horizon, at the speeds of the speed plan.

use crate::path::Path;
use crate::residual::ROAD;
use crate::signal::GRAVITY;

/// Speed over the horizon, as the speed controller plans it.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs)]
pub struct SpeedAhead<'a> {
    pub speed: f64,
    pub accel: f64,
    /// Predicted speed at the end of each step, m/s; beyond its end the acceleration is held.
    pub predicted: &'a [f64],
}

/// Gravity along the bank at a station, to the left, m/s2.
pub(super) fn bank_accel(path: &Path, station: f64) -> f64 {
    -GRAVITY * path.bank(station).sin()
}

/// The road ahead at each step of the horizon.
#[derive(Debug, Clone, Default)]
pub struct Preview {
    /// Station at the end of each step, m.
    pub station: Vec<f64>,
    /// Mean speed of each step and speed at its end, m/s.
    pub speed: Vec<[f64; 2]>,
    /// Heading rate of the path, `v kappa`, at the middle of each step, rad/s.
    pub heading_rate: Vec<f64>,
    /// Heading acceleration of the path, `v^2 kappa' + a kappa`, there, rad/s2.
    pub heading_accel: Vec<f64>,
    /// Curvature at the end of each step, 1/m.
    pub curvature: Vec<f64>,
    /// Gravity along the road's bank, to the left, at the middle of each step, m/s2.
    pub bank_accel: Vec<f64>,
    /// Speed, curvature and curvature rate at the beginning of each step; m/s, 1/m, 1/m2.
    pub road: Vec<[f64; ROAD]>,
}

impl Preview {
    /// Room for a horizon.
    #[must_use]
    pub fn new(horizon: usize) -> Self {
        Self {
            station: vec![0.0; horizon],
            speed: vec![[0.0; 2]; horizon],
            heading_rate: vec![0.0; horizon],
            heading_accel: vec![0.0; horizon],
            curvature: vec![0.0; horizon],
            bank_accel: vec![0.0; horizon],
            road: vec![[0.0; ROAD]; horizon],
        }
    }

    /// Reads the road over the horizon. The middle of each step is for the inputs of the model, its end is for
    /// comparison with the state there.
    pub fn look(&mut self, path: &Path, station: f64, ahead: SpeedAhead<'_>, sample_time: f64) {
        let (mut s, mut v) = (station, ahead.speed);
        let mut bend = path.bend(s);
        for j in 0..self.station.len() {
            let (next, accel) = match ahead.predicted.get(j) {
                Some(&next) => (next.max(0.0), (next.max(0.0) - v) / sample_time),
                None => ((v + ahead.accel * sample_time).max(0.0), ahead.accel),
            };
            let mean = 0.5 * (v + next);
            let [curvature, curvature_rate] = bend;
            self.road[j] = [v, curvature, curvature_rate];
            self.speed[j] = [mean, next];
            let middle = s + 0.5 * mean * sample_time;
            let [curvature, curvature_rate] = path.bend(middle);
            self.heading_rate[j] = mean * curvature;
            self.heading_accel[j] = mean * mean * curvature_rate + accel * curvature;
            self.bank_accel[j] = bank_accel(path, middle);
            s += mean * sample_time;
            bend = path.bend(s);
            self.station[j] = s;
            self.curvature[j] = bend[0];
            v = next;
        }
    }
}
