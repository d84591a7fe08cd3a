//! Ensembles of scenarios, each by a seed: vehicles, stiffness, payload, friction, actuator, speed, noise and road.
//!
//! Discrete choices go round, each with a period of its own, so that a small ensemble has all of them; continuous ones
//! are drawn. Every other actuator is a corner of its range: a worst case lies there more often than inside.

use super::scenario::Scenario;
use crate::control::{ControllerParametersFor, PredictionModelFor};
use crate::nominal::Actuator;
use crate::numerics::Random;
use crate::path::{Path, PathError, RandomRoad};
use crate::simulate::SimulatedVehicle;
use crate::simulate::experiment::{Compared, NominalOf};
use crate::vehicle::VehicleParameters as _;
use std::sync::Arc;

/// A controller, and its prediction model.
pub type Controlled<P, const S: usize, const C: usize> = (
    ControllerParametersFor<<P as SimulatedVehicle<S, C>>::Nominal>,
    PredictionModelFor<NominalOf<P, S, C>, S>,
);

/// Purpose of an ensemble: seeds of the one are never seeds of the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// To search or tune on.
    Training,
    /// To examine what was found.
    HeldOut,
}

/// Actuators of the vehicles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuators {
    /// Least and greatest lag on top of the file's, s.
    pub lag: (f64, f64),
    /// Least and greatest dead time on top of the file's, s.
    pub dead_time: (f64, f64),
    /// Least and greatest factor on the file's own lag and dead time.
    pub own: (f64, f64),
}

/// A family of scenarios.
pub struct Family<P: Compared<S, C>, const S: usize, const C: usize> {
    /// The vehicles by name.
    pub vehicles: Vec<P::Parameters>,
    /// Least and greatest factor on the stiffness of each axle.
    pub stiffness: (f64, f64),
    /// Payloads, kg.
    pub payloads: Vec<f64>,
    /// Factors on the road's friction.
    pub friction: Vec<f64>,
    /// Actuators.
    pub actuators: Actuators,
    /// Values of `speed.lateral_accel`, m/s2.
    pub lateral_accel: Vec<f64>,
    /// Noise as a multiple of the typical; 0 for none.
    pub noise: Vec<f64>,
    /// Roads that all drive; random ones if there are none.
    pub roads: Vec<Arc<Path>>,
    /// Shape of random roads; every third is closed.
    pub road: RandomRoad,
    /// Errors of the dead time and lag given to the controller, as shares; none if it is given nothing.
    pub told: Option<f64>,
}

/// Reasons for which there is no ensemble.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum FamilyError {
    #[error("an ensemble needs at least one vehicle, and one value of each quantity")]
    Empty,
    #[error("a {vehicle} has no effect {id}")]
    NoEffect { vehicle: &'static str, id: &'static str },
    #[error("a random road: {0}")]
    Road(#[from] PathError),
}

impl<P: Compared<S, C>, const S: usize, const C: usize> Family<P, S, C> {
    /// Spread of vehicles around these: the field's matrix for searches.
    #[must_use]
    pub fn around(vehicles: Vec<P::Parameters>) -> Self {
        let truck = P::SIGNALS.len() > crate::simulate::CAR_COLUMNS;
        let dead_time = (0.0, if truck { 0.3 } else { 0.12 });
        Self {
            vehicles,
            stiffness: (0.8, 1.1),
            payloads: if truck { vec![0.0, 3000.0] } else { vec![0.0, 300.0] },
            friction: vec![1.0, 1.0, 0.6],
            actuators: Actuators { lag: (0.0, 0.2), dead_time, own: (1.0, 1.0) },
            lateral_accel: if truck { vec![1.0, 1.5, 1.0] } else { vec![4.0, 2.25] },
            noise: vec![0.0, 1.0],
            roads: vec![],
            road: if truck { RandomRoad::TRUCK } else { RandomRoad::CAR },
            told: None,
        }
    }

    /// The scenarios of a seed, `count` of them. `controller` gives the controller for a vehicle and what it predicts with.
    ///
    /// # Errors
    /// A family with nothing in it.
    pub fn scenarios(
        &self,
        count: usize,
        seed: u64,
        purpose: Purpose,
        controller: impl Fn(&P::Parameters) -> Controlled<P, S, C>,
    ) -> Result<Vec<Scenario<P, S, C>>, FamilyError> {
        let seed = 2 * seed + u64::from(purpose == Purpose::HeldOut);
        (0..count).map(|i| self.scenario(i, seed, &controller)).collect()
    }

