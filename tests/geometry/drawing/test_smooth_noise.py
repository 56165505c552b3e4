"""Noise of measured depth averaged for drawing (oracles: a literal twin, closed-form worlds with noise that is known)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import dlama
from dlama.geometry.camera import Camera
from dlama.geometry.drawing.grid_mesh import mesh_grid, smooth_noise
from dlama.geometry.kernels.smoothing import average_pairs
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from marks import first_quick
from reference import smoothing
from worlds import Box, Plane, World, moved

CAMERA = Camera.from_fov(160, 120, 60)
ROOM = World((Plane((0, 1, 0), (0, -1, 0)), Box((-0.6, -0.3, 1.5), (0.2, 1, 1.9)), Plane((0, 0, 4), (0.3, 0, -1))))


def noisy(kind: str, seed: int = 0) -> RGBD:
    """The room with noise of 1 % of the distance, or of 0.01/m of inverse depth."""
    frame, noise = ROOM.rgbd(CAMERA), 0.01 * np.random.default_rng(seed).standard_normal(CAMERA.hw)
    depth = frame.depth * (1 + noise) if kind == "share" else 1 / (1 / frame.depth + noise)
    return dataclasses.replace(frame, depth=depth.astype(np.float32))


@pytest.mark.parametrize("seed", first_quick(range(6)))
def test_twin(seed: int) -> None:
    """Twin: every pixel, next to holes and the border, too."""
    rng = np.random.default_rng(seed)
    w = (0.3 + 0.2 * (rng.random((12, 15)) > 0.5) + 0.02 * rng.standard_normal((12, 15))).astype(np.float32)
    w[rng.random(w.shape) > 0.9] = 0
    constant, share, reach = 0.03 * (seed % 2), 0.05 * rng.random(), 1 + seed % 3
    out = np.empty_like(w)
    average_pairs(0, len(w), w, constant, share, reach, out)
    np.testing.assert_allclose(out, smoothing.average_pairs(w, constant, share, reach), rtol=1e-5)


@pytest.mark.parametrize("kind", ["share", "constant"])
def test_noise_falls_and_edges_stay(kind: str) -> None:
    """Closed form: noise within surfaces falls to less than a third, and no pixel comes to hang between two surfaces: all are
    within 6 standard deviations of noise of their true depth."""
    truth, view = 1 / ROOM.rgbd(CAMERA).depth, View.from_rgbd(noisy(kind))
    depth, _ = mesh_grid(view)
    smooth = smooth_noise(view, depth)
    known = depth > 0
    unit = 0.01 * (truth if kind == "share" else np.ones_like(truth))
    before, after = (np.abs(1 / one[known] - truth[known]) / unit[known] for one in (depth, smooth))
    assert np.median(after) < np.median(before) / 3
    assert after.max() < 6 and (smooth[~known] == 0).all()


def test_exact_depth_and_own_cameras_have_the_same_bits() -> None:
    """Law: depth without noise is drawn as it is, and measured depth is what the frame's own camera shows, whatever its noise."""
    view = View.from_rgbd(ROOM.rgbd(CAMERA))
    depth, _ = mesh_grid(view)
    assert smooth_noise(view, depth) is depth
    frame = noisy("share")
    np.testing.assert_array_equal(render(frame, CAMERA).depth, frame.depth)
    np.testing.assert_array_equal(dlama.view(frame, yaw=0, filler="telea").view.depth, frame.depth)


def test_another_camera_sees_smoother_surfaces() -> None:
    """Closed form: seen from aside depth is nearer to the truth than noise of one pixel is, by half."""
    target = moved(CAMERA, shift=(0.15, 0, 0))
    truth = ROOM.rgbd(target).depth
    seen = render(noisy("share"), target)
    error = np.abs(seen.depth / truth - 1)[~seen.hole]
    assert np.median(error) < 0.5 * 0.6745 * 0.01
