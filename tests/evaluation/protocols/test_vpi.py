"""VPI against scores computed by hand on the world of a wall and a square."""

from __future__ import annotations

import numpy as np
import pytest
from square_world import (
    BEHIND_SQUARE,
    DISOCCLUDED,
    FILLED,
    OUT_OF_VIEW,
    SOURCE,
    SQUARE_IN_SOURCE,
    SQUARE_IN_TARGET,
    TARGET,
    WALL,
    frame,
    rectangle,
    values,
)

from dlama.datasets.frames import ViewTruth
from dlama.evaluation.metrics.pictures import psnr, ssim_map
from dlama.evaluation.protocols import PROTOCOLS
from dlama.evaluation.protocols.methods import NO_FILL, Method, ProtocolSettings, Scored
from dlama.evaluation.protocols.scores import region_ssim
from dlama.evaluation.protocols.vpi import target_reference
from dlama.geometry.rgbd import RGBD

QUICK = ProtocolSettings(lpips=False)
TRUTH = ViewTruth(
    frame(SOURCE, SQUARE_IN_SOURCE), frame(TARGET, SQUARE_IN_TARGET), SQUARE_IN_SOURCE, frame(TARGET, None)
)
UNSEEN = DISOCCLUDED | OUT_OF_VIEW


def scored(filler: str, truth: ViewTruth = TRUTH, settings: ProtocolSettings = QUICK) -> list[Scored]:
    return PROTOCOLS["vpi"](truth, Method("paper", filler), settings)


def test_scores_by_hand(constant_filler: str) -> None:
    """Closed form: seen pixels are right; unseen ones are off by 60 levels and by 13 levels, 0.51 m, of depth.

    4 m is level 102; 4.5 m is level 115 of 255 in the paper's 8-bit depth, 4.5098 m.
    """
    plain = scored(constant_filler)[0]
    found = values(plain.measures)
    share = UNSEEN.mean()
    assert found["whole", "rgb", "mask_ratio"] == pytest.approx(100 * share) == 18.75
    assert found["unseen", "rgb", "share"] == found["whole", "rgb", "mask_ratio"]
    for region in ("unseen", "disoccluded", "out-of-view"):
        assert found[region, "rgb", "mse"] == (WALL - FILLED) ** 2
        assert found[region, "rgb", "psnr"] == psnr(3600.0)
        assert found[region, "depth", "mse"] == 13**2
        assert found[region, "depth_m", "mae"] == pytest.approx(115 / 25.5 - 4)
        assert found[region, "depth_m", "absrel"] == pytest.approx((115 / 25.5 - 4) / 4)
        assert (found[region, "depth_m", "delta1.05"], found[region, "depth_m", "delta1.25"]) == (0, 1)
    assert found["seen", "rgb", "mse"] == found["seen", "depth", "mse"] == found["seen", "depth_m", "mae"] == 0
    assert found["seen", "rgb", "psnr"] == np.inf and found["seen", "depth_m", "leaks"] == 0
    assert found["whole", "rgb", "mse"] == pytest.approx(3600 * share)
    assert found["whole", "depth_m", "mae"] == pytest.approx(share * (115 / 25.5 - 4))
    answer = np.where(UNSEEN[..., None], np.uint8(FILLED), TRUTH.target.color)
    assert found["whole", "rgb", "ssim"] == pytest.approx(region_ssim(ssim_map(TRUTH.target.color, answer), None))
    assert found["whole", "depth_m", "law_violations"] == 0 and found["whole", "time", "seconds"] > 0
    assert not any(np.isnan(value) for value in found.values())
    assert plain.panel is not None and plain.variant == ""


