//! The FMU library of the car's controller: [`RflMpc`](rfl_mpc::fmu::RflMpc) behind the C functions of FMI 2.0.

rfl_mpc::export_fmi2!(rfl_mpc::fmu::RflMpc, include_str!("../../../modelDescription/RflMpc.xml"));
