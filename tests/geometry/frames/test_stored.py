"""Frames that are read when they are needed (oracles: the same frames in memory, bit for bit; the cache's limit)."""

from __future__ import annotations

import dataclasses
import gc
import math
import pickle
import weakref
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

import dlama
from dlama.completion.completion import layer_above
from dlama.errors import InputTypeError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.frames import gathering
from dlama.geometry.frames.choosing import MOST_FRAMES, may_show
from dlama.geometry.frames.merging import KEPT
from dlama.geometry.frames.removal import crop_layer
from dlama.geometry.frames.stored import (
    BLOCK,
    BoxedView,
    PixelCache,
    StoredView,
    coarse_depth,
    count_bytes,
)
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters import context
from dlama.inpainters.context import FillContext
from worlds import Box, Plane, World, moved

LENS = Camera.from_fov(48, 36, 70)
WORLD = World((Plane((0, 0, 4), (0.1, 0, -1)), Plane((0, 1.2, 0), (0, -1, 0)), Box((-1.2, -0.6, 2.8), (-1.0, 2, 3.0))))
PLACES = np.linspace(-1.5, 1.5, 60)
CAMERAS = [moved(LENS, (0, -8 * x, 0), (x, 0.02 * (n % 3), 0)) for n, x in enumerate(PLACES)]
ONE = count_bytes(View.from_rgbd(WORLD.rgbd(CAMERAS[0])))
LIMIT = 12 * ONE
TARGET = moved(LENS, (0, 1, 0), (0.03, 0.02, 0.05))
FOUND = ("origins", "shows_source", "has_holes", "has_filled_depth", "has_errors", "has_open_holes", "has_far")
"""What a scene asks of its layers."""


class Reader:
    """Reads frames of the world, and knows how often, and of how many the pixels are still alive."""

    def __init__(self) -> None:
        self.times = 0
        self.given: list[weakref.ref[np.ndarray]] = []

    def __call__(self, camera: Camera) -> RGBD:
        self.times += 1
        rgbd = WORLD.rgbd(camera)
        depth = rgbd.depth.copy()
        depth[10:14, 20:26] = 0
        found = RGBD(rgbd.color, depth, camera)
        self.given.append(weakref.ref(found.color))  # a view shares it
        return found

    def alive(self) -> int:
        gc.collect()
        return sum(one() is not None for one in self.given)


@pytest.fixture
def limited(monkeypatch: pytest.MonkeyPatch) -> list[PixelCache]:
    """The caches that scenes make, of twelve frames."""
    made: list[PixelCache] = []

    def cache() -> PixelCache:
        made.append(PixelCache(LIMIT))
        return made[-1]

    monkeypatch.setattr(gathering, "PixelCache", cache)
    return made


def readers(reader: Reader) -> list[Callable[[], RGBD]]:
    return [partial(reader, camera) for camera in CAMERAS]


@pytest.mark.slow
def test_results_are_those_of_frames_in_memory(limited: list[PixelCache]) -> None:
    """Bit for bit, with a removal; and never more than the limit is held."""
    reader = Reader()
    stored = dlama.scene(readers(reader)[::4])
    eager = dlama.scene([reader(camera) for camera in CAMERAS[::4]])
    assert stored.gains == eager.gains and stored.noise == eager.noise and stored.numbers == eager.numbers
    mask = WORLD.trace(CAMERAS[20])[1] == 2
    one, other = (dlama.complete(each, [TARGET], mask={5: mask}, filler="telea") for each in (stored, eager))
    for plane in ("color", "depth", "origin", "confidence", "frame"):
        np.testing.assert_array_equal(getattr(one.view, plane), getattr(other.view, plane))
    assert one.meta["law_violations"] == 0 and limited[0].reads > 30
    assert limited[0].bytes <= LIMIT


@pytest.mark.slow
def test_a_camera_touches_few_frames_and_few_are_alive(limited: list[PixelCache]) -> None:
    """Each frame is read at most twice to gather the scene; then a camera reads no more than MOST_FRAMES; 12 are held."""
    reader = Reader()
    found = dlama.scene(readers(reader))
    assert len(found.numbers) == 60 and reader.times <= 2 * 60 + 12
    assert 0 < reader.alive() <= 12  # what was read lives on in the views that the cache holds, and nowhere else
    before = reader.times
    render(found, TARGET)
    assert reader.times - before <= MOST_FRAMES
    assert limited[0].bytes <= LIMIT and limited[0].reads == reader.times
    found.without({21: WORLD.trace(CAMERAS[21])[1] == 2})
    assert reader.alive() <= 12 + KEPT  # and of the frames that were drawn last


