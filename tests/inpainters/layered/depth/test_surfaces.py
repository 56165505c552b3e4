"""Surfaces continued into holes: the kernels against their twins, belief propagation against every labelling there is."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.layered.depth.cut_objects import CutObjects
from dlama.inpainters.layered.depth.surface_labels import (
    GRID,
    POTTS,
    REACH,
    RIM,
    CoarseView,
)
from dlama.inpainters.layered.depth.surfaces import continue_surfaces
from dlama.inpainters.layered.kernels import surfaces as kernels
from dlama.perception.planes import SKY
from marks import first_quick
from reference import extension as twin
from worlds import Plane

SEEDS = first_quick(range(8), 4)


def holed(seed: int, height: int = 9, width: int = 11) -> tuple[np.ndarray, np.ndarray]:
    """Random inverse depth with some sky, and a hole of random blocks and lone pixels."""
    rng = np.random.default_rng(seed)
    w = rng.uniform(0.1, 1, (height, width)).astype(np.float32)
    w[rng.random(w.shape) < 0.2] = 0
    hole = rng.random(w.shape) < 0.2
    hole[2:6, 3:8] = True
    return w, hole


@pytest.mark.parametrize("seed", SEEDS)
def test_far_side_equals_its_twin(seed: int) -> None:
    """Twin: 16 rays a pixel, one step at a time; the weighted far quartile and all within 30 % of it."""
    w, hole = holed(seed)
    got = kernels.far_side(w, hole)
    np.testing.assert_allclose(got, twin.far_side(w, hole), rtol=1e-6)
    assert (got[hole] > 0).any()


def costs_setup(seed: int, labels: int = 4) -> tuple:
    """Random arguments of the twin of `unary_costs`."""
    rng = np.random.default_rng(seed)
    w, hole = holed(seed)
    values = rng.uniform(0, 1, (labels, *w.shape)).astype(np.float32)
    values[1] = 0
    label = rng.integers(-1, labels - 1, w.shape).astype(np.int8)
    w[label == SKY] = 0
    there = rng.random(values.shape) < 0.1
    values = np.where(there, w * rng.uniform(0.9, 1.1, values.shape), values).astype(np.float32)
    distance = rng.uniform(0, 30, values.shape).astype(np.float32)
    penalty = rng.uniform(0, 2, values.shape).astype(np.float32)
    return values, rng.random(values.shape) < 0.8, distance, hole, w, label, REACH * GRID, penalty, np.array(RIM)


@pytest.mark.parametrize("seed", SEEDS)
def test_unary_costs_equal_their_twin(seed: int) -> None:
    """Twin: label by label, neighbour by neighbour."""
    values, allowed, distance, hole, w, label, _, penalty, _ = args = costs_setup(seed)
    camera = Camera.from_fov(hole.shape[1], hole.shape[0], 60)
    none = np.zeros(1, np.float32), np.zeros((1, 3), np.float32)
    nothing = CutObjects(np.zeros(hole.shape, np.float32), np.zeros(hole.shape, np.int32), *none)
    found = CoarseView(camera, hole, hole, w, label, values, nothing).unary_costs(allowed, distance, penalty)
    np.testing.assert_allclose(found, twin.unary(*args), rtol=1e-5, atol=1e-5)


def random_problem(seed: int, hole: np.ndarray, labels: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Unary costs (0 outside the hole) and inverse depths of a labelling problem with jumps of all sizes."""
    rng = np.random.default_rng(seed)
    unary = np.where(hole[..., None], rng.uniform(0, 2, (*hole.shape, labels)), 0).astype(np.float32)
    values = (0.5 + 0.06 * rng.standard_normal((labels, *hole.shape))).astype(np.float32)
    return unary, values


TREES = {
    "row": ["......."],
    "column": [*"......."],
    "row cut in two": ["...x..."],
    "cross": ["x.xx", "....", "x.xx", "x.xx"],
    "comb": ["...", ".x.", "xx.", "x.."],
    "one pixel": ["xx", "x."],
}


@pytest.mark.parametrize("shape", TREES.values(), ids=TREES)
@pytest.mark.parametrize("seed", range(4))
def test_belief_propagation_on_a_tree_is_exact(shape: list[str], seed: int) -> None:
    """Oracle: every labelling tried out. Beliefs are the min-marginals but for a constant per pixel (no cycles: exact)."""
    hole = np.array([[pixel == "." for pixel in row] for row in shape])
    unary, values = random_problem(seed, hole)
    got = kernels.beliefs(unary, values, hole, POTTS, rounds=8)
    exact = twin.min_marginals(unary, values, hole, POTTS)
    for row, column in zip(*np.nonzero(hole)):
        np.testing.assert_allclose(
            got[row, column] - got[row, column].min(), exact[row, column] - exact[row, column].min(), atol=1e-5
        )
    np.testing.assert_array_equal(got[~hole], 0)


def test_a_plane_seen_nowhere_else_and_pixels_alone() -> None:
    """Law: with too few pixels for any plane, the hole takes the far side of its rim: 4 m, not 1 m."""
    depth = np.array([[1, 4, 4, 4, 4, 4, 4]], np.float32)
    frame = RGBD(np.zeros((1, 7, 3), np.uint8), depth, Camera.from_fov(7, 1, 60))
    taken = np.array([[0, 1, 1, 1, 1, 0, 0]], np.bool_)
    surfaces = continue_surfaces(View.from_rgbd(frame).without(taken, HoleType.OBJECT), FillContext(Law(())))
    np.testing.assert_allclose(surfaces.inverse_depth[0, 3:], 0.25, rtol=1e-5)
    assert (surfaces.inverse_depth[0, 1:5] <= 1).all()
    assert Plane((0, 0, 4), (0, 0, 1)).distance(np.array([0, 0, 1 / surfaces.inverse_depth[0, 3]])) < 1e-3
