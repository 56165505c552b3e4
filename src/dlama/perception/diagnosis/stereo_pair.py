"""Two pictures of a supposed rectified pair in; whether they are swapped, mirrored, turned, identical, unrectified,
unrelated or of exchanged channels, and their exposure, out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.rgbd import UInt8Array
from dlama.perception.diagnosis.finding import Finding
from dlama.perception.diagnosis.frames.landing import brightness_ratio
from dlama.perception.stereo.checks import Corners, diagnose_corners, match_corners, on_common_rows

MENDS = {
    "unrelated": "give two pictures of one scene, taken side by side",
    "unrectified": "rectify the pair with its calibration (cv2.stereoRectify)",
    "identical": "give the two different pictures of the pair",
    "mirrored": "flip it back (some front cameras mirror what they record)",
    "turned": "turn it back",
    "swapped": "give them the other way round",
    "channels": "exchange its red and blue: cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)",
}


def check_pair(left: UInt8Array, right: UInt8Array, doffs: float = 0.0) -> list[Finding]:
    """Findings on a pair (uint8 H x W x 3 each, of one size); `doffs` as `StereoRig.doffs`, px."""
    if np.abs(left.astype(np.int16) - right).mean() < 1:  # levels
        what = "left and right are the same picture"
        return [Finding("identical-pair", "fault", 0.98, what, MENDS["identical"])]
    corners = match_corners(left, right)
    doubt = diagnose_corners(corners, left.shape[0], doffs)
    exposure = check_exposure(left, right)
    if doubt is None:
        return exposure
    kind, what = doubt
    mend = describe_shift(corners, left.shape[0]) if kind == "unrectified" else MENDS[kind]
    return [Finding(f"{kind}-pair", "fault", 0.92, what, mend), *exposure]


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


def describe_shift(corners: Corners, height: int) -> str:
    """The correction of an unrectified pair: a vertical shift of the right picture, where that is enough."""
    down = corners.offsets[on_common_rows(corners, height), 1]
    middle = float(np.median(down))
    if np.median(np.abs(down - middle)) > 0.3 * abs(middle):
        return MENDS["unrectified"]
    return f"move the right picture {'down' if middle > 0 else 'up'} by {abs(middle):.1f} px, or {MENDS['unrectified']}"
