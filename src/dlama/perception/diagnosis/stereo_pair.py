"""Two pictures of a supposed rectified pair in; findings on it out: the fault, and unequal exposure.

They may be swapped, mirrored, turned, identical, not rectified, of exchanged channels, or of different scenes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from dlama.errors import InputError
from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.perception.diagnosis.finding import Finding
from dlama.perception.diagnosis.poses import brightness_ratio
from dlama.perception.sky import find_plain_sky

ENOUGH = 20
"""Least number of matched corners for a decision."""
ONE_SCENE = 60
"""Matched corners that no two scenes share by chance (at most 28 in 36 such pairs)."""
SHARED = 0.5
"""Share of matched corners: fewer on common rows are chance."""
MANY_UNMATCHED = 0.35
"""Share of the left picture, but for plain sky, without a match that is warned of: 3 to 20 % of usable pairs."""

DIFFERENT = "give the two different pictures of the pair"
"""What mends a pair of one picture."""
NONE = np.zeros((0, 2))


class Corners(NamedTuple):
    """Corners found in both pictures of a pair."""

    found: int
    """Corners in the picture that has fewer."""
    mirrored: int = 0
    """How many match where the right picture is flipped left to right; 0 where many match as it is."""
    at: Float64Array = NONE
    """N x 2 px, column and row of each matched one in the left picture."""
    offsets: Float64Array = NONE
    """N x 2 px, left minus right position (x: disparity, y: 0 where rows match)."""
    turns: Float64Array = NONE[:, 0]
    """N degrees by which each is turned in the right picture."""
    warmth: Float64Array = NONE
    """N x 2 levels, red minus blue around each, in the left and in the right picture."""


Described = tuple[Sequence[cv2.KeyPoint], UInt8Array]
"""Corners, and N x 32 bytes of what is around each."""


def match_corners(left: UInt8Array, right: UInt8Array) -> Corners:
    """Distinct ORB corners (Rublee et al. 2011) of two pictures (H x W x 3, RGB) that are each other's best match."""
    finder = cv2.ORB.create(1500)
    # too small for any, or for OpenCV at all
    if min(*left.shape[:2], *right.shape[:2]) <= 2 * finder.getEdgeThreshold():
        return Corners(0)
    here, there = describe_corners(finder, left), describe_corners(finder, right)
    found = min(len(here[0]), len(there[0]))
    if found < 2:
        return Corners(found)
    matched, mirrored = match_described(here, there), 0
    if len(matched) < 0.3 * found:  # a mirrored pair matches 22 % at most, as symmetric objects do
        flipped = describe_corners(finder, right[:, ::-1])
        mirrored = len(match_described(here, flipped)) if len(flipped[0]) >= 2 else 0
    at, at_right = (np.array([pair[k].pt for pair in matched], np.float64).reshape(-1, 2) for k in (0, 1))
    turns = np.array([other.angle - one.angle for one, other in matched], np.float64)
    warmth = np.stack([warmth_at(left, at), warmth_at(right, at_right)], 1)
    return Corners(found, mirrored, at, at - at_right, turns, warmth)


def warmth_at(picture: UInt8Array, at: Float64Array) -> Float64Array:
    """N levels, red minus blue around places (N x 2, column and row) of a picture (H x W x 3, RGB)."""
    x, y = at.astype(int).T
    colors = cv2.blur(picture, (5, 5))[y, x].astype(np.float64)
    return np.asarray(colors[:, 0] - colors[:, 2])


def describe_corners(finder: cv2.ORB, picture: UInt8Array) -> Described:
    """Corners of a picture (H x W x 3, RGB)."""
    corners, around = finder.detectAndCompute(cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2GRAY), None)
    return corners, np.zeros((0, 32), np.uint8) if around is None else np.asarray(around, np.uint8)


def match_described(here: Described, there: Described) -> list[tuple[cv2.KeyPoint, cv2.KeyPoint]]:
    """Corners of two pictures that are distinct (the best match is clearly nearer than the second, Lowe 2004) and each other's
    best match."""
    both = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(here[1], there[1], k=2)
    back = {(one.trainIdx, one.queryIdx) for one in cv2.BFMatcher(cv2.NORM_HAMMING).match(there[1], here[1])}
    kept = [two[0] for two in both if len(two) == 2 and two[0].distance < 0.8 * two[1].distance]
    return [(here[0][one.queryIdx], there[0][one.trainIdx]) for one in kept if (one.queryIdx, one.trainIdx) in back]


