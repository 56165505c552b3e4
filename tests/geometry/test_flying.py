"""Flying pixels: found where a mixture of two depths lies, nowhere else; kept in place, rejected when the camera moves."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.drawing.grid_mesh import find_joints
from dlama.geometry.holes import dilate_square
from dlama.geometry.rendering import MODES, Mode, render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from worlds import Box, Plane, World, moved, pixels_of, points_of

SOURCE = Camera.from_fov(80, 60, 60)
BOX = Box((-0.5, -0.6, 3), (0.5, 0.6, 4))
WALL = Plane((0, 0, 6), (0, 0, -1))
modes = pytest.mark.parametrize("mode", MODES)


def steep(angle_deg: float) -> Plane:
    """A plane 4 m ahead, turned from the view's axis by an angle."""
    angle = np.radians(angle_deg)
    return Plane((0, 0, 4), (np.sin(angle), 0, -np.cos(angle)))


def with_mixed_rim(share: float) -> tuple[RGBD, np.ndarray]:
    """Box before wall; the wall's pixels next to the box (by row or column, not at corners) mix both inverse depths."""
    frame = World((BOX, WALL)).rgbd(SOURCE)
    box = frame.depth < 5
    mixed = np.zeros_like(box)
    mixed[:, 1:] |= box[:, :-1]
    mixed[:, :-1] |= box[:, 1:]
    mixed[1:] |= box[:-1]
    mixed[:-1] |= box[1:]
    mixed &= ~box
    depth = np.where(mixed, 1 / (share / 3 + (1 - share) / 6), frame.depth).astype(np.float32)
    return RGBD(frame.color, depth, SOURCE), mixed


@settings(max_examples=25, deadline=None)
@given(st.floats(0.15, 0.85))
def test_mixed_pixels_are_found_and_nothing_else(share: float) -> None:
    """Closed form: of all pixels exactly those that mix the box's and the wall's depth, at any proportion, on all sides."""
    frame, mixed = with_mixed_rim(share)
    assert mixed.sum() > 80
    np.testing.assert_array_equal(find_joints(View.from_rgbd(frame)).flying, mixed)


@pytest.mark.parametrize("share", [0.3, 0.5])
@modes
def test_mixed_pixels_stay_at_home_and_vanish_when_the_camera_moves(share: float, mode: Mode) -> None:
    """Law: at home bit-exact; elsewhere no depth but the box's and the wall's is drawn, and the mixture's place is open."""
    frame, mixed = with_mixed_rim(share)
    np.testing.assert_array_equal(render(frame, SOURCE, mode).depth, frame.depth)
    target = moved(SOURCE, shift=(0.4, 0.1, 0))  # no turn: depth stays 3 and 6 where the source sees
    view = render(frame, target, mode)
    known = view.depth[~view.hole]
    assert np.minimum(abs(known - 3), abs(known - 6)).max() < 1e-4
    x, y, _ = pixels_of(target, points_of(SOURCE, frame.depth.astype(np.float64))[mixed])
    inside = (x >= 0) & (y >= 0) & (x < 80) & (y < 60)
    lands = np.zeros(view.hole.shape, np.bool_)
    lands[y[inside].astype(int), x[inside].astype(int)] = True
    assert (lands & view.hole).sum() > 20
    np.testing.assert_array_equal(view.hole_type == HoleType.FLYING, lands & view.hole)


@pytest.mark.parametrize("wall", [WALL, None], ids=["wall", "sky"])
def test_a_fill_beside_an_occluder_is_kept_at_home_and_not_shown_elsewhere(wall: Plane | None) -> None:
    """Law: what was filled next to a measured box is pink; at home it comes back bit for bit, elsewhere no pixel is pink, whether
    wall or sky was filled. What was filled next to a filled box stays."""
    frame, mixed = with_mixed_rim(0.0)
    depth = frame.depth if wall else np.where(frame.depth < 5, frame.depth, np.float32(np.inf))
    color = np.where(mixed[..., None], (255, 0, 255), (0, 200, 0)).astype(np.uint8)
    measured = View.from_rgbd(RGBD(color, depth, SOURCE))
    hole_type = np.where(frame.depth < 5, HoleType.NONE, HoleType.DISOCCLUDED).astype(np.uint8)
    origin = np.where(hole_type, Origin.FILLED, measured.origin).astype(np.uint8)
    target, pink = moved(SOURCE, shift=(0.4, 0.1, 0)), (255, 0, 255)

    def shown(view: View, camera: Camera) -> np.ndarray:
        return (render(view, camera, close=False).color == pink).all(-1)

    filled = dataclasses.replace(measured, hole_type=hole_type, origin=origin)
    np.testing.assert_array_equal(render(filled, SOURCE).color, color)
    np.testing.assert_array_equal(render(filled, SOURCE).depth, depth)
    assert not shown(filled, target).any() and shown(measured, target).sum() > 20
    whole = dataclasses.replace(filled, origin=np.full_like(origin, Origin.FILLED))
    np.testing.assert_array_equal(shown(whole, target), shown(measured, target))


