"""Bags of ROS 1 and 2 and MCAP (oracle: the closed-form world that they were written from, by the package rosbags)."""

from __future__ import annotations

import io
import struct
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from dlama.datasets.captures.ros_messages import Transforms
from dlama.datasets.captures.rosbag import Bag
from dlama.datasets.diagnosis import diagnose
from dlama.datasets.layouts import detect, open_dataset
from dlama.datasets.sequences.loading import open_frames
from dlama.datasets.sequences.sequence import sequence
from dlama.errors import CameraError, FileError, MissingExtraError
from dlama.geometry.camera import Camera
from dlama.geometry.motion.poses import invert_pose, rotation_deg
from posed_folders import LENS, WORLD, cameras, check_frames, check_registered, truth
from rosbag_writer import Writer, as_rvl
from worlds import pose_of

rosbags = pytest.importorskip("rosbags", reason="rosbags is not installed (extra ros)")

OPTICAL, BODY, ROOT = "camera_color_optical_frame", "base_link", "map"
OPTICAL_IN_BODY = np.array([[0.0, 0, 1, 0.1], [-1, 0, 0, 0.02], [0, -1, 0, 0.3], [0, 0, 0, 1]])
"""x forward, y left, z up (REP 103) -> x right, y down, z forward."""
KINDS = ("ros1", "sqlite3", "mcap")


def write_bag(
    path: Path,
    kind: str,
    packing: str = "raw",
    depth_frame: str = OPTICAL,
    mover: str | None = BODY,
    info: bool = True,
    count: int = 4,
) -> Path:
    """Frames at 10 to 10.3 s; depth is 4 ms late; body poses come every 10 ms, one of them at each picture's time."""
    names = ("/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw")
    with Writer(path, kind) as bag:
        bag.transform("/tf_static", BODY, OPTICAL, 0.0, OPTICAL_IN_BODY)
        if info:
            bag.info("/camera/color/camera_info", OPTICAL, LENS)
            bag.info("/camera/aligned_depth_to_color/camera_info", depth_frame, LENS)
        for number, frame in enumerate(truth()[:count]):
            seconds = 10 + number / 10
            if mover:
                body = frame.camera.world_from_cam @ invert_pose(OPTICAL_IN_BODY)
                bag.transform("/tf", ROOT, mover, seconds, body)
            bag.image("/camera/infra1/image_rect_raw", "infra", seconds, frame.color[..., 0].copy(), "mono8")
            codes = np.rint(frame.depth * 1000).astype(np.uint16)
            codes[0, :2] = 0
            metres = frame.depth.copy()
            metres[0, :2] = np.nan
            late, (a, b) = seconds + 0.004, (60000.0, 2.0)
            if packing == "raw":
                bag.image(names[0], OPTICAL, seconds, frame.color[..., ::-1].copy(), "bgr8")
                bag.image(names[1], depth_frame, late, codes, "16UC1")
            elif packing == "float":
                bag.image(names[0], OPTICAL, seconds, frame.color, "rgb8")
                bag.image(names[1], depth_frame, late, metres, "32FC1")
            else:
                inverse = np.where(np.isnan(metres), 0, np.rint(a / np.maximum(metres, 1e-3) + b)).astype(np.uint16)
                kind, head, stored = ("32FC1", (a, b), inverse) if packing == "quantised" else ("16UC1", (0, 0), codes)
                bag.packed(f"{names[0]}/compressed", OPTICAL, seconds, png(frame.color), "bgr8; png compressed bgr8")
                if packing in ("packed", "plain"):
                    bag.packed(f"{names[1]}/compressed", depth_frame, late, png(codes), "16UC1; png compressed ")
                if packing != "plain":
                    codec, pack = ("rvl", as_rvl) if packing == "rvl" else ("png", png)
                    data = struct.pack("<iff", 0, *head) + pack(stored)
                    name = f"{names[1]}/compressedDepth"
                    bag.packed(name, depth_frame, late, data, f"{kind}; compressedDepth {codec}")
    return path


