"""Sets of cases: the same seed gives the same bits; the diagnosis gets no label."""

import gzip
import json

import numpy as np
import pytest

from blind import cases, make, sensors

SET = cases.Set(99, True, 20, longest=30.0)


def plan(kind, *causes, vehicle="bmw", reference=False):
    return cases.Plan(kind, vehicle, causes, reference)


def made(number, planned, of=SET):
    return cases.make(of, number, planned, cases.vehicle_of(of.designs(), planned.vehicle))


@pytest.mark.parametrize("vehicle", ["bmw", "truck"])
def test_the_same_seed_gives_the_same_bits(vehicle, tmp_path):
    planned = plan("single", "steer_delay", vehicle=vehicle)
    for name in ("a", "b"):
        make.write_case(made(3, planned), tmp_path / name)
    for file in ("log.csv.gz", "vehicle.toml"):
        assert (tmp_path / "a/case_003" / file).read_bytes() == (tmp_path / "b/case_003" / file).read_bytes()
    other = cases.Set(98, True, 20, longest=30.0)
    make.write_case(made(3, planned, other), tmp_path / "c")
    assert (tmp_path / "c/case_003/log.csv.gz").read_bytes() != (tmp_path / "a/case_003/log.csv.gz").read_bytes()


def test_development_and_scoring_share_neither_vehicles_nor_drives():
    scoring = cases.Set(99, False, 20, longest=30.0)
    for one, other in zip(SET.designs(), scoring.designs()):
        assert one.name == other.name and one.p != other.p
    assert not np.array_equal(SET.rng(3, 0).normal(size=4), scoring.rng(3, 0).normal(size=4))


def test_a_plan_holds_all_kinds_and_spreads_the_effects():
    plans = cases.Set(5, False, 400).plan()
    assert len(plans) == 400
    count = {kind: sum(p.kind == kind for p in plans) for kind in cases.KINDS}
    assert count == {"single": 200, "pair": 60, "none": 80, "outside": 60}
    singles = [p.causes[0] for p in plans if p.kind == "single" and p.vehicle != "truck"]
    often = [singles.count(id) for id in set(singles)]
    assert len(often) == 28 and max(often) - min(often) <= 1
    assert all(len(set(p.causes)) == 2 for p in plans if p.kind == "pair")


def test_the_diagnosis_gets_no_label(tmp_path):
    case = made(4, plan("single", "steer_gain", reference=True))
    make.write_case(case, tmp_path)
    folder = tmp_path / "case_004"
    assert sorted(p.name for p in folder.iterdir()) == ["bmw.tir", "log.csv.gz", "reference.csv.gz", "vehicle.toml"]
    text = (folder / "vehicle.toml").read_text()
    assert "effect" not in text and "steer_gain" not in text and "single" not in text
    header = gzip.decompress((folder / "log.csv.gz").read_bytes()).decode().splitlines()[0]
    assert header.split(",") == list(case.log) and header.startswith("time,steer_cmd,accel_cmd")
    # The file is the design's, not the unit's: its tolerances are the case's secret too.
    again = made(4, plan("single", "steer_gain", reference=True))
    assert case.background["mass"] != 1.0 and json.dumps(again.label()) == json.dumps(case.label())


def test_a_case_keeps_what_it_promises():
    case = made(5, plan("pair", "steer_delay", "road_bank"))
    assert min(case.dominance.values()) >= cases.LEAST_OF_PAIR and max(case.dominance.values()) <= cases.DOMINANCE[1]
    outside = made(6, plan("outside", "second_order_steering"))
    assert outside.dominance[""] >= cases.LEAST_OUTSIDE and not outside.values


def test_stamps_rise_and_noise_has_its_size():
    case = made(7, plan("none"))
    assert np.all(np.diff(case.log["time"]) > 0.0)
    true = case.truth.signals[:: round(1.0 / (case.suite.rate * case.truth.h)), 3] * case.background["speed_scale"]
    if case.background["sensor_delay"] < 0.004:
        noise = case.log["vx"] - true
        assert np.std(np.diff(noise)) == pytest.approx(2**0.5 * sensors.NOISE["vx"] * case.suite.noise, rel=0.15)
