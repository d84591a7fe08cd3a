//! The prediction with a learned residual is that of the model it stands for, and the MPC uses it.

use nalgebra::{Matrix4, Vector4};
use rfl_mpc::control::{Affine, HorizonModel, Propagation, QpShape, TrackingQp, condense};
use rfl_mpc::numerics::Random;

const HORIZON: usize = 16;

fn problem() -> TrackingQp {
    TrackingQp::new(QpShape {
        horizon: HORIZON,
        outputs: 4,
        inputs: 1,
        output_weight: vec![1.0; 4],
        terminal_factor: 1.0,
        rate_weight: vec![1.0],
        input_min: vec![-1.0],
        input_max: vec![1.0],
        rate_max: vec![1.0],
        soft: vec![],
    })
}

struct Case {
    a: Matrix4<f64>,
    b: Vector4<f64>,
    start: Vector4<f64>,
    affine: Affine<Vector4<f64>>,
    past: Vec<f64>,
    decisions: Vec<f64>,
}

fn case(window: usize, seed: u64) -> Case {
    let mut random = Random::new(seed);
    let mut draw = move || 2.0 * random.uniform() - 1.0;
    let mut affine = Affine::new(HORIZON, window);
    for j in 0..HORIZON {
        affine.known[j] = Vector4::from_fn(|_, _| draw());
        affine.constant[j] = Vector4::from_fn(|_, _| draw());
    }
    for effect in &mut affine.command {
        *effect = Vector4::from_fn(|_, _| draw());
    }
    Case {
        a: Matrix4::from_fn(|_, _| 0.4 * draw()),
        b: Vector4::from_fn(|_, _| draw()),
        start: Vector4::from_fn(|_, _| draw()),
        affine,
        past: (1..window).map(|_| draw()).collect(),
        decisions: (0..HORIZON).map(|_| draw()).collect(),
    }
}

/// The model as it is written, simulated step by step.
fn simulate(case: &Case, propagation: Propagation) -> Vec<Vector4<f64>> {
    let commands: Vec<f64> = case.past.iter().chain(&case.decisions).copied().collect();
    let window = case.past.len() + 1;
    let mut x = case.start;
    (0..HORIZON)
        .map(|j| {
            let mut residual = case.affine.constant[j];
            for (effect, command) in case.affine.commands_of(j).iter().zip(&commands[j..j + window]) {
                residual += effect * *command;
            }
            x = case.a * x + case.b * case.decisions[j] + case.affine.known[j];
            match propagation {
                Propagation::Propagated => {
                    x += residual;
                    x
                }
                Propagation::Direct => x + residual,
            }
        })
        .collect()
}

#[test]
fn condensing_is_exact_for_windows_shorter_and_longer_than_the_horizon() {
    for propagation in [Propagation::Propagated, Propagation::Direct] {
        for window in [1, 2, 7, 15, 16, 17, 40] {
            let mut case = case(window, window as u64);
            let expected = simulate(&case, propagation);
            let mut problem = problem();
            let linear = HorizonModel { a: &case.a, b: &case.b };
            let tracked = [0, 1, 2, 3];
            condense(linear, &case.start, &mut case.affine, &case.past, propagation, &tracked, &mut problem);
            for (row, value) in expected.iter().flatten().enumerate() {
                let gain = &problem.gain[row * HORIZON..][..HORIZON];
                let forced: f64 = gain.iter().zip(&case.decisions).map(|(g, u)| g * u).sum();
                let found = problem.free[row] + forced;
                assert!((found - value).abs() < 1e-12, "{propagation:?}, window {window}, row {row}");
            }
        }
    }
}

#[test]
fn without_a_residual_both_ways_are_the_nominal_model() {
    let mut case = case(1, 5);
    let known = case.affine.known.clone();
    case.affine = Affine::new(HORIZON, 0);
    case.affine.known = known;
    let mut gains = Vec::new();
    for propagation in [Propagation::Propagated, Propagation::Direct] {
        let mut problem = problem();
        let linear = HorizonModel { a: &case.a, b: &case.b };
        condense(linear, &case.start, &mut case.affine, &[], propagation, &[0, 1, 2, 3], &mut problem);
        gains.push((problem.gain, problem.free));
    }
    assert_eq!(gains[0], gains[1]);
}
