//! The roads of a comparison.

use super::plant::TestPlant;
use super::vehicle::Setting;
use crate::path::sudoku::Route;
use crate::path::{Closure, Path, PathError};
use std::sync::Arc;

/// Roads of the comparison on a plant.
pub struct Roads {
    /// All of the training route.
    pub train: Arc<Path>,
    /// Pieces of it on which weights are tuned.
    pub pieces: Vec<Arc<Path>>,
    /// Piece on which candidates are shaken.
    pub shaking: Arc<Path>,
    /// Roads on which the best candidates are compared.
    pub validation: Vec<Arc<Path>>,
    /// Test road of the plant.
    pub test: Arc<Path>,
    /// Further ones, with their names.
    pub further: Vec<(Route, Arc<Path>)>,
}

impl Roads {
    /// Draws them.
    ///
    /// # Errors
    /// None for our own courses, unless they were changed.
    pub fn new(setting: &Setting, plant: &TestPlant) -> Result<Self, PathError> {
        let train = Arc::new(setting.training.path()?);
        let samples = setting.training.samples();
        let length = train.length();
        let index = |station: usize| (station * samples.len() / length as usize).min(samples.len());
        let piece = |&(from, to): &(usize, usize)| {
            Path::from_samples(samples[index(from)..index(to)].to_vec(), Closure::Open).map(Arc::new)
        };
        let further = |&route: &Route| Ok((route, Arc::new(route.path()?)));
        Ok(Self {
            pieces: setting.pieces.iter().map(piece).collect::<Result<_, _>>()?,
            shaking: piece(&setting.shaking)?,
            validation: match setting.validation {
                [] => vec![train.clone()],
                pieces => pieces.iter().map(piece).collect::<Result<_, _>>()?,
            },
            train,
            test: Arc::new(plant.test.path()?),
            further: setting.further.iter().map(further).collect::<Result<_, PathError>>()?,
        })
    }
}
