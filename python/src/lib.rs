//! The Python package's library: the commands of `rfl` and its controller, called from Python.
//!
//! A command takes its options in the words of the command line ([`rfl_mpc::cli::arguments`]). It works in a thread of
//! its own without Python's lock, and reports its words and its progress to the caller. An interrupt (Ctrl-C) stops it.
//! Names and documentation for people are Python: `rfl_mpc/__init__.py`.

mod work;

use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyType};
use rfl_mpc::cli::drive::Stepwise;
use rfl_mpc::cli::{self, ReadsLogs};
use rfl_mpc::control::{ControlStatus, KnownActuator, Measurement, StepReport};
use rfl_mpc::log::DriveLog;
use std::error::Error;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use work::{guarded, keep_panics, working};

create_exception!(
    rfl_mpc,
    RflError,
    PyException,
    "Bad input or a failure. The words say what was wrong, where, and what to do."
);
create_exception!(rfl_mpc, InternalError, RflError, "An error in rfl_mpc itself: a report is welcome.");

/// A log that Python has: its name, and columns of doubles in this machine's byte order.
type Frame = (String, Vec<(String, PyBackedBytes)>);

fn log_of((name, columns): &Frame) -> Result<DriveLog, Box<dyn Error>> {
    let doubles = |bytes: &[u8]| {
        bytes.chunks_exact(8).map(|one| f64::from_ne_bytes(one.try_into().unwrap_or_default())).collect()
    };
    let columns = columns.iter().map(|(name, bytes)| (name.clone(), doubles(bytes))).collect();
    Ok(DriveLog::from_columns(Path::new(name), columns)?)
}

/// The arguments of a command with the logs that Python has.
fn with_logs<T: ReadsLogs>(
    command: &'static str,
    words: &[String],
    frames: &[Frame],
) -> Result<T, Box<dyn Error>> {
    let logs = frames.iter().map(log_of).collect::<Result<_, _>>()?;
    Ok(cli::arguments::<T>(command, words)?.with_logs(logs))
}

/// Steering and acceleration of one control step, and its grounds.
#[pyclass(frozen, get_all, module = "rfl_mpc")]
struct Command {
    /// Road-wheel angle asked of the actuator, rad.
    steer_cmd: f64,
    /// Acceleration asked of drive and brakes, m/s2.
    accel_cmd: f64,
    /// Status of the step, in a word such as `optimal`.
    status: &'static str,
    /// The end of the road is reached, or a full lap is driven.
    finished: bool,
    /// Lateral error, m, and its rate, m/s.
    e1: f64,
    e1_rate: f64,
    /// Heading error, rad, and its rate, rad/s.
    e2: f64,
    e2_rate: f64,
    /// Place along the road, m.
    station: f64,
    /// Curvature of the road there, 1/m.
    curvature: f64,
    /// Speed that is wanted there, m/s.
    speed_ref: f64,
    /// Iterations of the QP solver.
    iterations: u32,
    /// Wall-clock time of the step, s.
    compute_time: f64,
}

impl From<StepReport> for Command {
    fn from(report: StepReport) -> Self {
        let StepReport { steer_cmd, accel_cmd, finished, e1, e1_rate, e2, e2_rate, .. } = report;
        let StepReport { station, curvature, speed_ref, iterations, compute_time, .. } = report;
        let of_road = [e1, e1_rate, e2, e2_rate, station, curvature, speed_ref];
        Self::of(report.status.name(), ([steer_cmd, accel_cmd], finished, of_road, iterations, compute_time))
    }
}

/// The numbers of a [`Command`] beside its status, in the order of its fields.
type Numbers = ([f64; 2], bool, [f64; 7], u32, f64);

impl Command {
    fn of(status: &'static str, numbers: Numbers) -> Self {
        let ([steer_cmd, accel_cmd], finished, of_road, iterations, compute_time) = numbers;
        let [e1, e1_rate, e2, e2_rate, station, curvature, speed_ref] = of_road;
        Self {
            steer_cmd,
            accel_cmd,
            status,
            finished,
            e1,
            e1_rate,
            e2,
            e2_rate,
            station,
            curvature,
            speed_ref,
            iterations,
            compute_time,
        }
    }
}

#[pymethods]
impl Command {
    #[new]
    fn new(status: &str, numbers: Numbers) -> PyResult<Self> {
        let found = ControlStatus::ALL.iter().find(|known| known.name() == status);
        let Some(status) = found.map(|known| known.name()) else {
            return Err(PyValueError::new_err(format!("'{status}' is no status of a controller")));
        };
        Ok(Self::of(status, numbers))
    }

    /// For `pickle` and `copy`.
    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyType>, (&'static str, Numbers)) {
        let of_road =
            [self.e1, self.e1_rate, self.e2, self.e2_rate, self.station, self.curvature, self.speed_ref];
        let commands = [self.steer_cmd, self.accel_cmd];
        let numbers = (commands, self.finished, of_road, self.iterations, self.compute_time);
        (py.get_type::<Self>(), (self.status, numbers))
    }

    fn __repr__(&self) -> String {
        format!(
            "Command(steer_cmd={:.5}, accel_cmd={:.3}, status='{}', e1={:.4}, station={:.2})",
            self.steer_cmd, self.accel_cmd, self.status, self.e1, self.station
        )
    }
}

