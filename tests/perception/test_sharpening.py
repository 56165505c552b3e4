"""Edges of blurred depth moved to the picture's (oracles: the step that was blurred, a slow median, laws)."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dlama.geometry.drawing.picture_edges import JUMP
from dlama.perception.kernels.joint_filters import MOST, joint_median
from dlama.perception.sharpening import LARGEST, sharpen_depth

RNG = np.random.default_rng(4)


def blurred_box(
    size: int = 256, texture: float = 4, blur: float = 3, seed: int = 4
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(colours, true inverse depth, blurred inverse depth) of a bright box before a dark wall; texture: levels of noise."""
    rng = np.random.default_rng(seed)
    inside = np.zeros((size, size), np.bool_)
    inside[size // 4 : -size // 4, size // 3 : -size // 3] = True
    color = np.where(inside[..., None], 170, 70) + rng.normal(0, texture, (size, size, 3))
    truth = np.where(inside, 0.8, 0.3).astype(np.float32)
    return np.clip(color, 0, 255).astype(np.uint8), truth, cv2.GaussianBlur(truth, (0, 0), blur)


def test_a_blurred_step_becomes_a_step_at_the_picture_s_edge() -> None:
    """Oracle: the step itself: of the pixels that the blur put between both depths nearly all are back, and on the right side."""
    color, truth, blurred = blurred_box()
    found = sharpen_depth(blurred, color)
    wrong = [(abs(one - truth) > 0.05).mean() for one in (blurred, found)]
    assert wrong[1] < 0.2 * wrong[0]


@pytest.mark.parametrize("seed", range(3))
def test_on_a_texture_hardly_a_pixel_is_torn_from_its_neighbours(seed: int) -> None:
    """Law: hardly any differs so much from all four that a view would tear it off; with votes by colour alone forty do."""
    color, _, blurred = blurred_box(texture=40, blur=6, seed=seed)
    found = sharpen_depth(blurred, color)
    next_to = np.stack([np.roll(found, by, axis) for by in (1, -1) for axis in (0, 1)])
    assert (np.abs(next_to / found - 1) > JUMP).all(0).sum() <= 3


def test_no_depth_is_invented() -> None:
    """Law: every value stood in the map before; what is far from edges stays."""
    color, _, blurred = blurred_box(128)
    found = sharpen_depth(blurred, color)
    assert np.isin(found, blurred).all() and (found != blurred).any()
    np.testing.assert_array_equal(found[:10], blurred[:10])


@pytest.mark.parametrize("size", [256, 2 * LARGEST])
def test_where_few_pixels_are_needed_they_are_those_of_all(size: int) -> None:
    """Twin: the whole map sharpened; far from the needed pixels the map stays as it is."""
    color, _, blurred = blurred_box(size, texture=40, blur=6)
    needed = np.zeros((size, size), np.bool_)
    needed[size // 4 - 20 : size // 4 + 30, size // 3 - 20 : size // 3 + 60] = True
    whole, found = sharpen_depth(blurred, color), sharpen_depth(blurred, color, where=needed)
    np.testing.assert_array_equal(found[needed], whole[needed])
    np.testing.assert_array_equal(found[size // 2 :], blurred[size // 2 :])
    assert (found != blurred).any() and (whole[size // 2 :] != blurred[size // 2 :]).any()


def test_slopes_and_flat_maps_stay() -> None:
    """Law: without a step there is nothing to move, whatever the picture shows; far pixels are no harm."""
    color = RNG.integers(0, 256, (128, 128, 3), np.uint8)
    slope = np.linspace(0.4, 0.9, 128, dtype=np.float32)[:, None] * np.ones((1, 128), np.float32)
    np.testing.assert_array_equal(sharpen_depth(slope, color), slope)
    sky = slope.copy()
    sky[:20] = np.inf
    assert np.isposinf(sharpen_depth(sky, color)).sum() > 0


def test_depth_and_inverse_depth_are_sharpened_alike() -> None:
    """Law: a median is the same of any falling function, and the same pixels vote."""
    color, _, blurred = blurred_box(128)
    both = sharpen_depth(blurred, color), 1 / sharpen_depth(1 / blurred, color, inverse=False)
    np.testing.assert_allclose(both[0], both[1], rtol=1e-5)


def test_the_kernel_is_a_weighted_median() -> None:
    """Oracle: a slow literal twin on random numbers."""
    values = RNG.random((30, 34), np.float32)
    votes, blurred = RNG.random((2, 30, 34)) > 0.4
    color = RNG.integers(0, 30, (30, 34, 3), np.uint8)
    out, room = np.empty_like(values), np.empty((30, 2, MOST), np.float32)
    alike = np.exp(-np.arange(3 * 30**2) / 392).astype(np.float32)
    step = np.arange(-6, 7, 2)
    near = np.exp(-(step[:, None] ** 2 + step**2) / 32).astype(np.float32)
    joint_median(0, 30, values, blurred, votes, color, 6, 2, alike, near, room, out)
    for row in range(30):
        for column in range(34):
            if not blurred[row, column]:
                assert out[row, column] == values[row, column]
                continue
            found = [
                (
                    values[y, x],
                    np.exp(
                        -((color[y, x].astype(float) - color[row, column]) ** 2).sum() / 392
                        - ((y - row) ** 2 + (x - column) ** 2) / 32
                    ),
                )
                for y in range(row - 6, row + 7, 2)
                for x in range(column - 6, column + 7, 2)
                if 0 <= y < 30 and 0 <= x < 34 and votes[y, x]
            ]
            found.sort(reverse=True)
            reached = np.cumsum([weight for _, weight in found])
            expected = found[int(np.searchsorted(reached, 0.5 * reached[-1]))][0] if found else values[row, column]
            assert out[row, column] == expected


def test_edges_of_a_large_picture_lie_where_its_colours_change() -> None:
    """Closed form: a step over 160 px of a picture four times LARGEST wide becomes one at the picture's edge, within 2 px."""
    width, edge = 4 * LARGEST, 4 * LARGEST // 2 + 7
    ramp = np.clip((np.arange(width) - edge) / 80, -1, 1)
    values = np.ascontiguousarray(np.broadcast_to(0.4 + 0.2 * ramp, (256, width)), np.float32)
    color = np.where(np.arange(width)[:, None] < edge, np.uint8(60), np.uint8(190)) * np.ones((256, 1, 3), np.uint8)
    found = sharpen_depth(values, color)
    apart = np.abs(np.arange(width) - edge) > 2
    np.testing.assert_allclose(found[:, apart & (np.arange(width) < edge)], 0.2, atol=0.01)
    np.testing.assert_allclose(found[:, apart & (np.arange(width) >= edge)], 0.6, atol=0.01)