def png(values: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(values).save(stream, "PNG")
    return stream.getvalue()


@pytest.mark.parametrize("kind", KINDS)
def test_frames_are_those_of_the_world(tmp_path: Path, kind: str) -> None:
    """Axes through two transforms, units, times, channels and padded rows; the infrared topic is not taken for the colour."""
    path = write_bag(tmp_path / ("a.bag" if kind == "ros1" else "a"), kind)
    assert detect(path) == detect(tmp_path) == "rosbag"
    check_frames(open_dataset(path))
    inside = next(each for each in (path, *path.glob("*.db3"), *path.glob("*.mcap")) if each.is_file())
    assert len(open_frames(inside)) == 4
    assert "layout rosbag, 4 frames" in diagnose(inside)[-1].what


@pytest.mark.parametrize("packing", ["float", "packed", "rvl", "quantised", "plain"])
def test_other_encodings(tmp_path: Path, packing: str) -> None:
    """Depth in float metres, as packed PNG or RVL, and quantised by a / (code - b), whose steps are z^2 / a; and as a PNG next to
    it in the same bag, as `rosbag record -a` has it, which was taken for the picture, being first by name."""
    check_frames(open_dataset(write_bag(tmp_path / "a.bag", "ros1", packing=packing)), half_unit_m=0.0009)


def test_depth_of_another_camera_is_registered(tmp_path: Path) -> None:
    """A depth camera 5 cm next to the colour camera, with other pixels: its depth comes to lie on the world as colour sees it."""
    side = pose_of((0, 0, 0), (0.05, 0, 0))
    lens = Camera(128, 96, 110.0, 110.0, 64.5, 47.5)
    with Writer(tmp_path / "a.bag", "ros1") as bag:
        bag.transform("/tf_static", OPTICAL, "depth_optical", 0.0, side)
        bag.info("/color/camera_info", OPTICAL, LENS)
        bag.info("/depth/camera_info", "depth_optical", lens)
        for number, camera in enumerate(cameras()):
            bag.transform("/tf", ROOT, OPTICAL, 10 + number, camera.world_from_cam)
            bag.image("/color/image_raw", OPTICAL, 10 + number, WORLD.rgbd(camera).color, "rgb8")
            seen = WORLD.rgbd(lens.at(camera.world_from_cam @ side)).depth
            bag.image("/depth/image_raw", "depth_optical", 10 + number, seen, "32FC1")
    for frame, true in zip(open_frames(tmp_path / "a.bag"), truth()):
        check_registered(frame.load(), true)


def test_poses_between_two_transforms_are_interpolated() -> None:
    """Closed form: half of the way and half of the turn; beyond a quarter second nothing is known."""

    def pose(shift: float, z: float, w: float) -> Any:
        turn, place = SimpleNamespace(x=0.0, y=0.0, z=z, w=w), SimpleNamespace(x=shift, y=0.0, z=0.0)
        return SimpleNamespace(translation=place, rotation=turn)

    found = Transforms()
    found.add("cam", "map", 1.0, pose(0, 0, 1), False, "test")
    found.add("/cam", "/map", 1.2, pose(2, 0.5**0.5, 0.5**0.5), False, "test")
    middle = found.root_from("cam", 1.1)
    assert middle is not None and middle[0, 3] == pytest.approx(1)
    assert rotation_deg(middle[None, :3, :3], np.eye(3))[0] == pytest.approx(45)
    assert found.root_from("cam", 1.6) is None and found.between("cam", "elsewhere", 1.1) is None


def test_what_a_bag_lacks_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """One line each: no moving transform, no camera_info, no transform to the depth camera, no depth, no bag."""
    still = f"holds no moving transform (/tf) of the camera's frame '{OPTICAL}': the camera is taken as standing still"
    # of a robot, whose camera does not move with it, or by frames that are not in the bag
    for mover in (None, "wheel"):
        caplog.clear()
        frames = open_frames(write_bag(tmp_path / f"{mover}.bag", "ros1", mover=mover))
        assert len(frames) == 4 and still in caplog.text
    assert any(still in found.what for found in diagnose(tmp_path / "wheel.bag"))
    with pytest.raises(FileError, match=r"a.bag, /camera/color/image_raw: has no camera_info next to it"):
        open_frames(write_bag(tmp_path / "a.bag", "ros1", info=False, count=1))
    words = "depth is in the frame 'other' and colour in .*, and no transform leads from one"
    with pytest.raises(FileError, match=words):
        open_frames(write_bag(tmp_path / "b.bag", "ros1", depth_frame="other", count=1))
    with Writer(tmp_path / "c.bag", "ros1") as bag:
        bag.image("/color", OPTICAL, 1.0, truth()[0].color, "rgb8")
    with pytest.raises(FileError, match=r"c.bag: a colour and a depth topic are expected; of pictures it has /color"):
        open_frames(tmp_path / "c.bag")
    whole = write_bag(tmp_path / "d.bag", "ros1", count=1).read_bytes()
    for data in (b"no bag", whole[: len(whole) // 2]):
        (tmp_path / "e.bag").write_bytes(data)
        with pytest.raises(FileError, match=r"e.bag: is no readable bag"):
            open_frames(tmp_path / "e.bag")


def small_bag(
    path: Path, color: str, values: np.ndarray, encoding: str, late: float = 0.0, per_metre: float = 1, **info: Any
) -> Path:
    """One frame with depth registered to it."""
    with Writer(path, "ros1") as bag:
        bag.info(f"{color}/camera_info", OPTICAL, info.pop("camera", LENS), **info)
        kind = "image_rect_color" if "rectified" in info else "image_raw"
        bag.image(f"{color}/{kind}", OPTICAL, 1.0, values, encoding)
        bag.image(f"{color}/depth_rect", OPTICAL, 1.0 + late, truth()[0].depth * np.float32(per_metre), "32FC1")
    return path


@pytest.mark.parametrize(
    ("model", "terms"), [("equidistant", (0.0,) * 4), ("rational_polynomial", (0.5, 0, 0, 0, 0, 0.2, 0, 0))]
)
def test_distortion_of_other_models_is_warned_of(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, model: str, terms: tuple[float, ...]
) -> None:
    """Closed form: a fisheye lens draws a ray at r (z = 1) at atan r; k1 and k4 of the rational model at r (1 + k1 r2) /
    (1 + k4 r2)."""
    open_frames(small_bag(tmp_path / "a.bag", "/c", truth()[0].color, "rgb8", distortion=terms, model=model))
    shifts = []
    for u, v in ((0, 0), (96, 0), (0, 72), (96, 72)):
        off = np.array([u - LENS.cx + 0.5, v - LENS.cy + 0.5])
        r = float(np.hypot(*(off / (LENS.fx, LENS.fy))))
        drawn = np.arctan(r) if model == "equidistant" else r * (1 + 0.5 * r**2) / (1 + 0.2 * r**2)
        shifts.append(np.hypot(*off) * abs(drawn / r - 1))
    assert f"moves the picture's corners by {max(shifts):.1f} px; it is not undone" in caplog.text


def test_rectified_pictures_have_the_camera_of_the_rectified_ones(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Law of sensor_msgs/CameraInfo: P is the camera of the rectified pictures, in which nothing is distorted."""
    raw = Camera(96, 72, 70.0, 70.0, 40.0, 30.0)
    info = {"camera": raw, "rectified": LENS, "distortion": (-0.3, 0.1, 0.0, 0.0, 0.0)}
    (frame,) = open_frames(small_bag(tmp_path / "a.bag", "/direct/rgb", truth()[0].color, "rgb8", **info))
    assert np.allclose(frame.load().camera.K, LENS.K) and "distortion" not in caplog.text


def test_a_part_of_the_sensor_has_its_own_camera(tmp_path: Path) -> None:
    """Law of sensor_msgs/CameraInfo: K is the whole sensor's; a ray of column u of the picture is of column binning u + offset
    there, of pixels counted from 0."""
    whole = Camera(300, 200, 2 * LENS.fx, 3 * LENS.fy, 120.5, 110.5)
    info = {"camera": whole, "region": (40, 20, 192, 216), "binning": (2, 3)}
    (frame,) = open_frames(small_bag(tmp_path / "a.bag", "/c", truth()[0].color, "rgb8", **info))
    found = frame.load().camera
    assert np.allclose((found.fx, found.fy), (LENS.fx, LENS.fy)) and found.wh == (96, 72)
    assert np.allclose(2 * (found.cx - 0.5) + 40, 120) and np.allclose(3 * (found.cy - 0.5) + 20, 110)


def test_what_cannot_be_read_of_a_bag_is_named(tmp_path: Path) -> None:
    """One line each: an encoding, a camera that was not calibrated, depth that comes too late."""
    color = truth()[0].color
    words = "of pictures it has /c/depth_rect; /c/image_raw has the encoding bayer_rggb16, which"
    with pytest.raises(FileError, match=words):
        open_frames(small_bag(tmp_path / "a.bag", "/c", color[..., 0].astype(np.uint16), "bayer_rggb16"))
    with pytest.raises(FileError, match=r"1 without depth within 0.02 s"):
        open_frames(small_bag(tmp_path / "b.bag", "/c", color, "rgb8", late=0.03))
    with pytest.raises(CameraError, match=r"K is zero everywhere: the camera was not calibrated"):
        open_frames(small_bag(tmp_path / "c.bag", "/c", color, "rgb8", uncalibrated=True))


@pytest.mark.parametrize("encoding", ["bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8"])
def test_pictures_as_a_colour_sensor_sees_them(tmp_path: Path, encoding: str) -> None:
    """Closed form: any interpolation of a mosaic gives back one colour all over; a step of brightness stays where it is."""
    picture = np.full((72, 96, 3), (200, 120, 40), np.uint8)
    picture[:, 48:] //= 2
    channel = np.array(["rgb".index(letter) for letter in encoding[6:10]]).reshape(2, 2)
    mosaic = np.take_along_axis(picture, np.tile(channel, (36, 48))[..., None], 2)[..., 0]
    (frame,) = open_frames(small_bag(tmp_path / "a.bag", "/c", mosaic, encoding))
    read = frame.load().color
    away = np.abs(np.arange(96) - 47.5) > 3
    np.testing.assert_array_equal(read[2:-2, away], picture[2:-2, away])


def test_a_grey_picture_in_place_of_one_that_is_not_read(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """One line: the colour topic's encoding is unknown, so that the infrared camera's picture is taken; depth has 64 bits."""
    color, depth = truth()[0].color, truth()[0].depth
    with Writer(tmp_path / "a.bag", "ros1") as bag:
        for topic, values, encoding in (
            ("/c/image_raw", color.astype(np.uint16), "rgb16"),
            ("/c/ir/image_raw", color[..., 0].copy(), "mono8"),
            ("/c/depth", depth.astype(np.float64), "64FC1"),
        ):
            bag.info(f"{topic.rsplit('/', 1)[0]}/camera_info", OPTICAL, LENS)
            bag.image(topic, OPTICAL, 1.0, values, encoding)
    (frame,) = open_frames(tmp_path / "a.bag")
    words = "/c/ir/image_raw, which is grey, is taken for the picture; /c/image_raw has the encoding rgb16"
    assert words in caplog.text
    np.testing.assert_array_equal(frame.load().depth, depth)


def test_float_depth_in_millimetres_is_warned_of(tmp_path: Path) -> None:
    """Oracle: 32FC1 of millimetres, which a bag calls metres (a file with such depth is refused)."""
    small_bag(tmp_path / "a.bag", "/c", truth()[0].color, "rgb8", per_metre=1000)
    with pytest.warns(UserWarning, match=r"the median depth is \d+ m: metres are expected; divide millimetres by 1000"):
        sequence(tmp_path / "a.bag", filler="telea")


def test_a_bag_that_is_no_longer_kept_is_closed(tmp_path: Path) -> None:
    """Oracle: what the package says of its own reader."""
    bag = Bag(write_bag(tmp_path / "a.bag", "ros1", count=1))
    reader = bag.reader
    assert next(reader.messages())
    del bag
    with pytest.raises(rosbags.highlevel.AnyReaderError, match="not open"):
        next(reader.messages())


def test_without_the_package_it_says_which(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.bag").write_bytes(b"#ROSBAG V2.0\n")
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(MissingExtraError, match=r"a bag of ROS needs .*pip install 'dlama\[ros\]'"):
        open_frames(tmp_path / "a.bag")
