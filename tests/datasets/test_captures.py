"""Recordings of capture apps (oracle: the closed-form world that each folder was written from, by the apps' specifications)."""

from __future__ import annotations

import io
import json
import shutil
import sys
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from dlama.datasets.diagnosis import diagnose
from dlama.datasets.layouts import LAYOUTS, detect, open_dataset
from dlama.datasets.posed.posed_frames import PosedFrame
from dlama.datasets.sequences.loading import open_frames, read_scene_of
from dlama.errors import FileError, MissingExtraError
from dlama.geometry.camera import Camera
from dlama.geometry.motion.poses import invert_pose, quaternion_from_rotation
from posed_folders import LENS, check_frames, truth, write_codes16, write_picture

GL_FROM_CV = np.diag([1.0, -1.0, -1.0, 1.0])
HIGH = {"stray-scanner": 2, "polycam": 255, "record3d": 2, "arkitscenes": 2}
LOW_PLACE = (40, 50)
"""Row and column of the pixel that gets low confidence."""


def confidence(high: int) -> np.ndarray:
    levels = np.full(LENS.hw, high, np.uint8)
    levels[LOW_PLACE] = 0
    return levels


def write_video(path: Path, pictures: list[np.ndarray]) -> None:
    """Without loss, with time stamps at a varying rate, as phones write them."""
    av = pytest.importorskip("av", reason="PyAV is not installed (extra captures)")
    with av.open(str(path), "w", format="matroska") as container:
        stream = container.add_stream("ffv1", rate=1000)
        stream.height, stream.width, stream.pix_fmt = *pictures[0].shape[:2], "bgr0"
        for number, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts = 33 * number + (number % 2) * 9
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def stray(root: Path, *, lens_in_rows: bool = True) -> Path:
    root.mkdir(parents=True)
    write_video(root / "rgb.mp4", [frame.color for frame in truth()])
    head = ["timestamp", "frame", "x", "y", "z", "qx", "qy", "qz", "qw"]
    lines = [", ".join([*head, "fx", "fy", "cx", "cy"] if lens_in_rows else head)]
    for number, frame in enumerate(truth()):
        pose = frame.camera.world_from_cam
        values = [0.1 * number, f"{number:06d}", *pose[:3, 3], *quaternion_from_rotation(pose[:3, :3])]
        lines.append(", ".join(map(str, [*values, *lens(LENS)] if lens_in_rows else values)))
        write_codes16(root / "depth" / f"{number:06d}.png", frame.depth)
        write_picture(root / "confidence" / f"{number:06d}.png", confidence(2))
    (root / "odometry.csv").write_text("\n".join(lines))
    (root / "camera_matrix.csv").write_text("\n".join(", ".join(map(str, row)) for row in LENS.K))
    return root


def lens(camera: Camera) -> list[float]:
    return [camera.fx, camera.fy, camera.cx, camera.cy]


def polycam(root: Path, corrected: bool = True) -> Path:
    for number, frame in enumerate(truth()):
        name, inside = str(1_000_000 * (number + 9)), root / "keyframes"
        pose = frame.camera.world_from_cam @ GL_FROM_CV
        for folder, wrong in (("cameras", 0.5 * corrected), ("corrected_cameras", 0.0)):
            fields = dict(zip(("fx", "fy", "cx", "cy", "width", "height", "blur_score"), [*lens(LENS), 96, 72, 9.0]))
            moved = pose + wrong * np.eye(4)[3]
            fields |= {f"t_{row}{column}": moved[row, column] for row in range(3) for column in range(4)}
            if corrected or folder == "cameras":
                (inside / folder).mkdir(parents=True, exist_ok=True)
                (inside / folder / f"{name}.json").write_text(json.dumps(fields))
                write_picture(inside / folder.replace("cameras", "images") / f"{name}.png", frame.color)
        write_codes16(inside / "depth" / f"{name}.png", frame.depth)
        write_picture(inside / "confidence" / f"{name}.png", confidence(255))
    return root


