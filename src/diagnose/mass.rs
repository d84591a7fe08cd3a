//! A drive's gain and a mass are one to the motion along the road: `a = g u` whether the gain `g` has changed or the mass has, by
//! `1 / g`. What tells them apart is what the mass does besides, to tyres, inertia and body. So a gain is compared with a mass
//! of the vehicle itself that is off by more than its tolerance, which is no effect of the library; and a payload with the gain
//! where that may not be named: what a payload does besides has to speak for it.

use super::fit::{FREED, Fit, Prior, fit};
use super::knob::LOADED;
use super::problem::Problem;
use super::rank::{Ranking, polished};
use super::replay::ReplayVehicle;

const GAIN: &str = "drive_gain";
/// Steps of a fit.
const STEPS: usize = 5;

/// The best fit with a mass in place of a gain that is named in `named`, or with the gain in place of a payload, each at
/// whatever it needs; and which knob it is that stands there.
#[must_use]
pub fn instead<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    named: &Fit,
) -> Option<(usize, Fit)> {
    let gain = problem.find(GAIN)?;
    let masses: Vec<usize> = LOADED.iter().filter_map(|(id, _)| problem.find(id)).collect();
    let given = |i: usize| problem.knobs[i].adjusted(0.0, problem.vehicle).0;
    let all: f64 = masses.iter().map(|&i| given(i)).sum();
    // What of the gain's coordinate some kilograms more are.
    let of_gain = |kilograms: f64| -kilograms / all / problem.knobs[gain].unit;
    let (none, mean) = (&ranking.none, &ranking.prior.mean);
    let off = ranking.prior.off(&named.x);
    let mut free = ranking.prior.clone();
    free.covariance[(gain, gain)] += FREED.powi(2);

    // What stands in whose place, where its search begins, and what is known of it.
    let mut rivals: Vec<(usize, usize, Vec<f64>, Prior)> = Vec::new();
    for &mass in masses.iter().filter(|_| named.freed.contains(&gain)) {
        // The vehicle's file tells the drive its mass; one that the drive does not know acts as a gain besides.
        let tie = of_gain(given(mass) * problem.knobs[mass].unit);
        let mut prior = free.clone();
        prior.covariance[(mass, mass)] += (FREED / tie).powi(2);
        prior.covariance[(mass, gain)] += FREED.powi(2) / tie;
        prior.covariance[(gain, mass)] += FREED.powi(2) / tie;
        let mut there = named.x.clone();
        there[mass] = problem.knobs[mass].within(mean[mass] + off[gain] / tie, false);
        rivals.push((gain, mass, there, prior));
    }
    if !problem.knobs[gain].is_candidate() {
        let is_load = |i: &&usize| LOADED.iter().any(|(_, id)| problem.knobs[**i].id == *id);
        for &payload in named.freed.iter().filter(is_load) {
            let mut there = ranking.prior.without(problem, &[payload], &named.x);
            let at = mean[gain] + of_gain(off[payload] * problem.knobs[payload].unit);
            there[gain] = problem.knobs[gain].within(at, false);
            rivals.push((payload, gain, there, free.clone()));
        }
    }
    if rivals.is_empty() {
        return None;
    }
    let linear = &ranking.linear;
    let at_none = linear.anew(problem, &none.x, &none.gap);
    let fitted = |(own, rival, there, prior): (usize, usize, Vec<f64>, Prior)| {
        let others: Vec<usize> = named.freed.iter().copied().filter(|&i| i != own).collect();
        let local = problem.residual(&there).map(|gap| (&there, linear.anew(problem, &there, &gap)));
        let starts = local.into_iter().chain([(&none.x, at_none.clone())]);
        let found = starts.filter_map(|(x, local)| fit(problem, &prior, &local, &others, x, STEPS));
        let best = found.min_by(better)?;
        Some((rival, polished(problem, &prior, linear, &best)))
    };
    rivals.into_iter().filter_map(fitted).min_by(|a, b| better(&a.1, &b.1))
}

fn better(a: &Fit, b: &Fit) -> std::cmp::Ordering {
    a.cost.total_cmp(&b.cost)
}
