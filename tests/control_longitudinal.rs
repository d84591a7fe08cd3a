//! Speed and lag error by MPC.

use crate::counting::allocated;
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;
use rfl_mpc::control::{
    ClarabelSolver, FastSolver, LongitudinalInput, LongitudinalMpc, LongitudinalParameters, LongitudinalStep,
    MpcParameters, QpShape, QpSolver, SpeedParameters, TrackingQp,
};
use rfl_mpc::nominal::{ContinuousErrorModel, zero_order_hold};
use rfl_mpc::path::{Closure, Path, Sample, SpeedLimits, SpeedPlan};
use rfl_mpc::vehicle::SingleTrack;

const TS: f64 = 0.02;

fn straight(length: f64) -> Path {
    let samples = (0..=40).map(|k| Sample::at(f64::from(k) * length / 40.0, 0.0)).collect();
    Path::from_samples(samples, Closure::Open).unwrap()
}

fn circle(radius: f64) -> Path {
    let point = |k: i32| {
        let angle = f64::from(k) * std::f64::consts::TAU / 120.0;
        Sample::at(radius * angle.cos(), radius * angle.sin())
    };
    Path::from_samples((0..120).map(point).collect(), Closure::Closed).unwrap()
}

/// A point mass behind a drive with a lag, on a slope, that brakes can hold.
#[derive(Debug, Clone, Copy, Default)]
struct Mass {
    station: f64,
    speed: f64,
    drive: f64,
    lag: f64,
    slope: f64,
}

impl Mass {
    fn advance(&mut self, accel_cmd: f64, time: f64) {
        for _ in 0..20 {
            let step = time / 20.0;
            let follow = if self.lag > 0.0 { 1.0 - (-step / self.lag).exp() } else { 1.0 };
            self.drive += follow * (accel_cmd - self.drive);
            self.speed = (self.speed + (self.drive + self.slope) * step).max(0.0);
            self.station += self.speed * step;
        }
    }
}

struct Drive {
    path: Path,
    plan: SpeedPlan,
    mpc: LongitudinalMpc,
    mass: Mass,
    speed: SpeedParameters,
    parameters: LongitudinalParameters,
    accel_cmd: f64,
    /// Time between steps, s.
    elapsed: f64,
}

impl Drive {
    fn new(path: Path, horizon: usize, mass: Mass, change: impl Fn(&mut LongitudinalParameters)) -> Self {
        let mut parameters = LongitudinalParameters { horizon, ..LongitudinalParameters::default() };
        change(&mut parameters);
        let speed = SpeedParameters { limit: 10.0, ..SpeedParameters::default() };
        let limits = SpeedLimits {
            lateral_accel: speed.lateral_accel,
            accel: speed.accel,
            decel: speed.decel,
            speed: speed.limit,
            ..SpeedLimits::default()
        };
        let plan = SpeedPlan::between(&path, &limits, None, true);
        let mpc = LongitudinalMpc::new(parameters, &speed, &MpcParameters::default());
        Self { path, plan, mpc: mpc.unwrap(), mass, speed, parameters, accel_cmd: 0.0, elapsed: TS }
    }

    /// A step; bounds are checked in each.
    fn step(&mut self, speed_limit: f64) -> LongitudinalStep {
        let length = self.path.length();
        let station =
            if self.path.is_periodic() { self.mass.station.rem_euclid(length) } else { self.mass.station };
        let step = self.mpc.step(&LongitudinalInput {
            station,
            speed: self.mass.speed,
            elapsed: self.elapsed,
            plan: &self.plan,
            path: &self.path,
            speed_limit,
            time_limit: f64::INFINITY,
        });
        assert!(step.solved.is_ok(), "{step:?}");
        let accel_cmd = step.accel_cmd;
        assert!(accel_cmd >= -self.speed.decel_cmd_max && accel_cmd <= self.speed.accel_cmd_max, "{step:?}");
        let rate = (accel_cmd - self.accel_cmd).abs() / TS;
        assert!(rate <= self.parameters.accel_rate_max * (1.0 + 1e-9), "{step:?} after {}", self.accel_cmd);
        assert!(step.lag_error.abs() <= self.parameters.lag_max, "{step:?}");
        self.accel_cmd = accel_cmd;
        self.mass.advance(accel_cmd, self.elapsed);
        step
    }
}

