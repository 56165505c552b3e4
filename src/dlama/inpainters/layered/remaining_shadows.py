"""Shadows that stay: a view with a thing taken out in; what of its surroundings still shows it, its shadow, out.

Those pixels were measured and stay as they are, but no hole may be painted with them: that would paint what was taken out.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import nearest_known, opened, square
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import HoleType, View
from dlama.perception.shadows.lit_surface import quadratic, robust_fit

GRID = 256
"""Longer side of the coarse picture on which shadows are looked for."""
DARKER = 0.12
"""Natural logarithm by which a shadow's core is darker than the lit surface, at least."""
FAINTEST = 0.06
"""The same of its border."""
USUAL = 0.98
"""Share of the surface farther off that is less dark than a shadow: what is as dark elsewhere is a pattern."""
CLEARLY = 1.25
"""A shadow's core is darker than that pattern by this factor."""
REACH = 1.0
"""A shadow is looked for within this many times the root of the thing's area."""
LEAST_CELLS = 60
"""Fewer cells of a surface farther off say nothing about its pattern."""
FADE = 0.008
"""Share of the picture's longer side over which painted ground gets lit, from its shadow on."""
RIM_SIGMA = 2.0
"""Pixels over which brightness is averaged at the rim."""


def shadow_beside(view: View, label: NDArray[np.int32]) -> BoolArray:
    """H x W, True where a plane beside what was taken out is darker than its lit surface, and than it is anywhere farther off.

    label: H x W, the surface of each pixel.
    """
    thing = view.hole & (view.hole_type == HoleType.OBJECT)
    if not thing.any() or view.hole.all():
        return np.zeros_like(thing)
    height, width = thing.shape
    step = max(1.0, max(height, width) / GRID)
    wh = max(1, round(width / step)), max(1, round(height / step))
    distance = cv2.distanceTransform((~shrunk(thing, wh, 0.25)).astype(np.uint8), cv2.DIST_L2, 5)
    reach = REACH * np.sqrt((distance == 0).sum()) + 2
    luma = np.log(cv2.cvtColor(view.color, cv2.COLOR_RGB2GRAY).astype(np.float32) + 4)
    out = np.zeros(wh[::-1], np.bool_)
    ring = (distance > 0) & (distance <= 3)
    for number in np.unique(cv2.resize(label.astype(np.int16), wh, interpolation=cv2.INTER_NEAREST)[ring]).tolist():
        on = (label == number) & ~view.hole
        share = cv2.resize(on.astype(np.float32), wh, interpolation=cv2.INTER_AREA)
        surface = (share > 0.5) & (distance > 0)
        if number < 1 or not (surface & ring).any():
            continue
        level = cv2.resize(luma * on, wh, interpolation=cv2.INTER_AREA) / np.maximum(share, 1e-3)
        out |= shadow_on(surface, np.asarray(level, np.float32), np.asarray(distance, np.float32), reach)
    out = cv2.dilate(out.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    full = cv2.resize(out.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
    return np.asarray(full & ~view.hole)


def fading_out(painted: UInt8Array, shadow: BoolArray, hole: BoolArray, label: NDArray[np.int32]) -> UInt8Array:
    """H x W x 3: painted colours that begin as dark as the shadow beside them and are lit a little farther in.

    painted: H x W x 3; shadow: H x W, known; hole: H x W, painted; label: H x W. Without this what was taken out stays visible
    as a bright shape in its own shadow.
    """
    sigma = FADE * max(hole.shape)
    distance, nearest = nearest_known(shadow)
    inside = hole & (distance < 4 * sigma) & (label == label.ravel()[nearest])
    if not inside.any():
        return painted
    box = bounds(
        inside | (shadow & (cv2.dilate(inside.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0)), round(3 * sigma)
    )
    picture, dark, inside, distance = painted[box].astype(np.float32), shadow[box], inside[box], distance[box]
    there, own = mean_of(picture, dark, RIM_SIGMA), mean_of(picture, inside, RIM_SIGMA)
    rim = inside & (distance < 2)
    step = mean_of(there - own, rim, sigma)
    out = painted.copy()
    lit = picture + step * np.exp(-distance / sigma)[..., None]
    out[box][inside] = np.clip(np.round(lit[inside]), 0, 255)
    return out


def mean_of(values: Float32Array, where: BoolArray, sigma: float) -> Float32Array:
    """H x W x C: Gaussian mean of the values in `where`."""
    weight = where.astype(np.float32)
    sums = cv2.GaussianBlur(values * weight[..., None], (0, 0), sigma)
    return np.asarray(sums / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-6)[..., None], np.float32)


def bounds(where: BoolArray, margin: int) -> tuple[slice, slice]:
    """The box round `where`, grown."""
    rows, columns = np.flatnonzero(where.any(1)), np.flatnonzero(where.any(0))
    down, across = (slice(max(0, ends[0] - margin), ends[-1] + margin + 1) for ends in (rows, columns))
    return down, across


def shrunk(mask: BoolArray, wh: tuple[int, int], least: float) -> BoolArray:
    return np.asarray(cv2.resize(mask.astype(np.float32), wh, interpolation=cv2.INTER_AREA) > least)


def shadow_on(surface: BoolArray, level: Float32Array, distance: Float32Array, reach: float) -> BoolArray:
    """h x w, the shadow on one surface (h x w bool). level: h x w logarithm of its brightness; distance: cells to the thing."""
    beyond = surface & (distance > reach) & (distance <= 3 * reach)
    near = surface & (distance <= reach)
    if beyond.sum() < LEAST_CELLS or not near.any():
        return np.zeros_like(surface)
    dark = lit_surface(level, near | beyond) - level
    core = max(DARKER, CLEARLY * float(np.quantile(dark[beyond], USUAL)))
    darker = opened(near & (dark > max(FAINTEST, core / 2)), square(3))
    number = cv2.connectedComponents(darker.astype(np.uint8), connectivity=4)[1]
    beside = np.unique(number[near & (distance <= 2) & (dark > core)])
    return np.isin(number, beside[beside > 0])


def lit_surface(level: Float32Array, where: BoolArray) -> Float32Array:
    """h x w: a quadratic over pixels in `where`, fitted to `level` by `robust_fit`; elsewhere `level` itself."""
    rows, columns = np.nonzero(where)
    height, width = where.shape
    design, value = quadratic(columns / width, rows / height), level[rows, columns].astype(np.float64)
    out = level.copy()
    out[rows, columns] = design @ robust_fit(design, value)
    return out
