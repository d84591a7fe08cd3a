"""The arithmetic of a score against closed forms."""

import math

import pytest

from blind import measures


def label(kind, *causes, values=None, dominance=1.5, **more):
    return {
        "kind": kind,
        "causes": list(causes),
        "values": values or dict.fromkeys(causes, 0.1),
        "dominance": {"": dominance},
        "reference": False,
        "truck": False,
    } | more


def report(kind, *effects, probability=0.9, candidates=(), **more):
    """Effects as (id, value, class)."""
    named = [
        {"id": id, "value": value, "low": 0.9 * value, "high": 1.1 * value, "class": members, "dominance": 1.0}
        for id, value, members in effects
    ]
    verdict = {"kind": kind, "probability": probability, "effects": named}
    return {"verdict": verdict, "candidates": list(candidates), "seconds": 1.0} | more


def test_wilson_is_the_closed_form():
    z, n, p = 1.959963984540054, 20, 0.85
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    assert measures.wilson(17, 20) == pytest.approx((centre - half, centre + half))
    assert measures.wilson(0, 0) == (0.0, 1.0)
    # No hit leaves z^2 / (n + z^2) possible.
    assert measures.wilson(0, 30) == pytest.approx((0.0, z * z / (30 + z * z)), abs=1e-12)


def test_calibration_error_is_the_weighed_gap_of_the_bins():
    # Four at 0.95 of which three are right: |0.75 - 0.95|; two at 0.25, none right: 0.25.
    error = measures.calibration_error([0.95] * 4 + [0.25] * 2, [True, True, True, False, False, False])
    assert error == pytest.approx((4 * 0.20 + 2 * 0.25) / 6)
    assert measures.calibration_error([1.0, 0.0], [True, False]) == 0.0
    assert measures.calibration_error([], []) == 0.0


def test_a_class_counts_and_is_penalised_by_its_size():
    truth = label("single", "steer_delay")
    whole = report("effect", ("steer_lag", 0.1, ["steer_lag", "steer_delay"]))
    assert not measures.exact(truth, whole) and measures.in_class(truth, whole)
    assert measures.credit(truth, whole) == 0.5
    everything = report("effect", ("steer_lag", 0.1, ["steer_lag", "steer_delay", "a", "b", "c"]))
    assert not measures.in_class(truth, everything)
    exact = report("effect", ("steer_delay", 0.1, ["steer_delay"]))
    assert measures.exact(truth, exact) and measures.credit(truth, exact) == 1.0


def test_one_class_serves_one_cause_of_a_pair():
    truth = label("pair", "steer_delay", "steer_lag")
    one = report("effect", ("steer_lag", 0.1, ["steer_lag", "steer_delay"]))
    both = report("effect", ("steer_lag", 0.1, ["steer_lag", "steer_delay"]), ("steer_delay", 0.1, ["steer_delay"]))
    assert not measures.in_class(truth, one) and measures.some_of_pair(truth, one)
    assert measures.in_class(truth, both)
    # 2 PR / (P + R) with P = 1, R = 1/2.
    assert measures.f1(truth, one) == pytest.approx(2 / 3)
    assert measures.f1(truth, both) == 1.0


def test_one_more_than_the_truth_is_wrong():
    truth = label("single", "steer_delay")
    two = report("effect", ("steer_delay", 0.1, ["steer_delay"]), ("drag", 2.0, ["drag"]))
    assert not measures.exact(truth, two) and not measures.in_class(truth, two)


def test_none_and_outside_are_verdicts_of_their_own():
    assert measures.exact(label("none"), report("none"))
    assert not measures.exact(label("none"), report("cannot_tell"))
    assert measures.exact(label("outside", "gusts"), report("not_in_library"))
    assert not measures.in_class(label("single", "drag"), {"error": "no answer", "seconds": 1.0})


def test_a_value_is_judged_by_its_distance_from_neutral():
    truth = label("single", "steer_gain", values={"steer_gain": 1.10})
    assert measures.value_errors(truth, report("effect", ("steer_gain", 1.11, []))) == pytest.approx([0.1])
    truth = label("single", "steer_rate_limit", values={"steer_rate_limit": 0.2})
    assert measures.value_errors(truth, report("effect", ("steer_rate_limit", 0.25, []))) == pytest.approx([0.25])
    assert measures.covered(truth, report("effect", ("steer_rate_limit", 0.25, []))) == [False]


