"""Masks carried from one frame to others (oracles: the exact masks of generated worlds; the closed form of a tilted plane)."""

from __future__ import annotations

import numpy as np
import pytest

import dlama
from dlama.geometry.camera import Camera
from dlama.geometry.frames.foreground import find_foreground, grow_region
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.perception.object_removal import carry_masks
from dlama.worlds.dataset import world
from worlds import Box, Plane, World, moved

CAMERA = Camera.from_fov(128, 96, 60)
WALL = Plane((0, 0, 4), (0, 0, -1))


def carried(frames: list[RGBD], masks: dict[int, np.ndarray]) -> list[np.ndarray]:
    return list(carry_masks(dlama.scene(frames), masks))


def check_covers(mask: np.ndarray, true: np.ndarray, least: float = 0.95, most: float = 0.1) -> None:
    """The mask covers that share of the object at least, and of what is not the object less than `most` of its size."""
    assert (mask & true).sum() > least * true.sum()
    assert (mask & ~true).sum() < most * true.sum()


def two_views(seed: int) -> tuple[list[RGBD], list[np.ndarray]]:
    """Frames of a generated world, and the exact masks of its object."""
    made = world(seed)
    cameras = [made.camera(yaw, 128) for yaw in (0, -10)]
    return [made.frame(each) for each in cameras], [made.raycast(each).group == made.object_index for each in cameras]


@pytest.mark.parametrize(("seed", "most"), [(3, 0.3), (4, 0.1)], ids=["a bicycle seen from behind", "a stool"])
def test_a_mask_follows_the_object(seed: int, most: float) -> None:
    """Oracle: the exact mask."""
    frames, exact = two_views(seed)
    found = carried(frames, {0: exact[0]})
    np.testing.assert_array_equal(found[0], exact[0])
    check_covers(found[1], exact[1], most=most)


def test_a_mask_reaches_where_depth_is_missing() -> None:
    """A frame without depth on half of the object: the carried mask covers that half, too (oracle: the exact mask)."""
    (first, second), exact = two_views(4)
    lost = exact[1] & (np.arange(128) > np.median(np.nonzero(exact[1])[1]))
    holed = RGBD(second.color, np.where(lost, np.float32(0), second.depth), second.camera)
    found = carried([first, holed], {0: exact[0]})[1]
    assert (found & lost).sum() > 0.9 * lost.sum()
    check_covers(found, exact[1], least=0.9, most=0.15)


def test_one_mask_of_many_objects() -> None:
    """Three balls in one mask, all of them carried (oracle: the closed form of the balls' discs)."""
    v, u = np.mgrid[:96, :128]
    discs = [np.hypot(v - 48, u - column) < 11 for column in (20, 64, 108)]
    balls = np.logical_or.reduce(discs)
    color = np.where(balls[..., None], np.uint8([200, 40, 30]), np.uint8([90, 110, 100])).astype(np.uint8)
    depth = np.where(balls, 1.0, 3.0).astype(np.float32)
    found = carried([RGBD(one, depth, CAMERA) for one in (color, color + np.uint8(1))], {0: balls})[1]
    assert all((found & disc).sum() > 0.95 * disc.sum() for disc in discs)
    check_covers(found, balls)


def test_two_objects_masked_in_different_frames_are_both_carried() -> None:
    """Two boxes close to each other before a wall: neither keeps the other from being found, though the frame that
    masks the one shows the other unmasked (oracle: the closed form of the boxes)."""
    made = World((WALL, Box((-0.5, -0.3, 2.6), (-0.1, 0.3, 3)), Box((-0.02, -0.3, 2.7), (0.4, 0.3, 3.1))))
    cameras = [moved(CAMERA, (0, -yaw, 0), (yaw / 20, 0, 0)) for yaw in (0, 5, -5)]
    shapes = [made.trace(each)[1] for each in cameras]
    found = carried([made.rgbd(each) for each in cameras], {0: shapes[0] == 1, 1: shapes[1] == 2})
    for mask, shape in zip(found, shapes):
        check_covers(mask, shape > 0, least=0.97)


