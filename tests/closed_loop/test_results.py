"""What the results' writers say of numbers: divergence is no success, and what falls short is said."""

from __future__ import annotations

import pytest

pytest.importorskip("matplotlib", reason="plots need scripts/setup --plots")

from results import car, truck
from results.common import summary, tracking_markdown


def outcome(mae: float, lost: bool = False, articulation: float = 0.5) -> dict:
    return {
        "tracking": {"mae": mae, "rmse": 1.5 * mae, "max": 3 * mae},
        "steering": {"rate_rms": 0.05},
        "lost": lost,
        "articulation": articulation,
    }


def rows_of(outcomes: dict[str, dict]) -> dict:
    return {name: summary([of], [outcomes["MPC"]]) for name, of in outcomes.items()}


def test_pe_is_the_cut_against_the_nominal_and_none_where_something_diverged():
    rows = rows_of({"MPC": outcome(0.1), "RFL": outcome(0.02), "RTL": outcome(0.01, lost=True)})
    assert rows["RFL"]["pe_mae"] == pytest.approx(80) and rows["RFL"]["pe_rmse"] == pytest.approx(80)
    assert rows["RTL"]["diverged"] == 1
    _, _, mpc, rfl, rtl = tracking_markdown(rows).split("\n")
    assert "80.0" in rfl and "diverged in 1 of 1" in rtl and "90.0" not in rtl and "0.0 ±" in mpc
    # Against a nominal that diverged there is no cut at all.
    rows = rows_of({"MPC": outcome(0.1, lost=True), "RFL": outcome(0.02)})
    assert "80.0" not in tracking_markdown(rows)


def test_the_best_row_never_diverged_and_what_falls_short_is_said():
    rows = rows_of(
        {"MPC": outcome(0.1), "RFL": outcome(0.03), "RTL": outcome(0.001, lost=True), "oracle": outcome(0.02)}
    )
    text = truck.verdict(rows, "", 80.0, ("RTL", "oracle"))
    assert text.startswith("RFL, MAE 30.00 mm") and "**below** 80.0 %" in text
    assert "No worse than RTL (diverged)" in text and "**Worse than** oracle (20.00 mm)" in text
    assert "at least 51.5 %" in truck.verdict(rows, "", 51.5, ())
    assert truck.verdict(rows, "+observer", 80.0, ()) is None


def test_a_u_turn_is_within_bounds_only_if_driven_to_its_end():
    turns = {"MPC": outcome(0.1, articulation=1.2), "RFL": outcome(0.1), "RTL": outcome(0.1, lost=True)}
    condition = {
        "articulation_bound": 1.0,
        "rows": [{"row": name, "further": {"truck_u_turn": [of]}} for name, of in turns.items()],
    }
    rows = truck.u_turns(condition)
    assert [rows[name]["within_bounds"] for name in turns] == [False, True, False]
    assert [rows[name]["completed"] for name in turns] == [True, True, False]


def test_the_sweep_marks_divergence():
    points = [
        {"dead_time": 0.1, "weights": "default", "row": "MPC", "outcome": outcome(0.1)},
        {"dead_time": 0.5, "weights": "default", "row": "MPC", "outcome": outcome(0.1, lost=True)},
        {"dead_time": 0.1, "weights": "default", "row": "RFL", "outcome": outcome(0.01)},
        {"dead_time": 0.5, "weights": "default", "row": "RFL", "outcome": None},
    ]
    text = truck.sweep_markdown(truck.sweep_table(points)["default"])
    assert "| MPC | 100.00 | diverged |" in text and "| RFL | 10.00 | nothing to learn from |" in text


def test_conditions_that_were_not_run_stay_with_the_program_that_ran_them():
    names = ["lag", "as_is"]
    before = {"vehicle": "A", "effort": {"seeds": 5}, "program": "old", "conditions": {"lag": 1, "as_is": 2}}
    results = {"vehicle": "A", "effort": {"seeds": 5}, "conditions": {"lag": 3}}
    car.keep(results, before, names)
    assert results["conditions"] == {"lag": 3, "as_is": 2} and results["kept"] == {"as_is": "old"}
    # What was kept once is still of that program.
    again = {"vehicle": "A", "effort": {"seeds": 5}, "conditions": {"lag": 4}}
    car.keep(again, results | {"program": "newer"}, names)
    assert again["kept"] == {"as_is": "old"}
    for other in ({"vehicle": "B"}, {"effort": {"seeds": 3}}):
        alone = {"vehicle": "A", "effort": {"seeds": 5}, "conditions": {"lag": 3}}
        car.keep(alone, before | other, names)
        assert alone["conditions"] == {"lag": 3} and alone["kept"] == {}
