use rfl_mpc::control::*;
use rfl_mpc::path::*;
use rfl_mpc::vehicle::SingleTrack;
use std::sync::Arc;
fn main() {
    let f = std::env::args().nth(1).unwrap();
    let path = Arc::new(Path::read(std::path::Path::new(&f)).unwrap());
    let mut p = ControllerParameters::default();
    if let Some(n) = std::env::args().nth(2) {
        p.mpc.horizon = n.parse().unwrap();
    }
    if std::env::args().nth(3).is_some() {
        p.mpc.q_e2_rate = 0.1;
        p.mpc.q_e1_rate = 0.1;
    }
    let v: SingleTrack = p.vehicle.single_track();
    let mut c = Controller::new(p, path.clone()).unwrap();
    let b = path.at(0.0);
    let (mut x, mut y, mut yaw, mut vx, mut vy, mut r, mut steer) = (b.x, b.y, b.yaw, 5.0, 0.0, 0.0, 0.0f64);
    let mut t = vec![];
    let mut e = vec![];
    let mut it = 0;
    for _ in 0..5000 {
        let rep = *c.step(&Measurement { x, y, yaw, vx, vy, yaw_rate: r, steer }).unwrap();
        t.push(rep.compute_time);
        e.push(rep.e1);
        it += rep.iterations;
        for _ in 0..20 {
            let h = 0.001;
            steer = rep.steer_cmd;
            let vv = vx.max(1.0);
            let ff = v.cf * (steer - (vy + v.lf * r) / vv);
            let fr = -v.cr * (vy - v.lr * r) / vv;
            let ay = (ff + fr) / v.mass - vx * r;
            let rr = (ff * v.lf - fr * v.lr) / v.yaw_inertia;
            x += h * (vx * yaw.cos() - vy * yaw.sin());
            y += h * (vx * yaw.sin() + vy * yaw.cos());
            yaw += h * r;
            vy += h * ay;
            r += h * rr;
            vx += h * rep.accel_cmd;
        }
        if rep.finished {
            break;
        }
    }
    println!(
        "{:?} {:?} it {}",
        TM::of(&mut t.clone(), 0.02),
        rfl_mpc::simulate::TrackingMetrics::of(e),
        it as f64 / t.len() as f64
    );
    t.sort_by(f64::total_cmp);
    println!("median {}", t[t.len() / 2]);
}
use rfl_mpc::simulate::TimeMetrics as TM;
