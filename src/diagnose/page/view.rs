//! A diagnosis as plots look at it.

use super::plot::{Colour, PlotCurve, legend};
use crate::diagnose::{Diagnosis, Report, Series};
use crate::log::CleanLog;
use std::ops::Range;

/// Input of a page besides the diagnosis.
pub struct PageInput<'a> {
    /// The diagnosis.
    pub diagnosis: &'a Diagnosis,
    /// The log.
    pub log: &'a CleanLog,
    /// Wheelbase, m.
    pub wheelbase: f64,
    /// Road-wheel angle for each 1/m of curvature in steady cornering at a speed, rad m.
    pub steering: &'a dyn Fn(f64) -> f64,
    /// Files written beside the page, with their descriptions.
    pub files: &'a [(String, String)],
}

/// Colours of all plots, with their meanings.
pub(super) const LEGEND: [(Colour, &str); 4] = [
    (Colour::Log, "real"),
    (Colour::Simulated, "simulator as given"),
    (Colour::Effect, "with the effect"),
    (Colour::Corrected, "effect and recalibration"),
];

/// Length of the stretch that overlays show, s.
const STRETCH: f64 = 12.0;

/// A diagnosis as plots look at it.
pub(super) struct View<'a> {
    pub(super) report: &'a Report,
    pub(super) series: &'a Series,
    pub(super) valid: Vec<bool>,
    pub(super) commanded: bool,
    pub(super) step: f64,
    pub(super) wheelbase: f64,
    pub(super) steering: &'a dyn Fn(f64) -> f64,
    /// The stretch with the largest gap.
    pub(super) window: Range<usize>,
}

impl<'a> View<'a> {
    pub(super) fn new(input: &PageInput<'a>) -> Self {
        let Diagnosis { report, series } = input.diagnosis;
        let rows = series.time.len();
        let step = if rows > 1 { (series.time[rows - 1] - series.time[0]) / (rows - 1) as f64 } else { 1.0 };
        // The series may be a part of the log.
        let judged = |time: &f64| {
            let row = ((time - input.log.time.first()?) / input.log.step).round();
            input.log.valid.get(row as usize).copied().filter(|_| row >= 0.0)
        };
        let valid = series.time.iter().map(|time| judged(time).unwrap_or(false)).collect();
        let mut view = Self {
            report,
            series,
            valid,
            commanded: input.log.commanded,
            step,
            wheelbase: input.wheelbase,
            steering: input.steering,
            window: 0..rows,
        };
        view.window = view.largest_gap();
        view
    }

    /// A column of the log, if it is as long as the clock.
    pub(super) fn log(&self, name: &str) -> Option<&'a [f64]> {
        self.series.log.get(name).filter(|column| column.len() == self.series.time.len()).map(Vec::as_slice)
    }

    /// The log's and each simulator's column of this name.
    pub(super) fn of(&self, name: &str) -> impl Iterator<Item = (Colour, &'a [f64])> {
        let Series { log, simulated, with_effect, corrected, time } = self.series;
        let all = [log, simulated, with_effect, corrected];
        let colours = LEGEND.map(|(colour, _)| colour);
        let columns = colours
            .into_iter()
            .zip(all)
            .filter_map(move |(colour, columns)| Some((colour, columns.get(name)?)));
        let length = time.len();
        columns
            .filter(move |(_, column)| column.len() == length)
            .map(|(colour, column)| (colour, column.as_slice()))
    }

    /// A curve of each, the corrected one on top.
    pub(super) fn each(&self, name: &str, curve: impl Fn(Colour, &[f64]) -> PlotCurve) -> Vec<PlotCurve> {
        self.of(name).map(|(colour, values)| curve(colour, values)).collect()
    }

    pub(super) fn keys(&self) -> String {
        let some = |columns: &std::collections::BTreeMap<String, Vec<f64>>| !columns.is_empty();
        let Series { simulated, with_effect, corrected, .. } = self.series;
        let shown = [true, some(simulated), some(with_effect), some(corrected)];
        let entries: Vec<(Colour, &str)> =
            LEGEND.into_iter().zip(shown).filter(|(_, shown)| *shown).map(|(entry, _)| entry).collect();
        legend(&entries)
    }

    pub(super) fn mean_of_valid(&self, values: &[f64]) -> f64 {
        let valid = values.iter().zip(&self.valid).filter(|(_, valid)| **valid);
        let (sum, count) = valid.fold((0.0, 0_u32), |(sum, count), (value, _)| (sum + value, count + 1));
        sum / f64::from(count.max(1))
    }

    /// Place of the first signal's largest gap over a stretch.
    pub(super) fn largest_gap(&self) -> Range<usize> {
        let rows = self.series.time.len();
        let size = ((STRETCH / self.step) as usize).clamp(1, rows.max(1));
        let compared = self.report.inputs.signals.iter().find_map(|name| {
            Some((self.log(name)?, self.series.simulated.get(name).filter(|column| column.len() == rows)?))
        });
        let Some((log, simulated)) = compared else { return 0..size.min(rows) };
        let square = |i: usize| if self.valid[i] { (log[i] - simulated[i]).powi(2) } else { 0.0 };
        let mut sum: f64 = (0..size).map(square).sum();
        let (mut best, mut from) = (sum, 0);
        for end in size..rows {
            sum += square(end) - square(end - size);
            if sum > best {
                (best, from) = (sum, end + 1 - size);
            }
        }
        from..from + size
    }
}
