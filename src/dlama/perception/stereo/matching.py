"""Stereo matching: a rectified colour pair in, a disparity map for each view out.

Disparity is left x minus right x of the same surface point, in pixels; 0 = unknown. A right camera whose principal
point is shifted (Middlebury's doffs) makes no difference here: doffs belongs to `dlama.geometry.projection.depth_from_disparity`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np

from dlama.arguments import format_value, is_finite
from dlama.errors import InputError
from dlama.geometry.kernels.jit import begin_job
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.perception.stereo.consistency import TOLERANCE_PX, keep_consistent, nearest_columns, zero_where_unknown
from dlama.perception.stereo.subpixel import refine_disparity

Matcher = Callable[[UInt8Array, UInt8Array], tuple[Float32Array, Float32Array]]
"""Left and right picture (H x W x 3, RGB) in; the disparity of each (H x W px, 0 = unknown) out."""
MARGIN_PX = 2
"""Columns added to the range, so that its ends get sub-pixel values as well."""
BLOCK_SIZE = 3
"""Pixels; 1, 3 and 5 were measured."""


@dataclass(frozen=True)
class Search:
    """One semi-global search (Hirschmueller 2008) as OpenCV has it."""

    mode: int
    """Aggregation along all eight paths, or three."""
    step: int
    """Penalty of a disparity change of 1 px between neighbours, grey levels per channel and pixel of the block."""
    jump: int
    """Penalty of any larger change."""
    unique: int
    """Per cent by which the best match must beat the second."""


WHOLE = Search(cv2.STEREO_SGBM_MODE_HH, 12, 40, 0)
"""Eight paths at the pictures' width: few mistakes, coarse below one pixel."""
FINE = Search(cv2.STEREO_SGBM_MODE_SGBM_3WAY, 8, 32, 5)
"""Three paths at twice the width: more mistakes, half the error where it is right."""
WIDEST_PX = 2400
"""Width of pictures that are searched; wider ones are halved. Of worlds 2600 and 3600 px wide, a little blurred as photos of that
size are, the mean error is .29 and .38 px then, .35 and .48 where they are searched as they are."""
VOLUME = 2.5e8
"""Pixels x disparities of the search along eight paths, which keeps 4 bytes of each; beyond it the pictures are halved."""
SAME_EXPOSURE = 1.1
"""Ratio of brightness up to which pictures are matched as they are. Of one at half the exposure OpenCV's matcher finds 20 % and
less of the disparities (Motorcycle 91 % to 20 %, Cone 89 % to 20 %), all of them where it is made as bright first."""


def disparity_pair(
    left: UInt8Array, right: UInt8Array, *, max_disparity: float | None = None, min_disparity: float = 0
) -> tuple[Float32Array, Float32Array]:
    """Disparity of the left and of the right view of a rectified pair (uint8 H x W x 3, RGB, of one size): float32 H x W, px.

    A right picture that is darker or brighter as a whole is first made as bright as the left one.
    Two semi-global searches: along eight paths at the pictures' width, and along three at twice the width for what lies below a
    pixel. Where they agree within 1 px the finer one counts, else the first; where the first has no match, the finer one,
    unless a nearer surface occludes it. Each search keeps what passes the left-right check and is no speckle. Matches are
    then refined below a pixel (`refine_disparity`). Pictures wider than WIDEST_PX are halved, matched, and the matches enlarged
    and refined. Everything else is 0 = unknown: above all what only one of the two cameras sees. A match at exactly 0 px
    (infinity) is written as 1e-6. `max_disparity` None searches the range first, in a small copy of the pair; negative
    disparities need a negative `min_disparity`.
    Raises InputError when the range is empty, or wider than the picture.
    """
    right = equalise_exposure(right, left)
    if max_disparity is None:
        min_disparity, max_disparity = _estimate_range(left, right, min_disparity)
    else:
        _check_reach(left.shape[1], min_disparity, max_disparity)
    if not (is_finite(min_disparity) and is_finite(max_disparity) and min_disparity < max_disparity):
        raise InputError(
            f"`max_disparity` is {format_value(max_disparity)} px; more than {format_value(min_disparity)} px is expected"
        )
    at_left, at_right = _search_and_refine(left, right, (min_disparity, max_disparity))
    return zero_where_unknown(at_left), zero_where_unknown(at_right)


