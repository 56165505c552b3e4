"""LPIPS by the shipped network (oracle: the published recipe in torch on full-precision weights, and its frozen values).

FROZEN was printed by `python tests/reference/lpips_twin.py` (torch 2.13, CPU, the weights in DLAMA_DATA/weights), which
holds the recipe and makes the pictures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dlama.errors import ShapeError
from dlama.evaluation.metrics.lpips import NETWORK, distance, distance_map, features, lpips
from reference import lpips_twin
from reference.lpips_twin import PICTURES, gradient, noise, pair, weights_of

FROZEN = {
    "noise": 0.096263,
    "noise on a gradient": 0.798521,
    "gradients": 0.703764,
    "box blur": 0.656605,
    "grey depth": 0.197950,
    "smallest": 0.687518,
    "demo removal": 0.063619,
}


@pytest.mark.parametrize("name", PICTURES)
def test_frozen_values(name: str) -> None:
    """Noise, gradients, blur, grey depth, the smallest size, a photo: within 1e-3 of full precision."""
    mine, truth = pair(name)
    assert lpips(mine, truth) == pytest.approx(FROZEN[name], abs=1e-3)


@pytest.mark.parametrize("name", ["box blur", "grey depth", "smallest"])
def test_distance_and_map_agree_with_the_twin(name: str, weights_dir: Path) -> None:
    """The twin, live: the number, the map, and the mean of the map."""
    a, b = pair(name)
    expected, expected_map = lpips_twin.lpips(weights_of(weights_dir), a, b)
    assert FROZEN[name] == pytest.approx(expected, abs=2e-5)
    one, other = features(a), features(b)
    assert distance(one, other) == pytest.approx(expected, abs=1e-3)
    got = distance_map(one, other, (a.shape[0], a.shape[1]))
    np.testing.assert_allclose(got, expected_map, atol=3e-3)
    assert got.mean() == pytest.approx(expected_map.mean(), abs=1e-3)


def noise_in_a_box() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What a method made, the truth, a region, and the truth with the former pasted into it."""
    truth, mine = gradient(90, 110), noise((90, 110, 3), 7)
    region = np.zeros((90, 110), np.bool_)
    region[20:60, 30:70] = True
    return mine, truth, region, np.where(region[..., None], mine, truth)


def test_a_region_is_the_mean_of_the_map_with_the_truth_pasted_outside(weights_dir: Path) -> None:
    """The twin on pictures pasted by hand."""
    mine, truth, region, pasted = noise_in_a_box()
    expected = lpips_twin.lpips(weights_of(weights_dir), pasted, truth)[1][region].mean()
    assert lpips(mine, truth, region) == pytest.approx(expected, abs=1e-3)


def test_what_lies_outside_a_region_has_no_say() -> None:
    """Law: outside stands the truth, whatever a method made of it; and a region that is right counts 0."""
    mine, truth, region, pasted = noise_in_a_box()
    assert lpips(mine, truth, region) == lpips(pasted, truth, region) > 0
    assert lpips(np.where(region[..., None], truth, mine), truth, region) == 0


def test_the_map_keeps_pixel_centres() -> None:
    """Closed form: a tap whose cells rise by 1 along both axes is, enlarged four times, the same ramp over pixel centres."""
    rise = (np.arange(6)[:, None] + np.arange(5)).astype(np.float32)
    nothing = np.zeros((1, 6, 5), np.float32)
    got = distance_map((np.sqrt(rise)[None],), (nothing,), (24, 20))
    down, along = ((np.arange(4 * n) + 0.5) / 4 - 0.5 for n in (6, 5))
    np.testing.assert_allclose(got[2:-2, 2:-2], (down[:, None] + along)[2:-2, 2:-2], rtol=1e-5)


def test_regions_of_grey_depth_and_empty_ones() -> None:
    """Depth equals its three-channel picture; an empty region is nan."""
    mine, truth = pair("grey depth")
    region = np.zeros(truth.shape, np.bool_)
    region[10:50, 80:120] = True
    colour = [np.stack([plane] * 3, axis=2) for plane in (mine, truth)]
    assert lpips(mine, truth, region) == lpips(colour[0], colour[1], region) > 0
    assert np.isnan(lpips(mine, truth, ~truth.astype(np.bool_)))


def test_small_pictures_are_refused() -> None:
    """What came and what was expected."""
    small = np.zeros((30, 64, 3), np.uint8)
    with pytest.raises(ShapeError, match="64x30; 31x31 or more is expected"):
        lpips(small, small)


def test_the_shipped_file_is_small_and_carries_its_notices() -> None:
    """At most 5.5 MB; both licences next to it."""
    assert NETWORK.stat().st_size <= 5_500_000
    notices = (NETWORK.parent / "LICENSES.txt").read_text("utf-8")
    assert "Soumith Chintala 2016" in notices and "Richard Zhang" in notices
