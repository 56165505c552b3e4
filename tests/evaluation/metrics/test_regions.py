"""Regions against worlds whose visibility is known: rectangles by hand, and rays traced from both cameras."""

from __future__ import annotations

import numpy as np
import pytest
from square_world import (
    BEHIND_SQUARE,
    DISOCCLUDED,
    OUT_OF_VIEW,
    SIZE,
    SOURCE,
    SQUARE_IN_SOURCE,
    SQUARE_IN_TARGET,
    TARGET,
    frame,
    rectangle,
)

from dlama.evaluation.metrics.regions import darkened_by_shadow, removal_regions, source_visibility, stereo_regions
from dlama.geometry.camera import Camera
from dlama.geometry.holes import dilate_mask
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.rgbd import RGBD
from worlds import Box, Plane, Sphere, World, moved

STREET = World((Plane((0, 1, 0), (0, 1, 0)), Box((-9, -0.6, 6), (9, 1, 7)), Sphere((0.2, 0.2, 2.2), 0.4)))


def expected(disoccluded: np.ndarray, outside: np.ndarray) -> dict[str, np.ndarray]:
    unseen = disoccluded | outside
    return {"seen": ~unseen, "unseen": unseen, "disoccluded": disoccluded, "out-of-view": outside}


def assert_regions(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> None:
    assert list(found) == list(wanted)
    for name, region in wanted.items():
        np.testing.assert_array_equal(found[name], region, err_msg=name)


def test_rectangles_by_hand() -> None:
    """Closed form: shifts of whole pixels make every region a rectangle; the object is no other occluder."""
    source = frame(SOURCE, SQUARE_IN_SOURCE)
    found = source_visibility(source, frame(TARGET, SQUARE_IN_TARGET))
    assert_regions(found.regions(), expected(DISOCCLUDED, OUT_OF_VIEW))
    bare = source_visibility(source, frame(TARGET, None), SQUARE_IN_SOURCE)
    np.testing.assert_array_equal(bare.hidden_by_object, BEHIND_SQUARE)
    assert not bare.disoccluded.any()
    regions = bare.regions(with_object=True)
    np.testing.assert_array_equal(regions["object"], BEHIND_SQUARE)
    np.testing.assert_array_equal(regions["unseen"], BEHIND_SQUARE | OUT_OF_VIEW)


@pytest.mark.parametrize("yaw", [-35.0, -12.0, 9.0, 30.0])
def test_traced_worlds(yaw: float) -> None:
    """Oracle: rays traced from the source to each target point. Only pixels next to a border of the truth may differ."""
    camera = Camera.from_fov(128, 96, 65)
    target = orbit(camera, yaw)
    found = source_visibility(STREET.rgbd(camera), STREET.rgbd(target))
    finite = np.isfinite(STREET.trace(target)[0])
    wanted = STREET.seen_by(camera, target)
    border = dilate_mask(wanted, 2) & dilate_mask(~wanted, 2)
    np.testing.assert_array_equal(found.seen[finite & ~border], wanted[finite & ~border])
    np.testing.assert_array_equal(found.unseen[finite & ~border], ~wanted[finite & ~border])
    assert (found.seen != wanted)[finite].mean() < 0.02
    assert not (found.seen & found.unseen).any() and (found.seen | found.unseen).all()


def test_grazing_ground_is_seen() -> None:
    """Closed form: nothing hides a bare plane, however flat it is looked at."""
    ground = World((Plane((0, 0.3, 0), (0, 1, 0)),))
    camera = Camera.from_fov(96, 72, 70)
    target = moved(camera, turn=(0, 5, 0), shift=(0.2, 0, -0.3))
    found = source_visibility(ground.rgbd(camera), ground.rgbd(target))
    below_horizon = ground.trace(target)[0] < 40  # the row that touches it lies between the last ground and nothing
    assert below_horizon.mean() > 0.4
    assert not found.disoccluded[below_horizon].any() and found.out_of_view.any()


def test_sky_goes_by_its_direction() -> None:
    """Closed form: turned in place nothing is disoccluded; behind a near square the sky is, when the camera moves."""
    sky = np.full((SIZE, SIZE), np.inf, np.float32)
    grey = np.full((SIZE, SIZE, 3), 90, np.uint8)
    found = source_visibility(RGBD(grey, sky, SOURCE), RGBD(grey, sky, moved(SOURCE, turn=(0, 10, 0))))
    assert not found.disoccluded.any() and 0 < found.out_of_view.mean() < 0.3
    depth = np.where(SQUARE_IN_SOURCE, np.float32(2), sky)
    found = source_visibility(RGBD(grey, depth, SOURCE), RGBD(grey, sky, TARGET))
    np.testing.assert_array_equal(found.disoccluded, SQUARE_IN_SOURCE)
    assert found.seen[~SQUARE_IN_SOURCE].all()


def test_without_depth_nothing_is_known() -> None:
    """Closed form: a sensor hole of the source, shifted by 8 px, and one of the target are in no region."""
    source, target = frame(SOURCE, None), frame(TARGET, None)
    holed = RGBD(source.color, source.depth * ~rectangle((20, 30), (5, 15)), SOURCE)
    blind = RGBD(target.color, target.depth * ~rectangle((40, 44), (50, 60)), TARGET)
    found = source_visibility(holed, blind)
    unknown = rectangle((12, 22), (5, 15)) | rectangle((40, 44), (50, 60))
    np.testing.assert_array_equal(~(found.seen | found.unseen), unknown)


def test_carried_colors() -> None:
    """Closed form: a source picture carried over is the target's where it is seen, and 0 elsewhere."""
    source, target = frame(SOURCE, SQUARE_IN_SOURCE), frame(TARGET, SQUARE_IN_TARGET)
    found = source_visibility(source, target)
    np.testing.assert_array_equal(found.warp_color(source.color), target.color * found.seen[..., None])


def test_stereo_regions_by_hand() -> None:
    """Closed form: the same rectangles, from both disparities and from the left one alone."""
    left = np.where(SQUARE_IN_SOURCE, 16, 8).astype(np.float32)
    right = np.where(SQUARE_IN_TARGET, 16, 8).astype(np.float32)
    assert_regions(stereo_regions(left, right), expected(DISOCCLUDED, OUT_OF_VIEW))
    assert_regions(stereo_regions(left), expected(DISOCCLUDED, OUT_OF_VIEW))


def test_stereo_regions_of_a_rig_with_doffs() -> None:
    """Closed form: at a disparity of -6 px the right camera sees 6 columns more on the left; they counted as seen."""
    disparity = np.full((SIZE, SIZE), -6, np.float32)
    for found in (stereo_regions(disparity, disparity), stereo_regions(disparity)):
        np.testing.assert_array_equal(found["out-of-view"], rectangle((0, 6), (0, SIZE)))
        np.testing.assert_array_equal(found["seen"], rectangle((6, SIZE), (0, SIZE)))
    disparity[:, :2] = 0
    assert stereo_regions(disparity)["out-of-view"].sum() == 6 * SIZE


def test_stereo_regions_with_unknown_disparity() -> None:
    """Closed form: n left pixels without disparity next to the edge leave n pixels at either end of the gap in doubt."""
    left = np.where(SQUARE_IN_SOURCE, 16, 8).astype(np.float32)
    left[16:48, 48:50] = 0
    found = stereo_regions(left)
    np.testing.assert_array_equal(found["disoccluded"], rectangle((34, 40), (16, 48)))
    doubt = rectangle((32, 34), (16, 48)) | rectangle((40, 42), (16, 48))
    np.testing.assert_array_equal(~(found["seen"] | found["unseen"]), doubt)
    left[:] = np.inf
    assert not any(region.any() for region in stereo_regions(left).values())


def test_removal_regions_share_the_picture() -> None:
    """Closed form: mask, ring and outside are a partition; the ring is a disc's reach; a shadow keeps off the mask."""
    mask = rectangle((30, 31), (30, 31))
    found = removal_regions(mask, rectangle((29, 33), (30, 31)), 5)
    assert sum(found[name].astype(int) for name in ("mask", "ring", "outside")).tolist() == np.ones((64, 64)).tolist()
    rows, columns = np.nonzero(found["ring"])
    assert np.hypot(rows - 30, columns - 30).max() <= 5.5
    assert found["shadow"].sum() == 3 and "shadow" not in removal_regions(mask, None, 5)


def test_darkened_pixels() -> None:
    """A fifth less light is a shadow, 6 % less is none; nothing under the mask or right next to it."""
    without = np.full((SIZE, SIZE, 3), 100, np.uint8)
    color = without.copy()
    color[10:30, 10:30] = 80
    color[35:55, 35:55] = 94
    found = darkened_by_shadow(color, without, rectangle((0, 9), (0, 9)))
    assert found[12:28, 12:28].all() and not found[33:].any() and not found[:10].any()
