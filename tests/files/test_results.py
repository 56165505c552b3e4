"""A completion's directory (oracles: the nouns that went in, read back by readers of other libraries, and the layout)."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from plyfile import PlyData

from box_frame import WORLD, pixels
from dlama.completion.completion import Completion
from dlama.completion.pipeline import complete
from dlama.completion.verbs import remove
from dlama.errors import InputError, OutputError
from dlama.files.cameras import read_camera
from dlama.files.rasters.depth import read_depth
from dlama.files.results.completion import BY_DEFAULT, RESULTS, check_results, file_names, write
from dlama.files.results.preview import source_panel
from dlama.files.scenes import textured_mesh
from dlama.files.scenes.scene_npz import read_scene
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD

CAMERA = Camera.from_fov(56, 40, 60)
EVERY = tuple(name for name in RESULTS if name not in ("disparity", "mask"))
"""What a removal by a filler that does not choose has; a mask is written where it is given."""


@pytest.fixture(scope="module")
def removal() -> Completion:
    """The box removed, seen from 10 degrees to the right."""
    _, shown = WORLD.trace(CAMERA)
    return remove(WORLD.rgbd(CAMERA), shown == 1, yaw=10, filler="telea", dilate=1)


@pytest.fixture(scope="module")
def folder(removal: Completion, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all of it was written."""
    return write(removal, tmp_path_factory.mktemp("results") / "a" / "b", only=EVERY)


def test_pictures_are_the_view(removal: Completion, folder: Path) -> None:
    """Oracle: the view, bit for bit where the format is lossless."""
    view = removal.view
    assert (pixels(folder / "image.png") == view.color).all()
    assert (read_depth(folder / "depth.exr") == view.depth).all()
    assert np.abs(read_depth(folder / "depth.png") - view.depth).max() <= 0.0005 + 1e-6
    assert (pixels(folder / "hole_type.png") == view.hole_type).all()
    assert ((pixels(folder / "hole.png") == 255) == removal.warped[0].hole).all()
    assert (pixels(folder / "origin.png") == view.origin).all()
    assert np.abs(pixels(folder / "confidence.png") / 255 - view.confidence).max() <= 0.5 / 255 + 1e-6


def test_hole_has_what_lacked_only_depth(tmp_path: Path) -> None:
    """Closed form: at the source camera all that was written are the pixels that the sensor gave no depth."""
    rgbd = WORLD.rgbd(CAMERA)
    depth = rgbd.depth.copy()
    depth[10:13, 20:30] = 0
    done = complete(RGBD(rgbd.color, depth, CAMERA), [CAMERA], filler="telea")
    folder = write(done, tmp_path / "out", only=["hole"])
    np.testing.assert_array_equal(pixels(folder / "hole.png") == 255, depth == 0)


def test_clouds(removal: Completion, folder: Path) -> None:
    """scene = c-, completed = c+ (oracle: plyfile, and the clouds)."""
    counts = {name: len(PlyData.read(str(folder / f"{name}.ply"))["vertex"]) for name in ("scene", "completed")}
    assert counts == {"scene": len(removal.background), "completed": len(removal.completed)}
    assert counts["completed"] > counts["scene"]
    origins = PlyData.read(str(folder / "scene.ply"))["vertex"]["origin"]
    assert set(np.unique(origins)) <= {Origin.MEASURED, Origin.DEPTH_FILLED, Origin.FILLED}


def test_what_stays_of_an_earlier_result_is_named(removal: Completion, tmp_path: Path) -> None:
    """Law: once; not of files that are replaced, nor of a folder that is no result."""
    (tmp_path / "depth.png").touch()
    write(removal, tmp_path, only=["image"])
    (tmp_path / "mine.txt").touch()
    with pytest.warns(UserWarning, match=r": of an earlier result there is still depth\.png$") as seen:
        write(removal, tmp_path, only=["image"])
    assert [one.filename for one in seen] == [__file__]  # not a line of the decorators of `write`
    write(removal, tmp_path, only=["image", "depth"])


