//! Cost of the residual. At run time: 60 rows looked up and their leaves averaged (T = 20, depth 6, W = 16, four
//! outputs). Of a Gaussian process: 60 rows with gradients (two outputs, 300 points each). And the training of a forest
//! on 100 000 x 64, as `scikit-learn`'s `RandomForestRegressor` is timed.
//!
//! The table is made of SplitMix64 numbers, so that another language can make the same one:
//! `x[i] = (mix(1 + (i + 1) 0x9e3779b97f4a7c15) >> 11) / 2^53`, row after row of 64, then one more number a row.

#[path = "../tests/residual_plant/mod.rs"]
mod residual_plant;

use criterion::{Criterion, SamplingMode, criterion_group, criterion_main};
use residual_plant::{Plant, data};
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::gp::{Exact, Kernel, Sparse};
use rfl_mpc::residual::{
    Block, Dense, Forest, ForestConfig, GrownForest, Kind, Resolution, TrainConfig, grow, train,
};
use std::hint::black_box;
use std::time::Duration;

const ROWS: usize = 100_000;
const COLUMNS: usize = 64;

/// Features, and four outputs that depend on six of them.
fn table(rows: usize) -> (Vec<f64>, Vec<[f64; 4]>) {
    let mut random = Random::new(1);
    let values: Vec<f64> = (0..rows * COLUMNS).map(|_| random.uniform()).collect();
    let label = |x: &[f64]| {
        let noise = 0.1 * random.uniform();
        let step = f64::from(x[0] > 0.3);
        [
            step + x[1] * x[2] + noise,
            (4.0 * x[3]).sin() * step + noise,
            x[4] * x[4] + x[0] + noise,
            x[5] - x[1] + noise,
        ]
    };
    let labels = values.chunks(COLUMNS).map(label).collect();
    (values, labels)
}

/// Root mean square error of the forest with the mean in each leaf, relative to the spread, over all outputs.
fn relative_error(grown: &GrownForest, learned: (&[f64], &[[f64; 4]]), test: (&[f64], &[[f64; 4]])) -> f64 {
    let forest: &Forest = &grown.forest;
    let mut sums = vec![([0.0; 4], 0.0); forest.leaves()];
    for (row, (x, y)) in learned.0.chunks(COLUMNS).zip(learned.1).enumerate() {
        forest.look_up(x, |tree, leaf| {
            let w = f64::from(grown.in_bag[tree][row]);
            (0..4).for_each(|o| sums[leaf].0[o] += w * y[o]);
            sums[leaf].1 += w;
        });
    }
    let n = test.1.len() as f64;
    let mean: [f64; 4] = std::array::from_fn(|o| test.1.iter().map(|y| y[o]).sum::<f64>() / n);
    let (mut error, mut spread) = ([0.0; 4], [0.0; 4]);
    for (x, y) in test.0.chunks(COLUMNS).zip(test.1) {
        let mut fit = [0.0; 4];
        forest.look_up(x, |_, leaf| (0..4).for_each(|o| fit[o] += sums[leaf].0[o] / sums[leaf].1));
        for o in 0..4 {
            error[o] += (y[o] - fit[o] / forest.trees() as f64).powi(2);
            spread[o] += (y[o] - mean[o]).powi(2);
        }
    }
    ((0..4).map(|o| error[o] / spread[o]).sum::<f64>() / 4.0).sqrt()
}

