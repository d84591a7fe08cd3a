//! Candidates and their evidence: single effects, pairs of the best with all others, and triples of the best pairs with
//! all others. Triples follow only where a pair explains much more than one effect: a real vehicle differs in more than
//! one respect.
//!
//! | file | problem |
//! |---|---|
//! | `search.rs` | fits of candidates |
//! | `beam.rs` | candidates of one effect more |
//! | `nested.rs` | bounds by candidates with one effect more or less |
//! | `order.rs` | order by costs |
//! | `glance.rs` | a first look, with little trust |

mod beam;
mod glance;
mod nested;
mod order;
mod search;

use super::fit::{Fit, Linearisation, Prior};
use super::noise::Noise;
use super::problem::Problem;
use super::replay::ReplayVehicle;
use crate::numerics::parallel;
use beam::{OF_PAIRS, OF_SINGLES};
use order::{LITTLE, NEAR, is_ahead, sort};
use search::Search;

pub use glance::{Glance, glance};

/// Singles that are fitted with less and then with all trust.
const REFINED: usize = 6;
/// Evidence of a pair over its better half from which on the noise is taken from the pair's remainder.
const TELLING: f64 = 20.0;
/// Evidence of a single effect from which on slopes are taken at it.
const INFORMATIVE: f64 = 50.0;

/// All that was fitted.
pub struct Ranking {
    /// With nothing free.
    pub none: Fit,
    /// The best first.
    pub singles: Vec<Fit>,
    /// The best first; empty if pairs were not asked for.
    pub pairs: Vec<Fit>,
    /// True if pairs were asked for.
    pub with_pairs: bool,
    /// The best first; empty if the best pair gains little over the best single effect.
    pub triples: Vec<Fit>,
    /// Slopes and weights for the background, at `none`.
    pub linear: Linearisation,
    /// Tolerances.
    pub prior: Prior,
    /// Noise model with which gaps were weighed.
    pub noise: Noise,
    /// The gap with all coordinates as expected: neutral, or by a reference log.
    pub neutral: Vec<f64>,
}

impl Ranking {
    /// The candidate of a set of effects, in any order.
    #[must_use]
    pub fn find(&self, effects: &[usize]) -> Option<&Fit> {
        if effects.is_empty() {
            return Some(&self.none);
        }
        let is_of =
            |fit: &&Fit| fit.free.len() == effects.len() && effects.iter().all(|i| fit.free.contains(i));
        self.of(effects.len()).iter().find(is_of)
    }

    /// Candidates of so many effects, the best first.
    #[must_use]
    pub fn of(&self, effects: usize) -> &[Fit] {
        match effects {
            1 => &self.singles,
            2 => &self.pairs,
            3 => &self.triples,
            _ => &[],
        }
    }

    /// Slopes of all uncertain parameters at a fitted point, taken anew.
    #[must_use]
    pub fn linear_at<V: ReplayVehicle>(&self, problem: &Problem<V>, at: &Fit) -> Linearisation {
        if at.free.is_empty() { self.linear.clone() } else { self.linear.anew(problem, &at.x, &at.gap) }
    }
}

/// Reasons for which candidates could not be ranked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the vehicle cannot be replayed on this log")]
pub struct NoReplay;

/// Candidates on their way, with the weights and slopes of the moment.
struct Candidates<'s, V> {
    problem: &'s Problem<'s, V>,
    prior: &'s Prior,
    noise: Noise,
    linear: Linearisation,
    none: Fit,
    singles: Vec<Fit>,
    pairs: Vec<Fit>,
    triples: Vec<Fit>,
}

