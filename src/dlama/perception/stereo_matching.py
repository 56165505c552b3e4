"""Stereo: a rectified colour pair in, a disparity map for each view out; how well two views agree; a mask carried over.

Disparity is left x minus right x of the same surface point, in pixels; 0 = unknown. A right camera whose principal
point is shifted (Middlebury's doffs) makes no difference here: doffs belongs to `dlama.geometry.projection.depth_from_disparity`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from dlama.errors import InputError, MaskError, ShapeError
from dlama.geometry.holes import with_nearest
from dlama.geometry.projection import SMALLEST_DISPARITY
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

TOLERANCE_PX = 1.0
"""Left and right disparity of one surface point may differ by this much."""
BLOCK_SIZE = 3
"""Pixels of the doubled picture; 3, 5 and 7 were measured on Middlebury pairs, 3 had the fewest wrong pixels."""
DOUBLED_UP_TO_PX = 1600
"""Pictures up to this width are matched at twice the width: up to a sixth fewer pixels off by more than 1 px and
a third less median error on Middlebury pairs, for 2.5 times the time."""
PROBE_WIDTH_PX = 320
"""Width at which the disparity range is looked for."""
LARGEST_STEP = 2000
"""Disparity in px that OpenCV's matcher can say (16 bits, steps of 1/16), less margins."""
MARGIN_PX = 2
"""Columns of the search that lie beyond the asked range, so that its ends get sub-pixel values as well."""


def disparity_pair(
    left: UInt8Array, right: UInt8Array, *, max_disparity: float | None = None, min_disparity: float = 0
) -> tuple[Float32Array, Float32Array]:
    """Disparity of the left and of the right view of a rectified pair (uint8 H x W x 3, RGB): float32 H x W, px.

    OpenCV's semi-global matching (three directions), each view matched against the other; kept is what both agree on
    within 1 px and what is no speckle. Everything else is 0 = unknown: above all what only one of the two cameras sees.
    A match at exactly 0 px (infinity) is written as 1e-6. `max_disparity` None looks for the range first, in a small
    copy of the pair; negative disparities need a negative `min_disparity`.
    Raises ShapeError when the pictures are no such pair, InputError when the range is empty, or wider than the picture.
    """
    _check_pair(left, right)
    if max_disparity is None:
        max_disparity = _estimated_maximum(left, right, min_disparity)
    else:
        _check_reach(left.shape[1], min_disparity, max_disparity)
    if not (math.isfinite(min_disparity) and math.isfinite(max_disparity) and min_disparity < max_disparity):
        raise InputError(
            f"disparity range is {min_disparity}..{max_disparity} px; min_disparity < max_disparity is wanted"
        )
    scale = 2 if left.shape[1] <= DOUBLED_UP_TO_PX else 1
    at_left, at_right = _matched_both_ways(
        _resized(left, scale),
        _resized(right, scale),
        min_disparity * scale,
        max_disparity * scale,
        TOLERANCE_PX * scale,
    )
    at_left, at_right = _at_original_width(at_left, scale), _at_original_width(at_right, scale)
    return _zero_where_unknown(at_left), _zero_where_unknown(at_right)


