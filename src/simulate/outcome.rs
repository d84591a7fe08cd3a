//! The outcome of a drive in one word, from the vehicle's true place: a drive off the road is no completed one.
//!
//! At each communication point `t_k` the true pose is projected onto the path: station `s_k`, lateral error `e1_k` and
//! heading error `e2_k`, from the nearest of the directions that the road has within a vehicle's length: it is turned at a
//! corner only if it heads along neither side. With the lane's half width `b`, the heading's bound `h` and the path's length `L`,
//!
//! ```text
//! lost       |e1_k| > b or |e2_k| > h at some k, back beyond the start, rolled over, jack-knifed, or a step failed
//! completed  never lost, and driven: s_k >= L of an open path, sum of (s_k - s_{k-1}) >= L of a closed one
//! stopped    never lost, and |vx| < STANDING_SPEED for STANDING_TIME before the end
//! timed_out  never lost, and the duration was over first
//! ```
//!
//! A vehicle that is placed beside its lane is to come in first: its lane is left from then on. The reason says where it
//! began and came in, and the errors count from the start.
//!
//! A drive whose outcome is `lost` goes on, for it may come back, as long as it is within [`NO_RETURN`] of its road.
//!
//! The controller's own estimate decides nothing: a false sample at the road's end completes no drive.

use crate::control::{ControlStatus, StepError};
use crate::enumeration;
use crate::path::Path;
use crate::vehicle::PlantStepError;

enumeration! {
    /// Outcome of a drive: the same word in text, JSON, page and exit status.
    pub enum Outcome {
        TimedOut = 0 "timed_out", "The duration was over before the road's end, on the road until then";
        Completed = 1 "completed", "The road was driven to its end, within the lane from where the vehicle was in it";
        Stopped = 2 "stopped", "The vehicle came to a stop before the road's end, within its lane";
        Lost = 3 "lost", "The vehicle left its lane, rolled over, jack-knifed, or could not be driven on";
    }
}

/// Speed, m/s, below which a vehicle stands, and time of it, s, after which its drive is over.
const STANDING_SPEED: f64 = 0.05;
const STANDING_TIME: f64 = 5.0;
/// Distance, m, by which a controller with noisy sensors may see the road's end too early. A vehicle may roll back
/// beyond the start by as much.
const END_TOLERANCE: f64 = 5.0;
/// Distance from the path, m, from which on the projection may belong to another part of it.
const ASTRAY: f64 = 14.0;
/// Distance, m, from the road beyond which nothing more is learnt from a drive that is lost.
const NO_RETURN: f64 = 100.0;

/// Bounds beyond which a vehicle is lost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaneLimits {
    /// Largest true lateral error, m. The default, 2, puts the vehicle's middle on the neighbouring lane.
    pub lateral_error: f64,
    /// Largest true heading error, rad. The default, 1, is where the controller gives up its linear model.
    pub heading_error: f64,
}

impl Default for LaneLimits {
    fn default() -> Self {
        Self { lateral_error: 2.0, heading_error: 1.0 }
    }
}

/// True place of a vehicle at one communication point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Place {
    /// Time, s.
    pub time: f64,
    /// Station, m.
    pub station: f64,
    /// Lateral error, m, positive to the left.
    pub lateral_error: f64,
    /// Heading error, rad, positive to the left.
    pub heading_error: f64,
}

/// Reason for which controller or vehicle cannot go on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum DriveError {
    #[error("at t = {time:.3} s the controller: {source}")]
    Controller { time: f64, source: StepError },
    #[error("at t = {time:.3} s the {vehicle}: {source}")]
    Vehicle { time: f64, vehicle: &'static str, source: PlantStepError },
}

/// Reason for which a drive ended.
#[derive(Debug, Clone, PartialEq, Default)]
#[allow(missing_docs)]
pub enum End {
    /// The duration was over.
    #[default]
    Duration,
    /// The end of an open road, or a full lap of a closed one.
    Road,
    /// The vehicle stood; with the controller's status then.
    Standing { status: ControlStatus },
    /// The vehicle had left its lane, and was farther from its road than a lost drive is followed; the distance, m.
    Astray { distance: f64 },
    /// The caller had seen enough.
    GivenUp,
    /// Controller or vehicle could not go on.
    Failed(DriveError),
}

