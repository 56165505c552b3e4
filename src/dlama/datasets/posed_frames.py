"""The colour and the depth file of one pinhole camera at a pose in; an RGBD, or only its depth, out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlama.errors import ShapeError
from dlama.files.cameras import checked_camera
from dlama.files.checked_fields import Intrinsics
from dlama.files.depth import read_depth
from dlama.files.images import picture_hw
from dlama.files.pictures import read_color
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.rgbd import RGBD, Float32Array, UInt8Array

SAME_PROPORTIONS = 0.02
"""Relative difference of width / height up to which colour and depth of two sizes show the same field of view."""


@dataclass(frozen=True)
class Lens:
    """Intrinsics as a file says them, before any picture was opened."""

    source: str
    """The file or option they come from, for messages."""
    intrinsics: Intrinsics
    """fx, fy, cx, cy of the colour picture, px."""
    pixel_center: float
    """Where they put the first pixel's centre: 0.5 or 0.0."""
    hw: tuple[int, int] | None = None
    """The picture size they are for; None: whatever the picture has."""


@dataclass(frozen=True, eq=False)
class FrameFiles:
    """Colour and depth of one pinhole camera, not yet read."""

    color: Path
    depth: Path
    lens: Lens
    world_from_cam: Float64Array
    depth_scale: float = 1000.0
    """Units per metre."""
    far_code: bool = False
    """True: 65535 in 16-bit depth, and infinity, is far, as in our own files; False: missing, as sensors mean it."""


def load_rgbd(files: FrameFiles) -> RGBD:
    """Read both. Colour bigger than depth is brought to depth's size by area means, and the camera with it.

    Raises FileError, DepthError, CameraError, ShapeError.
    """
    depth = _metres(files)
    color = read_color(files.color)
    camera = _camera(files, color.shape[:2], depth.shape)
    return RGBD(_shrunk(color, depth.shape), depth, camera)


def load_depth(files: FrameFiles) -> tuple[Float32Array, Camera]:
    """The depth of `load_rgbd` and its camera; of the colour only the size is read."""
    depth = _metres(files)
    return depth, _camera(files, picture_hw(files.color), depth.shape)


def _metres(files: FrameFiles) -> Float32Array:
    depth = read_depth(files.depth, depth_scale=files.depth_scale)
    if not files.far_code:
        depth[np.isposinf(depth)] = 0
    return depth


def _camera(files: FrameFiles, color_hw: tuple[int, ...], depth_hw: tuple[int, ...]) -> Camera:
    """The camera at the depth's size; refuses sizes that cannot belong together."""
    lens = files.lens
    if lens.hw is not None and lens.hw != tuple(color_hw):
        raise ShapeError(
            f"{files.color}: is {color_hw[1]}x{color_hw[0]}, and {lens.source} is for {lens.hw[1]}x{lens.hw[0]}; "
            "both must be the same"
        )
    proportions = color_hw[1] / color_hw[0] * depth_hw[0] / depth_hw[1]
    if color_hw[0] < depth_hw[0] or color_hw[1] < depth_hw[1] or abs(proportions - 1) > SAME_PROPORTIONS:
        raise ShapeError(
            f"{files.color}: is {color_hw[1]}x{color_hw[0]} and {files.depth} {depth_hw[1]}x{depth_hw[0]}; colour of the "
            "same size, or bigger with the same proportions, is wanted"
        )
    hw = color_hw[0], color_hw[1]
    camera = checked_camera(lens.source, hw, lens.intrinsics, lens.pixel_center, files.world_from_cam)
    return camera.resized(depth_hw[1], depth_hw[0])


def _shrunk(color: UInt8Array, hw: tuple[int, ...]) -> UInt8Array:
    if color.shape[:2] == tuple(hw):
        return color
    import cv2

    return np.asarray(cv2.resize(color, (hw[1], hw[0]), interpolation=cv2.INTER_AREA), np.uint8)