def _check_reach(width: int, min_disparity: float, max_disparity: float) -> None:
    """Raise InputError for a range that is wider than pictures of that width, or than the matcher can say."""
    scale = 2 if width <= DOUBLED_UP_TO_PX else 1
    most, asked = min(width, LARGEST_STEP // scale), max(-min_disparity, max_disparity)
    if asked > most:
        raise InputError(f"max_disparity is {asked:g} px; at most {most} px is wanted in pictures {width} px wide")


def _check_pair(left: UInt8Array, right: UInt8Array) -> None:
    for name, picture in (("left", left), ("right", right)):
        if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3:
            raise ShapeError(f"{name} picture is {picture.dtype} {picture.shape}; uint8 H x W x 3 is wanted")
    if left.shape != right.shape:
        raise ShapeError(
            f"left picture is {left.shape[1]}x{left.shape[0]} and the right {right.shape[1]}x{right.shape[0]}; "
            "a rectified pair has one size"
        )


def _estimated_maximum(left: UInt8Array, right: UInt8Array, min_disparity: float) -> float:
    """The largest disparity that a small copy of the pair shows (up to half the width), with a margin; full pixels."""
    scale = min(1.0, PROBE_WIDTH_PX / left.shape[1])
    small_left, small_right = _resized(left, scale, scale), _resized(right, scale, scale)
    lowest = min_disparity * scale
    found, _ = _matched_both_ways(small_left, small_right, lowest, lowest + small_left.shape[1] / 2, TOLERANCE_PX)
    known = found[np.isfinite(found)]
    # 0.2 % of stray matches may survive the checks; a thing smaller than that is found if it is in the margin.
    highest = float(np.percentile(known, 99.8)) / scale if len(known) else min_disparity
    return min_disparity + 1.1 * (highest - min_disparity) + 8


def _resized(picture: UInt8Array, across: float, down: float = 1.0) -> UInt8Array:

    if across == down == 1:
        return picture
    size = (max(1, round(picture.shape[1] * across)), max(1, round(picture.shape[0] * down)))
    interpolation = cv2.INTER_AREA if across < 1 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, size, interpolation=interpolation), np.uint8)


def _matched_both_ways(
    left: UInt8Array, right: UInt8Array, lowest: float, highest: float, tolerance: float
) -> tuple[Float32Array, Float32Array]:
    """Both views matched, checked against each other, speckles removed; NaN = unknown."""
    # Mirrored left and right, the right view is a left one: the same matcher serves both.
    at_left = _matched(left, right, lowest, highest)
    at_right = _matched(right[:, ::-1], left[:, ::-1], lowest, highest)[:, ::-1]
    checked_left = np.where(_consistent(at_left, at_right, 1, tolerance), at_left, np.nan)
    checked_right = np.where(_consistent(at_right, at_left, -1, tolerance), at_right, np.nan)
    return _without_speckles(checked_left), _without_speckles(checked_right)