/// Outcome of a drive, with place and reason.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ending {
    /// The word.
    pub outcome: Outcome,
    /// Reason for which the drive ended.
    pub end: End,
    /// Place of the vehicle at the end.
    pub place: Place,
    /// Place at which it left its lane first.
    pub departure: Option<Place>,
    /// The first place of a vehicle that began beside its lane, and the one at which it came in.
    pub entered_late: Option<[Place; 2]>,
    /// Limits of the lane.
    pub limits: LaneLimits,
    /// Length of the road, m.
    pub length: f64,
    /// Station of an open road at which the drive began, m; 0 at its start, before it, and on a closed one.
    pub began: f64,
    /// Distance driven along it from its start on, m.
    pub driven: f64,
}

impl Ending {
    /// Share of the road that was driven: 1 of a completed one from its start, although its end counts as reached a little
    /// before it. What lies before the place of the beginning was not driven.
    #[must_use]
    pub fn driven_share(&self) -> f64 {
        let end = if self.outcome == Outcome::Completed { self.length } else { self.driven.min(self.length) };
        (end - self.began) / self.length
    }

    /// The place that decided the outcome: of a lost drive the one at which the lane was left, else the end.
    #[must_use]
    pub fn decided(&self) -> Place {
        self.departure.unwrap_or(self.place)
    }

    /// The reason in a sentence: where, when, how far off.
    #[must_use]
    pub fn reason(&self) -> String {
        let end = match &self.end {
            End::Duration if self.driven < 0.0 => {
                format!("the duration was over {:.0} m behind the beginning", -self.driven)
            }
            End::Duration => {
                format!("the duration was over after {:.0} of {:.0} m", self.driven, self.length)
            }
            End::Road if self.place.lateral_error.abs() > self.limits.lateral_error => {
                format!("it passed the end of the road {:.0} m beside it", self.place.lateral_error.abs())
            }
            End::Road if self.began > 0.0 => {
                format!("the road was driven to its end, from station {:.0} m on", self.began)
            }
            End::Road => "the road was driven to its end".to_owned(),
            End::Standing { status } => {
                let left = (self.length - self.driven.max(0.0)).max(0.0).round();
                let why = match status {
                    // The steering's plan says nothing of the speed.
                    ControlStatus::Optimal | ControlStatus::ReducedAccuracy => {
                        "although it was to drive: its drive is too weak, or something holds it".to_owned()
                    }
                    ControlStatus::FarFromPath
                        if self.place.lateral_error.abs() <= self.limits.lateral_error =>
                    {
                        format!(
                            "for it was turned by {:.2} rad from its path",
                            self.place.heading_error.abs()
                        )
                    }
                    _ => format!("control status {}: {}", status.name(), status.meaning()),
                };
                format!("the vehicle stood {left} m before the end of the road ({:.0} m), {why}", self.length)
            }
            End::Astray { distance } => format!(
                "it was {distance:.0} m from its road, and the drive ended there, at {:.2} s and station {:.0} m",
                self.place.time, self.place.station
            ),
            End::GivenUp => "the drive was given up".to_owned(),
            End::Failed(error) => error.to_string(),
        };
        let entered = self.entered_late.map_or(String::new(), |[first, entered]| {
            format!("; it began {}, and was in its lane from {:.2} s on", self.beside(&first), entered.time)
        });
        let Some(at) = self.departure else { return end + &entered };
        let left = self.beside(&at);
        format!(
            "the vehicle was {left}, at {:.2} s and station {:.0} m; later {end}{entered}",
            at.time, at.station
        )
    }

