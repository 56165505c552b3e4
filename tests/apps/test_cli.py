"""The command line, run in this process on a small made-up frame (oracles: the issue's option names, the files' own readers)."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from dlama.apps.cli import main
from dlama.files.depth import write_depth_exr
from dlama.geometry.camera import Camera
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(64, 48, 60)
WORLD = World((Plane((0, 0, 4), (0, 0, 1)), Box((-0.5, -0.4, 2.0), (0.4, 0.5, 2.4))))
FAST = ["--filler", "telea"]
RESULT_FILES = {
    "image.png", "depth.png", "depth.exr", "hole.png", "hole_type.png", "origin.png", "confidence.png",
    "scene.npz", "scene.ply", "scene.glb", "preview.png", "meta.json",
}  # fmt: skip


@pytest.fixture
def frame(tmp_path: Path) -> Path:
    """A folder with image.png, depth.png (mm), mask.png (the box) of a box before a wall."""
    rgbd = WORLD.rgbd(CAMERA)
    _, shown = WORLD.trace(CAMERA)
    Image.fromarray(rgbd.color).save(tmp_path / "image.png")
    Image.fromarray((rgbd.depth * 1000).round().astype(np.uint16)).save(tmp_path / "depth.png")
    Image.fromarray(((shown == 1) * 255).astype(np.uint8)).save(tmp_path / "mask.png")
    return tmp_path


def pixels(path: Path) -> np.ndarray:
    """A picture's numbers; codes for a palette picture."""
    with Image.open(path) as picture:
        return np.array(picture)


def run(folder: Path, *words: object) -> Path:
    """`dlama WORDS -o folder/out` with files named relative to the folder; returns the output directory."""
    known = [str(folder / str(word)) if (folder / str(word)).is_file() else str(word) for word in words]
    main([*known, "-o", str(folder / "out")])
    return folder / "out"


def refused(capsys: pytest.CaptureFixture[str], folder: Path, *words: object) -> str:
    """The one line that the command prints on bad input; it exits with 2 and leaves nothing behind."""
    before = sorted(folder.rglob("*"))
    with pytest.raises(SystemExit) as stop:
        run(folder, *words)
    captured = capsys.readouterr()
    assert stop.value.code == 2
    assert captured.out == ""
    assert re.fullmatch(r"error: [^\n]+\n", captured.err), captured.err
    assert sorted(folder.rglob("*")) == before
    return captured.err


