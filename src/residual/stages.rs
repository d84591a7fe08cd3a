//! The stages of the training: the global fit, the trees, and the fits of their leaves.

use super::ROAD;
use super::dataset::Windows;
use super::forest::{self, Forest, ForestConfig};
use super::global::{self, GlobalFit};
use super::leaf::{self, Design, Expectation, LeafFit, LeafModels, Members};
use super::least_squares::Theta;
use super::measure::{ErrorSums, FitErrors, fit};
use super::prior::Means;
use super::train_config::{LambdaChoice, TrainConfig};
use crate::numerics::parallel;

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

/// Shared data of the stages of training.
pub(super) struct Job<'a, const S: usize> {
    pub windows: &'a Windows<'a, S>,
    pub config: &'a TrainConfig,
    pub threads: usize,
    pub progress: &'a (dyn Fn(Progress) + Sync),
    pub sample_time: f64,
    pub min_model_speed: f64,
    /// The prior's means between two speeds.
    pub means_between: &'a (dyn Fn([f64; 2]) -> Option<Means<S>> + Sync),
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

/// Candidates for the scale of a prior: `lambda` of coefficients in units of the prior's spread.
const PRIOR_SCALES: [f64; 9] = [1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 1e-1, 1.0, f64::INFINITY];

/// Forest and leaves as they were learned.
pub(super) struct LearnedForest<const S: usize> {
    pub forest: Forest,
    pub leaves: LeafModels<S>,
    pub global_lambda: Option<f64>,
    pub leaf_lambda: Option<f64>,
    pub lambdas: Vec<(f64, f64)>,
    pub held_out: Option<FitErrors<S>>,
    pub smallest_leaf: usize,
    pub determined: Option<f64>,
}

/// One fit of a tree's leaves: on rows with a weight; the others test it.
struct TreeFit {
    tree: usize,
    weights: Vec<u16>,
}