#[test]
fn a_speed_step_is_tracked_without_overshoot() {
    for (horizon, lag, behind) in [(40, 0.0, 0.1), (60, 0.0, 0.1), (60, 0.3, 0.25)] {
        let mass = Mass { speed: 5.0, lag, ..Mass::default() };
        let mut drive = Drive::new(straight(600.0), horizon, mass, |p| p.drive_lag = lag);
        let (mut top, mut most) = (0.0_f64, 0.0_f64);
        for k in 0..1500 {
            let step = drive.step(if k < 250 { 5.0 } else { f64::INFINITY });
            if k < 250 {
                assert!((drive.mass.speed - 5.0).abs() < 1e-6, "{step:?}");
            }
            top = top.max(drive.mass.speed);
            most = most.max(step.lag_error.abs());
        }
        let step = drive.step(f64::INFINITY);
        assert!(top < 10.1, "{top}");
        // An unannounced step: the drive's own lag is way lost.
        assert!(most < behind, "{most}");
        assert!((drive.mass.speed - 10.0).abs() < 1e-3, "{}", drive.mass.speed);
        assert!(step.lag_error.abs() < 1e-3, "{step:?}");
    }
}

#[test]
fn a_slope_and_an_unknown_drive_lag_leave_no_lag_error() {
    for horizon in [40, 60] {
        let mass = Mass { speed: 8.0, lag: 0.2, slope: -0.8, ..Mass::default() };
        let mut drive = Drive::new(straight(900.0), horizon, mass, |_| {});
        for _ in 0..2500 {
            drive.step(f64::INFINITY);
        }
        let step = drive.step(f64::INFINITY);
        assert!(step.lag_error.abs() < 0.01 && (drive.mass.speed - 10.0).abs() < 0.01, "{step:?}");
        assert!((drive.mpc.disturbance() + 0.8).abs() < 0.02, "{}", drive.mpc.disturbance());
    }
}

#[test]
fn it_stops_at_the_end() {
    for (horizon, lag) in [(40, 0.0), (60, 0.0), (60, 0.3)] {
        let mass = Mass { lag, ..Mass::default() };
        let mut drive = Drive::new(straight(150.0), horizon, mass, |p| p.drive_lag = lag);
        let mut furthest = 0.0_f64;
        for _ in 0..2500 {
            drive.step(f64::INFINITY);
            furthest = furthest.max(drive.mass.station);
        }
        let rest = drive.path.length() - drive.mass.station;
        assert!(drive.mass.speed < 1e-3 && rest.abs() < 0.1, "{:?}", drive.mass);
        assert!(furthest < drive.path.length() + 0.1);
    }
}

#[test]
fn a_vehicle_that_is_held_is_waited_for() {
    let mut drive = Drive::new(straight(600.0), 60, Mass { speed: 6.0, ..Mass::default() }, |_| {});
    for _ in 0..100 {
        drive.step(f64::INFINITY);
    }
    // Held for 20 s: the point waits at its bound, and the command stays where it is.
    let mut commands = Vec::new();
    let place = drive.mass.station;
    for _ in 0..1000 {
        (drive.mass.station, drive.mass.speed) = (place, 0.0);
        let step = drive.step(f64::INFINITY);
        commands.push(step.accel_cmd);
        assert!(step.lag_error <= drive.parameters.lag_max);
    }
    let late = &commands[800..];
    assert!(late.iter().all(|command| (command - late[0]).abs() < 1e-6), "{late:?}");
    // Let go: it catches up, no faster than the reference allows.
    (drive.mass.station, drive.mass.speed) = (place, 0.0);
    let mut excess = 0.0_f64;
    for _ in 0..1500 {
        let step = drive.step(f64::INFINITY);
        excess = excess.max(drive.mass.speed - step.speed_ref);
    }
    assert!(excess < drive.parameters.overspeed_max + 0.1, "{excess}");
    let step = drive.step(f64::INFINITY);
    assert!(step.lag_error.abs() < 0.02 && (drive.mass.speed - 10.0).abs() < 0.02, "{step:?}");
}

