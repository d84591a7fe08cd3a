//! A nonlinear vehicle as an FMU: what cars and trucks have in common.
//!
//! Parameters come from a vehicle file or a built-in vehicle (`vehicle_file`). A value that the host chooses, or who packed
//! the FMU, takes precedence, and afterwards all values are those in effect. Every effect is a parameter `effect.<id>`, and may stand
//! in the file.

mod delegate;

pub(super) use self::delegate::delegate;
use super::{PLACES, failed, vehicle_file_parameter, vehicle_named};
use crate::fmi::{
    Context, Declaration, DefaultExperiment, Log, LogCategory, Model, ModelError, Seconds, Severity, Values,
    Variable, VariableKind, Vr,
};
use crate::parameter::Parameter;
use crate::path::Path;
use crate::signal::{self, Signal, Unit};
use crate::vehicle::{Effect, PlantStepError, RestoreError, VehicleInput, VehicleParameters, WheelOutput};
use std::sync::Arc;

const LOG: &str = "logPlant";
const LOG_CATEGORIES: &[LogCategory] =
    &[LogCategory { name: LOG, description: "The vehicle: files read, values in effect, status changes" }];

type OfWheel = fn(&WheelOutput) -> f64;

/// Pose and speed at the start: a vehicle's parameters beside those of its file.
pub const INITIAL: [Parameter; 4] = {
    const fn initial(name: &'static str, unit: Unit, most: f64, meaning: &'static str) -> Parameter {
        Parameter { name, unit, default: 0.0, min: -most, max: most, integer: false, choices: None, meaning }
    }
    [
        initial("initial.x", Unit::METRE, signal::X.range.1, "East position at the start"),
        initial("initial.y", Unit::METRE, signal::Y.range.1, "North position at the start"),
        initial("initial.yaw", Unit::RADIAN, signal::YAW.range.1, "Yaw angle at the start"),
        initial("initial.vx", Unit::METRE_PER_SECOND, 60.0, "Speed at the start"),
    ]
};

const OF_WHEELS: &[(&str, Unit, &str, OfWheel)] = &[
    ("load", Unit::NEWTON, "Load", |wheel| wheel.load),
    ("slip", Unit::ONE, "Longitudinal slip, positive when driving", |wheel| wheel.slip),
    ("slip_angle", Unit::RADIAN, "Slip angle, positive when the contact slips to the left", |wheel| {
        wheel.slip_angle
    }),
    ("speed", Unit::RADIAN_PER_SECOND, "Spin", |wheel| wheel.speed),
];

