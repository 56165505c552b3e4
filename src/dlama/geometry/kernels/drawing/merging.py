"""Numba kernel that merges frames drawn into one camera: stacks of pictures in; one picture out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dlama.geometry.camera import Float64Array
from dlama.geometry.codes import Origin
from dlama.geometry.kernels.drawing.shading import Planes
from dlama.geometry.kernels.jit import Flag, Real, Whole, inlined, kernel, piece
from dlama.geometry.kernels.visibility import ray
from dlama.geometry.rgbd import Float32Array, UInt8Array, UInt16Array

LEAST = 1e-6
REPROJECTED, DEPTH_FILLED, ELSEWHERE = (
    code.value for code in (Origin.REPROJECTED, Origin.DEPTH_FILLED, Origin.ELSEWHERE)
)
"""Of the last two the colour is a frame's own, the depth is not."""


class Frames(NamedTuple):
    """K frames, drawn into the target, and where they were taken from."""

    color: UInt8Array
    """K x H x W x 3."""
    depth: Float32Array
    """K x H x W, metres: 0 = none, inf = far."""
    origin: UInt8Array
    confidence: Float32Array
    near: Float32Array
    """K x h x w, each frame's own depth, the nearest of a neighbourhood."""
    margin: Float32Array
    """K x h x w, pixels to the frame's border or next depth edge."""
    matrix: Float64Array
    """K x 3 x 3, and `offset`: from pixels of the target to those of the frame."""
    offset: Float64Array
    """K x 3."""
    center: Float64Array
    """K x 4, the frames' centres in the target's axes and their focal lengths."""
    gain: Float64Array
    """K x 3, of their colours."""


class Seen(NamedTuple):
    """A surface in a pixel."""

    measured: Flag
    """Whether it is measured there."""
    nearest: Real
    """Metres, and `limit`: between these a frame shows it."""
    limit: Real
    mean: Real
    """Metres, of the frames that show it."""


@piece
def tolerance(depth: Real, noise: Float64Array) -> Real:
    """Metres between two depths of one surface: three standard deviations, or 0.5 %, as layers of a scene are fused."""
    spread = noise[1] * depth * depth
    return max(5e-3 * depth, 3.0 * math.sqrt(noise[0] * noise[0] + spread * spread))


@inlined
def sees_through(frames: Frames, frame: Whole, row: Whole, column: Whole, depth: Real, noise: Float64Array) -> Real:
    """1 where a frame measured clearly behind the point at `depth` on a target pixel's ray, all around it; else 0."""
    matrix, offset, near = frames.matrix, frames.offset, frames.near
    ax, ay, az = ray(matrix[frame], row, column)
    z = depth * az + offset[frame, 2]
    if z <= 0:
        return 0
    x, y = (depth * ax + offset[frame, 0]) / z, (depth * ay + offset[frame, 1]) / z
    if not (0 <= x < near.shape[2] and 0 <= y < near.shape[1]):
        return 0
    limit = near[frame, np.int64(y), np.int64(x)]
    if limit == 0 or limit == np.inf:
        return 1 if limit == np.inf else 0
    return 1 if z < limit - 2.0 * tolerance(limit, noise) else 0


@inlined
def color_weight(frames: Frames, frame: Whole, row: Whole, column: Whole, depth: Real, lens: Float64Array) -> Real:
    """How well a frame shows the point at `depth` on a target pixel's ray: the best one prevails, equally good ones blend.

    0.2 radians between the lines of sight cost as much as pixels that are e times as coarse; 12 px from a border or a depth edge
    the colour counts fully.
    """
    matrix, offset, margin, center = frames.matrix, frames.offset, frames.margin, frames.center
    x, y = depth * (column + 0.5 - lens[2]) / lens[0], depth * (row + 0.5 - lens[3]) / lens[1]
    u, v, w = x - center[frame, 0], y - center[frame, 1], depth - center[frame, 2]
    here, there = math.sqrt(x * x + y * y + depth * depth), math.sqrt(u * u + v * v + w * w)
    cosine = (x * u + y * v + depth * w) / max(here * there, LEAST)
    coarser = math.log(max(1.0, there * lens[0] / max(here * center[frame, 3], LEAST)))
    cost = math.acos(min(1.0, max(-1.0, cosine))) / 0.2 + coarser
    ax, ay, az = ray(matrix[frame], row, column)
    z = depth * az + offset[frame, 2]
    px = min(margin.shape[2] - 1.0, max(0.0, (depth * ax + offset[frame, 0]) / max(z, LEAST)))
    py = min(margin.shape[1] - 1.0, max(0.0, (depth * ay + offset[frame, 1]) / max(z, LEAST)))
    safe = min(1.0, (margin[frame, np.int64(py), np.int64(px)] + 0.5) / 12.0)
    return max(LEAST, math.exp(-4.0 * cost) * safe * safe)


