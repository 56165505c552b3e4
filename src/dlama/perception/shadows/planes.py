"""A picture, an object's mask and its supporting surface in; planes of a crop, and its shadow by a small U-Net that ships, out.

They are log colour against the lit surface, masks of object and surface, height and position over the surface in object
heights, darkness, ambient occlusion and the darkness that it explains, and the shapes cast by the likeliest light and by the
common light of all objects; and, for the network, how frequent colours are. `benchmarks/shadow_network.py` trains it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import dilate_mask
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.models.network_file import ASSETS, NetworkFile, shipped_network
from dlama.perception.shadows.ground import EDGE_PX, Crop, Ground, crop_around, measure_object, object_points
from dlama.perception.shadows.lit_surface import ambient_occlusion, measure_darkness
from dlama.perception.shadows.search import find_cast_shapes

MULTIPLE = 32
"""The sides of the planes are multiples of this many pixels; the crop's longer side has `ground.SIDE`."""
PLANES = (
    "red", "green", "blue", "object", "surface", "picture", "height", "right", "away", "darkness", "occluded",
    "ambient", "cast", "common",
)  # fmt: skip
FIRST_CAST = PLANES.index("cast")
"""First plane of a cast shape."""
LOG_RANGE, FAR = 2.0, 4.0
"""Log colour, and distance in object heights, that are 1 in a plane (the latter through tanh)."""
COLORS = 24
"""Bins of log colour a channel."""
NETWORK = ASSETS / "shadow" / "shadow.onnx"
LOG_SHARE = 4.0
"""Logarithm of a frequency that is 1 in a plane."""
HUES = 32
"""Bins of the logarithms of red and blue over green."""