#[test]
fn a_lap_of_a_closed_path_is_no_jump() {
    let mut drive = Drive::new(circle(30.0), 60, Mass::default(), |_| {});
    let target = drive.plan.speed(0.0);
    for k in 0..4000 {
        let step = drive.step(f64::INFINITY);
        if k > 1000 {
            assert!(step.lag_error.abs() < 0.01 && (drive.mass.speed - target).abs() < 0.05, "{k}: {step:?}");
        }
    }
    assert!(drive.mass.station > 2.0 * drive.path.length());
}

#[test]
fn a_jump_of_the_station_moves_the_point_along() {
    let mut drive = Drive::new(straight(900.0), 60, Mass { speed: 9.0, ..Mass::default() }, |_| {});
    for _ in 0..300 {
        drive.step(f64::INFINITY);
    }
    for jump in [200.0, -150.0] {
        drive.mass.station += jump;
        for _ in 0..500 {
            drive.step(f64::INFINITY);
        }
        let step = drive.step(f64::INFINITY);
        assert!(step.lag_error.abs() < 0.05 && (drive.mass.speed - 10.0).abs() < 0.1, "{step:?}");
    }
}

#[test]
fn a_restored_state_goes_on_alike() {
    let start = Mass { slope: -0.3, lag: 0.2, ..Mass::default() };
    let mut drive = Drive::new(straight(400.0), 60, start, |p| p.drive_lag = 0.1);
    for _ in 0..200 {
        drive.step(f64::INFINITY);
    }
    let saved = postcard::to_allocvec(&drive.mpc.state()).unwrap();
    let (mass, accel_cmd) = (drive.mass, drive.accel_cmd);
    let first: Vec<u64> = (0..100).map(|_| drive.step(f64::INFINITY).accel_cmd.to_bits()).collect();
    let mut again = Drive::new(straight(400.0), 60, mass, |p| p.drive_lag = 0.1);
    again.accel_cmd = accel_cmd;
    again.mpc.restore(postcard::from_bytes(&saved).unwrap());
    let second: Vec<u64> = (0..100).map(|_| again.step(f64::INFINITY).accel_cmd.to_bits()).collect();
    assert_eq!(first, second);
}

#[test]
fn a_step_allocates_nothing() {
    let mut drive = Drive::new(straight(400.0), 60, Mass { slope: -0.5, ..Mass::default() }, |_| {});
    let most = (0..600)
        .map(|k| {
            let limit = if k == 300 { 3.0 } else { f64::INFINITY };
            allocated(|| {
                drive.step(limit);
            })
            .0
        })
        .skip(1)
        .max();
    assert_eq!(most, Some(0));
}

/// A host whose steps are a little longer than the sample time drives as fast as the plan says.
#[test]
fn the_reference_point_moves_with_the_clock_of_the_host() {
    for elapsed in [0.9 * TS, TS, 1.1 * TS] {
        let mut drive = Drive::new(straight(600.0), 60, Mass { speed: 5.0, ..Mass::default() }, |_| {});
        drive.elapsed = elapsed;
        for k in 0..1500 {
            let step = drive.step(f64::INFINITY);
            if k > 500 && step.speed_ref > 9.9 {
                assert!(
                    (drive.mass.speed - step.speed_ref).abs() < 0.05,
                    "{elapsed} s: {}",
                    drive.mass.speed
                );
                assert!(drive.mpc.disturbance().abs() < 0.05, "{elapsed} s: {}", drive.mpc.disturbance());
            }
        }
    }
}

