"""Surfaces painted with patches, without a network and with one (oracles: patterns that continue, laws)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import dlama
from brick_walls import COLUMNS, ROWS, brick_wall
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters import AUTO, FILLER_NAMES, FILLERS, find_filler
from dlama.inpainters.context import FillContext
from dlama.inpainters.layered.filler import Guess, close_narrow_holes, copy_patches, layered, replace_removed


def camera_frame(off: int, wall: np.ndarray) -> tuple[RGBD, np.ndarray]:
    """A wall at 2 m behind a plain table at 1 m, whose depth ends `off` columns next to its picture; a hole in the wall."""
    rows, columns = np.indices(wall.shape[:2])
    color = np.where((columns < 40)[..., None], np.uint8([200, 160, 90]), wall).astype(np.uint8)
    depth = np.where(columns - off < 40, 1, 2).astype(np.float32)
    hole = (np.abs(rows - 50) < 12) & (np.abs(columns - 90) < 14)
    return RGBD(color, depth, Camera.from_fov(128, len(rows), 60)), hole


def test_over_layers_depth_is_that_of_layered_and_colours_are_the_pictures() -> None:
    """Law: depth is the same to the bit, cracks are painted the same; truth: the wall's pattern continues in the hole."""
    rgbd, hole = camera_frame(4, brick_wall())
    crack = (ROWS == 20) & (COLUMNS > 50)
    view = View.from_rgbd(rgbd)
    view = view.without(hole, HoleType.OBJECT).without(crack, HoleType.CRACK)
    scene = Scene((view,))
    found = FillContext.of(scene)
    context = FillContext(found.law.with_aligned_edges(scene), found.sky)
    fills = [find_filler(name)(view, context, 3) for name in ("layered", "layered-patches")]
    np.testing.assert_array_equal(fills[0].depth, fills[1].depth)
    np.testing.assert_array_equal(fills[0].color[crack], fills[1].color[crack])
    assert (np.abs(fills[1].color[hole].astype(int) - rgbd.color[hole]).max(-1) <= 12).mean() > 0.8
    assert "migan" in str(fills[1].notes["guess"]) and fills[1].notes["planes"] == fills[0].notes["planes"]


def test_the_network_paints_dis_occlusions_and_nothing_else() -> None:
    """Law: of a view of exact depth, all but the dis-occlusions has the colours of `layered`, to the bit; without any the network
    does not run."""
    rgbd, _ = camera_frame(0, brick_wall())
    for move, some in ((dlama.orbit(rgbd.camera, 15), True), (dlama.orbit(rgbd.camera, 15, pivot=1e-6), False)):
        done, plain = (dlama.complete(rgbd, [move], filler=name) for name in ("auto", "layered"))
        uncovered = done.views[0].hole_type == HoleType.DISOCCLUDED.value
        differs = (done.views[0].color != plain.views[0].color).any(-1)
        assert differs.any() == uncovered.any() == some and not (differs & ~uncovered).any()
        assert ("migan" in str(done.meta)) == some


def test_what_patches_begin_from() -> None:
    """Definition: where no patch is known the beginning comes back, and what is known stays."""
    hole = (ROWS % 4 == 0) | (COLUMNS % 4 == 0)
    color, start = (np.full((96, 128, 3), level, np.uint8) for level in (40, 81))
    view = View.from_rgbd(RGBD(color, np.full((96, 128), 3, np.float32), Camera.from_fov(128, 96, 60)))
    view = view.without(hole, HoleType.OBJECT)
    painted = copy_patches(np.where(hole[..., None], start, color), hole, np.zeros((96, 128), np.int8), 0)
    for done in (painted, replace_removed(view, color, Guess(lambda: start, hole, dict), hole, 0)):
        np.testing.assert_array_equal(done, np.where(hole[..., None], start, color))


def test_without_a_network_the_pattern_of_a_surface_continues() -> None:
    """Truth: a wall whose bricks repeat, in the hole of an object; sky out of view stays smooth, whatever is seen of it."""
    rgbd, hole = camera_frame(0, brick_wall())
    view = View.from_rgbd(rgbd).without(hole, HoleType.OBJECT)
    done = layered(view, FillContext.of(Scene((view,))))
    assert (np.abs(done.color[hole].astype(int) - rgbd.color[hole]).max(-1) <= 12).mean() > 0.8
    sky = RGBD(brick_wall(), np.full((96, 128), np.inf, np.float32), rgbd.camera)
    turned = dlama.view(sky, yaw=15, pivot=1e-6, filler="layered").views[0]
    unseen = turned.hole_type == HoleType.OUT_OF_VIEW.value
    assert unseen.any() and turned.color[unseen].std(0).max() < 0.5 * turned.color[~unseen].std(0).min()


