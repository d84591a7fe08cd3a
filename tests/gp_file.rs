//! The process's file: the same bits back, and nothing else is taken for a process.

use crate::gp_plant::{CONFIG, Known, Plant, car, data_of};
use proptest::prelude::*;
use rfl_mpc::residual::gp::{
    GpConfig, GpModel, GpModelFor, INPUTS, StateSmoothing, TRUCK_INPUTS, TruckGpModel, train,
};
use rfl_mpc::residual::{Expected, FileError, FileKind, ModelMismatch, ResidualModel};
use rfl_mpc::vehicle::SingleTrack;
use std::sync::OnceLock;

fn learned<V: Known<S, D, O>, const S: usize, const D: usize, const O: usize>() -> GpModelFor<V, D, O> {
    let config = GpConfig {
        friction: 0.9,
        smoothing: StateSmoothing::Fixed(2),
        points: 12,
        hyperparameter_samples: 100,
        starts: 1,
        iterations: 10,
        ..GpConfig::default()
    };
    let data = data_of::<V, S, D, O>(&Plant { lag: 0.1, noise: 1.0 }, 2, 300, 1);
    train(&data, None, &config, &|_| ()).unwrap().model
}

fn model() -> &'static GpModel {
    static MODEL: OnceLock<GpModel> = OnceLock::new();
    MODEL.get_or_init(learned)
}

fn truck_model() -> &'static TruckGpModel {
    static MODEL: OnceLock<TruckGpModel> = OnceLock::new();
    MODEL.get_or_init(learned)
}

pub fn file() -> &'static [u8] {
    static FILE: OnceLock<Vec<u8>> = OnceLock::new();
    FILE.get_or_init(|| model().to_bytes().unwrap())
}

fn sealed(head: &[u8], numbers: &[u8]) -> Vec<u8> {
    crate::sealed::sealed("rfl-gp", head, numbers)
}

fn parts() -> (Vec<u8>, Vec<u8>) {
    let (head, numbers) = crate::sealed::parts(file()).unwrap();
    (head.to_vec(), numbers.to_vec())
}

#[test]
fn it_comes_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gp.rflm");
    model().write(&path).unwrap();
    let read = GpModel::read(&path).unwrap();
    assert_eq!(&read, model());
    assert_eq!(read.to_bytes().unwrap(), file());
    let input = [9.0, 0.1, 0.2, 0.05, 0.3];
    assert_eq!(read.residual(&input), model().residual(&input));
    assert_eq!(read.variance(&input, &mut vec![]), model().variance(&input, &mut vec![]));

    let bytes = truck_model().to_bytes().unwrap();
    let read = TruckGpModel::from_bytes(&bytes).unwrap();
    assert_eq!((&read, read.to_bytes().unwrap()), (truck_model(), bytes));
    let input: [f64; TRUCK_INPUTS] = [9.0, 0.1, 0.2, 0.3, 0.01, 0.05, 0.3];
    assert_eq!(read.residual(&input), truck_model().residual(&input));
}

#[test]
fn a_process_of_another_kind_of_vehicle_is_refused() {
    let error = TruckGpModel::from_bytes(file()).unwrap_err().to_string();
    assert!(error.contains("a model for a car, and one for a truck is needed"), "{error}");
    let error = GpModel::from_bytes(&truck_model().to_bytes().unwrap()).unwrap_err();
    assert!(error.is_of_another_vehicle() && error.to_string().contains("one for a car"), "{error}");
}

#[test]
fn people_can_read_the_head() {
    let (head, _) = parts();
    let head = String::from_utf8(head).unwrap();
    for text in [
        "sample_time = 0.02",
        "friction = 0.9",
        "vehicle_hash",
        "mass = 1400.0",
        "data_hash",
        "length_scales",
        "noise",
        "name = \"steer_cmd\"\nunit = \"rad\"\nmin = ",
        "name = \"accel\"\nunit = \"m/s2\"\nmin = ",
        "name = \"yaw_rate\"\nunit = \"rad/s\"\nlength_scales = ",
    ] {
        assert!(head.contains(text), "{text} in {head}");
    }
}

