//! Changes of the controller's status, told to the host once in a while.
//!
//! A sensor that is slower than the controller makes every other step `bridged`, and the one between `optimal`. A host that
//! reads a message for each reads nothing else.

use crate::control::ControlStatus;
use crate::fmi::{Log, Seconds, Severity};
use crate::signal::Signal;

/// Time within which a status is told once, s of the simulation.
const WHILE: f64 = 10.0;
/// Signals of a car; a truck has more.
const CAR_SIGNALS: usize = 6;

/// When each status was last told, s, and how often it came since.
#[derive(Debug, Clone, Default)]
pub(super) struct ToldStatuses([Option<(f64, u32)>; ControlStatus::ITEMS.len()]);

impl ToldStatuses {
    /// Tells a status, if it was not told a while ago. `bridged`: the signals for which the prediction stands in.
    pub(super) fn tell<'a>(
        &mut self,
        time: f64,
        status: ControlStatus,
        bridged: impl Iterator<Item = &'a Signal>,
        log: &mut dyn Log,
    ) {
        let Some(told) = self.0.get_mut(status as usize) else { return };
        // A host that goes back in time is told anew.
        if let Some((at, more)) = told
            && (*at..*at + WHILE).contains(&time)
        {
            *more = more.saturating_add(1);
            return;
        }
        let more = told.replace((time, 0)).map_or(0, |(_, more)| more);
        let ordinary =
            matches!(status, ControlStatus::Optimal | ControlStatus::Waiting | ControlStatus::Finished);
        let severity = if ordinary { Severity::Info } else { Severity::Warning };
        let mut text = format!("t = {}: status {}: {}", Seconds(time), status.name(), status.meaning());
        let signals: Vec<&str> = bridged.map(|signal| signal.name).collect();
        if matches!(status, ControlStatus::Bridged | ControlStatus::SafeStop) && !signals.is_empty() {
            text += &format!(" ({})", signals.join(", "));
            if signals.len() >= CAR_SIGNALS {
                text += "; a vehicle that is held while it is asked to drive gives the same samples as dead sensors";
            }
        }
        if more > 0 {
            text += &format!("; it came {more} times more since it was told");
        }
        log.log(severity, "control", &text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal;

    #[derive(Default)]
    struct Lines(Vec<(Severity, String)>);

    impl Log for Lines {
        fn log(&mut self, severity: Severity, _category: &'static str, text: &str) {
            self.0.push((severity, text.to_owned()));
        }
    }

    #[test]
    fn a_status_that_comes_and_goes_is_told_once_in_a_while_with_its_signals() {
        let (mut told, mut lines) = (ToldStatuses::default(), Lines::default());
        for k in 0..600 {
            let status = if k % 2 == 0 { ControlStatus::Bridged } else { ControlStatus::Optimal };
            told.tell(0.02 * f64::from(k), status, [&signal::YAW_RATE].into_iter(), &mut lines);
        }
        // Twelve seconds: each at the start, and ten seconds later.
        assert_eq!(lines.0.len(), 4, "{:?}", lines.0);
        let (severity, text) = &lines.0[0];
        assert!(*severity == Severity::Warning && text.ends_with("(yaw_rate)"), "{text}");
        assert!(lines.0[2].1.ends_with("it came 249 times more since it was told"), "{:?}", lines.0[2]);
        assert!(lines.0[1].0 == Severity::Info && !lines.0[1].1.contains("yaw_rate"));
        assert!(lines.0.iter().all(|(_, text)| !text.contains("held")), "{:?}", lines.0);
    }

    #[test]
    fn where_nothing_is_new_the_vehicle_may_be_held() {
        let (mut told, mut lines) = (ToldStatuses::default(), Lines::default());
        let all = [signal::X, signal::Y, signal::YAW, signal::VX, signal::VY, signal::YAW_RATE];
        told.tell(0.0, ControlStatus::Bridged, all.iter(), &mut lines);
        assert!(lines.0[0].1.contains("vy, yaw_rate); a vehicle that is held"), "{:?}", lines.0);
    }
}
