//! The gap as a function of all uncertain parameters, and its slopes.

use super::filter::Filter;
use super::form;
use super::library::Library;
use super::memo::Memo;
use super::profile::Profile;
use super::replay::{CHANNELS, Channel, Correction, ReplayDrive, ReplayVehicle, Trace, replay, replay_with};
use super::uncertain::{self, UncertainParameter};
use crate::numerics::parallel;
use crate::vehicle::TruckEffects;
use std::borrow::Cow;
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Gap, in units of the signal's own size, from which on a replay has diverged.
const ASTRAY: f64 = 20.0;

/// Number of sets of slopes that are kept, each with its place: a search returns to earlier places.
const KEPT: usize = 8;
/// Distance within which slopes hold, as a share of the step over which they are taken.
const NEAR: f64 = 0.05;

/// Coordinates, and the slopes over all uncertain parameters there.
type Slopes = (Vec<f64>, Vec<Arc<Vec<f64>>>);

/// The gap of a log: residuals after the filter, channel after channel.
pub struct Problem<'a, V> {
    /// The drive replayed.
    pub drive: &'a ReplayDrive,
    /// The vehicle as it was given.
    pub vehicle: &'a V,
    /// Full plant less reduced model.
    pub correction: &'a Correction,
    /// Effects that may be named.
    pub library: Library<'a>,
    /// Uncertain parameters.
    pub uncertain: Vec<UncertainParameter>,
    /// The low pass.
    pub filter: Filter,
    /// Rows of the log that are compared.
    pub rows: Vec<usize>,
    /// Each channel's part of the residuals.
    pub blocks: Vec<(Channel, Range<usize>)>,
    /// Response of the residuals to an unknown road.
    pub profile: Option<Arc<Profile>>,
    /// True if `ay` is that of a level frame (an inertial navigation unit), without gravity's share by roll and bank.
    levelled: bool,
    measured: Vec<f64>,
    size: Vec<f64>,
    /// Contributions of the errors of the form: uncertain parameter, channel, shape.
    forms: Vec<(usize, Channel, Vec<f64>)>,
    /// Slopes of the errors of the form: they hardly change.
    of_forms: Vec<OnceLock<Arc<Vec<f64>>>>,
    /// Slopes that were taken last, the oldest first.
    kept: Mutex<Vec<Slopes>>,
    /// Gaps that are known.
    known: Mutex<Memo>,
    threads: usize,
}

impl<'a, V: ReplayVehicle> Problem<'a, V> {
    /// From a drive; effects that are not in the library cannot be named.
    #[must_use]
    pub fn new(
        drive: &'a ReplayDrive,
        vehicle: &'a V,
        correction: &'a Correction,
        library: Library<'a>,
        threads: usize,
    ) -> Self {
        let filter = Filter::new(drive.step);
        let rows = filter.rows(&drive.scored);
        let mut measured = Vec::new();
        let (mut blocks, mut size) = (Vec::new(), Vec::new());
        for &channel in &drive.channels {
            let from = measured.len();
            if channel.leaks() {
                measured.resize(from + rows.len(), 0.0);
                size.push(f64::INFINITY);
            } else {
                filter.apply(drive.column(channel.name()), &rows, &mut measured);
                size.push(ASTRAY * rms(&measured[from..]).max(channel.least_noise() * 10.0));
            }
            blocks.push((channel, from..measured.len()));
        }
        let uncertain = uncertain::uncertain_parameters(vehicle, drive, library);
        let forms = forms(drive, vehicle, correction, &uncertain);
        let of_forms = vec![OnceLock::new(); uncertain.len()];
        let mut made = Self {
            drive,
            vehicle,
            correction,
            library,
            uncertain,
            filter,
            rows,
            blocks,
            profile: None,
            levelled: false,
            measured,
            size,
            forms,
            of_forms,
            kept: Mutex::default(),
            known: Mutex::default(),
            threads,
        };
        made.profile = Profile::of(&made).map(Arc::new);
        made
    }

