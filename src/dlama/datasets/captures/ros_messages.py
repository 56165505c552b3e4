"""Messages of ROS 1 and 2 in; pictures, depth, intrinsics and poses out. The messages are objects with the fields of their types.

sensor_msgs/Image, CompressedImage and CameraInfo; depth as of REP 118 (16UC1: millimetres, 0 missing; 32FC1, 64FC1: metres,
NaN missing), also packed by compressed_depth_image_transport (12 bytes: a kind and two numbers a, b; then a PNG, or RVL; of
32FC1 depth = a / (code - b), 0 missing). Camera frames have OpenCV's axes ("optical", REP 103); transforms are those of
tf2_msgs/TFMessage.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from dlama.datasets.posed.nerfstudio import distortion_px
from dlama.datasets.text_tables import nearest_in_time, pose_of
from dlama.errors import FileError, any_error
from dlama.files.rasters.images import check_pixels, picture_of_bytes
from dlama.geometry.camera import Float64Array
from dlama.geometry.motion.poses import invert_pose, slerp
from dlama.geometry.rgbd import Float32Array, UInt8Array, UInt16Array

COLORS: dict[str, tuple[int, int | None]] = {
    "rgb8": (3, None), "bgr8": (3, cv2.COLOR_BGR2RGB), "8UC3": (3, cv2.COLOR_BGR2RGB),
    "rgba8": (4, cv2.COLOR_RGBA2RGB), "bgra8": (4, cv2.COLOR_BGRA2RGB),
    "mono8": (1, cv2.COLOR_GRAY2RGB), "8UC1": (1, cv2.COLOR_GRAY2RGB),
    "yuv422": (2, cv2.COLOR_YUV2RGB_UYVY), "yuv422_yuy2": (2, cv2.COLOR_YUV2RGB_YUY2), "YUYV": (2, cv2.COLOR_YUV2RGB_YUY2),
    "bayer_rggb8": (1, cv2.COLOR_BayerRGGB2RGB), "bayer_bggr8": (1, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGBRG2RGB), "bayer_grbg8": (1, cv2.COLOR_BayerGRBG2RGB),
}  # fmt: skip
"""Encodings of colour pictures -> bytes a pixel, and OpenCV's way to RGB (sensor_msgs/image_encodings.hpp)."""
DEPTHS = {"16UC1": np.uint16, "mono16": np.uint16, "32FC1": np.float32, "64FC1": np.float64}
"""Encodings of depth."""
DEPTH_HEADER = 12
"""Bytes before the PNG or RVL of packed depth."""
MOST_NIBBLES = 10
"""Of a number in RVL, at 3 bits each."""
BETWEEN_S = 0.25
"""Seconds beyond the first and the last transform up to which these hold, and between two that are interpolated."""


@dataclass(frozen=True)
class Topic:
    """Pictures of one topic."""

    name: str
    frame: str
    """Of their heads."""
    stamps: Float64Array
    """Seconds of their heads, ascending."""
    places: tuple[int, ...]
    """When each was recorded, ns: by it a message is found again."""


def times_to_match(color: Topic, depth: Topic) -> tuple[Float64Array, Float64Array]:
    """Seconds of the pictures and of the depth: of their heads, or, where two clocks wrote these, when each was recorded."""
    if color.stamps[0] <= depth.stamps[-1] and depth.stamps[0] <= color.stamps[-1]:
        return color.stamps, depth.stamps
    return np.array(color.places) * 1e-9, np.array(depth.places) * 1e-9


def seconds_of(message: Any) -> float:
    """Of a message's head."""
    return float(message.header.stamp.sec) + 1e-9 * float(message.header.stamp.nanosec)


def encoding_of(message: Any) -> str:
    """As image_encodings.hpp calls it; of a CompressedImage the first word of its format, such as `16UC1; png compressed`."""
    return str(message.encoding if hasattr(message, "encoding") else message.format.split(";")[0].strip())


def is_depth(message: Any) -> bool:
    """Whether an Image or a CompressedImage holds depth, which is also packed as a plain PNG."""
    known = encoding_of(message) in DEPTHS
    return known if hasattr(message, "encoding") else is_packed_depth(message) or (known and "png" in message.format)


def is_color(message: Any) -> bool:
    """Whether an Image or a CompressedImage holds a picture."""
    code = encoding_of(message)
    return code in COLORS if hasattr(message, "encoding") else not (is_packed_depth(message) or code in DEPTHS)


def is_packed_depth(message: Any) -> bool:
    """Whether a CompressedImage is one of compressed_depth_image_transport."""
    return "compressedDepth" in message.format


