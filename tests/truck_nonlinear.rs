//! The nonlinear tractor with semi-trailer of nonlinear MPC: Newton and Euler, the linear model at small angles, its
//! derivatives, its steady state; and that the prediction along a path has the right derivatives.

use nalgebra::{SMatrix, SVector, Vector3};
use rfl_mpc::control::{ArticulatedRollOut, StepSpeed};
use rfl_mpc::nominal::{
    ArticulatedPathState, ArticulatedSingleTrack, ArticulatedState, Bicycle, ContinuousErrorModel, HeldSpeed,
    LateralVehicle, PathModel,
};
use rfl_mpc::numerics::Random;
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::vehicle::{Articulated, SingleTrack, builtin_truck};

fn truck() -> Articulated {
    builtin_truck("truck_simulation").unwrap().articulated()
}

fn model(friction: f64) -> ArticulatedSingleTrack {
    ArticulatedSingleTrack::new(&truck(), friction).unwrap()
}

/// Lateral force of an axle, as the module's formula has it.
fn force(stiffness: f64, peak: f64, slip_angle: f64) -> f64 {
    let b = stiffness / (1.3 * peak);
    peak * (1.3 * (b * slip_angle).atan()).sin()
}

/// Accelerations `[vy', r', r2']` with the hitch force as an unknown, in the tractor's axes, each unit by itself.
fn newton_euler(
    p: &Articulated,
    friction: f64,
    [vy, r, phi, phi_rate]: [f64; 4],
    u: f64,
    steer: f64,
) -> Vector3<f64> {
    let Articulated { mass1, mass2, yaw_inertia1, yaw_inertia2, a1, b1, c1, a2, b2, stiffness } = *p;
    let r2 = r - phi_rate;
    let (sin, cos) = phi.sin_cos();
    // Static loads by moments about the hitch and about the tractor's axles.
    let load3 = 9.81 * mass2 * a2 / (a2 + b2);
    let at_hitch = 9.81 * mass2 - load3;
    let load2 = (9.81 * mass1 * a1 + at_hitch * (a1 + c1)) / (a1 + b1);
    let load1 = 9.81 * mass1 + at_hitch - load2;
    // The trailer's axes in the tractor's: forward and left. Its velocities in them.
    let (forward, left) = ([cos, -sin], [sin, cos]);
    let hitch = [u, vy - c1 * r];
    let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
    let slip3 = -((dot(hitch, left) - (a2 + b2) * r2) / dot(hitch, forward)).atan();
    let f1 = force(stiffness[0], friction * load1, steer - ((vy + a1 * r) / u).atan()) * steer.cos();
    let f2 = force(stiffness[1], friction * load2, -((vy - b1 * r) / u).atan());
    let f3 = force(stiffness[2], friction * load3, slip3);
    // Unknowns: vy', r', r2', hitch force on the trailer [x, y]. The trailer's CG accelerates with
    // a_hitch - a2 r2' left + a2 r2^2 forward, the hitch with [-vy r + c1 r^2, vy' + u r - c1 r'].
    #[rustfmt::skip]
    let matrix = SMatrix::<f64, 5, 5>::new(
        mass1, 0.0,           0.0,                    0.0,          1.0,
        0.0,   yaw_inertia1,  0.0,                    0.0,          -c1,
        0.0,   0.0,           -mass2 * a2 * left[0],  -1.0,         0.0,
        mass2, -mass2 * c1,   -mass2 * a2 * left[1],  0.0,          -1.0,
        0.0,   0.0,           yaw_inertia2,           -a2 * left[0], -a2 * left[1],
    );
    let centripetal = mass2 * a2 * r2 * r2;
    let right = SVector::<f64, 5>::from([
        f1 + f2 - mass1 * u * r,
        a1 * f1 - b1 * f2,
        f3 * left[0] - mass2 * (c1 * r * r - vy * r) - centripetal * forward[0],
        f3 * left[1] - mass2 * u * r - centripetal * forward[1],
        -b2 * f3,
    ]);
    let found = matrix.lu().solve(&right).unwrap();
    Vector3::new(found[0], found[1], found[2])
}

#[test]
fn agrees_with_newton_and_euler_of_each_unit() {
    let mut random = Random::new(3);
    let mut draw = |half: f64| half * (2.0 * random.uniform() - 1.0);
    for friction in [0.5, 1.0] {
        for _ in 0..200 {
            let body = [draw(1.0), draw(0.5), draw(1.0), draw(0.5)];
            let (u, steer) = (8.0 + draw(6.0), draw(0.4));
            let [vy, r, phi_rate] = model(friction).rates(body, u, steer).value;
            let expected = newton_euler(&truck(), friction, body, u, steer);
            let found = Vector3::new(vy, r, r - phi_rate);
            assert!((found - expected).norm() < 1e-9 * (1.0 + expected.norm()), "{found} {expected}");
        }
    }
}

