//! Report of a drive: its figures and checks, on the terminal, in files, and as an exit status.

use super::super::output::{write_file, write_json};
use super::super::require::{Check, CheckKind, Figures, write_junit};
use super::{DriveArgs, DriveResult};
use crate::control::{ControlVariant, KnownActuator, WIDEST_GAP};
use crate::path::RoadClass;
use crate::simulate::{DriveFor, Outcome, Place, STATION, StepTimes, TIME, TrackingMetrics};
use serde_json::{Value, json};
use std::error::Error;

/// Exit status of a requirement that is not met.
const NOT_MET: u8 = 6;

/// Exit status of an outcome; `cut`: the user chose the duration, `asked`: a requirement asks for this outcome.
fn status(outcome: Outcome, cut: bool, asked: bool, met: bool) -> u8 {
    match outcome {
        _ if asked && met => 0,
        _ if asked => NOT_MET,
        Outcome::Stopped => 3,
        Outcome::Lost => 4,
        Outcome::TimedOut if !cut => 5,
        _ if !met => NOT_MET,
        Outcome::Completed | Outcome::TimedOut => 0,
    }
}

/// Report of a drive.
pub(super) struct DriveReport {
    figures: Figures,
    times: StepTimes,
    variant: ControlVariant,
    /// Time that the drive took on the clock, s.
    wall: f64,
    /// The outcome first, then the requirements.
    checks: Vec<Check>,
    status: u8,
    /// Place of the largest lateral error.
    largest: Option<Place>,
    /// The steering actuator as the drive has shown it.
    found: Option<KnownActuator>,
}

impl DriveReport {
    pub fn of<const C: usize>(
        drive: &DriveFor<C>,
        variant: ControlVariant,
        sample_time: f64,
        wall: f64,
        found: Option<KnownActuator>,
        args: &DriveArgs,
    ) -> Self {
        let figures = Figures::of(drive, sample_time, wall);
        let required: Vec<Check> = args.requirements.iter().map(|wanted| wanted.check(&figures)).collect();
        let outcome = drive.ending.outcome;
        let met = required.iter().all(|check| check.met);
        let cut = args.duration.is_some();
        let asked = args.requirements.iter().any(|wanted| wanted.asks_for(outcome));
        let mut checks = vec![Check {
            name: "outcome".to_owned(),
            met: status(outcome, cut, asked, true) == 0,
            kind: CheckKind::Requirement,
            words: format!("{}: {}", outcome.name(), drive.ending.reason()),
        }];
        checks.extend(required);
        let errors = drive.lateral_errors.iter().zip(&drive.rows);
        let largest = errors.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        Self {
            times: drive.times(sample_time),
            variant,
            wall,
            checks,
            status: status(outcome, cut, asked, met),
            largest: largest.map(|(&lateral_error, row)| Place {
                time: row[TIME],
                station: row[STATION],
                lateral_error,
                ..Place::default()
            }),
            figures,
            found,
        }
    }

    /// Writes all files, then prints. A file that cannot be written keeps none of the others from it.
    pub fn give<const C: usize>(
        &self,
        drive: &DriveFor<C>,
        args: &DriveArgs,
    ) -> Result<DriveResult, Box<dyn Error>> {
        let report = self.json(drive);
        let log = args.log.as_ref().map(|file| write_file(file, |to| Ok(drive.write_csv(to)?)));
        let json = args.json.as_ref().map(|file| write_json(file, &report));
        let class = args.junit_class();
        let junit =
            args.junit.as_ref().map(|file| write_junit(file, "rfl drive", &class, self.wall, &self.checks));
        self.print(drive, args);
        for written in [log, json, junit].into_iter().flatten() {
            written?;
        }
        Ok(DriveResult {
            columns: drive.columns.iter().map(|signal| (signal.name, drive.column(signal.name))).collect(),
            statuses: drive.statuses.iter().map(|status| status.name()).collect(),
            report,
            status: self.status,
        })
    }

    fn json<const C: usize>(&self, drive: &DriveFor<C>) -> Value {
        let ending = &drive.ending;
        let StepTimes { step, look_up, condense, solve } = self.times;
        let classes: serde_json::Map<String, Value> = RoadClass::ALL
            .into_iter()
            .map(|class| (class, drive.tracking_on(class)))
            .filter(|(_, metrics)| metrics.count > 0)
            .map(|(class, metrics)| (class.name().to_owned(), json!(metrics)))
            .collect();
        let place =
            |at: Place| json!({ "time": at.time, "station": at.station, "lateral_error": at.lateral_error });
        let requirements: Vec<Value> = self.checks[1..]
            .iter()
            .map(|check| json!({ "requirement": check.name, "met": check.met, "summary": check.words, "words": check.words }))
            .collect();
        json!({
            "outcome": ending.outcome.name(),
            "reason": ending.reason(),
            "end": place(ending.place),
            "left_lane": ending.departure.map(place),
            "entered_lane": ending.entered_late.map(|[_, entered]| place(entered)),
            "largest": self.largest.map(place),
            "length": ending.length,
            "driven": ending.driven,
            "variant": self.variant.name(),
            "actuator": self.found.map(|found| json!({
                "dead_time": found.actuator.dead_time,
                "time_constant": found.actuator.time_constant,
                "spread": found.spread,
                "shown": found.shown,
                "backlash": found.backlash,
            })),
            "tracking": self.figures.tracking,
            "classes": classes,
            "duration": self.figures.duration,
            "finished": drive.finished,
            "real_time_factor": self.figures.real_time_factor,
            "step": step,
            "parts": { "look_up": look_up, "condense": condense, "solve": solve },
            "requirements": requirements,
            "exit_status": self.status,
        })
    }