    /// The correction with the errors of the form at coordinates.
    fn corrected(&self, x: &[f64]) -> Cow<'_, Correction> {
        let mut all = Cow::Borrowed(self.correction);
        for (uncertain, channel, shape) in self.forms.iter().filter(|(uncertain, ..)| x[*uncertain] != 0.0) {
            let columns = &mut all.to_mut().columns;
            columns.resize(CHANNELS.len(), Vec::new());
            let column = &mut columns[*channel as usize];
            column.resize(shape.len(), 0.0);
            let size = self.uncertain[*uncertain].unit * x[*uncertain];
            column.iter_mut().zip(shape).for_each(|(value, shape)| *value += size * shape);
        }
        let late = uncertain::receiver_late(&self.uncertain, x);
        if late != 0.0 {
            all.to_mut().receiver_late = late;
        }
        all
    }

    /// The replay at coordinates.
    ///
    /// # Errors
    /// A vehicle that cannot be made.
    pub fn trace(&self, x: &[f64]) -> Result<Trace, String> {
        Ok(self.sensed(self.motion(x)?, x, self.levelled))
    }

    /// The same, started anew from the log every so many rows.
    pub(super) fn trace_anew(&self, x: &[f64], rows: usize) -> Option<Trace> {
        let trace = self.replayed(self.drive, x, Some(rows)).ok()?;
        Some(self.sensed(trace, x, self.levelled))
    }

    /// The replay before the sensors' frame and uncertain parameters.
    fn motion(&self, x: &[f64]) -> Result<Trace, String> {
        self.replayed(self.drive, x, None)
    }

    /// The vehicle at coordinates along a drive.
    fn replayed(&self, drive: &ReplayDrive, x: &[f64], horizon: Option<usize>) -> Result<Trace, String> {
        let (vehicle, effects) = uncertain::at(&self.uncertain, x, self.vehicle);
        let own = uncertain::own_effects(&self.uncertain, x, self.library);
        replay_with(drive, &vehicle, &effects, own, &self.corrected(x), horizon)
    }

    /// Sensor signals of a replay.
    fn sensed(&self, mut trace: Trace, x: &[f64], levelled: bool) -> Trace {
        if levelled {
            let ay = &mut trace.columns[Channel::Ay as usize];
            ay.iter_mut().zip(&trace.felt).for_each(|(ay, felt)| *ay -= felt);
        }
        uncertain::sense(&self.uncertain, x, self.drive, &mut trace);
        trace
    }

    /// Takes `ay` for that of a level frame.
    pub(super) fn level(&mut self) {
        self.levelled = true;
        uncertain::level(&mut self.uncertain, self.vehicle);
        (self.kept, self.known) = (Mutex::default(), Mutex::default());
        self.profile = Profile::of(self).map(Arc::new);
    }

    /// True if `ay` is that of a level frame.
    pub(super) fn is_level(&self) -> bool {
        self.levelled
    }

    /// Log less replay, filtered. None without such a vehicle.
    #[must_use]
    pub fn residual(&self, x: &[f64]) -> Option<Vec<f64>> {
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(gap) = known().find(x) {
            return Some(gap);
        }
        let gap = self.compare(&self.trace(x).ok()?);
        known().keep(x, &gap);
        Some(gap)
    }

    /// The same on a road with a column of its own.
    pub(super) fn residual_on(&self, x: &[f64], name: &'static str, column: Vec<f64>) -> Option<Vec<f64>> {
        self.residual_of(x, |drive| drop(drive.columns.insert(name, column)))
    }

    /// The same with something added to the steering.
    pub(super) fn residual_steered(&self, x: &[f64], more: &[f64]) -> Option<Vec<f64>> {
        self.residual_of(x, |drive| drive.steer.iter_mut().zip(more).for_each(|(steer, more)| *steer += more))
    }

    /// The same of a drive that is changed.
    fn residual_of(&self, x: &[f64], change: impl FnOnce(&mut ReplayDrive)) -> Option<Vec<f64>> {
        let mut drive = self.drive.clone();
        change(&mut drive);
        let trace = self.replayed(&drive, x, None).ok()?;
        Some(self.compare(&self.sensed(trace, x, self.levelled)))
    }

    /// Log less a replay, filtered.
    #[must_use]
    pub fn compare(&self, trace: &Trace) -> Vec<f64> {
        let mut simulated = Vec::with_capacity(self.measured.len());
        for (channel, _) in &self.blocks {
            self.filter.apply(trace.column(*channel), &self.rows, &mut simulated);
        }
        for ((_, block), &limit) in self.blocks.iter().zip(&self.size) {
            for i in block.clone() {
                let gap = self.measured[i] - simulated[i];
                simulated[i] = if gap.is_finite() { gap.clamp(-limit, limit) } else { limit.min(1e6) };
            }
        }
        simulated
    }

    /// Slope of the replay over one uncertain parameter at coordinates where the gap is `here`.
    #[must_use]
    pub fn slope(&self, x: &[f64], here: &[f64], uncertain: usize) -> Vec<f64> {
        self.slope_by(x, here, uncertain, |there| self.residual(there))
    }

    /// The slope where `residual` gives the gap.
    fn slope_by(
        &self,
        x: &[f64],
        here: &[f64],
        uncertain: usize,
        residual: impl Fn(&[f64]) -> Option<Vec<f64>>,
    ) -> Vec<f64> {
        let (there, size) = self.aside(x, uncertain);
        slope(here, residual(&there).as_ref(), size)
    }

    /// Second point of a difference quotient over an uncertain parameter, and its distance.
    fn aside(&self, x: &[f64], uncertain: usize) -> (Vec<f64>, f64) {
        let it = &self.uncertain[uncertain];
        let size = it.stride();
        let mut there = x.to_vec();
        // Downwards at the upper end.
        let size = if x[uncertain] + size > it.greatest { -size } else { size };
        there[uncertain] += size;
        (there, size)
    }

    /// True if slopes at one place hold at another.
    #[must_use]
    pub fn is_near(&self, x: &[f64], there: &[f64]) -> bool {
        let mut all = self.uncertain.iter().zip(x.iter().zip(there));
        all.all(|(uncertain, (x, there))| (x - there).abs() <= NEAR * uncertain.stride())
    }

    /// Slopes over all uncertain parameters at coordinates where the gap is `here`.
    #[must_use]
    pub fn slopes(&self, x: &[f64], here: &[f64]) -> Vec<Arc<Vec<f64>>> {
        let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        // The newest first.
        if let Some((_, slopes)) = kept().iter().rev().find(|(there, _)| self.is_near(x, there)) {
            return slopes.clone();
        }
        let slopes = self.taken(x, here);
        self.keep(x, &slopes);
        slopes
    }

    fn keep(&self, x: &[f64], slopes: &[Arc<Vec<f64>>]) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() == KEPT {
            kept.remove(0);
        }
        kept.push((x.to_vec(), slopes.to_vec()));
    }

    /// Slopes over all uncertain parameters, taken anew.
    fn taken(&self, x: &[f64], here: &[f64]) -> Vec<Arc<Vec<f64>>> {
        // What the sensors' uncertain parameters turn does not move the vehicle: one replay serves them all.
        let motion = self.motion(x).ok();
        let sensed = |there: &[f64]| Some(self.compare(&self.sensed(motion.clone()?, there, self.levelled)));
        parallel::map(self.threads, self.uncertain.len(), |uncertain| {
            let it = &self.uncertain[uncertain];
            if it.form().is_some() {
                let slope = || Arc::new(self.slope(x, here, uncertain));
                self.of_forms[uncertain].get_or_init(slope).clone()
            } else if it.is_sensed() {
                Arc::new(self.slope_by(x, here, uncertain, sensed))
            } else {
                Arc::new(self.slope(x, here, uncertain))
            }
        })
    }

    /// Number of threads.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Place of an uncertain parameter.
    #[must_use]
    pub fn find(&self, id: &str) -> Option<usize> {
        self.uncertain.iter().position(|uncertain| uncertain.id == id)
    }

    /// Uncertain parameter that is free with an uncertain parameter, and its standard deviation.
    #[must_use]
    pub fn companion(&self, uncertain: usize) -> Option<(usize, f64)> {
        let (id, deviation) = self.uncertain[uncertain].companion?;
        Some((self.find(id)?, deviation))
    }

    /// Uncertain parameters with their companions.
    #[must_use]
    pub fn with_companions(&self, uncertain: &[usize]) -> Vec<usize> {
        let companions = uncertain.iter().filter_map(|&uncertain| Some(self.companion(uncertain)?.0));
        uncertain.iter().copied().chain(companions).collect()
    }
}

