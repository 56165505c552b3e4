"""dlama.sequence: a folder of posed frames completed into another (oracles: closed-form frames, round trips, a killed run)."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import dlama
from dlama.apps.cli import main
from dlama.datasets.posed.nerfstudio import write_transforms
from dlama.datasets.sequences import camera_paths
from dlama.datasets.sequences import completion as module
from dlama.datasets.sequences.loading import LoadedScene, masks_of_frames, open_frames, slice_frames
from dlama.datasets.sequences.results import pictures
from dlama.errors import FileError, InputError, OutputError
from dlama.files.cameras import camera_as_json
from dlama.files.rasters.masks import write_mask
from dlama.files.rasters.pictures import write_color
from dlama.geometry.camera import Camera
from dlama.geometry.codes import Origin
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import RGBD
from posed_folders import write_nerfstudio
from worlds import Box, Plane, Sphere, World, moved

LENS = Camera.from_fov(64, 48, 60)
SHAPES = (Plane((0, 0, 4), (0.1, 0, -1)), Plane((0, 1.2, 0), (0, -1, 0)), Box((-1.2, -0.6, 2.8), (-1.0, 2, 3.0)))
BALL = Sphere((0.1, 0.2, 2.4), 0.3)
WORLD = World((*SHAPES, BALL))
PLACES = (-0.45, -0.15, 0.15, 0.45)
CAMERAS = {f"img-{n}": moved(LENS, (0, -10 * x, 0), (x, 0, 0)) for n, x in enumerate(PLACES)}


def frame(name: str) -> RGBD:
    """A frame of the world, with a sensor hole."""
    rgbd = WORLD.rgbd(CAMERAS[name])
    depth = rgbd.depth.copy()
    depth[4:9, 30:40] = 0
    return RGBD(rgbd.color, depth, rgbd.camera)


def write_room(folder: Path) -> Path:
    """Four frames in nerfstudio's layout."""
    return write_nerfstudio(folder, {name: frame(name) for name in CAMERAS}, CAMERAS)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The frames, which no test changes."""
    return write_room(tmp_path_factory.mktemp("given") / "room")


@pytest.fixture(scope="module")
def whole(room: Path) -> tuple[Path, dict[str, Any]]:
    """All of them completed in one go: the folder and its meta data."""
    return room.parent / "whole", dlama.sequence(room).write(room.parent / "whole", also=["scene", "points"])


def test_what_is_written_is_read_back(whole: tuple[Path, dict[str, Any]]) -> None:
    """Round trip: the output is a data set of our own reader; measured pixels are bit for bit, depth to half a millimetre."""
    out, meta = whole
    frames = open_frames(out)
    assert [each.name for each in frames] == list(CAMERAS) == meta["frames"]["names"]
    for each in frames:
        done, given = each.load(), frame(each.name)
        known = given.depth > 0
        np.testing.assert_array_equal(done.color, given.color)
        assert np.abs(done.depth - given.depth)[known].max() < 6e-4
        assert (done.depth > 0).all()
        np.testing.assert_allclose(done.camera.world_from_cam, given.camera.world_from_cam, atol=1e-9)
        truth = WORLD.trace(given.camera)[0]
        assert np.median(np.abs(done.depth - truth)[~known]) < 0.01
        origin = np.array(Image.open(out / "origin" / f"{each.name}.png"))
        for reported, code in (("filled_share", Origin.FILLED), ("depth_filled_share", Origin.DEPTH_FILLED)):
            assert abs(meta[reported][each.name] - (origin == code).mean()) < 1e-6
    written = "images depth hole origin source transforms.json meta.json scene.npz scene.ply scene.glb sparse"
    assert {path.name for path in out.iterdir()} == {*written.split(), meta["video"]}


def test_views_come_one_by_one_and_nothing_is_written(room: Path, whole: tuple[Path, dict[str, Any]]) -> None:
    """Oracle: the same views, written."""
    before, stages = sorted(room.parent.rglob("*")), list[str]()
    given = dlama.sequence(room, progress=stages.append)
    assert "read frame 4 of 4" in stages and "compare frames" in stages
    assert repr(given) == "SequenceCompletion(4 views of 4 frames)"
    names = []
    for name, view in given.views():
        names.append(name)
        np.testing.assert_array_equal(view.color, np.array(Image.open(whole[0] / "images" / f"{name}.png")))
        np.testing.assert_array_equal(view.origin, np.array(Image.open(whole[0] / "origin" / f"{name}.png")))
    assert names == list(CAMERAS) and sorted(room.parent.rglob("*")) == before


def test_source_says_which_frame_a_pixel_comes_from(whole: tuple[Path, dict[str, Any]]) -> None:
    """Codes: own pixels 1 + the own number, the sensor hole another frame's, filled ones 0."""
    named = json.loads((whole[0] / "transforms.json").read_text())["source_frames"]
    kinds = "source", "origin", "hole"
    source, origin, hole = (np.array(Image.open(whole[0] / kind / "img-1.png")) for kind in kinds)
    assert {named[code - 1] for code in np.unique(source[origin == Origin.MEASURED])} == {"img-1"}
    elsewhere = origin == Origin.ELSEWHERE
    assert elsewhere.any() and "img-1" not in {named[code - 1] for code in np.unique(source[elsewhere])}
    assert (source[hole == 255] == 0).all()


