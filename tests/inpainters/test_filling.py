"""What `inpaint` promises for every filler: known pixels untouched, the law kept, all holes filled; and what fillers know besides
the view (oracles: closed forms)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law, violations
from dlama.inpainters import FILLERS, find_filler
from dlama.inpainters.confidence import depth_noise, features_of_known
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, inpaint
from worlds import Box, Plane, Sphere, World, moved

PLAIN = [name for name, record in FILLERS.items() if not record.needs_model]
fillers = pytest.mark.parametrize("name", PLAIN)
NOTHING = FillContext(Law(()))


def random_view(seed: int, height: int, width: int) -> View:
    """Any mixture of surface, sky, sensor holes and taken-out pixels; what is known may be nothing."""
    rng = np.random.default_rng(seed)
    depth = np.exp(rng.uniform(-1, 3, (height, width))).astype(np.float32)
    state = rng.random((height, width))
    depth[state < 0.1] = np.inf
    depth[state > 0.9] = 0
    color = rng.integers(0, 256, (height, width, 3), np.uint8)
    view = View.from_rgbd(RGBD(color, depth, Camera.from_fov(width, height, 70)))
    taken = rng.random((height, width)) < rng.choice([0.1, 0.5, 1.0])
    return view.without(taken, HoleType.OBJECT)


def moved_view() -> tuple[View, FillContext]:
    """A street-like world (floor, wall, sky, ball; a sensor hole) seen from 60 cm aside: every kind of hole."""
    world = World((Plane((0, 1, 0), (0, 1, 0)), Box((-9, -0.5, 6), (9, 1, 7)), Sphere((0, 0.3, 3), 0.4)))
    frame = world.rgbd(Camera.from_fov(96, 72, 70))
    depth = frame.depth.copy()
    depth[60:66, 20:30] = 0
    source = View.from_rgbd(RGBD(frame.color, depth, frame.camera))
    return render(source, moved(frame.camera, (0, -8, 0), (0.6, 0, 0))), FillContext.of(Scene((source,)))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(PLAIN)), st.integers(1, 9), st.integers(1, 9))
def test_any_small_view_is_filled(seed: int, name: str, height: int, width: int) -> None:
    """Law, also for 1x1, 1xN and Nx1: known pixels bit for bit, measured colour kept, depth > 0, confidence in 0..1."""
    view = random_view(seed, height, width)
    filled, report = inpaint(view, find_filler(name), NOTHING, seed % 7)
    if view.hole.all():
        assert filled is view and report.notes["nothing_visible"] and report.hole_pixels == 0
        return
    known, sensor = ~view.hole, view.depth_hole
    np.testing.assert_array_equal(filled.color[known | sensor], view.color[known | sensor])
    np.testing.assert_array_equal(filled.depth[known], view.depth[known])
    assert not filled.hole.any() and (filled.depth > 0).all()
    np.testing.assert_array_equal(filled.filled, view.hole & ~sensor)
    np.testing.assert_array_equal(filled.origin == Origin.DEPTH_FILLED, sensor)
    assert (filled.confidence >= 0).all() and (filled.confidence <= 1).all()
    assert report.hole_pixels == view.hole.sum()


def careless(view: View, context: FillContext, seed: int) -> Fill:
    """A filler that writes everywhere, and 1 m before everything."""
    return Fill(np.full_like(view.color, 7), np.ones_like(view.depth), law_moves=3, notes={"careless": True})


def test_a_careless_filler_is_held_to_the_promises() -> None:
    """Guard: it overwrites known pixels and breaks the law everywhere; neither gets through, and the moves are counted."""
    view, context = moved_view()
    filled, report = inpaint(view, careless, context)
    np.testing.assert_array_equal(filled.color[~view.hole], view.color[~view.hole])
    np.testing.assert_array_equal(filled.depth[~view.hole], view.depth[~view.hole])
    assert (filled.color[view.hole] == 7).all() and (filled.depth[view.hole] >= 1).all()
    broken = context.law.violations(view.camera, np.ones_like(view.depth), view.hole)
    assert broken.sum() > 100
    assert report.law_moves == 3 + broken.sum() and report.law_violations == 0
    assert report.notes == {"careless": True}
    assert (filled.depth[view.hole & ~broken] == 1).all() and (filled.depth[broken] > 1).all()


def test_names_are_a_closed_set() -> None:
    """Law: every name is made, without a network the same each time; another name lists them all."""
    assert all(find_filler(name) is find_filler(name) for name in PLAIN)
    with pytest.raises(InputError, match="filler is 'lama-xl'; one of auto, layered, layered-patches, telea") as error:
        find_filler("lama-xl")
    assert all(name in str(error.value) for name in FILLERS)


def test_network_fillers_want_their_file_and_the_others_none() -> None:
    """Message: a network without a file, and a file that has no use."""
    for name in (name for name, record in FILLERS.items() if record.needs_model and record.shipped is None):
        with pytest.raises(InputError, match=f"model is missing: filler '{name}' runs a network"):
            find_filler(name)
    with pytest.raises(InputError, match="`dlama models pull big-lama` gets one"):
        find_filler("lama")
    with pytest.raises(InputError, match=r"model is weights\.onnx and filler 'telea' runs no network"):
        find_filler("telea", "weights.onnx")


def test_a_function_is_a_filler_already() -> None:
    """Law: it comes back as it is; a model next to it has no use."""

    def own(view: View, context: FillContext, seed: int) -> Fill:
        return Fill(view.color, view.depth)

    assert find_filler(own) is own
    with pytest.raises(InputError, match=r"model is weights\.onnx and the filler a function"):
        find_filler(own, "weights.onnx")


def large_view_with_small_hole() -> tuple[View, FillContext]:
    """1200 x 900 px of a floor, a wall and the sky, of which a ball was removed; what was measured is its law."""
    world = World((Plane((0, 1, 0), (0, 1, 0)), Box((-9, -0.5, 6), (9, 1, 7)), Sphere((0.6, 0.6, 3), 0.2)))
    frame = world.rgbd(Camera.from_fov(1200, 900, 70))
    source = View.from_rgbd(frame)
    removed = frame.depth < 3.1
    removed[:, : removed.shape[1] // 2] = False
    removed[650:] = False
    return source.without(removed, HoleType.OBJECT), FillContext.of(Scene((source,)))


def test_a_filler_sees_no_more_of_a_large_view_than_its_hole_needs() -> None:
    """Law: known pixels keep every bit, the hole is filled as in the part alone, and no law is broken. Closed form: the part is
    the hole's box and 256 px round it."""
    view, context = large_view_with_small_hole()
    seen: list[View] = []

    def filler(part: View, its_context: FillContext, seed: int) -> Fill:
        seen.append(part)
        return find_filler("telea")(part, its_context, seed)

    filled, report = inpaint(view, filler, context)
    rows, columns = (np.flatnonzero(view.hole.any(axis)) for axis in (1, 0))
    top, left = rows[0] - 256, columns[0] - 256
    part = seen[0]
    assert part.camera.hw == (min(900, rows[-1] + 257) - top, min(1200, columns[-1] + 257) - left)
    assert part.hole.size < 0.6 * view.hole.size and report.law_violations == 0
    assert not violations(filled, context.law).any() and report.hole_pixels == view.hole.sum()
    known = ~view.hole
    for name in ("color", "depth", "origin", "confidence", "hole_type"):
        np.testing.assert_array_equal(getattr(filled, name)[known], getattr(view, name)[known], err_msg=name)
    alone, _ = inpaint(part, find_filler("telea"), NOTHING)
    box = np.s_[top : top + part.camera.height, left : left + part.camera.width]
    np.testing.assert_array_equal(filled.color[box], alone.color)
    assert (filled.origin[view.hole] == Origin.FILLED).all()


