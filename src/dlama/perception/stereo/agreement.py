"""Two views of a pair and their disparities in; their consistency, and the left mask carried to the right view, out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.errors import MaskError
from dlama.geometry.holes import dilate_mask, fill_with_nearest, morphological_close
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.masks.borders import decide_by_color
from dlama.perception.stereo.consistency import TOLERANCE_PX, nearest_columns

BAND_ROWS = 128
"""Rows that are compared at a time: it takes 80 bytes a pixel."""


@dataclass(frozen=True)
class StereoConsistency:
    """Consistency of two views, as measured by `consistency`."""

    photometric_mae: float
    """Mean absolute colour difference, grey levels 0..255, over the pixels compared; NaN where there are none."""
    left_right_within_1px: float
    """Share 0..1 of the pixels compared with known right disparity there; NaN where there are none."""
    coverage: float
    """Share 0..1 of all left pixels that have a disparity."""


def consistency(
    left_color: UInt8Array, right_color: UInt8Array, left_disparity: Float32Array, right_disparity: Float32Array
) -> StereoConsistency:
    """The agreement of two views (uint8 H x W x 3) and their disparities (float32 H x W px; 0, NaN, inf = unknown).

    Compared are the left pixels that have a disparity d and whose match x - d lies in the right picture.
    photometric_mae: their colour against the right picture's at x - d (linear between columns), mean over pixels and
    channels. left_right_within_1px: of those whose match's nearest right pixel has a disparity, the share in which the
    two disparities differ by at most 1 px; a pixel that the right camera cannot see but has a (filled) disparity
    counts as disagreeing, so dense true disparities do not reach 1 (cone 0.95, Cloth3 0.975). coverage: of all left
    pixels, the share with a disparity.
    """
    bands = (slice(first, first + BAND_ROWS) for first in range(0, len(left_disparity), BAND_ROWS))
    counts = [
        _compare_rows(left_color[band], right_color[band], left_disparity[band], right_disparity[band])
        for band in bands
    ]
    known, compared, difference, matched, within = np.sum(counts, 0)
    return StereoConsistency(
        photometric_mae=float(difference / (3 * compared)) if compared else math.nan,
        left_right_within_1px=float(within / matched) if matched else math.nan,
        coverage=float(known / left_disparity.size),
    )


def _compare_rows(
    left_color: UInt8Array, right_color: UInt8Array, left_disparity: Float32Array, right_disparity: Float32Array
) -> NDArray[np.float64]:
    """5, of some rows: pixels with a disparity; those compared, the sum of their colour differences, those whose match has a
    disparity, those in which both agree."""
    ours, theirs = _nan_where_unknown(left_disparity), _nan_where_unknown(right_disparity)
    known = np.isfinite(ours)
    shift = np.where(known, ours, 0)
    height, width = ours.shape
    x = np.arange(width, dtype=np.float32) - shift
    y = np.broadcast_to(np.arange(height, dtype=np.float32)[:, None], x.shape)
    compared = known & (x >= 0) & (x <= width - 1)
    # float32, or OpenCV would round the column to 1/32 px in its 8-bit path
    matched = cv2.remap(right_color.astype(np.float32), x, np.ascontiguousarray(y), cv2.INTER_LINEAR)
    difference = np.abs(matched - left_color)[compared]
    columns, _ = nearest_columns(shift, 1)
    deviation = np.abs(np.take_along_axis(theirs, columns, axis=1) - ours)
    deviation = deviation[compared & np.isfinite(deviation)]
    agree = (deviation <= TOLERANCE_PX).sum()
    return np.array([known.sum(), compared.sum(), difference.sum(dtype=np.float64), deviation.size, agree])


def _nan_where_unknown(disparity: Float32Array) -> Float32Array:
    return np.where(np.isfinite(disparity) & (disparity != 0), disparity, np.float32(np.nan)).astype(np.float32)


def transfer_mask(mask_left: BoolArray, left_disparity: Float32Array) -> BoolArray:
    """The mask of an object in the right view, from its mask in the left one (both H x W bool, True = object).

    Every masked pixel moves by its disparity (0, NaN, inf = unknown: the nearest known one inside the mask is taken),
    and gaps of up to 4 columns or 2 rows are closed. What leaves the picture is dropped. An empty mask stays empty.
    Raises MaskError when no disparity is known inside the mask.
    """
    carried = np.zeros(mask_left.shape, np.bool_)
    if not mask_left.any():
        return carried
    disparity = _nan_where_unknown(left_disparity)
    known = mask_left & np.isfinite(disparity)
    if not known.any():
        raise MaskError(
            "no disparity is known inside the mask, so it cannot be carried over; a mask of the right view is expected"
        )
    shift = fill_with_nearest(disparity, known)
    columns, inside = nearest_columns(shift, 1)
    moved = mask_left & inside
    carried[np.nonzero(moved)[0], columns[moved]] = True
    # A slant stretches the mask along its rows, so that is where gaps open: 5 columns by 3 rows.
    return morphological_close(carried, np.ones((3, 5), np.uint8))


def carry_mask(mask_left: BoolArray, disparities: tuple[Float32Array, Float32Array], right: RGBD) -> BoolArray:
    """The mask of an object in the right picture, by that in the left one and both disparities (H x W each; px, 0 = unknown).

    Disparity moves the mask, but not onto pixels that match what the left picture shows outside it, such as what hides it.
    Next to it are pixels that the right camera alone sees, where the left picture's border or another object hides more of this
    one: colours decide them. Raises MaskError as `transfer_mask` does.
    """
    carried = transfer_mask(mask_left, disparities[0])
    columns, inside = nearest_columns(disparities[1], -1)
    matched = inside & (disparities[1] != 0)
    carried &= ~matched | np.take_along_axis(dilate_mask(mask_left, round(TOLERANCE_PX)), columns, axis=1)
    if not carried.any():
        return carried
    reach = max(0, math.ceil(disparities[0][mask_left].max()))
    alone = dilate_mask(carried, reach) & ~carried & ~matched
    return decide_by_color(right, carried, alone)
