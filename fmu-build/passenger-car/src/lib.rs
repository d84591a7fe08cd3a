//! The FMU library of the car: [`PassengerCar`](rfl_mpc::fmu::PassengerCar) behind the C functions of FMI 2.0.

rfl_mpc::export_fmi2!(rfl_mpc::fmu::PassengerCar, include_str!("../../../modelDescription/PassengerCar.xml"));