def test_an_object_is_removed_from_all_frames(room: Path, tmp_path: Path) -> None:
    """By its place (oracle: the world without the ball)."""
    mask = WORLD.trace(CAMERAS["img-1"])[1] == 3
    meta = dlama.sequence(room, masks={"1": mask}, filler="layered").write(tmp_path / "out", only=["scene"])
    assert meta["masked_frames"] == ["img-1"]
    for each in open_frames(tmp_path / "out"):
        done = each.load()
        ball = WORLD.trace(done.camera)[1] == 3
        truth = World(SHAPES).trace(done.camera)[0]
        assert np.median(np.abs(done.depth - truth)[ball] / truth[ball]) < 0.02


def test_masks_of_all_frames_of_a_video(room: Path, tmp_path: Path) -> None:
    """As a segmenter leaves them: of frames that are not chosen, without the object, of the larger pictures (oracle: those masks
    alone that count)."""
    mask, empty = WORLD.trace(CAMERAS["img-1"])[1] == 3, np.zeros(LENS.hw, bool)
    options: dict[str, Any] = {"frames": "1:3", "filler": "telea"}
    dlama.sequence(room, masks={"img-1": mask}, **options).write(tmp_path / "alone", only=["scene"])
    masks = {"img-0": mask, "img-1": mask.repeat(3, 0).repeat(3, 1), "img-2": empty, "img-3": empty}
    with pytest.warns(UserWarning, match=r"1 mask of frames that are left out: not used \(img-0\)"):
        meta = dlama.sequence(room, masks=masks, **options).write(tmp_path / "all", only=["scene"])
    assert meta["masked_frames"] == ["img-1"]
    for file in (tmp_path / "alone").glob("*/*.png"):
        assert file.read_bytes() == (tmp_path / "all" / file.parent.name / file.name).read_bytes(), file
    for wrong, words in (
        ({"img-0": mask}, "mask is for frame img-0, which is left out: frames is 1:3"),
        ({"img-1": empty}, "mask is empty"),
        ({"img-1": mask[:40]}, "mask of frame img-1 is 64x40 and the picture 64x48"),
    ):
        with pytest.raises(InputError, match=words):
            dlama.sequence(room, frames="1:3", masks=wrong)


