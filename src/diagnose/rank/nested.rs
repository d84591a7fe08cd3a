//! Bounds of a candidate's cost by those with one effect more or less, and fits from their coordinates.

use super::beam::Beam;
use super::order::{of_the_same, sort, take};
use super::search::{POLISHED, STEPS, Search};
use crate::diagnose::fit::Fit;
use crate::diagnose::replay::ReplayVehicle;
use crate::diagnose::uncertain::LOADED;
use crate::numerics::parallel;

/// Distance of an effect, in tolerances, from which on freeing it is sure to gain: its square is the evidence.
pub(super) const STRAINED: f64 = 3.0;

impl<V: ReplayVehicle> Search<'_, V> {
    /// Upper bounds from nested models. A candidate with a value within its tolerance is also explained by the background.
    /// So its cost with the tolerance's penalty bounds that of nothing free, which in turn bounds every candidate's.
    pub(super) fn bound(self, none: &mut Fit, singles: &mut [Fit]) {
        let Self { problem, prior, .. } = self;
        let of_none = prior.free(problem, &[]);
        for single in singles.iter() {
            let off = prior.off(&single.x);
            let of_single = prior.free(problem, &single.free);
            let cost = single.cost - of_single.penalty(&off) + of_none.penalty(&off);
            if cost < none.cost {
                *none = Fit { free: Vec::new(), columns: Vec::new(), cost, ..single.clone() };
            }
        }
        // And where the background strains an effect's tolerance, freeing that effect alone saves the strain's cost.
        let off = prior.off(&none.x);
        let left = none.cost - of_none.penalty(&off);
        for single in singles.iter_mut() {
            let i = single.free[0];
            let free = left + prior.free(problem, &single.free).penalty(&off);
            let may_be = problem.uncertain[i].within(none.x[i], true) == none.x[i];
            if may_be && free < single.cost {
                *single = Fit { x: none.x.clone(), gap: none.gap.clone(), cost: free, ..single.clone() };
            }
        }
        sort(singles);
    }

    /// Upper bounds from larger candidates. The background also explains the part of an effect within its tolerance,
    /// without freeing it. The cost bounds that of the candidate of the others, whose own search may have missed it.
    pub(super) fn bound_fewer(self, fewer: &mut Vec<Fit>, more: &[Fit]) {
        let Self { problem, prior, .. } = self;
        for fit in more {
            let off = prior.off(&fit.x);
            let gap = fit.cost - prior.free(problem, &fit.free).penalty(&off);
            for (place, &i) in fit.free.iter().enumerate() {
                if problem.uncertain[i].tolerance == 0.0
                    || problem.uncertain[i].within(fit.x[i], false) != fit.x[i]
                {
                    continue;
                }
                let mut others = fit.clone();
                others.free.remove(place);
                others.columns.clear();
                others.cost = gap + prior.free(problem, &others.free).penalty(&off);
                match fewer.iter_mut().find(|known| of_the_same(known, &others)) {
                    Some(known) if known.cost <= others.cost => {}
                    Some(known) => (known.x, known.gap, known.cost) = (others.x, others.gap, others.cost),
                    None => fewer.push(others),
                }
            }
        }
        sort(fewer);
    }

    /// Upper bounds from smaller candidates, the reverse of [`bound`]. Among the first few, freeing an effect whose
    /// tolerance is strained saves the cost of the strain. True if the result is better than the best known.
    pub(super) fn bound_more(self, more: &mut Vec<Fit>, fewer: &[Fit]) -> bool {
        let Self { problem, prior, .. } = self;
        let before = more.first().map_or(f64::INFINITY, |best| best.cost);
        for fit in fewer.iter().take(POLISHED) {
            let off = prior.off(&fit.x);
            let gap = fit.cost - prior.free(problem, &fit.free).penalty(&off);
            for (i, uncertain) in problem.uncertain.iter().enumerate() {
                let may_be = uncertain.is_candidate() && uncertain.within(fit.x[i], true) == fit.x[i];
                let strains = uncertain.tolerance > 0.0 && off[i].abs() > STRAINED * uncertain.tolerance;
                if !may_be || !strains || fit.free.contains(&i) {
                    continue;
                }
                let free = [&fit.free[..], &[i]].concat();
                let cost = gap + prior.free(problem, &free).penalty(&off);
                take(more, [Fit { free, columns: Vec::new(), cost, ..fit.clone() }]);
            }
        }
        more.first().is_some_and(|best| best.cost < before - 1.0)
    }

    /// Candidates with a payload in place of a strained mass. No tolerance is that wide, and a payload has much the same
    /// response; it is fitted from as many kilograms.
    pub(super) fn loaded(self, fewer: &[Fit]) -> Vec<Fit> {
        let Self { problem, prior, .. } = self;
        let each = fewer.iter().take(POLISHED).flat_map(|fit| LOADED.iter().map(move |it| (fit, it)));
        let swapped = each.filter_map(|(of, (mass, load))| {
            let (mass, load) = (problem.find(mass)?, problem.find(load)?);
            let (uncertain, of_load) = (&problem.uncertain[mass], &problem.uncertain[load]);
            let heavier = of.x[mass] - prior.mean[mass] > STRAINED * uncertain.tolerance;
            if !heavier || !of_load.is_candidate() || of.free.contains(&load) {
                return None;
            }
            let kilograms = |x: f64| uncertain.adjusted(x, problem.vehicle).1;
            let mut x = of.x.clone();
            x[mass] = prior.mean[mass];
            x[load] += (kilograms(of.x[mass]) - kilograms(x[mass])) / of_load.unit;
            Some(([&of.free[..], &[load]].concat(), x))
        });
        swapped.filter_map(|(free, x)| self.fit(&free, &x, STEPS)).collect()
    }

    /// Fits candidates of one effect less from the coordinates of the best `count` with one more. The larger search may
    /// have found the background and the others in another valley.
    pub(super) fn fewer_from_more(self, fewer: &mut Vec<Fit>, more: &[Fit], count: usize) {
        let Self { problem, prior, .. } = self;
        let starts: Vec<(Vec<usize>, Vec<f64>)> = more
            .iter()
            .take(count)
            .flat_map(|fit| (0..fit.free.len()).map(move |place| (fit, place)))
            .map(|(fit, place)| {
                let mut others = fit.free.clone();
                let gone = others.remove(place);
                (others, prior.without(problem, &[gone], &fit.x))
            })
            .collect();
        let found =
            parallel::map(problem.threads(), starts.len(), |k| self.fit(&starts[k].0, &starts[k].1, STEPS));
        take(fewer, found.into_iter().flatten());
    }

    /// Fits candidates of one effect more from the coordinates of the best with one less, where they explain hardly more.
    /// Chance alone gives one more effect some gain, so these searches began in another valley.
    pub(super) fn more_from_fewer(self, more: &mut Vec<Fit>, fewer: &[Fit], singles: &[Fit], beam: &Beam) {
        let Self { problem, linear, .. } = self;
        if more.is_empty() {
            return;
        }
        take(more, self.loaded(fewer));
        if self.bound_more(more, fewer) {
            self.refine(more);
        }
        let (Some(best), Some(behind)) = (fewer.first(), more.first()) else { return };
        if behind.cost <= best.cost - 1.0 {
            return;
        }
        let local = linear.anew(problem, &best.x, &best.gap);
        take(more, self.at(&local).extended(fewer, singles, beam));
        self.at(&local).refine(more);
    }
}
