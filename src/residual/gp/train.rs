//! Training: from drives to a process, and the quality of its fit.
//!
//! 0. Amount of smoothing of the recorded states, by trial.
//! 1. Hyperparameters by maximum likelihood on some hundred samples drawn at random.
//! 2. A dictionary for each output, by posterior variance, from some thousand samples drawn at random.
//! 3. Weights from all samples.
//!
//! The same data, configuration and seed give the same bits on any number of threads.

use super::dictionary::choose;
use super::fit::{FitConfig, Fitted, fit};
use super::model::{GpModelFor, GpOutput, GpSchema, GpTraining};
use super::samples::Samples;
use super::smoothing::{self, StateSmoothing};
use super::sparse::{MAX_POINTS, Sparse};
use super::vehicle::{GpVehicle, input_names, output_names};
use super::{GP_OUTPUTS, INPUTS};
use crate::nominal::SingleTrackError;
use crate::numerics::Random;
use crate::numerics::parallel;
use crate::residual::dataset::DataSet;
use crate::residual::schema::Range;
use crate::residual::stages::{Progress, TrainingStage};
use crate::residual::train_config::ConfigError;
use crate::signal;
use crate::vehicle::SingleTrack;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Settings of the training.
#[derive(Debug, Clone, PartialEq)]
pub struct GpConfig {
    /// Friction coefficient of the nonlinear nominal model; not learned, as it cannot be observed in calm driving.
    pub friction: f64,
    /// Smoothing of recorded states.
    pub smoothing: StateSmoothing,
    /// Most points of the dictionary of an output.
    pub points: usize,
    /// Number of samples for the hyperparameters: time grows with its cube.
    pub hyperparameter_samples: usize,
    /// Number of samples from which the dictionary is chosen.
    pub candidates: usize,
    /// Starts of the search for hyperparameters.
    pub starts: usize,
    /// Most iterations from each start.
    pub iterations: usize,
    /// Seed of all that is random.
    pub seed: u64,
    /// Threads; 0 for all there are. The result does not depend on it.
    pub threads: usize,
}

impl Default for GpConfig {
    fn default() -> Self {
        Self {
            friction: 1.0,
            smoothing: StateSmoothing::Choose(vec![0, 2, 3, 4, 6]),
            points: 300,
            hyperparameter_samples: 400,
            candidates: 8000,
            starts: 3,
            iterations: 60,
            seed: 1,
            threads: 0,
        }
    }
}

/// Fewest samples of a process with so many inputs: ten for each hyperparameter.
const fn fewest(inputs: usize) -> usize {
    10 * (inputs + 2)
}

/// Share of the prior variance below which no further point is taken: its contribution is below a ten-thousandth of the
/// signal.
const LEAST_VARIANCE: f64 = 1e-8;

impl GpConfig {
    fn check(&self, inputs: usize) -> Result<(), ConfigError> {
        let ranges = [
            ("points", self.points, 1, MAX_POINTS),
            ("hyperparameter_samples", self.hyperparameter_samples, fewest(inputs), 5000),
            ("candidates", self.candidates, 1, 1_000_000),
            ("starts", self.starts, 1, 100),
            ("iterations", self.iterations, 1, 10_000),
        ];
        let reaches = match &self.smoothing {
            StateSmoothing::Fixed(reach) => std::slice::from_ref(reach),
            StateSmoothing::Choose(reaches) => reaches,
        };
        if reaches.is_empty() {
            return Err(ConfigError::NoCandidate { name: "smoothing" });
        }
        let reaches = reaches.iter().map(|&reach| ("smoothing", reach, 0, 50));
        match reaches.chain(ranges).find(|(_, value, min, max)| !(min..=max).contains(&value)) {
            Some((name, value, min, max)) => Err(ConfigError::Range { name, value, min, max }),
            None => Ok(()),
        }
    }
}

