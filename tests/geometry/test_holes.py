"""Masks and holes: growing, shrinking and the nearest pixel by brute force; masks refused with a reason."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlama.errors import InputTypeError, MaskError
from dlama.geometry.holes import (
    box_mean,
    check_mask,
    dilate_mask,
    dilate_square,
    disc,
    distance_to,
    erode_mask,
    erode_square,
    fill_with_nearest,
    iou,
    morphological_close,
    morphological_open,
    nearest_known,
    region_at,
    regions_touching,
    square,
)


def random_mask(seed: int, height: int = 14, width: int = 17) -> np.ndarray:
    """A few lone pixels."""
    return np.random.default_rng(seed).random((height, width)) < 0.05


def grown_by_hand(mask: np.ndarray, radius: int) -> np.ndarray:
    """Every pixel within radius + 0.5 of a pixel of the mask."""
    rows, columns = np.nonzero(mask)
    y, x = np.indices(mask.shape)
    if not len(rows):
        return mask.copy()
    return (np.hypot(y[..., None] - rows, x[..., None] - columns) <= radius + 0.5).any(-1)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 4))
def test_dilation_and_erosion_by_brute_force(seed: int, radius: int) -> None:
    """Brute force; erosion is dilation of what is outside, and beyond the picture counts as mask."""
    mask = random_mask(seed)
    np.testing.assert_array_equal(dilate_mask(mask, radius), grown_by_hand(mask, radius))
    np.testing.assert_array_equal(erode_mask(~mask, radius), ~grown_by_hand(mask, radius))
    for out in (dilate_mask(mask, radius), erode_mask(mask, radius)):
        assert out.dtype == np.bool_ and out is not mask


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        (np.zeros((4, 6), bool), "empty"),
        (np.ones((4, 6), bool), "full"),
        (np.eye(6, dtype=bool), "6x6 and the picture 6x4"),
        (np.eye(4, 6, dtype=np.uint8) * 255, r"uint8 with shape \(4, 6\)"),
        (np.zeros((4, 6, 3), bool), r"bool with shape \(4, 6, 3\)"),
        (np.zeros((4, 6)), "float64"),
        ([[True, False]], r"mask is of type list; a bool array H x W is expected"),
    ],
)
def test_masks_that_are_refused(mask: np.ndarray, message: str) -> None:
    """Message: empty, full, of the wrong size, grey, coloured, no array (a TypeError, too): each says what came."""
    with pytest.raises(MaskError if isinstance(mask, np.ndarray) else InputTypeError, match=message):
        check_mask(mask, (4, 6))


def test_nearest_known_by_brute_force() -> None:
    """Brute force, within what OpenCV's 5 x 5 distance allows (2 %)."""
    known = np.random.default_rng(0).random((20, 30)) < 0.03
    distance, source = nearest_known(known)
    assert known.ravel()[source].all()
    rows, columns = np.nonzero(known)
    y, x = np.indices(known.shape)
    exact = np.hypot(y[..., None] - rows, x[..., None] - columns)
    chosen = np.hypot(y - source // 30, x - source % 30)
    assert (chosen <= 1.03 * exact.min(-1) + 1e-6).all()
    np.testing.assert_allclose(distance, exact.min(-1), rtol=0.03)


def test_nothing_is_near_where_nothing_is_known() -> None:
    """Closed form: at an infinite distance."""
    distance, source = nearest_known(np.zeros((3, 4), np.bool_))
    assert np.isposinf(distance).all() and not source.any()


def test_values_spread_outside_are_the_nearest_known() -> None:
    """Closed form on a row; with nothing known, or nothing unknown, they stay as they are."""
    values = np.arange(6.0)[None, :, None]
    known = np.array([[False, False, True, True, False, False]])
    np.testing.assert_array_equal(fill_with_nearest(values, known)[0, :, 0], [2, 2, 2, 3, 3, 3])
    assert fill_with_nearest(values, ~known & known) is values
    assert fill_with_nearest(values, known | True) is values


def test_a_mask_of_numbers_is_reported_how_it_becomes_one() -> None:
    """Round trip: the advice of the message gives a mask that is taken."""
    for mask in (np.array([[0, 255]], np.uint8), np.array([[0, 1.0]])):
        with pytest.raises(MaskError) as refused:
            check_mask(mask, (1, 2))
        advice = str(refused.value).rpartition(": ")[2]
        assert check_mask(eval(advice, {"mask": mask}), (1, 2)).tolist() == [[False, True]]


@pytest.mark.parametrize("kernel", [square(2), square(3), square(4), disc(2)])
def test_opened_and_closed_by_places_of_the_kernel(kernel: np.ndarray) -> None:
    """Literal twin: opened is what the kernel covers wherever it lies within the mask; closed the same of what is not mask."""
    mask = np.pad(np.random.default_rng(0).random((12, 14)) < 0.94, 6)
    covered = np.zeros(mask.shape, bool)
    rows, columns = np.nonzero(kernel)
    for row in range(mask.shape[0] - len(kernel) + 1):
        for column in range(mask.shape[1] - len(kernel) + 1):
            if mask[row + rows, column + columns].all():
                covered[row + rows, column + columns] = True
    assert 0 < covered.sum() < mask.sum()
    np.testing.assert_array_equal(morphological_open(mask, kernel), covered)
    inside = np.s_[5:-5, 5:-5]
    np.testing.assert_array_equal(morphological_close(~mask, kernel)[inside], ~covered[inside])


def test_a_pixel_by_squares_and_distances() -> None:
    """Closed form: a pixel grows to 3 x 3, which shrinks to it again; along rows and columns distances are whole pixels."""
    mask = np.zeros((7, 9), bool)
    mask[3, 4] = True
    grown = dilate_square(mask, 3)
    assert grown[2:5, 3:6].all() and grown.sum() == 9 and np.array_equal(erode_square(grown, 3), mask)
    distance = distance_to(mask)
    assert distance[3].tolist() == [4, 3, 2, 1, 0, 1, 2, 3, 4] and distance[:, 4].tolist() == [3, 2, 1, 0, 1, 2, 3]


def test_the_region_at_a_box_has_most_pixels_in_it() -> None:
    """By hand: of two regions the one with more pixels in the box, whole; none where it holds no pixel of any."""
    where = np.zeros((6, 8), bool)
    where[:, 1], where[2:4, 3:8] = True, True
    assert np.array_equal(region_at(where, (slice(2, 4), slice(1, 6))), where & (np.arange(8) > 2))
    assert not region_at(where, (slice(0, 2), slice(3, 8))).any()


def test_touching_regions() -> None:
    """By hand: a region that meets the other in one pixel, and its corner; not the region far off."""
    where = np.zeros((10, 10), np.bool_)
    where[1:3, 1:3] = where[3, 3] = where[7:9, 7:9] = True
    other = np.zeros_like(where)
    other[1, 1] = True
    found = regions_touching(where, other)
    assert found.sum() == 5 and not found[7:9, 7:9].any()


def test_means_are_of_what_counts() -> None:
    """Closed form: of one value everywhere that counts it is the mean, whatever lies where nothing counts; far off 0."""
    weight = np.zeros((40, 30), np.float32)
    weight[:20] = 1
    found = box_mean(np.where(weight > 0, 7, np.float32(1e6)).astype(np.float32), weight, 5)
    np.testing.assert_allclose(found[:21], 7, rtol=1e-5)
    assert found.dtype == np.float32 and not found[39].any()


def test_iou_of_shifted_squares() -> None:
    """Half a square off: 200 of 600 pixels."""
    one, other = np.zeros((2, 60, 60), bool)
    one[10:30, 10:30] = other[10:30, 20:40] = True
    assert iou(one, other) == pytest.approx(1 / 3)
    assert iou(one, one) == 1 and iou(one & False, one & False) == 0
