"""The shadow of an object that is removed from many frames (oracle: closed-form frames of a box that darkens a grey ground)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import dlama
from dlama.apps.cli import main
from dlama.datasets.sequences import completion
from dlama.datasets.sequences.loading import open_frames
from dlama.errors import InputError
from dlama.files.rasters.masks import write_mask
from dlama.geometry.camera import Camera
from dlama.geometry.holes import erode_mask
from dlama.geometry.projection import world_points
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.view import View
from posed_folders import write_nerfstudio
from worlds import Box, Plane, World, moved

LENS = Camera.from_fov(192, 144, 70)
BOX = Box((-0.3, 0.1, 2.6), (0.2, 1.0, 3.0))
WORLD = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 8), (0, 0, -1)), BOX))
TO_LIGHT = np.array([-1.0, -1.2, 0.3])
CAMERAS = {f"img-{n}": moved(LENS, (0, -4 * n, 0), (0.1 * n, 0, 0)) for n in range(2)}
LIT, DARK = 150.0, 75.0


def frame(name: str) -> tuple[RGBD, BoolArray, BoolArray]:
    """A frame, the box's mask and the pixels of the ground from which the box hides the light."""
    camera = CAMERAS[name]
    rgbd, shown = WORLD.rgbd(camera), WORLD.trace(camera)[1]
    points = world_points(View.from_rgbd(rgbd))
    shadow = (shown == 0) & np.isfinite(BOX.hit(points, np.broadcast_to(TO_LIGHT, points.shape)))
    level = np.where(shown == 2, 90.0, np.where(shadow, DARK, LIT)) + np.random.default_rng(0).normal(0, 4, shown.shape)
    color = np.repeat(np.clip(level, 0, 255).astype(np.uint8)[..., None], 3, 2)
    return RGBD(color, rgbd.depth, camera), shown == 2, shadow


@pytest.mark.slow
def test_a_shadow_is_removed_from_all_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What stays of it is reported with the option that removes it; with that, its ground is lit in every frame."""
    room = write_nerfstudio(tmp_path / "room", {name: frame(name)[0] for name in CAMERAS}, CAMERAS)
    write_mask(tmp_path / "box.png", frame("img-0")[1])
    words = ["sequence", str(room), "--mask", f"img-0={tmp_path / 'box.png'}", "--keep-poses", "--only", "video"]
    for out, more, least, most in (("stays", [], DARK - 8, DARK + 8), ("gone", ["--with-shadow"], LIT - 12, LIT + 12)):
        main([*words, *more, "-o", str(tmp_path / out)])
        hint = "pixels next to the object look like its shadow and stay: --with-shadow removes it, too"
        assert (hint in capsys.readouterr().out) == (not more)
        meta = json.loads((tmp_path / out / "meta.json").read_text())
        assert meta["with_shadow"] == bool(more) and bool(meta["remaining_shadow"]) == (not more)
        for done in open_frames(tmp_path / out):
            _, mask, shadow = frame(done.name)
            inner = erode_mask(shadow, 3) & ~mask
            assert inner.sum() > 100 and least < np.median(done.load().color[inner]) < most


def test_a_shadow_of_nothing_is_refused(tmp_path: Path) -> None:
    """One line."""
    dlama.write(dlama.complete(frame("img-0")[0], [CAMERAS["img-0"]], filler="telea"), tmp_path / "one", only=["scene"])
    with pytest.raises(InputError, match="with_shadow is for a removed object; give its masks"):
        dlama.sequence(tmp_path / "one" / "scene.npz", with_shadow=True)


def test_an_earlier_removal_is_no_object_of_this_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where its shadow seems to stay, the option is not advised that the test above refuses."""
    monkeypatch.setattr(completion, "shadow_of", lambda found: dict(zip(completion.SHADOW, (500, 1000))))
    rgbd, mask, _ = frame("img-0")
    earlier = dlama.write(dlama.remove(rgbd, mask, filler="telea"), tmp_path / "one", only=["scene"])
    assert dlama.sequence(earlier / "scene.npz").write(tmp_path / "out", only=["colmap"])["remaining_shadow"] == ""
