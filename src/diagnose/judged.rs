//! The judgement of a log: the decision with the fit behind it, tested on parts of the log that the fit has not seen, in
//! numbers and words.

use super::calibration::Calibration;
use super::decision::{Decision, decide, lead};
use super::fit::{Fit, Linearisation, Precision};
use super::gap_reduction::{Predictive, gap_reduction, recalibrated};
use super::manoeuvre;
use super::naming::named;
use super::posterior::{Posterior, Unknown};
use super::problem::Problem;
use super::rank::Ranking;
use super::replay::ReplayVehicle;
use super::report::{
    Adjustment, Finding, FindingSeverity, GapReduction, Manoeuvre, ReportedHypothesis, Varies, Verdict,
    VerdictKind,
};
use super::words;
use nalgebra::DMatrix;

/// Number of other hypotheses that the next manoeuvre separates from the first, and of hypotheses in a short list.
const RIVALS: usize = 4;
const SHORT_LIST: usize = 5;

/// The decision, with the fit behind it and what it predicts.
pub(super) struct Judged {
    pub decision: Decision,
    pub winner: Fit,
    /// Slopes at the winner, the precision of its coordinates, and their covariance.
    pub local: Linearisation,
    pub precision: Precision,
    pub covariance: DMatrix<f64>,
    pub gap_reduction: GapReduction,
    pub predictive: Predictive,
    /// Coordinates of the calibrated simulator.
    pub simulator: Vec<f64>,
    /// True if pairs were left out of the search and would be likelier than nothing.
    pub more_than_one: bool,
}

impl Judged {
    /// The drive that tells apart what else the log may mean.
    pub fn next_manoeuvre<V: ReplayVehicle>(
        &self,
        problem: &Problem<V>,
        ranking: &Ranking,
        posterior: &Posterior,
    ) -> Option<Manoeuvre> {
        let rivals: Vec<&Fit> = posterior
            .hypotheses
            .iter()
            .filter(|it| it.unknown.is_none() && !it.is_of(&self.winner.free))
            .filter_map(|it| ranking.find(&it.effects))
            .take(RIVALS)
            .collect();
        let tells_apart = matches!(self.decision.kind, VerdictKind::Effect | VerdictKind::CannotTell);
        (tells_apart && !self.winner.free.is_empty())
            .then(|| manoeuvre::next(problem, ranking, &self.winner, &rivals))?
    }

    /// An uncertain parameter at a point, in its own unit.
    fn adjustment<V: ReplayVehicle>(
        &self,
        problem: &Problem<V>,
        vehicle: &V,
        i: usize,
        x: &[f64],
    ) -> Adjustment {
        let it = &problem.uncertain[i];
        let (given, value) = it.adjusted(x[i], vehicle);
        Adjustment {
            parameter: it.parameter(),
            given,
            value,
            tolerance: it.deviation(it.tolerance, vehicle),
            deviation: it.deviation(self.covariance[(i, i)].max(0.0).sqrt(), vehicle),
            unit: it.symbol::<V>(),
        }
    }

    /// Adjustments beside the effects, each within its tolerance.
    pub fn recalibration<V: ReplayVehicle>(&self, problem: &Problem<V>, vehicle: &V) -> Vec<Adjustment> {
        if !self.predictive.recalibration_gains() {
            return Vec::new();
        }
        let free = problem.with_companions(&self.winner.free);
        let is_adjusted = |&i: &usize| {
            let it = &problem.uncertain[i];
            self.precision.free.contains(&i) && !free.contains(&i) && it.tolerance > 0.0 && !it.is_form()
        };
        let adjusted = (0..problem.uncertain.len()).filter(is_adjusted);
        adjusted.map(|i| self.adjustment(problem, vehicle, i, &self.simulator)).collect()
    }