fn training(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("train");
    group.sample_size(10).sampling_mode(SamplingMode::Flat).warm_up_time(Duration::from_millis(1));
    let (values, labels) = table(ROWS + ROWS / 5);
    let (learned, test) = values.split_at(ROWS * COLUMNS);
    let features: Vec<u16> = (0..COLUMNS as u16).collect();
    for features_per_split in [8, COLUMNS] {
        let config = ForestConfig {
            trees: 20,
            depth: 6,
            min_leaf: 20,
            features_per_split,
            bootstrap: Some(Block(1)),
            resolution: Resolution::Histogram(255),
            seed: 1,
            threads: 0,
        };
        let run = || grow(&Dense::new(learned, COLUMNS), &features, &labels[..ROWS], &config, &|_| ());
        let error = relative_error(&run(), (learned, &labels[..ROWS]), (test, &labels[ROWS..]));
        println!("forest, F = {features_per_split}: relative test RMSE {error:.5}");
        group.bench_function(format!("forest/100k_x_64/F_{features_per_split}"), |b| {
            b.iter(|| black_box(run()))
        });
    }
    let plant = Plant { lag: 0.1, noise: 1.0, ..Plant::exact() };
    let samples = data(&plant, &[6.0, 8.0, 10.0, 12.0, 14.0].repeat(10), 2016, 1);
    let config = TrainConfig::new(Kind::Rfl);
    group.bench_function("rfl/100k_samples", |b| b.iter(|| train(&samples, None, &config, &|_| ()).unwrap()));
    group.finish();
}

fn run_time(criterion: &mut Criterion) {
    let plant = Plant { lag: 0.1, noise: 1.0, ..Plant::exact() };
    let samples = data(&plant, &[6.0, 8.0, 10.0, 12.0, 14.0].repeat(4), 1000, 1);
    for (name, kind) in [("rf", Kind::Rf), ("rfl", Kind::Rfl), ("rfl_s", Kind::RflS)] {
        let model = train(&samples, None, &TrainConfig::new(kind), &|_| ()).unwrap().model;
        let windows = samples.windows(16);
        let mut features = vec![vec![0.0; model.features()]; 60];
        features.iter_mut().enumerate().for_each(|(j, row)| windows.features(300 + j, row));
        // One room for all rows, as the controller has it: it keeps the leaves of the row before.
        let mut room = model.workspace();
        println!("{name}: {} leaves", model.forest().leaves());
        criterion.bench_function(&format!("coefficients/60_rows/{name}"), |b| {
            b.iter(|| {
                for (j, row) in features.iter().enumerate() {
                    model.coefficients(black_box(row), windows.commands(300 + j), &mut room);
                    black_box(&room);
                }
            });
        });
        if kind == Kind::Rfl {
            criterion.bench_function("look_up/60_rows", |b| {
                b.iter(|| {
                    let mut sum = 0;
                    features
                        .iter()
                        .for_each(|row| model.forest().look_up(black_box(row), |_, leaf| sum += leaf));
                    sum
                });
            });
        }
    }
}

/// Queries of GP-NMPC at each of its iterations.
fn gaussian_process(criterion: &mut Criterion) {
    const POINTS: usize = 300;
    let kernel = Kernel { length_scales: [5.0, 0.4, 0.3, 0.1, 2.0], signal: 0.05, noise: 0.01 };
    let mut random = Random::new(1);
    let inputs: Vec<[f64; 5]> = (0..2000)
        .map(|_| std::array::from_fn(|d| 3.0 * kernel.length_scales[d] * random.uniform()))
        .collect();
    let labels: Vec<f64> = inputs.iter().map(|x| 0.05 * (3.0 * x[1]).sin() + 0.1 * x[2] * x[3]).collect();
    let output = || Sparse::new(kernel, inputs[..POINTS].to_vec(), &inputs, &labels, 0).unwrap();
    let outputs = [output(), output()];
    criterion.bench_function("gp/mean_and_gradient/60_rows_x_2_x_300", |b| {
        b.iter(|| {
            for row in &inputs[..60] {
                for output in &outputs {
                    black_box(output.mean(black_box(row)));
                }
            }
        });
    });
    let mut room = vec![];
    criterion.bench_function("gp/variance/1_row_x_300", |b| {
        b.iter(|| outputs[0].variance(black_box(&inputs[7]), &mut room));
    });
    let chosen = 400;
    let exact = Exact::new(kernel, &inputs[..chosen], &labels[..chosen]).unwrap();
    let mut group = criterion.benchmark_group("gp/likelihood/400_samples");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.bench_function("value", |b| {
        b.iter(|| Exact::new(kernel, &inputs[..chosen], &labels[..chosen]).unwrap().log_likelihood());
    });
    group.bench_function("gradient", |b| b.iter(|| exact.gradient()));
    group.finish();
}

criterion_group!(benches, run_time, gaussian_process, training);
criterion_main!(benches);
