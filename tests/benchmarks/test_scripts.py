"""Every script of benchmarks/, and what a click is worth. What the scripts made is tested where it ships."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np

from click_photos import innermost_pixel, largest_region
from clicks import Click

SCRIPTS = sorted(path.stem for path in (Path(__file__).parents[2] / "benchmarks").glob("*.py"))


def test_every_script_is_imported() -> None:
    """Oracle: the package: each name that a script imports is there."""
    assert len(SCRIPTS) > 40
    for name in SCRIPTS:
        importlib.import_module(name)


def test_the_score_of_a_click_on_nothing() -> None:
    """1 where nothing is found, else 0; on an object the intersection over union of what counts."""
    nothing, some = np.zeros((4, 4), np.bool_), np.eye(4, dtype=np.bool_)
    assert [Click((0, 0), nothing, nothing).score(found) for found in (nothing, some)] == [1, 0]
    assert Click((0, 0), some, ~some).score(np.ones_like(some)) == 1
    assert Click((0, 0), some, nothing).score(np.ones_like(some)) == 0.25


def square(top: int, left: int, side: int) -> np.ndarray:
    out = np.zeros((60, 60), bool)
    out[top : top + side, left : left + side] = True
    return out


def test_where_to_click() -> None:
    """The innermost pixel of a square is its middle, of two the larger one's; at the picture's rim it is off the rim."""
    assert all(abs(one - 20) <= 1 for one in innermost_pixel(square(11, 11, 19)))
    both = square(5, 5, 9) | square(30, 30, 21)
    np.testing.assert_array_equal(largest_region(both), square(30, 30, 21))
    x, y = innermost_pixel(square(0, 0, 21))
    assert 9 <= x <= 11 and 9 <= y <= 11
