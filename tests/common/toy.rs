//! A small real model to test the FMI layer with: a steering actuator of first order,
//! `tau * d(steer)/dt = gain * steer_cmd - steer`, with a variable of each type and causality, a resource file, and
//! parameters that make it fail, discard a step or panic.

use rfl_mpc::fmi::{
    Array, Causality, Context, Declaration, DefaultExperiment, Initial, Log, LogCategory, Model, ModelError,
    Severity, Values, Variability, Variable, VariableKind, Vr,
};
use rfl_mpc::signal::{self, Unit};

/// References of the variables, in the order of their declaration.
pub mod vr {
    pub const STEER_CMD: u32 = 0;
    pub const ENABLED: u32 = 1;
    pub const STEER: u32 = 2;
    pub const STEPS: u32 = 3;
    pub const MOVING: u32 = 4;
    pub const SOURCE: u32 = 5;
    pub const METHOD_USED: u32 = 6;
    pub const TAU: u32 = 7;
    pub const GAIN: u32 = 8;
    pub const SUBSTEPS: u32 = 9;
    pub const METHOD: u32 = 10;
    pub const LIMITED: u32 = 11;
    pub const FILE: u32 = 12;
    pub const MAX_STEP: u32 = 13;
    pub const FAIL_AFTER: u32 = 14;
    pub const PANIC_AFTER: u32 = 15;
    pub const START: u32 = 16;
    pub const HISTORY: u32 = 17;
    pub const REPORT_WARNINGS: u32 = 19;
    /// Number of variables; bytes follow in versions that have them.
    pub const COUNT: u32 = 20;
    pub const DATA: u32 = COUNT;
}

const METHODS: &[(i32, &str, &str)] =
    &[(1, "exact", "Exact for held inputs"), (2, "euler", "Explicit Euler")];

fn method(start: i32) -> VariableKind {
    VariableKind::Enumeration { type_name: "Method", items: METHODS, start }
}

/// The model.
pub struct SteeringLag {
    steer: f64,
    steps: i32,
    history: [f64; 2],
    tau: f64,
}

fn up(vr: u32) -> Vr {
    vr as Vr
}

impl Model for SteeringLag {
    fn declaration() -> Declaration {
        let parameter = |kind, name, description| Variable::parameter_of(kind, name, description);
        let boolean_input = Variable {
            causality: Causality::Input,
            variability: Variability::Discrete,
            initial: Initial::Exact,
            ..parameter(
                VariableKind::Boolean { start: true },
                "enabled",
                "Whether the actuator follows the command",
            )
        };
        let history =
            |i| Variable::real_output(format!("history[{i}]"), Unit::RADIAN, "Angle that many steps ago");
        Declaration {
            name: "SteeringLag",
            description: "A steering actuator of first order, to test FMI with: <\"&'> survive",
            variables: vec![
                Variable::input(&signal::STEER_CMD),
                boolean_input,
                Variable::output(&signal::STEER),
                Variable::output_of(
                    VariableKind::Integer { start: 0, min: Some(0), max: None },
                    "steps",
                    "Steps made",
                ),
                Variable::output_of(
                    VariableKind::Boolean { start: false },
                    "moving",
                    "Whether the wheels turn",
                ),
                Variable::output_of(
                    VariableKind::String { start: "".into() },
                    "source",
                    "Where tau comes from",
                ),
                Variable::output_of(method(1), "method_used", "The method in use"),
                Variable::parameter("actuator.tau", Unit::SECOND, 0.1, "Time constant").range(1e-3, 10.0),
                Variable::parameter("actuator.gain", Unit::ONE, 1.0, "Gain").range(0.0, 2.0).tunable(),
                parameter(
                    VariableKind::Integer { start: 1, min: Some(1), max: Some(100) },
                    "solver.substeps",
                    "Integration steps in one step",
                ),
                parameter(method(1), "solver.method", "Integration method"),
                parameter(
                    VariableKind::Boolean { start: false },
                    "actuator.limited",
                    "Whether the angle is limited to 0.5 rad",
                ),
                parameter(
                    VariableKind::String { start: "".into() },
                    "actuator_file",
                    "File with tau, in s, or empty",
                ),
                Variable::parameter("test.max_step", Unit::SECOND, 1.0, "A longer step is discarded")
                    .range(0.0, 1e9),
                Variable::parameter("test.fail_after", Unit::SECOND, 1e9, "From this time on steps fail"),
                Variable::parameter("test.panic_after", Unit::SECOND, 1e9, "From this time on steps panic"),
                Variable::parameter("actuator.start", Unit::RADIAN, 0.0, "Angle at the start")
                    .range(-1.0, 1.0),
                history(1),
                history(2),
                parameter(
                    VariableKind::Boolean { start: false },
                    "test.report_warnings",
                    "Whether warnings are statuses",
                ),
            ],
            binaries: vec![parameter(
                VariableKind::Binary { max_size: 64 },
                "actuator_data",
                "Contents of actuator_file instead of a file, or empty",
            )],
            arrays: vec![Array {
                name: "history".into(),
                description: "Angles one and two steps ago".into(),
                elements: vec![up(vr::HISTORY), up(vr::HISTORY) + 1],
            }],
            ends_early: true,
            experiment: DefaultExperiment {
                start_time: 0.0,
                stop_time: 2.0,
                tolerance: 1e-6,
                step_size: 0.01,
            },
            log_categories: &[LogCategory { name: "logActuator", description: "What the actuator does" }],
        }
    }

