//! The derivatives that nonlinear MPC linearises with are those of its prediction.

use rfl_mpc::control::{BicycleRollOut, StepSpeed};
use rfl_mpc::nominal::{BicycleState, ErrorState, errors_of};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::vehicle::builtin;

const HORIZON: usize = 24;

fn roll_out(friction: f64, speed: f64) -> BicycleRollOut {
    let car = builtin("c_class").unwrap().single_track();
    let mut roll_out = BicycleRollOut::new(&car, friction, None, 0.02, HORIZON).unwrap();
    for (j, speeds) in roll_out.speed.iter_mut().enumerate() {
        // Braking, so that no two steps are alike.
        let at = |j: f64| speed * (1.0 - 0.01 * j);
        let j = j as f64;
        *speeds = StepSpeed { speed: [at(j), at(j + 0.5), at(j + 1.0)], ..StepSpeed::held(speed) };
    }
    roll_out.disturbance = BicycleState::new(0.0, 1e-3, -5e-4, 2e-3, 1e-3);
    roll_out
}

fn plan() -> Vec<f64> {
    (0..HORIZON).map(|j| 0.15 + 0.1 * (0.3 * j as f64).sin()).collect()
}

/// All predicted errors under a plan.
fn errors(roll_out: &mut BicycleRollOut, path: &Path, plan: &[f64]) -> Vec<f64> {
    roll_out.follow(path, plan);
    (0..HORIZON).flat_map(|j| roll_out.errors(j).iter().copied().collect::<Vec<_>>()).collect()
}

#[test]
fn gains_are_differences_of_the_prediction_over_the_horizon() {
    let path = Path::from_samples(Route::SudokuTest.samples(), Closure::Detect).unwrap();
    // A slow start, where a control step is made of parts; a bend with saturating tyres; a fast straight.
    for (friction, speed, station) in [(1.0, 1.5, 850.0), (0.4, 6.0, 690.0), (1.0, 12.0, 60.0)] {
        let mut roll_out = roll_out(friction, speed);
        roll_out.start = BicycleState::new(station, 0.3, -0.1, 0.1, 0.2);
        let plan = plan();
        let at = errors(&mut roll_out, &path, &plan);
        let mut gain = vec![0.0; 4 * HORIZON * HORIZON];
        roll_out.write_gain(&[0, 1, 2, 3], &mut gain);
        assert!(at.iter().all(|value| value.is_finite()));
        for column in 0..HORIZON {
            let mut moved = |by: f64| {
                let mut plan = plan.clone();
                plan[column] += by;
                errors(&mut roll_out, &path, &plan)
            };
            let (up, down) = (moved(1e-5), moved(-1e-5));
            for row in 0..4 * HORIZON {
                let difference = (up[row] - down[row]) / 2e-5;
                let entry = gain[row * HORIZON + column];
                // The second derivative of the path's curvature jumps at its nodes: differences see that, a little.
                assert!(
                    (entry - difference).abs() < 1e-6 * (1.0 + difference.abs()),
                    "speed {speed}, row {row}, column {column}: {entry} {difference}"
                );
            }
        }
    }
}

#[test]
fn the_next_state_is_that_of_the_prediction_and_its_derivatives() {
    let path = Path::from_samples(Route::SudokuTest.samples(), Closure::Detect).unwrap();
    let mut roll_out = roll_out(1.0, 6.0);
    roll_out.start = BicycleState::new(690.0, 0.1, -0.1, 0.1, 0.2);
    roll_out.follow(&path, &plan());
    let same = roll_out.first_step(&ErrorState::zeros(), plan()[0]);
    assert_eq!(same.state, *roll_out.errors(0));
    // Other errors at the same station, and another command.
    let before = roll_out.clone();
    let at_start = |state: &BicycleState| {
        let station = state[0];
        let curvature = [path.curvature(station), path.curvature_rate(station)];
        errors_of(state, before.speed[0].speed[1], curvature).errors
    };
    for (i, by) in [(1, 1e-3), (2, 1e-3), (3, 1e-3), (4, 1e-3), (0, 0.0)] {
        roll_out.start = before.start;
        roll_out.start[i] += by;
        let mut other = plan();
        other[0] += if i == 0 { 1e-3 } else { 0.0 };
        roll_out.follow(&path, &other);
        let moved = at_start(&roll_out.start) - at_start(&before.start);
        let expected = before.first_step(&moved, other[0]).state;
        let change = (roll_out.errors(0) - before.errors(0)).norm();
        assert!(change > 1e-4, "{i}: {change}");
        assert!(
            (expected - roll_out.errors(0)).norm() < 0.02 * change,
            "{i}: {expected} {}",
            roll_out.errors(0)
        );
    }
}

#[test]
fn the_steady_yaw_error_stays_under_a_disturbance() {
    let circle = (0..400).map(|k| {
        let angle = f64::from(k) * std::f64::consts::TAU / 400.0;
        rfl_mpc::path::Sample::at(40.0 * angle.cos(), 40.0 * angle.sin())
    });
    let path = Path::from_samples(circle.collect(), Closure::Closed).unwrap();
    let mut roll_out = roll_out(1.0, 8.0);
    roll_out.speed.fill(StepSpeed::held(8.0));
    let curvature = path.curvature(0.0);
    let yaw_error = roll_out.steady_yaw_error(0, curvature);
    // Find the steady state by Newton on differences of the prediction alone.
    let mut x = [yaw_error, -8.0 * yaw_error.tan(), 8.0 * curvature, 0.07];
    let gap = |roll_out: &mut BicycleRollOut, x: &[f64; 4]| {
        roll_out.start = BicycleState::new(0.0, 0.0, x[0], x[1], x[2]);
        roll_out.follow(&path, &[x[3]; HORIZON]);
        let state = roll_out.state(0);
        nalgebra::Vector4::new(state[1], state[2] - x[0], state[3] - x[1], state[4] - x[2])
    };
    for _ in 0..10 {
        let at = gap(&mut roll_out, &x);
        let by = nalgebra::Matrix4::from_columns(&std::array::from_fn::<_, 4, _>(|i| {
            let mut moved = x;
            moved[i] += 1e-6;
            (gap(&mut roll_out, &moved) - at) / 1e-6
        }));
        let step = by.lu().solve(&at).unwrap();
        for (x, step) in x.iter_mut().zip(step.iter()) {
            *x -= step;
        }
    }
    assert!((x[0] - yaw_error).abs() < 1e-5, "{} {yaw_error}", x[0]);
    roll_out.disturbance = BicycleState::zeros();
    assert!((roll_out.steady_yaw_error(0, curvature) - yaw_error).abs() > 1e-3, "the disturbance counts");
}
