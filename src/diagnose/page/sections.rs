//! The answer in words, bars and tables.

use super::html::{escaped, folded, number, percent, table, unit_of};
use crate::diagnose::headline::behind;
use crate::diagnose::words::weight;
use crate::diagnose::{
    Candidate, FindingSeverity, Gap, GapLocation, NamedEffect, Report, ReportedHypothesis, Verdict,
    VerdictKind,
};
use crate::vehicle::{Explanation, NO_RATE_LIMIT, Stage, TruckEffects};
use std::collections::BTreeMap;

/// The verdict as a title.
pub(super) fn headline(verdict: &Verdict) -> String {
    match verdict.kind {
        VerdictKind::Effect => {
            let named: Vec<String> =
                verdict.effects.iter().map(|effect| value(effect.value, &effect.id, &effect.unit)).collect();
            named.join(" and ")
        }
        VerdictKind::None if verdict.tolerance_factor.is_some() => {
            "no effect, but the vehicle's numbers are off".into()
        }
        VerdictKind::None => "nothing worth naming".into(),
        VerdictKind::NotInLibrary => "not in the library of effects".into(),
        VerdictKind::CannotTell => "this log does not tell".into(),
    }
}

fn value(value: f64, id: &str, unit: &str) -> String {
    if value >= NO_RATE_LIMIT {
        return format!("{id}: no limit");
    }
    format!("{id} = {}{}", number(value), behind(unit))
}

/// Banner, tiles, and the meaning of each named effect.
pub(super) fn verdict(report: &Report) -> String {
    let verdict = &report.verdict;
    let mut html = format!(
        "<div class='banner {}'><div class='faint'>Sim-to-real diagnosis of {} against {}</div><h1>{}</h1><p>{}</p><div class='tiles'>",
        verdict.kind.name(),
        escaped(report.inputs.files.get("log").map_or("a log", |file| &file.file)),
        escaped(&report.inputs.vehicle),
        escaped(&headline(verdict)),
        escaped(&verdict.summary)
    );
    let mut tile = |name: &str, text: String| {
        html += &format!("<div><span>{}</span><b>{}</b></div>", escaped(name), escaped(&text))
    };
    if verdict.kind != VerdictKind::CannotTell {
        tile("probability", percent(verdict.probability));
    }
    for effect in &verdict.effects {
        let unit = if effect.unit == "1" { "" } else { &effect.unit };
        tile(
            &format!("{}, 95 %", effect.id),
            format!("{} to {} {unit}", number(effect.low), number(effect.high)),
        );
        tile("stage", effect.stage.name().to_owned());
        tile("gap of the effect over that of the background", number(effect.dominance));
    }
    let first =
        report.inputs.signals.iter().find_map(|name| Some((name, report.gap_reduction.open_loop.get(name)?)));
    if let Some((name, gap)) = first.filter(|_| verdict.kind == VerdictKind::Effect) {
        tile(&format!("gap in {name} closed"), percent(1.0 - gap.recalibrated / gap.before));
    }
    html += "</div></div>";
    html + &verdict.effects.iter().map(explained).collect::<String>()
}

fn explained(effect: &NamedEffect) -> String {
    let mut html = format!("<h3>{}</h3><p>", escaped(&effect.id));
    if let Some(text) = Explanation::of(&effect.id) {
        html += &format!("{} {}", escaped(&text.what), escaped(&text.shows));
    }
    html += "</p>";
    let others: Vec<&str> = effect.class.iter().map(String::as_str).filter(|id| *id != effect.id).collect();
    if !others.is_empty() {
        html += &format!(
            "<p><b>This log cannot tell it from {}.</b> A drive that could: {}.</p>",
            escaped(&others.join(", ")),
            escaped(effect.separated_by.trim_end_matches('.'))
        );
    }
    html
}

