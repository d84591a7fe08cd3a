//! Instances are independent: interleaved, and many on many threads, each gives the bits of a lone one; two calls
//! of one instance at a time are refused.

use crate::common::*;
use rfl_mpc::fmi::v2::Status;

/// One instance's step `k` with its own parameters and inputs.
fn advance(host: &Host, who: u32, k: u32) {
    let input = 0.3 * (0.1 * f64::from(k) + f64::from(who)).sin();
    assert_eq!(host.set_real(vr::STEER_CMD, input), Status::Ok);
    assert_eq!(host.step(f64::from(k) * 0.01, 0.01), Status::Ok, "{}", host.last());
}

fn made(who: u32) -> Host {
    let host = Host::new();
    assert_eq!(host.set_real(vr::TAU, 0.05 + 0.01 * f64::from(who)), Status::Ok);
    host.initialize();
    host
}

fn alone(who: u32) -> (Vec<u64>, Vec<i32>, String) {
    let host = made(who);
    (0..500).for_each(|k| advance(&host, who, k));
    host.fingerprint()
}

#[test]
fn interleaved_instances_do_not_touch_each_other() {
    let (a, b) = (made(1), made(2));
    for k in 0..500 {
        advance(&a, 1, k);
        advance(&b, 2, k);
        if k == 250 {
            drop(made(3));
        }
    }
    assert_eq!((a.fingerprint(), b.fingerprint()), (alone(1), alone(2)));
}

/// 16 instances on 8 threads; each instance moves from thread to thread in between.
#[test]
fn sixteen_instances_on_eight_threads() {
    let mut hosts: Vec<Host> = (0..16).map(made).collect();
    for round in 0..10 {
        hosts = std::thread::scope(|scope| {
            let mut rest = hosts;
            let mut threads = Vec::new();
            while !rest.is_empty() {
                let pair: Vec<(usize, Host)> = rest.drain(..2).enumerate().collect();
                let first = 2 * threads.len() as u32;
                threads.push(scope.spawn(move || {
                    for k in 50 * round..50 * (round + 1) {
                        for (i, host) in &pair {
                            advance(host, first + *i as u32, k);
                        }
                    }
                    pair.into_iter().map(|(_, host)| host).collect::<Vec<_>>()
                }));
            }
            threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
        });
    }
    for (who, host) in hosts.iter().enumerate() {
        assert_eq!(host.fingerprint(), alone(who as u32), "instance {who}");
    }
}

/// Two threads call one instance at the same time, against the standard: calls are made one by one or refused.
#[test]
fn calls_of_one_instance_do_not_race() {
    let host = Host::ready();
    let component = host.component.expose_provenance();
    let done: u32 = std::thread::scope(|scope| {
        let call = || {
            let component = std::ptr::with_exposed_provenance_mut(component);
            let mut done = 0;
            for _ in 0..20_000 {
                // SAFETY: a live component, arrays of one.
                let status = unsafe { fmi2SetReal(component, &vr::STEER_CMD, 1, &0.25) };
                done += u32::from(status == Status::Ok);
            }
            done
        };
        let threads = [scope.spawn(call), scope.spawn(call)];
        threads.into_iter().map(|thread| thread.join().unwrap()).sum()
    });
    let refused = host.take_messages();
    assert_eq!(done as usize + refused.len(), 40_000);
    assert!(refused.iter().all(|message| message.text.contains("another call of this instance")));
    assert_eq!(host.step(0.0, 0.1), Status::Ok);
}
