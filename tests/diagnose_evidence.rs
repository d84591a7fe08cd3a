//! Evidence is replayed, not promised: every candidate's cost is what a replay at its own values leaves, and whatever is free
//! besides, a candidate explains no less.

use crate::diagnose;

use rfl_mpc::diagnose::Library;
use rfl_mpc::diagnose::fit::{Fit, Prior};
use rfl_mpc::diagnose::problem::Problem;
use rfl_mpc::diagnose::rank::rank;
use rfl_mpc::diagnose::replay::{ReplayDrive, neutral};

/// Cost that a search may leave undone.
const UNDONE: f64 = 1.0;

fn holds(seed: u64, put_in: &[(&str, f64)]) {
    let (vehicle, log) = (diagnose::car(), diagnose::log(seed, put_in));
    let drive = ReplayDrive::new(&log, false);
    let correction = neutral(&drive, &vehicle).unwrap();
    let problem = Problem::new(&drive, &vehicle, &correction, Library::default(), 0);
    let prior = Prior::of(&problem);
    let ranking = rank(&problem, prior.clone(), &|_, _| true, &|_, _| {}).unwrap();
    let name = |fit: &Fit| fit.free.iter().map(|&i| problem.uncertain[i].id).collect::<Vec<_>>().join("+");

    let all = [&ranking.singles, &ranking.pairs, &ranking.triples].into_iter().flatten();
    for fit in all.chain([&ranking.none]) {
        let gap = problem.residual(&fit.x).unwrap();
        let penalty = prior.free(&problem, &fit.free).penalty(&prior.off(&fit.x));
        let replayed = ranking.linear.square(&gap) + penalty;
        let off = (fit.cost - replayed).abs() / replayed.max(1.0);
        assert!(
            off < 1e-6,
            "seed {seed}: {} claims {} where a replay leaves {replayed}",
            name(fit),
            fit.cost
        );
    }
    let mut less = &ranking.none;
    for more in [&ranking.singles, &ranking.pairs, &ranking.triples] {
        let Some(best) = more.first() else { continue };
        assert!(
            best.cost < less.cost + UNDONE,
            "seed {seed}: {} leaves {}, {} leaves {}",
            name(best),
            best.cost,
            name(less),
            less.cost
        );
        less = best;
    }
}

#[test]
fn of_a_sound_car() {
    holds(3, &[]);
}

#[test]
fn of_one_effect() {
    holds(4, &[("road_friction", 0.5)]);
}

#[test]
fn of_two_effects_with_a_load() {
    holds(5, &[("payload", 350.0), ("steer_delay", 0.1)]);
}