    fn print<const C: usize>(&self, drive: &DriveFor<C>, args: &DriveArgs) {
        let all = &self.figures.tracking;
        say!("{:<16} {:>9} {:>9} {:>9} {:>8}", "lateral error", "mean m", "RMS m", "max m", "share %");
        let line = |name: &str, metrics: &TrackingMetrics| {
            let share = 100.0 * metrics.count as f64 / all.count.max(1) as f64;
            say!("{name:<16} {:>9.4} {:>9.4} {:>9.4} {share:>8.1}", metrics.mae, metrics.rmse, metrics.max);
        };
        line("whole drive", all);
        for class in RoadClass::ALL {
            let metrics = drive.tracking_on(class);
            if metrics.count > 0 {
                line(class.name(), &metrics);
            }
        }
        let step = &self.times.step;
        say!(
            "step time: mean {:.0} us, p99 {:.0} us, max {:.0} us, {} over Ts",
            1e6 * step.mean_s,
            1e6 * step.p99_s,
            1e6 * step.max_s,
            step.missed
        );
        let (driven, factor) = (self.figures.duration, self.figures.real_time_factor);
        say!("{driven:.2} s driven in {:.2} s ({factor:.0} times real time)", self.wall);
        if let Some(found) = self.found {
            let KnownActuator { actuator, spread, shown, backlash } = found;
            let (dead_time, lag) = (actuator.dead_time, actuator.time_constant);
            if shown {
                say!(
                    "steering as driven: dead time {dead_time:.3} s, lag {lag:.3} s; the sum within {spread:.3} s"
                );
            } else {
                say!("steering: the drive does not show its dead time and lag");
            }
            if backlash > 0.0 {
                let more = if backlash > WIDEST_GAP - 1e-6 { ", or more" } else { "" };
                say!("steering's backlash as driven: {backlash:.4} rad{more}");
            }
        }
        for check in &self.checks[1..] {
            say!("{}: {}", if check.met { "met" } else { "NOT met" }, check.words);
        }
        let at = self.largest.map_or(String::new(), |at| {
            let error = at.lateral_error.abs();
            format!(
                "; farthest from the path {error:.3} m, at {:.2} s and station {:.0} m",
                at.time, at.station
            )
        });
        say!("outcome: {}{at}", self.checks[0].words);
        if let Some(words) = next(drive.ending.outcome, args) {
            say!("next: {words}");
        }
    }
}

/// Advice after an outcome.
fn next(outcome: Outcome, args: &DriveArgs) -> Option<String> {
    let log = args.log.as_ref().map_or("LOG".to_owned(), |log| log.display().to_string());
    let written = if args.log.is_some() { "" } else { " (--log LOG writes it)" };
    match outcome {
        Outcome::Completed => None,
        Outcome::TimedOut if args.duration.is_some() => None,
        Outcome::TimedOut => Some(format!(
            "drive longer, with --duration S, unless vx in {log}{written} says that it hardly moves"
        )),
        Outcome::Stopped => Some(format!("look at the columns status and vx at the end of {log}{written}")),
        Outcome::Lost => Some(format!(
            "look at e1, steer_cmd and status in {log}{written}; rfl identify {log} says whether the steering is as the \
             controller takes it; slower in bends: --set speed.lateral_accel=A"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_chosen_end_on_the_road_is_a_success() {
        let statuses =
            |cut, met| Outcome::ALL.iter().map(|&of| status(of, cut, false, met)).collect::<Vec<_>>();
        assert_eq!(
            Outcome::ALL.iter().map(|of| of.name()).collect::<Vec<_>>(),
            ["timed_out", "completed", "stopped", "lost"]
        );
        assert_eq!(statuses(true, true), [0, 0, 3, 4]);
        assert_eq!(statuses(false, true), [5, 0, 3, 4]);
        // What happened to the drive says more than a figure.
        assert_eq!(statuses(true, false), [6, 6, 3, 4]);
        assert_eq!(statuses(false, false), [5, 6, 3, 4]);
        // Nor does what a test asks for fail it.
        for &outcome in Outcome::ALL {
            assert_eq!([true, false].map(|met| status(outcome, false, true, met)), [0, 6]);
        }
    }
}
