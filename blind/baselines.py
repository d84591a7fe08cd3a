"""What simpler methods name on the same logs.

All replay the simulator once as given (gap e) and once with each effect (signature s_i = its change), in the channels
that the log has, low-passed, at 10 Hz, in units of noise.

- largest correlation: the effect whose signature is most like the gap;
- plain output error: the effect whose best value leaves least on the last 40 % of the log, fitted on the rest;
- linear signatures: all signatures at once by ridge regression, the largest share wins;
- LightGBM: a classifier on correlations and sizes, trained on cases of the development set.

Each says "none" where it explains too small a share of the gap: thresholds as a user would set them, below.
"""

from __future__ import annotations

import gzip
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from . import effects, measures, plant, sensors
from .cases import Set
from .make import folder_of, make_set

CHANNELS = ("yaw_rate", "ay", "vy", "ax", "vx", "steer", "roll", "articulation")
STEP, EVERY = 0.02, 5
# Least explained share of the squared gap for a name.
LEAST = 0.25
# A moderate value of each effect to probe with.
PROBES = {
    "steer_delay": 0.1, "steer_lag": 0.1, "steer_rate_limit": 0.15, "steer_backlash": 0.015, "steer_offset": 0.01,
    "steer_gain": 1.1, "tyre_stiffness_front": 0.8, "tyre_stiffness_rear": 0.85, "road_friction": 0.6,
    "tyre_relaxation": 1.5, "cg_shift": 0.1, "yaw_inertia": 1.3, "roll_stiffness": 0.75, "road_bank": 0.03,
    "road_grade": 0.03, "wind_x": 8.0, "wind_y": 8.0, "drag": 2.0, "drive_lag": 0.2, "drive_gain": 1.12,
    "yaw_rate_bias": 0.01, "lateral_accel_bias": 0.3, "sensor_delay": 0.06, "speed_scale": 1.03, "imu_lever_arm": 0.6,
    "heading_misalignment": 0.02, "trailer_stiffness": 0.8, "hitch_offset": 0.2, "articulation_friction": 6000.0,
    "articulation_bias": 0.015,
}  # fmt: skip
LOADS = {"payload": (250.0, 2000.0), "brake_pull": (250.0, 2500.0), "trailer_payload": (0.0, 6000.0)}


@dataclass
class Evidence:
    """Gap and signatures of a case: rows are samples of all channels in a row."""

    names: list[str]
    gap: np.ndarray
    signatures: np.ndarray  # (effects, rows)
    late: np.ndarray  # rows of the last 40 %
    sizes: np.ndarray  # RMS of the gap by channel, 0 where there is none


def read(path: Path) -> dict[str, np.ndarray]:
    """A log's columns."""
    with gzip.open(path, "rt", encoding="utf-8") as file:
        header = file.readline().strip().split(",")
        return dict(zip(header, np.loadtxt(file, delimiter=",").T))


def evidence(folder: Path, is_truck: bool) -> Evidence:
    """Replays the simulator for all effects."""
    log = read(folder / "log.csv.gz")
    time = np.arange(log["time"][0], log["time"][-1], STEP)
    last = np.maximum(np.searchsorted(log["time"], time + 1e-9, side="right") - 1, 0)
    steer, accel = log["steer_cmd"][last], log["accel_cmd"][last]
    start = {name: float(log[name][0]) for name in ("x", "y", "yaw") if name in log} | {"vx": float(log["vx"][0])}
    channels = [name for name in CHANNELS if name in log]
    sos = butter(2, 3.0 * 2.0 * STEP, output="sos")

    def stacked(signals: dict[str, np.ndarray]) -> np.ndarray:
        rows = []
        for name in channels:
            signal = signals[name]
            if name == "vx":  # speeds drift apart: their change counts
                signal = np.gradient(signal, STEP)
            noise = sensors.NOISE[name] * (5.0 if name == "vx" else 1.0)
            rows.append(sosfiltfilt(sos, signal)[::EVERY] / noise)
        return np.array(rows)

    def simulated(values: dict[str, float], otherwise: np.ndarray) -> np.ndarray:
        """A replay; where the simulator cannot drive these commands (it rolls over), there is no signature."""
        try:
            return stacked(plant.replay(folder / "vehicle.toml", is_truck, start, STEP, steer, accel, values))
        except RuntimeError:
            return otherwise

    real = stacked({name: np.interp(time, log["time"], log[name]) for name in channels})
    given = simulated({}, real)
    names, signatures = effects.ids(is_truck), []
    for name in names:
        value = LOADS[name][is_truck] if name in LOADS else PROBES[name]
        signatures.append((simulated({name: value}, given) - given).ravel())
    late = np.broadcast_to(np.arange(real.shape[1]) >= 0.6 * real.shape[1], real.shape).ravel()
    gap = real - given
    sizes = np.zeros(len(CHANNELS))
    for name, row in zip(channels, gap):
        sizes[CHANNELS.index(name)] = np.sqrt(np.mean(row**2))
    return Evidence(names, gap.ravel(), np.array(signatures), late, sizes)


