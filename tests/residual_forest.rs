//! Forests: bootstrap, feature sampling, and the same bits on any number of threads.

use crate::residual_plant::{Plant, data};
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::{Block, Dense, ForestConfig, Kind, Resolution, TrainConfig, grow, train};

const CONFIG: ForestConfig = ForestConfig {
    trees: 12,
    depth: 5,
    min_leaf: 10,
    features_per_split: 3,
    bootstrap: Some(Block(1)),
    resolution: Resolution::Histogram(64),
    seed: 5,
    threads: 1,
};

fn example(rows: usize) -> (Vec<f64>, Vec<[f64; 1]>) {
    let mut random = Random::new(11);
    let values: Vec<f64> = (0..rows * 6).map(|_| random.uniform()).collect();
    let labels = values.chunks(6).map(|x| [x[0] + x[1] * x[2] + (5.0 * x[3]).sin()]).collect();
    (values, labels)
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let (values, labels) = example(3000);
    let grown = [1, 2, 5].map(|threads| {
        grow(
            &Dense::new(&values, 6),
            &[0, 1, 2, 3, 4, 5],
            &labels,
            &ForestConfig { threads, ..CONFIG },
            &|_| (),
        )
    });
    for other in &grown[1..] {
        assert_eq!(grown[0].forest, other.forest);
        assert_eq!(grown[0].in_bag, other.in_bag);
    }

    let plant = Plant { lag: 0.1, noise: 1.0, ..Plant::exact() };
    let samples = data(&plant, &[6.0, 10.0, 14.0], 1500, 1);
    for &kind in Kind::ALL {
        let bytes = [1, 2, 5].map(|threads| {
            let config = TrainConfig { trees: 6, depth: 4, threads, ..TrainConfig::new(kind) };
            let trained = train(&samples, Some(&samples), &config, &|_| ()).unwrap();
            (trained.model.to_bytes().unwrap(), format!("{:?}", trained.report))
        });
        assert!(bytes.iter().all(|other| *other == bytes[0]), "{kind:?}");
    }
}

#[test]
fn the_seed_changes_the_forest() {
    let (values, labels) = example(1000);
    let of = |seed| {
        let config = ForestConfig { seed, ..CONFIG };
        grow(&Dense::new(&values, 6), &[0, 1, 2, 3, 4, 5], &labels, &config, &|_| ()).forest
    };
    assert_eq!(of(5), of(5));
    assert_ne!(of(5), of(6));
}

#[test]
fn each_tree_draws_as_many_rows_as_there_are() {
    let rows = 2000;
    let (values, labels) = example(rows);
    let grown = grow(&Dense::new(&values, 6), &[0, 1, 2, 3, 4, 5], &labels, &CONFIG, &|_| ());
    assert_eq!(grown.in_bag.len(), 12);
    for (tree, bag) in grown.in_bag.iter().enumerate() {
        assert_eq!(bag.iter().map(|&w| usize::from(w)).sum::<usize>(), rows);
        let out = bag.iter().filter(|&&w| w == 0).count() as f64 / rows as f64;
        // (1 - 1/n)^n, with a standard deviation of about 0.011 for n = 2000.
        assert!((out - (-1.0_f64).exp()).abs() < 0.05, "tree {tree}: {out} out of bag");
        assert!(grown.in_bag[..tree].iter().all(|other| other != bag), "trees draw apart");
    }
}

#[test]
fn only_offered_features_are_split_on_and_sampling_varies_them() {
    let (values, labels) = example(2000);
    let firsts = |features_per_split| -> Vec<u16> {
        let config = ForestConfig { features_per_split, trees: 20, ..CONFIG };
        let forest = grow(&Dense::new(&values, 6), &[1, 3, 4], &labels, &config, &|_| ()).forest;
        for tree in 0..20 {
            assert!(forest.splits(tree).flatten().all(|(f, _)| [1, 3, 4].contains(&f)));
        }
        (0..20).map(|tree| forest.splits(tree).next().flatten().unwrap().0).collect()
    };
    assert!(firsts(3).iter().all(|&f| f == 3), "with all features the strongest comes first");
    let sampled = firsts(1);
    assert!([1, 3, 4].iter().all(|f| sampled.contains(f)), "{sampled:?}");
}

#[test]
fn blocks_are_drawn_whole() {
    let (values, labels) = example(1990);
    let config = ForestConfig { bootstrap: Some(Block(200)), ..CONFIG };
    let grown = grow(&Dense::new(&values, 6), &[0, 1, 2, 3, 4, 5], &labels, &config, &|_| ());
    for bag in &grown.in_bag {
        assert!(bag.chunks(200).all(|block| block.iter().all(|w| *w == block[0])));
        assert_eq!(bag.chunks(200).map(|block| block[0]).sum::<u16>(), 10);
    }
}