@pytest.mark.slow
def test_the_law_of_very_many_frames_is_made_for_each_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it forbids is a part of what the law of all forbids (oracle: that), and it forbids most of it."""
    eager = dlama.scene([Reader()(camera) for camera in CAMERAS])
    whole = Law.of(eager)
    monkeypatch.setattr(context, "HELD_BYTES", 1000)
    near = FillContext.of(eager).near(TARGET).law
    assert MOST_FRAMES <= len(near.measured) < 60
    depth = render(eager, TARGET).depth * np.float32(0.7)
    every = np.ones(depth.shape, bool)
    broken, part = whole.violations(TARGET, depth, every), near.violations(TARGET, depth, every)
    assert not (part & ~broken).any() and part.sum() > 0.95 * broken.sum()


def test_coarse_depth_is_the_nearest_of_each_block() -> None:
    """Oracle: a loop; and a block's ray goes through the block's middle."""
    view = View.from_rgbd(Reader()(CAMERAS[3]))
    coarse, camera = coarse_depth(view), LENS.with_larger_pixels(BLOCK, math.ceil)
    assert coarse.shape == camera.hw == (5, 6)
    for row, column in ((0, 0), (2, 4), (1, 2)):
        block = view.depth[row * BLOCK : (row + 1) * BLOCK, column * BLOCK : (column + 1) * BLOCK]
        assert coarse[row, column] == (0 if block.size < BLOCK**2 or (block == 0).any() else block.min())
    assert camera.fx * BLOCK == pytest.approx(LENS.fx) and camera.cx * BLOCK == pytest.approx(LENS.cx)


def test_views_next_to_the_picture_are_not_drawn() -> None:
    """Law: what `may_show` turns down renders as nothing; what is seen is never turned down."""
    seen = []
    for yaw in range(0, 360, 30):
        camera = moved(LENS, (0, yaw, 0), (0, 0, 0))
        shown = not render(View.from_rgbd(WORLD.rgbd(LENS)), camera).hole.all()
        assert may_show(View.from_rgbd(WORLD.rgbd(LENS)), camera) or not shown
        seen.append(may_show(View.from_rgbd(WORLD.rgbd(LENS)), camera))
    assert not all(seen) and any(seen)


def test_a_stored_view_is_loaded() -> None:
    """Round trips: loaded, pickled, with a part removed; none of them holds pixels beyond its cache."""
    reader = Reader()
    plain, cache = View.from_rgbd(reader(LENS)), PixelCache(0)
    stored = StoredView(LENS, partial(_view, LENS), cache)
    assert cache.reads == 0 and stored.camera is LENS
    again = dataclasses.replace(stored.load(), depth=stored.load().depth * 2)
    assert type(again) is View and cache.reads == 2
    np.testing.assert_array_equal(again.depth, plain.depth * 2)
    where = plain.depth > 3
    taken = stored.without(where, HoleType.OBJECT)
    assert isinstance(taken, StoredView)
    for mine, theirs in ((taken, plain.without(where, HoleType.OBJECT)), (pickle.loads(pickle.dumps(stored)), plain)):
        np.testing.assert_array_equal(mine.load().color, theirs.color)
        np.testing.assert_array_equal(mine.load().hole_type, theirs.hole_type)
    assert cache.bytes == 0 and Scene((stored,)).layers[0] is stored


def test_a_stored_view_is_no_view() -> None:
    """Message: whoever hands one in has to call `load`."""
    stored = StoredView(LENS, partial(_view, LENS), PixelCache(0))
    with pytest.raises(InputTypeError, match=r"type StoredView; a View is expected.*scene\.frames\[0\]\.load\(\)"):
        dlama.fuse(Scene((stored,)), stored)  # type: ignore[arg-type]


def test_a_view_made_of_another_one_is_held_alone() -> None:
    """Law: what a view is made of is read, but the cache keeps the made one, which is asked for instead."""
    cache = PixelCache()
    plain = View.from_rgbd(Reader()(LENS))
    base = StoredView(LENS, partial(View.load, plain), cache)
    made = base.without(plain.valid, HoleType.OBJECT)
    np.testing.assert_array_equal(made.load().hole, plain.hole | plain.valid)
    made.load()
    assert cache.reads == 2 and cache.bytes == count_bytes(made.load())
    base.load()
    assert cache.reads == 3 and cache.bytes == count_bytes(made.load()) + count_bytes(plain)


def test_facts_of_a_stored_view_are_read_once() -> None:
    """Oracle: those of the view in memory, of a frame and of one whose sensor hole was filled."""
    plain = View.from_rgbd(Reader()(LENS))
    filled = plain.with_planes(
        depth=np.where(plain.hole, np.float32(3), plain.depth),
        hole=np.zeros_like(plain.hole),
        origin=np.where(plain.hole, np.uint8(Origin.DEPTH_FILLED), plain.origin),
    )
    for view in (plain, filled):
        cache = PixelCache(0)
        stored = StoredView(LENS, partial(View.load, view), cache)
        for _ in range(2):
            assert [getattr(stored, name) for name in FOUND] == [getattr(view, name) for name in FOUND]
        assert cache.reads == 2  # the first reading finds what a scene asks of all its layers
        opened = stored.without_filled_depth()
        assert (opened is stored) == (view is plain) and isinstance(opened, StoredView)
        np.testing.assert_array_equal(opened.load().depth, plain.depth)
        assert (layer_above(stored, 0.5) is stored) == (view is plain)  # without a filled pixel it stays as it is


def boxed_object() -> tuple[View, BoxedView]:
    """A view with pixels under an object's mask alone, far ones among them, and the same with these pixels held alone."""
    plain = View.from_rgbd(Reader()(LENS))
    where = np.zeros(LENS.hw, bool)
    where[7:21, 18:31] = True
    far = np.where(where & (np.arange(LENS.width) > 27), np.float32(np.inf), plain.depth)
    whole = plain.with_planes(depth=far).without(~where, HoleType.NONE)
    whole = whole.with_planes(hole_type=np.where(where, np.uint8(HoleType.OBJECT), whole.hole_type))
    return whole, crop_layer(whole, where)


