"""Frames merged into one view (oracles: closed forms, a slow literal twin, the laws that frames stay and order is nothing)."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
import pytest

from dlama.geometry import rendering
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.drawing import layers
from dlama.geometry.frames import merging
from dlama.geometry.frames.choosing import MOST_FRAMES, choose_frames
from dlama.geometry.frames.gathering import scene
from dlama.geometry.frames.merging import merge_frames, nearest_depth_around
from dlama.geometry.fusion import fuse
from dlama.geometry.holes import erode_square
from dlama.geometry.rendering import render, render_fills
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from reference.merging import merged_depth
from worlds import Box, Plane, Sphere, World, moved, noisy_frames

LENS = Camera.from_fov(64, 48, 60)
WALL, BALL, POST = Plane((0, 0, 4), (0.1, 0, -1)), Sphere((0.1, 0.1, 2.2), 0.35), Box((-0.9, -0.6, 2.4), (-0.7, 2, 2.6))
WORLD = World((WALL, BALL, POST))
PLACES = ((0, 0, 0), (0.5, 0, 0.1), (-0.5, 0.1, 0), (0.2, -0.3, 0.3))
CAMERAS = [moved(LENS, (0, -12 * x, 0), (x, y, z)) for x, y, z in PLACES]
BETWEEN = moved(LENS, (0, -2, 0), (0.12, 0.05, 0.05))
frames = partial(noisy_frames, WORLD, CAMERAS)


def as_scene(frames: list[RGBD], noise: tuple[float, float] = (0.0, 0.0)) -> Scene:
    """Without any judgement of what they say of each other."""
    return Scene(tuple(View.from_rgbd(frame) for frame in frames), noise=noise)


def test_in_its_own_camera_a_frame_stays_bit_for_bit() -> None:
    """Law of rendering; what it does not see itself comes from others and says so: ELSEWHERE, and the frame's number."""
    given = frames()
    depth = given[1].depth.copy()
    depth[10:30, 20:40] = 0
    given[1] = RGBD(given[1].color, depth, given[1].camera)
    view = render(scene(given), given[1].camera)
    known = depth > 0
    np.testing.assert_array_equal(view.depth[known], depth[known])
    np.testing.assert_array_equal(view.color, given[1].color)
    assert (view.origin[known] == Origin.MEASURED).all()
    elsewhere = ~known & ~view.hole
    assert elsewhere.mean() > 0.8 * (~known).mean() and (view.origin[elsewhere] == Origin.ELSEWHERE).all()
    truth = WORLD.trace(given[1].camera)[0]
    assert np.median(np.abs(view.depth - truth)[elsewhere]) < 0.004
    assert view.frame is not None
    assert set(np.unique(view.frame[known])) == {2} and 2 not in view.frame[elsewhere]


