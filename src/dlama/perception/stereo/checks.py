"""Two pictures of a supposed rectified pair in; the fault, in one line, out.

They may be swapped, identical, not rectified, or of different scenes.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dlama.errors import InputError
from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import Float32Array, UInt8Array

FEATURES = 1500
"""Corners detected in each picture."""
DISTINCT = 0.8
"""A corner's best match must be nearer than this share of its second best (Lowe 2004)."""
ENOUGH = 20
"""Least number of matched corners for a decision."""
SAME_ROW = 0.05
"""Largest vertical offset, over the height, of matched corners of the same scene, rectified or not."""
ROW_OFFSET_PX = (0.8, 1.5)
"""Median and upper quartile of vertical offsets above which rows do not match; of rectified pairs they are 0 and 0.4 at most."""
SHARED, SWAPPED = 0.5, 0.4
"""Shares of matched corners: fewer within SAME_ROW are chance, more with negative disparity are a swapped pair."""
AGREEING = 0.1
"""Share of pixels with a disparity below which matching has failed."""


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners found in both pictures of a pair."""

    offsets: Float64Array
    """N x 2 px, left minus right position (x: disparity, y: 0 where rows match) of the matched ones."""
    found: int
    """Corners in the picture that has fewer."""


def match_corners(left: UInt8Array, right: UInt8Array) -> Corners:
    """Distinct ORB corners (Rublee et al. 2011) of two pictures (H x W x 3, RGB) that are each other's best match."""
    finder = cv2.ORB.create(FEATURES)
    # too small for any, or for OpenCV at all
    if min(*left.shape[:2], *right.shape[:2]) <= 2 * finder.getEdgeThreshold():
        return Corners(np.zeros((0, 2)), 0)
    grey = [cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2GRAY) for picture in (left, right)]
    (here, ours), (there, theirs) = [finder.detectAndCompute(picture, None) for picture in grey]
    found = min(len(here), len(there))
    if found < 2:
        return Corners(np.zeros((0, 2)), found)
    both = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(ours, theirs, k=2)
    back = {(one.trainIdx, one.queryIdx) for one in cv2.BFMatcher(cv2.NORM_HAMMING).match(theirs, ours)}
    kept = [two[0] for two in both if len(two) == 2 and two[0].distance < DISTINCT * two[1].distance]
    kept = [one for one in kept if (one.queryIdx, one.trainIdx) in back]
    offsets = [np.subtract(here[one.queryIdx].pt, there[one.trainIdx].pt) for one in kept]
    return Corners(np.array(offsets, np.float64).reshape(-1, 2), found)


def refuse_identical(left: UInt8Array, right: UInt8Array) -> None:
    """Raise InputError where both pictures are one and the same."""
    if left.shape == right.shape and np.array_equal(left, right) and left.size and left.min() != left.max():
        raise InputError("the left and the right picture are identical; two pictures of a rectified pair are expected")


def find_pair_fault(left: UInt8Array, right: UInt8Array, left_disparity: Float32Array) -> str | None:
    """The likely reason why two pictures (H x W x 3) are no rectified pair, in one line; None: none found.

    left_disparity: H x W px as matched, 0 = unknown.
    """
    doubt = diagnose_corners(match_corners(left, right), left.shape[0])
    if doubt is not None:
        return doubt[1]
    known = float((left_disparity != 0).mean())
    if known < AGREEING:
        return f"only {known:.0%} of the left picture was found in the right one, so most depth is a guess"
    return None


def diagnose_corners(corners: Corners, height: int, doffs: float = 0.0) -> tuple[str, str] | None:
    """Fault of pictures `height` px high by their corners: "unrelated", "unrectified" or "swapped", and a line about it; None:
    none.

    doffs: px, the negated disparity of a point at infinity (`StereoRig.doffs`).
    """
    if corners.found < 5 * ENOUGH:
        return None
    offsets = corners.offsets
    near = np.abs(offsets[:, 1]) <= SAME_ROW * height
    if len(offsets) < ENOUGH or near.mean() < SHARED:
        return "unrelated", (
            f"only {int(near.sum())} of {corners.found} corners are found in both pictures; are they of the same scene, "
            "taken at the same time?"
        )
    across, rows = offsets[near, 0] + doffs, np.abs(offsets[near, 1])
    middle, upper = np.median(rows), np.percentile(rows, 75)
    if middle > ROW_OFFSET_PX[0] or upper > ROW_OFFSET_PX[1]:
        return "unrectified", (
            f"rows of the pictures do not match: a quarter of their corners lie {upper:.1f} px or more higher or lower in "
            "the other one; are the pictures rectified?"
        )
    if (across < -1).mean() > SWAPPED:
        return "swapped", (
            f"{(across < -1).mean():.0%} of the corners lie farther to the right in the right picture; are left and right "
            "swapped?"
        )
    return None
