"""Stereo's options and its calibration: far limit, doffs, masks of either picture (closed forms); and a removal from a matched
pair: what matching gets wrong on and next to the object does not reach the background."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import dlama
from dlama.completion.completion import StereoCompletion
from dlama.completion.stereo.disparities import match_pair
from dlama.completion.stereo.pair import MatchedPair, default_far, depth_in_metres
from dlama.completion.stereo.stereo import stereo
from dlama.errors import DepthError, InputError
from dlama.files.rasters.depth import read_disparity, write_disparity_pfm
from dlama.geometry.camera import Camera, StereoRig
from dlama.geometry.codes import HoleType
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import RGBD
from worlds import Box, Plane, World, moved

CAMERA = Camera(60, 40, 100, 100, 30, 20)
DOFFS = 30.0


def rig(doffs: float = 0.0) -> StereoRig:
    """f b = 20: a disparity of d px is 20 / (d + doffs) metres."""
    other = Camera(60, 40, 100, 100, 30 + doffs, 20)
    return StereoRig(CAMERA, other.at(moved(CAMERA, shift=(0.2, 0, 0)).world_from_cam))


def square(rows: tuple[int, int], columns: tuple[int, int]) -> np.ndarray:
    """H x W bool, True in the rows and columns [from, to)."""
    mask = np.zeros(CAMERA.hw, bool)
    mask[slice(*rows), slice(*columns)] = True
    return mask


THING = square((15, 25), (30, 40))


def test_what_half_a_pixel_cannot_tell_from_infinity_is_far() -> None:
    """Closed form: 40 m by default, whatever the calibration's doffs; `far` itself is far."""
    disparity = np.array([[0.49, 0.51, 1.9, 2.1, 0]], np.float32)
    for doffs in (0.0, DOFFS):
        about = rig(doffs)
        assert default_far(about) == pytest.approx(40)
        shifted = np.where(disparity == 0, np.float32(0), disparity - np.float32(doffs))
        np.testing.assert_allclose(
            depth_in_metres(shifted, about, default_far(about))[0],
            [np.inf, 20 / 0.51, 20 / 1.9, 20 / 2.1, 0],
            rtol=1e-4,
        )
        np.testing.assert_allclose(
            depth_in_metres(shifted, about, 10.0)[0], [np.inf, np.inf, np.inf, 20 / 2.1, 0], rtol=1e-4
        )


def pair_of(doffs: float, item: float, next_to: float) -> MatchedPair:
    """An object before a wall, and right of it a strip; each at its distance to infinity (disparity + doffs, px)."""
    disparity = np.full(CAMERA.hw, 2 - doffs, np.float32)
    disparity[15:25, 30:40], disparity[15:25, 40:44] = item - doffs, next_to - doffs
    grey = np.zeros((*CAMERA.hw, 3), np.uint8)
    return MatchedPair(rig(doffs), 40.0, (grey, grey), (disparity, disparity), (THING, THING))


@pytest.mark.parametrize("doffs", [0.0, DOFFS, -DOFFS])
def test_bleeding_is_measured_from_infinity(doffs: float) -> None:
    """Closed form: next to an object at 20 px, what is 17.1 px from infinity bled (85 %), 16.9 px did not, whatever disparity
    infinity has; the object's own depth is 1 m."""
    for next_to, missing in ((17.1, True), (16.9, False)):
        pair = pair_of(doffs, 20, next_to)
        for cleaned in pair.without_bleeding().disparities:
            assert (cleaned[18:22, 40:42] == 0).all() == missing
            np.testing.assert_array_equal(cleaned[THING], 20 - doffs)
            np.testing.assert_array_equal(cleaned[:, :20], 2 - doffs)
        depth = pair.object_depth
        assert depth is not None
        np.testing.assert_allclose(depth[THING], 1, rtol=1e-5)


def completed(**options: Any) -> StereoCompletion:
    """A flat wall 5 m away (4 px), matched perfectly."""
    wall = np.full(CAMERA.hw, 4, np.float32)
    wall[:4] = 8
    texture = np.random.default_rng(0).integers(0, 256, (40, 80, 3), np.uint8)
    return stereo(
        texture[:, :60], texture[:, 4:64], rig(), matcher=lambda *_: (wall, wall), filler="telea", dilate=1, **options
    )


