//! Settings of the training as a user gives them, and the configuration of each kind that they make.

use super::super::named;
use crate::control::ControlVariant;
use crate::residual::gp::GpConfig;
use crate::residual::{CommandPrior, Kind, LambdaChoice, TrainConfig, TreeFeatures};
use clap::Args;

/// Settings of the training; those not given are the kind's defaults.
#[derive(Debug, Args)]
#[command(next_help_heading = "Tuning")]
pub(super) struct TrainSettings {
    /// Window of commands in steps: it should cover the actuator's delay and four of its time constants [default: 28;
    /// of a truck 60]
    #[arg(long)]
    window: Option<usize>,
    /// Trees of a forest [default: 20]
    #[arg(long)]
    trees: Option<usize>,
    /// Depth of the trees [default: 6]
    #[arg(long)]
    depth: Option<usize>,
    /// Features tried at each split of a forest [default: 8; rfl_s: 3, all that it has]
    #[arg(long, value_name = "N")]
    features_per_split: Option<usize>,
    /// Fewest samples in a leaf [default: 100 with linear leaves, 20 with constant ones]
    #[arg(long, value_name = "N")]
    min_leaf: Option<usize>,
    /// Shrinkage of linear leaves to the global fit: a number, held-out (the number with the least error on samples
    /// that a tree has not seen) or least-squares (not at all: the paper's)
    #[arg(long, default_value = "held-out", value_parser = lambda)]
    lambda: Lambda,
    /// Memory of the filter on linear leaves' samples before the fit, 0 (none) to less than 1. Measured states are
    /// noisy, and the noise of one-step labels is mostly of high frequency, where it hides the response to commands
    /// [default: 0.8; with --lambda least-squares 0, the paper's way]
    #[arg(long, value_name = "MEMORY")]
    prefilter: Option<f64>,
    /// No prior for the effects of past commands: shrink them towards zero. Without --no-prior towards those of the actuator that
    /// the logs show
    #[arg(long)]
    no_prior: bool,
    /// Features that trees split on [default: errors; rfl_s: road]
    #[arg(long, value_name = "WHAT", hide_possible_values = true, value_parser = named(TreeFeatures::ALL, TreeFeatures::name, TreeFeatures::meaning))]
    tree_features: Option<TreeFeatures>,
    /// Curvature, its rate and curvature times speed squared in linear leaves, too [rfl_s: always]
    #[arg(long)]
    road_regressors: bool,
    /// So many of the newest error states in linear leaves, too: they fit better, and suffer from sensor noise
    #[arg(long, value_name = "N", default_value_t = 0)]
    state_regressors: usize,
    /// Most points of a Gaussian process (gp_nmpc) [default: 300]
    #[arg(long, value_name = "N")]
    points: Option<usize>,
    /// Samples that the hyperparameters of a Gaussian process are fitted on: time grows with their cube (gp_nmpc) [default: 400]
    #[arg(long, value_name = "N")]
    hyperparameter_samples: Option<usize>,
    /// Seed of all that is random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Threads; 0 for all there are. The model does not depend on it
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// Shrinkage, as a user writes it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Lambda {
    HeldOut,
    LeastSquares,
    Fixed(f64),
}

fn lambda(text: &str) -> Result<Lambda, String> {
    match text {
        "held-out" => Ok(Lambda::HeldOut),
        "least-squares" => Ok(Lambda::LeastSquares),
        number => match number.parse::<f64>() {
            Ok(value) if value >= 0.0 => Ok(Lambda::Fixed(value)),
            _ => Err("give a number from 0, held-out or least-squares".to_owned()),
        },
    }
}

impl TrainSettings {
    /// The options given that a kind does not have.
    pub fn without_effect(&self, variant: ControlVariant) -> Vec<&'static str> {
        let is = |of: fn(Kind) -> bool| variant.residual().is_some_and(of);
        let (forest, trees, linear) = (is(Kind::is_forest), is(Kind::has_trees), is(Kind::is_linear));
        let process = variant == ControlVariant::GpNmpc;
        let options = [
            ("--trees", self.trees.is_some(), forest),
            ("--features-per-split", self.features_per_split.is_some(), forest),
            ("--depth", self.depth.is_some(), trees),
            ("--min-leaf", self.min_leaf.is_some(), trees),
            ("--tree-features", self.tree_features.is_some(), trees),
            ("--lambda", self.lambda != Lambda::HeldOut, linear),
            ("--prefilter", self.prefilter.is_some(), linear),
            ("--road-regressors", self.road_regressors, linear),
            ("--state-regressors", self.state_regressors > 0, linear),
            ("--points", self.points.is_some(), process),
            ("--hyperparameter-samples", self.hyperparameter_samples.is_some(), process),
        ];
        options.into_iter().filter(|(_, given, has)| *given && !has).map(|(name, ..)| name).collect()
    }

    /// The configuration for a kind. For all kinds at once, each takes only the settings that it has.
    pub fn config(&self, kind: Kind, all: bool, window: usize, prior: Option<CommandPrior>) -> TrainConfig {
        let mut config = TrainConfig::new(kind);
        config.window = self.window.unwrap_or(window);
        config.prior = prior.filter(|_| !self.no_prior);
        config.trees = self.trees.unwrap_or(config.trees);
        config.depth = self.depth.unwrap_or(config.depth);
        config.features_per_split = self.features_per_split.unwrap_or(config.features_per_split);
        config.min_leaf = self.min_leaf.unwrap_or(config.min_leaf);
        if !(all && kind == Kind::RflS) {
            config.tree_features = self.tree_features.unwrap_or(config.tree_features);
        }
        config.regressors.road |= self.road_regressors;
        config.regressors.states = self.state_regressors;
        match self.lambda {
            Lambda::HeldOut => {}
            Lambda::LeastSquares => {
                config.lambda = LambdaChoice::LeastSquares;
                config.prefilter = 0.0;
            }
            Lambda::Fixed(lambda) => config.lambda = LambdaChoice::Fixed(lambda),
        }
        config.prefilter = self.prefilter.unwrap_or(config.prefilter);
        (config.seed, config.threads) = (self.seed, self.threads);
        config
    }

    /// The configuration of a Gaussian process for a controller that counts on this friction.
    pub fn gp_config(&self, friction: f64) -> GpConfig {
        let (points, hyperparameter_samples) =
            (self.points.unwrap_or(300), self.hyperparameter_samples.unwrap_or(400));
        let Self { seed, threads, .. } = *self;
        GpConfig { friction, points, hyperparameter_samples, seed, threads, ..GpConfig::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::FromArgMatches as _;

    #[test]
    fn options_that_a_kind_does_not_have_are_named() {
        let read = TrainSettings::augment_args(clap::Command::new("train").no_binary_name(true))
            .get_matches_from(["--trees", "5", "--depth", "2", "--lambda", "1", "--points", "9"]);
        let settings = TrainSettings::from_arg_matches(&read).unwrap();
        for (kind, idle) in [
            (ControlVariant::Linear, &["--trees", "--depth", "--points"][..]),
            (ControlVariant::Rt, &["--trees", "--lambda", "--points"]),
            (ControlVariant::RflS, &["--points"]),
            (ControlVariant::GpNmpc, &["--trees", "--depth", "--lambda"]),
        ] {
            assert_eq!(settings.without_effect(kind), idle);
        }
    }
}