/// Reasons for which no process was trained.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GpTrainError {
    /// A setting is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The nominal model cannot be made.
    #[error(transparent)]
    Nominal(#[from] SingleTrackError),
    /// Too little data.
    #[error(
        "{samples} steps can be learned from, and {needed} are needed; {rows} rows were recorded, of which {left_out} were left out, with {gaps} gaps, and {turned} steps with the vehicle across the path: drive longer"
    )]
    TooFewSamples {
        /// Steps there are.
        samples: usize,
        /// Steps needed.
        needed: usize,
        /// Rows of the drives.
        rows: usize,
        /// Rows left out.
        left_out: usize,
        /// Gaps.
        gaps: usize,
        /// Steps left out because the motion cannot be told from the errors.
        turned: usize,
    },
    /// Test data made for another vehicle or sample time.
    #[error(
        "the test data are for another vehicle, sample time or minimum model speed than the training data"
    )]
    TestData,
    /// Covariances cannot be factored.
    #[error(
        "the covariance of `{output}` is singular: signal {signal}, noise {noise}; the drives are too much alike, or without any noise: drive more varied, or with fewer points"
    )]
    Singular {
        /// The output.
        output: &'static str,
        /// Its signal.
        signal: f64,
        /// Its noise.
        noise: f64,
    },
}

/// Errors of one-step predictions of the outputs: of a car `[vy m/s, yaw rate rad/s]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpFit<const O: usize = GP_OUTPUTS> {
    /// Steps measured.
    pub samples: usize,
    /// Root mean square error.
    pub rmse: [f64; O],
    /// Largest magnitude.
    pub max: [f64; O],
    /// Root mean square of the label itself: the nominal model's error.
    pub nominal_rmse: [f64; O],
}

/// Report of the training, measured against the record, not the smoothed states. Hyperparameters and likelihoods stand
/// in the model's schema.
#[derive(Debug, Clone, PartialEq)]
pub struct GpReport<const O: usize = GP_OUTPUTS> {
    /// On the samples learned from.
    pub train: GpFit<O>,
    /// On the test data, if there are any.
    pub test: Option<GpFit<O>>,
    /// Steps left out because the motion cannot be told from the errors.
    pub left_out: usize,
    /// Candidates for the smoothing of states, in rows on each side. Each comes with the mean square of small
    /// processes' errors over [`STEPS`](super::STEPS) steps, in units of the nominal model's.
    pub smoothing_scores: Vec<(usize, f64)>,
    /// Evaluations of the likelihood, for each output.
    pub evaluations: [usize; O],
}

/// A process and the quality of its fit.
#[derive(Debug, Clone, PartialEq)]
pub struct GpTrained<V = SingleTrack, const D: usize = INPUTS, const O: usize = GP_OUTPUTS> {
    /// The process.
    pub model: GpModelFor<V, D, O>,
    /// Quality of the fit.
    pub report: GpReport<O>,
}

