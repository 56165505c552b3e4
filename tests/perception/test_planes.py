"""Planes found and labelled: closed forms, and the kernels against their twins."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.projection import inverse_depth
from dlama.perception.kernels import planes as plane_kernels
from dlama.perception.planes import (
    MOST_PLANES,
    NEIGHBOURHOOD,
    NOISE_FACTOR,
    OUTLIER_FACTOR,
    SKY,
    SMOOTH,
    TOLERANCE,
    denoise,
    find_planes,
    fit_plane,
    label_known,
    noise_level,
    plane_values,
    tolerance,
)
from marks import first_quick
from reference import planes as twin
from worlds import Plane, World

SEEDS = first_quick(range(8), 4)
FLOOR, WALL = Plane((0, 1.2, 0), (0, 1, 0)), Plane((0, 0, 5), (0.3, 0, -1))


def closed_form(plane: Plane, camera: Camera) -> np.ndarray:
    """(a, b, c) of inverse depth over pixels for a camera at the origin: n . K^-1 (u, v, 1) / n . p."""
    normal = np.array(plane.normal)
    return np.linalg.inv(camera.K).T @ normal / (normal @ plane.point)


def floor_and_wall(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inverse depth (0 = sky), where there is a surface, and which of the two it is."""
    depth, number = World((FLOOR, WALL)).trace(camera)
    return inverse_depth(depth.astype(np.float32)), np.isfinite(depth), number


def check_floor_and_wall(
    planes: np.ndarray, label: np.ndarray, number: np.ndarray, camera: Camera, share: float, within: float
) -> None:
    """Of each surface's pixels more than a share have one label, whose plane is `within` 1/m of the true one there."""
    for index, plane in enumerate((FLOOR, WALL)):
        mine = label[number == index]
        k = np.bincount(mine[mine > 0]).argmax()
        assert (mine == k).mean() > share
        exact, got = (plane_values(p[None], camera.hw)[0] for p in (closed_form(plane, camera), planes[k - 1]))
        assert abs(exact - got)[number == index].max() < within


def samples(seed: int, count: int = 60) -> tuple[np.ndarray, ...]:
    """u, v, w of random samples on two planes, a third of them off both."""
    rng = np.random.default_rng(seed)
    u, v = rng.integers(0, 40, (2, count)) + 0.5
    w = np.where(rng.random(count) < 0.5, 0.2 + 0.002 * u + 0.001 * v, 0.6 - 0.003 * v)
    return u, v, np.where(rng.random(count) < 0.3, rng.uniform(0.1, 1, count), w), rng.random(count) < 0.8


