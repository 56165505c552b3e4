"""Files that version 0.1 wrote, kept in tests/data/version_0_1: later versions read them (oracle: the small frame, ray-traced).

dlama remove image.png depth.png mask.png --fov 60 --yaw 5 --filler telea --only image,scene -o result
dlama batch jobs.jsonl --fov 60 --filler telea --only image -o out
"""

from __future__ import annotations

import csv
import json
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest

import dlama
from box_frame import CAMERA, WORLD, small_frame
from dlama.errors import FileError
from dlama.files.scenes.scene_npz import read_npz, write_npz
from dlama.files.schema import SCHEMA
from dlama.geometry.codes import HoleType
from dlama.jobs.results.manifest import Manifest
from dlama.jobs.results.result import CSV_COLUMNS
from dlama.jobs.storage import Output

FROZEN = Path(__file__).parents[1] / "data" / "version_0_1"


def test_its_scene_is_read_without_loss(tmp_path: Path) -> None:
    """The frame bit for bit, the object that was removed, two fills; and what is written of it again holds the same."""
    view, scene = read_npz(FROZEN / "scene.npz")
    truth, mask = WORLD.rgbd(CAMERA), dlama.read_mask(small_frame(tmp_path) / "mask.png")
    frame, removal = scene.frames[0], scene.removals[0]
    known, millimetres = ~frame.hole, (truth.depth * 1000).round().astype(np.float32)
    assert known.sum() > 0.6 * known.size and frame.camera.same_view_as(CAMERA)
    assert np.array_equal(frame.color[known], truth.color[known])
    assert np.array_equal(frame.depth[known], millimetres[known] / 1000)
    assert (frame.hole_type == HoleType.OBJECT)[mask].all() and (removal.valid & mask).sum() == mask.sum()
    assert (len(scene.frames), len(scene.removals), len(scene.fills), scene.numbers) == (1, 1, 2, (0,))
    write_npz(tmp_path / "again.npz", view, scene)
    with np.load(FROZEN / "scene.npz") as old, np.load(tmp_path / "again.npz") as new:
        assert all(np.array_equal(old[name], new[name], equal_nan=old[name].dtype.kind == "f") for name in old)


def test_its_fields_are_written_still(tmp_path: Path) -> None:
    """Fields may be added; one that leaves, or gets another meaning, raises SCHEMA."""
    frame = small_frame(tmp_path)
    rgbd, mask = dlama.read_rgbd(frame / "image.png", frame / "depth.png", fov=60), dlama.read_mask(frame / "mask.png")
    dlama.write(dlama.remove(rgbd, mask, yaw=5, filler="telea"), tmp_path / "out", only="image")
    old, new = (json.loads((folder / "meta.json").read_text("utf-8")) for folder in (FROZEN, tmp_path / "out"))
    assert set(old) - {"inputs"} <= set(new) and new["schema"] == SCHEMA
    assert set(old["hole_share_by_type"][0]) <= set(new["hole_share_by_type"][0])
    with (FROZEN / "manifest.csv").open(encoding="utf-8", newline="") as stream:
        assert set(next(csv.reader(stream))) <= set(CSV_COLUMNS)


def test_its_manifest_continues(tmp_path: Path) -> None:
    """One job done, one failed, as its CSV has them."""
    shutil.copytree(FROZEN / "manifest", tmp_path / "manifest")
    with Manifest(Output(str(tmp_path)), read_only=True) as manifest:
        found = {row.id: (row.status, row.error_kind, row.hole_share, row.schema) for row in manifest.rows()}
    assert found == {"near": ("done", "", 0.052734, 1), "lost": ("failed", "FileError", None, 1)}


def test_a_later_schema_is_refused_by_name(tmp_path: Path) -> None:
    """And a file without a number is read as the first."""
    for number, name in ((SCHEMA + 1, "later.npz"), (None, "none.npz")):
        with zipfile.ZipFile(FROZEN / "scene.npz") as old, zipfile.ZipFile(tmp_path / name, "w") as new:
            for part in old.namelist():
                if part != "schema.npy":
                    new.writestr(part, old.read(part))
            if number is not None:
                with new.open("schema.npy", "w") as entry:
                    np.lib.format.write_array(entry, np.array(number))
    assert dlama.read_scene(tmp_path / "none.npz").frames
    with pytest.raises(FileError, match=rf"later\.npz: has fields of schema {SCHEMA + 1}, .* a newer dlama"):
        dlama.read_scene(tmp_path / "later.npz")
