"""What is taken home is what the command line and the Python lines write (oracle: both are run, and bytes compared)."""

from __future__ import annotations

import io
import json
import shlex
import shutil
import zipfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from handing_in import completed, hand_in, open_frame

import dlama
from box_frame import pixels
from dlama.apps.cli import main
from dlama.errors import InputError
from dlama.web import api
from dlama.web.completions import results, take_home
from dlama.web.completions.runs import warnings_by_thread
from dlama.web.visits import Result, Visit

CLICK = {"kind": "click", "at": [30, 24]}
REQUESTS: dict[str, tuple[list[dict[str, Any]], dict[str, Any], dict[str, Any]]] = {
    "view": ([], {}, {"yaw": 8, "dolly": -0.25}),
    "nothing asked": ([], {}, {}),
    "clicked, with shadow": ([CLICK], {"with_shadow": True}, {"pitch": -4.5, "pivot": 3}),
    "box": ([{"kind": "box", "box": [17, 14, 26, 24]}], {}, {"yaw": -6, "pivot": "auto"}),
    "painted": ([{"kind": "add", "points": [[30, 20], [30, 28]], "radius": 5}], {}, {"yaw": 5, "seed": 3}),
    "clicked and grown": ([CLICK], {"grow": 2}, {"min_confidence": 0.2, "dilate": 1}),
}


def files_below(folder: Path) -> dict[str, bytes]:
    """Name -> bytes, of every file."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def unpacked(result: Result, visit: Visit) -> dict[str, bytes]:
    """The zip's files."""
    with zipfile.ZipFile(io.BytesIO(take_home.zip_result(result, visit.folder))) as archive:
        assert archive.testzip() is None
        return {name: archive.read(name) for name in archive.namelist()}


def same_files(mine: dict[str, bytes], theirs: dict[str, bytes], meta: bool) -> None:
    """Every byte but those of times; of the Python lines' meta.json also what only the command line knows."""
    assert set(mine) == set(theirs)
    for name, data in mine.items():
        if not name.endswith("meta.json"):
            assert data == theirs[name], name
    if meta:
        both = [json.loads(files["meta.json"]) for files in (mine, theirs)]
        for one in both:
            one.pop("seconds")
            for entry in one["inputs"].values():
                entry["path"] = Path(entry["path"]).name
        assert both[0] == both[1]


