"""Which frames matter for a camera (oracles: closed-form worlds, the pixels that see a box)."""

from __future__ import annotations

import numpy as np
import pytest

import dlama
from dlama.geometry.camera import Camera
from dlama.geometry.frames.choosing import box_corners, count_unseen, find_box_in_view
from dlama.geometry.projection import world_points
from dlama.geometry.view import View
from worlds import Box, Plane, World, moved

LENS = Camera.from_fov(96, 72, 60)
WALL = World((Plane((0, 0, 4), (0, 0, -1)), Box((-0.4, -0.5, 2.4), (0.4, 0.5, 2.6))))


def test_the_frame_that_sees_most_of_what_no_frame_shows() -> None:
    """A box in front of a wall: alone no frame shows what is behind it; two cameras far to either side show all of it."""
    near, far = ([moved(LENS, (0, 0, 0), (x, 0, 0)) for x in places] for places in ((0, 0.02), (0, -1.4, 1.4)))
    counts = []
    for cameras in (near, far):
        frames = [WALL.rgbd(camera) for camera in cameras]
        masks = {place: frame.depth < 3 for place, frame in enumerate(frames)}
        scene = dlama.scene(frames).without(masks)
        counts.append([count_unseen(scene.frames, place)[0] for place in range(len(frames))])
    cells = 24 * 32 * (WALL.rgbd(LENS).depth < 3).mean()
    assert 0.8 * cells < counts[0][0] < 1.6 * cells and abs(counts[0][0] - counts[0][1]) < 0.3 * cells
    assert max(counts[1]) < 0.1 * cells


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.9, 0.3, 0.4), (-0.9, 0.0, 1.0)])
def test_where_a_box_is_in_view(place: tuple[float, float, float]) -> None:
    """Law: every pixel that shows a point of the box lies in it, and little else; behind the camera there is none."""
    low, high = np.array((-0.4, -0.5, 2.4)), np.array((0.4, 0.5, 2.6))
    camera, corners = moved(LENS, (0, 0, 0), place), box_corners(np.stack([low, high]))
    points = world_points(View.from_rgbd(WALL.rgbd(camera)))
    seen = ((points >= low - 1e-6) & (points <= high + 1e-6)).all(-1)
    box = find_box_in_view(corners, camera)
    assert box is not None and seen.any()
    assert not (np.delete(seen, np.r_[box[0]], 0).any() or np.delete(seen, np.r_[box[1]], 1).any())
    assert seen.sum() > 0.5 * seen[box].size
    assert find_box_in_view(corners, moved(LENS, (0, 180, 0), place)) is None
    within = find_box_in_view(corners, moved(LENS, (0, 0, 0), (0, 0, 2.5)))
    assert within == (slice(0, 72), slice(0, 96))  # the camera stands in the box
