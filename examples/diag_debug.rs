use rfl_mpc::diagnose::fit::{Linear, Prior, fit};
use rfl_mpc::diagnose::noise::Noise;
use rfl_mpc::diagnose::problem::{Problem, rms};
use rfl_mpc::diagnose::rank::rank;
use rfl_mpc::diagnose::replay::{Correction, Drive, replay};
use rfl_mpc::diagnose::simulated::{Conditions, drive};
use rfl_mpc::vehicle::{TruckEffects, builtin};

fn main() {
    let seed: u64 = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(1);
    let bg: f64 = std::env::args().nth(2).and_then(|a| a.parse().ok()).unwrap_or(1.0);
    let car = builtin("c_class").unwrap();
    let c = Conditions { seed, duration: 60.0, background: bg, speed: (7.0, 24.0), ..Conditions::default() };
    let log = drive(&car, &TruckEffects::default(), &c).unwrap();
    let d = Drive::new(&log, false);
    let correction = Correction::default();
    let problem = Problem::new(&d, &car, &correction, &[], 2);
    let prior = Prior::of(&problem);
    let r = rank(&problem, prior.clone(), false, &|_, _| {}).unwrap();
    let refit = {
        let slopes = problem.slopes(&r.none.x, &r.none.gap);
        let lin = Linear::new(slopes, r.linear.weights.clone());
        fit(&problem, &prior, &lin, &[], &r.none.x, 6).unwrap()
    };
    println!(
        "none {:.1} refit {:.1} best {:.1} excess {:.2}",
        r.none.cost,
        refit.cost,
        r.singles[0].cost,
        r.noise.excess(&problem, &r.none.gap)
    );
    for (i, (ch, b)) in problem.blocks.iter().enumerate() {
        println!(
            "{:10} neutral {:.5} none {:.5} refit {:.5} single {:.5} floor {:.5} eff {:.5}",
            ch.name(),
            rms(&r.neutral[b.clone()]),
            rms(&r.none.gap[b.clone()]),
            rms(&refit.gap[b.clone()]),
            rms(&r.singles[0].gap[b.clone()]),
            r.noise.floor[i],
            r.noise.effective[i]
        );
    }
    for (i, k) in problem.knobs.iter().enumerate() {
        println!(
            "{:26} none {:+.2} refit {:+.2} sigmas",
            k.id,
            r.none.x[i] / k.tolerance.max(1e-9),
            refit.x[i] / k.tolerance.max(1e-9)
        );
    }
    let (b, range) = &problem.blocks[0];
    println!("{b:?}");
    for k in (0..range.len()).step_by(8) {
        let row = problem.rows[k];
        println!(
            "t {:.2} v {:.2} steer {:.4} r {:.4} gap {:.5} a {:.2}",
            d.time[row],
            d.column("vx")[row],
            d.steer[row],
            d.column("yaw_rate")[row],
            refit.gap[range.start + k],
            d.accel[row]
        );
    }
    let _ = (Noise::of(&problem, &replay(&d, &car, &TruckEffects::default(), &correction, None).unwrap()),);
}
