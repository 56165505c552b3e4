"""Views and a camera in; whether each may be visible there, by its points' bounding box, out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.frames.stored import Layer
from dlama.geometry.once import once
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import BoolArray

MARGIN = 0.05
"""Margin of the frustum, over the picture's size: rims are drawn a little larger."""


@once
def box_of(layer: Layer) -> Float64Array | None:
    """8 x 3, the corners of the box that holds a view's points (NaN where there are none); None: far pixels are in no box."""
    view = layer.load()
    return None if view.far.any() else bounding_boxes([lift(view).points])[0]


def may_show(layer: Layer, camera: Camera) -> bool:
    """False where nothing of a view can be seen from a camera. Its pixels are read once, the box of its points is kept."""
    box = box_of(layer)
    return box is None or bool(intersects_view(box[None], camera)[0])


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
    boxes = np.full((len(parts), 8, 3), np.nan)
    for box, points in zip(boxes, parts):
        if len(points):
            ends = zip(points.min(0), points.max(0))
            box[:] = np.stack(np.meshgrid(*ends, indexing="ij"), -1).reshape(8, 3)
    return boxes
