//! Drives a built-in car open loop: `drive_car CAR SPEED [effect.ID=VALUE ...] < in.csv > out.csv`.
//!
//! The input has the columns `time, steer_cmd, accel_cmd`; each row's commands hold until the next row's time. The
//! output has one row for each of the input, with what was measured then. `speed_gain=K` adds `K (SPEED - vx)` to the
//! acceleration command at each row, to hold the speed.

use rfl_mpc::vehicle::{Car, CarInput, CarParameters, Effects, builtin};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(name), Some(speed)) = (arguments.next(), arguments.next()) else {
        return Err("usage: drive_car CAR_OR_FILE SPEED [PARAMETER=VALUE ...] < in.csv > out.csv".into());
    };
    let mut parameters =
        if name.ends_with(".toml") { CarParameters::read(Path::new(&name))? } else { builtin(&name)? };
    let mut effects = Effects::default();
    let speed: f64 = speed.parse()?;
    let mut speed_gain = 0.0;
    for argument in arguments {
        let (key, value) = argument.split_once('=').ok_or(format!("{argument}: write PARAMETER=VALUE"))?;
        let value: f64 = value.parse()?;
        if key == "speed_gain" {
            speed_gain = value;
        } else if let Some(effect) = key.strip_prefix("effect.").and_then(|id| effects.get_mut(id)) {
            *effect = value;
        } else if let Some(parameter) = CarParameters::TABLE.iter().find(|parameter| parameter.name == key) {
            parameter.set(&mut parameters, value);
        } else {
            return Err(format!("there is no parameter {key}").into());
        }
    }
    let mut car = Car::new(&parameters, &effects, None)?;
    car.place(0.0, 0.0, 0.0, speed);

    let mut reader = csv::Reader::from_reader(std::io::stdin().lock());
    let mut writer = csv::Writer::from_writer(std::io::stdout().lock());
    writer.write_record([
        "time", "x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "steer", "roll", "pitch", "load_fl",
        "load_fr", "load_rl", "load_rr",
    ])?;
    let mut previous: Option<(f64, CarInput)> = None;
    for row in reader.deserialize() {
        let (time, steer_cmd, accel_cmd): (f64, f64, f64) = row?;
        if let Some((before, input)) = previous {
            car.step(&input, time - before)?;
        }
        let o = car.output();
        let accel_cmd = accel_cmd + speed_gain * (speed - o.vx);
        previous = Some((time, CarInput { steer_cmd, accel_cmd }));
        let mut values =
            vec![time, o.x, o.y, o.yaw, o.vx, o.vy, o.yaw_rate, o.ax, o.ay, o.steer, o.roll, o.pitch];
        values.extend(o.wheels.iter().map(|wheel| wheel.load));
        writer.write_record(values.iter().map(f64::to_string))?;
    }
    writer.flush()?;
    Ok(())
}
