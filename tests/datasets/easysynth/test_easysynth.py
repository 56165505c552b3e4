"""EasySynth's layout read: against poses.json of the street benchmark, closed forms, and files with one thing wrong."""

from __future__ import annotations

import json
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

from dlama.datasets.easysynth.dataset import easysynth, looks_like_easysynth, orbit_yaw
from dlama.datasets.easysynth.text_files import opencv_pose, unreal_pose
from dlama.datasets.easysynth.writer import write_scene
from dlama.datasets.frames import RemovalTruth, ViewTruth
from dlama.datasets.layouts import detect, open_dataset
from dlama.datasets.posed.posed_frames import PosedFrame
from dlama.errors import CameraError, DepthError, FileError, MaskError
from dlama.geometry.motion.poses import quaternion_from_rotation, rotation_from_quaternion
from dlama.geometry.motion.trajectories import dolly, orbit
from rendered_walls import CAMERA, CLASSES, edit_json, frame
from worlds import moved, rotation

SCENES = ("s03", "s05", "s06", "s08")


@pytest.fixture(scope="module")
def street(data_dir: Path) -> Path:
    return data_dir / "street"


# The street benchmark


def test_street_poses_agree_with_poses_json(street: Path) -> None:
    """Oracle: poses.json, written next to the CSV in OpenCV axes: 5e-7 m, rotations to the CSV's digits, yaws, lens."""
    frames = {(each.scene, each.name): each for each in easysynth(street).frames}
    assert len(frames) == 4 * (13 + 13 + 2 + 2)
    for scene in SCENES:
        reported = json.loads((street / scene / "poses.json").read_text())
        for number, entry in enumerate(reported["sequences"]["with"]["frames"]):
            found = frames[scene, f"with-{number:04d}"]
            files = found.load.args[0]  # type: ignore[attr-defined]
            expected = np.array(entry["world_from_cam"])
            np.testing.assert_allclose(files.world_from_cam[:3, 3], expected[:3, 3], atol=5e-7 + 1e-12)
            np.testing.assert_allclose(files.world_from_cam[:3, :3], expected[:3, :3], atol=2e-6)
            assert found.yaw == entry["yaw_deg"] and files.depth.args[0].parent.name == "DepthMM"
            np.testing.assert_array_equal(files.lens.camera(expected).K, reported["K"])


def test_street_cases(street: Path) -> None:
    """12 yaws, 13 removals and a pair per scene, names unique, everything picklable, the truths those of the README."""
    data = pickle.loads(pickle.dumps(easysynth(street)))
    assert (data.name, data.layout) == ("street", "easysynth")
    assert [len(data.of(protocol)) for protocol in ("vpi", "ori", "sii")] == [4 * 12, 4 * 13, 4]
    assert len({case.key for case in data.cases}) == len(data.cases)
    assert [case.yaw for case in data.of("vpi")[:4]] == [10, -10, 20, -20]
    view = data.of("vpi")[0].load()
    assert isinstance(view, ViewTruth) and view.object_mask is not None and view.target_without is not None
    assert view.object_mask.mean() == pytest.approx(0.021, abs=0.001)  # README: 2.1 %
    assert not np.array_equal(view.target.color, view.target_without.color)
    assert view.target.camera.same_view_as(view.target_without.camera)


def test_street_exr_agrees_with_millimetres(street: Path, tmp_path: Path) -> None:
    """Oracle: the same depth stored twice; README: within 6.4e-4 of the range; 1.0 is far, also beyond 10 m."""
    shutil.copytree(street / "s03" / "with", tmp_path / "with", ignore=shutil.ignore_patterns("DepthMM"))
    exr = easysynth(tmp_path / "with", depth_range=10).frames[3].load()
    millimetres = easysynth(street / "s03" / "with").frames[3].load()
    near = millimetres.depth < 9.99
    assert np.abs(exr.depth[near] - millimetres.depth[near]).max() <= 10 * 6.4e-4
    assert exr.far[millimetres.depth > 10.01].all() and not exr.far[near].any()


# Poses


def test_unreal_axes_by_hand() -> None:
    """Closed form: X is forward, Y right, Z up, cm; an Unreal yaw of +90 turns to the right, a pitch of +90 looks up."""
    half = np.sqrt(0.5)
    np.testing.assert_allclose(opencv_pose((100, 200, 300), np.eye(3))[:3], [[1, 0, 0, 2], [0, 1, 0, -3], [0, 0, 1, 1]])
    turned, tilted = (0, 0, half, half), (0, -half, 0, half)  # FRotator(0, 90, 0) and (90, 0, 0).Quaternion()
    right = opencv_pose((0, 0, 0), rotation_from_quaternion(turned))[:3, :3]
    np.testing.assert_allclose(right @ (0, 0, 1), (1, 0, 0), atol=1e-15)
    np.testing.assert_allclose(right @ (0, 1, 0), (0, 1, 0), atol=1e-15)
    up = opencv_pose((0, 0, 0), rotation_from_quaternion(tilted))[:3, :3]
    np.testing.assert_allclose(up @ (0, 0, 1), (0, -1, 0), atol=1e-15)


