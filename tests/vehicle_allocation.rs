//! A step of the car does not allocate.

mod counting;

use counting::allocated;
use rfl_mpc::vehicle::{BUILTIN, Car, CarInput, Effects, builtin};

#[test]
fn steps_do_not_allocate() {
    let delayed = Effects { steer_delay: 0.5, sensor_delay: 0.4, ..Effects::default() };
    for (name, effects) in BUILTIN.iter().flat_map(|name| [(name, Effects::default()), (name, delayed)]) {
        let mut car = Car::new(&builtin(name).unwrap(), &effects, None).unwrap();
        car.place(0.0, 0.0, 0.0, 15.0);
        let mut saved = Vec::new();
        for restored in [false, true] {
            if restored {
                car.save(&mut saved);
                car.restore(&saved).unwrap();
            }
            let (count, _) = allocated(|| {
                for k in 0..3000 {
                    let input = CarInput { steer_cmd: 0.02 * (0.01 * f64::from(k)).sin(), accel_cmd: 0.1 };
                    car.step(&input, if k % 2 == 0 { 0.0005 } else { 0.01 }).unwrap();
                }
                // Errors give back the state before, and do not allocate either.
                assert!(car.step(&CarInput::default(), -1.0).is_err());
            });
            assert_eq!(count, 0, "{name}, restored: {restored}");
        }
    }
}
