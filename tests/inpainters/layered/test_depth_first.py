"""Depth first: depth is the continued surfaces', colour the painter's, which never sees an occluder next to a dis-occlusion."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import dlama
from dlama.errors import InputError, ShapeError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Painter
from dlama.inpainters.layered import depth_first
from dlama.inpainters.layered.depth.surfaces import Surfaces, continue_lawfully
from dlama.inpainters.layered.depth_first import (
    BAND,
    MIXED_PX,
    NEARER,
    find_occluders,
    find_occluders_coarsely,
    hide_from_painter,
    paint_over_depth,
    seams,
)
from dlama.inpainters.layered.filler import layered
from dlama.perception.planes import plane_values_at

NOTHING = FillContext(Law(()))


def flat(view: View, metres: float) -> tuple[Surfaces, np.ndarray]:
    """Surfaces without planes, so many metres away everywhere, and that depth."""
    w = np.full(view.depth.shape, 1 / metres, np.float32)
    return Surfaces(w, np.full(w.shape, -1, np.int8), np.zeros((0, 3))), 1 / w


def step(kind: HoleType = HoleType.DISOCCLUDED) -> View:
    """An occluder at 1 m on the left, a wall at 3 m on the right, a hole of 8 columns between them."""
    depth = np.full((40, 80), 3, np.float32)
    depth[:, :36] = 1
    color = np.where(depth[..., None] == 1, np.uint8(250), np.uint8(40)).repeat(3, 2)
    hole = np.zeros(depth.shape, bool)
    hole[:, 36:44] = True
    return View.from_rgbd(RGBD(color, depth, Camera.from_fov(80, 40, 60))).without(hole, kind)


def view_of(depth: np.ndarray, hole: np.ndarray, kind: HoleType, fov: float = 90) -> View:
    """A black picture with a hole."""
    frame = RGBD(np.zeros((*depth.shape, 3), np.uint8), depth, Camera.from_fov(*depth.shape[::-1], fov))
    return View.from_rgbd(frame).without(hole, kind)


def box_on_ground(kind: HoleType) -> tuple[View, np.ndarray, np.ndarray]:
    """Ground 1.5 m below the camera, a hole in it, and in front of that, in the same columns, a box at 1 m; the box; the ground's
    depth, row by row."""
    rows, focal = np.arange(120) + 0.5, Camera.from_fov(160, 120, 90).fy
    ground = np.where(rows > 70, 1.5 * focal / np.maximum(rows - 60, 1), 9).astype(np.float32)
    hole, box = np.zeros((2, 120, 160), bool)
    hole[75:85, 40:120] = box[85:95, 100:110] = True
    return view_of(np.where(box, np.float32(1), ground[:, None]), hole, kind), box, ground


def box_before_a_wall(width: int) -> tuple[View, np.ndarray, np.ndarray]:
    """A box at 1 m before a wall at 3 m, and next to it a dis-occlusion of so many columns; the box, the hole."""
    box, hole = np.zeros((2, 160, 320), bool)
    box[40:120, 140:200], hole[40:120, 200 : 200 + width] = True, True
    return view_of(np.where(box, 1, 3).astype(np.float32), hole, HoleType.DISOCCLUDED), box, hole


def recording(shown: list[np.ndarray]) -> Painter:
    """Paints 99; remembers which pixels it was reported to fill."""

    def paint(picture: np.ndarray, hole: np.ndarray, seed: int) -> np.ndarray:
        shown.append(hole)
        return np.full_like(picture, 99)

    def unused(view: View, context: FillContext, seed: int) -> Fill:
        raise AssertionError("its own way with a view is not asked")

    return Painter(paint, unused, lambda: {"model": "m"})


def test_depth_is_the_continued_surfaces_and_colour_the_painters() -> None:
    """Twin: the depth that `layered` gives, bit for bit, on a real dis-occlusion; its holes show the wall behind, so in
    closed form their points lie on the wall (z = 3 m at home), and the painter was never reported to keep the occluder."""
    home = step().camera
    source = View.from_rgbd(
        RGBD(step().color, np.where(np.arange(80) < 36, 1, 3) + np.zeros((40, 1), np.float32), home)
    )
    scene, shown = Scene((source,)), []
    camera = dataclasses.replace(
        home, world_from_cam=np.array([[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    )
    view, context = render(scene, camera), FillContext.of(scene)
    fill = paint_over_depth(recording(shown))(view, context, 0)
    np.testing.assert_array_equal(fill.depth[view.hole], layered(view, context, 0).depth[view.hole])
    hidden = view.hole & (view.hole_type == HoleType.DISOCCLUDED)
    assert hidden.sum() > 100 and (abs(fill.depth[hidden] - 3) < 0.01).mean() > 0.95
    assert (fill.color[view.hole] == 99).all() and fill.notes["model"] == "m" and "surfaces" in fill.notes["depth_as"]
    assert shown[0][view.hole].all() and shown[0][~view.hole & (view.depth < 2)].any()
    assert not shown[0][~view.hole & (view.depth > 2)].any()


def test_a_function_that_fills_pictures_is_a_filler() -> None:
    """Twin: the depth is that of `layered`, bit for bit; the published recipe paints it, too; what is no picture is refused."""
    rgbd = RGBD(step().color, np.where(np.arange(80) < 36, 1, 3) + np.zeros((40, 1), np.float32), step().camera)

    def mean_color(picture: np.ndarray, hole: np.ndarray, seed: int) -> np.ndarray:
        return np.where(hole[..., None], np.uint8(99), picture)

    done = dlama.view(rgbd, yaw=10, filler=dlama.Painter(mean_color))
    np.testing.assert_array_equal(done.view.depth, dlama.view(rgbd, yaw=10, filler="layered").view.depth)
    assert done.meta["filler"] == "mean_color" and np.median(done.view.color[done.view.filled]) == 99
    grey = dlama.view(rgbd, yaw=10, filler=dlama.Painter(mean_color), recipe="paper")
    assert grey.view.filled.any() and np.allclose(grey.view.depth[grey.view.filled], 99 * 10 / 255)
    with pytest.raises(InputError, match="depth_by 'surfaces' is expected"):
        dlama.view(rgbd, yaw=10, filler=dlama.Painter(mean_color), depth_by="filler")
    with pytest.raises(ShapeError, match="float32; uint8 is expected"):
        dlama.view(rgbd, yaw=10, filler=dlama.Painter(lambda picture, hole, seed: picture.astype(np.float32)))
    with pytest.raises(ShapeError, match="has shape"):
        dlama.view(rgbd, yaw=10, filler=dlama.Painter(lambda picture, hole, seed: picture[:1]))


def test_occluders_next_to_a_disocclusion_are_known_by_their_depth() -> None:
    """Closed form: the columns of the occluder that lie within BAND of the hole, and nothing of the wall."""
    view = step()
    columns = np.flatnonzero(find_occluders(view, *flat(view, 3), NOTHING.law).all(0))
    np.testing.assert_array_equal(columns, np.arange(36 - BAND, 36))


@pytest.mark.parametrize("kind", [HoleType.OUT_OF_VIEW, HoleType.SENSOR])
def test_next_to_what_is_out_of_view_or_lacks_depth_alone_nothing_is_hidden(kind: HoleType) -> None:
    """Law: what lies beyond the picture is hidden by nothing; a sensor hole has its own colours, and colours are painted."""
    view = step(kind)
    if kind == HoleType.SENSOR:
        view = dataclasses.replace(view, origin=np.where(view.hole, np.uint8(Origin.MEASURED), view.origin))
    assert not find_occluders(view, *flat(view, 3), NOTHING.law).any()


def test_ground_that_comes_towards_the_camera_hides_nothing() -> None:
    """Closed form: BAND px below the hole the ground is less than NEARER times as far off, but it is the hole's own surface; the
    box is not."""
    view, box, ground = box_on_ground(HoleType.OBJECT)
    surfaces, filled, _ = continue_lawfully(view, NOTHING, 0)
    assert (surfaces.label[view.hole] > 0).all() and ground[85 + BAND - 1] < NEARER * ground[84]
    found = find_occluders(view, surfaces, filled, NOTHING.law)
    assert found[box].all() and not found[~dilate_mask(box, MIXED_PX)].any()


def test_an_occluder_hides_also_where_its_depth_is_missing() -> None:
    """Law: what the painter must not see is the same whether the sensor measured the occluder's rim, or it was filled."""
    view = step()
    surfaces, filled = flat(view, 3)
    rim = np.zeros(view.hole.shape, np.bool_)
    rim[:, 33:36] = True
    lacking = dataclasses.replace(view, hole=view.hole | rim, depth=np.where(rim, np.float32(0), view.depth))
    assert (lacking.depth_hole == rim).all()
    expected = hide_from_painter(view, surfaces, filled, NOTHING.law)[0]
    assert expected[rim].all()
    found = hide_from_painter(lacking, surfaces, np.where(rim, view.depth, filled), NOTHING.law)[0]
    np.testing.assert_array_equal(found, expected)


