//! The process's file: made as that of a [`ResidualModel`](crate::residual::ResidualModel), with the word `rfl-gp`.
//!
//! Hyperparameters stand in the head, for people; dictionary, weights and covariance are its numbers.

use super::kernel::Kernel;
use super::model::{GpModelFor, GpSchema};
use super::sparse::{Sparse, SparseNumbers};
use super::vehicle::{GpVehicle, input_names, output_names};
use crate::input;
use crate::nominal::LateralVehicle;
use crate::residual::file::{FileError, FileKind, in_file, open, seal};
use crate::residual::rows::{self, FeatureRow};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The numbers of one output as they lie in the file.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Stored<const D: usize> {
    /// Points one after the other, each with its inputs.
    #[serde(with = "rows")]
    dictionary: Vec<[f64; D]>,
    weights: Vec<f64>,
    posterior: Vec<f64>,
}

impl<V, const D: usize, const O: usize> GpModelFor<V, D, O> {
    /// The process as the bytes of its file.
    ///
    /// # Errors
    /// A process that cannot be written; none that training makes.
    pub fn to_bytes<const S: usize>(&self) -> Result<Vec<u8>, FileError>
    where
        V: LateralVehicle<S>,
    {
        let stored: [Stored<D>; O] = std::array::from_fn(|o| {
            let SparseNumbers { dictionary, weights, posterior } = self.outputs[o].numbers().clone();
            Stored { dictionary, weights, posterior }
        });
        seal(FileKind::Gp, &self.schema.vehicle, &self.schema, &FeatureRow(&stored))
    }

    /// A process from the bytes of its file.
    ///
    /// # Errors
    /// Bytes that are no process, whole and consistent; never a panic.
    pub fn from_bytes<const S: usize>(bytes: &[u8]) -> Result<Self, FileError>
    where
        V: GpVehicle<S, D, O>,
    {
        let (schema, FeatureRow(stored)): (GpSchema<V>, FeatureRow<[Stored<D>; O]>) =
            open(FileKind::Gp, bytes, |schema: &GpSchema<V>| &schema.vehicle)?;
        assemble(schema, stored).map_err(|what| FileError::Invalid { what })
    }

    /// Reads a process's file.
    ///
    /// # Errors
    /// A file that cannot be read or is no process.
    pub fn read<const S: usize>(file: &Path) -> Result<Self, FileError>
    where
        V: GpVehicle<S, D, O>,
    {
        in_file(file, || Self::from_bytes(&input::read(file, input::MODEL).map_err(FileError::Read)?))
    }

    /// Writes the process's file.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write<const S: usize>(&self, file: &Path) -> Result<(), FileError>
    where
        V: LateralVehicle<S>,
    {
        in_file(file, || crate::output::write_bytes(file, self.to_bytes()?).map_err(FileError::Write))
    }
}

/// A process that predictions can rely on, whoever wrote it.
fn assemble<V: GpVehicle<S, D, O>, const S: usize, const D: usize, const O: usize>(
    schema: GpSchema<V>,
    stored: [Stored<D>; O],
) -> Result<GpModelFor<V, D, O>, &'static str> {
    let ensure = |holds: bool, what: &'static str| if holds { Ok(()) } else { Err(what) };
    let positive = |x: f64| x > 0.0 && x.is_finite();
    ensure(positive(schema.sample_time), "its sample time is no positive number")?;
    ensure(positive(schema.min_model_speed), "its minimum model speed is no positive number")?;
    ensure(
        schema.vehicle.nonlinear_model(schema.friction).is_ok(),
        "a parameter of its vehicle, or its friction, is no positive number",
    )?;
    let names = schema.inputs.iter().map(|range| range.name.as_str());
    ensure(names.eq(input_names::<V, S, D>()), "its ranges are not those of its inputs")?;
    let ordered = schema.inputs.iter().all(|r| r.min <= r.max && r.min.is_finite() && r.max.is_finite());
    ensure(ordered, "a range is none")?;
    let names = schema.outputs.iter().map(|head| head.name.as_str());
    ensure(names.eq(output_names::<V, S, D, O>()), "its outputs are not those of such a vehicle's process")?;
    let outputs = schema.outputs.iter().zip(stored).map(|(head, stored)| {
        let length_scales = <[f64; D]>::try_from(&head.length_scales[..])
            .map_err(|_| "an output has not one length scale for each input")?;
        ensure(head.points == stored.dictionary.len(), "its dictionary has not the size that its head says")?;
        let Stored { dictionary, weights, posterior } = stored;
        Sparse::assemble(
            Kernel { length_scales, signal: head.signal, noise: head.noise },
            SparseNumbers { dictionary, weights, posterior },
        )
    });
    let outputs = outputs.collect::<Result<_, _>>()?;
    Ok(GpModelFor { schema, outputs })
}