def _search_and_refine(
    left: UInt8Array, right: UInt8Array, limits: tuple[float, float]
) -> tuple[Float32Array, Float32Array]:
    """Disparities of both views (H x W px, NaN = unknown) between the limits."""
    height, width = left.shape[:2]
    if width > WIDEST_PX:
        small = [_resize(picture, 0.5, 0.5) for picture in (left, right)]
        ratio = width / small[0].shape[1]
        found = _search_and_refine(small[0], small[1], (limits[0] / ratio, limits[1] / ratio))
        at_left, at_right = (_enlarge(one * np.float32(ratio), (width, height)) for one in found)
    else:
        whole = _search(left, right, limits, WHOLE, _scale_of_whole(left.shape, limits[1] - limits[0]))
        fine = _search(left, right, limits, FINE, _scale_of_fine(width))
        at_left, at_right = _join(whole[0], fine[0], whole[1], 1), _join(whole[1], fine[1], whole[0], -1)
    mirrored = begin_job(refine_disparity, right[:, ::-1], left[:, ::-1], at_right[:, ::-1], limits[0])
    return refine_disparity(left, right, at_left, limits[0]), mirrored()[:, ::-1]


def _enlarge(disparity: Float32Array, size: tuple[int, int]) -> Float32Array:
    """Disparities (H x W px, NaN = unknown) at another size (width, height): between neighbours on one surface, elsewhere of the
    nearest."""
    nearest = cv2.resize(disparity, size, interpolation=cv2.INTER_NEAREST)
    between = cv2.resize(disparity, size, interpolation=cv2.INTER_LINEAR)
    return np.where(np.abs(between - nearest) < TOLERANCE_PX, between, nearest)


def equalise_exposure(picture: UInt8Array, like: UInt8Array) -> UInt8Array:
    """The picture (H x W x 3) as bright on average as another one; itself where they differ by SAME_EXPOSURE at most."""
    gain = (float(like.mean()) + 1) / (float(picture.mean()) + 1)
    if 1 / SAME_EXPOSURE <= gain <= SAME_EXPOSURE:
        return picture
    return np.asarray(cv2.convertScaleAbs(picture, alpha=gain), np.uint8)


def _check_reach(width: int, min_disparity: float, max_disparity: float) -> None:
    """Raise InputError for a range that is wider than pictures of that width, or than the matcher can say."""
    most, asked = min(width, _reach(width)), max(-min_disparity, max_disparity)
    if asked > most:
        raise InputError(
            f"`max_disparity` is {format_value(asked)} px; at most {most} px is expected in pictures {width} px wide"
        )


def _reach(width: int) -> int:
    """px that OpenCV's matcher can say in pictures of that width: it has 16 bits, in steps of 1/16, less margins."""
    return 2 * _reach(width // 2) if width > WIDEST_PX else 2000 // _scale_of_fine(width)


def _scale_of_fine(width: int) -> int:
    return 2 if width <= 1600 else 1  # larger pictures are searched as they are


def _scale_of_whole(shape: tuple[int, ...], span: float) -> float:
    """1, or the half, the quarter ... at which the eight-path search fits into VOLUME."""
    scale = 1.0
    while shape[0] * shape[1] * span * scale**3 > VOLUME and scale * min(shape[:2]) >= 2:
        scale /= 2
    return scale


def _search(
    left: UInt8Array, right: UInt8Array, limits: tuple[float, float], search: Search, scale: float
) -> tuple[Float32Array, Float32Array]:
    """Disparities of both views at the pictures' own size, in their pixels; NaN = unknown. Below 1 `scale` shrinks height too."""
    down = min(scale, 1.0)
    small = [_resize(picture, scale, down) for picture in (left, right)]
    found = _match_both_ways(
        small[0], small[1], limits[0] * scale, limits[1] * scale, TOLERANCE_PX * max(scale, 1), search
    )
    if scale >= 1:
        return _restore_width(found[0], int(scale)), _restore_width(found[1], int(scale))
    size = left.shape[1], left.shape[0]
    large = [cv2.resize(one, size, interpolation=cv2.INTER_NEAREST) / np.float32(scale) for one in found]
    return large[0], large[1]


def _join(whole: Float32Array, fine: Float32Array, other: Float32Array, sign: int) -> Float32Array:
    """One view's disparity from both searches; other: the other view's, from the first. NaN = unknown, in and out."""
    agreed = np.where(np.abs(fine - whole) <= TOLERANCE_PX, fine, whole)
    columns, inside = nearest_columns(np.nan_to_num(fine), sign)
    hidden = np.take_along_axis(other, columns, axis=1) > fine + TOLERANCE_PX
    return np.where(np.isnan(whole) & inside & ~hidden, fine, agreed)


def _estimate_range(left: UInt8Array, right: UInt8Array, min_disparity: float) -> tuple[float, float]:
    """The range of disparities, from `min_disparity` to half the width, that a copy of the pair 320 px wide shows, with margins;
    full pixels. It begins at 0 where nothing lies below."""
    scale = min(1.0, 320 / left.shape[1])
    small_left, small_right = _resize(left, scale, scale), _resize(right, scale, scale)
    lowest = min_disparity * scale
    highest = max(lowest, 0) + small_left.shape[1] / 2
    found, _ = _match_both_ways(small_left, small_right, lowest, highest, TOLERANCE_PX, FINE)
    known = found[np.isfinite(found)]
    if not len(known):
        return min_disparity, min_disparity + 8
    # 0.2 % of stray matches may survive the checks; an object smaller than that is found if it is in the margin.
    least, most = (float(np.percentile(known, share)) / scale for share in (0.2, 99.8))
    margin = 0.1 * (most - min(least, 0.0)) + 8
    return max(min_disparity, min(0.0, least - margin)), most + margin


def _resize(picture: UInt8Array, across: float, down: float) -> UInt8Array:
    if across == down == 1:
        return picture
    size = (max(1, round(picture.shape[1] * across)), max(1, round(picture.shape[0] * down)))
    interpolation = cv2.INTER_AREA if across < 1 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, size, interpolation=interpolation), np.uint8)


