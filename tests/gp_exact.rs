//! The Gaussian process without approximation is the textbook's: mean, variance, likelihood and its gradient.

use rfl_mpc::numerics::Random;
use rfl_mpc::residual::gp::{Exact, Kernel};

const KERNEL: Kernel<3> = Kernel { length_scales: [0.7, 1.9, 30.0], signal: 1.3, noise: 0.2 };

fn samples(n: usize) -> (Vec<[f64; 3]>, Vec<f64>) {
    let mut random = Random::new(5);
    let inputs: Vec<[f64; 3]> =
        (0..n).map(|_| std::array::from_fn(|_| 4.0 * random.uniform() - 2.0)).collect();
    let labels = inputs.iter().map(|x| (2.0 * x[0]).sin() + 0.3 * x[1] + 0.1 * random.uniform()).collect();
    (inputs, labels)
}

/// `A^-1 b` and `log |A|` by Gauss's elimination with pivoting, written out.
fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> (Vec<f64>, f64) {
    let n = b.len();
    let mut log_determinant = 0.0;
    for c in 0..n {
        let pivot = (c..n).max_by(|&i, &j| a[i][c].abs().total_cmp(&a[j][c].abs())).unwrap();
        a.swap(c, pivot);
        b.swap(c, pivot);
        log_determinant += a[c][c].abs().ln();
        for i in 0..n {
            if i != c {
                let pivot = a[c].clone();
                let factor = a[i][c] / pivot[c];
                a[i].iter_mut().zip(&pivot).for_each(|(value, pivot)| *value -= factor * pivot);
                b[i] -= factor * b[c];
            }
        }
    }
    ((0..n).map(|i| b[i] / a[i][i]).collect(), log_determinant)
}

fn k(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let Kernel { length_scales, signal, .. } = KERNEL;
    let distance: f64 = (0..3).map(|d| ((a[d] - b[d]) / length_scales[d]).powi(2)).sum();
    signal.powi(2) * (-0.5 * distance).exp()
}

#[test]
fn mean_variance_and_likelihood_are_the_textbooks() {
    let (inputs, labels) = samples(25);
    let exact = Exact::new(KERNEL, &inputs, &labels).unwrap();
    let noise = KERNEL.noise * KERNEL.noise;
    let covariance: Vec<Vec<f64>> = (0..25)
        .map(|i| (0..25).map(|j| k(&inputs[i], &inputs[j]) + if i == j { noise } else { 0.0 }).collect())
        .collect();
    let (alpha, log_determinant) = solve(covariance.clone(), labels.clone());
    let fit: f64 = labels.iter().zip(&alpha).map(|(y, a)| y * a).sum();
    let likelihood = -0.5 * fit - 0.5 * log_determinant - 12.5 * std::f64::consts::TAU.ln();
    assert!((exact.log_likelihood() - likelihood).abs() < 1e-6, "{} {likelihood}", exact.log_likelihood());
    for x in [[0.1, -0.4, 1.0], [1.9, 1.9, -1.9], inputs[3], [40.0, 0.0, 0.0]] {
        let cross: Vec<f64> = inputs.iter().map(|z| k(z, &x)).collect();
        let mean: f64 = cross.iter().zip(&alpha).map(|(k, a)| k * a).sum();
        let (weights, _) = solve(covariance.clone(), cross.clone());
        let variance = k(&x, &x) - cross.iter().zip(&weights).map(|(k, w)| k * w).sum::<f64>();
        assert!((exact.mean(&x) - mean).abs() < 1e-7, "{x:?}");
        assert!((exact.variance(&x) - variance).abs() < 1e-7, "{x:?}");
    }
}

#[test]
fn far_from_all_data_it_is_the_prior() {
    let (inputs, labels) = samples(25);
    let exact = Exact::new(KERNEL, &inputs, &labels).unwrap();
    assert!(exact.mean(&[1e3, 0.0, 0.0]).abs() < 1e-12);
    assert!((exact.variance(&[1e3, 0.0, 0.0]) - 1.69).abs() < 1e-12);
}

#[test]
fn the_likelihoods_gradient_is_that_of_differences() {
    let (inputs, labels) = samples(40);
    let at = |kernel: Kernel<3>| Exact::new(kernel, &inputs, &labels).unwrap();
    let step = |change: &dyn Fn(&mut Kernel<3>, f64)| {
        let (mut up, mut down) = (KERNEL, KERNEL);
        change(&mut up, 1e-4_f64.exp());
        change(&mut down, (-1e-4_f64).exp());
        (at(up).log_likelihood() - at(down).log_likelihood()) / 2e-4
    };
    let gradient = at(KERNEL).gradient();
    for d in 0..3 {
        let difference = step(&|kernel, factor| kernel.length_scales[d] *= factor);
        assert!((gradient.length_scales[d] - difference).abs() < 1e-5, "{d}: {gradient:?} {difference}");
    }
    let difference = step(&|kernel, factor| kernel.signal *= factor);
    assert!((gradient.signal - difference).abs() < 1e-5, "{gradient:?} {difference}");
    let difference = step(&|kernel, factor| kernel.noise *= factor);
    assert!((gradient.noise - difference).abs() < 1e-5, "{gradient:?} {difference}");
}

#[test]
fn what_cannot_be_is_refused() {
    assert!(Exact::new(KERNEL, &[[0.0; 3], [f64::NAN; 3]], &[1.0, 2.0]).is_none());
    assert!(Exact::new(KERNEL, &[[0.0; 3], [1.0; 3]], &[1.0, f64::NAN]).is_none());
}
