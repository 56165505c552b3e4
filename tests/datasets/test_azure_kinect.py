"""Azure Kinect recordings (oracle: the closed-form world, calibrated as mode_specific_calibration.c of the SDK reads it back)."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from dlama.datasets.captures.azure_kinect import Kinect, undistorted_color
from dlama.datasets.diagnosis import diagnose
from dlama.datasets.layouts import detect
from dlama.datasets.posed.lenses import Lens
from dlama.datasets.sequences.loading import open_frames
from dlama.errors import FileError
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from posed_folders import WORLD

av = pytest.importorskip("av", reason="PyAV is not installed (extra captures)")

COLOR = Camera(1280, 720, 600.0, 605.0, 640.5, 363.0)
"""720p; of the whole 4:3 sensor (1280 x 960) 120 rows above are not in the picture."""
DEPTH = Camera(320, 288, 252.0, 253.0, 160.25, 146.5)
"""NFOV 2x2 binned: of 512 x 512 from (96, 90) on."""
SIDE = np.array([[1.0, 0, 0, 0.032], [0, 1, 0, 0.002], [0, 0, 1, -0.004], [0, 0, 0, 1]])
"""Colour from depth, m."""


@functools.cache
def seen() -> tuple[RGBD, RGBD]:
    """What the colour and the depth camera see."""
    return WORLD.rgbd(COLOR), WORLD.rgbd(DEPTH.at(SIDE))


def camera_json(
    location: str, camera: Camera, whole: tuple[int, int], first: tuple[int, int], pose: np.ndarray, sensor: Any
) -> Any:
    shares = (np.array([camera.cx + first[0], camera.cy + first[1], camera.fx, camera.fy]) / (*whole, *whole)).tolist()
    return {
        "Location": location,
        "SensorWidth": sensor[0],
        "SensorHeight": sensor[1],
        "Rt": {"Rotation": pose[:3, :3].ravel().tolist(), "Translation": pose[:3, 3].tolist()},
        "Intrinsics": {
            "ModelParameterCount": 14,
            "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
            "ModelParameters": [*shares, *[0.0] * 10],
        },
    }


def write_recording(path: Path, *, wide: bool = False, calibration: bool = True, frames: int = 2) -> None:
    """Colour and, 3 ms later, depth of the world from a camera that stands still; wide: an old calibration of 16:9."""
    cameras = [camera_json("CALIBRATION_CameraLocationD0", DEPTH, (512, 512), (96, 90), np.eye(4), (1024, 1024))]
    if wide:  # shares of 4096 x 2304, which is 4096 x 3072 without 384 rows above and below
        color = camera_json("CALIBRATION_CameraLocationPV0", COLOR, (1280, 720), (0, 0), SIDE, (4096, 2304))
    else:
        color = camera_json("CALIBRATION_CameraLocationPV0", COLOR, (1280, 960), (0, 120), SIDE, (4096, 3072))
    text = json.dumps({"CalibrationInformation": {"Cameras": [*cameras, color]}}).encode() + b"\0"
    with av.open(str(path), "w", format="matroska", container_options={"allow_raw_vfw": "1"}) as container:
        tracks = [container.add_stream(name, rate=1000) for name in ("ffv1", "rawvideo")]
        for track, camera, kind, title in zip(tracks, (COLOR, DEPTH), ("bgr0", "gray16be"), ("COLOR", "DEPTH")):
            track.width, track.height, track.pix_fmt = camera.width, camera.height, kind
            track.metadata["title"] = title
        if calibration:
            container.add_attachment("calibration.json", "application/octet-stream", text)
        codes = np.rint(seen()[1].depth * 1000).astype(np.uint16)
        for number in range(frames):
            pictures = (
                av.VideoFrame.from_ndarray(seen()[0].color, format="rgb24"),
                av.VideoFrame.from_ndarray(codes, format="gray16le").reformat(format="gray16be"),
            )
            for track, picture, late in zip(tracks, pictures, (0, 3)):
                picture.pts = 33 * number + late
                container.mux(track.encode(picture))
        for track in tracks:
            container.mux(track.encode(None))


@pytest.mark.slow
@pytest.mark.parametrize("wide", [False, True])
def test_depth_lies_on_the_world_as_colour_sees_it(tmp_path: Path, wide: bool) -> None:
    """Modes, sensor crops, byte order, millimetres, the offset between the cameras; both kinds of calibrations."""
    write_recording(tmp_path / "a.mkv", wide=wide)
    assert detect(tmp_path) == detect(tmp_path / "a.mkv") == "azure-kinect"
    frames = open_frames(tmp_path / "a.mkv")
    assert len(frames) == 2
    read = frames[1].load()
    camera = read.camera.resized(1280, 720)
    np.testing.assert_allclose((camera.fx, camera.fy, camera.cx, camera.cy), (600, 605, 640.5, 363), rtol=1e-6)
    small = cv2.resize(seen()[0].color, read.color.shape[1::-1], interpolation=cv2.INTER_AREA)
    assert np.abs(read.color.astype(int) - small).max() <= 1
    true = WORLD.rgbd(read.camera).depth
    error = np.abs(read.depth - true)[read.valid]
    assert read.valid.mean() > 0.35 and np.percentile(error, 90) < 0.015 * np.median(true)
    assert "layout azure-kinect, 2 frames" in diagnose(tmp_path / "a.mkv")[-1].what


def test_distortion_is_undone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: cv2.projectPoints: a dot that a distorting lens puts at p comes to lie where a pinhole camera sees it."""
    distortion = (0.5, -2.7, 0.0008, -0.0001, 1.6, 0.4, -2.5, 1.5)
    lens = Lens("test", (600.0, 605.0, 640.5, 363.0), 0.5, (720, 1280))
    K = np.array([[600, 0, 640.0], [0, 605, 362.5], [0, 0, 1]])
    point = np.array([[0.6, -0.35, 1.0]])
    spot = cv2.projectPoints(point, np.zeros(3), np.zeros(3), K, np.array(distortion))[0].ravel()
    ideal = cv2.projectPoints(point, np.zeros(3), np.zeros(3), K, None)[0].ravel()
    assert np.hypot(*(spot - ideal)) > 3
    picture = np.zeros((720, 1280, 3), np.uint8)
    cv2.circle(picture, tuple(int(round(16 * v)) for v in spot), 16 * 6, (255, 255, 255), -1, cv2.LINE_AA, 4)
    monkeypatch.setattr("dlama.datasets.captures.azure_kinect.read_video_frame", lambda *_: picture)
    found = undistorted_color(tmp_path, 0, 0, Kinect(lens, distortion, np.eye(4)))[..., 0].astype(float)
    rows, columns = np.indices(found.shape)
    center = (columns * found).sum() / found.sum(), (rows * found).sum() / found.sum()
    assert np.hypot(*(np.array(center) - ideal)) < 0.4


def test_other_videos_are_one_line(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.mkv", calibration=False, frames=1)
    with pytest.raises(FileError, match=r"a.mkv: has no calibration attached; a recording of k4arecorder is expected"):
        open_frames(tmp_path / "a.mkv")
    with av.open(str(tmp_path / "b.mkv"), "w") as container:
        stream = container.add_stream("ffv1", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "bgr0"
        container.mux(stream.encode(av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8), format="rgb24")))
        container.mux(stream.encode(None))
    with pytest.raises(FileError, match=r"b.mkv: has no track COLOR .*a recording of an Azure Kinect is expected"):
        open_frames(tmp_path / "b.mkv")
    (tmp_path / "c.mkv").write_bytes(b"no video")
    with pytest.raises(FileError, match=r"c.mkv: is no readable video"):
        open_frames(tmp_path / "c.mkv")