    /// Words for a place out of the lane.
    fn beside(&self, at: &Place) -> String {
        let LaneLimits { lateral_error, heading_error } = self.limits;
        if at.lateral_error.abs() > lateral_error {
            let side = if at.lateral_error > 0.0 { "left" } else { "right" };
            let far = beyond(at.lateral_error.abs(), lateral_error);
            format!("{far} m {side} of its path, beyond the lane's {lateral_error} m")
        } else if at.heading_error.abs() > heading_error {
            format!("turned by {:.2} rad from its path, beyond {heading_error} rad", at.heading_error.abs())
        } else {
            "back beyond the start of its road".to_owned()
        }
    }
}

/// A value in so many digits, two at least, that it shows to be beyond the limit.
fn beyond(value: f64, limit: f64) -> String {
    let mut written = (2..15).map(|digits| format!("{value:.digits$}"));
    let shown = |text: &String| text.parse::<f64>().is_ok_and(|read| read > limit);
    written.find(shown).unwrap_or_else(|| value.to_string())
}

/// Watches a drive: the true place at each communication point, and the outcome.
#[derive(Debug, Clone)]
pub(super) struct Referee {
    limits: LaneLimits,
    length: f64,
    periodic: bool,
    /// The newest place; none before the first.
    place: Option<Place>,
    /// Distance along the path, m, less laps back.
    driven: f64,
    /// True once the vehicle was within its lane: one placed beside it has to come in first.
    entered: bool,
    /// Station of an open road at the first place, m.
    from: f64,
    /// First place of a vehicle that began beside its lane, and the one at which it came in.
    began: Option<Place>,
    entered_late: Option<[Place; 2]>,
    departure: Option<Place>,
    /// Time since which the vehicle stands.
    standing: Option<f64>,
}

impl Referee {
    pub fn new(path: &Path, limits: LaneLimits) -> Self {
        Self {
            limits,
            length: path.length(),
            periodic: path.is_periodic(),
            place: None,
            driven: 0.0,
            entered: false,
            from: 0.0,
            began: None,
            entered_late: None,
            departure: None,
            standing: None,
        }
    }

    /// True place of a vehicle with this pose (m, m, rad), found from the one before.
    pub fn place(&self, path: &Path, time: f64, [x, y, yaw]: [f64; 3]) -> Place {
        let hint = self.place.map(|place| place.station);
        let mut at = path.project(x, y, yaw, hint);
        if hint.is_some() && at.e1.abs() > ASTRAY {
            at = path.project(x, y, yaw, None);
        }
        let mut heading_error = at.e2;
        if heading_error.abs() > self.limits.heading_error {
            heading_error = path.least_turn(at.station, at.e2);
        }
        Place { time, station: at.station, lateral_error: at.e1, heading_error }
    }

    /// Takes note of a place and the speed there, m/s.
    pub fn see(&mut self, place: Place, speed: f64) {
        // A lap begins where the vehicle does, an open road at its first point.
        let first = if self.periodic { place.station } else { 0.0 };
        if self.place.is_none() && place.station - first > END_TOLERANCE {
            self.from = place.station;
        }
        let mut advance = place.station - self.place.map_or(first, |before| before.station);
        if self.periodic {
            advance -= self.length * (advance / self.length).round();
        }
        self.driven += advance;
        self.place = Some(place);

        let inside = place.lateral_error.abs() <= self.limits.lateral_error
            && place.heading_error.abs() <= self.limits.heading_error
            && self.driven >= -END_TOLERANCE;
        if inside {
            if !self.entered {
                self.entered_late = self.began.map(|began| [began, place]);
            }
            self.entered = true;
        } else if !self.entered {
            self.began = self.began.or(Some(place));
        } else if self.departure.is_none() {
            self.departure = Some(place);
        }
        let since = self.standing.unwrap_or(place.time);
        self.standing = (speed.abs() < STANDING_SPEED).then_some(since);
    }

    /// True if the road is driven to its end.
    pub fn at_end(&self) -> bool {
        self.driven >= self.length - END_TOLERANCE
    }

