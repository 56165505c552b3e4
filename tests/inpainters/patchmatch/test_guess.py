"""The rough guess that patches begin with, and its mean with them where they differ. Oracle: closed forms."""

import numpy as np
import pytest

from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.inpainters.patchmatch.filler import AGREE, DIFFERS, DISTANCE, GUESS_SIDE, blend_with_guess, guess_coarsely

TELEA = 3
"""Levels by which OpenCV's Telea is off on one colour (5), as half of the smooth estimate."""


def test_a_painter_sees_a_large_picture_small_and_without_the_hole() -> None:
    """Closed form: a picture of one colour with another in its hole reaches the painter without that other, GUESS_SIDE px wide;
    known pixels come back as they were, the hole as it was painted. A small picture is painted as it is."""
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
    small, none = np.zeros((20, 30, 3), np.uint8), np.zeros((20, 30), bool)
    assert guess_coarsely(lambda given, of, seed: given + np.uint8(seed), small, none, 7).max() == 7


def square_hole(side: int, first: int, last: int) -> np.ndarray:
    hole = np.zeros((side, side), np.bool_)
    hole[first:last, first:last] = True
    return hole


def in_hole(level: int, hole: np.ndarray, known: int) -> UInt8Array:
    """A grey picture with another level in its hole."""
    return np.repeat(np.where(hole, np.uint8(level), np.uint8(known))[..., None], 3, 2)


@pytest.mark.parametrize(
    ("guess", "share", "mean"),
    [
        (160, None, 130),
        (100 + round(DIFFERS / 2), None, 100 + round(DIFFERS / 8)),
        (104, 0.25, 101),
        (180, 0.25, 120),
    ],
)
def test_the_mean_is_taken_where_they_differ_by_far(guess: int, share: float | None, mean: int) -> None:
    """Closed form: painted are 100 levels; half of a large difference, a quarter of one of DIFFERS / 2; a given share counts
    everywhere. Known pixels stay."""
    hole = square_hole(96, 20, 70)
    out = blend_with_guess(in_hole(100, hole, 50), in_hole(guess, hole, 50), hole, guess_share=share)
    assert (out[~hole] == 50).all()
    assert (out[35:55, 35:55] == mean).all()


def test_detail_finer_than_the_guess_stays() -> None:
    """Law: in a picture larger than the guess, stripes of one pixel about the guess's own level are kept bit for bit."""
    side = 2 * 768
    hole = square_hole(side, 100, 400)
    painted = np.zeros((side, side, 3), np.uint8)
    painted[:, ::2] = 200
    guess = np.where(hole[..., None], np.uint8(100), painted)
    inner = np.s_[140:360, 140:360]
    np.testing.assert_array_equal(blend_with_guess(painted, guess, hole)[inner], painted[inner])


@pytest.mark.parametrize(("painted", "guess", "weight"), [(100, 220, DISTANCE / (DISTANCE + 120)), (220, 100, 1.0)])
def test_what_neither_the_picture_nor_the_other_shows_weighs_little(painted: int, guess: int, weight: float) -> None:
    """Closed form: all known pixels have 100 levels, so that the one with 220 is 120 off and the other 0: a guess that is farther
    off weighs DISTANCE / (DISTANCE + 120), one that is nearer replaces the patches."""
    hole = square_hole(96, 20, 70)
    patches, network = (in_hole(level, hole, 100) for level in (painted, guess))
    out = blend_with_guess(patches, network, hole, hole)
    assert (out[~hole] == 100).all()
    np.testing.assert_allclose(out[35:55, 35:55], painted + (guess - painted) * weight, atol=TELEA)


def test_hidden_pixels_are_no_evidence() -> None:
    """Closed form: of the known pixels those of 100 levels are hidden, so that 220, as all others have, is right."""
    hole = square_hole(96, 20, 70)
    patches, network = (in_hole(level, hole, 220) for level in (100, 220))
    patches[:20], network[:20] = 100, 100
    hidden = hole.copy()
    hidden[:20] = True
    out = blend_with_guess(patches, network, hole, hidden)
    np.testing.assert_allclose(out[35:55, 35:55], 220, atol=TELEA)


@pytest.mark.parametrize(("spread", "counts"), [(0.0, 0.0), (AGREE, 0.5), (1e6, 1.0)])
def test_patches_that_agree_are_kept(spread: float, counts: float) -> None:
    """Closed form: the guess is as near to the known colours as the patches are, so that it replaces them; of the way to it
    spread^2 / (spread^2 + AGREE^2) is gone."""
    hole = square_hole(96, 20, 70)
    painted, guess = in_hole(80, hole, 100), in_hole(120, hole, 100)
    out = blend_with_guess(painted, guess, hole, hole, spread=np.where(hole, np.float32(spread), np.float32(0)))
    np.testing.assert_allclose(out[35:55, 35:55], 80 + 40 * counts, atol=TELEA)
