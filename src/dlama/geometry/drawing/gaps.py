"""A drawn picture in; the same with narrow gaps between its surfaces closed, and the sky extended, out.

Layers that were filled for several cameras meet at their pixel borders. From a view between them seams of a pixel or two open,
and so do directions of the sky that no camera saw. Wider gaps stay open.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.codes import Origin
from dlama.geometry.drawing.canvas import Canvas
from dlama.geometry.projection import depth_from_inverse, inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array

WIDEST = 2
"""Largest width of a seam, px along a row or a column."""
SKY = 0.08
"""Largest gap along a row, over the picture's width, into which sky extends."""
SEAM_CONFIDENCE, SKY_CONFIDENCE = 0.9, 0.5
"""Factors on the lower confidence of both sides, for seams and for sky."""


class Ends(NamedTuple):
    """The nearest known pixels before and after each of N empty ones, along its row or its column."""

    before: NDArray[np.intp]
    """N flat indices, -1 where there is none."""
    after: NDArray[np.intp]
    length: NDArray[np.intp]
    """N: pixels of the gap from end to end."""
    share: Float32Array
    """N: where in the gap the pixel is, 0..1."""

    @classmethod
    def of(cls, known: BoolArray, flat: NDArray[np.intp]) -> Ends:
        """Along the rows of `known` (H x W); flat: H x W, each pixel's flat index."""
        gaps = ~known.all(1)
        known, flat = known[gaps], flat[gaps]
        width, column = known.shape[1], np.arange(known.shape[1], dtype=np.int32)
        left = np.maximum.accumulate(np.where(known, column, np.int32(-1)), axis=1)[~known]
        right = np.minimum.accumulate(np.where(known, column, np.int32(width))[:, ::-1], axis=1)[:, ::-1][~known]
        row, at = np.nonzero(~known)
        before = np.where(left >= 0, flat[row, left], -1)
        after = np.where(right < width, flat[row, np.minimum(right, width - 1)], -1)
        return cls(before, after, right - left - 1, ((at - left) / (right - left)).astype(np.float32))

    def select(self, which: NDArray[np.intp] | BoolArray) -> Ends:
        """Some of them."""
        return Ends(self.before[which], self.after[which], self.length[which], self.share[which])


def close_gaps(canvas: Canvas) -> None:
    """Fill empty pixels in gaps at most WIDEST px wide or high, or next to sky in their row; origin FILLED.

    Drawn pixels stay bit for bit.
    """
    known = canvas.depth > 0
    if known.all() or not known.any():
        return
    flat = np.arange(known.size).reshape(known.shape)
    empty = flat[~known]
    along, down = Ends.of(known, flat), Ends.of(known.T, flat.T).select(np.argsort(flat.T[~known.T]))
    inverse = inverse_depth(canvas.depth).ravel()
    steps = [seam_step(ends, inverse) for ends in (along, down)]
    nothing = canvas.origin.ravel()[empty] == Origin.UNKNOWN.value  # a measured colour without depth stays
    in_row = nothing & (steps[0] <= steps[1]) & np.isfinite(steps[0])
    in_column = nothing & (steps[0] > steps[1])
    far = np.append(np.isposinf(canvas.depth.ravel()), False)  # -1: there is none
    by_sky = (far[along.before] | far[along.after]) & (along.length <= SKY * known.shape[1])
    sky = nothing & by_sky & ~in_row & ~in_column
    for ends, where, factor in (
        (along, in_row, SEAM_CONFIDENCE),
        (down, in_column, SEAM_CONFIDENCE),
        (along, sky, SKY_CONFIDENCE),
    ):
        join(canvas, inverse, empty[where], ends.select(where), factor)


def seam_step(ends: Ends, inverse: Float32Array) -> Float32Array:
    """N: relative step in inverse depth over a seam, +inf where there is none."""
    w, v = inverse[ends.before], inverse[ends.after]
    seam = (ends.before >= 0) & (ends.after >= 0) & (ends.length <= WIDEST)
    return np.where(seam, np.abs(w - v) / np.maximum(np.maximum(w, v), np.float32(1e-12)), np.float32(np.inf))


def join(canvas: Canvas, inverse: Float32Array, empty: NDArray[np.intp], ends: Ends, factor: float) -> None:
    """Write the empty pixels (flat indices): interpolated between both ends within one surface, else as the farther end."""
    before = np.where(ends.before >= 0, ends.before, ends.after)
    after = np.where(ends.after >= 0, ends.after, ends.before)
    w, v = inverse[before], inverse[after]
    same = np.abs(w - v) <= 0.03 * np.maximum(w, v)
    share = np.where(same, ends.share, (v < w).astype(np.float32))
    colors = canvas.color.reshape(-1, 3)
    colors[empty] = np.rint(colors[before] * (1 - share)[:, None] + colors[after] * share[:, None]).astype(np.uint8)
    canvas.depth.reshape(-1)[empty] = depth_from_inverse(w * (1 - share) + v * share)
    canvas.origin.reshape(-1)[empty] = Origin.FILLED
    confidence = canvas.confidence.reshape(-1)
    confidence[empty] = np.float32(factor) * np.minimum(confidence[before], confidence[after])
    if len(canvas.errors):
        errors = canvas.errors.reshape(-1, 2)
        errors[empty] = np.maximum(errors[before], errors[after])