@inlined
def shows(frames: Frames, frame: Whole, row: Whole, column: Whole, measured: Flag) -> Real:
    """The depth a frame shows in a pixel, if it is measured there, or if not; else 0."""
    code, depth = frames.origin[frame, row, column], frames.depth[frame, row, column]
    return np.float64(depth) if (code != DEPTH_FILLED and code != ELSEWHERE) == measured else 0.0


@inlined
def nearest_behind(frames: Frames, row: Whole, column: Whole, measured: Flag, behind: Real) -> Real:
    """The nearest depth beyond `behind` that a frame shows: inf where only far is left, 0 where nothing is."""
    found = 0.0
    for k in range(len(frames.depth)):
        z = shows(frames, k, row, column, measured)
        if z > behind and (found == 0 or z < found):
            found = z
    return found


@inlined
def mean_depth(
    frames: Frames, row: Whole, column: Whole, measured: Flag, nearest: Real, limit: Real
) -> tuple[Real, Whole]:
    """Mean depth of the surface between two depths, and how many frames show it; near measurements count more."""
    total, mean, support = 0.0, 0.0, 0
    for k in range(len(frames.depth)):
        z = shows(frames, k, row, column, measured)
        if nearest <= z <= limit:
            weight = 1.0 / (z * z)
            total, mean, support = total + weight, mean + weight * z, support + 1
    return mean / total, support


@inlined
def shade(
    frames: Frames, row: Whole, column: Whole, seen: Seen, lens: Float64Array, out: Planes, best: UInt16Array
) -> None:
    """The colour of a surface: the weighted mean of the frames that show it, after their gains."""
    color, gain = frames.color, frames.gain
    red, green, blue, total, most = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(len(frames.depth)):
        z = shows(frames, k, row, column, seen.measured)
        if seen.nearest <= z <= seen.limit:
            w = color_weight(frames, k, row, column, min(seen.mean, 1e6), lens)  # far is finite
            r, g, b = (
                np.float64(color[k, row, column, 0]), np.float64(color[k, row, column, 1]), np.float64(color[k, row, column, 2])
            )  # fmt: skip
            r_gain, g_gain, b_gain = gain[k, 0], gain[k, 1], gain[k, 2]
            bright = (max(r, g, b) - 215.0) / 35.0  # up to 250 levels it saturates, to a weight of 0.05
            if bright > 0:  # one gain a channel would tint what is white because it is too bright
                bright, even = min(bright, np.float64(1)), max(r_gain, g_gain, b_gain)
                w = max(LEAST, w * (1 - bright * 0.95))
                r_gain, g_gain, b_gain = (
                    r_gain + bright * (even - r_gain), g_gain + bright * (even - g_gain), b_gain + bright * (even - b_gain)
                )  # fmt: skip
            red, green, blue = red + w * r_gain * r, green + w * g_gain * g, blue + w * b_gain * b
            total += w
            if w > most:
                most = w
                best[row, column] = k + 1
    out.color[row, column, 0] = np.uint8(min(255.0, red / total + 0.5))
    out.color[row, column, 1] = np.uint8(min(255.0, green / total + 0.5))
    out.color[row, column, 2] = np.uint8(min(255.0, blue / total + 0.5))


@kernel
def merge(
    first: Whole,
    last: Whole,
    frames: Frames,
    lens: Float64Array,
    noise: Float64Array,
    out: Planes,
    best: UInt16Array,
) -> None:
    """For each pixel the nearest surface that the frames agree on: its mean depth and the colour of the best frames.

    A surface is rejected if as many frames saw through it as show it; filled depths, and those of other frames, count only where
    no measured one is left. lens: fx, fy, cx, cy of the target; noise: of depth, as `tolerance` takes it. best: H x W,
    1 + the index of the frame with the largest weight, whose origin and confidence the pixel gets; 0 = a hole; pixels where it is
    set already stay out.
    """
    for row in range(first, last):
        for column in range(best.shape[1]):
            for measured in (True, False):
                behind = 0.0
                while best[row, column] == 0:
                    nearest = nearest_behind(frames, row, column, measured, behind)
                    if nearest == 0:
                        break
                    limit, mean = nearest, nearest
                    if nearest < np.inf:
                        limit = nearest + tolerance(nearest, noise)
                        mean, against = mean_depth(frames, row, column, measured, nearest, limit)
                        for k in range(len(frames.depth)):
                            z = shows(frames, k, row, column, measured)
                            if not nearest <= z <= limit:
                                against -= sees_through(frames, k, row, column, mean, noise)
                        if against <= 0:
                            behind = limit
                            continue
                    out.depth[row, column] = mean
                    shade(frames, row, column, Seen(measured, nearest, limit, mean), lens, out, best)
                    of = best[row, column] - 1
                    code = frames.origin[of, row, column]
                    out.origin[row, column] = REPROJECTED if code == ELSEWHERE else code
                    out.confidence[row, column] = frames.confidence[of, row, column]
