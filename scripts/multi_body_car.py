"""CommonRoad's multi-body cars in real time steps: vehicles that others wrote, to be driven by our controller.

The cars of PyPI `commonroad-vehicle-models` (M. Althoff and G. Wuersching, "CommonRoad: Vehicle Models", 2020), the
BMW 320i if not said: 29 states, four wheels, suspension, Magic Formula tyres. Their inputs are a steering VELOCITY and
an acceleration; between the controller's command and the front wheels stands a steering actuator,

    steer' = (steer_cmd(t - delay) - steer) / lag,     |steer'| <= 0.4 rad/s (the car's own limit),

with a dead time of whole samples. The classic Runge-Kutta method integrates with 1 to 4 ms: the spin of a wheel
decays with some 4000 / v in 1/s, which has to stay within the method's stability limit of 2.8 / h.

The model has its axes x forward, y right, z down, and mirrors "left", so that pose, yaw rate and steering have the
signs of ISO 8855. It knows no bank, grade or friction of a road.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from plant import Lost
from vehiclemodels.init_mb import init_mb
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

# Numbers of the parameter sets, by the names of our vehicle files.
CARS = {"ford_escort": 1, "bmw_320i": 2, "vw_vanagon": 3}
SHORTEST, LONGEST = 1e-3, 4e-3  # s, steps of the integration
STIFFNESS = 4000.0  # m/s2, decay rate of a wheel's spin times speed
STABLE = 2.0  # product of step and decay rate that is well within stability


@dataclass(frozen=True)
class Actuator:
    """A steering actuator: time constant in s, dead time in samples of the controller."""

    lag: float
    delay: int

    def __str__(self) -> str:
        return f"lag {self.lag:g} s, dead time {self.delay} samples"


class MultiBodyCar:
    """The car on its wheels, at speed on a flat road."""

    def __init__(self, actuator: Actuator, x: float, y: float, yaw: float, speed: float, car: str = "bmw_320i") -> None:
        self.parameters = setup_vehicle_parameters(CARS[car])
        self.actuator = actuator
        self.state = init_mb([x, y, 0.0, speed, yaw, 0.0, 0.0], self.parameters)
        self._waiting = deque([0.0] * actuator.delay)

    def outputs(self) -> dict[str, float]:
        """The signals that a controller measures; SI units, ISO 8855."""
        s = self.state
        return {"x": s[0], "y": s[1], "yaw": s[4], "vx": s[3], "vy": s[10], "yaw_rate": s[5], "steer": s[2]}

    def step(self, steer_cmd: float, accel_cmd: float, length: float) -> None:
        """Advances by `length` (one sample of the controller, in s) under commands that hold over it."""
        self._waiting.append(steer_cmd)
        target, lag, p = self._waiting.popleft(), self.actuator.lag, self.parameters

        def rate(state: list[float]) -> list[float]:
            return vehicle_dynamics_mb(state, [(target - state[2]) / lag, accel_cmd], p)

        decay = STIFFNESS / max(self.state[3], 0.1)
        count = math.ceil(length / min(max(STABLE / decay, SHORTEST), LONGEST) - 1e-9)
        h = length / count
        try:
            for _ in range(count):
                self.state = runge_kutta(rate, self.state, h)
        except (ValueError, ZeroDivisionError, OverflowError) as error:
            raise Lost(f"the multi-body model has no state any more ({error})") from error
        if not all(map(math.isfinite, self.state)) or self.state[3] < 0.5:
            raise Lost("the car spun or stopped")


def runge_kutta(rate, x: list[float], h: float) -> list[float]:
    """One step of the classic method of fourth order."""
    k1 = rate(x)
    k2 = rate([a + 0.5 * h * b for a, b in zip(x, k1)])
    k3 = rate([a + 0.5 * h * b for a, b in zip(x, k2)])
    k4 = rate([a + h * b for a, b in zip(x, k3)])
    return [a + h / 6.0 * (b + 2.0 * c + 2.0 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4)]
