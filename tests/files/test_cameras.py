"""Camera files: there and back, pixel centres, Middlebury calibrations, EXIF, and errors that name file and field."""

from __future__ import annotations

import json
import math
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from dlama.datasets.stereo_folder import stereo_folder
from dlama.errors import CameraError, FileError, InputError
from dlama.files.cameras import camera_as_json, camera_for, read_camera, read_cameras, read_stereo_calib, write_camera
from dlama.files.results.meta_json import describe_source
from dlama.geometry.camera import Camera

TURN = np.array([[0, 0, 1, 0.1], [0, 1, 0, -2], [-1, 0, 0, 1e6 + 0.123456789], [0, 0, 0, 1.0]])
PLAIN: dict[str, Any] = {"width": 640, "height": 480, "fx": 500, "fy": 510, "cx": 319.5, "cy": 239.5}
CALIB = """cam0=[994.978 0 311.193; 0 994.978 254.877; 0 0 1]
cam1=[994.978 0 342.279; 0 994.978 254.877; 0 0 1]
doffs=31.086
baseline=193.001
width=741
height=500
ndisp=70
isint=0
"""


def matrix(fx: float, cx: float, cy: float, fy: float | None = None) -> list[list[float]]:
    return [[fx, 0, cx], [0, fx if fy is None else fy, cy], [0, 0, 1]]


STEREO: dict[str, Any] = {
    "left_K": matrix(300, 160, 120),
    "right_K": matrix(300, 164, 120),
    "baseline_m": 0.12,
    "doffs": 4,
}


def saved(path: Path, values: object) -> Path:
    path.write_text(values if isinstance(values, str) else json.dumps(values), encoding="utf-8")
    return path


number = st.floats(1e-3, 1e5)


@pytest.mark.filterwarnings("ignore:.*(such an|the middle of a picture|not square)")
@settings(max_examples=40, deadline=None)
@given(f=st.tuples(number, number), c=st.tuples(st.floats(0, 640), st.floats(0, 480)))
def test_there_and_back_exactly(tmp_path_factory: pytest.TempPathFactory, f: tuple, c: tuple) -> None:
    path = tmp_path_factory.mktemp("c") / "camera.json"
    camera = Camera(640, 480, *f, *c, TURN)
    write_camera(path, camera)
    back = read_camera(path, hw=(480, 640))
    assert camera_as_json(back) == camera_as_json(camera) == json.loads(path.read_text())
    assert np.array_equal(back.world_from_cam, TURN)


def test_pixel_center_moves_the_principal_point(tmp_path: Path) -> None:
    """Oracle: HOUSE.md: 0.0 files say 319.5 for the middle of 640 pixels, we say 320."""
    zero = read_camera(saved(tmp_path / "z.json", {**PLAIN, "pixel_center": 0.0}))
    half = read_camera(saved(tmp_path / "h.json", {**PLAIN, "pixel_center": 0.5}))
    noted = {**PLAIN, "intrinsics_from": "fov"}  # as meta.json has it, after a byte order mark
    none = read_camera(saved(tmp_path / "n.json", "\ufeff" + json.dumps(noted)))
    assert (zero.cx, zero.cy) == (320, 240) and (half.cx, half.cy) == (none.cx, none.cy) == (319.5, 239.5)
    assert (zero.fx, zero.fy) == (500, 510) and np.array_equal(zero.world_from_cam, np.eye(4))


def test_the_meta_json_of_a_3d_photo_has_the_camera_of_its_picture(tmp_path: Path) -> None:
    """Round trip: it has no view of its own, and so neither `cameras` nor `camera`."""
    meta = describe_source(read_camera(saved(tmp_path / "c.json", PLAIN)), "camera c.json")
    back = read_camera(saved(tmp_path / "meta.json", meta), hw=(480, 640))
    assert {**camera_as_json(back), "intrinsics_from": "camera c.json"} == meta["source_camera"]