@pytest.mark.parametrize("place", [1, None])
def test_only_pixels_that_count_are_drawn(place: int | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: all pixels drawn. At a frame's own camera others count where it has no depth; of fills, the holes that measurements
    leave, which are the same whether the frames are drawn again or, away from them, not."""
    given = frames(0.01)
    given[1] = RGBD(given[1].color, np.where(given[1].depth > 3, 0, given[1].depth), given[1].camera)
    many, camera = as_scene(given[:2], (0.012, 0.0)), BETWEEN if place is None else CAMERAS[place]
    before, found = render(many, camera, close=False), View.from_rgbd(given[3])
    filled = dataclasses.replace(found, origin=np.full(LENS.hw, Origin.FILLED, np.uint8))
    larger = dataclasses.replace(many, fills=(filled,))
    some = [render_fills(larger, camera, "surface", before.hole, again) for again in {True, place is not None}]
    for module in (merging, rendering):
        monkeypatch.setattr(module, "count_needed", lambda _: layers.ALL)
    whole = [render(many, camera, close=False), render(larger, camera, close=False)]
    shown = before.hole & ~whole[1].hole
    assert shown.sum() > 30
    for name in ("color", "depth", "hole", "hole_type", "origin", "confidence"):
        np.testing.assert_array_equal(getattr(before, name), getattr(whole[0], name), name)
        if name != "hole_type":
            for one in some:
                np.testing.assert_array_equal(
                    getattr(one, name)[before.hole], getattr(whole[1], name)[before.hole], name
                )


def test_depth_agrees_with_the_slow_twin() -> None:
    """Every pixel of a noisy scene (oracle: the twin, fed with each frame's own drawing)."""
    many = as_scene(frames(0.01), (0.012, 0.0))
    drawn = [render(Scene((layer,)), BETWEEN, types=False) for layer in many.layers]
    around = [nearest_depth_around(layer) for layer in many.layers]
    found = merge_frames(many, BETWEEN, "surface", True).canvas.depth
    for row in range(0, 48, 3):
        for column in range(64):
            shown = [float(view.depth[row, column]) for view in drawn]
            expected = merged_depth(shown, CAMERAS, around, BETWEEN, (row, column), many.noise)
            assert found[row, column] == pytest.approx(expected, rel=1e-5), (row, column)


def test_the_order_of_frames_does_not_count() -> None:
    """Law: depth of the merged view is the same for any order; so are colours, but for rounding."""
    given = frames()
    one, other = (render(as_scene(order), BETWEEN) for order in (given, given[::-1]))
    np.testing.assert_allclose(one.depth, other.depth, rtol=1e-6)
    assert np.abs(one.color.astype(int) - other.color).max() <= 1


def test_more_frames_see_more_and_noise_falls() -> None:
    """Closed form: the mean of several depths is nearer to the truth than one frame's; holes only shrink."""
    given = frames(0.01)
    truth = WORLD.trace(BETWEEN)[0]
    views = [render(as_scene(given[:count], (0.01, 0.0)) if count > 1 else given[0], BETWEEN) for count in (1, 4)]
    assert views[1].hole.mean() < 0.5 * views[0].hole.mean()
    errors = [float(np.median(np.abs(view.depth - truth)[view.valid])) for view in views]
    assert errors[1] < 0.75 * errors[0]


def test_what_another_frame_looked_through_is_dropped() -> None:
    """A phantom in the air of one frame, which the others see past (closed form: the wall's depth comes instead)."""
    given = frames()
    depth = given[0].depth.copy()
    depth[20:26, 44:50] = 1.5
    given[0] = RGBD(given[0].color, depth, given[0].camera)
    alone = render(given[0], BETWEEN)
    assert ((alone.depth > 1.2) & (alone.depth < 1.7)).any()
    view = render(as_scene(given), BETWEEN)
    assert not ((view.depth > 1.2) & (view.depth < 1.7)).any()


def test_gains_bring_one_brightness() -> None:
    """Frames of half the brightness (closed form: the merged colours follow one factor everywhere)."""
    given = frames()
    given[1] = dataclasses.replace(given[1], color=(given[1].color * 0.6).astype(np.uint8))
    given[3] = dataclasses.replace(given[3], color=(given[3].color * 0.8).astype(np.uint8))
    many = scene(given)
    gains = np.array(many.gains)
    np.testing.assert_allclose(gains[:, 0] / gains[0, 0], [1, 1 / 0.6, 1, 1 / 0.8], rtol=0.03)
    truth, view = WORLD.rgbd(BETWEEN), render(many, BETWEEN)
    ratio = view.color[view.valid].astype(float)[:, 0] / truth.color[view.valid][:, 0]
    assert np.percentile(np.abs(ratio / np.median(ratio) - 1), 90) < 0.06
    own = render(many, given[1].camera)
    np.testing.assert_array_equal(own.color, given[1].color)


def test_fills_are_as_bright_as_the_view_that_shows_them() -> None:
    """A fill made in the view of a frame of half the brightness (closed form: its grey times the frames' gains)."""
    views = [View.from_rgbd(WORLD.rgbd(camera)) for camera in CAMERAS]
    behind = np.zeros(LENS.hw, bool)
    behind[18:30, 26:38] = True
    hidden = [view.without(behind | (view.depth < 3), HoleType.OBJECT) for view in views]
    grey = np.full((*LENS.hw, 3), 60, np.uint8)
    filled = hidden[0].with_planes(
        color=np.where(hidden[0].hole[..., None], grey, hidden[0].color),
        depth=World((WALL,)).rgbd(CAMERAS[0]).depth,
        hole=np.zeros(LENS.hw, bool),
        origin=np.where(hidden[0].hole, np.uint8(Origin.FILLED), hidden[0].origin),
    )
    many = fuse(Scene(tuple(hidden), gains=((2, 2, 2), *[(1, 1, 1)] * 2, (0.5, 1, 2))), filled)
    seen_by = zip((CAMERAS[0], CAMERAS[1], BETWEEN, CAMERAS[3]), ([60] * 3, [120] * 3, [120] * 3, [240, 120, 60]))
    for camera, color in seen_by:
        view = render(many, camera)
        inner = erode_square(view.origin == Origin.FILLED, 5)
        assert inner.sum() > 30
        np.testing.assert_allclose(
            view.color[inner], np.broadcast_to(color, (inner.sum(), 3)), atol=4
        )  # a level, times 4


def test_frames_are_chosen_for_what_they_add() -> None:
    """The frame of the camera itself first; never more than asked; of many behind each other few; none that sees elsewhere."""
    given = frames()
    away = WORLD.rgbd(moved(LENS, (0, 180, 0)))
    views = [View.from_rgbd(frame) for frame in [*given, away]]
    assert choose_frames(views, CAMERAS[2])[0] == 2
    assert 4 not in choose_frames(views, BETWEEN)
    crowd = [View.from_rgbd(WORLD.rgbd(moved(LENS, shift=(0.01 * n, 0, 0)))) for n in range(20)]
    assert len(choose_frames(crowd, BETWEEN)) <= MOST_FRAMES and len(choose_frames(crowd, BETWEEN, most=2)) == 2


def test_nothing_known_far_stays_far() -> None:
    """Sky of all frames is sky in the view (closed form)."""
    world = World((Plane((0, 1, 0), (0, -1, 0)),))
    many = as_scene([world.rgbd(camera) for camera in CAMERAS])
    view = render(many, BETWEEN)
    truth = world.trace(BETWEEN)[0]
    assert np.isposinf(view.depth[5:15]).all() and np.isposinf(truth[5:15]).all()


@pytest.mark.parametrize(("wh", "count"), [((8, 6), merging.KEPT), ((1250, 1000), 4), ((2500, 2004), 0)])
def test_what_drawing_finds_of_frames_is_kept_for_the_latest(wh: tuple[int, int], count: int) -> None:
    """Law: found once for each of the latest KEPT frames, or as many as have KEPT_PIXELS, anew after as many others."""
    found: list[View] = []
    keep, lens = merging.keep_latest(lambda frame: found.append(frame)), Camera.from_fov(*wh, 60)
    rgbd = RGBD(np.zeros((*lens.hw, 3), np.uint8), np.ones(lens.hw, np.float32), lens)
    views = [View.from_rgbd(rgbd) for _ in range(count + 1)]
    assert count == min(merging.KEPT, merging.KEPT_PIXELS // (wh[0] * wh[1]))
    for view in (*views[:2], *views[:2], *views, views[0]):
        keep(view)
    assert found == ([*views, views[0]] if count else 4 * views)


def test_a_table_continues_behind_what_stood_on_it() -> None:
    """A cup removed from two frames: where neither shows the table below it, the wall is not seen through the table (oracle: the
    world without the cup)."""
    table, cup = Box((-0.5, 0.4, 1.6), (0.5, 0.45, 2.6)), Box((-0.12, 0.15, 1.9), (0.12, 0.4, 2.1))
    room = Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1)), table
    cameras = [moved(Camera.from_fov(160, 120, 70), shift=(x, y, 0)) for x, y in ((0, -0.3), (0.9, 0.2))]
    with_cup, without = World((*room, cup)), World(room)
    masks = {number: with_cup.trace(camera)[1] == 3 for number, camera in enumerate(cameras)}
    without_cup = scene([with_cup.rgbd(camera) for camera in cameras]).without(masks, dilate=0)
    view, empty = render(without_cup, cameras[0]), without.rgbd(cameras[0])
    on_table = masks[0] & (without.trace(cameras[0])[1] == 2)
    shown = masks[0] & ~view.hole
    assert on_table.sum() > 100
    assert not (on_table & shown & (view.depth > 1.1 * empty.depth)).any()
    assert (shown & ~on_table).any()  # the wall above the table is seen by the other frame


def test_depth_of_another_surface_is_not_taken_for_that_of_what_is_seen() -> None:
    """Closed form: a blue ball without depth in both frames stands before a grey wall that the other one sees past it. Its
    pixels stay without depth here, though that frame has the wall's there; the wall's own, missing next to it, are found."""
    given = []
    for number, camera in enumerate(CAMERAS[:2]):
        truth, surface, *_ = WORLD.trace(camera)
        ball = surface == 1
        color = np.where(ball[..., None], (40, 60, 220), (150, 150, 150)).astype(np.uint8)
        depth = np.where(ball, 0, truth).astype(np.float32)
        if number == 0:
            first, beside = ball, np.roll(ball, 14, 1) & ~ball & (surface == 0)
            depth[beside] = 0
        given.append(RGBD(color, depth, camera))
    view = render(as_scene(given), CAMERAS[0])
    inner = erode_square(first, 5)
    assert inner.sum() > 30 and view.hole[inner].all()
    np.testing.assert_array_equal(view.color[first], given[0].color[first])
    found = beside & ~view.hole
    assert found.sum() > 0.5 * beside.sum() and (view.origin[found] == Origin.ELSEWHERE).all()
    np.testing.assert_allclose(view.depth[found], WORLD.trace(CAMERAS[0])[0][found], rtol=0.02)
