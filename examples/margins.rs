//! Margins of the default controllers by speed, calm and tight: `margins [NAME=VALUE,..]`.

use rfl_mpc::control::{
    ControllerParametersFor, LinearController, PredictionModelFor, SteeringLoop, VehicleParameters,
};
use rfl_mpc::nominal::LateralVehicle;
use rfl_mpc::simulate::{CAR_COLUMNS, SimulatedVehicle, TRUCK_COLUMNS};
use rfl_mpc::vehicle::{Car, Truck, VehicleParameters as File};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let settings = std::env::args().nth(1).unwrap_or_default();
    of::<Car, 4, CAR_COLUMNS>(&settings)?;
    of::<Truck, 6, TRUCK_COLUMNS>(&settings)
}

fn of<P: SimulatedVehicle<S, C>, const S: usize, const C: usize>(
    settings: &str,
) -> Result<(), Box<dyn Error>> {
    for name in P::Parameters::BUILTIN {
        let mut parameters: ControllerParametersFor<P::Nominal> =
            P::controller(&P::Parameters::builtin(name)?);
        for (name, value) in settings.split(',').filter_map(|text| text.split_once('=')) {
            parameters.set::<S>(name, value.parse()?)?;
        }
        let speeds = [3.0, 5.0, 8.0, 12.0, 18.0, 25.0, 35.0];
        for tightness in [0.0, 1.0] {
            let parameters =
                ControllerParametersFor { mpc: parameters.mpc.tightened(tightness), ..parameters };
            let actuator = parameters.actuator.actuator();
            let model = PredictionModelFor::Actuator(actuator);
            print!("{name} {tightness}:");
            for controller in LinearController::at_speeds(&parameters, model, &speeds)? {
                let vehicle = parameters.vehicle.nominal();
                let of = SteeringLoop::new(controller, vehicle, actuator, parameters.mpc.min_model_speed)?;
                match of.margins() {
                    Some(m) => print!("  {:.2}s {:.1}x {:.1}r/s", m.delay, m.gain, m.crossover),
                    None => print!("  unstable"),
                }
            }
            println!("  L={}", parameters.vehicle.nominal().wheelbase());
        }
    }
    Ok(())
}