    fn scenario(
        &self,
        number: usize,
        seed: u64,
        controller: impl Fn(&P::Parameters) -> Controlled<P, S, C>,
    ) -> Result<Scenario<P, S, C>, FamilyError> {
        let mut random = Random::stream(seed, number as u64);
        let mut between = |(low, high): (f64, f64)| low + (high - low) * random.uniform();
        let round = |values: &[f64], every: usize| {
            values.get((number / every) % values.len().max(1)).copied().ok_or(FamilyError::Empty)
        };
        let place = number % self.vehicles.len().max(1);
        let vehicle = self.vehicles.get(place).ok_or(FamilyError::Empty)?;
        let factors = [between(self.stiffness), between(self.stiffness)];
        let drawn = [between(self.actuators.lag), between(self.actuators.dead_time)];
        let share = |(low, high): (f64, f64), share: f64| low + (high - low) * share;
        // A corner does not meet the same vehicle every time round.
        let corner = CORNERS[(number / 2 + number / (2 * CORNERS.len())) % CORNERS.len()];
        let [lag, dead_time] = match number % 2 {
            0 => [share(self.actuators.lag, corner[0]), share(self.actuators.dead_time, corner[1])],
            _ => drawn,
        };
        let error = between((-1.0, 1.0));
        // What is known of the own actuator is wrong in both parts alike, on every second drive by as much as may be.
        let own = match number % 4 {
            0 => self.actuators.own.1,
            2 => self.actuators.own.0,
            _ => between(self.actuators.own),
        };
        // Each with a period that has nothing to do with the others'.
        let (accel, friction) = (round(&self.lateral_accel, 2)?, round(&self.friction, 2)?);
        let payload = round(&self.payloads, 4)?;
        let noise = round(&self.noise, 3)?;

        let (mut controller, mut model) = controller(vehicle);
        controller.speed.lateral_accel = accel;
        let mut vehicle = vehicle.clone();
        for parameter in P::Parameters::TABLE {
            if ["steering.lag", "steering.dead_time"].contains(&parameter.name) {
                let value = own * parameter.get(&vehicle);
                parameter.set(&mut vehicle, value);
            }
        }
        let mut effects = vehicle.effects().clone();
        let multiplied = [
            ("tyre_stiffness_front", factors[0]),
            ("tyre_stiffness_rear", factors[1]),
            ("road_friction", friction),
        ];
        for (id, factor) in multiplied {
            *effect::<P, S, C>(&mut effects, id)? *= factor;
        }
        for (id, more) in [("payload", payload), ("steer_lag", lag), ("steer_delay", dead_time)] {
            *effect::<P, S, C>(&mut effects, id)? += more;
        }
        let steering = P::steering(&vehicle);
        let actuator = Actuator {
            dead_time: steering.dead_time + *effect::<P, S, C>(&mut effects, "steer_delay")?,
            time_constant: steering.lag + *effect::<P, S, C>(&mut effects, "steer_lag")?,
            ..Actuator::default()
        };
        if let Some(wrong) = self.told {
            let factor = 1.0 + wrong * error;
            let told = Actuator {
                dead_time: actuator.dead_time * factor,
                time_constant: actuator.time_constant * factor,
                ..actuator
            };
            (controller.actuator.dead_time, controller.actuator.time_constant) =
                (told.dead_time, told.time_constant);
            model = PredictionModelFor::Actuator(told);
        }
        let road_seed = 1000 * seed + number as u64;
        let (road, path) = match self.roads.len() {
            0 => {
                let road = RandomRoad { closed: number % 3 == 2, ..self.road };
                (format!("road {road_seed}"), Arc::new(road.path(road_seed)?))
            }
            count => (format!("road {}", number % count + 1), self.roads[number % count].clone()),
        };
        let name = format!(
            "{}, lag {:.3}, dead time {:.3}, stiffness {:.2}/{:.2}, payload {payload}, friction {friction}, \
             ay {accel}, noise {noise}, {road}",
            vehicle.name(),
            actuator.time_constant,
            actuator.dead_time,
            factors[0],
            factors[1],
        );
        let noise = (noise > 0.0).then(|| (P::SETTING.noise.scaled(noise), road_seed));
        Ok(Scenario { name, vehicle, effects, actuator, path, controller, model, noise })
    }
}

/// Lag and dead time as shares of their ranges.
const CORNERS: [[f64; 2]; 5] = [[1.0, 1.0], [0.0, 0.0], [0.5, 1.0], [1.0, 0.3], [0.0, 1.0]];

fn effect<'a, P: Compared<S, C>, const S: usize, const C: usize>(
    effects: &'a mut P::Effects,
    id: &'static str,
) -> Result<&'a mut f64, FamilyError> {
    P::effect(effects, id).ok_or(FamilyError::NoEffect { vehicle: P::KIND, id })
}
