"""Rendering's laws: a frame in its own camera is itself, the nearest wins, nothing behind a camera is seen, none crashes."""

from __future__ import annotations

import dataclasses
import gc
import weakref

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import PointCloud
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.drawing.grid_mesh import find_joints
from dlama.geometry.kernels import jit
from dlama.geometry.projection import lift
from dlama.geometry.rendering import MODES, Mode, render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from worlds import Plane, Sphere, World, moved, pixels_of, points_of, pose_of, rgbd_of

modes = pytest.mark.parametrize("mode", MODES)


@st.composite
def frames(draw: st.DrawFn) -> RGBD:
    """Any small frame at any pose: surfaces and lone pixels (wires), sky and missing pixels in any mixture."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    height, width = draw(st.integers(1, 12)), draw(st.integers(1, 12))
    pose = pose_of(rng.normal(size=3), rng.uniform(-1000, 1000, 3))
    focal = draw(st.floats(0.5, 2000))
    camera = Camera(width, height, focal, focal * draw(st.floats(0.5, 2)), *rng.uniform(-5, 15, 2), pose)
    depth = np.full((height, width), draw(st.floats(0.05, 500)), np.float32)
    state = rng.random((height, width))
    share = draw(st.floats(0, 0.5))
    depth[state < share] = np.exp(rng.uniform(-3, 7, (height, width)))[state < share]
    depth[(state > 0.5) & (rng.random(depth.shape) < draw(st.floats(0, 1)))] = np.inf
    depth[rng.random(depth.shape) < draw(st.sampled_from([0, 0.1, 1]))] = 0
    return RGBD(rng.integers(0, 256, (height, width, 3), np.uint8), depth, camera)


@settings(max_examples=100, deadline=None)
@given(frames(), st.sampled_from(MODES))
def test_a_frame_in_its_own_camera_is_itself(frame: RGBD, mode: Mode) -> None:
    """Law: every pixel comes back bit for bit, sky too; what is missing is a SENSOR hole that keeps its colour, marked as
    View.from_rgbd marks it."""
    view = render(frame, frame.camera, mode)
    np.testing.assert_array_equal(view.depth, frame.depth)
    np.testing.assert_array_equal(view.color, frame.color)
    np.testing.assert_array_equal(view.hole, frame.missing)
    np.testing.assert_array_equal(view.hole_type, frame.missing * np.uint8(HoleType.SENSOR))
    np.testing.assert_array_equal(view.origin[~view.hole], Origin.MEASURED)
    np.testing.assert_array_equal(view.origin, View.from_rgbd(frame).origin)
    np.testing.assert_array_equal(view.confidence, ~frame.missing)


def test_a_frame_in_its_own_camera_shares_its_arrays() -> None:
    """Law: nothing is drawn and nothing copied where nothing can change; what a caller left in holes is not shown."""
    depth = np.full((9, 12), 2, np.float32)
    depth[3:6, 4:9] = 0
    color = np.random.default_rng(0).integers(0, 256, (9, 12, 3), np.uint8)
    source = View.from_rgbd(RGBD(color, depth, Camera.from_fov(12, 9, 60)))
    seen = render(source, source.camera)
    assert np.shares_memory(seen.color, source.color) and np.shares_memory(seen.depth, source.depth)
    assert (seen.hole_type == source.hole_type).all()
    left = dataclasses.replace(source, confidence=np.full(depth.shape, 0.5, np.float32))
    assert not render(left, source.camera).confidence[3:6, 4:9].any()


@settings(max_examples=30, deadline=None)
@given(frames(), st.sampled_from(MODES))
def test_a_filled_view_in_its_own_camera_is_itself(frame: RGBD, mode: Mode) -> None:
    """Law: origin and confidence of filled pixels come back as they are, and a hole of any type keeps its type."""
    rng = np.random.default_rng(0)
    kind = rng.integers(1, 7, frame.depth.shape).astype(np.uint8)
    view = View(
        frame.camera,
        frame.color * ~frame.missing[..., None],
        frame.depth,
        frame.missing,
        kind * frame.missing,
        rng.integers(1, 5, frame.depth.shape).astype(np.uint8) * ~frame.missing,
        rng.random(frame.depth.shape, np.float32) * ~frame.missing,
    )
    again = render(view, frame.camera, mode)
    for field in dataclasses.fields(View)[1:]:
        np.testing.assert_array_equal(getattr(again, field.name), getattr(view, field.name), err_msg=field.name)


@settings(max_examples=60, deadline=None)
@given(st.floats(0.1, 50), st.floats(0.1, 50), st.booleans())
def test_of_two_points_on_one_ray_the_nearest_wins(one: float, other: float, swap: bool) -> None:
    """Law, whatever the order of the points; the depth that comes out is the nearer one's."""
    camera = Camera.from_fov(5, 4, 70, [[0, 0, 1, 3], [1, 0, 0, -2], [0, 1, 0, 5], [0, 0, 0, 1]])
    points = np.stack([points_of(camera, np.full(camera.hw, z))[2, 1] for z in (one, other)])
    color = np.array([[255, 0, 0], [0, 255, 0]], np.uint8)
    order = [1, 0] if swap else [0, 1]
    cloud = PointCloud(points[order], color[order], np.ones(2, np.uint8), np.ones(2, np.float32))
    view = render(cloud, camera, "points")
    assert (~view.hole).sum() == 1
    assert view.depth[2, 1] == pytest.approx(min(one, other), rel=1e-6)
    if abs(one - other) > 1e-3:
        np.testing.assert_array_equal(view.color[2, 1], color[int(other < one)])