def test_the_law_of_a_part_is_that_of_the_whole() -> None:
    """Law: a depth breaks it in the part where it breaks it in the whole picture, seen from the source and from aside."""
    view, context = large_view_with_small_hole()
    aside = (moved(view.camera, (0, 5, 0), (0.3, 0, 0)), np.full((900, 1200), 2.5, np.float32))
    law = Law((*context.law.measured, aside))
    depth = np.broadcast_to(np.linspace(0.5, 7, 1200, dtype=np.float32), view.hole.shape).copy()
    rows, columns = slice(300, 700), slice(500, 1100)
    inside = law.cropped(view, rows, columns)
    part = view.cropped(rows, columns)
    whole = law.violations(view.camera, depth, np.ones_like(view.hole))[rows, columns]
    cut = inside.violations(part.camera, depth[rows, columns], np.ones(part.camera.hw, bool))
    assert 0.05 < whole.mean() < 0.95
    assert (whole != cut).mean() < 1e-4  # a pixel centre on the border of two, by rounding


def test_the_sky_that_was_measured_is_known() -> None:
    """Closed form: the mean colour of the measured far pixels; a filled sky is none, and without sky there is no colour."""
    color = np.array([[(10, 20, 30), (20, 40, 50), (200, 0, 0)]], np.uint8)
    camera = Camera.from_fov(3, 1, 60)
    source = View.from_rgbd(RGBD(color, np.array([[np.inf, np.inf, 2]], np.float32), camera))
    context = FillContext.of(Scene((source,)))
    assert context.sky is not None
    np.testing.assert_array_equal(context.sky, (15, 30, 40))
    below = source.without(np.array([[True, True, False]]), HoleType.OBJECT)
    filled, _ = inpaint(below, find_filler("telea"), context)
    for scene in (Scene((below,)), Scene((below,), fills=(filled,))):
        assert FillContext.of(scene).sky is None


def test_the_noise_of_depth_that_is_drawn_without_it_is_known() -> None:
    """Closed form: exact depth has none; of noisy depth, confidence knows as much of a view drawn from aside as of the frame."""
    camera = Camera.from_fov(160, 120, 60)
    frame = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 4), (0.3, 0, -1)))).rgbd(camera)
    assert FillContext.of(Scene((View.from_rgbd(frame),))).noise == 0
    noise = np.float32(0.01) * np.random.default_rng(2).standard_normal(camera.hw, np.float32)
    source = View.from_rgbd(replace(frame, depth=frame.depth * (1 + noise)))
    context, aside = FillContext.of(Scene((source,))), render(source, moved(camera, shift=(0.2, 0, 0)))
    assert context.noise == depth_noise(source) > depth_noise(aside)
    assert (features_of_known(aside, context.noise).rows[25] == np.float32(context.noise)).all()
