"""An object's points over its supporting plane, and the picture, in; the shapes it casts under the likeliest lights, with their
probabilities, out.

For each direction of light the object's shape is projected on the plane. Across a shadow's border log luma rises outwards by the
same step everywhere, on any pattern. So the flux of its gradient through the border (by Gauss, the sum of the divergence inside)
is compared with the flux expected by chance for a border of that length.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import erode_square, gaussian_mean, morphological_close, square
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import project_to_pixels, rays
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.perception.kernels.shadows import DIRECTIONS_A_TASK, cast_shapes
from dlama.perception.shadows.ground import Ground, StandingObject, light_offsets, measure_object
from dlama.perception.shadows.lit_surface import log_luma

SLOPES = np.array((0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.72, 0.86, 1.0, 1.2, 1.45, 1.75, 2.1, 2.6, 3.2))
"""Tried lengths of a shadow over the object's height."""
TURNS = 48
"""Number of tried directions over the surface."""
STEEPEST = 0.08
"""Largest gradient (of the logarithm, per px) that counts, so that lines of a pattern weigh no more than borders."""
SMALLEST_PX = 25
"""Fewer points of an object, or pixels of a shadow, are ignored."""


def best_direction(caster: StandingObject, rgbd: RGBD, seen: BoolArray) -> tuple[NDArray[np.float64], float] | None:
    """The direction whose cast shape is strongest, metres over the surface for each metre of height, in camera axes; and its
    strength, flux over its standard deviation by chance, less for a low sun. None where no shape falls on the visible surface.

    seen: H x W, True where the surface is seen. The picture is reduced by a whole factor to about 256 pixels along its longer
    side; the six best of the coarse directions are refined.
    """
    step = max(1, round(max(seen.shape) / 256))
    height, width = seen.shape[0] // step, seen.shape[1] // step
    whole = seen[: height * step, : width * step].reshape(height, step, width, step)
    seen = np.ascontiguousarray(whole.all((1, 3)))
    small = cv2.resize(rgbd.color[: height * step, : width * step], (width, height), interpolation=cv2.INTER_AREA)
    divergence, spread = divergence_of(np.asarray(small, np.uint8), seen)
    points = np.ascontiguousarray(caster.base), np.ascontiguousarray(caster.rise)
    lens = np.array([rgbd.camera.fx, rgbd.camera.fy, rgbd.camera.cx, rgbd.camera.cy]) / step

    def offsets(slopes: NDArray[np.float64], turns: NDArray[np.float64]) -> NDArray[np.float64]:
        return light_offsets(caster.up, slopes, -2 * np.pi * turns / TURNS)

    def strengths(slopes: NDArray[np.float64], turns: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.zeros((len(slopes), 3))
        stamps = np.zeros((-(-len(slopes) // DIRECTIONS_A_TASK), *seen.shape), np.int32)
        args = *points, offsets(slopes, turns), lens, divergence, seen, stamps, out
        in_bands(cast_shapes, len(slopes), *args, band=DIRECTIONS_A_TASK)
        flux, pixels, border = out.T
        # short borders are no evidence, and a low sun is rare
        strength = flux / (spread * np.sqrt(np.maximum(border, 20))) / (1 + (slopes / 2.5) ** 2)
        return np.asarray(np.where(pixels < 8, 0, strength))

    slopes, turns = (each.ravel() for each in np.meshgrid(SLOPES, np.arange(TURNS) * 1.0, indexing="ij"))
    top = np.argsort(-strengths(slopes, turns), kind="stable")[:6]
    finer = np.linspace(0.82, 1.18, 7), np.linspace(-2 / 3, 2 / 3, 5)
    factors, shifts = (each.ravel() for each in np.meshgrid(*finer, indexing="ij"))
    near = np.outer(slopes[top], factors).ravel(), np.add.outer(turns[top], shifts).ravel()
    fine = strengths(*near)
    best = int(fine.argmax())
    if fine[best] <= 0:
        return None
    return offsets(near[0][best : best + 1], near[1][best : best + 1])[0], float(fine[best])


def divergence_of(color: UInt8Array, seen: BoolArray) -> tuple[NDArray[np.float64], float]:
    """H x W divergence of the clipped gradient of log luma between pixels that are seen, and the gradient's RMS."""
    smooth = gaussian_mean(log_luma(color), seen, 1.2, 1e-3)
    inner = erode_square(seen, 3)
    out, squares = np.zeros(seen.shape), []
    for axis in (0, 1):
        both = inner & np.roll(inner, -1, axis)
        both[(-1, slice(None)) if axis == 0 else (slice(None), -1)] = False
        step = np.where(both, np.clip(np.roll(smooth, -1, axis) - smooth, -STEEPEST, STEEPEST), 0)
        out += step - np.roll(step, 1, axis)
        squares.append(step[inner] ** 2)
    spread = float(np.sqrt(np.concatenate(squares).mean())) if inner.any() else 0.0
    return out, max(spread, 1e-3)


def find_cast_shapes(
    rgbd: RGBD, ground: Ground, usable: BoolArray, caster: StandingObject, tall: float
) -> list[tuple[float, BoolArray] | None]:
    """Probability and H x W shape of: the best light of the object, and the common light of all objects. usable: H x W, True
    where the surface is seen; tall: metres."""
    if len(caster.base) < SMALLEST_PX:
        return [None, None]
    found = best_direction(caster, rgbd, usable)
    # its own probability; one fitted to seven features of the shape found no more shadows
    own = None if found is None else (0.6, cast_shape(caster, found[0], rgbd, usable))
    return [own, find_common_light(rgbd, ground, usable, caster, tall)]


def find_common_light(
    rgbd: RGBD, ground: Ground, usable: BoolArray, caster: StandingObject, tall: float
) -> tuple[float, BoolArray] | None:
    """The shape cast by the light that explains the shadows of all objects on the surface, of at most 4000 points that are
    neither much lower nor much taller than the object; at a strength of 20 it is nearly certain."""
    there = rgbd.valid & ~ground.surface
    every = rays(rgbd.camera)[there] * rgbd.depth[there][:, None]
    height = ground.heights(every)
    keep = np.flatnonzero((height > 0.04 * tall) & (height < 4 * tall))
    keep = keep[:: max(1, len(keep) // 4000)]
    if len(keep) < SMALLEST_PX:
        return None
    others = measure_object(every[keep], height[keep], ground)
    found = best_direction(others, rgbd, usable)
    if found is None:
        return None
    over, strength = found
    return float(np.tanh(strength / 20)), cast_shape(caster, over, rgbd, usable)


def cast_shape(caster: StandingObject, over: NDArray[np.float64], rgbd: RGBD, usable: BoolArray) -> BoolArray:
    """H x W shape cast on `usable` by a light (metres over the surface for each metre of height), gaps closed."""
    shape = np.zeros(usable.shape, np.bool_)
    points = caster.base + caster.rise[:, None] * over
    row, column, z, inside = project_to_pixels(points, rgbd.camera.at(np.eye(4)))
    inside &= z > 1e-3
    shape[row[inside], column[inside]] = True
    return np.asarray(usable & morphological_close(shape, square(9)))