    /// The verdict in numbers and words.
    pub fn verdict<V: ReplayVehicle>(
        &self,
        problem: &Problem<V>,
        ranking: &Ranking,
        vehicle: &V,
        (findings, straight): (&[Finding], bool),
        (posterior, hypotheses): (&Posterior, &[ReportedHypothesis]),
        next: Option<&Manoeuvre>,
    ) -> Verdict {
        let Self { decision, winner, covariance, gap_reduction, .. } = self;
        let interval = Calibration::built_in().interval;
        let mut effects = named(problem, ranking, winner, &decision.classes, covariance, interval);
        // What matters most stands first.
        effects.sort_by(|a, b| b.dominance.total_cmp(&a.dominance));
        if let Some(next) = next {
            let alike =
                effects.iter_mut().filter(|effect| effect.class.len() > 1 && effect.separated_by.is_empty());
            alike.for_each(|effect| effect.separated_by = format!("{}: {}", next.name, next.how));
        }
        let unknown = decision.unknown.filter(|_| decision.kind == VerdictKind::NotInLibrary);
        let strained = match unknown {
            Some(Unknown::Off { uncertain, x }) => {
                let mut at = winner.x.clone();
                at[uncertain] = x;
                Some(self.adjustment(problem, vehicle, uncertain, &at))
            }
            _ => None,
        };
        let varying = match unknown {
            Some(Unknown::Varies(it)) => {
                let uncertain = &problem.uncertain[it.effect];
                Some(Varies {
                    id: uncertain.id.to_owned(),
                    with: it.with,
                    deviation: uncertain.deviation(it.deviation, vehicle),
                    unit: uncertain.symbol::<V>(),
                    evidence: it.gain,
                })
            }
            _ => None,
        };
        let short_list: Vec<ReportedHypothesis> = match decision.kind {
            // Before it is cleared up what a suspicious log shows, nothing in it is a cause.
            VerdictKind::CannotTell if !is_suspicious(findings) => {
                hypotheses.iter().take(SHORT_LIST).cloned().collect()
            }
            _ => Vec::new(),
        };
        let tolerance_factor = posterior.wide().filter(|_| decision.kind == VerdictKind::None);
        let swings = unknown == Some(Unknown::Swings);
        let why = words::UnknownSign { varying: varying.as_ref(), strained: strained.as_ref(), swings };
        let words = match decision.kind {
            VerdictKind::CannotTell => {
                let advice = words::Advice { next, more_than_one: self.more_than_one };
                words::cannot_tell(findings, straight, &short_list, &effects, &self.predictive, advice)
            }
            VerdictKind::Effect => words::effect(&effects, gap_reduction, decision.probability),
            VerdictKind::None => {
                words::none(gap_reduction, tolerance_factor, &self.recalibration(problem, vehicle))
            }
            VerdictKind::NotInLibrary => words::not_in_library(&effects, why, gap_reduction),
        };
        let (effects, nearest) = match decision.kind {
            VerdictKind::Effect => (effects, Vec::new()),
            VerdictKind::NotInLibrary => (Vec::new(), effects),
            VerdictKind::None | VerdictKind::CannotTell => (Vec::new(), Vec::new()),
        };
        let (kind, probability) = (decision.kind, decision.probability);
        Verdict {
            kind,
            probability,
            effects,
            nearest,
            tolerance_factor,
            short_list,
            varying,
            strained,
            summary: words,
        }
    }
}

fn is_suspicious(findings: &[Finding]) -> bool {
    findings.iter().any(|finding| finding.gravity == FindingSeverity::Suspicion)
}

/// Decides from a posterior, after a test on parts of the log that a fit has not seen.
pub(super) fn judge<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    posterior: &Posterior,
    straight: bool,
    findings: &[Finding],
) -> Judged {
    let lead = lead(posterior);
    let winner = ranking.find(&lead.effects).unwrap_or(&ranking.none).clone();
    let local = ranking.linear_at(problem, &winner);
    let (gap_reduction, predictive) = gap_reduction(problem, ranking, &winner, &local.slopes);
    let predicts = predictive.names(lead.effects.len());
    let mut decision = decide(lead, predicts);
    // A pair explains no less than the better of its two: here more than the odds against both.
    let odds = 2.0 * Calibration::built_in().telling();
    let by_one = ranking.singles.first().filter(|best| ranking.none.cost - best.cost > odds);
    let more_than_one = decision.kind == VerdictKind::None && !ranking.with_pairs && by_one.is_some();
    if straight && decision.kind != VerdictKind::None || is_suspicious(findings) || more_than_one {
        decision.kind = VerdictKind::CannotTell;
    }
    let precision = ranking.prior.free(problem, &winner.free);
    let covariance = local.covariance(&precision);
    // What is calibrated beside the effects has to hold on what its fit has not seen.
    let simulator = if predictive.recalibration_gains() {
        recalibrated(problem, &ranking.prior, &local, &winner.free, &winner.x)
    } else {
        ranking.prior.only(problem, &winner.free, &winner.x)
    };
    Judged {
        decision,
        winner,
        local,
        precision,
        covariance,
        gap_reduction,
        predictive,
        simulator,
        more_than_one,
    }
}
