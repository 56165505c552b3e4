"""Depth of one camera in; the same as the colour camera next to it sees it out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dlama.datasets.posed.posed_frames import Lens
from dlama.files.cameras import make_camera
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.projection import project, unproject
from dlama.geometry.rgbd import Float32Array


def register_depth(
    read: Callable[[], Float32Array], depth_lens: Lens, lens: Lens, color_from_depth: Float64Array
) -> Float32Array:
    """Depth moved into the colour camera, at a size at which no cracks open. FileError, CameraError."""
    depth = np.nan_to_num(read(), nan=0.0, posinf=0.0, neginf=0.0)
    source, target = _camera_of(depth_lens, color_from_depth), _camera_of(lens, np.eye(4))
    source = source.resized(depth.shape[1], depth.shape[0])
    factor = min(1.0, source.fx / target.fx, source.fy / target.fy)
    target = target.resized(max(1, round(target.width * factor)), max(1, round(target.height * factor)))
    return warp_depth(depth.astype(np.float32), source, target)


def _camera_of(lens: Lens, pose: Float64Array) -> Camera:
    assert lens.hw is not None
    return make_camera(lens.source, lens.hw, lens.intrinsics, lens.pixel_center, pose)


def warp_depth(depth: Float32Array, source: Camera, target: Camera) -> Float32Array:
    """Depth as seen from another camera close by: each reading goes to the pixel it falls into, the nearest wins.

    H x W of the target, 0 where nothing fell. Fit for a target with the shorter focal length, where no cracks open.
    """
    rows, columns = np.nonzero(depth)
    pixels, seen_at = project(unproject(source, columns + 0.5, rows + 0.5, depth[rows, columns]), target)
    inside = (pixels >= 0).all(1) & (pixels[:, 0] < target.width) & (pixels[:, 1] < target.height)
    flat = pixels[inside].astype(np.intp) @ (1, target.width)
    out = np.full(target.height * target.width, np.inf, np.float32)
    np.minimum.at(out, flat, seen_at[inside].astype(np.float32))
    out[np.isinf(out)] = 0
    return out.reshape(target.hw)