def record3d(path: Path, *, per_frame: bool = True) -> Path:
    lzfse = pytest.importorskip("lzfse", reason="lzfse is not installed (extra captures)")
    path.parent.mkdir(parents=True, exist_ok=True)
    poses = [frame.camera.world_from_cam @ GL_FROM_CV for frame in truth()]
    meta = {"w": 96, "h": 72, "dw": 96, "dh": 72, "fps": 60, "K": LENS.K.T.ravel().tolist()}
    meta["poses"] = [[*quaternion_from_rotation(pose[:3, :3]), *pose[:3, 3]] for pose in poses]
    if per_frame:
        meta["perFrameIntrinsicCoeffs"] = [lens(LENS) for _ in poses]
        meta["K"] = (2 * LENS.K).T.ravel().tolist()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("metadata", json.dumps(meta))
        for number, frame in enumerate(truth()):
            picture, depth = io.BytesIO(), frame.depth.copy()
            Image.fromarray(frame.color).save(picture, "PNG")
            depth[0, :2] = np.nan
            archive.writestr(f"rgbd/{number}.jpg", picture.getvalue())
            archive.writestr(f"rgbd/{number}.depth", lzfse.compress(depth.astype("<f4").tobytes()))
            archive.writestr(f"rgbd/{number}.conf", lzfse.compress(confidence(2).tobytes()))
    return path


def arkitscenes(root: Path) -> Path:
    lines = []
    for number, frame in enumerate(truth()):
        stem, seconds = f"41069021_{300 + number / 10:.3f}", 300 + number / 10
        pose = invert_pose(frame.camera.world_from_cam)
        turn = cv2.Rodrigues(pose[:3, :3])[0].ravel()
        lines.append(" ".join(map(repr, [seconds + 0.002, *map(float, turn), *map(float, pose[:3, 3])])))
        write_picture(root / "lowres_wide" / f"{stem}.png", frame.color)
        write_codes16(root / "lowres_depth" / f"{stem}.png", frame.depth)
        write_picture(root / "confidence" / f"{stem}.png", confidence(2))
        camera = root / "lowres_wide_intrinsics" / f"41069021_{300 + number / 10 - 0.001:.3f}.pincam"
        camera.parent.mkdir(exist_ok=True)
        camera.write_text(" ".join(map(str, [96, 72, *lens(LENS)])))
    (root / "lowres_wide.traj").write_text("\n".join(lines))
    return root


def scannetpp(root: Path, *, video: bool = False) -> Path:
    inside = root / "iphone"
    inside.mkdir(parents=True)
    K = LENS.K.tolist()
    found = {}
    for number, frame in enumerate(truth()):
        pose = frame.camera.world_from_cam.tolist()
        values = {"pose": np.eye(4).tolist(), "aligned_pose": pose, "intrinsic": K, "timestamp": number}
        found[f"frame_{number:06d}"] = values
        write_codes16(inside / "depth" / f"frame_{number:06d}.png", frame.depth)
        if not video:
            write_picture(inside / "rgb" / f"frame_{number:06d}.png", frame.color)
    if video:
        write_video(inside / "rgb.mkv", [frame.color for frame in truth()])
    (inside / "pose_intrinsic_imu.json").write_text(json.dumps(found))
    return root


WRITERS: dict[str, Callable[[Path], Path]] = {
    "stray-scanner": stray,
    "polycam": polycam,
    "record3d": lambda root: record3d(root / "scan.r3d").parent,
    "arkitscenes": arkitscenes,
    "scannetpp": scannetpp,
}


@pytest.mark.parametrize("layout", WRITERS)
def test_frames_are_those_of_the_world(tmp_path: Path, layout: str) -> None:
    """Axes, units, pixel centres, order, time stamps and pictures; the pixel of low confidence is missing."""
    root = WRITERS[layout](tmp_path / "set")
    assert detect(root) == layout
    dataset = open_dataset(root)
    assert dataset.layout == layout
    if layout in HIGH:
        read = dataset.frames[1].load()
        assert read.depth[LOW_PLACE] == 0 and read.missing.sum() <= 3
        undo_low_confidence(root, layout)
        dataset = open_dataset(root)
    check_frames(dataset, range_m=5)
    assert len(open_frames(root)) == 4


def undo_low_confidence(root: Path, layout: str) -> None:
    """`check_frames` holds every pixel against the truth."""
    if layout == "record3d":
        with zipfile.ZipFile(root / "scan.r3d") as archive:
            kept = {name: archive.read(name) for name in archive.namelist() if not name.endswith(".conf")}
        with zipfile.ZipFile(root / "scan.r3d", "w") as archive:
            for name, data in kept.items():
                archive.writestr(name, data)
        return
    for path in root.rglob("confidence/*.png"):
        path.unlink()