def test_the_network_runs_where_a_depth_camera_did_not_see() -> None:
    """Law: out of view alone is enough where depth edges are off; of exact depth the network paints nothing there."""
    plain = np.random.default_rng(0).integers(60, 70, (144, 128, 3), np.uint8)
    for off in (0, 4):
        rgbd, _ = camera_frame(off, plain)
        done = dlama.complete(rgbd, [dlama.orbit(rgbd.camera, 15, pivot=1e-6)])
        assert (done.views[0].hole_type == HoleType.OUT_OF_VIEW.value).any()
        assert ("migan" in str(done.meta)) == (off > 0)


def test_auto_is_the_filler_that_suits_the_depth() -> None:
    """Law: layered-patches where depth was measured, patchmatch where it was estimated; meta data say which and why; a name is
    that name."""
    assert FILLER_NAMES[0] == AUTO and set(FILLER_NAMES) == {AUTO, *FILLERS}
    plain = np.random.default_rng(0).integers(60, 70, (144, 128, 3), np.uint8)
    rgbd, hole = camera_frame(4, plain)
    assert dlama.view(rgbd, yaw=5).meta["filler"] == "layered-patches"
    assert dlama.remove(rgbd, hole).meta["filler"] == "layered-patches"
    rgbd, hole = camera_frame(0, brick_wall())
    estimated = dataclasses.replace(rgbd, estimate={"estimator": "mine"})
    done = dlama.remove(estimated, hole)
    assert done.meta["filler"] == "patchmatch" and done.meta["depth"] == "estimated"
    for frame in (rgbd, estimated):
        assert dlama.remove(frame, hole, filler="telea").meta["filler"] == "telea"


def ramp_with(hole: np.ndarray, kind: HoleType = HoleType.DISOCCLUDED) -> View:
    """A view of a ramp of 2 levels a column, with that hole (H x W), black in it."""
    ramp = np.repeat((2 * COLUMNS)[..., None], 3, 2).astype(np.uint8)
    camera = Camera.from_fov(128, 96, 60)
    return View.from_rgbd(RGBD(ramp, np.full((96, 128), 2, np.float32), camera)).without(hole, kind)


@pytest.mark.parametrize("width", [1, 2, 3])
def test_a_crack_takes_the_mean_of_both_sides(width: int) -> None:
    """Closed form: a row with one colour on both sides takes it; its depth stays open, and all else is as it was."""
    crack = np.isin(ROWS, range(20, 20 + width)) & (COLUMNS > 10) & (COLUMNS < 50)
    view = ramp_with(crack)
    closed = close_narrow_holes(view, np.full_like(view.depth, 2))
    assert np.abs(closed.color[..., 0].astype(int) - 2 * COLUMNS)[crack].max() <= 4
    assert not closed.color_hole.any() and (closed.depth_hole == crack).all()
    np.testing.assert_array_equal(closed.color[~crack], view.color[~crack])
    np.testing.assert_array_equal(closed.origin[~crack], view.origin[~crack])


@pytest.mark.parametrize("filled", [1.0, 2.0])
def test_a_crack_takes_no_colour_of_an_occluder(filled: float) -> None:
    """Closed form: a crack between a white object at 1 m and black background at 2 m, filled at 2 m, is black; at 1 m it has
    some of both, which was measured no farther."""
    crack, near = (COLUMNS >= 60) & (COLUMNS < 63), COLUMNS < 60
    color = np.repeat(np.where(near, np.uint8(255), np.uint8(0))[..., None], 3, 2)
    depth = np.where(near, np.float32(1), np.float32(2))
    view = View.from_rgbd(RGBD(color, depth, Camera.from_fov(128, 96, 60))).without(crack, HoleType.DISOCCLUDED)
    closed = close_narrow_holes(view, np.full_like(depth, filled)).color[crack]
    assert (closed == 0).all() if filled > 1 else (closed > 0).all()


def test_wide_holes_stay_and_lose_their_tails() -> None:
    """Law: a square stays open, a tail of 2 px that leads to it does not."""
    square = (np.abs(ROWS - 20) < 8) & (np.abs(COLUMNS - 20) < 8)
    tail = (np.abs(ROWS - 20) < 2) & (COLUMNS >= 28) & (COLUMNS < 50)
    view = ramp_with(square | tail)
    np.testing.assert_array_equal(close_narrow_holes(view, np.full_like(view.depth, 2)).color_hole, square)


def test_a_thin_object_stays_removed() -> None:
    """Law: behind a wire that was removed the picture is painted, not closed from its rims."""
    view = ramp_with(np.abs(ROWS - 20) < 2, HoleType.OBJECT)
    assert close_narrow_holes(view, np.full_like(view.depth, 2)) is view
