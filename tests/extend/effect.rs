//! An effect of one's own that is diagnosed: a steering that turns the wheels more than in proportion.

use rfl_mpc::diagnose::{Options, OwnEffect, Report, VerdictKind, diagnose};
use rfl_mpc::log::CleanLog;
use rfl_mpc::numerics::Random;
use rfl_mpc::signal::Unit;
use rfl_mpc::vehicle::{
    Car, CarInput, Effect, Effects, ReducedInput, ReducedOutput, ReducedStart, ReducedSteer, ReducedVehicle,
    Stage, builtin,
};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Angle at which the ratio has changed by the effect's value, rad.
const AT: f64 = 0.1;

/// Angle of the wheels, rad: `steer (1 + progression (steer / 0.1)^2)`.
fn progressive(steer: f64, progression: f64) -> f64 {
    steer * (1.0 + progression * (steer / AT).powi(2))
}

static PROGRESSION: Effect = Effect {
    id: "steer_progression",
    unit: Unit::ONE,
    neutral: 0.0,
    range: (-0.5, 2.0),
    stage: Stage::Linkage,
    meaning: "Change of the steering's ratio at 0.1 rad",
};

#[derive(Debug)]
struct Progression;

impl OwnEffect for Progression {
    fn declaration(&self) -> &'static Effect {
        &PROGRESSION
    }

    fn clear(&self) -> f64 {
        0.1
    }

    fn act(&self, vehicle: Box<dyn ReducedVehicle>, value: f64) -> Box<dyn ReducedVehicle> {
        Box::new(Progressive { vehicle, value })
    }
}

struct Progressive {
    vehicle: Box<dyn ReducedVehicle>,
    value: f64,
}

impl ReducedVehicle for Progressive {
    fn start(&mut self, start: &ReducedStart) {
        self.vehicle.start(start);
    }

    fn set_motion(&mut self, vy: f64, yaw_rate: f64) {
        self.vehicle.set_motion(vy, yaw_rate);
    }

    fn step(&mut self, input: &ReducedInput, step: f64) -> ReducedOutput {
        let steer = match input.steer {
            ReducedSteer::Commanded(angle) => ReducedSteer::Commanded(progressive(angle, self.value)),
            ReducedSteer::Measured(angle) => ReducedSteer::Measured(progressive(angle, self.value)),
        };
        self.vehicle.step(&ReducedInput { steer, ..*input }, step)
    }
}

const STEP: f64 = 0.02;

/// A minute of the full plant, its steering progressive.
fn log(progression: f64) -> CleanLog {
    let mut car = Car::new(&builtin("c_class").unwrap(), &Effects::default(), None).unwrap();
    car.place(0.0, 0.0, 0.0, 12.0);
    let mut random = Random::new(5);
    let mut columns: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    for k in 0..3000 {
        let t = f64::from(k) * STEP;
        let amplitude = 0.05 * (1.0 + (0.11 * t).sin());
        let steer_cmd = amplitude * (0.9 * t).sin() * (1.0 + 0.2 * (3.1 * t).sin());
        let accel_cmd = 1.5 * (12.0 + 2.0 * (0.2 * t).sin() - car.output().vx);
        let o = *car.output();
        // Uniform, of this standard deviation.
        let mut noise = |deviation: f64| 12.0_f64.sqrt() * deviation * (random.uniform() - 0.5);
        let row = [
            ("steer_cmd", steer_cmd),
            ("accel_cmd", accel_cmd),
            ("vx", o.vx + noise(0.02)),
            ("yaw_rate", o.yaw_rate + noise(0.002)),
            ("ay", o.ay + noise(0.05)),
            ("vy", o.vy + noise(0.02)),
        ];
        for (name, value) in row {
            columns.entry(name).or_default().push(value);
        }
        car.step(&CarInput { steer_cmd: progressive(steer_cmd, progression), accel_cmd }, STEP).unwrap();
    }
    CleanLog::of_columns(STEP, columns)
}

fn verdict(progression: f64, own: bool) -> Report {
    let own: Vec<Arc<dyn OwnEffect>> = if own { vec![Arc::new(Progression)] } else { Vec::new() };
    let options = Options { own, ..Options::default() };
    diagnose(&log(progression), None, &builtin("c_class").unwrap(), &options, &|_, _| ()).unwrap().report
}

#[test]
fn it_is_named_with_its_value_and_its_meaning() {
    let report = verdict(0.4, true);
    let named = report.verdict.effects.first().expect("a name");
    assert_eq!(
        (named.id.as_str(), report.verdict.effects.len()),
        (PROGRESSION.id, 1),
        "{}",
        report.verdict.summary
    );
    assert!(named.low <= 0.4 && 0.4 <= named.high && (named.value - 0.4).abs() < 0.06, "{named:?}");
    assert!(report.verdict.summary.contains("ratio at 0.1 rad"), "{}", report.verdict.summary);
    let seen = report.observability.iter().find(|one| one.effect == PROGRESSION.id).expect("observability");
    assert!(seen.observable, "{seen:?}");
}

#[test]
fn without_it_the_diagnosis_does_not_name_it_and_is_not_sure_of_another() {
    let report = verdict(0.4, false);
    let sure = report.verdict.kind == VerdictKind::Effect && report.verdict.probability > 0.9;
    assert!(!sure, "{}", report.verdict.summary);
    assert!(report.observability.iter().all(|one| one.effect != PROGRESSION.id));
}

#[test]
fn a_sound_log_stays_sound() {
    let report = verdict(0.0, true);
    assert_eq!(report.verdict.kind, VerdictKind::None, "{}", report.verdict.summary);
}