/// An output that is a signal of the vocabulary, and its value.
pub type SignalOutput<O> = (&'static Signal, fn(&O) -> f64);
/// An output beyond the vocabulary: name, unit, meaning, value.
pub type ExtraOutput<O> = (&'static str, Unit, &'static str, fn(&O) -> f64);

/// A kind of vehicle, as its FMU needs it.
pub trait PlantUnit: Send + Sized + 'static {
    /// FMI `modelName`.
    const NAME: &'static str;
    /// One sentence.
    const DESCRIPTION: &'static str;
    /// Name of such a vehicle for people.
    const WHAT: &'static str;
    /// The outputs that are signals of the vocabulary.
    const SIGNALS: &'static [SignalOutput<Self::Output>];
    /// Outputs beyond the vocabulary.
    const MORE: &'static [ExtraOutput<Self::Output>];
    /// The wheels: name and place.
    const WHEELS: &'static [(&'static str, &'static str)];
    /// Type and values of the status.
    const STATUS: (&'static str, &'static [(i32, &'static str, &'static str)]);

    /// Contents of its file.
    type Parameters: VehicleParameters<Effects = Self::Effects>;
    /// Its effects.
    type Effects: Default + Clone;
    /// Measured signals.
    type Output: Copy;

    /// All effects, in order.
    fn all_effects() -> impl Iterator<Item = &'static Effect>;
    /// Value of an effect.
    fn effect<'a>(effects: &'a mut Self::Effects, id: &str) -> Option<&'a mut f64>;
    /// The vehicle.
    ///
    /// # Errors
    /// Parameters or effects out of range or without sense, as text.
    fn make(
        parameters: &Self::Parameters,
        effects: &Self::Effects,
        road: Option<Arc<Path>>,
    ) -> Result<Self, String>;
    /// Puts it somewhere: m, m, rad, m/s.
    fn place(&mut self, x: f64, y: f64, yaw: f64, vx: f64);
    /// Advances by a time in s.
    ///
    /// # Errors
    /// See [`PlantStepError`].
    fn step(&mut self, input: &VehicleInput, step: f64) -> Result<(), PlantStepError>;
    /// The same, but ends where the status changes; gives the time made, in s.
    ///
    /// # Errors
    /// See [`PlantStepError`].
    fn step_to_status(&mut self, input: &VehicleInput, step: f64) -> Result<f64, PlantStepError>;
    /// Measurements.
    fn output(&self) -> &Self::Output;
    /// The wheels, in the order of their names.
    fn wheels(output: &Self::Output) -> &[WheelOutput];
    /// The number of the status.
    fn status(output: &Self::Output) -> i32;
    /// Appends its state.
    fn save(&self, bytes: &mut Vec<u8>);
    /// Takes a saved state.
    ///
    /// # Errors
    /// Bytes of something else.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError>;
    /// Checks bytes that are to be restored later.
    ///
    /// # Errors
    /// Bytes of something else, or numbers that no drive can have.
    fn check_state(bytes: &[u8]) -> Result<(), RestoreError>;
}

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

/// The default vehicle, whose values are the start values, so that a host shows what is in effect.
fn default_of<P: PlantUnit>() -> P::Parameters {
    P::Parameters::builtin(P::Parameters::BUILTIN[0]).expect("the built-in vehicles are read in a test")
}

