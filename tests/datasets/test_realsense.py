"""Recordings of a RealSense camera itself (oracle: the closed-form world that each was written from, by librealsense's layout).

After ros_file_format.h and ros_writer.cpp of librealsense: topics by device, sensor and stream, one head for all of them, options
as messages, transforms from the reference to each stream, and the unit of depth behind each image.
"""

from __future__ import annotations

import functools
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlama import read_color, read_scene
from dlama.apps.cli import main
from dlama.datasets.diagnosis import diagnose
from dlama.datasets.layouts import detect
from dlama.datasets.sequences.loading import open_frames
from dlama.errors import FileError
from dlama.geometry.camera import Camera
from dlama.geometry.motion.poses import invert_pose
from dlama.geometry.rgbd import RGBD
from posed_folders import LENS, WORLD, cameras, check_registered
from rosbag_writer import Writer
from worlds import pose_of

pytest.importorskip("rosbags", reason="rosbags is not installed (extra ros)")

DEPTH, COLOR = "/device_0/sensor_0/Depth_0", "/device_0/sensor_1/Color_0"
DEPTH_LENS = Camera(128, 96, 110.0, 110.0, 64.5, 47.5)
UNIT = 1e-4
COUNT = 3


TO_DEPTH = pose_of((0, np.radians(1), 0), (0.01, 0, 0))
TO_COLOR = pose_of((0, np.radians(-2), 0), (0.06, 0.005, 0.002))
"""Points of the reference to each stream's axes."""


class RealSense(Writer):
    """A recording under way."""

    def picture(self, stream: str, seconds: float, values: np.ndarray, encoding: str, unit: float | None) -> None:
        """An image, of new recordings with the unit behind it, which the head's frame "1" says."""
        behind = b"" if unit is None else struct.pack("<f", unit)
        self.image(f"{stream}/image/data", "0" if unit is None else "1", seconds, values, encoding, behind)
        self.note(f"{stream}/image/metadata", "system_time", "1573.25")

    def note(self, topic: str, key: str, value: str) -> None:
        kind = "diagnostic_msgs/msg/KeyValue"
        self.put(topic, kind, 1, self.make(kind, key=key, value=value))

    def number(self, topic: str, value: float) -> None:
        self.put(topic, "std_msgs/msg/Float32", 1, self.make("std_msgs/msg/Float32", data=value))

    def extrinsics(self, stream: str, pose: np.ndarray) -> None:
        self.put(f"{stream}/tf/0", "geometry_msgs/msg/Transform", 1, self.move(pose))


@functools.cache
def truth() -> list[RGBD]:
    """What the colour camera sees, the reference where the world's cameras are."""
    return [WORLD.rgbd(LENS.at(one.world_from_cam @ invert_pose(TO_COLOR))) for one in cameras()[:COUNT]]


def write_recording(
    path: Path, *, units: str = "option", lag: float = 0.004, extrinsics: bool = True, encoding: str = "rgb8"
) -> Path:
    """Depth in a tenth of a millimetre; units: where they stand ("option", "image", "property" or "none")."""
    with RealSense(path, "ros1") as bag:
        bag.note("/device_0/info", "Name", "Intel RealSense D435")
        bag.number("/device_0/sensor_0/option/Exposure/value", 8500)
        if units == "option":
            bag.number("/device_0/sensor_0/option/Depth Units/value", UNIT)
        if units == "property":
            bag.note("/device_0/sensor_0/property", "Exposure", "8500")
            bag.note("/device_0/sensor_0/property", "Depth Units", str(UNIT))
        bag.info(f"{DEPTH}/info/camera_info", "", DEPTH_LENS)
        bag.info(f"{COLOR}/info/camera_info", "", LENS)
        if extrinsics:
            bag.extrinsics(DEPTH, TO_DEPTH)
            bag.extrinsics(COLOR, TO_COLOR)
        for number, (camera, color) in enumerate(zip(cameras(), truth())):
            seconds = 10 + number / 10
            depth = WORLD.rgbd(DEPTH_LENS.at(camera.world_from_cam @ invert_pose(TO_DEPTH))).depth
            codes = np.rint(np.where(np.isfinite(depth), depth, 0) / UNIT).astype(np.uint16)
            behind = {"image": UNIT, "option": 0.0}.get(units)
            grey = np.full(codes.shape, 7, np.uint8)
            bag.picture("/device_0/sensor_0/Infrared_1", seconds, grey, "8UC1", None if behind is None else 0.0)
            bag.picture(DEPTH, seconds + lag, codes, "mono16", behind)
            values = color.color if encoding == "rgb8" else as_yuyv(color.color)
            bag.picture(COLOR, seconds, values, encoding, None if behind is None else 0.0)
    return path


