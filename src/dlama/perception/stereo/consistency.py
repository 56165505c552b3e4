"""Disparities of both pictures of a pair in; what each says of the other out: which agree, and one carried to the other picture.

Disparity is left x minus right x of the same surface point, in pixels.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.projection import SMALLEST_DISPARITY
from dlama.geometry.rgbd import BoolArray, Float32Array

TOLERANCE_PX = 1.0
"""Left and right disparity of one surface point may differ by this much; so may two searches for it."""


def keep_consistent(
    at_left: Float32Array, at_right: Float32Array, tolerance: float = TOLERANCE_PX
) -> tuple[Float32Array, Float32Array]:
    """Both disparities (H x W px, NaN = unknown) where they point to each other within `tolerance` and are no speckles."""
    ours = np.where(_check_consistency(at_left, at_right, 1, tolerance), at_left, np.float32(np.nan))
    theirs = np.where(_check_consistency(at_right, at_left, -1, tolerance), at_right, np.float32(np.nan))
    return _remove_speckles(ours), _remove_speckles(theirs)


def _check_consistency(disparity: Float32Array, other: Float32Array, sign: int, tolerance: float) -> BoolArray:
    """True where a pixel's match lies in the other view and points back within `tolerance` (left-right check); sign 1: left to
    right."""
    known = np.isfinite(disparity)
    columns, inside = nearest_columns(np.where(known, disparity, 0), sign)
    back = np.take_along_axis(other, columns, axis=1)
    return known & inside & (np.abs(back - disparity) <= tolerance)  # NaN compares as False


def _remove_speckles(disparity: Float32Array) -> Float32Array:
    """NaN for patches of fewer than 1/4000 of the picture (10..200 px) that differ from their neighbourhood."""
    smallest = min(200, max(10, disparity.size // 4000))
    unknown = np.int16(np.iinfo(np.int16).min)
    fixed = np.where(np.isfinite(disparity), np.nan_to_num(disparity) * 16, unknown).astype(np.int16)
    cv2.filterSpeckles(fixed, float(unknown), smallest, 2 * 16)
    return np.where(fixed == unknown, np.float32(np.nan), disparity)


def nearest_columns(disparity: Float32Array, sign: int) -> tuple[np.ndarray, BoolArray]:
    """The nearest column (clipped) where each pixel lands in the other view, and whether it lies in the picture.

    disparity: H x W px, finite; sign: 1 from left to right, -1 back.
    """
    width = disparity.shape[1]
    columns = np.floor(np.arange(width) - sign * disparity + 0.5).astype(np.intp)
    return np.clip(columns, 0, width - 1), (columns >= 0) & (columns < width)


def transfer_disparity(at_left: Float32Array) -> Float32Array:
    """The right view's disparity (H x W px, 0 = unknown) from the left one's, z-buffered.

    Cracks of one column are closed by the farther of their neighbours; what only the right camera sees stays unknown.
    """
    columns, inside = nearest_columns(at_left, 1)
    inside &= at_left != 0
    rows = np.broadcast_to(np.arange(len(at_left))[:, None], at_left.shape)
    lowest = np.float32(-np.inf)
    found = np.full(at_left.shape, lowest, np.float32)
    np.maximum.at(found, (rows[inside], columns[inside]), at_left[inside])
    crack = np.zeros(found.shape, bool)
    crack[:, 1:-1] = (found[:, 1:-1] == lowest) & (found[:, :-2] > lowest) & (found[:, 2:] > lowest)
    neighbour = np.minimum(np.roll(found, 1, 1), np.roll(found, -1, 1))
    found = np.where(crack, neighbour, found)
    return np.where(found > lowest, found, np.float32(0))


def zero_where_unknown(disparity: Float32Array) -> Float32Array:
    """Unknown as 0, and a measured 0 as the smallest disparity."""
    measured = np.where(disparity == 0, SMALLEST_DISPARITY, disparity)
    return np.nan_to_num(measured, nan=0.0).astype(np.float32)
