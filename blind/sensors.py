"""What sensors make of a true drive: mounting, biases, filters, latency, noise, late stamps, and what is not logged."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter, lfilter_zi

from .drive import SIGNALS, Truth
from .wild import Conventions, written

# Standard deviations of noise at one sample, SI units.
NOISE = {
    "x": 0.02, "y": 0.02, "yaw": 0.0012, "vx": 0.03, "vy": 0.03, "yaw_rate": 0.0025, "ax": 0.06, "ay": 0.06,
    "roll": 0.001, "articulation": 0.0015, "articulation_rate": 0.004, "steer": 0.0004,
}  # fmt: skip
# Signals of the inertial sensors go through a low pass.
FILTERED = ("yaw_rate", "ax", "ay")


@dataclass(frozen=True)
class Suite:
    """The instruments of one car: how often they log, what, and how well."""

    rate: int  # samples a second
    noise: float  # factor on NOISE
    cutoff: float  # Hz, second-order low pass of the inertial sensors
    late: float  # s, greatest lateness of a time stamp
    logged: tuple[str, ...]
    seed: int


def draw(rng: np.random.Generator, is_truck: bool) -> Suite:
    """Random instruments: 50 or 100 Hz, some signals missing."""
    logged = ["x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "steer", "roll"]
    logged += ["articulation", "articulation_rate"] if is_truck else []
    for names, share in ((("roll",), 0.4), (("vy",), 0.2), (("steer",), 0.15), (("x", "y", "yaw"), 0.1)):
        if rng.random() < share:
            logged = [name for name in logged if name not in names]
    return Suite(
        int(rng.choice([50, 100])),
        rng.uniform(0.5, 1.5),
        rng.uniform(18.0, 40.0),
        rng.choice([0.0, 0.002, 0.004]),
        tuple(logged),
        int(rng.integers(2**31)),
    )


def placed(truth: Truth, values: dict[str, float]) -> dict[str, np.ndarray]:
    """Signals without noise, sampled as the truth is: mounting, scales and biases of `values`."""
    s = dict(zip(SIGNALS, truth.signals.T))
    h = truth.h
    yaw_accel = np.gradient(s["yaw_rate"], h)
    arm, turn = values["imu_lever_arm"], values["heading_misalignment"]
    ax, ay = s["ax"] - arm * s["yaw_rate"] ** 2, s["ay"] + arm * yaw_accel
    cos, sin = math.cos(turn), math.sin(turn)
    vx, vy = s["vx"] * values["speed_scale"], s["vy"] * values["speed_scale"]
    found = {
        "x": s["x"],
        "y": s["y"],
        "yaw": s["yaw"] + turn,
        "vx": vx * cos + vy * sin,
        "vy": vy * cos - vx * sin,
        "yaw_rate": s["yaw_rate"] * values["yaw_rate_scale"] + values["yaw_rate_bias"],
        "ax": ax * cos + ay * sin + values["ax_bias"],
        "ay": (ay * cos - ax * sin) * values["ay_scale"] + values["lateral_accel_bias"],
        "roll": s["roll"] + values["roll_bias"],
        "articulation": s["articulation"] + values.get("articulation_bias", 0.0),
        "articulation_rate": s["articulation_rate"],
        "steer": truth.steer,
    }
    delay = values["sensor_delay"]
    if delay > 0.0:
        time = np.arange(len(vx)) * h
        for name in SIGNALS:
            found[name] = np.interp(time - delay, time, found[name])
    return found


def log(truth: Truth, values: dict[str, float], suite: Suite, how: Conventions | None = None) -> dict[str, np.ndarray]:
    """The drive log: its columns in the order of the file, as the logger writes them."""
    found = placed(truth, values)
    rng = np.random.default_rng(suite.seed)
    b, a = butter(2, suite.cutoff * 2.0 * truth.h)
    every = round(1.0 / (suite.rate * truth.h))
    rows = np.arange(0, len(truth.steer), every)
    per = round(len(truth.steer) / len(truth.steer_cmd))
    columns = {
        "time": np.round(rows * truth.h + rng.uniform(0.0, 1.0, len(rows)) * suite.late, 5),
        "steer_cmd": truth.steer_cmd[rows // per],
        "accel_cmd": truth.accel_cmd[rows // per],
    }
    for name in NOISE:  # in this order, logged or not: the noise of one signal does not hang on another
        noise = rng.normal(size=len(rows)) * NOISE[name] * suite.noise
        if name not in suite.logged:
            continue
        signal = found[name]
        if name in FILTERED:
            signal = lfilter(b, a, signal, zi=lfilter_zi(b, a) * signal[0])[0]
        columns[name] = signal[rows] + noise
    if how is None:
        return columns
    s = dict(zip(SIGNALS, truth.signals.T))
    level = s["vx"] * s["yaw_rate"] + np.gradient(s["vy"], truth.h)
    return written(columns, (s["ay"] - level)[rows], how)


def write(columns: dict[str, np.ndarray], path) -> None:
    """Writes a log as CSV (`.csv.gz`: compressed, the same bytes each time)."""
    import gzip

    text = ",".join(columns) + "\n"
    widths = {"time": "%.5f", "x": "%.3f", "y": "%.3f"}
    form = ",".join(widths.get(name, "%.6f") for name in columns)
    text += "\n".join(form % row for row in zip(*columns.values())) + "\n"
    with open(path, "wb") as file, gzip.GzipFile(fileobj=file, mode="wb", mtime=0, filename="") as packed:
        packed.write(text.encode())
