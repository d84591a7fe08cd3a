//! From drives to samples: errors of the nominal model, and the features known before.
//!
//! For each step of a drive, the nominal model is discretised exactly at that row's speed. With the *commanded*
//! steering `u` (a measured angle would hide the actuator's delay),
//!
//! ```text
//! eps_{k+1} = x_{k+1} - (A x_k + B u_k + D psi_des' + E psi_des''),     x = [e1, e1', e2, e2']
//! ```
//!
//! The road's heading rate and acceleration are those at the middle of the step, as in the controller's prediction.
//! A sample at row `k` with window `W` has *features* and *commands*. The features are `x_{k-W+1}, .., x_k` (oldest
//! first), then speed, curvature and curvature rate of row `k`. The commands are `u_{k-W+1}, .., u_k`, the last one
//! being in force over the step.
//! No window reaches over a gap or from one drive into the next.

use super::ROAD;
use super::checks::{self, DataError};
use super::recorded::{DataReport, Drive, DriveRow, Recorded};
use super::table::Columns;
use crate::nominal::{DiscreteErrorModel, ERRORS, LateralVehicle};
use crate::numerics::Fnv;
use crate::vehicle::{SingleTrack, Surface};
use nalgebra::SVector;

/// Controller for which the samples are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DataConfig {
    /// Time between control steps, s.
    pub sample_time: f64,
    /// Speed below which the controller holds its prediction model, m/s.
    pub min_model_speed: f64,
    /// Known ratio and offset, rad, of the angle at the wheels to the command: the controller plans the former.
    pub steer_gain: f64,
    #[allow(missing_docs)]
    pub steer_offset: f64,
}

impl Default for DataConfig {
    fn default() -> Self {
        Self { sample_time: 0.02, min_model_speed: 1.5, steer_gain: 1.0, steer_offset: 0.0 }
    }
}

/// Rows at the sample time and their labels, for a vehicle with `S` states.
#[derive(Debug, Clone, PartialEq)]
pub struct DataSet<V = SingleTrack, const S: usize = ERRORS> {
    pub(super) config: DataConfig,
    pub(super) vehicle: V,
    rows: DatasetRows<S>,
    hash: u64,
    report: DataReport,
}

/// The rows.
#[derive(Debug, Clone, Default, PartialEq)]
struct DatasetRows<const S: usize> {
    states: Vec<[f64; S]>,
    commands: Vec<f64>,
    road: Vec<[f64; ROAD]>,
    surfaces: Vec<Surface>,
    labels: Vec<Option<[f64; S]>>,
    /// Rows before this one in its uninterrupted stretch.
    before: Vec<u32>,
}

impl<V: LateralVehicle<S>, const S: usize> DataSet<V, S> {
    /// Checks drives, repairs what can be repaired and labels each step.
    ///
    /// All repairs are counted in the [`DataReport`]. Rows with impossible values or without numbers are left out, and
    /// gaps are not bridged. Drives sampled a whole number of times faster are thinned.
    ///
    /// # Errors
    /// Drives that cannot be repaired: see [`DataError`].
    pub fn new(drives: &[Drive], vehicle: &V, config: DataConfig) -> Result<Self, DataError> {
        const { assert!(S >= ERRORS, "a state begins with the errors to the path") };
        vehicle.model_at(config.min_model_speed)?;
        let mut report = DataReport::default();
        let mut hash = Fnv::new();
        let mut stretches: Vec<Vec<DriveRow<S>>> = Vec::new();
        for drive in drives {
            let recorded = Recorded::new(drive, &V::STATES);
            let values = recorded.columns.iter().flat_map(|(_, column)| *column);
            values.for_each(|x| hash.add(&x.to_bits().to_le_bytes()));
            stretches.extend(checks::stretches(&recorded, config.sample_time, &mut report)?);
        }
        for row in stretches.iter_mut().flatten() {
            row.command = config.steer_gain * row.command + config.steer_offset;
        }
        checks::units(&stretches, vehicle.wheelbase(), config.sample_time)?;
        checks::variation(&stretches, &V::STATES, &mut report)?;
        let mut rows = DatasetRows::default();
        let mut model = None;
        for stretch in &stretches {
            for (i, row) in stretch.iter().enumerate() {
                rows.states.push(row.state);
                rows.commands.push(row.command);
                rows.road.push(row.road);
                rows.surfaces.push(row.surface);
                rows.before.push(i as u32);
                let label = (i + 1 < stretch.len())
                    .then(|| label(vehicle, config, stretch, i, &mut model))
                    .transpose()?;
                report.labels += usize::from(label.is_some());
                rows.labels.push(label);
            }
        }
        Ok(Self { config, vehicle: *vehicle, rows, hash: hash.value(), report })
    }
}

/// The residual over the step that begins at row `i` of a stretch. `model` is kept while the speed stays.
fn label<V: LateralVehicle<S>, const S: usize>(
    vehicle: &V,
    config: DataConfig,
    stretch: &[DriveRow<S>],
    i: usize,
    model: &mut Option<(f64, DiscreteErrorModel<S>)>,
) -> Result<[f64; S], DataError> {
    let (now, next) = (&stretch[i], &stretch[i + 1]);
    let speed = now.road[0].max(config.min_model_speed);
    let (_, model) = match model {
        Some(kept) if kept.0 == speed => kept,
        _ => {
            let fresh = vehicle.model_at(speed)?.discretise(config.sample_time);
            model.insert((speed, fresh))
        }
    };
    let middle: [f64; ROAD] = std::array::from_fn(|r| 0.5 * (now.road[r] + next.road[r]));
    let [v, curvature, curvature_rate] = middle;
    let accel = acceleration(stretch, i, config.sample_time);
    let predicted = model.step(
        &SVector::from(now.state),
        now.command,
        v * curvature,
        v * v * curvature_rate + accel * curvature,
    );
    Ok(std::array::from_fn(|o| next.state[o] - predicted[o]))
}

