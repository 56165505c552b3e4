"""Readers of a picture, its depth and its confidence in; one frame of a phone's recording out.

A phone's depth is small (256 x 192) and its picture large: depth is enlarged to up to four times its size, guided by the picture
(`upsample_depth`), which is shrunk to the same size. Low confidence, and what lies beyond the range of the sensor, is missing
depth.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from dlama.datasets.posed.lenses import Lens
from dlama.datasets.posed.posed_frames import FrameFiles
from dlama.errors import FileError
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.images import read_stored
from dlama.files.rasters.pictures import read_color_of_camera
from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import UInt8Array

MEDIUM = 1
"""ARConfidenceLevel: 0 low, 1 medium, 2 high (developer.apple.com/documentation/arkit/arconfidencelevel)."""
LIDAR_RANGE_M = 5.0
"""Beyond, depth of an iPhone's LiDAR is a guess (github.com/PolyCam/polyform)."""
MOST_ENLARGED = 4
"""Times the depth's size to which it is enlarged at most."""

lidar_frame = partial(FrameFiles, least_confidence=MEDIUM, range_m=LIDAR_RANGE_M, enlarged=MOST_ENLARGED)
"""One frame of a phone with a LiDAR."""


def levels_of_png(path: Path) -> UInt8Array:
    """A picture of confidence levels, h x w. FileError."""
    levels = read_stored(path).values
    if levels.ndim != 2:
        raise FileError(f"{path}: has {levels.shape[2]} channels; one of confidence levels is expected")
    return np.asarray(levels, np.uint8)


def files_of_capture(
    color: Path, depth: Path, lens: Lens, pose: Float64Array, confidence: Path | None, least: int = MEDIUM
) -> FrameFiles:
    """A frame of a picture file, a depth file and, where the app recorded it, one of confidence."""
    levels = None if confidence is None else partial(levels_of_png, confidence)
    reading = partial(read_color_of_camera, color), partial(read_depth, depth)
    return lidar_frame((str(color), str(depth)), *reading, lens, pose, confidence=levels, least_confidence=least)