@dataclass(frozen=True, eq=False)
class ShadowPlanes:
    """What is known of each pixel of a crop."""

    values: Float32Array
    """PLANES x h x w."""

    def plane(self, name: str) -> Float32Array:
        """One of PLANES, h x w."""
        return self.values[PLANES.index(name)]

    @property
    def color(self) -> Float32Array:
        """3 x h x w logarithms against the lit surface, over LOG_RANGE."""
        return self.values[:3]

    @cached_property
    def caster(self) -> BoolArray:
        """h x w, True on the object."""
        return np.asarray(self.plane("object") > 0.5)

    @cached_property
    def surface(self) -> BoolArray:
        """h x w, True on the visible surface that it stands on."""
        return np.asarray(self.plane("surface") > 0.5)

    @property
    def casts(self) -> Float32Array:
        """K x h x w, cast shapes, each times the probability of its light."""
        return self.values[FIRST_CAST:]

    @cached_property
    def shares(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Frequencies on the surface, N logarithms each: of the colour of each pixel of it, and of lighter ones."""
        color = self.color[:, self.surface].T * LOG_RANGE
        place = bin_of(color)
        flat = (place[:, 0] * COLORS + place[:, 1]) * COLORS + place[:, 2]
        counts = np.bincount(flat, minlength=COLORS**3).astype(np.float32).reshape((COLORS,) * 3)
        for axis in range(3):
            counts += (np.roll(counts, 1, axis) + np.roll(counts, -1, axis) - 2 * counts) / 4
        share = np.log(counts / max(len(color), 1) + 1e-4)
        raised = [share[tuple(bin_of(color + more).T)] for more in (0.12, 0.25, 0.45, 0.8)]
        return share[tuple(place.T)], raised


def bin_of(color: Float32Array) -> NDArray[np.intp]:
    """N x 3: which of COLORS bins, from -2.5 to 1.5, each channel of log colours (N x 3) is in."""
    return (np.clip((color + 2.5) / 4, 0, 0.9999) * COLORS).astype(int)


def shadow_planes(rgbd: RGBD, mask: BoolArray, ground: Ground) -> tuple[ShadowPlanes, Crop, Float32Array]:
    """The planes, sides multiples of MULTIPLE and at most `ground.SIDE`; the crop; and H x W, the ambient occlusion."""
    crop = crop_around(mask)
    points, rise = object_points(rgbd, mask, ground)
    caster = measure_object(points, rise, ground)
    occlusion = ambient_occlusion(caster, rgbd.camera, crop)
    dark = measure_darkness(rgbd, mask, ground.surface, occlusion)
    usable = ground.surface & ~dilate_mask(mask, EDGE_PX)
    wide, high = crop.size
    out = np.zeros((len(PLANES), -(-high // MULTIPLE) * MULTIPLE, -(-wide // MULTIPLE) * MULTIPLE), np.float32)
    view = out[:, :high, :wide]
    surface = crop.small(usable)
    level = np.log(crop.small(rgbd.color) + 4)
    lit = np.median(level[surface > 0.5], 0) if (surface > 0.5).any() else np.median(level, (0, 1))
    view[0:3] = np.clip((level - lit) / LOG_RANGE, -1.5, 1.5).transpose(2, 0, 1)
    view[3], view[4], view[5] = crop.small(mask), surface, 1
    tall = max(float(np.quantile(rise, 0.98)), 0.02) if len(rise) else 1.0
    view[6:9] = places(rgbd, ground, crop, points, rise, tall)
    if dark is not None:
        view[9] = np.clip(crop.small(dark.dark), -1.5, 1.5)
        view[11] = np.clip(crop.small(dark.ambient), 0, 1.5)
    view[10] = crop.small(occlusion)
    for plane, shape in zip(view[FIRST_CAST:], find_cast_shapes(rgbd, ground, usable, caster, tall)):
        if shape is not None:
            plane[:] = shape[0] * crop.small(shape[1])
    return ShadowPlanes(out), crop, occlusion


def places(
    rgbd: RGBD, ground: Ground, crop: Crop, points: NDArray[np.float64], rise: NDArray[np.float64], tall: float
) -> Float32Array:
    """3 x h x w: height over the surface, and position right of and behind the object's ground contact, in object heights."""
    wide, high = crop.size
    hw = rgbd.depth.shape
    column = (crop.columns.start + (np.arange(wide) + 0.5) / crop.scale).astype(int).clip(0, hw[1] - 1)
    row = (crop.rows.start + (np.arange(high) + 0.5) / crop.scale).astype(int).clip(0, hw[0] - 1)
    at = np.ix_(row, column)
    direction, depth = rays(rgbd.camera)[at], np.where(rgbd.valid, rgbd.depth, 0)[at]
    length = float(np.linalg.norm(ground.normal))
    up = -ground.normal / length
    over = np.where(depth > 0, ground.heights(direction * depth[..., None]), 4 * tall)
    right = np.array([1.0, 0, 0]) - up[0] * up
    right /= max(float(np.linalg.norm(right)), 1e-9)
    away = np.cross(right, up)
    away *= 1 if away[2] > 0 else -1
    low = points[rise < 0.3 * tall]
    base = np.median(low if len(low) else points, 0) if len(points) else np.array([0.0, 0.0, 1.0])
    hit = direction / np.maximum(direction @ ground.normal, 1e-3 * length)[..., None] - base
    return np.stack(
        [np.clip(over / tall, -0.5, 2) / 2, np.tanh(hit @ right / tall / FAR), np.tanh(hit @ away / tall / FAR)]
    )


def network_planes(planes: ShadowPlanes) -> Float32Array:
    """The planes with three more: frequency of each colour on the surface, gain in frequency if it were lit, and darkness
    relative to its hue (`darkness_by_hue`)."""
    where = planes.surface
    share, raised = planes.shares
    added = np.zeros((3, *where.shape), np.float32)
    if where.any():
        added[0, where], added[1, where] = share / LOG_SHARE, (np.max(raised, 0) - share) / LOG_SHARE
        added[2] = darkness_by_hue(planes)
    return np.concatenate([planes.values, added])


def darkness_by_hue(planes: ShadowPlanes) -> Float32Array:
    """h x w mean log level of all surface pixels with similar ratios of red, green and blue, over the pixel's own. A shadow is
    equally far below its own material on a rug and on the floor next to it. 0 off the surface."""
    where = planes.surface
    color = np.stack([cv2.GaussianBlur(plane, (0, 0), 1.0) for plane in planes.color])[:, where] * LOG_RANGE
    ratios = np.clip((np.stack([color[0] - color[1], color[2] - color[1]]) + 1) / 2, 0, 0.9999)  # -1 to 1
    place, level = (ratios * HUES).astype(int), color.mean(0)
    flat = place[0] * HUES + place[1]
    count, total = (
        cv2.GaussianBlur(np.bincount(flat, each, HUES**2).astype(np.float32).reshape(HUES, HUES), (0, 0), 1.0)
        for each in (None, level)
    )
    out = np.zeros(where.shape, np.float32)
    out[where] = (total / np.maximum(count, 1e-3)).ravel()[flat] - level
    return out


def network_probability(planes: ShadowPlanes, file: NetworkFile | None = None) -> Float32Array:
    """h x w probability of each pixel of the surface; file: another network."""
    logits = (file or shipped_network(NETWORK)).run({"planes": network_planes(planes)[None]})[0]
    return np.asarray(np.where(planes.surface, 1 / (1 + np.exp(-logits)), 0), np.float32)
