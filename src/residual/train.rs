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
use super::forest::{self, Forest, ForestConfig};
use super::global;
use super::leaf::{self, Design, Expectation, LeafFit, LeafModels, Members};
use super::least_squares::Theta;
use super::model::{Kind, Range, Regressors, ResidualModelFor, Schema, Training};
use super::prior::Means;
use super::recorded::ROAD_NAMES;
use super::train_config::{ConfigError, LambdaChoice, TrainConfig};
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

/// Stage of the training.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrainingStage {
    /// The global fit.
    Global,
    /// Growing trees.
    Trees,
    /// Fitting leaves.
    Leaves,
    /// Fitting the hyperparameters of a Gaussian process.
    Hyperparameters,
    /// Its dictionary and weights.
    Weights,
    /// Measuring the fit.
    Report,
}

/// A sign of life.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Stage of the training.
    pub stage: TrainingStage,
    /// Parts of the stage done.
    pub done: usize,
    /// Parts of the stage.
    pub total: usize,
}

/// Errors of one-step predictions of the states, `[e1 m, e1' m/s, e2 rad, e2' rad/s, ..]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitErrors<const S: usize = ERRORS> {
    /// Samples measured.
    pub samples: usize,
    /// Root mean square error.
    pub rmse: [f64; S],
    /// Largest magnitude.
    pub max: [f64; S],
    /// Root mean square of the label itself: the nominal model's error.
    pub nominal_rmse: [f64; S],
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
    let min_leaf = if config.kind.has_trees() { config.min_leaf } else { 1 };
    let needed = (2 * min_leaf).max(10 * p);
    if windows.len() < needed {
        let found = data.report();
        return Err(TrainError::TooFewSamples {
            samples: windows.len(),
            window: config.window,
            needed,
            regressors: p,
            min_leaf,
            rows: found.rows,
            left_out: found.not_finite + found.implausible,
            gaps: found.gaps,
        });
    }
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

impl<V: LateralVehicle<S>, const S: usize> ResidualModelFor<V, S> {
    /// The model's one-step errors on other data, labelled for the same vehicle and sample time.
    #[must_use]
    pub fn measure(&self, data: &DataSet<V, S>) -> FitErrors<S> {
        measure(self, &data.windows(self.schema.window), parallel::threads(0))
    }
}

fn measure<V: LateralVehicle<S>, const S: usize>(
    model: &ResidualModelFor<V, S>,
    windows: &Windows<S>,
    threads: usize,
) -> FitErrors<S> {
    // Looking up wants room of its own on each thread: a chunk of samples at a time.
    let chunks = parallel::chunks(windows.len(), 2048);
    let errors = parallel::map(threads, chunks.len(), |chunk| {
        let mut features = vec![0.0; model.features()];
        let mut room = model.workspace();
        let states = S * model.schema.regressors.states;
        let error = |i| {
            windows.features(i, &mut features);
            model.coefficients(&features, &[], &mut room);
            let newest = &windows.states(i).as_flattened()[S * windows.window() - states..];
            let (label, fit) = (windows.label(i), room.residual(windows.commands(i), newest));
            std::array::from_fn(|o| label[o] - fit[o])
        };
        chunks[chunk].clone().map(error).collect::<Vec<[f64; S]>>()
    });
    let errors = errors.concat();
    fit(
        leaf::accumulate(threads, errors.len(), |i| Some(errors[i])),
        leaf::accumulate(threads, windows.len(), |i| Some(windows.label(i))),
    )
}

type ErrorSums<const S: usize> = (usize, [f64; S], [f64; S]);

fn fit<const S: usize>(
    (samples, squares, max): ErrorSums<S>,
    (labels, label_squares, _): ErrorSums<S>,
) -> FitErrors<S> {
    let root = |squares: [f64; S], n: usize| squares.map(|s| (s / n.max(1) as f64).sqrt());
    FitErrors { samples, rmse: root(squares, samples), max, nominal_rmse: root(label_squares, labels) }
}

