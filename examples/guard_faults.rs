//! Faults of measurements in the loop: what they do to a drive. `guard_faults [table|silence] [--off]`.

use rfl_mpc::control::{
    ControlStatus, Controller, ControllerParameters, Measurement, TruckController, TruckControllerParameters,
};
use rfl_mpc::path::Path;
use rfl_mpc::simulate::{ClosedLoop, SensorNoise, TruckClosedLoop};
use rfl_mpc::vehicle::{BUILTIN, BUILTIN_TRUCKS, Car, Effects, TruckEffects, builtin, builtin_truck};
use std::sync::Arc;

type Fault = fn(&mut Measurement, &Measurement, &Path);
const START: f64 = 3.0;

fn faults() -> Vec<(&'static str, f64, Fault)> {
    vec![
        ("yaw +0.2", 0.2, |m, _, _| m.yaw += 0.2),
        ("yaw rate 5", 0.2, |m, _, _| m.yaw_rate = 5.0),
        ("teleport 30 m", 0.2, |m, _, _| {
            m.x += 30.0 * (m.yaw + 1.57).cos();
            m.y += 30.0 * (m.yaw + 1.57).sin();
        }),
        ("frozen", 0.2, |m, before, _| *m = *before),
        ("nan", 0.2, |m, _, _| nan(m)),
        ("frozen", 2.0, |m, before, _| *m = *before),
        ("nan", 2.0, |m, _, _| nan(m)),
        ("vx = 0", 2.0, |m, _, _| m.vx = 0.0),
        ("end, one sample", 0.02, |m, _, path| {
            let e = path.at(path.length());
            (m.x, m.y, m.yaw) = (e.x, e.y, e.yaw);
        }),
        ("yaw +0.2", 2.0, |m, _, _| m.yaw += 0.2),
        ("yaw rate 5", 2.0, |m, _, _| m.yaw_rate = 5.0),
        ("vx = 0", 0.2, |m, _, _| m.vx = 0.0),
        ("vy + 3", 0.2, |m, _, _| m.vy += 3.0),
        ("yaw rate +.3", 0.2, |m, _, _| m.yaw_rate += 0.3),
        ("yaw rate +.14", 0.2, |m, _, _| m.yaw_rate += 0.14),
        ("vy +.15", 0.2, |m, _, _| m.vy += 0.15),
        ("y +.07", 0.2, |m, _, _| {
            m.y += 0.07;
            m.x += 0.07;
        }),
        ("yaw +.02", 0.2, |m, _, _| m.yaw += 0.02),
    ]
}
fn nan(m: &mut Measurement) {
    (m.x, m.y, m.yaw, m.vx, m.vy, m.yaw_rate) = (f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN);
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let off = args.iter().any(|a| a == "--off");
    if args[1] == "residual" {
        residual(&args[2..]);
    } else if args[1] == "table" {
        table(off, args.iter().any(|a| a == "--noise"));
    } else {
        silence(&args[2..]);
    }
}

