//! The truck against closed forms: what the linear tractor and semi-trailer do.

use nalgebra::{Complex, DMatrix, DVector, Matrix3, Vector3};
use rfl_mpc::vehicle::{
    Articulated, BUILTIN_TRUCKS, Truck, TruckEffects, TruckInput, TruckOutput, TruckParameters, builtin_truck,
};

fn truck(parameters: &TruckParameters, speed: f64) -> Truck {
    let mut truck = Truck::new(parameters, &TruckEffects::default(), None).unwrap();
    truck.place(0.0, 0.0, 0.0, speed);
    truck
}

/// Holds a speed in a circle until all is steady.
fn circle(parameters: &TruckParameters, speed: f64, steer_cmd: f64, seconds: f64) -> TruckOutput {
    let mut truck = truck(parameters, speed);
    for _ in 0..(seconds * 100.0) as usize {
        let accel_cmd = 2.0 * (speed - truck.output().vx);
        truck.step(&TruckInput { steer_cmd, accel_cmd }, 0.01).unwrap();
    }
    *truck.output()
}

fn near(value: f64, expected: f64, relative: f64, what: &str) {
    assert!((value / expected - 1.0).abs() <= relative, "{what}: {value}, expected {expected}");
}

/// A truck that lacks what the linear model does not know: air, rolling resistance, friction of the fifth wheel.
fn plain(name: &str) -> TruckParameters {
    let mut truck = builtin_truck(name).unwrap();
    truck.hitch.friction = 0.0;
    truck.air.drag_area = 0.0;
    (truck.air.tractor_side_area, truck.air.trailer_side_area) = (0.0, 0.0);
    for tyre in [&mut truck.tyre.front, &mut truck.tyre.rear, &mut truck.tyre.trailer] {
        tyre.coefficients.as_mut().unwrap().qsy1 = 0.0;
    }
    truck
}

/// The linear model's inertia matrix, of `[v', r', phi'']`.
fn inertia(p: &Articulated) -> Matrix3<f64> {
    let h = p.c1 + p.a2;
    let coupling = p.yaw_inertia2 + p.mass2 * p.a2 * h;
    Matrix3::from_rows(&[
        [p.mass1 + p.mass2, -p.mass2 * h, p.mass2 * p.a2].into(),
        [-p.mass2 * h, p.yaw_inertia1 + p.yaw_inertia2 + p.mass2 * h * h, -coupling].into(),
        [p.mass2 * p.a2, -coupling, p.yaw_inertia2 + p.mass2 * p.a2 * p.a2].into(),
    ])
}

/// From forces of the axle groups to generalised forces.
fn geometry(p: &Articulated) -> Matrix3<f64> {
    let (h, l2) = (p.c1 + p.a2, p.a2 + p.b2);
    Matrix3::new(1.0, 1.0, 1.0, p.a1, -p.b1, -(h + p.b2), 0.0, 0.0, l2)
}

/// The linear model's state matrix for `[v, r, phi', phi]` at a speed, and its input column.
fn linear(p: &Articulated, u: f64) -> (DMatrix<f64>, DVector<f64>) {
    let (inertia, g) = (inertia(p), geometry(p));
    let force = inertia.try_inverse().unwrap() * g * Matrix3::from_diagonal(&Vector3::from(p.stiffness));
    let (rates, angle, steer) = (-force * g.transpose() / u, -force.column(2), force.column(0));
    let mut a = DMatrix::zeros(4, 4);
    a.view_mut((0, 0), (3, 3)).copy_from(&rates);
    a.view_mut((0, 3), (3, 1)).copy_from(&angle);
    a[(0, 1)] -= u;
    a[(3, 2)] = 1.0;
    (a, DVector::from_iterator(4, steer.iter().copied().chain([0.0])))
}

