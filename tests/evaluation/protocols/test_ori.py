"""ORI against scores computed by hand: the square taken away from before the wall."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from square_world import (
    FILLED,
    SIZE,
    SOURCE,
    SQUARE_IN_SOURCE,
    WALL,
    WALL_M,
    frame,
    rectangle,
    values,
)

from dlama.completion.recipes import find_recipe
from dlama.datasets.frames import RemovalTruth
from dlama.datasets.layouts import open_dataset
from dlama.evaluation.protocols import PROTOCOLS
from dlama.evaluation.protocols.methods import NO_FILL, Method, ProtocolSettings, Scored
from dlama.evaluation.protocols.ori import change_outside, find_true_shadow
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View

PLAIN = ProtocolSettings(lpips=False, mask_changes=(), ring_px=8)
TRUTH = RemovalTruth(frame(SOURCE, SQUARE_IN_SOURCE), frame(SOURCE, None), SQUARE_IN_SOURCE)
BAND = dilate_mask(SQUARE_IN_SOURCE, 3) & ~SQUARE_IN_SOURCE
RING = dilate_mask(SQUARE_IN_SOURCE, 8) & ~SQUARE_IN_SOURCE


def scored(filler: str, truth: RemovalTruth = TRUTH, settings: ProtocolSettings = PLAIN, **changes) -> list[Scored]:
    return PROTOCOLS["ori"](truth, Method(find_recipe("paper", **changes), filler), settings)


def test_scores_by_hand(constant_filler: str) -> None:
    """Closed form: the mask is off by 60 levels, of the ring the 3 px that the recipe gives up, and nothing beyond."""
    (plain,) = scored(constant_filler)
    found = values(plain.measures)
    wrong = (WALL - FILLED) ** 2
    assert found["mask", "rgb", "mse"] == wrong and found["mask", "depth", "mse"] == 13**2
    assert found["ring", "rgb", "mse"] == pytest.approx(wrong * BAND.sum() / RING.sum())
    assert found["outside", "rgb", "mse"] == found["outside", "depth_m", "mae"] == 0
    for modality in ("rgb", "depth"):
        assert found["outside", modality, "changed_pixels"] == found["outside", modality, "mse_source"] == 0
    assert found["whole", "rgb", "mask_ratio"] == 100 * (SQUARE_IN_SOURCE | BAND).mean()
    assert found["mask", "rgb", "share"] == 25
    assert found["mask", "depth_m", "mae"] == pytest.approx(115 / 25.5 - WALL_M)
    assert plain.panel is not None and not any(np.isnan(value) for value in found.values())


def test_holes_of_colour_and_of_depth(constant_filler: str) -> None:
    """Closed form: a sensor hole opens depth and no colour."""
    holed = RGBD(TRUTH.source.color, TRUTH.source.depth * ~rectangle((0, 8), (0, 8)), SOURCE)
    found = values(scored(constant_filler, RemovalTruth(holed, TRUTH.without, TRUTH.mask), dilate=0)[0].measures)
    assert found["whole", "rgb", "mask_ratio"] == 25
    assert found["whole", "depth", "mask_ratio"] == pytest.approx(25 + 100 * 64 / SIZE**2)


def test_the_background_as_a_cloud(constant_filler: str) -> None:
    """Closed form: a wall put 0.51 m behind its place has nothing within 10 cm; left to a filler that continues it, all."""
    found = values(scored(constant_filler)[0].measures)
    behind = 115 / 25.5 - WALL_M
    assert behind <= found["mask", "cloud", "accuracy"] < 1.05 * behind
    assert found["mask", "cloud", "fscore_0.10"] == 0
    found = values(PROTOCOLS["ori"](TRUTH, Method("dlama", "telea"), PLAIN)[0].measures)
    assert found["mask", "cloud", "accuracy"] < 1e-3
    assert found["mask", "cloud", "fscore_0.02"] == 1


def test_changed_masks(constant_filler: str) -> None:
    """Closed form: in the same regions, an eroded mask leaves a rim of the square standing, a dilated one opens the ring."""
    settings = ProtocolSettings(lpips=False, mask_changes=(-20, -6, 0, 6), ring_px=16)
    runs = scored(constant_filler, settings=settings, dilate=0)
    assert [run.variant for run in runs] == ["", "mask-6", "mask+6"]  # 20 px eat up the whole square
    found = {run.variant: values(run.measures) for run in runs}
    rim = 1 - (20 * 20) / (32 * 32)
    assert found["mask-6"]["mask", "rgb", "mse"] == pytest.approx(rim * 100**2 + (1 - rim) * 3600)
    assert found["mask-6"]["ring", "rgb", "mse"] == 0 == found[""]["ring", "rgb", "mse"]
    opened = dilate_mask(SQUARE_IN_SOURCE, 6) & ~SQUARE_IN_SOURCE
    ring = dilate_mask(SQUARE_IN_SOURCE, 16) & ~SQUARE_IN_SOURCE
    assert found["mask+6"]["ring", "rgb", "mse"] == pytest.approx(3600 * opened.sum() / ring.sum())
    assert [run.panel is not None for run in runs] == [True, False, False]


def test_only_what_is_comparable_counts(constant_filler: str) -> None:
    """Closed form: half the mask is not comparable and shows something else; a shadow is its own region."""
    left, shadow = rectangle((0, 32)), rectangle((4, 12), (16, 48))
    moved = np.array(TRUTH.without.color)
    moved[~left] = 7
    shaded = np.array(TRUTH.source.color)
    shaded[shadow] = WALL - 20
    truth = RemovalTruth(
        RGBD(shaded, TRUTH.source.depth, SOURCE),
        RGBD(moved, TRUTH.without.depth, SOURCE),
        SQUARE_IN_SOURCE,
        compare=left,
        shadow=shadow,
    )
    found = values(scored(constant_filler, truth, dilate=0)[0].measures)
    assert found["mask", "rgb", "mse"] == 3600 and found["mask", "rgb", "share"] == 12.5
    assert found["shadow", "rgb", "mse"] == 400
    assert found["whole", "rgb", "mse"] == pytest.approx((3600 * 16 * 32 + 400 * shadow.sum()) / left.sum())


def test_exposure_of_a_pair(constant_filler: str) -> None:
    """Closed form: gain 2, fitted beyond the ring."""
    dark = RGBD(TRUTH.source.color // 2, TRUTH.source.depth, SOURCE)
    truth = RemovalTruth(dark, TRUTH.without, TRUTH.mask, exposure_varies=True)
    found = values(scored(constant_filler, truth)[0].measures)
    assert found["outside", "rgb", "mse"] == 0 and found["mask", "rgb", "mse"] == (WALL - 2 * FILLED) ** 2
    assert found["outside", "rgb", "changed_pixels"] == 0


def test_what_was_touched_is_counted() -> None:
    """Guard: three pixels changed by 10 levels and one moved by a metre are found; a sensor hole's new depth is not."""
    source = RGBD(TRUTH.source.color, TRUTH.source.depth * ~rectangle((0, 2), (0, 1)), SOURCE)
    view = View.from_rgbd(source)
    color, depth = np.array(view.color), np.array(view.depth)
    color[0, :3] += 10
    depth[0, :2], depth[5, 5] = 3, 5
    changed = View(SOURCE, color, depth, np.zeros((SIZE, SIZE), bool), view.hole_type, view.origin, view.confidence)
    outside = ~SQUARE_IN_SOURCE
    found = values(change_outside(changed, source, outside))
    assert found["outside", "rgb", "changed_pixels"] == 3 and found["outside", "depth", "changed_pixels"] == 1
    assert found["outside", "rgb", "mse_source"] == pytest.approx(300 / outside.sum())
    assert set(values(change_outside(view, source, outside)).values()) == {0.0}


def test_no_fill_is_black() -> None:
    """Closed form: the object is black, its depth missing; no cloud and no metres in the mask."""
    found = values(scored(NO_FILL)[0].measures)
    assert found["mask", "rgb", "mse"] == WALL**2 and found["mask", "depth", "mse"] == 102**2
    assert not any(modality == "cloud" for _, modality, _ in found) and ("mask", "depth_m", "mae") not in found


def test_street_shadows(data_dir: Path) -> None:
    """Looked at: the barrel's sun shadow lies to its right on the asphalt, next to the mask, 0.2 to 0.8 % of the picture."""
    truth = open_dataset(data_dir / "street", scenes=["s03"]).of("ori")[0].load()
    assert isinstance(truth, RemovalTruth) and truth.shadow is None
    shadow = find_true_shadow(truth)
    assert shadow is not None and not (shadow & truth.mask).any() and 0.002 < shadow.mean() < 0.008
    middle_of = [np.argwhere(each).mean(axis=0) for each in (truth.mask, shadow)]
    assert middle_of[1][1] > middle_of[0][1] + 20 and middle_of[1][0] > middle_of[0][0]
    luma = [each.color[shadow].mean() for each in (truth.source, truth.without)]
    assert luma[0] < luma[1] - 10
