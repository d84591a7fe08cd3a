"""What counts as confused, and whether the report says why."""

from blind import manoeuvres


def label(value=0.1):
    return {"kind": "single", "causes": ["cg_shift"], "values": {"cg_shift": value}}


def report(*named, kind="effect", likeness=None, named_from=0.05):
    """Effects as (id, class); how collinear the true one is with them."""
    effects = [{"id": id, "class": members} for id, members in named]
    return {
        "verdict": {"kind": kind, "effects": effects if kind == "effect" else []},
        "candidates": [{"effects": ["cg_shift"], "collinearity": likeness}],
        "observability": [{"effect": "cg_shift", "named_from": named_from}],
    }


RIGHT = ("cg_shift", ["cg_shift"])
IN_CLASS = ("cg_shift", ["cg_shift", "payload"])
OTHER = ("payload", ["payload"])


def test_right_and_missing_names_are_not_confused():
    assert not manoeuvres.confused(label(), report(RIGHT))
    assert not manoeuvres.confused(label(), report(kind="none"))


def test_another_name_a_class_and_one_too_many_are():
    for named in ([OTHER], [IN_CLASS], [RIGHT, OTHER]):
        assert manoeuvres.confused(label(), report(*named))
    assert manoeuvres.has_another(label(), report(RIGHT, OTHER))
    assert not manoeuvres.has_another(label(), report(OTHER))
    assert not manoeuvres.has_another(label(), report(IN_CLASS))


def test_a_confusion_is_explained_by_class_likeness_or_size():
    assert manoeuvres.explained(label(), report(IN_CLASS))
    assert manoeuvres.explained(label(), report(OTHER, likeness=-0.93))
    assert manoeuvres.explained(label(), report(OTHER, likeness=0.2, named_from=0.2))
    assert not manoeuvres.explained(label(), report(OTHER, likeness=0.2))
    assert not manoeuvres.explained(label(), report(OTHER))
