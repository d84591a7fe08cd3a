//! The test model as an FMU library: `fmu-build`'s tests pack it.

#[path = "../../tests/common/toy.rs"]
#[allow(dead_code)]
mod toy;

rfl_mpc::export_fmi2!(toy::SteeringLag, include_str!("../../tests/common/SteeringLag.xml"));
