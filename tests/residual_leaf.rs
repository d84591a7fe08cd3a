//! Leaf models and the least squares below them, against closed forms.

use crate::residual_plant::{Plant, data};
use nalgebra::{DMatrix, DVector};
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::{
    DataSet, Gram, Kind, LambdaChoice, Regressors, Theta, TrainConfig, TrainError, Trained, Triangle, train,
};

fn example(rows: usize, columns: usize) -> (DMatrix<f64>, DMatrix<f64>, Vec<f64>) {
    let mut random = Random::new(3);
    let z = DMatrix::from_fn(rows, columns, |_, _| random.uniform() - 0.5);
    let y = DMatrix::from_fn(rows, 4, |_, _| random.uniform() - 0.5);
    (z, y, (0..rows).map(|_| f64::from(1 + random.below(3))).collect())
}

/// `(Z' W Z + lambda n I)^-1 Z' W Y`, as it is written.
fn closed_form(z: &DMatrix<f64>, y: &DMatrix<f64>, weights: &[f64], lambda: f64) -> DMatrix<f64> {
    let w = DMatrix::from_diagonal(&DVector::from_row_slice(weights));
    let n: f64 = weights.iter().sum();
    let ridge = DMatrix::identity(z.ncols(), z.ncols()) * (lambda * n);
    (z.transpose() * &w * z + ridge).try_inverse().unwrap() * z.transpose() * &w * y
}

fn difference(theta: &Theta, expected: &DMatrix<f64>) -> f64 {
    (DMatrix::from_fn(theta.len(), 4, |i, o| theta[i][o]) - expected).norm()
}

fn summaries(z: &DMatrix<f64>, y: &DMatrix<f64>, weights: &[f64]) -> (Gram, Triangle) {
    let (mut gram, mut triangle) = (Gram::new(z.ncols()), Triangle::new(z.ncols()));
    for (i, &weight) in weights.iter().enumerate() {
        let row: Vec<f64> = z.row(i).iter().copied().collect();
        let outputs = std::array::from_fn(|o| y[(i, o)]);
        gram.add(&row, &outputs, weight);
        triangle.add(&row, &outputs, weight);
    }
    (gram, triangle)
}

#[test]
fn ridge_is_its_closed_form() {
    // More rows than are worked in at once.
    let (z, y, weights) = example(700, 6);
    let (gram, triangle) = summaries(&z, &y, &weights);
    let decomposed = triangle.clone().decompose();
    for lambda in [1e-6, 1e-3, 0.1, 10.0] {
        let expected = closed_form(&z, &y, &weights, lambda);
        assert!(difference(&gram.ridge(lambda).unwrap(), &expected) < 1e-12);
        assert!(difference(&decomposed.solve(lambda), &expected) < 1e-12);
    }
    let plain = closed_form(&z, &y, &weights, 0.0);
    assert!(difference(&decomposed.solve(0.0), &plain) < 1e-12);
    assert!(difference(&gram.ridge(f64::INFINITY).unwrap(), &(plain * 0.0)) == 0.0);

    let theta = decomposed.solve(0.1);
    let fit = &z * DMatrix::from_fn(6, 4, |i, o| theta[i][o]);
    for o in 0..4 {
        let direct: f64 = (0..700).map(|i| weights[i] * (y[(i, o)] - fit[(i, o)]).powi(2)).sum();
        assert!((triangle.squared_error(&theta)[o] - direct).abs() < 1e-10 * direct);
    }
}

#[test]
fn triangles_add_up() {
    let (z, y, weights) = example(300, 5);
    let (_, whole) = summaries(&z, &y, &weights);
    let (_, mut first) = summaries(&z.rows(0, 120).into(), &y.rows(0, 120).into(), &weights[..120]);
    let (_, second) = summaries(&z.rows(120, 180).into(), &y.rows(120, 180).into(), &weights[120..]);
    first.merge(&second);
    let (whole, merged) = (whole.decompose().solve(1e-3), first.decompose().solve(1e-3));
    let same = whole.as_flattened().iter().zip(merged.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-13);
    assert!(same, "{whole:?} {merged:?}");
}