#[test]
fn what_is_no_number_holds_the_command() {
    let mut drive = Drive::new(straight(400.0), 60, Mass::default(), |_| {});
    for _ in 0..50 {
        drive.step(f64::INFINITY);
    }
    let state = drive.mpc.state();
    for (station, speed) in [(f64::NAN, 5.0), (10.0, f64::INFINITY)] {
        let step = drive.mpc.step(&LongitudinalInput {
            station,
            speed,
            elapsed: drive.elapsed,
            plan: &drive.plan,
            path: &drive.path,
            speed_limit: f64::INFINITY,
            time_limit: f64::INFINITY,
        });
        assert_eq!(step.accel_cmd, drive.accel_cmd);
        assert!(step.solved.is_err());
        assert_eq!(drive.mpc.state(), state);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn whatever_happens_commands_keep_their_bounds(
        events in prop::collection::vec((0.0..900.0_f64, 0.0..20.0_f64, 0.0..15.0_f64), 1..20),
        lag in 0.0..0.5_f64,
    ) {
        let mut drive = Drive::new(straight(700.0), 30, Mass { lag, ..Mass::default() }, |p| p.drive_lag = lag);
        for (station, speed, limit) in events {
            (drive.mass.station, drive.mass.speed) = (station, speed);
            for _ in 0..15 {
                drive.step(limit);
            }
        }
    }
}

/// Lateral and longitudinal errors of a car in a bend, linear about driving on the reference: `[e1, e1', e2, e2', e_l, v -
/// v_ref]` by steering, acceleration and the road.
struct Joint {
    a: SMatrix<f64, 6, 6>,
    b: SMatrix<f64, 6, 2>,
    road: SVector<f64, 6>,
}

const SPEED: f64 = 8.0;
const CURVATURE: f64 = 0.02;

impl Joint {
    /// With or without the products with the curvature.
    fn new(coupled: bool) -> Self {
        let car = SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 };
        let model = ContinuousErrorModel::new(&car, SPEED).unwrap();
        let (mut a, mut inputs) = (SMatrix::<f64, 6, 6>::zeros(), SMatrix::<f64, 6, 3>::zeros());
        a.fixed_view_mut::<4, 4>(0, 0).copy_from(&model.a);
        a[(4, 5)] = -1.0;
        inputs.fixed_view_mut::<4, 1>(0, 0).copy_from(&model.b);
        inputs[(5, 1)] = 1.0;
        inputs.fixed_view_mut::<4, 1>(0, 2).copy_from(&(model.d * (SPEED * CURVATURE)));
        if coupled {
            // The way along the path is s' = v (1 + kappa e1), and D psi_des' = (.. / v - v) v kappa.
            a[(4, 0)] = -SPEED * CURVATURE;
            a[(1, 5)] = -2.0 * SPEED * CURVATURE;
        }
        let (a, inputs) = zero_order_hold(&a, &inputs, TS);
        Self { a, b: inputs.fixed_view::<6, 2>(0, 0).into_owned(), road: inputs.column(2).into_owned() }
    }

    /// The problem over both inputs from a state, by simulation of each input's effect.
    fn problem(&self, lateral: &QpShape, longitudinal: &QpShape, start: &SVector<f64, 6>) -> TrackingQp {
        let both = |of: fn(&QpShape) -> &Vec<f64>| [of(lateral).as_slice(), of(longitudinal)].concat();
        let shift = lateral.outputs;
        let shape = QpShape {
            horizon: lateral.horizon,
            outputs: shift + longitudinal.outputs,
            inputs: 2,
            output_weight: both(|shape| &shape.output_weight),
            terminal_factor: 1.0,
            rate_weight: both(|shape| &shape.rate_weight),
            input_min: both(|shape| &shape.input_min),
            input_max: both(|shape| &shape.input_max),
            rate_max: both(|shape| &shape.rate_max),
            soft: longitudinal
                .soft
                .iter()
                .map(|soft| rfl_mpc::control::SoftBound { output: soft.output + shift, ..*soft })
                .collect(),
        };
        let (horizon, outputs) = (shape.horizon, shape.outputs);
        let mut problem = TrackingQp::new(shape);
        let mut x = *start;
        for j in 0..horizon {
            x = self.a * x + self.road;
            problem.free[j * outputs..][..outputs].copy_from_slice(x.as_slice());
        }
        for input in 0..2 {
            for at in 0..horizon {
                let mut effect = self.b.column(input).into_owned();
                for j in at..horizon {
                    for i in 0..outputs {
                        problem.gain[(j * outputs + i) * 2 * horizon + 2 * at + input] = effect[i];
                    }
                    effect = self.a * effect;
                }
            }
        }
        problem
    }
}

/// The part of a joint problem that one input and some outputs are.
fn part(joint: &TrackingQp, shape: &QpShape, input: usize, first: usize) -> TrackingQp {
    let mut problem = TrackingQp::new(shape.clone());
    let (horizon, outputs, all) = (shape.horizon, shape.outputs, joint.shape.outputs);
    for j in 0..horizon {
        for i in 0..outputs {
            let (row, from) = (j * outputs + i, j * all + first + i);
            problem.free[row] = joint.free[from];
            for at in 0..horizon {
                problem.gain[row * horizon + at] = joint.gain[from * 2 * horizon + 2 * at + input];
            }
        }
    }
    problem.previous[0] = joint.previous[input];
    problem
}

