//! Explanation of each effect: its meaning, its appearance in a log, the effects that it is confused with. The texts
//! stand in `effects.toml`.

use super::effects::TruckEffects;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// An effect's explanation.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Explanation {
    /// Meaning in the vehicle.
    pub what: String,
    /// Appearance in a log.
    pub shows: String,
    /// Ids of the effects that it is confused with.
    pub confused: Vec<String>,
    /// Separation from them.
    pub separates: String,
}

static ALL: LazyLock<BTreeMap<String, Explanation>> =
    LazyLock::new(|| toml::from_str(include_str!("effects.toml")).expect("the texts are read in a test"));

impl Explanation {
    /// The explanation of the effect with this id.
    #[must_use]
    pub fn of(id: &str) -> Option<&'static Self> {
        ALL.get(id)
    }
}

/// The effect whose id is most like a mistyped word.
#[must_use]
pub fn effect_like(word: &str) -> Option<&'static str> {
    let letters = |text: &str| text.chars().filter(char::is_ascii_alphabetic).collect::<String>();
    let word = letters(word);
    let shared = |id: &str| word.chars().zip(letters(id).chars()).take_while(|(a, b)| a == b).count();
    let best = TruckEffects::all().map(|effect| effect.id).max_by_key(|id| shared(id))?;
    (shared(best) > 2).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_is_explained_and_nothing_else() {
        let ids: Vec<&str> = TruckEffects::all().map(|effect| effect.id).collect();
        for id in &ids {
            let text = Explanation::of(id).unwrap_or_else(|| panic!("{id} is not explained"));
            assert!(
                [&text.what, &text.shows, &text.separates].iter().all(|words| words.ends_with('.')),
                "{id}"
            );
            assert!(!text.confused.is_empty(), "{id}");
            for other in &text.confused {
                assert!(ids.contains(&other.as_str()) && other != id, "{id}: {other}");
            }
        }
        assert_eq!(ALL.len(), ids.len());
    }

    #[test]
    fn a_mistyped_word_finds_its_effect() {
        assert_eq!(effect_like("steer-delai"), Some("steer_delay"));
        assert_eq!(effect_like("qqq"), None);
    }
}
