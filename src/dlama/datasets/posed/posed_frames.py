"""The colour and the depth file of a pinhole camera at a pose in; an RGBD, or its depth alone, out."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np

from dlama.datasets.frames import Frame
from dlama.datasets.posed.lenses import Lens
from dlama.errors import CameraError, FileError, InputError, ShapeError, check_same_size, format_size
from dlama.files.rasters.depth import check_positive, read_depth
from dlama.files.rasters.float_files import read_colmap_depth
from dlama.files.rasters.images import picture_hw, read_stored
from dlama.files.rasters.pictures import read_color_of_camera
from dlama.files.rasters.turned_pairs import same_proportions
from dlama.files.rgbd import fit_depth
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.missing_depth import densify
from dlama.perception.resampling import shrink_color

LOG = logging.getLogger("dlama")
MEDIUM = 1
"""ARConfidenceLevel: 0 low, 1 medium, 2 high (developer.apple.com/documentation/arkit/arconfidencelevel)."""
LIDAR_RANGE_M = 5.0
"""Beyond, depth of an iPhone's LiDAR is a guess (github.com/PolyCam/polyform)."""
MOST_ENLARGED = 4
"""Times the depth's size to which depth of a phone or a depth camera is enlarged at most."""


@dataclass(frozen=True, eq=False)
class FrameFiles:
    """A picture and its depth of one pinhole camera, not yet read. Its functions are picklable (functools.partial)."""

    names: tuple[str, str]
    """How messages call the picture and the depth."""
    color: Callable[[], UInt8Array]
    """H x W x 3 RGB."""
    depth: Callable[[], Float32Array]
    """h x w metres; 0 and NaN are missing."""
    lens: Lens
    """Of the picture."""
    world_from_cam: Float64Array
    """4x4, camera to world, OpenCV axes, metres."""
    color_hw: Callable[[], tuple[int, int]] | None = None
    """(H, W), where that is known without reading the picture."""
    confidence: Callable[[], UInt8Array] | None = None
    """h x w; None: none was recorded."""
    least_confidence: int = 0
    """Less is missing depth."""
    range_m: float = np.inf
    """Beyond is missing depth, but for far pixels."""
    enlarged: int = 1
    """Times its own size to which depth is enlarged at most, where the picture is larger, which is shrunk to that."""
    resize_depth: Literal["guided", "nearest"] | None = None
    """Depth is enlarged to the picture's size, as of `read_rgbd`."""
    has_far: bool = False
    """True: infinite depth is far, as in our own files; False: missing, as sensors mean it."""
    shown: Callable[[], BoolArray] | None = None
    """H x W of the picture, False where it shows nothing of the scene; None: it shows it everywhere."""


Listed = Iterator[tuple[str, FrameFiles | str]]
"""Name and files of each frame, or why it is left out."""


def files_of(
    color: Path, depth: Path, lens: Lens, pose: Float64Array, units: float = 1000.0, has_far: bool = False
) -> FrameFiles:
    """Of a picture file and a depth file with so many units a metre; pose: 4x4, camera to world, OpenCV axes, metres."""
    of_colmap = depth.suffix == ".bin"
    read = partial(read_colmap_depth, depth) if of_colmap else partial(read_depth, depth, depth_scale=units)
    read_color, hw = partial(read_color_of_camera, color), partial(picture_hw, color)
    return FrameFiles((str(color), str(depth)), read_color, read, lens, pose, hw, has_far=has_far)


lidar_frame = partial(FrameFiles, least_confidence=MEDIUM, range_m=LIDAR_RANGE_M, enlarged=MOST_ENLARGED)
"""One frame of a phone with a LiDAR, whose depth is small (256 x 192) and its picture large: depth is enlarged, guided by the
picture. Low confidence, and what lies beyond the range of the sensor, is missing depth."""