/// A waterfall of each signal's gap, and the horizons.
pub(super) fn gap_reduction(report: &Report) -> String {
    let mut html = String::new();
    let reduction = &report.gap_reduction;
    if !reduction.open_loop.is_empty() {
        html += "<p class='faint'>RMS of real minus simulated on held-out parts of the log, the simulator replayed from the commands. The effect's share and the recalibration's stand apart.</p>";
    }
    let ordered = in_order(report, &reduction.open_loop);
    for (name, gap) in ordered.iter().take(MAIN) {
        html += &format!(
            "<h3>{} <span class='faint'>({})</span></h3>{}",
            escaped(name),
            unit_of(name),
            waterfall(gap)
        );
    }
    let header = ["signal", "before", "effect", "recalibrated", "learnable", "noise", "closed"];
    let named = |name: &str| format!("{} ({})", escaped(name), unit_of(name));
    if ordered.len() > MAIN {
        let rows: Vec<_> =
            ordered[MAIN..].iter().map(|(name, gap)| gap_row(vec![named(name)], gap)).collect();
        html += &format!("<h3>The other signals</h3>{}", table(&header, &rows, 1));
    }
    for (horizon, signals) in &reduction.horizons {
        let rows: Vec<_> =
            in_order(report, signals).iter().map(|(name, gap)| gap_row(vec![named(name)], gap)).collect();
        html += &format!(
            "<details><summary>When the simulator starts anew from the log every {} s</summary>{}</details>",
            escaped(horizon),
            table(&header, &rows, 1)
        );
    }
    if let Some(errors) = &reduction.closed_loop {
        html += "<h3>With the loop closed</h3><p class='faint'>The same controller drives the simulator along the path; its tracking error against that of the log, at the same stations.</p>";
        for (name, gap) in errors {
            html += &format!(
                "<h3>{} <span class='faint'>({})</span></h3>{}",
                escaped(name),
                unit_of(name),
                waterfall(gap)
            );
        }
    }
    html
}

/// Signals that are shown at large; the others are tables, or folded.
const MAIN: usize = 3;

/// Entries of each signal, in the order in which they were compared.
fn in_order<'a, T>(report: &Report, of: &'a BTreeMap<String, T>) -> Vec<(&'a str, &'a T)> {
    let place =
        |name: &str| report.inputs.signals.iter().position(|signal| signal == name).unwrap_or(usize::MAX);
    let mut all: Vec<(&str, &T)> = of.iter().map(|(name, value)| (name.as_str(), value)).collect();
    all.sort_by_key(|(name, _)| place(name));
    all
}

fn gap_row(mut cells: Vec<String>, gap: &Gap) -> Vec<String> {
    cells.extend(
        [gap.before, gap.effect, gap.recalibrated, gap.learnable.unwrap_or(f64::NAN), gap.noise].map(number),
    );
    cells.push(percent(1.0 - gap.recalibrated / gap.before));
    cells
}

fn waterfall(gap: &Gap) -> String {
    let most = [gap.before, gap.effect, gap.recalibrated, gap.noise].into_iter().fold(1e-300, f64::max);
    let mut html = String::from("<div class='fall'>");
    let mut bar = |name: &str, from: f64, to: f64, colour: &str, text: String| {
        let (low, high) = (from.min(to).clamp(0.0, most) / most, from.max(to).clamp(0.0, most) / most);
        html += &format!(
            "<span>{name}</span><span class='bar'><i style='margin-left:{:.2}%;width:{:.2}%;background:var({colour})'></i></span><span class='v'>{text}</span>",
            100.0 * low,
            100.0 * (high - low)
        );
    };
    let change = |from: f64, to: f64| {
        if to <= from { format!("−{}", number(from - to)) } else { format!("+{}", number(to - from)) }
    };
    bar("before", 0.0, gap.before, "--simulated", number(gap.before));
    bar("the effect", gap.effect, gap.before, "--effect", change(gap.before, gap.effect));
    bar("recalibration", gap.recalibrated, gap.effect, "--corrected", change(gap.effect, gap.recalibrated));
    bar(
        "left",
        0.0,
        gap.recalibrated,
        "--ink",
        format!("{} ({})", number(gap.recalibrated), percent(gap.recalibrated / gap.before)),
    );
    if let Some(learnable) = gap.learnable.filter(|learnable| *learnable < gap.recalibrated) {
        bar(
            "of that still learnable",
            learnable,
            gap.recalibrated,
            "--warn",
            number(gap.recalibrated - learnable),
        );
    }
    bar("noise floor", 0.0, gap.noise, "--faint", number(gap.noise));
    html + "</div>"
}

