"""Bytes of a valid file in; damaged ones out: cut, flipped, repeated, with numbers that are too large, too small or none."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Sequence

import numpy as np

Edit = tuple[str, float, int]
"""Kind, where (0..1 of the file), and a number that the kind takes its choice by."""
NUMBERS = (
    b"0", b"-1", b"1e300", b"-1e-300", b"nan", b"inf", b"1" * 30, b"9" * 400, b"9" * 5000, b"0.5", b"1.2.3", b"null",
    b"true", b"[]", b"{}", b'"a"', b"[" * 3000, b"100000", b"4294967295", b"",
)  # fmt: skip
"""What takes the place of a number in a text."""
WORDS = tuple(value.to_bytes(size, order, signed=False)
              for size in (1, 2, 4, 8) for value in (0, 1, 2 ** (8 * size - 1), 2 ** (8 * size) - 1, 2 ** (4 * size))
              for order in ("little", "big"))  # fmt: skip
"""What takes the place of a binary number."""
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
KINDS = ("flip", "cut", "word", "number", "repeat", "drop", "zeros", "swap")


def edits_of(name: str, count: int) -> Iterator[list[Edit]]:
    """One to three edits, so often; those of a reader's name, the same at every run."""
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    for _ in range(count):
        kinds = rng.choice(KINDS, rng.integers(1, 4))
        yield [(str(kind), float(rng.random()), int(rng.integers(2**16))) for kind in kinds]


def mutated(data: bytes, edits: Sequence[Edit]) -> bytes:
    """The bytes after some edits."""
    for kind, where, choice in edits:
        if data:
            data = _edited(data, kind, min(int(where * len(data)), len(data) - 1), choice)
    return data


def _edited(data: bytes, kind: str, at: int, choice: int) -> bytes:
    length = 1 + choice % 64
    if kind == "flip":
        return data[:at] + bytes([data[at] ^ (1 + choice % 255)]) + data[at + 1 :]
    if kind == "cut":
        return data[:at]
    if kind == "word":
        word = WORDS[choice % len(WORDS)]
        return data[:at] + word + data[at + len(word) :]
    if kind == "number":
        found = list(NUMBER.finditer(data[: 1 << 16]))
        if not found:
            return data
        match = found[min(at * len(found) // len(data), len(found) - 1)]
        return data[: match.start()] + NUMBERS[choice % len(NUMBERS)] + data[match.end() :]
    if kind == "repeat":
        return data[:at] + data[at : at + length] * (2 + choice % 5) + data[at + length :]
    if kind == "drop":
        return data[:at] + data[at + length :]
    if kind == "zeros":
        return data[:at] + bytes(length) + data[at + length :]
    return data[:at] + data[at : at + length][::-1] + data[at + length :]
