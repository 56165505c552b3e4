"""A picture with depth and a click in; the probability of each pixel belonging to the object clicked on out, and of an object
being there at all, by a small U-Net.

The network sees a square about the click: first most of the picture, then about the object that it found there. It learnt on
objects of procedural worlds, in exact, measured, matched and estimated depth (`benchmarks/click_network.py`).
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from dlama.geometry.holes import region_at
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, Float32Array, is_valid
from dlama.models.network_file import ASSETS, NetworkFile, shipped_network
from dlama.perception.masks.prompt import Pixel, square_about
from dlama.perception.masks.salient import WindowSaliency, window_around, window_side

FOLDER = ASSETS / "click"
SIDE = 128
"""Height and width of the network's planes."""
PLANES = ("red", "green", "blue", "distance", "known", "inside", "right", "down", "click", "estimated")
SALIENT = ("salient", "salient_near")
"""Further planes of the network for estimated depth: saliency of most of the picture, and about the object."""
KNOWN = 0.2
"""Least share of known depth for a pixel of the planes to have one."""
LOG_RANGE = (-2.0, 1.0)
"""Of inverse depth over the click's, logarithm; sky is at the lower end."""
CLICK_PX = 4
"""Standard deviation of the click in its plane, and the distance from it at which a region is the clicked one."""
MIDDLE = slice(SIDE // 2 - CLICK_PX, SIDE // 2 + CLICK_PX + 1)
"""Rows, or columns, of the network's planes near the click."""
FIRST_WINDOW, LARGEST_WINDOW, SMALLEST_WINDOW = 0.75, 1.4, 40
"""Side of the first square and of the largest, over the picture's longer side, and the least in px."""


def network(estimated: bool) -> NetworkFile:
    """The network that ships for estimated depth, or for measured depth; opened once a process."""
    return shipped_network(FOLDER / ("estimated.onnx" if estimated else "click.onnx"))


def click_planes(rgbd: RGBD, pixel: Pixel, radius: int, salient: Sequence[Float32Array]) -> Float32Array:
    """C x SIDE x SIDE: PLANES of a square of 2 radius + 1 px about (row, column); zeros beyond the picture.

    salient: H x W each; one more plane for each.
    """
    span = square_about(pixel, radius)
    beyond = [(max(radius - at, 0), max(at + radius + 1 - n, 0)) for at, n in zip(pixel, rgbd.depth.shape)]
    how = cv2.INTER_AREA if 2 * radius + 1 > SIDE else cv2.INTER_LINEAR

    def resized(values: np.ndarray) -> Float32Array:
        padded = np.pad(values, beyond + [(0, 0)] * (values.ndim - 2))
        return np.asarray(cv2.resize(padded, (SIDE, SIDE), interpolation=how), np.float32)

    depth = rgbd.depth[span]
    valid, far = (resized(where.astype(np.float32)) for where in (is_valid(depth), depth == np.inf))
    inside = resized(np.ones(depth.shape, np.float32))
    w = np.where(valid > KNOWN, resized(inverse_depth(depth)) / np.maximum(valid, KNOWN), np.float32(0))
    known, middle = w > 0, SIDE // 2
    squares = (w[middle - k : middle + k, middle - k : middle + k] for k in (2, 4, 8, 16, SIDE // 2))
    here = next((float(np.median(each[each > 0])) for each in squares if (each > 0).any()), 1.0)
    logs = np.clip(np.log(np.maximum(w, 1e-6) / here), *LOG_RANGE)
    out = np.zeros((len(PLANES) + len(salient), SIDE, SIDE), np.float32)
    out[:3] = (resized(rgbd.color[span]) / 127.5 - 1).transpose(2, 0, 1) * inside
    out[3:6] = np.where(known, logs, np.where(far > 0.5, LOG_RANGE[0], 0)), known, inside
    for number, (right, down) in ((6, (1, 0)), (7, (0, 1))):
        slope = 20.0 * cv2.Sobel(w, cv2.CV_32F, right, down, ksize=3) / 8 / np.maximum(w, 1e-6)
        out[number] = np.where(known, np.clip(slope, -2, 2), 0)
    apart = np.arange(SIDE, dtype=np.float32) - (SIDE - 1) / 2
    out[8] = np.exp(-(apart[:, None] ** 2 + apart**2) / (2 * CLICK_PX**2))
    out[9] = rgbd.estimate is not None
    for number, level in enumerate(salient, len(PLANES)):
        out[number] = resized(level[span])
    return out


def first_window(hw: tuple[int, ...]) -> int:
    """Side in px of the window about a click in which saliency is asked for first."""
    return window_side(hw, FIRST_WINDOW)


def salient_about(seen: WindowSaliency, pixel: Pixel, side: int) -> Float32Array:
    """H x W saliency of a window about (row, column), shifted into the picture; zeros beyond it."""
    out = np.zeros(seen.color.shape[:2], np.float32)
    window = window_around(pixel, side, out.shape)
    level = seen.level(window)
    if level is not None:
        out[window] = level
    return out


def probability_in_window(planes: Float32Array, file: NetworkFile) -> tuple[Float32Array, list[float]]:
    """SIDE x SIDE; and the probability of an object at the click (that of corrections says none): means over the planes and their
    mirror image."""
    mirrored = planes[:, :, ::-1].copy()
    mirrored[PLANES.index("right")] *= -1
    found, *objects = (1 / (1 + np.exp(-each)) for each in file.run_all({"planes": np.stack([planes, mirrored])}))
    return np.asarray((found[0] + found[1][:, ::-1]) / 2, np.float32), [float(each.mean()) for each in objects]


def object_probability(
    rgbd: RGBD, pixel: Pixel, seen: WindowSaliency | None = None, file: NetworkFile | None = None
) -> tuple[Float32Array, int, float]:
    """What the network says of a click at (row, column): H x W, probability of belonging to the object there; pixels of the
    picture for each of the network; probability that an object is there, the largest of all squares.

    seen: saliency of the picture where depth is estimated; None: depth says more, and sooner.
    """
    file = file or network(seen is not None)
    hw = rgbd.depth.shape
    radius = int(FIRST_WINDOW * max(hw) / 2)
    salient = [salient_about(seen, pixel, first_window(hw))] * len(SALIENT) if seen else []
    found, objects = probability_in_window(click_planes(rgbd, pixel, radius, salient), file)
    for number in range(2):
        side = 2 * radius + 1
        expected = next_side(found, side, max(hw))
        if number and 1 / 1.25 < expected / side < 1.25:  # another one is not worth its time
            break
        radius = int(expected / 2)
        if seen and not number:
            salient[1] = salient_about(seen, pixel, 2 * radius + 1)
        found, more = probability_in_window(click_planes(rgbd, pixel, radius, salient), file)
        objects += more
    return place_square(found, pixel, radius, hw), -(-(2 * radius + 1) // SIDE), max(objects)


def next_side(found: Float32Array, side: int, longer: int) -> float:
    """Side in px of the square about the object whose probability (SIDE x SIDE) was found in a square of `side`; half of it where
    none was found. longer: longer side of the picture."""
    part = region_at(found > 0.5, (MIDDLE, MIDDLE))
    expected = side / 2
    if part.any():
        reach = np.abs(np.argwhere(part) - (SIDE - 1) / 2).max() * side / SIDE
        expected = 3 * reach + 8  # px
    return float(np.clip(expected, SMALLEST_WINDOW, LARGEST_WINDOW * longer))


def place_square(found: Float32Array, pixel: Pixel, radius: int, hw: tuple[int, ...]) -> Float32Array:
    """H x W: SIDE x SIDE values in the square of 2 radius + 1 px about (row, column), 0 round it."""
    side = 2 * radius + 1
    large = cv2.resize(found, (side, side), interpolation=cv2.INTER_LINEAR if side >= SIDE else cv2.INTER_AREA)
    out = np.zeros(hw, np.float32)
    span = square_about(pixel, radius)
    rows, columns = (slice(max(radius - at, 0), max(radius - at, 0) + n) for at, n in zip(pixel, out[span].shape))
    out[span] = large[rows, columns]
    return out
