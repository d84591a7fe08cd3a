"""The blind vehicles' physics: against the package they come from, against conservation laws, against our simulator."""

import numpy as np
import pytest

from blind import car, cases, effects, plant, sensors, truck, truck_design, vehicles
from blind.drive import SIGNALS

FLAT = np.array([0.0, 0.0, 1.0, 0.0, 0.0])


@pytest.mark.parametrize("number", [1, 2, 3])
def test_the_car_is_commonroads(number):
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
    from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

    p, theirs = car.parameters(number), setup_vehicle_parameters(number)
    rng = np.random.default_rng(number)
    for _ in range(20):
        x = car.at_speed(p, 1.0, 2.0, 0.3, 15.0)
        x[2:13] += rng.normal(size=11) * 1e-2
        x[13:29] += rng.normal(size=16) * 5e-4
        x[23:27] = x[3] / p["R_w"] * (1.0 + 0.02 * rng.normal(size=4))
        f, flow = np.zeros(car.STATES), np.zeros(4)
        car.rate(x, x[2], 0.5, FLAT, car.array(p), f, flow)
        expected = np.array(vehicle_dynamics_mb(list(x[:29]), [0.0, 0.5], theirs))
        assert np.max(np.abs(f[:29] - expected) / (1.0 + np.abs(expected))) < 1e-9


def test_the_car_starts_at_rest_on_its_springs():
    p = vehicles.design_car("bmw", np.random.default_rng(3)).p
    # Without air, and without the shifts by which a free wheel drives or brakes a little.
    p |= dict.fromkeys(("drag_area", "p_hx1", "p_vx1"), 0.0)
    x, f = car.at_speed(p, 0.0, 0.0, 0.0, 15.0), np.zeros(car.STATES)
    car.rate(x, 0.0, 0.0, FLAT, car.array(p), f, np.zeros(4))
    assert np.max(np.abs(f[5:23])) < 1e-6


def test_a_truck_without_tyres_keeps_its_momentum_and_energy():
    p = truck_design.design(None).p
    for name in (
        "stiff_f",
        "stiff_r",
        "stiff_t",
        "rolling",
        "drag",
        "side1",
        "side2",
        "hitch_friction",
        "df",
        "dr",
        "dt",
    ):
        p[name] = 0.0
    p |= {"hitch_roll_d": 0.0, "added": 0.0}
    y = truck.at_speed(p, 0.0, 0.0, 0.4, 12.0)
    y[5], y[6], y[7], y[9], y[10], y[11], y[12] = 0.1, 0.03, 0.05, -0.15, 0.4, -0.02, 0.03
    a, h, n = truck.array(p), 1e-3, 1500
    high1, high2, pin1, pin2 = truck._above(a)
    ms1, ms2 = p["m1"] - p["mu1"], p["m2"] - p["mu2"]

    def places(s):
        """Masses and their places, written down apart from the derivation."""

        def at(angle, forward, left):
            return np.array(
                [forward * np.cos(angle) - left * np.sin(angle), forward * np.sin(angle) + left * np.cos(angle)]
            )

        foot1 = s[:2]
        pin = foot1 + at(s[4], -p["hx"], -pin1 * np.sin(s[6]))
        foot2 = pin - at(s[8], p["lx"], -pin2 * np.sin(s[11]))
        bodies = foot1 + at(s[4], 0.0, -high1 * np.sin(s[6])), foot2 + at(s[8], 0.0, -high2 * np.sin(s[11]))
        return np.array([foot1, bodies[0], foot2, bodies[1]])

    masses = np.array([p["mu1"], ms1, p["mu2"], ms2])
    states = [y.copy()]
    ks, flow = [np.zeros(truck.STATES) for _ in range(4)], np.zeros(4)
    for _ in range(n):
        for i, share in enumerate((0.0, 0.5, 0.5, 1.0)):
            truck.rate(y + share * h * ks[i - 1] if i else y, 0.0, 0.0, FLAT, a, ks[i], flow)
        y = y + h / 6.0 * (ks[0] + 2.0 * ks[1] + 2.0 * ks[2] + ks[3])
        states.append(y.copy())
    where = np.array([places(s) for s in states])
    speed = (where[2:] - where[:-2]) / (2.0 * h)
    momentum = np.einsum("i,tij->tj", masses, speed)
    assert np.ptp(momentum, axis=0).max() < 1e-4 * np.abs(momentum).max()
    s = np.array(states)[1:-1]
    energy = 0.5 * np.einsum("i,tij->t", masses, speed**2)
    for inertia, column in (("iz1", 5), ("ix1", 7), ("iz2", 9), ("ix2", 12)):
        energy += 0.5 * p[inertia] * s[:, column] ** 2
    for mass, high, roll, rate in ((ms1, high1, 6, 7), (ms2, high2, 11, 12)):
        energy += 0.5 * mass * (high * np.sin(s[:, roll]) * s[:, rate]) ** 2
        energy += 9.81 * mass * high * np.cos(s[:, roll])
    energy += 0.5 * (p["kf"] + p["kr"]) * s[:, 6] ** 2 + 0.5 * p["kt"] * s[:, 11] ** 2
    energy += 0.5 * p["hitch_roll"] * (s[:, 6] - s[:, 11]) ** 2
    assert np.ptp(energy) < 1e-4 * 0.5 * masses.sum() * 0.4**2


