"""What is less sure stays open (oracles: the confidences of the same completion without the option, and counts)."""

from __future__ import annotations

import numpy as np
import pytest

import dlama
from dlama.errors import InputError
from dlama.geometry.codes import Origin

LEAST = 0.6


@pytest.fixture(scope="module")
def completions() -> tuple[dlama.Completion, dlama.Completion]:
    """A removal seen from elsewhere, whole and with a least confidence; of the street each third pixel."""
    street = dlama.example()
    large = dlama.read_rgbd(street / "street.jpg", street / "depth.png", fov=90)
    color, depth, mask = (each[::3, ::3] for each in (large.color, large.depth, dlama.read_mask(street / "mask.png")))
    rgbd = dlama.RGBD(color, depth, dlama.Camera.from_fov(*mask.shape[::-1], 90))
    whole = dlama.remove(rgbd, mask, yaw=10, filler="telea")
    return whole, dlama.remove(rgbd, mask, yaw=10, filler="telea", min_confidence=LEAST)


def test_views_lose_what_is_less_sure_and_nothing_else(
    completions: tuple[dlama.Completion, dlama.Completion],
) -> None:
    """Law: open exactly where a filled pixel had less; there depth and origin are 0; all other pixels keep their bits."""
    whole, sure = (done.view for done in completions)
    filled = np.isin(whole.origin, (Origin.FILLED, Origin.DEPTH_FILLED))
    unsure = filled & (whole.confidence < LEAST)
    assert 0.05 < unsure.sum() / filled.sum() < 0.95
    np.testing.assert_array_equal(sure.hole, unsure)
    assert (sure.depth[unsure] == 0).all() and (sure.origin[unsure] == Origin.UNKNOWN).all()
    assert (sure.confidence[unsure] == 0).all() and (sure.color[unsure & whole.filled] == 0).all()
    for name in ("color", "depth", "origin", "confidence"):
        np.testing.assert_array_equal(getattr(sure, name)[~unsure], getattr(whole, name)[~unsure])
    np.testing.assert_array_equal(sure.hole_type, whole.hole_type)


def test_clouds_and_meshes_lose_it_too(completions: tuple[dlama.Completion, dlama.Completion]) -> None:
    """Law: no filled point below it is left; measured points are all there."""
    whole, sure = completions
    for noun in ("completed", "background", "mesh"):
        every, kept = getattr(whole, noun), getattr(sure, noun)
        assert (kept.confidence[np.isin(kept.origin, (Origin.FILLED, Origin.DEPTH_FILLED))] >= LEAST).all()
        if noun != "mesh":
            filled = np.isin(every.origin, (Origin.FILLED, Origin.DEPTH_FILLED))
            assert len(kept.points) == int((~filled | (every.confidence >= LEAST)).sum()) < len(every.points)


def test_meta_says_it_and_bad_values_are_refused(completions: tuple[dlama.Completion, dlama.Completion]) -> None:
    """Count: the share of the view; a probability is expected; 0 changes nothing."""
    whole, sure = completions
    assert sure.meta["min_confidence"] == LEAST and "min_confidence" not in whole.meta
    assert sure.meta["left_open_share"] == [round(float(sure.view.hole.mean()), 6)]
    assert whole.with_min_confidence(0) is whole
    for wrong in (-0.1, 1.5, float("nan")):
        with pytest.raises(InputError, match=f"min_confidence is {wrong}; a probability from 0 to 1 is expected"):
            whole.with_min_confidence(wrong)