def refuse_identical(left: UInt8Array, right: UInt8Array) -> None:
    """Raise InputError where both pictures are one and the same."""
    if left.shape == right.shape and np.array_equal(left, right) and left.size and left.min() != left.max():
        raise InputError("the left and the right picture are identical; two pictures of a rectified pair are expected")


def check_pair(left: UInt8Array, right: UInt8Array, doffs: float = 0.0) -> list[Finding]:
    """Findings on a pair (uint8 H x W x 3 each, of one size); `doffs` as `StereoRig.doffs`, px."""
    if np.abs(left.astype(np.int16) - right).mean() < 1:  # levels
        return [_fault("identical", "left and right are the same picture", DIFFERENT)]
    fault = find_corner_fault(match_corners(left, right), left.shape[0], doffs)
    return [*([] if fault is None else [fault]), *check_exposure(left, right)]


def _fault(kind: str, what: str, mend: str) -> Finding:
    return Finding(f"{kind}-pair", "fault", 0.92, what, mend)


def check_exposure(left: UInt8Array, right: UInt8Array) -> list[Finding]:
    """Reports pictures of a pair that are not equally bright."""
    times = brightness_ratio(left, right)
    if 1 / 1.3 < times < 1.3:
        return []
    what = f"the right picture is {times:.2f} times as bright as the left one"
    mend = "nothing to do: matching and filling allow for it"
    lost = abs(float((left == 255).mean() - (right == 255).mean()))  # by exposure
    if lost > 0.05:
        what, mend = f"{what}, and {lost:.0%} of the brighter one is white", "expose both alike"
    return [Finding("exposure", "note", 0.8, what, mend)]


def find_pair_fault(
    left: UInt8Array, right: UInt8Array, left_disparity: Float32Array, doffs: float = 0.0
) -> str | None:
    """The likely reason why two pictures (H x W x 3) are no rectified pair, or why the disparity is not theirs, in one line;
    None: none found.

    left_disparity: H x W px as matched or given, 0 = unknown; doffs: px, as of the rig.
    """
    corners = match_corners(left, right)
    fault = find_corner_fault(corners, left.shape[0], doffs)
    if fault is not None:
        return fault.what
    kept = on_common_rows(corners, len(left_disparity))
    column, row = corners.at[kept].astype(int).T
    theirs = left_disparity[row, column].astype(np.float64)
    own, theirs = corners.offsets[kept, 0][theirs != 0], theirs[theirs != 0]
    agree = np.abs(own - theirs) <= np.maximum(2.0, 0.05 * np.abs(own))
    if len(agree) >= ENOUGH and agree.mean() < SHARED:  # true and matched maps have 86 to 98 %
        return (
            f"the disparity is that of only {agree.mean():.0%} of {len(agree)} corners that both pictures show; is it of this "
            "pair's left picture, in pixels (`disparity_scale` of a file), and no depth?"
        )
    known = float((left_disparity != 0).mean())
    if known < 0.1:
        return f"only {known:.0%} of the left picture was found in the right one, so most depth is a guess"
    return None


def find_many_unmatched(left: UInt8Array, depth: Float32Array) -> str | None:
    """That much of the left picture (H x W x 3) finds no match, in one line; None: little, but for plain sky, which is found
    without.

    depth: H x W metres as matched, 0 = unknown.
    """
    unmatched = depth == 0
    if unmatched.mean() > MANY_UNMATCHED:
        unmatched &= ~find_plain_sky(left, unmatched, depth)
    if (share := unmatched.mean()) <= MANY_UNMATCHED:
        return None
    return (
        f"{share:.0%} of the left picture finds no match in the right one, as surfaces without texture and dark, noisy or "
        "blurred pictures do; depth there is guessed from its surroundings"
    )