def changed(base: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Fields of another value, and without those that are `...`."""
    return {name: value for name, value in {**base, **change}.items() if value is not ...}


@pytest.mark.parametrize(
    ("read", "change", "words"),
    [
        (read_camera, {"cy": ...}, r"'cy' is missing; it has width, height"),
        (read_camera, {"K": matrix(500, 320, 240)}, "K and fx, fy, cx, cy are both given"),
        (read_camera, {"fx": None}, "fx is null"),
        (read_camera, {"fy": "500"}, 'fy is "500"'),
        (read_camera, {"fx": 0}, "fx is 0.*singular"),
        (read_camera, {"fy": -5}, "fy is -5.*negative"),
        (read_camera, {"cx": math.nan}, "cx is nan"),
        (read_camera, {"width": 0}, "width is 0"),
        (read_camera, {"width": 640.5}, "width is 640.5"),
        (read_camera, {"height": True}, "height is true"),
        (read_camera, {"pixel_center": 1}, "pixel_center is 1"),
        (read_camera, {"world_from_cam": np.zeros((3, 4)).tolist()}, "world_from_cam is .*4x4"),
        (read_camera, {"world_from_cam": np.diag([1, 1, 2, 1]).tolist()}, "not a rigid motion"),
        (read_camera, {"world_from_cam": np.diag([1, 1, -1, 1]).tolist()}, "mirroring"),
        (read_camera, {"world_from_cam": "identity"}, "world_from_cam is .*4x4"),
        (read_stereo_calib, {"height": None}, "height is null"),
        (read_stereo_calib, {"doffs": 4.02}, "doffs is 4.02, but cx of right_K minus cx of left_K is 4"),
        (read_stereo_calib, {"doffs": ..., "right_K": ...}, "neither right_K nor doffs"),
        (read_stereo_calib, {"baseline_m": 0}, "baseline is 0 m"),
        (read_stereo_calib, {"right_K": matrix(301, 164, 120)}, "fx is 300.0 left and 301.0 right"),
    ],
)
def test_bad_fields_are_named(tmp_path: Path, read: Any, change: dict[str, Any], words: str) -> None:
    base, hw = (PLAIN, None) if read is read_camera else (STEREO, (240, 320))
    path = saved(tmp_path / "bad.json", changed(base, change))
    with pytest.raises(CameraError, match=words) as caught:
        read(path, hw=hw)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_fields_of_others_are_warned_of(tmp_path: Path) -> None:
    """Law: camera files of data sets carry notes; the camera is the one without them, and a misspelt pose is seen."""
    more = {"source": "a kinect", "world_from_cma": np.eye(4).tolist()}
    pair = {**STEREO, "width": 320, "height": 240}
    for read, values, name in ((read_camera, PLAIN, "c.json"), (read_stereo_calib, pair, "s.json")):
        expected = read(saved(tmp_path / name, values))
        with pytest.warns(UserWarning, match=rf"{name}: .*not used: 'source', 'world_from_cma'; known are"):
            found = read(saved(tmp_path / name, {**values, **more}))
        assert repr(found) == repr(expected)
    with pytest.warns(UserWarning, match=r"l\.json: .*not used: 'source', 'world_from_cma'; known are name, width"):
        assert len(read_cameras(saved(tmp_path / "l.json", [PLAIN, {**PLAIN, **more}]))) == 2


def test_bad_files(tmp_path: Path) -> None:
    for data in (b"{", b"[1, 2]", b"\0", b"\xff\xfe\x00"):
        (tmp_path / "b.json").write_bytes(data)
        with pytest.raises(FileError, match=r"b\.json"):
            read_camera(tmp_path / "b.json")
    for text, words in (
        ("[" * 100_000, "is no JSON"), ('[{"width": 3,}]', r"c\.json:1:1[34]: is no JSON"), ("3", "holds no list"),
    ):  # fmt: skip
        with pytest.raises(FileError, match=words):
            read_cameras(saved(tmp_path / "c.json", text))
    with pytest.raises(FileError, match="no such file"):
        read_camera(tmp_path / "none.json")
    with pytest.raises(CameraError, match="camera is 640x480 and the picture 320x240"):
        read_camera(saved(tmp_path / "d.json", PLAIN), hw=(240, 320))


def test_calib_txt(tmp_path: Path) -> None:
    """Oracle: the Middlebury format's text: baseline in mm, first pixel's centre at 0, doffs = cx1 - cx0."""
    path = saved(tmp_path / "calib.txt", CALIB)
    rig = read_stereo_calib(path, hw=(500, 741))
    assert (rig.left.fx, rig.left.cx, rig.left.cy) == (994.978, 311.693, 255.377)
    assert rig.baseline_m == pytest.approx(0.193001, abs=1e-12) and rig.doffs == pytest.approx(31.086, abs=1e-9)
    assert rig.right.cx == pytest.approx(342.779) and rig.left.wh == rig.right.wh == (741, 500)
    assert rig.right.world_from_cam[:3, 3].tolist() == [rig.baseline_m, 0, 0]
    assert camera_as_json(read_camera(path)) == camera_as_json(rig.left)


KITTI = """P0: 7.18856e+02 0 6.071928e+02 0 0 7.18856e+02 1.852157e+02 0 0 0 1 0
P1: 7.18856e+02 0 6.071928e+02 -3.861448e+02 0 7.18856e+02 1.852157e+02 0 0 0 1 0
P2: 7.18856e+02 0 6.071928e+02 4.538225e+01 0 7.18856e+02 1.852157e+02 -1.130887e-01 0 0 1 3.779761e-03
P3: 7.18856e+02 0 6.071928e+02 -3.372877e+02 0 7.18856e+02 1.852157e+02 2.369057e+00 0 0 1 4.915215e-03
"""
"""Of its odometry sequence 00, as published, with fewer digits."""


def test_a_camera_of_open3d(tmp_path: Path) -> None:
    """Oracle: Open3D's PinholeCameraIntrinsic of its default PrimeSense camera, written by its recorder: K column by column, the
    first pixel at 0, and fields of the recording."""
    text = """{"color_mode": "MJPG_1080P", "width": 640, "height": 480,
        "intrinsic_matrix": [525.0, 0.0, 0.0, 0.0, 526.0, 0.0, 319.5, 239.5, 1.0]}"""
    camera = read_camera(saved(tmp_path / "camera_intrinsic.json", text), hw=(480, 640))
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (525, 526, 320, 240)
    with pytest.raises(CameraError, match="the camera is 640x480 and the picture 320x240"):
        read_camera(tmp_path / "camera_intrinsic.json", hw=(240, 320))


def test_a_view_saved_in_the_window_of_open3d(tmp_path: Path) -> None:
    """Oracle: Open3D's PinholeCameraParameters, what its window saves by P: world to camera, column by column. A camera 3 m to
    the right, turned left by 90 degrees, has its x axis along the world's z and looks back along the world's x."""
    lens = {"height": 480, "intrinsic_matrix": [525.0, 0, 0, 0, 526.0, 0, 319.5, 239.5, 1], "width": 640}
    columns = [0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 3, 1]
    view = {"class_name": "PinholeCameraParameters", "extrinsic": columns, "intrinsic": lens, "version_major": 1}
    camera = read_camera(saved(tmp_path / "ScreenCamera.json", json.dumps(view)))
    assert (camera.wh, camera.fy, camera.cx) == ((640, 480), 526, 320)
    np.testing.assert_array_equal(camera.world_from_cam[:3], [[0, 0, -1, 3], [0, 1, 0, 0], [1, 0, 0, 0]])
    twice = json.dumps(view | {"extrinsic": [2 * number for number in columns]})
    with pytest.raises(CameraError, match=r"Twice\.json: world_from_cam .*is expected"):
        read_camera(saved(tmp_path / "Twice.json", twice))


@pytest.mark.parametrize(
    "text",
    [
        "525 0 319.5\n0 526 239.5\n0 0 1\n",
        "525 0 319.5 0\n0 526 239.5 0\n0 0 1 0\n0 0 0 1",
        "525.0, 526.0, 319.5, 239.5\n",
    ],
    ids=["3x3", "4x4", "fx fy cx cy"],
)
def test_a_text_of_K_alone(tmp_path: Path, text: str) -> None:
    """Closed form: as BOP, ScanNet and ETH3D write it, the first pixel's centre at 0.0, the size that of the picture."""
    camera = read_camera(saved(tmp_path / "K.txt", text), hw=(480, 640))
    assert (camera.wh, camera.fx, camera.fy, camera.cx, camera.cy) == ((640, 480), 525, 526, 320, 240)
    with pytest.raises(CameraError, match=r"K\.txt: K is .*\(no skew\)"):
        read_camera(saved(tmp_path / "K.txt", "525 1 320 0 526 240 0 0 1"), hw=(480, 640))


def test_what_is_no_calib_txt(tmp_path: Path) -> None:
    """A camera of COLMAP: the line that is none, and what else is a camera file."""
    path = saved(tmp_path / "cameras.txt", "# Camera list\n1 PINHOLE 640 480 526 526 320 240\n")
    with pytest.raises(FileError, match=r"cameras\.txt: .*a line is '# Camera list'; 'name=value' is expected"):
        read_camera(path)


@pytest.mark.parametrize("raw", [False, True])
def test_calibrations_of_kitti(tmp_path: Path, raw: bool) -> None:
    """Oracle: the baseline of its colour cameras as its paper has it, 0.54 m (0.532 by calibration), the first pixel at 0; the
    size of its raw pictures (S_rect)."""
    text = f"calib_time: 09-Jan-2012 13:57:47\n{KITTI.replace('P', 'P_rect_0')}" if raw else KITTI
    rig = read_stereo_calib(saved(tmp_path / "calib.txt", text), hw=(376, 1241))
    assert rig.baseline_m == pytest.approx(0.5323, abs=1e-4) and rig.doffs == 0
    assert (rig.left.fx, rig.left.cx, rig.left.cy) == (718.856, pytest.approx(607.6928), pytest.approx(185.7157))
    assert read_camera(tmp_path / "calib.txt", hw=(376, 1241)).cx == rig.left.cx
    of_raw = f"S_rect_02: 1.241000e+03 3.760000e+02\n{text}"
    assert read_stereo_calib(saved(tmp_path / "raw.txt", of_raw)).left.wh == (1241, 376)
    with pytest.raises(CameraError, match=r"the camera is 1241x376 and the picture 620x188"):
        read_stereo_calib(tmp_path / "raw.txt", hw=(188, 620))
    for wrong in (KITTI.replace("-3.372877e+02", "x"), KITTI.replace("P3", "P5")):
        with pytest.raises(FileError, match=r"no calib.txt of Middlebury or KITTI"):
            read_stereo_calib(saved(tmp_path / "calib.txt", wrong), hw=(376, 1241))


ROS = """image_width: 640
image_height: 480
camera_name: head_camera
camera_matrix:
  rows: 3
  cols: 3
  data: [500.5, 0.0, 319.5, 0.0, 501.0, 239.5, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.0, 0.0, 0.0, 0.0, 0.0]
"""


@pytest.mark.parametrize(
    ("text", "old", "new", "words"),
    [
        (CALIB, "doffs=31.086", "doffs=31.2", "doffs is 31.2, but cx of cam1 minus cx of cam0 is 31.086"),
        (CALIB, "baseline=193.001", "baseline=-1", "baseline is -0.001 m"),
        (CALIB, "baseline=193.001\n", "", "'baseline' is missing"),
        (CALIB, "0 994.978 254.877; 0 0 1]\ncam1", "0.3 994.978 254.877; 0 0 1]\ncam1", "cam0 is .*no skew"),
        (CALIB, "cam0=[994.978", "cam0=[0", "singular"),
        (CALIB, "width=741", "width=740", "camera is 740x500 and the picture 741x500"),
        (CALIB, "width=741\n", "", "'width' is missing"),
        (CALIB, "doffs=31.086", "doffs", "no calib.txt of Middlebury or KITTI"),
        (CALIB, "; 0 0 1]\ndoffs", "; 0 0]\ndoffs", "cam1 is .*3x3"),
        (CALIB, "ndisp=70", "baseline=193.001", "field 'baseline' is given twice"),
        (CALIB, "baseline=193.001", "baseline=1e-300", "baseline is 1e-303 m; a distance of 1e-06 to 1e"),
        (ROS, "camera_matrix:", "matrix:", "camera_matrix has 0 numbers; 9 are expected"),
        (ROS, "[500.5, 0.0", "[oops, 0.0", "cannot be read; the YAML or XML of a camera is expected, as ROS"),
        (ROS, "[500.5, 0.0", "[500.5", "camera_matrix has 8 numbers"),
        (ROS, "[500.5, 0.0", "[500.5, 1.0", "no skew"),
        (ROS, "image_width: 640", "image_width: 641", "the camera is 641x480 and the picture 640x480"),
        (ROS, "image_width: 640", "\t- [", "cannot be read"),
    ],
)
def test_bad_texts(tmp_path: Path, text: str, old: str, new: str, words: str) -> None:
    """Of Middlebury's calib.txt and of ROS."""
    name, read, hw = ("a.txt", read_stereo_calib, (500, 741)) if text is CALIB else ("a.yaml", read_camera, (480, 640))
    assert old in text
    with pytest.raises(InputError, match=words) as caught:
        read(saved(tmp_path / name, text.replace(old, new)), hw=hw)
    assert str(caught.value).startswith(str(tmp_path / name))


@pytest.mark.parametrize("missing", [(), ("doffs",), ("right_K",)])
def test_stereo_json_completes_itself(tmp_path: Path, missing: tuple[str, ...]) -> None:
    for center, border in ((0.5, 0), (0.0, 0.5)):
        values = changed(STEREO, {**dict.fromkeys(missing, ...), "pixel_center": center})
        rig = read_stereo_calib(saved(tmp_path / "s.json", values), hw=(240, 320))
        assert (rig.left.cx, rig.right.cx, rig.left.cy) == (160 + border, 164 + border, 120 + border)
        assert (rig.doffs, rig.baseline_m) == (4, 0.12)


def test_the_calib_json_of_a_stereo_folder(tmp_path: Path) -> None:
    """Oracle: the rig with which the folder's layout reads it; of the camera of one picture the line says what a pair has."""
    for name in ("left", "right"):
        Image.new("RGB", (320, 240)).save(tmp_path / f"{name}.png")
    np.savez(tmp_path / "disparity.npz", disparity=np.full((240, 320), 9, np.float32))
    path, change = tmp_path / "calib.json", {"left_K": ..., "right_K": ..., "K": matrix(300, 160, 120)}
    for doffs in (4.0, ...):
        saved(path, changed(STEREO, {**change, "pixel_center": ..., "doffs": doffs}))
        rig = read_stereo_calib(path, hw=(240, 320))
        expected = stereo_folder(tmp_path).cases[0].load().rig
        assert rig.left.same_view_as(expected.left) and rig.right.same_view_as(expected.right)
    with pytest.raises(CameraError, match=r"'left_K' is missing; left_K, right_K or doffs, and baseline_m of a pair"):
        read_stereo_calib(saved(tmp_path / "camera.json", PLAIN))


def test_camera_from_flags_or_a_file(tmp_path: Path) -> None:
    """Oracle: f = w / 2 / tan(fov / 2); EasySynth's 512 pixels at 90 degrees have f = 256."""
    path = saved(tmp_path / "c.json", {**PLAIN, "world_from_cam": TURN.tolist()})
    camera, source = camera_for((480, 640), camera=path)
    assert np.array_equal(camera.world_from_cam, TURN) and source == "camera c.json"
    camera, source = camera_for((512, 512), fov=90)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == pytest.approx((256, 256, 256, 256)) and source == "fov"
    camera, source = camera_for((480, 640), fx=500)
    assert (camera.fx, camera.fy, camera.cx, camera.cy, source) == (500, 500, 320, 240, "fx")
    camera, _ = camera_for((480, 640), fx=500, fy=505, cx=319.5, cy=238, pixel_center=0.0)
    assert (camera.fy, camera.cx, camera.cy) == (505, 320, 238.5)


@pytest.mark.parametrize("kind", ["yml", "xml"])
def test_the_yaml_of_ros_and_what_opencv_writes(tmp_path: Path, kind: str) -> None:
    """Oracles: the numbers of camera_info, whose first pixel has its centre at 0; what cv2.FileStorage itself writes."""
    camera = read_camera(saved(tmp_path / "info.yaml", ROS), hw=(480, 640))
    assert (camera.wh, camera.fx, camera.fy, camera.cx, camera.cy) == ((640, 480), 500.5, 501, 320, 240)
    written = cv2.FileStorage(str(tmp_path / f"cv.{kind}"), cv2.FILE_STORAGE_WRITE)
    written.write("camera_matrix", np.array([[500.5, 0, 319.5], [0, 501.0, 239.5], [0, 0, 1]]))
    written.write("distortion_coefficients", np.zeros((1, 5)))
    written.release()
    assert read_camera(tmp_path / f"cv.{kind}", hw=(480, 640)).same_view_as(camera)
    text = (tmp_path / f"cv.{kind}").read_text().replace("camera_matrix", "Camera_Matrix")  # as Metashape calls it
    assert read_camera(saved(tmp_path / f"m.{kind}", text), hw=(480, 640)).same_view_as(camera)
    with pytest.raises(FileError, match=rf"bad\.{kind}: cannot be read; the YAML or XML of a camera is expected"):
        read_camera(saved(tmp_path / f"bad.{kind}", text.replace("500.5", "many")))


NUMBERS = {"d": [0.0] * 5, "k": [500.5, 0.0, 319.5, 0.0, 501.0, 239.5, 0.0, 0.0, 1.0], "r": [1.0, 0.0]}
PRINTED = "header:\n  stamp:\n    sec: 1\n  frame_id: optical\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\n"


@pytest.mark.parametrize("times", [1, 2])
def test_the_message_that_ros_prints(tmp_path: Path, times: int) -> None:
    """Oracle: the numbers of CameraInfo, printed as rostopic echo (one line a list) and ros2 topic echo (one a number) do."""
    old = PRINTED + "".join(f"{name.upper()}: {found}\n" for name, found in NUMBERS.items())
    lists = {name: "".join(f"- {one}\n" for one in found) for name, found in NUMBERS.items()}
    new = PRINTED + "".join(f"{name}:\n{found}" for name, found in lists.items())
    for text in (old, new):
        camera = read_camera(saved(tmp_path / "info.yaml", f"{text}roi:\n  height: 0\n---\n" * times), hw=(480, 640))
        assert (camera.wh, camera.fx, camera.fy, camera.cx, camera.cy) == ((640, 480), 500.5, 501, 320, 240)


def test_a_distortion_is_warned_of(tmp_path: Path) -> None:
    """Pictures that image_rect made undistorted have the projection matrix, which the warning names."""
    bent = ROS.replace("data: [0.0", "data: [0.1")
    with pytest.warns(UserWarning, match=r"its distortion \(0.1, 0, .*is not used: .* to be undistorted"):
        read_camera(saved(tmp_path / "d.yaml", bent))
    bent += "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [480.0, 0, 310.5, 0, 0, 481.0, 240.5, 0, 0, 0, 1, 0]\n"
    with pytest.warns(UserWarning, match=r"give `fx=480` `fy=481` `cx=310.5` `cy=240.5` `pixel_center=0.0`\)"):
        read_camera(saved(tmp_path / "d.yaml", bent))


@pytest.mark.parametrize("unit", [1, 1000])
def test_the_yaml_of_a_pair(tmp_path: Path, unit: int, recwarn: pytest.WarningsRecorder) -> None:
    """Oracles: camera_info's convention, Tx = -fx B of the right camera; and what cv2.stereoRectify gives, in metres or
    millimetres, of two cameras 63 mm apart."""
    numbers = ", ".join(map(str, [500.0, 0, 319.5, -500 * 0.063, 0, 500.0, 239.5, 0, 0, 0, 1, 0]))
    right = f"{ROS}projection_matrix:\n  rows: 3\n  cols: 4\n  data: [{numbers}]\n"
    ros = read_stereo_calib(saved(tmp_path / "right.yaml", right))
    assert (ros.left.wh, ros.left.fx, ros.left.cx, ros.right.cx) == ((640, 480), 500, 320, 320)
    assert ros.baseline_m == pytest.approx(0.063)
    K = np.array([[500.0, 0, 319.5], [0, 500, 239.5], [0, 0, 1]])
    apart = np.array([[-0.063 * unit], [0], [0]])
    _, _, P1, P2, *_ = cv2.stereoRectify(K, np.zeros(5), K, np.zeros(5), (640, 480), np.eye(3), apart)
    written = cv2.FileStorage(str(tmp_path / "cv.yml"), cv2.FILE_STORAGE_WRITE)
    written.write("P1", P1)
    written.write("P2", P2)
    written.release()
    of_opencv = read_stereo_calib(tmp_path / "cv.yml", hw=(480, 640))
    assert of_opencv.baseline_m == pytest.approx(0.063 * unit)
    assert of_opencv.left.fx == pytest.approx(P1[0, 0]) and of_opencv.left.cx == pytest.approx(P1[0, 2] + 0.5)
    assert ["calib.txt counts millimetres" in str(one.message) for one in recwarn] == [True] * (unit == 1000)
    left = f"{ROS}projection_matrix:\n  rows: 3\n  cols: 4\n  data: [500, 0, 319.5, 0, 0, 500, 239.5, 0, 0, 0, 1, 0]\n"
    for text, words in ((left, "no baseline, as the left camera's"), (ROS, "no projection matrices of 12 numbers")):
        with pytest.raises(CameraError, match=words):
            read_stereo_calib(saved(tmp_path / "left.yaml", text))


@pytest.mark.parametrize(
    ("K", "words"),
    [
        (matrix(1.0, 1.0, 1.0, 1.3), "`fx` 1 px, wider than any lens.*give `fx=640`"),
        (matrix(4.2, 3.2, 2.4), "`fx` 4.2 px, wider than any lens"),
        (matrix(35, 320, 240), "looks like a lens in millimetres.*`fx=622.22` of a sensor 36 mm wide"),
        (matrix(1000, 640, 480), "the middle of a picture 2 times as large: give `fx=500`"),
        (matrix(500, -20, 239.5), r"k\.json: the principal point \(-20, 239.5\) lies outside"),
        (matrix(256, 320, 240, 26), "`fx` is 256 and `fy` 26, so pixels are not square: leave `fy` away"),
    ],
)
def test_a_matrix_for_another_size_or_unit_is_warned_of(tmp_path: Path, K: list, words: str) -> None:
    """Oracle: K of a picture w px wide, over w (normalised), in mm on the sensor, of twice the size, or with a digit missing."""
    path = saved(tmp_path / "k.json", {"width": 640, "height": 480, "K": K})
    with pytest.warns(UserWarning, match=words):
        read_camera(path)


def test_a_field_of_view_of_no_lens_is_named() -> None:
    """Law: the warning names what was given, fov; nobody gave an fx."""
    with pytest.warns(UserWarning, match=r"^camera options: `fov` is 179 degrees, `fx` 2\.23 px, wider than any lens"):
        camera_for((512, 512), fov=179)


def test_camera_from_exif(tmp_path: Path) -> None:
    """Oracle: 26 mm on film of 43.27 mm diagonal see atan(21.63 / 26) to the corner; so must the picture's corner."""
    exif = Image.Exif()
    exif[0x8769] = {0xA405: 26}  # least Pillow writes it so alone
    Image.new("RGB", (400, 300)).save(tmp_path / "phone.jpg", exif=exif)
    camera, source = camera_for((300, 400), image=tmp_path / "phone.jpg")
    assert math.atan(250 / camera.fx) == pytest.approx(math.atan(math.hypot(18, 12) / 26))
    assert source == "EXIF FocalLengthIn35mmFilm (26 mm)"
    assert camera_for((300, 400), image=tmp_path / "phone.jpg", fov=90)[1] == "fov"


@pytest.mark.parametrize(
    ("sides", "known"),
    [((4000, 3000), True), ((3000, 4000), True), ((4000, 2992), True), ((0, 0), True), ((4000, 4000), False)],
)
def test_a_crop_has_not_the_field_of_view_of_its_exif_data(tmp_path: Path, sides: tuple[int, int], known: bool) -> None:
    """Law: of other proportions than the picture that the camera took; smaller, turned and of a few rows less it still has."""
    exif = Image.Exif()
    exif[0x8769] = {0xA405: 26, 0xA002: sides[0], 0xA003: sides[1]}
    Image.new("RGB", (400, 300)).save(tmp_path / "phone.jpg", exif=exif)
    with nullcontext() if known else pytest.raises(CameraError, match="give fov in degrees"):
        assert camera_for((300, 400), image=tmp_path / "phone.jpg")[1].startswith("EXIF")


def test_no_intrinsics_teach_fov(tmp_path: Path) -> None:
    Image.new("RGB", (8, 6)).save(tmp_path / "plain.jpg")
    for image in (None, tmp_path / "plain.jpg"):
        with pytest.raises(CameraError, match=r"give fov in degrees, .*phone.*65.*camera"):
            camera_for((6, 8), image=image)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"camera": "c.json", "fov": 60}, "camera and fov contradict"),
        ({"camera": "c.json", "pixel_center": 0.0}, "camera and pixel_center contradict each other"),
        ({"fy": 500}, "fy is given without fx"),
        ({"fov": 180}, "fov is 180 degrees; a field of view between 0 and 180"),
        ({"fx": 500, "pixel_center": 1}, "pixel_center is 1"),
    ],
)
def test_contradicting_flags(options: dict[str, Any], words: str) -> None:
    with pytest.raises(CameraError, match=words):
        camera_for((480, 640), **options)


