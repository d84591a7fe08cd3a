//! Conservation by hitch and equations: momentum, angular momentum and energy without external forces.

use super::dynamics::TruckEnvironment;
use super::output::TruckFlow;
use super::plant::{STATES, TRAILER, TruckPlant, WHEELS};
use crate::vehicle::stepper::{Plant, StageInputs};
use crate::vehicle::unit::{
    BODY, HEAVE, HEAVE_RATE, PITCH, PITCH_RATE, ROLL, ROLL_RATE, UnitConstants, VX, VY, X, Y, YAW, YAW_RATE,
};
use crate::vehicle::{TruckEffects, builtin_truck};
use proptest::prelude::*;

/// A truck on ice without friction, in no air.
fn on_ice(name: &str) -> TruckPlant {
    let mut truck = builtin_truck(name).unwrap();
    for tyre in [&mut truck.tyre.front, &mut truck.tyre.rear, &mut truck.tyre.trailer] {
        let coefficients = tyre.coefficients.as_mut().unwrap();
        (coefficients.lmux, coefficients.lmuy, coefficients.qsy1) = (1e-12, 1e-12, 0.0);
    }
    (truck.air.density, truck.hitch.friction) = (0.0, 0.0);
    TruckPlant::new(&truck, truck.tyres(), &TruckEffects::default()).unwrap()
}

fn environment(plant: &TruckPlant) -> TruckEnvironment {
    plant.environment(&[0.0; STATES], None, 0.0)
}

const COASTING: StageInputs = StageInputs { steer: 0.1, accel: 0.0 };

/// Both units' bodies with their places.
fn bodies(plant: &TruckPlant, y: &[f64; STATES]) -> [[f64; BODY]; 2] {
    [std::array::from_fn(|i| y[i]), plant.trailer_placed(y)]
}

/// Momentum in world axes, N s, and angular momentum about the origin, N m s.
fn momenta(plant: &TruckPlant, y: &[f64; STATES]) -> [f64; 3] {
    let [tractor, trailer] = bodies(plant, y);
    let of = |mass: f64, sprung: f64, arm: f64, x_sprung: f64, inertia: f64, body: &[f64; BODY]| {
        let (sin, cos) = body[YAW].sin_cos();
        let sway = -sprung * arm * body[ROLL_RATE];
        let (along, aside) = (mass * body[VX], mass * body[VY] + sway);
        let (px, py) = (along * cos - aside * sin, along * sin + aside * cos);
        [px, py, body[X] * py - body[Y] * px + inertia * body[YAW_RATE] + x_sprung * sway]
    };
    let (a, b) = (&plant.tractor, &plant.trailer);
    let one = of(a.mass, a.sprung_mass, a.roll_arm, a.x_sprung, inertias(a)[0], &tractor);
    let two = of(b.mass, b.sprung_mass, b.roll_arm, b.x_sprung, inertias(b)[0], &trailer);
    std::array::from_fn(|i| one[i] + two[i])
}

/// Yaw inertia of a unit, and roll inertia of its body about its CG, kg m2, out of the inverse that it keeps.
fn inertias<T, const A: usize>(unit: &UnitConstants<T, A>) -> [f64; 2] {
    let rows = nalgebra::Matrix3::from_fn(|i, j| unit.inverse_inertia[i][j]);
    let inertia = rows.try_inverse().unwrap();
    [inertia[(1, 1)], inertia[(2, 2)]]
}

/// Kinetic energy of the motion in the plane, J.
fn kinetic(plant: &TruckPlant, y: &[f64; STATES]) -> f64 {
    let [tractor, trailer] = bodies(plant, y);
    let of = |mass: f64, inertia: f64, body: &[f64; BODY]| {
        0.5 * (mass * (body[VX].powi(2) + body[VY].powi(2)) + inertia * body[YAW_RATE].powi(2))
    };
    of(plant.tractor.mass, inertias(&plant.tractor)[0], &tractor)
        + of(plant.trailer.mass, inertias(&plant.trailer)[0], &trailer)
}

/// Number of the state's components.
const NUMBERS: usize = 16;

/// A motion in the plane, an attitude of the bodies, which do not roll at this instant; from numbers between -1 and 1.
fn state_of(plant: &TruckPlant, numbers: &[f64]) -> [f64; STATES] {
    let mut numbers = numbers.iter();
    let mut number = |greatest: f64| greatest * numbers.next().expect("enough numbers");
    let mut y = plant.placed(number(100.0), number(100.0), number(3.0), number(30.0));
    y[VY] = number(3.0);
    y[YAW_RATE] = number(1.0);
    (y[PITCH], y[PITCH_RATE]) = (number(0.03), number(0.1));
    (y[HEAVE], y[HEAVE_RATE]) = (number(0.02), number(0.1));
    y[TRAILER] = y[YAW] + number(1.5);
    y[TRAILER + 1] = number(1.0);
    (y[TRAILER + 4], y[TRAILER + 5]) = (number(0.02), number(0.1));
    (y[TRAILER + 6], y[TRAILER + 7]) = (number(0.02), number(0.1));
    y
}

