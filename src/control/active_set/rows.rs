//! The rows `a'U <= b` of the tracking problem, and those of them in the working set.

use crate::control::cholesky::{add, dot};
use crate::control::tracking_qp::{QpShape, TrackingQp};

/// A family of rows; each row has an upper side (sign +1) and a lower one (sign -1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RowFamily {
    Rate,
    Bound,
    Soft,
}

/// One side of one row.
#[derive(Debug, Clone, Copy)]
pub(super) struct BoundSide {
    pub(super) family: RowFamily,
    /// Column of the input, or number of the soft row, `step * soft bounds + bound`.
    pub(super) index: usize,
    pub(super) sign: f64,
}

/// A row of the working set.
#[derive(Debug, Clone, Copy)]
pub(super) struct ActiveRow {
    pub(super) row: BoundSide,
    /// Place of its column `H^-1 a`.
    pub(super) slot: usize,
    pub(super) multiplier: f64,
    /// True if it is soft and exceeded.
    pub(super) yields: bool,
}

impl BoundSide {
    /// Place among all rows.
    pub(super) fn place(&self, inputs: usize) -> usize {
        self.index
            + match self.family {
                RowFamily::Rate => 0,
                RowFamily::Bound => inputs,
                RowFamily::Soft => 2 * inputs,
            }
    }

    /// Step and number of the bound of a soft row.
    pub(super) fn soft(&self, shape: &QpShape) -> (usize, usize) {
        (self.index / shape.soft.len(), self.index % shape.soft.len())
    }

    /// Row of the gain of a soft row, as far as it reaches.
    pub(super) fn gain<'a>(&self, problem: &'a TrackingQp) -> &'a [f64] {
        let shape = &problem.shape;
        let (step, bound) = self.soft(shape);
        let row = step * shape.outputs + shape.soft[bound].output;
        &problem.gain[row * problem.columns()..][..(step + 1) * shape.inputs]
    }

    /// `a'x`.
    pub(super) fn dot(&self, problem: &TrackingQp, x: &[f64]) -> f64 {
        let value = match self.family {
            RowFamily::Rate => {
                let before = self.index.checked_sub(problem.shape.inputs).map_or(0.0, |before| x[before]);
                x[self.index] - before
            }
            RowFamily::Bound => x[self.index],
            RowFamily::Soft => dot(self.gain(problem), x),
        };
        self.sign * value
    }

    /// `y += factor a`.
    pub(super) fn add(&self, problem: &TrackingQp, factor: f64, y: &mut [f64]) {
        let factor = factor * self.sign;
        match self.family {
            RowFamily::Soft => add(y, factor, self.gain(problem)),
            RowFamily::Bound => y[self.index] += factor,
            RowFamily::Rate => {
                y[self.index] += factor;
                if let Some(before) = self.index.checked_sub(problem.shape.inputs) {
                    y[before] -= factor;
                }
            }
        }
    }

    /// Entries of `a` before the first that is not zero.
    pub(super) fn zeros(&self, shape: &QpShape) -> usize {
        match self.family {
            RowFamily::Rate => self.index.saturating_sub(shape.inputs),
            RowFamily::Bound => self.index,
            RowFamily::Soft => 0,
        }
    }

    /// `a'U - b`.
    pub(super) fn excess(&self, problem: &TrackingQp, inputs: &[f64], outputs: &[f64]) -> f64 {
        let shape = &problem.shape;
        let sided = |value: f64, min: f64, max: f64| if self.sign > 0.0 { value - max } else { min - value };
        match self.family {
            RowFamily::Rate => {
                let i = self.index % shape.inputs;
                let before =
                    self.index.checked_sub(shape.inputs).map_or(problem.previous[i], |before| inputs[before]);
                sided(inputs[self.index] - before, -shape.rate_max[i], shape.rate_max[i])
            }
            RowFamily::Bound => {
                let i = self.index % shape.inputs;
                sided(inputs[self.index], shape.input_min[i], shape.input_max[i])
            }
            RowFamily::Soft => {
                let (step, bound) = self.soft(shape);
                let soft = &shape.soft[bound];
                sided(outputs[step * shape.outputs + soft.output], soft.min, soft.max)
            }
        }
    }

    /// The measure for its excess.
    pub(super) fn width(&self, shape: &QpShape) -> f64 {
        match self.family {
            RowFamily::Rate | RowFamily::Bound => input_width(shape, self.index % shape.inputs),
            RowFamily::Soft => soft_width(shape, self.soft(shape).1),
        }
    }

    /// Linear penalty and compliance `1/q` of a soft row.
    pub(super) fn penalty(&self, shape: &QpShape) -> Option<(f64, f64)> {
        (self.family == RowFamily::Soft).then(|| {
            let soft = &shape.soft[self.soft(shape).1];
            (soft.linear, 1.0 / soft.quadratic)
        })
    }
}

impl ActiveRow {
    /// Its entry of `C`.
    pub(super) fn compliance(&self, shape: &QpShape) -> f64 {
        self.row.penalty(shape).filter(|_| self.yields).map_or(0.0, |(_, compliance)| compliance)
    }

    /// Its slack as its multiplier says.
    pub(super) fn slack(&self, shape: &QpShape) -> f64 {
        self.row
            .penalty(shape)
            .filter(|_| self.yields)
            .map_or(0.0, |(linear, compliance)| (self.multiplier - linear) * compliance)
    }

    /// Distance of its multiplier from the range that belongs to its state.
    pub(super) fn dual_violation(&self, shape: &QpShape) -> f64 {
        match (self.row.penalty(shape), self.yields) {
            (Some((linear, _)), true) => linear - self.multiplier,
            (Some((linear, _)), false) => (-self.multiplier).max(self.multiplier - linear),
            (None, _) => -self.multiplier,
        }
    }
}

/// Width of the range of an input, the measure of violations of its bounds.
pub(super) fn input_width(shape: &QpShape, i: usize) -> f64 {
    shape.input_max[i] - shape.input_min[i]
}

/// Width of the range of a softly bounded output.
pub(super) fn soft_width(shape: &QpShape, bound: usize) -> f64 {
    let width = shape.soft[bound].max - shape.soft[bound].min;
    if width > 0.0 { width } else { 1.0 }
}
