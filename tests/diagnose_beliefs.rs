//! What a user knows besides the log: how good the vehicle's numbers are, and how likely an effect is.

use crate::diagnose;

use diagnose::{car, found, log, singles};
use rfl_mpc::diagnose::beliefs::{Beliefs, Trust};
use rfl_mpc::diagnose::{DiagnoseError, Options, Report, diagnose as diagnosed};
use rfl_mpc::log::CleanLog;
use rfl_mpc::vehicle::{CarParameters, VehicleError, builtin_text};
use std::path::Path;

/// Probability of an effect among the causes of a log, as believed.
fn inclusion(log: &CleanLog, effect: &str, beliefs: Beliefs) -> f64 {
    let report = found(log, &Options { beliefs, ..singles() }).report;
    report.posterior.expect("a posterior").inclusion.get(effect).copied().unwrap_or(0.0)
}

fn c_class(more: &str) -> Result<CarParameters, VehicleError> {
    let text = format!("{}\n{more}", builtin_text("c_class").unwrap());
    CarParameters::parse(&text, Path::new("c_class.toml"), |name| {
        let tyre = rfl_mpc::vehicle::builtin("c_class").unwrap().tyre.front.coefficients.unwrap();
        assert!(!name.is_empty());
        Ok(tyre)
    })
}

fn of(vehicle: &CarParameters, log: &CleanLog) -> Result<Report, DiagnoseError> {
    diagnosed(log, None, vehicle, &singles(), &|_, _| {}).map(|it| it.report)
}

#[test]
fn what_is_likely_beforehand_is_likelier_after() {
    let log = log(5, &[("steer_gain", 1.04)]);
    let with = |p: f64| {
        let probabilities = [("steer_gain".to_owned(), p)].into();
        inclusion(&log, "steer_gain", Beliefs { probabilities, ..Beliefs::default() })
    };
    let [rare, usual, likely] = [with(1e-4), inclusion(&log, "steer_gain", Beliefs::default()), with(0.5)];
    assert!(rare < usual && usual < likely, "{rare} {usual} {likely}");
}

#[test]
fn who_trusts_the_file_less_finds_less_in_a_small_gap() {
    let log = log(5, &[("steer_gain", 1.05)]);
    let [low, usual, high] = [Trust::Low, Trust::Usual, Trust::High]
        .map(|trust| inclusion(&log, "steer_gain", Beliefs { trust, ..Beliefs::default() }));
    assert!(low < usual && usual <= high, "{low} {usual} {high}");
}

#[test]
fn a_tolerance_of_the_vehicle_file_is_taken() {
    let log = log(5, &[("steer_gain", 1.08)]);
    let report = of(&c_class("[tolerance]\neffect.steer_gain = 0.1\n").unwrap(), &log).unwrap();
    assert!((report.inputs.tolerances["effect.steer_gain"] - 0.1).abs() < 1e-12);
    let named = report.verdict.effects.iter().any(|effect| effect.id == "steer_gain");
    assert!(!named, "{}", report.verdict.summary);
    assert!(of(&car(), &log).unwrap().verdict.effects.iter().any(|effect| effect.id == "steer_gain"));
}

#[test]
fn what_is_no_tolerance_is_refused_in_words() {
    let negative = c_class("[tolerance]\nvehicle.mass = -3.0\n").unwrap_err().to_string();
    assert!(negative.contains("vehicle.mass = -3"), "{negative}");
    let log = log(5, &[]);
    let unknown =
        of(&c_class("[tolerance]\n\"vehicle.colour\" = 1.0\n").unwrap(), &log).unwrap_err().to_string();
    assert!(unknown.contains("vehicle.colour") && unknown.contains("inputs.tolerances"), "{unknown}");
    for (id, p) in [("no_such", 0.5), ("steer_gain", 0.0), ("steer_gain", 1.0), ("steer_gain", f64::NAN)] {
        let beliefs = Beliefs { probabilities: [(id.to_owned(), p)].into(), ..Beliefs::default() };
        let options = Options { beliefs, ..singles() };
        let refused = diagnosed(&log, None, &car(), &options, &|_, _| {}).unwrap_err().to_string();
        assert!(refused.contains(&format!("--prior {id}=")), "{refused}");
    }
}
