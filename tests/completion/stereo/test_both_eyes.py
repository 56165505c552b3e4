"""Stereo: what one camera measured is used before anything is guessed. Closed-form worlds, matched exactly where both see."""

from __future__ import annotations

import dataclasses
import functools
import warnings
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

import dlama
from dlama.completion.completion import StereoCompletion
from dlama.completion.stereo import disparities as pairs
from dlama.completion.stereo.exchange import color_gain
from dlama.completion.stereo.pair import MatchedPair
from dlama.completion.stereo.stereo import stereo
from dlama.errors import InputError
from dlama.geometry.camera import Camera, StereoRig
from dlama.geometry.codes import LARGEST_CONFIDENCE, HoleType, Origin
from dlama.geometry.drawing.grid_mesh import find_joints
from dlama.geometry.holes import dilate_mask, iou
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.rendering import render
from dlama.perception.stereo.agreement import carry_mask, transfer_mask
from worlds import Box, Plane, World, moved

CAMERA = Camera.from_fov(160, 120, 60)
RIG = StereoRig(CAMERA, moved(CAMERA, shift=(0.4, 0, 0)))
CAMERAS = RIG.left, RIG.right
WALL, BOX = Plane((0, 0, 4), (0, 0, -1)), Box((-0.3, -0.4, 2), (0.3, 0.5, 2.2))
SCENE = World((WALL, BOX))
WITHOUT = World((WALL,))
CUT_OFF = World((WALL, Box((0.8, -0.4, 2), (1.5, 0.5, 2.2))))
"""The left picture's border cuts the box."""
BEHIND = World((WALL, Box((-0.3, -0.4, 2), (0.3, 0.5, 2.2)), Box((0.0, -0.6, 1.4), (0.16, 0.7, 1.5))))
"""A post hides more of the box from the left camera than from the right one."""


def matches(world: World) -> tuple[np.ndarray, np.ndarray]:
    """Both true disparities where the other camera sees the point, 0 elsewhere: what a perfect matcher could know."""
    found = []
    for camera, other in (CAMERAS, CAMERAS[::-1]):
        disparity = CAMERA.fx * RIG.baseline_m / world.trace(camera)[0]
        found.append(np.where(world.seen_by(other, camera), disparity, 0).astype(np.float32))
    return found[0], found[1]


