//! The room for coefficients remembers the last leaves: that changes no bit, and a room belongs to its model.

use crate::residual_plant::{Plant, data};
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::{
    Coefficients, DataSet, Kind, LambdaChoice, Regressors, ResidualModel, TrainConfig, train,
};

fn samples() -> DataSet {
    data(&Plant { lag: 0.1, noise: 1.0, ..Plant::exact() }, &[6.0, 10.0, 14.0], 700, 1)
}

fn model(samples: &DataSet, kind: Kind) -> ResidualModel {
    let regressors = Regressors { road: true, states: 2 };
    let lambda = LambdaChoice::Fixed(1e-3);
    let config =
        TrainConfig { trees: 11, depth: 4, min_leaf: 20, regressors, lambda, ..TrainConfig::new(kind) };
    train(samples, None, &config, &|_| ()).unwrap().model
}

fn bits(room: &Coefficients) -> Vec<u64> {
    let known = [room.constant()];
    let all = known.iter().chain(room.command()).chain(room.state()).flatten();
    all.chain([&room.excess, &room.strange_leaves]).map(|x| x.to_bits()).collect()
}

fn leaves(model: &ResidualModel, features: &[f64]) -> Vec<usize> {
    let mut found = vec![];
    model.forest().look_up(features, |_, leaf| found.push(leaf));
    found
}

#[test]
fn a_used_room_gives_the_bits_of_a_fresh_one() {
    let samples = samples();
    let windows = samples.windows(16);
    for &kind in Kind::ALL {
        let model = model(&samples, kind);
        let mut random = Random::new(3);
        let mut used = model.workspace();
        let mut features = vec![0.0; model.features()];
        let mut last = vec![];
        let (mut same, mut other, mut strange) = (0, 0, 0);
        for call in 0..2000 {
            // Mostly a step further, in between somewhere else, and now and then what no data had.
            match random.below(8) {
                0 => windows.features(random.below(windows.len() as u32) as usize, &mut features),
                1 => features[random.below(67) as usize] = 10.0 * random.uniform() - 5.0,
                2 => features[random.below(67) as usize] = f64::NAN,
                _ => features.iter_mut().for_each(|x| *x += 1e-5 * (random.uniform() - 0.5)),
            }
            if random.below(4) == 0 {
                windows.features(random.below(windows.len() as u32) as usize, &mut features);
            }
            // The commands decide alone whether leaves know the like, whatever was asked before.
            let width = [0.0, 0.02, 0.1, 1.0][random.below(4) as usize];
            let commands: Vec<f64> = (0..16).map(|_| width * (random.uniform() - 0.5)).collect();
            model.coefficients(&features, &commands, &mut used);
            let mut fresh = model.workspace();
            model.coefficients(&features, &commands, &mut fresh);
            assert_eq!(bits(&used), bits(&fresh), "{kind:?}, call {call}");
            strange += usize::from(used.strange_leaves > 0.0);

            let now = leaves(&model, &features);
            *(if now == last { &mut same } else { &mut other }) += 1;
            last = now;
            // What the controller does with what it was given must not stay.
            if random.below(2) == 0 {
                used.scale(random.uniform());
            }
        }
        assert!(same > 300, "{kind:?}: the same leaves {same} times");
        assert!(other > if kind.has_trees() { 300 } else { 0 }, "{kind:?}: other leaves {other} times");
        assert!(kind == Kind::None || (200..1800).contains(&strange), "{kind:?}: strange {strange} times");
    }
}

#[test]
#[should_panic(expected = "room of another model")]
fn a_room_of_another_model_of_the_same_shape_is_refused() {
    let samples = samples();
    let [mine, other] = [Kind::Rfl, Kind::Rfl].map(|kind| model(&samples, kind));
    mine.coefficients(&vec![0.0; mine.features()], &[], &mut other.workspace());
}

#[test]
fn a_room_is_good_for_a_copy_of_its_model() {
    let samples = samples();
    let model = model(&samples, Kind::Rfl);
    let (mut room, mut fresh) = (model.workspace(), model.workspace());
    let features = vec![0.0; model.features()];
    model.clone().coefficients(&features, &[], &mut room);
    model.coefficients(&features, &[], &mut fresh);
    assert_eq!(bits(&room), bits(&fresh));
}