/// The way from command to measurement, with the stage at which the gap enters.
pub(super) fn stages(report: &Report) -> String {
    let all = [
        Stage::Command,
        Stage::Actuator,
        Stage::Linkage,
        Stage::Tyre,
        Stage::Body,
        Stage::Road,
        Stage::Drive,
        Stage::Sensor,
    ];
    let Some(stage) = report.stage else { return String::new() };
    let chain: Vec<String> = all
        .into_iter()
        .map(|each| format!("<span{}>{}</span>", if each == stage { " class='on'" } else { "" }, each.name()))
        .collect();
    format!("<p>The gap enters here:</p><div class='chain'>{}</div>", chain.join("<em>→</em>"))
}

/// A heat map for each signal: regimes by their bins.
pub(super) fn places(report: &Report) -> String {
    let mut signals: BTreeMap<String, BTreeMap<&str, Vec<&GapLocation>>> = BTreeMap::new();
    for place in &report.location {
        signals.entry(place.signal.clone()).or_default().entry(&place.regime).or_default().push(place);
    }
    if signals.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<p class='faint'>RMS of the gap in each regime; below it its share of the whole squared gap, and how far that is beyond chance, in standard deviations.</p>",
    );
    for (place, (signal, regimes)) in in_order(report, &signals).into_iter().enumerate() {
        let hottest = regimes.values().flatten().map(|place| place.rms).fold(1e-300, f64::max);
        let title = format!("{} <span class='faint'>({})</span>", escaped(signal), unit_of(signal));
        let folded = place >= MAIN;
        html += &if folded {
            format!("<details><summary>{title}</summary>")
        } else {
            format!("<h3>{title}</h3>")
        };
        html += "<div class='scroll'><table class='heat'>";
        for (regime, places) in regimes {
            let mut places = places.clone();
            places.sort_by(|a, b| a.from.total_cmp(&b.from));
            html += &format!("<tr><th>{}</th>", escaped(&regime_label(regime)));
            for place in places.iter() {
                html += &format!(
                    "<td style='background:color-mix(in srgb, var(--hot) {:.0}%, transparent)' title='{} samples'>{}<br><b>{}</b><small>{}, {:.1} σ</small></td>",
                    75.0 * place.rms / hottest,
                    place.count,
                    escaped(&bin(regime, place)),
                    number(place.rms),
                    percent(place.share),
                    place.significance
                );
            }
            html += "</tr>";
        }
        html += if folded { "</table></div></details>" } else { "</table></div>" };
    }
    html
}

fn regime_label(regime: &str) -> String {
    let unit = match regime {
        "speed" => "m/s",
        "lateral_accel" => "m/s2",
        "curvature" => "1/m",
        "steer_rate" => "rad/s",
        "time" => "s",
        "station" => "m",
        "frequency" => "Hz",
        _ => "",
    };
    let name = regime.replace('_', " ");
    if unit.is_empty() { name } else { format!("{name} ({unit})") }
}

fn bin(regime: &str, place: &GapLocation) -> String {
    match regime {
        "side" if place.from < 0.0 => "right".into(),
        "side" => "left".into(),
        _ => format!("{} to {}", number(place.from), number(place.to)),
    }
}

