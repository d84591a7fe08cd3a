//! Our models as FMI units, in this process.

use rfl_mpc::fmi::{Context, Log, Model, Severity, Value, Values};

/// Hears nothing.
pub struct Silent;

impl Log for Silent {
    fn log(&mut self, _severity: Severity, _category: &'static str, _message: &str) {}
}

/// Keeps what is said.
#[derive(Default)]
pub struct Messages(pub Vec<(Severity, String)>);

impl Log for Messages {
    fn log(&mut self, severity: Severity, _category: &'static str, message: &str) {
        self.0.push((severity, message.to_owned()));
    }
}

/// An FMI unit with its values, as an FMI host handles it.
pub struct Unit<M: Model> {
    pub model: M,
    pub values: Values,
    pub log: Messages,
}

impl<M: Model> Unit<M> {
    /// Initialised with these settings.
    pub fn new(settings: &[(&str, Value)]) -> Self {
        let declaration = M::declaration();
        let mut values = Values::starting_from(&declaration.variables);
        for (name, value) in settings {
            let vr = declaration.find(name).unwrap();
            values.set_by_host(vr, &declaration.variables[vr], value.clone());
        }
        let mut model = M::new();
        let mut log = Messages::default();
        model.initialize(&mut values, 0.0, &Context::default(), &mut log).unwrap();
        Self { model, values, log }
    }

    /// The value of a real variable.
    pub fn real(&self, name: &str) -> f64 {
        self.values.real(M::declaration().find(name).unwrap())
    }
}