/// Ranks all candidates; `prior` is the knowledge of the tolerances. `pairs` decides from the gains of nothing and of
/// single effects if more than one is searched for.
///
/// # Errors
/// A vehicle that cannot be replayed.
pub fn rank<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: Prior,
    pairs: &dyn Fn(&Fit, &[Fit]) -> bool,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Ranking, NoReplay> {
    let trace = problem.trace(&prior.mean).map_err(|_| NoReplay)?;
    let neutral = problem.compare(&trace);
    let fine = Noise::of(problem, &trace, &prior.form);
    progress("sensitivities", 0.1);
    let mut found = Candidates::new(problem, &prior, fine.coarse(problem, &neutral))?;
    progress("single effects", 0.2);
    found.find_singles();
    progress("noise", 0.5);
    found.trust(fine)?;
    found.measure_noise()?;
    progress("single effects", 0.6);
    found.fit_singles()?;
    let with_pairs = pairs(&found.none, &found.singles);
    if with_pairs {
        progress("pairs", 0.75);
        found.find_pairs();
    }
    progress("pairs", 0.9);
    found.find_triples()?;
    found.fit_fewer_from_more();
    found.fit_more_from_fewer();
    let Candidates { none, singles, pairs, triples, linear, noise, .. } = found;
    Ok(Ranking { none, singles, pairs, with_pairs, triples, linear, prior, noise, neutral })
}

impl<'s, V: ReplayVehicle> Candidates<'s, V> {
    /// Nothing free, with slopes at its own best.
    fn new(problem: &'s Problem<'s, V>, prior: &'s Prior, noise: Noise) -> Result<Self, NoReplay> {
        let at_start = problem.residual(&prior.mean).ok_or(NoReplay)?;
        let linear = Linearisation::new(problem.slopes(&prior.mean, &at_start), noise.weights(problem));
        let none = Search { problem, prior, linear: &linear }.fit_none(&prior.mean).ok_or(NoReplay)?;
        let linear = Linearisation::new(problem.slopes(&none.x, &none.gap), noise.weights(problem));
        let none = Search { problem, prior, linear: &linear }.fit_none(&none).ok_or(NoReplay)?;
        let [singles, pairs, triples] = [const { Vec::new() }; 3];
        Ok(Self { problem, prior, noise, linear, none, singles, pairs, triples })
    }

    /// Each effect alone, from the start that promises most.
    fn find_singles(&mut self) {
        let Self { problem, prior, linear, none, .. } = self;
        let search = Search { problem, prior, linear };
        let candidates = candidates(problem);
        let found = parallel::map(problem.threads(), candidates.len(), |k| {
            let free = [candidates[k]];
            search.fit(&free, search.best_start(&free, none, None), 3)
        });
        self.singles = found.into_iter().flatten().collect();
        sort(&mut self.singles);
        let mut found = vec![none.clone()];
        search.fewer_from_more(&mut found, &self.singles, 3);
        self.none = found.swap_remove(0);
    }

    /// Slopes at the best single effect where it is informative, with the weights of a noise.
    fn relinearise_at_base(&mut self) -> Result<(), NoReplay> {
        let best = self.singles.first().filter(|best| self.none.cost - best.cost > INFORMATIVE);
        let base = best.map_or(&self.none.x, |best| &best.x).clone();
        let at_base = self.problem.residual(&base).ok_or(NoReplay)?;
        let slopes = self.problem.slopes(&base, &at_base);
        self.linear = Linearisation::new(slopes, self.noise.weights(self.problem));
        Ok(())
    }

    /// From here on with all trust.
    fn trust(&mut self, noise: Noise) -> Result<(), NoReplay> {
        self.noise = noise;
        self.relinearise_at_base()?;
        let search = Search { problem: self.problem, prior: self.prior, linear: &self.linear };
        search.reweighed(&mut self.none);
        self.none = search.fit_none(&self.none).ok_or(NoReplay)?;
        search.refined(&mut self.singles, REFINED);
        Ok(())
    }

    /// Noise with what the best single effect leaves.
    fn measure_noise(&mut self) -> Result<(), NoReplay> {
        if let Some(best) = self.singles.first() {
            let search = Search { problem: self.problem, prior: self.prior, linear: &self.linear };
            self.noise = self.noise.with_left(self.problem, &search.unexplained(best));
        }
        self.relinearise_at_base()
    }

    /// Nothing and single effects to convergence.
    fn fit_singles(&mut self) -> Result<(), NoReplay> {
        let Self { problem, prior, linear, none, singles, .. } = self;
        let search = Search { problem, prior, linear };
        *none = search.fit_none(&*none).ok_or(NoReplay)?;
        search.fitted_again(none, singles);
        let local = linear.anew(problem, &none.x, &none.gap);
        if let Some(new) = search.at(&local).fit(&[], &*none, 5).filter(|new| new.cost < none.cost) {
            *none = new;
        }
        search.at(&local).again_from_none(none, singles);
        search.relinearise(none, singles);
        search.polish_singles(none, singles);
        search.bound(none, singles);
        Ok(())
    }