/// Filters regressors and labels alike, `x_k += memory x_{k-1}` along each stretch. Linear relations keep their
/// coefficients. The noise of one-step labels from measured states, `e_{k+1} - A e_k`, loses its high frequencies,
/// which carry no information (Ljung, System Identification, ch. 7.4 and 13.7).
fn prefilter<const S: usize>(windows: &Windows<S>, memory: f64, z: &mut [f64], labels: &mut [[f64; S]]) {
    let p = z.len() / labels.len().max(1);
    for i in (1..windows.len()).filter(|&i| memory > 0.0 && windows.follows(i)) {
        let (before, now) = z.split_at_mut(i * p);
        now[..p].iter_mut().zip(&before[(i - 1) * p..]).for_each(|(z, before)| *z += memory * before);
        let before = labels[i - 1];
        labels[i].iter_mut().zip(before).for_each(|(label, before)| *label += memory * before);
    }
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

/// Shared data of the parts of training.
struct Job<'a, const S: usize> {
    windows: &'a Windows<'a, S>,
    config: &'a TrainConfig,
    threads: usize,
    progress: &'a (dyn Fn(Progress) + Sync),
    sample_time: f64,
    min_model_speed: f64,
    /// The prior's means between two speeds.
    means_between: &'a (dyn Fn([f64; 2]) -> Option<Means<S>> + Sync),
}

/// Candidates for the scale of a prior: `lambda` of coefficients in units of the prior's spread.
const PRIOR_SCALES: [f64; 9] = [1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 1e-1, 1.0, f64::INFINITY];

/// Result of the training.
struct LearnedForest<const S: usize> {
    forest: Forest,
    leaves: LeafModels<S>,
    global_lambda: Option<f64>,
    leaf_lambda: Option<f64>,
    lambdas: Vec<(f64, f64)>,
    held_out: Option<FitErrors<S>>,
    smallest_leaf: usize,
    determined: Option<f64>,
}

/// One fit of a tree's leaves: on rows with a weight; the others test it.
struct TreeFit {
    tree: usize,
    weights: Vec<u16>,
}

