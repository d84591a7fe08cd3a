//! Thresholds and probabilities, from one file.

use super::form::Kind;
use super::replay::Channel;
use super::report::Scores;
use crate::residual::fnv;
use crate::vehicle::{Effect, Stage};
use serde::Deserialize;
use std::sync::LazyLock;

const TEXT: &str = include_str!("calibration.toml");

/// What `calibration.toml` holds; evidence is a difference of `J`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Evidence below which nothing is named.
    pub none: f64,
    /// The same of tyres and body, and of friction.
    #[serde(skip)]
    structural: f64,
    #[serde(skip)]
    friction: f64,
    /// The same of what acts steadily, whatever the vehicle does.
    #[serde(skip)]
    steady: f64,
    /// The same of the drive's gain.
    #[serde(skip)]
    drive: f64,
    /// Whether a reference log has shown the errors of the model's form.
    #[serde(skip)]
    pub form_is_known: bool,
    alone: Alone,
    /// Evidence that a further effect of tyres or body must add.
    #[serde(skip)]
    pair: f64,
    second: OfVehicle,
    /// The same of a third, whatever it is.
    third: f64,
    /// Evidence within which candidates are one class.
    pub class: f64,
    /// Rest over noise and model form from which on the cause is not in the library.
    pub outside: f64,
    /// Share of the neutral gap that must be left besides.
    pub left: f64,
    /// Evidence that the value of an effect varies from which on the cause is not in the library.
    pub varying: f64,
    /// Tolerances by which an effect is off that is not named, from which on the cause is not in the library.
    pub strained: f64,
    /// Gap of an effect over that of the background below which it is not worth naming.
    pub dominance: f64,
    /// Factor on the gap beyond which what is named takes the simulator farther from the log instead of nearer.
    #[serde(skip)]
    pub farthest: f64,
    farther: OfVehicle,
    /// Errors of the model's form.
    pub form: Form,
    /// Factor on the standard deviations of named values: what the form of the model adds beyond the fit's own.
    pub interval: f64,
    effect: OfEffect,
    nothing: [f64; 2],
    unknown: [f64; 2],
}

/// Log odds that a named effect is right: a constant, by the logarithm of the margin up to `clear`, and by how near the answer
/// is to one that is not in the library: what is left, strained and varying, as shares of the thresholds of these; by how unsure
/// the least sure value is; and for each effect that is named beyond one.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct OfEffect {
    constant: f64,
    margin: f64,
    /// Margin beyond which a candidate is clear of the others: more of it is no surer that the library has the cause.
    clear: f64,
    left: f64,
    strained: f64,
    varying: f64,
    unsure: f64,
    further: f64,
}

/// One number for each kind of vehicle.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct OfVehicle {
    car: f64,
    truck: f64,
}

impl OfVehicle {
    fn of(self, truck: bool) -> f64 {
        if truck { self.truck } else { self.car }
    }
}

/// Thresholds without a reference log.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Alone {
    car: Thresholds,
    truck: Thresholds,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Thresholds {
    /// Of tyres and body.
    structural: f64,
    /// Of friction, which looks like another curve of the tyres.
    friction: f64,
    /// Of the drive's gain, which a mass looks like: a drive gives the force that its design needs, whatever the vehicle weighs.
    drive: f64,
    /// Of what acts steadily: errors of the form follow the motion.
    steady: f64,
    other: f64,
}

/// What acts steadily, whatever the vehicle does.
const STEADY: [&str; 7] = [
    "steer_offset",
    "road_bank",
    "road_grade",
    "yaw_rate_bias",
    "lateral_accel_bias",
    "heading_misalignment",
    "articulation_bias",
];

fn is_steady(effect: Option<&Effect>) -> bool {
    effect.is_some_and(|effect| STEADY.contains(&effect.id))
}

/// Of tyres and body; friction stands apart.
fn is_structural(effect: Option<&Effect>) -> bool {
    effect.is_some_and(|effect| {
        matches!(effect.stage, Stage::Tyre | Stage::Body) && effect.id != "road_friction"
    })
}

/// Standard deviations of the tyres' curve: shape factor, as a share, curvature factor, lateral peak, as a share, and early
/// softening, in that of brushes.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Tyre {
    car: [f64; 4],
    truck: [f64; 4],
}

/// Standard deviations of the errors of the model's form: of size, lateness in s, change with speed, with lateral and with
/// longitudinal acceleration, as `form.rs` has them.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Form {
    yaw_rate: [f64; 5],
    ay: [f64; 5],
    vy: [f64; 5],
    roll: [f64; 5],
    articulation: [f64; 5],
    ax: [f64; 5],
    tyre: Tyre,
}

impl Form {
    /// Of a channel.
    #[must_use]
    pub fn of(&self, channel: Channel, kind: Kind) -> f64 {
        let sizes = match channel {
            Channel::YawRate => self.yaw_rate,
            Channel::Ay => self.ay,
            Channel::Vy => self.vy,
            Channel::Roll => self.roll,
            Channel::Articulation => self.articulation,
            Channel::Ax => self.ax,
            _ => [0.0; 5],
        };
        sizes[kind as usize]
    }

