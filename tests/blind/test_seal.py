"""Labels stay sealed until they are scored."""

import json

import pytest

from blind import seal

LABELS = [{"case": 0, "kind": "single", "causes": ["steer_delay"], "values": {"steer_delay": 0.123456}}]
SALT = bytes(range(16))


def test_labels_cannot_be_read_without_the_seed(tmp_path):
    place = tmp_path / "labels.sealed"
    expected = seal.close(LABELS, 42, SALT, place)
    for secret in (b"steer_delay", b"0.123456", b"single"):
        assert secret not in place.read_bytes()
    with pytest.raises(seal.BrokenSeal, match="does not open"):
        seal.open_labels(place, 43, expected)
    assert seal.open_labels(place, 42, expected) == LABELS


def test_changed_labels_are_noticed(tmp_path):
    place = tmp_path / "labels.sealed"
    expected = seal.close(LABELS, 42, SALT, place)
    other = [LABELS[0] | {"causes": ["steer_lag"]}]
    seal.close(other, 42, SALT, place)
    with pytest.raises(seal.BrokenSeal, match="other labels"):
        seal.open_labels(place, 42, expected)
    spoiled = bytearray(place.read_bytes())
    spoiled[40] ^= 1
    place.write_bytes(bytes(spoiled))
    with pytest.raises(seal.BrokenSeal):
        seal.open_labels(place, 42, expected)


def test_the_hash_is_salted_and_hangs_on_every_bit():
    again = json.loads(json.dumps(LABELS))
    assert seal.commitment(again, SALT) == seal.commitment(LABELS, SALT)
    assert seal.commitment(LABELS, bytes(16)) != seal.commitment(LABELS, SALT)
    again[0]["values"]["steer_delay"] += 1e-9
    assert seal.commitment(again, SALT) != seal.commitment(LABELS, SALT)
