//! `rfl diagnose --explain`: effects in words.

use crate::vehicle::{Effect, Explanation, TrailerEffects, TruckEffects, effect_like};
use std::error::Error;

/// Prints the explanation of an effect; of all effects without a name.
pub(super) fn explain(id: &str) -> Result<(), Box<dyn Error>> {
    if id.is_empty() {
        for effect in TruckEffects::all() {
            print(effect);
        }
        return Ok(());
    }
    let id = id.strip_prefix("effect.").unwrap_or(id);
    match TruckEffects::all().find(|effect| effect.id == id) {
        Some(effect) => {
            print(effect);
            Ok(())
        }
        None => {
            let near = effect_like(id).map_or(String::new(), |near| format!("; did you mean {near}?"));
            Err(format!("there is no effect '{id}'{near} 'rfl diagnose --explain' lists all").into())
        }
    }
}

fn print(effect: &Effect) {
    let Effect { id, unit, neutral, range, stage, meaning } = effect;
    let fmu = if TrailerEffects::find(id).is_some() {
        "SemiTrailerTruck"
    } else {
        "PassengerCar and SemiTrailerTruck"
    };
    say!("{id}   {meaning}");
    say!("  stage           {}", stage.name());
    if let Some(text) = Explanation::of(id) {
        say!("  what it is      {}", text.what);
        say!("  in a log        {}", text.shows);
        say!("  confused with   {}", text.confused.join(", "));
        say!("  what separates  {}", text.separates);
    }
    say!(
        "  FMU parameter   effect.{id} of {fmu}, {} ... {} {}, neutral {neutral}\n",
        range.0,
        range.1,
        unit.symbol
    );
}
