"""A thing's points over the plane it stands on, and how dark that is, in; the direction of light that explains a shadow out.

For each direction the thing's shape is thrown on the plane, and how much darker it is than its surroundings is compared with how
much darker the same shape would be elsewhere on the plane: what a texture does anywhere is no shadow.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array

SLOPES = (0.15, 0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.6, 3.4, 4.5)
"""Lengths of a shadow over the height of what casts it, that are tried."""
DIRECTIONS = 36
"""And directions over the surface."""
CELL_PX = 4
"""Width of the cells in which thrown shapes are compared with what is dark."""
CONTRAST = 0.07
"""Least difference in darkness between a thrown shape and what lies round it."""
EVENLY = 0.6
"""Share of a thrown shape that must be darker than half way."""
TEXTURE = 0.04
"""Contrast that a shape may have anywhere, at least: added (squared) to what it has elsewhere on the surface."""
MOST_CELLS = 100
"""Cells from which on a larger shape is no surer."""
LONG = 2.0
"""Slope from which on shadows are rare: a low sun."""
OFF_COLOR = (0.05, 0.25)
"""Natural logarithm by which a shadow's red or blue differs from its green: so much, and so much of its contrast."""
ALIKE = 0.6
"""Directions with this share of the best score and within TURNS of it are weighed by their extent, too."""
TURNS = 2
FEWEST_PLACES = 30
"""Places on the surface that a shape is compared with."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What is known of the plane, in cells of CELL_PX."""

    dark: Float32Array
    """Mean darkness (natural logarithm) of each cell."""
    level: tuple[Float32Array, Float32Array, Float32Array]
    """Mean logarithm of red, green and blue."""
    weight: Float32Array
    """Share of each cell that is seen of the surface."""


@dataclass(frozen=True, eq=False)
class Thrown:
    """A thing's shape thrown by one direction of light."""

    over: NDArray[np.float64]
    """Metres over the surface for each metre of height."""
    slope: float
    turn: int
    shape: BoolArray
    """Cells."""
    score: float
    middle: float
    """Darkness half way between the shape and what lies round it."""