def plane_at(z: float, color: tuple[int, int, int], camera: Camera) -> View:
    """A fronto-parallel wall in one colour."""
    return View.from_rgbd(rgbd_of(np.full(camera.hw, z), camera, color))


@modes
@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_of_two_layers_the_nearest_wins(order: tuple[int, int], mode: Mode) -> None:
    """Law: whatever the order of the layers in the scene, and from the nearer layer's own camera too.

    The nearer wall was seen from nearer by, so it shrinks in these targets: also points leave no cracks to look through.
    """
    camera = Camera.from_fov(24, 16, 60)
    views = plane_at(3, (255, 0, 0), camera), plane_at(1, (0, 255, 0), moved(camera, shift=(0, 0, 0.5)))
    scene = Scene((views[order[0]],), fills=(views[order[1]],))  # walls at z = 3 and z = 1.5
    middle = np.s_[4:12, 6:18]
    for target, expected in ((camera, 1.5), (views[1].camera, 1), (moved(camera, shift=(0.05, 0, 0.1)), 1.4)):
        view = render(scene, target, mode)
        np.testing.assert_allclose(view.depth[middle], expected, rtol=1e-5)
        np.testing.assert_array_equal(view.color[middle], np.broadcast_to([0, 255, 0], (8, 12, 3)))


def test_points_of_a_view_and_of_its_cloud_are_the_same_picture() -> None:
    """Twin within the package: lifting, then projecting the bare cloud, equals the grid's own points mode."""
    source = Camera.from_fov(40, 30, 70)
    frame = World((Sphere((0, 0, 4), 1), Plane((0, 0, 6), (0, 0.1, -1)))).rgbd(source)
    target = moved(source, (3, -5, 2), (0.4, 0.1, 0.3))
    view = View.from_rgbd(frame)
    cloud = lift(view.without(find_joints(view).flying, HoleType.FLYING))  # which pixels fly is known in a grid alone
    of_grid, of_cloud = render(view, target, "points"), render(cloud, target, "points")
    np.testing.assert_array_equal(of_cloud.hole, of_grid.hole)
    known = ~of_grid.hole
    assert known.mean() > 0.5
    np.testing.assert_allclose(of_cloud.depth[known], of_grid.depth[known], rtol=1e-6)
    np.testing.assert_array_equal(of_cloud.color[known], of_grid.color[known])
    np.testing.assert_array_equal(of_cloud.origin[known], Origin.REPROJECTED)