def files_of_capture(
    color: Path, depth: Path, lens: Lens, pose: Float64Array, confidence: Path | None, least: int = MEDIUM
) -> FrameFiles:
    """A phone's frame of a picture file, a depth file and, where the app recorded it, one of confidence."""
    files = files_of(color, depth, lens, pose)
    levels = None if confidence is None else partial(levels_of_png, confidence)
    return replace(files, confidence=levels, least_confidence=least, range_m=LIDAR_RANGE_M, enlarged=MOST_ENLARGED)


def levels_of_png(path: Path) -> UInt8Array:
    """A picture of confidence levels, h x w. FileError."""
    levels = read_stored(path).values
    if levels.ndim != 2:
        raise FileError(f"{path}: has {levels.shape[2]} channels; one of confidence levels is expected")
    return np.asarray(levels, np.uint8)


@dataclass(frozen=True, eq=False)
class PosedFrame(Frame):
    """A frame whose pose is known before its pictures are read. All frames of a scene share one world."""

    files: FrameFiles = field(kw_only=True)

    @property
    def world_from_cam(self) -> Float64Array:
        """4x4, camera to world, OpenCV axes, metres."""
        return self.files.world_from_cam

    def load_depth(self) -> tuple[Float32Array, Camera]:
        """The depth as it was recorded (h x w metres), and its camera; the picture is not read where its size is known."""
        depth = measured_depth(self.files)
        return depth, _camera(self.files, size_of_picture(self.files), depth.shape)


def posed_frame(scene: str, name: str, files: FrameFiles, yaw: float | None = None) -> PosedFrame:
    """A frame whose pixels are read when they are needed."""
    return PosedFrame(scene, name, partial(load_rgbd, files), yaw, files=files)


def posed_frames(scene: str, place: Path, listed: Listed, **reading: Any) -> list[PosedFrame]:
    """The frames of a scene, without those that are left out, which a line reports; reading: as of `read_otherwise`.

    Raises FileError where none is kept.
    """
    frames, left_out = list[PosedFrame](), Counter[str]()
    for name, files in listed:
        if isinstance(files, str):
            left_out[files] += 1
        else:
            frames.append(posed_frame(scene, name, read_otherwise(files, **reading)))
    count, reasons = len(frames) + left_out.total(), ", ".join(f"{left_out[why]} {why}" for why in left_out)
    if not frames:
        raise FileError(f"{place}: none of its {count} frames can be used" + (f" ({reasons})" if reasons else ""))
    if reasons:
        LOG.warning("%s: %d of %d frames are left out (%s)", place, left_out.total(), count, reasons)
    return frames


def read_otherwise(
    files: FrameFiles,
    *,
    depth_scale: float | None = None,
    max_depth: float | None = None,
    resize_depth: Literal["guided", "nearest"] | None = None,
) -> FrameFiles:
    """With other units per metre, range of depth (metres) or size of it than the layout's. InputError where that cannot be."""
    check_positive(depth_scale=depth_scale, max_depth=max_depth)
    if depth_scale is not None:
        read = files.depth
        if not (isinstance(read, partial) and read.func is read_depth):
            raise InputError(f"`depth_scale` does not apply to {files.names[1]}, which has a unit of its own")
        files = replace(files, depth=partial(read, depth_scale=depth_scale))
    return replace(files, range_m=max_depth or files.range_m, resize_depth=resize_depth)


def load_rgbd(files: FrameFiles) -> RGBD:
    """Picture and depth at one size (`size_of_frame`); the picture is shrunk to it by area means.

    Between single readings, as of a LIDAR, depth is filled along colours (`densify`).

    Raises FileError, DepthError, CameraError, ShapeError, MissingExtraError.
    """
    depth, color = measured_depth(files), files.color()
    camera, hw = _camera(files, color.shape[:2], depth.shape), size_of_frame(files, color.shape, depth.shape)
    padding, color = _padding(files, color.shape, hw), shrink_color(color, hw)
    if files.resize_depth is None and hw == depth.shape:
        return densify(RGBD(color, depth, camera, padding=padding))
    fitted = fit_depth(*files.names, depth, color, files.resize_depth or "guided")
    found = RGBD(color, fitted, camera.resized(hw[1], hw[0]), padding=padding)
    return densify(found) if hw == depth.shape else found


