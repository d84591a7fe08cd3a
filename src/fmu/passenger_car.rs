//! `PassengerCar`: the nonlinear car as an FMU.
//!
//! Parameters come from a vehicle file or a built-in car (`vehicle_file`); a value that the host sets itself wins, and
//! afterwards all values are those in effect. Every effect is a parameter `effect.<id>`.

use super::{failed, vehicle_file_parameter, vehicle_named};
use crate::fmi::{
    Context, Declaration, DefaultExperiment, Kind, Log, LogCategory, Model, ModelError, Severity, Values,
    Variable, Vr,
};
use crate::path::Path;
use crate::signal::{self, Signal, Unit};
use crate::vehicle::{
    BUILTIN, Car, CarInput, CarOutput, CarParameters, CarStatus, Effects, StepError, WheelOutput, builtin,
};
use std::sync::Arc;

const LOG: &str = "logPlant";
const LOG_CATEGORIES: &[LogCategory] =
    &[LogCategory { name: LOG, description: "The vehicle: files read, values in effect, status changes" }];

const WHEELS: [(&str, &str); 4] = [
    ("front_left", "front left"),
    ("front_right", "front right"),
    ("rear_left", "rear left"),
    ("rear_right", "rear right"),
];

type OfCar = fn(&CarOutput) -> f64;
type OfWheel = fn(&WheelOutput) -> f64;

/// The outputs that are signals of the vocabulary.
const SIGNALS: &[(&Signal, OfCar)] = &[
    (&signal::X, |car| car.x),
    (&signal::Y, |car| car.y),
    (&signal::YAW, |car| car.yaw),
    (&signal::VX, |car| car.vx),
    (&signal::VY, |car| car.vy),
    (&signal::YAW_RATE, |car| car.yaw_rate),
    (&signal::AX, |car| car.ax),
    (&signal::AY, |car| car.ay),
    (&signal::STEER, |car| car.steer),
    (&signal::ROLL, |car| car.roll),
    (&signal::PITCH, |car| car.pitch),
];

/// Outputs beyond the vocabulary.
const MORE: &[(&str, Unit, &str, OfCar)] = &[
    ("roll_rate", Unit::RADIAN_PER_SECOND, "Roll rate of the body", |car| car.roll_rate),
    (
        "road_wheel_angle",
        Unit::RADIAN,
        "Real angle of the road wheels, behind gain and offset of the linkage",
        |car| car.road_wheel_angle,
    ),
    ("drive_force", Unit::NEWTON, "Force that drive (positive) or brakes (negative) are set to", |car| {
        car.drive_force
    }),
    ("road.station", Unit::METRE, "Arc length on the road of road_file; 0 without one", |car| car.station),
];

const OF_WHEELS: &[(&str, Unit, &str, OfWheel)] = &[
    ("load", Unit::NEWTON, "Load", |wheel| wheel.load),
    ("slip", Unit::ONE, "Longitudinal slip, positive when driving", |wheel| wheel.slip),
    ("slip_angle", Unit::RADIAN, "Slip angle, positive when the contact slips to the left", |wheel| {
        wheel.slip_angle
    }),
    ("speed", Unit::RADIAN_PER_SECOND, "Spin", |wheel| wheel.speed),
];

/// References of all variables.
#[derive(Debug, Clone, PartialEq)]
struct References {
    steer_cmd: Vr,
    accel_cmd: Vr,
    /// The first of the signals, of the others, and of the wheels' outputs; each group is contiguous.
    signals: Vr,
    more: Vr,
    wheels: Vr,
    status: Vr,
    vehicle_file: Vr,
    road_file: Vr,
    initial: Vr,
    /// The first of the vehicle's parameters and of the effects.
    parameters: Vr,
    effects: Vr,
}