/// Hypotheses that are shown at large.
const SHOWN: usize = 6;
/// Probability below which a hypothesis is only folded away.
const UNLIKELY: f64 = 0.01;

/// Possible causes with their probabilities; empty where there is nothing to tabulate.
pub(super) fn posterior(report: &Report) -> String {
    let Some(posterior) = &report.posterior else { return String::new() };
    let said = |it: &ReportedHypothesis| {
        let effects = it.effects.iter().map(|id| escaped(id)).collect::<Vec<_>>().join(" and ");
        match (&it.not_in_library, effects.is_empty()) {
            (None, true) => "nothing worth naming".into(),
            (None, false) => effects,
            (Some(why), true) => format!("not in the library: {}", escaped(why)),
            (Some(why), false) => format!("not in the library: {} (beside {effects})", escaped(why)),
        }
    };
    let row = |it: &ReportedHypothesis| {
        let meter =
            format!("<span class='meter'><i style='width:{:.0}%'></i></span>", 100.0 * it.probability);
        vec![said(it), format!("{meter}{}", percent(it.probability))]
    };
    let likely = |it: &&ReportedHypothesis| it.probability >= UNLIKELY;
    let rows: Vec<_> = posterior.hypotheses.iter().filter(likely).map(row).collect();
    let (first, rest) = rows.split_at(SHOWN.min(rows.len()));
    let mut html = table(&["what may be the matter", "probability"], first, 2);
    if !rest.is_empty() {
        html += &folded(&format!("{} others", rest.len()), &table(&["", ""], rest, 2));
    }
    if let Some(likeliest) =
        posterior.tolerances.iter().max_by(|a, b| a.probability.total_cmp(&b.probability))
    {
        html += &format!(
            "<p class='faint'>How good the vehicle's numbers are, most probably ({}): tolerances {} times as wide as those of a careful measurement.</p>",
            percent(likeliest.probability),
            number(likeliest.factor),
        );
    }
    html
}

/// All candidates with their evidence.
pub(super) fn candidates(report: &Report) -> String {
    let most = report.candidates.iter().map(|candidate| candidate.evidence).fold(1e-300, f64::max);
    let row = |(place, candidate): (usize, &Candidate)| {
        let values = candidate.effects.iter().zip(&candidate.values).map(|(id, number)| {
            let unit =
                TruckEffects::all().find(|effect| effect.id == id).map_or("", |effect| effect.unit.symbol);
            escaped(&value(*number, id, unit))
        });
        let width = (100.0 * candidate.evidence / most).clamp(0.0, 100.0);
        vec![
            (place + 1).to_string(),
            values.collect::<Vec<_>>().join("<br>"),
            format!(
                "<span class='meter'><i style='width:{width:.0}%'></i></span>{}",
                weight(candidate.evidence)
            ),
            escaped(&candidate.why),
        ]
    };
    let rows: Vec<Vec<String>> = report.candidates.iter().enumerate().map(row).collect();
    let header = ["", "cause", "evidence", "why it stands here"];
    let (first, rest) = rows.split_at(SHOWN.min(rows.len()));
    match (first.is_empty(), rest.is_empty()) {
        (true, _) => String::new(),
        (_, true) => table(&header, first, 4),
        _ => table(&header, first, 4) + &folded(&format!("{} others", rest.len()), &table(&header, rest, 4)),
    }
}

/// Effects that the log can show.
pub(super) fn observability(report: &Report) -> String {
    let rows: Vec<Vec<String>> = report
        .observability
        .iter()
        .map(|one| {
            let unit = TruckEffects::all()
                .find(|effect| effect.id == one.effect)
                .map_or("", |effect| effect.unit.symbol);
            let (class, word) = if one.observable { ("yes", "yes") } else { ("no", "no") };
            let least = one.least.map_or("–".into(), |least| {
                format!("{} {}", number(least), if unit == "1" { "" } else { unit })
            });
            vec![
                escaped(&one.effect),
                format!("<span class='{class}'>{word}</span>"),
                least,
                escaped(&one.why),
            ]
        })
        .collect();
    let seen = report.observability.iter().filter(|one| one.observable).count();
    let header = ["effect", "observable", "from", "why"];
    let all = folded(
        &format!("{seen} of {} effects can be seen in this log", rows.len()),
        &table(&header, &rows, 4),
    );
    if rows.is_empty() { String::new() } else { all }
}

