//! The FMU library of the truck: [`SemiTrailerTruck`](rfl_mpc::fmu::SemiTrailerTruck) behind the C functions of FMI 2.0.

rfl_mpc::export_fmi2!(
    rfl_mpc::fmu::SemiTrailerTruck,
    include_str!("../../../modelDescription/SemiTrailerTruck.xml")
);