def test_legend_covers_every_code(folder: Path) -> None:
    """Oracle: the enums; a strict parser, which knows no NaN and no Infinity."""

    def refuse(word: str) -> None:
        raise AssertionError(word)

    legends = json.loads((folder / "meta.json").read_text(), parse_constant=refuse)["legends"]
    assert [entry[0] for entry in legends["hole_type.png"].values()] == [code.name.lower() for code in HoleType]
    assert [entry[0] for entry in legends["origin.png"].values()] == [code.name.lower() for code in Origin]


def test_several_views(tmp_path: Path) -> None:
    """Each view gets a folder; the last one and the scene lie at the top."""
    cameras = [orbit(CAMERA, yaw) for yaw in (-8, 8)]
    done = complete(WORLD.rgbd(CAMERA), cameras, filler="telea")
    write(done, tmp_path / "out")
    for number, view in enumerate(done.views, 1):
        assert (pixels(tmp_path / "out" / f"view-0{number}" / "image.png") == view.color).all()
    assert (pixels(tmp_path / "out" / "image.png") == done.views[1].color).all()
    meta = json.loads((tmp_path / "out" / "meta.json").read_text())
    assert len(meta["cameras"]) == len(meta["hole_share_by_type"]) == 2
    assert set(meta["depth_png_clipped_pixels"]) == {"", "view-01/", "view-02/"}


def test_of_a_scene_without_views_the_scene_is_written(tmp_path: Path) -> None:
    """Round trip: no camera was given. The files of the scene are there and no picture; the scene read back renders the same,
    and meta.json is the camera of the picture."""
    rgbd = WORLD.rgbd(CAMERA)
    mask = np.zeros(CAMERA.hw, bool)
    mask[20:30, 20:30] = True
    done = complete(rgbd, [], mask=mask, filler="telea")
    write(done, tmp_path / "out", also=["scene", "points"])
    files = {path.name for path in (tmp_path / "out").iterdir()}
    assert files == {"scene.glb", "scene.npz", "scene.ply", "completed.ply", "meta.json"}
    again = render(read_scene(tmp_path / "out" / "scene.npz"), orbit(CAMERA, 5))
    np.testing.assert_array_equal(again.color, render(done.scene, orbit(CAMERA, 5)).color)
    assert read_camera(tmp_path / "out" / "meta.json").same_view_as(CAMERA)
    with pytest.raises(InputError, match="image is to be written, which the completion lacks"):
        write(done, tmp_path / "more", only="image,scene")


