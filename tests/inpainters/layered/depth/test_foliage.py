"""Leaves are copied where a cut crown continues (oracles: literal twin, a bush drawn whole and then cut, laws)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters import find_filler
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Inpainter, inpaint
from dlama.inpainters.layered.depth.cut_objects import CutObjects
from dlama.inpainters.layered.depth.foliage import copy_leaves, solid
from dlama.inpainters.layered.depth.surfaces import continue_surfaces
from dlama.inpainters.layered.depth_first import paint_over_depth
from dlama.inpainters.layered.filler import layered
from dlama.inpainters.layered.kernels.quilt import GAP, OUTSIDE, RIM, RIM_BUMPS, UNDECIDED, quilt
from reference.quilting import quilted

CAMERA = Camera.from_fov(256, 192, 60)
ROWS, COLUMNS = np.indices(CAMERA.hw)
BORDER = 176
GREEN, WALL = (30, 90, 20), 210


def bush_before_a_wall(seed: int = 0) -> tuple[View, np.ndarray]:
    """A dark green bush, a fifth of it gaps, before a bright wall, known up to the BORDER; where its leaves are."""
    rng = np.random.default_rng(seed)
    leaves = np.kron(rng.uniform(2.2, 4.2, (64, 86)), np.ones((3, 3)))[: CAMERA.height, : CAMERA.width]
    bush = (np.hypot(ROWS - 80, COLUMNS - BORDER) <= 50) & (leaves < 3.8)
    depth = np.where(bush, leaves, 8).astype(np.float32)
    color = np.where(bush[..., None], GREEN, WALL) + rng.normal(0, 6, (*CAMERA.hw, 1))
    frame = RGBD(np.clip(color, 0, 255).astype(np.uint8), depth, CAMERA)
    return View.from_rgbd(frame).without(COLUMNS >= BORDER, HoleType.OUT_OF_VIEW), bush


@pytest.mark.parametrize("filler", [layered, paint_over_depth(find_filler("telea"))], ids=["layered", "telea"])
def test_a_bush_continues_with_its_own_leaves_whoever_paints(filler: Inpainter) -> None:
    """Truth: out of view the bush is as green, uneven and dense, at the depths of its leaves; next to it the wall continues."""
    view, bush = bush_before_a_wall()
    done, _ = inpaint(view, filler, FillContext(Law(())))
    unseen = COLUMNS >= BORDER
    inner, outer = (np.hypot(ROWS - 80, COLUMNS - BORDER) <= radius for radius in (35, 70))
    leaf = done.depth < 5
    assert leaf[unseen & inner].mean() == pytest.approx(bush[unseen & inner].mean(), abs=0.12)
    assert (done.depth[unseen & ~outer] > 7).mean() > 0.9
    np.testing.assert_allclose(done.color[unseen & inner & leaf].mean(0), GREEN, atol=8)
    np.testing.assert_allclose(done.color[unseen & inner & leaf].std(0), view.color[~unseen & bush].std(0), rtol=0.3)
    assert done.color[unseen & ~outer].mean() > 150


def test_steps_of_estimated_depth_are_no_leaves() -> None:
    """Law: the same bush as an estimate has no leaf to copy, for a network's depth resolves none; rendered, it has."""
    rendered, _ = bush_before_a_wall()
    estimated = rendered.with_planes(
        origin=np.where(rendered.hole, rendered.origin, np.uint8(Origin.ESTIMATED)).astype(np.uint8)
    )
    found = [continue_surfaces(view, FillContext(Law(()))).leaves.shape[1] for view in (rendered, estimated)]
    assert found[0] > 500 and found[1] == 0


@pytest.mark.parametrize("seen", [False, True])
def test_an_object_that_the_source_shows_whole_does_not_extend(seen: bool) -> None:
    """Visibility law: where a camera measured the wall right of the bush, no leaf is copied before it."""
    view, _ = bush_before_a_wall()
    wall = np.where(view.hole, 8, view.depth).astype(np.float32)
    context = FillContext(Law(((CAMERA, wall),) if seen else ()))
    assert (continue_surfaces(view, context).leaves.size == 0) == seen