def test_help_names_every_option_of_the_issue(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the issue's list, verb by verb."""
    shared = "--output --filler --recipe --mode --dilate --dilate-holes --clip --seed"
    source = "--camera --fx --fy --cx --cy --fov --pixel-center --depth-scale --depth-range --resize-depth --far"
    move = "--yaw --pitch --pivot --dolly --to"
    mask = "--mask-polarity --soft-mask --mask-class"
    wanted = {
        "view": f"{shared} {source} {move}",
        "remove": f"{shared} {source} {move} {mask}",
        "stereo": f"{shared} {mask} --calib --mask --mask-right --max-disparity --far",
        "demo": "--output --filler",
    }
    for verb, options in wanted.items():
        with pytest.raises(SystemExit) as stop:
            main([verb, "--help"])
        shown = capsys.readouterr().out
        assert stop.value.code == 0
        assert [option for option in options.split() if not re.search(rf"{option}\b(?!-)", shown)] == []
        assert f"$ dlama {verb}" in shown


def test_help_says_the_signs(capsys: pytest.CaptureFixture[str]) -> None:
    """Positive yaw and pitch are told in words."""
    with pytest.raises(SystemExit):
        main(["view", "--help"])
    shown = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "Positive: the camera moves to its right and turns left" in shown
    assert "Positive: the camera moves up and looks down" in shown


def test_view_writes_every_file(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the issue's list of files; hole.png is where hole_type.png is not 0; one summary line."""
    out = run(frame, "view", "image.png", "depth.png", "--fov", 60, "--yaw", 12, *FAST)
    assert {path.name for path in out.iterdir()} == RESULT_FILES
    hole = pixels(out / "hole.png")
    kinds = pixels(out / "hole_type.png")
    assert set(np.unique(hole)) == {0, 255}
    assert ((hole == 255) == (kinds > 0)).all()
    captured = capsys.readouterr()
    assert captured.err == ""
    assert re.fullmatch(rf"{re.escape(str(out))}: \d+\.\d% was unknown .*telea.* s\n", captured.out)


def test_meta_tells_what_was_done(frame: Path) -> None:
    """Oracles: hashlib on the inputs, the codes' counts in hole_type.png, the camera's closed form."""
    out = run(frame, "view", "image.png", "depth.png", "--fov", 60, "--yaw", 12, "--seed", 3, *FAST)
    meta = json.loads((out / "meta.json").read_text())
    for role in ("image", "depth"):
        assert meta["inputs"][role]["sha256"] == hashlib.sha256((frame / f"{role}.png").read_bytes()).hexdigest()
    kinds = pixels(out / "hole_type.png")
    names = {int(code): entry[0] for code, entry in meta["legends"]["hole_type.png"].items()}
    for code, name in names.items():
        if code:
            assert meta["hole_share_by_type"][0][name] == pytest.approx((kinds == code).mean(), abs=1e-6)
    assert meta["source_camera"]["fx"] == pytest.approx(32 / np.tan(np.radians(30)))
    assert meta["source_camera"]["intrinsics_from"] == "--fov"
    assert (meta["filler"], meta["recipe"]["name"], meta["seed"]) == ("telea", "dlama", 3)
    assert meta["law_violations"] == 0
    assert {"read", "render", "fill", "write"} <= set(meta["seconds"])
    assert {"dlama", "python", "numpy", "numba", "opencv"} <= set(meta["versions"])
    assert meta["depth_png_clipped_pixels"] == 0


def test_positive_yaw_shows_the_right_side(frame: Path) -> None:
    """Oracle: the pose's closed form. The camera moves to +x, and its axis still meets the pivot 2.5 m ahead."""
    out = run(frame, "view", "image.png", "depth.png", "--fov", 60, "--yaw", 20, *FAST)
    pose = np.array(json.loads((out / "meta.json").read_text())["cameras"][0]["world_from_cam"])
    assert pose[0, 3] == pytest.approx(2.5 * np.sin(np.radians(20)))
    assert pose[:3, 3] + 2.5 * pose[:3, 2] == pytest.approx([0, 0, 2.5])


def test_remove_writes_both_clouds(frame: Path) -> None:
    """c- lacks the object, c+ has it (oracle: the world's box lies nearer than 2.5 m, the wall does not)."""
    from dlama.files.clouds import read_ply

    out = run(frame, "remove", "image.png", "depth.png", "mask.png", "--fov", 60, "--dilate", 1, *FAST)
    assert {path.name for path in out.iterdir()} == RESULT_FILES | {"background.ply", "completed.ply"}
    assert read_ply(out / "background.ply").points[:, 2].min() > 2.5
    assert read_ply(out / "completed.ply").points[:, 2].min() == pytest.approx(2.0, abs=1e-3)
    meta = json.loads((out / "meta.json").read_text())
    assert meta["hole_share_by_type"][0]["object"] > 0.02


def test_pixels_outside_the_hole_are_measured_ones(frame: Path) -> None:
    """At the source camera everything outside hole.png is the input, bit for bit (oracle: the input)."""
    out = run(frame, "remove", "image.png", "depth.png", "mask.png", "--fov", 60, *FAST)
    known = pixels(out / "hole.png") == 0
    for name in ("image.png", "depth.png"):
        assert (pixels(out / name)[known] == pixels(frame / name)[known]).all()


def test_target_camera_file(frame: Path) -> None:
    """--to takes size, lens and pose of its file (oracle: the file)."""
    pose = np.eye(4)
    pose[0, 3] = 0.1
    target = {
        "width": 40,
        "height": 30,
        "fx": 40.0,
        "fy": 40.0,
        "cx": 20.0,
        "cy": 15.0,
        "world_from_cam": pose.tolist(),
    }
    (frame / "target.json").write_text(json.dumps(target))
    out = run(frame, "view", "image.png", "depth.png", "--fov", 60, "--to", "target.json", *FAST)
    assert pixels(out / "image.png").shape == (30, 40, 3)
    camera = json.loads((out / "meta.json").read_text())["cameras"][0]
    assert {key: camera[key] for key in target} == target


def test_target_from_which_nothing_is_visible(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A camera that looks the other way gets a result that says so."""
    target = {"width": 64, "height": 48, "fx": 55.4, "fy": 55.4, "cx": 32.0, "cy": 24.0}
    (frame / "behind.json").write_text(json.dumps({**target, "world_from_cam": np.diag([-1.0, 1, -1, 1]).tolist()}))
    out = run(frame, "view", "image.png", "depth.png", "--fov", 60, "--to", "behind.json", *FAST)
    assert json.loads((out / "meta.json").read_text())["nothing_visible"] is True
    assert "nothing of the scene is visible" in capsys.readouterr().out


def test_principal_point_outside_is_warned_of_once(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line, and the result is written."""
    out = run(frame, "view", "image.png", "depth.png", "--fx", 55, "--cx", 90, "--cy", 24, "--yaw", 5, *FAST)
    assert re.fullmatch(r"warning: [^\n]*principal point[^\n]*\n", capsys.readouterr().err)
    assert (out / "meta.json").is_file()


def test_paper_recipe_and_its_changes(frame: Path) -> None:
    """--recipe paper is points and a 10 m clip; --mode and --clip override it (oracle: the options)."""
    words = ("view", "image.png", "depth.png", "--fov", 60, "--yaw", 8, "--recipe", "paper", *FAST)
    recipe = json.loads((run(frame, *words) / "meta.json").read_text())["recipe"]
    assert (recipe["mode"], recipe["clip_m"], recipe["eight_bit_depth"]) == ("points", 10.0, True)
    recipe = json.loads((run(frame, *words, "--mode", "surface", "--clip", 3) / "meta.json").read_text())["recipe"]
    assert (recipe["mode"], recipe["clip_m"]) == ("surface", 3.0)


def test_depth_beyond_16_bit_is_counted(frame: Path) -> None:
    """Pixels deeper than 65.534 m are counted in meta.json and exact in depth.exr (oracle: how many were written)."""
    depth = WORLD.rgbd(CAMERA).depth.copy()
    depth[:3, :5] = 80.0
    write_depth_exr(frame / "depth.exr", depth)
    out = run(frame, "remove", "image.png", "depth.exr", "mask.png", "--fov", 60, *FAST)
    assert json.loads((out / "meta.json").read_text())["depth_png_clipped_pixels"] == 15


def test_older_results_are_replaced_and_other_files_stay(frame: Path) -> None:
    """A second run into the same directory (oracle: the files' contents)."""
    words = ("view", "image.png", "depth.png", "--fov", 60, *FAST)
    out = run(frame, *words, "--yaw", 5)
    first = (out / "image.png").read_bytes()
    (out / "notes.txt").write_text("mine")
    run(frame, *words, "--yaw", 15)
    assert (out / "image.png").read_bytes() != first
    assert (out / "notes.txt").read_text() == "mine"


def test_nothing_says_where_to_go(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`view` without a move teaches --yaw; with two, both are named."""
    words = ("view", "image.png", "depth.png", "--fov", 60)
    assert "--yaw" in refused(capsys, frame, *words)
    assert "--to" in refused(capsys, frame, *words, "--yaw", 3, "--to", "target.json")


def test_no_intrinsics_teaches_fov(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A PNG has no EXIF focal length."""
    assert "--fov" in refused(capsys, frame, "view", "image.png", "depth.png", "--yaw", 5)


def spoiled(frame: Path, what: str) -> None:
    """Spoil one file of a frame."""
    depth = cv2.imread(str(frame / "depth.png"), cv2.IMREAD_UNCHANGED)
    mask = cv2.imread(str(frame / "mask.png"), cv2.IMREAD_UNCHANGED)
    image = frame / "image.png"
    {
        "image missing": lambda: image.unlink(),
        "image truncated": lambda: image.write_bytes(image.read_bytes()[: image.stat().st_size // 2]),
        "image is text": lambda: image.write_text("hello"),
        "depth smaller": lambda: cv2.imwrite(str(frame / "depth.png"), depth[:24, :32]),
        "depth all zero": lambda: cv2.imwrite(str(frame / "depth.png"), depth * 0),
        "depth in metres": lambda: cv2.imwrite(str(frame / "depth.png"), depth // 1000),
        "depth 8-bit colour": lambda: (frame / "depth.png").write_bytes(image.read_bytes()),
        "mask empty": lambda: cv2.imwrite(str(frame / "mask.png"), mask * 0),
        "mask full": lambda: cv2.imwrite(str(frame / "mask.png"), mask * 0 + 255),
        "mask smaller": lambda: cv2.imwrite(str(frame / "mask.png"), mask[:40]),
        "mask grey": lambda: cv2.imwrite(str(frame / "mask.png"), mask // 2 + 20),
    }[what]()


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("image missing", ["image.png", "no such file"]),
        ("image truncated", ["image.png", "truncated"]),
        ("image is text", ["image.png"]),
        ("depth smaller", ["32x24", "64x48", "--resize-depth nearest"]),
        ("depth all zero", ["depth.png"]),
        ("depth in metres", ["--depth-scale 1"]),
        ("depth 8-bit colour", ["8-bit colour"]),
        ("mask empty", ["mask", "empty"]),
        ("mask full", ["mask", "full"]),
        ("mask smaller", ["64x40", "64x48"]),
        ("mask grey", ["--soft-mask"]),
    ],
)
def test_bad_files(frame: Path, capsys: pytest.CaptureFixture[str], what: str, words: list[str]) -> None:
    """Each gets exit code 2 and one line with these words, and leaves nothing behind."""
    spoiled(frame, what)
    line = refused(capsys, frame, "remove", frame / "image.png", "depth.png", "mask.png", "--fov", 60, *FAST)
    assert [word for word in words if word not in line] == [], line


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--fx", "-3"], ["-3", "> 0"]),
        (["--fov", "190"], ["190"]),
        (["--fov", "60", "--fx", "3"], ["--fov", "--fx"]),
        (["--fov", "60", "--filler", "magic"], ["magic", "layered", "telea"]),
        (["--fov", "60", "--recipe", "soup"], ["soup", "dlama", "paper"]),
        (["--fov", "60", "--dilate", "-1"], ["dilate", "-1"]),
        (["--fov", "60", "--far", "0.5"], ["--far"]),
        (["--fov", "60", "--pivot", "-2"], ["-2"]),
    ],
)
def test_bad_options(frame: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: list[str]) -> None:
    """Each gets exit code 2 and one line that names what came and what is wanted."""
    line = refused(capsys, frame, "view", "image.png", "depth.png", "--yaw", 5, *options)
    assert [word for word in words if word not in line] == [], line


@pytest.mark.parametrize(("name", "value"), [("world_from_cam", np.diag([2.0, 1, 1, 1]).tolist()), ("fx", 0.0)])
def test_bad_camera_file(frame: Path, capsys: pytest.CaptureFixture[str], name: str, value: object) -> None:
    """A pose that is no rotation, a K that is singular: the file is named."""
    fields = {"width": 64, "height": 48, "fx": 55.4, "fy": 55.4, "cx": 32.0, "cy": 24.0, name: value}
    (frame / "camera.json").write_text(json.dumps(fields))
    line = refused(capsys, frame, "view", "image.png", "depth.png", "--camera", "camera.json", "--yaw", 5)
    assert "camera.json" in line


def test_output_that_cannot_be_written(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file is where the directory should be."""
    (frame / "out").write_text("in the way")
    line = refused(capsys, frame, "view", "image.png", "depth.png", "--fov", 60, "--yaw", 5, *FAST)
    assert "cannot be written" in line
    assert (frame / "out").read_text() == "in the way"


def test_misspelt_option_exits_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    """The parser's own errors have the same exit code."""
    with pytest.raises(SystemExit) as stop:
        main(["view", "a.png", "b.png", "-o", "out", "--yaww", "3"])
    assert stop.value.code == 2
    assert "--yaww" in capsys.readouterr().err


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    """One line per package (oracle: the package's own number)."""
    import dlama

    main(["version"])
    assert capsys.readouterr().out.splitlines()[0] == f"dlama {dlama.__version__}"
