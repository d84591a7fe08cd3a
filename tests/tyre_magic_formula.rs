//! The Magic Formula against its own closed forms.

use rfl_mpc::vehicle::builtin;
use rfl_mpc::vehicle::tyre::{Coefficients, Contact, TyreForces, TyreModel as _};

fn tyre() -> Coefficients {
    builtin("c_class").unwrap().tyre.rear.coefficients.unwrap()
}

fn at(kappa: f64, alpha: f64, gamma: f64, load: f64) -> TyreForces {
    tyre().forces(&Contact { kappa, alpha, gamma, load, friction: 1.0 })
}

#[test]
fn slope_at_zero_is_bcd() {
    let tyre = tyre();
    for load in [1000.0, 4000.0, 7000.0] {
        let step = 1e-6;
        let lateral = (at(0.0, -step, 0.0, load).fy - at(0.0, step, 0.0, load).fy) / (2.0 * step);
        assert!((lateral / tyre.cornering_stiffness(load, 0.0) - 1.0).abs() < 1e-6, "{lateral}");
        let longitudinal = (at(step, 0.0, 0.0, load).fx - at(-step, 0.0, 0.0, load).fx) / (2.0 * step);
        assert!((longitudinal / tyre.slip_stiffness(load) - 1.0).abs() < 1e-6, "{longitudinal}");
        // PKY1 Fz0 sin(2 atan(Fz / (PKY2 Fz0)))
        let expected = 20.3 * 4000.0 * (2.0 * (load / 8000.0).atan()).sin();
        assert!((tyre.cornering_stiffness(load, 0.0) / expected - 1.0).abs() < 1e-12);
    }
}

#[test]
fn early_softening_is_that_of_a_brush() {
    let softer = Coefficients { softening: 1.0, ..tyre() };
    let load = 4000.0;
    // A brush slides from 3 times its greatest force over its slope on; the formula's friction is 1.05 at this load.
    let slides = 3.0 * 1.05 * load / tyre().cornering_stiffness(load, 0.0);
    for share in [0.01, 0.08, 0.2, 0.4] {
        let contact = Contact { alpha: -share * slides, load, friction: 1.0, ..Contact::default() };
        let ratio = softer.forces(&contact).fy / tyre().forces(&contact).fy;
        assert!((ratio - 1.08 / (1.0 + share)).abs() < 1e-12, "{ratio} at {share}");
        // To second order what a brush has: 1 - u + u^2 / 3.
        let brush = 1.0 - share + share * share / 3.0;
        assert!((ratio / 1.08 - brush).abs() < 0.7 * share * share, "{ratio} at {share}");
    }
}

#[test]
fn peak_is_friction_times_load() {
    for (load, dfz) in [(2000.0, -0.5), (4000.0, 0.0), (6000.0, 0.5)] {
        let mu = 1.05 - 0.12 * dfz;
        let peak = (1..2000).map(|k| at(0.0, -1e-3 * f64::from(k), 0.0, load).fy).fold(0.0, f64::max);
        assert!((peak / (mu * load) - 1.0).abs() < 1e-4, "{peak} at {load}");
        let mu = 1.12 - 0.08 * dfz;
        let peak = (1..2000).map(|k| at(1e-3 * f64::from(k), 0.0, 0.0, load).fx).fold(0.0, f64::max);
        assert!((peak / (mu * load) - 1.0).abs() < 1e-4, "{peak} at {load}");
    }
}

#[test]
fn mirrored_slip_gives_mirrored_forces() {
    for (kappa, alpha, gamma) in [(0.02, 0.05, 0.03), (-0.1, 0.2, -0.02), (0.0, 0.01, 0.1)] {
        let (left, right) = (at(kappa, alpha, gamma, 3500.0), at(kappa, -alpha, -gamma, 3500.0));
        assert_eq!(left.fx, right.fx);
        assert_eq!(left.fy, -right.fy);
        assert_eq!(left.mz, -right.mz);
    }
}