def test_the_second_experiment(constant_filler: str) -> None:
    """Closed form: with the square's points gone, what it hid is filled, and scored as a type against the bare wall."""
    runs = scored(constant_filler)
    assert [run.variant for run in runs] == ["", "object,dilate=0", "object,dilate=3", "object,dilate=9"]
    assert [run.panel is not None for run in runs] == [True, False, False, False]
    found = values(runs[1].measures)
    assert found["object", "rgb", "share"] == 100 * BEHIND_SQUARE.mean()
    assert found["object", "rgb", "mse"] == (WALL - FILLED) ** 2
    # the paper's union with the footprint: the square's own 32 columns of the new view are filled as well
    footprint = SQUARE_IN_TARGET & ~BEHIND_SQUARE
    seen = ~(BEHIND_SQUARE | OUT_OF_VIEW)
    assert found["seen", "rgb", "mse"] == pytest.approx(3600 * footprint.sum() / seen.sum())
    ratios = [values(run.measures)["whole", "rgb", "mask_ratio"] for run in runs[1:]]
    assert ratios[0] == pytest.approx(100 * (BEHIND_SQUARE | OUT_OF_VIEW | SQUARE_IN_TARGET).mean())
    assert ratios[0] < ratios[1] < ratios[2]
    assert len(scored(constant_filler, settings=ProtocolSettings(lpips=False, object_dilations=()))) == 1
    assert len(scored(constant_filler, ViewTruth(TRUTH.source, TRUTH.target, SQUARE_IN_SOURCE))) == 1


def test_no_fill_is_black() -> None:
    """Closed form: holes are black and at level 0; metres only where there are any."""
    found = values(scored(NO_FILL)[0].measures)
    assert found["unseen", "rgb", "mse"] == WALL**2
    assert found["unseen", "depth", "mse"] == 102**2
    assert found["whole", "depth_m", "mae"] == 0 and ("unseen", "depth_m", "mae") not in found
    assert not any(metric.startswith(("edge", "law")) for _, _, metric in found)


def test_exposure_is_undone_for_all_alike(constant_filler: str) -> None:
    """Closed form: a target twice as bright has gain 2, so what is seen is right and 40 becomes 80 next to 100."""
    dark = RGBD(TRUTH.source.color // 2, TRUTH.source.depth, SOURCE)
    found = values(scored(constant_filler, ViewTruth(dark, TRUTH.target, exposure_varies=True))[0].measures)
    assert found["seen", "rgb", "mse"] == 0 and found["unseen", "rgb", "mse"] == (WALL - 2 * FILLED) ** 2
    found = values(scored(constant_filler, ViewTruth(dark, TRUTH.target))[0].measures)
    assert found["seen", "rgb", "mse"] > 2000


def test_missing_truth_is_left_out(constant_filler: str) -> None:
    """Closed form: where the true frame has no depth, depth is not scored and colour is."""
    blind = rectangle((56, 64), (0, 32))
    target = RGBD(TRUTH.target.color, TRUTH.target.depth * ~blind, TARGET)
    found = values(scored(constant_filler, ViewTruth(TRUTH.source, target))[0].measures)
    wrong = (UNSEEN & ~blind).sum()
    assert found["whole", "depth", "mse"] == pytest.approx(13**2 * wrong / (~blind).sum())
    assert found["whole", "depth_m", "mae"] == pytest.approx((115 / 25.5 - 4) * wrong / (~blind).sum())
    assert found["whole", "rgb", "mse"] == pytest.approx(3600 * UNSEEN.mean())


def test_lpips_by_region(constant_filler: str) -> None:
    """Law: nothing differs where everything was seen; what was filled with another colour does."""
    found = values(scored(constant_filler, settings=ProtocolSettings(object_dilations=()))[0].measures)
    assert found["seen", "rgb", "lpips"] == pytest.approx(0, abs=1e-6)
    assert found["unseen", "rgb", "lpips"] > found["whole", "rgb", "lpips"] > 0.01
    assert found["unseen", "depth", "lpips"] > 0


def test_small_regions_have_no_rows(constant_filler: str) -> None:
    """Closed form: 256 disoccluded pixels are too few for 300 and enough for 256."""
    for limit, there in ((300, False), (256, True)):
        settings = ProtocolSettings(lpips=False, object_dilations=(), smallest_region=limit)
        found = values(scored(constant_filler, settings=settings)[0].measures)
        assert (("disoccluded", "rgb", "mse") in found) is there
        assert (("disoccluded", "depth_m", "mae") in found) is there


@pytest.mark.parametrize(("behind", "region"), [(1.015, "seen"), (1.03, "disoccluded")])
def test_seen_is_what_lies_within_2_percent(behind: float, region: str) -> None:
    """Closed form: the same camera, whose true target lies 1.5 % behind the source's depth, or 3 %; the limit is 2 %."""
    source = frame(SOURCE, None)
    target = RGBD(source.color, source.depth * np.float32(behind), SOURCE)
    regions = target_reference(ViewTruth(source, target), ProtocolSettings()).regions
    assert regions[region].all()