def find_corner_fault(corners: Corners, height: int, doffs: float = 0.0) -> Finding | None:
    """The fault of pictures `height` px high by their corners; None: none.

    doffs: px, the negated disparity of a point at infinity (`StereoRig.doffs`).
    """
    if corners.found < 5 * ENOUGH:
        return None
    if misplaced := find_misorientation(corners):
        return misplaced
    near = on_common_rows(corners, height)
    offsets = corners.offsets[near]
    if len(near) < ENOUGH or near.mean() < SHARED:
        what = (
            f"only {int(near.sum())} of {corners.found} corners are found in both pictures; are they of the same scene, "
            "taken at the same time?"
        )
        return _fault("unrelated", what, "give two pictures of one scene, taken side by side")
    if (np.abs(offsets) < 0.5).all(1).mean() > 0.9:
        what = (
            "corners lie at the same place in both pictures; are they one and the same, or is everything too far away for "
            "this baseline?"
        )
        return _fault("identical", what, DIFFERENT)
    across, rows = offsets[:, 0] + doffs, np.abs(offsets[:, 1])
    middle, upper = np.median(rows), np.percentile(rows, 75)
    if middle > 0.8 or upper > 1.5:  # px; of rectified pairs they are 0 and 0.4 at most
        what = (
            f"rows of the pictures do not match: a quarter of their corners lie {upper:.1f} px or more higher or lower in "
            "the other one; are the pictures rectified?"
        )
        return _fault("unrectified", what, describe_rectification(offsets[:, 1]))
    if (across < -1).mean() > 0.4:
        what = (
            f"{(across < -1).mean():.0%} of the corners lie farther to the right in the right picture; are left and right "
            "swapped?"
        )
        return _fault("swapped", what, "give them the other way round")
    if has_exchanged_channels(corners.warmth[near]):
        what = (
            "what is red in one picture is blue in the other one: the channels of one are the other way round "
            "(BGR read as RGB)"
        )
        mend = "exchange its red and blue: cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)"
        return _fault("channels", what, mend)
    return None


def describe_rectification(down: Float64Array) -> str:
    """The correction of a pair by the vertical offsets of its corners: a shift of the right picture, where that is enough."""
    middle, rectify = float(np.median(down)), "rectify the pair with its calibration (cv2.stereoRectify)"
    if np.median(np.abs(down - middle)) > 0.3 * abs(middle):
        return rectify
    return f"move the right picture {'down' if middle > 0 else 'up'} by {abs(middle):.1f} px, or {rectify}"


def has_exchanged_channels(warmth: Float64Array) -> bool:
    """Whether what is red in one picture is blue in the other one; warmth: as in `Corners`. In such pairs it is correlated by
    -0.9 or less, in others by 0.9 or more, where there are colours at all."""
    return bool((warmth.std(0) > 4).all() and np.asarray(np.corrcoef(warmth.T))[0, 1] < -0.7)


def find_misorientation(corners: Corners) -> Finding | None:
    """As `find_corner_fault`, of a picture that is mirrored or turned."""
    count = len(corners.offsets)
    if corners.mirrored > max(ONE_SCENE, 2 * count):
        what = (
            f"one of the pictures is mirrored: {corners.mirrored} of {corners.found} corners are found in both when the right "
            f"one is flipped left to right, {count} as it is"
        )
        return _fault("mirrored", what, "flip it back (some front cameras mirror what they record)")
    mean = np.exp(1j * np.radians(corners.turns)).mean() if count >= ONE_SCENE else 1.0
    turn = float(np.degrees(np.angle(mean)))
    if abs(mean) < SHARED or abs(turn) < 20:  # turned by less they still match by rows, and are not rectified
        return None
    return _fault(
        "turned", f"the right picture is turned by {abs(turn):.0f} degrees against the left one", "turn it back"
    )


def on_common_rows(corners: Corners, height: int) -> BoolArray:
    """N, True for corners whose vertical offset is, to a twentieth of the height, that of most (0 where too few matched)."""
    down = corners.offsets[:, 1]
    middle = float(np.median(down)) if len(down) >= ONE_SCENE else 0.0
    return np.asarray(np.abs(down - middle) <= 0.05 * height, np.bool_)
