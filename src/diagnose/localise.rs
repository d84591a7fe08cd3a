//! Location of the gap: signal by regime.
//!
//! A regime's significance compares its mean square with that of all others, in standard deviations of an even spread.
//! Consecutive samples count by their correlation time.

use super::problem::Problem;
use super::rank::Ranking;
use super::replay::{Channel, ReplayVehicle};
use super::report::GapLocation;
use std::f64::consts::TAU;

/// Parts of each regime; least samples in one.
const PARTS: usize = 5;
const LEAST: usize = 12;
/// Samples of 10 Hz that count as one.
const CORRELATED: f64 = 5.0;
/// Frequency bands, Hz.
const BANDS: [f64; 5] = [0.05, 0.2, 0.5, 1.0, 3.0];

/// All places, the greatest share of the gap above an even spread first.
#[must_use]
pub fn places<V: ReplayVehicle>(problem: &Problem<V>, ranking: &Ranking) -> Vec<GapLocation> {
    let drive = problem.drive;
    let vx = drive.column("vx");
    let rate = drive.column("yaw_rate");
    let row = |k: usize| problem.rows[k];
    let lateral = |k: usize| vx[row(k)] * rate.get(row(k)).copied().unwrap_or(0.0);
    let curvature = |k: usize| rate.get(row(k)).copied().unwrap_or(0.0) / vx[row(k)].max(1.0);
    let half = (0.1 / drive.step).ceil() as usize;
    let steer_rate = |k: usize| {
        let (a, b) = (row(k).saturating_sub(half), (row(k) + half).min(drive.steer.len() - 1));
        (drive.steer[b] - drive.steer[a]).abs() / ((b - a).max(1) as f64 * drive.step)
    };
    let station = drive.columns.get("station");
    let count = problem.rows.len();
    let mut regimes: Vec<(&str, Vec<f64>)> = vec![
        ("speed", (0..count).map(|k| vx[row(k)]).collect()),
        ("lateral_accel", (0..count).map(|k| lateral(k).abs()).collect()),
        ("curvature", (0..count).map(|k| curvature(k).abs()).collect()),
        ("steer_rate", (0..count).map(steer_rate).collect()),
        ("side", (0..count).map(|k| lateral(k).signum()).collect()),
        ("time", (0..count).map(|k| drive.time[row(k)]).collect()),
    ];
    if let Some(station) = station {
        regimes.push(("station", (0..count).map(|k| station[row(k)]).collect()));
    }
    let mut places = Vec::new();
    for ((channel, block), &noise) in problem.blocks.iter().zip(&ranking.noise.white) {
        if *channel == Channel::Along {
            continue;
        }
        let gap = &ranking.neutral[block.clone()];
        let total: f64 = gap.iter().map(|e| e * e).sum();
        if total <= 0.0 {
            continue;
        }
        for (regime, values) in &regimes {
            split(channel.name(), regime, values, gap, total, noise, &mut places);
        }
        bands(channel.name(), gap, total, &mut places);
    }
    let order = |place: &GapLocation| place.significance * place.share;
    places.sort_by(|a, b| order(b).total_cmp(&order(a)).then_with(|| a.signal.cmp(&b.signal)));
    places
}

fn split(
    signal: &str,
    regime: &str,
    values: &[f64],
    gap: &[f64],
    total: f64,
    noise: f64,
    places: &mut Vec<GapLocation>,
) {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    // Nothing to divide: a constant, or nothing at all.
    if high <= low + 1e-9 {
        return;
    }
    let parts = if regime == "side" { 2 } else { PARTS };
    let mean = total / gap.len() as f64;
    let fourth: f64 = gap.iter().map(|e| (e * e - mean).powi(2)).sum::<f64>() / gap.len() as f64;
    let spread = fourth.sqrt().max(mean).max(noise * noise);
    for part in 0..parts {
        let edge = |i: usize| low + (high - low) * i as f64 / parts as f64;
        let (from, to) = (edge(part), edge(part + 1));
        let last = part + 1 == parts;
        let inside: Vec<f64> = values
            .iter()
            .zip(gap)
            .filter(|(v, _)| **v >= from && (**v < to || last))
            .map(|(_, e)| e * e)
            .collect();
        if inside.len() < LEAST {
            continue;
        }
        let sum: f64 = inside.iter().sum();
        let own = sum / inside.len() as f64;
        let worth = (inside.len() as f64 / CORRELATED).max(1.0);
        places.push(GapLocation {
            signal: signal.to_owned(),
            regime: regime.to_owned(),
            from,
            to,
            count: inside.len(),
            rms: own.sqrt(),
            share: sum / total,
            significance: (own - mean) / (spread / worth.sqrt()),
        });
    }
}

/// Shares of the gap in frequency bands, by a discrete Fourier transform of stretches of 20 s.
fn bands(signal: &str, gap: &[f64], total: f64, places: &mut Vec<GapLocation>) {
    const LENGTH: usize = 200;
    let pieces = gap.len() / LENGTH;
    if pieces == 0 {
        return;
    }
    let mut power = [0.0; BANDS.len()];
    let mut bins = [0.0; BANDS.len()];
    for piece in gap.chunks_exact(LENGTH) {
        for k in 0..=LENGTH / 2 {
            let frequency = k as f64 * 10.0 / LENGTH as f64;
            let Some(band) = BANDS.iter().position(|&upper| frequency <= upper) else { continue };
            let (mut re, mut im) = (0.0, 0.0);
            for (i, value) in piece.iter().enumerate() {
                let (sin, cos) = (TAU * (k * i % LENGTH) as f64 / LENGTH as f64).sin_cos();
                (re, im) = (re + value * cos, im + value * sin);
            }
            let twice = if k == 0 { 1.0 } else { 2.0 };
            power[band] += twice * (re * re + im * im) / LENGTH as f64;
            bins[band] += 1.0;
        }
    }
    let (all, count): (f64, f64) = (power.iter().sum(), bins.iter().sum());
    if all <= 0.0 {
        return;
    }
    let mut from = 0.0;
    for (band, &to) in BANDS.iter().enumerate() {
        let (even, bin) = (all / count, bins[band].max(1.0));
        places.push(GapLocation {
            signal: signal.to_owned(),
            regime: "frequency".to_owned(),
            from,
            to,
            count: bins[band] as usize,
            rms: (power[band] / all * total / gap.len() as f64).sqrt(),
            share: power[band] / all,
            significance: (power[band] / bin - even) / (even / bin.sqrt()),
        });
        from = to;
    }
}