@pytest.mark.parametrize("angle_deg", [0, 30, 60, 75, 80, 85])
def test_planes_do_not_fly(angle_deg: float) -> None:
    """Law: no pixel of a plane hangs between two surfaces, however steep, with 0.1 % of noise, in front of a wall or not."""
    rng = np.random.default_rng(3)
    for world in (World((steep(angle_deg),)), World((steep(angle_deg), Plane((0, 0, 40), (0, 0, -1))))):
        frame = world.rgbd(SOURCE)
        assert not find_joints(View.from_rgbd(frame)).flying.any()
        noisy = frame.depth * (1 + 0.001 * rng.standard_normal(frame.depth.shape).astype(np.float32))
        assert find_joints(View.from_rgbd(RGBD(frame.color, noisy, SOURCE))).flying.mean() < 0.002


def test_edges_poles_and_stairs_do_not_fly() -> None:
    """Law: a sharp edge, a pole nearer than all, a gap farther than all, stairs with treads of two pixels, sky, missing."""
    pole = Box((-0.4, -10, 2), (-0.39, 10, 2.01))
    for shapes in ((BOX, WALL), (pole, WALL), (pole, BOX, WALL), (BOX, Plane((0, 1.2, 0), (0, -1, 0)))):
        assert not find_joints(View.from_rgbd(World(shapes).rgbd(SOURCE))).flying.any()
    flat = np.full((12, 12), 3, np.float32)
    gap, stairs, sky = flat.copy(), flat.copy(), flat.copy()
    gap[:, 5] = 6
    for step in range(6):
        stairs[:, 2 * step : 2 * step + 2] = 2 + step
    sky[:, :5], sky[:, 7:] = np.inf, 0  # 3 m next to sky, then to missing: there are no two surfaces to mix
    camera = Camera.from_fov(12, 12, 60)
    for depth in (gap, stairs, sky):
        assert not find_joints(View.from_rgbd(RGBD(np.zeros((12, 12, 3), np.uint8), depth, camera))).flying.any()


def matched(world: World, px: float) -> RGBD:
    """A frame whose depth was matched: off by `px` of disparity (standard deviation), f b = 100 px m."""
    camera = Camera.from_fov(160, 120, 60)
    frame = world.rgbd(camera)
    disparity = 100 / frame.depth + px * np.random.default_rng(5).standard_normal(camera.hw)
    return RGBD(frame.color, (100 / disparity).astype(np.float32), camera)


def test_noise_of_matching_tears_no_far_wall() -> None:
    """Law: a wall at 10 m, seen from aside, has no more holes than steps of noise are larger than 4 standard deviations (0.5 %),
    though its disparity of 10 px is off by 0.15 px, 1.5 %; a box of 20 px of disparity before it is cut out still."""
    wall = Plane((0, 0, 10), (0, 0, -1))
    frame = matched(World((wall,)), 0.15)
    target = moved(frame.camera, shift=(1, 0, 0))
    inside = np.s_[2:-2, 2:-24]
    assert render(frame, target, "surface").hole[inside].mean() < 0.005
    assert not find_joints(View.from_rgbd(frame)).flying.any()
    next_to = render(matched(World((Box((-0.5, -0.6, 5), (0.5, 0.6, 5.5)), wall)), 0.15), target, "surface")
    assert (next_to.hole_type[inside] == HoleType.DISOCCLUDED).sum() > 200


@pytest.mark.parametrize("share", [0.005, 0.015])
def test_noise_of_a_time_of_flight_camera_tears_no_surface(share: float) -> None:
    """Law: ground and a box near and far, off by that share of the distance, seen from aside have no more holes in them than
    steps of noise are larger than 4 standard deviations (0.5 %); the box is cut out of the ground still."""
    camera = Camera.from_fov(160, 120, 60)
    frame = World(
        (Plane((0, 1, 0), (0, -1, 0)), Box((-0.6, -0.3, 1.2), (0.2, 1, 1.6)), Plane((0, 0, 4), (0, 0, -1)))
    ).rgbd(camera)
    noise = share * np.random.default_rng(6).standard_normal(camera.hw)
    target = moved(camera, shift=(0.15, 0, 0))
    exact, seen = (
        render(dataclasses.replace(frame, depth=depth.astype(np.float32)), target, "surface")
        for depth in (frame.depth, frame.depth * (1 + noise))
    )
    whole = ~dilate_square(exact.hole, 5)
    assert seen.hole[whole].mean() < 0.005
    assert (seen.hole & exact.hole).sum() > 0.8 * exact.hole.sum()
