//! The plants of the comparison: a vehicle with effects that its nominal model lacks.

use crate::path::sudoku::Route;
use std::borrow::Cow;

/// The driven vehicle, and its test road.
#[derive(Debug, Clone, PartialEq)]
pub struct TestPlant {
    /// Name in files and tables.
    pub name: Cow<'static, str>,
    /// Description, in a sentence.
    pub meaning: Cow<'static, str>,
    /// Effects on top of the vehicle's file, by id.
    pub effects: Cow<'static, [(&'static str, f64)]>,
    /// Road of its test.
    pub test: Route,
    /// True if its rows' steps are timed and their drives are kept.
    pub timed: bool,
    /// True if the paper's setting is made of it: see [`Edge`](super::Edge).
    pub edge: bool,
}

/// Ids of the effects on the steering actuator.
pub const STEER_DELAY: &str = "steer_delay";
/// See [`STEER_DELAY`].
pub const STEER_LAG: &str = "steer_lag";

impl TestPlant {
    /// A plant by name, meaning, effects and test road.
    #[must_use]
    pub const fn new(
        name: &'static str,
        meaning: &'static str,
        effects: &'static [(&'static str, f64)],
        test: Route,
    ) -> Self {
        Self {
            name: Cow::Borrowed(name),
            meaning: Cow::Borrowed(meaning),
            effects: Cow::Borrowed(effects),
            test,
            timed: false,
            edge: false,
        }
    }

    /// One that is timed.
    #[must_use]
    pub const fn timed(mut self) -> Self {
        self.timed = true;
        self
    }

    /// One that the paper's setting is made of.
    #[must_use]
    pub const fn with_edge(mut self) -> Self {
        self.edge = true;
        self
    }

    /// The value of an effect; 0 for one that it does not have.
    #[must_use]
    pub fn effect(&self, id: &str) -> f64 {
        self.effects.iter().find(|(known, _)| *known == id).map_or(0.0, |(_, value)| *value)
    }
}

/// The cars, with more and more effects that the nominal model lacks.
pub const CAR_PLANTS: &[TestPlant] = &[
    TestPlant::new(
        "as_is",
        "The car of the vehicle file: tyres, suspension, its own actuator",
        &[],
        Route::SudokuTest,
    ),
    TestPlant::new("lag", "A steering lag of 0.1 s added", &[(STEER_LAG, 0.1)], Route::SudokuTest),
    TestPlant::new(
        "lag_and_dead_time",
        "A steering lag of 0.1 s and a dead time of 60 ms added",
        &[(STEER_LAG, 0.1), (STEER_DELAY, 0.06)],
        Route::SudokuTest,
    )
    .timed(),
    TestPlant::new(
        "payload_low_friction",
        "300 kg loaded 0.8 m behind the CG, friction of all roads at 60 %",
        &[("payload", 300.0), ("payload_x", -0.8), ("road_friction", 0.6)],
        Route::SudokuTest,
    ),
];

/// The trucks: the two delays of the truck paper.
pub const TRUCK_PLANTS: &[TestPlant] = &[
    TestPlant::new(
        "low_delay",
        "Dead time of 2 samples and a lag of 0.05 s added to the steering; on the off-road path",
        &[(STEER_DELAY, 0.04), (STEER_LAG, 0.05)],
        Route::TruckOffRoad,
    )
    .timed(),
    TestPlant::new(
        "high_delay",
        "Dead time of 15 samples and a lag of 0.2 s added to the steering; on the test route",
        &[(STEER_DELAY, 0.3), (STEER_LAG, 0.2)],
        Route::TruckTest,
    )
    .timed()
    .with_edge(),
];
