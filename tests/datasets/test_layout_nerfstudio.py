"""nerfstudio folders written from a closed-form world: OpenGL axes, units, lenses of each frame, distortion, bad fields."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlama.datasets.layouts import open_dataset
from dlama.datasets.posed.nerfstudio import lens_of
from dlama.errors import CameraError, DepthError, InputError, ShapeError
from dlama.files.fields import FileFields
from dlama.files.rasters.exr_files import write_exr
from posed_folders import check_frames, truth, write_codes16, write_picture

LENS_FIELDS: dict[str, Any] = {"fl_x": 90.5, "fl_y": 92.25, "cx": 46.25, "cy": 37.75, "w": 96, "h": 72}


def written(root: Path, per_frame: bool = False, unit: float | None = None) -> Path:
    """Lens for all or for each; OpenGL axes by their definition: the columns y and z of the pose turned round."""
    frames = []
    for number, frame in enumerate(truth()):
        write_picture(root / f"images/f{number}.png", frame.color)
        write_codes16(root / f"depths/f{number}.png", frame.depth, 1000 if unit is None else 1 / unit)
        pose = np.array(frame.camera.world_from_cam)
        pose[:, 1:3] *= -1
        files = {"file_path": f"images/f{number}.png", "depth_file_path": f"depths/f{number}.png"}
        frames.append({**files, "transform_matrix": pose.tolist(), **(LENS_FIELDS if per_frame else {})})
    top = dict.fromkeys(("fl_x", "fl_y"), 1.0) if per_frame else LENS_FIELDS
    listing = {"camera_model": "OPENCV", "k1": 0.0, **top, "applied_scale": 1.0, "frames": frames}
    if unit is not None:
        listing["depth_unit_scale_factor"] = unit
    save(root, listing)
    return root


def save(root: Path, listing: object) -> None:
    (root / "transforms.json").write_text(json.dumps(listing, indent=1))


def stored(root: Path) -> dict[str, Any]:
    return json.loads((root / "transforms.json").read_text())


def test_a_lens_of_each_frame_and_another_unit(tmp_path: Path) -> None:
    """Oracle: the world; a frame's own fields go before the shared ones."""
    check_frames(open_dataset(written(tmp_path, per_frame=True, unit=0.0002)), half_unit_m=0.000101, far=True)


def test_pictures_of_one_name_in_several_folders(tmp_path: Path) -> None:
    """Oracle: the world; a rig's cameras number their pictures alike, which the folder tells apart, as of COLMAP."""
    listing = stored(written(tmp_path))
    for number, frame in enumerate(listing["frames"]):
        frame["file_path"] = f"images/cam{number % 2}/{number // 2:04d}.png"
        (tmp_path / frame["file_path"]).parent.mkdir(exist_ok=True)
        (tmp_path / f"images/f{number}.png").rename(tmp_path / frame["file_path"])
    save(tmp_path, listing)
    dataset = open_dataset(tmp_path)
    assert [frame.name for frame in dataset.frames] == ["cam0_0000", "cam1_0000", "cam0_0001", "cam1_0001"]
    check_frames(dataset, far=True)


def test_a_unit_that_is_given_replaces_the_listing_s(tmp_path: Path) -> None:
    """Oracle: the world; without either they are millimetres, and 65535 is far. Depth that has a unit of its own is refused."""
    listing = stored(written(tmp_path))
    dataset = open_dataset(tmp_path)
    assert dataset.layout == "nerfstudio"
    check_frames(dataset, far=True)
    save(tmp_path, listing | {"depth_unit_scale_factor": 1.0})
    again = open_dataset(tmp_path, depth_scale=1000)
    np.testing.assert_array_equal(again.frames[1].load().depth, dataset.frames[1].load().depth)
    with pytest.raises(DepthError, match="depth_scale is 0"):
        open_dataset(tmp_path, depth_scale=0)
    listing["frames"][0]["depth_file_path"] = "depths/f0.bin"
    save(tmp_path, listing)
    with pytest.raises(InputError, match=r"depth_scale does not apply to .*f0\.bin, which has a unit of its own"):
        open_dataset(tmp_path, depth_scale=1000)


