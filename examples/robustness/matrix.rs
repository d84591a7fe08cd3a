//! The matrix: vehicles x actuators x roads x speed x friction x payload x noise, a sample of it by a fixed seed.
//!
//! Vehicles and roads go round, with periods that have no common factor; the rest is drawn. Road seeds begin at
//! [`FIRST_ROAD`]: the searches' are `2000 n + i` and `2000 n + 1000 + i` of the ensemble `n`, of which 1 was used.
//!
//! | row | controller |
//! |---|---|
//! | `default` | as the vehicle's file has it, default options |
//! | `told` | its actuator set to the vehicle's, as `rfl identify --into` does |
//! | `papers` | N = 16 and the weights of the papers' tables, nominal model |

use crate::{Arguments, map, shared};
use rfl_mpc::control::{ControllerFor, PredictionModelFor};
use rfl_mpc::numerics::Random;
use rfl_mpc::path::{Path, RandomRoad, Sample, sudoku::Route};
use rfl_mpc::simulate::experiment::Compared;
use rfl_mpc::simulate::{CAR_COLUMNS, ClosedLoopFor, TIME, TRUCK_COLUMNS};
use rfl_mpc::vehicle::{Car, Truck, VehicleParameters as _};
use serde_json::{Value, json};
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

/// Seed of what is drawn.
const SEED: u64 = 20_370_001;
/// Seed of the first random road.
const FIRST_ROAD: u64 = 900_001;
const RANDOM_ROADS: usize = 24;
/// Drives of a row.
pub const CARS: usize = 240;
pub const TRUCKS: usize = 96;
/// Error at which there is no more to see, m: beyond the lane, so that the drive counts as lost.
const ENOUGH: f64 = 4.0;
/// Time by which the steering is known, s.
const KNOWN: f64 = 20.0;

pub struct Road {
    pub name: String,
    pub path: Arc<Path>,
    /// Its file, or else its points.
    pub from: Result<PathBuf, Vec<Sample>>,
}

