"""Outlines of masks whose depth lies next to the picture: closed-form worlds with shifted depth, known moves, a dense solve."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dlama import find_mask
from dlama.evaluation.metrics.masks import border_f, innermost_pixel, iou
from dlama.geometry.camera import Camera
from dlama.geometry.drawing.picture_edges import edge_misalignment
from dlama.geometry.kernels.relaxing import relax
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.kernels.outlines import color_odds
from dlama.perception.masks.outlines import CLINGS, PULL, Doubt, best_move, color_log_odds, random_walk, refine_outline
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(320, 240, 70)
THINGS = Box((-0.6, 0.0, 2.2), (0.2, 1.0, 2.8)), Box((0.6, 0.3, 2.6), (1.2, 1.0, 3.0))
WORLD = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1)), *THINGS))
BLUE, GREEN, GREY, BROWN = (60, 80, 150), (70, 130, 90), (150, 150, 150), (140, 110, 80)


def shifted(by: tuple[int, int]) -> tuple[RGBD, BoolArray]:
    """The picture with its depth moved by columns and rows against it, and the true pixels of the first object."""
    depth, shown = WORLD.trace(CAMERA)
    color = np.array([BROWN, GREY, BLUE, GREEN], np.uint8)[shown]
    noise = np.random.default_rng(0).normal(0, 3, color.shape)
    color = np.clip(cv2.GaussianBlur(color, (0, 0), 0.8) + noise, 0, 255).astype(np.uint8)
    rows, columns = np.clip(np.arange(240) - by[1], 0, 239), np.clip(np.arange(320) - by[0], 0, 319)
    return RGBD(color, depth[rows][:, columns].astype(np.float32), CAMERA), shown == 2


@pytest.mark.parametrize("by", [(4, 0), (-4, 2), (3, -3)])
def test_a_mask_follows_the_picture_where_depth_is_shifted(by: tuple[int, int]) -> None:
    """The truth is where the picture has the object; the mask of shifted depth alone is off by the shift."""
    rgbd, true = shifted(by)
    mask = find_mask(rgbd, clicks=[innermost_pixel(true)]).mask
    assert iou(mask, true) > 0.96
    assert border_f(mask, true) > 0.97


def test_depth_that_lies_on_the_picture_is_taken_as_it_is() -> None:
    rgbd, true = shifted((0, 0))
    assert edge_misalignment(rgbd.color, rgbd.depth, rgbd.valid, rgbd.far) == 0
    assert iou(find_mask(rgbd, clicks=[innermost_pixel(true)]).mask, true) > 0.98


@pytest.mark.parametrize("by", [(3, -2), (-4, 4), (0, 0)])
def test_the_move_of_a_disc_is_found(by: tuple[int, int]) -> None:
    """A dark disc on grey; its mask was moved by so many rows and columns."""
    disc = np.zeros((90, 100), np.uint8)
    cv2.circle(disc, (50, 45), 22, 1, -1)
    lab = np.zeros((90, 100, 3), np.float32)
    lab[..., 0] = np.where(disc, 30, 60)
    mask = np.roll(disc, by, (0, 1)) > 0
    assert best_move(lab, mask, 5) == (-by[0], -by[1])


def test_a_foot_that_depth_lost_is_found_by_its_colour() -> None:
    """A post whose lower 9 px the mask lacks; `unknown` says that depth cannot tell."""
    true, unknown = (np.zeros((90, 80), np.bool_) for _ in range(2))
    true[10:70, 25:55] = True
    unknown[61:73, 25:55] = True
    color = np.where(true[..., None], BLUE, BROWN).astype(np.uint8)
    mask = refine_outline(color, true & ~unknown, Doubt(1, unknown))
    assert iou(mask, true) > 0.97


def test_a_random_walk_is_what_its_equations_say() -> None:
    """Against the dense linear system of a random walker with priors, solved by NumPy."""
    rng = np.random.default_rng(1)
    hw = (7, 8)
    lab = rng.uniform(0, 60, (*hw, 3)).astype(np.float32)
    open_ = rng.random(hw) < 0.7
    inside = ~open_ & (rng.random(hw) < 0.5)
    odds = rng.normal(0, 2, hw).astype(np.float32)
    assert np.abs(random_walk(lab, open_, odds, inside) - dense_walk(lab, open_, odds, inside)).max() < 0.01


def dense_walk(lab: Float32Array, open_: BoolArray, odds: Float32Array, inside: BoolArray) -> np.ndarray:
    """The levels of open pixels by a dense solve; written out from the definition."""
    height, width = open_.shape
    pairs = [((r, c), (r, c + 1)) for r in range(height) for c in range(width - 1)]
    pairs += [((r, c), (r + 1, c)) for r in range(height - 1) for c in range(width)]
    steps = {pair: float(((lab[pair[0]] - lab[pair[1]]) ** 2).sum()) for pair in pairs}
    about = open_ | inside
    usual = 2 * np.mean([step for (_, second), step in steps.items() if about[second]])
    level = inside.astype(float)
    number = {pixel: n for n, pixel in enumerate(zip(*np.nonzero(open_)))}
    matrix, right = np.zeros((len(number),) * 2), np.zeros(len(number))
    for pixel, n in number.items():
        pull = PULL * abs(np.tanh(odds[pixel] / 2))
        matrix[n, n] += pull
        right[n] += pull / (1 + np.exp(-odds[pixel]))
    for (one, other), step in steps.items():
        hold = np.exp(-step / usual) + CLINGS
        for here, there in ((one, other), (other, one)):
            if here in number:
                matrix[number[here], number[here]] += hold
                if there in number:
                    matrix[number[here], number[there]] -= hold
                else:
                    right[number[here]] += hold * level[there]
    level[open_] = np.linalg.solve(matrix, right)
    return level


def test_odds_of_colours_are_parzen_windows() -> None:
    """Slow twin: every second pixel of the window about one, the kernel densities of either side."""
    rng = np.random.default_rng(2)
    hw = (24, 26)
    lab = rng.uniform(0, 20, (*hw, 3)).astype(np.float32)
    kind = rng.integers(0, 3, hw)
    odds = np.zeros(hw, np.float32)
    color_odds(0, hw[0], lab, kind == 0, kind == 1, kind == 2, 6, 5.0, 0.01, 4, odds)
    for row, column in [(10, 10), (3, 20), (23, 0)]:
        densities = []
        for side in (1, 2):
            near = [
                lab[r, c]
                for r in range(max(row - 6, 0), min(row + 7, hw[0]), 2)
                for c in range(max(column - 6, 0), min(column + 7, hw[1]), 2)
                if kind[r, c] == side
            ]
            away = ((np.array(near) - lab[row, column]) ** 2).sum(1)
            densities.append(np.exp(-away / (2 * 5.0**2)).mean() + 0.01)
        wanted = np.log(densities[0] / densities[1]) if kind[row, column] == 0 else 0.0
        assert odds[row, column] == pytest.approx(wanted, abs=1e-4)


def test_too_few_samples_say_nothing() -> None:
    lab = np.zeros((9, 9, 3), np.float32)
    open_ = np.zeros((9, 9), np.bool_)
    open_[4, 4] = True
    assert color_log_odds(lab, open_, np.zeros_like(open_), ~open_, 4)[4, 4] == 0


def test_a_sweep_changes_open_pixels_alone() -> None:
    holds = np.ones((5, 5), np.float32)
    level, open_ = np.zeros((5, 5), np.float32), np.zeros((5, 5), np.bool_)
    level[:, 0], open_[2, 2] = 1, True
    none = np.zeros((5, 5), np.float32)
    relax(holds, holds, open_, none, none, 1.0, level)
    assert level[:, 0].min() == 1
    assert (level[:, 1:] == 0).all()
