"""Worlds as a data set and as folders."""

from __future__ import annotations

import dataclasses
import pickle
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlama.datasets.easysynth.dataset import easysynth
from dlama.datasets.frames import RemovalTruth, StereoTruth, ViewTruth
from dlama.errors import InputError, OutputError
from dlama.worlds.dataset import world, worlds
from dlama.worlds.writer import write_worlds
from dlama.writing import drafts

SIZE = 64


def test_the_listing_names_every_frame_and_case_and_builds_nothing() -> None:
    """Two worlds, two yaws: five frames, four VPI, five ORI and one SII case each; keys differ; loaders travel."""
    listed = worlds(2, seed=5, size=SIZE, yaws=(10, 40))
    assert [frame.yaw for frame in listed.frames[:5]] == [0, 10, -10, 40, -40]
    assert {protocol: len(listed.of(protocol)) for protocol in ("vpi", "ori", "sii")} == {"vpi": 8, "ori": 10, "sii": 2}
    assert len({case.key for case in listed.cases}) == 20
    assert {frame.scene for frame in listed.frames} == {"w005", "w006"}
    assert len(pickle.dumps(listed)) < 20_000


def test_cases_hold_the_worlds_own_truth() -> None:
    """Oracle: the world of the seed, asked directly."""
    listed = pickle.loads(pickle.dumps(worlds(1, seed=3, size=SIZE, yaws=(20,))))
    made = world(3)
    view = listed.of("vpi")[1].load()
    source, target = made.camera(0, SIZE), made.camera(-20, SIZE)
    assert isinstance(view, ViewTruth) and listed.of("vpi")[1].yaw == -20
    np.testing.assert_array_equal(view.source.color, made.frame(source).color)
    np.testing.assert_array_equal(view.target.depth, made.frame(target).depth)
    np.testing.assert_array_equal(view.target_without.depth, made.frame(target, object=False).depth)
    np.testing.assert_array_equal(view.object_mask, made.raycast(source).group == made.object_index)
    removal = listed.of("ori")[2].load()
    assert isinstance(removal, RemovalTruth) and removal.source.camera.same_view_as(target)
    np.testing.assert_array_equal(removal.mask, made.raycast(target).group == made.object_index)
    shadow = made.shadow_of(made.raycast(target), made.raycast(target, object=False))
    np.testing.assert_array_equal(removal.shadow, shadow)
    np.testing.assert_array_equal(removal.without.color, made.frame(target, object=False).color)


def test_disparities_lead_from_view_to_view() -> None:
    """Law: what the left pixel shows lies `disparity` columns to the left in the right view, at the same depth, or is hidden."""
    truth = worlds(1, seed=24, size=256, kind="street").of("sii")[0].load()
    assert isinstance(truth, StereoTruth) and truth.metric and truth.disparity_right is not None
    rows, columns = np.mgrid[:256, :256]
    landing = columns + 0.5 - truth.disparity_left
    column = np.floor(landing).astype(int)
    inside = (truth.disparity_left > 0) & (column >= 0)
    there = truth.disparity_right[rows[inside], column[inside]]
    mine = truth.disparity_left[inside]
    agree = np.abs(there - mine) < 0.02 * mine + 0.05
    nearer = there > mine
    assert agree.mean() > 0.9 and (agree | nearer).mean() > 0.985
    assert truth.mask_left is not None and truth.mask_left.any() and truth.without_left is not None
    camera = truth.rig.left
    depth = world(24, kind="street").frame(camera).depth
    finite = np.isfinite(depth)
    np.testing.assert_allclose(truth.disparity_left[finite] * depth[finite], camera.fx * 0.12, rtol=1e-5)
    assert (truth.disparity_left[~finite] == 0).all()