def test_a_wind_named_by_its_speed_is_judged_by_its_speed():
    truth = label("single", "wind_x", values={"wind_x": -8.0})
    found = report("effect", ("wind_x", 8.4, ["wind_x", "wind_y"]))
    assert measures.value_errors(truth, found) == pytest.approx([2.05]) and measures.covered(truth, found) == [False]
    found["verdict"]["effects"][0]["direction"] = 2.0
    assert measures.value_errors(truth, found) == pytest.approx([0.05]) and measures.covered(truth, found) == [True]


def test_what_a_log_shows_is_what_its_report_says():
    seen = [{"effect": "drag", "named_from": 0.5}, {"effect": "steer_gain", "named_from": None}]
    found = report("none", observability=seen)
    for drag, shown in [(1.6, True), (1.4, False), (0.4, True)]:
        values = {"drag": drag, "steer_gain": 1.001, "steer_rate_limit": 0.1}
        truth = label("pair", *values, values=values)
        assert measures.shown(truth, found) == shown


def test_shrinkage_leaves_noise_out():
    gap = {"before": 0.05, "effect": 0.05, "recalibrated": 0.03, "noise": 0.03}
    found = report("effect", gap_reduction={"open_loop": {"yaw_rate": gap}})
    assert measures.shrinkage(found) == pytest.approx(1.0)
    assert measures.shrinkage(found, stage="effect") == pytest.approx(0.0)
    assert measures.shrinkage(report("none")) is None


def test_score_counts_each_kind_by_itself():
    labels = [
        label("single", "drag", dominance=2.0),
        label("single", "drag", dominance=0.5),
        label("none", dominance=0.0),
        label("none", dominance=0.0),
        label("outside", "gusts"),
        label("pair", "drag", "payload"),
    ]
    reports = [
        report("effect", ("drag", 0.1, ["drag"])),
        report("none"),
        report("none"),
        report("not_in_library"),
        report("not_in_library"),
        report("effect", ("drag", 0.1, ["drag"])),
    ]
    found = measures.score(labels, reports)
    assert (found["moderate"]["hits"], found["moderate"]["count"]) == (1, 1)
    assert (found["small"]["hits"], found["small"]["count"]) == (0, 1)
    assert (found["false_alarms"]["hits"], found["false_alarms"]["count"]) == (1, 2)
    assert (found["outside_found"]["hits"], found["false_flags"]["hits"], found["false_flags"]["count"]) == (1, 1, 5)
    assert (found["pair_both"]["hits"], found["pair_one"]["hits"]) == (0, 1)
    assert found["confusion"]["drag"] == {"drag": 1, "none": 1}
    assert found["value_error"] == 0.0


def test_how_clear_a_case_is():
    # Tyres 4 %, offset 1.7 mrad: the weaker one counts. Backlash has no tolerance.
    pair = label(
        "pair", "tyre_stiffness_front", "steer_offset", values=dict(tyre_stiffness_front=0.8, steer_offset=0.017)
    )
    assert measures.tolerances_off(pair) == pytest.approx(5.0)
    assert measures.tolerances_off(label("single", "steer_backlash")) == math.inf
    score = measures.score([pair], [report("effect", ("steer_offset", 0.017, ["steer_offset"]))])
    assert (
        score["clear_pair"]["count"] == 1 and score["clear_pair"]["hits"] == 0 and score["clear_single"]["count"] == 0
    )


def test_a_name_that_was_not_put_in_may_be_true_of_the_unit():
    # A lever arm has 5 cm of tolerance, a mass 3 %.
    background = {"imu_lever_arm": -0.48, "mass": 1.2, "drag": 1.0}
    unit = label("none", background=background)
    named = [("imu_lever_arm", -0.4, []), ("payload", 250.0, []), ("drag", 1.8, []), ("steer_backlash", 0.01, [])]
    assert measures.wrong_names(unit, report("effect", *named)) == [True, True, False, False]
    # The other side, and what was put in.
    assert measures.wrong_names(unit, report("effect", ("imu_lever_arm", 0.4, []))) == [False]
    put_in = label("single", "imu_lever_arm", background=background)
    assert measures.wrong_names(put_in, report("effect", ("imu_lever_arm", -0.4, []))) == []
    found = measures.score([unit, put_in], [report("effect", *named), report("effect", ("imu_lever_arm", -0.4, []))])
    assert (found["wrong_names"]["hits"], found["wrong_names"]["count"]) == (4, 5)
    assert (found["wrong_names_of_unit"]["hits"], found["wrong_names_of_unit"]["count"]) == (2, 4)