fn declare() -> (Declaration, References) {
    let mut declaration = Declaration {
        name: "PassengerCar",
        description: "Nonlinear two-track passenger car: roll, pitch, transient Magic Formula tyres, steering chain, \
                      unmodelled effects; integrated at 1000 Hz",
        variables: Vec::new(),
        experiment: DefaultExperiment { start_time: 0.0, stop_time: 60.0, tolerance: 1e-6, step_size: 0.01 },
        log_categories: LOG_CATEGORIES,
    };
    let d = &mut declaration;
    let steer_cmd = d.add(Variable::input(&signal::STEER_CMD));
    let accel_cmd = d.add(Variable::input(&signal::ACCEL_CMD));

    let signals = d.variables.len();
    for (signal, _) in SIGNALS {
        d.add(Variable::output(signal));
    }
    let more = d.variables.len();
    for (name, unit, meaning, _) in MORE {
        d.add(Variable::real_output(*name, *unit, *meaning));
    }
    let wheels = d.variables.len();
    for (wheel, place) in WHEELS {
        for (name, unit, meaning, _) in OF_WHEELS {
            d.add(Variable::real_output(
                format!("wheel.{wheel}.{name}"),
                *unit,
                format!("{meaning}, {place} wheel"),
            ));
        }
    }
    let status = Kind::Enumeration { type_name: "CarStatus", items: CarStatus::ITEMS, start: 0 };
    let status = d.add(Variable::output_of(status, "status", "What the car does, in one word"));

    let vehicle_file = d.add(vehicle_file_parameter());
    let road_file = d.add(Variable::parameter_of(
        Kind::String { start: "".into() },
        "road_file",
        "Road with bank, grade and friction (path CSV), absolute or in resources/; empty: level road",
    ));
    let initial = d.add(Variable::parameter("initial.x", Unit::METRE, 0.0, "East position at the start"));
    d.add(Variable::parameter("initial.y", Unit::METRE, 0.0, "North position at the start"));
    d.add(Variable::parameter("initial.yaw", Unit::RADIAN, 0.0, "Yaw angle at the start"));
    d.add(
        Variable::parameter("initial.vx", Unit::METRE_PER_SECOND, 0.0, "Speed at the start")
            .range(-60.0, 60.0),
    );

    // The default car's values are the start values, so that a host shows what is in effect.
    let default = builtin(BUILTIN[0]).expect("the built-in cars are read in a test");
    let parameters = d.variables.len();
    for parameter in CarParameters::TABLE {
        let (low, high) = parameter.range;
        let start = parameter.get(&default);
        d.add(Variable::parameter(parameter.name, parameter.unit, start, parameter.meaning).range(low, high));
    }
    let effects = d.variables.len();
    for effect in Effects::ALL {
        let description =
            format!("{} ({}; neutral: {})", effect.meaning, effect.stage.name(), effect.neutral);
        d.add(
            Variable::parameter(format!("effect.{}", effect.id), effect.unit, effect.neutral, description)
                .range(effect.range.0, effect.range.1),
        );
    }
    let references = References {
        steer_cmd,
        accel_cmd,
        signals,
        more,
        wheels,
        status,
        vehicle_file,
        road_file,
        initial,
        parameters,
        effects,
    };
    (declaration, references)
}

/// The FMU's model.
pub struct PassengerCar {
    references: References,
    car: Option<Car>,
    status: CarStatus,
}

impl PassengerCar {
    fn parameters(
        &self,
        values: &Values,
        context: &Context,
        log: &mut dyn Log,
    ) -> Result<CarParameters, ModelError> {
        let at = &self.references;
        let mut parameters = vehicle_named(values.string(at.vehicle_file), context)?;
        log.log(Severity::Info, LOG, &format!("the car is '{}'", parameters.name));
        let default = builtin(BUILTIN[0]).map_err(failed)?;
        for (index, parameter) in CarParameters::TABLE.iter().enumerate() {
            let (vr, default) = (at.parameters + index, parameter.get(&default));
            // Another start value than the declaration's: the FMU was packed with it.
            if values.is_set_by_host(vr) || values.real(vr) != default {
                parameter.set(&mut parameters, values.real(vr));
            }
        }
        Ok(parameters)
    }

    fn effects(&self, values: &Values) -> Effects {
        let mut effects = Effects::default();
        for (index, effect) in Effects::ALL.iter().enumerate() {
            if let Some(value) = effects.get_mut(effect.id) {
                *value = values.real(self.references.effects + index);
            }
        }
        effects
    }

