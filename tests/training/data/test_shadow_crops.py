"""Crops for the shadow's classifiers, against what must hold of any of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.perception.shadows.planes import MULTIPLE, PLANES
from dlama.training.data.shadow_crops import ShadowCrops, shadow_crop, write_shadow_crops


def test_a_seed_says_it_all_and_truth_lies_on_the_surface(tmp_path: Path) -> None:
    """Oracles: the same seed gives the same crop, in memory and in a file; no shadow counts off the surface."""
    made = shadow_crop(54_003)
    assert made is not None
    planes, target = made
    assert len(planes) == len(PLANES) and planes.shape[1:] == target.shape
    assert all(side % MULTIPLE == 0 for side in target.shape)
    assert target.max() <= 1 and (target[planes[4] < 0.25] == -1).all()
    assert write_shadow_crops(tmp_path, 1, 54_003, None) == 1
    (stored,) = ShadowCrops.of(tmp_path)
    np.testing.assert_allclose(stored[0], planes, atol=2e-3)
    np.testing.assert_allclose(stored[1], target, atol=1e-3)


def test_fifths_share_nothing_and_leave_nothing_out() -> None:
    files = [Path(f"{number}.npz") for number in range(12)]
    most, fifth = ShadowCrops(files).fifths()
    assert len(most) == 9 and fifth.files == [files[0], files[5], files[10]]
    assert sorted(most.files + fifth.files) == sorted(files)
