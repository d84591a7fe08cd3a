"""Instructions of a control step, counted by callgrind: no machine is too busy for that, and speed cannot rot unseen.

Counts stand in `instructions.json`, for the profile that tests are built with. A step may need `MARGIN` more than is
written there; who makes it faster writes the new count. Another compiler counts otherwise: the file names the one that
was used.

In the profile `dev` the lanes of four numbers are calls, not instructions, and small dependencies are built as
quickly as they can be: what is faster in a release may count more here. An incremental build inlines least; the counts
of `dev` are those of one.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import programs
import pytest
from peer_forest import call

EXPECTED = Path(__file__).with_name("instructions.json")
MARGIN = 0.10


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """Our program, and the folder with the steps that it makes."""
    if not shutil.which("valgrind"):
        pytest.skip("NO INSTRUCTIONS ARE COUNTED: valgrind is missing (Debian, Ubuntu: apt-get install valgrind)")
    program = programs.example("peers")
    folder = tmp_path_factory.mktemp("steps")
    steps = call(program, "prepare", folder)["steps"]
    return program, folder, steps


@pytest.mark.parametrize("name", ["nominal", "rfl"])
def test_a_step_takes_no_more_instructions_than_it_did(prepared, name):
    program, folder, steps = prepared
    expected = json.loads(EXPECTED.read_text(encoding="utf-8")).get(programs.PROFILE)
    out = folder / f"{name}.callgrind"
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", "--collect-atstart=no"]
    command += ["--toggle-collect=*counted_step*", str(program), "counted", str(folder), name]
    subprocess.run(command, check=True, capture_output=True, timeout=600)
    counted = int(re.search(r"^(?:totals|summary): (\d+)", out.read_text(encoding="utf-8"), re.MULTILINE)[1]) / steps
    assert counted > 1000, "the step was not found"
    if expected is None:
        pytest.skip(
            f"NOTHING IS COMPARED: {EXPECTED.name} has no count for '{programs.PROFILE}'; {name} takes {counted:.0f}"
        )
    share = counted / expected[name] - 1
    print(f"{name}: {counted:.0f} instructions a step, {share:+.1%} against {expected[name]}")
    assert share <= MARGIN, (
        f"a step takes {counted:.0f} instructions, {share:.0%} more than the {expected[name]} in {EXPECTED.name} (made "
        f"with {expected['compiler']}); make it faster, or say there why it has to be so"
    )
