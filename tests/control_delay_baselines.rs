//! Delay baselines from a recorded step to the drive: identify on the plant, predict with what was found.

use rfl_mpc::control::{
    Choice, ControlVariant, Controller, ControllerParameters, PredictionModel, Propagation, RollOut,
};
use rfl_mpc::nominal::{Actuator, ContinuousErrorModel, DeadTimeModel, DelayModel, SteeringRecord};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::simulate::{ClosedLoop, TrackingMetrics};
use rfl_mpc::vehicle::{Car, CarInput, Effects, builtin};
use std::sync::Arc;

const TS: f64 = 0.02;

/// A steering actuator much slower than the nominal model thinks.
fn slow() -> Effects {
    Effects { steer_lag: 0.1, steer_delay: 0.16, ..Effects::default() }
}

/// A step of the steering at 10 m/s on the plant: time, command, angle, yaw rate.
fn recorded_step() -> [Vec<f64>; 4] {
    let mut car = Car::new(&builtin("c_class").unwrap(), &slow(), None).unwrap();
    car.place(0.0, 0.0, 0.0, 10.0);
    let mut log = [(); 4].map(|()| Vec::new());
    for k in 0..150 {
        let steer_cmd = if k < 50 { 0.0 } else { 0.03 };
        let output = *car.output();
        let row = [TS * f64::from(k), steer_cmd, output.steer, output.yaw_rate];
        log.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
        let accel_cmd = 2.0 * (10.0 - output.vx);
        car.step(&CarInput { steer_cmd, accel_cmd }, TS).unwrap();
    }
    log
}

/// The actuator as it is: the car's own and what was added.
fn truth() -> Actuator {
    let steering = builtin("c_class").unwrap().steering;
    DelayModel::DeadTimeLag.actuator(steering.dead_time + slow().steer_delay, steering.lag + slow().steer_lag)
}

#[test]
fn the_angle_and_the_yaw_rate_tell_the_actuator() {
    let [time, command, angle, yaw_rate] = recorded_step();
    let truth = truth();
    let by_angle = SteeringRecord::new(&time, &command, &angle).unwrap();
    let by_angle = by_angle.identify(DelayModel::DeadTimeLag).unwrap();
    assert!((by_angle.actuator.dead_time - truth.dead_time).abs() < 0.01 * TS, "{by_angle:?}");
    assert!((by_angle.actuator.time_constant - truth.time_constant).abs() < 0.01 * TS, "{by_angle:?}");

    // The linear model knows neither relaxation nor roll: what they delay is shared out between the two constants, and
    // only the sum is to be believed.
    let vehicle = builtin("c_class").unwrap().single_track();
    let model = ContinuousErrorModel::new(&vehicle, 10.0).unwrap();
    let by_yaw_rate = SteeringRecord::new(&time, &command, &yaw_rate).unwrap();
    let by_yaw_rate = by_yaw_rate.identify_by_yaw_rate(DelayModel::DeadTimeLag, &model).unwrap();
    let whole = |actuator: Actuator| actuator.dead_time + actuator.time_constant;
    let more = whole(by_yaw_rate.actuator) - whole(truth);
    assert!(more.abs() < TS, "{by_yaw_rate:?}");
}

#[test]
fn the_delay_s_model_is_chosen_by_name() {
    let choice = Choice {
        variant: ControlVariant::Actuator,
        file: None,
        folder: "none".into(),
        propagation: Propagation::Propagated,
        roll_out: RollOut::Corrected,
    };
    for &dead_time_model in DeadTimeModel::ALL {
        let mut parameters = ControllerParameters::default();
        let declared = ControllerParameters::declared("actuator.dead_time_model").unwrap();
        for (name, value) in [
            ("actuator.dead_time", 0.16),
            ("actuator.time_constant", 0.1),
            (declared.name, declared.read(dead_time_model.name()).unwrap()),
        ] {
            assert!(parameters.set(name, value).unwrap());
        }
        let (_, model) = choice.prediction_model(&parameters).unwrap();
        let PredictionModel::Actuator(actuator) = model else { panic!("{model:?}") };
        assert_eq!(actuator, Actuator { dead_time: 0.16, time_constant: 0.1, dead_time_model });
        // Only the exact one looks back at commands; the first order has none of the dead time.
        assert_eq!(actuator.delay(TS).0, if dead_time_model == DeadTimeModel::Exact { 8 } else { 0 });
        let lag = Actuator { dead_time: 0.0, ..actuator };
        assert_eq!(actuator.sample(TS) == lag.sample(TS), dead_time_model == DeadTimeModel::FirstOrder);
    }
}

fn drive(model: PredictionModel) -> (TrackingMetrics, bool) {
    let path = Arc::new(Path::from_samples(Route::OffRoad.samples(), Closure::Detect).unwrap());
    let car = builtin("c_class").unwrap();
    let mut parameters = ControllerParameters::for_car(&car);
    // Beyond the delay: within it an approximant's answer of the wrong sign is all that is seen.
    parameters.mpc.horizon = 60;
    let controller = Controller::predicting_with(parameters, path, model).unwrap();
    let mut closed = ClosedLoop::at_start(controller, &car, &slow(), TS).unwrap();
    let drive = closed.drive_while(60.0, |_, error| error.abs() < 3.5).unwrap();
    (drive.tracking(), drive.lost)
}

#[test]
fn who_knows_the_delay_better_drives_better() {
    let [time, command, angle, _] = recorded_step();
    let record = SteeringRecord::new(&time, &command, &angle).unwrap();
    let with = |model: DelayModel| {
        let actuator = record.identify(model).unwrap().actuator;
        let (tracking, lost) = drive(PredictionModel::Actuator(actuator));
        assert!(!lost, "{actuator:?}");
        tracking.rmse
    };
    let [exact, first_order, pade11, pade22] =
        [DelayModel::DeadTimeLag, DelayModel::FirstOrder, DelayModel::Pade11, DelayModel::Pade22].map(with);
    let (nominal, lost) = drive(PredictionModel::Nominal);
    let (oracle, _) = drive(PredictionModel::Actuator(truth()));
    assert!(lost || nominal.rmse > 2.0 * exact, "{nominal:?} {exact}");
    assert!(
        [first_order, pade11, pade22].iter().all(|&rmse| rmse > exact),
        "{exact} {first_order} {pade11} {pade22}"
    );
    assert!((exact - oracle.rmse).abs() < 0.1 * oracle.rmse, "{exact} {oracle:?}");
}