def _match_both_ways(
    left: UInt8Array, right: UInt8Array, lowest: float, highest: float, tolerance: float, search: Search
) -> tuple[Float32Array, Float32Array]:
    """Both views matched, checked against each other, speckles removed; NaN = unknown."""
    # Mirrored left and right, the right view is a left one: the same matcher serves both.
    at_once = left.shape[0] * left.shape[1] * (highest - lowest) <= 8e7  # as VOLUME
    mirrored = right[:, ::-1], left[:, ::-1], lowest, highest, search
    of_right = begin_job(_match, *mirrored) if at_once else partial(_match, *mirrored)
    at_left = _match(left, right, lowest, highest, search)
    return keep_consistent(at_left, of_right()[:, ::-1], tolerance)


def _match(base: UInt8Array, other: UInt8Array, lowest: float, highest: float, search: Search) -> Float32Array:
    """Semi-global matching of `base` against `other`: H x W float32 px, NaN where nothing in the range matches."""
    first = math.floor(lowest) - MARGIN_PX
    count = 16 * math.ceil((math.ceil(highest) + MARGIN_PX - first) / 16)
    matcher = cv2.StereoSGBM.create(
        minDisparity=first,
        numDisparities=count,
        blockSize=BLOCK_SIZE,
        P1=search.step * 3 * BLOCK_SIZE**2,
        P2=search.jump * 3 * BLOCK_SIZE**2,
        disp12MaxDiff=-1,
        preFilterCap=15,
        uniquenessRatio=search.unique,
        mode=search.mode,
    )
    # The matcher skips every column from which the whole range cannot be reached: margins make that none of ours.
    before, after = max(0, first + count) + BLOCK_SIZE, max(0, -first) + BLOCK_SIZE
    padded = [cv2.copyMakeBorder(p, 0, 0, before, after, cv2.BORDER_REPLICATE) for p in (base, other)]
    raw = matcher.compute(*padded)[:, before:-after]
    disparity = raw.astype(np.float32) / 16
    unknown = (raw < first * 16) | (disparity < lowest - 0.5) | (disparity > highest + 0.5)
    # Sub-pixel values may overshoot the range's ends by half a step; a point at infinity must not get behind it.
    return np.where(unknown, np.float32(np.nan), np.clip(disparity, lowest, highest)).astype(np.float32)


def _restore_width(disparity: Float32Array, scale: int) -> Float32Array:
    """Back to the picture's width: the mean of the two halves of each pixel; unknown where they lie on two surfaces."""
    if scale == 1:
        return disparity
    first, second = disparity[:, 0::2] / 2, disparity[:, 1::2] / 2
    first, second = np.where(np.isnan(first), second, first), np.where(np.isnan(second), first, second)
    return np.where(np.abs(first - second) <= TOLERANCE_PX, (first + second) / 2, np.float32(np.nan))
