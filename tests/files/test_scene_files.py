"""scene.npz: everything, without loss (oracle: the arrays that were written), and readable by numpy alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dlama.errors import FileError
from dlama.files.rasters.depth import read_depth
from dlama.files.scenes.scene_npz import _arrays, depth_differences, depth_of_differences, read_npz, write_npz
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.frames.removal import crop_layer
from dlama.geometry.frames.stored import BoxedView, PixelCache
from dlama.geometry.scene import Scene
from dlama.geometry.view import View


def view_of(seed: int, hw: tuple[int, int] = (5, 7)) -> View:
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, 3] = rng.normal(size=3)
    camera = Camera(hw[1], hw[0], 4.1, 4.2, 3.3, 2.4, pose)
    depth = np.where(rng.random(hw) < 0.2, np.inf, rng.uniform(1, 9, hw)).astype(np.float32)
    color, origin = rng.integers(0, 256, (*hw, 3), np.uint8), rng.integers(1, 5, hw, np.uint8)
    hole = np.zeros(hw, bool)
    full = View(camera, color, depth, hole, hole.astype(np.uint8), origin, rng.random(hw, np.float32))
    return full.without(rng.random(hw) < 0.3, HoleType.OBJECT)


def assert_same(a: View, b: View) -> None:
    assert a.camera.same_view_as(b.camera) and np.array_equal(a.camera.K, b.camera.K)
    for name in ("color", "depth", "hole", "hole_type", "origin", "confidence"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name


@pytest.mark.parametrize(("hw", "cache"), [((5, 7), None), ((1, 1), None), ((5, 7), PixelCache(0))])
def test_there_and_back(tmp_path: Path, hw: tuple[int, int], cache: PixelCache | None) -> None:
    """Twice written it is the same file; with a cache that holds nothing layers are read again."""
    view, scene = view_of(0, hw), Scene((view_of(1, hw),), (view_of(3, hw),), (view_of(2),))
    write_npz(tmp_path / "scene.npz", view, scene)
    back, back_scene = read_npz(tmp_path / "scene.npz", cache)
    assert_same(back, view)
    assert len(back_scene.frames) == len(back_scene.fills) == len(back_scene.removals) == 1
    for mine, theirs in zip((*back_scene.layers, *back_scene.removals), (*scene.layers, *scene.removals)):
        assert_same(mine.load(), theirs.load())
    write_npz(tmp_path / "again.npz", view, scene)
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "scene.npz").read_bytes()


def test_a_file_that_was_written_again_is_no_longer_read(tmp_path: Path) -> None:
    """Law: a scene keeps its pixels, also a large one, which is read as it is needed."""
    write_npz(tmp_path / "scene.npz", view_of(0), Scene((view_of(1, (5, 7)),)))
    back = read_npz(tmp_path / "scene.npz", PixelCache(0))[1]
    write_npz(tmp_path / "scene.npz", view_of(0), Scene((view_of(2, (2, 7)),)))
    with pytest.raises(FileError, match="was written again after its scene was read"):
        back.frames[0].load()
    assert read_npz(tmp_path / "scene.npz", PixelCache(0))[1].frames[0].load().camera.hw == (2, 7)


@pytest.mark.parametrize("cache", [None, PixelCache()])
def test_a_boxed_layer_comes_back_in_its_box(tmp_path: Path, cache: PixelCache | None) -> None:
    """Law: what is drawn of a layer is its box, whose noise says where surfaces are cut: a scene read back is drawn alike."""
    where = np.zeros((5, 7), bool)
    where[2:4, 3] = True
    layers = [crop_layer(view_of(seed).without(~where, HoleType.NONE), where) for seed in (2, 3)]
    write_npz(tmp_path / "scene.npz", view_of(0), Scene((view_of(1),), layers[:1], layers[1:]))
    back = read_npz(tmp_path / "scene.npz", cache)[1]
    for mine, theirs in zip((*back.removals, *back.fills), layers):
        assert isinstance(mine, BoxedView) and mine.box == theirs.box == (slice(1, 5), slice(2, 5))
        assert_same(mine.load_part(), theirs.load_part())
        assert_same(mine.load(), theirs.load())
    with np.load(tmp_path / "scene.npz") as arrays:
        damaged = {**arrays, "object0_box": np.array([(1, 9), (2, 5)])}
    np.savez(tmp_path / "damaged.npz", **damaged)
    with pytest.raises(FileError, match=r"damaged\.npz"):
        read_npz(tmp_path / "damaged.npz")


@pytest.mark.parametrize("hw", [(5, 7), (1, 1), (1, 9), (40, 30)])
def test_depth_comes_back_bit_for_bit(hw: tuple[int, int]) -> None:
    """Any bits at all: infinity, NaN with its payload, -0, subnormal numbers."""
    bits = np.random.default_rng(0).integers(0, 2**32, hw, dtype=np.uint32)
    bits.flat[:3] = np.array([np.inf, -0.0, np.nan], np.float32).view(np.uint32)[: bits.size]
    back = depth_of_differences(depth_differences(bits.view(np.float32)))
    assert back.dtype == np.float32 and np.array_equal(back.view(np.uint32), bits)


def test_layers_as_they_are_are_read(tmp_path: Path) -> None:
    """A file whose layers hold colour and depth as they are, written by numpy."""
    arrays = {prefix + name: array for prefix in ("", "layer0_") for name, array in _arrays("", view_of(0)).items()}
    np.savez(tmp_path / "plain.npz", **arrays)
    assert_same(read_npz(tmp_path / "plain.npz")[1].layers[0], view_of(0))


def test_numpy_alone_reads_it(tmp_path: Path) -> None:
    view = view_of(0)
    write_npz(tmp_path / "scene.npz", view, Scene((view_of(1),)))
    with np.load(tmp_path / "scene.npz") as arrays:
        assert {"rgb", "depth", "valid", "K", "world_from_cam", "origin", "confidence"} <= set(arrays.files)
        color = np.cumsum(arrays["layer0_rgb"], 0, dtype=np.uint8)
        assert np.array_equal(arrays["valid"], view.valid) and np.array_equal(color, view_of(1).color)
    assert np.array_equal(read_depth(tmp_path / "scene.npz"), view.depth)


def test_bad_files(tmp_path: Path) -> None:
    """Of others, missing: the option that writes it is named. tests/fuzz has damaged ones."""
    with pytest.raises(FileError, match=r"scene\.npz: no such file; .*--also scene"):
        read_npz(tmp_path / "scene.npz")
    np.savez(tmp_path / "other.npz", depth=np.ones((2, 2)))
    with pytest.raises(FileError, match=r"other\.npz: has no array called 'rgb'"):
        read_npz(tmp_path / "other.npz")
