"""Known surfaces of a coarse grid in; each cell's distance to them, in cells or as an angle, out."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.visibility import Law

CHORD = 25.0
"""Geometric mean of a solid plane's mean visible runs along rows and columns, in cells, at least."""
FAR_SAMPLES = 256
"""Number of far directions that represent a source camera's."""


def mean_chords(there: BoolArray) -> tuple[float, float]:
    """Mean length of the runs of True along columns and along rows of an h x w grid, over the cells in them."""
    chords = []
    for lines in (there.T, there):
        apart = np.zeros((len(lines), lines.shape[1] + 1), np.bool_)  # one run ends where another line begins
        apart[:, 1:] = lines
        ends = np.flatnonzero(np.diff(apart.ravel(), append=False))
        length = (ends[1::2] - ends[::2]).astype(np.float64)
        chords.append(float((length**2).sum() / max(length.sum(), 1)))
    return chords[0], chords[1]


def angle_to_far(camera: Camera, law: Law) -> Float32Array:
    """H x W radians between each pixel's direction and the nearest direction in which a source camera saw far pixels."""
    directions = rays(camera) @ camera.world_from_cam[:3, :3].T
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    nearest = np.full(camera.hw, -1.0)
    for source, measured in law.measured:
        places = np.flatnonzero(np.isposinf(measured))
        rows, columns = np.divmod(places[:: max(1, len(places) // FAR_SAMPLES)], source.width)
        x, y = (columns + 0.5 - source.cx) / source.fx, (rows + 0.5 - source.cy) / source.fy
        far = np.stack([x, y, np.ones(len(x))], 1) @ source.world_from_cam[:3, :3].T
        far /= np.linalg.norm(far, axis=1, keepdims=True)
        for block in range(0, len(far), 32):
            np.maximum(nearest, (directions @ far[block : block + 32].T).max(2), out=nearest)
    return np.arccos(np.clip(nearest, -1, 1)).astype(np.float32)


def enlarge(values: Float32Array, wh: tuple[int, int]) -> Float32Array:
    """A coarse picture bilinearly enlarged to the view."""
    return np.asarray(
        cv2.resize(np.ascontiguousarray(values, np.float32), wh, interpolation=cv2.INTER_LINEAR), np.float32
    )
