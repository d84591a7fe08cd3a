//! The process through a dictionary: what it approximates, from what, and its gradient.

use proptest::prelude::*;
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::gp::{Exact, Kernel, Sparse, choose};

const KERNEL: Kernel<2> = Kernel { length_scales: [0.8, 1.5], signal: 1.2, noise: 0.15 };

fn truth(x: &[f64; 2]) -> f64 {
    (1.5 * x[0]).sin() + 0.4 * (x[0] * x[1]).cos()
}

fn samples(n: usize) -> (Vec<[f64; 2]>, Vec<f64>) {
    let mut random = Random::new(11);
    let inputs: Vec<[f64; 2]> =
        (0..n).map(|_| std::array::from_fn(|_| 4.0 * random.uniform() - 2.0)).collect();
    let labels = inputs.iter().map(|x| truth(x) + 0.5 * (random.uniform() - 0.5)).collect();
    (inputs, labels)
}

fn probes() -> Vec<[f64; 2]> {
    let mut random = Random::new(12);
    (0..50).map(|_| std::array::from_fn(|_| 5.0 * random.uniform() - 2.5)).collect()
}

#[test]
fn with_all_data_as_dictionary_it_is_exact() {
    let (inputs, labels) = samples(60);
    let exact = Exact::new(KERNEL, &inputs, &labels).unwrap();
    let sparse = Sparse::new(KERNEL, inputs.clone(), &inputs, &labels, 1).unwrap();
    let mut room = vec![];
    for x in probes() {
        assert!((sparse.mean(&x).0 - exact.mean(&x)).abs() < 1e-6, "{x:?}");
        assert!((sparse.variance(&x, &mut room) - exact.variance(&x)).abs() < 1e-6, "{x:?}");
    }
}

#[test]
fn a_small_dictionary_carries_what_all_samples_say() {
    let (inputs, labels) = samples(500);
    let exact = Exact::new(KERNEL, &inputs, &labels).unwrap();
    let taken = choose(&KERNEL, &inputs, 60, 1e-8);
    let dictionary: Vec<[f64; 2]> = taken.iter().map(|&i| inputs[i]).collect();
    let sparse = Sparse::new(KERNEL, dictionary.clone(), &inputs, &labels, 2).unwrap();
    let own: Vec<f64> = taken.iter().map(|&i| labels[i]).collect();
    let alone = Exact::new(KERNEL, &dictionary, &own).unwrap();
    let rms = |mean: &dyn Fn(&[f64; 2]) -> f64| {
        let square: f64 = probes().iter().map(|x| (mean(x) - exact.mean(x)).powi(2)).sum();
        (square / 50.0).sqrt()
    };
    let (with_all, with_own) = (rms(&|x| sparse.mean(x).0), rms(&|x| alone.mean(x)));
    // The points' own labels alone are noisy: the others must count.
    assert!(with_all < 0.02 && with_all < 0.2 * with_own, "{with_all} {with_own}");
    let mut room = vec![];
    for x in probes() {
        assert!((sparse.variance(&x, &mut room) - exact.variance(&x)).abs() < 0.03, "{x:?}");
    }
}

#[test]
fn the_dictionary_takes_what_is_least_known() {
    let inputs = [[0.0, 0.0], [0.01, 0.0], [3.0, 0.0], [0.0, 0.0], [1.2, 0.0]];
    // The farthest from the first, then what lies between; twins of points taken say nothing.
    assert_eq!(choose(&KERNEL, &inputs, 3, 1e-2), [0, 2, 4]);
    assert_eq!(choose(&KERNEL, &inputs, 5, 1e-2), [0, 2, 4]);
    assert_eq!(choose(&KERNEL, &inputs, 5, 0.0).len(), 4, "a point itself is known");
    assert!(choose(&KERNEL, &[], 5, 0.0).is_empty());
    // Against the definition: the variance given those taken, by the exact process without noise.
    let (inputs, _) = samples(80);
    let noise_free = Kernel { noise: 0.0, ..KERNEL };
    let taken = choose(&KERNEL, &inputs, 12, 0.0);
    for count in 1..12 {
        let known: Vec<[f64; 2]> = taken[..count].iter().map(|&i| inputs[i]).collect();
        let exact = Exact::new(noise_free, &known, &vec![0.0; count]).unwrap();
        let next = exact.variance(&inputs[taken[count]]);
        let most = inputs.iter().map(|x| exact.variance(x)).fold(0.0, f64::max);
        assert!(next > most - 1e-7, "point {count}: {next} of {most}");
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let (inputs, labels) = samples(700);
    let dictionary: Vec<[f64; 2]> = choose(&KERNEL, &inputs, 30, 0.0).iter().map(|&i| inputs[i]).collect();
    let one = Sparse::new(KERNEL, dictionary.clone(), &inputs, &labels, 1).unwrap();
    for threads in [2, 5] {
        assert_eq!(one, Sparse::new(KERNEL, dictionary.clone(), &inputs, &labels, threads).unwrap());
    }
}

#[test]
fn what_is_not_finite_passes_through() {
    let (inputs, labels) = samples(30);
    let sparse = Sparse::new(KERNEL, inputs.clone(), &inputs, &labels, 1).unwrap();
    let (mean, gradient) = sparse.mean(&[f64::NAN, 0.0]);
    assert!(mean.is_nan() && gradient[0].is_nan());
    let (mean, _) = sparse.mean(&[1e200, 0.0]);
    assert!(mean.abs() < 1e-12);
    assert!(Sparse::new(KERNEL, inputs.clone(), &inputs, &[f64::NAN; 30], 1).is_none());
    assert!(Sparse::new(Kernel { noise: 0.0, ..KERNEL }, inputs.clone(), &inputs, &labels, 1).is_none());
}

proptest! {
    #[test]
    fn the_gradient_is_that_of_differences(
        n in 1_usize..40,
        x in prop::array::uniform2(-3.0_f64..3.0),
        lengths in prop::array::uniform2(0.2_f64..5.0),
    ) {
        let kernel = Kernel { length_scales: lengths, ..KERNEL };
        let (inputs, labels) = samples(n);
        let sparse = Sparse::new(kernel, inputs.clone(), &inputs, &labels, 1).unwrap();
        let (mean, gradient) = sparse.mean(&x);
        let exact = Exact::new(kernel, &inputs, &labels).unwrap();
        prop_assert!((mean - exact.mean(&x)).abs() < 1e-5);
        for d in 0..2 {
            let (mut up, mut down) = (x, x);
            (up[d], down[d]) = (x[d] + 1e-5, x[d] - 1e-5);
            let difference = (sparse.mean(&up).0 - sparse.mean(&down).0) / 2e-5;
            prop_assert!((gradient[d] - difference).abs() < 1e-4 * (1.0 + difference.abs()), "{} {difference}", gradient[d]);
        }
    }
}
