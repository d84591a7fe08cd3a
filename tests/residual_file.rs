//! The model's file: the same bits back, and nothing else is taken for a model.

use crate::residual_plant::{CONFIG, Plant, car, data};
use proptest::prelude::*;
use rfl_mpc::residual::{Expected, FileError, Kind, ModelMismatch, ResidualModel, TrainConfig, train};
use rfl_mpc::vehicle::SingleTrack;
use std::sync::OnceLock;

fn model(kind: Kind) -> ResidualModel {
    let samples = data(&Plant { lag: 0.1, noise: 1.0, ..Plant::exact() }, &[6.0, 10.0], 800, 1);
    let config = TrainConfig { trees: 3, depth: 3, window: 6, ..TrainConfig::new(kind) };
    train(&samples, None, &config, &|_| ()).unwrap().model
}

fn file() -> &'static [u8] {
    static FILE: OnceLock<Vec<u8>> = OnceLock::new();
    FILE.get_or_init(|| model(Kind::Rfl).to_bytes().unwrap())
}

fn sealed(head: &[u8], numbers: &[u8]) -> Vec<u8> {
    crate::sealed::sealed("rfl-residual", head, numbers)
}

fn parts() -> (Vec<u8>, Vec<u8>) {
    let (head, numbers) = crate::sealed::parts(file()).unwrap();
    (head.to_vec(), numbers.to_vec())
}

#[test]
fn every_kind_comes_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let none = ResidualModel::none(&car(), 0.02, 1.5, 16);
    for (kind, model) in Kind::ALL.iter().map(|&kind| (kind, model(kind))).chain([(Kind::None, none)]) {
        let path = folder.path().join(format!("{kind:?}.rfl"));
        model.write(&path).unwrap();
        let read = ResidualModel::read(&path).unwrap();
        assert_eq!(read, model, "{kind:?}");
        assert_eq!(read.to_bytes().unwrap(), model.to_bytes().unwrap(), "{kind:?}");
    }
}

#[test]
fn people_can_read_the_head() {
    let (head, _) = parts();
    let head = String::from_utf8(head).unwrap();
    for word in
        ["kind = \"rfl\"", "sample_time = 0.02", "window = 6", "data_hash", "vehicle_hash", "mass = 1400.0"]
    {
        assert!(head.contains(word), "{word} in {head}");
    }
    assert!(head.contains("name = \"e1_rate\"\nunit = \"m/s\"\nmin = "), "{head}");
}

#[test]
fn what_is_no_model_is_refused_with_the_reason() {
    let bytes = file();
    let refused = |bytes: &[u8]| ResidualModel::from_bytes(bytes).unwrap_err();
    assert!(matches!(refused(b""), FileError::NotAModel));
    assert!(matches!(refused(b"time,steer_cmd\n0,0\n"), FileError::NotAModel));
    assert!(matches!(refused(&bytes[..bytes.len() - 1]), FileError::Length { .. }));
    assert!(matches!(refused(&[bytes, b"x"].concat()), FileError::Length { .. }));
    assert!(matches!(refused(b"rfl-residual 2 1 1 0\nab"), FileError::Format { found: 2 }));
    assert!(matches!(refused(b"rfl-residual one"), FileError::FirstLine { .. }));
    let mut damaged = bytes.to_vec();
    *damaged.last_mut().unwrap() ^= 1;
    assert!(matches!(refused(&damaged), FileError::Checksum { .. }));

    let missing = ResidualModel::read(std::path::Path::new("no/such.rfl")).unwrap_err().to_string();
    assert!(missing.contains("no/such.rfl"), "{missing}");

    let (head, numbers) = parts();
    assert!(ResidualModel::from_bytes(&sealed(&head, &numbers)).is_ok());
    let edited = |from: &str, to: &str| {
        let head = String::from_utf8(head.clone()).unwrap();
        assert!(head.contains(from), "{from} in {head}");
        refused(&sealed(head.replacen(from, to, 1).as_bytes(), &numbers)).to_string()
    };
    assert!(edited("mass = 1400.0", "mass = 1500.0").contains("hash"));
    assert!(edited("window = 6", "window = 7").contains("contradicts itself"));
    assert!(edited("window = 6", "window = 0").contains("window"));
    assert!(edited("kind = \"rfl\"", "kind = \"linear\"").contains("has trees"));
    assert!(edited("kind = \"rfl\"", "kind = \"magic\"").contains("magic"));
    assert!(edited("sample_time = 0.02", "sample_time = nan").contains("sample time"));
    assert!(edited("sample_time", "sampling_time").contains("sample_time"));
}

