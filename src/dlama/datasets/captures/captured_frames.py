"""Readers of a picture, its depth and its confidence in; an RGBD, or the depth alone, out.

A phone's depth is small (256 x 192) and its picture large: depth is enlarged to up to four times its size in inverse depth, its
edges are moved to the picture's, and the picture is shrunk to the same size. Low confidence, and what lies beyond the range of
the sensor, is missing depth.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from dlama.datasets.posed.numbered_frames import warp_depth
from dlama.datasets.posed.posed_frames import Lens, PosedFrame, camera_at_depth, report_left_out, shrink_color
from dlama.errors import FileError, ShapeError
from dlama.files.cameras import make_camera
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.images import read_stored
from dlama.files.rasters.pictures import read_color_of_camera
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, Float32Array, UInt8Array
from dlama.perception.sharpening import sharpen_depth

MEDIUM = 1
"""ARConfidenceLevel: 0 low, 1 medium, 2 high (developer.apple.com/documentation/arkit/arconfidencelevel)."""
LIDAR_RANGE_M = 5.0
"""Beyond, depth of an iPhone's LiDAR is a guess (github.com/PolyCam/polyform)."""
MOST_ENLARGED = 4
"""Times the depth's size to which it is enlarged at most."""


@dataclass(frozen=True, eq=False)
class CaptureFiles:
    """One frame of a capture, not yet read. The functions are picklable (functools.partial of a module's function)."""

    names: tuple[str, str]
    """How messages call the picture and the depth."""
    color: Callable[[], UInt8Array]
    """H x W x 3 RGB."""
    depth: Callable[[], Float32Array]
    """h x w metres; 0, NaN and infinity are missing."""
    lens: Lens
    """Of the picture."""
    world_from_cam: Float64Array
    """4x4, camera to world, OpenCV axes, metres."""
    confidence: Callable[[], UInt8Array] | None = None
    """h x w; None: the app recorded none."""
    least_confidence: int = MEDIUM
    """Less is missing depth."""
    range_m: float = LIDAR_RANGE_M
    """Beyond is missing depth."""


def load_capture(files: CaptureFiles) -> RGBD:
    """Picture and depth at one size. Raises FileError, DepthError, CameraError, ShapeError, MissingExtraError."""
    depth, color = confident_depth(files), files.color()
    camera = camera_at_depth(files.lens, files.world_from_cam, files.names, color.shape[:2], depth.shape)
    wide = min(color.shape[1], MOST_ENLARGED * depth.shape[1])
    if wide <= depth.shape[1]:
        return RGBD(shrink_color(color, depth.shape), depth, camera)
    hw = (max(1, round(color.shape[0] * wide / color.shape[1])), wide)
    color = shrink_color(color, hw)
    return RGBD(color, enlarge_depth(depth, color), camera.resized(hw[1], hw[0]))


def load_capture_depth(files: CaptureFiles) -> tuple[Float32Array, Camera]:
    """The depth as it was recorded, and its camera; the picture is not read where its size is known."""
    depth = confident_depth(files)
    hw = files.lens.hw or files.color().shape[:2]
    return depth, camera_at_depth(files.lens, files.world_from_cam, files.names, hw, depth.shape)


def confident_depth(files: CaptureFiles) -> Float32Array:
    """h x w metres, 0 where it is missing, not confident or beyond the range."""
    depth = np.nan_to_num(files.depth(), nan=0.0, posinf=0.0, neginf=0.0)
    known = (depth > 0) & (depth <= files.range_m)
    if files.confidence is not None:
        confidence = files.confidence()
        if confidence.shape != depth.shape:
            raise ShapeError(
                f"{files.names[1]}: is {depth.shape[1]}x{depth.shape[0]} and its confidence "
                f"{'x'.join(map(str, confidence.shape[1::-1]))}; one size is expected"
            )
        known &= confidence >= files.least_confidence
    return np.where(known, depth, np.float32(0)).astype(np.float32)


def enlarge_depth(depth: Float32Array, color: UInt8Array) -> Float32Array:
    """h x w metres (0 = missing) at the picture's size (H x W x 3), edges where the picture has them; missing stays missing."""
    known, wh = depth > 0, (color.shape[1], color.shape[0])
    if not known.any():
        return np.zeros(color.shape[:2], np.float32)
    w = fill_with_nearest(inverse_depth(depth), known)
    large = sharpen_depth(np.asarray(cv2.resize(w, wh, interpolation=cv2.INTER_LINEAR), np.float32), color)
    shown = cv2.resize(known.astype(np.uint8), wh, interpolation=cv2.INTER_NEAREST) > 0
    return np.divide(1, large, out=np.zeros_like(large), where=shown & (large > 0))


def register_depth(
    read: Callable[[], Float32Array], depth_lens: Lens, lens: Lens, color_from_depth: Float64Array
) -> Float32Array:
    """Depth moved into the colour camera, at a size at which no cracks open. FileError, CameraError."""
    depth = np.nan_to_num(read(), nan=0.0, posinf=0.0, neginf=0.0)
    source, target = _camera_of(depth_lens, color_from_depth), _camera_of(lens, np.eye(4))
    factor = min(1.0, source.fx / target.fx, source.fy / target.fy)
    target = target.resized(max(1, round(target.width * factor)), max(1, round(target.height * factor)))
    return warp_depth(depth.astype(np.float32), source, target)


def _camera_of(lens: Lens, pose: Float64Array) -> Camera:
    assert lens.hw is not None
    return make_camera(lens.source, lens.hw, lens.intrinsics, lens.pixel_center, pose)


def levels_of_png(path: Path) -> UInt8Array:
    """A picture of confidence levels, h x w. FileError."""
    levels = read_stored(path).values
    if levels.ndim != 2:
        raise FileError(f"{path}: has {levels.shape[2]} channels; one of confidence levels is expected")
    return np.asarray(levels, np.uint8)


def files_by_stem(folder: Path, suffixes: Sequence[str]) -> dict[str, Path]:
    """The name without its ending -> file, of a folder that may be missing."""
    return {path.stem: path for path in folder.iterdir() if path.suffix.lower() in suffixes} if folder.is_dir() else {}


def captured_frames(scene: str, place: Path, listed: Iterable[tuple[str, CaptureFiles | str]]) -> list[PosedFrame]:
    """The frames of a recording; listed: name and files of each, or why it is left out, which a line reports.

    Raises FileError where none is kept.
    """
    frames, left_out = list[PosedFrame](), Counter[str]()
    for name, files in listed:
        if isinstance(files, str):
            left_out[files] += 1
        else:
            load, depth = partial(load_capture, files), partial(load_capture_depth, files)
            frames.append(PosedFrame(scene, name, load, world_from_cam=files.world_from_cam, load_depth=depth))
    report_left_out(place, frames, len(frames) + left_out.total(), left_out)
    return frames


def files_of_capture(
    color: Path, depth: Path, lens: Lens, pose: Float64Array, confidence: Path | None, least: int = MEDIUM
) -> CaptureFiles:
    """A frame of a picture file, a depth file and, where the app recorded it, one of confidence."""
    levels = None if confidence is None else partial(levels_of_png, confidence)
    names = str(color), str(depth)
    return CaptureFiles(
        names, partial(read_color_of_camera, color), partial(read_depth, depth), lens, pose, levels, least
    )