@pytest.mark.parametrize("seed", SEEDS)
def test_best_plane_is_the_one_with_most_support(seed: int) -> None:
    """Twin: every hypothesis counted sample by sample; failed triples and lines have no support; the first wins a tie."""
    u, v, w, free = samples(seed)
    rng = np.random.default_rng(seed)
    triples = np.stack([rng.choice(len(u), 3, replace=False) for _ in range(40)])
    triples[rng.random(40) < 0.2, 2] = -1
    triples = np.concatenate([triples, triples])
    near = tolerance(w, 0.002 * (seed % 2))
    plane, support = plane_kernels.best_plane(u, v, w, free, triples, near)
    counts = []
    for three in triples:
        line = three[2] < 0 or abs(np.linalg.det(np.stack([u[three], v[three], np.ones(3)], 1))) <= 4
        counts.append((0, 0) if line else twin.support(twin.through(u, v, w, three), u, v, w, free, near))
    assert max(sure for sure, _ in counts) <= support <= max(most for _, most in counts)
    first = triples[[most for _, most in counts].index(support)]
    np.testing.assert_allclose(plane, twin.through(u, v, w, first), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_labels_equal_their_twin(seed: int) -> None:
    """Twin: pixel by pixel, plane by plane, over its neighbourhood; planes, sky, noise and pixels that are no surface mixed."""
    rng = np.random.default_rng(seed)
    planes = np.array([(0.002, 0.001, 0.2), (0, -0.003, 0.6), (0.0021, 0.001, 0.2)])
    which = np.kron(rng.integers(0, 3, (3, 4)), np.ones((6, 6), int))
    w = np.take_along_axis(plane_values(planes, which.shape), which[None], 0)[0]
    w = (w * rng.uniform(1 - 1.5 * TOLERANCE, 1 + 1.5 * TOLERANCE, w.shape)).astype(np.float32)
    surface = rng.random(w.shape) < 0.9
    far = ~surface & (rng.random(w.shape) < 0.5)
    got = label_known(w, surface, far, planes)
    expected = twin.labels(w, surface, planes, TOLERANCE, NEIGHBOURHOOD)
    np.testing.assert_array_equal(got, np.where(far, SKY, expected))
    assert {-1, 1, 2} <= set(np.unique(got).tolist())
    assert label_known(w, surface, far, planes[:0])[surface].max() == SMOOTH


def test_a_plane_that_cuts_through_leaves_no_stripe() -> None:
    """Closed form: on a wall, a second plane fits a line of pixels only; all of the wall stays the wall's, and vice versa."""
    planes = np.array([(0.0, 0.0, 0.3), (0.004, 0.0, 0.18)])  # they cross in column 30
    both = plane_values(planes, (40, 60))
    everywhere = np.ones((40, 60), bool)
    for order in (planes, planes[::-1]):
        for number, value in enumerate(plane_values(order, (40, 60))):
            np.testing.assert_array_equal(label_known(value, everywhere, ~everywhere, order), number + 1)
    assert (abs(both[0] - both[1]) < TOLERANCE * both[0]).any(), "else there is nothing to compete for"


def test_local_triples_are_free_near_and_repeatable() -> None:
    """Law: every triple names free samples within reach of its first; a lonely sample finds no partners; same seed, same."""
    u, v, _, free = samples(0, 400)
    u[0], v[0] = 1000.5, 1000.5
    free[0] = True
    triples = plane_kernels.local_triples(u, v, free, 8.0, 300, 7)
    np.testing.assert_array_equal(triples, plane_kernels.local_triples(u, v, free, 8.0, 300, 7))
    found = triples[triples[:, 2] >= 0]
    assert len(found) > 200 and free[found].all()
    assert (found[:, 1:] != found[:, :1]).all()
    for axis in (u, v):
        assert abs(axis[found] - axis[found[:, :1]]).max() <= 8
    assert (triples[triples[:, 0] == 0, 2] == -1).all()
    lonely = np.zeros_like(free)
    lonely[0] = True
    assert (plane_kernels.local_triples(u, v, lonely, 8.0, 3, 1) == (0, -1, -1)).all()


def test_floor_and_wall_are_found_as_what_they_are() -> None:
    """Closed form: inverse depth n . K^-1 (u, v, 1) / n . p, to 1e-4 of the largest value in the picture."""
    camera = Camera.from_fov(120, 90, 70)
    w, surface, number = floor_and_wall(camera)
    planes = find_planes(w, surface, seed=3)
    assert len(planes) == 2
    label = label_known(w, surface, ~surface, planes)  # at the crease a pixel may lie on both
    check_floor_and_wall(planes, label, number, camera, share=0.97, within=1e-4 * w.max())


def test_no_plane_where_there_is_none_and_never_too_many() -> None:
    """Law: noise over three decades has no plane (a band of 2.4 % holds 0.35 % of it); a staircase of 16 risers gives
    at most MOST_PLANES; under 50 pixels none is looked for."""
    rng = np.random.default_rng(0)
    noise = np.exp(rng.uniform(-7, 0, (60, 80))).astype(np.float32)
    everywhere = np.ones(noise.shape, bool)
    assert len(find_planes(noise, everywhere, 0)) == 0
    stairs = np.repeat(np.linspace(0.1, 1, 16, dtype=np.float32), 5)[None].repeat(60, 0)
    assert 10 <= len(find_planes(np.ascontiguousarray(stairs), everywhere, 0)) <= MOST_PLANES
    few = np.zeros(noise.shape, bool)
    few[0, :49] = True
    assert find_planes(noise, few, 0).shape == (0, 3)


def test_least_squares_weigh_by_relative_residual() -> None:
    """Closed form: of two values on one spot, the fit minimises relative error: w = sum(1/w) / sum(1/w^2)."""
    u, v = np.tile([0.5, 9.5, 0.5, 9.5], 2), np.tile([0.5, 0.5, 9.5, 9.5], 2)
    w = np.repeat([1.0, 2.0], 4)
    np.testing.assert_allclose(fit_plane(u, v, w, tolerance(w, 0)), (0, 0, 1.5 / 1.25), atol=1e-12)


@pytest.mark.parametrize("sigma", [0.002, 0.01])
def test_noise_is_the_deviation_that_was_put_in(sigma: float) -> None:
    """Closed form: none on floor, wall and sky as they are; on them with Gaussian noise its standard deviation, to 6 %
    though a thirtieth of the picture is blown into pieces."""
    camera = Camera.from_fov(320, 240, 70)
    w, surface, _ = floor_and_wall(camera)
    assert noise_level(w, surface) == 0
    rng = np.random.default_rng(0)
    noisy = (w + rng.normal(0, sigma, w.shape)).astype(np.float32)
    noisy[100:140, 100:160] = rng.uniform(0, 1, (40, 60))
    assert noise_level(noisy, surface) == pytest.approx(sigma, rel=0.06)
    assert noise_level(w, np.zeros_like(surface)) == 0
    faint = TOLERANCE / NOISE_FACTOR * float(np.median(w[surface])) / 2
    assert noise_level((w + rng.normal(0, faint, w.shape)).astype(np.float32), surface) == 0, "the tolerance covers it"


def test_planes_under_the_noise_of_a_matched_pair() -> None:
    """Closed form: a tenth of a pixel of noise at 3 to 20 px of disparity, the floor's and the wall's planes still found,
    to 1 % of the largest value, their pixels theirs; without being reported of the noise far fewer pixels lie on any."""
    camera = Camera.from_fov(320, 240, 70)
    w, surface, number = floor_and_wall(camera)
    sigma = 0.1 / 20 * float(w.max())
    noisy = (w + np.random.default_rng(1).normal(0, sigma, w.shape)).astype(np.float32)
    planes = find_planes(noisy, surface, 0, sigma)
    label = label_known(noisy, surface, ~surface, planes, sigma)
    check_floor_and_wall(planes, label, number, camera, share=0.9, within=0.01 * w.max())
    untold = label_known(noisy, surface, ~surface, find_planes(noisy, surface, 0))
    assert (untold[surface] > 0).mean() < 0.8 < (label[surface] > 0).mean() - 0.15


def test_a_small_outlying_patch_is_its_planes_and_a_large_one_is_not() -> None:
    """Closed form: pixels 1.5 times the tolerance of noise off a plane belong to it amid its pixels, not where they are the most;
    beyond OUTLIER_FACTOR times, or without noise, never."""
    plane, noise = np.array([(0.0, 0.0, 0.1)]), 0.002
    w = plane_values(plane, (40, 60))[0].copy()
    for columns, off in ((slice(5, 8), 1.5), (slice(20, 36), 1.5), (slice(50, 53), 1.1 * OUTLIER_FACTOR)):
        w[10 : 13 if columns.start != 20 else 26, columns] += np.float32(off * NOISE_FACTOR * noise)
    everywhere = np.ones(w.shape, bool)
    label = label_known(w, everywhere, ~everywhere, plane, noise)
    assert (label[10:13, 5:8] == 1).all()
    assert (label[15:21, 25:31] == SMOOTH).all() and (label[10:13, 50:53] == SMOOTH).all()
    assert (label_known(w, everywhere, ~everywhere, plane)[10:13, 5:8] == SMOOTH).all()


def test_noise_is_taken_off_planes_and_nothing_else() -> None:
    """Closed form: what lies within OUTLIER_FACTOR x NOISE_FACTOR of the noise of its plane is put on it, the rest that much
    nearer to it; pixels on no plane, and all where there is no noise, stay."""
    plane = np.array([(0.001, 0.002, 0.3)])
    flat = plane_values(plane, (3, 4))[0]
    off = np.array([0, 0.01, -0.02, 0.04] * 3, np.float32).reshape(3, 4)
    label = np.ones((3, 4), np.int8)
    label[2] = SMOOTH
    got = denoise(flat + off, label, plane, 0.002)
    kept = np.where(label == SMOOTH, off, np.array([0, 0, -0.01, 0.03], np.float32))
    np.testing.assert_allclose(got, flat + kept, atol=1e-6)
    assert OUTLIER_FACTOR * NOISE_FACTOR * 0.002 == 0.01
    np.testing.assert_array_equal(denoise(flat + off, label, plane, 0.0), flat + off)


def test_plane_values_are_affine_at_pixel_centres() -> None:
    """Closed form, also on a grid with pixels three times as large."""
    plane = np.array([[0.01, -0.02, 0.5]])
    assert plane_values(plane, (4, 5))[0, 2, 3] == pytest.approx(0.035 - 0.05 + 0.5)
    assert plane_values(plane, (4, 5), step=3.0)[0, 2, 3] == pytest.approx(0.105 - 0.15 + 0.5)
    assert plane_values(plane[:0], (4, 5)).shape == (0, 4, 5)
