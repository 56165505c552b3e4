"""A picture with an object on a surface in; the darkness of the surface, and the part of it that is ambient occlusion, out.

The lit surface is modelled as a quadratic over pixels. The ambient-occlusion component is fitted with it: on an overcast day
the whole surface round a wide object is darker. Its light comes from all directions above, weighted by the cosine law; a
surface point loses the share that the object covers. The object's points are projected on the surface along directions of equal
light. Its hidden side is assumed half the object's width behind the visible one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.holes import box_around, box_mean, dilate_mask, larger_box, sides_of, square
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.shadows.ground import EDGE_PX, Crop, StandingObject, light_offsets, surface_axes

DIRECTIONS = 64
"""Number of directions, each with the same share of the sky's light."""
LAYERS = 5
"""Of the points of an object, in its thickness."""
COARSE = 2
"""Pixels of the crop (`ground.SIDE`) in one of the map."""


@dataclass(frozen=True, eq=False)
class Darkness:
    """How dark a surface is."""

    dark: Float32Array
    """H x W natural logarithm of lit over observed luma, averaged over 5 x 5 px; 0 off the surface."""
    ambient: Float32Array
    """H x W, its ambient-occlusion component; 0 or more."""
    share: float
    """Exponent of the sky's visible share that gives the levels."""


def measure_darkness(rgbd: RGBD, mask: BoolArray, surface: BoolArray, occlusion: Float32Array) -> Darkness | None:
    """Darkness of the surface round the object under `mask`; None: too little of it is seen.

    occlusion: H x W, `ambient_occlusion`. Both parts are fitted robustly (Tukey's weights, cut sooner on the darker side).
    """
    near = around(mask)
    usable = surface & near & ~dilate_mask(mask, EDGE_PX)
    if usable.sum() < 200:
        return None
    level, inside = log_luma(rgbd.color), (surface & ~dilate_mask(mask, EDGE_PX)).astype(np.float32)
    smooth = np.where(cv2.blur(inside, (5, 5)) > 0, box_mean(level, inside, 5), level)
    hidden = sky_lost(occlusion)
    v, u = np.nonzero(usable)
    keep = slice(None, None, max(1, len(v) // 20000))
    v, u = v[keep], u[keep]
    height, width = mask.shape
    design, value = quadratic(u / width, v / height), smooth[v, u].astype(np.float64)
    fit = robust_fit(np.c_[design, -hidden[v, u]], value)
    share = float(np.clip(fit[-1], 0, 1 / 2.2))  # at most all light comes from the sky; 2.2 is the gamma of pictures
    if share != fit[-1]:
        fit = robust_fit(design, value + share * hidden[v, u])
    rows, columns = np.nonzero(surface & near)
    dark, ambient = np.zeros((2, *mask.shape), np.float32)
    dark[rows, columns] = quadratic(columns / width, rows / height) @ fit[:6] - smooth[rows, columns]
    ambient[rows, columns] = share * hidden[rows, columns]
    return Darkness(dark, ambient, share)


def sky_lost(occlusion: Float32Array) -> NDArray[np.float64]:
    """H x W natural logarithm of the whole sky's light over the unoccluded part; what hardly sees it is lit from elsewhere."""
    return np.asarray(-np.log(1 - np.minimum(occlusion, 0.95)), np.float64)


def log_luma(color: UInt8Array) -> Float32Array:
    """H x W logarithm of the luma (0..255, 4 more: of black it is finite) of a picture (H x W x 3)."""
    return np.asarray(np.log(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY).astype(np.float32) + 4), np.float32)


def robust_fit(design: NDArray[np.float64], value: NDArray[np.float64]) -> NDArray[np.float64]:
    """C coefficients of the lit surface: design (N x C) @ C ~ value (N), where much darker values count less each round."""
    weight = np.ones(len(value))
    for _ in range(8):
        root = np.sqrt(weight)
        fit = np.linalg.lstsq(design * root[:, None], value * root, rcond=None)[0]
        off = value - design @ fit
        spread = max(1.4826 * float(np.median(np.abs(off))), 0.02)
        scaled = off / np.where(off < 0, 2.0 * spread, 4.0 * spread)
        weight = np.clip(1 - scaled**2, 0, None) ** 2 + 1e-6
    return np.asarray(fit)


def quadratic(u: np.ndarray, v: np.ndarray) -> NDArray[np.float64]:
    """N x 6: the terms of a quadratic over N points, for `robust_fit`."""
    return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], 1).astype(np.float64)


def around(mask: BoolArray) -> BoolArray:
    """H x W, True in the box of the mask grown by 1.6 of its diagonals."""
    tight = box_around(mask, 0)
    out = np.zeros(mask.shape, np.bool_)
    out[larger_box(tight, int(1.6 * np.hypot(*sides_of(tight))), mask.shape)] = True
    return out


def ambient_occlusion(caster: StandingObject, camera: Camera, crop: Crop) -> Float32Array:
    """H x W occluded share of the sky, 0..1, on the supporting plane; 0 outside the crop round the object."""
    wide, high = (-(-side // COARSE) for side in crop.size)
    total = np.zeros((high, wide), np.float32)
    caster, scale = thicken(caster), crop.scale / COARSE
    for over in sky_directions(caster.up):
        points = caster.base + caster.rise[:, None] * over
        front = points[points[:, 2] > 1e-3]
        u = (front[:, 0] / front[:, 2] * camera.fx + camera.cx - crop.columns.start) * scale
        v = (front[:, 1] / front[:, 2] * camera.fy + camera.cy - crop.rows.start) * scale
        seen = (u >= 0) & (u < wide) & (v >= 0) & (v < high)
        shape = np.zeros((high, wide), np.uint8)
        shape[v[seen].astype(int), u[seen].astype(int)] = 1
        total += cv2.morphologyEx(shape, cv2.MORPH_CLOSE, square(5))
    smooth = cv2.GaussianBlur(total / DIRECTIONS, (0, 0), 1.5)  # against steps between directions
    return crop.place(np.asarray(smooth, np.float32), camera.hw)


def thicken(caster: StandingObject) -> StandingObject:
    """The object with copies of its points behind the visible ones, along the surface, over half of its width."""
    if not len(caster.base):
        return caster
    keep = slice(None, None, max(1, len(caster.base) // 2000))
    across, behind = surface_axes(caster.up)
    place = caster.base @ across
    width = float(np.quantile(place, 0.98) - np.quantile(place, 0.02))
    layers = [caster.base[keep] + back * behind for back in np.linspace(0, width / 2, LAYERS)]
    return StandingObject(np.concatenate(layers), np.tile(caster.rise[keep], LAYERS), caster.up)


def sky_directions(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """DIRECTIONS x 3: metres over the surface for each metre of height, in camera axes; as dense as the cosine to `up`, the
    golden angle from one to the next."""
    number = np.arange(DIRECTIONS)
    sine2, turn = (number + 0.5) / DIRECTIONS, 2.39996 * number
    return light_offsets(up, np.sqrt(sine2 / (1 - sine2)), turn)