def test_a_boxed_view_is_the_whole_one() -> None:
    """Oracle: the view it was cropped from, plane by plane and fact by fact; held are 16 x 15 pixels of it."""
    whole, boxed = boxed_object()
    assert boxed.part.camera.hw == (16, 15) and boxed.camera is LENS
    for field in dataclasses.fields(View)[1:]:
        np.testing.assert_array_equal(getattr(boxed.load(), field.name), getattr(whole, field.name))
    for name in FOUND:
        assert getattr(boxed, name) == getattr(whole, name)
    again = pickle.loads(pickle.dumps(boxed))
    np.testing.assert_array_equal(again.load().depth, whole.depth)
    where = whole.depth > 3.5
    np.testing.assert_array_equal(
        boxed.without(where, HoleType.SENSOR).load().depth, whole.without(where, HoleType.SENSOR).depth
    )


def test_a_boxed_view_is_drawn_as_the_whole_one() -> None:
    """Oracle: the whole view's drawing, of a fill of two frames, from another place and in its own camera."""
    whole, boxed = boxed_object()
    frames = tuple(View.from_rgbd(Reader()(camera)).without(~whole.hole, HoleType.OBJECT) for camera in CAMERAS[:2])
    for camera in (TARGET, LENS):
        one, other = (render(Scene(frames, fills=(fill,)), camera) for fill in (whole, boxed))
        np.testing.assert_array_equal(one.hole, other.hole)
        np.testing.assert_allclose(one.depth, other.depth, rtol=1e-5)
        assert np.abs(one.color.astype(int) - other.color).max() <= 1


def test_what_is_removed_from_many_frames_is_held_in_boxes() -> None:
    """Law: memory of the removed parts is that of the masks, not of the frames."""
    frames = [partial(Reader(), camera) for camera in CAMERAS[28:32]]
    mask = np.zeros(LENS.hw, bool)
    mask[16:24, 22:30] = True
    removed = dlama.scene(frames).without(dict.fromkeys(range(4), mask), dilate=0).removals
    assert len(removed) == 4
    for one in removed:
        assert isinstance(one, BoxedView) and count_bytes(one.part.load()) == ONE * 100 // (48 * 36)


def _view(camera: Camera) -> View:
    return View.from_rgbd(Reader()(camera))
