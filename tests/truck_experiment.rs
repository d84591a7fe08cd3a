//! The truck's comparison: it runs, is the same on any number of threads, and calls a lost truck lost.

use rfl_mpc::control::{PredictionModelFor, TRUCK_STATES, TruckControllerParameters};
use rfl_mpc::nominal::DelayModel;
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::simulate::TRUCK_COLUMNS;
use rfl_mpc::simulate::experiment::{
    Compared, ComparisonFor, Condition, CostWeights, DriveMetrics, Effort, Predictor, Roads, SteeringStep,
    TRUCK_PLANTS, TableRow, TestPlant, TrialFor,
};
use rfl_mpc::vehicle::{Truck, TruckParameters, builtin_truck};
use std::sync::{Arc, LazyLock, Mutex};

static TRUCK: LazyLock<TruckParameters> = LazyLock::new(|| builtin_truck("truck_simulation").unwrap());

fn plant(name: &str) -> &'static TestPlant {
    TRUCK_PLANTS.iter().find(|plant| plant.name == name).unwrap()
}

/// The beginning of a road, so many metres.
fn beginning(route: Route, length: usize) -> Arc<Path> {
    Arc::new(Path::from_samples(route.samples()[..length].to_vec(), Closure::Open).unwrap())
}

fn road(length: usize) -> Arc<Path> {
    beginning(Route::TruckUTurn, length)
}

/// A short road for everything: a comparison in seconds.
fn short() -> Roads {
    let bend = road(170);
    Roads {
        train: bend.clone(),
        pieces: vec![bend.clone()],
        shaking: road(60),
        validation: vec![bend.clone()],
        test: bend.clone(),
        further: vec![(Route::TruckUTurn, bend)],
    }
}

const ROWS: [TableRow; 2] = [TableRow::plain(Predictor::Identified), TableRow::observing(Predictor::Linear)];

type TruckComparison<'a> = ComparisonFor<'a, Truck, TRUCK_STATES, TRUCK_COLUMNS>;

fn collected<'a>(name: &str, roads: &'a Roads, threads: usize) -> TruckComparison<'a> {
    let effort = Effort { seeds: 1, drives: 1, budget: 2, threads };
    TruckComparison::collect(&TRUCK, plant(name), None, roads, effort).unwrap()
}

#[test]
fn the_comparison_runs_and_does_not_depend_on_threads() {
    let roads = short();
    let run = |comparison: &TruckComparison<'_>| {
        let kept = Mutex::new(vec![]);
        let keep = |so_far: &Condition| kept.lock().unwrap().push(so_far.rows.len());
        let mut condition = comparison.run_keeping(&ROWS, None, &|_| (), &keep).unwrap();
        // Each row is there to be kept when it is done, the nominal MPC's first.
        assert_eq!(kept.into_inner().unwrap(), [1, 2, 3]);
        condition.effort.threads = 0;
        condition
    };
    let comparison = collected("high_delay", &roads, 1);
    let condition = run(&comparison);
    assert_eq!((condition.rows.len(), condition.left_out.len()), (1 + ROWS.len(), 0));
    assert_eq!(condition.rows[0].row, "MPC");
    for row in &condition.rows {
        assert_eq!(row.tried.len(), 2, "{}", row.row);
        assert!(row.tried.contains(&(row.weights, row.score)), "{}: the score is of other weights", row.row);
        let further = &row.further["truck_u_turn"][0];
        assert!(further == &row.own_best[0] && further.articulation.unwrap() > 0.1, "{}", row.row);
    }
    let row = |name: &str| condition.rows.iter().find(|row| row.row == name).unwrap();
    let fit = &row("linear+observer").fit[0];
    assert_eq!(fit.test.rmse.len(), TRUCK_STATES);
    // The second round was driven, and what was learned knows the actuator: a step at the speed of the bend.
    assert_eq!(condition.again_dithers, [0.01]);
    let step = &fit.steps["step_at_4"];
    assert!(step.rmse[3] < 0.2 * step.nominal_rmse[3], "{step:?}");
    let ahead = fit.test_horizon.as_ref().unwrap();
    assert!(ahead.rmse[0] < ahead.nominal_rmse[0]);
    // What knows the delay tracks better, each at its own best and where the nominal is at its edge.
    let outcome = |name: &str| row(name).own_best[0].clone();
    assert!(!outcome("identified").lost);
    assert!(outcome("identified").tracking.mae < 0.7 * outcome("MPC").tracking.mae);
    let best = [TableRow::NOMINAL, ROWS[0]].map(|of| (of, row(&of.name()).weights));
    let edges =
        [comparison.edge_of_weights(&best).unwrap(), comparison.edge_of_delay(&best).unwrap().unwrap()];
    for edge in &edges {
        assert!((0.0..=1.0).contains(&edge.share) && edge.rows.iter().all(|(_, outcome)| !outcome.lost));
    }
    assert!((edges[0].dead_time - 0.3).abs() < 1e-12, "{:?}", edges[0]);
    assert!((edges[1].dead_time - 0.3 * edges[1].share).abs() < 1e-12, "{:?}", edges[1]);

    let text = |condition: &Condition| serde_json::to_string(condition).unwrap();
    let again = collected("high_delay", &roads, 2);
    assert_eq!(text(&condition), text(&run(&again)));
    // A row that is run alone, later, is the same.
    let alone = again.run(&ROWS[..1], Some(condition.rows[0].weights), &|_| ()).unwrap();
    let row_text = |condition: &Condition, row: usize| serde_json::to_string(&condition.rows[row]).unwrap();
    assert_eq!(row_text(&condition, 1), row_text(&alone, 0));
}