def test_a_failure_leaves_nothing(removal: Completion, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk half-way: the directory is not there, nor is anything next to it."""

    def full(*_: object) -> None:
        raise OutputError("scene.glb: cannot be written: no space left on device")

    monkeypatch.setattr(textured_mesh, "write_textured_glb", full)
    with pytest.raises(OutputError, match="no space"):
        write(removal, tmp_path / "deep" / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("only", "also"),
    [(("image", "depth"), ()), (("preview", "mesh"), "image"), ("points", ("scene",)), (None, "scene")],
)
def test_only_what_is_asked_for_is_written(
    removal: Completion, folder: Path, tmp_path: Path, only: tuple[str, ...] | str | None, also: tuple[str, ...] | str
) -> None:
    """Oracle: the whole directory. The named files are there, bit for bit the same, meta.json too, and nothing else."""
    files = [file for name in EVERY for file in RESULTS[name]]
    assert sorted([*files, "meta.json"]) == sorted(path.name for path in folder.iterdir()), "each of exactly one name"
    write(removal, tmp_path, only=only, also=also)
    names = {*((only,) if isinstance(only, str) else BY_DEFAULT if only is None else only)}
    names |= {also} if isinstance(also, str) else {*also}
    expected = {file for name in names for file in RESULTS[name]}
    assert {path.name for path in tmp_path.iterdir()} == expected | {"meta.json"}
    for file in expected:
        assert (tmp_path / file).read_bytes() == (folder / file).read_bytes()
    assert ("depth_png_clipped_pixels" in json.loads((tmp_path / "meta.json").read_text())) == ("depth" in names)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"only": ("image", "depths")}, ", ".join(RESULTS)),
        ({"only": "picture"}, "only is 'picture'"),
        ({"only": ()}, ", ".join(RESULTS)),
        ({"also": ["scenes"]}, "also is 'scenes'; names of image"),
        ({"also": "mask"}, "also names mask, and mask is not given"),
        ({"only": ["disparity"]}, "disparity is to be written, which the completion lacks; disparity is of stereo"),
    ],
)
def test_unknown_results_list_the_known(
    removal: Completion, tmp_path: Path, options: dict[str, Any], words: str
) -> None:
    """Message; and nothing is written. Names in one text, as the command line has them, are taken."""
    with pytest.raises(InputError, match=words):
        write(removal, tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()
    assert check_results("image,depth", "scene") == check_results(["image", "depth"], ["scene"])


def test_the_mask_that_is_written_is_one_of_the_picture(removal: Completion, tmp_path: Path) -> None:
    """Round trip of a mask as PIL has it; 255 in bytes became 1, and one of another size was written as it is."""
    mask = np.zeros(CAMERA.hw, bool)
    mask[5:9, 5:9] = True
    write(removal, tmp_path / "mask", only=["mask"], mask=Image.fromarray(mask))  # type: ignore[arg-type]
    np.testing.assert_array_equal(pixels(tmp_path / "mask" / "mask.png"), 255 * mask)
    for wrong in (mask[1:], 255 * mask.astype(np.uint8), 3):
        with pytest.raises(InputError, match="mask is"):
            write(removal, tmp_path / "out", also="mask", mask=wrong)  # type: ignore[arg-type]
    assert not (tmp_path / "out").exists()


def test_no_result_replaces_an_input(removal: Completion, tmp_path: Path) -> None:
    """The user's picture stays what it was, also behind a link, and nothing is written; other files may be replaced."""
    picture = tmp_path / "image.png"
    picture.write_bytes(b"the user's picture")
    linked = tmp_path / "elsewhere.png"
    linked.hardlink_to(picture)
    (tmp_path / "depth.png").write_bytes(b"an earlier result")
    for path in (picture, linked, tmp_path / "." / "image.png"):
        with pytest.raises(OutputError, match=r"image\.png: is the image that was read"):
            write(removal, tmp_path, inputs={"image": path})
    assert sorted(each.name for each in tmp_path.iterdir()) == ["depth.png", "elsewhere.png", "image.png"]
    assert picture.read_bytes() == b"the user's picture"
    assert (write(removal, tmp_path, only=["depth"], inputs={"image": picture}) / "depth.exr").is_file()


@pytest.mark.parametrize("name", ["o.JPG", "scene.glb", "scene.npz"])
def test_a_folder_named_as_a_file_is_refused(removal: Completion, tmp_path: Path, name: str) -> None:
    """Law: it would be a folder called o.png. Nothing is written; a folder that has such a name is one."""
    with pytest.raises(OutputError, match=rf"{name}: is the name of a file; a folder is expected"):
        write(removal, tmp_path / name, only=["image"])
    assert list(tmp_path.iterdir()) == []
    (tmp_path / name).mkdir()
    assert (write(removal, tmp_path / name, only=["image"]) / "image.png").is_file()


def test_the_files_are_named_before_they_are_written(removal: Completion, tmp_path: Path) -> None:
    """Oracle: the folder itself."""
    made = write(removal, tmp_path / "out", also=("points", "scene", "hole"))
    found = sorted(path.relative_to(made).as_posix() for path in made.rglob("*") if path.is_file())
    assert file_names(removal, also=("points", "scene", "hole")) == found


def test_the_source_panel_marks_what_is_removed(removal: Completion) -> None:
    """Red lies on the object alone; a picture from which nothing is removed is shown as it is."""
    name, marked = source_panel(removal)
    plain_name, plain = source_panel(remove_nothing(removal))
    removed = removal.scene.layers[0].hole_type == HoleType.OBJECT
    assert (name, plain_name) == ("source, marked: to be removed", "source")
    assert marked.shape == plain.shape == (*removed.shape, 3) and np.array_equal(plain, removal.source.color)
    assert np.array_equal((marked != plain).any(-1), removed & (marked != plain).any(-1)) and (marked != plain).any()


def remove_nothing(removal: Completion) -> Completion:
    """The same completion of a scene without removals."""
    return dataclasses.replace(removal, scene=dataclasses.replace(removal.scene, removals=()))