def as_yuyv(color: np.ndarray) -> np.ndarray:
    """H x W x 2 of H x W x 3 (Rec. 601, 16..235), the chroma of every second pixel."""
    r, g, b = (color[..., n].astype(np.float64) for n in range(3))
    y = 16 + (65.738 * r + 129.057 * g + 25.064 * b) / 256
    u, v = 128 + (-37.945 * r - 74.494 * g + 112.439 * b) / 256, 128 + (112.439 * r - 94.154 * g - 18.285 * b) / 256
    chroma = np.where(np.arange(color.shape[1]) % 2 == 0, u.repeat(1, 1), np.roll(v, 1, 1))
    return np.rint(np.stack([y, chroma], 2)).astype(np.uint8)


def check(path: Path, mean_level: float = 0) -> None:
    """Each frame is the world's as the colour camera sees it."""
    frames = open_frames(path)
    assert len(frames) == COUNT
    for frame, true in zip(frames, truth()):
        read: Any = frame.load()
        check_registered(read, true)
        assert np.abs(read.color.astype(int) - true.color).mean() <= mean_level
        assert np.allclose(read.camera.world_from_cam, invert_pose(TO_COLOR), atol=1e-6)


@pytest.mark.parametrize(
    ("units", "encoding", "mean_level"), [("option", "rgb8", 0), ("image", "rgb8", 0), ("property", "YUYV", 12)]
)
def test_depth_is_registered_in_metres(tmp_path: Path, units: str, encoding: str, mean_level: float) -> None:
    """Wherever the unit stands; the reference is neither of the two cameras, which are turned against it; grey is not taken.
    Colours of YUYV are right within a few levels, for two pixels share their chroma."""
    path = write_recording(tmp_path / "a.bag", units=units, encoding=encoding)
    assert detect(tmp_path) == "rosbag"
    check(path, mean_level)
    found = diagnose(path)
    assert "nothing wrong: layout rosbag, 3 frames" in found[-1].what
    assert any("the camera is taken as standing still" in one.what for one in found)


def test_commands_take_a_recording(tmp_path: Path) -> None:
    """`dlama photo3d FILE.bag` is about its middle frame; `dlama view` says where a recording goes."""
    path = write_recording(tmp_path / "a.bag")
    main(["photo3d", str(path), "--filler", "telea", "--only", "scene", "-o", str(tmp_path / "out")])
    frames = read_scene(tmp_path / "out" / "scene.npz").frames
    assert len(frames) == COUNT and np.allclose(frames[1].camera.world_from_cam, invert_pose(TO_COLOR), atol=1e-6)
    with pytest.raises(FileError, match=r"a recording goes into sequence, photo3d, show and doctor"):
        read_color(path)


def test_clocks_of_their_own_are_matched_by_when_each_was_recorded(tmp_path: Path) -> None:
    """Depth stamped by another clock, an hour off, whose messages were recorded in turn with the pictures."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RealSense, "head", shift_clock(RealSense.head))
        check(write_recording(tmp_path / "a.bag"))


def shift_clock(head: Any) -> Any:
    """Stamps of the depth (which is 4 ms late) an hour later."""
    return lambda bag, frame, seconds: head(bag, frame, seconds + 3600 * (abs(seconds * 10 % 1 - 0.04) < 0.01))


def test_what_a_recording_lacks_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """No unit: millimetres, with a line; no transforms: an error that names both streams."""
    frames = open_frames(write_recording(tmp_path / "a.bag", units="none"))
    line = f"a.bag, {DEPTH}/image/data: no unit of depth is recorded: millimetres are taken"
    assert len(frames) == COUNT and line in caplog.text
    words = "'device_0/sensor_0/Depth_0' and colour in 'device_0/sensor_1/Color_0', and no"
    with pytest.raises(FileError, match=words):
        open_frames(write_recording(tmp_path / "b.bag", extrinsics=False))