def test_where_its_mask_is_black_a_frame_shows_nothing(tmp_path: Path) -> None:
    """Law of nerfstudio: black pixels of `mask_path` are left out. A mask of another size is refused."""
    listing, black = stored(written(tmp_path)), np.zeros((72, 96), np.bool_)
    black[10:30, 40:60] = True
    write_picture(tmp_path / "masks/0.png", np.dstack([~black * np.uint8(255)] * 3))
    write_picture(tmp_path / "masks/1.png", np.full((36, 48, 3), 255, np.uint8))
    for number in (0, 1):
        listing["frames"][number]["mask_path"] = f"masks/{number}.png"
    save(tmp_path, listing)
    first, second, third = open_dataset(tmp_path).frames[:3]
    np.testing.assert_array_equal(first.load().padding, black)
    with pytest.raises(ShapeError, match=r"f1\.png: is 96x72 and its mask 48x36"):
        second.load()
    assert third.load().padding is None


@pytest.mark.parametrize(("kind", "unit"), [("exr", None), ("exr", 0.01), ("npy", None)])
def test_float_depth(tmp_path: Path, kind: str, unit: float | None) -> None:
    """Oracle: the world. EXR depth is in metres unless a unit is given; nerfstudio multiplies NPY depth, as whole numbers."""
    root = written(tmp_path)
    listing = stored(root) | ({} if unit is None else {"depth_unit_scale_factor": unit})
    for number, (frame, true) in enumerate(zip(listing["frames"], truth())):
        path = root / f"depths/f{number}.{kind}"
        if kind == "exr":
            write_exr(path, {"Z": true.depth.astype(np.float32) / np.float32(unit or 1)})
        else:
            np.save(path, np.where(true.depth < 60, true.depth * 1000, np.inf).astype(np.float32))
        frame["depth_file_path"] = f"depths/{path.name}"
    save(root, listing)
    for read, true in zip(open_dataset(root).frames, truth()):
        np.testing.assert_allclose(read.load().depth, true.depth, rtol=1e-6)


def test_frames_without_depth_are_left_out_and_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    root = written(tmp_path)
    listing = stored(root)
    del listing["frames"][0]["depth_file_path"]
    save(root, listing)
    with caplog.at_level(logging.WARNING, logger="dlama"):
        assert [frame.name for frame in open_dataset(root).frames] == ["f1", "f2", "f3"]
    assert "1 of 4 frames are left out (1 without a depth_file_path)" in caplog.text


def as_nerf_s(root: Path, splits: Sequence[str] = ("",)) -> Path:
    """The same world as NeRF's synthetic sets lie: angles, names without an ending, no size, a listing of each split."""
    listing = stored(written(root))
    for field in ("camera_model", "fl_x", "fl_y", "w", "h"):
        del listing[field]
    for frame in listing["frames"]:
        frame["file_path"] = "./" + frame["file_path"].removesuffix(".png")
    (root / "transforms.json").unlink()
    listing |= {"camera_angle_x": 2 * math.atan(48 / 90.5), "camera_angle_y": 2 * math.atan(36 / 92.25)}
    for split in splits:
        (root / f"transforms{split}.json").write_text(json.dumps(listing))
    return root


def test_frames_of_nerf_s_synthetic_sets(tmp_path: Path) -> None:
    """Oracle: the world; the angle under which a side is seen is 2 atan(side / 2 f). Of a square picture without the other angle
    NeRF's `lego`: 0.6911112070083618 radians of 800 pixels are 1111.1110311937682 px, in both directions."""
    check_frames(open_dataset(as_nerf_s(tmp_path, ["_train"])), far=True)
    write_picture(tmp_path / "r_0.png", np.zeros((800, 800, 3), np.uint8))
    lens = lens_of(FileFields("t.json", {"camera_angle_x": 0.6911112070083618}), tmp_path / "r_0.png")
    assert lens.hw == (800, 800) and lens.intrinsics == pytest.approx((1111.1110311937682,) * 2 + (400.0, 400.0))