def test_occluders_for_a_coarse_picture_are_those_of_every_nth_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: a view whose pixels are squares of 3 x 3 has the occluders of the view of its middles, as squares; a box on ground
    whose plane is inclined, next to a dis-occlusion."""
    monkeypatch.setattr(depth_first, "OCCLUDERS_SIDE", 160)
    view, box, ground = box_on_ground(HoleType.DISOCCLUDED)
    surfaces, filled, _ = continue_lawfully(view, NOTHING, 0)

    def enlarge(plane: np.ndarray) -> np.ndarray:
        return plane.repeat(3, 0).repeat(3, 1)

    inverse, label = (enlarge(each) for each in (surfaces.inverse_depth, surfaces.label))
    depth = np.where(box, np.float32(1), ground[:, None])
    large = view_of(enlarge(depth), enlarge(view.hole), HoleType.DISOCCLUDED)
    planes = surfaces.planes / (3, 3, 1)
    found = find_occluders_coarsely(large, Surfaces(inverse, label, planes), enlarge(filled), NOTHING.law)
    expected = find_occluders(view, surfaces, filled, NOTHING.law)
    np.testing.assert_array_equal(found, enlarge(expected))
    assert expected.any()


def test_an_object_that_stands_before_the_hole_is_an_occluder_as_a_whole() -> None:
    """Closed form: a box at 1 m, wider than BAND, before a wall at 3 m: all of it and at most MIXED_PX more, though only its
    edge lies next to the hole. Not where its own surface continues in what was hidden: there BAND px of it."""
    view, box, hole = box_before_a_wall(12)
    surfaces, filled = flat(view, 3)
    found = find_occluders(view, surfaces, filled, NOTHING.law)
    assert found[box].all() and not found[~dilate_mask(box, MIXED_PX)].any()
    label = np.where(box | hole, 1, -1).astype(np.int8)
    one_plane = Surfaces(surfaces.inverse_depth, label, np.array([[0, 0, 1 / 3]]))
    np.testing.assert_array_equal(
        np.flatnonzero(find_occluders(view, one_plane, filled, NOTHING.law).any(0)), np.arange(200 - BAND, 200)
    )


def test_estimated_depth_says_less_of_occluders() -> None:
    """Law: it does not tell where an object ends, only what stands within BAND next to a dis-occlusion; next to a removed object
    it hides nothing."""
    depth = np.full((60, 160), 3, np.float32)
    depth[:, :100] = 1
    hole = np.broadcast_to(np.arange(160) // 10 == 10, depth.shape)
    frame = RGBD(np.zeros((60, 160, 3), np.uint8), depth, Camera.from_fov(160, 60, 60))
    guessed = dataclasses.replace(frame, estimate={"estimator": "mine"})
    for kind, reach in ((HoleType.DISOCCLUDED, BAND), (HoleType.OBJECT, 0)):
        measured, estimated = (View.from_rgbd(one).without(hole, kind) for one in (frame, guessed))
        assert find_occluders(measured, *flat(measured, 3), NOTHING.law)[:, 62:98].all()
        found = np.flatnonzero(find_occluders(estimated, *flat(estimated, 3), NOTHING.law).any(0))
        np.testing.assert_array_equal(found, np.arange(100 - reach, 100))


def test_a_seam_along_an_occluder_hides_it_from_nobody() -> None:
    """Law: where the fill continues the occluder's own face for a few pixels into the hole, it is an occluder all the same; a
    face that continues over half of the hole is none."""
    view, box, hole = box_before_a_wall(40)
    for width, hidden in ((5, True), (25, False)):
        goes_on = box.copy()
        goes_on[40:120, 200 : 200 + width] = True
        label = np.where(goes_on, 1, -1).astype(np.int8)
        w = np.where(goes_on, 1, 1 / 3).astype(np.float32)
        surfaces = Surfaces(w, label, np.array([[0, 0, 1.0]]))
        assert seams(label, hole).any() == hidden
        assert find_occluders(view, surfaces, 1 / w, NOTHING.law)[60:100, 150:198].all() == hidden


def test_what_lies_behind_a_removed_object_is_its_background() -> None:
    """Law: by the depth of the removed object, at 2 m before a wall at 5 m. A box next to it at 2 m is shown to the painter; one
    at 1.5 m stands before it and is hidden, and so is the first where the object's depth is not known."""
    depth = np.full((120, 200), 5, np.float32)
    depth[30:90, 80:120] = 2
    depth[60:90, 50:76], depth[60:90, 124:150] = 2, 1.5
    frame = View.from_rgbd(RGBD(np.zeros((*depth.shape, 3), np.uint8), depth, Camera.from_fov(200, 120, 60)))
    hole = np.zeros(depth.shape, bool)
    hole[27:93, 77:123] = True
    view = frame.without(hole, HoleType.OBJECT)
    law = Law.of(Scene((view,), (frame.without(~hole, HoleType.NONE),)))
    known, unknown = (find_occluders(view, *flat(view, 5), one) for one in (law, NOTHING.law))
    assert not known[60:90, 50:76].any() and known[60:90, 126:148].all()
    assert unknown[60:90, 54:74].all() and unknown[60:90, 126:148].all()