def test_a_part_that_the_masked_frame_does_not_show_is_carried() -> None:
    """A box a fifth of which another one hides in the masked frame: from aside all of it is found, and none of what hid it
    (oracle: the closed form of both)."""
    made = World((WALL, Box((-0.4, -0.3, 2.8), (0.4, 0.3, 3)), Box((0.15, -0.6, 1.9), (0.8, 0.6, 2))))
    camera = Camera.from_fov(160, 120, 60)
    cameras = [camera, moved(camera, (0, 0, 0), (-0.7, 0, 0))]
    shapes = [made.trace(each)[1] for each in cameras]
    found = carried([made.rgbd(each) for each in cameras], {0: shapes[0] == 1})[1]
    assert (found & (shapes[1] == 1)).sum() > 0.95 * (shapes[1] == 1).sum()
    assert (found & (shapes[1] == 2)).sum() < 0.05 * (shapes[1] == 2).sum()


def test_a_mask_that_the_border_cuts_continues_beyond_it() -> None:
    """A bar along a wall, of which the masked frame shows a part: in a frame that shows all of it the carried mask covers it, and
    not the wall (oracle: the closed form of the bar)."""
    made = World((WALL, Box((-0.6, -0.2, 2.9), (0.6, 0.2, 3.1))))
    cameras = [moved(CAMERA, (0, yaw, 0)) for yaw in (29, 0)]
    exact = [made.trace(each)[1] == 1 for each in cameras]
    assert exact[0][:, 0].any() and exact[0].sum() < 0.7 * exact[1].sum()
    check_covers(carried([made.rgbd(each) for each in cameras], {0: exact[0]})[1], exact[1])


def plane_with_a_post() -> tuple[RGBD, np.ndarray]:
    """A tilted plane, in inverse depth linear, and a post 3 px wide at 1.5 m before it; True at the post."""
    x, y = np.meshgrid(np.arange(60), np.arange(50))
    depth = (1 / (0.2 + 0.004 * y + 0.001 * x)).astype(np.float32)
    post = (np.abs(x - 30) <= 1) & (y >= 10) & (y < 40)
    depth[post] = 1.5
    return RGBD(np.zeros((50, 60, 3), np.uint8), depth, Camera.from_fov(60, 50, 60)), post


def test_a_post_stands_in_front_and_the_ground_does_not() -> None:
    """Of candidates on both only those of the post."""
    rgbd, post = plane_with_a_post()
    candidates = np.zeros_like(post)
    candidates[8:42, 24:37] = True
    np.testing.assert_array_equal(find_foreground(View.from_rgbd(rgbd), candidates), post)
    assert not find_foreground(View.from_rgbd(rgbd), np.zeros_like(post)).any()


def test_what_hides_a_part_is_no_background() -> None:
    """Closed form: the same next to a wall at 0.5 m, which hides what is left of the post: the post alone is in front."""
    rgbd, post = plane_with_a_post()
    depth = rgbd.depth.copy()
    depth[:, :29] = 0.5
    candidates = np.zeros_like(post)
    candidates[8:42, 29:37] = True
    found = find_foreground(View.from_rgbd(RGBD(rgbd.color, depth, rgbd.camera)), candidates)
    np.testing.assert_array_equal(found, post)


def test_growth_stops_at_another_depth() -> None:
    """From one pixel over the whole post, not onto what is allowed and lies elsewhere in depth or apart."""
    rgbd, post = plane_with_a_post()
    seeds = np.zeros_like(post)
    seeds[20, 30] = True
    far_away = np.zeros_like(post)
    far_away[20:30, 34:38] = True
    np.testing.assert_array_equal(grow_region(seeds, post | far_away, rgbd.depth), post)
