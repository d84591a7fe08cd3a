//! Response of the vehicle to steering, in the curves that engineers know: real, simulated, corrected.

use super::frequency::{FrequencyResponse, response};
use super::html::figure;
use super::plot::{Colour, Plot, PlotCurve, legend};
use super::view::{LEGEND, View};

/// Yaw accelerations up to this are steady cornering, rad/s2.
const STEADY: f64 = 0.15;
/// Steering rates up to this, rad/s.
const STEADY_ANGLE: f64 = 0.1;
/// Least angle for a gain, rad.
const LEAST_ANGLE: f64 = 5e-3;
/// Fewest rows for a point of a curve.
const LEAST_ROWS: usize = 20;

/// Means of `y` in bins of `x` of this width.
fn binned(pairs: impl Iterator<Item = (f64, f64)>, width: f64) -> Vec<(f64, f64)> {
    let mut bins = std::collections::BTreeMap::<i64, (f64, f64, usize)>::new();
    for (x, y) in pairs.filter(|(x, y)| x.is_finite() && y.is_finite()) {
        let bin = bins.entry((x / width).round() as i64).or_default();
        *bin = (bin.0 + x, bin.1 + y, bin.2 + 1);
    }
    let full = bins.into_values().filter(|bin| bin.2 >= LEAST_ROWS);
    full.map(|(x, y, count)| (x / count as f64, y / count as f64)).collect()
}

/// Slope of `y` over `x` through the origin in bins of `by`.
fn slopes(rows: impl Iterator<Item = (f64, f64, f64)>, width: f64) -> Vec<(f64, f64)> {
    let mut bins = std::collections::BTreeMap::<i64, (f64, f64, f64, usize)>::new();
    for (by, x, y) in rows.filter(|(_, x, y)| x.is_finite() && y.is_finite()) {
        let bin = bins.entry((by / width).round() as i64).or_default();
        *bin = (bin.0 + by, bin.1 + x * x, bin.2 + x * y, bin.3 + 1);
    }
    let full = bins.into_values().filter(|bin| bin.3 >= LEAST_ROWS && bin.1 > 0.0);
    full.map(|(by, xx, xy, count)| (by / count as f64, xy / xx)).collect()
}

/// Steering beyond the kinematic angle over lateral acceleration.
pub(super) fn understeer(view: &View) -> String {
    let (Some(steer), Some(vx)) = (view.log("steer").or(view.log("steer_cmd")), view.log("vx")) else {
        return String::new();
    };
    let curve = |colour: Colour, rate: &[f64]| {
        let steady = (1..rate.len()).filter(|&i| {
            let acceleration = (rate[i] - rate[i - 1]) / view.step;
            view.valid[i] && vx[i] > 3.0 && acceleration.abs() < STEADY
        });
        let points = steady.map(|i| (vx[i] * rate[i], steer[i] - view.wheelbase * rate[i] / vx[i]));
        PlotCurve::line(colour, binned(points, 0.4))
    };
    let curves = view.each("yaw_rate", curve);
    let plot = Plot {
        size: (420, 300),
        ..Plot::new(
            "Understeer curve",
            "lateral acceleration (m/s2)",
            "steering beyond kinematic (rad)",
            curves,
        )
    };
    figure(
        &plot.svg(),
        &format!(
            "<b>Understeer.</b> A slope at the origin is tyre stiffness and load, a bend is grip, an offset at zero is offset, bank or wind. {}",
            view.keys()
        ),
    )
}

/// Yaw rate for each radian of steering over speed.
pub(super) fn yaw_gain(view: &View) -> String {
    let (Some(steer), Some(vx)) = (view.log("steer_cmd"), view.log("vx")) else { return String::new() };
    let mean = view.mean_of_valid(steer);
    let curve = |colour: Colour, rate: &[f64]| {
        let offset = view.mean_of_valid(rate);
        let steady = |i: usize| (rate[i] - rate[i - 1]).abs() < STEADY * view.step;
        let held = |i: usize| (steer[i] - steer[i - 1]).abs() < STEADY_ANGLE * view.step;
        let rows = (1..rate.len())
            .filter(|&i| view.valid[i] && (steer[i] - mean).abs() > LEAST_ANGLE && steady(i) && held(i));
        PlotCurve::line(colour, slopes(rows.map(|i| (vx[i], steer[i] - mean, rate[i] - offset)), 1.0))
    };
    let curves = view.each("yaw_rate", curve);
    let plot = Plot {
        size: (420, 300),
        ..Plot::new("Yaw gain over speed", "speed (m/s)", "yaw rate for each rad of steering (1/s)", curves)
    };
    figure(
        &plot.svg(),
        &format!(
            "<b>Yaw gain over speed.</b> A wrong ratio shows at all speeds, stiffness and load only as speed grows. {}",
            view.keys()
        ),
    )
}

