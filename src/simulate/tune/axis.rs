//! Axes of the search: named numbers of the controller, each over decades.

use crate::control::{ControlledParameters, ControllerParametersFor};
use crate::parameter::{OutOfRange, ParameterGroup};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A number that is searched.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// The parameter's name.
    pub name: String,
    /// Decades that stand for one unit of the search.
    pub decades: f64,
}

/// Numbers of a controller by their names.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ControllerNumbers(pub BTreeMap<String, f64>);

/// The weights and the horizon.
#[must_use]
pub fn standard_axes() -> Vec<Axis> {
    let names = ["mpc.q_e1", "mpc.q_e1_rate", "mpc.q_e2", "mpc.q_e2_rate", "mpc.r_rate", "mpc.horizon"];
    names.map(Axis::of).into()
}

impl Axis {
    /// A number with its usual width: a horizon's is less than a weight's.
    #[must_use]
    pub fn of(name: &str) -> Self {
        Self { name: name.to_owned(), decades: if name == "mpc.horizon" { 0.3 } else { 1.0 } }
    }

    /// The value so many units from another, within the parameter's range; 0 is replaced by the least effective weight.
    #[must_use]
    pub fn from<G>(&self, start: f64, units: f64) -> f64 {
        let value = self.least(start) * 10.0_f64.powf(self.decades * units);
        match ControllerParametersFor::<G>::declared(&self.name) {
            Some(parameter) => {
                let value = if parameter.integer { value.round() } else { value };
                value.clamp(parameter.min, parameter.max)
            }
            None => value,
        }
    }

    fn least(&self, value: f64) -> f64 {
        value.max(LEAST)
    }
}

/// Least effective weight.
const LEAST: f64 = 1e-4;

/// A number of the groups that all controllers have, by its name.
#[must_use]
pub fn number_of<G>(parameters: &ControllerParametersFor<G>, name: &str) -> Option<f64> {
    fn of<T: ParameterGroup>(group: &T, name: &str) -> Option<f64> {
        Some(group.get(T::table().iter().position(|parameter| parameter.name == name)?))
    }
    let p = parameters;
    of(&p.mpc, name)
        .or_else(|| of(&p.observer, name))
        .or_else(|| of(&p.speed, name))
        .or_else(|| of(&p.longitudinal, name))
        .or_else(|| of(&p.actuator, name))
        .or_else(|| of(&p.nmpc, name))
}

impl ControllerNumbers {
    /// Values of the axes in a controller; without those that only its kind of vehicle has.
    #[must_use]
    pub fn of<G>(parameters: &ControllerParametersFor<G>, axes: &[Axis]) -> Self {
        let value = |axis: &Axis| Some((axis.name.clone(), number_of(parameters, &axis.name)?));
        Self(axes.iter().filter_map(value).collect())
    }

    /// Applies the numbers to a controller.
    ///
    /// # Errors
    /// A value out of its range, or a name that no parameter has.
    pub fn apply<G: ControlledParameters<S>, const S: usize>(
        &self,
        parameters: &mut ControllerParametersFor<G>,
    ) -> Result<(), NotSet> {
        for (name, &value) in &self.0 {
            if !parameters.set::<S>(name, value)? {
                return Err(NotSet::Unknown { name: name.clone() });
            }
        }
        Ok(())
    }

    /// As settings, `NAME=VALUE` each.
    #[must_use]
    pub fn settings(&self) -> Vec<String> {
        self.0.iter().map(|(name, value)| format!("{name}={value}")).collect()
    }
}

/// A number that cannot be set.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum NotSet {
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    #[error("the controller has no number '{name}'; 'rfl parameters' lists all")]
    Unknown { name: String },
}