#[test]
fn stiffness_at_rest_is_what_the_papers_page_says() {
    for (name, wanted) in [("truck_simulation", [289e3, 343e3, 329e3]), ("truck_real", [270e3, 298e3, 263e3])]
    {
        let truck = builtin_truck(name).unwrap();
        let linear = truck.articulated();
        for ((stiffness, wanted), load) in linear.stiffness.iter().zip(wanted).zip(truck.axle_loads()) {
            near(*stiffness, wanted, 1e-4, name);
            near(stiffness / load, 5.7, 2e-3, "per newton of load");
        }
    }
    let sim = builtin_truck("truck_simulation").unwrap().articulated();
    assert_eq!(
        (sim.mass1, sim.mass2, sim.yaw_inertia1, sim.yaw_inertia2),
        (7180.0, 10000.0, 21863.0, 141_676.0)
    );
    assert_eq!((sim.a1, sim.b1, sim.c1, sim.a2, sim.b2), (1.675, 1.815, 0.6, 4.426, 3.102));
    let real = builtin_truck("truck_real").unwrap().articulated();
    assert_eq!(
        (real.mass1, real.mass2, real.yaw_inertia1, real.yaw_inertia2),
        (6870.0, 8000.0, 24800.0, 113_341.0)
    );
    assert_eq!((real.a1, real.b1, real.c1, real.a2, real.b2), (1.8, 2.0, 0.6, 4.426, 3.102));
}

#[test]
fn a_steady_circle_takes_the_geometric_angles() {
    for name in BUILTIN_TRUCKS {
        let p = plain(name);
        let l = p.articulated();
        let wheelbase = l.a1 + l.b1;
        // Slowly: the wheels roll where they point.
        let steer = wheelbase / 50.0;
        let out = circle(&p, 2.0, steer, 60.0);
        let radius = out.vx / out.yaw_rate;
        near(radius, 50.0, 0.01, "radius");
        // Rear axle on a circle, the hitch ahead of it, the trailer's axle towed by the hitch.
        let rear = radius;
        let ahead = l.b1 - l.c1;
        let hitch = rear.hypot(ahead);
        let expected = ((l.a2 + l.b2) / hitch).asin() - (ahead / rear).atan();
        near(out.articulation, expected, 0.01, "articulation");
        assert!(out.articulation_rate.abs() < 1e-6, "{}", out.articulation_rate);
    }
}

#[test]
fn a_fast_circle_is_that_of_the_linear_model() {
    for name in BUILTIN_TRUCKS {
        let p = plain(name);
        for speed in [10.0, 20.0] {
            let steer = 0.002;
            let out = circle(&p, speed, steer, 40.0);
            let (a, b) = linear(&p.articulated(), out.vx);
            let steady = -(a.clone().try_inverse().unwrap() * b) * steer;
            near(out.yaw_rate, steady[1], 3e-3, "yaw rate");
            near(out.articulation, steady[3], 5e-3, "articulation");
            assert!((out.vy - steady[0]).abs() < 0.01 * steer * speed, "vy {}, {}", out.vy, steady[0]);
        }
    }
}

/// The least damped pair of what a truck does freely after a small push of its steering at a speed: the eigenvalues of
/// the map from `[vy, r, phi', phi]` to the same a moment later, by least squares.
fn least_damped(p: &TruckParameters, effects: &TruckEffects, speed: f64) -> Complex<f64> {
    const STEP: f64 = 0.02;
    let mut truck = Truck::new(p, effects, None).unwrap();
    truck.place(0.0, 0.0, 0.0, speed);
    let mut rows = Vec::new();
    for k in 0..250 {
        let steer_cmd = if k < 10 { 1e-4 } else { 0.0 };
        truck.step(&TruckInput { steer_cmd, accel_cmd: 0.0 }, STEP).unwrap();
        let o = truck.output();
        rows.push([o.vy, o.yaw_rate, o.articulation_rate, o.articulation]);
    }
    // When what tyres and bodies add has died out.
    let free = &rows[30..];
    let matrix = |rows: &[[f64; 4]]| DMatrix::from_fn(rows.len(), 4, |i, j| rows[i][j] * 1e4);
    let (now, next) = (matrix(&free[..free.len() - 1]), matrix(&free[1..]));
    let map = now.svd(true, true).solve(&next, 1e-12).unwrap().transpose();
    let modes = map.complex_eigenvalues().map(|value| value.ln() / STEP);
    modes.iter().copied().max_by(|x, y| x.re.total_cmp(&y.re)).unwrap()
}

