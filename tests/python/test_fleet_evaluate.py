"""`rfl evaluate --dask`: which tasks there are, where their results come to lie, and what is not done again."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="the extra [fleet] is not installed")


@pytest.fixture
def evaluate(rfl_mpc):
    return importlib.import_module("rfl_mpc.fleet.evaluate")


def test_an_option_is_taken_with_its_value(evaluate):
    assert evaluate.taken(["--quick", "--dask", "local"], "--dask") == ("local", ["--quick"])
    assert evaluate.taken(["--dask=tcp://a:1", "--seeds", "2"], "--dask") == ("tcp://a:1", ["--seeds", "2"])
    assert evaluate.taken(["--quick"], "--out") == (None, ["--quick"])


def test_each_plant_and_noise_is_a_task_and_its_results_lie_beside_the_others(evaluate, tmp_path, monkeypatch, capsys):
    def said(words):
        if "--list" in words:
            return "lag off\nlag on\nas_is off\n"
        out = Path(words[words.index("--out") + 1])
        noise = "_noise" if words[words.index("--noise") + 1] == "on" else ""
        name = words[words.index("--plants") + 1] + noise
        if (out / f"{name}.json").exists():
            return f"{name}: there already ({out / name}.json); delete the file to repeat it\n"
        (out / f"drives_{name}").mkdir(parents=True)
        (out / f"{name}.json").write_text(" ".join(words))
        return "a table\n"

    monkeypatch.setattr(evaluate, "said", said)
    out = tmp_path / "results"
    out.mkdir()
    (out / "as_is.json").write_text("there")
    assert evaluate.main(["--dask", "local", "--quick", "--out", str(out), "--noise", "both"]) == 0
    assert sorted(one.name for one in out.glob("*.json")) == ["as_is.json", "lag.json", "lag_noise.json"]
    assert (out / "as_is.json").read_text() == "there" and not (out / "parts").exists()
    for name in ("lag", "lag_noise"):
        words = (out / f"{name}.json").read_text()
        assert "--quick" in words and "--dask" not in words and (out / f"drives_{name}").is_dir()
    assert f"as_is: there already ({out / 'as_is'}.json)" in capsys.readouterr().out


def test_results_of_another_vehicle_are_refused_and_stay(evaluate, tmp_path, monkeypatch, capsys):
    def said(words):
        if "--list" in words:
            return "lag off\n"
        out = Path(words[words.index("--out") + 1])
        raise evaluate.RflError(f'{out / "lag.json"}: holds results of the vehicle "A"')

    monkeypatch.setattr(evaluate, "said", said)
    (tmp_path / "lag.json").write_text("of another")
    assert evaluate.main(["--dask", "local", "--out", str(tmp_path)]) == 1
    assert (tmp_path / "lag.json").read_text() == "of another"
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith(f"error: {tmp_path / 'lag.json'}: holds results")


def test_what_a_run_without_dask_left_unfinished_is_gone_on_with(evaluate, tmp_path, monkeypatch):
    def said(words):
        if "--list" in words:
            return "lag off\n"
        file = Path(words[words.index("--out") + 1]) / "lag.json"
        assert '"unfinished": true' in file.read_text()
        (file.parent / "drives_lag").mkdir()
        file.write_text("whole")
        return "a table\n"

    monkeypatch.setattr(evaluate, "said", said)
    (tmp_path / "drives_lag").mkdir()
    (tmp_path / "lag.json").write_text('{"unfinished": true}')
    assert evaluate.main(["--dask", "local", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "lag.json").read_text() == "whole" and not list((tmp_path / "drives_lag").iterdir())


def test_a_failure_is_one_line(evaluate, tmp_path, capsys):
    assert evaluate.main(["--dask", "local", "--plants", "nothing", "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err.startswith("error: there is no plant 'nothing'")
