//! The FMU library of the car: [`PassengerCar`](rfl_mpc::fmu::PassengerCar) behind the C functions of FMI 2.0 and 3.0. It is
//! compiled once, and linked for each version with that version's functions (`linker.rs` of fmu-build).

rfl_mpc::export_fmi2!(rfl_mpc::fmu::PassengerCar, include_str!("../../../modelDescription/PassengerCar.xml"));
rfl_mpc::export_fmi3!(
    rfl_mpc::fmu::PassengerCar,
    include_str!("../../../modelDescription/fmi3/PassengerCar.xml")
);
