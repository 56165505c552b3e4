"""Depth of one camera in; the same as the colour camera next to it sees it out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dlama.datasets.posed.lenses import Lens
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.projection import project_to_pixels, unproject
from dlama.geometry.rgbd import Float32Array


def register_depth(
    read: Callable[[], Float32Array], depth_lens: Lens, lens: Lens, color_from_depth: Float64Array
) -> Float32Array:
    """Depth moved into the colour camera, at a size at which no cracks open. FileError, CameraError."""
    depth = np.nan_to_num(read(), nan=0.0, posinf=0.0, neginf=0.0)
    source, target = depth_lens.camera(color_from_depth), lens.camera(np.eye(4))
    source = source.resized(depth.shape[1], depth.shape[0])
    factor = min(1.0, source.fx / target.fx, source.fy / target.fy)
    target = target.resized(max(1, round(target.width * factor)), max(1, round(target.height * factor)))
    return warp_depth(depth.astype(np.float32), source, target)


def warp_depth(depth: Float32Array, source: Camera, target: Camera) -> Float32Array:
    """Depth as seen from another camera close by: each reading goes to the pixel it falls into, the nearest wins.

    H x W of the target, 0 where nothing fell. Fit for a target with the shorter focal length, where no cracks open.
    """
    rows, columns = np.nonzero(depth)
    points = unproject(source, columns + 0.5, rows + 0.5, depth[rows, columns])
    y, x, z, inside = project_to_pixels(points, target)
    out = np.full(target.hw, np.inf, np.float32)
    np.minimum.at(out, (y[inside], x[inside]), z[inside].astype(np.float32))
    return np.where(np.isinf(out), np.float32(0), out)
