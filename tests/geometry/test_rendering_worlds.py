"""Rendering against closed-form worlds: true depth, no cracks, nothing shines through, nothing between two surfaces."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.rendering import render
from worlds import Box, Plane, Sphere, World, moved, pixels_of, points_of, shape_shown

SOURCE = Camera.from_fov(160, 120, 60, [[0, 0, 1, 3], [1, 0, 0, -2], [0, 1, 0, 5], [0, 0, 0, 1]])
HOME = SOURCE.at(np.eye(4))
WALL = Plane((0, 0, 6), (0, 0, -1))
FLOOR = Plane((0, 1.2, 0), (0, -1, 0))
BOX = Box((-0.5, -0.6, 3), (0.5, 0.6, 4))
SPHERE = Sphere((0, 0, 3.5), 0.8)
POLE = Box((-0.4, -10, 2), (-0.39, 10, 2.01))  # at 2 m a pixel is 14.4 mm wide: one column of the source sees it

PLANES = {
    "wall": World((WALL,)),
    "slanted": World((Plane((0, 0, 5), (0.6, 0.3, -1)),)),
    "floor": World((FLOOR,)),
    "at 80 degrees": World((Plane((0, 0, 4), (np.sin(np.radians(80)), 0, -np.cos(np.radians(80)))),)),
}
EDGES = {
    "box": World((BOX, WALL)),
    "sphere": World((SPHERE, WALL)),
    "sphere on a floor under the sky": World((SPHERE, FLOOR)),
    "pole": World((POLE, WALL)),
}
TARGETS = {
    "yaw 15": orbit(HOME, 15),
    "yaw -35 pitch 10": orbit(HOME, -35, 10),
    "from above": orbit(HOME, 0, 30, 4),
    "nearer, rolled": moved(HOME, (0, 0, 25), (0.2, 0.1, 1.2)),
    "back": moved(HOME, (1, 2, 0), (0.3, 0, -2)),
}
targets = pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS.keys())


def within_mesh(world: World, source: Camera, target: Camera, margin: int = 1) -> np.ndarray:
    """H x W of the target, True where it sees what the source sees, `margin` source pixels round it on the same shape.

    At 0 the four source pixels round it are the mesh's last; further in, no footprint of the mesh's rim reaches.
    """
    depth, number = world.trace(target)
    x, y, _ = pixels_of(source, points_of(target, np.where(np.isfinite(depth), depth, 1.0)))
    seen = world.seen_by(source, target)
    left, upper = (np.floor(np.where(seen, value, -9) - 0.5).astype(int) + 9 for value in (x, y))
    of_source = np.pad(world.trace(source)[1], 9, constant_values=-9)
    inside = seen
    for row in range(-margin, 2 + margin):
        for column in range(-margin, 2 + margin):
            inside = inside & (of_source[upper + row, left + column] == number)
    return inside


@targets
@pytest.mark.parametrize("name", PLANES)
def test_planes_are_exact(name: str, target: Camera) -> None:
    """Closed form: inverse depth is affine on a plane, so what is left of interpolation is float32 rounding (1e-4)."""
    world = PLANES[name]
    inside = within_mesh(world, HOME, target, margin=2)
    if name == "at 80 degrees" and target is TARGETS["yaw -35 pitch 10"]:
        assert not inside.any()  # from there the plane shows its back, of which the source knows nothing
    else:
        assert inside.mean() > 0.02
    view = render(world.rgbd(HOME), target)
    true, _ = world.trace(target)
    assert not view.hole[inside].any()
    np.testing.assert_allclose(view.depth[inside], true[inside], rtol=1e-4)


DISTANCES = [(HOME, moved(HOME, (3, -4, 10), (0.01, 0.01, 6 - far))) for far in (0.02, 0.1, 0.5, 1, 3, 5.9, 12, 60)]
ANGLES = [
    tuple(orbit(HOME, angle, pivot=6) for angle in angles)
    for angles in itertools.product((0, 40, 70, 80), (-80, -60, 30, 75, 80))
]


@pytest.mark.parametrize(("source", "target"), [*DISTANCES, *ANGLES])
def test_no_crack_at_any_distance_and_angle(source: Camera, target: Camera) -> None:
    """Law: a wall is closed and true, from 0.3 % of the distance it was taken from up to ten times as far; taken at up to 80
    degrees from its normal, and seen at up to 80."""
    world = PLANES["wall"]
    view = render(world.rgbd(source), target)
    inside = within_mesh(world, source, target)
    assert inside.sum() > 50
    assert not view.hole[inside].any()
    np.testing.assert_allclose(view.depth[inside], world.trace(target)[0][inside], rtol=1e-3)


@pytest.mark.parametrize("name", ["box", "sphere"])
@pytest.mark.parametrize("forward", [0.8, 1.6, 2.4])
def test_nothing_shines_through_a_magnified_foreground(name: str, forward: float) -> None:
    """Law: up to five times nearer, each pixel within the foreground shows the foreground, in its colours."""
    world = EDGES[name]
    target = moved(HOME, (2, -3, 0), (0.1, 0.05, forward))
    view = render(world.rgbd(HOME), target)
    _, number = world.trace(target)
    inside = within_mesh(world, HOME, target) & (number == 0)  # margin: the outermost ring is taken for flying
    assert inside.mean() > 0.05
    assert not view.hole[inside].any()
    np.testing.assert_array_equal(shape_shown(view.color)[inside], 0)


@targets
@pytest.mark.parametrize("name", EDGES)
def test_nothing_is_drawn_between_two_surfaces(name: str, target: Camera) -> None:
    """Law: every drawn point lies on a true surface.

    A footprint is drawn at its vertex's depth up to half a source pixel (and half a target pixel) next to it in x and y, so a
    point may be off by 0.71 pixels of each; the gaps between the surfaces are twenty times as wide.
    """
    world = EDGES[name]
    view = render(world.rgbd(HOME), target)
    points = points_of(target, np.where(view.valid, view.depth, 1).astype(np.float64))
    _, _, z_source = pixels_of(HOME, points)
    allowed = 0.75 * (z_source / HOME.fx + view.depth / target.fx)
    assert view.valid.mean() > 0.1
    off = world.distance(points)[view.valid] / allowed[view.valid]
    assert off.max() < 1


@targets
def test_every_pixel_of_a_pole_keeps_its_footprint(target: Camera) -> None:
    """Law: the target pixel into which a pole's pixel falls shows the pole; from a level camera it has no gap and is thin."""
    world = EDGES["pole"]
    frame = world.rgbd(HOME)
    on_pole = world.trace(HOME)[1] == 0
    assert (on_pole.sum(1) == 1).all()
    x, y, z = pixels_of(target, points_of(HOME, frame.depth.astype(np.float64))[on_pole])
    inside = (z > 0) & (x >= 0) & (y >= 0) & (x < target.width) & (y < target.height)
    rows, columns = y[inside].astype(int), x[inside].astype(int)
    view = render(frame, target)
    np.testing.assert_allclose(view.depth[rows, columns], z[inside], rtol=0.02)
    np.testing.assert_array_equal(shape_shown(view.color)[rows, columns], 0)
    shown = view.valid & (POLE.distance(points_of(target, view.depth.astype(np.float64))) < 0.05)
    if target in (TARGETS["yaw 15"], TARGETS["back"]):
        width = shown[rows.min() : rows.max() + 1].sum(1)
        assert len(width) > 50 and width.min() >= 1 and width.max() <= 2


def test_a_surface_seen_from_behind_leaves_no_outline() -> None:
    """Law: the source knows nothing of a wall's back, so from there nothing of it shows, the rim of its mesh included."""
    target = moved(HOME, (0, 180, 0), (0, 0, 12))
    assert render(PLANES["wall"].rgbd(HOME), target).hole.all()


def test_footprints_do_not_cover_their_own_surface() -> None:
    """Law: where the floor's mesh reaches, its depth is exact up to the border of the source picture."""
    world, target = PLANES["floor"], TARGETS["back"]
    inside = within_mesh(world, HOME, target, margin=0)
    view = render(world.rgbd(HOME), target)
    np.testing.assert_allclose(view.depth[inside], world.trace(target)[0][inside], rtol=1e-4)
