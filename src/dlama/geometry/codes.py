"""Codes of a pixel: where its value comes from, and why it was not covered; which pixels of a view have some of them.

They are fixed (docs/concepts/conventions.md); every output format carries them.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from dlama.geometry.rgbd import BoolArray, UInt8Array


class Origin(IntEnum):
    """Where the value of a pixel or point comes from."""

    UNKNOWN = 0
    MEASURED = 1
    REPROJECTED = 2
    DEPTH_FILLED = 3
    """Colour measured, depth filled (a sensor hole)."""
    FILLED = 4
    ESTIMATED = 5
    """Colour measured, depth estimated from the picture; so too where it is seen from elsewhere."""
    ELSEWHERE = 6
    """In the view of one of a scene's frames: measured by another frame; where the colour is the frame's own, its depth alone."""


DEPTH_FROM_OTHERS = (Origin.DEPTH_FILLED, Origin.ELSEWHERE)
"""Origins of a frame's pixels with its own colour and a depth that the frame did not measure."""
ESTIMATED_CONFIDENCE = 0.6
"""Confidence of measured colour with estimated depth; 1 is measured, fills have 0.5 and less."""
LARGEST_CONFIDENCE = 0.99
"""Largest probability of a filled pixel; 1 is what was measured."""
SEEN_AGAIN = (Origin.REPROJECTED, Origin.ESTIMATED)
"""Origins of what the source view shows, seen from elsewhere."""


def has_code(codes: UInt8Array, *which: int) -> BoolArray:
    """True where a code (Origin, HoleType) is one of these.

    Arrays are compared with numbers, as `Origin.FILLED.value` is: next to a member of an enum numpy counts in 64 bits, which
    takes twelve times as long, and `np.isin` a hundred times.
    """
    out = codes == int(which[0])
    for code in which[1:]:
        out |= codes == int(code)
    return np.asarray(out, np.bool_)


def from_source(origin: UInt8Array) -> BoolArray:
    """True where the source view itself shows a pixel: measured, or measured with estimated depth."""
    return has_code(origin, Origin.MEASURED, Origin.ESTIMATED)


def from_filler(origin: UInt8Array) -> BoolArray:
    """True where a filler wrote depth: with a colour of its own, or to a measured one."""
    return has_code(origin, Origin.FILLED, Origin.DEPTH_FILLED)


class HoleType(IntEnum):
    """Why a pixel was not covered."""

    NONE = 0
    CRACK = 1
    """Between two samples of one surface (rounding)."""
    DISOCCLUDED = 2
    """Hidden behind something in the source view."""
    FLYING = 3
    """Only a rejected flying pixel (a mix of two depths) lay here."""
    OUT_OF_VIEW = 4
    """Outside the source camera's picture."""
    SENSOR = 5
    """The sensor gave colour but no depth."""
    OBJECT = 6
    """Covered by the object that was removed."""
