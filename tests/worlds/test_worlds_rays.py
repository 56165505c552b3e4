"""The ray caster of the worlds against closed forms and its literal twin."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import worlds as oracle
from dlama.geometry.camera import Camera
from dlama.worlds.raycast import shape_rows as k
from dlama.worlds.raycast.shape_rows import OBJECT_GROUP
from dlama.worlds.scene_builder import Material, SceneBuilder
from dlama.worlds.world import Light, Sky, World
from reference import ray_caster as twin

CLEAR = Sky(haze=0.0)
SUN = np.array((0.4, -0.8, -0.45)) / np.linalg.norm((0.4, -0.8, -0.45))


def plain(builder: SceneBuilder, *color: int) -> Material:
    """A material of one colour."""
    picture = np.full((k.SIDE, k.SIDE, 4), 255, np.uint8)
    picture[..., :3] = color
    return Material(builder.layer(picture))


def new_builder() -> SceneBuilder:
    """A builder whose first two layers (stains, clouds) are grey."""
    builder = SceneBuilder()
    plain(builder, 128, 128, 128)
    plain(builder, 128, 128, 128)
    return builder


def set_world(builder: SceneBuilder, light: Light | None = None, **changes: object) -> World:
    """The world of a builder, without haze and without smoothed edges."""
    light = light or Light(tuple(SUN))  # type: ignore[arg-type]
    return dataclasses.replace(
        World(builder.shapes(), builder.texels(), light, CLEAR, 1.4, antialias=False),
        **changes,  # type: ignore[arg-type]
    )


def jumble(seed: int) -> World:
    """Every kind of shape in every position, materials with holes among them, before a ground."""
    rng = np.random.default_rng(seed)
    builder = new_builder()
    paints = [plain(builder, *rng.integers(40, 250, 3)) for _ in range(4)]
    holed = np.full((k.SIDE, k.SIDE, 4), 200, np.uint8)
    holed[..., 3] = np.where(rng.random((8, 8)) < 0.5, 255, 0).repeat(32, 0).repeat(32, 1)
    holes = Material(builder.layer(holed), (0.7, 0.9), cut=True)
    builder.panel((0, 0, 0), (60, 60), paints[0])
    for n in range(24):
        size = rng.uniform(0.2, 0.9, 3)
        at, turn = tuple(rng.uniform((-4, 0.2, 2), (4, 3, 9))), tuple(rng.uniform(-180, 180, 3))
        paint = paints[n % 4]
        with builder.group(OBJECT_GROUP if n % 6 == 0 else None, casts=n % 5 != 4):
            if n % 4 == 0:
                builder.box(at, tuple(size), paint, turn)
            elif n % 4 == 1:
                builder.ball(at, tuple(size), holes if n % 8 == 1 else paint, turn)
            elif n % 4 == 2:
                builder.tube(at, 2 * size[0], size[1], paint, top=size[2] if n % 8 == 2 else 0.0, turn=turn)
            else:
                builder.panel(at, (2 * size[0], 2 * size[1]), holes if n % 8 == 3 else paint, turn)
    return set_world(builder)


def test_depth_of_planes_balls_and_boxes_is_the_closed_form() -> None:
    """Oracle: the analytic caster of the tests (tests/worlds.py), to float32."""
    builder = new_builder()
    paint = plain(builder, 200, 100, 50)
    builder.panel((0, 0, 0), (4000, 4000), paint)
    builder.ball((0.4, 1.0, 4.0), (0.8, 0.8, 0.8), paint)
    builder.box((-1.5, 0.5, 3.0), (1.0, 1.2, 0.8), paint)
    camera = oracle.moved(Camera.from_fov(97, 75, 80, set_world(builder).camera().world_from_cam), turn=(4, -9, 3))
    shapes = (
        oracle.Plane((0, 0, 0), (0, -1, 0)),
        oracle.Sphere((0.4, -1.0, 4.0), 0.8),
        oracle.Box((-2.0, -1.7, 2.6), (-1.0, -0.5, 3.4)),
    )
    depth, number = oracle.World(shapes).trace(camera)
    near = depth < 1000  # the panel ends, the plane does not
    found = set_world(builder).raycast(camera)
    np.testing.assert_allclose(found.depth[near], depth[near], rtol=2e-7)
    assert np.isposinf(found.depth[~near & (number < 0)]).all()
    assert {0, 1, 2} <= set(number[near])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_all_kinds_of_shapes_match_the_twin(seed: int) -> None:
    """Depth, what is seen and what is lit: the literal twin, at every pixel."""
    world = jumble(seed)
    camera = oracle.moved(Camera.from_fov(120, 90, 85, world.camera().world_from_cam), turn=(3, 5, -4))
    found, expected = world.raycast(camera), twin.trace(world, camera)
    same = found.group == expected.group
    assert same.mean() > 0.9995  # a ray along an edge may fall either way
    np.testing.assert_allclose(found.depth[same], expected.depth[same], rtol=1e-5)
    assert (found.light == expected.light)[same].mean() > 0.999
    assert len(np.unique(expected.group)) > 12 and (expected.light == 2).mean() > 0.02


def test_without_the_object_and_behind_objects_match_the_twin() -> None:
    """The twin, reported which group is not there: the whole object, or each pixel's own first group."""
    world = jumble(4)
    camera = world.camera(size=90)
    gone = twin.trace(world, camera, without=OBJECT_GROUP)
    np.testing.assert_allclose(world.frame(camera, object=False).depth, gone.depth.astype(np.float32), rtol=1e-5)
    first = world.raycast(camera).group
    second = twin.trace(world, camera, through=first)
    behind = world.raycast(camera, through=world.raycast(camera).group).depth
    agree = np.isclose(behind, second.depth, rtol=1e-5)
    assert agree.mean() > 0.9995
    assert (behind >= world.frame(camera).depth).all()


