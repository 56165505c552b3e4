"""What the border cuts continues as a circle would (oracles: discs and posts drawn whole, then cut; laws)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.holes import dilate_mask
from dlama.inpainters.layered.depth.cut_objects import CutObjects, find_cut_objects, foliage
from dlama.perception.planes import SMOOTH

HW, BORDER = (120, 160), 110
ROWS, COLUMNS = np.indices(HW)
UNSEEN = BORDER <= COLUMNS
WALL, OBJECT = 0.1, 0.5
"""Inverse depths, 1/m."""


GAPS = np.random.default_rng(0).random(HW) < 0.2
"""Between leaves."""


def cut(item: np.ndarray, w: np.ndarray | None = None) -> CutObjects:
    """Of an object (h x w) before a wall, all but for what lies beyond the BORDER known."""
    w = np.where(item, OBJECT, WALL).astype(np.float32) if w is None else w
    label = np.where(item, SMOOTH, 1).astype(np.int8)
    return find_cut_objects(w, label, UNSEEN, dilate_mask(UNSEEN, 2))


@pytest.mark.parametrize("inside", [-10, -6, 0, 8])
def test_a_disc_continues_as_the_circle_that_it_is(inside: int) -> None:
    """Truth: of a disc of 20 cells full of gaps, its middle so many cells before the border, what nobody sees is found."""
    disc = np.hypot(ROWS - 60, COLUMNS - (BORDER - inside)) <= 20
    found = cut(disc & ~GAPS)
    beyond, truth = (found.number > 0) & UNSEEN, disc & UNSEEN
    assert (beyond & truth).sum() > 0.65 * (beyond | truth).sum()
    assert found.inverse_depth[1:] == pytest.approx([OBJECT])
    assert (found.number[disc & ~GAPS & (COLUMNS >= BORDER - 5) & ~UNSEEN] == 1).all()
    assert np.isinf(found.beyond[UNSEEN]).all()
    np.testing.assert_allclose(found.circle[1], (60, BORDER - inside, 20), atol=3)


def test_without_leaves_a_disc_has_an_extent_alone() -> None:
    """Law: in depth that resolves no leaves it ends as any object without a plane; nothing is numbered."""
    disc = (np.hypot(ROWS - 60, COLUMNS - BORDER) <= 20) & ~GAPS
    w = np.where(disc, OBJECT, WALL).astype(np.float32)
    found = find_cut_objects(
        w, np.where(disc, SMOOTH, 1).astype(np.int8), UNSEEN, dilate_mask(UNSEEN, 2), with_leaves=False
    )
    assert not found.number.any() and len(found.circle) == 1
    assert np.isfinite(found.beyond).all() and found.beyond[60, BORDER + 1] == 0 < found.beyond[60, -1]


@pytest.mark.parametrize(
    ("item", "end"),
    [
        (np.hypot(ROWS - 60, COLUMNS - BORDER) <= 20, 0),
        ((COLUMNS >= BORDER - 4) & (np.abs(ROWS - 60) < 25) & ~GAPS, 0),
        ((np.abs(ROWS - 60) <= 2) & (COLUMNS > BORDER - 60) & ~GAPS, BORDER + 5),
    ],
    ids=["solid", "strip along the border", "post cut across"],
)
def test_what_ends_at_the_border(item: np.ndarray, end: int) -> None:
    """Law: an eave or a bench, without gaps, has no number, nor has a strip of 4 cells that may end there. Closed form: a bar of
    60 x 5 cells continues for less than its width."""
    assert not (cut(item).number > 0)[:, end:].any()


def test_objects_at_different_depths_are_two() -> None:
    """Law: a disc before a farther one: two numbers, two inverse depths, and the nearer one is in front where both continue."""
    first, second = (np.hypot(ROWS - row, COLUMNS - BORDER) <= 18 for row in (45, 70))
    w = np.where(GAPS, WALL, np.where(first, 0.5, np.where(second, 0.25, WALL))).astype(np.float32)
    found = cut((first | second) & ~GAPS, w)
    assert sorted(found.inverse_depth[1:].tolist()) == pytest.approx([0.25, 0.5])
    both = first & second & UNSEEN
    assert both.sum() > 50 and (found.inverse_depth[found.number[both]] == 0.5).mean() > 0.8


def test_nothing_continues_where_nothing_is_cut() -> None:
    """Closed form: a disc inside the picture has no number; `beyond` is the distance from it, less 0.3 of its root area."""
    disc = np.hypot(ROWS - 60, COLUMNS - 40) <= 10
    found = cut(disc)
    assert not found.number.any() and found.inverse_depth.tolist() == [0]
    assert found.beyond[60, 70] == pytest.approx(20 - 0.3 * np.sqrt(disc.sum()), abs=0.5)
    assert (cut(np.zeros(HW, bool)).beyond == 1e3).all()


def test_foliage_has_steps_everywhere() -> None:
    """Closed form: of a checkerboard of two depths every pair of neighbours is a step, on a slope of 1 % a cell none, along one
    straight outline one pair in 30; unknown cells count as nothing."""
    known = np.ones(HW, bool)
    checker = np.where((ROWS + COLUMNS) % 2, 0.5, 0.25).astype(np.float32)
    assert foliage(checker, known).all() and not foliage(checker, ~known).any()
    assert not foliage((0.2 * 1.01**COLUMNS).astype(np.float32), known).any()
    assert not foliage(np.where(COLUMNS < 60, 0.5, 0.1).astype(np.float32), known).any()
