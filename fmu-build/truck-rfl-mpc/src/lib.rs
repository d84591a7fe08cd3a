//! The FMU library of the truck's controller: [`TruckRflMpc`](rfl_mpc::fmu::TruckRflMpc) behind the C functions of FMI 2.0.

rfl_mpc::export_fmi2!(rfl_mpc::fmu::TruckRflMpc, include_str!("../../../modelDescription/TruckRflMpc.xml"));
