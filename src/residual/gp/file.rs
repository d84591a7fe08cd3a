//! The process's file: made as that of a [`ResidualModel`](crate::residual::ResidualModel), with the word `rfl-gp`.
//!
//! Hyperparameters stand in the head, for people; dictionary, weights and covariance are its numbers.

use super::kernel::Kernel;
use super::model::{GpModel, GpSchema};
use super::samples::{OUTPUT_NAMES, input_names};
use super::sparse::{Numbers, Sparse};
use super::{GP_OUTPUTS, INPUTS};
use crate::nominal::Bicycle;
use crate::residual::file::{FileError, FileKind, in_file, open, seal};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The numbers of one output as they lie in the file.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Stored {
    /// Points one after the other, each with its inputs.
    dictionary: Vec<[f64; INPUTS]>,
    weights: Vec<f64>,
    posterior: Vec<f64>,
}

impl GpModel {
    /// The process as the bytes of its file.
    ///
    /// # Errors
    /// A process that cannot be written; none that training makes.
    pub fn to_bytes(&self) -> Result<Vec<u8>, FileError> {
        let stored = self.outputs.each_ref().map(|output| {
            let Numbers { dictionary, weights, posterior } = output.numbers().clone();
            Stored { dictionary, weights, posterior }
        });
        seal(FileKind::Gp, &self.schema.vehicle, &self.schema, &stored)
    }

    /// A process from the bytes of its file.
    ///
    /// # Errors
    /// Bytes that are no process, whole and consistent; never a panic.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FileError> {
        let (schema, stored): (GpSchema, [Stored; GP_OUTPUTS]) =
            open(FileKind::Gp, bytes, |schema: &GpSchema| &schema.vehicle)?;
        assemble(schema, stored).map_err(|what| FileError::Invalid { what })
    }

    /// Reads a process's file.
    ///
    /// # Errors
    /// A file that cannot be read or is no process.
    pub fn read(file: &Path) -> Result<Self, FileError> {
        in_file(file, || Self::from_bytes(&std::fs::read(file)?))
    }

    /// Writes the process's file.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, file: &Path) -> Result<(), FileError> {
        in_file(file, || Ok(std::fs::write(file, self.to_bytes()?)?))
    }
}

/// A process that predictions can rely on, whoever wrote it.
fn assemble(schema: GpSchema, stored: [Stored; GP_OUTPUTS]) -> Result<GpModel, &'static str> {
    let ensure = |holds: bool, what: &'static str| if holds { Ok(()) } else { Err(what) };
    let positive = |x: f64| x > 0.0 && x.is_finite();
    ensure(positive(schema.sample_time), "its sample time is no positive number")?;
    ensure(positive(schema.min_model_speed), "its minimum model speed is no positive number")?;
    ensure(
        Bicycle::new(&schema.vehicle, schema.friction).is_ok(),
        "a parameter of its vehicle, or its friction, is no positive number",
    )?;
    let names = schema.inputs.iter().map(|range| range.name.as_str());
    ensure(names.eq(input_names()), "its ranges are not those of the 5 inputs")?;
    let ordered = schema.inputs.iter().all(|r| r.min <= r.max && r.min.is_finite() && r.max.is_finite());
    ensure(ordered, "a range is none")?;
    let Ok(heads) = <&[_; GP_OUTPUTS]>::try_from(&schema.outputs[..]) else {
        return Err("its head has not 2 outputs");
    };
    let names = heads.each_ref().map(|head| head.name.as_str());
    ensure(names == OUTPUT_NAMES, "its outputs are not vy and yaw_rate")?;
    let mut outputs = heads.iter().zip(stored).map(|(head, stored)| {
        let length_scales = <[f64; INPUTS]>::try_from(&head.length_scales[..])
            .map_err(|_| "an output has not one length scale for each input")?;
        ensure(head.points == stored.dictionary.len(), "its dictionary has not the size that its head says")?;
        let Stored { dictionary, weights, posterior } = stored;
        Sparse::assemble(
            Kernel { length_scales, signal: head.signal, noise: head.noise },
            Numbers { dictionary, weights, posterior },
        )
    });
    let mut next = || outputs.next().unwrap_or(Err("its head has not 2 outputs"));
    let outputs = [next()?, next()?];
    Ok(GpModel { schema, outputs })
}