def perfect(left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The matcher that knows them."""
    return matches(SCENE)


def pictures(brighter: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Left, and right as many times as bright."""
    left, right = (SCENE.rgbd(camera).color for camera in CAMERAS)
    return left, np.clip(np.rint(right * brighter), 0, 255).astype(np.uint8)


@functools.cache
def completed(removing: bool, brighter: float = 1.0, view: str | None = None) -> StereoCompletion:
    """One pair, shared by the tests that only look."""
    masks = [SCENE.trace(camera)[1] == 1 for camera in CAMERAS] if removing else [None, None]
    how = {"mask": masks[0], "mask_right": masks[1], "right_view": view, "matcher": perfect}
    return stereo(*pictures(brighter), RIG, **how)  # type: ignore[arg-type]


def test_what_one_camera_looks_past_has_not_the_depth_of_the_object_next_to_it() -> None:
    """Closed form: box and wall of one colour, and the box's disparity bleeds 3 px over its edges, so that colours lead from it
    into what one camera alone sees: that lies on the wall, 4 m away, for the other camera saw the wall past the box."""
    found = []
    for camera, disparity in zip(CAMERAS, matches(SCENE)):
        box = SCENE.trace(camera)[1] == 1
        found.append(np.where(dilate_mask(box, 3) & (disparity > 0), disparity[box].max(), disparity))
    grey = np.random.default_rng(0).integers(118, 123, (2, *CAMERA.hw, 3)).astype(np.uint8)
    done = stereo(*grey, RIG, matcher=lambda *_: tuple(found), filler="layered")
    for view, camera in zip(done.views, CAMERAS):
        alone = (view.origin == Origin.DEPTH_FILLED) & ~dilate_mask(SCENE.trace(camera)[1] == 1, 5)
        assert alone.sum() > 300
        assert (np.abs(view.depth[alone] - 4) < 0.1).mean() > 0.99


def test_without_a_mask_both_pictures_stay_and_get_depth() -> None:
    """Law: both given pictures bit for bit; closed form: the depth of what one camera sees alone is the wall's, 4 m."""
    done = completed(False)
    for view, picture, camera, other in zip(done.views, pictures(), CAMERAS, CAMERAS[::-1]):
        np.testing.assert_array_equal(view.color, picture)
        assert not view.hole.any() and set(np.unique(view.origin)) == {Origin.MEASURED, Origin.DEPTH_FILLED}
        alone = ~SCENE.seen_by(other, camera) & (SCENE.trace(camera)[1] == 0)
        assert alone.sum() > 500
        assert np.median(abs(view.depth[alone] - 4)) < 0.05
    assert done.meta["stereo"]["right"] == "given" and done.meta["hole_share"] == [0, 0]


def test_the_cloud_knows_what_either_camera_saw_and_nothing_twice() -> None:
    """Closed form: the cloud has the left picture's pixels and those of the right one that only the right camera sees, but for
    the rims; seen from either camera, the scene shows that camera's picture."""
    done = completed(False)
    alone = ~SCENE.seen_by(RIG.left, RIG.right)
    count = len(done.completed.points)
    assert CAMERA.width * CAMERA.height + 0.85 * alone.sum() < count < CAMERA.width * CAMERA.height + 1.05 * alone.sum()
    at_left, at_right = (render(done.scene, camera) for camera in CAMERAS)
    np.testing.assert_array_equal(at_left.color, pictures()[0])
    wrong = abs(at_right.color.astype(int) - pictures()[1]).max(-1) > 12
    assert wrong[alone].mean() < 0.12 and wrong.mean() < 0.05


def test_the_right_view_can_be_made_from_the_left() -> None:
    """Law: where the left camera sees nothing, it is filled (not the given right picture's pixels); the recipe paper does so by
    itself, and with a mask it cannot be asked for."""
    done = completed(False, view="synthesised")
    alone = ~SCENE.seen_by(RIG.left, RIG.right)
    assert (done.views[1].origin[alone] == Origin.FILLED).mean() > 0.8
    assert not (done.views[1].origin == Origin.MEASURED).any() and done.meta["stereo"]["right"] == "synthesised"
    papers = {"recipe": "paper", "filler": "telea", "matcher": perfect}
    assert stereo(*pictures(), RIG, **papers).meta["stereo"]["right"] == "synthesised"
    given = stereo(*pictures(), RIG, **papers, right_view="given")
    np.testing.assert_array_equal(given.views[1].color, pictures()[1])
    with pytest.raises(InputError, match=r"right_view is 'mine'; one of given, synthesised"):
        stereo(*pictures(), RIG, right_view="mine")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="right_view is 'synthesised' and a mask is given"):
        completed(True, view="synthesised")


@pytest.mark.parametrize("brighter", [1.0, 0.8])
def test_what_the_other_camera_sees_behind_a_removed_object_is_no_guess(brighter: float) -> None:
    """Closed form: where the other picture shows the wall behind the box, both views have the wall's colour and its 4 m, in the
    brightness of their own picture; only what neither camera sees is filled."""
    done = completed(True, brighter)
    masks = [before.hole_type == HoleType.OBJECT for before in done.warped]
    for number, (camera, other) in enumerate((CAMERAS, CAMERAS[::-1])):
        view, truth = done.views[number], WITHOUT.rgbd(camera).color * (brighter if number else 1.0)
        x = np.arange(camera.width) - (1, -1)[number] * round(CAMERA.fx * RIG.baseline_m / 4)
        shown = masks[number] & ((x >= 0) & (x < camera.width))
        shown &= ~masks[1 - number][:, np.clip(x, 0, camera.width - 1)]
        inner = shown & (view.origin != Origin.FILLED)
        assert shown.sum() > 300 and inner.sum() > 0.9 * shown.sum()
        assert abs(view.color.astype(int) - truth)[inner].mean() < 2
        np.testing.assert_allclose(view.depth[inner], 4, rtol=0.02)
        assert not view.hole.any()
        neither = masks[number] & ~shown & WITHOUT.seen_by(other, camera)
        assert (view.origin[neither] == Origin.FILLED).mean() > 0.6
    shares = done.meta["stereo"]["transferred_share"]
    assert all(0.2 < share < 1 for share in shares) and done.meta["law_violations"] == 0