def test_a_matrix_in_the_place_of_four_numbers(tmp_path: Path) -> None:
    """Round trip: K says what fx, fy, cx, cy do; what is no such matrix is refused."""
    K = matrix(PLAIN["fx"], PLAIN["cx"], PLAIN["cy"], PLAIN["fy"])
    of_matrix = {"width": PLAIN["width"], "height": PLAIN["height"], "K": K}
    expected = read_camera(saved(tmp_path / "p.json", PLAIN))
    assert read_camera(saved(tmp_path / "k.json", of_matrix)).same_view_as(expected)
    sizeless = saved(tmp_path / "s.json", {"K": K})
    assert read_camera(sizeless, hw=(480, 640)).same_view_as(expected)
    K[2][2] = 2
    with pytest.raises(CameraError, match=r"bad\.json: K"):
        read_camera(saved(tmp_path / "bad.json", of_matrix))


@pytest.mark.parametrize("read", [read_camera, read_stereo_calib])
def test_a_field_that_stands_twice_is_refused(tmp_path: Path, read: Any) -> None:
    """At any depth of a JSON; oracle: the message names file and field."""
    for text in ('{"fx": 1, "fx": 2}', '{"K": {"left_K": 0, "left_K": 0}}'):
        with pytest.raises(FileError, match=r"c\.json: field '(fx|left_K)' is given twice"):
            read(saved(tmp_path / "c.json", text))


@pytest.mark.parametrize("name", ["calib.txt", "calib.json"])
def test_a_baseline_in_another_unit_is_warned_of(tmp_path: Path, name: str) -> None:
    """Oracle: no camera pair is 0.2 mm wide, or 120 m."""
    values = CALIB.replace("193.001", ".193") if name == "calib.txt" else {**STEREO, "baseline_m": 120}
    with pytest.warns(UserWarning, match=rf"{name}: the baseline is (0.000193|120) m; calib.txt counts millimetres"):
        read_stereo_calib(saved(tmp_path / name, values), hw=(500, 741) if name == "calib.txt" else (240, 320))
