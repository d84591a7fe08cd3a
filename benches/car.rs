//! Time of one second of driving: real-time factor = 1 s / time.

use criterion::{Criterion, criterion_group, criterion_main};
use rfl_mpc::vehicle::{
    BUILTIN, BUILTIN_TRUCKS, Car, CarInput, Effects, Truck, TruckEffects, TruckInput, builtin, builtin_truck,
};
use std::hint::black_box;

fn car(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("car, 1 s of driving at 1000 Hz");
    for name in BUILTIN {
        let mut car = Car::new(&builtin(name).expect("built in"), &Effects::default(), None).expect("sound");
        car.place(0.0, 0.0, 0.0, 20.0);
        let mut k = 0.0_f64;
        group.bench_function(*name, |bencher| {
            bencher.iter(|| {
                for _ in 0..100 {
                    k += 0.01;
                    let accel_cmd = 20.0 - car.output().vx;
                    let input = CarInput { steer_cmd: 0.03 * k.sin(), accel_cmd };
                    car.step(black_box(&input), 0.01).expect("an ordinary drive");
                }
            });
        });
    }
    group.finish();
}

fn truck(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("truck, 1 s of driving at 1000 Hz");
    for name in BUILTIN_TRUCKS {
        let parameters = builtin_truck(name).expect("built in");
        let mut truck = Truck::new(&parameters, &TruckEffects::default(), None).expect("sound");
        truck.place(0.0, 0.0, 0.0, 15.0);
        let mut k = 0.0_f64;
        group.bench_function(*name, |bencher| {
            bencher.iter(|| {
                for _ in 0..100 {
                    k += 0.01;
                    let accel_cmd = 15.0 - truck.output().vx;
                    let input = TruckInput { steer_cmd: 0.03 * k.sin(), accel_cmd };
                    truck.step(black_box(&input), 0.01).expect("an ordinary drive");
                }
            });
        });
    }
    group.finish();
}

criterion_group!(benches, car, truck);
criterion_main!(benches);