def test_a_sensor_hole_keeps_its_colour() -> None:
    """Law: where only depth is missing no painter is asked."""
    view = step(HoleType.SENSOR)
    view = dataclasses.replace(view, origin=np.where(view.hole, np.uint8(Origin.MEASURED), view.origin))
    shown: list[np.ndarray] = []
    fill = paint_over_depth(recording(shown))(view, NOTHING, 0)
    assert not shown and fill.color is view.color


def test_other_fillers_go_their_own_way() -> None:
    """Law: one that fills no pictures is called as it is."""
    view = step()
    own = Fill(view.color, np.ones_like(view.depth), 7, {"who": "own"})
    assert paint_over_depth(lambda view, context, seed: own)(view, NOTHING, 0) is own


def test_painting_is_proportional_to_the_colour_holes() -> None:
    """Probe: where depth is missing in all corners of a large picture, a painter sees the part round the one removed object; the
    rest stays to the bit, and depth (closed form: the wall) is filled everywhere."""
    depth, hole = np.full((700, 1200), 3, np.float32), np.zeros((700, 1200), bool)
    depth[:5, :5] = depth[-5:, -5:] = 0
    hole[300:340, 600:650] = True
    color = np.random.default_rng(0).integers(100, 140, (*depth.shape, 3), np.uint8)
    view = View.from_rgbd(RGBD(color, depth, Camera.from_fov(1200, 700, 60))).without(hole, HoleType.OBJECT)
    seen: list[tuple[int, ...]] = []

    def paint(picture: np.ndarray, where: np.ndarray, seed: int) -> np.ndarray:
        seen.append(picture.shape)
        return np.where(where[..., None], np.uint8(7), picture)

    for filler in (paint_over_depth(Painter(paint)), layered):
        fill = filler(view, NOTHING, 0)
        np.testing.assert_array_equal(fill.color[~hole], color[~hole])
        np.testing.assert_allclose(fill.depth[view.hole], 3, rtol=1e-3)
    assert len(seen) == 1 and seen[0][0] == 552 and seen[0][1] == 562


def test_a_part_of_surfaces_has_their_values() -> None:
    """Oracle: the planes in the whole picture."""
    planes = np.array([[1e-3, -2e-3, 0.5], [0, 1e-3, 0.2]])
    label = np.random.default_rng(1).integers(1, 3, (30, 40)).astype(np.int8)
    whole = Surfaces(np.ones(label.shape, np.float32), label, planes)
    part = whole.cropped(slice(5, 20), slice(12, 40))
    rows, columns = np.indices(part.label.shape).reshape(2, -1)
    expected = plane_values_at(planes, label[5:20, 12:].ravel(), rows + 5, columns + 12)
    np.testing.assert_allclose(plane_values_at(part.planes, part.label.ravel(), rows, columns), expected)
