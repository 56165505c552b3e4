"""An Azure Kinect recording in (.mkv with colour, depth and calibration); frames of a camera that stands still, and cases, out.

Tracks are called COLOR and DEPTH (16-bit millimetres, big endian); the calibration is an attached JSON. Its focal lengths and
principal points are shares of the whole sensor, from the corner of the first pixel; a mode bins and crops the sensor (MODES,
COLORS). Rt takes points of the device into a camera, in metres. Distortion is OpenCV's rational model: both pictures are
undistorted, and depth is moved into the colour camera. Format: learn.microsoft.com/azure/kinect-dk/record-file-format;
numbers: github.com/microsoft/Azure-Kinect-Sensor-SDK, src/calibration/calibration.c and
src/transformation/mode_specific_calibration.c.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from dlama.datasets.posed.lenses import Lens, register_depth
from dlama.datasets.posed.posed_frames import LOG, MOST_ENLARGED, FrameFiles, Listed
from dlama.datasets.text_tables import nearest_in_time, pose_at
from dlama.errors import FileError, format_size
from dlama.files.fields import FileFields, json_fields
from dlama.files.rasters.video_frames import read_raw_frame, read_video_frame, video_times, video_tracks
from dlama.geometry.camera import Float64Array
from dlama.geometry.motion.poses import invert_pose, make_pose
from dlama.geometry.rgbd import Float32Array, UInt8Array

MODEL = "CALIBRATION_LensDistortionModelBrownConrady"
MODES = {
    (320, 288): ((512, 512), (96, 90)),
    (640, 576): ((1024, 1024), (192, 180)),
    (512, 512): ((512, 512), (0, 0)),
    (1024, 1024): ((1024, 1024), (0, 0)),
}
"""Width and height of depth -> size of the whole sensor, binned, and the first pixel in it."""
COLORS = {(w, h): ((w, 3 * w // 4), (0, (3 * w // 4 - h) // 2)) for w, h in (
    (1280, 720), (1920, 1080), (2560, 1440), (2048, 1536), (3840, 2160), (4096, 3072)
)}  # fmt: skip
"""The same of colour, whose sensor has 4:3."""


@dataclass(frozen=True)
class Kinect:
    """One of the two cameras."""

    lens: Lens
    distortion: tuple[float, ...]
    """k1, k2, p1, p2, k3, k4, k5, k6, as OpenCV has them."""
    from_device: Float64Array
    """4x4, metres."""


def looks_like(folder: Path) -> bool:
    """A recording is a file."""
    return False


def list_frames(path: Path) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    tags, attached = video_tracks(path)
    color, depth = (_track(path, tags, name) for name in ("COLOR", "DEPTH"))
    name = next((name for name in attached if name.endswith(".json")), None)
    if name is None:
        raise FileError(f"{path}: has no calibration attached; a recording of k4arecorder is expected")
    fields = json_fields(f"{path}: {name}", attached[name].decode("utf-8", "replace").rstrip("\0"))
    part = "CalibrationInformation"
    listed = fields.part(part, fields.values.get(part)).entries("Cameras", "cameras")
    sizes = read_video_frame(path, 0, color).shape[:2], read_raw_frame(path, 0, depth).shape
    color_camera = _camera(fields, listed, "CALIBRATION_CameraLocationPV0", sizes[0], COLORS)
    depth_camera = _camera(fields, listed, "CALIBRATION_CameraLocationD0", sizes[1], MODES)
    color_from_depth = color_camera.from_device @ invert_pose(depth_camera.from_device)
    LOG.warning("%s: holds no poses: the camera is taken as standing still", path)
    times, depth_times = video_times(path, color), video_times(path, depth)
    for place, time in enumerate(times):
        near = nearest_in_time(depth_times, time)
        if near is None:
            yield f"{place:06d}", "without depth"
            continue
        metres = partial(undistorted_depth, path, near, depth, depth_camera)
        files = FrameFiles(
            (f"{path}, picture {place}", f"{path}, depth {near}"),
            partial(undistorted_color, path, place, color, color_camera),
            partial(register_depth, metres, depth_camera.lens, color_camera.lens, color_from_depth),
            color_camera.lens,
            np.eye(4),
            enlarged=MOST_ENLARGED,
        )
        yield f"{place:06d}", files


def _track(path: Path, tags: Sequence[dict[str, str]], name: str) -> int:
    found = [place for place, each in enumerate(tags) if each.get("title") == name or f"K4A_{name}_TRACK" in each]
    if not found:
        titles = ", ".join(each.get("title", "without a title") for each in tags)
        raise FileError(
            f"{path}: has no track {name} (its tracks: {titles}); a recording of an Azure Kinect is expected"
        )
    return found[0]


def _camera(
    fields: FileFields,
    listed: Sequence[object],
    location: str,
    hw: tuple[int, ...],
    modes: dict[tuple[int, int], tuple[tuple[int, int], tuple[int, int]]],
) -> Kinect:
    cameras = [fields.part(f"Cameras[{number}]", each) for number, each in enumerate(listed)]
    found = next((each for each in cameras if each.values.get("Location") == location), None)
    if found is None:
        raise FileError(f"{fields.path}: has no camera {location}")
    if (hw[1], hw[0]) not in modes:
        known = ", ".join(f"{w}x{h}" for w, h in modes)
        raise FileError(f"{fields.path}: pictures of {format_size(hw)} are no mode of this camera ({known})")
    inner, pose = (found.part(name, found.values.get(name)) for name in ("Intrinsics", "Rt"))
    if inner.values.get("ModelType") != MODEL:
        raise FileError(f"{inner.path}: ModelType is {inner.values.get('ModelType')!r}; {MODEL} is expected")
    values = FileFields(inner.path, {"ModelParameters": inner.entries("ModelParameters", "numbers")[:14]})
    cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, _, _, p2, p1 = values.numbers("ModelParameters", 14)
    if found.number("SensorWidth") * 9 == found.number("SensorHeight") * 16:  # a calibration of 16:9 in a sensor of 4:3
        cy, fy = (cy * 2304 + 384) / 3072, fy * 2304 / 3072
    (width, height), (left, top) = modes[hw[1], hw[0]]
    intrinsics = (fx * width, fy * height, cx * width - left, cy * height - top)
    matrix = make_pose(np.reshape(pose.numbers("Rotation", 9), (3, 3)), pose.numbers("Translation", 3))
    lens = Lens(str(inner.path), intrinsics, 0.5, (int(hw[0]), int(hw[1])))
    return Kinect(lens, (k1, k2, p1, p2, k3, k4, k5, k6), pose_at(str(pose.path), matrix))


def undistorted_color(path: Path, place: int, track: int, camera: Kinect) -> UInt8Array:
    """H x W x 3 as a pinhole camera of the same intrinsics sees it. FileError."""
    return np.asarray(_undistorted(read_video_frame(path, place, track), camera, cv2.INTER_LINEAR), np.uint8)


def undistorted_depth(path: Path, place: int, track: int, camera: Kinect) -> Float32Array:
    """h x w metres as a pinhole camera of the same intrinsics sees them; each is one of the file's, never a mean. FileError."""
    codes = _undistorted(read_raw_frame(path, place, track), camera, cv2.INTER_NEAREST)
    return codes.astype(np.float32) / np.float32(1000)


def _undistorted(picture: np.ndarray, camera: Kinect, how: int) -> np.ndarray:
    if not any(camera.distortion):
        return picture
    fx, fy, cx, cy = camera.lens.intrinsics
    K = np.array([[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]])  # OpenCV's first pixel has its centre at 0
    size = picture.shape[1], picture.shape[0]
    maps = cv2.initUndistortRectifyMap(K, np.array(camera.distortion), np.eye(3), K, size, cv2.CV_32FC1)
    return np.asarray(cv2.remap(picture, *maps, how, borderMode=cv2.BORDER_CONSTANT, borderValue=0))
