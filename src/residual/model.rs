//! The learned residual of the controller.
//!
//! For step `j` of the horizon the controller gives the features of the window that ends with the state at the start of
//! the step. Measured ones come first, then predicted ones. It gets the coefficients of
//! ```text
//! r = constant + sum_i command_i u_i + sum_s state_s x_s
//! ```
//!
//! with `u_i` the commands of the window, oldest first, the last one in force over the step. `x_s` are the newest error
//! states, oldest first, if the leaves have them (else there are no such terms). Terms in the road are known when the
//! problem is set up and stand in the constant. Nothing is allocated.
//!
//! Consecutive steps mostly fall into the same leaves. Their mean is kept in the caller's workspace, and only changed
//! leaves are replaced in it. The controller asks a whole horizon again and again; its rows keep more
//! ([`ResidualModelFor::row`]).

use super::ROAD;
use super::fits::{Expected, ModelMismatch};
use super::forest::Forest;
use super::leaf::{LeafModels, Shares};
use super::least_squares::Theta;
use super::linear::{LinearResidual, ResidualRows};
use super::lookahead::{Lookahead, LookedUp, Questions};
use super::schema::{Kind, ROAD_TERMS, Range, Regressors, Schema, Training, TreeFeatures, road_terms};
use crate::nominal::{ERRORS, LateralVehicle};
use crate::vehicle::SingleTrack;
use std::sync::Arc;

/// Place of the speed among the road's features.
const SPEED: usize = 0;
/// A learned residual of a car.
pub type ResidualModel = ResidualModelFor<SingleTrack, ERRORS>;

/// A learned residual of a kind of vehicle with `S` states.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualModelFor<V, const S: usize> {
    pub(super) schema: Schema<V>,
    pub(super) forest: Forest,
    pub(super) leaves: LeafModels<S>,
    /// Shared with the rooms made for it, which know their model by it.
    shares: Arc<Shares<S>>,
    questions: Arc<Questions<S>>,
    /// Ranges in training of states and road, endless where the model does not depend on a value.
    used: ([[f64; 2]; S], [[f64; 2]; ROAD]),
}

/// The linear residual at one step of the horizon; made once, filled at each call.
#[derive(Debug, Clone, PartialEq)]
pub struct Coefficients<const S: usize = ERRORS> {
    /// Constant, commands, states; then the road's terms, which are added to the constant.
    values: Theta<S>,
    window: usize,
    /// Place of the road's first term.
    road: usize,
    /// The shares of whose model these are.
    model: Arc<Shares<S>>,
    /// The leaf of each tree at the last call; at first none.
    leaves: Vec<u32>,
    /// Their mean coefficients as they are in the model: without the road's values, not scaled.
    mean: Theta<S>,
    /// Distance of the worst feature from its range in training, in widths of that range; 0 inside. Of the speed, in
    /// shares of the speed exceeded.
    pub excess: f64,
    /// Share of the leaves whose training had no commands like those given, 0 to 1.
    pub strange_leaves: f64,
}

impl<const S: usize> Coefficients<S> {
    /// Effect of known quantities on the states.
    #[must_use]
    pub fn constant(&self) -> [f64; S] {
        self.values[0]
    }

    /// Effect of each command of the window, oldest first, per rad.
    #[must_use]
    pub fn command(&self) -> &[[f64; S]] {
        &self.values[1..=self.window]
    }

    /// Effect of the newest error states, oldest first; empty if the leaves have none.
    #[must_use]
    pub fn state(&self) -> &[[f64; S]] {
        &self.values[1 + self.window..self.road]
    }

    /// True if the model was asked outside its training.
    #[must_use]
    pub fn outside(&self) -> bool {
        self.excess > 0.0 || self.strange_leaves > 0.5
    }

    /// Shrinks the residual towards none, the nominal model: 1 leaves it unchanged, 0 removes it.
    pub fn scale(&mut self, factor: f64) {
        self.values.as_flattened_mut().iter_mut().for_each(|value| *value *= factor);
    }

    /// The residual for these commands and newest states (both oldest first).
    #[must_use]
    pub fn residual(&self, commands: &[f64], states: &[f64]) -> [f64; S] {
        let mut sum = self.values[0];
        let known = commands.iter().zip(self.command()).chain(states.iter().zip(self.state()));
        for (value, effect) in known {
            sum.iter_mut().zip(effect).for_each(|(sum, effect)| *sum += value * effect);
        }
        sum
    }
}

