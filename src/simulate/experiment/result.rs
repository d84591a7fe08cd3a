//! Results of a comparison, as files hold them.

use super::fit::FitMetrics;
use super::step::{Identified, SteeringStep};
use super::weights::CostWeights;
use crate::numerics::fnv;
use crate::path::RoadClass;
use crate::simulate::{DriveFor, InputMetrics, StepTimes, TrackingMetrics};
use crate::vehicle::VehicleParameters;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Effort of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Effort {
    /// Seeds: each has drives, models and noise of its own.
    pub seeds: usize,
    /// Drives of the training route from which a seed's models are learned.
    pub drives: usize,
    /// Candidates of each row's search.
    pub budget: usize,
    /// Threads; the results do not depend on it.
    pub threads: usize,
}

/// One drive of the test route in numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct DriveMetrics {
    pub tracking: TrackingMetrics,
    pub classes: BTreeMap<&'static str, TrackingMetrics>,
    pub steering: InputMetrics,
    /// True if the vehicle left the path, jack-knifed or rolled over: the loop diverged. The other numbers are then
    /// those until there.
    pub lost: bool,
    /// Largest articulation, rad, of a vehicle that has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub articulation: Option<f64>,
}

impl<const C: usize> From<&DriveFor<C>> for DriveMetrics {
    fn from(drive: &DriveFor<C>) -> Self {
        let classes = RoadClass::ALL
            .iter()
            .map(|class| (class.name(), drive.tracking_on(*class)))
            .filter(|(_, metrics)| metrics.count > 0)
            .collect();
        Self {
            tracking: drive.tracking(),
            classes,
            steering: drive.steering(),
            lost: drive.lost || !drive.finished,
            articulation: drive.column("articulation").iter().map(|angle| angle.abs()).reduce(f64::max),
        }
    }
}

/// Prediction errors of a row's residual, for one seed.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct RowFit {
    pub train: FitMetrics,
    pub test: FitMetrics,
    /// After a horizon of 16 steps, on the test route.
    pub test_16_steps: FitMetrics,
    /// After a longer horizon, where the vehicle has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub test_horizon: Option<FitMetrics>,
    /// After a step of the command, `step_at_V` for a speed of V m/s, where the vehicle is asked.
    #[serde(flatten)]
    pub steps: BTreeMap<String, FitMetrics>,
}

/// One row of the comparison.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct RowResult {
    pub row: String,
    pub weights: CostWeights,
    /// Score of `weights` on the training pieces, m. Another candidate's may be less: the best two are driven against each
    /// other on the whole training route.
    pub score: f64,
    /// Every candidate's weights and score.
    pub tried: Vec<(CostWeights, f64)>,
    /// One for each seed; one only where no seed plays a part.
    pub own_best: Vec<DriveMetrics>,
    pub frozen: Vec<DriveMetrics>,
    pub default: Vec<DriveMetrics>,
    pub fit: Vec<RowFit>,
    pub time: Option<StepTimes>,
    /// On further roads by name, at the row's own best weights.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub further: BTreeMap<&'static str, Vec<DriveMetrics>>,
}

impl RowResult {
    /// Outcomes of each protocol.
    #[must_use]
    pub fn protocols(&self) -> [(&'static str, &[DriveMetrics]); 3] {
        [("own best", &self.own_best), ("frozen", &self.frozen), ("default", &self.default)]
    }
}

/// A plant, with or without noise.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct Condition {
    pub plant: String,
    pub noise: bool,
    pub vehicle: String,
    /// Digest of its numbers: see [`vehicle_digest`].
    pub vehicle_digest: String,
    pub effort: Effort,
    pub rows: Vec<RowResult>,
    /// Rows that were asked for and that this vehicle does not have.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
    /// Amplitudes of the dither of the collecting drives, rad, where some did not stand the usual one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub weaker_dithers: Vec<f64>,
    /// Those of the second round's drives, where there is one; 0 where no amplitude was stood.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub again_dithers: Vec<f64>,
    /// Soft bound of the articulation, rad, of a vehicle that has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub articulation_bound: Option<f64>,
    /// The step that delay models are identified from, where there are such rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<SteeringStep>,
    /// Identification from the record.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub identified: Vec<Identified>,
}

/// Digest of a vehicle: of its file's numbers and words, and of the tyre files that it names.
#[must_use]
pub fn vehicle_digest(parameters: &impl VehicleParameters) -> String {
    // Its file's text has only the names of the tyre files.
    format!("{:016x}", fnv(format!("{parameters:?}").as_bytes()))
}
