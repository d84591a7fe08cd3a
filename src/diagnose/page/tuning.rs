//! Result of a tuning as a page: the figures before and after, margins over speed, the response to an offset.

use super::html::{escaped, figure, number, section, table};
use super::plot::{Colour, Plot, PlotCurve, legend};
use crate::control::Margins;
use crate::simulate::tune::{ScenarioResult, TuneCandidate};

/// A speed in m/s with the margins there; none where the loop is unstable.
pub type AtSpeed = (f64, Option<Margins>);

/// Contents of a page of a tuning. Pairs are the default controller and the tuned one.
#[allow(missing_docs)]
pub struct Tuned<'a> {
    pub vehicle: &'a str,
    /// Prediction model of the controller.
    pub variant: &'a str,
    /// Result in words.
    pub words: &'a str,
    /// True if the tuned one is better on held-out roads.
    pub better: bool,
    /// Ensembles: name, scenarios, results of the two.
    pub sets: [(&'a str, Vec<String>, [&'a TuneCandidate; 2]); 2],
    /// At each speed.
    pub margins: &'a [Vec<AtSpeed>; 2],
    /// Delay in s and gain that were asked for.
    pub goal: (f64, f64),
    pub answers: &'a [Answer],
    /// True for each candidate that was driven to its end, with its cost.
    pub trace: &'a [(bool, f64)],
}

/// Lateral error over time, s and m, from beside the road at a speed in m/s.
#[allow(missing_docs)]
pub struct Answer {
    pub speed: f64,
    pub curves: [Vec<(f64, f64)>; 2],
}

const COLOURS: [(Colour, &str); 2] = [(Colour::Simulated, "default"), (Colour::Corrected, "tuned")];

/// The page.
#[must_use]
pub fn tuning_page(tuned: &Tuned<'_>) -> String {
    let verdict = if tuned.better { "none" } else { "cannot_tell" };
    let title = format!("Tuned: {}", tuned.vehicle);
    let keys = format!("<p>{}</p>", legend(&COLOURS));
    let head = format!(
        "<div class='banner {verdict}'><h1>{}</h1><p>{}</p><p class='faint'>Predicts with: {}</p></div>",
        escaped(&title),
        escaped(tuned.words),
        escaped(tuned.variant)
    );
    let body = [
        head,
        section("Before and after", &figures(tuned)),
        section("Weights and horizon", &weights(tuned)),
        section("Margins of the steering loop over speed", &(keys.clone() + &margins(tuned))),
        section("From 0.3 m beside the road", &(keys + &answers(tuned))),
        section("Every drive", &drives(tuned)),
        section("The search", &trace(tuned)),
    ]
    .concat();
    include_str!("page.html").replace("{{title}}", &escaped(&title)).replace("{{body}}", &body)
}

fn figures(tuned: &Tuned<'_>) -> String {
    let mut rows = vec![];
    for (name, scenarios, pair) in &tuned.sets {
        for ((_, who), candidate) in COLOURS.iter().zip(pair) {
            rows.push(vec![
                format!("{name}, {who}"),
                format!("{} of {}", candidate.lost(), scenarios.len()),
                number(candidate.worst()),
                number(candidate.mean()),
                number(candidate.penalty),
                number(candidate.cost),
            ]);
        }
    }
    let header = ["drives", "lost", "largest error, m", "mean error, m", "margins missed, m", "cost, m"];
    table(&header, &rows, 1)
        + "<p class='sub'>Cost: the worst drive's and 0.3 of the mean, where a drive costs its largest error, its RMS and a \
           little for rough steering, a lost one 10 m and more; and what margins miss.</p>"
}

fn weights(tuned: &Tuned<'_>) -> String {
    let (_, _, [default, best]) = &tuned.sets[0];
    let rows: Vec<Vec<String>> = best
        .values
        .0
        .iter()
        .map(|(name, value)| {
            let before = default.values.0.get(name).copied().unwrap_or(f64::NAN);
            vec![format!("<code>{}</code>", escaped(name)), number(before), number(*value)]
        })
        .collect();
    table(&["parameter", "default", "tuned"], &rows, 1)
}

