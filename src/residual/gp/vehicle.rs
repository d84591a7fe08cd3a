//! The vehicles of Gaussian processes: a nonlinear model, and its states that the process corrects.
//!
//! A model along a path has the states `[station, e1, e2, vy, r, ..]` (`nominal/path_model.rs`). The vehicle's place on
//! the path does not affect its body, so the process has as many inputs as the model has states. The speed before
//! replaces the first three; command and acceleration follow the body's states,
//!
//! ```text
//! z = [vx, vy, r, .., steer_cmd, accel]
//! ```
//!
//! The states after `vy` and `r` are those of the linear model behind the errors to the path, unchanged. Angles are not
//! corrected: over a step they follow from their rates.

use super::{GP_OUTPUTS, INPUTS, TRUCK_GP_OUTPUTS, TRUCK_INPUTS};
use crate::nominal::{
    ARTICULATED_PATH_STATES, ArticulatedPathState, ArticulatedSingleTrack, Bicycle, ERRORS, HeldSpeed,
    LateralVehicle, PathModel, SingleTrackError,
};
use crate::vehicle::{Articulated, SingleTrack};

/// A vehicle whose nonlinear model with `D` states a process with `D` inputs corrects in `O` of them.
pub trait GpVehicle<const S: usize, const D: usize, const O: usize>: LateralVehicle<S> {
    /// The nonlinear model.
    type Model: PathModel<S, D>;

    /// Indices of the inputs that, one step later, are the outputs.
    const OUTPUTS: [usize; O];

    /// The nonlinear model on a road with this friction coefficient.
    ///
    /// # Errors
    /// A parameter that is not positive.
    fn nonlinear_model(&self, friction: f64) -> Result<Self::Model, SingleTrackError>;

    /// The inputs with the body's states after a control step, s, at a held, positive speed, m/s.
    fn step(model: &Self::Model, at: &[f64; D], speed: f64, sample_time: f64) -> [f64; D];
}

impl GpVehicle<ERRORS, INPUTS, GP_OUTPUTS> for SingleTrack {
    type Model = Bicycle;

    const OUTPUTS: [usize; GP_OUTPUTS] = [1, 2];

    fn nonlinear_model(&self, friction: f64) -> Result<Bicycle, SingleTrackError> {
        Bicycle::new(self, friction)
    }

    fn step(model: &Bicycle, at: &[f64; INPUTS], speed: f64, sample_time: f64) -> [f64; INPUTS] {
        let [vx, vy, yaw_rate, steer, accel] = *at;
        let [vy, yaw_rate] = model.step(vy, yaw_rate, speed, steer, sample_time).value;
        [vx, vy, yaw_rate, steer, accel]
    }
}

impl GpVehicle<6, TRUCK_INPUTS, TRUCK_GP_OUTPUTS> for Articulated {
    type Model = ArticulatedSingleTrack;

    const OUTPUTS: [usize; TRUCK_GP_OUTPUTS] = [1, 2, 4];

    fn nonlinear_model(&self, friction: f64) -> Result<ArticulatedSingleTrack, SingleTrackError> {
        ArticulatedSingleTrack::new(self, friction)
    }

    fn step(
        model: &ArticulatedSingleTrack,
        at: &[f64; TRUCK_INPUTS],
        speed: f64,
        sample_time: f64,
    ) -> [f64; TRUCK_INPUTS] {
        const { assert!(TRUCK_INPUTS == ARTICULATED_PATH_STATES) };
        let [vx, vy, yaw_rate, articulation, articulation_rate, steer, accel] = *at;
        let state =
            ArticulatedPathState::from([0.0, 0.0, 0.0, vy, yaw_rate, articulation, articulation_rate]);
        // The body moves on any road as on a straight one.
        let held = HeldSpeed { path: speed, body: speed };
        let next = model.step_along(|_| [0.0; 2], &state, held, steer, sample_time).state;
        [vx, next[3], next[4], next[5], next[6], steer, accel]
    }
}

/// Names of the inputs.
pub(super) fn input_names<V: LateralVehicle<S>, const S: usize, const D: usize>() -> [&'static str; D] {
    const { assert!(D == S + 1, "speed, body, command, acceleration") };
    std::array::from_fn(|d| match d {
        0 => "vx",
        1 => "vy",
        2 => "yaw_rate",
        d if d + 2 == D => "steer_cmd",
        d if d + 1 == D => "accel",
        d => V::STATES[d + 1].name,
    })
}

/// Names of the outputs.
pub(super) fn output_names<V, const S: usize, const D: usize, const O: usize>() -> [&'static str; O]
where
    V: GpVehicle<S, D, O>,
{
    let names = input_names::<V, S, D>();
    V::OUTPUTS.map(|place| names[place])
}