fn table(off: bool, noise: bool) {
    let open = Arc::new(open_road());
    println!("{} m", open.length());
    for limit in [10.0, 30.0] {
        for (name, length, fault) in faults() {
            if std::env::var("WHAT").is_ok_and(|w| !name.contains(&w)) {
                continue;
            }
            let (mut worst, mut at, mut optimal, mut stopped, mut count, mut stops) =
                (0.0_f64, 0.0, 0, 0, 0, 0);
            let mut seen = std::collections::BTreeSet::new();
            for k in 0..24 {
                let station = 100.0 + 150.0 * f64::from(k);
                let car = builtin("c_class").unwrap();
                let mut p = ControllerParameters::for_car(&car);
                p.speed.limit = limit;
                settings(|n, v| p.set(n, v).unwrap());
                if off {
                    p.set("guard.active", 0.0).unwrap();
                    p.set("guard.lateral_jerk_max", 1e4).unwrap();
                }
                let controller = Controller::new(p, open.clone()).unwrap();
                let mut vehicle = Car::new(&car, &Effects::default(), Some(open.clone())).unwrap();
                let s = open.at(station);
                vehicle.place(s.x, s.y, s.yaw, controller.speed_plan().speed(station));
                let path = open.clone();
                let mut before = Measurement::default();
                let mut drive = ClosedLoop::new(controller, vehicle, 0.02).with_fault(move |time, m| {
                    if time >= START - 1e-9 && time < START + length - 1e-9 {
                        fault(m, &before, &path)
                    } else {
                        before = *m
                    }
                });
                if noise {
                    drive = drive.with_noise(SensorNoise::TYPICAL.scaled(2.0), k as u64 + 1);
                }
                count += 1;
                let mut error = 0.0_f64;
                let mut speed = 0.0;
                for step in 0..750 {
                    let time = 0.02 * f64::from(step);
                    match drive.advance() {
                        Ok((row, _)) => {
                            error = error.max(drive.lateral_error().abs());
                            speed = row[6];
                        }
                        Err(e) => {
                            if step < 3 {
                                println!("{e}");
                            }
                            error = 99.0;
                            break;
                        }
                    }
                    let report = drive.controller().report();
                    if time >= START - 1e-9 && time < START + length - 1e-9 {
                        optimal += u32::from(report.status == ControlStatus::Optimal);
                    }
                    seen.insert(report.status.name());
                    if report.finished {
                        break;
                    }
                }
                stops += u32::from(drive.controller().report().status == ControlStatus::SafeStop);
                stopped += u32::from(speed.abs() < 0.3);
                if error > worst {
                    (worst, at) = (error, station);
                }
            }
            println!(
                "{:>4} m/s {name:<16} {length:.2} s: max {worst:.3} m at {at}, optimal {optimal}, stopped {stopped} safe_stop {stops} of {count} {seen:?}",
                limit.min(26.6)
            );
        }
    }
}

/// BrandsHatch without its last metres: an open road.
fn open_road() -> Path {
    let text = std::fs::read_to_string("/work/shared/data/paths/tum_BrandsHatch.csv").unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let file = std::env::temp_dir().join("rfl_open_road.csv");
    std::fs::write(&file, lines[..lines.len() - 12].join("\n")).unwrap();
    Path::read(&file).unwrap()
}

fn silence(which: &[String]) {
    let roads: Vec<String> = which.iter().filter(|w| w.ends_with(".csv")).cloned().collect();
    for road in roads {
        let path = Arc::new(Path::read(std::path::Path::new(&road)).unwrap());
        let truck_road = road.contains("truck");
        for car in BUILTIN.iter().filter(|_| !truck_road) {
            let car = builtin(car).unwrap();
            for (what, effects, noise) in situations() {
                if std::env::var("WHAT").is_ok_and(|w| !what.contains(&w)) {
                    continue;
                }
                let mut p = ControllerParameters::for_car(&car);
                settings(|n, v| p.set(n, v).unwrap());
                let drive =
                    ClosedLoop::at_start(Controller::new(p, path.clone()).unwrap(), &car, &effects, 0.02)
                        .unwrap();
                let mut drive =
                    if noise > 0.0 { drive.with_noise(SensorNoise::TYPICAL.scaled(noise), 7) } else { drive };
                let name = format!("{road} {} {what}", car.name);
                count(&name, || {
                    let r = drive.advance();
                    let rep = *drive.controller().report();
                    (r.is_ok(), rep.status, rep.finished, drive.lateral_error())
                });
            }
        }
        for truck in BUILTIN_TRUCKS.iter().filter(|_| truck_road) {
            let truck = builtin_truck(truck).unwrap();
            for (what, effects, noise) in [
                ("plain", TruckEffects::default(), 0.0),
                ("noise", TruckEffects::default(), 2.0),
                (
                    "delay",
                    TruckEffects {
                        vehicle: Effects { steer_lag: 0.2, steer_delay: 0.12, ..Default::default() },
                        ..Default::default()
                    },
                    0.0,
                ),
            ] {
                let mut p = TruckControllerParameters::for_truck(&truck);
                settings(|n, v| p.set(n, v).unwrap());
                let drive = TruckClosedLoop::at_start(
                    TruckController::new(p, path.clone()).unwrap(),
                    &truck,
                    &effects,
                    0.02,
                )
                .unwrap();
                let mut drive = if noise > 0.0 {
                    drive.with_noise(SensorNoise::TYPICAL_TRUCK.scaled(noise), 7)
                } else {
                    drive
                };
                let name = format!("{road} {} {what}", truck.name);
                count(&name, || {
                    let r = drive.advance();
                    let rep = *drive.controller().report();
                    (r.is_ok(), rep.status, rep.finished, drive.lateral_error())
                });
            }
        }
    }
}

