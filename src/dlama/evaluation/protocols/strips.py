"""What a method made of a case in; one strip of small pictures out: input, warped, filled, truth, error; colour above, depth
below."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from dlama.geometry.figures.false_color import depth_limits, depth_picture, hatch_holes
from dlama.geometry.figures.html import shrink
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

COLUMNS = ("input", "warped", "filled", "truth", "error")
CELL = 256
"""Largest side of a small picture in px."""
GAP = 4
COLOR_FULL = 64.0
"""Levels of mean absolute difference that are shown brightest."""
DEPTH_FULL = 0.25
"""Share of the true depth by which a fill is off that is shown brightest; far against near is brightest too."""


def strip(colors: Sequence[UInt8Array], depths: Sequence[Float32Array], hole: BoolArray) -> UInt8Array:
    """uint8 H x W x 3 on black: two rows of the five pictures; the depths share their colours, holes are hatched.

    Args:
        colors: input, warped, filled, truth, H x W x 3 each.
        depths: the same in metres, 0 = missing, inf = far.
        hole: H x W, True = was unknown before filling.
    """
    source, warped, filled, truth = depths
    limits = depth_limits(truth, source)
    below = [
        depth_picture(source, None, *limits),
        depth_picture(warped, hole, *limits),
        depth_picture(filled, None, *limits),
        depth_picture(truth, None, *limits),
        heat_map(depth_error(filled, truth)),
    ]
    above = [colors[0], hatch_holes(colors[1], hole), colors[2], colors[3], heat_map(color_error(*colors[2:]))]
    return stack([[shrink(cell, CELL) for cell in row] for row in (above, below)])


def color_error(filled: UInt8Array, truth: UInt8Array) -> Float32Array:
    """H x W, 0..1: mean absolute difference over the channels, 1 = COLOR_FULL levels or more."""
    gap = np.abs(filled.astype(np.float32) - truth.astype(np.float32)).mean(axis=2)
    return np.minimum(gap / COLOR_FULL, 1).astype(np.float32)


def depth_error(filled: Float32Array, truth: Float32Array) -> Float32Array:
    """H x W, 0..1, NaN where the truth is missing: share of the true depth, 1 = DEPTH_FULL or more, or far for near."""
    filled = np.nan_to_num(filled, nan=0, posinf=np.inf)
    valid = (truth > 0) & (truth < np.inf) & (filled < np.inf)
    gap = np.where(np.isinf(filled) & np.isinf(truth), 0.0, 1.0)
    gap[valid] = np.abs(filled[valid] - truth[valid]) / (DEPTH_FULL * truth[valid])
    return np.where(truth > 0, np.minimum(gap, 1), np.nan).astype(np.float32)


def heat_map(error: Float32Array) -> UInt8Array:
    """uint8 H x W x 3: 0 black to 1 bright yellow; NaN hatched."""
    unknown: BoolArray = np.isnan(error)
    levels = np.rint(np.nan_to_num(error) * 255).astype(np.uint8)
    return hatch_holes(np.array(cv2.applyColorMap(levels, cv2.COLORMAP_INFERNO)[..., ::-1], np.uint8), unknown)


def stack(rows: list[list[UInt8Array]]) -> UInt8Array:
    """Rows of pictures on one black sheet, every cell of the size of the largest, so that columns have equal widths."""
    height = max(cell.shape[0] for row in rows for cell in row)
    width = max(cell.shape[1] for row in rows for cell in row)
    sheet = np.zeros((len(rows) * (height + GAP) - GAP, len(rows[0]) * (width + GAP) - GAP, 3), np.uint8)
    for down, row in enumerate(rows):
        for across, cell in enumerate(row):
            top, left = down * (height + GAP), across * (width + GAP)
            sheet[top : top + cell.shape[0], left : left + cell.shape[1]] = cell
    return sheet


def jpeg(picture: UInt8Array) -> bytes:
    """The picture as the bytes of a JPEG file."""
    _, data = cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 80])
    return bytes(data.tobytes())