#[test]
fn it_learns_a_gaussian_process_and_drives_with_it() {
    let roads = Roads { test: road(90), ..short() };
    let comparison = collected("low_delay", &roads, 2);
    let weights = CostWeights::of(&TruckControllerParameters::for_truck(&TRUCK).mpc);
    let row = TableRow::plain(Predictor::GpNmpc);
    assert!(comparison.has(row) && Truck::SETTING.rows.contains(&row));
    let drive = |row: TableRow| comparison.drive(row, &weights, &roads.test).unwrap();
    let (with, without) = (drive(row), drive(TableRow::plain(Predictor::Nmpc)));
    assert!(with.finished && !with.lost && with.column("steer_cmd") != without.column("steer_cmd"));
    assert!(with.tracking().mae < 0.1, "{:?}", with.tracking());
}

#[test]
fn a_recorded_step_tells_the_delay() {
    for (name, dead_time, time_constant) in [("low_delay", 0.04, 0.05), ("high_delay", 0.3, 0.2)] {
        let step = SteeringStep::record::<Truck, TRUCK_STATES, TRUCK_COLUMNS>(&TRUCK, plant(name), 0.02);
        let found = step.unwrap().identify(DelayModel::DeadTimeLag).unwrap().actuator;
        assert!((found.dead_time - dead_time).abs() < 0.01, "{name}: {found:?}");
        assert!((found.time_constant - time_constant).abs() < 0.02, "{name}: {found:?}");
    }
}

#[test]
fn a_lost_truck_is_reported_as_lost() {
    // Tight weights that know nothing of a long delay.
    let weights = CostWeights::of(&TruckControllerParameters::for_truck(&TRUCK).mpc);
    let trial = TrialFor::<Truck, TRUCK_STATES, TRUCK_COLUMNS> {
        vehicle: &TRUCK,
        plant: plant("high_delay"),
        path: beginning(Route::TruckTest, 600),
        model: PredictionModelFor::Nominal,
        weights: CostWeights { r_rate: 1e-3, ..weights },
        noise: None,
        give_up: f64::INFINITY,
        dither: None,
    };
    let drive = trial.drive().unwrap();
    let outcome = DriveMetrics::from(&drive);
    assert!(outcome.lost && !drive.finished && !drive.rows.is_empty());
    assert_eq!(Truck::SETTING.plants.len(), 2);
}
