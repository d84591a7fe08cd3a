//! Makes the thresholds and probabilities of the diagnosis from simulated logs of our own plants.
//!
//! `calibrate_diagnosis COUNT SEED > trials.csv` tries COUNT sound logs, COUNT with one effect and COUNT / 2 with two, of
//! random values between small and moderate, and prints one line for each; then what the thresholds should be, as
//! comments. The numbers go into `src/diagnose/calibration.toml` by hand: a change of thresholds is a decision.

use rfl_mpc::diagnose::simulated::{Conditions, drive};
use rfl_mpc::diagnose::{Options, Trial, trial};
use rfl_mpc::residual::Random;
use rfl_mpc::vehicle::{Effects, TruckEffects, builtin};

#[path = "diagnose_cases/values.rs"]
mod values;

fn percentile(values: &mut [f64], share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(((values.len().max(1) - 1) as f64 * share).round() as usize).copied().unwrap_or(0.0)
}

/// `p = 1 / (1 + exp(-(a + b ln(1 + margin))))` by Newton's method, with a weak pull of `b` to 1 that keeps it monotone.
fn logistic(cases: &[(f64, bool)]) -> [f64; 2] {
    let (mut a, mut b) = (0.0_f64, 1.0_f64);
    for _ in 0..50 {
        let (mut ga, mut gb) = (-0.1 * a, -(b - 1.0));
        let (mut haa, mut hab, mut hbb) = (0.1, 0.0, 1.0);
        for &(margin, right) in cases {
            let x = margin.max(0.0).ln_1p();
            let p = 1.0 / (1.0 + (-(a + b * x)).exp());
            let (gap, weight) = (f64::from(u8::from(right)) - p, p * (1.0 - p));
            (ga, gb) = (ga + gap, gb + gap * x);
            (haa, hab, hbb) = (haa + weight, hab + weight * x, hbb + weight * x * x);
        }
        let determinant = haa * hbb - hab * hab;
        a += (hbb * ga - hab * gb) / determinant;
        b += (haa * gb - hab * ga) / determinant;
    }
    [a, b.max(0.05)]
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let count: u64 = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(10);
    let seed: u64 = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(1);
    let cars = ["c_class", "bmw_320i", "ford_escort", "vw_vanagon"];
    let of_cars: Vec<_> = values::VALUES.iter().filter(|(id, ..)| Effects::find(id).is_some()).collect();
    println!("truth,single,pair,excess,left,kind,margin,best,right");
    let mut sound: Vec<Trial> = Vec::new();
    let mut single: Vec<(f64, bool)> = Vec::new();
    let mut adds: Vec<f64> = Vec::new();
    for k in 0..count * 5 / 2 {
        let mut random = Random::stream(seed, k);
        let car = builtin(cars[random.below(4) as usize]).expect("built in");
        let wanted = if k < count {
            0
        } else if k < 2 * count {
            1
        } else {
            2
        };
        let mut effects = TruckEffects::default();
        let mut truth: Vec<&str> = Vec::new();
        while truth.len() < wanted {
            let &(id, moderate, small) = of_cars[random.below(of_cars.len() as u32) as usize];
            if !truth.contains(&id) {
                let value = small + (moderate - small) * random.uniform();
                *effects.get_mut(id).expect("an effect") = value;
                truth.push(id);
            }
        }
        let conditions = Conditions {
            seed: seed.wrapping_mul(1_000_003).wrapping_add(k),
            duration: 45.0,
            step: 0.02,
            speed: (7.0, 18.0 + 8.0 * random.uniform()),
            lateral: 2.0 + 3.5 * random.uniform(),
            quick: 0.1 + 0.3 * random.uniform(),
            noise: 0.5 + random.uniform(),
            ..Conditions::default()
        };
        let Some(log) = drive(&car, &effects, &conditions) else { continue };
        let Ok(tried) = trial(&log, &car, &Options::default()) else { continue };
        let inside = |class: &[String], id: &str| class.iter().any(|member| member == id);
        let right = match truth.as_slice() {
            [] => false,
            [one] => inside(&tried.single, one),
            [a, b, ..] => {
                let [p, q] = &tried.pair;
                inside(p, a) && inside(q, b) || inside(p, b) && inside(q, a)
            }
        };
        let s = tried.scores;
        println!(
            "{},{:.1},{:.1},{:.2},{:.2},{:?},{:.1},{},{right}",
            truth.join("+"),
            s.single,
            s.pair,
            s.excess,
            s.left,
            tried.kind,
            tried.margin,
            tried.single.join(" ")
        );
        match wanted {
            0 => sound.push(tried),
            1 => {
                single.push((tried.margin, right));
                adds.push(s.pair);
            }
            _ => single.push((tried.margin, right)),
        }
    }
    let of = |get: &dyn Fn(&Trial) -> f64| sound.iter().map(get).collect::<Vec<f64>>();
    println!("# none = {:.1}", percentile(&mut of(&|t| t.scores.single), 0.97));
    println!(
        "# pair = {:.1} (sound logs: {:.1})",
        percentile(&mut adds, 0.95),
        percentile(&mut of(&|t| t.scores.pair), 0.97)
    );
    println!("# excess of sound logs: {:.2}", percentile(&mut of(&|t| t.scores.excess), 0.97));
    println!("# effect = {:.2?}", logistic(&single));
}