def _matched(base: UInt8Array, other: UInt8Array, lowest: float, highest: float) -> Float32Array:
    """Semi-global matching of `base` against `other`: H x W float32 px, NaN where nothing in the range matches."""

    first = math.floor(lowest) - MARGIN_PX
    count = 16 * math.ceil((math.ceil(highest) + MARGIN_PX - first) / 16)
    matcher = cv2.StereoSGBM.create(
        minDisparity=first,
        numDisparities=count,
        blockSize=BLOCK_SIZE,
        P1=8 * 3 * BLOCK_SIZE**2,
        P2=32 * 3 * BLOCK_SIZE**2,
        disp12MaxDiff=-1,
        preFilterCap=31,
        uniquenessRatio=5,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    # The matcher skips every column from which the whole range cannot be reached: margins make that none of ours.
    before, after = max(0, first + count) + BLOCK_SIZE, max(0, -first) + BLOCK_SIZE
    padded = [cv2.copyMakeBorder(p, 0, 0, before, after, cv2.BORDER_REPLICATE) for p in (base, other)]
    raw = matcher.compute(*padded)[:, before:-after]
    disparity = raw.astype(np.float32) / 16
    unknown = (raw < first * 16) | (disparity < lowest - 0.5) | (disparity > highest + 0.5)
    # Sub-pixel values may overshoot the range's ends by half a step; a point at infinity must not get behind it.
    return np.where(unknown, np.float32(np.nan), np.clip(disparity, lowest, highest)).astype(np.float32)


def _consistent(disparity: Float32Array, other: Float32Array, sign: int, tolerance: float) -> BoolArray:
    """True where a pixel's match lies in the other view and points back within `tolerance`; sign 1: left to right."""
    known = np.isfinite(disparity)
    columns, inside = nearest_columns(np.where(known, disparity, 0), sign)
    back = np.take_along_axis(other, columns, axis=1)
    return known & inside & (np.abs(back - disparity) <= tolerance)  # NaN compares as False


def nearest_columns(disparity: Float32Array, sign: int) -> tuple[np.ndarray, BoolArray]:
    """The nearest column (clipped) where each pixel lands in the other view, and whether it lies in the picture.

    disparity: H x W px, finite; sign: 1 from left to right, -1 back.
    """
    width = disparity.shape[1]
    columns = np.floor(np.arange(width) - sign * disparity + 0.5).astype(np.intp)
    return np.clip(columns, 0, width - 1), (columns >= 0) & (columns < width)


def _without_speckles(disparity: Float32Array) -> Float32Array:
    """NaN for patches of fewer than 1/4000 of the picture (10..200 px) that differ from their neighbourhood."""

    smallest = min(200, max(10, disparity.size // 4000))
    unknown = np.int16(np.iinfo(np.int16).min)
    fixed = np.where(np.isfinite(disparity), np.nan_to_num(disparity) * 16, unknown).astype(np.int16)
    cv2.filterSpeckles(fixed, float(unknown), smallest, 2 * 16)
    return np.where(fixed == unknown, np.float32(np.nan), disparity)


def _at_original_width(disparity: Float32Array, scale: int) -> Float32Array:
    """Back to the picture's width: the mean of the two halves of each pixel; unknown where they lie on two surfaces."""
    if scale == 1:
        return disparity
    first, second = disparity[:, 0::2] / 2, disparity[:, 1::2] / 2
    first, second = np.where(np.isnan(first), second, first), np.where(np.isnan(second), first, second)
    return np.where(np.abs(first - second) <= TOLERANCE_PX, (first + second) / 2, np.float32(np.nan))


def _zero_where_unknown(disparity: Float32Array) -> Float32Array:
    """Unknown as 0, and a measured 0 as the smallest disparity."""
    measured = np.where(disparity == 0, SMALLEST_DISPARITY, disparity)
    return np.nan_to_num(measured, nan=0.0).astype(np.float32)


@dataclass(frozen=True)
class StereoConsistency:
    """How well two views agree, as measured by `consistency`."""

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
    Raises ShapeError when sizes differ.
    """

    _check_pair(left_color, right_color)
    for name, disparity in (("left", left_disparity), ("right", right_disparity)):
        if disparity.shape != left_color.shape[:2]:
            raise ShapeError(f"{name} disparity is {disparity.shape}, the pictures are {left_color.shape[:2]}")
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
    return StereoConsistency(
        photometric_mae=float(difference.mean()) if difference.size else math.nan,
        left_right_within_1px=float((deviation <= TOLERANCE_PX).mean()) if deviation.size else math.nan,
        coverage=float(known.mean()),
    )


def _nan_where_unknown(disparity: Float32Array) -> Float32Array:
    return np.where(np.isfinite(disparity) & (disparity != 0), disparity, np.float32(np.nan)).astype(np.float32)


def carry_mask(mask_left: BoolArray, left_disparity: Float32Array) -> BoolArray:
    """The mask of an object in the right view, from its mask in the left one (both H x W bool, True = object).

    Every masked pixel moves by its disparity (0, NaN, inf = unknown: the nearest known one inside the mask is taken),
    and gaps of up to 4 columns or 2 rows are closed. What leaves the picture is dropped. An empty mask stays empty.
    Raises MaskError when mask and disparity differ in size, or no disparity is known inside the mask.
    """

    if mask_left.shape != left_disparity.shape:
        raise MaskError(
            f"mask is {mask_left.shape} and the left disparity {left_disparity.shape}; both must be the same"
        )
    carried = np.zeros(mask_left.shape, np.uint8)
    if not mask_left.any():
        return carried.astype(bool)
    disparity = _nan_where_unknown(left_disparity)
    known = mask_left & np.isfinite(disparity)
    if not known.any():
        raise MaskError(
            "no disparity is known inside the mask, so it cannot be carried over; a mask of the right view is wanted"
        )
    shift = with_nearest(disparity, known)
    columns, inside = nearest_columns(shift, 1)
    moved = mask_left & inside
    carried[np.nonzero(moved)[0], columns[moved]] = 1
    # A slant stretches the mask along its rows, so that is where gaps open: 5 columns by 3 rows.
    return np.asarray(cv2.morphologyEx(carried, cv2.MORPH_CLOSE, np.ones((3, 5), np.uint8)), bool)