def size_of_frame(files: FrameFiles, color_hw: tuple[int, ...], depth_hw: tuple[int, ...]) -> tuple[int, int]:
    """(H, W) of a frame: that of its depth, or the one that is enlarged to."""
    height, width = color_hw[:2]
    if files.resize_depth is not None:
        return height, width
    wide = min(width, files.enlarged * depth_hw[1])
    return (depth_hw[0], depth_hw[1]) if wide <= depth_hw[1] else (max(1, round(height * wide / width)), wide)


def _padding(files: FrameFiles, hw: tuple[int, ...], small: tuple[int, ...]) -> BoolArray | None:
    """At the size `small`, True where a part of a pixel shows nothing of the scene; ShapeError: a mask of another size."""
    if files.shown is None:
        return None
    shown = files.shown()
    check_same_size(f"{files.names[0]}:", hw, "its mask", shown.shape)
    return np.asarray(cv2.resize(shown.astype(np.float32), (small[1], small[0]), interpolation=cv2.INTER_AREA) < 1)


def size_of_picture(files: FrameFiles) -> tuple[int, int]:
    """(H, W); the picture is read where nothing else says it."""
    height, width = files.color_hw() if files.color_hw is not None else files.lens.hw or files.color().shape[:2]
    return height, width


def measured_depth(files: FrameFiles) -> Float32Array:
    """h x w metres, 0 where it is missing, not confident or beyond the range."""
    depth, known, beyond = _readings(files)
    return np.where(known & ~beyond, depth, np.float32(0)).astype(np.float32)


def count_readings(files: FrameFiles) -> tuple[int, int]:
    """How many confident readings the depth of a frame has, and how many of them lie beyond the range."""
    _, known, beyond = _readings(files)
    return int(known.sum()), int((known & beyond).sum())


def _readings(files: FrameFiles) -> tuple[Float32Array, BoolArray, BoolArray]:
    """The depth as it is stored, h x w, which of it is known, and what is beyond the range."""
    depth = files.depth()
    known, far = depth > 0, depth == np.inf
    if not files.has_far:
        known &= ~far
    if files.confidence is not None:
        confidence = files.confidence()
        check_same_size(f"{files.names[1]}:", depth.shape, "its confidence", confidence.shape)
        known &= confidence >= files.least_confidence
    return depth, known, (depth > files.range_m) & ~far


def _camera(files: FrameFiles, color_hw: tuple[int, ...], depth_hw: tuple[int, ...]) -> Camera:
    """The camera at the depth's size; ShapeError, with the names of picture and depth, for sizes that cannot belong together,
    CameraError where sensor and picture differ in proportions, so that the crop is not known."""
    lens, names = files.lens, files.names
    if lens.hw is not None and lens.scales:
        if not same_proportions(color_hw, lens.hw):
            raise CameraError(
                f"{lens.source}: the sensor is {format_size(lens.hw)} and the picture {format_size(color_hw)}; both must have "
                "the same proportions, else how wide the camera sees is not known"
            )
    elif lens.hw is not None and lens.hw != tuple(color_hw):
        raise ShapeError(
            f"{names[0]}: is {format_size(color_hw)}, and {lens.source} is for {format_size(lens.hw)}; "
            "both must be the same"
        )
    if color_hw[0] < depth_hw[0] or color_hw[1] < depth_hw[1] or not same_proportions(color_hw, depth_hw):
        raise ShapeError(
            f"{names[0]}: is {format_size(color_hw)} and {names[1]} {format_size(depth_hw)}; colour of the "
            "same size, or bigger with the same proportions, is expected"
        )
    return lens.camera(files.world_from_cam, color_hw).resized(depth_hw[1], depth_hw[0])