def test_a_picture_that_is_drawn_again_is_prepared_once_and_let_go_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: its View, drawn bit for bit alike. One View is made of it, and nothing holds it after it."""
    camera = Camera.from_fov(64, 48, 60)
    rgbd = World((Plane((0, 1, 0), (0, -1, 0)), Sphere((0, 0, 3), 0.4))).rgbd(camera)
    elsewhere, made, begin = moved(camera, (0.2, 0, 0)), list[View](), View.from_rgbd
    expected = render(begin(rgbd), elsewhere)
    monkeypatch.setattr(View, "from_rgbd", lambda one: made.append(begin(one)) or made[-1])
    for _ in range(2):
        found = render(rgbd, elsewhere)
        np.testing.assert_array_equal(found.color, expected.color)
        np.testing.assert_array_equal(found.hole_type, expected.hole_type)
    kept = weakref.ref(made.pop())
    assert not made and kept() is not None
    del rgbd
    gc.collect()
    assert kept() is None


def test_what_is_no_mode_is_refused() -> None:
    """Oracle: the message says what came and what was expected."""
    frame = rgbd_of(np.ones((2, 2)))
    with pytest.raises(InputError, match=r"'mesh'; one of surface, points"):
        render(frame, frame.camera, "mesh")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="mode 'points' is expected"):
        render(lift(frame), frame.camera, "surface")


@modes
def test_without_types_only_the_types_differ(mode: Mode) -> None:
    """Law: `types=False` draws the same picture; its holes all say OUT_OF_VIEW."""
    source = Camera.from_fov(40, 30, 70)
    frame = World((Sphere((0, 0, 4), 1), Plane((0, 0, 6), (0, 0, -1)))).rgbd(source)
    target = moved(source, shift=(0.7, 0, 0))
    typed, plain = render(frame, target, mode), render(frame, target, mode, types=False)
    for name in ("color", "depth", "hole", "origin", "confidence"):
        np.testing.assert_array_equal(getattr(typed, name), getattr(plain, name))
    np.testing.assert_array_equal(plain.hole_type, plain.hole * np.uint8(HoleType.OUT_OF_VIEW))
    assert len(np.unique(typed.hole_type)) > 2


def nothing_seen(view: View) -> None:
    """All hole, all zero, and every pixel says why."""
    assert view.hole.all() and (view.hole_type != HoleType.NONE).all()
    assert not view.color.any() and not view.depth.any() and not view.origin.any() and not view.confidence.any()


@modes
@pytest.mark.parametrize(
    ("turn", "shift"), [((0, 180, 0), (0, 0, 0)), ((0, 0, 0), (0, 0, 10)), ((0, 90, 0), (30, 0, 0))]
)
def test_a_target_from_which_nothing_is_visible(turn, shift, mode: Mode) -> None:  # type: ignore[no-untyped-def]
    """Law: turned round, behind the wall, or far aside: a view that is all hole, and no crash."""
    source = Camera.from_fov(16, 12, 60)
    nothing_seen(render(plane_at(3, (255, 0, 0), source), moved(source, turn, shift), mode))


@modes
def test_nothing_behind_the_camera_appears(mode: Mode) -> None:
    """Closed form: inside a sphere, halfway to its wall and turned, all depths are positive and on the true wall."""
    world = World((Sphere((0, 0, 0), 2),))
    source = Camera.from_fov(48, 36, 80)
    frame = world.rgbd(source)
    for turn, shift in (((0, 0, 0), (0, 0, 1.5)), ((0, 120, 0), (0, 0, 1.0)), ((60, 0, 0), (0.5, 0, 0.9))):
        target = moved(source, turn, shift)
        view = render(frame, target, mode)
        points = points_of(target, view.depth.astype(np.float64))
        x, y, z = pixels_of(source, points[~view.hole])
        assert (view.depth[~view.hole] > 0).all() and (z > 0).all()
        # a footprint at the border of the picture reaches half a source pixel (f = 28.6 px) beyond it, magnified
        assert max(-x.min(initial=0), x.max(initial=0) - 48, -y.min(initial=0), y.max(initial=0) - 36) < 1.5
        assert world.distance(points[~view.hole]).max(initial=0) < 2 / source.fx


@modes
@pytest.mark.parametrize("hw", [(1, 1), (1, 7), (7, 1), (2, 2)])
def test_pictures_of_one_row_or_column(hw: tuple[int, int], mode: Mode) -> None:
    """Closed form: a wall of 1 x N pixels moved by a pixel's width shifts by one pixel, each with its colour."""
    camera = Camera(hw[1], hw[0], 10, 10, hw[1] / 2, hw[0] / 2)
    color = np.random.default_rng(2).integers(0, 256, (*hw, 3), np.uint8)
    frame = RGBD(color, np.full(hw, 2, np.float32), camera)
    view = render(frame, moved(camera, shift=(0.2, 0, 0)), mode)  # f / z * 0.2 m = 1 px
    np.testing.assert_array_equal(view.color[:, :-1], color[:, 1:])
    np.testing.assert_array_equal(view.hole, np.arange(hw[1]) == np.full(hw, hw[1] - 1))
    np.testing.assert_array_equal(view.hole_type[:, -1], HoleType.OUT_OF_VIEW)
    for target in (moved(camera, (10, 5, 90), (0.1, 0, -1)), Camera(1, 1, 3, 3, 0.5, 0.5), Camera(1, 9, 3, 3, 0.5, 4)):
        seen = render(frame, target, mode)
        np.testing.assert_array_equal(seen.hole, seen.depth == 0)


@modes
def test_result_does_not_depend_on_the_number_of_threads(mode: Mode, monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: one thread and two give the same bits in every field."""
    source = Camera.from_fov(160, 120, 70)
    frame = World((Sphere((0.3, 0, 3), 0.8), Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 8), (0.3, 0, -1)))).rgbd(source)
    target = moved(source, (4, 12, -3), (-0.6, 0.1, 0.5))
    views = []
    for count in (1, 2):
        monkeypatch.setattr(jit, "_most_threads", [count])
        views.append(render(frame, target, mode))
    for field in dataclasses.fields(View)[1:]:
        np.testing.assert_array_equal(getattr(views[0], field.name), getattr(views[1], field.name))
