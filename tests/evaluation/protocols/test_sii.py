"""SII against scores computed by hand: the wall and the square as a stereo pair, painted so that it can be matched."""

from __future__ import annotations

import numpy as np
import pytest
from square_world import (
    DISOCCLUDED,
    FILLED,
    OUT_OF_VIEW,
    SIZE,
    SOURCE,
    SQUARE_IN_SOURCE,
    SQUARE_IN_TARGET,
    TARGET,
    WALL_M,
    values,
)

from dlama.completion.recipes import find_recipe
from dlama.datasets.frames import StereoTruth
from dlama.errors import InputError
from dlama.evaluation.protocols import PROTOCOLS
from dlama.evaluation.protocols.methods import NO_FILL, Method, ProtocolSettings, Scored
from dlama.geometry.camera import StereoRig
from dlama.geometry.rgbd import RGBD

QUICK = ProtocolSettings(lpips=False, matched_stereo=False)
RIG = StereoRig(SOURCE, TARGET)
LEFT_PX = np.where(SQUARE_IN_SOURCE, 16, 8).astype(np.float32)
RIGHT_PX = np.where(SQUARE_IN_TARGET, 16, 8).astype(np.float32)
UNSEEN = DISOCCLUDED | OUT_OF_VIEW


def painted() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Left and right picture with the square, left and right without: one noise on the wall, another on the square."""
    rng = np.random.default_rng(3)
    wall = rng.integers(60, 140, (SIZE, SIZE + 8, 3), np.uint8)
    square = rng.integers(150, 250, (32, 32, 3), np.uint8)
    without = wall[:, :SIZE].copy(), wall[:, 8:].copy()
    left, right = without[0].copy(), without[1].copy()
    left[16:48, 16:48], right[16:48, :32] = square, square
    return left, right, *without


def pair(**fields) -> StereoTruth:
    left, right, _, _ = painted()
    return StereoTruth(left, right, RIG, LEFT_PX, **fields)


def removal() -> StereoTruth:
    _, _, left, right = painted()
    wall = np.full((SIZE, SIZE), WALL_M, np.float32)
    frames = {"without_left": RGBD(left, wall, SOURCE), "without_right": RGBD(right, wall, TARGET)}
    return pair(disparity_right=RIGHT_PX, mask_left=SQUARE_IN_SOURCE, mask_right=SQUARE_IN_TARGET, **frames)


def scored(truth: StereoTruth, filler: str, settings: ProtocolSettings = QUICK, **changes) -> list[Scored]:
    return PROTOCOLS["sii"](truth, Method(find_recipe("paper", **changes), filler), settings)


def test_the_right_view_by_hand(constant_filler: str) -> None:
    """Closed form: seen pixels are the left picture's own; unseen ones hold the filler's colour and disparity."""
    (plain,) = scored(pair(disparity_right=RIGHT_PX), constant_filler)
    found = values(plain.measures)
    right = painted()[1].astype(float)
    assert found["unseen", "rgb", "mse"] == pytest.approx(((right - FILLED) ** 2)[UNSEEN].mean())
    assert found["seen", "rgb", "mse"] == found["seen", "disparity", "epe"] == found["seen", "depth_m", "mae"] == 0
    filled_px = 64 * 0.5 / (115 / 25.5)
    assert found["unseen", "disparity", "epe"] == pytest.approx(8 - filled_px, rel=1e-5)
    assert found["unseen", "disparity", "bad-1"] == found["whole", "disparity", "bad-2"] == 0
    assert found["whole", "rgb", "mask_ratio"] == pytest.approx(100 * UNSEEN.mean())
    assert plain.panel is not None


def test_what_is_not_known_is_not_scored(constant_filler: str) -> None:
    """Law: a nominal rig gives no metres; without the right disparity there is none to compare with."""
    nominal = values(scored(pair(disparity_right=RIGHT_PX, metric=False), constant_filler)[0].measures)
    assert not any(modality in ("depth_m", "depth") and metric in ("mae", "mse") for _, modality, metric in nominal)
    assert ("unseen", "disparity", "epe") in nominal
    blind = values(scored(pair(), constant_filler)[0].measures)
    assert not any(modality == "disparity" for _, modality, _ in blind)
    assert blind["unseen", "rgb", "mse"] == nominal["unseen", "rgb", "mse"]


def test_an_object_removed_from_both(constant_filler: str) -> None:
    """Closed form: both masks hold the filler's colour; at the true disparity left and right agree in every pixel."""
    (plain,) = scored(removal(), constant_filler, dilate=0)
    found = values(plain.measures)
    left, right = (picture.astype(float) for picture in painted()[2:])
    assert found["mask", "rgb", "mse"] == pytest.approx(((left - FILLED) ** 2)[SQUARE_IN_SOURCE].mean())
    assert found["mask-right", "rgb", "mse"] == pytest.approx(((right - FILLED) ** 2)[SQUARE_IN_TARGET].mean())
    assert found["whole", "rgb", "mask_ratio"] == found["whole-right", "rgb", "mask_ratio"] == 25
    assert found["mask", "disparity", "photometric_truth"] == 0
    # the left mask carried by 8 px covers 24 of the right mask's columns; 8 columns of 32 show 40 next to the wall
    shifted = np.abs(right - FILLED).mean(2)[16:48, 32:40].mean()
    assert found["mask", "disparity", "photometric_at_truth"] == pytest.approx(shifted * 8 / 32)
    assert plain.panel is not None and not any(np.isnan(value) for value in found.values())


def test_the_wall_comes_back() -> None:
    """Law: a smooth filler under our recipe restores the wall's disparity within 1 px; its views agree better than truth."""
    run = PROTOCOLS["sii"](removal(), Method("dlama", "telea"), QUICK)[0]
    found = values(run.measures)
    assert found["mask", "disparity", "coverage"] == 1 and found["mask", "disparity", "epe"] < 1.5
    assert found["mask", "cloud", "completeness"] < 0.6 and found["mask", "depth_m", "mae"] < 0.6
    assert found["mask", "disparity", "photometric"] < 20


def test_the_methods_own_disparity_is_a_variant(constant_filler: str) -> None:
    """Law: two runs, distinguished; the second has no panel."""
    settings = ProtocolSettings(lpips=False)
    runs = scored(pair(disparity_right=RIGHT_PX), constant_filler, settings)
    assert [(run.variant, run.panel is not None) for run in runs] == [("", True), ("sgm", False)]
    assert values(runs[1].measures)["seen", "rgb", "mse"] < 4000


def test_no_fill_is_black() -> None:
    """Closed form: colours are scored with black holes, disparity and metres are not in them."""
    found = values(scored(pair(disparity_right=RIGHT_PX), NO_FILL)[0].measures)
    right = painted()[1].astype(float)
    assert found["unseen", "rgb", "mse"] == pytest.approx((right**2)[UNSEEN].mean())
    assert ("unseen", "depth_m", "mae") not in found and ("unseen", "disparity", "epe") not in found
    found = values(scored(removal(), NO_FILL, dilate=0)[0].measures)
    left = painted()[2].astype(float)
    assert found["mask", "rgb", "mse"] == pytest.approx((left**2)[SQUARE_IN_SOURCE].mean())
    assert {modality for _, modality, metric in found if metric != "mask_ratio"} == {"rgb", "time"}


def test_refused() -> None:
    """Law: masks without their answers are named."""
    with pytest.raises(InputError, match="both true frames"):
        scored(pair(mask_left=SQUARE_IN_SOURCE), NO_FILL)
