"""Objects removed of a closed-form scene: the background behind them, the clouds with and without, the masks refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from small_street import BALL, MASK, completed, fillers, recipes, street

from dlama.completion.recipes import RECIPES
from dlama.completion.verbs import remove
from dlama.errors import MaskError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.holes import dilate_mask
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from whole_picture import counts


@fillers
@recipes
def test_the_background_lies_behind_what_was_removed(recipe: str, filler: str) -> None:
    """Law: at every pixel of the grown mask depth is not before the object's, and what was a hole says OBJECT."""
    done, frame = completed(recipe, filler, True, 0.0), street()
    taken = dilate_mask(MASK, 3)
    np.testing.assert_array_equal(done.warped[0].hole_type[taken], HoleType.OBJECT)
    np.testing.assert_array_equal(done.view.filled & ~frame.missing, taken & ~frame.missing)
    object_depth = np.minimum(frame.depth, RECIPES[recipe].clip or np.inf)
    assert (done.view.depth[taken] >= object_depth[taken] * (1 - 1.1e-3)).all()
    if filler == "layered":
        assert (done.view.depth[MASK] > 1.3 * frame.depth[MASK]).mean() > 0.98


@fillers
@recipes
def test_clouds_with_and_without_the_object(recipe: str, filler: str) -> None:
    """Closed form (eq. 10, 11): c+ holds every measured point and the finite filled ones; c- all but the grown object's."""
    done = completed(recipe, filler, True, 0.0)
    plus, minus = done.completed, done.background
    taken, valid = dilate_mask(MASK, 3), done.source.valid
    assert counts(plus.origin)[Origin.MEASURED] == valid.sum()
    assert counts(minus.origin)[Origin.MEASURED] == (valid & ~taken).sum()
    for kind in (Origin.FILLED, Origin.DEPTH_FILLED):
        finite = (done.view.origin == kind) & np.isfinite(done.view.depth)
        assert counts(plus.origin)[kind] == counts(minus.origin)[kind] == finite.sum()
    assert counts(plus.origin)[Origin.UNKNOWN] == counts(plus.origin)[Origin.REPROJECTED] == 0
    of_source = lift(done.source)
    kept = set(map(tuple, plus.points[plus.origin == Origin.MEASURED]))
    assert kept == set(map(tuple, of_source.points))
    assert (BALL.distance(plus.points) < 1e-3).sum() >= MASK.sum()
    assert not (BALL.distance(minus.points[minus.origin == Origin.MEASURED]) < 1e-3).any()


def test_depth_by_says_what_fills_depth() -> None:
    """Closed form: behind an object surfaces continue the plane of a slanted wall (1/z is linear), telea diffuses."""
    wall = (1 / (0.25 - 0.002 * np.arange(64)) + np.zeros((48, 1))).astype(np.float32)
    mask = np.zeros(wall.shape, np.bool_)
    mask[13:36, 19:43] = True
    rgbd = RGBD(np.full((*wall.shape, 3), 90, np.uint8), wall, Camera.from_fov(64, 48, 60))
    wrong = {
        word: np.abs(remove(rgbd, mask, filler="telea", depth_by=word, dilate=0).view.depth - wall).max()
        for word in ("surfaces", "filler")
    }
    assert wrong["surfaces"] < 0.02 < 3 * 0.02 < wrong["filler"]


@recipes
def test_masks_that_are_refused(recipe: str) -> None:
    """Message: a mask is checked (how: `check_mask`), and once more when it has grown by 3 px and is full only then."""
    for mask, message in (
        (np.zeros((96, 128), bool), "empty"),
        (~np.pad(np.ones((4, 4), bool), ((46, 46), (62, 62))), "full"),
    ):
        with pytest.raises(MaskError, match=message):
            remove(street(), mask, filler="telea", recipe=recipe)


def test_a_hole_comes_from_no_frame() -> None:
    """Law: what is removed from a view has the frame 0, "none"."""
    view = dataclasses.replace(View.from_rgbd(street()), frame=np.full(MASK.shape, 2, np.uint16))
    cut = view.without(MASK, HoleType.OBJECT)
    assert cut.frame is not None
    np.testing.assert_array_equal(cut.frame, np.where(MASK, 0, 2))
