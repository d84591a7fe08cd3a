//! Result of an identification, in words and as JSON.

use super::{IdentifiedLog, IdentifyArgs, models_as_json, response};
use crate::log::FindingSeverity;
use crate::nominal::{Between, Estimate, IdentifiedSteering};
use serde_json::{Value, json};

/// Wrong rows that are named.
const NAMED: usize = 5;
/// Deviation of a gain from 1 from which on it is a ratio or a unit.
const GAIN_ODD: f64 = 0.2;

/// Prints the numbers, and the repairs.
pub(super) fn print(found: &IdentifiedLog, args: &IdentifyArgs) {
    for finding in &found.findings {
        let gravity = if finding.gravity == FindingSeverity::Note { "note" } else { "warning" };
        warn!("{gravity}: {}", finding.summary);
    }
    if let Some(words) = &found.contradiction {
        warn!("warning: {words}");
    }
    let Some(steering) = &found.steering else { return };
    say!("{:<15} {:>10} {:>23}  90 % interval", "", "value", "");
    for (name, estimate, unit) in estimates(steering).into_iter().chain(backlash(steering)) {
        let Estimate { value, low, high, excited } = estimate;
        let words = if excited { "" } else { "  not excited" };
        say!("{name:<15} {value:>10.4} {:>23}  {unit}{words}", format!("{low:.4} ... {high:.4}"));
    }
    let unit = if args.by_yaw_rate { "rad/s" } else { "rad" };
    say!(
        "{} rows used, RMS error {:.2e} {unit}, {:.2} % explained",
        steering.rows,
        steering.rmse,
        100.0 * steering.explained
    );
    notes(found, steering, args);
    not_excited(steering);
}

fn estimates(steering: &IdentifiedSteering) -> [(&'static str, Estimate, &'static str); 5] {
    [
        ("dead time", steering.dead_time, "s"),
        ("lag", steering.lag, "s"),
        ("together", steering.delay, "s"),
        ("gain", steering.gain, ""),
        ("offset", steering.offset, "rad"),
    ]
}

fn backlash(steering: &IdentifiedSteering) -> Option<(&'static str, Estimate, &'static str)> {
    steering.backlash.map(|width| ("backlash", width, "rad"))
}