@pytest.mark.parametrize("world", [CUT_OFF, BEHIND])
def test_a_carried_mask_holds_what_the_right_camera_alone_sees_of_the_object(world: World) -> None:
    """Closed form: the box in the right picture is known, and the part of it that the left camera does not see; that part is not
    where disparity moves the left mask. What stands before the box is no part of it."""
    left, right = (world.trace(camera)[1] == 1 for camera in CAMERAS)
    alone, before = right & ~world.seen_by(RIG.left, RIG.right), world.trace(RIG.right)[1] == 2
    assert alone.sum() > 0.1 * right.sum() and transfer_mask(left, matches(world)[0])[alone].mean() < 0.2
    carried = carry_mask(left, matches(world), world.rgbd(RIG.right))
    assert iou(carried, right) > 0.9 and carried[alone].mean() > 0.9 and carried[before].sum() <= 0.05 * before.sum()


def test_a_mask_of_what_the_right_camera_does_not_see_stays_empty_there() -> None:
    """Law: an object beyond the left border of the right picture has no mask there."""
    mask = np.zeros(CAMERA.hw, bool)
    mask[40:80, :5] = True
    at_left = np.where(mask, np.float32(20), matches(SCENE)[0])
    assert not carry_mask(mask, (at_left, matches(SCENE)[1]), SCENE.rgbd(RIG.right)).any()


def test_the_points_behind_a_removed_object_are_in_the_cloud() -> None:
    """Closed form: the background has the wall's points that only the right camera sees behind the box, as measured colours."""
    done = completed(True)
    right_only = done.scene.layers[1]
    assert right_only.camera.same_view_as(RIG.right)
    kept = right_only.valid & (right_only.origin != Origin.REPROJECTED)
    np.testing.assert_array_equal(right_only.color[kept], pictures()[1][kept])
    assert kept.sum() > 300
    assert abs(done.background.points[:, 2] - 4).max() < 0.2


def test_what_is_left_open_has_no_disparity() -> None:
    """Law: disparity is known where depth is; the pair without a least confidence is itself."""
    whole = completed(removing=True)
    assert whole.with_min_confidence(0) is whole
    done = whole.with_min_confidence(0.99)
    for view, disparity in zip(done.views, (done.disparity_left, done.disparity_right)):
        assert view.hole.any()
        np.testing.assert_array_equal(disparity != 0, view.valid)


def test_the_gain_of_two_exposures() -> None:
    """Closed form: a right picture 0.8 times as bright is brought back by 1.25, but for rounding; one alike by exactly 1."""
    for brighter in (0.8, 1.0):
        pair = MatchedPair(RIG, 1e9, pictures(brighter), matches(SCENE))
        np.testing.assert_allclose(color_gain(pair), 1 / brighter, rtol=0.02)
    assert (color_gain(pair) == 1).all()
    nothing = dataclasses.replace(pair, disparities=(np.zeros((120, 160), np.float32),) * 2)
    assert (color_gain(nothing) == 1).all()