/// A controller that is called step by step.
#[pyclass(frozen, module = "rfl_mpc._native")]
struct Controller(Mutex<Box<dyn Stepwise>>);

impl Controller {
    fn with<T>(&self, of: impl FnOnce(&mut dyn Stepwise) -> T) -> T {
        of(self.0.lock().unwrap_or_else(PoisonError::into_inner).as_mut())
    }
}

#[pymethods]
impl Controller {
    #[new]
    fn new(py: Python<'_>, words: Vec<String>, tell: &Bound<'_, PyAny>) -> PyResult<Self> {
        let made = working(py, tell, move || cli::drive::controller(&cli::arguments("Controller", &words)?))?;
        Ok(Self(Mutex::new(made)))
    }

    /// `measured`: x, y, yaw, vx, vy, yaw rate, steer, articulation, its rate.
    fn step_with(&self, py: Python<'_>, time: Option<f64>, measured: [f64; 9]) -> PyResult<Command> {
        let [x, y, yaw, vx, vy, yaw_rate, steer, articulation, articulation_rate] = measured;
        let measured = Measurement { x, y, yaw, vx, vy, yaw_rate, steer, articulation, articulation_rate };
        py.detach(|| guarded(|| Ok(self.with(|one| one.step(time, &measured))?.into())))
    }

    /// A controller of its own in the same state.
    fn copied(&self, py: Python<'_>) -> PyResult<Self> {
        py.detach(|| guarded(|| Ok(Self(Mutex::new(self.with(|one| one.copied())?)))))
    }

    #[getter]
    fn sample_time(&self) -> f64 {
        self.with(|one| one.sample_time())
    }

    #[getter]
    fn start(&self) -> [f64; 4] {
        self.with(|one| one.start())
    }

    #[getter]
    fn length(&self) -> f64 {
        self.with(|one| one.length())
    }

    #[getter]
    fn actuator(&self) -> Option<(f64, f64, f64, bool, f64)> {
        let KnownActuator { actuator, spread, shown, backlash } = self.with(|one| one.actuator())?;
        Some((actuator.dead_time, actuator.time_constant, spread, shown, backlash))
    }
}

/// A drive's log as Python gets it: columns of doubles, and the statuses.
type Log<'py> = (Vec<(&'static str, Bound<'py, PyBytes>)>, Vec<&'static str>);

/// The module `rfl_mpc._native`.
#[pymodule(name = "_native")]
mod native {
    use super::*;

    #[pymodule_export]
    use super::{Command, Controller, InternalError, RflError};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        keep_panics();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }

    /// The program `rfl`, the program's name first; gives its exit status.
    #[pyfunction]
    fn program(py: Python<'_>, words: Vec<OsString>) -> PyResult<u8> {
        py.detach(|| guarded(|| Ok(cli::main(words))))
    }

    #[pyfunction]
    fn drive<'py>(
        py: Python<'py>,
        words: Vec<String>,
        tell: &Bound<'py, PyAny>,
    ) -> PyResult<(String, Log<'py>)> {
        let driven = working(py, tell, move || cli::drive::driven(&cli::arguments("drive", &words)?))?;
        let bytes = |values: Vec<f64>| {
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
            PyBytes::new(py, &bytes)
        };
        let columns = driven.columns.into_iter().map(|(name, values)| (name, bytes(values))).collect();
        Ok((driven.report.to_string(), (columns, driven.statuses)))
    }

    #[pyfunction]
    fn diagnose(
        py: Python<'_>,
        words: Vec<String>,
        frames: Vec<Frame>,
        out: Option<PathBuf>,
        tell: &Bound<'_, PyAny>,
    ) -> PyResult<(String, String)> {
        let found = working(py, tell, move || {
            let args = with_logs("diagnose", &words, &frames)?;
            let found = cli::diagnose::diagnosed(&args, out.as_deref())?;
            Ok((serde_json::to_string(&found.report)?, found.page))
        })?;
        Ok(found)
    }

    #[pyfunction]
    fn train(
        py: Python<'_>,
        words: Vec<String>,
        frames: Vec<Frame>,
        tell: &Bound<'_, PyAny>,
    ) -> PyResult<(String, Option<String>)> {
        let learned = working(py, tell, move || cli::train::trained(&with_logs("train", &words, &frames)?))?;
        Ok((learned.report.to_string(), learned.refused))
    }

    #[pyfunction]
    fn identify(
        py: Python<'_>,
        words: Vec<String>,
        frames: Vec<Frame>,
        tell: &Bound<'_, PyAny>,
    ) -> PyResult<String> {
        let read = move || cli::identify::identified(&with_logs("identify", &words, &frames)?);
        Ok(working(py, tell, read)?.to_string())
    }

    #[pyfunction]
    fn tune(py: Python<'_>, words: Vec<String>, tell: &Bound<'_, PyAny>) -> PyResult<String> {
        let tuned = working(py, tell, move || cli::tune::tuned(&cli::arguments("tune", &words)?))?;
        Ok(tuned.to_string())
    }

    /// The signals of a drive log that a table's columns are, by their names.
    #[pyfunction]
    #[expect(clippy::needless_pass_by_value, reason = "Python's list becomes one of our own")]
    fn signals(names: Vec<String>) -> Vec<Option<&'static str>> {
        DriveLog::signals(&names)
    }
}
