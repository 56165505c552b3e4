"""A matched pair with an object taken out: what matching gets wrong on and beside the object does not reach the background."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.completion.stereo import disparities as pairs
from dlama.completion.stereo.pair import OBJECT_REACH, largest_object_disparity
from dlama.completion.stereo.stereo import stereo
from dlama.geometry.camera import Camera, StereoRig
from worlds import Box, Plane, World, moved

CAMERA = Camera.from_fov(96, 72, 60)
RIG = StereoRig(CAMERA, moved(CAMERA, shift=(0.3, 0, 0)))
WALL, BOX = Plane((0, 0, 4), (0, 0, -1)), Box((-0.3, -0.4, 2), (0.3, 0.5, 2.2))


def disparity_of(world: World, camera: Camera) -> np.ndarray:
    """H x W px, exact."""
    return (CAMERA.fx * RIG.baseline_m / world.trace(camera)[0]).astype(np.float32)


def test_the_nearest_of_an_object_is_its_largest_disparity_around() -> None:
    """Twin: the largest of the mask within a disc of OBJECT_REACH px, pixel by pixel; 0 where the mask is farther away."""
    rng = np.random.default_rng(0)
    disparity = rng.uniform(1, 20, (40, 50)).astype(np.float32)
    mask = np.zeros(disparity.shape, bool)
    mask[12:20, 10:22] = rng.random((8, 12)) < 0.6
    got = largest_object_disparity(disparity, mask)
    rows, columns = np.nonzero(mask)
    for row, column in np.ndindex(disparity.shape):
        apart = np.hypot(rows - row, columns - column)
        surely, maybe = (disparity[rows, columns][apart <= OBJECT_REACH + margin] for margin in (-1, 1))
        assert surely.max(initial=0) <= got[row, column] <= maybe.max(initial=0)
    np.testing.assert_array_equal(largest_object_disparity(disparity, ~mask & mask), 0)


@pytest.mark.parametrize("filler", ["layered", "telea"])
def test_bad_matches_on_and_beside_the_object_do_not_reach_the_wall(
    filler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Closed form: a wall at 4 m behind a box. A patch of the box is matched at 8 m, and the box bleeds 6 px over its edge; the
    restored wall lies at 4 m all the same, in both views."""
    with_box = World((WALL, BOX))
    cameras = RIG.left, RIG.right
    masks = [with_box.trace(camera)[1] == 1 for camera in cameras]
    found = []
    for camera, mask in zip(cameras, masks):
        disparity = disparity_of(with_box, camera)
        bleeding = np.zeros_like(mask)
        for step in range(1, 7):
            bleeding |= np.roll(mask, step, 1)
        disparity[bleeding & ~mask] = disparity[mask].max()
        rows, columns = np.nonzero(mask)
        disparity[rows.min() + 4 : rows.min() + 9, columns.min() + 4 : columns.min() + 9] /= 4
        found.append(disparity)
    monkeypatch.setattr(pairs, "disparity_pair", lambda *_, **__: tuple(found))
    left, right = (with_box.rgbd(camera).color for camera in cameras)
    done = stereo(left, right, RIG, mask=masks[0], mask_right=masks[1], filler=filler)
    for view, mask in zip(done.views, masks):
        assert mask.sum() > 300
        np.testing.assert_allclose(view.depth[mask], 4, rtol=0.02)
    assert done.meta["law_violations"] == 0
