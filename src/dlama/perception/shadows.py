"""A picture with depth and the mask of a thing in; the shadow that the thing casts on the surface it stands on out.

The surface is a plane. A shadow on it is the thing's own shape thrown along the light, and darker than the lit surface by a
nearly constant ratio in every channel. Where no direction of light explains one with certainty there is none.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import dilated
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.masks.supports import Planes, planes_of

DARKER = 0.1
"""Natural logarithm by which a shadow is darker at least; a tenth."""
WINDOWS_PX = (5, 9, 15, 23)
"""Darkness is averaged over the first of these windows at which the lit surface is even."""
EVEN = 0.05
"""Standard deviation of the darkness of a lit surface that is even."""
EDGE_PX = 2
"""Pixels round the thing that are mixes of it and its surroundings."""
AROUND = 1.6
"""The lit surface is looked at as far from the thing as this many times its diagonal in the picture."""
ROUNDS = 8
"""Of the robust fit of the lit surface."""
SLOPES = (0.15, 0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.6, 3.4, 4.5)
"""Lengths of a shadow over the height of what casts it, that are tried."""
DIRECTIONS = 36
"""And directions over the surface."""
POINTS = 4000
"""Pixels of the thing that are thrown for each of them."""
CELL_PX = 4
"""Width of the cells in which thrown shapes are compared with what is dark."""
CONTRAST = 0.08
"""Least difference in darkness between a thrown shape and what lies round it."""
CERTAIN = 25.0
"""Least number of standard deviations of that difference, as even as the surface is."""
OFF_COLOR = 0.08
"""Natural logarithm by which a shadow's red or blue may differ from its green, beside a sixth of its darkness."""
EVENLY = 0.75
"""Share of a thrown shape that must be darker than half way."""
SMALLEST_PX = 25
LARGEST = 4.0
"""A shadow covers no more pixels than this many times the thing."""


@dataclass(frozen=True, eq=False)
class Ground:
    """The surface that a thing stands on."""

    normal: NDArray[np.float64]
    """n of the plane n . p = 1 over points in camera axes, 1/m; the camera is on its side where n . p < 1."""
    surface: BoolArray
    """H x W, True where it is seen."""


def find_shadow(rgbd: RGBD, mask: BoolArray, found: Planes | None = None) -> BoolArray:
    """H x W bool, True in the shadow of the thing under `mask`, which is no part of it; False everywhere where there is none.

    found: the planes of the picture, where they are known already.
    """
    none = np.zeros(mask.shape, np.bool_)
    ground = ground_of(rgbd, mask, found or planes_of(rgbd))
    if ground is None:
        return none
    usable = ground.surface & ~dilated(mask, EDGE_PX)
    dark = np.zeros(mask.shape, np.float32)
    for window in WINDOWS_PX:
        averaged = darkness(rgbd, mask, ground.surface, window)
        if averaged is None:
            return none
        dark = averaged
        if unevenness(dark, usable) <= EVEN:
            break
    shadow = thrown_shadow(rgbd, mask, ground, dark, usable)
    if shadow.sum() < SMALLEST_PX:
        return none
    shadow = cv2.morphologyEx(shadow.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8)) > 0
    contact = dilated(shadow, EDGE_PX + 2) & dilated(mask, EDGE_PX + 1)
    return np.asarray((shadow | contact) & ground.surface & ~mask)


def ground_of(rgbd: RGBD, mask: BoolArray, found: Planes) -> Ground | None:
    """The plane that holds most of what is seen just below and beside the lower part of the thing; None where there is none."""
    rows = np.flatnonzero(mask.any(1))
    if not len(rows) or not len(found.planes):
        return None
    lower = np.zeros(mask.shape, np.bool_)
    lower[int(rows[0] + 0.6 * (rows[-1] - rows[0])) :] = True
    ring = dilated(mask, 6) & ~mask & lower
    counts = np.bincount(found.label[ring & (found.label > 0)], minlength=len(found.planes) + 1)
    number = int(counts.argmax())
    if number < 1 or counts[number] < 10:
        return None
    camera = rgbd.camera
    a, b, c = found.planes[number - 1]
    normal = np.array([a * camera.fx, b * camera.fy, a * camera.cx + b * camera.cy + c])
    surface = (found.label == number) & rgbd.valid & ~mask
    return Ground(normal, np.asarray(surface))