def _cosines(e: Evidence) -> np.ndarray:
    norms = np.linalg.norm(e.signatures, axis=1) * np.linalg.norm(e.gap)
    return np.abs(e.signatures @ e.gap) / np.maximum(norms, 1e-12)


def largest_correlation(e: Evidence) -> str:
    """The effect whose signature is most like the gap."""
    cosines = _cosines(e)
    best = int(np.argmax(cosines))
    return e.names[best] if cosines[best] ** 2 >= LEAST else "none"


def output_error(e: Evidence) -> str:
    """The effect that, fitted on the first part, leaves least on the last."""
    fit, test = ~e.late, e.late
    left = []
    for s in e.signatures:
        scale = s[fit] @ e.gap[fit] / max(s[fit] @ s[fit], 1e-12)
        left.append(float(np.sum((e.gap[test] - scale * s[test]) ** 2)))
    best = int(np.argmin(left))
    return e.names[best] if left[best] <= (1.0 - LEAST) * float(np.sum(e.gap[test] ** 2)) else "none"


def linear_signatures(e: Evidence) -> str:
    """All signatures at once; the one that explains the largest part."""
    s = e.signatures / np.maximum(np.linalg.norm(e.signatures, axis=1, keepdims=True), 1e-12)
    weights = np.linalg.solve(s @ s.T + 0.02 * np.eye(len(s)), s @ e.gap)
    best = int(np.argmax(np.abs(weights)))
    return e.names[best] if weights[best] ** 2 >= LEAST * float(e.gap @ e.gap) else "none"


def features(e: Evidence) -> np.ndarray:
    """What the classifier sees: likeness to each effect of a truck's library, and the gap's size by channel."""
    likeness = dict(zip(e.names, _cosines(e)))
    return np.array([*(likeness.get(name, 0.0) for name in effects.ids(True)), *np.log(e.sizes + 1e-3)])


def _gathered(job: tuple[Path, bool]) -> Evidence:
    return evidence(*job)


def answer_of(label: dict) -> str | None:
    """The one word that a single-effect method could say; None for pairs."""
    return {"single": label["causes"][0] if label["causes"] else "", "none": "none", "outside": "outside"}.get(
        label["kind"]
    )


def measure(cases: Set, labels: list[dict], out: Path, train: int, jobs: int, say=lambda text: None) -> dict:
    """Shares of right names of each baseline on a set; the classifier learns from `train` development cases."""
    learning = Set(cases.seed + 1, True, train, cases.cars, cases.trucks, cases.longest)
    folder = out / "training"
    of_training = make_set(learning, folder, jobs, say) if train else []
    with ProcessPoolExecutor(jobs) as pool:
        known = list(pool.map(_gathered, [(folder_of(folder, a["case"]), a["truck"]) for a in of_training]))
        say(f"{len(known)} training cases replayed")
        asked = list(pool.map(_gathered, [(folder_of(out, a["case"]), a["truck"]) for a in labels]))
        say(f"{len(asked)} cases replayed")
    answers = {
        "largest correlation": [largest_correlation(e) for e in asked],
        "plain output error": [output_error(e) for e in asked],
        "linear signatures": [linear_signatures(e) for e in asked],
    }
    if known:
        import lightgbm

        pairs = [(features(e), answer_of(a)) for e, a in zip(known, of_training) if answer_of(a)]
        model = lightgbm.LGBMClassifier(
            n_estimators=150, min_child_samples=3, num_leaves=15, verbosity=-1, random_state=1, n_jobs=1
        )
        model.fit(np.array([x for x, _ in pairs]), [y for _, y in pairs])
        answers[f"LightGBM ({len(pairs)} cases)"] = list(model.predict(np.array([features(e) for e in asked])))
    found = {}
    for name, given in answers.items():

        def right(kind: str, least: float = 0.0, given: list[str] = given) -> list[bool]:
            return [
                a == answer_of(b)
                for a, b in zip(given, labels)
                if b["kind"] == kind and b["dominance"].get("", 0.0) >= least
            ]

        found[name] = {
            "single": measures.share(right("single")),
            "moderate": measures.share(right("single", 1.0)),
            "false_alarms": measures.share(not r for r in right("none")),
        }
    return found
