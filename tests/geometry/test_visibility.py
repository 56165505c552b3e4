"""The visibility law: its checker and its projection against a march along the ray."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry import visibility
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.kernels import visibility as kernels
from dlama.geometry.projection import px_from_px
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law, violations
from dlama.inpainters import find_filler
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import inpaint
from reference import law as twin
from worlds import moved, points_of, random_camera

SEEDS = range(10)
FINE = twin.STEP + 1e-6
"""The march stops up to one step, and float32 rounding, after the first lawful depth."""


def random_frame(rng: np.random.Generator, height: int = 9, width: int = 12) -> RGBD:
    """Blocks of surfaces from 1 m to 10 m, some sky, some sensor holes."""
    camera = random_camera(rng, width, height)
    blocks = np.exp(rng.uniform(0, np.log(10), (height // 3 + 1, width // 3 + 1)))
    depth = np.kron(blocks, np.ones((3, 3)))[:height, :width] * rng.uniform(0.98, 1.02, (height, width))
    state = np.kron(rng.random(blocks.shape), np.ones((3, 3)))[:height, :width]
    depth[state < 0.15] = np.inf
    depth[rng.random(depth.shape) < 0.05] = 0
    return RGBD(rng.integers(0, 256, (height, width, 3), np.uint8), depth.astype(np.float32), camera)


def next_to(rng: np.random.Generator, source: Camera, height: int = 10, width: int = 11) -> Camera:
    """Another lens some steps aside, turned so that much of the same is in view."""
    lens = random_camera(rng, width, height).at(source.world_from_cam)
    return moved(lens, tuple(rng.uniform(-15, 15, 3)), tuple(rng.uniform(-1, 1, 3)))


def proposal(rng: np.random.Generator, target: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Random depth for every pixel, some of it far, and which pixels are meant (three in four)."""
    depth = np.exp(rng.uniform(-0.5, 2.5, target.hw)).astype(np.float32)
    depth[rng.random(target.hw) < 0.05] = np.inf
    return depth, rng.random(target.hw) < 0.75


def setup(seed: int) -> tuple[RGBD, Law, Camera, np.ndarray, np.ndarray]:
    """A source frame and its law, a camera elsewhere, and random depth there."""
    rng = np.random.default_rng(seed)
    frame = random_frame(rng)
    target = next_to(rng, frame.camera)
    return frame, Law.of(Scene((View.from_rgbd(frame),))), target, *proposal(rng, target)


@pytest.mark.parametrize("seed", SEEDS)
def test_checker_agrees_with_its_twin(seed: int) -> None:
    """Twin: points one by one through the world; pixels within rounding of a border are left out."""
    frame, law, target, depth, where = setup(seed)
    expected, unsure = twin.broken(target, depth, where, frame.camera, frame.depth)
    found = law.violations(target, depth, where)
    assert expected.sum() > 2 and (where & ~expected).sum() > 5 and unsure.mean() < 0.02
    np.testing.assert_array_equal(found[~unsure], expected[~unsure])


@pytest.mark.parametrize("seed", SEEDS)
def test_push_back_finds_the_first_lawful_depth(seed: int) -> None:
    """Twin: a march in steps of 1e-4. The answer keeps the law, and nothing before it does, but for the tolerance."""
    frame, law, target, depth, where = setup(seed)
    out, pixels = depth.copy(), kernels.Pixels(np.flatnonzero(where).astype(np.int32), depth[where], target.width)
    kernels.push_back(0, len(pixels.places), pixels, px_from_px(frame.camera, target), frame.depth)
    out[where] = pixels.depth
    np.testing.assert_array_equal(out[~where], depth[~where])
    still, unsure = twin.broken(target, out, where, frame.camera, frame.depth)
    assert not (still & ~unsure).any()
    finite = 0
    for row, column in zip(*np.nonzero(law.violations(target, depth, where))):
        within, strictly = twin.march(target, row, column, float(depth[row, column]), frame.camera, frame.depth)
        got = float(out[row, column])
        assert within == np.inf or got <= strictly * (1 + FINE)
        assert got > twin.FARTHEST or got >= within * (1 - FINE) or lawful_there(target, row, column, got, frame)
        finite += got < np.inf
    assert finite > 3


def lawful_there(target: Camera, row: int, column: int, depth: float, frame: RGBD) -> bool:
    """True where a lawful stretch too short for the march's steps begins at `depth`."""
    point = points_of(target, np.full(target.hw, depth * (1 + 1e-6)))[row, column]
    return not twin.in_front(frame.camera, frame.depth, point[None])[0][0]


@pytest.mark.parametrize("seed", SEEDS)
def test_projection_moves_outwards_and_only_what_is_unlawful(seed: int) -> None:
    """Law: lawful pixels stay bit for bit, the others only move away from the camera, then all keep the law; again: no-op."""
    _, law, target, depth, where = setup(seed)
    before = law.violations(target, depth, where)
    out, moved_pixels = law.project(target, depth, where)
    assert out.dtype == np.float32
    np.testing.assert_array_equal(moved_pixels, before)
    np.testing.assert_array_equal(out[~before], depth[~before])
    assert (out[before] > depth[before]).all()
    assert not law.violations(target, out, where).any()
    again, moved_again = law.project(target, out, where)
    np.testing.assert_array_equal(again, out)
    assert not moved_again.any()


