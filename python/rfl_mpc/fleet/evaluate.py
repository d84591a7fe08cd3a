"""``rfl evaluate --dask``: each plant with each noise is a task of its own, for none needs another's results.

A task is ``rfl evaluate`` of one plant and noise in a folder of its own below ``--out``, which workers see at the
same place. It goes on with the results that are there, if they are of the same vehicle and options; what is whole is
moved beside the others. Times of a step are of the machine that the task ran on, with whatever else ran there.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from rfl_mpc._native import RflError
from rfl_mpc.fleet.engine import cluster
from rfl_mpc.fleet.work import environment

PROGRAM = [sys.executable, "-m", "rfl_mpc", "evaluate"]


def taken(words: Sequence[str], name: str) -> tuple[str | None, list[str]]:
    """The value of an option, and the words without it."""
    rest, value, at = [], None, 0
    while at < len(words):
        word = words[at]
        if word == name and at + 1 < len(words):
            value, at = words[at + 1], at + 1
        elif word.startswith(f"{name}="):
            value = word.split("=", 1)[1]
        else:
            rest.append(word)
        at += 1
    return value, rest


def said(words: Sequence[str]) -> str:
    """What a command prints; its own words where it fails."""
    done = subprocess.run([*PROGRAM, *words], env=environment(), capture_output=True, text=True, check=False)
    if done.returncode:
        raise RflError(done.stderr.strip().removeprefix("error: ") or f"exit status {done.returncode}")
    return done.stdout


def main(words: Sequence[str]) -> int:
    """Runs ``rfl evaluate`` with ``--dask`` among its words; gives the exit status."""
    from distributed import as_completed
    from tqdm import tqdm

    address, words = taken(words, "--dask")
    sweep = "--sweep" in words
    words = [word for word in words if word not in ("--sweep", "--quiet")]
    try:
        conditions = [line.split() for line in said([*words, "--list"]).splitlines()]
        out, words = taken(words, "--out")
        vehicle, _ = taken(words, "--vehicle")
        for name in ("--plants", "--noise", "--threads"):
            _, words = taken(words, name)
        if out is None:
            stem = "" if vehicle in (None, "c_class") else f"_{Path(vehicle).stem}"
            out = f"out/evaluate{stem}"
        folder = Path(out).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        jobs = {}
        for plant, noise in conditions:
            name = f"{plant}{'_noise' if noise == 'on' else ''}"
            there, part = folder / f"{name}.json", folder / "parts" / name
            # A copy: whether results belong to what is asked is for the task to say.
            if there.exists() and not (part / there.name).exists():
                part.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(there, part / there.name)
            jobs[name] = [*words, "--plants", plant, "--noise", noise, "--threads", "1", "--out", str(part), "--quiet"]
        with cluster(address) as client:
            tasks = {client.submit(said, job, key=f"evaluate-{name}", pure=False): name for name, job in jobs.items()}
            for task in tqdm(as_completed(tasks), total=len(tasks), unit="plant", file=sys.stderr):
                name = tasks[task]
                part = folder / "parts" / name
                try:
                    text = task.result().replace(str(part), str(folder))
                except RflError as error:
                    raise RflError(str(error).replace(str(part), str(folder))) from None
                for found in part.iterdir():
                    if not found.name.startswith("."):
                        if found.is_dir():
                            shutil.rmtree(folder / found.name, ignore_errors=True)
                        shutil.move(found, folder / found.name)
                print(text, end="", flush=True)
        shutil.rmtree(folder / "parts", ignore_errors=True)
        if sweep:
            print(
                said(
                    [*words, "--plants", conditions[0][0], "--noise", conditions[0][1], "--out", str(folder), "--sweep"]
                )
            )
    except RflError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
