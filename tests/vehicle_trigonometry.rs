//! Our arc tangent, sine and cosine against the library's.

use rfl_mpc::vehicle::trigonometry::{atan, cos, sin};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// What the module promises, and one unit in the last place for the library's own error.
const TOLERANCE: f64 = 5e-16 + 2.3e-16;

fn check_atan(x: f64) {
    let (plus, minus) = (atan(x), atan(-x));
    let expected = x.atan();
    assert!((plus - expected).abs() <= TOLERANCE * expected.abs(), "atan {x:e}: {plus:e}, not {expected:e}");
    assert_eq!(plus.to_bits(), (-minus).to_bits(), "atan is not odd at {x:e}");
}

fn check_sin_and_cos(x: f64) {
    let (sin, cos, mirrored) = (sin(x), cos(x), cos(-x));
    assert!((sin - x.sin()).abs() <= TOLERANCE, "sin {x:e}: {sin:e}, not {:e}", x.sin());
    assert!((cos - x.cos()).abs() <= TOLERANCE, "cos {x:e}: {cos:e}, not {:e}", x.cos());
    assert_eq!(cos.to_bits(), mirrored.to_bits(), "cos is not even at {x:e}");
}

#[test]
fn arc_tangent_over_all_magnitudes() {
    for k in -700_000..=700_000 {
        check_atan((f64::from(k) * 1e-3).exp());
    }
    for k in 1..=400_000 {
        check_atan(f64::from(k) * 2e-5);
    }
}

#[test]
fn arc_tangent_where_its_pieces_meet() {
    for middle in [FRAC_PI_4 / 2.0, FRAC_PI_4, 3.0 * FRAC_PI_4 / 2.0] {
        let bits = middle.tan().to_bits();
        for bits in bits - 1000..bits + 1000 {
            check_atan(f64::from_bits(bits));
        }
    }
}

#[test]
fn arc_tangent_at_extremes() {
    let special = [0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY];
    let expected = [0.0, -0.0, FRAC_PI_2, -FRAC_PI_2];
    assert_eq!(special.map(|x| atan(x).to_bits()), expected.map(f64::to_bits));
    assert!(atan(f64::NAN).is_nan());
    for x in [5e-324, 1e-310, f64::MIN_POSITIVE, f64::MIN_POSITIVE / 3.0] {
        assert_eq!([atan(x), atan(-x)], [x, -x]);
    }
    check_atan(f64::MAX);
}

#[test]
fn sine_and_cosine_over_a_dense_grid() {
    for k in 0..=800_000 {
        check_sin_and_cos(f64::from(k) * 2.5e-5);
        check_sin_and_cos(f64::from(k) * -0.012_5);
    }
    for k in 0..6000 {
        // Half turns and what lies beside them, up to where the library takes over and beyond.
        let x = f64::from(k) * FRAC_PI_2;
        for x in [x, x + 1e-9, x - 1e-9, x.next_up(), x.next_down()] {
            check_sin_and_cos(x);
        }
    }
}

#[test]
fn small_sines_are_relatively_exact() {
    for k in -700_000..=450 {
        let x = (f64::from(k) * 1e-3).exp();
        let sin = sin(x);
        assert!((sin - x.sin()).abs() <= TOLERANCE * x.sin(), "sin {x:e}: {sin:e}");
    }
    assert_eq!([sin(5e-324), sin(1e-310)], [5e-324, 1e-310]);
}

#[test]
fn sine_and_cosine_at_extremes() {
    assert_eq!([sin(0.0), cos(0.0)], [0.0, 1.0]);
    for x in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
        assert!(sin(x).is_nan() && cos(x).is_nan());
    }
    for x in [1e4, 1e4 + 1.0, 1e6 * PI, 1e15, 1e300] {
        check_sin_and_cos(x);
    }
}
