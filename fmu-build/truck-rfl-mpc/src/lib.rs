//! The FMU library of the truck's controller: [`TruckRflMpc`](rfl_mpc::fmu::TruckRflMpc) behind the C functions of FMI 2.0 and 3.0. It is
//! compiled once, and linked for each version with that version's functions (`linker.rs` of fmu-build).

rfl_mpc::export_fmi2!(rfl_mpc::fmu::TruckRflMpc, include_str!("../../../modelDescription/TruckRflMpc.xml"));
rfl_mpc::export_fmi3!(
    rfl_mpc::fmu::TruckRflMpc,
    include_str!("../../../modelDescription/fmi3/TruckRflMpc.xml")
);