    /// Of the tyres' curve: shape factor, as a share, curvature factor, lateral peak, as a share, and early softening.
    #[must_use]
    pub fn tyre(&self, truck: bool) -> [f64; 4] {
        if truck { self.tyre.truck } else { self.tyre.car }
    }
}

impl Calibration {
    /// The calibration that comes with the program.
    ///
    /// # Panics
    /// Never: the file is part of the program, and a test reads it.
    #[must_use]
    pub fn built_in() -> &'static Self {
        static PARSED: LazyLock<Calibration> = LazyLock::new(|| {
            toml::from_str(TEXT).expect("the calibration that comes with the program is sound")
        });
        &PARSED
    }

    /// That for cars or trucks, with or without a reference log: with one the form of the model is known, and thresholds
    /// are the least.
    ///
    /// # Panics
    /// Never, as [`built_in`](Self::built_in).
    #[must_use]
    pub fn of(truck: bool, reference: bool) -> Self {
        let all = Self::built_in().clone();
        let alone = if truck { &all.alone.truck } else { &all.alone.car };
        let [structural, friction, steady, drive, none] = if reference {
            [all.none; 5]
        } else {
            [alone.structural, alone.friction, alone.steady, alone.drive, alone.other]
        };
        let (pair, farthest) = (all.second.of(truck), all.farther.of(truck));
        Self { none, structural, friction, steady, drive, pair, farthest, form_is_known: reference, ..all }
    }

    /// Evidence that an effect needs to be named: what the model's form can look like, tyres and body, needs most.
    #[must_use]
    pub fn threshold(&self, effect: Option<&Effect>) -> f64 {
        match effect {
            Some(effect) if effect.id == "road_friction" => self.friction,
            Some(effect) if effect.id == "drive_gain" => self.drive,
            _ if is_steady(effect) => self.steady,
            _ if is_structural(effect) => self.structural,
            _ => self.none,
        }
    }

    /// Evidence that it must add to so many `others`: what these leave of the model's form looks like tyres and body.
    #[must_use]
    pub fn further(&self, effect: Option<&Effect>, others: usize) -> f64 {
        let alone = self.threshold(effect);
        match others {
            0 | 1 if is_structural(effect) => alone.max(self.pair),
            0 | 1 => alone,
            _ => alone.max(self.third),
        }
    }

    /// Its hash, hexadecimal.
    #[must_use]
    pub fn hash() -> String {
        format!("{:016x}", fnv(TEXT.as_bytes()))
    }

    /// Probability that a named effect is right, by the evidence against the next candidate outside its class. An answer that
    /// leaves much, strains tolerances or needs a value that varies is less sure, long before the cause is said not to be in the
    /// library: what another effect takes for a missing one does so at the background's expense. Less sure is also
    /// an effect whose value is, and that all of several are right: two can do what a missing one does.
    #[must_use]
    pub fn of_effect(&self, scores: &Scores, named: usize) -> f64 {
        let OfEffect { constant, margin, clear, left, strained, varying, unsure, further } = self.effect;
        // What is left is nothing as long as it is no more than noise and the model's form.
        let rest = (scores.left / self.left).clamp(0.0, 1.0) * (scores.excess / self.outside).clamp(0.0, 1.0);
        let off = left * rest
            + strained * scores.strained / self.strained
            + varying * scores.varying.max(0.0) / self.varying
            + unsure * scores.unsure
            + further * named.saturating_sub(1) as f64;
        logistic([constant + off, margin], scores.margin.min(clear))
    }

    /// That there is nothing, by the evidence that is missing to name something.
    #[must_use]
    pub fn of_nothing(&self, margin: f64) -> f64 {
        logistic(self.nothing, margin)
    }

    /// That the cause is not in the library, by what is left beyond the threshold, as a share of it.
    #[must_use]
    pub fn of_unknown(&self, margin: f64) -> f64 {
        logistic(self.unknown, margin)
    }
}

fn logistic([a, b]: [f64; 2], margin: f64) -> f64 {
    1.0 / (1.0 + (-(a + b * margin.max(0.0).ln_1p())).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_is_less_sure_with_less_margin_more_left_strained_or_varying_an_unsure_value_and_others() {
        let clear = Scores {
            single: 100.0,
            pair: 0.0,
            excess: 1.0,
            left: 0.0,
            varying: 0.0,
            strained: 0.0,
            unsure: 0.0,
            margin: 30.0,
        };
        for truck in [false, true] {
            let calibration = Calibration::of(truck, false);
            let odds = |scores: &Scores, named: usize| {
                let probability = calibration.of_effect(scores, named);
                probability / (1.0 - probability)
            };
            let sure = odds(&clear, 1);
            assert!(sure > 20.0 && sure.is_finite(), "{sure}");
            for less in [
                Scores { margin: 5.0, ..clear },
                Scores { left: calibration.left, excess: calibration.outside, ..clear },
                Scores { strained: calibration.strained, ..clear },
                Scores { varying: calibration.varying, ..clear },
                Scores { unsure: 0.5, ..clear },
            ] {
                assert!(odds(&less, 1) < 0.5 * sure, "{less:?}: {} {sure}", odds(&less, 1));
            }
            assert!(odds(&clear, 2) < 0.8 * sure && odds(&clear, 3) < 0.8 * odds(&clear, 2));
        }
    }
}
