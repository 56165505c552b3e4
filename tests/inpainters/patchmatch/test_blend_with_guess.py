"""Patches and their guess are averaged where they differ: closed forms."""

from __future__ import annotations

import numpy as np

from dlama.inpainters.patchmatch.filler import DIFFERS, blend_with_guess


def square_hole(side: int, first: int, last: int) -> np.ndarray:
    hole = np.zeros((side, side), np.bool_)
    hole[first:last, first:last] = True
    return hole


def test_the_mean_is_taken_where_they_differ_by_far() -> None:
    """Closed form: 100 and 160 levels give 130 in the hole; known pixels stay."""
    hole = square_hole(96, 20, 70)
    painted = np.full((96, 96, 3), 100, np.uint8)
    guess = np.where(hole[..., None], np.uint8(160), painted)
    out = blend_with_guess(painted, guess, hole)
    assert (out[~hole] == 100).all()
    assert (out[35:55, 35:55] == 130).all()


def test_a_small_difference_counts_in_proportion() -> None:
    """Closed form: a difference of DIFFERS / 2 moves the colour by a quarter of itself."""
    hole = square_hole(96, 0, 96)
    painted = np.full((96, 96, 3), 100, np.uint8)
    out = blend_with_guess(painted, painted + np.uint8(DIFFERS / 2), hole)
    assert (out == 100 + round(DIFFERS / 8)).all()


def test_detail_finer_than_the_guess_stays() -> None:
    """Law: in a picture larger than the guess, stripes of one pixel about the guess's own level are kept bit for bit."""
    side = 2 * 768
    hole = square_hole(side, 100, 400)
    painted = np.zeros((side, side, 3), np.uint8)
    painted[:, ::2] = 200
    guess = np.where(hole[..., None], np.uint8(100), painted)
    inner = np.s_[140:360, 140:360]
    np.testing.assert_array_equal(blend_with_guess(painted, guess, hole)[inner], painted[inner])
