//! Hyperparameters are found again in data drawn from a Gaussian process.

use crate::gp_plant::normal;
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::gp::{Exact, FitConfig, Kernel, fit};

const CONFIG: FitConfig = FitConfig { starts: 3, iterations: 60, seed: 3, threads: 1 };

/// Inputs of unlike units, and a draw of the process by the Cholesky factor of its covariance.
fn draw(kernel: &Kernel<3>, n: usize, seed: u64) -> (Vec<[f64; 3]>, Vec<f64>) {
    let mut random = Random::new(seed);
    let inputs: Vec<[f64; 3]> = (0..n)
        .map(|_| [20.0 * random.uniform(), 0.2 * random.uniform() - 0.1, 5.0 * random.uniform()])
        .collect();
    let factor = kernel.among(&inputs, 1e-9 * kernel.signal * kernel.signal).cholesky().unwrap();
    let white = nalgebra::DVector::from_fn(n, |_, _| normal(&mut random));
    let values = factor.l() * white;
    let labels = values.iter().map(|value| value + kernel.noise * normal(&mut random)).collect();
    (inputs, labels)
}

#[test]
fn known_hyperparameters_are_recovered() {
    // The third input has hardly any effect.
    let known = Kernel { length_scales: [4.0, 0.06, 100.0], signal: 0.03, noise: 0.003 };
    let (inputs, labels) = draw(&known, 220, 8);
    let found = fit(&inputs, std::slice::from_ref(&labels), &CONFIG, &|| ())[0];
    let near = |found: f64, known: f64, factor: f64| (found / known).ln().abs() < f64::ln(factor);
    let Kernel { length_scales: [a, b, c], signal, noise } = found.kernel;
    assert!(near(a, 4.0, 1.25) && near(b, 0.06, 1.25) && c > 20.0, "{found:?}");
    assert!(near(signal, 0.03, 1.7) && near(noise, 0.003, 1.2), "{found:?}");

    // No less likely than the truth, and a maximum: the gradient vanishes where no bound holds.
    let at = |kernel: Kernel<3>| Exact::new(kernel, &inputs, &labels).unwrap();
    assert!(at(found.kernel).log_likelihood() >= at(known).log_likelihood(), "{found:?}");
    let gradient = at(found.kernel).gradient();
    for slope in [gradient.length_scales[0], gradient.length_scales[1], gradient.signal, gradient.noise] {
        assert!(slope.abs() < 0.2, "{gradient:?}");
    }
}

#[test]
fn pure_noise_is_called_noise() {
    let mut random = Random::new(2);
    let inputs: Vec<[f64; 3]> = (0..150).map(|_| std::array::from_fn(|_| random.uniform())).collect();
    let labels: Vec<f64> = (0..150).map(|_| 0.01 * normal(&mut random)).collect();
    let Kernel { signal, noise, .. } = fit(&inputs, &[labels], &CONFIG, &|| ())[0].kernel;
    assert!((noise / 0.01 - 1.0).abs() < 0.2 && signal < 0.005, "{signal} {noise}");
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let kernel = Kernel { length_scales: [4.0, 0.06, 3.0], signal: 0.03, noise: 0.003 };
    let (inputs, labels) = draw(&kernel, 80, 4);
    let twice = [labels.clone(), labels];
    let one = fit(&inputs, &twice, &CONFIG, &|| ());
    assert_eq!(one[0], one[1]);
    assert_eq!(one, fit(&inputs, &twice, &FitConfig { threads: 4, ..CONFIG }, &|| ()));
}

#[test]
fn labels_and_inputs_without_change_are_survived() {
    let inputs: Vec<[f64; 3]> = (0..90).map(|i| [f64::from(i), 7.0, 0.0]).collect();
    for labels in [vec![0.0; 90], vec![1.0; 90]] {
        let found = fit(&inputs, &[labels], &CONFIG, &|| ())[0];
        assert!(found.kernel.is_valid(), "{found:?}");
    }
}