fn margins(tuned: &Tuned<'_>) -> String {
    // Beyond these nobody asks.
    let plot = |title: &str, y: &str, most: f64, goal: f64, of: fn(&Margins) -> f64| {
        let mut curves: Vec<PlotCurve> = COLOURS
            .iter()
            .zip(tuned.margins)
            .map(|((colour, _), margins)| {
                let at = |(speed, margins): &AtSpeed| {
                    (*speed, margins.as_ref().map_or(0.0, |margins| of(margins).min(most)))
                };
                PlotCurve::line(*colour, margins.iter().map(at).collect())
            })
            .collect();
        let ends = [tuned.margins[0].first(), tuned.margins[0].last()];
        let ends = ends.map(|end| (end.map_or(0.0, |(speed, _)| *speed), goal));
        curves.push(PlotCurve::line(Colour::Faint, ends.to_vec()));
        let plot = Plot {
            size: (430, 260),
            y_range: Some((0.0, 1.05 * most)),
            ..Plot::new(title, "speed, m/s", y, curves)
        };
        figure(&plot.svg(), &escaped(title))
    };
    let delay =
        plot("Delay margin: dead time that it stands beyond its own", "s", 0.5, tuned.goal.0, |m| m.delay);
    let gain = plot(
        "Gain margin: a factor on its answer to steering that it stands",
        "factor",
        10.0,
        tuned.goal.1,
        |m| m.gain,
    );
    format!("<div class='pair'>{delay}{gain}</div>")
        + "<p class='sub'>Of the linear loop on a straight road: the controller as a linear feedback with its memory, the vehicle \
           of the file behind its steering. Grey: what was asked for. 0: the loop is unstable there; what is beyond the scale is \
           drawn at its end.</p>"
}

fn answers(tuned: &Tuned<'_>) -> String {
    let mut plots = String::new();
    for answer in tuned.answers {
        let curve = |((colour, _), points): (&(Colour, &str), &Vec<(f64, f64)>)| {
            PlotCurve::line(
                *colour,
                points.iter().map(|&(time, error)| (time, error.clamp(-1.0, 1.0))).collect(),
            )
        };
        let curves = COLOURS.iter().zip(&answer.curves).map(curve).collect();
        let title = format!("{} m/s", answer.speed);
        let plot = Plot { size: (300, 220), ..Plot::new(&title, "time, s", "lateral error, m", curves) };
        plots += &figure(&plot.svg(), &title);
    }
    if plots.is_empty() { plots } else { format!("<div class='pair three'>{plots}</div>") }
}

fn drives(tuned: &Tuned<'_>) -> String {
    let cell = |outcome: Option<&Option<ScenarioResult>>| match outcome {
        Some(Some(outcome)) if outcome.lost => "<span class='no'>lost</span>".to_owned(),
        Some(Some(outcome)) => number(outcome.max),
        _ => "–".to_owned(),
    };
    let mut html = String::new();
    for (name, scenarios, [default, best]) in &tuned.sets {
        let rows: Vec<Vec<String>> = scenarios
            .iter()
            .enumerate()
            .map(|(i, scenario)| {
                vec![escaped(scenario), cell(default.outcomes.get(i)), cell(best.outcomes.get(i))]
            })
            .collect();
        html += &format!(
            "<details><summary>{}</summary>{}</details>",
            escaped(name),
            table(&["drive", "default: largest error, m", "tuned"], &rows, 1)
        );
    }
    html
}

fn trace(tuned: &Tuned<'_>) -> String {
    let mut best = f64::INFINITY;
    let mut points = vec![];
    for (number, (complete, cost)) in tuned.trace.iter().enumerate() {
        if *complete {
            best = best.min(*cost);
        }
        points.push(((number + 1) as f64, best));
    }
    let curves = vec![PlotCurve::line(Colour::Corrected, points)];
    let plot = Plot { size: (860, 200), ..Plot::new("Best cost", "candidates", "cost, m", curves) };
    figure(&plot.svg(), "The least cost so far.")
}
