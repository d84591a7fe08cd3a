//! Settings of the training: sizes of the forest, regressors of its leaves, shrinkage.

use super::forest::Block;
use super::prior::CommandPrior;
use super::schema::{Kind, Regressors, TreeFeatures};
use super::table::Resolution;
use super::tree::MAX_DEPTH;
use super::{MAX_WINDOW, ROAD};

/// Shrinkage of linear leaves towards the global fit.
#[derive(Debug, Clone, PartialEq)]
pub enum LambdaChoice {
    /// The candidate with the least error on held-out samples; infinity, the global fit itself, may be one.
    HeldOut(Vec<f64>),
    /// This one.
    Fixed(f64),
    /// No shrinkage: plain least squares in each leaf, the paper's way. The global fit is plain, too.
    LeastSquares,
}

/// Settings of the training.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainConfig {
    /// Kind of residual.
    pub kind: Kind,
    /// Window, W, steps. It should cover delay and four time constants of the actuator.
    pub window: usize,
    /// Number of trees, T; RT and RTL always have a single tree.
    pub trees: usize,
    /// Depth of the trees.
    pub depth: usize,
    /// Features tried at each split, F; RT and RTL try all.
    pub features_per_split: usize,
    /// Fewest samples in a leaf.
    pub min_leaf: usize,
    /// Consecutive samples that a forest's bootstrap draws together; the paper's 1 makes held-out errors too good.
    pub bootstrap_block: Block,
    /// Resolution of values when trees grow.
    pub resolution: Resolution,
    /// Features that trees split on.
    pub tree_features: TreeFeatures,
    /// Regressors of linear leaves besides constant and commands.
    pub regressors: Regressors,
    /// Memory of the filter on regressors and labels of linear leaves before the fit, 0 to less than 1; 0 for none, the
    /// paper's way. With noisy measurements, one-step labels are mostly noise of high frequency.
    pub prefilter: f64,
    /// Prior of the effects of commands; none, the paper's way, for shrinkage towards zero. Plain least squares know no
    /// prior.
    pub prior: Option<CommandPrior>,
    /// Shrinkage of linear leaves.
    pub lambda: LambdaChoice,
    /// Candidates for the shrinkage of the global fit towards zero.
    pub global_lambda: Vec<f64>,
    /// Seed of all that is random.
    pub seed: u64,
    /// Threads; 0 for all there are. The result does not depend on it.
    pub threads: usize,
}

impl TrainConfig {
    /// The default for a kind: the paper's sizes, and leaves shrunk by held-out error.
    #[must_use]
    pub fn new(kind: Kind) -> Self {
        let speed_and_road = kind == Kind::RflS;
        Self {
            kind,
            window: 16,
            trees: 20,
            depth: 6,
            features_per_split: if speed_and_road { ROAD } else { 8 },
            min_leaf: if kind.is_linear() { 100 } else { 20 },
            bootstrap_block: Block(200),
            resolution: Resolution::Histogram(255),
            tree_features: if speed_and_road { TreeFeatures::Road } else { TreeFeatures::Errors },
            regressors: Regressors { road: speed_and_road, states: 0 },
            prefilter: 0.8,
            prior: None,
            lambda: LambdaChoice::HeldOut(vec![1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, f64::INFINITY]),
            global_lambda: vec![0.0, 1e-12, 1e-10, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2],
            seed: 1,
            threads: 0,
        }
    }

    /// Checks the values.
    ///
    /// # Errors
    /// The first impossible value.
    pub fn check(&self) -> Result<(), ConfigError> {
        let within = |name, value, min, max| {
            if (min..=max).contains(&value) {
                Ok(())
            } else {
                Err(ConfigError::Range { name, value, min, max })
            }
        };
        within("window", self.window, 1, MAX_WINDOW)?;
        if self.kind.has_trees() {
            within("trees", self.trees, 1, 1000)?;
            within("depth", self.depth, 1, MAX_DEPTH)?;
            within("features_per_split", self.features_per_split, 1, 1_000_000)?;
            within("min_leaf", self.min_leaf, 1, 1_000_000)?;
            within("bootstrap_block", self.bootstrap_block.0, 1, 1_000_000)?;
            if let Resolution::Histogram(bins) = self.resolution {
                within("bins", usize::from(bins), 2, 256)?;
            }
        }
        if !(0.0..1.0).contains(&self.prefilter) {
            return Err(ConfigError::Prefilter { value: self.prefilter });
        }
        within("regressors.states", self.regressors.states, 0, self.window)?;
        if self.kind == Kind::RflS && (self.tree_features != TreeFeatures::Road || !self.regressors.road) {
            return Err(ConfigError::RflS);
        }
        let lambdas: &[f64] = match &self.lambda {
            LambdaChoice::HeldOut(candidates) => candidates,
            LambdaChoice::Fixed(lambda) => std::slice::from_ref(lambda),
            LambdaChoice::LeastSquares => &[f64::INFINITY],
        };
        for (name, candidates) in [("lambda", lambdas), ("global_lambda", &self.global_lambda)] {
            if candidates.is_empty() {
                return Err(ConfigError::NoCandidate { name });
            }
            if let Some(&value) = candidates.iter().find(|lambda| lambda.is_nan() || **lambda < 0.0) {
                return Err(ConfigError::Lambda { name, value });
            }
        }
        Ok(())
    }
}

/// Errors of a training configuration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A number out of range.
    #[error("{name} = {value} must be from {min} to {max}")]
    Range {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: usize,
        /// Smallest allowed.
        min: usize,
        /// Largest allowed.
        max: usize,
    },
    /// A filter that is none.
    #[error("prefilter = {value} must be at least 0 and less than 1")]
    Prefilter {
        /// Its value.
        value: f64,
    },
    /// RFL+S defined otherwise.
    #[error(
        "the kind rfl_s splits on the road only and has the road in its leaves; for other choices use the kind rfl"
    )]
    RflS,
    /// No candidate for a shrinkage.
    #[error("{name} has no candidates; give at least one")]
    NoCandidate {
        /// The setting.
        name: &'static str,
    },
    /// A shrinkage that is negative or not a number.
    #[error("{name} = {value} must not be negative")]
    Lambda {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}