/// Slope of a gap over a step; none without a vehicle.
fn slope(here: &[f64], there: Option<&Vec<f64>>, size: f64) -> Vec<f64> {
    match there {
        Some(there) => here.iter().zip(there).map(|(here, there)| (here - there) / size).collect(),
        None => vec![0.0; here.len()],
    }
}

/// Contributions of the errors of the form, from the neutral replay.
fn forms<V: ReplayVehicle>(
    drive: &ReplayDrive,
    vehicle: &V,
    correction: &Correction,
    uncertain: &[UncertainParameter],
) -> Vec<(usize, Channel, Vec<f64>)> {
    let mut all = Vec::new();
    let Ok(neutral) = replay(drive, vehicle, &TruckEffects::default(), correction, None) else { return all };
    for (i, uncertain) in uncertain.iter().enumerate() {
        if let Some(row) = uncertain.form() {
            let shapes = form::shapes(drive, &neutral, row);
            all.extend(shapes.into_iter().map(|(channel, shape)| (i, channel, shape)));
        }
    }
    all
}

/// Root mean square.
#[must_use]
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::replay::neutral;
    use super::super::simulated::{Conditions, drive};
    use super::*;
    use crate::vehicle::builtin;

    #[test]
    fn a_slope_is_the_gap_s_change_over_the_step_and_none_without_a_vehicle() {
        let there = vec![0.5, 4.0];
        assert_eq!(slope(&[1.0, 3.0], Some(&there), 0.5), [1.0, -2.0]);
        assert_eq!(slope(&[1.0, 3.0], Some(&there), -0.5), [-1.0, 2.0]);
        assert_eq!(slope(&[1.0, 3.0], None, 0.5), [0.0, 0.0]);
        assert_eq!((rms(&[3.0, -4.0]), rms(&[])), (12.5_f64.sqrt(), 0.0));
    }

    #[test]
    fn a_gap_is_the_log_less_the_replay_and_its_slopes_are_kept() {
        let car = builtin("c_class").unwrap();
        let conditions = Conditions { seed: 5, duration: 8.0, step: 0.02, ..Conditions::default() };
        let log = drive(&car, &TruckEffects::default(), &conditions).unwrap();
        let drive = ReplayDrive::new(&log, false);
        let correction = neutral(&drive, &car).unwrap();
        let problem = Problem::new(&drive, &car, &correction, Library::default(), 1);
        let neutral = vec![0.0; problem.uncertain.len()];
        let gap = problem.residual(&neutral).unwrap();
        assert_eq!(problem.blocks.last().unwrap().1.end, gap.len());
        // A bias of a sensor moves its own channel by as much, and nothing else.
        let bias = problem.find("yaw_rate_bias").unwrap();
        let biased = problem.slope(&neutral, &gap, bias);
        for (channel, block) in &problem.blocks {
            let wanted = if channel.name() == "yaw_rate" { problem.uncertain[bias].unit } else { 0.0 };
            let far = biased[block.clone()].iter().map(|slope| (slope - wanted).abs()).fold(0.0, f64::max);
            assert!(far < 1e-9, "{}: {far}", channel.name());
        }
        // At its upper end a parameter is varied downwards, and stays in its range.
        for (i, uncertain) in problem.uncertain.iter().enumerate().filter(|(_, it)| it.greatest.is_finite()) {
            let mut end = neutral.clone();
            end[i] = uncertain.greatest;
            let (there, size) = problem.aside(&end, i);
            assert!(size < 0.0 && there[i] < uncertain.greatest, "{}", uncertain.id);
        }
        // Slopes nearby are those taken before; farther on they are new.
        let slopes = problem.slopes(&neutral, &gap);
        let (mut near, mut far) = (neutral.clone(), neutral.clone());
        near[bias] += 0.5 * NEAR * problem.uncertain[bias].stride();
        far[bias] += 2.0 * NEAR * problem.uncertain[bias].stride();
        assert!(problem.is_near(&near, &neutral) && !problem.is_near(&far, &neutral));
        assert!(Arc::ptr_eq(&slopes[bias], &problem.slopes(&near, &gap)[bias]));
        assert!(!Arc::ptr_eq(&slopes[bias], &problem.slopes(&far, &gap)[bias]));
    }
}
