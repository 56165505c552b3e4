"""Grey levels of two pictures of the same points in; how many times as bright one is, and a note where that is much, out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import UInt8Array
from dlama.perception.diagnosis.finding import Finding
from dlama.perception.diagnosis.frames.landing import Landed

PAIR, FRAMES = 1.3, 1.25
"""Least ratios of brightness that are reported: of all pixels of a pair's pictures; of points that two frames show."""

WHITE = 0.05
"""Share of white values (255) that one picture of a pair has more than the other, from which its exposure has lost them."""


def gain(first: NDArray[Any], second: NDArray[Any]) -> float:
    """Brightness of the second over the first."""
    return float((np.median(second) + 1) / (np.median(first) + 1))


def check_exposure_of_pair(left: UInt8Array, right: UInt8Array) -> list[Finding]:
    """Reports pictures of a pair that are not equally bright."""
    times = gain(left, right)
    if 1 / PAIR < times < PAIR:
        return []
    what = f"the right picture is {times:.2f} times as bright as the left one"
    lost = abs(float((left == 255).mean() - (right == 255).mean()))
    if lost > WHITE:
        return [
            Finding(
                "exposure", "note", 0.8, f"{what}, and {lost:.0%} of the brighter one is white", "expose both alike"
            )
        ]
    return [Finding("exposure", "note", 0.8, what, "nothing to do: matching and filling allow for it")]


def check_exposure_of_frames(landed: Sequence[Landed], name: str) -> list[Finding]:
    """Reports frames in a row, called `name`, that are not equally bright where they show the same points."""
    gains = [gain(each.first, each.second) for each in landed]
    most = max((max(each, 1 / each) for each in gains), default=1.0)
    if most <= FRAMES:
        return []
    what = f"{name}: exposure changes from frame to frame, up to {most:.2f} times as bright"
    return [Finding("exposure", "note", 0.85, what, "undo the gain before colours of frames are compared or mixed")]
