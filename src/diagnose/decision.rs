//! The decision from the posterior: the most probable of nothing, a set of effects, and a cause outside the library. No
//! decision is made where none has a probability above one half, or where a name does not predict data unseen by its
//! fit.
//!
//! A set of effects stands with its class: an effect and its nearly as probable alternatives beside the rest. The class
//! is as probable as all its sets together.

use super::posterior::{Posterior, Unknown};
use super::report::VerdictKind;

/// Probability of an alternative, as a share of the best's, from which on it is of the class.
const ALIKE: f64 = 0.1;
/// Probability above which a hypothesis is more probable than not.
const MORE_THAN_NOT: f64 = 0.5;

/// The most probable cause.
#[derive(Debug, Clone, PartialEq)]
pub struct Decision {
    pub kind: VerdictKind,
    /// Probability of the verdict; if the log does not tell, of the most probable hypothesis.
    pub probability: f64,
    /// The effects that are named; for a cause outside the library, the nearest ones.
    pub effects: Vec<usize>,
    /// Alternatives to each effect.
    pub classes: Vec<Vec<usize>>,
    /// Sign that the cause is not in the library.
    pub unknown: Option<Unknown>,
}

/// Alternatives to each effect of a set, and their joint probability.
fn classes(posterior: &Posterior, effects: &[usize]) -> (Vec<Vec<usize>>, f64) {
    let best = posterior.of_set(effects);
    let others = |own: usize| effects.iter().copied().filter(move |&it| it != own);
    let class_of = |&own: &usize| {
        let mut class = vec![own];
        for hypothesis in posterior.hypotheses.iter().filter(|it| it.unknown.is_none()) {
            let is_beside = hypothesis.effects.len() == effects.len()
                && others(own).all(|it| hypothesis.effects.contains(&it))
                && hypothesis.probability >= ALIKE * best;
            let new = |it: &&usize| !effects.contains(it) && !class.contains(it);
            let found: Vec<usize> = hypothesis.effects.iter().filter(new).copied().collect();
            class.extend(found.into_iter().filter(|_| is_beside));
        }
        class.sort_unstable();
        class
    };
    let classes: Vec<Vec<usize>> = effects.iter().map(class_of).collect();
    let is_inside = |of: &[usize]| of.len() == effects.len() && fits(of, &classes);
    let inside = posterior.hypotheses.iter().filter(|it| it.unknown.is_none() && is_inside(&it.effects));
    let probability = inside.map(|it| it.probability).sum();
    (classes, probability)
}

/// True if each effect finds a class of its own.
fn fits(effects: &[usize], classes: &[Vec<usize>]) -> bool {
    let Some((first, rest)) = effects.split_first() else { return true };
    (0..classes.len()).filter(|&place| classes[place].contains(first)).any(|place| {
        let left: Vec<Vec<usize>> = classes
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != place)
            .map(|(_, it)| it.clone())
            .collect();
        fits(rest, &left)
    })
}

/// The most probable of all, regardless of its prediction.
#[must_use]
pub fn lead(posterior: &Posterior) -> Decision {
    let nothing = Decision {
        kind: VerdictKind::None,
        probability: posterior.none(),
        effects: Vec::new(),
        classes: Vec::new(),
        unknown: None,
    };
    let of_unknown = posterior.hypotheses.iter().find(|it| it.unknown.is_some());
    let unknown = of_unknown.map(|it| Decision {
        kind: VerdictKind::NotInLibrary,
        probability: posterior.unknown(),
        effects: it.effects.clone(),
        classes: Vec::new(),
        unknown: it.unknown,
    });
    let of_set = posterior.hypotheses.iter().find(|it| it.unknown.is_none() && !it.effects.is_empty());
    let set = of_set.map(|it| {
        let (classes, probability) = classes(posterior, &it.effects);
        Decision {
            kind: VerdictKind::Effect,
            probability,
            effects: it.effects.clone(),
            classes,
            unknown: None,
        }
    });
    let others = [set, unknown].into_iter().flatten();
    others.fold(nothing, |best, it| if it.probability > best.probability { it } else { best })
}

/// The verdict: the lead, if it is more probable than not, and predicts.
#[must_use]
pub fn decide(lead: Decision, predicts: bool) -> Decision {
    let tells = lead.probability >= MORE_THAN_NOT && (predicts || lead.kind != VerdictKind::Effect);
    if tells { lead } else { Decision { kind: VerdictKind::CannotTell, ..lead } }
}

#[cfg(test)]
mod tests {
    use super::super::posterior::Hypothesis;
    use super::super::replay::Channel;
    use super::*;

    fn posterior(of: &[(&[usize], bool, f64)]) -> Posterior {
        let hypothesis = |&(effects, unknown, probability): &(&[usize], bool, f64)| Hypothesis {
            effects: effects.to_vec(),
            unknown: unknown.then_some(Unknown::Misfit(3.0, Channel::Ay)),
            terms: Vec::new(),
            probability: probability.ln(),
        };
        Posterior::normalised(of.iter().map(hypothesis).collect())
    }

    fn verdict(of: &[(&[usize], bool, f64)], predicts: bool) -> (VerdictKind, Vec<usize>, f64) {
        let found = decide(lead(&posterior(of)), predicts);
        (found.kind, found.effects, (found.probability * 1e9).round() / 1e9)
    }

    #[test]
    fn the_most_probable_is_named_if_it_is_more_probable_than_not_and_predicts() {
        use VerdictKind::{CannotTell, Effect, None, NotInLibrary};
        let (nothing, one, two): (&[usize], &[usize], &[usize]) = (&[], &[1], &[1, 2]);
        for (of, predicts, expected) in [
            (vec![(nothing, false, 0.9), (one, false, 0.1)], false, (None, vec![], 0.9)),
            (vec![(nothing, false, 0.3), (one, false, 0.7)], true, (Effect, vec![1], 0.7)),
            (vec![(nothing, false, 0.3), (one, false, 0.7)], false, (CannotTell, vec![1], 0.7)),
            (vec![(one, true, 0.6), (one, false, 0.4)], true, (NotInLibrary, vec![1], 0.6)),
            // Two unknown causes are one verdict.
            (vec![(one, true, 0.3), (two, true, 0.3), (one, false, 0.4)], true, (NotInLibrary, vec![1], 0.6)),
            // A further effect that is not sure keeps both sets from being named.
            (
                vec![(one, false, 0.45), (two, false, 0.4), (nothing, false, 0.15)],
                true,
                (CannotTell, vec![1], 0.45),
            ),
        ] {
            assert_eq!(verdict(&of, predicts), expected, "{of:?}");
        }
    }

    #[test]
    fn a_class_is_as_probable_as_its_members_together() {
        let of: Vec<(&[usize], bool, f64)> = vec![
            (&[1, 2], false, 0.3),
            (&[1, 3], false, 0.25),
            (&[4, 2], false, 0.2),
            (&[4, 3], false, 0.15),
            (&[], false, 0.1),
        ];
        let found = decide(lead(&posterior(&of)), true);
        assert_eq!((found.kind, found.effects), (VerdictKind::Effect, vec![1, 2]));
        assert_eq!(found.classes, [vec![1, 4], vec![2, 3]]);
        assert!((found.probability - 0.9).abs() < 1e-9);
        // What is a tenth as probable is of no class.
        let far: Vec<(&[usize], bool, f64)> =
            vec![(&[1], false, 0.9), (&[2], false, 0.05), (&[], false, 0.05)];
        let found = lead(&posterior(&far));
        assert_eq!(found.classes, [vec![1]]);
        assert!((found.probability - 0.9).abs() < 1e-9);
    }
}
