"""scikit-learn's random forest on the tables that our forest learns.

Both have the same trees (20 of depth 6, at least 20 rows in a leaf, a bootstrap of single rows, 8 features tried at a
split, outputs standardised), the same data and the same number of threads, and are measured by the same error: the
RMS of what is predicted for rows not learned from, relative to their spread. Ours finds splits on 255 bins of each
feature, scikit-learn on the exact values.
"""

from __future__ import annotations

import json
import resource
import subprocess
import time
from pathlib import Path

import numpy as np

COLUMNS, OUTPUTS = 64, 4
THREADS = 2


def table(rows: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Uniform features, and four outputs that depend on six of them, with steps, curves and noise; standardised."""
    random = np.random.default_rng(seed)
    x = random.random((rows, COLUMNS))
    noise = 0.1 * random.random(rows)
    step = (x[:, 0] > 0.3).astype(float)
    y = [step + x[:, 1] * x[:, 2], np.sin(4.0 * x[:, 3]) * step, x[:, 4] ** 2 + x[:, 0], x[:, 5] - x[:, 1]]
    y = np.stack([column + noise for column in y], axis=1)
    return x, (y - y.mean(axis=0)) / y.std(axis=0)


def relative_rmse(predicted: np.ndarray, true: np.ndarray) -> float:
    """Root mean square error over all outputs, relative to the spread."""
    return float(np.sqrt((((predicted - true) ** 2).mean(axis=0) / true.var(axis=0)).mean()))


def forest(trees: int, depth: int, min_leaf: int, features: int, jobs: int):
    """scikit-learn's forest with these sizes."""
    from sklearn.ensemble import RandomForestRegressor

    return RandomForestRegressor(
        trees, max_depth=depth, min_samples_leaf=min_leaf, max_features=features, n_jobs=jobs, random_state=1
    )


def compare_training(program: Path, folder: Path, rows: int = 100_000, say=print) -> dict:
    """Training on `rows` x 64, and the error on a fifth more."""
    tests = rows // 5
    x, y = table(rows + tests)
    data, fits = folder / "table.f64", folder / "fits.f64"
    np.hstack([x, y]).astype("<f8").tofile(data)
    say(f"forest: ours on {rows} x {COLUMNS}")
    begin = children_cpu()
    ours = call(program, "forest", data, rows, tests, fits)
    # Reading the table and predicting are in it: more than training alone.
    ours_cpu = (children_cpu() - begin) / ours["repeats"]
    ours_rmse = relative_rmse(np.fromfile(fits, "<f8").reshape(tests, OUTPUTS), y[rows:])
    times, cpu_times = [], []
    for repeat in range(ours["repeats"]):
        say(f"forest: scikit-learn on the same, {repeat + 1} of {ours['repeats']}")
        theirs = forest(ours["trees"], ours["depth"], 20, 8, THREADS)
        begin, cpu_begin = time.perf_counter(), time.process_time()
        theirs.fit(x[:rows], y[:rows])
        times.append(time.perf_counter() - begin)
        cpu_times.append(time.process_time() - cpu_begin)
    theirs_rmse = relative_rmse(theirs.predict(x[rows:]), y[rows:])
    seconds, cpu = float(np.median(times)), float(np.median(cpu_times))
    return {
        "rows": rows,
        "columns": COLUMNS,
        "threads": THREADS,
        "ours_s": ours["train_s"],
        "sklearn_s": seconds,
        "ratio": seconds / ours["train_s"],
        "ours_cpu_s": ours_cpu,
        "sklearn_cpu_s": cpu,
        "cpu_ratio": cpu / ours_cpu,
        "ours_test_rmse": ours_rmse,
        "sklearn_test_rmse": theirs_rmse,
    }


def children_cpu() -> float:
    """CPU seconds of programs that were called and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def compare_lookup(program: Path, folder: Path, say=print) -> dict:
    """60 rows of a drive: leaves found in 20 trees, their 17 x 4 coefficients averaged."""
    features, labels = folder / "features.f64", folder / "labels.f64"
    say("lookup: ours")
    ours = call(program, "lookup", features, labels)
    x = np.fromfile(features, "<f8").reshape(ours["samples"], ours["features"])
    y = np.fromfile(labels, "<f8").reshape(ours["samples"], OUTPUTS)
    say("lookup: scikit-learn")
    x = np.ascontiguousarray(x[:, : ours["tree_features"]], dtype=np.float32)
    theirs = forest(ours["trees"], ours["depth"], ours["min_leaf"], ours["features_per_split"], 1)
    theirs.fit(x, (y - y.mean(axis=0)) / y.std(axis=0))
    # A leaf's number to its place among coefficients: of equal size as ours, what stands in them is no matter.
    nodes = max(tree.tree_.node_count for tree in theirs.estimators_)
    theta = np.random.default_rng(1).random((ours["trees"], nodes, ours["regressors"] * OUTPUTS))
    rows, trees = x[-ours["rows"] :], np.arange(ours["trees"])
    apply = median_time(lambda: theta[trees, theirs.apply(rows)].mean(axis=1))
    predict = median_time(lambda: theirs.predict(rows))
    return {
        "rows": ours["rows"],
        "ours_us": 1e6 * ours["lookup_s"],
        "sklearn_apply_and_average_us": 1e6 * apply,
        "sklearn_predict_us": 1e6 * predict,
        "ratio": apply / ours["lookup_s"],
    }


def median_time(call, repeats: int = 101) -> float:
    """Seconds of one call."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def call(program: Path, *arguments) -> dict:
    """Runs our side of the comparison; gives what it prints."""
    command = [str(part) for part in (program, *arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command[:2])} failed: {done.stderr.strip()}")
    return json.loads(done.stdout)