@pytest.mark.parametrize("turn", [(10, -20, 30), (180, 0, 0), (0, 0, 179.999), (0, 180, 0)])
def test_poses_there_and_back(turn: tuple[float, float, float]) -> None:
    """Round trip at any angle, also about 180 degrees, where w of the quaternion vanishes; rotations from Rodrigues."""
    pose = moved(CAMERA, turn=turn, shift=(1, -2, 3)).world_from_cam
    translation, quaternion = unreal_pose(pose)
    np.testing.assert_allclose(opencv_pose(translation, rotation_from_quaternion(quaternion)), pose, atol=1e-12)
    assert quaternion[3] >= 0 and np.linalg.norm(quaternion) == pytest.approx(1)
    turned = rotation(np.radians(turn))
    np.testing.assert_allclose(rotation_from_quaternion(quaternion_from_rotation(turned)), turned, atol=1e-12)


def write_metric_table(table: Path) -> None:
    """Poses as EasySynth 1.0's exporter wrote them: (Y, -Z, X) / 100 and (w, -y, z, -x) of Unreal's pose, and intrinsics."""
    lines = ["id,tx,ty,tz,qw,qx,qy,qz,fx,fy,cx,cy"]
    for line in table.read_text().splitlines()[1:]:
        number, tx, ty, tz, qx, qy, qz, qw, _ = map(float, line.split(","))
        values = (ty / 100, -tz / 100, tx / 100, qw, -qy, qz, -qx, 9.5, 9.5, 8, 6)
        lines.append(f"{number:.0f}," + ",".join(f"{value:.9f}" for value in values))
    table.write_text("\r\n".join(lines) + "\r\n")


def test_orbit_yaw_is_signed_and_knows_what_is_none() -> None:
    """Oracle: `orbit` itself, also of a camera that looks down and orbits about the vertical; dollies and pans are none."""
    start = moved(CAMERA, turn=(0, 30, 0), shift=(1, 2, 3))
    for yaw in (-60, -0.5, 10, 45):
        assert orbit_yaw(start.world_from_cam, orbit(start, yaw).world_from_cam) == pytest.approx(yaw, abs=1e-3)
    down = orbit(CAMERA, 0, 25)
    assert orbit_yaw(down.world_from_cam, orbit(CAMERA, 20, 25).world_from_cam) is not None
    for other in (start, dolly(start, 1), moved(start, turn=(0, 10, 0)), moved(orbit(start, 20), shift=(0, 0.2, 0))):
        assert orbit_yaw(start.world_from_cam, other.world_from_cam) is None


def test_a_rig_without_the_cameras_own_poses(sequence: Path) -> None:
    """Closed form: the rig's pose, then 10 cm along the rig's own Y (right)."""
    (sequence / "CameraComponent" / "CameraPoses.csv").unlink()
    edit_json(sequence / "CameraRig.json", translation=[0, 10, 0])
    for found, yaw in zip(easysynth(sequence).frames, (0, 10, -10)):
        expected = moved(orbit(CAMERA, yaw), shift=(0.1, 0, 0)).world_from_cam
        np.testing.assert_allclose(found.load().camera.world_from_cam, expected, atol=1e-8)


# Lenses and depth


def test_intrinsics_scale_with_the_sensor(sequence: Path) -> None:
    """Closed form: a sensor of twice the picture's size halves fx, fy, cx, cy; other proportions are refused."""
    edit_json(sequence / "CameraRig.json", sensor_size=[32, 24], intrinsics=[30, 0, 16, 0, 28, 12, 0, 0, 1])
    camera = easysynth(sequence).frames[0].load().camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (15, 14, 8, 6)
    edit_json(sequence / "CameraRig.json", sensor_size=[36, 24])
    words = r"CameraRig.json: cameras.CameraComponent: the sensor is 36x24 and the picture 16x12"
    with pytest.raises(CameraError, match=words):
        easysynth(sequence).frames[0].load()


def test_normalised_depth_needs_its_range(sequence: Path) -> None:
    """Guard: without DepthMM nothing says what 1.0 means."""
    shutil.rmtree(sequence / "CameraComponent" / "DepthMM")
    with pytest.raises(DepthError, match=r"DepthImage: .*give depth_range=METRES"):
        easysynth(sequence)
    frame = easysynth(sequence, depth_range=10).frames[0]
    np.testing.assert_allclose(frame.load().depth, 2, rtol=2**-11)
    assert isinstance(frame, PosedFrame)
    depth, camera = frame.load_depth()
    assert np.array_equal(depth, frame.load().depth) and camera.same_view_as(frame.load().camera)


@pytest.mark.parametrize("suffix", [".png", ".jpeg"])
def test_depth_of_8_bits_is_refused(suffix: str, sequence: Path) -> None:
    """Guard: 256 steps, in an encoding that no file states, are no depth."""
    place = sequence / "CameraComponent"
    shutil.rmtree(place / "DepthMM")
    for path in (place / "DepthImage").iterdir():
        path.rename(path.with_suffix(suffix))
    with pytest.raises(DepthError, match=rf"{suffix}: depth as PNG has 256 steps.*render DepthImage as EXR"):
        easysynth(sequence, depth_range=10)


