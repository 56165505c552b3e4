"""A picture, a thing's mask and the surface it stands on in; the planes of a crop round it that its shadow is judged by out.

Log colour against the lit surface, where thing and surface are, height and place over the surface in heights of the thing, the
darkness map, and the thing's shape thrown by the lights that explain most.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import dilated
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.shadows.ground import EDGE_PX, Ground, standing, thing_points
from dlama.perception.shadows.thrown import thrown_shapes

SIDE, MULTIPLE = 320, 32
"""Longer side of the crop in its own pixels, and what its sides are multiples of."""
PLANES = (
    "red", "green", "blue", "thing", "surface", "picture", "height", "right", "away", "darkness", "sharp", "soft",
    "second", "common",
)  # fmt: skip
ASIDE, BELOW, ABOVE = 1.6, 1.2, 0.5
"""The crop reaches as far from the thing as these times its diagonal in the picture."""
LARGEST_SCALE = 2.0
"""Small crops are enlarged by no more than this."""
LOG_RANGE, FAR = 2.0, 4.0
"""Logarithms of colour, and heights of the thing, that are 1 in a plane (the latter through tanh)."""


@dataclass(frozen=True)
class Crop:
    """The part of a picture that a shadow is looked for in."""

    rows: slice
    columns: slice
    scale: float
    """Pixels of the crop in one of the picture."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the crop; what is right of and below it is empty."""
        wide, high = self.columns.stop - self.columns.start, self.rows.stop - self.rows.start
        return min(SIDE, max(1, round(wide * self.scale))), min(SIDE, max(1, round(high * self.scale)))

    def small(self, picture: np.ndarray) -> np.ndarray:
        """The crop of a picture (H x W or H x W x 3) at the crop's size, float32."""
        part = np.ascontiguousarray(picture[self.rows, self.columns]).astype(np.float32)
        how = cv2.INTER_AREA if self.scale < 1 else cv2.INTER_LINEAR
        return cv2.resize(part, self.size, interpolation=how)

    def large(self, plane: Float32Array, hw: tuple[int, int]) -> Float32Array:
        """A plane of the crop back in a picture of H x W, 0 outside the crop."""
        wide, high = self.size
        out = np.zeros(hw, np.float32)
        box = out[self.rows, self.columns]
        box[:] = cv2.resize(plane[:high, :wide], box.shape[::-1], interpolation=cv2.INTER_LINEAR)
        return out


def crop_round(mask: BoolArray) -> Crop:
    """The crop that a thing's shadow is looked for in."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    height, width = mask.shape
    diagonal = float(np.hypot(np.ptp(rows) + 1, np.ptp(columns) + 1)) + 8
    top, bottom = max(0, int(rows[0] - ABOVE * diagonal)), min(height, int(rows[-1] + BELOW * diagonal) + 1)
    left, right = max(0, int(columns[0] - ASIDE * diagonal)), min(width, int(columns[-1] + ASIDE * diagonal) + 1)
    scale = min(LARGEST_SCALE, SIDE / max(bottom - top, right - left))
    return Crop(slice(top, bottom), slice(left, right), scale)


def shadow_planes(rgbd: RGBD, mask: BoolArray, ground: Ground, dark: Float32Array | None) -> tuple[Float32Array, Crop]:
    """PLANES x h x w, sides multiples of MULTIPLE and at most SIDE, and where in the picture that is.

    dark: H x W, `darkness` of the surface.
    """
    crop = crop_round(mask)
    usable = ground.surface & ~dilated(mask, EDGE_PX)
    wide, high = crop.size
    out = np.zeros((len(PLANES), -(-high // MULTIPLE) * MULTIPLE, -(-wide // MULTIPLE) * MULTIPLE), np.float32)
    view = out[:, :high, :wide]
    thing, surface = crop.small(mask), crop.small(usable)
    level = np.log(crop.small(rgbd.color) + 4)
    lit = np.median(level[surface > 0.5], 0) if (surface > 0.5).any() else np.median(level, (0, 1))
    view[0:3] = np.clip((level - lit) / LOG_RANGE, -1.5, 1.5).transpose(2, 0, 1)
    view[3], view[4], view[5] = thing, surface, 1
    points, rise = thing_points(rgbd, mask, ground)
    tall = max(float(np.quantile(rise, 0.98)), 0.02) if len(rise) else 1.0
    view[6:9] = places(rgbd, ground, crop, points, rise, tall)
    if dark is not None:
        view[9] = np.clip(crop.small(dark), -1.5, 1.5)
    for plane, shape in zip(view[10:], thrown_shapes(rgbd, ground, usable, standing(points, rise, ground), tall)):
        if shape is not None:
            plane[:] = shape[0] * crop.small(shape[1])
    return out, crop


def places(
    rgbd: RGBD, ground: Ground, crop: Crop, points: NDArray[np.float64], rise: NDArray[np.float64], tall: float
) -> Float32Array:
    """3 x h x w: height over the surface, and place on it to the right of and behind the thing's foot, in its heights."""
    wide, high = crop.size
    hw = rgbd.depth.shape
    column = (crop.columns.start + (np.arange(wide) + 0.5) / crop.scale).astype(int).clip(0, hw[1] - 1)
    row = (crop.rows.start + (np.arange(high) + 0.5) / crop.scale).astype(int).clip(0, hw[0] - 1)
    at = np.ix_(row, column)
    direction, depth = rays(rgbd.camera)[at], np.where(rgbd.valid, rgbd.depth, 0)[at]
    length = float(np.linalg.norm(ground.normal))
    up = -ground.normal / length
    over = np.where(depth > 0, (1 - (direction * depth[..., None]) @ ground.normal) / length, 4 * tall)
    right = np.array([1.0, 0, 0]) - up[0] * up
    right /= max(float(np.linalg.norm(right)), 1e-9)
    away = np.cross(right, up)
    away *= 1 if away[2] > 0 else -1
    low = points[rise < 0.3 * tall]
    foot = np.median(low if len(low) else points, 0) if len(points) else np.array([0.0, 0.0, 1.0])
    hit = direction / np.maximum(direction @ ground.normal, 1e-3 * length)[..., None] - foot
    return np.stack(
        [np.clip(over / tall, -0.5, 2) / 2, np.tanh(hit @ right / tall / FAR), np.tanh(hit @ away / tall / FAR)]
    )
