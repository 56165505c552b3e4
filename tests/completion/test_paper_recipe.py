"""The paper recipe, by its own words: points, a 10 m clip, 8-bit depth, the union with the footprint (fig. 5)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from small_street import CAMERA, MASK, completed, fillers, street

from dlama.completion.recipes import RECIPES
from dlama.completion.verbs import remove, target_camera
from dlama.geometry.codes import HoleType
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.visibility import Law


def test_the_paper_draws_points_and_clips_at_ten_metres() -> None:
    """Closed form: the warped view is the points rendering of the picture cut at 10 m, sky and all; 3 px of dilation."""
    done = completed("paper", "telea", False, 14.0)
    frame = street()
    assert frame.far.any() and done.source.depth.max() == 10
    cut = RGBD(frame.color, np.minimum(frame.depth, np.float32(10)), CAMERA)
    by_hand = render(cut, target_camera(frame, yaw=14.0), "points")
    for name in ("color", "depth", "hole", "hole_type"):
        np.testing.assert_array_equal(getattr(done.warped[0], name), getattr(by_hand, name))
    assert not done.view.far.any()
    own = completed("paper", "telea", True, 0.0)
    np.testing.assert_array_equal(own.warped[0].hole & ~frame.missing, dilate_mask(MASK, 3) & ~frame.missing)


@fillers
def test_the_papers_filled_depth_has_eight_bits(filler: str) -> None:
    """Closed form: multiples of 10 m / 255, but for as many pixels as the law had moved; `clip` sets the step."""
    done = completed("paper", filler, True, -14.0)
    steps = done.view.depth[done.warped[0].hole] / (10 / 255)
    off = abs(steps - np.round(steps)) > 1e-3
    assert (~off).mean() > 0.5 and off.sum() <= done.meta["law_moves"]
    coarse = remove(street(), MASK, filler=filler, recipe="paper", clip=5.1)
    steps = coarse.view.depth[coarse.warped[0].hole] / 0.02
    assert (abs(steps - np.round(steps)) > 1e-3).sum() <= coarse.meta["law_moves"]
    assert coarse.view.depth.max() == np.float32(5.1)


def test_the_papers_hole_is_the_union_with_the_footprint() -> None:
    """Fig. 5: every pixel that the grown object's points reach is a hole of type OBJECT, also where background points show
    through when only the reduced cloud is asked (eq. 4 without the union)."""
    union = completed("paper", "telea", True, -14.0)
    reduced = remove(street(), MASK, yaw=-14.0, filler="telea", recipe=replace(RECIPES["paper"], footprint=False))
    footprint = ~render(Scene(union.scene.removals), union.view.camera, "points").hole
    shining = footprint & ~reduced.warped[0].hole
    assert shining.sum() > 20
    np.testing.assert_array_equal(union.warped[0].hole, reduced.warped[0].hole | footprint)
    np.testing.assert_array_equal(union.warped[0].hole_type[shining], HoleType.OBJECT)


def test_without_its_law_the_papers_depth_stands_as_the_filler_gave_it() -> None:
    """Law, and that it can fail: with `law` off nothing is moved, every depth is one of the 8-bit steps, and the law, asked
    afterwards, finds pixels that break it; with it on there are none."""
    loose = remove(street(), MASK, yaw=-14.0, filler="telea", recipe=replace(RECIPES["paper"], law=False))
    steps = loose.view.depth[loose.warped[0].hole] / (10 / 255)
    assert abs(steps - np.round(steps)).max() < 1e-3 and loose.meta["law_moves"] == 0
    held = completed("paper", "telea", True, -14.0)
    law = Law.of(Scene((held.source.without(dilate_mask(MASK, 3), HoleType.OBJECT),)))
    broken = [law.violations(one.view.camera, one.view.depth, one.warped[0].hole).sum() for one in (loose, held)]
    assert broken[0] > 20 and broken[1] == 0