@pytest.mark.parametrize("far", [None, 4.0])
def test_far_is_where_it_is_put(far: float | None) -> None:
    """Closed form: the wall at 5 m, below 4 rows at 2.5 m, is a wall by default, and sky where far begins at 4 m."""
    done = completed(far=far)
    assert done.source.far[4:].all() == (far is not None) and not done.source.far[:4].any()
    assert np.isinf(done.views[0].depth[8:]).all() == (far is not None)


@pytest.mark.parametrize("given", [True, False])
def test_the_object_leaves_the_right_view_where_its_mask_is(given: bool) -> None:
    """Closed form: the right view's hole is the mask of the right picture, or the left one 4 px further left, dilated by 1 px."""
    own = square((10, 20), (5, 15)) if given else None
    done = completed(mask=THING, mask_right=own)
    expected = own if own is not None else square((15, 25), (26, 36))
    for before, mask in zip(done.warped, (THING, expected)):
        np.testing.assert_array_equal(before.hole_type == HoleType.OBJECT, dilate_mask(mask, 1))


def test_an_inverted_mask_of_a_pair_is_warned_of() -> None:
    """The mask of all but the object (oracle: the message that `remove` gives)."""
    with pytest.warns(UserWarning, match=r"the mask removes 96 % of the picture.*`mask_polarity` turns it round"):
        completed(mask=~THING)


def test_a_mask_may_be_found_in_the_matched_depth() -> None:
    """A function as mask sees the left picture with its depth; the result is that of the mask it gives."""
    seen = []

    def find(left: RGBD) -> np.ndarray:
        seen.append(left)
        return THING

    texture = np.random.default_rng(0).integers(0, 256, (40, 70, 3)).astype(np.uint8)
    left, right = texture[:, :60], texture[:, 4:64]
    options: dict[str, Any] = {"filler": "telea", "dilate": 1, "max_disparity": 8}
    found = stereo(left, right, rig(), mask=find, **options)
    given = stereo(left, right, rig(), mask=THING, **options)
    np.testing.assert_array_equal(found.views[0].color, given.views[0].color)
    (source,) = seen
    np.testing.assert_allclose(np.median(source.depth[source.valid]), 5.0, rtol=0.05)


def test_a_pair_without_contrast_is_refused_before_it_is_matched() -> None:
    """Two black pictures, or one (oracle: the message names which); a disparity that is given needs no contrast."""
    black = np.zeros((*CAMERA.hw, 3), np.uint8)
    known = np.random.default_rng(0).integers(0, 256, (*CAMERA.hw, 3), dtype=np.uint8)

    def matcher(left: np.ndarray, right: np.ndarray) -> Any:
        raise AssertionError("was matched")

    for pair, name in (((black, black), "left"), ((known, black), "right")):
        with pytest.raises(InputError, match=f"the {name} picture has nearly one colour .* nothing to match"):
            stereo(*pair, rig(), matcher=matcher)
    with pytest.raises(InputError, match="identical"):
        stereo(known, known, rig(), matcher=matcher)


def test_a_far_limit_nearer_than_everything_is_refused() -> None:
    """As of a depth file (oracle: the nearest depth of that disparity)."""
    picture = np.random.default_rng(0).integers(0, 256, (*CAMERA.hw, 3), dtype=np.uint8)
    disparity = np.full(CAMERA.hw, 4, np.float32)
    with pytest.raises(DepthError, match=r"no depth is nearer than far, 1e-09 m; the scene has "):
        stereo(picture, picture[:, ::-1].copy(), rig(), disparity=disparity, far=1e-9)


