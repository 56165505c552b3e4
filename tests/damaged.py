"""Damaged copies of a file, the same at every run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np


def damaged_copies(whole: Path, count: int) -> Iterator[Path]:
    """So many files beside it, in each of which six bytes after the first twelve are others; every second one is cut off, too."""
    data, rng = whole.read_bytes(), np.random.default_rng(2)
    for number in range(count):
        spoilt = bytearray(data[: rng.integers(20, len(data))] if number % 2 else data)
        for place in rng.integers(12, len(spoilt), 6):
            spoilt[place] = rng.integers(0, 256)
        path = whole.with_name(f"damaged {number}{whole.suffix}")
        path.write_bytes(spoilt)
        yield path
