"""A frame in; its measured depth in blocks of pixels, small enough to hold that of a thousand frames, out."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.codes import from_source
from dlama.geometry.frames.stored import Layer
from dlama.geometry.once import once
from dlama.geometry.rgbd import Float32Array

BLOCK = 8
"""px."""


@once
def coarse_depth(layer: Layer) -> Float32Array:
    """The nearest depth measured in each block of pixels, ceil(H / BLOCK) x ceil(W / BLOCK) metres; computed once.

    0 where a pixel of the block has none, inf = far.
    """
    view = layer.load()
    depth = np.where(from_source(view.origin) & ~view.hole, view.depth, np.float32(0))
    rows, columns = (-size % BLOCK for size in depth.shape)
    padded = np.pad(depth, ((0, rows), (0, columns)))
    blocks = padded.reshape(padded.shape[0] // BLOCK, BLOCK, padded.shape[1] // BLOCK, BLOCK)
    return np.asarray(blocks.min((1, 3)), np.float32)


def coarse_camera(camera: Camera) -> Camera:
    """The camera whose pixels are those blocks."""
    width, height = (-(-size // BLOCK) for size in camera.wh)
    lens = {name: getattr(camera, name) / BLOCK for name in ("fx", "fy", "cx", "cy")}
    return dataclasses.replace(camera, width=width, height=height, **lens)
