//! Vehicles and roads that a controller is tuned for: the family around one vehicle.

use super::super::drive::Setup;
use super::super::vehicle::Commanded;
use super::TuneArgs;
use crate::control::ControlVariant;
use crate::diagnose::page::{Answer, AtSpeed};
use crate::path::{Closure, Path, PathOptions, Sample, Smoothing};
use crate::simulate::tune::{
    Actuators, Controlled, ControllerNumbers, Ensemble, Family, MarginGoal, Purpose, SPEEDS, Scenario,
    answer_to_offset, margins_over_speeds,
};
use crate::vehicle::{TruckEffects, VehicleParameters as _};
use std::error::Error;
use std::sync::Arc;

/// Factors on stiffness and on the own steering, and on the friction.
const STIFFNESS: (f64, f64) = (0.8, 1.1);
const OWN_STEERING: (f64, f64) = (0.7, 1.3);
const FRICTION: [f64; 3] = [1.0, 1.0, 0.8];
/// Share of the mean in the cost.
const MEAN_SHARE: f64 = 0.3;
/// Highest speed at which margins are asked for, m/s.
pub(super) const FASTEST: f64 = 24.0;
/// Pieces of a long road, m.
const PIECE: f64 = 500.0;
/// Pieces of a road at most, half for training and half held out.
const PIECES: usize = 8;
/// Speeds at which the answer to an offset is shown, m/s.
const SHOWN_SPEEDS: [f64; 3] = [5.0, 12.0, 22.0];

/// Data of the command.
pub(super) struct TuneData<'a, P: Commanded<S, C>, const S: usize, const C: usize> {
    pub args: &'a TuneArgs,
    pub vehicle: P::Parameters,
    pub controlled: Controlled<P, S, C>,
    family: Family<P, S, C>,
    /// Roads held out, if a road is given.
    other_roads: Vec<Arc<Path>>,
    pub variant: ControlVariant,
}

impl<'a, P, const S: usize, const C: usize> TuneData<'a, P, S, C>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    /// The family around the vehicle of the command line.
    pub fn new(args: &'a TuneArgs) -> Result<Self, Box<dyn Error>> {
        let setup = Setup::<P, S, C>::new(
            args.path.as_deref(),
            &args.limit.road(),
            P::TEST,
            &args.vehicle,
            &args.settings,
        )?;
        let (variant, model) = args.model.choose(&setup.controller)?;
        let mut roads = match &args.path {
            Some(_) => pieces(&setup.path)?,
            None => vec![],
        };
        // Every second one is held out; a short road is both, with other vehicles.
        let other_roads = match roads.len() {
            0 | 1 => roads.clone(),
            _ => roads.iter().skip(1).step_by(2).cloned().collect(),
        };
        roads = roads.into_iter().step_by(2).collect();
        let family = Family {
            stiffness: STIFFNESS,
            friction: FRICTION.into(),
            actuators: Actuators { lag: (0.0, 0.0), dead_time: (0.0, 0.0), own: OWN_STEERING },
            lateral_accel: vec![setup.controller.speed.lateral_accel],
            roads,
            ..Family::around(vec![setup.vehicle.clone()])
        };
        // Effects that were set are the vehicle's here; what they add to its steering is known of it.
        let mut vehicle = setup.vehicle;
        let mut effects = setup.effects;
        for effect in TruckEffects::all() {
            let Some(set) = P::effect(&mut effects, effect.id).map(|value| *value) else { continue };
            let Some(own) = vehicle.effect_mut(effect.id) else { continue };
            let more = set - *own;
            let steering = match effect.id {
                "steer_lag" => "steering.lag",
                "steer_delay" => "steering.dead_time",
                _ => {
                    *own = set;
                    continue;
                }
            };
            if let Some(parameter) = P::Parameters::TABLE.iter().find(|parameter| parameter.name == steering)
            {
                let value = parameter.get(&vehicle) + more;
                parameter.set(&mut vehicle, value);
            }
        }
        let family = Family { vehicles: vec![vehicle.clone()], ..family };
        Ok(Self { args, vehicle, controlled: (setup.controller, model), family, other_roads, variant })
    }

    /// Drives of the family, so many.
    pub fn ensemble(
        &self,
        count: usize,
        purpose: Purpose,
        seed: u64,
    ) -> Result<Ensemble<P, S, C>, Box<dyn Error>> {
        let mut scenarios = self.family.scenarios(count, seed, purpose, |_| self.controlled.clone())?;
        if purpose == Purpose::HeldOut && !self.other_roads.is_empty() {
            for (number, scenario) in scenarios.iter_mut().enumerate() {
                scenario.path = self.other_roads[number % self.other_roads.len()].clone();
            }
        }
        let goal = MarginGoal { delay: self.args.delay_margin, gain: self.args.gain_margin, speed: FASTEST };
        Ok(Ensemble { scenarios, mean_share: MEAN_SHARE, goal: Some(goal), threads: self.args.threads })
    }

    /// The vehicle as its file has it.
    fn nominal(&self) -> Result<Scenario<P, S, C>, Box<dyn Error>> {
        let exact = Actuators { own: (1.0, 1.0), ..self.family.actuators };
        let family = Family {
            vehicles: vec![self.vehicle.clone()],
            stiffness: (1.0, 1.0),
            payloads: vec![0.0],
            friction: vec![1.0],
            actuators: exact,
            lateral_accel: self.family.lateral_accel.clone(),
            noise: vec![0.0],
            roads: vec![],
            road: self.family.road,
            told: None,
        };
        let mut scenarios = family.scenarios(1, 0, Purpose::Training, |_| self.controlled.clone())?;
        Ok(scenarios.remove(0))
    }

    /// Margins of the vehicle's file at each speed.
    pub fn margins(&self, values: &ControllerNumbers) -> Result<Vec<AtSpeed>, Box<dyn Error>> {
        let scenario = self.nominal()?;
        let found = margins_over_speeds(&scenario, values, &SPEEDS)?;
        Ok(SPEEDS.into_iter().zip(found.into_iter().map(|(_, margins)| margins)).collect())
    }

    /// Answers to an offset, of two controllers.
    pub fn answers(&self, values: [&ControllerNumbers; 2]) -> Result<Vec<Answer>, Box<dyn Error>> {
        let scenario = self.nominal()?;
        let limit = self.controlled.0.speed.limit;
        let speeds = SHOWN_SPEEDS.into_iter().filter(|speed| *speed <= limit);
        speeds
            .map(|speed| {
                let [before, after] = values.map(|values| answer_to_offset(&scenario, values, speed));
                Ok(Answer { speed, curves: [before?, after?] })
            })
            .collect()
    }
}

/// Pieces of a road, evenly spread; all of it where it is short.
fn pieces(road: &Arc<Path>) -> Result<Vec<Arc<Path>>, Box<dyn Error>> {
    let length = road.length();
    if length < 3.0 * PIECE {
        return Ok(vec![road.clone()]);
    }
    let count = ((length / PIECE) as usize).min(PIECES);
    let begin = |piece: usize| length * piece as f64 / count as f64;
    let sample = |station: f64| {
        let at = road.at(station);
        Sample { yaw: Some(at.yaw), friction: Some(at.friction), ..Sample::at(at.x, at.y) }
    };
    let piece = |number: usize| {
        let samples = (0..=PIECE as usize).map(|i| sample(begin(number) + i as f64)).collect();
        let options =
            PathOptions { closure: Closure::Open, smoothing: Smoothing::None, ..PathOptions::default() };
        Ok(Arc::new(Path::from_samples_with(samples, &options)?))
    };
    (0..count).map(piece).collect()
}