/// The rates at a state, and the change of something of the state along them.
fn along<T, const M: usize>(
    plant: &TruckPlant,
    y: &[f64; STATES],
    of: impl Fn(&[f64; STATES]) -> T,
) -> [f64; M]
where
    T: Into<[f64; M]>,
{
    let (mut rates, mut flow) = ([0.0; STATES], TruckFlow::default());
    plant.derivative(y, &COASTING, &environment(plant), &mut rates, &mut flow);
    const H: f64 = 1e-6;
    let at = |h: f64| of(&std::array::from_fn(|i| y[i] + h * rates[i])).into();
    let (after, before) = (at(H), at(-H));
    std::array::from_fn(|i| (after[i] - before[i]) / (2.0 * H))
}

proptest! {
    #[test]
    fn nothing_from_outside_changes_no_momentum(
        name in prop::sample::select(crate::vehicle::BUILTIN_TRUCKS),
        numbers in prop::collection::vec(-1.0..1.0_f64, NUMBERS),
    ) {
        let plant = on_ice(name);
        let y = state_of(&plant, &numbers);
        let change: [f64; 3] = along(&plant, &y, |y| momenta(&plant, y));
        let scale = [2e5, 2e5, 2e7];
        for i in 0..3 {
            prop_assert!(change[i].abs() < 2e-6 * scale[i], "component {i}: {}", change[i]);
        }
    }

    #[test]
    fn the_trailers_velocity_is_that_of_its_place(
        numbers in prop::collection::vec(-1.0..1.0_f64, NUMBERS),
        rolls in prop::array::uniform4(-0.3..0.3_f64),
    ) {
        let plant = on_ice("truck_real");
        let mut y = state_of(&plant, &numbers);
        // Here the bodies may roll.
        [y[ROLL], y[ROLL_RATE], y[TRAILER + 2], y[TRAILER + 3]] = rolls;
        let [dx, dy]: [f64; 2] = along(&plant, &y, |y| {
            let trailer = plant.trailer_placed(y);
            [trailer[X], trailer[Y]]
        });
        let now = plant.trailer_placed(&y);
        let (sin, cos) = now[YAW].sin_cos();
        prop_assert!((dx * cos + dy * sin - now[VX]).abs() < 1e-6, "along: {dx} {dy} {now:?}");
        prop_assert!((dy * cos - dx * sin - now[VY]).abs() < 1e-6, "across: {dx} {dy} {now:?}");
    }
}

#[test]
fn ten_seconds_of_whirling_keep_momenta_and_energy() {
    // All heights equal: no force makes a body roll.
    // Bodies' CGs and hitch in the plane of the road, which a truck's file cannot say: no force makes a body roll.
    let mut plant = on_ice("truck_simulation");
    flatten(&mut plant);
    let mut y = plant.placed(0.0, 0.0, 0.4, 15.0);
    (y[YAW_RATE], y[TRAILER], y[TRAILER + 1]) = (0.7, -0.2, -0.3);
    let (before, energy) = (momenta(&plant, &y), kinetic(&plant, &y));
    let environment = environment(&plant);
    for _ in 0..10_000 {
        y = runge_kutta(&plant, &y, &environment, 1e-3);
    }
    let after = momenta(&plant, &y);
    let scale = [before[0].hypot(before[1]), before[0].hypot(before[1]), before[2].abs()];
    for i in 0..3 {
        assert!((after[i] - before[i]).abs() < 1e-7 * scale[i], "component {i}: {} {}", before[i], after[i]);
    }
    let kept = kinetic(&plant, &y) / energy - 1.0;
    eprintln!("energy changed by {kept:e}, articulation {}", plant.articulation(&y));
    assert!(kept.abs() < 1e-7, "energy changed by {kept:e}");
    assert!((plant.articulation(&y) - 0.6).abs() > 0.2, "the units whirl");
    assert!(y[WHEELS..].iter().all(|state| state.is_finite()));
}

/// Takes all lever arms of roll away.
fn flatten(plant: &mut TruckPlant) {
    fn level<T, const A: usize>(unit: &mut UnitConstants<T, A>) {
        let inertias = inertias(unit);
        unit.roll_arm = 0.0;
        unit.sprung_height = 0.0;
        for axle in &mut unit.axles {
            (axle.roll_centre, axle.sway) = (0.0, 0.0);
        }
        unit.inverse_inertia =
            [[1.0 / unit.mass, 0.0, 0.0], [0.0, 1.0 / inertias[0], 0.0], [0.0, 0.0, 1.0 / inertias[1]]];
    }
    level(&mut plant.tractor);
    level(&mut plant.trailer);
    for pin in &mut plant.hitch.pins {
        pin.level();
    }
}

/// One step of the classic Runge-Kutta method.
fn runge_kutta(
    plant: &TruckPlant,
    y: &[f64; STATES],
    environment: &TruckEnvironment,
    h: f64,
) -> [f64; STATES] {
    let rate = |y: &[f64; STATES]| {
        let (mut rates, mut flow) = ([0.0; STATES], TruckFlow::default());
        plant.derivative(y, &COASTING, environment, &mut rates, &mut flow);
        rates
    };
    let ahead = |k: &[f64; STATES], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
    let first = rate(y);
    let second = rate(&ahead(&first, 0.5 * h));
    let third = rate(&ahead(&second, 0.5 * h));
    let fourth = rate(&ahead(&third, h));
    std::array::from_fn(|i| y[i] + h / 6.0 * (first[i] + 2.0 * (second[i] + third[i]) + fourth[i]))
}
