//! The FMU library of the car's controller: [`RflMpc`](rfl_mpc::fmu::RflMpc) behind the C functions of FMI 2.0 and 3.0. It is
//! compiled once, and linked for each version with that version's functions (`linker.rs` of fmu-build).

rfl_mpc::export_fmi2!(rfl_mpc::fmu::RflMpc, include_str!("../../../modelDescription/RflMpc.xml"));
rfl_mpc::export_fmi3!(rfl_mpc::fmu::RflMpc, include_str!("../../../modelDescription/fmi3/RflMpc.xml"));