fn notes(found: &IdentifiedLog, steering: &IdentifiedSteering, args: &IdentifyArgs) {
    if !steering.left_out.is_empty() {
        let named: Vec<String> = steering
            .left_out
            .iter()
            .take(NAMED)
            .map(|one| {
                let time =
                    found.drives.get(one.drive as usize).and_then(|drive| drive.time.get(one.row as usize));
                let signal = if one.signal == "response" { response(args) } else { one.signal };
                format!("{signal} = {:.4} at {:.2} s", one.value, time.copied().unwrap_or(f64::NAN))
            })
            .collect();
        let more = steering.left_out.len().saturating_sub(NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        warn!("note: values that stand out were left out: {}{more}", named.join(", "));
    }
    if let Some(limit) = steering.rate_limit {
        warn!("note: the angle's rate is limited to {limit:.3} rad/s: rows at the limit were left out");
    }
    let command = crate::signal::STEER_CMD.name;
    if steering.between == Between::Line {
        warn!(
            "note: commands between those that are written lie on a line: they are recorded more slowly than they are given; record \
             {command} at the controller's rate"
        );
    }
    if steering.unseen_delay > 0.0 {
        warn!(
            "note: rows come more slowly than controllers give commands, and do not show these: {:.0} ms of the dead time are for \
             commands at 50 Hz, and its interval holds any rate; record {command} at the controller's rate",
            1e3 * steering.unseen_delay
        );
    }
    let (gain, is_known) = (steering.gain.value, steering.gain.excited);
    if is_known && gain < 0.0 {
        warn!(
            "warning: the response has the opposite sign of the command: steering is positive to the left in both"
        );
    } else if is_known && !args.by_yaw_rate && (gain - 1.0).abs() > GAIN_ODD {
        warn!(
            "note: the angle is {gain:.4} times the command (1 to {:.2}): is one of them in degrees, or at the steering \
             wheel?",
            1.0 / gain
        );
    }
    if args.by_yaw_rate {
        warn!(
            "note: seen through the vehicle's linear model: the intervals know that its stiffness (10 % an axle), its inertia \
             (5 %) and what it leaves out (relaxation of tyres, their curve) may be wrong. The sensor's latency is in dead \
             time and lag, a bias of the yaw rate in the offset"
        );
    }
}

/// Open quantities, and drives that would determine them.
fn not_excited(steering: &IdentifiedSteering) {
    let IdentifiedSteering { dead_time, lag, delay, gain, offset, .. } = steering;
    match (dead_time.excited && lag.excited, delay.excited) {
        (true, _) => {}
        (false, true) => say!(
            "not excited: how the delay is shared out between dead time and lag; together they are {:.3} s ({:.3} ... \
             {:.3}). Quick steering tells: a lane change, a slalom, or steps of the command of 0.03 rad, 20 of them",
            delay.value,
            delay.low,
            delay.high
        ),
        (false, false) => say!(
            "not excited: dead time and lag. Drive bends both ways at 5 to 15 m/s, a slalom or steps of the command of 0.03 \
             rad, for 20 s and more, and record steer_cmd and steer at the controller's rate"
        ),
    }
    if !gain.excited {
        say!("not excited: the gain. Bends both ways, each held for a second, tell");
    }
    if !offset.excited {
        say!("not excited: the offset. A straight stretch, and bends both ways, tell");
    }
}

/// Advice for the use of the result.
pub(super) fn next(found: &IdentifiedLog, args: &IdentifyArgs) {
    let Some(steering) = &found.steering else { return };
    if args.logs.is_empty() || !found.models.is_empty() && args.into.is_none() {
        // The models of a step say it themselves.
        return;
    }
    match &args.into {
        Some(file) => say!("next: rfl drive --vehicle {}", file.display()),
        None if steering.excited() => {
            let gap = steering.shown_backlash();
            let gap =
                gap.map_or(String::new(), |width| format!(" --set actuator.backlash={:.4}", width.value));
            say!(
                "next: the same with --into my_car.toml, which is then driven by rfl drive --vehicle my_car.toml; or rfl \
                 drive --variant actuator --set actuator.dead_time={:.4} --set actuator.time_constant={:.4}{gap}",
                steering.dead_time.value,
                steering.lag.value
            );
        }
        None => say!("next: a drive as said, and rfl identify with this log and that one together"),
    }
}

/// The results.
pub(super) fn as_json(found: &IdentifiedLog, args: &IdentifyArgs) -> Value {
    let logs: Vec<String> = args.logs.iter().map(|file| file.display().to_string()).collect();
    let mut value = json!({
        "log": logs.first(),
        "logs": logs,
        "response": response(args),
        "rows": found.rows,
        "models": models_as_json(found),
        "findings": found.findings,
        "contradiction": found.contradiction,
    });
    let Some(steering) = &found.steering else { return value };
    let number = |estimate: Estimate| {
        let Estimate { value, low, high, excited } = estimate;
        json!({"value": value, "low": low, "high": high, "excited": excited})
    };
    let left_out: Vec<Value> = steering
        .left_out
        .iter()
        .map(|one| {
            let drive = found.drives.get(one.drive as usize);
            let signal = if one.signal == "response" { response(args) } else { one.signal };
            json!({
                "log": drive.map(|drive| &drive.name),
                "time": drive.and_then(|drive| drive.time.get(one.row as usize)),
                "signal": signal, "value": one.value,
            })
        })
        .collect();
    value["dead_time"] = number(steering.dead_time);
    value["lag"] = number(steering.lag);
    value["delay"] = number(steering.delay);
    value["gain"] = number(steering.gain);
    value["offset"] = number(steering.offset);
    value["backlash"] = json!(steering.backlash.map(number));
    value["confidence"] = json!(0.9);
    value["rmse"] = json!(steering.rmse);
    value["explained"] = json!(steering.explained);
    value["rows_used"] = json!(steering.rows);
    value["left_out"] = json!(left_out);
    value["rate_limit"] = json!(steering.rate_limit);
    value["between_rows"] = json!(steering.between.name());
    value["unseen_delay"] = json!(steering.unseen_delay);
    value
}
