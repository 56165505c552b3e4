"""Two pictures that should be a rectified pair in; whether they are swapped, the same, unrectified or unrelated out.

Corners of both are matched by their surroundings (SIFT, Lowe 2004). In a rectified pair each match lies on the row of its corner
and, in the right picture, further left than a point at infinity would.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import UInt8Array
from dlama.perception.diagnosis.finding import Finding, certainty

WIDTH = 1000
"""Matches are looked for in pictures of at most so many pixels across."""
CORNERS = 3000
DISTINCT = 0.75
"""A match must be so much nearer than the next best one (Lowe's ratio)."""
FEWEST = 12
"""Matches from which anything is said."""
SAME_LEVELS = 1.0
"""Mean difference of colours (of 255) up to which two pictures are the same."""
ON_ROW_PX = 1.5
"""Of pictures WIDTH across: matches may lie so far off their row."""
OFF_ROW_SHARE = 0.5
"""Share of the matches off their row from which a pair is unrectified."""
BEHIND_SHARE = 0.2
"""Share of the matches behind the cameras from which a pair is swapped; mismatches are fewer."""
RELATED = 0.5
"""Share of the matches that one epipolar geometry must explain."""
GAIN = 1.3
"""Ratio of brightness from which a difference of exposure is told."""


class Matches(NamedTuple):
    """N matches in pixels of the pictures as given."""

    left: NDArray[np.float64]
    """N x 2, x and y."""
    right: NDArray[np.float64]
    tried: int
    """Corners of the left picture for which one was looked for."""

    @property
    def down(self) -> NDArray[np.float64]:
        """By how much each match lies lower in the right picture, px."""
        return np.asarray(self.right[:, 1] - self.left[:, 1], np.float64)


def pair_faults(left: UInt8Array, right: UInt8Array, doffs: float = 0.0) -> list[Finding]:
    """Findings on a pair (uint8 H x W x 3 each, of one size); `doffs` as `StereoRig.doffs`, px."""
    if np.abs(left.astype(np.int16) - right).mean() < SAME_LEVELS:
        what = "left and right are the same picture"
        return [Finding("identical-pair", "fault", 0.98, what, "give the two different pictures of the pair")]
    matches = matched(left, right)
    unit = max(left.shape[1], WIDTH / 2) / WIDTH
    related = _related(matches, unit)
    if related is None:
        what = f"left and right share next to nothing (only {len(matches.left)} of {matches.tried} corners match)"
        return [Finding("unrelated-pair", "fault", 0.9, what, "give two pictures of one scene, taken side by side")]
    found = _unrectified(related, unit, left.shape[1]) or _swapped(related, doffs, unit)
    return found + _exposure(left, right)


def matched(left: UInt8Array, right: UInt8Array) -> Matches:
    """Corners whose surroundings look alike in both, each the other's best match."""
    scale = min(1.0, WIDTH / left.shape[1])
    sift = cv2.SIFT_create(nfeatures=CORNERS)
    points, words = [], []
    for picture in (left, right):
        grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else grey
        corners, descriptors = sift.detectAndCompute(small, None)
        points.append(np.array([corner.pt for corner in corners]).reshape(-1, 2) / scale)
        words.append(descriptors)
    tried = len(points[0])
    if min(len(each) for each in points) < 2:
        return Matches(np.zeros((0, 2)), np.zeros((0, 2)), tried)
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    there = matcher.knnMatch(words[0], words[1], k=2)
    back = {each[0].queryIdx: each[0].trainIdx for each in matcher.knnMatch(words[1], words[0], k=1)}
    kept = [one for one, two in there if one.distance < DISTINCT * two.distance and back[one.trainIdx] == one.queryIdx]
    first, second = [one.queryIdx for one in kept], [one.trainIdx for one in kept]
    return Matches(points[0][first], points[1][second], tried)


def _related(matches: Matches, unit: float) -> Matches | None:
    """The matches that one geometry of two cameras explains; None where that is not most of them."""
    if len(matches.left) < FEWEST:
        return None
    on_row = np.abs(matches.down - np.median(matches.down)) < 2 * ON_ROW_PX * unit
    if on_row.mean() > RELATED:
        return Matches(matches.left[on_row], matches.right[on_row], matches.tried)
    _, inside = cv2.findFundamentalMat(matches.left, matches.right, cv2.FM_RANSAC, 2 * ON_ROW_PX * unit, 0.999, 2000)
    inside = np.zeros(len(matches.left), bool) if inside is None else inside.ravel().astype(bool)
    # Eight matches always fit some geometry: of unrelated pictures a third do.
    if inside.mean() < RELATED or inside.sum() < FEWEST:
        return None
    return Matches(matches.left[inside], matches.right[inside], matches.tried)


def _unrectified(matches: Matches, unit: float, width: int) -> list[Finding]:
    off = np.abs(matches.down)
    if (off > ON_ROW_PX * unit).mean() < OFF_ROW_SHARE:
        return []
    middle = float(np.median(matches.down))
    spread = float(np.median(np.abs(matches.down - middle)))
    word = "lower" if middle > 0 else "higher"
    if spread < 0.3 * abs(middle):
        shows = f"what lies on a row of the left picture lies {abs(middle):.1f} px {word} in the right one"
        mend = f"move the right picture by {-middle:.1f} px down, or rectify the pair with its calibration"
    else:
        shows = f"half of what lies on a row of the left picture lies {np.median(off):.1f} px or more off it in the right one"
        mend = "rectify the pair with its calibration (cv2.stereoRectify)"
    sure = certainty(float(np.median(off) / (ON_ROW_PX * unit) - 1), 0.7)
    return [Finding("unrectified-pair", "fault", sure, f"the pair is not rectified: {shows}", mend)]


def _swapped(matches: Matches, doffs: float, unit: float) -> list[Finding]:
    disparity = matches.left[:, 0] - matches.right[:, 0] + doffs
    behind = float((disparity < -ON_ROW_PX * unit).mean())
    if behind < BEHIND_SHARE:
        return []
    what = f"left and right look swapped: {100 * behind:.0f} % of what both show would lie behind the cameras"
    return [Finding("swapped-pair", "fault", certainty(behind - BEHIND_SHARE, 0.15), what, "give them the other way round")]


def _exposure(left: UInt8Array, right: UInt8Array) -> list[Finding]:
    gain = (np.median(right) + 1) / (np.median(left) + 1)
    if 1 / GAIN < gain < GAIN:
        return []
    what = f"the right picture is {gain:.2f} times as bright as the left one"
    return [Finding("exposure", "note", 0.8, what, "nothing to do: matching and filling allow for it")]
