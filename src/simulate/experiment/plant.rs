//! The plants of the comparison: one car, with more and more that its nominal model does not know.

use crate::enumeration;
use crate::nominal::Actuator;
use crate::vehicle::{CarParameters, Effects};

enumeration! {
    /// The car that is really driven.
    pub enum Plant {
        AsIs = 0 "as_is", "The car of the vehicle file: tyres, suspension, its own actuator";
        Lag = 1 "lag", "A steering lag of 0.1 s added";
        LagAndDeadTime = 2 "lag_and_dead_time", "A steering lag of 0.1 s and a dead time of 60 ms added";
        PayloadLowFriction = 3 "payload_low_friction", "300 kg loaded 0.8 m behind the CG, friction of all roads at 60 %";
    }
}

impl Plant {
    /// The effects that make it.
    #[must_use]
    pub fn effects(self) -> Effects {
        let none = Effects::default();
        match self {
            Self::AsIs => none,
            Self::Lag => Effects { steer_lag: 0.1, ..none },
            Self::LagAndDeadTime => Effects { steer_lag: 0.1, steer_delay: 0.06, ..none },
            Self::PayloadLowFriction => {
                Effects { payload: 300.0, payload_x: -0.8, road_friction: 0.6, ..none }
            }
        }
    }

    /// The steering actuator as it really is: what the oracle is told.
    #[must_use]
    pub fn actuator(self, car: &CarParameters) -> Actuator {
        let effects = self.effects();
        Actuator {
            dead_time: car.steering.dead_time + effects.steer_delay,
            time_constant: car.steering.lag + effects.steer_lag,
            ..Actuator::default()
        }
    }
}