def color_of(message: Any, where: str) -> UInt8Array:
    """H x W x 3 RGB. FileError, which begins with `where`."""
    if not hasattr(message, "encoding"):
        return np.asarray(picture_of_bytes(bytes(message.data), f"{where}, {message.format}").convert("RGB"))
    channels, code = COLORS[message.encoding]
    pixels = _pixels(message, np.uint8, channels, where)
    return np.asarray(pixels if code is None else cv2.cvtColor(pixels, code), np.uint8)


def depth_of(message: Any, where: str, unit: float | None = None) -> Float32Array:
    """h x w metres; 0 or NaN is missing. unit: metres a level, if not REP 118's. FileError, which begins with `where`."""
    if hasattr(message, "encoding"):
        codes = _pixels(message, DEPTHS[message.encoding], 1, where)[..., 0]
    else:
        data = bytes(message.data)
        unpack = unpack_rvl if "rvl" in message.format.lower() else picture_of_bytes
        start = DEPTH_HEADER if is_packed_depth(message) else 0
        codes = np.asarray(unpack(data[start:], f"{where}, {message.format}"))
        if encoding_of(message) == "32FC1":
            _, a, b = struct.unpack("<iff", data[:DEPTH_HEADER])
            steps = np.where(codes > 0, codes.astype(np.float32) - np.float32(b), 1)
            return np.where(codes > 0, a / steps, 0).astype(np.float32)
    metres = codes.astype(np.float32)
    if unit is not None:
        return metres * np.float32(unit)
    return metres / np.float32(1000) if codes.dtype.kind in "ui" else metres


def unpack_rvl(data: bytes, where: str) -> UInt16Array:
    """h x w codes of RVL (A. Wilson, "Fast Lossless Depth Image Compression", 2017), after 4 bytes each of width and height.

    Numbers are nibbles, of a word's high bits first: 3 bits each, low ones first, and a bit that more follow. In turn they say
    how many pixels are 0, how many are not, and by how much each of these differs from the last one. FileError.
    """
    with any_error(FileError, f"{where}: is damaged"):
        width, height = struct.unpack_from("<ii", data)
        check_pixels(where, width, height)
        words = np.frombuffer(data, "<u4", offset=8)
        nibbles = (words[:, None] >> np.arange(28, -1, -4, dtype=np.uint32)).ravel().astype(np.int64) & 15
        ends = np.flatnonzero(nibbles < 8)
        starts = np.r_[0, ends[:-1] + 1]
        nibbles = nibbles[: ends[-1] + 1]
        shift = 3 * np.minimum(np.arange(len(nibbles)) - np.repeat(starts, ends - starts + 1), MOST_NIBBLES)
        numbers = np.add.reduceat((nibbles & 7) << shift, starts)
        known, steps, pixel, at = np.zeros(width * height, np.bool_), [], 0, 0
        while pixel < len(known):
            start, count = pixel + int(numbers[at]), int(numbers[at + 1])
            known[start : start + count] = True
            steps.append(numbers[at + 2 : at + 2 + count])
            pixel, at = start + count, at + 2 + count
        changes = np.concatenate(steps)
        codes = np.zeros(len(known), np.uint16)
        codes[known] = np.cumsum((changes >> 1) ^ -(changes & 1)).astype(np.uint16)
        return codes.reshape(height, width)


def _pixels(message: Any, kind: type, channels: int, where: str) -> np.ndarray:
    """H x W x channels of an Image, rows without their padding, in this machine's byte order."""
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    height, width, step = int(message.height), int(message.width), int(message.step)
    check_pixels(where, width, height)
    row, data = width * channels * dtype.itemsize, np.asarray(message.data, np.uint8)
    if row > step or len(data) < step * height or not data.size:
        raise FileError(
            f"{where}: holds {len(data)} bytes in rows of {step}; {height} rows of {row} bytes are expected ({width}x{height})"
        )
    rows = data[: step * height].reshape(height, step)[:, :row]
    return np.ascontiguousarray(rows).view(dtype).reshape(height, width, channels).astype(kind, copy=False)


@dataclass
class Track:
    """The transforms from a frame to its parent, in order of time."""

    parent: str
    times: list[float] = field(default_factory=list)
    poses: list[Float64Array] = field(default_factory=list)
    fixed: bool = False
    """It holds for ever (/tf_static)."""

    def at(self, time: float) -> Float64Array | None:
        """4x4 at a time, between two interpolated; None where none is near enough."""
        if self.fixed or not self.times:
            return self.poses[-1] if self.poses else None
        times = np.array(self.times)
        after = int(np.searchsorted(times, time))
        if 0 < after < len(times) and times[after] - times[after - 1] <= BETWEEN_S:
            share = float((time - times[after - 1]) / (times[after] - times[after - 1]))
            one, other = self.poses[after - 1], self.poses[after]
            pose = (1 - share) * one + share * other
            pose[:3, :3] = slerp(one[:3, :3], other[:3, :3], share)
            return pose
        near = nearest_in_time(times, time, BETWEEN_S)
        return None if near is None else self.poses[near]


