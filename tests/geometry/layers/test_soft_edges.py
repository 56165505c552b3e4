"""Soft borders (oracles: shares that the test mixed two surfaces by; the picture itself, put together again)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.layers.soft_edges import SoftEdges, complete_surfaces, find_soft_edges, separate_colors
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, Float32Array
from dlama.geometry.view import View

CAMERA = Camera.from_fov(64, 48, 60)
NEAR, FAR = np.array([200, 40, 30]), np.array([30, 60, 180])
SHARE = np.clip((33.5 - np.arange(64)) / 3, 0, 1)
"""Of the near surface, by column: a border of 3 px; depth has its edge in the middle of it."""


def mix() -> View:
    """A red surface at 2 m before a blue one at 6 m, in stripes of 4 levels."""
    share = np.tile(SHARE[:, None], (48, 1, 1))
    texture = np.where(np.arange(48) % 2, 4, 0)[:, None, None]
    color = np.rint(share * NEAR + (1 - share) * FAR + texture).astype(np.uint8)
    depth = np.where(np.tile(SHARE > 0.5, (48, 1)), 2, 6).astype(np.float32)
    return View.from_rgbd(RGBD(color, depth, CAMERA))


def edges_of(view: View, step: int = 1) -> SoftEdges:
    """Its soft edges, on a grid of every step-th pixel."""
    depth: Float32Array
    depth, joined = complete_surfaces(view)
    color = view.color.repeat(step, 0).repeat(step, 1)
    return find_soft_edges(color, inverse_depth(depth), joined, step)


@pytest.mark.parametrize("step", [1, 3])
def test_shares_are_those_it_was_mixed_by(step: int) -> None:
    """Within a fifth (the hard border is off by a half), also where the picture is finer than the grid."""
    found = edges_of(mix(), step).alpha[8 * step : -8 * step]
    assert np.abs(found - np.repeat(SHARE, step)).max() < 0.2


def test_both_surfaces_give_the_picture_again() -> None:
    """Drawn one over the other, within two levels."""
    view = mix()
    soft = edges_of(view)
    share = soft.alpha[..., None]
    assert np.abs(share * soft.front + (1 - share) * soft.back - view.color).max() <= 2


def test_surfaces_are_continued_over_the_edge() -> None:
    """In the band both are where they are elsewhere: 2 and 6 m."""
    soft = edges_of(mix())
    assert soft.band.any() and np.allclose(soft.near[soft.band], 1 / 2) and np.allclose(soft.far[soft.band], 1 / 6)


def test_no_pixel_is_mixed_any_more() -> None:
    """Each has the colour of its own surface, within 40 levels; mixed ones are off by up to 85."""
    view = mix()
    color = separate_colors(view).color.astype(int)
    own = np.where((view.depth < 4)[..., None], NEAR, FAR)
    assert np.abs(color - own)[:, np.abs(SHARE - 0.5) < 0.5].max() <= 40


def test_without_an_edge_all_stays() -> None:
    """A wall across."""
    wall = View.from_rgbd(RGBD(mix().color, np.full((48, 64), 3, np.float32), CAMERA))
    soft = edges_of(wall)
    assert not soft.band.any() and (separate_colors(wall).color == wall.color).all()


def test_separated_colors_do_not_overshoot() -> None:
    """A border of random shades between a dark surface and a bright one: none is darker or brighter than both."""
    color = np.full((48, 64, 3), 200.0)
    color[:, :32] = 90
    color[:, 31:34] = np.clip(150 + np.random.default_rng(0).normal(0, 25, (48, 3, 3)), 90, 200)
    depth = np.where(np.arange(64) < 33, 2, 4).astype(np.float32)
    given = RGBD(color.astype(np.uint8), np.tile(depth, (48, 1)), CAMERA)
    found = separate_colors(View.from_rgbd(given)).color
    assert found.min() >= 90 and found.max() <= 200