#[test]
fn combined_slip_takes_from_both_and_stays_in_the_ellipse() {
    let (load, mu_x, mu_y) = (4000.0, 1.12, 1.05);
    for k in 0..60 {
        let kappa = 0.01 * f64::from(k);
        for a in 0..60 {
            let alpha = -0.01 * f64::from(a);
            let both = at(kappa, alpha, 0.0, load);
            assert!(both.fx <= at(kappa, 0.0, 0.0, load).fx + 1e-9);
            assert!(both.fy <= at(0.0, alpha, 0.0, load).fy + 1e-9);
            let grip = (both.fx / (mu_x * load)).hypot(both.fy / (mu_y * load));
            assert!(grip < 1.1, "{grip} at {kappa}, {alpha}");
        }
    }
}

#[test]
fn without_combined_coefficients_the_friction_ellipse_holds() {
    let tyre = Coefficients { rbx1: 0.0, rby1: 0.0, ..tyre() };
    let pure = |kappa, alpha| tyre.forces(&Contact { kappa, alpha, gamma: 0.0, load: 4000.0, friction: 1.0 });
    assert_eq!(pure(0.05, 0.0).fx, at(0.05, 0.0, 0.0, 4000.0).fx);
    assert_eq!(pure(0.0, -0.05).fy, at(0.0, -0.05, 0.0, 4000.0).fy);
    for (kappa, alpha) in [(0.05_f64, -0.05_f64), (0.3, -0.1), (-0.2, 0.4), (1e-9, -0.1), (0.1, -1e-9)] {
        let both = pure(kappa, alpha);
        assert!(both.fx * kappa > 0.0 && both.fy * alpha < 0.0);
        assert!((both.fx / 4480.0).hypot(both.fy / 4200.0) <= 1.0 + 1e-9, "{both:?}");
    }
}

#[test]
fn friction_moves_the_peak_and_not_the_slope() {
    let tyre = tyre();
    let with =
        |alpha, friction| tyre.forces(&Contact { kappa: 0.0, alpha, gamma: 0.0, load: 4000.0, friction }).fy;
    assert!((with(-1e-5, 0.4) / with(-1e-5, 1.0) - 1.0).abs() < 1e-5);
    let peak = |friction| (1..1500).map(|k| with(-1e-3 * f64::from(k), friction)).fold(0.0, f64::max);
    assert!((peak(0.4) / peak(1.0) - 0.4).abs() < 1e-4);
}

#[test]
fn camber_thrust_points_where_the_wheel_leans() {
    // Top to the right (gamma > 0): force to the right. K PHY3 gamma + Fz PVY3 gamma.
    let force = at(0.0, 0.0, 1e-4, 4000.0).fy;
    let expected = -(64960.0 * 0.03 + 4000.0 * 0.2) * 1e-4;
    assert!((force / expected - 1.0).abs() < 1e-3, "{force}, expected {expected}");
}

#[test]
fn aligning_moment_turns_the_wheel_into_the_slip() {
    // Trail at zero slip and nominal load: QDZ1 R0.
    let force = at(0.0, -1e-4, 0.0, 4000.0);
    assert!((force.mz / force.fy / (-0.09 * 0.316) - 1.0).abs() < 1e-3, "{force:?}");
}

#[test]
fn a_wheel_in_the_air_has_no_forces_and_small_loads_small_ones() {
    assert_eq!(at(0.5, 0.5, 0.1, 0.0), TyreForces::default());
    assert_eq!(at(0.5, 0.5, 0.1, -50.0), TyreForces::default());
    let (one, two) = (at(0.02, 0.05, 0.0, 20.0), at(0.02, 0.05, 0.0, 40.0));
    assert!((two.fy / one.fy - 2.0).abs() < 1e-9, "below FZMIN forces are proportional to the load");
    let (most, more) = (at(0.02, 0.05, 0.0, 12000.0), at(0.02, 0.05, 0.0, 50000.0));
    assert_eq!(most, more, "above FZMAX the load is clamped");
}
