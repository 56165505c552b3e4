"""Views and a camera in; whether each may be visible there, by its points' bounding box, out."""

from __future__ import annotations

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.frames.stored import Layer
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import BoolArray

MARGIN = 0.05
"""Margin of the frustum, over the picture's size: rims are drawn a little larger."""
_corners: WeakKeyDictionary[Layer, Float64Array | None] = WeakKeyDictionary()


def may_show(layer: Layer, camera: Camera) -> bool:
    """False where nothing of a view can be seen from a camera. Its pixels are read once, the box of its points is kept."""
    if layer not in _corners:
        view = layer.load()
        points = lift(view).points
        ends = np.stack([points.min(0), points.max(0)]) if len(points) else np.zeros((2, 0))
        _corners[layer] = None if view.far.any() else box_corners(ends)
    corners = _corners[layer]
    return corners is None or (len(corners) > 0 and bool(intersects_view(corners[None], camera)[0]))


def box_corners(ends: Float64Array) -> Float64Array:
    """8 x 3, the corners of the box between two points (2 x 3); 0 x 3 of none."""
    if ends.shape[1] == 0:
        return np.zeros((0, 3))
    return np.stack(np.meshgrid(*ends.T, indexing="ij"), -1).reshape(8, 3)


def intersects_view(corners: Float64Array, camera: Camera) -> BoolArray:
    """N, False for boxes (N x 8 x 3, corners in the world) entirely outside the camera's frustum."""
    pose = camera.world_from_cam
    local = (corners - pose[:3, 3]) @ pose[:3, :3]
    x, y, z = np.moveaxis(local, -1, 0)
    wide, high = MARGIN * camera.width, MARGIN * camera.height
    sides = (
        z,
        x * camera.fx + (camera.cx + wide) * z,
        (camera.width + wide - camera.cx) * z - x * camera.fx,
        y * camera.fy + (camera.cy + high) * z,
        (camera.height + high - camera.cy) * z - y * camera.fy,
    )
    with np.errstate(invalid="ignore"):
        return np.asarray(np.all([(side >= 0).any(1) for side in sides], axis=0))


def bounding_boxes(parts: Sequence[Float64Array]) -> Float64Array:
    """N x 8 x 3, the boxes that hold N sets of points (M x 3 each); NaN for no points, which are in no view."""
    empty = np.full((8, 3), np.nan)
    return np.stack([box_corners(np.stack([p.min(0), p.max(0)])) if len(p) else empty for p in parts])