/// Ranges in training of the newest state and of the road, endless for unused features. The speed is always bounded, as
/// every effect of a command grows with it.
fn used_ranges<V, const S: usize>(schema: &Schema<V>) -> ([[f64; 2]; S], [[f64; 2]; ROAD]) {
    let trees = schema.kind.has_trees();
    let leaves = schema.kind.is_linear();
    let by_errors =
        (trees && schema.tree_features != TreeFeatures::Road) || (leaves && schema.regressors.states > 0);
    let by_road =
        (trees && schema.tree_features != TreeFeatures::Errors) || (leaves && schema.regressors.road);
    let range = |asked: bool, i: usize| {
        let range = schema.ranges.get(i).filter(|_| asked);
        range.map_or([f64::NEG_INFINITY, f64::INFINITY], |range| [range.min, range.max])
    };
    let of_road = |i: usize| {
        let [min, max] = range(by_road || (i == SPEED && schema.kind != Kind::None), S + i);
        // Below that speed the nominal model is held.
        if i == SPEED && min <= schema.min_model_speed { [f64::MIN, max] } else { [min, max] }
    };
    (std::array::from_fn(|i| range(by_errors, i)), std::array::from_fn(of_road))
}

impl<V: LateralVehicle<S>, const S: usize> ResidualModelFor<V, S> {
    /// No residual: coefficients are zero.
    #[must_use]
    pub fn none(vehicle: &V, sample_time: f64, min_model_speed: f64, window: usize) -> Self {
        let schema = Schema {
            kind: Kind::None,
            sample_time,
            window,
            min_model_speed,
            tree_features: TreeFeatures::Errors,
            regressors: Regressors::default(),
            vehicle: *vehicle,
            training: Training {
                data_hash: String::new(),
                samples: 0,
                seed: 0,
                global_lambda: None,
                leaf_lambda: None,
            },
            ranges: vec![],
        };
        let leaves = LeafModels { regressors: 1, theta: vec![[0.0; S]], command_range: vec![[0.0; 2]] };
        Self::new(schema, Forest::single_leaf(), leaves)
    }

    /// A model of consistent parts.
    pub(super) fn new(schema: Schema<V>, forest: Forest, leaves: LeafModels<S>) -> Self {
        let shares = Arc::new(Shares::new(&leaves, forest.trees(), schema.window));
        let used = used_ranges(&schema);
        let questions = Arc::new(Questions::new(&forest, schema.window));
        Self { schema, forest, leaves, shares, questions, used }
    }

    /// Description of the model.
    #[must_use]
    pub fn schema(&self) -> &Schema<V> {
        &self.schema
    }

    /// Its trees.
    #[must_use]
    pub fn forest(&self) -> &Forest {
        &self.forest
    }

    /// Its leaves.
    #[must_use]
    pub fn leaves(&self) -> &LeafModels<S> {
        &self.leaves
    }

    /// Number of features that [`coefficients`](Self::coefficients) takes: `S W + 3`.
    #[must_use]
    pub fn features(&self) -> usize {
        S * self.schema.window + ROAD
    }

    /// Room for the coefficients of one step.
    #[must_use]
    pub fn workspace(&self) -> Coefficients<S> {
        let Schema { window, regressors, .. } = self.schema;
        let count = regressors.count(S, window);
        Coefficients {
            values: vec![[0.0; S]; count],
            window,
            road: count - if regressors.road { ROAD_TERMS } else { 0 },
            model: Arc::clone(&self.shares),
            leaves: vec![self.shares.none(); self.forest.trees()],
            mean: vec![[0.0; S]; self.shares.entries()],
            excess: 0.0,
            strange_leaves: 0.0,
        }
    }

    /// The linear residual at `features`: `W` states, oldest first, then speed, curvature and curvature rate of the
    /// newest row. `commands` is the window of commands as far as known or planned, for comparison with the leaves'
    /// training; it may be empty.
    ///
    /// # Panics
    /// If `features` has not [`features`](Self::features) values, or if `out` is of another model: a mistake of the
    /// calling code, not of data.
    pub fn coefficients(&self, features: &[f64], commands: &[f64], out: &mut Coefficients<S>) {
        assert_eq!(features.len(), self.features(), "features");
        assert!(Arc::ptr_eq(&self.shares, &out.model), "room of another model");
        let schema = &self.schema;
        self.forest.look_up(features, |tree, leaf| {
            let last = std::mem::replace(&mut out.leaves[tree], leaf as u32);
            if last != leaf as u32 {
                self.shares.exchange(&mut out.mean, last, leaf as u32);
            }
        });
        // Constant leaves have only the first of the coefficients.
        let (known, rest) = out.values.split_at_mut(self.leaves.regressors());
        known.copy_from_slice(&out.mean[..known.len()]);
        rest.fill([0.0; S]);
        if schema.regressors.road {
            let road = road_terms(&features[features.len() - ROAD..]);
            for (i, term) in road.iter().enumerate() {
                for o in 0..S {
                    out.values[0][o] += term * out.values[out.road + i][o];
                }
            }
        }
        out.strange_leaves =
            if schema.kind == Kind::None { 0.0 } else { self.leaves.strange(&out.leaves, commands) };
        let (states, road) = features.split_at(features.len() - ROAD);
        let newest = states.last_chunk::<S>().zip(road.first_chunk::<ROAD>());
        out.excess = newest.map_or(0.0, |(errors, road)| self.excess(errors, road));
    }

