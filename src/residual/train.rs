//! Training: from samples to a model, and the quality of its fit.
//!
//! 1. Global ridge fit of the linear regressors, `lambda` by cross-validation.
//! 2. Trees on the features that are already decided; each tree on a bootstrap sample.
//! 3. In each leaf a constant, or a linear model shrunk towards the global fit. The `lambda` of all leaves has the
//!    least error on held-out samples. They are out of bag for a forest; by cross-validation within the tree's leaves
//!    for a single tree.
//!
//! The same data, configuration and seed give the same bits on any number of threads.

use super::ROAD;
use super::dataset::{DataSet, Windows};
use super::measure::{FitErrors, measure};
use super::model::ResidualModelFor;
use super::prior::Means;
use super::recorded::{DataReport, ROAD_NAMES};
use super::schema::{Kind, Range, Regressors, Schema, Training};
use super::stages::{Job, Progress, TrainingStage};
use super::train_config::{ConfigError, TrainConfig};
use crate::nominal::{ERRORS, LateralVehicle};
use crate::numerics::parallel;
use crate::signal;
use crate::vehicle::SingleTrack;

/// Reasons for which no model was trained.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrainError {
    /// A setting is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Too little data.
    #[error(
        "{samples} samples with a full window of {window} steps, and {needed} are needed for {regressors} regressors and leaves of {min_leaf} samples; {rows} rows were recorded, of which {left_out} were left out, with {gaps} gaps: drive longer, or choose a shorter window"
    )]
    TooFewSamples {
        /// Samples there are.
        samples: usize,
        /// Window, steps.
        window: usize,
        /// Samples needed.
        needed: usize,
        /// Regressors of a leaf.
        regressors: usize,
        /// Fewest samples in a leaf.
        min_leaf: usize,
        /// Rows of the drives.
        rows: usize,
        /// Rows left out.
        left_out: usize,
        /// Gaps.
        gaps: usize,
    },
    /// Test data made for another vehicle or sample time.
    #[error(
        "the test data were labelled for another vehicle, sample time or minimum model speed than the training data"
    )]
    TestData,
}

/// Report of the training.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainReport<const S: usize = ERRORS> {
    /// On the samples learned from.
    pub train: FitErrors<S>,
    /// On samples that the trees concerned did not see; for a single tree: its leaves. With `lambda` chosen on the same
    /// samples. None for kinds without trees, and for a single tree without a choice.
    pub held_out: Option<FitErrors<S>>,
    /// On the test data, if there are any.
    pub test: Option<FitErrors<S>>,
    /// Candidates for the leaves' `lambda` and their held-out error (mean square in units of the labels' variance,
    /// mean over outputs).
    pub lambdas: Vec<(f64, f64)>,
    /// Leaves of all trees.
    pub leaves: usize,
    /// Distinct samples in the smallest leaf.
    pub smallest_leaf: usize,
    /// Share of the window's directions that the log determines rather than the prior, 0 to 1; none without a prior.
    pub determined: Option<f64>,
}

/// A model and the quality of its fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Trained<V = SingleTrack, const S: usize = ERRORS> {
    /// The model.
    pub model: ResidualModelFor<V, S>,
    /// Quality of the fit.
    pub report: TrainReport<S>,
}

/// Trains a model on `data`, and measures it on `test` too.
///
/// `progress` is called from the threads that work.
///
/// # Errors
/// An impossible setting; too few samples; test data of another vehicle.
pub fn train<V: LateralVehicle<S>, const S: usize>(
    data: &DataSet<V, S>,
    test: Option<&DataSet<V, S>>,
    config: &TrainConfig,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Trained<V, S>, TrainError> {
    config.check()?;
    if test.is_some_and(|test| test.config != data.config || test.vehicle != data.vehicle) {
        return Err(TrainError::TestData);
    }
    let windows = data.windows(config.window);
    let p = if config.kind.is_linear() { config.regressors.count(S, config.window) } else { 1 };
    check_samples(windows.len(), config, p, data.report())?;
    let means_between = |range| {
        let of = |prior| Means::new(prior, &data.vehicle, range, data.config.sample_time, config.window);
        config.prior.as_ref().and_then(|prior| of(prior).ok())
    };
    let job = Job {
        windows: &windows,
        config,
        threads: parallel::threads(config.threads),
        progress,
        sample_time: data.config.sample_time,
        min_model_speed: data.config.min_model_speed,
        means_between: &means_between,
    };
    let learned = job.learn(p);
    progress(Progress { stage: TrainingStage::Report, done: 0, total: 1 });
    let schema = Schema {
        kind: config.kind,
        sample_time: data.config.sample_time,
        window: config.window,
        min_model_speed: data.config.min_model_speed,
        tree_features: config.tree_features,
        regressors: if config.kind.is_linear() { config.regressors } else { Regressors::default() },
        vehicle: data.vehicle,
        training: Training {
            data_hash: format!("{:016x}", data.hash()),
            samples: windows.len(),
            seed: config.seed,
            global_lambda: learned.global_lambda,
            leaf_lambda: learned.leaf_lambda,
        },
        ranges: if config.kind == Kind::None { vec![] } else { ranges::<V, S>(&windows) },
    };
    let model = ResidualModelFor::new(schema, learned.forest, learned.leaves);
    let report = TrainReport {
        train: measure(&model, &windows, job.threads),
        held_out: learned.held_out,
        test: test.map(|test| measure(&model, &test.windows(config.window), job.threads)),
        lambdas: learned.lambdas,
        leaves: model.forest.leaves(),
        smallest_leaf: learned.smallest_leaf,
        determined: learned.determined,
    };
    progress(Progress { stage: TrainingStage::Report, done: 1, total: 1 });
    Ok(Trained { model, report })
}

/// # Errors
/// Too few samples for so many regressors and for the leaves.
fn check_samples(
    samples: usize,
    config: &TrainConfig,
    regressors: usize,
    found: &DataReport,
) -> Result<(), TrainError> {
    let min_leaf = if config.kind.has_trees() { config.min_leaf } else { 1 };
    let needed = (2 * min_leaf).max(10 * regressors);
    if samples >= needed {
        return Ok(());
    }
    Err(TrainError::TooFewSamples {
        samples,
        window: config.window,
        needed,
        regressors,
        min_leaf,
        rows: found.rows,
        left_out: found.not_finite + found.implausible,
        gaps: found.gaps,
    })
}

/// Ranges of features and commands, in the order that [`Schema::ranges`] names.
fn ranges<V: LateralVehicle<S>, const S: usize>(windows: &Windows<S>) -> Vec<Range> {
    let states = V::STATES.map(|signal| signal.name);
    let mut ranges: Vec<Range> = states
        .into_iter()
        .chain(ROAD_NAMES)
        .chain(["steer_cmd"])
        .map(|name| Range {
            name: name.to_owned(),
            // The rate of change of curvature along the path is no signal of a log.
            unit: signal::find(name).map_or("1/m2", |signal| signal.unit.symbol).to_owned(),
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
        })
        .collect();
    let mut see = |i: usize, value: f64| {
        ranges[i].min = ranges[i].min.min(value);
        ranges[i].max = ranges[i].max.max(value);
    };
    for sample in 0..windows.len() {
        windows
            .states(sample)
            .iter()
            .for_each(|state| state.iter().enumerate().for_each(|(i, &x)| see(i, x)));
        windows.road(sample).iter().enumerate().for_each(|(i, &x)| see(S + i, x));
        windows.commands(sample).iter().for_each(|&u| see(S + ROAD, u));
    }
    ranges
}