def test_depth_smaller_than_its_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Pictures that are shrunk to its size are reported; with `resize_depth` they keep theirs, and masks too (oracles: the given
    pictures, bit for bit; the world's depth at their size)."""
    room, cameras = write_room(tmp_path / "room"), {name: each.resized(128, 96) for name, each in CAMERAS.items()}
    for name, camera in cameras.items():
        write_color(room / "images" / f"{name}.png", WORLD.rgbd(camera).color)
    write_transforms(room, cameras, [], {})
    mask = WORLD.trace(cameras["img-1"])[1] == 3
    write_mask(tmp_path / "ball.png", mask)
    words = f"sequence {room} --frames 1:3 --mask img-1={tmp_path / 'ball.png'} --filler layered --only video".split()
    main([*words, "-o", str(tmp_path / "small")])
    hint = "pictures of 128x96 are shrunk to 64x48, as their depth is smaller; --resize-depth guided"
    assert hint in capsys.readouterr().err
    meta = json.loads((tmp_path / "small" / "meta.json").read_text())
    assert meta["decisions"]["size"]["name"] == "64x48"
    assert not any((tmp_path / "small" / name).exists() for name in ("scene.npz", "scene.ply", "scene.glb", "sparse"))
    main([*words, "-o", str(tmp_path / "large"), "--resize-depth", "guided"])
    assert "shrunk" not in capsys.readouterr().err
    assert "size" not in json.loads((tmp_path / "large" / "meta.json").read_text())["decisions"]
    for each in open_frames(tmp_path / "large"):
        done, given = each.load(), WORLD.rgbd(cameras[each.name])
        ball = dilate_mask(WORLD.trace(given.camera)[1] == 3, 8)
        np.testing.assert_array_equal(done.color[~ball], given.color[~ball])
        assert np.median(np.abs(done.depth / given.depth - 1)[~ball]) < 0.002
        assert np.percentile(np.abs(done.depth / given.depth - 1)[~ball], 90) < 0.01


def test_names_of_frames_are_no_places() -> None:
    """Law: a mask of frame "3", which is not chosen, is not that of the fourth of those that are."""
    mask, names = np.ones(LENS.hw, bool), ["0", "4", "8", "12"]
    loaded = LoadedScene(names, dlama.scene(list(map(frame, CAMERAS)), names=names), {}, ["3"], {})
    with pytest.warns(UserWarning, match="1 mask of frames that are left out: not used .3."):
        assert list(masks_of_frames({"3": mask, "8": mask}, loaded, "::4")) == [2]


def killed_after(count: int) -> Callable[..., None]:
    """Progress that stops the run."""

    def progress(done: int, *_: Any) -> None:
        if done == count:
            raise KeyboardInterrupt

    return progress


def test_a_killed_run_continues(
    room: Path, whole: tuple[Path, dict[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Law: the result is the same as in one go; what was done is not done again; other settings begin anew."""
    with pytest.raises(KeyboardInterrupt):
        dlama.sequence(room).write(tmp_path / "out", progress=killed_after(2))
    assert not (tmp_path / "out" / "transforms.json").exists()
    worked: list[object] = []
    original = module.complete_step
    monkeypatch.setattr(module, "complete_step", lambda *given: (worked.append(given), original(*given))[1])
    meta = dlama.sequence(room).write(tmp_path / "out")
    assert len(worked) == 2 and meta["views_from_earlier_run"] == 2
    assert meta["filled_share"] == whole[1]["filled_share"]
    for file in whole[0].glob("*/*.png"):
        assert file.read_bytes() == (tmp_path / "out" / file.parent.name / file.name).read_bytes(), file
    assert not (tmp_path / "out" / ".dlama-sequence").exists()
    with pytest.raises(KeyboardInterrupt):
        dlama.sequence(room).write(tmp_path / "other", progress=killed_after(2))
    assert dlama.sequence(room, seed=1).write(tmp_path / "other")["views_from_earlier_run"] == 0


def test_two_runs_do_not_write_to_the_same_place(room: Path, tmp_path: Path) -> None:
    """The second, which starts within the first, is refused; the first's views are those of a run alone (oracle)."""
    pytest.importorskip("fcntl")
    mask = np.zeros((48, 64), bool)
    mask[20:30, 25:40] = True
    second = dlama.sequence(room, filler="telea", masks={"img-1": mask})
    refused = []

    def start_second(done: int, *_: object) -> None:
        if done == 2:
            with pytest.raises(OutputError, match="another run is writing there") as error:
                second.write(tmp_path / "out")
            refused.append(error)

    first = dlama.sequence(room, filler="telea")
    first.write(tmp_path / "out", only=[], progress=start_second)
    first.write(tmp_path / "alone", only=[])
    assert len(refused) == 1
    for path in (tmp_path / "alone").glob("*/*.png"):
        assert (tmp_path / "out" / path.relative_to(tmp_path / "alone")).read_bytes() == path.read_bytes()


def test_what_is_less_sure_stays_open(room: Path, tmp_path: Path) -> None:
    """Law: open in pictures, depth and the scene exactly where a fill had less confidence; all else keeps its bits."""
    views = {"left": moved(LENS, (0, 0, 0), (-0.6, 0, 0)), "right": moved(LENS, (0, 10, 0), (0.5, 0, 0))}
    options: dict[str, Any] = {"frames": "1:2", "views": views, "filler": "layered"}
    dlama.sequence(room, **options).write(tmp_path / "whole", only=["scene"])
    least = 0.75
    meta = dlama.sequence(room, min_confidence=least, **options).write(tmp_path / "out", only=["scene"])
    whole, kept = (dlama.read_scene(tmp_path / name / "scene.npz") for name in ("whole", "out"))
    for before, after in zip(whole.fills, kept.fills, strict=True):
        before, after = before.load(), after.load()
        unsure = before.valid & (before.confidence < least)
        np.testing.assert_array_equal(after.hole, before.hole | unsure)
        np.testing.assert_array_equal(after.depth, np.where(unsure, 0, before.depth))
    opened = 0
    for name, left_open in meta["left_open_share"].items():
        images, depths, holes, origins = (
            [np.array(Image.open(tmp_path / run / kind / f"{name}.png")) for run in ("whole", "out")]
            for kind in ("images", "depth", "hole", "origin")
        )
        now_open = (origins[0] >= Origin.DEPTH_FILLED) & (depths[1] == 0)
        assert left_open == round(float(now_open.mean()), 6)
        black = now_open & (origins[1] == Origin.UNKNOWN)
        assert not images[1][black].any()
        np.testing.assert_array_equal(np.array(Image.open(tmp_path / "out" / "masks" / f"{name}.png")) == 0, black)
        np.testing.assert_array_equal(holes[0], holes[1])
        for first, second in (images, depths):
            np.testing.assert_array_equal(first[~now_open], second[~now_open])
        opened += int(now_open.sum())
    assert opened > 100 and meta["min_confidence"] == least
    for frame in open_frames(tmp_path / "out"):  # read back, what is open is no black surface
        source, black = frame.load(), np.array(Image.open(tmp_path / "out" / "masks" / f"{frame.name}.png")) == 0
        np.testing.assert_array_equal(dlama.View.from_rgbd(source).color_hole, black)
        assert not source.depth[black].any()
    for run, kinds in (("whole", set()), ("out", {"masks"})):
        frames = json.loads((tmp_path / run / "transforms.json").read_text())["frames"]
        assert {Path(each["mask_path"]).parent.name for each in frames if "mask_path" in each} == kinds


def test_depth_that_its_files_cannot_hold_is_counted(tmp_path: Path) -> None:
    """Closed form: a half of the picture at 100 m, as seen from the air, is written as 65.534 m; it was, without a word."""
    given = frame("img-1")
    depth = np.full(LENS.hw, 40, np.float32)
    depth[:, : LENS.width // 2] = 100
    done = dlama.complete(RGBD(given.color, depth, given.camera), [given.camera])
    dlama.write(done, tmp_path / "one", only=["scene"])
    completion = dlama.sequence(tmp_path / "one" / "scene.npz")
    with pytest.warns(UserWarning, match=r"^1536 pixels of the views beyond 65\.534 m.*also=scene"):
        meta = completion.write(tmp_path / "out", only=["scene"])
    assert meta["depth_png_clipped_pixels"] == LENS.width // 2 * LENS.height == 1536
    codes = np.array(Image.open(next((tmp_path / "out" / "depth").iterdir())))
    np.testing.assert_array_equal(codes, np.where(depth == 100, 65534, 40000))


def test_views_of_a_path_and_of_a_file(room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A list of cameras with names, of another size than the frames; a path by name (oracle: the true depth)."""
    camera = moved(LENS, (0, 1, 0), (0.05, 0.02, 0)).resized(80, 60)
    cameras = [{**camera_as_json(camera), "name": "mine"}, camera_as_json(LENS)]
    (tmp_path / "cameras.json").write_text(json.dumps(cameras))
    dlama.sequence(room, views=str(tmp_path / "cameras.json")).write(tmp_path / "out", only=["scene", "mesh"])
    frames = open_frames(tmp_path / "out")
    assert [each.name for each in frames] == ["mine", "0001"]
    truth, done = WORLD.trace(camera)[0], frames[0].load()
    assert np.median(np.abs(done.depth - truth)) < 0.005
    monkeypatch.setattr(camera_paths, "VIEWS_OF_PATH", 4)
    path = dlama.sequence(room, views="spiral", frames="::3", filler="telea")
    meta = path.write(tmp_path / "path", only=["scene"])
    assert len(meta["filled_share"]) == 4 and meta["frames"]["names"] == ["img-0", "img-3"]


def test_a_scene_file_keeps_the_names_of_its_frames(room: Path, tmp_path: Path) -> None:
    """Round trip: a mask by name removes from the saved scene what it removes from the folder; of a file without names, as
    earlier versions wrote it, frames are called by their numbers; a name leads to no other folder."""
    dlama.sequence(room, frames="1:4", filler="telea").write(tmp_path / "out", only=["scene"])
    file, mask = tmp_path / "out" / "scene.npz", WORLD.trace(CAMERAS["img-2"])[1] == 3
    assert dlama.read_scene(file).names == ("img-1", "img-2", "img-3")
    views = {"img-2": CAMERAS["img-2"]}
    removed = dlama.sequence(file, masks={"img-2": mask}, views=views, filler="telea")
    meta = removed.write(tmp_path / "next", only=["scene"])
    assert list(meta["filled_share"]) == ["img-2"] and len(dlama.read_scene(file).gains) == 3
    assert meta["masked_frames"] == ["img-2"] and meta["frames"]["names"] == ["img-1", "img-2", "img-3"]
    assert dlama.read_scene(tmp_path / "next" / "scene.npz").names == ("img-1", "img-2", "img-3")
    arrays = dict(np.load(file))
    names = arrays.pop("names")
    np.savez(tmp_path / "old.npz", **arrays)
    assert dlama.read_scene(tmp_path / "old.npz").names == ("frame-0000", "frame-0001", "frame-0002")
    np.savez(tmp_path / "odd.npz", **arrays, names=np.char.add("../../", names))
    assert dlama.read_scene(tmp_path / "odd.npz").names[0] == ".._.._img-1"


def test_auto_is_the_filler_that_suits_the_scene(
    room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Law: `patchmatch` where the scene's depth was estimated, `layered-patches` where it was measured, in sequence and in
    video; the last line and meta.json say which."""
    monkeypatch.chdir(tmp_path)
    guessed = dataclasses.replace(frame("img-1"), estimate={"estimator": "mine"})
    dlama.write(dlama.complete(guessed, [guessed.camera]), "one", only=["scene"])
    for source, depth, filler in (
        ("one/scene.npz", "estimated", "patchmatch"),
        (str(room), "measured", "layered-patches"),
    ):
        main(["sequence", source, "-o", depth, "--only", "scene", *(["--frames", "1:2"] * (depth == "measured"))])
        assert f", filler {filler}, " in capsys.readouterr().out
        meta = json.loads(Path(depth, "meta.json").read_text())
        assert (meta["depth"], meta["filler"]) == (depth, filler)
        main(["video", f"{depth}/scene.npz", "-o", "v.webp", "--seconds", ".1", "--fps", "20", "--json"])
        assert json.loads(capsys.readouterr().out)["filler"] == filler


def test_views_of_another_shape_are_not_distorted_in_a_video(tmp_path: Path) -> None:
    """Closed form: a square of 8 x 8 px in a picture twice as wide and as high, but for its borders, is one of 4 x 4 px; black
    beside it. It was drawn half as wide."""
    (tmp_path / "images").mkdir()
    square = np.full((48, 40, 3), 9, np.uint8)
    square[20:28, 16:24] = 200
    for name, color in (("one", np.full((24, 40, 3), 50, np.uint8)), ("other", square)):
        write_color(tmp_path / "images" / f"{name}.png", color)
    one, other = pictures(tmp_path, ["one", "other"])
    assert one.shape == other.shape == (24, 40, 3) and (one == 50).all()
    expected = np.full((24, 40), 0, np.uint8)
    expected[:, 10:30], expected[10:14, 18:22] = 9, 200
    np.testing.assert_array_equal(other[..., 0], expected)
    (small,) = pictures(tmp_path, ["one"], widest=13)
    assert small.shape == (8, 13, 3) and (small == 50).all()


def test_the_recipe_of_the_paper_clips_frames(room: Path, tmp_path: Path) -> None:
    """Frames of a folder are clipped; a scene cannot be any more, which one line says."""
    dlama.sequence(room, recipe="paper", filler="telea", frames="1:2").write(tmp_path / "out", only=["scene"])
    assert max(one.load().depth.max() for one in open_frames(tmp_path / "out")) <= 10
    with pytest.raises(InputError, match=r"recipe clips depth at 10 m, and .* is a scene; give its frames instead"):
        dlama.sequence(tmp_path / "out" / "scene.npz", recipe="paper")


def test_damaged_frames_are_named_and_left_out(tmp_path: Path) -> None:
    """The others are completed; with none left there is one line."""
    room = write_room(tmp_path / "room")
    (room / "depth" / "img-2.png").write_bytes(b"no picture")
    with pytest.warns(UserWarning, match="frame img-2 is left out"):
        meta = dlama.sequence(room, filler="telea").write(tmp_path / "out", only=["scene"])
    assert list(meta["left_out"]) == ["img-2"] and len(meta["filled_share"]) == 3
    assert meta["model"] is None and meta["recipe"]["dilate"] is None  # no network ran, no mask grew
    mask = WORLD.trace(CAMERAS["img-3"])[1] == 3
    for place, words in (
        ("3", "for the frame in place 3, frames are left out .img-2.; name the frame"),
        ("img-2", "left out: "),
    ):
        with pytest.warns(UserWarning), pytest.raises(InputError, match=words):  # place 3 was another frame
            dlama.sequence(room, masks={place: mask})
    for name in CAMERAS:
        (room / "depth" / f"{name}.png").write_bytes(b"no picture")
    with pytest.raises(FileError, match=r"not one of its 4 frames can be read; the first: .*img-0"):
        dlama.sequence(room)


def test_bad_words_are_refused_before_anything_is_written(room: Path, tmp_path: Path) -> None:
    """One line each, and no folder."""
    mask = np.zeros(LENS.hw, bool)
    mask[20:30, 20:30] = True
    bad: list[tuple[dict[str, Any], str]] = [
        ({"masks": {"nobody": mask}}, "mask is for frame nobody, which is not there"),
        ({"views": "circle"}, "views is 'circle'; frames, orbit, spiral, dolly or a JSON file"),
        ({"frames": "1-3"}, "frames is '1-3'; FIRST:END:STEP is expected"),
        ({"frames": "9:"}, "frames is 9:, and there are 4; nothing is left"),
        ({"scene": "cellar"}, "scene 'cellar' is not in this data set"),
        ({"layout": "tum2"}, "layout 'tum2' is not known"),
    ]
    for options, message in bad:
        with pytest.raises(InputError, match=message):
            dlama.sequence(room, **options)
    with pytest.raises(FileError, match="no such folder"):
        dlama.sequence(tmp_path / "nowhere")
    read = dlama.sequence(room)
    words = "only is 'pictures'; names of scene, points, mesh, colmap, video are expected"
    with pytest.raises(InputError, match=words):
        read.write(tmp_path / "out", only=["pictures"])
    with pytest.raises(OutputError, match=r"done.mp4: is the name of a file; a folder is expected"):
        read.write(tmp_path / "done.mp4")
    assert not (tmp_path / "out").exists()


def test_slices() -> None:
    """As Python's (oracle: Python)."""
    assert slice_frames(range(9), None) == tuple(range(9))
    assert slice_frames(range(9), "1:8:3") == (1, 4, 7) and slice_frames(range(9), "-3:") == (6, 7, 8)
