//! The observer before the MPC, once its gains stand still.

use super::UNIT;
use super::complex::solve_shifted;
use crate::control::observer::{Observer, ObserverNoise};
use crate::control::variant::ExpectedState;
use nalgebra::{Complex, DMatrix, SMatrix, SVector};

/// Steps after which an observer's covariances stand still.
const SETTLED: usize = 3000;

/// A steady observer, and the prediction that it compares with.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearObserver<const S: usize> {
    /// Gain of the estimated state on a deviation from the prediction.
    pub of_state: SMatrix<f64, S, S>,
    /// Gain of the disturbance on it.
    pub of_disturbance: SMatrix<f64, S, S>,
    /// Effect `G` of the disturbance in a step.
    pub effect: SMatrix<f64, S, S>,
    /// Gain of the command on the disturbance.
    pub by_disturbance: SVector<f64, S>,
    /// The next state by the state of this step, the one before, ..
    pub next_by_state: Vec<SMatrix<f64, S, S>>,
    /// The next state by the command of this step, the one before, ..
    pub next_by_command: Vec<SVector<f64, S>>,
}

impl<const S: usize> LinearObserver<S> {
    /// `u` by way of the estimate: of a measured state, and of a command of 1.
    pub(super) fn response(
        &self,
        z_inverse: Complex<f64>,
        measured: &[Complex<f64>; S],
        gain: &SVector<f64, S>,
    ) -> [Complex<f64>; 2] {
        let complex = |value: f64| Complex::new(value, 0.0);
        let z = z_inverse.inv();
        // The disturbance sums the deviations x - p: d = M_d (x - p) z / (z - 1).
        let disturbance = self.of_disturbance.map(complex) * (1.0 - z_inverse).inv();
        let next = self.next_by_state[0].map(complex);
        let estimate = self.of_state.map(complex);
        let measured = SVector::from(*measured);
        // (z - N (I - M_x) + G M_d z / (z - 1)) p = (N M_x + G M_d z / (z - 1)) x + older states, or commands
        let by_deviation = next * estimate + self.effect.map(complex) * disturbance;
        let mut drive = by_deviation * measured;
        let mut delay = complex(1.0);
        for older in self.next_by_state.iter().skip(1) {
            delay *= z_inverse;
            drive += older.map(complex) * measured * delay;
        }
        let mut issued = SVector::zeros();
        let mut delay = complex(1.0);
        for gain in &self.next_by_command {
            issued += gain.map(complex) * delay;
            delay *= z_inverse;
        }
        let a = next - by_deviation;
        let predicted = |drive: SVector<Complex<f64>, S>| {
            SVector::from(solve_shifted::<S>(z, |i, j| a[(i, j)], drive.into()))
        };
        let command = |predicted: SVector<Complex<f64>, S>, measured: SVector<Complex<f64>, S>| {
            let deviation = measured - predicted;
            let state = predicted + estimate * deviation;
            (gain.map(complex).transpose() * state)[0]
                + (self.by_disturbance.map(complex).transpose() * disturbance * deviation)[0]
        };
        [command(predicted(drive), measured), command(predicted(issued), SVector::zeros())]
    }

    /// Writes the rows of `p` and `d` into the closed loop; `command` is the command as a row, and the places are those of the
    /// commands before, of the states before, and of `p` and `d`.
    pub(super) fn close(
        &self,
        closed: &mut DMatrix<f64>,
        command: &[f64],
        commands: usize,
        states: usize,
        [predicted, disturbance]: [usize; 2],
    ) {
        let by_deviation = self.next_by_state[0] * self.of_state + self.effect * self.of_disturbance;
        // A disturbance that nothing moves is no pole of the loop.
        let moved =
            SMatrix::from_fn(|i, j| f64::from(u8::from(i == j && self.of_disturbance.row(i).amax() > 0.0)));
        let mut write = |row: usize, column: usize, block: &SMatrix<f64, S, S>| {
            closed.view_mut((row, column), (S, S)).copy_from(block);
        };
        write(predicted, 0, &by_deviation);
        write(predicted, predicted, &(self.next_by_state[0] - by_deviation));
        write(predicted, disturbance, &self.effect);
        for (back, block) in self.next_by_state.iter().enumerate().skip(1) {
            write(predicted, states + S * (back - 1), block);
        }
        write(disturbance, 0, &self.of_disturbance);
        write(disturbance, predicted, &-self.of_disturbance);
        write(disturbance, disturbance, &moved);
        for i in 0..S {
            for (back, gain) in self.next_by_command.iter().enumerate().skip(1) {
                closed[(predicted + i, commands + back - 1)] += gain[i];
            }
            for (column, value) in command.iter().enumerate() {
                closed[(predicted + i, column)] += self.next_by_command[0][i] * value;
            }
        }
    }
}

/// Gains of the observer's state and of its disturbance on a deviation, once its covariances stand still.
pub(super) fn steady_gains<const S: usize>(
    noise: &ObserverNoise<S>,
    speed: f64,
    transition: &SMatrix<f64, S, S>,
) -> [SMatrix<f64, S, S>; 2] {
    let mut observer = Observer::default();
    let expected = ExpectedState { state: SVector::zeros(), transition: *transition };
    for _ in 0..SETTLED {
        observer.observe(&SVector::zeros(), speed, noise);
        observer.expect(expected);
    }
    let mut gains = [SMatrix::<f64, S, S>::zeros(); 2];
    for i in 0..S {
        let mut asked = observer.clone();
        let unit = SVector::from_fn(|j, _| if i == j { UNIT } else { 0.0 });
        gains[0].set_column(i, &(asked.observe(&unit, speed, noise) / UNIT));
        gains[1].set_column(i, &(asked.accelerations() / UNIT));
    }
    gains
}
