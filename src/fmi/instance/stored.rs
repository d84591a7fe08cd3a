//! States that a host stores, takes over and writes into bytes.
//!
//! A handle is looked up and never followed, so that a foreign one does no harm. A state of another FMU, or with content that no
//! state has, is refused.

use super::{ALL_STALE, CallResult, Instance};
use crate::fmi::call_error::CallError;
use crate::fmi::logger::Messages;
use crate::fmi::model::{Model, ModelError};
use crate::fmi::snapshot::Snapshot;
use crate::fmi::types::Status;
use std::ffi::c_void;

impl<M: Model> Instance<M> {
    /// A new state, or the one that `handle` names is written over.
    pub fn store(&mut self, handle: *mut c_void) -> Result<*mut c_void, CallError> {
        if !handle.is_null() && !self.snapshots.contains_key(&handle.addr()) {
            return Err(CallError::ForeignState);
        }
        let model = self.life.has_working_model().then(|| {
            let mut bytes = Vec::new();
            self.model.save(&mut bytes);
            bytes
        });
        let snapshot = Snapshot {
            life: self.life,
            start_time: self.start_time,
            stop_time: self.stop_time,
            time: self.time,
            values: self.values.clone(),
            model,
        };
        match self.snapshots.get_mut(&handle.addr()) {
            Some(place) => {
                **place = snapshot;
                Ok(handle)
            }
            None => Ok(self.keep(snapshot)),
        }
    }

    /// Keeps a state and gives its handle.
    fn keep(&mut self, snapshot: Snapshot) -> *mut c_void {
        let mut snapshot = Box::new(snapshot);
        let handle: *mut Snapshot = &mut *snapshot;
        self.snapshots.insert(handle.addr(), snapshot);
        handle.cast()
    }

    /// Forgets a state.
    pub fn free_state(&mut self, handle: *mut c_void) -> CallResult {
        match self.snapshots.remove(&handle.addr()) {
            None if !handle.is_null() => Err(CallError::ForeignState),
            _ => Ok(Status::Ok),
        }
    }

    /// A state's bytes.
    pub fn serialize(&self, handle: *mut c_void) -> Result<Vec<u8>, CallError> {
        let snapshot = self.snapshots.get(&handle.addr()).ok_or(CallError::ForeignState)?;
        Ok(snapshot.to_bytes(self.guid))
    }

    /// A state from bytes.
    pub fn deserialize(&mut self, bytes: &[u8]) -> Result<*mut c_void, CallError> {
        let snapshot = Snapshot::from_bytes(bytes, self.guid, &self.declaration.variables)?;
        if let Some(state) = &snapshot.model {
            M::check(state).map_err(|error| CallError::StateContent { message: error.to_string() })?;
        }
        Ok(self.keep(snapshot))
    }

    /// Takes over a state. A model of other parameters is made anew from those of the state; if that fails, the
    /// instance is as it was.
    pub fn restore(&mut self, handle: *mut c_void) -> CallResult {
        let snapshot = self.snapshots.get(&handle.addr()).ok_or(CallError::ForeignState)?;
        let refused = |error: ModelError| CallError::Restore { message: error.to_string() };
        let variables = &self.declaration.variables;
        match &snapshot.model {
            None => self.model = M::new(),
            Some(bytes) => {
                let alive = self.life.has_working_model()
                    && self.start_time == snapshot.start_time
                    && self.values.same_fixed_parameters(&snapshot.values, variables);
                if alive {
                    self.model.restore(bytes).map_err(refused)?;
                } else {
                    let mut values = snapshot.values.clone();
                    values.forget_calculated(variables);
                    let mut model = M::new();
                    let mut messages = Messages::to(&self.logger);
                    model
                        .initialize(&mut values, snapshot.start_time, &self.context, &mut messages)
                        .map_err(refused)?;
                    model.restore(bytes).map_err(refused)?;
                    self.model = model;
                }
            }
        }
        self.values.clone_from(&snapshot.values);
        (self.life, self.stale) = (snapshot.life, ALL_STALE);
        (self.start_time, self.stop_time) = (snapshot.start_time, snapshot.stop_time);
        let time = snapshot.time;
        self.set_time(time);
        self.outside.fill(false);
        self.wrote_start.fill(false);
        Ok(Status::Ok)
    }
}
