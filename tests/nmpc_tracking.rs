//! Nonlinear MPC in the closed loop: as good as its model is, and never worse than the linear MPC by much.

use crate::nmpc::{controller, drive, drive_bicycle, with_model};
use rfl_mpc::control::{ControllerParameters, PredictionModel};
use rfl_mpc::nominal::Bicycle;
use rfl_mpc::simulate::TrackingMetrics;
use rfl_mpc::vehicle::{Effects, builtin};

fn linear(change: impl Fn(&mut ControllerParameters)) -> rfl_mpc::control::Controller {
    with_model(change, PredictionModel::Nominal)
}

#[test]
fn on_the_vehicle_that_it_predicts_with_it_beats_the_linear_mpc_by_far() {
    let plant = Bicycle::new(&builtin("c_class").unwrap().single_track(), 1.0).unwrap();
    let nonlinear = drive_bicycle(controller(|_| ()), &plant, |_, _| ());
    let linear = drive_bicycle(linear(|_| ()), &plant, |_, _| ());
    assert!(nonlinear.mae < 0.6 * linear.mae && nonlinear.max < 0.6 * linear.max, "{nonlinear:?} {linear:?}");
}

#[test]
fn on_the_default_car_it_is_as_good_as_the_linear_mpc() {
    let calm = |p: &mut ControllerParameters| {
        (p.mpc.r_rate, p.mpc.q_e1_rate, p.mpc.q_e2) = (0.3, 1.0, 2.0);
    };
    let default = |_: &mut ControllerParameters| ();
    let delayed = Effects { steer_lag: 0.1, steer_delay: 0.06, ..Effects::default() };
    let as_good = |nonlinear: TrackingMetrics, linear: TrackingMetrics| {
        assert!(
            nonlinear.mae < 1.15 * linear.mae
                && nonlinear.rmse < 1.15 * linear.rmse
                && nonlinear.max < 1.15 * linear.max,
            "{nonlinear:?} {linear:?}"
        );
    };
    let none = Effects::default();
    as_good(drive(controller(default), &none, |_, _| ()), drive(linear(default), &none, |_, _| ()));
    as_good(drive(controller(calm), &none, |_, _| ()), drive(linear(calm), &none, |_, _| ()));
    as_good(drive(controller(calm), &delayed, |_, _| ()), drive(linear(calm), &delayed, |_, _| ()));
}

#[test]
fn the_observer_takes_a_steady_gap_away() {
    let offset = Effects { steer_offset: 0.01, ..Effects::default() };
    let without = drive(controller(|_| ()), &offset, |_, _| ());
    let with = drive(controller(|p| p.observer.disturbance_noise = 0.05), &offset, |_, _| ());
    assert!(with.mae < 0.4 * without.mae, "{with:?} {without:?}");
}

#[test]
fn what_real_cars_have_does_not_make_it_diverge() {
    for effects in [
        Effects { payload: 300.0, payload_x: -1.0, ..Effects::default() },
        Effects { road_friction: 0.5, ..Effects::default() },
        Effects { wind_y: 10.0, ..Effects::default() },
    ] {
        let tracking = drive(controller(|_| ()), &effects, |_, _| ());
        assert!(tracking.max < 0.3, "{tracking:?}");
    }
}
