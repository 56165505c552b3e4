"""open_dataset: every layout is recognised, what is none or several is refused with what was looked for, options too."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlama.datasets.layouts import LAYOUTS, detect, open_dataset
from dlama.datasets.posed.lenses import lens_for
from dlama.datasets.posed.numbered_frames import numbered_files
from dlama.datasets.posed.posed_frames import FrameFiles, PosedFrame, posed_frame
from dlama.datasets.posed.view_pairs import Overlaps, posed_dataset, view_pairs
from dlama.datasets.text_tables import scene_folders
from dlama.errors import FileError, InputError
from posed_folders import LENS, text_K, text_matrix, truth, write_numbered

MARKS = {
    "easysynth": ("CameraRig.json", "CameraPoses.csv", "Camera/ColorImage/"),
    "pairs": ("pairs.json",),
    "removal": ("with.color.png", "without.color.png"),
    "stereo": ("im0.png", "im1.png"),
    "tum": ("rgb.txt", "depth.txt", "groundtruth.txt", "rgb/", "depth/"),
    "7-scenes": ("frame-000000.color.png", "frame-000000.depth.png", "frame-000000.pose.txt"),
    "scannet": ("color/", "depth/", "pose/", "intrinsic/"),
    "tsdf-fusion": ("camera-intrinsics.txt", "frame-000000.depth.png", "frame-000000.pose.txt"),
    "redwood": ("trajectory.log", "depth/", "image/"),
    "replica": ("traj.txt", "results/"),
    "colmap": ("sparse/0/cameras.txt", "sparse/0/images.txt", "images/"),
    "nerfstudio": ("transforms.json", "images/"),
    "stray-scanner": ("rgb.mp4", "odometry.csv", "depth/", "confidence/"),
    "polycam": ("keyframes/cameras/", "keyframes/depth/", "keyframes/images/"),
    "record3d": ("metadata", "rgbd/"),
    "arkitscenes": ("lowres_wide.traj", "lowres_depth/", "lowres_wide/"),
    "azure-kinect": ("recording.mkv",),
    "rosbag": ("metadata.yaml", "bag_0.mcap"),
    "scannetpp": ("iphone/pose_intrinsic_imu.json", "iphone/depth/"),
}
"""Names that make a folder look like a layout; a folder ends with /."""


def marked(root: Path, *layouts: str) -> Path:
    for mark in (mark for layout in layouts for mark in MARKS[layout]):
        path = root / mark
        (path if mark.endswith("/") else path.parent).mkdir(parents=True, exist_ok=True)
        if not mark.endswith("/"):
            path.touch()
    return root


@pytest.mark.parametrize("layout", LAYOUTS)
def test_each_layout_is_distinguished_from_all_others(tmp_path: Path, layout: str) -> None:
    """Oracle: the names each layout's own description gives; at the root and one folder below."""
    assert detect(marked(tmp_path / "set", layout)) == layout
    assert detect(tmp_path) == layout


def test_several_or_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"may be pairs or tum; say which by layout=NAME"):
        detect(marked(tmp_path / "both", "tum", "pairs"))
    (tmp_path / "none").mkdir()
    with pytest.raises(InputError, match=r"is no data set of a known layout") as caught:
        open_dataset(tmp_path / "none")
    for name, layout in LAYOUTS.items():
        assert f"{name}: {layout.looked_for}" in str(caught.value)
    assert "are read by a transforms.json" in str(caught.value)


@pytest.mark.parametrize(
    ("place", "names"),
    [("sequences/00", ("image_2", "image_3")), ("2011_09_26/2011_09_26_drive_0001_sync", ("image_02", "image_03"))],
)
def test_pairs_of_kitti_are_named(tmp_path: Path, place: str, names: tuple[str, str]) -> None:
    """Oracle: the folders that KITTI's odometry and its raw data have."""
    for name in names:
        (tmp_path / place / name).mkdir(parents=True)
    with pytest.raises(InputError, match=rf"`dlama stereo {names[0]}/PICTURE {names[1]}/PICTURE --calib FILE`"):
        detect(tmp_path)


def test_a_result_is_named_as_one(tmp_path: Path) -> None:
    """Oracle: what leads on, in place of all layouts that were looked for."""
    for name in ("meta.json", "image.png"):
        (tmp_path / name).touch()
    with pytest.raises(InputError, match=r"holds no scene\.npz; a result has a scene\.npz where .* --also scene"):
        open_dataset(tmp_path)
    (tmp_path / "scene.npz").touch()
    with pytest.raises(InputError, match=r"is a result: give .*scene\.npz$"):
        open_dataset(tmp_path)