def test_other_versions_of_the_layouts(tmp_path: Path) -> None:
    """Stray Scanner with one matrix for all; Polycam without optimised poses; Record3D with one K, as a file by itself and
    unpacked; ScanNet++ as a video."""
    undo_low_confidence(stray(tmp_path / "stray", lens_in_rows=False), "stray-scanner")
    check_frames(open_dataset(tmp_path / "stray"), range_m=5)
    undo_low_confidence(polycam(tmp_path / "polycam", corrected=False), "polycam")
    check_frames(open_dataset(tmp_path / "polycam"), range_m=5)
    path = record3d(tmp_path / "one" / "scan.r3d", per_frame=False)
    undo_low_confidence(path.parent, "record3d")
    check_frames(open_dataset(path), range_m=5)
    assert [frame.scene for frame in open_frames(path)] == ["scan"] * 4
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "unpacked")
    check_frames(open_dataset(tmp_path / "unpacked"), range_m=5)
    check_frames(open_dataset(scannetpp(tmp_path / "scannetpp", video=True)), range_m=5)


def test_early_recordings_of_stray_scanner(tmp_path: Path) -> None:
    """Oracle: the world; bare poses and millimetres as NPY, as the reader of that time has them (StrayVisualizer, load_depth)."""
    root = stray(tmp_path / "stray", lens_in_rows=False)
    undo_low_confidence(root, "stray-scanner")
    rows = [line.split(", ")[2:] for line in (root / "odometry.csv").read_text().splitlines()]
    (root / "odometry.csv").write_text("\n".join(", ".join(row) for row in rows))
    for path in (root / "depth").iterdir():
        with Image.open(path) as picture:
            np.save(path.with_suffix(".npy"), np.array(picture))
        path.unlink()
    check_frames(open_dataset(root), range_m=5)


@pytest.mark.parametrize("packing", ["lz4", "zlib", "whole"])
def test_packed_depth_of_scannetpp(tmp_path: Path, packing: str) -> None:
    """All three ways in which prepare_iphone_data.py unpacks depth.bin."""
    root = scannetpp(tmp_path / "set")
    shutil.rmtree(root / "iphone" / "depth")
    depths = [np.full((192, 256), 1 + 0.25 * number, np.float32) for number in range(4)]
    match packing:
        case "lz4":
            block = pytest.importorskip("lz4.block", reason="lz4 is not installed (extra captures)")
            packed = [block.compress((1000 * one).astype(np.uint16).tobytes(), store_size=False) for one in depths]
        case "zlib":
            packed = [deflate(one.tobytes()) for one in depths]
        case _:
            packed = []
    data = b"".join(len(one).to_bytes(4, "little") + one for one in packed)
    (root / "iphone" / "depth.bin").write_bytes(data or deflate(np.stack(depths).tobytes()))
    for path in (root / "iphone" / "rgb").iterdir():
        Image.open(path).resize((1024, 768)).save(path)
    poses = root / "iphone" / "pose_intrinsic_imu.json"
    K = LENS.resized(1024, 768).K.tolist()
    found = {name: {**fields, "intrinsic": K} for name, fields in json.loads(poses.read_text()).items()}
    poses.write_text(json.dumps(found))
    for number, frame in enumerate(open_frames(root)):
        assert isinstance(frame, PosedFrame)
        depth, camera = frame.load_depth()
        assert depth.shape == (192, 256) and camera.hw == (192, 256)
        np.testing.assert_allclose(depth, 1 + 0.25 * number, atol=1e-3)
        read = frame.load()
        assert read.color.shape == (768, 1024, 3)
        np.testing.assert_allclose(read.depth, 1 + 0.25 * number, atol=2e-3)


def deflate(data: bytes) -> bytes:
    packer = zlib.compressobj(wbits=-zlib.MAX_WBITS)
    return packer.compress(data) + packer.flush()