def test_a_given_disparity_and_a_matcher() -> None:
    """Law: a function is asked once for both pictures; a given left disparity is taken as it is, and the right one follows from
    it; contradictions are refused."""
    at_left, at_right = matches(SCENE)
    asked: list[int] = []

    def mine(left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked.append(left.shape[1] + right.shape[1])
        return at_left, at_right

    by_function = stereo(*pictures(), RIG, matcher=mine)
    assert asked == [2 * CAMERA.width] and by_function.meta["stereo"]["matcher"] == "mine"
    given = stereo(*pictures(), RIG, disparity=at_left)
    for one, other in zip(by_function.views, given.views):
        known = one.origin == Origin.MEASURED
        assert (abs(one.depth - other.depth)[known] < 0.02 * one.depth[known]).mean() > 0.97
    np.testing.assert_array_equal(by_function.views[0].depth[at_left > 0], given.views[0].depth[at_left > 0])
    with pytest.raises(InputError, match="disparity and max_disparity contradict"):
        stereo(*pictures(), RIG, disparity=at_left, max_disparity=20)
    with pytest.raises(InputError, match="disparity has no known pixel"):
        stereo(*pictures(), RIG, disparity=0 * at_left)


def test_a_disparity_in_whole_numbers_is_refused() -> None:
    """Law: OpenCV's matchers give int16 sixteenths of a pixel; taken as pixels all was sixteen times too near."""
    sixteenths = np.round(16 * matches(SCENE)[0]).astype(np.int16)
    for given in ({"disparity": sixteenths}, {"matcher": lambda *_: (sixteenths, sixteenths)}):
        with pytest.raises(InputError, match=r" is int16; pixels as floating-point .*disparity / 16 of OpenCV"):
            stereo(*pictures(), RIG, **given)  # type: ignore[arg-type]


def test_a_matcher_is_held_to_what_is_expected_of_a_disparity() -> None:
    """Law: anything but two H x W arrays of numbers is an InputError (it was a TypeError, or rows taken as disparities), and what
    is not finite is unknown, as in `disparity`."""
    at_left, at_right = matches(SCENE)
    for found, message in (
        (None, "returned a NoneType; two"),
        (at_left, "returned a ndarray of 120; two"),
        ((at_left, at_right, at_left), "returned a tuple of 3; two"),
        ((at_left[::2], at_right), "is 160x60 and the pictures 160x120"),
        ((None, at_right), "is of type NoneType"),
    ):
        with pytest.raises(InputError, match=f"matcher {message}|what matcher returned {message}"):
            stereo(*pictures(), RIG, matcher=lambda *_, found=found: found)
    holes = np.where(at_left == 0, np.float32(np.nan), at_left)
    done = stereo(*pictures(), RIG, matcher=lambda *_: (holes.astype(np.float64), at_right), filler="telea")
    np.testing.assert_array_equal(done.source.depth == 0, at_left == 0)


def test_disparities_next_to_nothing_are_warned_of() -> None:
    """Law: f B / d; a unit of 1e-9 px puts all beyond the horizon, and nothing was said."""
    at_left = np.full(pictures()[0].shape[:2], 1e-9, np.float32)
    with pytest.warns(UserWarning, match="all of the pair is far: its disparities are next to nothing"):
        assert stereo(*pictures(), RIG, disparity=at_left, filler="telea").source.far.all()


def test_a_given_disparity_most_of_which_counts_as_infinity_is_warned_of() -> None:
    """Closed form: f B / 0.4 px lies beyond f B / 0.5 px, the default of `far`; with a `far` beyond it, it has that depth. Three
    quarters of a wall became sky without a word."""
    at_left = np.full(pictures()[0].shape[:2], 0.4, np.float32)
    at_left[::4] = 3
    metres = RIG.left.fx * RIG.baseline_m / 0.4
    with pytest.warns(UserWarning, match=rf"^75% of the pair is far: from {metres * 0.8:.3g} m on .*give `far`"):
        assert stereo(*pictures(), RIG, disparity=at_left, filler="telea").source.far.mean() == 0.75
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        depth = stereo(*pictures(), RIG, disparity=at_left, far=2 * metres, filler="telea").source.depth
    np.testing.assert_allclose(depth[1], metres, rtol=1e-6)


def test_the_paper_removes_the_object_and_obeys_the_range() -> None:
    """Law: c+ still has the object's points, c- does not; the filled pictures are matched by what the range was given for; a
    disparity of the unfilled ones cannot stand for it."""
    at_left, at_right = matches(SCENE)
    masks = [SCENE.trace(camera)[1] == 1 for camera in CAMERAS]
    calls: list[tuple[np.ndarray, np.ndarray]] = []

    def mine(left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        calls.append((left, right))
        return (at_left, at_right) if len(calls) == 1 else matches(WITHOUT)

    how = {"mask": masks[0], "mask_right": masks[1], "recipe": "paper", "filler": "telea"}
    done = stereo(*pictures(), RIG, matcher=mine, **how)
    assert len(calls) == 2 and (calls[1][0][~masks[0]] == pictures()[0][~masks[0]]).mean() > 0.9
    extra = len(done.completed.points) - len(done.background.points)
    assert (masks[0] & (at_left > 0)).sum() <= extra <= done.warped[0].hole.sum()
    nearest = done.completed.points[:, 2].min()
    assert abs(nearest - 2) < 0.05 and done.background.points[:, 2].min() > 3.5
    np.testing.assert_array_equal(done.source.color, pictures()[0])
    for view in done.views:
        filled = view.origin == Origin.FILLED
        assert filled.any() and view.confidence[filled].max() <= LARGEST_CONFIDENCE < 1
    with mock.patch.object(pairs, "disparity_pair", return_value=(at_left, at_right)) as matching:
        stereo(*pictures(), RIG, max_disparity=33, **how)
    assert [call.kwargs for call in matching.call_args_list] == [{"max_disparity": 33, "min_disparity": 0}] * 2
    with pytest.raises(InputError, match="disparity is given and the recipe 'paper'"):
        stereo(*pictures(), RIG, disparity=at_left, **how)


def test_pairs_that_are_none_are_noticed() -> None:
    """Law: one warning in one line, which meta.json keeps; identical pictures are an error."""
    left, right = (dlama.read_color(dlama.example() / name)[::2, ::2] for name in ("street.jpg", "right.jpg"))
    camera = Camera.from_fov(256, 256, 90)
    rig = StereoRig(camera, moved(camera, shift=(0.12, 0, 0)))
    with pytest.warns(UserWarning, match="swapped") as reported:
        done = stereo(right, left, rig, filler="telea", max_disparity=16)
    assert len(reported) == 1 and "\n" not in str(reported[0].message) and "swapped" in done.meta["stereo"]["doubt"]
    noise = np.random.default_rng(0).integers(0, 256, (2, *left.shape), np.uint8)
    lower = np.indices(left.shape)[0] > len(left) // 2
    with pytest.warns(UserWarning, match=r"\d\d% of the left picture finds no match") as reported:
        done = stereo(*np.where(lower, noise, [left, right]), rig, filler="telea", max_disparity=16)
    assert (
        len(reported) == 1
        and "no match" in done.meta["stereo"]["doubt"]
        and done.meta["stereo"]["unmatched_share"] > 0.35
    )
    with pytest.raises(InputError, match="identical"):
        stereo(left, left, rig)


def test_a_surface_of_a_matched_pair_is_whole(tmp_path: Path) -> None:
    """Oracle: closed form. Matches of a slanted plane cluster, with steps of a fifth of a pixel between; it is one surface, also
    in a scene that was saved."""
    rig = StereoRig(CAMERA, moved(CAMERA, shift=(0.06, 0, 0)))
    slant = World((Plane((0, 0, 4), (0, -0.7, -0.71)),))
    matched = np.round(rig.left.fx * rig.baseline_m / slant.trace(CAMERA)[0] / 0.2).astype(np.float32) * np.float32(0.2)
    left, right = (slant.rgbd(camera).color for camera in (rig.left, rig.right))
    done = stereo(left, right, rig, disparity=matched, filler="telea")
    dlama.write(done, tmp_path, only=["scene"])
    for scene in (done.scene, dlama.read_scene(tmp_path / "scene.npz")):
        flying, joined = find_joints(scene.frames[0].load())
        assert not flying.any() and (joined[:-1, :-1] == RIGHT + DOWN).all()
