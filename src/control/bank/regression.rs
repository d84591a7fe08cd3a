//! The regression of the yaw acceleration: what the rates alone explain, and what an angle explains beside them.

/// Regressors of the yaw acceleration beside the angle: 1, r/v, vy/v, and of a truck its articulation and the rate of it.
pub(super) const BESIDE: usize = 5;
/// A variance that is none.
pub(super) const TINY: f64 = 1e-18;

/// The regression of the yaw acceleration on all but the angle, by Cholesky factors of the ridged normal matrix.
pub(super) struct Rest {
    pub weight: f64,
    factor: [[f64; BESIDE]; BESIDE],
    /// `L^-1` times the products with the yaw acceleration, and the remainder of its square.
    of_accel: [f64; BESIDE],
    left: f64,
}

impl Rest {
    /// From the products of the regressors and the yaw acceleration; none without samples.
    pub fn of(common: &[[f64; BESIDE + 1]; BESIDE + 1]) -> Option<Self> {
        let weight = common[0][0];
        if weight <= 0.0 {
            return None;
        }
        let mut factor = [[0.0; BESIDE]; BESIDE];
        for i in 0..BESIDE {
            for j in 0..=i {
                let inner: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
                let value = common[i][j] - inner;
                factor[i][j] = if i == j {
                    // What does not move, as a car's articulation, drops out.
                    (value + 1e-9 * common[i][i] + 1e-9 * weight).sqrt()
                } else {
                    value / factor[j][j]
                };
            }
        }
        let of_accel = lower(&factor, &common[BESIDE][..BESIDE]);
        let left = common[BESIDE][BESIDE] - of_accel.iter().map(|x| x * x).sum::<f64>();
        Some(Self { weight, factor, of_accel, left })
    }

    /// Mean squared residual with an angle among the regressors.
    pub fn variance(&self, products: &[f64; BESIDE + 2]) -> f64 {
        let of_angle = lower(&self.factor, &products[..BESIDE]);
        let own = products[BESIDE + 1] - of_angle.iter().map(|x| x * x).sum::<f64>();
        let both = products[BESIDE] - of_angle.iter().zip(&self.of_accel).map(|(a, b)| a * b).sum::<f64>();
        let explained = if own > TINY * self.weight { both * both / own } else { 0.0 };
        ((self.left - explained) / self.weight).max(0.0)
    }
}

/// `L^-1 x`.
fn lower(factor: &[[f64; BESIDE]; BESIDE], x: &[f64]) -> [f64; BESIDE] {
    let mut solved = [0.0; BESIDE];
    for i in 0..BESIDE {
        let inner: f64 = (0..i).map(|k| factor[i][k] * solved[k]).sum();
        solved[i] = (x[i] - inner) / factor[i][i];
    }
    solved
}