@pytest.mark.parametrize("name", REQUESTS)
def test_command_and_python_lines_write_the_same_bytes(
    name: str, frame: Path, visit: Visit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each is run in a folder with the visitor's files and those of the zip."""
    marks, about, request = REQUESTS[name]
    open_frame(visit, frame, depth_scale="900")
    api.mark(visit, {"marks": marks, **about})
    result = completed(visit, **request)
    packed = unpacked(result, visit)
    mine = {each.removeprefix("out/"): data for each, data in packed.items() if each.startswith("out/")}
    how = take_home.how(result)
    assert packed["commands.txt"].decode() == f"{how['command']}\n\n{how['python']}"
    assert (take_home.MASK in packed) == bool(how["mask_file"])
    for kind in ("command", "python"):
        place = tmp_path / kind
        place.mkdir()
        for each in ("image.png", "depth.png"):
            (place / each).write_bytes((frame / each).read_bytes())
        if how["mask_file"]:
            (place / "mask.png").write_bytes(packed["mask.png"])
        monkeypatch.chdir(place)
        if kind == "command":
            main(shlex.split(how["command"])[1:])
        else:
            exec(compile(how["python"], "lines", "exec"), {})
        same_files(mine, files_below(place / "out"), meta=kind == "command")


def test_a_plate_of_16_bits_is_taken_home_in_16(
    frame: Path, visit: Visit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracles: the Python lines, run in a folder with the plate; the plate itself, where it was measured; known stages."""
    color = pixels(frame / "image.png").astype(np.uint16) << 8 | 5
    cv2.imwrite(str(frame / "image.png"), color[..., ::-1])
    with warnings_by_thread():
        reported = open_frame(visit, frame)
    assert any("has 16 bits a channel" in line for line in reported["warnings"])
    api.mark(visit, {"marks": [CLICK]})
    result = completed(visit)
    packed, lines = unpacked(result, visit), take_home.how(result)["python"]
    assert lines.endswith("dlama.write(done, 'out', inputs={'image': 'image.png'})\n")
    mine = cv2.imdecode(np.frombuffer(packed["out/image.png"], np.uint8), cv2.IMREAD_UNCHANGED)[..., ::-1]
    known = result.done.view.origin == dlama.Origin.MEASURED
    assert known.any() and np.array_equal(mine[known], color[known])
    assert "read" in json.loads(packed["out/meta.json"])["seconds"]
    monkeypatch.chdir(frame)
    with pytest.warns(UserWarning, match="16 bits"):
        exec(compile(lines, "lines", "exec"), {})
    assert (frame / "out" / "image.png").read_bytes() == packed["out/image.png"]


@pytest.mark.slow
def test_the_same_of_a_stereo_pair(visit: Visit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The example's at a quarter of its size, with a painted mask, by its command; moved by its Python lines, too."""
    monkeypatch.chdir(tmp_path)
    for role, name in (("picture", "street.jpg"), ("right", "right.jpg")):
        cv2.imwrite(name, cv2.resize(cv2.imread(str(dlama.example() / name)), (128, 128), interpolation=cv2.INTER_AREA))
        hand_in(visit, role, tmp_path / name)
    K = "[64 0 63.5; 0 64 63.5; 0 0 1]"
    Path("calib.txt").write_text(f"cam0={K}\ncam1={K}\ndoffs=0\nbaseline=120\nwidth=128\nheight=128\nndisp=16\n")
    hand_in(visit, "calib", tmp_path / "calib.txt")
    api.read(visit, {})
    api.mark(visit, {"marks": [{"kind": "add", "points": [[65, 77], [65, 100]], "radius": 10}]})
    for move in ({}, {"yaw": 7, "dolly": 0.2}):
        result = completed(visit, **move)
        packed = unpacked(result, visit)
        assert ("out/right/image.png" in packed) == (not move)
        Path("mask.png").write_bytes(packed["mask.png"])
        main(shlex.split(take_home.how(result)["command"])[1:])
        mine = {each.removeprefix("out/"): data for each, data in packed.items() if each.startswith("out/")}
        same_files(mine, files_below(tmp_path / "out"), meta=True)
        shutil.rmtree("out")
    exec(compile(take_home.how(result)["python"], "lines", "exec"), {})
    same_files(mine, files_below(tmp_path / "out"), meta=False)


def test_single_files_are_those_of_the_zip(frame: Path, visit: Visit) -> None:
    """Oracle: the zip, and what it leaves out; a name that the result has not is refused, also one that leads elsewhere. Neither
    leaves anything but the uploads in the visit's folder, nor does the 3-D photo."""
    open_frame(visit, frame)
    result = completed(visit, yaw=4)
    packed = unpacked(result, visit)
    more = {"hole.png", "hole_type.png", "scene.ply", "scene.npz"}
    assert result.done.meta and set(take_home.how(result)["files"]) == more | {
        name.removeprefix("out/") for name in packed if name.startswith("out/")
    }
    assert take_home.single_file(result, "scene.ply", visit.folder)[:3] == b"ply"
    for name in ("image.png", "scene.glb", "depth.exr"):
        assert take_home.single_file(result, name, visit.folder) == packed[f"out/{name}"]
    for name in ("../picture.png", "/etc/passwd", "background.ply", ""):
        with pytest.raises(InputError, match="is no file of this result"):
            take_home.single_file(result, name, visit.folder)
    assert results.photo3d(visit, {}).data.startswith(b"<!doctype html>")
    assert sorted(path.name for path in visit.folder.rglob("*")) == ["depth.png", "picture.png"]


def test_names_that_a_shell_would_take_apart(frame: Path, visit: Visit) -> None:
    """Round trip: what the command says splits into the visitor's names again."""
    hand_in(visit, "picture", frame / "image.png", "my photo; rm -rf (1).png")
    hand_in(visit, "depth", frame / "depth.png", "my photo; rm -rf (1).png")
    api.read(visit, {"fov": 60})
    words = shlex.split(take_home.how(completed(visit, yaw=2))["command"])
    assert words[2:4] == ["my photo_ rm -rf (1).png", "depth-my photo_ rm -rf (1).png"]
