"""dlama.complete of many frames (oracles: the closed-form street, laws of agreement and of one frame, the visibility law)."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from small_street import CAMERA, WORLD, street

import dlama
from dlama.completion.completion import Completion
from dlama.completion.start import scene_of
from dlama.errors import InputError
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.frames.gathering import drop_seen_depth
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from worlds import World

YAWS = (-14.0, -5.0, 5.0, 14.0)
CAMERAS = [orbit(CAMERA, yaw, 0.0, 3.0) for yaw in YAWS]
FRAMES = [street(camera) for camera in CAMERAS]
TARGET = orbit(CAMERA, 9.0, 0.0, 3.0)
MASKS = [WORLD.trace(camera)[1] == 3 for camera in CAMERAS]
EMPTY = World(WORLD.shapes[:3])


@functools.cache
def completed(count: int) -> Completion:
    """The street from between the frames, from so many of them."""
    return dlama.complete(FRAMES[:count], [TARGET])


@functools.cache
def removed() -> Completion:
    """The ball, masked in frame 1 alone, removed of all four frames."""
    return dlama.complete(FRAMES, CAMERAS, mask={1: MASKS[1]})


def test_more_frames_leave_less_to_fill() -> None:
    """The hole share falls by more than half from one frame to four, and what is left is filled under the law of all."""
    shares = [completed(count).meta["hole_share"][0] for count in (1, 2, 4)]
    assert shares[2] < 0.5 * shares[0] and shares[1] <= shares[0]
    done = completed(4)
    assert not done.view.hole.any() and done.meta["law_violations"] == 0
    assert done.meta["frames"]["numbers"] == [0, 1, 2, 3] and "frames" not in completed(1).meta
    law = Law.of(dlama.scene(FRAMES))
    assert not law.violations(TARGET, done.view.depth, done.view.filled).any()


def test_what_any_frame_saw_is_not_invented() -> None:
    """Depth of what was hidden from the first frame and seen by others is true (oracle: the street's own depth)."""
    truth = WORLD.trace(TARGET)[0]
    one, four = completed(1), completed(4)
    lent = one.warped[0].hole & ~four.warped[0].hole & np.isfinite(truth) & four.view.valid
    assert lent.mean() > 0.01
    assert np.median(np.abs(four.view.depth[lent] - truth[lent]) / truth[lent]) < 0.005


def test_depth_that_was_filled_stays_where_another_frame_has_a_hole() -> None:
    """Oracle: masks made for it; measured pixels stay in any case."""
    plain = View.from_rgbd(FRAMES[1])
    filled, unseen = np.zeros(plain.camera.hw, bool), np.zeros(plain.camera.hw, bool)
    filled[60:80, 10:30], unseen[60:80, 20:] = True, True
    filled &= plain.valid
    one = plain.with_planes(origin=np.where(filled, np.uint8(Origin.DEPTH_FILLED), plain.origin))
    other = plain.without(unseen, HoleType.NONE)
    left = drop_seen_depth(one, other)
    assert np.array_equal(left.hole, plain.hole | (filled & ~unseen)) and (filled & unseen).any()
    assert np.array_equal(left.depth[~filled], plain.depth[~filled])


@pytest.mark.slow
def test_removed_in_all_frames() -> None:
    """The ball is gone from every frame; where another frame saw behind it, that is what is shown (oracle: the empty street)."""
    done = removed()
    for number, (view, mask) in enumerate(zip(done.views, MASKS)):
        truth = EMPTY.trace(view.camera)[0]
        near = mask & np.isfinite(truth) & np.isfinite(view.depth)
        assert np.median(np.abs(view.depth[near] - truth[near]) / truth[near]) < 0.02
        elsewhere = mask & (view.origin == Origin.ELSEWHERE)
        assert elsewhere.any()
        assert view.frame is not None
        assert (view.frame[elsewhere] > 0).all() and number + 1 not in view.frame[elsewhere]
        outside = FRAMES[number].valid & (view.origin == Origin.MEASURED)
        np.testing.assert_array_equal(view.color[outside], FRAMES[number].color[outside])


def test_a_completed_scene_continues() -> None:
    """Law: completing the completed scene from the same camera fills nothing anew and gives the same view."""
    done = completed(4)
    again = dlama.complete(done.scene, [TARGET])
    assert again.meta["filled_pixels"] == 0
    np.testing.assert_allclose(again.view.depth, done.view.depth, rtol=2e-3)


def test_masks_that_fit_no_frame_are_refused() -> None:
    """One line each."""
    with pytest.raises(InputError, match=r"mask is for frame 7, which is not in the scene; it has frames 0, 1, 2, 3"):
        dlama.complete(FRAMES, [TARGET], mask={7: MASKS[0]})
    with pytest.raises(InputError, match="mask is one picture, and there are many frames"):
        dlama.complete(FRAMES, [TARGET], mask=MASKS[0])
    with pytest.raises(InputError, match=r"mask is empty; \{number of the frame: mask\} is expected"):
        dlama.complete(FRAMES, [TARGET], mask={})
    with pytest.raises(InputError, match="clip is 5 m: a scene cannot be clipped"):
        dlama.complete(dlama.scene(FRAMES), [TARGET], clip=5)


def test_frames_are_clipped_as_one_picture_is() -> None:
    """Oracle: `RGBD.clip_depth`, frame by frame, of frames in memory and of those that are read when they are needed."""
    frames = FRAMES[:2]
    for given in (frames, [functools.partial(lambda one: one, one) for one in frames]):
        for clip in (3.0, None):
            found = scene_of(given, clip).frames
            assert all(
                np.array_equal(one.load().depth, frame.clip_depth(clip).depth) for one, frame in zip(found, frames)
            )
    assert not np.array_equal(frames[0].clip_depth(3.0).depth, frames[0].depth)