/// The next manoeuvre.
pub(super) fn manoeuvre(report: &Report) -> String {
    let Some(next) = &report.next_manoeuvre else { return String::new() };
    format!(
        "<h3>{}</h3><p>{}; {}.</p><p class='faint'>It tells apart {}; expected evidence {}.</p>",
        escaped(&next.name),
        escaped(&next.how),
        escaped(&next.also),
        escaped(&next.separates.join(" and ")),
        weight(next.expected_evidence)
    )
}

/// Adjusted numbers, and the files.
pub(super) fn recalibration(report: &Report, files: &[(String, String)]) -> String {
    let mut html = String::new();
    if !files.is_empty() {
        html += "<ul>";
        for (name, what) in files {
            html += &format!("<li><code>{}</code> {}</li>", escaped(name), escaped(what));
        }
        html += "</ul>";
    }
    let rows: Vec<Vec<String>> = report
        .recalibration
        .iter()
        .map(|one| {
            let moved = if one.tolerance > 0.0 { (one.value - one.given) / one.tolerance } else { f64::NAN };
            vec![
                format!("<code>{}</code>", escaped(&one.parameter)),
                number(one.given),
                number(one.value),
                number(one.tolerance),
                number(one.deviation),
                number(moved),
                escaped(&one.unit),
            ]
        })
        .collect();
    if !rows.is_empty() {
        html += &table(
            &["adjusted", "given", "now", "tolerance", "uncertainty now", "moved, in tolerances", "unit"],
            &rows,
            1,
        );
    }
    html
}

/// Findings in the log.
pub(super) fn findings(report: &Report) -> String {
    let rows: Vec<Vec<String>> = report
        .findings
        .iter()
        .map(|finding| {
            let word = match finding.gravity {
                FindingSeverity::Note => "note",
                FindingSeverity::Warning => "warning",
                FindingSeverity::Suspicion => "suspicion",
            };
            let signal = finding.signal.as_deref().unwrap_or_default();
            vec![format!("<span class='{word}'>{word}</span>"), escaped(signal), escaped(&finding.summary)]
        })
        .collect();
    if rows.is_empty() {
        "<p>Nothing to remark.</p>".into()
    } else {
        table(&["", "column", "what was found"], &rows, 3)
    }
}

/// Files, hashes, tolerances.
pub(super) fn inputs(report: &Report) -> String {
    let inputs = &report.inputs;
    let file = |(what, file): (&String, &crate::diagnose::InputFile)| {
        vec![escaped(what), escaped(&file.file), format!("<code>{}</code>", escaped(&file.hash))]
    };
    let mut html =
        table(&["", "file", "hash (FNV-1a, 64 bits)"], &inputs.files.iter().map(file).collect::<Vec<_>>(), 3);
    html += &format!(
        "<p class='faint'>{:.1} s at {:.0} samples a second; compared: {}. Seed {}, rfl {}.</p>",
        inputs.duration,
        inputs.rate,
        escaped(&inputs.signals.join(", ")),
        report.seed,
        escaped(&report.version)
    );
    if !inputs.tolerances.is_empty() {
        let row = |(name, value): (&String, &f64)| vec![escaped(name), number(*value)];
        let rows: Vec<_> = inputs.tolerances.iter().map(row).collect();
        html += &folded("Tolerances (standard deviations, SI units)", &table(&["of", "deviation"], &rows, 1));
    }
    html
}