    /// Pairs of the best with all others.
    fn find_pairs(&mut self) {
        let search = Search { problem: self.problem, prior: self.prior, linear: &self.linear };
        self.pairs = search.extended(&self.singles, &self.singles, &OF_SINGLES);
        search.refine(&mut self.pairs);
    }

    /// Triples, where a pair tells much more than a single effect. Its rest is the measure of noise then.
    fn find_triples(&mut self) -> Result<(), NoReplay> {
        let Self { problem, prior, noise, linear, none, singles, pairs, triples } = self;
        let Some(pair) = pairs.first().filter(|_| is_ahead(pairs, singles, TELLING)) else { return Ok(()) };
        *noise = noise.with_left(problem, &Search { problem, prior, linear }.unexplained(pair));
        *linear = Linearisation::new(problem.slopes(&pair.x, &pair.gap), noise.weights(problem));
        let search = Search { problem, prior, linear };
        *none = search.fit_none(&*none).ok_or(NoReplay)?;
        search.refined(singles, REFINED);
        search.refined(pairs, REFINED);
        if !is_ahead(pairs, singles, NEAR) {
            search.polish_singles(none, singles);
        }
        search.bound(none, singles);
        *triples = search.extended(pairs, singles, &OF_PAIRS);
        if is_ahead(triples, pairs, LITTLE) {
            search.refine(triples);
        }
        Ok(())
    }

    /// Candidates of fewer effects from those of more; nothing to convergence.
    fn fit_fewer_from_more(&mut self) {
        let Self { problem, prior, linear, none, singles, pairs, triples, .. } = self;
        let search = Search { problem, prior, linear };
        search.bound_fewer(pairs, triples);
        if is_ahead(triples, pairs, LITTLE) {
            search.fewer_from_more(pairs, triples, 2);
            search.refine(pairs);
        }
        search.bound_fewer(singles, pairs);
        search.fewer_from_more(singles, pairs, 3);
        search.polish_singles(none, singles);
        let mut found = vec![none.clone()];
        search.fewer_from_more(&mut found, singles, 2);
        let before = found.swap_remove(0);
        *none = search.converged(before.clone());
        if before.cost - none.cost > 1.0 && !is_ahead(pairs, singles, NEAR) {
            let local = linear.anew(problem, &none.x, &none.gap);
            search.at(&local).again_from_none(none, singles);
            search.polish_singles(none, singles);
        }
        search.bound(none, singles);
    }

    /// And the other way round: whatever is free besides, a candidate explains no less than without.
    fn fit_more_from_fewer(&mut self) {
        let Self { problem, prior, linear, singles, pairs, triples, .. } = self;
        let search = Search { problem, prior, linear };
        search.more_from_fewer(pairs, singles, singles, &OF_SINGLES);
        search.more_from_fewer(triples, pairs, singles, &OF_PAIRS);
    }
}

/// The gap after a linear step.
#[must_use]
pub fn predicted(linear: &Linearisation, gap: &[f64], change: &[f64]) -> Vec<f64> {
    let mut left = gap.to_vec();
    for (slope, &change) in linear.slopes.iter().zip(change) {
        if change != 0.0 {
            left.iter_mut().zip(slope.iter()).for_each(|(left, slope)| *left -= slope * change);
        }
    }
    left
}

/// Uncertain parameters that may be named.
fn candidates<V: ReplayVehicle>(problem: &Problem<V>) -> Vec<usize> {
    (0..problem.uncertain.len()).filter(|&i| problem.uncertain[i].is_candidate()).collect()
}

/// The gap of a fit with all coordinates as expected, by its slopes.
#[must_use]
pub fn expected(linear: &Linearisation, prior: &Prior, fit: &Fit) -> Vec<f64> {
    let back: Vec<f64> = prior.off(&fit.x).iter().map(|off| -off).collect();
    predicted(linear, &fit.gap, &back)
}