/// The linear model's least damped mode; with tyres whose forces come a relaxation length (m) late, if it is not 0.
fn least_damped_linear(p: &Articulated, speed: f64, relaxation: f64) -> Complex<f64> {
    let (a, _) = linear(p, speed);
    let modes = if relaxation > 0.0 {
        // Forces relax to what the state asks for: F' = (u / relaxation) (K x - F), x' = N F + P x.
        let g = geometry(p);
        let stiffness = Matrix3::from_diagonal(&Vector3::from(p.stiffness));
        let force = inertia(p).try_inverse().unwrap() * g;
        let rate = speed / relaxation;
        let mut full = DMatrix::zeros(7, 7);
        full.view_mut((0, 4), (3, 3)).copy_from(&force);
        full[(0, 1)] -= speed;
        full[(3, 2)] = 1.0;
        let asked = -(stiffness * g.transpose() / speed) * rate;
        full.view_mut((4, 0), (3, 3)).copy_from(&asked);
        full[(6, 3)] -= p.stiffness[2] * rate;
        for i in 4..7 {
            full[(i, i)] -= rate;
        }
        full.complex_eigenvalues()
    } else {
        a.complex_eigenvalues()
    };
    modes.iter().copied().max_by(|x, y| x.re.total_cmp(&y.re)).unwrap()
}

fn close(found: Complex<f64>, expected: Complex<f64>, relative: f64, what: &str) {
    let expected = Complex::new(expected.re, expected.im.abs());
    let found = Complex::new(found.re, found.im.abs());
    eprintln!("{what}: {found}, expected {expected}");
    assert!((found - expected).norm() <= relative * expected.norm(), "{what}: {found}, expected {expected}");
}

#[test]
fn the_linear_model_has_the_known_eigenvalues() {
    let p = builtin_truck("truck_simulation").unwrap().articulated();
    close(least_damped_linear(&p, 20.0, 0.0), Complex::new(-1.36, 2.32), 2e-3, "linear model at 20 m/s");
}

#[test]
fn small_motions_are_those_of_the_linear_model() {
    for name in BUILTIN_TRUCKS {
        // A truck that hardly rolls, with known relaxation lengths.
        let mut p = plain(name);
        for axle in [&mut p.axle.front, &mut p.axle.rear, &mut p.axle.trailer] {
            axle.roll_centre_height = 0.55;
            axle.anti_roll_bar = 8e6;
        }
        (p.tractor.cg_height, p.trailer.cg_height, p.hitch.height) = (0.55, 0.55, 0.55);
        // One length for all, whatever their load.
        for tyre in [&mut p.tyre.front, &mut p.tyre.rear, &mut p.tyre.trailer] {
            tyre.coefficients.as_mut().unwrap().pty1 = 0.0;
        }
        for (speed, relaxation) in [(10.0, 0.35), (20.0, 0.1), (20.0, 0.35), (28.0, 0.35)] {
            let mut effects = TruckEffects::default();
            effects.vehicle.tyre_relaxation = relaxation;
            let found = least_damped(&p, &effects, speed);
            let expected = least_damped_linear(&p.articulated(), speed, relaxation);
            close(found, expected, 0.01, &format!("{name} at {speed} m/s, relaxation {relaxation} m"));
        }
    }
}

#[test]
fn the_whole_truck_swings_nearly_as_the_linear_model_does() {
    // Roll and relaxation move the pair a little.
    let found = least_damped(&plain("truck_simulation"), &TruckEffects::default(), 20.0);
    close(found, Complex::new(-1.36, 2.32), 0.15, "all of the truck at 20 m/s");
}
