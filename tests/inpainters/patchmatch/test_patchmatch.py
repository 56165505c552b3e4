"""Holes painted with patches of the picture (oracles: patterns that continue, laws)."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest

from brick_walls import COLUMNS, ROWS, brick_wall
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.kernels import jit
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters import find_filler
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Painter, inpaint
from dlama.inpainters.patchmatch import search
from dlama.inpainters.patchmatch.completion import QUICK, complete_picture, times_smaller
from dlama.inpainters.patchmatch.pyramid import build_pyramid, describe_known, shrink
from dlama.inpainters.patchmatch.search import nearest_source

HOLE = (np.abs(ROWS - 50) < 14) & (np.abs(COLUMNS - 60) < 17)


def with_mean(picture: np.ndarray) -> np.ndarray:
    """The picture, in the hole its mean colour: nothing of the pattern."""
    return np.where(HOLE[..., None], picture[~HOLE].mean(0).astype(np.uint8), picture)


def test_a_pattern_continues_whatever_the_guess() -> None:
    """Truth: a wall whose pattern repeats; of a grey guess of it hardly a pixel is left wrong."""
    wall = brick_wall()
    done = complete_picture(with_mean(wall), HOLE)[0]
    np.testing.assert_array_equal(done[~HOLE], wall[~HOLE])
    wrong = np.abs(done.astype(int) - wall).max(-1)[HOLE]
    assert (wrong <= 12).mean() > 0.9


def test_the_structure_of_a_networks_guess_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: drawn to the guess, what is painted has the guess's large shapes, which it has not alone, in the picture's grain."""
    grain = np.random.default_rng(3).normal(0, 12, (96, 128, 1))
    light = (COLUMNS // 20 % 2)[..., None]
    picture = np.clip(np.where(light, 170, 90) + grain + np.zeros(3), 0, 255).astype(np.uint8)
    guess = np.where(HOLE[..., None], np.where((ROWS > 50)[..., None], 170, 90), picture).astype(np.uint8)
    off = {}
    for pull in (0, search.PULL):
        monkeypatch.setattr(search, "PULL", pull)
        done = complete_picture(guess, HOLE)[0].astype(np.float32)
        off[pull] = np.abs(cv2.blur(done - guess, (9, 9)))[HOLE].mean()
        assert 6 < (done - cv2.blur(done, (5, 5)))[HOLE].std() < 18
    assert off[search.PULL] < 0.7 * off[0]


def test_nothing_is_painted_that_the_picture_does_not_show() -> None:
    """Law: a guess full of red in a picture of blue above green leaves no red, and ground stays below."""
    picture = np.where((ROWS < 50)[..., None], np.uint8([40, 60, 200]), np.uint8([40, 160, 60])).astype(np.uint8)
    guess = np.where((HOLE & (np.abs(ROWS - 50) < 8))[..., None], np.uint8([250, 20, 20]), picture)
    done = complete_picture(guess, HOLE)[0]
    assert done[HOLE][:, 0].max() <= 41
    blue = done[..., 2] > done[..., 1]
    assert blue[HOLE & (ROWS < 42)].all() and not blue[HOLE & (ROWS > 58)].any()


def test_the_same_bits_with_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: bands do not depend on each other; another seed draws other patches."""
    noise = np.random.default_rng(3).integers(0, 256, (96, 128, 3), np.uint8)
    results = []
    for threads in (1, 3):
        monkeypatch.setattr(jit, "_most_threads", [threads])
        results.append(complete_picture(with_mean(noise), HOLE, seed=5)[0])
    np.testing.assert_array_equal(*results)
    assert (complete_picture(with_mean(noise), HOLE, seed=6)[0] != results[0]).any()


@pytest.mark.parametrize("own", [0, 1])
def test_of_two_surfaces_the_own_one_is_copied(own: int) -> None:
    """Law: between walls of 120 and 130 levels a guess of 125 becomes the level of the wall it is said to lie on."""
    left = COLUMNS < 60
    levels = np.array([120, 130], np.uint8)
    picture = np.repeat(levels[np.where(left, 0, 1)][..., None], 3, 2)
    label = np.where(HOLE, own, np.where(left, 0, 1))
    guess = np.where(HOLE[..., None], np.uint8(125), picture)
    done = complete_picture(guess, HOLE, label=label, effort=QUICK)[0]
    deep = (np.abs(ROWS - 50) < 10) & (np.abs(COLUMNS - 60) < 13)
    assert np.abs(done[deep].astype(int) - levels[own]).mean() < 2


@pytest.mark.parametrize("limit", ["largest", "hole"])
def test_a_large_picture_takes_the_matches_of_a_small_one(limit: str) -> None:
    """Truth: a wall whose pattern repeats, 4 times as large as the largest picture, or hole, that is matched; the guess is its
    mean. Every pixel of the hole is covered though only every second patch is copied."""
    wall, guess, hole = (each.repeat(4, 0).repeat(4, 1) for each in (brick_wall(), with_mean(brick_wall()), HOLE))
    most = {"largest": HOLE.size, "hole": int(HOLE.sum())}[limit]
    effort = dataclasses.replace(QUICK, **{limit: most})
    assert times_smaller(hole, effort) == 4
    done = complete_picture(guess, hole, effort=effort)[0]
    np.testing.assert_array_equal(done[~hole], wall[~hole])
    assert (np.abs(done[hole].astype(int) - wall[hole]).max(-1) <= 20).mean() > 0.8


@pytest.mark.parametrize("hole", [np.ones((40, 40), np.bool_), np.indices((40, 40))[1] % 5 == 0], ids=["all", "bars"])
def test_without_a_known_patch_the_guess_stays(hole: np.ndarray) -> None:
    """Law: where no patch is whole, there is nothing to paint with."""
    picture = np.random.default_rng(0).integers(0, 256, (40, 40, 3), np.uint8)
    np.testing.assert_array_equal(complete_picture(picture, hole)[0], picture)


@pytest.mark.parametrize("shape", [(1, 1), (5, 90), (33, 47)])
def test_pictures_of_any_size_are_filled(shape: tuple[int, int]) -> None:
    """Law: known pixels as they were."""
    picture = np.random.default_rng(0).integers(0, 256, (*shape, 3), np.uint8)
    hole = np.zeros(shape, np.bool_)
    hole[: shape[0] // 2 + 1, : shape[1] // 3 + 1] = True
    done = complete_picture(picture, hole)[0]
    np.testing.assert_array_equal(done[~hole], picture[~hole])
    assert done.shape == picture.shape and done.dtype == np.uint8


def test_coarser_pictures_are_means_of_what_is_known() -> None:
    """Closed form: a flat picture stays flat next to a hole at every size, and the guess fills the hole."""
    picture = np.where(HOLE[..., None], np.uint8(90), np.full(3, 50, np.uint8))
    levels = build_pyramid(picture, HOLE, ROWS.astype(np.int32))
    assert len(levels) > 1 and levels[0].values.shape[:2] == HOLE.shape
    for level in levels:
        assert (level.values[~level.hole][:, :3] < 52).all() and level.values[level.hole][:, :3].max() > 80
        assert not (level.sources & level.hole).any()
        assert level.label.shape == level.hole.shape and level.label[1, 0] == ROWS.shape[0] // level.hole.shape[0]


def test_a_smaller_picture_has_means_of_what_is_known() -> None:
    """Twin: numpy's means over blocks of 4 x 4 px, where half or more is known of known pixels, to two levels: sums and shares
    are rounded. The last row and column of blocks are those of the border repeated."""
    rng = np.random.default_rng(5)
    picture = rng.integers(0, 256, (37, 42, 3), np.uint8)
    hole = rng.random((37, 42)) < np.linspace(0, 1, 42)
    small, smaller, label = shrink(picture, hole, np.indices(hole.shape)[1], 4)
    colors, known = (np.pad(each, [(0, 3), (0, 2), (0, 0)], "edge") for each in (picture, ~hole[..., None]))
    blocks, shares = (each.reshape(10, 4, 11, 4, -1).swapaxes(1, 2) for each in (colors.astype(float), known))
    share = shares.mean((2, 3))
    np.testing.assert_array_equal(smaller, share[..., 0] < 0.5)
    means = np.where(share < 0.5, blocks.mean((2, 3)), (blocks * shares).mean((2, 3)) / np.maximum(share, 0.1))
    np.testing.assert_allclose(small, means, atol=2.2)
    np.testing.assert_array_equal(label[0], np.arange(0, 42, 4))
    np.testing.assert_array_equal(shrink(picture, hole, label, 1)[0], picture)


def test_texture_is_the_mean_change_between_known_neighbours() -> None:
    """Closed form: a ramp of 4 levels a column changes by 4 across and by 0 along."""
    ramp = np.repeat(4 * np.indices((20, 30))[1][..., None], 3, 2).astype(np.uint8)
    values = describe_known(ramp, np.ones((20, 30), np.bool_))
    np.testing.assert_array_equal(values[..., :3], ramp)
    texture = values[5:-5, 5:-5, 3:]
    np.testing.assert_allclose(texture, np.broadcast_to([8.0, 0.0], texture.shape), atol=1e-4)


def test_the_nearest_source_is_nearest() -> None:
    """Twin: of all distances the least; a place beyond the border counts as on it."""
    rng = np.random.default_rng(2)
    sources = rng.random((30, 40)) < 0.02
    places = rng.integers(-5, 50, (60, 2)).astype(np.int32)
    inside = np.clip(places, 0, (29, 39))
    apart = ((inside[:, None] - np.argwhere(sources)) ** 2).sum(-1)
    found = ((nearest_source(sources, places) - inside) ** 2).sum(-1)
    np.testing.assert_allclose(np.sqrt(found), np.sqrt(apart.min(1)), atol=1e-6)


def test_as_a_filler_it_continues_surfaces_and_says_what_ran() -> None:
    """Law: a Painter as others are; depth is that of the wall behind, and the notes name the network of the guess."""
    filler = find_filler("patchmatch")
    assert isinstance(filler, Painter)
    wall, camera = brick_wall(), Camera.from_fov(128, 96, 60)
    view = View.from_rgbd(RGBD(wall, np.full((96, 128), 3, np.float32), camera)).without(HOLE, HoleType.OBJECT)
    done, report = inpaint(view, filler, FillContext(Law(())))
    np.testing.assert_allclose(done.depth, 3, rtol=1e-3)
    assert "migan" in str(report.notes["guess"])