/// One drive of the matrix.
pub struct Case {
    pub id: String,
    pub vehicle: &'static str,
    pub road: usize,
    pub lag: f64,
    pub dead_time: f64,
    pub accel: f64,
    pub friction: f64,
    pub payload: f64,
    noise: f64,
    seed: u64,
    /// An effect beside these, and its value.
    pub unknown: Option<(&'static str, f64)>,
}

pub fn run(arguments: &Arguments) -> Result<Value, Box<dyn Error>> {
    let car = part::<Car, 4, CAR_COLUMNS>(arguments, CARS)?;
    let truck = part::<Truck, 6, TRUCK_COLUMNS>(arguments, TRUCKS)?;
    let drives: Vec<Value> = car.into_iter().chain(truck).collect();
    Ok(json!({
        "seed": SEED,
        "road_seeds": { "first": FIRST_ROAD, "count": RANDOM_ROADS, "search": "2000..2999 (training), 3000..3999 (held out)" },
        "drives": drives,
    }))
}

fn part<P: Compared<S, C>, const S: usize, const C: usize>(
    arguments: &Arguments,
    count: usize,
) -> Result<Vec<Value>, Box<dyn Error>> {
    let roads = roads::<P, S, C>()?;
    let count = if arguments.quick { count / 10 } else { count };
    let cases: Vec<Case> = (0..count)
        .map(|number| case::<P, S, C>(number, roads.len()))
        .filter(|case| arguments.only.as_ref().is_none_or(|only| *only == case.id))
        .collect();
    let rows = ["default", "told", "papers"];
    let drives = map(arguments.threads, P::KIND, cases.len() * rows.len(), |number| {
        let (case, row) = (&cases[number / rows.len()], rows[number % rows.len()]);
        match drive::<P, S, C>(case, &roads[case.road], row, arguments) {
            Ok(value) => value,
            Err(error) => json!({ "id": case.id, "row": row, "failed": error.to_string() }),
        }
    });
    if arguments.only.is_some() {
        drives.iter().for_each(|drive| println!("{drive:#}"));
    }
    Ok(drives)
}

pub fn roads<P: Compared<S, C>, const S: usize, const C: usize>() -> Result<Vec<Road>, Box<dyn Error>> {
    let truck = P::KIND == "truck";
    let mut roads = vec![];
    for name in ["tum_Norisring.csv", "tum_BrandsHatch.csv"] {
        if let Some(file) = shared(&format!("data/paths/{name}")) {
            roads.push(Road { name: name.to_owned(), path: Arc::new(Path::read(&file)?), from: Ok(file) });
        }
    }
    let mut routes = vec![if truck { Route::TruckTest } else { Route::SudokuTest }];
    // Its bends of 12 m are none for a semi-trailer.
    if !truck {
        routes.push(Route::HairpinCircuit);
    }
    for route in routes {
        let path = Arc::new(route.path()?);
        roads.push(Road { name: route.name().to_owned(), path, from: Err(route.samples()) });
    }
    let family = if truck { RandomRoad::TRUCK } else { RandomRoad::CAR };
    for number in 0..RANDOM_ROADS {
        // Longer than those of the search: what comes after the first seconds is to be seen.
        let family = RandomRoad { closed: number % 2 == 1, length: 1.5 * family.length, ..family };
        let seed = FIRST_ROAD + number as u64;
        let kind = if family.closed { "closed" } else { "open" };
        let path = Arc::new(family.path(seed)?);
        let name = format!("random {seed}, {kind}");
        roads.push(Road { name, path, from: Err(family.samples(seed)) });
    }
    Ok(roads)
}

pub fn case<P: Compared<S, C>, const S: usize, const C: usize>(number: usize, roads: usize) -> Case {
    let truck = P::KIND == "truck";
    let mut random = Random::stream(SEED + u64::from(truck), number as u64);
    let vehicles = P::Parameters::BUILTIN;
    let longest = (0.2, if truck { 0.3 } else { 0.12 });
    let kind = random.below(6);
    let drawn = (longest.0 * random.uniform(), longest.1 * random.uniform());
    let (lag, dead_time) = match kind {
        0 => (0.0, 0.0),
        1 => longest,
        2 => (0.0, longest.1),
        _ => drawn,
    };
    let mut coin = |heads: f64, tails: f64| if random.uniform() < 0.5 { heads } else { tails };
    Case {
        id: format!("{}-{number:03}", P::KIND),
        vehicle: vehicles[(number / roads + number) % vehicles.len()],
        road: number % roads,
        lag,
        dead_time,
        accel: if truck { 1.0 } else { coin(2.25, 4.0) },
        friction: coin(1.0, 0.6),
        payload: coin(0.0, if truck { 3000.0 } else { 300.0 }),
        noise: coin(0.0, 1.0),
        seed: SEED + number as u64,
        unknown: None,
    }
}

pub fn drive<P: Compared<S, C>, const S: usize, const C: usize>(
    case: &Case,
    road: &Road,
    row: &str,
    arguments: &Arguments,
) -> Result<Value, Box<dyn Error>> {
    let vehicle = P::Parameters::builtin(case.vehicle)?;
    let mut effects = vehicle.effects().clone();
    let mut effect = |id: &'static str, change: &dyn Fn(f64) -> f64| {
        let value = P::effect(&mut effects, id).ok_or(format!("a {} has no effect {id}", P::KIND))?;
        *value = change(*value);
        Ok::<f64, Box<dyn Error>>(*value)
    };
    if let Some((id, value)) = case.unknown {
        effect(id, &|_| value)?;
    }
    effect("road_friction", &|value| value * case.friction)?;
    effect("payload", &|value| value + case.payload)?;
    let steering = P::steering(&vehicle);
    let lag = steering.lag + effect("steer_lag", &|value| value + case.lag)?;
    let dead_time = steering.dead_time + effect("steer_delay", &|value| value + case.dead_time)?;
    let mut parameters =
        if row == "papers" { P::controller_of_the_papers(&vehicle) } else { P::controller(&vehicle) };
    parameters.speed.lateral_accel = case.accel;
    if row == "told" {
        (parameters.actuator.time_constant, parameters.actuator.dead_time) = (lag, dead_time);
    }
    let controller = match row {
        "papers" => {
            ControllerFor::predicting_with(parameters, road.path.clone(), PredictionModelFor::Nominal)?
        }
        _ => ControllerFor::new(parameters, road.path.clone())?,
    };
    let step = parameters.mpc.sample_time;
    let duration = 2.0 * controller.speed_plan().duration() + 30.0;
    let mut closed = ClosedLoopFor::<P, S, C>::at_start(controller, &vehicle, &effects, step)?;
    if case.noise > 0.0 {
        closed = closed.with_noise(P::SETTING.noise.scaled(case.noise), case.seed);
    }
    let drive = closed.record(duration, |_, error| error.abs() < ENOUGH);
    if arguments.only.is_some() {
        let file = arguments.out.join(format!("{}-{row}.csv", case.id));
        drive.write_csv(std::fs::File::create(file)?)?;
    }
    let errors = || drive.rows.iter().map(|row| row[TIME]).zip(&drive.lateral_errors);
    let worst = errors().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).map_or(0.0, |(time, _)| time);
    let after = errors().filter(|(time, _)| *time >= KNOWN).map(|(_, error)| error.abs());
    let after = after.fold(None, |most: Option<f64>, error| Some(most.unwrap_or(0.0).max(error)));
    let tracking = drive.tracking();
    let seconds = |name: &str| {
        let count = drive.statuses.iter().filter(|status| status.name() == name).count();
        count as f64 * step
    };
    let place = drive.ending.decided();
    Ok(json!({
        "id": case.id, "row": row, "kind": P::KIND, "vehicle": case.vehicle, "road": road.name,
        "road_length": road.path.length(), "lag": case.lag, "dead_time": case.dead_time, "lateral_accel": case.accel,
        "friction": case.friction, "payload": case.payload, "noise": case.noise,
        "unknown": case.unknown.map(|(id, value)| json!({ "effect": id, "value": value })),
        "outcome": drive.ending.outcome.name(), "reason": drive.ending.reason(), "time": place.time,
        "station": place.station, "duration": drive.duration(), "max": tracking.max, "max_at": worst, "mean": tracking.mae,
        "max_after_20_s": after, "slowed_s": seconds("slowed"), "far_s": seconds("far_from_path"),
        "safe_stop_s": seconds("safe_stop"), "bridged_s": seconds("bridged"),
    }))
}
