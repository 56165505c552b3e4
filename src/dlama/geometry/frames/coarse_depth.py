"""A frame in; its measured depth in blocks of pixels, small enough to hold that of a thousand frames, out."""

from __future__ import annotations

import dataclasses
from weakref import WeakKeyDictionary

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.codes import from_source
from dlama.geometry.rgbd import Float32Array
from dlama.geometry.view import View

BLOCK = 8
"""px."""
_depths: WeakKeyDictionary[View, Float32Array] = WeakKeyDictionary()


def coarse_depth(view: View) -> Float32Array:
    """The nearest depth measured in each block of pixels, ceil(H / BLOCK) x ceil(W / BLOCK) metres; computed once.

    0 where a pixel of the block has none, inf = far.
    """
    if view not in _depths:
        whole = view.read()
        depth = np.where(from_source(whole.origin) & ~whole.hole, whole.depth, np.float32(0))
        rows, columns = (-size % BLOCK for size in depth.shape)
        padded = np.pad(depth, ((0, rows), (0, columns)))
        blocks = padded.reshape(padded.shape[0] // BLOCK, BLOCK, padded.shape[1] // BLOCK, BLOCK)
        _depths[view] = np.asarray(blocks.min((1, 3)), np.float32)
    return _depths[view]


def coarse_camera(camera: Camera) -> Camera:
    """The camera whose pixels are those blocks."""
    width, height = (-(-size // BLOCK) for size in camera.wh)
    lens = {name: getattr(camera, name) / BLOCK for name in ("fx", "fy", "cx", "cy")}
    return dataclasses.replace(camera, width=width, height=height, **lens)