#[test]
fn dependent_columns_give_the_solution_of_least_norm() {
    let (mut z, y, _) = example(80, 4);
    let copy = z.column(0) * 2.0;
    z.set_column(3, &copy);
    let weights = vec![1.0; 80];
    let (gram, triangle) = summaries(&z, &y, &weights);
    let theta = triangle.decompose().solve(0.0);
    let expected = z.clone().pseudo_inverse(1e-10).unwrap() * &y;
    assert!(difference(&theta, &expected) < 1e-12);
    // Normal equations cannot be trusted there; with any shrinkage they can.
    assert!(difference(&gram.ridge(1e-3).unwrap(), &closed_form(&z, &y, &weights, 1e-3)) < 1e-10);

    // Fewer rows than columns.
    let (z, y, _) = example(3, 5);
    let (_, triangle) = summaries(&z, &y, &[1.0; 3]);
    let theta = triangle.decompose().solve(0.0);
    assert!(difference(&theta, &(z.pseudo_inverse(1e-12).unwrap() * y)) < 1e-12);
}

fn lag() -> DataSet {
    data(&Plant { lag: 0.1, noise: 0.3, ..Plant::exact() }, &[6.0, 8.0, 10.0, 12.0], 1500, 1)
}

fn with(kind: Kind, lambda: LambdaChoice) -> TrainConfig {
    TrainConfig { trees: 5, depth: 3, lambda, prefilter: 0.0, ..TrainConfig::new(kind) }
}

fn trained(data: &DataSet, config: &TrainConfig) -> Trained {
    train(data, None, config, &|_| ()).unwrap()
}

#[test]
fn leaves_shrunk_without_bound_are_the_global_fit() {
    let samples = lag();
    let global = trained(&samples, &with(Kind::Linear, LambdaChoice::Fixed(0.0))).model;
    let expected = global.leaves().theta(0).as_flattened();
    for (lambda, tolerance) in [(f64::INFINITY, 0.0), (1e12, 1e-9)] {
        let model = trained(&samples, &with(Kind::Rfl, LambdaChoice::Fixed(lambda))).model;
        assert!(model.leaves().regressors() == 17 && model.forest().leaves() > 20);
        for leaf in 0..model.forest().leaves() {
            for (theta, expected) in model.leaves().theta(leaf).as_flattened().iter().zip(expected) {
                assert!((theta - expected).abs() <= tolerance, "{theta} against {expected}");
            }
        }
    }
}

/// Each leaf of a trained tree against the formula, from the samples that fall into it.
#[test]
fn each_leaf_is_the_formula() {
    let samples = lag();
    let lambda = 1e-3;
    let global = trained(&samples, &with(Kind::Linear, LambdaChoice::Fixed(0.0))).model;
    let model = trained(&samples, &with(Kind::Rtl, LambdaChoice::Fixed(lambda))).model;
    let windows = samples.windows(16);
    let n = windows.len();
    let z = DMatrix::from_fn(n, 17, |i, c| if c == 0 { 1.0 } else { windows.commands(i)[c - 1] });
    let scale: Vec<f64> = (0..17).map(|c| (z.column(c).norm_squared() / n as f64).sqrt()).collect();
    let mut features = vec![0.0; 67];
    let mut members = vec![vec![]; model.forest().leaves()];
    for i in 0..n {
        windows.features(i, &mut features);
        model.forest().look_up(&features, |_, leaf| members[leaf].push(i));
    }
    let theta_g = DMatrix::from_fn(17, 4, |c, o| global.leaves().theta(0)[c][o] * scale[c]);
    for (leaf, members) in members.iter().enumerate() {
        let z = DMatrix::from_fn(members.len(), 17, |i, c| z[(members[i], c)] / scale[c]);
        let y = DMatrix::from_fn(members.len(), 4, |i, o| windows.label(members[i])[o]);
        let change = closed_form(&z, &(y - &z * &theta_g), &vec![1.0; members.len()], lambda);
        let expected = &theta_g + change;
        let theta: Theta = (0..17).map(|c| model.leaves().theta(leaf)[c].map(|t| t * scale[c])).collect();
        assert!(difference(&theta, &expected) < 1e-10 * expected.norm(), "leaf {leaf}");
    }
}

#[test]
fn constant_leaves_are_means() {
    let samples = lag();
    let model = trained(&samples, &with(Kind::Rt, LambdaChoice::LeastSquares)).model;
    let windows = samples.windows(16);
    let mut sums = vec![([0.0; 4], 0.0); model.forest().leaves()];
    let mut features = vec![0.0; 67];
    for i in 0..windows.len() {
        windows.features(i, &mut features);
        model.forest().look_up(&features, |_, leaf| {
            (0..4).for_each(|o| sums[leaf].0[o] += windows.label(i)[o]);
            sums[leaf].1 += 1.0;
        });
    }
    for (leaf, (sum, count)) in sums.iter().enumerate() {
        for (theta, sum) in model.leaves().theta(leaf)[0].iter().zip(sum) {
            assert!((theta - sum / count).abs() < 1e-15);
        }
    }
    // The controller sees a residual that no command changes.
    let mut room = model.workspace();
    model.coefficients(&features, &[], &mut room);
    assert!(room.command().len() == 16 && room.command().as_flattened().iter().all(|&c| c == 0.0));
}