def test_colours_match_the_twin() -> None:
    """Sun, sky light, ground light and the darker foot of objects; textures of one colour; to one level."""
    world = jumble(5)
    camera = world.camera(size=90)
    traced = twin.trace(world, camera)
    rays = oracle.rays_of(camera)
    height = camera.world_from_cam[1, 3] + np.where(np.isfinite(traced.depth), traced.depth, 0) * rays[..., 1]
    expected = twin.shade(world, traced, height)
    found = world.raycast(camera)
    same = (found.group == traced.group) & (found.light == traced.light) & (found.group >= 0)
    assert same.mean() > 0.5
    assert np.abs(found.color[same] - expected[same]).max() <= 1


def test_a_texture_lies_on_a_wall_as_it_was_drawn() -> None:
    """A picture on a box's front, seen straight on at one texel a pixel, comes out unmirrored (oracle: the picture)."""
    builder = new_builder()
    rng = np.random.default_rng(0)
    picture = np.full((k.SIDE, k.SIDE, 4), 255, np.uint8)
    picture[..., :3] = rng.integers(0, 256, (32, 32, 3)).repeat(8, 0).repeat(8, 1)
    material = Material(builder.layer(picture), mode=k.FIT)
    for z, x in ((2.0, 0.0), (-2.0, 0.0), (0.0, 2.0), (0.0, -2.0)):
        builder.box((x, -1, z), (2.0, 2.0, 2.0), material)
    light = Light((0.0, -1.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
    world = dataclasses.replace(set_world(builder, light), eye_m=0.0)
    world = dataclasses.replace(world, shapes=np.where(np.arange(k.COLUMNS) == k.CONTACT, 0, world.shapes))
    for turn in (0, 90, 180, 270):
        camera = oracle.moved(Camera.from_fov(256, 256, 90), turn=(0, turn, 0))
        np.testing.assert_allclose(world.frame(camera).color.astype(int), picture[..., :3], atol=1)


def test_smoothed_edges_are_the_mean_over_the_pixel_and_depth_is_not_smoothed() -> None:
    """Oracle: 64 rays a pixel, from a camera of eight times the size; depth, group and light stay those of the centre."""
    world = jumble(6)
    camera = world.camera(size=80)
    hard, soft = world.raycast(camera), dataclasses.replace(world, antialias=True).raycast(camera)
    for name in ("depth", "group", "light"):
        np.testing.assert_array_equal(getattr(hard, name), getattr(soft, name))
    many = world.frame(world.camera(size=640)).color.reshape(80, 8, 80, 8, 3)
    expected = 255 * np.sqrt((many / 255.0) ** 2).mean((1, 3))
    changed = (hard.color != soft.color).any(-1)
    assert 0.02 < changed.mean() < 0.5
    off_hard, off_soft = (np.abs(each.color - expected)[changed].mean() for each in (hard, soft))
    assert off_soft < 0.5 * off_hard


def test_a_picture_is_the_sum_of_its_parts() -> None:
    """A camera that sees only a corner of another one's picture sees the same there: lists of tiles leave nothing out."""
    world = jumble(7)
    whole = world.camera(size=96)
    part = Camera(40, 30, whole.fx, whole.fy, whole.cx - 37, whole.cy - 29, whole.world_from_cam)
    np.testing.assert_allclose(world.frame(part).depth, world.frame(whole).depth[29:59, 37:77], rtol=1e-6)


def test_a_texture_far_finer_than_pixels_is_its_mean() -> None:
    """A wall of noise, hundreds of texels a pixel: no pixel is far from the picture's mean (no aliasing)."""
    builder = new_builder()
    picture = np.full((k.SIDE, k.SIDE, 4), 255, np.uint8)
    picture[..., :3] = np.random.default_rng(0).integers(0, 2, (k.SIDE, k.SIDE, 1)) * 255
    builder.panel((0, 0, 6), (60, 60), Material(builder.layer(picture), (0.05, 0.05)), (0, -90, 0))
    light = Light((0.0, -1.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
    world = set_world(builder, light)
    color = world.frame(world.camera(size=64, fov=60)).color.astype(float)
    assert abs(color.mean() - picture[..., :3].mean()) < 1.5 and color.std() < 4
    slanted = world.frame(oracle.moved(world.camera(size=64, fov=60), turn=(0, 50, 0)))
    assert slanted.valid.mean() > 0.5 and slanted.color[slanted.valid].astype(float).std() < 4


def test_a_clear_sky_is_a_gradient() -> None:
    """Closed form: 1 - (1 - up)^3 of the way from the horizon's to the zenith's colour; black below is not sky."""
    builder = new_builder()
    builder.panel((0, 0, 0), (1, 1), plain(builder, 0, 0, 0))
    world = set_world(builder, sky=dataclasses.replace(CLEAR, cover=2.0))
    camera = oracle.moved(world.camera(size=64), turn=(50, 0, 0))
    rays = oracle.rays_of(camera)
    up = np.maximum(-rays[..., 1] / np.linalg.norm(rays, axis=-1), 0)[..., None]
    low, high = np.array(CLEAR.horizon), np.array(CLEAR.zenith)
    expected = 255 * np.sqrt(low + (1 - (1 - up) ** 3) * (high - low))
    found = world.frame(camera)
    assert found.far.all() and up.min() > 0
    assert np.abs(found.color - expected).max() <= 1
