"""The colour and the depth file of a pinhole camera at a pose in; an RGBD, or its depth alone, out.

The camera's intrinsics (`Lens`) come from the option `camera`, or from a camera file that lies with the data set.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from dlama.datasets.frames import Frame
from dlama.datasets.text_tables import check_size, read_matrix, read_rows
from dlama.errors import CameraError, FileError, InputError, ShapeError, format_size
from dlama.files.camera_yaml import SUFFIXES, read_yaml_fields
from dlama.files.cameras import make_camera, read_camera
from dlama.files.fields import FileFields, Intrinsics, read_json_fields
from dlama.files.rasters.depth import check_depth_options, read_depth
from dlama.files.rasters.float_files import read_colmap_depth
from dlama.files.rasters.images import picture_hw
from dlama.files.rasters.pictures import read_color_of_camera
from dlama.files.rasters.turned_pairs import same_proportions
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.missing_depth.between_readings import densify
from dlama.perception.resampling import shrink_color, upsample_depth
from dlama.writing.atomic_write import PathLike

CameraOption = PathLike | Camera | None
"""The option `camera` of layouts whose files may say nothing of intrinsics: a camera file, or a Camera (its pose is not used)."""
LOG = logging.getLogger("dlama")
SENSOR_PROPORTIONS = 0.01
"""Relative difference of width / height up to which a picture is of the whole sensor that its intrinsics are for."""


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
    """The picture size they are for; None: the picture's."""
    scales: bool = False
    """Whether pictures of other sizes and the same proportions have them too, scaled."""

    @classmethod
    def of_matrix(
        cls, source: str, K: Sequence[Sequence[float]], center: float, hw: tuple[int, int] | None = None
    ) -> Lens:
        """Of a 3x3 matrix; raises CameraError that begins with the source for one that is none of a pinhole camera."""
        return cls(source, FileFields(source, {"the matrix K": K}).intrinsics("the matrix K"), center, hw)

    def camera(self, world_from_cam: Float64Array, hw: tuple[int, ...] | None = None) -> Camera:
        """The camera at a pose, of a picture of that size where they are for none; raises CameraError."""
        height, width = self.hw or hw or ()
        return make_camera(self.source, (height, width), self.intrinsics, self.pixel_center, world_from_cam)


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
    """Beyond is missing depth."""
    enlarged: int = 1
    """Times its own size to which depth is enlarged at most, where the picture is larger."""
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
    read = (
        partial(read_colmap_depth, depth) if depth.suffix == ".bin" else partial(read_depth, depth, depth_scale=units)
    )
    read_color, hw = partial(read_color_of_camera, color), partial(picture_hw, color)
    return FrameFiles((str(color), str(depth)), read_color, read, lens, pose, hw, has_far=has_far)


@dataclass(frozen=True, eq=False)
class PosedFrame(Frame):
    """A frame whose pose is known before its pictures are read. All frames of a scene share one world."""

    world_from_cam: Float64Array = field(kw_only=True)
    """4x4, camera to world, OpenCV axes, metres."""
    load_depth: Callable[[], tuple[Float32Array, Camera]] = field(kw_only=True)
    """Reads the depth of `load` (H x W, metres), or a smaller one, and its camera without the colour; picklable."""


def posed_frame(scene: str, name: str, files: FrameFiles, yaw: float | None = None) -> PosedFrame:
    """A frame whose pixels are read when they are needed."""
    load, depth = partial(load_rgbd, files), partial(load_depth, files)
    return PosedFrame(scene, name, load, yaw, world_from_cam=files.world_from_cam, load_depth=depth)


def posed_frames(scene: str, place: Path, listed: Listed, depth_scale: float | None = None) -> list[PosedFrame]:
    """The frames of a scene, without those that are left out, which a line reports. Raises FileError where none is kept.

    depth_scale: units per metre of their depth files, in place of the layout's. InputError where depth is not in such files.
    """
    frames, left_out = list[PosedFrame](), Counter[str]()
    for name, files in listed:
        if isinstance(files, str):
            left_out[files] += 1
        else:
            frames.append(posed_frame(scene, name, files if depth_scale is None else scale_depth(files, depth_scale)))
    count, reasons = len(frames) + left_out.total(), ", ".join(f"{left_out[why]} {why}" for why in left_out)
    if not frames:
        raise FileError(f"{place}: none of its {count} frames can be used" + (f" ({reasons})" if reasons else ""))
    if reasons:
        LOG.warning("%s: %d of %d frames are left out (%s)", place, left_out.total(), count, reasons)
    return frames


def scale_depth(files: FrameFiles, depth_scale: float) -> FrameFiles:
    """With other units per metre. InputError where depth is not in a file that `read_depth` reads, or that is none."""
    check_depth_options(depth_scale, None, None)
    read = files.depth
    if not (isinstance(read, partial) and read.func is read_depth):
        raise InputError(f"`depth_scale` does not apply to {files.names[1]}, which has a unit of its own")
    return replace(files, depth=partial(read, depth_scale=depth_scale))


