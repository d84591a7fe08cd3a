//! A truck that never comes near the peak of its tyres is not called slippery because they soften otherwise than its file says.

use rfl_mpc::diagnose::simulated::{Conditions, drive};
use rfl_mpc::diagnose::{Options, VerdictKind, diagnose};
use rfl_mpc::vehicle::tyre::Coefficients;
use rfl_mpc::vehicle::{TruckEffects, VehicleParameters, builtin_truck};

/// The diagnosis of a truck whose tyres are not those of its file: nothing is named, and the evidence for less friction.
fn evidence_for_friction(change: impl Fn(&mut Coefficients)) -> f64 {
    let given = builtin_truck("truck_simulation").unwrap();
    let mut softer = given.clone();
    for (_, tyre) in softer.tyres() {
        change(tyre.coefficients.as_mut().unwrap());
    }
    let conditions = Conditions {
        seed: 5,
        duration: 60.0,
        step: 0.02,
        speed: (8.0, 20.0),
        lateral: 2.0,
        background: 0.0,
        ..Conditions::default()
    };
    let log = drive(&softer, &TruckEffects::default(), &conditions).unwrap();
    let options = Options { pairs: false, ..Options::default() };
    let report = diagnose(&log, None, &given, &options, &|_, _| {}).unwrap().report;
    assert_eq!(report.verdict.kind, VerdictKind::None, "{:?}", report.verdict);
    report.candidates.iter().find(|it| it.effects == ["road_friction"]).unwrap().evidence
}

#[test]
fn a_lower_peak_is_no_friction() {
    // The slope at no slip stays: a lower peak is what softens them.
    let evidence = evidence_for_friction(|tyre| tyre.lmuy *= 0.45);
    // That such a peak is 4 standard deviations off is all that is held against it.
    let most = (0.45f64.ln() / 0.2).powi(2);
    assert!(evidence < most, "{evidence} of {most}");
}

#[test]
fn tyres_that_soften_from_the_first_slip_on_are_no_friction() {
    let evidence = evidence_for_friction(|tyre| tyre.softening = 1.0);
    // A brush is one standard deviation off: no more than chance gives.
    assert!(evidence < 4.0, "{evidence}");
}
