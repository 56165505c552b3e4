"""A depth map of COLMAP's dense workspace (`NAME.geometric.bin`) in; H x W float32 out."""

from __future__ import annotations

import re

import numpy as np

from dlama.errors import FileError, system_errors
from dlama.files.atomic_write import PathLike
from dlama.files.rasters.images import check_pixels, existing_file
from dlama.geometry.rgbd import Float32Array

HEAD = re.compile(rb"(\d{1,9})&(\d{1,9})&(\d{1,9})&")
"""Width, height, channels; then float32, little-endian, row by row."""


@system_errors(FileError)
def read_colmap_depth(path: PathLike) -> Float32Array:
    """Planar depth in the unit of the model; what is not positive is missing (0). Raises FileError."""
    file = existing_file(path)
    data = file.read_bytes()
    head = HEAD.match(data)
    if head is None:
        raise FileError(f"{file}: is no depth map of COLMAP, which begins with WIDTH&HEIGHT&CHANNELS&")
    width, height, channels = (int(one) for one in head.groups())
    if channels != 1:
        raise FileError(f"{file}: has {channels} channels; a depth map has 1")
    check_pixels(file, width, height)
    if len(data) - head.end() != 4 * width * height:
        raise FileError(
            f"{file}: holds {len(data) - head.end()} bytes; {width}x{height} pixels take {4 * width * height}"
        )
    depth = np.frombuffer(data, "<f4", offset=head.end()).reshape(height, width).astype(np.float32)
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))