impl<V, const S: usize> DataSet<V, S> {
    /// The controller for which the samples are made.
    #[must_use]
    pub fn config(&self) -> &DataConfig {
        &self.config
    }

    /// Samples with a full window of `window` rows.
    #[must_use]
    pub fn windows(&self, window: usize) -> Windows<'_, S> {
        let data = &self.rows;
        let full = |&row: &usize| data.before[row] as usize + 1 >= window && data.labels[row].is_some();
        Windows { data, window, rows: (0..data.states.len()).filter(full).map(|row| row as u32).collect() }
    }

    /// The rows again, stretch by stretch.
    pub(crate) fn stretches(&self) -> impl Iterator<Item = Vec<DriveRow<S>>> {
        let data = &self.rows;
        let row = |i: usize| DriveRow {
            command: data.commands[i],
            state: data.states[i],
            road: data.road[i],
            surface: data.surfaces[i],
        };
        let starts = (0..data.before.len()).filter(|&i| data.before[i] == 0);
        starts.map(move |start| {
            let end = (start + 1..data.before.len()).find(|&i| data.before[i] == 0);
            (start..end.unwrap_or(data.before.len())).map(row).collect()
        })
    }

    /// The same with the label of each row's step.
    pub(super) fn labelled_stretches(
        &self,
    ) -> impl Iterator<Item = (Vec<DriveRow<S>>, Vec<Option<[f64; S]>>)> {
        let mut next = 0;
        self.stretches().map(move |stretch| {
            let begin = next;
            next += stretch.len();
            let labels = self.rows.labels[begin..next].to_vec();
            (stretch, labels)
        })
    }

    /// Time between rows, s.
    #[must_use]
    pub fn sample_time(&self) -> f64 {
        self.config.sample_time
    }

    /// Findings in the drives.
    #[must_use]
    pub fn report(&self) -> &DataReport {
        &self.report
    }

    /// A number that identifies the drives' values (FNV-1a of their bits).
    #[must_use]
    pub fn hash(&self) -> u64 {
        self.hash
    }
}

/// Rows on each side over which the acceleration is taken: a difference of two rows would be mostly noise.
const ACCELERATION_ROWS: usize = 5;

/// Longitudinal acceleration near row `i` of a stretch, m/s2.
pub(crate) fn acceleration<const S: usize>(stretch: &[DriveRow<S>], i: usize, sample_time: f64) -> f64 {
    let (from, to) =
        (i.saturating_sub(ACCELERATION_ROWS), (i + 1 + ACCELERATION_ROWS).min(stretch.len() - 1));
    (stretch[to].road[0] - stretch[from].road[0]) / ((to - from) as f64 * sample_time)
}

/// The samples of a [`DataSet`] for one window.
#[derive(Debug, Clone)]
pub struct Windows<'a, const S: usize = ERRORS> {
    data: &'a DatasetRows<S>,
    window: usize,
    rows: Vec<u32>,
}

impl<const S: usize> Windows<'_, S> {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// True if there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Length of the window, W.
    #[must_use]
    pub fn window(&self) -> usize {
        self.window
    }

    /// True if a sample's step is the one after that of the sample before.
    #[must_use]
    pub fn follows(&self, sample: usize) -> bool {
        sample > 0 && self.rows[sample] == self.rows[sample - 1] + 1
    }

    fn range(&self, sample: usize) -> std::ops::Range<usize> {
        let newest = self.rows[sample] as usize;
        newest + 1 - self.window..newest + 1
    }

    /// Error states of the window, oldest first; rad, m, s.
    #[must_use]
    pub fn states(&self, sample: usize) -> &[[f64; S]] {
        &self.data.states[self.range(sample)]
    }

    /// Commands of the window, oldest first, rad.
    #[must_use]
    pub fn commands(&self, sample: usize) -> &[f64] {
        &self.data.commands[self.range(sample)]
    }

    /// Speed, curvature and curvature rate at the newest row; m/s, 1/m, 1/m2.
    #[must_use]
    pub fn road(&self, sample: usize) -> [f64; ROAD] {
        self.data.road[self.rows[sample] as usize]
    }

    /// Error of the nominal model over the step.
    #[must_use]
    pub fn label(&self, sample: usize) -> [f64; S] {
        self.data.labels[self.rows[sample] as usize].unwrap_or([f64::NAN; S])
    }

    /// Writes the features of a sample, `S W + 3` of them, as [`crate::residual::ResidualModel::coefficients`] takes
    /// them.
    pub fn features(&self, sample: usize, out: &mut [f64]) {
        let (states, road) = out.split_at_mut(S * self.window);
        states.copy_from_slice(self.states(sample).as_flattened());
        road.copy_from_slice(&self.road(sample));
    }
}

impl<const S: usize> Columns for Windows<'_, S> {
    fn rows(&self) -> usize {
        self.len()
    }
    fn columns(&self) -> usize {
        S * self.window + ROAD
    }
    fn value(&self, row: usize, column: usize) -> f64 {
        match column.checked_sub(S * self.window) {
            Some(road) => self.road(row)[road],
            None => self.states(row)[column / S][column % S],
        }
    }
}