    /// Workspace for the rows of a receding horizon.
    ///
    /// # Panics
    /// If the horizon has no row.
    #[must_use]
    pub fn lookahead(&self, horizon: usize) -> Lookahead<S> {
        assert!(horizon > 0, "horizon");
        Lookahead::new(&self.forest, &self.shares, &self.questions, self.schema.window, horizon)
    }

    /// The linear residual of a row of the horizon. It is the result of [`coefficients`](Self::coefficients) for the
    /// window of states held by `rows`, and this speed, curvature and curvature rate. It costs little if little has
    /// changed since the row was last asked.
    ///
    /// # Panics
    /// If `rows` is of another model, or has no such row: a mistake of the calling code, not of data.
    pub fn row<'a>(&self, rows: &'a mut Lookahead<S>, row: usize, road: &[f64; ROAD]) -> LookedUp<'a, S> {
        assert!(rows.is_of(&self.shares), "room of another model");
        let Schema { window, regressors, .. } = self.schema;
        let (slot, renewed) = rows.look_up(&self.forest, row, road);
        let (held, mean) = rows.mean(slot).split_last().unwrap_or((&[0.0; S], &[]));
        let mut constant = mean[0];
        // Constant leaves have only the first of the coefficients.
        let linear = mean.len() > 1;
        if regressors.road && linear {
            for (term, effect) in road_terms(road).iter().zip(&mean[mean.len() - ROAD_TERMS..]) {
                for o in 0..S {
                    constant[o] += term * effect[o];
                }
            }
        }
        let states = if linear { 1 + window..1 + window + S * regressors.states } else { 0..0 };
        LookedUp {
            slot,
            renewed,
            constant,
            command: if linear { &mean[1..=window] } else { &[] },
            held: *held,
            state: &mean[states],
            newest: rows.newest(row, regressors.states),
            excess: self.excess(rows.state(row + window - 1), road),
        }
    }

    /// Distance of the model's newest features from their ranges; older ones were the newest before.
    #[inline]
    fn excess(&self, errors: &[f64; S], road: &[f64; ROAD]) -> f64 {
        let (of_errors, of_road) = &self.used;
        let mut inside = true;
        for c in 0..S {
            inside &= (errors[c] >= of_errors[c][0]) & (errors[c] <= of_errors[c][1]);
        }
        for c in 0..ROAD {
            inside &= (road[c] >= of_road[c][0]) & (road[c] <= of_road[c][1]);
        }
        if inside { 0.0 } else { self.excess_outside(errors, road) }
    }

    #[cold]
    fn excess_outside(&self, errors: &[f64; S], road: &[f64; ROAD]) -> f64 {
        let used = self.used.0.iter().chain(&self.used.1);
        let all = used.zip(&self.schema.ranges).zip(errors.iter().chain(road)).enumerate();
        // What is endless may be no number, too.
        let outside = all.filter(|(_, (([min, max], _), x))| min.is_finite() && !(min..=max).contains(x));
        let excess = |(i, ((_, range), &x)): (usize, ((_, &Range), &f64))| {
            if i == S + SPEED { range.excess_in_shares(x) } else { range.excess(x) }
        };
        outside.map(excess).fold(0.0, f64::max)
    }

    /// Checks that the model was learned for such a controller.
    ///
    /// # Errors
    /// The first difference that matters.
    pub fn check_fits(&self, expected: &Expected<V>) -> Result<(), ModelMismatch> {
        let Schema { vehicle, sample_time, min_model_speed, window, .. } = self.schema;
        expected.check(&vehicle, sample_time, min_model_speed)?;
        match expected.window {
            Some(controller) if controller != window => {
                Err(ModelMismatch::Window { model: window, controller })
            }
            _ => Ok(()),
        }
    }
}

/// Rows of a forest, with what was looked up in the step before.
struct ForestRows<V, const S: usize> {
    model: Arc<ResidualModelFor<V, S>>,
    rows: Lookahead<S>,
}

impl<V: LateralVehicle<S>, const S: usize> LinearResidual<V, S> for ResidualModelFor<V, S> {
    fn window(&self) -> usize {
        self.schema.window
    }

    fn check_fits(&self, expected: &Expected<V>) -> Result<(), ModelMismatch> {
        Self::check_fits(self, expected)
    }

    fn rows(self: Arc<Self>, horizon: usize) -> Box<dyn ResidualRows<S>> {
        Box::new(ForestRows { rows: self.lookahead(horizon), model: self })
    }
}

impl<V: LateralVehicle<S>, const S: usize> ResidualRows<S> for ForestRows<V, S> {
    fn advance(&mut self) {
        self.rows.advance();
    }

    fn first(&self) -> usize {
        self.rows.first()
    }

    fn set_state(&mut self, at: usize, state: &[f64; S]) {
        self.rows.set_state(at, state);
    }

    fn row(&mut self, row: usize, road: &[f64; ROAD]) -> LookedUp<'_, S> {
        self.model.row(&mut self.rows, row, road)
    }
}