    fn write_outputs(references: &References, car: &CarOutput, values: &mut Values) {
        for (index, (_, of)) in SIGNALS.iter().enumerate() {
            values.set_real(references.signals + index, of(car));
        }
        for (index, (.., of)) in MORE.iter().enumerate() {
            values.set_real(references.more + index, of(car));
        }
        let mut vr = references.wheels;
        for wheel in &car.wheels {
            for (.., of) in OF_WHEELS {
                values.set_real(vr, of(wheel));
                vr += 1;
            }
        }
        values.set_integer(references.status, car.status as i32);
    }

    /// Tells the host when the car starts to do something that a user should know.
    fn tell(&mut self, status: CarStatus, time: f64, log: &mut dyn Log) {
        if status != self.status {
            self.status = status;
            log.log(Severity::Info, LOG, &format!("{time} s: {}: {}", status.name(), status.meaning()));
        }
    }
}

impl Model for PassengerCar {
    fn declaration() -> Declaration {
        declare().0
    }

    fn new() -> Self {
        Self { references: declare().1, car: None, status: CarStatus::default() }
    }

    fn initialize(
        &mut self,
        values: &mut Values,
        _start_time: f64,
        context: &Context,
        log: &mut dyn Log,
    ) -> Result<(), ModelError> {
        self.car = None;
        let parameters = self.parameters(values, context, log)?;
        let effects = self.effects(values);
        let at = &self.references;
        let road: Option<Arc<Path>> = match values.string(at.road_file) {
            "" => None,
            name => {
                let road = Path::read(&context.locate(name)).map_err(failed)?;
                for note in road.notes() {
                    log.log(Severity::Info, LOG, &format!("road_file {name}: {note}"));
                }
                Some(Arc::new(road))
            }
        };
        let mut car = Car::new(&parameters, &effects, road).map_err(failed)?;
        let initial = |index| values.real(at.initial + index);
        car.place(initial(0), initial(1), initial(2), initial(3));
        for (index, parameter) in CarParameters::TABLE.iter().enumerate() {
            values.set_real(at.parameters + index, parameter.get(&parameters));
        }
        Self::write_outputs(at, car.output(), values);
        self.status = car.output().status;
        self.car = Some(car);
        Ok(())
    }

    fn step(
        &mut self,
        values: &mut Values,
        time: f64,
        step: f64,
        log: &mut dyn Log,
    ) -> Result<(), ModelError> {
        let at = &self.references;
        let input = CarInput { steer_cmd: values.real(at.steer_cmd), accel_cmd: values.real(at.accel_cmd) };
        let Some(car) = &mut self.car else {
            return Err(ModelError::Failed("the car is not initialised".to_string()));
        };
        car.step(&input, step).map_err(|error| match error {
            StepError::InputNotFinite { .. } | StepError::StepLength { .. } => {
                ModelError::Discard(error.to_string())
            }
            StepError::RolledOver { .. } | StepError::JackKnifed { .. } | StepError::NotFinite { .. } => {
                ModelError::Failed(error.to_string())
            }
        })?;
        let output = *car.output();
        Self::write_outputs(at, &output, values);
        self.tell(output.status, time + step, log);
        Ok(())
    }

    fn save(&self, bytes: &mut Vec<u8>) {
        if let Some(car) = &self.car {
            bytes.push(self.status as u8);
            car.save(bytes);
        }
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), ModelError> {
        match (&mut self.car, bytes.split_first()) {
            (None, None) => Ok(()),
            (Some(car), Some((&status, state))) => {
                let status = CarStatus::from_number(i32::from(status)).ok_or_else(|| {
                    ModelError::Failed(format!("a saved car cannot have status {status}; the state is of another FMU"))
                })?;
                car.restore(state).map_err(failed)?;
                self.status = status;
                Ok(())
            }
            (Some(_), None) | (None, Some(_)) => Err(ModelError::Failed(
                "the saved state is of another stage of the instance's life; initialise the instance first, as the \
                 saved one was"
                    .to_string(),
            )),
        }
    }
}