impl<const S: usize> Job<'_, S> {
    /// Forest and leaves, from a design of `p` regressors.
    pub fn learn(&self, p: usize) -> LearnedForest<S> {
        let means = self.means();
        let design = self.design(p, means.is_some());
        let of_all = means.as_ref().map(|means| design.scaled_commands(&self.mean(means, None)));
        let linear = self.config.kind.is_linear();
        let (global, determined) = linear.then(|| self.global(&design, of_all.as_deref())).unzip();
        let theta = global.as_ref().map_or_else(|| vec![[0.0; S]; p], |fit| fit.theta.clone());
        let (global_lambda, determined) = (global.map(|fit| fit.lambda), determined.flatten());
        if !self.config.kind.has_trees() {
            return LearnedForest { global_lambda, determined, ..self.without_trees(&design, &theta) };
        }
        let differs = |rows: &[u32]| {
            let (Some(means), Some(of_all)) = (&means, &of_all) else { return vec![[0.0; S]; p] };
            let mut theta = design.scaled_commands(&self.mean(means, Some(rows)));
            theta.as_flattened_mut().iter_mut().zip(of_all.as_flattened()).for_each(|(t, of)| *t -= of);
            theta
        };
        let expectation = Expectation { differs: &differs };
        let grown = self.grow(&design.labels);
        let fitting = Fitting {
            design: &design,
            remainder: design.remainder(&theta),
            theta,
            expected: means.is_some().then_some(&expectation),
            leaf_of: self.leaves_of(&grown.forest),
            linear,
        };
        let (candidates, chosen) = self.candidates();
        let tests = self.members(&grown.in_bag, chosen.is_none());
        let tested = self.held_out(&fitting, &tests, &candidates);
        let best = tested.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let fit_used = chosen.or(best.map(|best| best.0)).unwrap_or(LeafFit::LeastSquares);
        let (leaves, smallest_leaf) = self.all_leaves(&fitting, &grown.in_bag, fit_used);
        self.say(TrainingStage::Leaves, tests.len(), tests.len());
        let lambda_of = |fit: LeafFit| match fit {
            LeafFit::Ridge { lambda } => Some(lambda),
            LeafFit::LeastSquares => None,
        };
        let labels = leaf::accumulate(self.threads, design.len(), |i| Some(design.labels[i]));
        LearnedForest {
            forest: grown.forest,
            leaves,
            global_lambda,
            leaf_lambda: linear.then(|| lambda_of(fit_used)).flatten(),
            lambdas: tested.iter().filter_map(|(c, score, _)| lambda_of(*c).map(|l| (l, *score))).collect(),
            held_out: tested.iter().find(|(c, ..)| *c == fit_used).map(|(_, _, sums)| fit(*sums, labels)),
            smallest_leaf,
            determined,
        }
    }

    /// The global fit, about the prior's mean over all rows if there is one, and the share that the log determines.
    fn global(&self, design: &Design<S>, of_all: Option<&[[f64; S]]>) -> (GlobalFit<S>, Option<f64>) {
        self.say(TrainingStage::Global, 0, 1);
        let plain = [0.0];
        let candidates: &[f64] = match (&self.config.lambda, of_all) {
            (LambdaChoice::LeastSquares, _) => &plain,
            (_, Some(_)) => &PRIOR_SCALES,
            (_, None) => &self.config.global_lambda,
        };
        let Some(of_all) = of_all else {
            return (global::fit(design, &design.labels, candidates, self.threads), None);
        };
        let mut fit = global::fit(design, &design.remainder(of_all), candidates, self.threads);
        let determined = design.determined(self.config.window, fit.lambda);
        fit.theta.as_flattened_mut().iter_mut().zip(of_all.as_flattened()).for_each(|(t, of)| *t += of);
        (fit, Some(determined))
    }

    /// The global fit as a forest of one leaf.
    fn without_trees(&self, design: &Design<S>, theta: &[[f64; S]]) -> LearnedForest<S> {
        let samples = self.windows.len();
        let leaves = LeafModels {
            regressors: design.regressors as u32,
            theta: design.unscaled(theta),
            command_range: vec![self.command_range(0..samples)],
        };
        LearnedForest {
            forest: Forest::single_leaf(),
            leaves,
            global_lambda: None,
            leaf_lambda: None,
            lambdas: vec![],
            held_out: None,
            smallest_leaf: samples,
            determined: None,
        }
    }

    /// Candidates for the fit of the leaves, and the one that needs no test.
    fn candidates(&self) -> (Vec<LeafFit>, Option<LeafFit>) {
        let ridge = |&lambda: &f64| LeafFit::Ridge { lambda };
        let only = match &self.config.lambda {
            _ if !self.config.kind.is_linear() => LeafFit::LeastSquares,
            LambdaChoice::LeastSquares => LeafFit::LeastSquares,
            LambdaChoice::Fixed(lambda) => ridge(lambda),
            LambdaChoice::HeldOut(all) => return (all.iter().map(ridge).collect(), None),
        };
        (vec![only], Some(only))
    }

    /// Held-out error of each candidate: its score, and the sums that the score is made of.
    fn held_out(
        &self,
        fitting: &Fitting<'_, S>,
        tests: &[TreeFit],
        candidates: &[LeafFit],
    ) -> Vec<(LeafFit, f64, ErrorSums<S>)> {
        let (design, p) = (fitting.design, fitting.design.regressors);
        let fitted = parallel::map(self.threads, tests.len(), |i| {
            self.say(TrainingStage::Leaves, i, tests.len());
            fitting.fit(&tests[i], candidates)
        });
        let spread = global::spread(&design.labels);
        let mut held_out = vec![];
        for (c, &candidate) in candidates.iter().enumerate().filter(|_| !tests.is_empty()) {
            let sums = leaf::accumulate(self.threads, design.len(), |row| {
                let mut sum = [0.0; S];
                let mut count = 0.0;
                for (member, fitted) in tests.iter().zip(&fitted).filter(|(m, _)| m.weights[row] == 0) {
                    let leaf = fitting.leaf_of[member.tree].leaf[row] as usize;
                    let one = design.predict(row, &fitted[c][leaf * p..][..p]);
                    sum.iter_mut().zip(&one).for_each(|(sum, x)| *sum += x);
                    count += 1.0;
                }
                (count > 0.0).then(|| std::array::from_fn(|o| design.labels[row][o] - sum[o] / count))
            });
            let score = global::score(&sums.1, &spread) / (sums.0.max(1) * S) as f64;
            held_out.push((candidate, score, sums));
        }
        held_out
    }

    /// The leaves themselves, on all rows of each tree's bag, and the samples in the smallest.
    fn all_leaves(
        &self,
        fitting: &Fitting<'_, S>,
        in_bag: &[Vec<u16>],
        fit_used: LeafFit,
    ) -> (LeafModels<S>, usize) {
        let fitted = parallel::map(self.threads, in_bag.len(), |tree| {
            let bag = TreeFit { tree, weights: in_bag[tree].clone() };
            let members = fitting.members(&bag);
            let theta = fitting.fit(&bag, &[fit_used]).pop().unwrap_or_default();
            let range = |leaf| self.command_range(members.of(leaf));
            let smallest = (0..members.leaves()).map(|leaf| members.count(leaf)).min().unwrap_or(0);
            (theta, (0..members.leaves()).map(range).collect::<Vec<_>>(), smallest)
        });
        let regressors = fitting.design.regressors as u32;
        let mut leaves = LeafModels { regressors, theta: vec![], command_range: vec![] };
        let mut smallest_leaf = usize::MAX;
        for (theta, ranges, smallest) in fitted {
            leaves.theta.extend(fitting.design.unscaled(&theta));
            leaves.command_range.extend(ranges);
            smallest_leaf = smallest_leaf.min(smallest);
        }
        (leaves, smallest_leaf)
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

/// The fits of the leaves of grown trees.
struct Fitting<'a, const S: usize> {
    design: &'a Design<S>,
    /// The global fit, and the labels less it.
    theta: Theta<S>,
    remainder: Vec<[f64; S]>,
    expected: Option<&'a Expectation<'a, S>>,
    leaf_of: Vec<TreeLeaves>,
    linear: bool,
}

impl<const S: usize> Fitting<'_, S> {
    fn members(&self, member: &TreeFit) -> Members {
        let tree = &self.leaf_of[member.tree];
        Members::new(&tree.leaf, tree.leaves, &member.weights)
    }

    /// Coefficients of all leaves of a tree, for each way to fit them.
    fn fit(&self, member: &TreeFit, fits: &[LeafFit]) -> Vec<Theta<S>> {
        let (members, weights) = (self.members(member), &member.weights);
        if self.linear {
            let Self { design, remainder, theta, expected, .. } = self;
            leaf::linear(design, remainder, theta, *expected, &members, weights, fits)
        } else {
            vec![leaf::constant(&self.design.labels, &members, weights); fits.len()]
        }
    }
}
