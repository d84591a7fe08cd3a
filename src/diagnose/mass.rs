//! A drive's gain and a mass are one to the motion along the road: `a = g u` whether the gain `g` has changed or the mass has, by
//! `1 / g`. What tells them apart is what the mass does besides, to tyres, inertia and body. The library has a payload; where
//! that is not the cause, or not in the library, a mass of the vehicle itself that is off by more than its tolerance may be.

use super::fit::{FREED, Fit, Linear, fit};
use super::problem::Problem;
use super::rank::{Ranking, polished};
use super::replay::ReplayVehicle;

/// Masses of a car, of a tractor, of its trailer.
const MASSES: [&str; 3] = ["vehicle.mass", "tractor.mass", "trailer.mass"];
/// Steps of a fit.
const STEPS: usize = 5;

/// The best fit with a mass in place of the drive's gain, at whatever it needs, if that gain is named in `named`; and which
/// knob the mass is.
#[must_use]
pub fn instead<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    named: &Fit,
) -> Option<(usize, Fit)> {
    let gain = problem.find("drive_gain").filter(|gain| named.freed.contains(gain))?;
    let masses: Vec<usize> = MASSES.iter().filter_map(|id| problem.find(id)).collect();
    let given = |i: usize| problem.knobs[i].adjusted(0.0, problem.vehicle).0;
    let all: f64 = masses.iter().map(|&i| given(i)).sum();
    let others: Vec<usize> = named.freed.iter().copied().filter(|&i| i != gain).collect();
    let none = &ranking.none;
    let slopes = |x: &[f64], gap: &[f64]| Linear::new(problem.slopes(x, gap), ranking.linear.weights.clone());
    let at_none = slopes(&none.x, &none.gap);
    let fitted = |&mass: &usize| {
        // The vehicle's file tells the drive its mass; one that the drive does not know acts as a gain besides.
        let tie = -given(mass) / all * problem.knobs[mass].unit / problem.knobs[gain].unit;
        let mut prior = ranking.prior.clone();
        prior.covariance[(gain, gain)] += FREED.powi(2);
        prior.covariance[(mass, mass)] += (FREED / tie).powi(2);
        prior.covariance[(mass, gain)] += FREED.powi(2) / tie;
        prior.covariance[(gain, mass)] += FREED.powi(2) / tie;
        let mut there = named.x.clone();
        there[mass] = (named.x[gain] - prior.mean[gain]) / tie + prior.mean[mass];
        there[mass] = problem.knobs[mass].within(there[mass], false);
        let at_gain = problem.residual(&there).map(|gap| (&there, slopes(&there, &gap)));
        let starts = at_gain.into_iter().chain([(&none.x, at_none.clone())]);
        let found = starts.filter_map(|(x, local)| fit(problem, &prior, &local, &others, x, STEPS));
        let best = polished(problem, &prior, &ranking.linear, &found.min_by(better)?);
        Some((mass, best))
    };
    masses.iter().filter_map(fitted).min_by(|a, b| better(&a.1, &b.1))
}

fn better(a: &Fit, b: &Fit) -> std::cmp::Ordering {
    a.cost.total_cmp(&b.cost)
}