#[test]
fn a_model_of_another_controller_is_refused_with_the_reason() {
    let model = model(Kind::Linear);
    let fits = Expected {
        vehicle: car(),
        sample_time: CONFIG.sample_time,
        min_model_speed: CONFIG.min_model_speed,
        window: None,
    };
    model.check_fits(&fits).unwrap();
    model.check_fits(&Expected { window: Some(6), ..fits }).unwrap();
    let heavier = Expected { vehicle: SingleTrack { mass: 1500.0, ..car() }, ..fits };
    let misfit = model.check_fits(&heavier).unwrap_err();
    assert_eq!(misfit, ModelMismatch::Vehicle { parameter: "mass", model: 1400.0, controller: 1500.0 });
    let misfit = model.check_fits(&Expected { sample_time: 0.05, ..fits }).unwrap_err();
    assert_eq!(misfit, ModelMismatch::SampleTime { model: 0.02, controller: 0.05 });
    let misfit = model.check_fits(&Expected { min_model_speed: 3.0, ..fits }).unwrap_err();
    assert_eq!(misfit, ModelMismatch::MinModelSpeed { model: 1.5, controller: 3.0 });
    let misfit = model.check_fits(&Expected { window: Some(16), ..fits }).unwrap_err();
    assert_eq!(misfit, ModelMismatch::Window { model: 6, controller: 16 });
}

#[test]
fn outside_the_training_range_the_model_says_so() {
    let model = model(Kind::Rfl);
    let range = &model.schema().ranges[0];
    let mut features = vec![0.0; model.features()];
    features[24..].copy_from_slice(&[8.0, 0.0, 0.0]);
    let mut room = model.workspace();
    model.coefficients(&features, &[0.0; 6], &mut room);
    assert!(!room.outside(), "{room:?}");
    // The newest lateral error: half a range beyond.
    features[20] = range.max + 0.5 * (range.max - range.min);
    model.coefficients(&features, &[0.0; 6], &mut room);
    assert!((room.excess - 0.5).abs() < 1e-12, "{room:?}");
    features[20] = f64::NAN;
    model.coefficients(&features, &[0.0; 6], &mut room);
    assert!(room.outside() && room.constant().iter().all(|x| x.is_finite()), "{room:?}");
    features[20] = 0.0;
    model.coefficients(&features, &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0], &mut room);
    assert!(room.excess == 0.0 && room.strange_leaves == 1.0, "no leaf saw such a command: {room:?}");
    let before = room.residual(&[0.1; 6], &[]);
    room.scale(0.5);
    let after = room.residual(&[0.1; 6], &[]);
    assert!((0..4).all(|o| (after[o] - 0.5 * before[o]).abs() < 1e-15));
}

/// Whatever is accepted can be asked anything.
fn never_panics(bytes: &[u8]) {
    if let Ok(model) = ResidualModel::from_bytes(bytes) {
        let mut room = model.workspace();
        for x in [0.0, 1e300, f64::NAN] {
            model.coefficients(&vec![x; model.features()], &[x], &mut room);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn foreign_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        never_panics(&bytes);
        never_panics(&[b"rfl-residual 1 ".as_slice(), &bytes].concat());
        let (head, _) = parts();
        never_panics(&sealed(&head, &bytes));
        never_panics(&sealed(&bytes, &bytes));
    }

    #[test]
    fn damaged_files_never_panic(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in any::<prop::sample::Index>(),
        cuts in any::<bool>(),
    ) {
        let mut plain = file().to_vec();
        let (mut head, mut numbers) = parts();
        let last = numbers.len() - 1;
        for (at, byte) in &changes {
            plain[at.index(file().len())] = *byte;
            numbers[at.index(last)] = *byte;
        }
        if cuts {
            plain.truncate(cut.index(plain.len()));
            numbers.truncate(cut.index(numbers.len()));
        }
        prop_assert!(plain == file() || ResidualModel::from_bytes(&plain).is_err());
        never_panics(&sealed(&head, &numbers));
        let at = changes[0].0.index(head.len());
        head[at] = changes[0].1;
        never_panics(&sealed(&head, &parts().1));
    }
}