fn declare<P: PlantUnit>() -> (Declaration, References) {
    let mut declaration = Declaration {
        name: P::NAME,
        description: P::DESCRIPTION,
        variables: Vec::new(),
        binaries: Vec::new(),
        arrays: Vec::new(),
        ends_early: true,
        experiment: DefaultExperiment { start_time: 0.0, stop_time: 60.0, tolerance: 1e-6, step_size: 0.01 },
        log_categories: LOG_CATEGORIES,
    };
    let d = &mut declaration;
    let steer_cmd = d.add(Variable::input(&signal::STEER_CMD));
    let accel_cmd = d.add(Variable::input(&signal::ACCEL_CMD));

    let signals = d.variables.len();
    for (signal, _) in P::SIGNALS {
        d.add(Variable::output(signal));
    }
    let more = d.variables.len();
    for (name, unit, meaning, _) in P::MORE {
        d.add(Variable::real_output(*name, *unit, *meaning));
    }
    let wheels = d.variables.len();
    for (wheel, place) in P::WHEELS {
        for (name, unit, meaning, _) in OF_WHEELS {
            d.add(Variable::real_output(
                format!("wheel.{wheel}.{name}"),
                *unit,
                format!("{meaning}, {place} wheel"),
            ));
        }
    }
    let places: Vec<&str> = P::WHEELS.iter().map(|(_, place)| *place).collect();
    for (index, (name, _, meaning, _)) in OF_WHEELS.iter().enumerate() {
        let of_wheels = (0..P::WHEELS.len()).map(|wheel| wheels + wheel * OF_WHEELS.len() + index).collect();
        d.add_array(
            format!("wheel.{name}"),
            format!("{meaning}, of the wheels: {}", places.join(", ")),
            of_wheels,
        );
    }
    let status = VariableKind::Enumeration { type_name: P::STATUS.0, items: P::STATUS.1, start: 0 };
    let status =
        d.add(Variable::output_of(status, "status", format!("What the {} does, in one word", P::WHAT)));

    let vehicle_file = d.add(vehicle_file_parameter::<P::Parameters>(P::WHAT));
    let road_file = d.add(Variable::parameter_of(
        VariableKind::String { start: "".into() },
        "road_file",
        format!("Road with bank, grade and friction (path CSV), {PLACES}. Empty: level road"),
    ));
    let [initial, ..] = INITIAL.map(|Parameter { name, unit, default, min, max, meaning, .. }| {
        d.add(Variable::parameter(name, unit, default, meaning).range(min, max))
    });

    let default = default_of::<P>();
    let parameters = d.variables.len();
    for parameter in P::Parameters::TABLE {
        let (low, high) = parameter.range;
        let start = parameter.get(&default);
        d.add(Variable::parameter(parameter.name, parameter.unit, start, parameter.meaning).range(low, high));
    }
    let effects = d.variables.len();
    for effect in P::all_effects() {
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
pub struct PlantFmu<P> {
    references: References,
    vehicle: Option<P>,
    status: i32,
    /// Hash of the road; 0 without one.
    road: u64,
}

impl<P: PlantUnit> PlantFmu<P> {
    fn parameters(
        &self,
        values: &Values,
        context: &Context,
        log: &mut dyn Log,
    ) -> Result<P::Parameters, ModelError> {
        let at = &self.references;
        let mut parameters: P::Parameters = vehicle_named(values.string(at.vehicle_file), context)?;
        log.log(Severity::Info, LOG, &format!("the {} is '{}'", P::WHAT, parameters.name()));
        for (index, parameter) in P::Parameters::TABLE.iter().enumerate() {
            let vr = at.parameters + index;
            if values.is_chosen(vr) {
                parameter.set(&mut parameters, values.real(vr));
            }
        }
        Ok(parameters)
    }

    fn effects(&self, parameters: &P::Parameters, values: &mut Values) -> P::Effects {
        let mut effects = parameters.effects().clone();
        for (index, effect) in P::all_effects().enumerate() {
            let vr = self.references.effects + index;
            if let Some(value) = P::effect(&mut effects, effect.id) {
                if values.is_chosen(vr) {
                    *value = values.real(vr);
                }
                values.set_real(vr, *value);
            }
        }
        effects
    }

    fn write_outputs(references: &References, output: &P::Output, values: &mut Values) {
        for (index, (_, of)) in P::SIGNALS.iter().enumerate() {
            values.set_real(references.signals + index, of(output));
        }
        for (index, (.., of)) in P::MORE.iter().enumerate() {
            values.set_real(references.more + index, of(output));
        }
        let mut vr = references.wheels;
        for wheel in P::wheels(output) {
            for (.., of) in OF_WHEELS {
                values.set_real(vr, of(wheel));
                vr += 1;
            }
        }
        values.set_integer(references.status, P::status(output));
    }

    /// Advances the vehicle and shows what came of it; gives the time made, in s.
    fn advance(
        &mut self,
        values: &mut Values,
        time: f64,
        log: &mut dyn Log,
        advance: impl FnOnce(&mut P, &VehicleInput) -> Result<f64, PlantStepError>,
    ) -> Result<f64, ModelError> {
        let at = &self.references;
        let input =
            VehicleInput { steer_cmd: values.real(at.steer_cmd), accel_cmd: values.real(at.accel_cmd) };
        let Some(vehicle) = &mut self.vehicle else {
            return Err(ModelError::Failed(format!("the {} is not initialised", P::WHAT)));
        };
        let made = advance(vehicle, &input).map_err(|error| match error {
            PlantStepError::InputNotFinite { .. } | PlantStepError::StepLength { .. } => {
                ModelError::Discard(error.to_string())
            }
            PlantStepError::RolledOver { .. }
            | PlantStepError::JackKnifed { .. }
            | PlantStepError::NotFinite { .. } => ModelError::Failed(error.to_string()),
        })?;
        let output = *vehicle.output();
        Self::write_outputs(at, &output, values);
        self.tell(P::status(&output), time + made, log);
        Ok(made)
    }

    /// Tells the host when the vehicle starts to do something that a user should know.
    fn tell(&mut self, status: i32, time: f64, log: &mut dyn Log) {
        if status == self.status {
            return;
        }
        self.status = status;
        if let Some((_, name, meaning)) = P::STATUS.1.iter().find(|item| item.0 == status) {
            log.log(Severity::Info, LOG, &format!("{}: {name}: {meaning}", Seconds(time)));
        }
    }
}

impl<P: PlantUnit> Model for PlantFmu<P> {
    fn declaration() -> Declaration {
        declare::<P>().0
    }

    fn new() -> Self {
        Self { references: declare::<P>().1, vehicle: None, status: 0, road: 0 }
    }

    fn initialize(
        &mut self,
        values: &mut Values,
        _start_time: f64,
        context: &Context,
        log: &mut dyn Log,
    ) -> Result<(), ModelError> {
        self.vehicle = None;
        let parameters = self.parameters(values, context, log)?;
        let effects = self.effects(&parameters, values);
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
        self.road = road.as_ref().map_or(0, |road| road.hash());
        let mut vehicle = P::make(&parameters, &effects, road).map_err(failed)?;
        let initial = |index| values.real(at.initial + index);
        vehicle.place(initial(0), initial(1), initial(2), initial(3));
        for (index, parameter) in P::Parameters::TABLE.iter().enumerate() {
            values.set_real(at.parameters + index, parameter.get(&parameters));
        }
        Self::write_outputs(at, vehicle.output(), values);
        self.status = P::status(vehicle.output());
        self.vehicle = Some(vehicle);
        Ok(())
    }

    fn step(
        &mut self,
        values: &mut Values,
        time: f64,
        step: f64,
        log: &mut dyn Log,
    ) -> Result<(), ModelError> {
        let advance = |vehicle: &mut P, input: &VehicleInput| vehicle.step(input, step).map(|()| step);
        self.advance(values, time, log, advance).map(|_| ())
    }

    fn step_to_event(
        &mut self,
        values: &mut Values,
        time: f64,
        step: f64,
        log: &mut dyn Log,
    ) -> Result<f64, ModelError> {
        self.advance(values, time, log, |vehicle, input| vehicle.step_to_status(input, step))
    }

    fn save(&self, bytes: &mut Vec<u8>) {
        if let Some(vehicle) = &self.vehicle {
            bytes.push(self.status as u8);
            bytes.extend_from_slice(&self.road.to_le_bytes());
            vehicle.save(bytes);
        }
    }

    fn check(bytes: &[u8]) -> Result<(), ModelError> {
        match Saved::of(bytes)? {
            None => Ok(()),
            Some(saved) => P::check_state(saved.vehicle).map_err(failed),
        }
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), ModelError> {
        match (&mut self.vehicle, Saved::of(bytes)?) {
            (None, None) => Ok(()),
            (Some(vehicle), Some(Saved { status, road, vehicle: state })) => {
                if P::STATUS.1.iter().all(|item| item.0 != status) {
                    return Err(ModelError::Failed(format!(
                        "a saved {} cannot have status {status}; the state is of another FMU",
                        P::WHAT
                    )));
                }
                if road != self.road {
                    return Err(ModelError::Failed(format!(
                        "the saved state of the {} was made on another road: the file that road_file names has changed \
                         since, or is another one; restore it with the file of then",
                        P::WHAT
                    )));
                }
                vehicle.restore(state).map_err(failed)?;
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

/// Parts of a saved state.
struct Saved<'a> {
    status: i32,
    road: u64,
    vehicle: &'a [u8],
}

impl<'a> Saved<'a> {
    /// None of an instance without a vehicle.
    fn of(bytes: &'a [u8]) -> Result<Option<Self>, ModelError> {
        let Some((&status, rest)) = bytes.split_first() else { return Ok(None) };
        let (road, vehicle) =
            rest.split_first_chunk().ok_or_else(|| failed("the saved state ends too early"))?;
        Ok(Some(Self { status: i32::from(status), road: u64::from_le_bytes(*road), vehicle }))
    }
}