def cells(values: np.ndarray, where: BoolArray) -> Float32Array:
    """Sums of values over cells of CELL_PX x CELL_PX pixels, over `where`, divided by the cells' size."""
    height, width = -(-values.shape[0] // CELL_PX), -(-values.shape[1] // CELL_PX)
    padded = np.zeros((height * CELL_PX, width * CELL_PX), np.float32)
    padded[: values.shape[0], : values.shape[1]] = np.where(where, values, 0)
    return np.asarray(padded.reshape(height, CELL_PX, width, CELL_PX).mean((1, 3)), np.float32)


def surface_of(rgbd: RGBD, dark: Float32Array, seen: BoolArray) -> Surface:
    """The surface in cells. dark: H x W; seen: H x W, True where the surface is seen."""
    weight = cells(np.ones_like(dark), seen)
    share = np.maximum(weight, 1e-6)
    level = np.log(rgbd.color.astype(np.float32) + 4)
    red, green, blue, mean = (
        np.asarray(cells(one, seen) / share, np.float32) for one in (*np.moveaxis(level, 2, 0), dark)
    )
    return Surface(mean, (red, green, blue), weight)


def best_direction(
    foot: NDArray[np.float64], rise: NDArray[np.float64], up: NDArray[np.float64], rgbd: RGBD, surface: Surface
) -> Thrown | None:
    """The thrown shape that stands out most; None where none does.

    foot: N x 3 points of the thing dropped on the surface, rise: their N heights in metres, up: the surface's normal.
    """
    found = list(candidates(foot, rise, up, rgbd, surface))
    if not found:
        return None
    best = max(found, key=lambda one: one.score)
    near = [
        one
        for one in found
        if one.score >= ALIKE * best.score and (one.turn - best.turn + TURNS) % DIRECTIONS <= 2 * TURNS
    ]
    fullest = max(near, key=lambda one: held(one.shape, surface, best.middle))
    return replace(fullest, score=best.score, middle=best.middle)


def held(shape: BoolArray, surface: Surface, middle: float) -> float:
    """How much of what is darker than `middle` a shape holds, less what is lighter."""
    return float((surface.weight[shape] * (surface.dark[shape] - middle)).sum())


def candidates(
    foot: NDArray[np.float64], rise: NDArray[np.float64], up: NDArray[np.float64], rgbd: RGBD, surface: Surface
) -> Iterator[Thrown]:
    """The shapes of all directions that are darker than their surroundings, evenly."""
    one = np.cross(up, [0.0, 0.0, 1.0])
    one /= max(float(np.linalg.norm(one)), 1e-9)
    two = np.cross(up, one)
    for slope in SLOPES:
        for turn in range(DIRECTIONS):
            angle = 2 * np.pi * turn / DIRECTIONS
            over = slope * (np.cos(angle) * one + np.sin(angle) * two)
            shape = thrown_cells(foot + rise[:, None] * over, rgbd, surface.dark.shape)
            score, middle = certainty(shape, surface)
            if score > 0:
                yield Thrown(over, slope, turn, shape, score / (1 + (slope / LONG) ** 2), middle)


def certainty(shape: BoolArray, surface: Surface) -> tuple[float, float]:
    """How surely the cells of a shape are darker than those round it by a shadow (0: they are not), and the darkness half way."""
    ring = ring_of(shape)
    weight = surface.weight
    inside, outside = weight[shape], weight[ring]
    if inside.sum() < 4 or outside.sum() < 4:
        return 0.0, 0.0
    dark, lit = (float((surface.dark[w] * weight[w]).sum() / weight[w].sum()) for w in (shape, ring))
    contrast, middle = dark - lit, (dark + lit) / 2
    even = float((inside * (surface.dark[shape] > middle)).sum() / inside.sum())
    clear = float((outside * (surface.dark[ring] < middle)).sum() / outside.sum())
    if contrast < CONTRAST or even < EVENLY:
        return 0.0, 0.0
    ratio = [
        float((c[ring] * outside).sum() / outside.sum() - (c[shape] * inside).sum() / inside.sum())
        for c in surface.level
    ]
    off = max(abs(ratio[0] - ratio[1]), abs(ratio[2] - ratio[1]))
    usual = contrast_elsewhere(shape, ring, surface)
    score = contrast / np.hypot(usual, TEXTURE) * min(float(inside.sum()), MOST_CELLS) ** 0.25 * (even + clear - 1)
    score *= np.exp(-((off / (OFF_COLOR[0] + OFF_COLOR[1] * contrast)) ** 2))
    return max(float(score), 0.0), middle


def ring_of(shape: BoolArray) -> BoolArray:
    """The cells round a shape, one cell away from it and two wide."""
    grown = cv2.dilate(shape.astype(np.uint8), np.ones((3, 3), np.uint8))
    return np.asarray((cv2.dilate(grown, np.ones((5, 5), np.uint8)) > 0) & (grown == 0))


def contrast_elsewhere(shape: BoolArray, ring: BoolArray, surface: Surface) -> float:
    """Standard deviation (robust) of the contrast that the same shape has at other places of the surface, beside this one."""
    rows, columns = np.flatnonzero((shape | ring).any(1)), np.flatnonzero((shape | ring).any(0))
    top, left, high, wide = int(rows[0]), int(columns[0]), int(np.ptp(rows)) + 1, int(np.ptp(columns)) + 1
    box = slice(top, top + high), slice(left, left + wide)
    kernels = [where[box].astype(np.float32) for where in (shape, ring)]
    weighted = surface.dark * surface.weight
    sums = [placed(weighted, kernel) for kernel in kernels]
    counts = [placed(surface.weight, kernel) for kernel in kernels]
    contrast = sums[0] / np.maximum(counts[0], 1e-3) - sums[1] / np.maximum(counts[1], 1e-3)
    whole = (counts[0] > 0.6 * kernels[0].sum()) & (counts[1] > 0.5 * kernels[1].sum())
    v, u = np.mgrid[: contrast.shape[0], : contrast.shape[1]]
    apart = whole & ((np.abs(u - left) > 0.7 * wide) | (np.abs(v - top) > 0.7 * high))
    places = apart & (np.abs(v - top) <= max(high, 6))
    if places.sum() < FEWEST_PLACES:
        places = apart
    if places.sum() < FEWEST_PLACES:
        return 0.1
    found = contrast[places]
    middle = float(np.median(found))
    return max(1.4826 * float(np.median(np.abs(found - middle))), float(np.percentile(found, 90)) - middle)


def placed(values: Float32Array, kernel: Float32Array) -> Float32Array:
    """Sum of values under a kernel whose upper left cell lies at each cell."""
    return np.asarray(cv2.filter2D(values, -1, kernel, anchor=(0, 0), borderType=cv2.BORDER_CONSTANT), np.float32)


def thrown_cells(points: NDArray[np.float64], rgbd: RGBD, hw: tuple[int, int]) -> BoolArray:
    """Which cells the thrown points fall into, gaps of a cell closed."""
    pixels = pixels_of(points, rgbd)
    shape = np.zeros(hw, np.uint8)
    shape[pixels // rgbd.camera.width // CELL_PX, pixels % rgbd.camera.width // CELL_PX] = 1
    return np.asarray(cv2.morphologyEx(shape, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0)


def pixels_of(points: NDArray[np.float64], rgbd: RGBD) -> NDArray[np.int64]:
    """Flat, unique indices of the pixels that points in camera axes fall into."""
    camera = rgbd.camera
    front = points[points[:, 2] > 1e-3]
    u = np.floor(front[:, 0] / front[:, 2] * camera.fx + camera.cx).astype(np.int64)
    v = np.floor(front[:, 1] / front[:, 2] * camera.fy + camera.cy).astype(np.int64)
    seen = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    return np.unique(v[seen] * camera.width + u[seen])