#[test]
fn derivatives_are_those_of_differences() {
    let mut random = Random::new(4);
    let mut draw = |half: f64| half * (2.0 * random.uniform() - 1.0);
    for friction in [0.5, 1.0] {
        let model = model(friction);
        for k in 0..100 {
            // The last ones beyond the articulation where the trailer's rolling speed is held.
            let phi = if k < 90 { draw(1.0) } else { 1.6 + draw(0.1) };
            let at = [draw(1.0), draw(0.5), phi, draw(0.5), draw(0.4)];
            let u = 8.0 + draw(6.0);
            let rates = |x: [f64; 5]| model.rates([x[0], x[1], x[2], x[3]], u, x[4]);
            let found = rates(at).jacobian;
            for i in 0..5 {
                let (mut up, mut down) = (at, at);
                (up[i], down[i]) = (at[i] + 1e-6, at[i] - 1e-6);
                let (up, down) = (rates(up).value, rates(down).value);
                for o in 0..3 {
                    let difference = (up[o] - down[o]) / 2e-6;
                    let gap = (found[o][i] - difference).abs();
                    assert!(
                        gap < 1e-6 * (1.0 + difference.abs()),
                        "{k} {o} {i}: {} {difference}",
                        found[o][i]
                    );
                }
            }
        }
    }
}

#[test]
fn at_small_angles_it_is_the_linear_model() {
    for speed in [2.0, 8.0, 20.0] {
        let linear = ContinuousErrorModel::new(&truck(), speed).unwrap();
        let rates = model(1.0).rates([0.0; 4], speed, 0.0);
        assert_eq!(rates.value, [0.0; 3]);
        // On a straight road e1' = vy + u e2, e2' = r: the columns of e1', e2', phi, phi' are those of vy, r, phi, phi'.
        for (row, jacobian) in [1, 3, 5].into_iter().zip(&rates.jacobian) {
            let [by_vy, by_r, by_phi, by_phi_rate, by_steer] = *jacobian;
            let turning = if row == 1 { speed } else { 0.0 };
            let expected = [
                linear.a[(row, 1)],
                linear.a[(row, 3)] - turning,
                linear.a[(row, 4)],
                linear.a[(row, 5)],
                linear.b[row],
            ];
            for (found, expected) in [by_vy, by_r, by_phi, by_phi_rate, by_steer].iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 1e-9 * (1.0 + expected.abs()),
                    "{row}: {found} {expected}"
                );
            }
            // A parallel turn of tractor and trailer is no force: the column of e2 is that of vy times the speed.
            assert!((linear.a[(row, 2)] + speed * by_vy).abs() < 1e-9 * (1.0 + linear.a[(row, 2)].abs()));
        }
    }
}

#[test]
fn without_a_trailer_it_is_the_bicycle() {
    let unit = Articulated { mass2: 1e-6, yaw_inertia2: 1e-6, stiffness: [289e3, 343e3, 1e-6], ..truck() };
    let car = SingleTrack {
        mass: unit.mass1,
        yaw_inertia: unit.yaw_inertia1,
        lf: unit.a1,
        lr: unit.b1,
        cf: unit.stiffness[0],
        cr: unit.stiffness[1],
    };
    let (truck, car) = (ArticulatedSingleTrack::new(&unit, 0.7).unwrap(), Bicycle::new(&car, 0.7).unwrap());
    let found = truck.rates([0.4, 0.3, 0.2, 0.1], 9.0, 0.15);
    let expected = car.rates(0.4, 0.3, 9.0, 0.15);
    for row in 0..2 {
        assert!((found.value[row] - expected.value[row]).abs() < 1e-6, "{found:?} {expected:?}");
        for (i, j) in [(0, 0), (1, 1), (4, 2)] {
            assert!(
                (found.jacobian[row][i] - expected.jacobian[row][j]).abs() < 1e-5,
                "{found:?} {expected:?}"
            );
        }
    }
}

