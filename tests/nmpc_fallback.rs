//! What nonlinear MPC does with bad input, without time, and after a saved state is restored.

use crate::counting::allocated;
use crate::nmpc::{controller, measure};
use rfl_mpc::control::{
    BicycleModel, ControlStatus, Controller, ControllerError, ControllerParameters, LateralError,
    Measurement, PredictionModel,
};
use rfl_mpc::nominal::SingleTrackError;

#[test]
fn a_measurement_that_is_not_finite_is_refused_and_changes_nothing() {
    let mut controller = controller(|_| ());
    let car = measure(&controller, 0.1);
    controller.step(&car).unwrap();
    let before = controller.state().clone();
    assert!(controller.step(&Measurement { vy: f64::NAN, ..car }).is_err());
    assert_eq!(controller.state(), &before);
}

#[test]
fn absurd_measurements_end_in_a_command() {
    let mut controller = controller(|_| ());
    let car = measure(&controller, 0.1);
    for absurd in [
        Measurement { vy: 1e9, ..car },
        Measurement { yaw_rate: -1e12, ..car },
        Measurement { vx: 1e6, ..car },
        Measurement { vx: -30.0, ..car },
        Measurement { x: 1e7, yaw: 3.0, ..car },
    ] {
        let before = controller.state().clone();
        let report = *controller.step(&absurd).unwrap();
        assert!(report.steer_cmd.is_finite() && report.steer_cmd.abs() <= 0.6, "{report:?}");
        assert!(controller.restore(before).is_none());
    }
}

#[test]
fn a_friction_that_is_none_is_named() {
    for friction in [0.0, f64::NAN] {
        let path = controller(|_| ()).path().clone();
        let model = PredictionModel::Nonlinear(BicycleModel { friction, ..BicycleModel::default() });
        let error = Controller::predicting_with(ControllerParameters::default(), path, model).err().unwrap();
        let ControllerError::Lateral(LateralError::Model(error)) = error else { panic!("{error}") };
        let SingleTrackError::NotPositive { name, .. } = error else { panic!("{error}") };
        assert_eq!(name, "friction");
    }
}

#[test]
fn without_time_the_last_plan_goes_on() {
    let mut with_time = controller(|_| ());
    let car = measure(&with_time, 0.1);
    with_time.step(&car).unwrap();
    let plan = with_time.lateral().plan().to_vec();
    let mut without = controller(|p| p.mpc.deadline = 1e-9);
    assert!(without.restore(with_time.state().clone()).is_none());
    let report = *without.step(&car).unwrap();
    assert_eq!(report.status, ControlStatus::DeadlineMissed);
    assert!((report.steer_cmd - plan[1]).abs() < 1e-6);
}

#[test]
fn it_goes_on_with_the_same_bits_after_a_restore() {
    let observing =
        || controller(|p| (p.observer.disturbance_noise, p.observer.prediction_noise) = (0.05, 0.01));
    let (mut first, mut second) = (observing(), observing());
    let at = |k: u32| measure(&observing(), 0.2 * (0.05 * f64::from(k)).sin());
    for k in 0..20 {
        first.step(&at(k)).unwrap();
    }
    // The other has been elsewhere: its buffers hold something else.
    for k in 0..7 {
        second.step(&at(100 + 10 * k)).unwrap();
    }
    assert!(second.restore(first.state().clone()).is_none());
    for k in 20..60 {
        let steer_cmds = [&mut first, &mut second].map(|one| one.step(&at(k)).unwrap().steer_cmd.to_bits());
        assert_eq!(steer_cmds[0], steer_cmds[1], "step {k}");
        assert_eq!(first.lateral().plan(), second.lateral().plan(), "step {k}");
    }
}

#[test]
fn a_step_allocates_no_more_than_its_qps() {
    let mut controller = controller(|_| ());
    for k in 0..100 {
        let car = measure(&controller, 0.3 * (0.1 * f64::from(k)).sin());
        let (count, _) = allocated(|| {
            controller.step(&car).unwrap();
        });
        let qps = controller.lateral().qps() as usize;
        assert!(k == 0 || count <= qps, "{count} allocations in {qps} QPs");
    }
}
