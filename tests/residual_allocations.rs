//! The controller asks the residual at each step of the horizon: that allocates nothing.

use crate::counting::allocated;
use crate::residual_plant::{Plant, data};
use rfl_mpc::residual::gp::{self, GpConfig, StateSmoothing};
use rfl_mpc::residual::{Kind, Regressors, TrainConfig, train};

#[test]
fn coefficients_allocate_nothing() {
    let samples = data(&Plant { lag: 0.1, ..Plant::exact() }, &[6.0, 10.0], 800, 1);
    let windows = samples.windows(16);
    for &kind in Kind::ALL {
        let regressors = Regressors { road: true, states: 2 };
        let config = TrainConfig { trees: 6, depth: 4, regressors, ..TrainConfig::new(kind) };
        let model = train(&samples, None, &config, &|_| ()).unwrap().model;
        let mut features = vec![0.0; model.features()];
        let mut room = model.workspace();
        let (count, _) = allocated(|| {
            for sample in 0..100 {
                windows.features(sample, &mut features);
                model.coefficients(&features, windows.commands(sample), &mut room);
                std::hint::black_box(room.residual(windows.commands(sample), &[0.0; 8]));
            }
        });
        assert_eq!(count, 0, "{kind:?}");
    }
}

#[test]
fn the_gaussian_process_allocates_nothing() {
    let samples = data(&Plant { lag: 0.1, ..Plant::exact() }, &[6.0, 10.0], 300, 1);
    let config = GpConfig {
        smoothing: StateSmoothing::Fixed(0),
        points: 30,
        hyperparameter_samples: 80,
        iterations: 5,
        ..GpConfig::default()
    };
    let model = gp::train(&samples, None, &config, &|_| ()).unwrap().model;
    let mut room = vec![];
    model.variance(&[0.0; 5], &mut room);
    let (count, _) = allocated(|| {
        for step in 0..100 {
            let input = [6.0, 0.01 * f64::from(step), 0.1, 0.05, 0.0];
            std::hint::black_box((model.residual(&input), model.excess(&input)));
            std::hint::black_box(model.variance(&input, &mut room));
        }
    });
    assert_eq!(count, 0);
}