fn residual(files: &[String]) {
    use rfl_mpc::control::{Choice, ControlVariant, Propagation, RollOut};
    for road in files.iter().filter(|f| f.ends_with(".csv")) {
        let path = Arc::new(Path::read(std::path::Path::new(road)).unwrap());
        let car = builtin("c_class").unwrap();
        for file in files.iter().filter(|f| f.ends_with(".rflm") || *f == "nominal") {
            for (what, effects, noise) in situations() {
                if std::env::var("WHAT").is_ok_and(|w| !what.contains(&w)) {
                    continue;
                }
                let mut p = ControllerParameters::for_car(&car);
                settings(|n, v| p.set(n, v).unwrap());
                let file_of = (file != "nominal").then(|| file.into());
                let choice = Choice {
                    variant: ControlVariant::None,
                    file: file_of,
                    folder: "".into(),
                    propagation: Propagation::Propagated,
                    roll_out: RollOut::Corrected,
                };
                let (_, model) = choice.prediction_model(&p).unwrap();
                let drive = ClosedLoop::at_start(
                    Controller::predicting_with(p, path.clone(), model).unwrap(),
                    &car,
                    &effects,
                    0.02,
                )
                .unwrap();
                let mut drive =
                    if noise > 0.0 { drive.with_noise(SensorNoise::TYPICAL.scaled(noise), 7) } else { drive };
                count(&format!("{road} {file} {what}"), || {
                    let r = drive.advance();
                    let rep = *drive.controller().report();
                    (r.is_ok(), rep.status, rep.finished, drive.lateral_error())
                });
            }
        }
    }
}

fn settings(mut set: impl FnMut(&str, f64) -> bool) {
    for arg in std::env::args() {
        if let Some((name, value)) = arg.split_once('=') {
            assert!(set(name, value.parse().unwrap()));
        }
    }
}

fn situations() -> Vec<(&'static str, Effects, f64)> {
    let e = Effects::default;
    vec![
        ("plain", e(), 0.0),
        ("noise x2", e(), 2.0),
        ("friction 0.4", Effects { road_friction: 0.4, ..e() }, 0.0),
        ("lag .2 dead .12", Effects { steer_lag: 0.2, steer_delay: 0.12, ..e() }, 0.0),
        ("wind", Effects { wind_y: 15.0, ..e() }, 0.0),
        ("payload", Effects { payload: 300.0, payload_x: -1.0, ..e() }, 0.0),
    ]
}

fn count(name: &str, mut step: impl FnMut() -> (bool, ControlStatus, bool, f64)) {
    let mut statuses = std::collections::BTreeMap::<&str, (u32, u32)>::new();
    let (mut steps, mut max, mut ok) = (0, 0.0_f64, true);
    while steps < 15000 {
        let (fine, status, finished, error) = step();
        ok = fine;
        max = max.max(error.abs());
        let entry = statuses.entry(status.name()).or_insert((0, steps));
        entry.0 += 1;
        steps += 1;
        if !ok || finished || max > 3.5 {
            break;
        }
    }
    let odd: Vec<_> = statuses.iter().filter(|(n, _)| !matches!(**n, "optimal" | "finished")).collect();
    println!(
        "{}{name}: {steps} steps, max {max:.3}, {ok} {odd:?}",
        if odd.is_empty() { "      " } else { "ALARM " }
    );
}
