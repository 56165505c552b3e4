"""The rough guess that patches begin with, and its mean with them where they differ. Oracle: closed forms."""

import numpy as np
import pytest

from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.inpainters.patchmatch.filler import AGREE, DIFFERS, DISTANCE, GUESS_SIDE, blend_with_guess, guess_coarsely

TELEA = 3
"""Levels by which OpenCV's Telea is off on one colour (5), as half of the smooth estimate."""


def test_a_painter_sees_a_large_picture_small_and_without_the_hole() -> None:
    """Closed form: a picture of one colour with another in its hole reaches the painter without that other, GUESS_SIDE px wide;
    known pixels come back as they were, the hole as it was painted."""
    picture = np.full((500, 2 * GUESS_SIDE, 3), 90, np.uint8)
    hole = np.zeros(picture.shape[:2], bool)
    hole[200:301, 400:601] = True
    picture[hole] = 255

    def paint(small: UInt8Array, of: BoolArray, seed: int) -> UInt8Array:
        assert small.shape == (250, GUESS_SIDE, 3) and seed == 3
        assert (small[~of] == 90).all() and 0.9 < of.sum() * 4 / hole.sum() < 1.1
        return np.where(of[..., None], np.uint8(40), small)

    out = guess_coarsely(paint, picture, hole, 3)
    np.testing.assert_array_equal(out[~hole], picture[~hole])
    assert (out[210:290, 410:590] == 40).all()


def test_a_small_picture_is_painted_as_it_is() -> None:
    """Closed form."""
    picture, hole = np.zeros((20, 30, 3), np.uint8), np.zeros((20, 30), bool)
    assert guess_coarsely(lambda given, of, seed: given + np.uint8(seed), picture, hole, 7).max() == 7


def square_hole(side: int, first: int, last: int) -> np.ndarray:
    hole = np.zeros((side, side), np.bool_)
    hole[first:last, first:last] = True
    return hole


def in_hole(level: int, hole: np.ndarray, known: int) -> UInt8Array:
    """A grey picture with another level in its hole."""
    return np.repeat(np.where(hole, np.uint8(level), np.uint8(known))[..., None], 3, 2)


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


@pytest.mark.parametrize(("painted", "guess"), [(100, 220), (220, 100)])
def test_what_neither_the_picture_nor_the_other_shows_weighs_little(painted: int, guess: int) -> None:
    """Closed form: all known pixels have 100 levels, so that the one with 220 is 120 off and the other 0: the weights are as
    DISTANCE + 120 to DISTANCE."""
    hole = square_hole(96, 20, 70)
    patches, network = (in_hole(level, hole, 100) for level in (painted, guess))
    out = blend_with_guess(patches, network, hole, hole)
    assert (out[~hole] == 100).all()
    np.testing.assert_allclose(out[35:55, 35:55], 100 + 120 * DISTANCE / (2 * DISTANCE + 120), atol=TELEA)


def test_hidden_pixels_are_no_evidence() -> None:
    """Closed form: of the known pixels those of 100 levels are hidden, so that 220, as all others have, is right."""
    hole = square_hole(96, 20, 70)
    patches, network = (in_hole(level, hole, 220) for level in (100, 220))
    patches[:20], network[:20] = 100, 100
    hidden = hole.copy()
    hidden[:20] = True
    out = blend_with_guess(patches, network, hole, hidden)
    np.testing.assert_allclose(out[35:55, 35:55], 220 - 120 * DISTANCE / (2 * DISTANCE + 120), atol=TELEA)


def test_a_share_is_the_same_everywhere() -> None:
    """Closed form: at a quarter, 100 and 104 levels give 101, 100 and 180 give 120, whether they differ by little or by far."""
    hole = square_hole(96, 20, 70)
    for guess, mean in ((104, 101), (180, 120)):
        out = blend_with_guess(in_hole(100, hole, 50), in_hole(guess, hole, 50), hole, guess_share=0.25)
        assert (out[hole] == mean).all() and (out[~hole] == 50).all()


@pytest.mark.parametrize(("spread", "counts"), [(0.0, 0.0), (AGREE, 0.5), (1e6, 1.0)])
def test_patches_that_agree_are_kept(spread: float, counts: float) -> None:
    """Closed form: patches and guess are as far from the known colours, so that their mean is taken; of the way to it
    spread^2 / (spread^2 + AGREE^2) is gone."""
    hole = square_hole(96, 20, 70)
    painted, guess = in_hole(80, hole, 100), in_hole(120, hole, 100)
    out = blend_with_guess(painted, guess, hole, hole, spread=np.where(hole, np.float32(spread), np.float32(0)))
    np.testing.assert_allclose(out[35:55, 35:55], 80 + 20 * counts, atol=TELEA)
