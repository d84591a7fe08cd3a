//! What a learned residual is made of: its kind, what its trees split on, the regressors of its leaves, and the ranges
//! of its training. It is the readable head of a model's file.
//!
//! ```text
//! regressors = 1, u_1 ... u_W, x_1 ... x_S, kappa, kappa', kappa v^2
//! ```

use super::ROAD;
use crate::enumeration;
use crate::vehicle::SingleTrack;
use serde::{Deserialize, Serialize};

enumeration! {
    /// Kinds of residual.
    #[serde(rename_all = "snake_case")]
    pub enum Kind {
        None = 0 "none", "No residual: the nominal controller";
        Linear = 1 "linear", "One linear model for all";
        Rt = 2 "rt", "A tree with constant leaves";
        Rf = 3 "rf", "A forest with constant leaves";
        Rtl = 4 "rtl", "A tree with linear leaves";
        Rfl = 5 "rfl", "A forest with linear leaves";
        RflS = 6 "rfl_s", "A forest that splits on speed and road only, its leaves linear in commands and road";
    }
}

impl Kind {
    /// True if leaves are linear (else constant).
    #[must_use]
    pub fn is_linear(self) -> bool {
        matches!(self, Self::Linear | Self::Rtl | Self::Rfl | Self::RflS)
    }

    /// True if the kind has trees.
    #[must_use]
    pub fn has_trees(self) -> bool {
        !matches!(self, Self::None | Self::Linear)
    }

    /// True if the kind has several trees, each on a bootstrap sample.
    #[must_use]
    pub fn is_forest(self) -> bool {
        matches!(self, Self::Rf | Self::Rfl | Self::RflS)
    }
}

enumeration! {
    /// Features that trees split on.
    #[serde(rename_all = "snake_case")]
    pub enum TreeFeatures {
        Errors = 0 "errors", "Error states of the whole window: the paper's";
        ErrorsAndRoad = 1 "errors_and_road", "The same, with speed, curvature and curvature rate of the newest row";
        Road = 2 "road", "Speed, curvature and curvature rate of the newest row";
    }
}

impl TreeFeatures {
    /// Their numbers among the features of a look-up; `states` is the number of states of a row.
    #[must_use]
    pub fn indices(self, states: usize, window: usize) -> Vec<u16> {
        let road = states * window;
        let all = match self {
            Self::Errors => 0..road,
            Self::ErrorsAndRoad => 0..road + ROAD,
            Self::Road => road..road + ROAD,
        };
        all.map(|i| i as u16).collect()
    }
}

/// Regressors of linear leaves besides the constant and the window of commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
pub struct Regressors {
    /// Curvature, curvature rate, and curvature times speed squared, at the newest row.
    pub road: bool,
    /// So many of the newest error states.
    pub states: usize,
}

/// Terms of the road in a leaf.
pub(super) const ROAD_TERMS: usize = 3;

impl Regressors {
    /// Number of regressors, with the constant; `states` is the number of states of a row.
    #[must_use]
    pub fn count(self, states: usize, window: usize) -> usize {
        1 + window + states * self.states + if self.road { ROAD_TERMS } else { 0 }
    }

    /// Writes the regressors: constant, commands, states, road.
    pub(super) fn write<const S: usize>(self, features: &[f64], commands: &[f64], out: &mut Vec<f64>) {
        let (states, road) = features.split_at(features.len() - ROAD);
        out.push(1.0);
        out.extend(commands);
        out.extend(&states[states.len() - S * self.states..]);
        if self.road {
            out.extend(road_terms(road));
        }
    }
}

/// `kappa, kappa', kappa v^2` from speed, curvature and curvature rate.
pub(super) fn road_terms(road: &[f64]) -> [f64; ROAD_TERMS] {
    [road[1], road[2], road[1] * road[0] * road[0]]
}

/// Range of a quantity in training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// The signal's name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

impl Range {
    /// Excess of a positive value over its range, as a share of the limit; 0 inside. For a speed: a cruise of many
    /// hours has a narrow range, and tells as much of speeds near it.
    pub(super) fn excess_in_shares(&self, value: f64) -> f64 {
        if value >= self.min && value <= self.max {
            0.0
        } else if value < self.min {
            self.min / value.max(f64::MIN_POSITIVE) - 1.0
        } else if value > self.max {
            value / self.max.max(f64::MIN_POSITIVE) - 1.0
        } else {
            f64::INFINITY
        }
    }

    /// Excess of a value over its range, in widths of the range; 0 inside.
    pub(super) fn excess(&self, value: f64) -> f64 {
        let width = (self.max - self.min).max(f64::MIN_POSITIVE);
        // Not a number compares as neither: it is as far outside as can be.
        if value >= self.min && value <= self.max {
            0.0
        } else if value < self.min {
            (self.min - value) / width
        } else if value > self.max {
            (value - self.max) / width
        } else {
            f64::INFINITY
        }
    }
}

/// From what a model was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Training {
    /// Identifies the drives' values.
    pub data_hash: String,
    /// Samples learned from.
    pub samples: usize,
    /// The seed.
    pub seed: u64,
    /// Shrinkage of the global fit, where there is one.
    pub global_lambda: Option<f64>,
    /// Shrinkage of the leaves towards it, where they are linear and shrunk.
    pub leaf_lambda: Option<f64>,
}

/// Description of a model, apart from its numbers: the readable head of its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Schema<V = SingleTrack> {
    /// Kind of residual.
    pub kind: Kind,
    /// Time between control steps, s.
    pub sample_time: f64,
    /// Length of the window, W, steps.
    pub window: usize,
    /// Speed below which the nominal model was held, m/s.
    pub min_model_speed: f64,
    /// Features that trees split on.
    pub tree_features: TreeFeatures,
    /// Regressors of linear leaves besides commands.
    pub regressors: Regressors,
    /// The nominal vehicle whose prediction the residual corrects.
    pub vehicle: V,
    /// From what the model was made.
    pub training: Training,
    /// Ranges in training: states, vx, curvature, curvature rate, command.
    pub ranges: Vec<Range>,
}
