//! A horizon that keeps what it looked up gives the bits of a look-up from nothing, wherever it moves.

use crate::counting::allocated;
use crate::residual_plant::{Plant, data};
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::{
    Coefficients, DataSet, Kind, LambdaChoice, Lookahead, LookedUp, Regressors, ResidualModel, TrainConfig,
    TreeFeatures, train,
};

const WINDOW: usize = 12;
const HORIZON: usize = 7;

type State = [f64; 4];

fn samples() -> DataSet {
    data(&Plant { lag: 0.1, noise: 1.0, ..Plant::exact() }, &[6.0, 10.0, 14.0], 700, 1)
}

fn model(samples: &DataSet, kind: Kind, regressors: Regressors, features: TreeFeatures) -> ResidualModel {
    let lambda = LambdaChoice::Fixed(1e-3);
    let config = TrainConfig {
        window: WINDOW,
        trees: 11,
        depth: 5,
        min_leaf: 20,
        regressors,
        lambda,
        tree_features: features,
        ..TrainConfig::new(kind)
    };
    train(samples, None, &config, &|_| ()).unwrap().model
}

/// Every kind; RFL with all features and regressors, too.
fn models(samples: &DataSet) -> Vec<(Kind, ResidualModel)> {
    let plain = |kind| {
        let defaults = TrainConfig::new(kind);
        (kind, model(samples, kind, defaults.regressors, defaults.tree_features))
    };
    let all = Regressors { road: true, states: 2 };
    let whole = (Kind::Rfl, model(samples, Kind::Rfl, all, TreeFeatures::ErrorsAndRoad));
    Kind::ALL.iter().map(|&kind| plain(kind)).chain([whole]).collect()
}

fn bits<'a>(values: impl IntoIterator<Item = &'a f64>) -> Vec<u64> {
    values.into_iter().map(|x| x.to_bits()).collect()
}

/// Whether a row is what the model's coefficients are for its window.
fn assert_same(row: &LookedUp<'_, 4>, fresh: &Coefficients, what: &str) {
    assert_eq!(bits(&row.constant), bits(&fresh.constant()), "{what}: constant");
    assert_eq!(row.excess.to_bits(), fresh.excess.to_bits(), "{what}: excess");
    for (name, of_row, of_fresh) in
        [("command", row.command, fresh.command()), ("state", row.state, fresh.state())]
    {
        match of_row.is_empty() {
            true => assert!(of_fresh.iter().flatten().all(|&x| x == 0.0), "{what}: {name}"),
            false => {
                assert_eq!(bits(of_row.iter().flatten()), bits(of_fresh.iter().flatten()), "{what}: {name}")
            }
        }
    }
}

/// What the horizon is told.
struct World {
    states: Vec<State>,
    road: Vec<[f64; 3]>,
}

impl World {
    /// Tells the rows one after the other, as a roll-out does, and compares each; gives how many had other leaves.
    fn tell(&self, model: &ResidualModel, rows: &mut Lookahead<4>, what: &str) -> usize {
        let mut renewed = 0;
        for (place, state) in self.states[..WINDOW].iter().enumerate() {
            rows.set_state(place, state);
        }
        for j in 0..HORIZON {
            if j > 0 {
                rows.set_state(j + WINDOW - 1, &self.states[j + WINDOW - 1]);
            }
            let window = self.states[j..j + WINDOW].iter().flatten();
            let features: Vec<f64> = window.chain(&self.road[j]).copied().collect();
            let mut fresh = model.workspace();
            model.coefficients(&features, &[], &mut fresh);
            let row = model.row(rows, j, &self.road[j]);
            assert_same(&row, &fresh, &format!("{what}, row {j}"));
            renewed += usize::from(row.renewed);
        }
        renewed
    }
}

#[test]
fn a_kept_horizon_gives_the_bits_of_a_fresh_look_up() {
    let samples = samples();
    let windows = samples.windows(WINDOW);
    for (kind, model) in models(&samples) {
        let mut random = Random::new(5);
        let mut rows = model.lookahead(HORIZON);
        let mut features = vec![0.0; model.features()];
        let (mut at, mut renewed, mut asked) = (0, 0, 0);
        for step in 0..1500 {
            let mut world = World { states: vec![], road: vec![] };
            for j in 0..WINDOW + HORIZON - 1 {
                windows.features((at + j) % windows.len(), &mut features);
                world.states.push(std::array::from_fn(|o| features[o]));
                world.road.push(std::array::from_fn(|r| features[4 * WINDOW + r]));
            }
            // Predictions miss by a little.
            for state in &mut world.states[WINDOW..] {
                state.iter_mut().for_each(|x| *x *= 1.0 + 0.05 * (random.uniform() - 0.5));
            }
            match random.below(12) {
                0 => world.states[random.below(18) as usize][random.below(4) as usize] = f64::NAN,
                1 => world.states[random.below(18) as usize][random.below(4) as usize] = f64::INFINITY,
                2 => world.road[random.below(7) as usize][random.below(3) as usize] = f64::NAN,
                3 => world.states[random.below(18) as usize] = [-0.0; 4],
                _ => (),
            }
            // Mostly a step further; sometimes the same again, sometimes without a word, sometimes somewhere else.
            match random.below(10) {
                0 => (),
                1 => at = random.below(windows.len() as u32) as usize,
                2 => rows.advance(),
                _ => {
                    at += 1;
                    rows.advance();
                }
            }
            renewed += world.tell(&model, &mut rows, &format!("{kind:?}, step {step}"));
            asked += HORIZON;
        }
        let share = renewed as f64 / asked as f64;
        if kind.has_trees() {
            assert!((0.05..0.9).contains(&share), "{kind:?}: {share} of the rows had other leaves");
        }
    }
}

#[test]
fn rows_allocate_nothing() {
    let samples = samples();
    let windows = samples.windows(WINDOW);
    for (kind, model) in models(&samples) {
        let mut rows = model.lookahead(HORIZON);
        let mut features = vec![0.0; model.features()];
        let (count, _) = allocated(|| {
            for step in 0..300 {
                rows.advance();
                windows.features(step, &mut features);
                for place in 0..WINDOW {
                    rows.set_state(place, &std::array::from_fn(|o| features[4 * place + o]));
                }
                for j in 0..HORIZON {
                    std::hint::black_box(model.row(&mut rows, j, &[8.0, 0.01, 0.0]));
                    let last = j + WINDOW - 1;
                    rows.set_state(last, &std::array::from_fn(|o| features[o]));
                }
            }
        });
        assert_eq!(count, 0, "{kind:?}");
    }
}

#[test]
#[should_panic(expected = "room of another model")]
fn rows_of_another_model_are_refused() {
    let samples = samples();
    let [(_, mine), (_, other)] = [Kind::Rfl, Kind::Rfl]
        .map(|kind| (kind, model(&samples, kind, Regressors::default(), TreeFeatures::Errors)));
    mine.row(&mut other.lookahead(HORIZON), 0, &[8.0, 0.0, 0.0]);
}