    fn new() -> Self {
        Self { steer: 0.0, steps: 0, history: [0.0; 2], tau: 0.0 }
    }

    fn initialize(
        &mut self,
        values: &mut Values,
        _start_time: f64,
        context: &Context,
        log: &mut dyn Log,
    ) -> Result<(), ModelError> {
        let file = values.string(up(vr::FILE)).to_owned();
        let mut source = "parameter".to_owned();
        let data = values.binary(up(vr::DATA));
        if !data.is_empty() {
            let text = String::from_utf8_lossy(&data);
            let tau =
                text.trim().parse().map_err(|error| ModelError::Failed(format!("actuator_data: {error}")))?;
            values.set_real(up(vr::TAU), tau);
            source = "bytes".to_owned();
        } else if !file.is_empty() && !values.is_set_by_host(up(vr::TAU)) {
            let path = context.locate(&file);
            let failed = |what: String| {
                ModelError::Failed(format!("{}, line 1: {what}. Write one number, in s.", path.display()))
            };
            let text = std::fs::read_to_string(&path).map_err(|error| failed(error.to_string()))?;
            let tau = text.trim().parse::<f64>().map_err(|error| failed(error.to_string()))?;
            values.set_real(up(vr::TAU), tau);
            source = file;
        }
        log.log(Severity::Info, "logActuator", "100 % ready: %s %n");
        let start = values.real(up(vr::START));
        *self = Self { steer: start, steps: 0, history: [start; 2], tau: values.real(up(vr::TAU)) };
        values.set_string(up(vr::SOURCE), source);
        values.set_integer(up(vr::METHOD_USED), values.integer(up(vr::METHOD)));
        self.publish(values, false);
        Ok(())
    }

    fn step(
        &mut self,
        values: &mut Values,
        time: f64,
        step: f64,
        log: &mut dyn Log,
    ) -> Result<(), ModelError> {
        self.advance(values, time, step, false, log).map(|_| ())
    }

    fn step_to_event(
        &mut self,
        values: &mut Values,
        time: f64,
        step: f64,
        log: &mut dyn Log,
    ) -> Result<f64, ModelError> {
        self.advance(values, time, step, true, log)
    }

    fn reports_warnings(&self, values: &Values) -> bool {
        values.boolean(up(vr::REPORT_WARNINGS))
    }

    fn save(&self, bytes: &mut Vec<u8>) {
        for real in [self.steer, self.history[0], self.history[1]] {
            bytes.extend_from_slice(&real.to_le_bytes());
        }
        bytes.extend_from_slice(&self.steps.to_le_bytes());
    }

    fn check(bytes: &[u8]) -> Result<(), ModelError> {
        Self::new().restore(bytes)
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), ModelError> {
        let truncated = || ModelError::Failed("its internal state is truncated".to_owned());
        let real = |i: usize| {
            let bytes = bytes.get(8 * i..8 * i + 8).and_then(|bytes| bytes.try_into().ok());
            bytes.map(f64::from_le_bytes).ok_or_else(truncated)
        };
        let steps = bytes.get(24..28).and_then(|bytes| bytes.try_into().ok()).ok_or_else(truncated)?;
        let (steer, history) = (real(0)?, [real(1)?, real(2)?]);
        (self.steer, self.history, self.steps) = (steer, history, i32::from_le_bytes(steps));
        Ok(())
    }
}

impl SteeringLag {
    /// A step; one to an event ends with the integration step in which the angle comes to its limit.
    fn advance(
        &mut self,
        values: &mut Values,
        time: f64,
        step: f64,
        to_event: bool,
        log: &mut dyn Log,
    ) -> Result<f64, ModelError> {
        if step > values.real(up(vr::MAX_STEP)) {
            return Err(ModelError::Discard(format!("{step} s is too long: 50 % of it may do")));
        }
        if time >= values.real(up(vr::FAIL_AFTER)) {
            return Err(ModelError::Failed("it was told to fail".to_owned()));
        }
        assert!(time < values.real(up(vr::PANIC_AFTER)), "it was told to panic");
        let (before, mut made) = (self.steer, step);
        if values.boolean(up(vr::ENABLED)) {
            let target = values.real(up(vr::GAIN)) * values.real(up(vr::STEER_CMD));
            let substeps = values.integer(up(vr::SUBSTEPS));
            let h = step / f64::from(substeps);
            let share =
                if values.integer(up(vr::METHOD)) == 1 { -(-h / self.tau).exp_m1() } else { h / self.tau };
            for substep in 1..=substeps {
                self.steer += share * (target - self.steer);
                if to_event && values.boolean(up(vr::LIMITED)) && self.steer.abs() > 0.5 {
                    made = h * f64::from(substep);
                    break;
                }
            }
        }
        if values.boolean(up(vr::LIMITED)) && self.steer.abs() > 0.5 {
            self.steer = self.steer.clamp(-0.5, 0.5);
            log.log(Severity::Warning, "logActuator", "the angle is at its limit");
        }
        self.steps += 1;
        self.history = [before, self.history[0]];
        self.publish(values, self.steer != before);
        Ok(made)
    }

    fn publish(&self, values: &mut Values, moving: bool) {
        values.set_real(up(vr::STEER), self.steer);
        values.set_integer(up(vr::STEPS), self.steps);
        values.set_boolean(up(vr::MOVING), moving);
        for (i, angle) in self.history.iter().enumerate() {
            values.set_real(up(vr::HISTORY) + i, *angle);
        }
    }
}