def test_a_design_without_changes_is_the_projects_file_of_it():
    import tomllib

    for name, file in (("bmw", "bmw_320i"), ("ford", "ford_escort"), ("vanagon", "vw_vanagon")):
        expected = tomllib.loads((vehicles.ROOT / "vehicles" / f"{file}.toml").read_text(encoding="utf-8"))
        folder = vehicles.ROOT / "out" / "blind" / "test_files"
        found = tomllib.loads(vehicles.write_file(vehicles.design_car(name, None), folder).read_text(encoding="utf-8"))
        for group in ("vehicle", "axle", "tyre", "brake"):
            for key, value in _flat(expected[group]).items():
                if isinstance(value, float):
                    assert _flat(found[group])[key] == pytest.approx(value, rel=2e-3, abs=1e-9), (name, group, key)


def _flat(table, name=""):
    found = {}
    for key, value in table.items():
        found |= _flat(value, f"{name}{key}.") if isinstance(value, dict) else {name + key: value}
    return found


@pytest.mark.parametrize("which", ["ford", "bmw", "vanagon", "truck"])
def test_the_unmodified_vehicle_is_within_tolerance_of_its_file(which, tmp_path):
    """The same commands through the blind vehicle and our FMU: less apart than tolerances of some per cent make."""
    if not (plant.FMUS / "PassengerCar.fmu").is_file():
        pytest.skip("no FMUs: scripts/build-fmus")
    design = cases.vehicle_of(cases.Set(11, True, 1).designs(), which)
    suite = sensors.Suite(100, 1.0, 40.0, 0.0, (), 0)
    conditions = cases.draw_conditions(np.random.default_rng(5), design, suite, 30.0)
    truth = cases.start_and_drive(vehicles.build(design, neutral(design)), conditions)
    assert truth.arrived
    commands = truth.steer_cmd, truth.accel_cmd
    simulated = plant.run(vehicles.write_file(design, tmp_path), design.is_truck, conditions, commands=commands)
    per = round(conditions.sample / truth.h)
    limits = {"yaw_rate": 0.03, "ay": 0.04, "vx": 0.01, "vy": 0.15}
    if which == "truck":
        # Measured up to 2.1, 1.7, 0.3, 4.6, 1.4 and 3.7 %.
        limits = {"yaw_rate": 0.025, "ay": 0.025, "vx": 0.005, "vy": 0.08, "articulation": 0.02, "roll": 0.06}
    for name, limit in limits.items():
        own = truth.signals[::per, SIGNALS.index(name)]
        assert rms(simulated[name] - own) < limit * rms(own), name


def neutral(design):
    names = effects.TOLERANCES | (effects.OF_TRUCKS if design.is_truck else {})
    return {name: 1.0 if name in effects.FACTORS else 0.0 for name in names}


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))
