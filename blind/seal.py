"""Seals the labels of a set until it is scored.

The key comes from the set's secret seed, which only the scoring process holds; beside the sealed file stands a salted
hash of the labels. Opening checks the hash: labels that were changed are no labels.
"""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path

from cryptography.fernet import Fernet, InvalidToken


class BrokenSeal(RuntimeError):
    """The sealed labels are not those that were sealed."""


def _key(seed: int, salt: bytes) -> bytes:
    return base64.urlsafe_b64encode(hashlib.scrypt(str(seed).encode(), salt=salt, n=2**14, r=8, p=1, dklen=32))


def commitment(labels: list[dict], salt: bytes) -> str:
    """The salted hash of the labels, hexadecimal."""
    return hashlib.sha256(salt + json.dumps(labels, sort_keys=True).encode()).hexdigest()


def close(labels: list[dict], seed: int, salt: bytes, place: Path) -> str:
    """Writes the labels sealed, and gives their salted hash."""
    place.write_bytes(salt + Fernet(_key(seed, salt)).encrypt(json.dumps(labels).encode()))
    return commitment(labels, salt)


def open_labels(place: Path, seed: int, expected: str) -> list[dict]:
    """The labels of a sealed file.

    Raises `BrokenSeal` on another seed, a changed file, or labels other than those of the hash.
    """
    sealed = place.read_bytes()
    salt = sealed[:16]
    try:
        labels = json.loads(Fernet(_key(seed, salt)).decrypt(sealed[16:]))
    except InvalidToken as error:
        raise BrokenSeal(f"{place} does not open with this seed") from error
    if commitment(labels, salt) != expected:
        raise BrokenSeal(f"{place} holds other labels than those whose hash was written")
    return labels


def hash_of(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def hash_of_sources(folder: Path) -> str:
    """SHA-256 of all Python files of a folder, in the order of their names."""
    files = sorted(folder.glob("*.py"))
    return hashlib.sha256(b"".join(file.name.encode() + b"\0" + file.read_bytes() for file in files)).hexdigest()