@pytest.mark.parametrize("filler", ["layered", "telea"])
def test_bad_matches_on_and_next_to_the_object_do_not_reach_the_wall(filler: str) -> None:
    """Closed form: a wall at 4 m behind a box. A patch of the box is matched at 8 m, and the box bleeds 6 px over its edge; the
    restored wall lies at 4 m all the same, in both views."""
    with_box = World((Plane((0, 0, 4), (0, 0, -1)), Box((-0.3, -0.4, 2), (0.3, 0.5, 2.2))))
    camera = Camera.from_fov(96, 72, 60)
    wide = StereoRig(camera, moved(camera, shift=(0.3, 0, 0)))
    cameras = wide.left, wide.right
    masks = [with_box.trace(camera)[1] == 1 for camera in cameras]
    found = []
    for camera, mask in zip(cameras, masks):
        disparity = (camera.fx * wide.baseline_m / with_box.trace(camera)[0]).astype(np.float32)
        bleeding = np.zeros_like(mask)
        for step in range(1, 7):
            bleeding |= np.roll(mask, step, 1)
        disparity[bleeding & ~mask] = disparity[mask].max()
        rows, columns = np.nonzero(mask)
        disparity[rows.min() + 4 : rows.min() + 9, columns.min() + 4 : columns.min() + 9] /= 4
        found.append(disparity)
    left, right = (with_box.rgbd(camera).color for camera in cameras)
    done = stereo(left, right, wide, mask=masks[0], mask_right=masks[1], matcher=lambda *_: found, filler=filler)
    for view, mask in zip(done.views, masks):
        assert mask.sum() > 300
        np.testing.assert_allclose(view.depth[mask], 4, rtol=0.02)
    assert done.meta["law_violations"] == 0


def test_a_pair_cropped_apart_has_the_depth_of_the_whole_one(tmp_path: Path) -> None:
    """Closed form: without the left columns of the left picture and the right ones of the right one every disparity is smaller
    by their number, which doffs says, and negative where the scene is far; depth stays, and so does the doubt (none). Round trip:
    the disparity that is written gives this depth again; numbers below 0 were refused."""
    folder = dlama.example()
    pictures = [
        cv2.resize(dlama.read_color(folder / name), (256, 256), interpolation=cv2.INTER_AREA)
        for name in ("street.jpg", "right.jpg")
    ]
    calib = dlama.read_stereo_calib(folder / "calib.txt")
    whole_rig = StereoRig(calib.left.resized(256, 256), calib.right.resized(256, 256))
    cut = 8
    cut_rig = StereoRig(whole_rig.left.cropped(cut, 0, 256 - cut, 256), whole_rig.right.cropped(0, 0, 256 - cut, 256))
    assert cut_rig.doffs == cut
    options: dict[str, Any] = {"disparity": None, "matcher": None, "max_disparity": None}
    whole = match_pair((pictures[0], pictures[1]), whole_rig, None, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # swapped, for one
        parts = match_pair((pictures[0][:, cut:], pictures[1][:, :-cut]), cut_rig, None, **options)
    expected, found = whole.left.depth[:, cut:], parts.left.depth
    both = (expected > 0) & (expected < np.inf) & (found > 0) & (found < np.inf)
    assert both.mean() > 0.9 * ((expected > 0) & (expected < np.inf)).mean()
    assert (np.abs(found[both] / expected[both] - 1) < 0.03).mean() > 0.95
    write_disparity_pfm(tmp_path / "disparity.pfm", parts.disparities[0])
    assert parts.disparities[0].min() < 0
    options["disparity"] = read_disparity(tmp_path / "disparity.pfm")
    again = match_pair((pictures[0][:, cut:], pictures[1][:, :-cut]), cut_rig, None, **options)
    np.testing.assert_array_equal(again.left.depth, found)


def test_the_code_of_a_matcher_for_unknown_is_no_match() -> None:
    """Oracle: OpenCV's matchers, which write one less than their least disparity where they find nothing. It counted
    as matched."""
    picture = np.random.default_rng(0).integers(0, 255, (40, 60, 3), np.uint8)
    left, right = picture, np.roll(picture, -9, 1)
    disparity = np.full(CAMERA.hw, 9, np.float32)
    disparity[:10] = -1
    for doffs in (0.0, DOFFS):
        pair = match_pair(
            (left, right),
            rig(doffs),
            None,
            disparity=None,
            matcher=lambda *_: (disparity, disparity),
            max_disparity=None,
        )
        assert pair.notes["unmatched_share"] == 0.25
        np.testing.assert_allclose(pair.left.depth, np.where(disparity < 0, 0, 20 / (9 + doffs)), rtol=1e-6)
    with pytest.raises(InputError, match="no known pixel in front of the cameras; the left x minus the right x"):
        match_pair((left, right), rig(), None, disparity=-abs(disparity), matcher=None, max_disparity=None)