def darkness(rgbd: RGBD, mask: BoolArray, surface: BoolArray, window: int) -> Float32Array | None:
    """H x W: natural logarithm of the lit surface's luma over what is seen, averaged over
    windows; 0 off the surface. None: too little is seen.

    The lit surface is a quadratic over pixels, fitted so that what is much darker counts less each round (Tukey's weights, the
    darker side cut sooner).
    """
    near = around(mask)
    usable = surface & near & ~dilated(mask, EDGE_PX)
    if usable.sum() < 200:
        return None
    luma = cv2.cvtColor(rgbd.color, cv2.COLOR_RGB2GRAY).astype(np.float32) + 4
    level = np.log(luma)
    inside = (surface & ~dilated(mask, EDGE_PX)).astype(np.float32)
    size = (window, window)
    total, count = cv2.blur(level * inside, size), cv2.blur(inside, size)
    smooth = np.where(count > 0, total / np.maximum(count, 1e-6), level)
    v, u = np.nonzero(usable)
    keep = slice(None, None, max(1, len(v) // 20000))
    v, u = v[keep], u[keep]
    value = smooth[v, u].astype(np.float64)
    height, width = mask.shape
    design = quadratic(u / width, v / height)
    weight = np.ones(len(v))
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        fit = np.linalg.lstsq(design * root[:, None], value * root, rcond=None)[0]
        off = value - design @ fit
        spread = max(1.4826 * float(np.median(np.abs(off))), 0.02)
        scaled = off / np.where(off < 0, 2.0 * spread, 4.0 * spread)
        weight = np.clip(1 - scaled**2, 0, None) ** 2 + 1e-6
    rows, columns = np.nonzero(surface & near)
    lit = quadratic(columns / width, rows / height) @ fit
    out = np.zeros(mask.shape, np.float32)
    out[rows, columns] = lit - smooth[rows, columns]
    return out


def quadratic(u: np.ndarray, v: np.ndarray) -> NDArray[np.float64]:
    return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], 1).astype(np.float64)