def test_frames_of_splits_have_names_of_their_own(tmp_path: Path) -> None:
    """Oracle: by hand; a whole listing goes before split ones, and splits come as they are named."""
    names = [frame.name for frame in open_dataset(as_nerf_s(tmp_path, ["_test", "_train"])).frames]
    assert names == [f"{split}_f{number}" for split in ("train", "test") for number in range(4)]
    as_nerf_s(tmp_path, ["", "_test"])
    assert [frame.name for frame in open_dataset(tmp_path).frames] == ["f0", "f1", "f2", "f3"]


def test_distortion_is_refused_where_it_shows(tmp_path: Path) -> None:
    """Oracle: by hand: with k1 alone the corner at radius r (in focal lengths) moves by f k1 r^3."""
    lens = {"fl_x": 100.0, "fl_y": 100.0, "cx": 50.0, "cy": 50.0, "w": 100, "h": 100}
    moves = 100 * math.hypot(0.5, 0.5) ** 3
    for pixels, fine in ((0.49, True), (0.51, False), (-0.51, False)):
        fields = FileFields("t.json", {**lens, "k1": pixels / moves})
        if fine:
            assert lens_of(fields, tmp_path / "unread.png").hw == (100, 100)
        else:
            with pytest.raises(CameraError, match=r"t\.json: k1 \.\.\. p2 move the picture's corners by 0\.5 px"):
                lens_of(fields, tmp_path / "unread.png")


ALL, TOP, ONE = "each frame", "the listing", "the second frame"


@pytest.mark.parametrize(
    ("write", "where", "change", "message"),
    [
        (as_nerf_s, TOP, {"camera_angle_x": 55.9}, r"frames\[0\]: camera_angle_x is 55\.9; radians between 0 and 3"),
        (as_nerf_s, TOP, {"camera_angle_x": "wide"}, r"camera_angle_x is \"wide\"; a finite number is expected"),
        (as_nerf_s, TOP, {"camera_angle_x": None}, r"has neither fl_x \(pixels\) nor camera_angle_x \(radians\)"),
        (as_nerf_s, TOP, {"w": 96}, r"frames\[0\]: field 'h' is missing"),
        (as_nerf_s, ALL, {"depth_file_path": None}, r"none of its 4 frames has a depth_file_path; .*dlama depth"),
        (as_nerf_s, ALL, {"file_path": "./train/r_0"}, r"train/r_0\.png: no such file"),
        (written, TOP, {"camera_model": "OPENCV_FISHEYE"}, r"camera_model is OPENCV_FISHEYE; one of PINHOLE"),
        (written, TOP, {"k4": 0.1}, r"frames\[0\]: k4 is not 0; a pinhole camera is expected"),
        (written, TOP, {"depth_unit_scale_factor": -1}, r"factor is -1; metres per unit > 0 are expected"),
        (written, TOP, {"depth_unit_scale_factor": 1.0}, r"f0\.png: the median depth is 3\d\d\d m, it looks like mill"),
        (written, TOP, {"w": 640, "h": 480}, r"f0\.png: is 96x72, and .*\.json: frames\[0\] is for 640x480"),
        (written, ONE, {"transform_matrix": np.diag([1, 1, -1, 1]).tolist()}, r"1\]: transform_.*: .*a mirroring"),
        (written, ONE, {"file_path": "images/f0.png"}, r"two frames have pictures called f0 \(scene \w+\); different"),
    ],
)
def test_bad_fields_are_named(
    tmp_path: Path, write: Callable[[Path], Path], where: str, change: dict[str, Any], message: str
) -> None:
    """Oracle: the fields that are changed; None: left out."""
    listing = stored(write(tmp_path))
    for fields in {TOP: [listing], ALL: listing["frames"], ONE: listing["frames"][1:2]}[where]:
        fields |= change
        for name in [name for name, value in fields.items() if value is None]:
            del fields[name]
    save(tmp_path, listing)
    with pytest.raises(InputError, match=message):
        open_dataset(tmp_path)