    /// True if the vehicle has stood long enough to be called stopped.
    pub fn stands(&self) -> bool {
        match (self.standing, self.place) {
            (Some(since), Some(place)) => place.time - since >= STANDING_TIME,
            _ => false,
        }
    }

    /// Distance from the road, m, of a vehicle that has left its lane and is not followed any farther.
    ///
    /// One that was never within its lane may be on its way there, from however far; not as it goes away.
    pub fn astray(&self) -> Option<f64> {
        let distance = |place: Place| {
            let beyond =
                if self.periodic { 0.0 } else { (place.station - self.length).max(-place.station).max(0.0) };
            place.lateral_error.hypot(beyond)
        };
        let first = match self.departure {
            Some(_) => 0.0,
            None if self.entered => return None,
            None => distance(self.began?),
        };
        Some(distance(self.place?)).filter(|distance| *distance > first + NO_RETURN)
    }

    /// Outcome of a drive that ended so.
    pub fn ending(&self, end: End) -> Ending {
        let place = self.place.unwrap_or_default();
        // Never within its lane: it had left it before the first step.
        let departure = self.departure.or(self.place.filter(|_| !self.entered));
        let outcome = match end {
            End::Failed(_) | End::GivenUp | End::Astray { .. } => Outcome::Lost,
            _ if departure.is_some() => Outcome::Lost,
            End::Road => Outcome::Completed,
            End::Standing { .. } => Outcome::Stopped,
            End::Duration => Outcome::TimedOut,
        };
        let Self { limits, length, driven, entered_late, from: began, .. } = *self;
        Ending { outcome, end, place, departure, entered_late, limits, length, began, driven }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{Closure, Sample};
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_place_off_the_lane_is_said_in_enough_digits() {
        for (value, limit, said) in [(2.5, 2.0, "2.50"), (0.0042, 0.001, "0.004"), (2.0001, 2.0, "2.0001")] {
            assert_eq!(beyond(value, limit), said);
        }
    }

    /// A straight of 100 m along the x axis.
    fn straight() -> Path {
        let samples = (0..=50).map(|k| Sample { x: 2.0 * f64::from(k), y: 0.0, ..Sample::default() });
        Path::from_samples(samples.collect(), Closure::Open).unwrap()
    }

    /// Drives at 10 m/s along poses of a station in m, 1 m apart.
    fn driven(to: u32, pose: impl Fn(f64) -> [f64; 3]) -> Referee {
        let path = straight();
        let mut referee = Referee::new(&path, LaneLimits::default());
        for k in 0..=to {
            let place = referee.place(&path, 0.1 * f64::from(k), pose(f64::from(k)));
            referee.see(place, 10.0);
        }
        referee
    }

    #[test]
    fn what_lies_before_the_beginning_was_not_driven() {
        let ending = driven(100, |s| [s.max(60.0), 0.0, 0.0]).ending(End::Road);
        assert!((ending.driven_share() - 0.4).abs() < 1e-9, "{}", ending.driven_share());
        assert!(ending.reason().contains("from station 60 m on"), "{}", ending.reason());
        let ending = driven(80, |s| [s.max(60.0), 0.0, 0.0]).ending(End::Duration);
        assert!((ending.driven_share() - 0.2).abs() < 1e-9, "{}", ending.driven_share());
    }

    #[test]
    fn a_road_driven_to_its_end_is_completed_only_within_the_lane() {
        let on = driven(100, |s| [s, 0.5, 0.0]);
        assert!(on.at_end());
        assert_eq!(on.ending(End::Road).outcome, Outcome::Completed);
        let off = driven(100, |s| [s, if s == 40.0 { -2.5 } else { 0.0 }, 0.0]).ending(End::Road);
        assert_eq!(off.outcome, Outcome::Lost);
        assert!((off.decided().station - 40.0).abs() < 1e-6 && off.decided().time == 4.0);
        assert!(off.reason().contains("2.50 m right of its path"), "{}", off.reason());
        let turned = driven(100, |s| [s, 0.0, if s > 60.0 { 1.2 } else { 0.0 }]).ending(End::Road);
        assert_eq!(turned.outcome, Outcome::Lost);
        assert!(turned.reason().contains("turned by 1.20 rad"), "{}", turned.reason());
    }

    #[test]
    fn at_a_corner_a_vehicle_heads_along_one_of_its_sides() {
        let corner = (0..=100).map(|k| Sample::at(f64::from(k.min(50)), f64::from((k - 50).max(0))));
        let path = Path::from_samples(corner.collect(), Closure::Open).unwrap();
        let referee = Referee::new(&path, LaneLimits::default());
        let error = |pose| referee.place(&path, 0.0, pose).heading_error.abs();
        // Still, or already, along a side at the corner; and across both.
        assert!(error([50.0, 0.5, 0.0]) < 1.0 && error([49.5, 0.0, FRAC_PI_2]) < 1.0);
        assert!(error([50.0, 0.0, -1.2]) > 1.0 && error([30.0, 0.0, FRAC_PI_2]) > 1.5);
    }

    #[test]
    fn only_a_lost_vehicle_is_not_followed_far_from_its_road() {
        let leaves = |by: f64| driven(80, move |s| [s, if s < 20.0 { 0.0 } else { by }, 0.0]);
        assert_eq!(leaves(99.0).astray(), None);
        assert!((leaves(-101.0).astray().unwrap() - 101.0).abs() < 1e-6);
        // A lane of that width was not left.
        let mut wide = leaves(101.0);
        wide.departure = None;
        assert_eq!(wide.astray(), None);
        // Beside the lane from the beginning: it may come in.
        assert_eq!(driven(80, |s| [s, 150.0, 0.0]).astray(), None);
        assert!(driven(200, |s| [s, 150.0 + s, 0.0]).astray().is_some());
        // Off the lane, and on beyond the road's end.
        let beyond = driven(250, |s| [s, if s == 40.0 { 3.0 } else { 0.0 }, 0.0]);
        let distance = beyond.astray().unwrap();
        assert!((distance - 150.0).abs() < 1e-6, "{distance}");
        let reason = beyond.ending(End::Astray { distance }).reason();
        assert!(
            reason.ends_with(
                "later it was 150 m from its road, and the drive ended there, at 25.00 s and station 250 m"
            ),
            "{reason}"
        );
    }

    #[test]
    fn rolling_back_is_no_stop() {
        let back = driven(10, |s| [-s, 0.0, 0.0]).ending(End::Duration);
        assert_eq!(back.outcome, Outcome::Lost);
        assert!(back.reason().contains("back beyond the start"), "{}", back.reason());
    }

    #[test]
    fn a_start_beside_the_lane_has_to_come_in() {
        let comes = driven(100, |s| [s, (3.0 - 0.1 * s).max(0.0), 0.0]);
        let comes = comes.ending(End::Duration);
        assert_eq!(comes.outcome, Outcome::TimedOut);
        let said = comes.reason();
        assert!(
            said.contains("it began 3.00 m left of its path") && said.contains("from 1.00 s on"),
            "{said}"
        );
        let stays = driven(100, |s| [s, 3.0, 0.0]);
        assert_eq!(stays.ending(End::Duration).outcome, Outcome::Lost);
    }

    #[test]
    fn half_a_road_is_no_road_and_standing_takes_seconds() {
        let mut referee = driven(50, |s| [s, 0.0, 0.0]);
        assert!(!referee.at_end() && !referee.stands());
        let path = straight();
        for k in 0..60 {
            let place = referee.place(&path, 5.0 + 0.1 * f64::from(k), [50.0, 0.0, 0.0]);
            referee.see(place, 0.0);
            assert_eq!(referee.stands(), k >= 50, "{k}");
        }
        let ending = referee.ending(End::Standing { status: ControlStatus::SafeHold });
        assert_eq!(ending.outcome, Outcome::Stopped);
        assert!(ending.reason().contains("50 m before the end") && ending.reason().contains("safe_hold"));
    }
}