def around(mask: BoolArray) -> BoolArray:
    """H x W, True in the box of the mask grown by AROUND of its diagonal."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    reach = int(AROUND * np.hypot(np.ptp(rows) + 1, np.ptp(columns) + 1))
    out = np.zeros(mask.shape, np.bool_)
    out[max(rows[0] - reach, 0) : rows[-1] + reach + 1, max(columns[0] - reach, 0) : columns[-1] + reach + 1] = True
    return out


def unevenness(dark: Float32Array, usable: BoolArray) -> float:
    """Standard deviation of the darkness of the lit surface, from its brighter half: shadows are in the darker one."""
    values = dark[usable & (dark < 0)]
    return 1.4826 * float(np.median(np.abs(values))) if values.size > 50 else 0.0


def thrown_shadow(rgbd: RGBD, mask: BoolArray, ground: Ground, dark: Float32Array, usable: BoolArray) -> BoolArray:
    """The thing's shape thrown over the surface by the light for which it differs most from what lies round it.

    Nowhere where no light makes a difference that the surface's own unevenness could not.
    """
    points, rise = thing_points(rgbd, mask, ground)
    none = np.zeros(mask.shape, np.bool_)
    if len(points) < SMALLEST_PX:
        return none
    n = ground.normal
    up = -n / np.linalg.norm(n)
    foot = points - rise[:, None] * up
    one = np.cross(up, [0.0, 0.0, 1.0])
    one /= max(float(np.linalg.norm(one)), 1e-9)
    two = np.cross(up, one)
    seen = usable & (dark != 0)
    mean, weight = cells(dark, seen), cells(np.ones_like(dark), seen)
    mean = np.asarray(mean / np.maximum(weight, 1e-6), np.float32)
    spread = cell_spread(mean, weight)
    best, light = 0.0, None
    for slope in SLOPES:
        for turn in range(DIRECTIONS):
            angle = 2 * np.pi * turn / DIRECTIONS
            over = slope * (np.cos(angle) * one + np.sin(angle) * two)
            shape = thrown_cells(foot + rise[:, None] * over, rgbd, mean.shape)
            score = certainty(shape, mean, weight, spread)
            if score > best:
                best, light = score, over
    if light is None or best < CERTAIN:
        return none
    place = pixels_of(foot + rise[:, None] * light, rgbd)
    none.ravel()[place] = True
    shape = cv2.morphologyEx(none.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8)) > 0
    shape &= usable
    if shape.sum() < SMALLEST_PX:
        return none & False
    deep = max(DARKER, float(np.median(dark[shape])))
    reach = 4 + round(0.1 * float(np.sqrt(shape.sum())))
    about = touching(usable & (dark > deep / 2) & dilated(shape, reach), shape)
    shadow = about | (shape & (dark > deep / 4))
    lit = usable & ~dilated(shadow, 4) & dilated(shadow, 4 + reach) & (np.abs(dark) < deep / 2)
    if lit.sum() < SMALLEST_PX or shadow.sum() > LARGEST * mask.sum() or not same_color(rgbd, shadow, lit, deep):
        return none & False
    return np.asarray(shadow)


def thing_points(rgbd: RGBD, mask: BoolArray, ground: Ground) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """N x 3 points of the thing in camera axes, and their heights over the surface in metres."""
    rows, columns = np.nonzero(mask & rgbd.valid)
    keep = slice(None, None, max(1, len(rows) // POINTS))
    points = rays(rgbd.camera)[rows[keep], columns[keep]] * rgbd.depth[rows[keep], columns[keep]][:, None]
    rise = (1 - points @ ground.normal) / np.linalg.norm(ground.normal)
    return points, np.maximum(rise, 0)


def cells(values: Float32Array, where: BoolArray) -> Float32Array:
    """Sums of values over cells of CELL_PX x CELL_PX pixels, over `where`, divided by the cells' size."""
    height, width = -(-values.shape[0] // CELL_PX), -(-values.shape[1] // CELL_PX)
    padded = np.zeros((height * CELL_PX, width * CELL_PX), np.float32)
    padded[: values.shape[0], : values.shape[1]] = np.where(where, values, 0)
    return np.asarray(padded.reshape(height, CELL_PX, width, CELL_PX).mean((1, 3)), np.float32)


def cell_spread(mean: Float32Array, weight: Float32Array) -> float:
    """Standard deviation of darkness from cell to cell, robust."""
    values = mean[(weight > 0.5) & (mean < 0)]
    return max(1.4826 * float(np.median(np.abs(values))) if values.size > 20 else 0.0, 0.02)


def thrown_cells(points: NDArray[np.float64], rgbd: RGBD, hw: tuple[int, int]) -> BoolArray:
    """Which cells the thrown points fall into, gaps of a cell closed."""
    pixels = pixels_of(points, rgbd)
    shape = np.zeros(hw, np.uint8)
    shape[pixels // rgbd.camera.width // CELL_PX, pixels % rgbd.camera.width // CELL_PX] = 1
    return np.asarray(cv2.morphologyEx(shape, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0)


def certainty(shape: BoolArray, mean: Float32Array, weight: Float32Array, spread: float) -> float:
    """How many standard deviations the cells of a shape are darker than those round it; 0 where it is less than CONTRAST."""
    grown = cv2.dilate(shape.astype(np.uint8), np.ones((3, 3), np.uint8))
    ring = (cv2.dilate(grown, np.ones((5, 5), np.uint8)) > 0) & (grown == 0)
    inside, outside = weight[shape], weight[ring]
    if inside.sum() < 4 or outside.sum() < 4:
        return 0.0
    dark = float((mean[shape] * inside).sum() / inside.sum())
    lit = float((mean[ring] * outside).sum() / outside.sum())
    if dark - max(lit, 0) < CONTRAST or dark < DARKER / 2:
        return 0.0
    even = float((inside * (mean[shape] > (dark + lit) / 2)).sum() / inside.sum())
    return (
        (dark - lit) / spread * float(np.sqrt(min(inside.sum(), 4 * outside.sum()))) * (2 * even - 1) * (even >= EVENLY)
    )


def pixels_of(points: NDArray[np.float64], rgbd: RGBD) -> NDArray[np.int64]:
    """Flat, unique indices of the pixels that points in camera axes fall into."""
    camera = rgbd.camera
    front = points[points[:, 2] > 1e-3]
    u = np.floor(front[:, 0] / front[:, 2] * camera.fx + camera.cx).astype(np.int64)
    v = np.floor(front[:, 1] / front[:, 2] * camera.fy + camera.cy).astype(np.int64)
    seen = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    return np.unique(v[seen] * camera.width + u[seen])


def same_color(rgbd: RGBD, region: BoolArray, lit: BoolArray, darker: float) -> bool:
    """True if a region is darker than the lit surface by much the same ratio in all channels."""
    ratio = np.log(rgbd.color[lit].astype(np.float64) + 4).mean(0) - np.log(
        rgbd.color[region].astype(np.float64) + 4
    ).mean(0)
    return bool(np.abs(ratio - ratio[1]).max() <= OFF_COLOR + darker / 6)


def touching(where: BoolArray, other: BoolArray) -> BoolArray:
    """The 8-connected regions of `where` that touch `other`."""
    _, labels = cv2.connectedComponents(where.astype(np.uint8), connectivity=8)
    numbers = np.unique(labels[where & other])
    return np.asarray(np.isin(labels, numbers) & where)