class Transforms:
    """The tree of frames of /tf and /tf_static, and of odometry."""

    def __init__(self) -> None:
        self.tracks: dict[str, Track] = {}

    def add(self, child: str, parent: str, time: float, pose: Any, fixed: bool, where: str) -> None:
        """A transform: the pose of `child` in `parent`. FileError, CameraError."""
        child, parent = child.lstrip("/"), parent.lstrip("/")
        place = pose.translation if hasattr(pose, "translation") else pose.position
        turn = pose.rotation if hasattr(pose, "rotation") else pose.orientation
        matrix = pose_of(f"{where}: {child} in {parent}", [place.x, place.y, place.z], [turn.x, turn.y, turn.z, turn.w])
        track = self.tracks.setdefault(child, Track(parent))
        if track.parent == parent and (not track.times or time > track.times[-1]):
            track.times.append(time)
            track.poses.append(matrix)
            track.fixed = fixed

    def chain(self, frame: str) -> list[str]:
        """A frame and the frames above it, up to the root."""
        found = [frame.lstrip("/")]
        while (track := self.tracks.get(found[-1])) is not None and track.parent not in found:
            found.append(track.parent)
        return found

    def moves(self, frame: str) -> bool:
        """Whether a frame changes its place in the root with time."""
        return any(not self.tracks[name].fixed for name in self.chain(frame)[:-1])

    def root_from(self, frame: str, time: float) -> Float64Array | None:
        """The pose of a frame in the root of its tree; None where a transform is missing at that time."""
        pose = np.eye(4)
        for name in self.chain(frame)[:-1]:
            step = self.tracks[name].at(time)
            if step is None:
                return None
            pose = step @ pose
        return pose

    def between(self, target: str, source: str, time: float) -> Float64Array | None:
        """target_from_source; None where nothing connects them."""
        ends = self.chain(target)[-1], self.chain(source)[-1]
        poses = self.root_from(target, time), self.root_from(source, time)
        if ends[0] != ends[1] or poses[0] is None or poses[1] is None:
            return None
        return invert_pose(poses[0]) @ poses[1]


def intrinsics_of_info(info: Any, rectified: bool = False) -> tuple[list[list[float]], tuple[int, int]]:
    """Intrinsics of the picture that a CameraInfo of ROS 1 (K, P) or 2 (k, p) came with, 3 x 3, and its height and width: K, or
    of rectified pictures the left part of P. The message has those of the whole sensor, from which a region (roi, zeros: all)
    was cut and then reduced (binning_x, binning_y, 0: 1), as image_geometry reads it."""
    name, columns = ("p", 4) if rectified else ("k", 3)
    found = getattr(info, name if hasattr(info, name) else name.upper())
    K, roi = np.array(found, np.float64).reshape(3, columns)[:, :3], info.roi
    K[:2, 2] -= roi.x_offset, roi.y_offset
    height, width = (roi.height, roi.width) if roi.height and roi.width else (info.height, info.width)
    across, down = max(int(info.binning_x), 1), max(int(info.binning_y), 1)
    return (K / np.array([[across], [down], [1]])).tolist(), (int(height) // down, int(width) // across)


def is_rectified(topic: str) -> bool:
    """Whether pictures of a topic are free of distortion, by its name (image_proc: image_rect, image_rect_color)."""
    return any("rect" in part.split("_") or "rectified" in part for part in topic.split("/"))


def distortion_px_of_info(info: Any) -> float:
    """How far the distortion of a CameraInfo moves the worst corner: plumb_bob (RealSense: Brown Conrady of any kind),
    rational_polynomial (Azure Kinect) and equidistant (fisheye lenses); 0 for others."""
    found = np.asarray(info.d if hasattr(info, "d") else info.D, np.float64).ravel()
    model, (K, hw) = info.distortion_model, intrinsics_of_info(info)
    intrinsics = K[0][0], K[1][1], K[0][2], K[1][2]
    if model in ("equidistant", "fisheye") and found.size == 4:
        return distortion_px(intrinsics, hw, found.tolist(), cv2.fisheye.projectPoints)
    known = model in ("plumb_bob", "rational_polynomial") or "Brown Conrady" in model
    return distortion_px(intrinsics, hw, found.tolist()) if known and found.size in (4, 5, 8, 12, 14) else 0.0
