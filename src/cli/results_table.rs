//! Tables of a file of results of `rfl evaluate`.

use crate::simulate::experiment::TableRow;
use serde_json::Value;

/// The protocols: keys of a row and titles.
const PROTOCOLS: [(&str, &str); 3] = [("own_best", "own best"), ("frozen", "frozen"), ("default", "default")];

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

/// A number; not a number where JSON could not hold it.
fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// Mean and standard deviation.
fn spread(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, variance.sqrt())
}

fn mae_of(outcomes: &[Value]) -> f64 {
    spread(outcomes.iter().map(|outcome| number(&outcome["tracking"]["mae"]))).0
}

/// Prints a table of outcomes; `base` is the mean error that PE is measured by, not a number if there is none.
fn print_table<'a>(title: &str, base: f64, rows: impl Iterator<Item = (&'a str, &'a [Value])>) {
    say!("{title:<18} {:>15} {:>8} {:>8} {:>8} {:>10}", "MAE (sd)", "RMSE", "max", "PE", "roughness");
    for (row, outcomes) in rows {
        let mean = |part: &str, key: &str| spread(outcomes.iter().map(|o| number(&o[part][key]))).0;
        let (mae, sd) = spread(outcomes.iter().map(|outcome| number(&outcome["tracking"]["mae"])));
        let lost = outcomes.iter().filter(|outcome| outcome["lost"] == true).count();
        let note =
            if lost > 0 { format!("  diverged in {lost} of {}", outcomes.len()) } else { String::new() };
        let cut = if base.is_nan() { "-".to_owned() } else { format!("{:.1}", 100.0 * (1.0 - mae / base)) };
        say!(
            "{row:<18} {:>8.2} ({:>4.2}) {:>8.2} {:>8.1} {cut:>8} {:>10.3}{note}",
            1e3 * mae,
            1e3 * sd,
            1e3 * mean("tracking", "rmse"),
            1e3 * mean("tracking", "max"),
            mean("steering", "rate_rms"),
        );
    }
}

/// Prints all rows of a file.
pub(super) fn print(results: &Value) {
    let noise = if results["noise"] == true { "with" } else { "without" };
    let seeds = &results["effort"]["seeds"];
    let s = if *seeds == 1 { "" } else { "s" };
    say!("\nplant {}, {noise} sensor noise, {seeds} seed{s}", text(&results["plant"]));
    say!("lateral error in mm, PE in % of the nominal MPC's mean; roughness: RMS steering rate in rad/s");
    let left_out: Vec<&str> = list(&results["left_out"]).iter().map(text).collect();
    if !left_out.is_empty() {
        say!("left out, for there is no such model of it: {}", left_out.join(", "));
    }
    let rows = list(&results["rows"]);
    let Some(nominal) = rows.first() else { return };
    let print_rows = |title: &str, of: &dyn Fn(&'_ Value) -> Value| {
        let outcomes: Vec<(&str, Value)> = rows.iter().map(|row| (text(&row["row"]), of(row))).collect();
        let measured = nominal["row"] == *TableRow::NOMINAL.name();
        let base = if measured { mae_of(list(&of(nominal))) } else { f64::NAN };
        print_table(title, base, outcomes.iter().map(|(row, of)| (*row, list(of))));
    };
    for (key, title) in PROTOCOLS {
        print_rows(title, &|row| row[key].clone());
    }
    for road in nominal["further"].as_object().into_iter().flat_map(|further| further.keys()) {
        print_rows(road, &|row| row["further"][road].clone());
    }
    for edge in list(&results["edges"]) {
        let rows = list(&edge["rows"]);
        let base = rows.first().map_or(f64::NAN, |nominal| number(&nominal[1]["tracking"]["mae"]));
        print_table(
            "nominal's edge",
            base,
            rows.iter().map(|row| (text(&row[0]), std::slice::from_ref(&row[1]))),
        );
        let (percent, delay) = (100.0 * number(&edge["share"]), number(&edge["dead_time"]));
        say!("  ({percent:.0} % of the way to {}; dead time {delay:.3} s)", text(&edge["towards"]));
    }
}
