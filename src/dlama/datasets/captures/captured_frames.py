"""Readers of a picture, its depth and its confidence, frame by frame, in; the posed frames of a recording out.

A phone's depth is small (256 x 192) and its picture large: depth is enlarged to up to four times its size in inverse depth, its
edges are moved to the picture's, and the picture is shrunk to the same size. Low confidence, and what lies beyond the range of
the sensor, is missing depth.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from dlama.datasets.posed.posed_frames import FrameFiles, Lens, PosedFrame, posed_frame, report_left_out
from dlama.errors import FileError
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.images import read_stored
from dlama.files.rasters.pictures import read_color_of_camera
from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import Float32Array, UInt8Array

MEDIUM = 1
"""ARConfidenceLevel: 0 low, 1 medium, 2 high (developer.apple.com/documentation/arkit/arconfidencelevel)."""
LIDAR_RANGE_M = 5.0
"""Beyond, depth of an iPhone's LiDAR is a guess (github.com/PolyCam/polyform)."""
MOST_ENLARGED = 4
"""Times the depth's size to which it is enlarged at most."""


def capture_files(
    names: tuple[str, str],
    color: Callable[[], UInt8Array],
    depth: Callable[[], Float32Array],
    lens: Lens,
    pose: Float64Array,
    confidence: Callable[[], UInt8Array] | None = None,
    least: int = MEDIUM,
    range_m: float = LIDAR_RANGE_M,
) -> FrameFiles:
    """One frame of a recording, as `FrameFiles` has it; depth is a phone's LiDAR's unless `range_m` says otherwise."""
    return FrameFiles(names, color, depth, lens, pose, None, confidence, least, range_m, MOST_ENLARGED)


def levels_of_png(path: Path) -> UInt8Array:
    """A picture of confidence levels, h x w. FileError."""
    levels = read_stored(path).values
    if levels.ndim != 2:
        raise FileError(f"{path}: has {levels.shape[2]} channels; one of confidence levels is expected")
    return np.asarray(levels, np.uint8)


def files_by_stem(folder: Path, suffixes: Sequence[str]) -> dict[str, Path]:
    """The name without its ending -> file, of a folder that may be missing."""
    return {path.stem: path for path in folder.iterdir() if path.suffix.lower() in suffixes} if folder.is_dir() else {}


def captured_frames(scene: str, place: Path, listed: Iterable[tuple[str, FrameFiles | str]]) -> list[PosedFrame]:
    """The frames of a recording; listed: name and files of each, or why it is left out, which a line reports.

    Raises FileError where none is kept.
    """
    frames, left_out = list[PosedFrame](), Counter[str]()
    for name, files in listed:
        if isinstance(files, str):
            left_out[files] += 1
        else:
            frames.append(posed_frame(scene, name, files))
    report_left_out(place, frames, len(frames) + left_out.total(), left_out)
    return frames


def files_of_capture(
    color: Path, depth: Path, lens: Lens, pose: Float64Array, confidence: Path | None, least: int = MEDIUM
) -> FrameFiles:
    """A frame of a picture file, a depth file and, where the app recorded it, one of confidence."""
    levels = None if confidence is None else partial(levels_of_png, confidence)
    names = str(color), str(depth)
    return capture_files(
        names, partial(read_color_of_camera, color), partial(read_depth, depth), lens, pose, levels, least
    )
