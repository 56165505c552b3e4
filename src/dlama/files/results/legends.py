"""Hole types in; the legends of pictures that show them, names with shares and colours, out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.figures.false_color import HOLE_PALETTE, RGB
from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.view import HoleType


def hole_legend(hole_type: UInt8Array) -> list[tuple[str, RGB]]:
    """(name with its share of the picture, colour) of the hole types that occur, for a sheet's legend."""
    counts = np.bincount(hole_type.ravel(), minlength=len(HOLE_PALETTE))
    total = max(hole_type.size, 1)
    return [
        (f"{code.name.lower().replace('_', ' ')} {percent(counts[code] / total)}", HOLE_PALETTE[code])
        for code in HoleType
        if code and counts[code]
    ]


def percent(share: float) -> str:
    """0.1234 -> "12.3 %"; what is there but tiny is not called 0."""
    return f"{100 * share:.1f} %" if share >= 0.0005 or share == 0 else "<0.1 %"
