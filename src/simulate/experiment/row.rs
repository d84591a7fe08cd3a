//! The rows of the comparison: each a way to predict, with or without the disturbance observer.

use crate::enumeration;
use crate::nominal::DelayModel;
use crate::residual::{Kind, Regressors, TrainConfig};

enumeration! {
    /// Ways to predict.
    pub enum Predictor {
        Mpc = 0 "MPC", "The nominal MPC";
        Rt = 1 "RT", "A tree with constant leaves (Zhao et al.)";
        Rtl = 2 "RTL", "A tree with linear leaves (Zhao et al.)";
        Rf = 3 "RF", "A forest with constant leaves (Zhao et al.)";
        Rfl = 4 "RFL", "A forest with linear leaves (Zhao et al.)";
        Linear = 5 "linear", "One linear model in the command window";
        LinearCurvature = 6 "linear_curvature", "One linear model in the command window and the road: the regressors of RFL+S";
        RflS = 7 "RFL+S", "A forest on speed and road, leaves linear in the command window and the road";
        FirstOrder = 8 "first_order", "The nominal MPC behind a first-order inertia, identified from a recorded step";
        Pade11 = 9 "pade_1_1", "The nominal MPC behind a Pade approximant (1, 1), identified from a recorded step";
        Pade22 = 10 "pade_2_2", "The nominal MPC behind a Pade approximant (2, 2), identified from a recorded step";
        Identified = 11 "identified", "The nominal MPC behind dead time and lag, identified from a recorded step";
        Nmpc = 12 "NMPC", "Nonlinear MPC";
        GpNmpc = 13 "GP-NMPC", "Nonlinear MPC with Gaussian processes for what its model misses";
        Oracle = 14 "oracle", "The nominal MPC that knows the steering actuator exactly";
    }
}

impl Predictor {
    /// Training for it, if anything is learned, with a window of so many steps.
    #[must_use]
    pub fn training(self, window: usize) -> Option<TrainConfig> {
        let kind = match self {
            Self::Rt => Kind::Rt,
            Self::Rtl => Kind::Rtl,
            Self::Rf => Kind::Rf,
            Self::Rfl => Kind::Rfl,
            Self::Linear | Self::LinearCurvature => Kind::Linear,
            Self::RflS => Kind::RflS,
            _ => return None,
        };
        let mut config = TrainConfig::new(kind);
        config.window = window;
        if self == Self::LinearCurvature {
            config.regressors = Regressors { road: true, states: 0 };
            // The filter worsens this row: steering and road, nearly collinear, differ in what it takes away. Measured
            // at the same weights, mean lateral error without and with noise: 7.2 and 2.3 mm, filtered 13.6 and 4.4 mm.
            config.prefilter = 0.0;
        }
        Some(config)
    }

    /// True if something is learned from drives.
    #[must_use]
    pub fn learns(self) -> bool {
        matches!(
            self,
            Self::Rt
                | Self::Rtl
                | Self::Rf
                | Self::Rfl
                | Self::Linear
                | Self::LinearCurvature
                | Self::RflS
                | Self::GpNmpc
        )
    }

    /// The model of the actuator that a recorded step gives it.
    #[must_use]
    pub fn delay_model(self) -> Option<DelayModel> {
        match self {
            Self::FirstOrder => Some(DelayModel::FirstOrder),
            Self::Pade11 => Some(DelayModel::Pade11),
            Self::Pade22 => Some(DelayModel::Pade22),
            Self::Identified => Some(DelayModel::DeadTimeLag),
            _ => None,
        }
    }

    /// True if it has a nonlinear model.
    #[must_use]
    pub fn is_nonlinear(self) -> bool {
        matches!(self, Self::Nmpc | Self::GpNmpc)
    }
}

/// A row of the tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TableRow {
    /// The way to predict.
    pub predictor: Predictor,
    /// True if the disturbance observer runs.
    pub observes: bool,
}

impl TableRow {
    /// The nominal MPC: every other is measured by it.
    pub const NOMINAL: Self = Self::plain(Predictor::Mpc);

    /// A row without observer.
    #[must_use]
    pub const fn plain(predictor: Predictor) -> Self {
        Self { predictor, observes: false }
    }

    /// The same with the observer.
    #[must_use]
    pub const fn observing(predictor: Predictor) -> Self {
        Self { predictor, observes: true }
    }

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> String {
        format!("{}{}", self.predictor.name(), if self.observes { "+observer" } else { "" })
    }
}

/// The car's rows; the slowest at the end.
pub const CAR_ROWS: &[TableRow] = &[
    TableRow::NOMINAL,
    TableRow::plain(Predictor::Rt),
    TableRow::plain(Predictor::Rtl),
    TableRow::plain(Predictor::Rf),
    TableRow::plain(Predictor::Rfl),
    TableRow::plain(Predictor::Linear),
    TableRow::plain(Predictor::LinearCurvature),
    TableRow::plain(Predictor::RflS),
    TableRow::observing(Predictor::RflS),
    TableRow::observing(Predictor::Mpc),
    TableRow::plain(Predictor::Nmpc),
    TableRow::plain(Predictor::GpNmpc),
    TableRow::plain(Predictor::Oracle),
];

/// The truck's rows: all delay models and residuals, without and with the observer; the slowest at the end.
pub const TRUCK_ROWS: &[TableRow] = &[
    TableRow::NOMINAL,
    TableRow::plain(Predictor::FirstOrder),
    TableRow::plain(Predictor::Pade11),
    TableRow::plain(Predictor::Pade22),
    TableRow::plain(Predictor::Identified),
    TableRow::plain(Predictor::Oracle),
    TableRow::plain(Predictor::Rt),
    TableRow::plain(Predictor::Rf),
    TableRow::plain(Predictor::Linear),
    TableRow::plain(Predictor::Rtl),
    TableRow::plain(Predictor::Rfl),
    TableRow::plain(Predictor::RflS),
    TableRow::observing(Predictor::Mpc),
    TableRow::observing(Predictor::FirstOrder),
    TableRow::observing(Predictor::Pade11),
    TableRow::observing(Predictor::Pade22),
    TableRow::observing(Predictor::Identified),
    TableRow::observing(Predictor::Oracle),
    TableRow::observing(Predictor::Linear),
    TableRow::observing(Predictor::Rtl),
    TableRow::observing(Predictor::Rfl),
    TableRow::observing(Predictor::RflS),
    TableRow::plain(Predictor::Nmpc),
    TableRow::plain(Predictor::GpNmpc),
];