impl<const S: usize> Job<'_, S> {
    fn learn(&self, p: usize) -> LearnedForest<S> {
        let (config, windows) = (self.config, self.windows);
        let means = self.means();
        let design = self.design(p, means.is_some());
        let linear = config.kind.is_linear();
        let of_all = means.as_ref().map(|means| design.scaled_commands(&self.mean(means, None)));
        let mut determined = None;
        let global = linear.then(|| {
            self.say(TrainingStage::Global, 0, 1);
            let plain = [0.0];
            let candidates: &[f64] = match (&config.lambda, &means) {
                (LambdaChoice::LeastSquares, _) => &plain,
                (_, Some(_)) => &PRIOR_SCALES,
                (_, None) => &config.global_lambda,
            };
            let Some(of_all) = &of_all else {
                return global::fit(&design, &design.labels, candidates, self.threads);
            };
            let mut fit = global::fit(&design, &design.remainder(of_all), candidates, self.threads);
            determined = Some(design.determined(config.window, fit.lambda));
            fit.theta.as_flattened_mut().iter_mut().zip(of_all.as_flattened()).for_each(|(t, of)| *t += of);
            fit
        });
        let differs = |rows: &[u32]| {
            let (Some(means), Some(of_all)) = (&means, &of_all) else { return vec![[0.0; S]; p] };
            let mut theta = design.scaled_commands(&self.mean(means, Some(rows)));
            theta.as_flattened_mut().iter_mut().zip(of_all.as_flattened()).for_each(|(t, of)| *t -= of);
            theta
        };
        let expectation = Expectation { differs: &differs };
        let expected = means.is_some().then_some(&expectation);
        if !config.kind.has_trees() {
            let theta = global.as_ref().map_or_else(|| vec![[0.0; S]; p], |fit| fit.theta.clone());
            let leaves = LeafModels {
                regressors: p as u32,
                theta: design.unscaled(&theta),
                command_range: vec![self.command_range(0..windows.len())],
            };
            return LearnedForest {
                forest: Forest::single_leaf(),
                leaves,
                global_lambda: global.map(|fit| fit.lambda),
                leaf_lambda: None,
                lambdas: vec![],
                held_out: None,
                smallest_leaf: windows.len(),
                determined,
            };
        }
        let grown = self.grow(&design.labels);
        let leaf_of = self.leaves_of(&grown.forest);
        let (candidates, chosen): (Vec<LeafFit>, Option<LeafFit>) = match &config.lambda {
            _ if !linear => (vec![LeafFit::LeastSquares], Some(LeafFit::LeastSquares)),
            LambdaChoice::LeastSquares => (vec![LeafFit::LeastSquares], Some(LeafFit::LeastSquares)),
            &LambdaChoice::Fixed(lambda) => {
                (vec![LeafFit::Ridge { lambda }], Some(LeafFit::Ridge { lambda }))
            }
            LambdaChoice::HeldOut(all) => {
                (all.iter().map(|&lambda| LeafFit::Ridge { lambda }).collect(), None)
            }
        };
        let theta = global.as_ref().map_or_else(|| vec![[0.0; S]; p], |fit| fit.theta.clone());
        let remainder = design.remainder(&theta);
        let fit_leaves = |member: &TreeFit, fits: &[LeafFit]| -> Vec<Theta<S>> {
            let tree = &leaf_of[member.tree];
            let members = Members::new(&tree.leaf, tree.leaves, &member.weights);
            if linear {
                leaf::linear(&design, &remainder, &theta, expected, &members, &member.weights, fits)
            } else {
                vec![leaf::constant(&design.labels, &members, &member.weights); fits.len()]
            }
        };

        // Held-out error of each candidate.
        let tests = self.members(&grown.in_bag, chosen.is_none());
        let fitted = parallel::map(self.threads, tests.len(), |i| {
            self.say(TrainingStage::Leaves, i, tests.len());
            fit_leaves(&tests[i], &candidates)
        });
        let spread = global::spread(&design.labels);
        let mut held_out: Vec<(LeafFit, f64, ErrorSums<S>)> = vec![];
        for (c, &candidate) in candidates.iter().enumerate().filter(|_| !tests.is_empty()) {
            let sums = leaf::accumulate(self.threads, design.len(), |row| {
                let mut sum = [0.0; S];
                let mut count = 0.0;
                for (member, fitted) in tests.iter().zip(&fitted).filter(|(m, _)| m.weights[row] == 0) {
                    let leaf = leaf_of[member.tree].leaf[row] as usize;
                    let one = design.predict(row, &fitted[c][leaf * p..][..p]);
                    sum.iter_mut().zip(&one).for_each(|(sum, x)| *sum += x);
                    count += 1.0;
                }
                (count > 0.0).then(|| std::array::from_fn(|o| design.labels[row][o] - sum[o] / count))
            });
            let score = global::score(&sums.1, &spread) / (sums.0.max(1) * S) as f64;
            held_out.push((candidate, score, sums));
        }
        let best = held_out.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let fit_used = chosen.or(best.map(|best| best.0)).unwrap_or(LeafFit::LeastSquares);

        // The leaves themselves, on all rows of each tree's bag.
        let bags: Vec<TreeFit> = (0..grown.in_bag.len())
            .map(|tree| TreeFit { tree, weights: grown.in_bag[tree].clone() })
            .collect();
        let final_leaves = parallel::map(self.threads, bags.len(), |i| {
            let tree = &leaf_of[bags[i].tree];
            let members = Members::new(&tree.leaf, tree.leaves, &bags[i].weights);
            let theta = fit_leaves(&bags[i], &[fit_used]).pop().unwrap_or_default();
            let range = |leaf| self.command_range(members.of(leaf));
            let smallest = (0..members.leaves()).map(|leaf| members.count(leaf)).min().unwrap_or(0);
            (theta, (0..members.leaves()).map(range).collect::<Vec<_>>(), smallest)
        });
        self.say(TrainingStage::Leaves, tests.len(), tests.len());
        let mut leaves = LeafModels { regressors: p as u32, theta: vec![], command_range: vec![] };
        let mut smallest_leaf = usize::MAX;
        for (theta, ranges, smallest) in final_leaves {
            leaves.theta.extend(design.unscaled(&theta));
            leaves.command_range.extend(ranges);
            smallest_leaf = smallest_leaf.min(smallest);
        }
        let lambda_of = |fit: LeafFit| match fit {
            LeafFit::Ridge { lambda } => Some(lambda),
            LeafFit::LeastSquares => None,
        };
        let labels = leaf::accumulate(self.threads, design.len(), |i| Some(design.labels[i]));
        LearnedForest {
            forest: grown.forest,
            leaves,
            global_lambda: global.map(|fit| fit.lambda),
            leaf_lambda: linear.then(|| lambda_of(fit_used)).flatten(),
            lambdas: held_out.iter().filter_map(|(c, score, _)| lambda_of(*c).map(|l| (l, *score))).collect(),
            held_out: held_out.iter().find(|(c, ..)| *c == fit_used).map(|(_, _, sums)| fit(*sums, labels)),
            smallest_leaf,
            determined,
        }
    }

    /// Expectation of the prior at each speed; none without a prior, or without a use for it.
    fn means(&self) -> Option<Means<S>> {
        if !self.config.kind.is_linear() || self.config.lambda == LambdaChoice::LeastSquares {
            return None;
        }
        let speed = |i: usize| self.windows.road(i)[0].max(self.min_model_speed);
        let range = (0..self.windows.len()).fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], i| {
            [least.min(speed(i)), most.max(speed(i))]
        });
        // A log whose speeds have no model has no labels either.
        (self.means_between)(range)
    }

    /// The mean of the prior over some rows, or over all.
    fn mean(&self, means: &Means<S>, rows: Option<&[u32]>) -> Theta<S> {
        let speed = |i: usize| self.windows.road(i)[0].max(self.min_model_speed);
        match rows {
            Some(rows) => means.over(rows.iter().map(|&i| speed(i as usize))),
            None => means.over((0..self.windows.len()).map(speed)),
        }
    }

    fn say(&self, stage: TrainingStage, done: usize, total: usize) {
        (self.progress)(Progress { stage, done, total });
    }

    /// Regressors and labels of all samples.
    fn design(&self, p: usize, with_prior: bool) -> Design<S> {
        let windows = self.windows;
        let mut labels: Vec<[f64; S]> = (0..windows.len()).map(|i| windows.label(i)).collect();
        let mut z = Vec::with_capacity(windows.len() * p);
        let mut features = vec![0.0; S * windows.window() + ROAD];
        for i in 0..windows.len() {
            if self.config.kind.is_linear() {
                windows.features(i, &mut features);
                self.config.regressors.write::<S>(&features, windows.commands(i), &mut z);
            } else {
                z.push(1.0);
            }
        }
        if self.config.kind.is_linear() {
            prefilter(windows, self.config.prefilter, &mut z, &mut labels);
        }
        if let Some(prior) = self.config.prior.filter(|_| with_prior) {
            let root = prior.root(self.sample_time, windows.window());
            return Design::with_prior(p, z, labels, root);
        }
        Design::new(p, z, labels)
    }

    fn grow(&self, labels: &[[f64; S]]) -> forest::GrownForest {
        let config = self.config;
        let forest = config.kind.is_forest();
        let features = config.tree_features.indices(S, config.window);
        let trees = if forest { config.trees } else { 1 };
        self.say(TrainingStage::Trees, 0, trees);
        let growth = ForestConfig {
            trees,
            depth: config.depth,
            min_leaf: config.min_leaf,
            features_per_split: if forest { config.features_per_split } else { usize::MAX },
            bootstrap: forest.then_some(config.bootstrap_block),
            resolution: config.resolution,
            seed: config.seed,
            threads: self.threads,
        };
        forest::grow(self.windows, &features, labels, &growth, &|done| {
            self.say(TrainingStage::Trees, done, trees)
        })
    }

    /// For each tree the leaf of each row, from 0 within the tree.
    fn leaves_of(&self, forest: &Forest) -> Vec<TreeLeaves> {
        let rows = self.windows.len();
        let chunks = parallel::chunks(rows, 2048);
        let found = parallel::map(self.threads, chunks.len(), |chunk| {
            let mut features = vec![0.0; S * self.windows.window() + ROAD];
            let mut leaves = vec![Vec::with_capacity(chunks[chunk].len()); forest.trees()];
            for row in chunks[chunk].clone() {
                self.windows.features(row, &mut features);
                forest.look_up(&features, |tree, leaf| leaves[tree].push(leaf as u32));
            }
            leaves
        });
        let first = forest.first_leaves();
        (0..forest.trees())
            .map(|tree| TreeLeaves {
                leaf: found
                    .iter()
                    .flat_map(|chunk| chunk[tree].iter().map(|leaf| leaf - first[tree]))
                    .collect(),
                leaves: (first[tree + 1] - first[tree]) as usize,
            })
            .collect()
    }

    /// Members fitted to test candidates: each tree on its bag; a single tree once without each fold.
    fn members(&self, in_bag: &[Vec<u16>], choice: bool) -> Vec<TreeFit> {
        if self.config.kind.is_forest() {
            return in_bag
                .iter()
                .cloned()
                .enumerate()
                .map(|(tree, weights)| TreeFit { tree, weights })
                .collect();
        }
        let n = self.windows.len();
        let folds = if choice { global::FOLDS } else { 0 };
        (0..folds)
            .map(|fold| {
                let weights = (0..n).map(|row| u16::from(global::fold(row, n) != fold)).collect();
                TreeFit { tree: 0, weights }
            })
            .collect()
    }

    fn command_range(&self, rows: impl IntoIterator<Item = usize>) -> [f64; 2] {
        let commands = rows.into_iter().flat_map(|row| self.windows.commands(row));
        commands.fold([f64::INFINITY, f64::NEG_INFINITY], |[min, max], &u| [min.min(u), max.max(u)])
    }
}

/// Leaf of each row in one tree.
struct TreeLeaves {
    leaf: Vec<u32>,
    leaves: usize,
}