def two_frames(seed: int) -> tuple[tuple[RGBD, RGBD], Camera, np.ndarray, np.ndarray]:
    """Two source frames whose cameras stand aside, a third camera, and random depth there."""
    rng = np.random.default_rng(seed)
    one, two = random_frame(rng), random_frame(rng)
    two = RGBD(two.color, two.depth, next_to(rng, one.camera, *two.camera.hw))
    target = next_to(rng, one.camera)
    return (one, two), target, *proposal(rng, target)


def test_projection_onto_two_laws_keeps_both_and_gives_nothing_up() -> None:
    """Twin: two source cameras, whose laws push pixels to and fro. Each is kept; what marches under one and the other
    in turn find at a finite depth is never given up as sky."""
    turns, compared = 0, 0
    for seed in range(3):
        frames, target, depth, where = two_frames(seed)
        law = Law.of(Scene(tuple(map(View.from_rgbd, frames))))
        assert len(law.measured) == 2
        out, moved_pixels = law.project(target, depth, where)
        for frame in frames:
            still, unsure = twin.broken(target, out, where, frame.camera, frame.depth)
            assert not (still & ~unsure).any()
        for row, column in zip(*np.nonzero(moved_pixels)):
            at, before, rounds = float(depth[row, column]), 0.0, 0
            while before != at < np.inf:
                before, rounds = at, rounds + 1
                for frame in frames:
                    at = twin.march(target, row, column, at, frame.camera, frame.depth)[1] if at < np.inf else at
            if at < np.inf:
                assert depth[row, column] <= out[row, column] <= at * 1.01
                turns, compared = max(turns, rounds), compared + 1
    assert compared > 50 and turns > 2


def test_in_the_source_camera_the_law_is_the_measured_depth() -> None:
    """Closed form: 2 m measured, tolerance 2 mm (0.1 %); 0.5 m: 1 mm. Sky admits nothing finite, a sensor hole anything."""
    measured = np.array([[2, 2, 2, 0.5, 0.5, np.inf, np.inf, 0]], np.float32)
    proposed = np.array([[1.997, 1.999, 3, 0.4985, 0.4995, 400, np.inf, 0.1]], np.float32)
    camera = Camera.from_fov(8, 1, 60)
    law = Law(((camera, measured),))
    where = np.ones((1, 8), bool)
    np.testing.assert_array_equal(law.violations(camera, proposed, where)[0], [1, 0, 0, 1, 0, 1, 0, 0])
    np.testing.assert_array_equal(law.violations(camera, proposed, ~where), False)
    out, moved_pixels = law.project(camera, proposed, where)
    np.testing.assert_allclose(out[0], [2, 1.999, 3, 0.5, 0.4995, np.inf, np.inf, 0.1], rtol=1e-6)
    np.testing.assert_array_equal(moved_pixels[0], [1, 0, 0, 1, 0, 1, 0, 0])


def test_what_still_breaks_the_law_after_the_last_round_is_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: with no round at all every pixel that breaks the law ends in the far layer, and no other one moves."""
    monkeypatch.setattr(visibility, "MAX_ROUNDS", 0)
    _, law, target, depth, where = setup(3)
    broken = law.violations(target, depth, where)
    out, _ = law.project(target, depth, where)
    assert broken.sum() > 3 and np.isposinf(out[broken]).all()
    np.testing.assert_array_equal(out[~broken], depth[~broken])


def test_the_checker_sees_a_planted_violation() -> None:
    """Guard: a lawful filled view has none; one pixel put before what was measured, one before the sky, are found; both
    are filled pixels, and the same depth in measured pixels is no violation of what was *filled*."""
    rng = np.random.default_rng(0)
    depth = np.full((6, 8), 3, np.float32)
    depth[:2] = np.inf
    frame = RGBD(rng.integers(0, 256, (6, 8, 3), np.uint8), depth, Camera.from_fov(8, 6, 60))
    source = View.from_rgbd(frame)
    law = Law.of(Scene((source,)))
    origin = source.origin.copy()
    origin[::2] = Origin.FILLED
    planted = source.depth.copy()
    planted[0, 3] = planted[4, 5] = planted[5, 1] = 1.5

    def with_depth(depth: np.ndarray) -> View:
        return View(frame.camera, source.color, depth, source.hole, source.hole_type, origin, source.confidence)

    assert not violations(with_depth(source.depth), law).any()
    assert sorted(zip(*np.nonzero(violations(with_depth(planted), law)))) == [(0, 3), (4, 5)]


def test_a_scene_lays_down_what_was_measured_and_what_was_removed() -> None:
    """Closed form: the object's own depth counts where the background layer is empty; filled layers count for nothing."""
    camera = Camera.from_fov(4, 1, 60)
    frame = RGBD(np.zeros((1, 4, 3), np.uint8), np.array([[1, 2, 0, np.inf]], np.float32), camera)
    source = View.from_rgbd(frame)
    taken = np.array([[True, False, False, False]])
    background, item = source.without(taken, HoleType.OBJECT), source.without(~taken, HoleType.NONE)
    filled, _ = inpaint(background, find_filler("telea"), FillContext(Law(())))
    law = Law.of(Scene((background,), (item,), (filled.without(~filled.filled, HoleType.NONE),)))
    assert len(law.measured) == 1
    np.testing.assert_array_equal(law.measured[0][1], frame.depth)