def test_folders_are_read_back_by_the_easysynth_reader(tmp_path: Path) -> None:
    """There and back: poses, colours (PNG), depth (16-bit mm), masks; progress counts every frame."""
    reported: list[tuple[int, int]] = []
    which = {"count": 1, "seed": 9, "size": SIZE}
    written = write_worlds(tmp_path, **which, progress=lambda *done: reported.append(done))
    assert written == [tmp_path / "w009"] and reported == [(n, 30) for n in range(1, 31)]
    made = world(9)
    read = easysynth(tmp_path)
    assert {len(read.of(protocol)) for protocol in ("vpi", "ori", "sii")} == {12, 13, 1}
    case = next(case for case in read.of("vpi") if case.yaw == pytest.approx(-30, abs=1e-3))
    truth, camera = case.load(), made.camera(-30, SIZE)
    assert isinstance(truth, ViewTruth)
    np.testing.assert_allclose(truth.target.camera.world_from_cam, camera.world_from_cam, atol=1e-6)
    expected = made.frame(camera)
    np.testing.assert_array_equal(truth.target.color, expected.color)
    near = expected.depth < 9.9
    np.testing.assert_allclose(truth.target.depth[near], expected.depth[near], atol=0.01)
    np.testing.assert_array_equal(truth.object_mask, made.raycast(made.camera(0, SIZE)).group == made.object_index)
    with pytest.raises(OutputError, match="is not empty"):
        write_worlds(tmp_path, count=1, seed=9, size=SIZE, kind="street")


class Killed(BaseException):
    """Stands for SIGKILL."""


def test_a_killed_run_continues(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed at the fortieth frame of sixty; the same call writes what is missing (oracles: one run of all; times of change)."""

    def killed(done: int, total: int) -> None:
        if done == 40:
            raise Killed

    with monkeypatch.context() as broken:
        broken.setattr(shutil, "rmtree", lambda *_, **__: None)
        broken.setattr(Path, "rmdir", lambda *_: None)
        with pytest.raises(Killed):
            write_worlds(tmp_path / "a", count=2, seed=9, size=16, progress=killed)
    first = tmp_path / "a" / "w009" / "made_with.json"
    before = first.stat().st_mtime_ns
    monkeypatch.setattr(drafts, "_swept", set())
    reported: list[int] = []
    write_worlds(tmp_path / "a", count=2, seed=9, size=16, progress=lambda done, total: reported.append(done))
    assert first.stat().st_mtime_ns == before and reported == list(range(1, 61))
    write_worlds(tmp_path / "b", count=2, seed=9, size=16)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"count": 0}, "count is 0; a whole number from 1 to 10000"),
        ({"count": "4"}, "count is '4'; a whole number from 1 to 10000"),
        ({"kind": "cave"}, "kind is 'cave'; one of street, room is expected"),
        ({"seed": 1.5}, "seed is 1.5; 0 or more is expected, a whole number"),
        ({"size": 64.5}, "size is 64.5; a whole number from 1 to 8192"),
        ({"size": 30_000}, "size is 30000; a whole number from 1 to 8192"),
        ({"yaws": (-10, 10)}, "yaws are"),
        ({"yaws": ("10",)}, "yaws are"),
    ],
)
def test_bad_wishes_are_refused(given: dict[str, Any], message: str, tmp_path: Path) -> None:
    """At once, not when the first frame is loaded; no bare TypeError. Messages name what came and what is expected."""
    with pytest.raises(InputError, match=message):
        worlds(**{"count": 1, **given})
    if "seed" in given:
        with pytest.raises(InputError, match=message):
            world(**given)
    if "size" in given:  # more than memory holds: nothing is begun
        with pytest.raises(InputError, match=message):
            write_worlds(tmp_path / "out", count=1, **given)
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("seed", [97, *range(1_000_000_000, 1_000_000_004)])
def test_every_seed_is_a_scene(seed: int) -> None:
    """Law: streets and rooms can be built of any seed; 97 is a street hardly wide enough for its markings."""
    plain = [np.full((8, 8, 3), 100, np.uint8)] * 3
    for kind in ("street", "room"):
        assert len(world(seed, kind=kind, textures=plain).shapes) > 10


def test_a_world_of_one_texture_layer_is_refused() -> None:
    made = world(0, kind="room")
    for wrong in (made.textures[:1], made.textures[..., :3], made.textures[0]):
        with pytest.raises(InputError, match=r"world\.textures is .*; at least 2 layers x .* x 4 are expected"):
            dataclasses.replace(made, textures=wrong)