# Layouts


def test_scenes_of_other_names(tmp_path: Path, sequence: Path) -> None:
    """A folder of plain sequences is a scene; they have VPI cases."""
    for name in ("a", "b"):
        shutil.copytree(sequence, tmp_path / "set" / name)
    data = easysynth(tmp_path / "set")
    expected = [f"vpi__set__set__{name}-{number:04d}" for name in ("a", "b") for number in (1, 2)]
    assert [case.key for case in data.cases] == expected
    assert all(isinstance(case.load(), ViewTruth) for case in data.cases)


def test_frames_that_do_not_show_the_object_are_no_removals(tmp_path: Path) -> None:
    """Of three frames the second does not show the object: two ORI cases, and VPI from the first as ever."""
    cameras = [orbit(CAMERA, yaw) for yaw in (0, 10, -10)]
    shown = [frame(camera, shows) for camera, shows in zip(cameras, (True, False, True))]
    hidden = [frame(camera, False) for camera in cameras]
    write_scene(tmp_path, "w", {"with": shown, "without": hidden}, depth_range=10, classes=CLASSES)
    data = easysynth(tmp_path / "w")
    assert [case.frame for case in data.of("ori")] == ["with-0000", "with-0002"]
    assert [case.frame for case in data.of("vpi")] == ["with-0001", "with-0002"]
    named = open_dataset(tmp_path / "w", removal_object="255,0,0").of("ori")[0].load()
    assert isinstance(named, RemovalTruth) and named.mask.sum() == 20
    with pytest.raises(MaskError, match=r"SemanticClasses.csv: no class is called 'car'; known: background, object"):
        easysynth(tmp_path / "w", removal_object="car")


def test_pairs_must_stand_at_the_same_pose(tmp_path: Path) -> None:
    """Guard: a `without` from elsewhere is no truth."""
    sequences = {"with": [frame()], "without": [frame(moved(CAMERA, shift=(0.01, 0, 0)))]}
    write_scene(tmp_path, "w", sequences, depth_range=10, classes=CLASSES)  # type: ignore[arg-type]
    with pytest.raises(FileError, match=r"CameraPoses.csv: the pose of frame 0 differs by 0.01"):
        easysynth(tmp_path / "w")


def test_layout_is_known_by_its_names(tmp_path: Path, sequence: Path) -> None:
    """True for a sequence, a scene and a folder of scenes; False for anything else, also for nothing."""
    shutil.copytree(sequence, tmp_path / "all" / "scene" / "with")
    for root in (sequence, tmp_path / "all", tmp_path / "all" / "scene"):
        assert looks_like_easysynth(root)
    (tmp_path / "other" / "color").mkdir(parents=True)
    for root in (tmp_path / "other", tmp_path / "nowhere", sequence / "CameraRig.json"):
        assert not looks_like_easysynth(root)
        with pytest.raises(FileError, match=root.name):
            easysynth(root)


@pytest.mark.parametrize("metric", [False, True])
def test_a_cameras_own_folder_is_a_sequence(sequence: Path, metric: bool) -> None:
    """Oracle: the frames of the sequence it lies in; before 1.2 there is no rig, nothing above the pictures, and the lens is in
    the table of poses."""
    table = sequence / "CameraComponent" / "CameraPoses.csv"
    expected = [each.load() for each in easysynth(sequence).frames]
    if metric:
        write_metric_table(table)
        (sequence / "CameraRig.json").unlink()
        (sequence / "CameraPoses.csv").unlink(missing_ok=True)
    for root in (table.parent, *([sequence] if metric else [])):
        assert detect(root) == "easysynth"
        frames = easysynth(root).frames
        assert [each.name for each in frames] == [f"CameraComponent-{number:04d}" for number in range(3)]
        for each, truth in zip(frames, expected):
            found = each.load()
            np.testing.assert_allclose(found.camera.world_from_cam, truth.camera.world_from_cam, atol=1e-8)
            np.testing.assert_array_equal(found.depth, truth.depth)
            np.testing.assert_array_equal(found.color, truth.color)
            lens = found.camera
            assert (lens.fx, lens.cx, lens.cy) == (9.5 if metric else CAMERA.fx, 8, 6)


def test_numbering_that_begins_elsewhere(sequence: Path) -> None:
    """Pictures 7, 8, 9 of poses 0, 1, 2 are matched in step; a missing one is an error of that frame alone, by name."""
    for kind in (sequence / "CameraComponent").glob("*/"):
        for path in sorted(kind.iterdir(), reverse=True):
            number = int(path.stem.split(".")[1])
            path.rename(path.with_name(f"seq_with.{number + 7:04d}{path.suffix}"))
    assert easysynth(sequence).frames[1].load.args[0].names[0].endswith("seq_with.0008.png")  # type: ignore[attr-defined]
    (sequence / "CameraComponent" / "ColorImage" / "seq_with.0008.png").unlink()
    with pytest.raises(FileError, match=r"ColorImage/seq_with.0001.png: no such file"):
        easysynth(sequence).frames[1].load()