/// Steering and acceleration over the horizon: by the joint problem, and by two.
fn solve_both(coupled: bool, start: &SVector<f64, 6>) -> [[Vec<f64>; 2]; 2] {
    let longitudinal = Drive::new(straight(100.0), 60, Mass::default(), |_| {}).mpc.problem().shape.clone();
    let p = MpcParameters { horizon: 60, ..MpcParameters::default() };
    let lateral = QpShape {
        outputs: 4,
        output_weight: vec![10.0, 1.0, 1.0, 0.0],
        rate_weight: vec![p.r_rate / (TS * TS)],
        input_min: vec![-p.steer_max],
        input_max: vec![p.steer_max],
        rate_max: vec![p.steer_rate_max * TS],
        soft: Vec::new(),
        ..longitudinal.clone()
    };
    let joint = Joint::new(coupled).problem(&lateral, &longitudinal, start);
    let solve = |solver: &mut dyn QpSolver, problem: &TrackingQp| {
        let (mut inputs, mut outputs) = (vec![0.0; problem.columns()], vec![0.0; problem.free.len()]);
        solver.solve(problem, f64::INFINITY, &mut inputs, &mut outputs).unwrap();
        (inputs, outputs)
    };
    let (together, _) = solve(&mut ClarabelSolver::exact(&joint).unwrap(), &joint);
    let of = |input: usize| together.iter().skip(input).step_by(2).copied().collect::<Vec<_>>();

    // Apart: the acceleration knows nothing of the steering; the steering knows the speeds that will be driven.
    let plain = Joint::new(false).problem(&lateral, &longitudinal, start);
    let alone = part(&plain, &longitudinal, 1, 4);
    let (accel, speeds) = solve(&mut FastSolver::new(&alone, 100).unwrap(), &alone);
    let mut alone = part(&plain, &lateral, 0, 0);
    if coupled {
        let model = Joint::new(true);
        let mut x = *start;
        for j in 0..60 {
            let before = if j == 0 { start[5] } else { speeds[2 * (j - 1) + 1] };
            x[5] = before;
            x = model.a * x + model.b.column(1) * accel[j] + model.road;
            alone.free[4 * j..][..4].copy_from_slice(&x.as_slice()[..4]);
        }
    }
    let (steer, _) = solve(&mut FastSolver::new(&alone, 100).unwrap(), &alone);
    [[of(0), of(1)], [steer, accel]]
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn without_products_of_curvature_two_problems_are_the_joint_one() {
    // Small deviations, then ones that bring the bounds of rates and of the overspeed in.
    let starts = [
        SVector::from([0.05, 0.02, -0.02, 0.01, 0.1, -0.2]),
        SVector::from([0.8, 0.1, 0.1, 0.0, 1.9, 0.4]),
        SVector::from([-1.5, 0.0, 0.0, 0.0, -1.0, -3.0]),
    ];
    for start in starts {
        let [[steer, accel], [steer_alone, accel_alone]] = solve_both(false, &start);
        let off = [difference(&steer, &steer_alone), difference(&accel, &accel_alone)];
        assert!(off.iter().all(|&off| off < 1e-6), "{off:?}");
    }
}

#[test]
fn the_products_of_curvature_would_only_cut_bends() {
    let largest = |x: &[f64]| x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    // 8 m/s in a left bend of 50 m, beside the path and a little slow: steering and acceleration are as good apart.
    let start = SVector::from([0.1, 0.0, 0.0, 0.0, 0.0, -0.1]);
    let [[steer, accel], [steer_alone, accel_alone]] = solve_both(true, &start);
    let off = [difference(&steer, &steer_alone), difference(&accel, &accel_alone)];
    assert!(off[0] < 0.05 * largest(&steer), "{off:?}");
    assert!(off[1] < 0.1 * largest(&accel), "{off:?}");
    // 0.3 m behind, on the path: together they steer to the inside.
    let start = SVector::from([0.0, 0.0, 0.0, 0.0, 0.3, 0.0]);
    let [[steer, _], [steer_alone, _]] = solve_both(true, &start);
    assert!(steer[0] > steer_alone[0] + 1e-3, "{} {}", steer[0], steer_alone[0]);
}