/// The angle over its command: lag and delay open a loop, backlash gives it a width, an offset shifts it.
pub(super) fn command_loop(view: &View) -> String {
    let (Some(command), Some(vx)) = (view.log("steer_cmd"), view.log("vx")) else { return String::new() };
    let window = view.window.clone();
    let (name, label) = if view.log("steer").is_some() && view.commanded {
        ("steer", "measured angle (rad)")
    } else {
        ("yaw_rate", "angle that the turn needs (rad)")
    };
    let curve = |colour: Colour, values: &[f64]| {
        let angle = |i: usize| {
            if name == "steer" { values[i] } else { (view.steering)(vx[i]) * values[i] / vx[i].max(1.0) }
        };
        PlotCurve::line(colour, window.clone().map(|i| (command[i], angle(i))).collect())
    };
    let mut curves = view.each(name, curve);
    if curves.len() == 1 {
        // The replay has no measured angle: the log alone.
        curves.insert(
            0,
            PlotCurve::line(Colour::Faint, window.clone().map(|i| (command[i], command[i])).collect()),
        );
    }
    let plot =
        Plot { size: (420, 300), ..Plot::new("Command and angle", "commanded angle (rad)", label, curves) };
    figure(
        &plot.svg(),
        &format!(
            "<b>Command and angle</b> in the stretch with the largest gap. Delay and lag open a loop, backlash gives it a constant width, an offset shifts it. {}",
            view.keys()
        ),
    )
}

/// Gain, phase and coherence from command to yaw rate.
pub(super) fn frequency(view: &View) -> String {
    let Some(command) = view.log("steer_cmd") else { return String::new() };
    let highest = (0.4 / view.step).min(4.0);
    let responses: Vec<(Colour, Vec<FrequencyResponse>)> = view
        .of("yaw_rate")
        .map(|(colour, values)| (colour, response(command, values, &view.valid, view.step, highest)))
        .collect();
    let draw = |title: &str, y: &str, of: fn(&FrequencyResponse) -> f64, range: Option<(f64, f64)>| {
        let curve = |(colour, found): &(Colour, Vec<FrequencyResponse>)| {
            // Where the output has little to do with the input a gain means nothing.
            let told = |at: &FrequencyResponse| title == "coherence" || at.coherence > 0.5;
            let points = found.iter().map(|at| (at.frequency, if told(at) { of(at) } else { f64::NAN }));
            PlotCurve::line(*colour, points.collect())
        };
        let curves = responses.iter().map(curve).collect();
        let plot = Plot {
            size: (290, 240),
            logarithmic: true,
            y_range: range,
            ..Plot::new(title, "frequency (Hz)", y, curves)
        };
        plot.svg()
    };
    let gain = draw("gain", "gain (1/s)", |at| at.gain, None);
    if gain.is_empty() {
        return String::new();
    }
    let phase = draw("phase", "phase (rad)", |at| at.phase, None);
    let coherence = draw("coherence", "coherence", |at| at.coherence, Some((0.0, 1.02)));
    let caption = format!(
        "<b>From steering command to yaw rate.</b> A dead time bends the phase alone, a lag gain and phase. Where coherence is low, nothing is told. {}",
        legend(&LEGEND)
    );
    format!(
        "<figure class='wide'><div class='pair three'>{gain}{phase}{coherence}</div><figcaption>{caption}</figcaption></figure>"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_hold_means_and_slopes() {
        let rows: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.01).collect();
        let means = binned(rows.iter().map(|x| (*x, 3.0 * x)), 1.0);
        assert!(means.len() >= 4 && means.iter().all(|(x, y)| (y - 3.0 * x).abs() < 1e-9));
        let gains = slopes(rows.iter().map(|x| (5.0, *x, 7.0 * x)), 1.0);
        assert_eq!(gains.len(), 1);
        assert!((gains[0].1 - 7.0).abs() < 1e-9);
    }
}