#[test]
fn what_is_no_process_is_refused_with_the_reason() {
    let refused = |bytes: &[u8]| GpModel::from_bytes(bytes).unwrap_err();
    assert!(matches!(refused(b""), FileError::NotAModel));
    assert!(matches!(refused(b"time,steer_cmd\n0,0\n"), FileError::NotAModel));
    assert!(matches!(refused(&file()[..file().len() - 1]), FileError::Length { .. }));
    assert!(matches!(refused(b"rfl-gp 2 1 1 0\nab"), FileError::Format { found: 2 }));
    assert!(matches!(refused(b"rfl-gp one"), FileError::FirstLine { .. }));
    assert!(matches!(refused(b"rfl-gp"), FileError::FirstLine { .. }));
    let mut damaged = file().to_vec();
    *damaged.last_mut().unwrap() ^= 1;
    assert!(matches!(refused(&damaged), FileError::Checksum { .. }));

    let forest = ResidualModel::none(&car(), 0.02, 1.5, 16).to_bytes().unwrap();
    assert_eq!((FileKind::of(&forest), FileKind::of(file())), (Some(FileKind::Residual), Some(FileKind::Gp)));
    assert_eq!((FileKind::of(b"rfl-gpu 1"), FileKind::of(b"")), (None, None));
    let message = refused(&forest).to_string();
    assert!(message.contains("holds a residual") && message.contains("a Gaussian process"), "{message}");
    let message = ResidualModel::from_bytes(file()).unwrap_err().to_string();
    assert!(message.contains("holds a Gaussian process"), "{message}");

    let (head, numbers) = parts();
    assert!(GpModel::from_bytes(&sealed(&head, &numbers)).is_ok());
    let edited = |from: &str, to: &str| {
        let head = String::from_utf8(head.clone()).unwrap();
        assert!(head.contains(from), "{from} in {head}");
        refused(&sealed(head.replacen(from, to, 1).as_bytes(), &numbers)).to_string()
    };
    assert!(edited("mass = 1400.0", "mass = 1500.0").contains("hash"));
    assert!(edited("friction = 0.9", "friction = -0.9").contains("friction"));
    assert!(edited("sample_time = 0.02", "sample_time = nan").contains("sample time"));
    assert!(edited("min_model_speed = 1.5", "min_model_speed = 0.0").contains("speed"));
    assert!(edited("points = 12", "points = 13").contains("dictionary"));
    assert!(edited("name = \"accel\"", "name = \"bank\"").contains("its inputs"));
    assert!(
        edited("name = \"yaw_rate\"\nunit = \"rad/s\"\nlength", "name = \"steer\"\nunit = \"rad/s\"\nlength")
            .contains("outputs")
    );
    assert!(edited("length_scales = [", "length_scales = [1.0, ").contains("length scale"));
    assert!(edited("signal = ", "signal = -").contains("hyperparameter"));
    assert!(edited("sample_time", "sampling_time").contains("sample_time"));
    assert!(
        refused(&sealed(&head, &[&numbers[..], &[0]].concat())).to_string().contains("more numbers"),
        "bytes behind the last number"
    );
}

#[test]
fn a_process_of_another_controller_is_refused_with_the_reason() {
    let fits = Expected {
        vehicle: car(),
        sample_time: CONFIG.sample_time,
        min_model_speed: CONFIG.min_model_speed,
        window: None,
    };
    let check = |expected: Expected| model().check_fits(&expected, 0.9).unwrap_err();
    model().check_fits(&fits, 0.9).unwrap();
    let heavier = SingleTrack { mass: 1500.0, ..car() };
    assert_eq!(
        check(Expected { vehicle: heavier, ..fits }),
        ModelMismatch::Vehicle { parameter: "mass", model: 1400.0, controller: 1500.0 }
    );
    assert_eq!(
        check(Expected { sample_time: 0.05, ..fits }),
        ModelMismatch::SampleTime { model: 0.02, controller: 0.05 }
    );
    assert_eq!(
        check(Expected { min_model_speed: 3.0, ..fits }),
        ModelMismatch::MinModelSpeed { model: 1.5, controller: 3.0 }
    );
    let misfit = model().check_fits(&fits, 1.0).unwrap_err();
    assert_eq!(misfit, ModelMismatch::Friction { model: 0.9, controller: 1.0 });
}

/// Whatever is accepted can be asked anything.
fn never_panics(bytes: &[u8]) {
    if let Ok(model) = GpModel::from_bytes(bytes) {
        let mut room = vec![];
        for x in [0.0, 1e300, f64::NAN] {
            let _ = model.residual(&[x; INPUTS]);
            model.variance(&[x; INPUTS], &mut room);
            let _ = model.excess(&[x; INPUTS]);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn foreign_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        never_panics(&bytes);
        never_panics(&[b"rfl-gp 1 ".as_slice(), &bytes].concat());
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
        prop_assert!(plain == file() || GpModel::from_bytes(&plain).is_err());
        never_panics(&sealed(&head, &numbers));
        let at = changes[0].0.index(head.len());
        head[at] = changes[0].1;
        never_panics(&sealed(&head, &parts().1));
    }
}
