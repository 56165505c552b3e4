"""Posed frames in, made small; points of one that reproject to another at its measured depth, and their colour agreement, out."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.motion.poses import transform_points
from dlama.geometry.projection import project_to_pixels, rays
from dlama.geometry.rgbd import RGBD, Float32Array, is_valid

LANDS_WITHIN = 0.04
"""Largest relative difference of depth of a point that lands."""
FEWEST = 25
"""Least number of landed points."""
LEAST_FIT = 0.12
"""Least agreement (1: every point lands, colours agree fully) of two frames with a fault mended,"""
LEAST_LEAD = 1.3
"""and least gain over the frames as read. Of an odd frame without a fault at most 1.05 (89 real frames, 52 of streets, 60 of
worlds); with one 1.48."""


class SmallFrame(NamedTuple):
    """A frame made small, and some of its points."""

    points: Float64Array
    """N x 3 m, camera axes."""
    brightness: Float64Array
    """N grey levels of the points."""
    depth: Float32Array
    """h x w m."""
    grey: Float32Array
    """h x w grey levels."""
    camera: Camera
    """Of the small pictures."""


class Landed(NamedTuple):
    """Points of one frame that reproject to another at its measured depth."""

    share: float
    """Of all points."""
    first: Float64Array
    """Their grey levels,"""
    second: Float64Array
    """and those measured where they land."""

    @property
    def gain(self) -> float:
        """Brightness of the second over the first."""
        return brightness_ratio(self.first, self.second)

    @property
    def fit(self) -> float:
        """The share, times the correlation of the grey levels (0 where negative)."""
        if len(self.first) < FEWEST or min(self.first.std(), self.second.std()) == 0:
            return 0.0
        return self.share * max(float(np.corrcoef(self.first, self.second)[0, 1]), 0.0)


def brightness_ratio(first: NDArray[Any], second: NDArray[Any]) -> float:
    """How many times as bright the second grey levels are."""
    return float((np.median(second) + 1) / (np.median(first) + 1))


def shrink(frame: RGBD) -> SmallFrame:
    """Every n-th depth, and the mean grey around it, in about 240 pixels across; at most 2000 points."""
    hw = frame.depth.shape
    step = max(1, min(round(max(hw) / 240), *hw))
    h, w = (n // step for n in hw)
    depth = np.array(frame.depth[step // 2 :: step, step // 2 :: step][:h, :w])
    grey = cv2.cvtColor(np.ascontiguousarray(frame.color[: h * step, : w * step]), cv2.COLOR_RGB2GRAY)
    means = np.asarray(cv2.resize(grey.astype(np.float32), (w, h), interpolation=cv2.INTER_AREA), np.float32)
    camera = frame.camera.cropped(0, 0, w * step, h * step).resized(w, h)
    known = np.flatnonzero(is_valid(depth))
    chosen = known[np.linspace(0, len(known) - 1, min(len(known), 2000)).astype(np.intp)]
    points = rays(camera).reshape(-1, 3)[chosen] * depth.ravel()[chosen, None]
    return SmallFrame(points, means.ravel()[chosen].astype(np.float64), depth, means, camera)


def find_landing_points(one: SmallFrame, other: SmallFrame) -> Landed:
    """Points of one frame that land in the other."""
    z, depth, first, second = reproject(one, other)
    lands = np.abs(depth - z) < LANDS_WITHIN * z
    return Landed(float(lands.sum() / max(len(one.points), 1)), first[lands], second[lands])


def reproject(one: SmallFrame, other: SmallFrame) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array]:
    """Depth and grey level of one frame's points that reproject to a pixel of the other with depth: (own, measured there) of
    each."""
    points = transform_points(one.camera.world_from_cam, one.points)
    rows, columns, z, inside = project_to_pixels(points, other.camera)
    depth, grey = (plane[rows, columns].astype(np.float64) for plane in (other.depth, other.grey))
    known = inside & is_valid(depth)
    return z[known], depth[known], one.brightness[known], grey[known]
