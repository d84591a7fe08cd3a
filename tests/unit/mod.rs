//! Our models as FMI units, in this process.

use rfl_mpc::fmi::{Context, Log, Model, Severity, Value, Values};

/// Hears nothing.
pub struct Silent;

impl Log for Silent {
    fn log(&mut self, _severity: Severity, _category: &'static str, _message: &str) {}
}

/// An FMI unit with its values, as an FMI host handles it.
pub struct Unit<M: Model> {
    pub model: M,
    pub values: Values,
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
        model.initialize(&mut values, 0.0, &Context::default(), &mut Silent).unwrap();
        Self { model, values }
    }

    /// The value of a real variable.
    pub fn real(&self, name: &str) -> f64 {
        self.values.real(M::declaration().find(name).unwrap())
    }
}