#[test]
fn the_shrinkage_is_the_candidate_with_the_least_held_out_error() {
    let samples = lag();
    for kind in [Kind::Rtl, Kind::Rfl, Kind::RflS] {
        let config = TrainConfig { trees: 8, depth: 4, prefilter: 0.0, ..TrainConfig::new(kind) };
        let Trained { model, report } = trained(&samples, &config);
        let chosen = model.schema().training.leaf_lambda.unwrap();
        let (least, _) = report.lambdas.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert_eq!(chosen, least, "{:?}", report.lambdas);
        let errors: Vec<f64> = report.lambdas.iter().map(|&(_, error)| error).collect();
        assert!(errors.iter().any(|e| *e > 1.000_001 * errors.iter().copied().fold(f64::INFINITY, f64::min)));
        // What was held out cannot fit better than what was learned, but not much worse either.
        let (train, held_out) = (report.train.rmse, report.held_out.unwrap().rmse);
        assert!(
            (0..4).all(|o| held_out[o] >= train[o] * (1.0 - 1e-12) && held_out[o] < 1.3 * train[o]),
            "{train:?} {held_out:?}"
        );
    }
}

#[test]
fn averaging_and_road_terms_are_the_mean_over_trees_by_hand() {
    let samples = lag();
    let regressors = Regressors { road: true, states: 2 };
    let config = TrainConfig { regressors, ..with(Kind::Rfl, LambdaChoice::Fixed(1e-4)) };
    let model = trained(&samples, &config).model;
    let windows = samples.windows(16);
    let mut features = vec![0.0; 67];
    let mut room = model.workspace();
    for i in [0, 100, 3000] {
        windows.features(i, &mut features);
        model.coefficients(&features, windows.commands(i), &mut room);
        let newest = &windows.states(i).as_flattened()[56..];
        let residual = room.residual(windows.commands(i), newest);
        let [v, curvature, curvature_rate] = windows.road(i);
        let road = [curvature, curvature_rate, curvature * v * v];
        let z: Vec<f64> =
            [1.0].iter().chain(windows.commands(i)).chain(newest).chain(&road).copied().collect();
        let mut expected = [0.0; 4];
        model.forest().look_up(&features, |_, leaf| {
            for (z, theta) in z.iter().zip(model.leaves().theta(leaf)) {
                (0..4).for_each(|o| expected[o] += z * theta[o] / 5.0);
            }
        });
        assert!((0..4).all(|o| (residual[o] - expected[o]).abs() < 1e-15), "{residual:?} {expected:?}");
        assert!(!room.outside(), "a sample of the training is not outside: {room:?}");
    }
}

#[test]
fn wrong_settings_and_too_few_samples_are_refused_with_the_reason() {
    let samples = data(&Plant::exact(), &[8.0], 200, 1);
    let Err(error) = train(&samples, None, &TrainConfig::new(Kind::Rfl), &|_| ()) else { panic!("trained") };
    assert!(matches!(error, TrainError::TooFewSamples { samples: 184, needed: 200, .. }), "{error}");
    let wrong = [
        TrainConfig { window: 0, ..TrainConfig::new(Kind::Rfl) },
        TrainConfig { depth: 99, ..TrainConfig::new(Kind::Rfl) },
        TrainConfig { trees: 0, ..TrainConfig::new(Kind::Rfl) },
        TrainConfig { lambda: LambdaChoice::Fixed(f64::NAN), ..TrainConfig::new(Kind::Rfl) },
        TrainConfig { lambda: LambdaChoice::HeldOut(vec![]), ..TrainConfig::new(Kind::Rfl) },
        TrainConfig { regressors: Regressors::default(), ..TrainConfig::new(Kind::RflS) },
        TrainConfig { regressors: Regressors { road: false, states: 17 }, ..TrainConfig::new(Kind::Linear) },
    ];
    for config in wrong {
        assert!(matches!(train(&samples, None, &config, &|_| ()), Err(TrainError::Config(_))), "{config:?}");
    }
}
