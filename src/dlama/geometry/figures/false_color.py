"""Depth, hole types and origins in; pictures that show them in colour out. Arrays only: the nouns draw themselves by it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

UInt8Array = NDArray[np.uint8]
Float32Array = NDArray[np.float32]
BoolArray = NDArray[np.bool_]
RGB = tuple[int, int, int]

HOLE_PALETTE: tuple[RGB, ...] = (
    (0, 0, 0),
    (245, 245, 245),
    (213, 94, 0),
    (240, 228, 66),
    (0, 114, 178),
    (204, 121, 167),
    (0, 158, 115),
)
"""RGB by HoleType code: none, crack, disoccluded, flying, out of view, sensor, object (Okabe and Ito's colours, which
the colour-blind tell apart)."""
ORIGIN_PALETTE: tuple[RGB, ...] = (
    (0, 0, 0),
    (235, 235, 235),
    (86, 180, 233),
    (204, 121, 167),
    (213, 94, 0),
    (0, 158, 115),
    (240, 228, 66),
)
"""RGB by Origin code: unknown, measured, reprojected, depth filled, filled, estimated, elsewhere."""

SKY: RGB = (222, 231, 240)
HATCH: tuple[RGB, RGB] = ((46, 48, 52), (64, 67, 72))
HATCH_PERIOD = 12
"""Pixels across one dark and one light stripe."""


def depth_picture(
    depth: Float32Array, hole: BoolArray | None = None, lo: float | None = None, hi: float | None = None
) -> UInt8Array:
    """Depth (H x W metres) as uint8 H x W x 3: near red, far blue, in equal steps of 1 / depth; sky pale, holes hatched.

    `lo` and `hi` are the depths in metres shown as the nearest and the farthest colour; by default the 2nd and 98th
    percentile of this picture, so give them where pictures are compared. `hole` adds to where depth is missing.
    """
    import cv2  # here, so that the nouns cost no more than numpy

    depth = np.asarray(depth, np.float32)
    known = depth > 0 if hole is None else (depth > 0) & ~hole
    valid = known & (depth < np.inf)
    inverse = np.divide(1, depth, out=np.zeros_like(depth), where=valid)
    if lo and hi:
        near, far = 1 / lo, 1 / hi
    else:
        low, high = np.percentile(inverse[valid], (2, 98)) if valid.any() else (0.0, 1.0)
        near, far = 1 / lo if lo else float(high), 1 / hi if hi else float(low)
    levels = np.rint(np.clip((inverse - far) / max(near - far, 1e-9), 0, 1) * 255).astype(np.uint8)
    picture = np.asarray(cv2.cvtColor(cv2.applyColorMap(levels, cv2.COLORMAP_TURBO), cv2.COLOR_BGR2RGB), np.uint8)
    picture[known & ~valid] = SKY
    return hatch_holes(picture, ~known)


def depth_limits(*depths: Float32Array) -> tuple[float, float]:
    """(lo, hi) for `depth_picture` that suit several depth maps at once; (1, 10) where none is valid."""
    valid = np.concatenate([depth[(depth > 0) & (depth < np.inf)].ravel() for depth in depths])
    if not valid.size:
        return 1.0, 10.0
    lo, hi = np.percentile(valid, (2, 98))
    return float(lo), float(max(hi, lo * 1.001))


def hole_picture(color: UInt8Array, hole_type: UInt8Array) -> UInt8Array:
    """uint8 H x W x 3: the colour where it was known, the hole types (H x W codes) in HOLE_PALETTE."""
    hole, out = hole_type > 0, color.copy()
    out[hole] = np.array(HOLE_PALETTE, np.uint8)[hole_type[hole]]
    return out


def origin_picture(origin: UInt8Array) -> UInt8Array:
    """uint8 H x W x 3: Origin codes (H x W) in ORIGIN_PALETTE."""
    return np.array(ORIGIN_PALETTE, np.uint8)[origin]


def hatch_holes(color: UInt8Array, hole: BoolArray) -> UInt8Array:
    """uint8 H x W x 3: the colour where it is known; in holes (H x W, True) quiet diagonal stripes, which no camera takes for a
    surface."""
    out, (rows, columns) = color.copy(), np.nonzero(hole)
    stripe = (rows + columns) % HATCH_PERIOD < HATCH_PERIOD // 2
    out[rows, columns] = np.where(stripe[:, None], *np.array(HATCH, np.uint8))
    return out
