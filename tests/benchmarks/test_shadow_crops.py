"""Crops for the shadow's classifiers, against what must hold of any of them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from dlama.geometry.projection import rays
from dlama.perception.shadows.planes import MULTIPLE, PLANES
from dlama.worlds.dataset import world
from dlama.worlds.raycast.shape_rows import GROUND_GROUP, LAYER
from shadow_crops import LOW_M, ShadowCrops, add_paving, shadow_crop, write_shadow_crops


@pytest.mark.slow
def test_a_seed_says_it_all_and_truth_lies_on_the_surface(tmp_path: Path) -> None:
    """Oracles: the same seed gives the same crop, in memory and in a file; no shadow counts off the surface."""
    made = shadow_crop(54_003)
    assert made is not None
    planes, target = made
    assert len(planes.values) == len(PLANES) and planes.surface.shape == target.shape
    assert all(side % MULTIPLE == 0 for side in target.shape)
    assert target.max() <= 1 and (target[planes.plane("surface") < 0.25] == -1).all()
    assert write_shadow_crops(tmp_path, 1, 54_003, None) == 1
    (stored,) = ShadowCrops.of(tmp_path)
    np.testing.assert_allclose(stored[0].values, planes.values, atol=2e-3)
    np.testing.assert_allclose(stored[1], target, atol=1e-3)


def test_fifths_share_nothing_and_leave_nothing_out() -> None:
    files = [Path(f"{number}.npz") for number in range(12)]
    most, fifth = ShadowCrops(files).fifths()
    assert len(most) == 9 and fifth.files == [files[0], files[5], files[10]]
    assert sorted(most.files + fifth.files) == sorted(files)


def test_new_paving_changes_the_colours_of_the_ground_alone() -> None:
    """Laws: shapes, depth and whatever is no ground stay to the byte; the ground has another texture; the world that was given,
    too, is as before."""
    before = dataclasses.replace(world(50_003), antialias=False)
    camera = before.camera(size=96)
    laid = add_paving(before, np.random.default_rng(0))
    old, new = before.raycast(camera), laid.raycast(camera)
    np.testing.assert_array_equal(new.depth, old.depth)
    np.testing.assert_array_equal(new.group, old.group)
    changed = (new.color != old.color).any(-1)
    low = (camera.world_from_cam[1, 3] + (rays(camera) * old.depth[..., None])[..., 1]) > -LOW_M
    assert not changed[(old.group != GROUND_GROUP) | ~low].any()
    assert changed[(old.group == GROUND_GROUP) & low].mean() > 0.9
    assert len(before.textures) + 1 == len(laid.textures) and before.shapes[:, LAYER].max() < len(before.textures)
