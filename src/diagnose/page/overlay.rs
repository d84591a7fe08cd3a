//! Log, simulator and corrected simulator over time, and the gap on the path.

use super::html::{escaped, figure, number, unit_of};
use super::plot::{Colour, HOTTEST, Plot, PlotCurve};
use super::view::View;

/// Each compared signal: a stretch of it, and its gap over the whole log.
pub(super) fn signals(view: &View) -> String {
    let mut html = String::new();
    for name in &view.report.inputs.signals {
        let Some(log) = view.log(name) else { continue };
        let unit = unit_of(name);
        let (over, whole_title) =
            (format!("{name}: real and simulated"), format!("{name}: gap over the whole log"));
        let window = view.window.clone();
        let stretch = |colour: Colour, values: &[f64]| {
            PlotCurve::line(colour, window.clone().map(|i| (view.series.time[i], values[i])).collect())
        };
        let y = format!("{name} ({unit})");
        let curves = view.each(name, stretch);
        let overlay = Plot { size: (860, 240), ..Plot::new(&over, "time (s)", &y, curves) };
        let gap = |colour: Colour, values: &[f64]| {
            let at = |i: usize| if view.valid[i] { log[i] - values[i] } else { f64::NAN };
            PlotCurve::line(colour, (0..log.len()).map(|i| (view.series.time[i], at(i))).collect())
        };
        let curves: Vec<PlotCurve> = view
            .of(name)
            .filter(|(colour, _)| *colour != Colour::Log)
            .map(|(colour, values)| gap(colour, values))
            .collect();
        let y = format!("gap ({unit})");
        let whole = Plot { size: (860, 170), ..Plot::new(&whole_title, "time (s)", &y, curves) };
        let caption = format!(
            "<b>{}</b> where its gap is largest, and below it the gap (real minus simulated) over the whole log. {}",
            escaped(name),
            view.keys()
        );
        // The place is compared as a difference: the log's own is zero.
        let alone = log.iter().all(|value| *value == 0.0);
        let stretch = if alone { String::new() } else { overlay.svg() };
        html += &figure(&(stretch + &whole.svg()), &caption);
    }
    html
}

/// The gap of the first signal painted on the way driven, before and after.
pub(super) fn on_path(view: &View) -> String {
    let Some(name) = view.report.inputs.signals.iter().find(|name| view.log(name).is_some()) else {
        return String::new();
    };
    let Some((points, made)) = way(view) else { return String::new() };
    let log = view.log(name).unwrap_or_default();
    let every = (log.len() / 900).max(1);
    let smooth = |values: &[f64]| -> Vec<f64> {
        let mean = |from: usize| {
            let rows = (from..(from + every).min(log.len())).filter(|i| view.valid[*i]);
            let (sum, count) =
                rows.fold((0.0, 0), |(sum, count), i| (sum + (log[i] - values[i]).abs(), count + 1));
            if count > 0 { sum / f64::from(count) } else { f64::NAN }
        };
        (0..log.len()).step_by(every).map(mean).collect()
    };
    let gaps: Vec<(&str, Vec<f64>)> =
        [("as given", &view.series.simulated), ("corrected", &view.series.corrected)]
            .into_iter()
            .filter_map(|(words, columns)| Some((words, smooth(columns.get(name)?))))
            .collect();
    let mut sorted: Vec<f64> = gaps
        .first()
        .map(|(_, gap)| gap.iter().copied().filter(|gap| gap.is_finite()).collect())
        .unwrap_or_default();
    sorted.sort_by(f64::total_cmp);
    let Some(&highest) = sorted.get(sorted.len().saturating_sub(1 + sorted.len() / 50)) else {
        return String::new();
    };
    let mut drawings = String::new();
    for (words, gap) in &gaps {
        let mut curves: Vec<PlotCurve> = (0..=HOTTEST)
            .map(|heat| PlotCurve { size: 2.5, ..PlotCurve::dots(Colour::Heat(heat), Vec::new()) })
            .collect();
        for (i, gap) in gap.iter().enumerate().filter(|(_, gap)| gap.is_finite()) {
            let heat = (gap / highest.max(1e-12) * f64::from(HOTTEST)).round().clamp(0.0, f64::from(HOTTEST));
            curves[heat as usize].points.push(points[(i * every).min(points.len() - 1)]);
        }
        let title = format!("gap of {name} on the path, simulator {words}");
        let plot = Plot { size: (420, 400), equal: true, ..Plot::new(&title, "x (m)", "y (m)", curves) };
        drawings += &format!("<div><div class='sub'>simulator {words}</div>{}</div>", plot.svg());
    }
    let unit = unit_of(name);
    let scale: String = (0..=HOTTEST)
        .map(|heat| {
            let value = highest * f64::from(heat) / f64::from(HOTTEST);
            format!("<span class='key'><i style='background:var(--heat{heat})'></i>{}</span>", number(value))
        })
        .collect();
    format!(
        "<figure class='wide'><div class='pair'>{drawings}</div><figcaption><b>The gap of {} on the way driven</b> ({unit}): {scale}{made}</figcaption></figure>",
        escaped(name)
    )
}

/// The way driven: as recorded, or from speed and yaw rate.
fn way(view: &View) -> Option<(Vec<(f64, f64)>, &'static str)> {
    if let (Some(x), Some(y)) = (view.log("x"), view.log("y")) {
        return Some((x.iter().copied().zip(y.iter().copied()).collect(), ""));
    }
    let (vx, rate) = (view.log("vx")?, view.log("yaw_rate")?);
    let (mut x, mut y, mut yaw) = (0.0, 0.0, 0.0_f64);
    let mut points = Vec::with_capacity(vx.len());
    for (v, rate) in vx.iter().zip(rate) {
        points.push((x, y));
        x += view.step * v * yaw.cos();
        y += view.step * v * yaw.sin();
        yaw += view.step * rate;
    }
    Some((points, " The log has no position: the way is made from speed and yaw rate."))
}