#[test]
fn steady_cornering_is_an_equilibrium_and_at_small_angles_the_linear_one() {
    let model = model(0.8);
    for (speed, curvature) in [(2.0, 1.0 / 12.5), (4.0, -1.0 / 15.0), (8.0, 1.0 / 60.0), (15.0, -0.01)] {
        let turn = model.steady_turn(speed, curvature);
        let yaw_rate = curvature * speed.hypot(turn.vy);
        let rates = model.rates([turn.vy, yaw_rate, turn.articulation, 0.0], speed, turn.steer);
        assert!(rates.value.iter().all(|rate| rate.abs() < 1e-9), "{speed} {curvature}: {rates:?}");
        let errors = model.steady_errors(speed, curvature);
        let (state, steer) = model.steady_state(speed, curvature, &errors);
        let held = HeldSpeed { path: speed, body: speed };
        let step = model.step_along(|_| [curvature, 0.0], &state, held, steer, 0.02);
        let moved = step.state - state;
        assert!(moved.fixed_rows::<6>(1).norm() < 1e-9, "{moved}");
    }
    let linear = truck().steady_state(10.0) * 1e-4;
    assert!((model.steady_errors(10.0, 1e-4) - linear).norm() < 1e-4 * linear.norm());
}

const HORIZON: usize = 24;

#[test]
fn gains_are_differences_of_the_prediction_over_the_horizon() {
    let path = Route::TruckTest.path().unwrap();
    let errors = |roll_out: &mut ArticulatedRollOut, plan: &[f64]| -> Vec<f64> {
        roll_out.follow(&path, plan);
        (0..HORIZON).flat_map(|j| roll_out.errors(j).iter().copied().collect::<Vec<_>>()).collect()
    };
    // A slow start, where a control step is made of parts; saturating tyres; speed.
    for (friction, speed, station) in [(1.0, 1.5, 100.0), (0.3, 6.0, 200.0), (1.0, 12.0, 60.0)] {
        let mut roll_out = ArticulatedRollOut::new(&truck(), friction, None, 0.02, HORIZON).unwrap();
        roll_out.speed.fill(StepSpeed::held(speed));
        roll_out.disturbance = [0.0, 1e-3, -5e-4, 2e-3, 1e-3, 0.0, 1e-3].into();
        roll_out.start = ArticulatedPathState::from([station, 0.3, -0.1, 0.1, 0.2, 0.4, -0.1]);
        let plan: Vec<f64> = (0..HORIZON).map(|j| 0.15 + 0.1 * (0.3 * j as f64).sin()).collect();
        let at = errors(&mut roll_out, &plan);
        assert!(at.iter().all(|value| value.is_finite()));
        let mut gain = vec![0.0; 6 * HORIZON * HORIZON];
        roll_out.write_gain(&[0, 1, 2, 3, 4, 5], &mut gain);
        for column in (0..HORIZON).step_by(5) {
            let mut moved = |by: f64| {
                let mut plan = plan.clone();
                plan[column] += by;
                errors(&mut roll_out, &plan)
            };
            let (up, down) = (moved(1e-5), moved(-1e-5));
            for row in 0..6 * HORIZON {
                let difference = (up[row] - down[row]) / 2e-5;
                let entry = gain[row * HORIZON + column];
                assert!(
                    (entry - difference).abs() < 2e-6 * (1.0 + difference.abs()),
                    "speed {speed}, row {row}, column {column}: {entry} {difference}"
                );
            }
        }
        // The next state from other errors, to first order.
        roll_out.follow(&path, &plan);
        let expected = *roll_out.errors(0);
        assert_eq!(roll_out.first_step(&ArticulatedState::zeros(), plan[0]).state, expected);
        for (of_errors, of_state) in [(4, 5), (5, 6)] {
            let (mut moved, mut other) = (ArticulatedState::zeros(), roll_out.clone());
            moved[of_errors] = 1e-4;
            other.start[of_state] += 1e-4;
            other.follow(&path, &plan);
            let predicted = roll_out.first_step(&moved, plan[0]).state;
            let (gap, change) = ((predicted - other.errors(0)).norm(), (predicted - expected).norm());
            assert!(change > 1e-5 && gap < 1e-3 * change, "{of_errors}: {predicted} {}", other.errors(0));
        }
    }
}

#[test]
fn names_the_parameter_that_is_wrong() {
    let error =
        |truck: &Articulated, friction| ArticulatedSingleTrack::new(truck, friction).unwrap_err().to_string();
    assert!(error(&truck(), 0.0).contains("friction"));
    assert!(error(&Articulated { b2: -1.0, ..truck() }, 1.0).contains("b2"));
    // A hitch far behind the rear axle lifts the front.
    assert!(error(&Articulated { c1: 9.0, ..truck() }, 1.0).contains("front axle"));
}