def objects_of(number: np.ndarray, circle: tuple[float, float, float], w: float = 0.33) -> CutObjects:
    """One object, whose cells are pixels."""
    two = np.array([0, w], np.float32), np.array([(0, 0, 0), circle], np.float32)
    return CutObjects(np.zeros(number.shape, np.float32), number.astype(np.int32), *two)


def test_leaves_are_copied_from_leaves() -> None:
    """Law: every pixel that is copied is a known one of the bush, none comes out of where the crown does not continue; the
    same seed gives the same leaves."""
    view, bush = bush_before_a_wall()
    w = np.where(view.hole, 0, 1 / np.where(view.hole, 1, view.depth)).astype(np.float32)
    number = np.hypot(ROWS - 80, COLUMNS - BORDER) <= 50
    items = objects_of(number & (view.hole | bush), (80, BORDER, 50))
    found = copy_leaves(view, w, items, seed=1)
    pixels, leaves = found
    copied = np.zeros(w.shape, bool)
    copied.ravel()[pixels] = True
    assert copied.sum() == len(pixels) and copied[number & view.hole].mean() > 0.5
    assert not copied[~view.hole | (np.hypot(ROWS - 80, COLUMNS - BORDER) > 55)].any()
    assert (bush & ~view.hole).ravel()[leaves].all()
    np.testing.assert_array_equal(found, copy_leaves(view, w, items, seed=1))


def test_too_narrow_a_strip_shows_no_leaves() -> None:
    """Law: of a bush of which three columns are seen nothing is copied."""
    view, _ = bush_before_a_wall()
    narrow = view.without(COLUMNS < BORDER - 3, HoleType.SENSOR)
    w = np.where(narrow.hole, 0, 1 / np.where(narrow.hole, 1, narrow.depth)).astype(np.float32)
    number = (np.hypot(ROWS - 80, COLUMNS - BORDER) <= 50) & (narrow.hole_type != HoleType.SENSOR)
    assert not copy_leaves(narrow, w, objects_of(number, (80, BORDER, 50))).size


def test_what_has_no_steps_is_no_leaf() -> None:
    """Closed form: of a slope of 0.3 % a pixel all is solid; where neighbours differ by 5 % nothing; what is unknown is not."""
    known = np.ones(CAMERA.hw, bool)
    known[:, :5] = False
    slope = (0.2 * 1.003**COLUMNS).astype(np.float32)
    np.testing.assert_array_equal(solid(slope, known, 13)[:, 6:], np.ones_like(known)[:, 6:])
    assert not solid(slope, known, 13)[:, :5].any()
    assert not solid(np.where((ROWS + COLUMNS) % 2, 0.2, 0.21).astype(np.float32), known, 13).any()


@pytest.mark.parametrize("stride", [1, 2])
def test_quilting_is_as_its_twin(stride: int) -> None:
    """Oracle: literal twin, on a picture half of which is undecided, with gaps, and a block that reaches over the border."""
    rng = np.random.default_rng(3)
    hw, side = (24, 30), 6
    color = rng.integers(0, 256, (*hw, 3), dtype=np.uint8)
    state = np.where(rng.random(hw) < 0.2, GAP, np.arange(24 * 30).reshape(hw)).astype(np.int32)
    state[:, 15:], state[:3, :4] = UNDECIDED, OUTSIDE
    places = np.array([(y, x) for x in (13, 17, 21, 26) for y in (-2, 2, 6, 10, 14, 18, 21)], np.int32)
    corners = np.array([(y, x) for y in (4, 9, 15, 18) for x in (0, 4, 8)], np.int32)
    own, there = (rng.random((len(a), 2)).astype(np.float32) for a in (places, corners))
    tried = rng.integers(0, len(corners), (len(places), 5)).astype(np.int32)
    bumps = rng.normal(size=hw).astype(np.float32)
    expected = quilted(state, color, places, corners, own, tried, there, side, stride, 80.0, RIM + -RIM_BUMPS * bumps)
    quilt(state, color, places, corners, own, tried, there, side, stride, 80.0, bumps)
    np.testing.assert_array_equal(state, expected)
    assert not (state == UNDECIDED).any() and (state == OUTSIDE).sum() == 12