/// Trains a process on `data`, and measures it on `test` too.
///
/// `progress` is called from the threads that work.
///
/// # Errors
/// An impossible setting; too few samples; test data of another vehicle.
pub fn train<V: GpVehicle<S, D, O>, const S: usize, const D: usize, const O: usize>(
    data: &DataSet<V, S>,
    test: Option<&DataSet<V, S>>,
    config: &GpConfig,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<GpTrained<V, D, O>, GpTrainError> {
    config.check(D)?;
    if test.is_some_and(|test| test.config != data.config || test.vehicle != data.vehicle) {
        return Err(GpTrainError::TestData);
    }
    let nominal = data.vehicle.nonlinear_model(config.friction)?;
    let recorded = Samples::new(data, &nominal, 0);
    if recorded.inputs.len() < fewest(D) {
        let found = data.report();
        return Err(GpTrainError::TooFewSamples {
            samples: recorded.inputs.len(),
            needed: fewest(D),
            rows: found.rows,
            left_out: found.not_finite + found.implausible,
            gaps: found.gaps,
            turned: recorded.left_out,
        });
    }
    let threads = parallel::threads(config.threads);
    let (smoothing, smoothing_scores) =
        smoothing::reach(&config.smoothing, data, &nominal, config.seed, threads);
    let samples = Samples::new(data, &nominal, smoothing);
    let fitted = hyperparameters(&samples, config, threads, progress);
    let say = |done| progress(Progress { stage: TrainingStage::Weights, done, total: O });
    let names = output_names::<V, S, D, O>();
    say(0);
    let mut outputs = Vec::with_capacity(O);
    for o in 0..O {
        outputs.push(output(&samples, (o, names[o]), &fitted[o], config, threads)?);
        say(o + 1);
    }
    let model = GpModelFor {
        schema: GpSchema {
            sample_time: data.config.sample_time,
            min_model_speed: data.config.min_model_speed,
            friction: config.friction,
            vehicle: data.vehicle,
            training: GpTraining {
                data_hash: format!("{:016x}", data.hash()),
                samples: samples.inputs.len(),
                hyperparameter_samples: config.hyperparameter_samples.min(samples.inputs.len()),
                smoothing,
                seed: config.seed,
            },
            inputs: ranges(&samples, input_names::<V, S, D>()),
            outputs: (0..O).map(|o| describe(names[o], &outputs[o], &fitted[o])).collect(),
        },
        outputs,
    };
    progress(Progress { stage: TrainingStage::Report, done: 0, total: 1 });
    let report = GpReport {
        train: measure(&model, &recorded, threads),
        test: test.map(|test| measure(&model, &Samples::new(test, &nominal, 0), threads)),
        left_out: recorded.left_out,
        smoothing_scores,
        evaluations: std::array::from_fn(|o| fitted[o].evaluations),
    };
    progress(Progress { stage: TrainingStage::Report, done: 1, total: 1 });
    Ok(GpTrained { model, report })
}

impl<V, const D: usize, const O: usize> GpModelFor<V, D, O> {
    /// The process's one-step errors on other data of the same vehicle and sample time.
    ///
    /// # Errors
    /// A nominal model that cannot be made; none that a trained process has.
    pub fn measure<const S: usize>(&self, data: &DataSet<V, S>) -> Result<GpFit<O>, SingleTrackError>
    where
        V: GpVehicle<S, D, O>,
    {
        let nominal = self.schema.vehicle.nonlinear_model(self.schema.friction)?;
        Ok(measure(self, &Samples::new(data, &nominal, 0), parallel::threads(0)))
    }

    /// Root mean square error of the outputs, predicted freely over `steps` steps, and that of the nominal model alone.
    /// The data are other drives of the same vehicle and sample time, with the recorded speeds and commands. Of a car:
    /// `[vy m/s, yaw rate rad/s]`. Not a number if no drive has so many steps without interruption.
    ///
    /// # Errors
    /// A nominal model that cannot be made; none that a trained process has.
    pub fn measure_steps<const S: usize>(
        &self,
        data: &DataSet<V, S>,
        steps: usize,
    ) -> Result<[[f64; O]; 2], SingleTrackError>
    where
        V: GpVehicle<S, D, O>,
    {
        let nominal = self.schema.vehicle.nonlinear_model(self.schema.friction)?;
        let samples = Samples::new(data, &nominal, 0);
        let with = samples.rollout(data, &nominal, steps, |input| self.residual(input).mean);
        Ok([with, samples.rollout(data, &nominal, steps, |_| [0.0; O])])
    }
}

fn hyperparameters<const D: usize, const O: usize>(
    samples: &Samples<D, O>,
    config: &GpConfig,
    threads: usize,
    progress: &(dyn Fn(Progress) + Sync),
) -> Vec<Fitted<D>> {
    let mut random = Random::stream(config.seed, 0);
    let rows = random.draw(samples.inputs.len(), config.hyperparameter_samples);
    let inputs: Vec<_> = rows.iter().map(|&row| samples.inputs[row]).collect();
    let labels: [Vec<f64>; O] =
        std::array::from_fn(|o| rows.iter().map(|&row| samples.labels[row][o]).collect());
    let total = O * config.starts;
    let done = AtomicUsize::new(0);
    let search =
        FitConfig { starts: config.starts, iterations: config.iterations as u64, seed: config.seed, threads };
    progress(Progress { stage: TrainingStage::Hyperparameters, done: 0, total });
    fit(&inputs, &labels, &search, &|| {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(Progress { stage: TrainingStage::Hyperparameters, done, total });
    })
}

fn output<const D: usize, const O: usize>(
    samples: &Samples<D, O>,
    (o, name): (usize, &'static str),
    fitted: &Fitted<D>,
    config: &GpConfig,
    threads: usize,
) -> Result<Sparse<D>, GpTrainError> {
    let kernel = fitted.kernel;
    let rows = Random::stream(config.seed, 1).draw(samples.inputs.len(), config.candidates);
    let candidates: Vec<_> = rows.iter().map(|&row| samples.inputs[row]).collect();
    let taken = choose(&kernel, &candidates, config.points, LEAST_VARIANCE);
    let dictionary = taken.iter().map(|&i| candidates[i]).collect();
    let labels: Vec<f64> = samples.labels.iter().map(|label| label[o]).collect();
    Sparse::new(kernel, dictionary, &samples.inputs, &labels, threads).ok_or(GpTrainError::Singular {
        output: name,
        signal: kernel.signal,
        noise: kernel.noise,
    })
}

fn unit(name: &str) -> String {
    // The smoothed acceleration is no signal of a log.
    signal::find(name).map_or("m/s2", |signal| signal.unit.symbol).to_owned()
}

fn describe<const D: usize>(name: &str, output: &Sparse<D>, fitted: &Fitted<D>) -> GpOutput {
    let kernel = output.kernel();
    GpOutput {
        name: name.to_owned(),
        unit: unit(name),
        length_scales: kernel.length_scales.to_vec(),
        signal: kernel.signal,
        noise: kernel.noise,
        points: output.dictionary().len(),
        log_likelihood: fitted.log_likelihood,
    }
}

fn ranges<const D: usize, const O: usize>(samples: &Samples<D, O>, names: [&str; D]) -> Vec<Range> {
    let range = |(d, name): (usize, &str)| {
        let column = samples.inputs.iter().map(|input| input[d]);
        Range {
            name: name.to_owned(),
            unit: unit(name),
            min: column.clone().fold(f64::INFINITY, f64::min),
            max: column.fold(f64::NEG_INFINITY, f64::max),
        }
    };
    names.into_iter().enumerate().map(range).collect()
}

fn measure<V: Sync, const D: usize, const O: usize>(
    model: &GpModelFor<V, D, O>,
    samples: &Samples<D, O>,
    threads: usize,
) -> GpFit<O> {
    let chunks = parallel::chunks(samples.inputs.len(), 2048);
    let found = parallel::map(threads, chunks.len(), |chunk| {
        let error = |row: usize| {
            let mean = model.residual(&samples.inputs[row]).mean;
            std::array::from_fn(|o| samples.labels[row][o] - mean[o])
        };
        chunks[chunk].clone().map(error).collect::<Vec<[f64; O]>>()
    });
    let errors = found.concat();
    let n = errors.len().max(1) as f64;
    let root = |of: &[[f64; O]]| -> [f64; O] {
        std::array::from_fn(|o| (of.iter().map(|x| x[o] * x[o]).sum::<f64>() / n).sqrt())
    };
    GpFit {
        samples: errors.len(),
        rmse: root(&errors),
        max: std::array::from_fn(|o| errors.iter().fold(0.0, |max, x| x[o].abs().max(max))),
        nominal_rmse: root(&samples.labels),
    }
}