def load_rgbd(files: FrameFiles) -> RGBD:
    """Picture and depth at one size: that of depth, or the one it is enlarged to; the picture is shrunk to it by area means.

    Between single readings, as of a LIDAR, depth is filled along colours (`densify`).

    Raises FileError, DepthError, CameraError, ShapeError, MissingExtraError.
    """
    depth, color = measured_depth(files), files.color()
    camera = _camera(files, color.shape[:2], depth.shape)
    wide = min(color.shape[1], files.enlarged * depth.shape[1])
    if wide <= depth.shape[1]:
        padding = _padding(files, color.shape, depth.shape)
        return densify(RGBD(shrink_color(color, depth.shape), depth, camera, padding=padding))
    hw = (max(1, round(color.shape[0] * wide / color.shape[1])), wide)
    color = shrink_color(color, hw)
    return RGBD(color, upsample_depth(depth, color), camera.resized(hw[1], hw[0]))


def _padding(files: FrameFiles, hw: tuple[int, ...], small: tuple[int, ...]) -> BoolArray | None:
    """At the size `small`, True where a part of a pixel shows nothing of the scene; ShapeError: a mask of another size."""
    if files.shown is None:
        return None
    shown = files.shown()
    check_size(files.names[0], hw, shown.shape, "its mask")
    return np.asarray(cv2.resize(shown.astype(np.float32), (small[1], small[0]), interpolation=cv2.INTER_AREA) < 1)


def load_depth(files: FrameFiles) -> tuple[Float32Array, Camera]:
    """The depth as it was recorded, and its camera; the picture is not read where its size is known."""
    depth = measured_depth(files)
    hw = files.color_hw() if files.color_hw is not None else files.lens.hw or files.color().shape[:2]
    return depth, _camera(files, hw, depth.shape)


def measured_depth(files: FrameFiles) -> Float32Array:
    """h x w metres, 0 where it is missing, not confident or beyond the range."""
    depth = files.depth()
    known = (depth > 0) & (depth <= files.range_m)
    if not files.has_far:
        known &= depth < np.inf
    if files.confidence is not None:
        confidence = files.confidence()
        if confidence.shape != depth.shape:
            sizes = f"is {format_size(depth.shape)} and its confidence {format_size(confidence.shape)}"
            raise ShapeError(f"{files.names[1]}: {sizes}; one size is expected")
        known &= confidence >= files.least_confidence
    return np.where(known, depth, np.float32(0)).astype(np.float32)


def lens_for(folder: Path, root: Path, camera: CameraOption, names: Sequence[str], advice: str) -> Lens:
    """The option where given, else the first file of these names in the folder, or above it up to the data set's root.

    Raises CameraError with the `advice` where there is none; FileError.
    """
    if isinstance(camera, Camera):
        return _of_camera(camera, "the given camera")
    if camera is not None:
        return read_lens(Path(camera))
    for place in (folder, *folder.parents):
        for name in names:
            if (place / name).is_file():
                return read_lens(place / name)
        if place == root:
            break
    raise CameraError(f"{folder}: has no {' or '.join(names)}, and {advice}; give `camera=FILE.json`")


def read_lens(path: Path) -> Lens:
    """Our camera JSON (its pose is not used), the YAML of ROS or OpenCV, Open3D's camera_intrinsic.json, or a text file with a
    3x3 K, or a 4x4 one with nothing in the last row and column (ScanNet).

    The first pixel of all but the first has its centre at 0.0. Raises FileError, CameraError.
    """
    if path.suffix.lower() == ".txt":
        size = 4 if len(read_rows(path)) == 4 else 3
        return Lens.of_matrix(str(path), read_matrix(path, (size, size))[:3, :3].tolist(), 0.0)
    if path.suffix.lower() in SUFFIXES:
        fields = read_yaml_fields(path)
        return Lens(str(path), fields.intrinsics("K"), 0.0, fields.size(None) if "width" in fields else None)
    fields = read_json_fields(path)
    if "intrinsic_matrix" in fields:  # K column by column
        K = fields.numbers("intrinsic_matrix", 9)
        return Lens.of_matrix(str(path), [K[row::3] for row in range(3)], 0.0, fields.size(None))
    return _of_camera(read_camera(path), str(path))


def json_lens(fields: FileFields) -> Lens:
    """The fields `width`, `height`, `K` and `pixel_center` (0.0 where it is missing); raises CameraError."""
    return Lens(str(fields.path), fields.intrinsics("K"), fields.pixel_center(0.0), fields.size(None))


def units_per_metre(fields: FileFields, name: str, default: float | None = None) -> float:
    """1 / a field that holds metres per unit of depth; raises CameraError (no number), FileError (not > 0)."""
    scale = fields.number(name) if default is None or name in fields else default
    if scale <= 0:
        raise FileError(f"{fields.path}: {name} is {scale:g}; metres per unit > 0 are expected")
    return 1 / scale


def _of_camera(camera: Camera, source: str) -> Lens:
    return Lens(source, (camera.fx, camera.fy, camera.cx, camera.cy), 0.5, camera.hw)


def _camera(files: FrameFiles, color_hw: tuple[int, ...], depth_hw: tuple[int, ...]) -> Camera:
    """The camera at the depth's size; ShapeError, with the names of picture and depth, for sizes that cannot belong together."""
    lens, names = files.lens, files.names
    if lens.hw is not None and lens.scales:
        _check_proportions(lens, lens.hw, color_hw)
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


def _check_proportions(lens: Lens, hw: tuple[int, int], color_hw: tuple[int, ...]) -> None:
    """CameraError where sensor (hw) and picture differ in proportions: then the crop is not known."""
    if not same_proportions(color_hw, hw, SENSOR_PROPORTIONS):
        raise CameraError(
            f"{lens.source}: the sensor is {format_size(hw)} and the picture {format_size(color_hw)}; both must have the "
            "same proportions, else how wide the camera sees is not known"
        )