def test_readings_beyond_the_range_are_missing(tmp_path: Path) -> None:
    """Beyond 5 m a phone's depth is a guess, as Polycam's description of its files says; a scene of it counts and reports what
    was left out (oracle: the codes in the files), and a range that is given takes the place of that one."""
    root = polycam(tmp_path / "set")
    for path in (root / "keyframes" / "depth").iterdir():
        codes = np.asarray(Image.open(path)).copy()
        codes[30:40, 30:40] = 5001
        Image.fromarray(codes).save(path)
    read = open_frames(root)[0].load()
    assert (read.depth[30:40, 30:40] == 0).all() and read.missing.mean() < 0.02
    codes = [np.asarray(Image.open(path)) for path in (root / "keyframes" / "depth").iterdir()]
    readings = np.concatenate([np.where(confidence(255) > 0, one, 0)[(one > 0) & (one < 65535)] for one in codes])
    beyond = int((readings > 5000).sum())
    words = "% of the depth readings, in 4 of 4 frames, lie beyond 5 m, the range of a phone's"
    with pytest.warns(UserWarning, match=words):
        found = read_scene_of(root, keep_poses=True)
    assert found.decisions["max_depth"]["dropped"] == beyond >= 400
    assert found.decisions["max_depth"]["readings"] == np.count_nonzero(readings)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        further = read_scene_of(root, keep_poses=True, max_depth=5.002)
    assert further.decisions["max_depth"]["reason"] == "as given"
    np.testing.assert_allclose(further.scene.frames[0].load().depth[30:40, 30:40], 5.001, atol=1e-6)


def test_frames_that_lack_something_are_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """One line says how many and why; where none is left, an error does."""
    root = arkitscenes(tmp_path / "set")
    poses = (root / "lowres_wide.traj").read_text().splitlines()
    (root / "lowres_wide.traj").write_text("\n".join(poses[:3]))
    assert len(open_frames(root)) == 3
    assert "set: 1 of 4 frames are left out (1 without a pose)" in caplog.text
    (root / "lowres_wide.traj").write_text(poses[0].replace("300.", "900."))
    with pytest.raises(FileError, match=r"set: none of its 4 frames can be used \(4 without a pose\)"):
        open_frames(root)


@pytest.mark.parametrize(
    ("layout", "file", "text", "message"),
    [
        ("stray-scanner", "odometry.csv", "timestamp, frame, x\n1, 2, 3", r"odometry.csv:1: has no column y"),
        ("stray-scanner", "odometry.csv", "0, 0, 0, 0, 0, 0, 2", r"odometry.csv:1:1: the quaternion has length 2"),
        ("stray-scanner", "rgb.mp4", "no video", r"rgb.mp4: is no readable video"),
        ("polycam", "keyframes/corrected_cameras/9000000.json", "{}", r"9000000.json: field 't_00' is missing"),
        ("record3d", "scan.r3d", "no zip", r"scan.r3d: is no readable ZIP"),
        ("arkitscenes", "lowres_wide.traj", "1 2 3", r"lowres_wide.traj:1:6: the line has 3 values; 7 are expected"),
        ("scannetpp", "iphone/pose_intrinsic_imu.json", "{", r"pose_intrinsic_imu.json:1:2: is no JSON"),
    ],
)
def test_damaged_recordings_are_one_line(tmp_path: Path, layout: str, file: str, text: str, message: str) -> None:
    root = WRITERS[layout](tmp_path / "set")
    (root / file).write_text(text)
    with pytest.raises(FileError if "field" not in message else Exception, match=message):
        open_frames(root)


def test_missing_packages_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = record3d(tmp_path / "scan.r3d")
    monkeypatch.setitem(sys.modules, "lzfse", None)
    with pytest.raises(MissingExtraError, match=r"LZFSE needs .*pip install 'dlama\[captures\]'"):
        open_frames(path)[0].load()


@pytest.mark.parametrize(
    ("layout", "part", "there"),
    [
        ("stray-scanner", "depth", "odometry.csv"),
        ("polycam", "keyframes/depth", "keyframes"),
        ("arkitscenes", "lowres_wide.traj", "lowres_depth, lowres_wide_intrinsics"),
        ("scannetpp", "pose_intrinsic_imu.json", "iphone"),
    ],
)
def test_doctor_names_the_layout_of_which_a_part_is_missing(tmp_path: Path, layout: str, part: str, there: str) -> None:
    """One line, with what is there and all that is needed, in place of the list of all layouts."""
    root = WRITERS[layout](tmp_path / "scan")
    (missing,) = root.rglob(part)
    shutil.rmtree(missing) if missing.is_dir() else missing.unlink()
    (only,) = diagnose(tmp_path / "scan")
    needs = LAYOUTS[layout].looked_for
    assert only.what.endswith(f"holds {there} as layout {layout} does, but not all it needs: {needs}")