def test_a_result_inside_a_data_set_is_none_of_its_scenes(tmp_path: Path) -> None:
    """Law: with what `dlama sequence SET -o SET/out` wrote the set is what it was before; results alone are read as one."""
    for kind in ("7-scenes", "nerfstudio"):
        root = tmp_path / kind
        result = marked(root / "out", "nerfstudio")
        (result / "origin").mkdir()
        (result / "meta.json").touch()
        assert detect(root) == "nerfstudio" and detect(result) == "nerfstudio"
        marked(root / "rooms" / "chess", kind)
        assert detect(root) == kind
        scenes = scene_folders(root, LAYOUTS[kind].looks_like, "")
        assert scenes == {"rooms_chess": root / "rooms" / "chess"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"layout": "kitti"},
            "layout 'kitti' is not known; known are easysynth, pairs, removal, stereo, tum, 7-scenes",
        ),
        ({"layout": "pairs", "depth_range": 1.0}, r"depth_range does not apply to .* of layout pairs; it is for eas"),
        ({"layout": "stereo", "camera": LENS}, r"camera does not apply to .* stereo; it is for tum, 7-scenes, scannet"),
        ({"limit": 0}, r"limit is 0; 1 or more is expected, a whole number"),
    ],
)
def test_options_that_say_nothing_are_refused(tmp_path: Path, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        open_dataset(**{"path": tmp_path, **arguments})


def test_no_such_folder(tmp_path: Path) -> None:
    for name, words in (
        ("nix", "no such folder; the folder of a data set is expected"),
        ("street.jpg", r"is a picture; the folder .* `dlama photo3d .*street\.jpg \[DEPTH\] --only scene .* makes"),
        ("walk.MOV", "is a video without poses and depth; .*dense workspace that COLMAP"),
    ):
        if name != "nix":
            (tmp_path / name).touch()
        with pytest.raises(FileError, match=f"{name}: {words}"):
            open_dataset(tmp_path / name)


def scene(root: Path) -> Path:
    write_numbered(root)
    (root / "camera-intrinsics.txt").write_text(text_K(LENS))
    return root


def test_scenes_and_limit(tmp_path: Path) -> None:
    """Oracle: by hand; the first cases stay, scene after scene."""
    for name in ("a", "b", "c"):
        scene(tmp_path / name)
    whole = open_dataset(tmp_path)
    assert len(whole.frames) == 12 and {case.scene for case in whole.cases} == {"a", "b", "c"}
    some = open_dataset(tmp_path, scenes=["c", "a"], limit=len(whole.cases) // 3 + 1)
    assert {frame.scene for frame in some.frames} == {"a", "c"}
    expected = [case.key for case in whole.cases if case.scene != "b"]
    assert [case.key for case in some.cases] == expected[: len(whole.cases) // 3 + 1]
    with pytest.raises(InputError, match=r"scene 'd' is not in this data set; it has a, b, c"):
        open_dataset(tmp_path, scenes=["d"])


def test_pairs_of_views_turn_as_expected_and_overlap(tmp_path: Path) -> None:
    """Oracle: the turns 0, 10, 21, 29 degrees about one axis: of every frame those about 10, 20 and 30 degrees away.

    Frame 2 to 1 (11 degrees) is nearer to 10 than 2 to 3 (8), which counts where there is no better.
    """
    dataset = open_dataset(scene(tmp_path), "tsdf-fusion")
    found = [(case.frame[10:12] + case.frame[-2:], case.yaw) for case in dataset.cases]
    assert found == [
        ("0001", 10.0), ("0002", 21.0), ("0003", 29.0),
        ("0100", 10.0), ("0103", 19.0),
        ("0201", 11.0), ("0200", 21.0),
        ("0302", 8.0), ("0301", 19.0), ("0300", 29.0),
    ]  # fmt: skip


@pytest.mark.parametrize(("share", "listed"), [(0.09, 0), (0.11, 10)])
def test_a_tenth_of_a_pair_must_overlap(
    share: float, listed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Closed form: docs/reference/formats.md says at least 10 %."""
    root = scene(tmp_path)
    lens = lens_for(root, root, LENS, (), "")
    frames = [posed_frame("s", name, files) for name, files in numbered_files(root, lens)]
    assert Overlaps(frames).share(0, 0) == pytest.approx(1.0)
    monkeypatch.setattr(Overlaps, "share", lambda *_: share)
    assert len(list(view_pairs(frames, "d"))) == listed


@pytest.mark.parametrize(("farther", "share"), [(1.04, 1.0), (1.06, 0.0)])
def test_only_pixels_of_the_same_depth_overlap(farther: float, share: float) -> None:
    """Closed form: the same camera twice, whose second reading is 4 % farther, or 6 %; the limit is 5 %."""
    depths = (np.full(LENS.hw, metres, np.float32) for metres in (2.0, 2.0 * farther))
    lens = lens_for(Path(), Path(), LENS, (), "")
    walls = [FrameFiles(("", ""), pytest.fail, partial(np.copy, depth), lens, np.eye(4)) for depth in depths]
    frames = [PosedFrame("s", "", pytest.fail, files=wall) for wall in walls]
    assert Overlaps(frames).share(0, 1) == share


def test_poses_in_another_unit_than_depth_are_reported(tmp_path: Path) -> None:
    """Poses in millimetres next to depth in metres: nothing overlaps, and the message asks the right question."""
    root = scene(tmp_path)
    for path, frame in zip(sorted(root.glob("*.pose.txt")), truth()):
        pose = np.array(frame.camera.world_from_cam)
        pose[:3, 3] *= 1000
        path.write_text(text_matrix(pose))
    words = r"no two of its 4 frames overlap by 10% .*are depth and poses in the same unit"
    with pytest.raises(FileError, match=words):
        open_dataset(root)
    with pytest.raises(FileError, match=r"holds 0 frames; two or more"):
        posed_dataset("tum", root, [])


def test_two_folders_that_make_one_scene_are_refused(tmp_path: Path) -> None:
    """Oracle: law; a/b is called a_b as a scene, so next to a_b one of the two would be lost."""
    scene(tmp_path / "a" / "b")
    scene(tmp_path / "a_b")
    with pytest.raises(FileError, match=r"b: is called a_b as a scene, and so is .*a_b; folders of other names are"):
        open_dataset(tmp_path, layout="tsdf-fusion")