#[cfg(test)]
mod tests {
    use super::nested::STRAINED;
    use super::search::STEPS;
    use super::*;
    use crate::diagnose::library::Library;
    use crate::diagnose::replay::{ReplayDrive, neutral};
    use crate::diagnose::simulated::{Conditions, drive};
    use crate::vehicle::{CarParameters, TruckEffects, builtin};

    /// A search on a drive of the default car with effects, at the expected tolerances.
    fn searched(put_in: &[(&str, f64)], test: impl FnOnce(Search<CarParameters>)) {
        let car = builtin("c_class").unwrap();
        let mut effects = TruckEffects::default();
        put_in.iter().for_each(|&(id, value)| *effects.get_mut(id).unwrap() = value);
        let conditions = Conditions { seed: 3, duration: 20.0, step: 0.02, ..Conditions::default() };
        let log = drive(&car, &effects, &conditions).unwrap();
        let drive = ReplayDrive::new(&log, false);
        let correction = neutral(&drive, &car).unwrap();
        let problem = Problem::new(&drive, &car, &correction, Library::default(), 0);
        let prior = Prior::of(&problem);
        let gap = problem.residual(&prior.mean).unwrap();
        let noise = Noise::of(&problem, &problem.trace(&prior.mean).unwrap(), &prior.form);
        let linear = Linearisation::new(problem.slopes(&prior.mean, &gap), noise.weights(&problem));
        test(Search { problem: &problem, prior: &prior, linear: &linear });
    }

    #[test]
    fn a_load_is_fitted_in_place_of_a_mass_that_is_strained() {
        searched(&[("payload", 300.0), ("steer_offset", 0.02)], |search| {
            let Search { problem, prior, .. } = search;
            let [mass, load, offset] =
                ["vehicle.mass", "payload", "steer_offset"].map(|id| problem.find(id).unwrap());
            let start = prior.mean.clone();
            let with_mass_at = |x: f64| {
                let mut at = start.clone();
                at[mass] = x;
                Search { prior: &prior.holding(&[mass], &at), ..search }.fit(&[offset], &at, STEPS).unwrap()
            };
            let strained = with_mass_at(6.0);
            let found = search.loaded(std::slice::from_ref(&strained));
            let [of_load] = found.as_slice() else { panic!("{}", found.len()) };
            assert_eq!(of_load.free, [offset, load]);
            let kilograms = of_load.x[load] * problem.uncertain[load].unit;
            assert!((kilograms - 300.0).abs() < 60.0, "{kilograms}");
            assert!(of_load.x[mass].abs() < STRAINED, "{}", of_load.x[mass]);
            // Within its tolerance a mass is no load.
            assert!(search.loaded(&[with_mass_at(2.0)]).is_empty());
        });
    }

    #[test]
    fn what_a_search_gave_to_the_background_is_got_back_afresh() {
        searched(&[("steer_delay", 0.1)], |search| {
            let Search { problem, prior, .. } = search;
            let [delay, rear] = ["steer_delay", "tyre_stiffness_rear"].map(|id| problem.find(id).unwrap());
            let start = prior.mean.clone();
            let none = search.fit_none(&start).unwrap();
            // Found with a rear axle that is too soft by two tolerances.
            let mut astray = start;
            (astray[delay], astray[rear]) = (4.0, -0.8);
            let mut found = Search { prior: &prior.holding(&[rear], &astray), ..search }
                .fit(&[delay], &astray, STEPS)
                .unwrap();
            search.reweighed(&mut found);
            let before = found.cost;
            let mut fits = vec![found];
            search.relinearise(&none, &mut fits);
            let [now] = fits.as_slice() else { panic!("{}", fits.len()) };
            assert!(now.cost < 0.5 * before, "{} {before} {}", now.cost, none.cost);
            let seconds = problem.uncertain[delay].value(now.x[delay]);
            assert!((seconds - 0.1).abs() < 0.01, "{seconds}");
            assert!(now.x[rear].abs() < 3.0 * problem.uncertain[rear].tolerance, "{}", now.x[rear]);
        });
    }
}
