"""Depth brought to its picture's size, pictures shrunk (oracles: a slow twin, planes, a step's true place; laws: no depth between
two surfaces, missing stays missing, far stays far)."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.perception.resampling import is_mixed, shrink_rgbd, upsample_depth
from reference.upsampling import upsample

RNG = np.random.default_rng(7)


def square_before_wall() -> tuple[np.ndarray, np.ndarray]:
    """(metres, colours) of a square of 1 m before a wall of 3 m, 192 x 256."""
    true = np.full((192, 256), 3, np.float32)
    true[61:130, 81:170] = 1
    return true, np.where(true[..., None] < 2, np.uint8(200), np.uint8(60)).repeat(3, 2)


def test_every_pixel_is_that_of_the_twin() -> None:
    """Twin: slanted ground, a box, sky and readings that are missing; colours at random."""
    rows = np.mgrid[0:10, 0:14][0]
    depth = (3 / (0.2 + 0.1 * rows)).astype(np.float32)
    depth[3:7, 4:9] = 1.2
    depth[:2, 9:] = np.inf
    depth[RNG.random(depth.shape) < 0.1] = 0
    color = RNG.integers(0, 256, (33, 47, 3), dtype=np.uint8)
    color = cv2.GaussianBlur(color, (0, 0), 2)
    small = cv2.resize(color, depth.shape[::-1], interpolation=cv2.INTER_AREA)
    kept = np.where(is_mixed(depth), 0, depth).astype(np.float32)
    np.testing.assert_allclose(upsample_depth(depth, color), upsample(kept, color, small), rtol=2e-5)


def test_a_plane_stays_a_plane() -> None:
    """Closed form: inverse depth of a plane is linear in the picture, whatever its colours, but for half a map pixel at the
    border, beyond which nothing is known."""
    rows, columns = np.mgrid[0:96, 0:128].astype(np.float32)
    true = 0.2 + 0.004 * (rows + 0.5) + 0.002 * (columns + 0.5)
    color = RNG.integers(0, 256, (96, 128, 3), dtype=np.uint8)
    small = true.reshape(12, 8, 16, 8).mean((1, 3))
    found = upsample_depth((1 / small).astype(np.float32), color)
    np.testing.assert_allclose(1 / found[4:-4, 4:-4], true[4:-4, 4:-4], rtol=1e-4)


def test_edges_are_those_of_the_picture() -> None:
    """Oracle: the true step. No pixel lies between its sides, and all within a map pixel of it take the side of their colour."""
    true, color = square_before_wall()
    np.testing.assert_allclose(upsample_depth(true[2::4, 2::4], color), true, rtol=1e-6)


def test_what_a_sensor_mixed_of_two_surfaces_is_no_depth() -> None:
    """Oracle: the share of each pixel that the square covers: mixed are those of which it covers a part, none of slanted ground,
    of a square without mixed pixels, or of a pole one pixel wide."""
    true, color = square_before_wall()
    clean = true[2::4, 2::4]
    blurred = cv2.resize(true, (64, 48), interpolation=cv2.INTER_AREA)
    np.testing.assert_array_equal(is_mixed(blurred), (blurred > 1) & (blurred < 3))
    assert is_mixed(blurred).sum() > 60
    found = upsample_depth(blurred, color)
    np.testing.assert_allclose(found[found > 0], true[found > 0], rtol=1e-6)
    pole = np.full((48, 64), 3, np.float32)
    pole[5:40, 30] = 1
    ground = (1 / (0.1 + 0.1 * np.arange(48, dtype=np.float32)))[:, None].repeat(64, 1)
    assert not any(is_mixed(each).any() for each in (clean, pole, ground))


def test_missing_stays_missing_and_far_far() -> None:
    """Law: what is nearest to a missing reading has none; next to sky nothing is farther than the surface it hides."""
    true, color = square_before_wall()
    small = true[2::4, 2::4].copy()
    small[:4, :6] = 0
    assert (upsample_depth(small, color) == 0).sum() == 16 * 24
    small = np.where(true[2::4, 2::4] == 3, np.float32(np.inf), np.float32(1))
    np.testing.assert_array_equal(upsample_depth(small, color), np.where(true == 3, np.inf, 1))


def test_maps_of_one_row_or_column() -> None:
    """Law: a map without neighbours is that value everywhere."""
    for shape in ((1, 1), (1, 5), (4, 1)):
        found = upsample_depth(np.full(shape, 2, np.float32), np.zeros((8, 10, 3), np.uint8))
        np.testing.assert_array_equal(found, np.full((8, 10), 2, np.float32))


def test_a_shrunk_picture_keeps_its_border_and_its_depths() -> None:
    """Law: a frame that shows nothing stays one, and every depth is one that was measured."""
    true, color = square_before_wall()
    padding = np.zeros(true.shape, np.bool_)
    padding[:16] = True
    found = shrink_rgbd(RGBD(color, true, Camera.from_fov(256, 192, 60), padding=padding), (64, 48))
    assert found.camera.wh == (64, 48) and found.camera.fx == Camera.from_fov(64, 48, 60).fx
    assert found.padding is not None and found.padding[:4].all() and not found.padding[4:].any()
    assert set(np.unique(found.depth)) == {0, 1, 3}
