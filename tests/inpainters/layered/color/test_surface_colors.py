"""Colours spread along surfaces: what a filled hole must look like where the answer is known, and what must never get into it."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.inpainters.layered.color.surface_colors import GREY, SKY_COLOR, spread_colors


def slanted_wall(size: int) -> np.ndarray:
    """H x W inverse depth (1/m) of a wall at 2.5 to 3.5 m."""
    return np.tile(np.linspace(0.29, 0.4, size, dtype=np.float32), (size, 1))


def border_and_gap(size: int) -> np.ndarray:
    """A hole: the right 38 % of the picture, and a gap further left."""
    hole = np.zeros((size, size), bool)
    hole[:, int(0.62 * size) :] = True
    hole[int(0.4 * size) : int(0.55 * size), int(0.1 * size) : int(0.3 * size)] = True
    return hole


@pytest.mark.parametrize("kind", [-1, 0, 1])
def test_constant_colour_stays_constant(kind):
    """Law: a surface of one colour is filled with exactly that colour."""
    hole = border_and_gap(160)
    color = np.where(hole[..., None], np.uint8(255), np.array([37, 141, 203], np.uint8))
    filled = spread_colors(color, hole, (kind != 0) * slanted_wall(160), np.full(hole.shape, kind, np.int8))
    assert (filled == [37, 141, 203]).all()


def occluded_scene(label_behind: int):
    """A red post 1.5 m ahead with anti-aliased edges, a blue-green wall behind it, and a hole on both sides of the post."""
    w = slanted_wall(192)
    color = np.random.default_rng(0).integers((0, 90, 80), (1, 170, 200), (*w.shape, 3), np.uint8)
    label, hole = np.full(w.shape, label_behind, np.int8), np.zeros(w.shape, bool)
    post, edge = np.s_[40:160, 80:100], np.s_[40:160, 79:101]
    color[edge], color[post] = (128, 60, 60), (255, 0, 0)
    w[post], label[post] = 1 / 1.5, 2
    hole[30:165, 101:125] = hole[60:120, 68:77] = True
    return np.where(hole[..., None], np.uint8(255), color), hole, w, label


@pytest.mark.parametrize("label_behind", [-1, 1])
def test_the_occluder_never_bleeds_in(label_behind):
    """Law: of a red post before a wall without red, and of its anti-aliased fringe, nothing enters the fill of the wall."""
    color, hole, w, label = occluded_scene(label_behind)
    filled = spread_colors(color, hole, w, label)
    assert filled[hole][:, 0].max() == 0
    assert filled[hole][:, 1].min() > 60


def test_a_rough_surface_takes_nothing_nearer_even_if_labels_agree():
    """Law: without planes (all labels -1) depth alone keeps a near red half out of a far blue hole."""
    w = np.full((96, 128), 0.2, np.float32)
    w[:, :64] = 0.5
    color = np.zeros((96, 128, 3), np.uint8)
    color[w > 0.3], color[w < 0.3] = (255, 0, 0), (0, 0, 200)
    hole = np.zeros(w.shape, bool)
    hole[:, 64:90] = True
    filled = spread_colors(color, hole, w, np.full(w.shape, -1, np.int8))
    assert (filled[hole] == (0, 0, 200)).all()


def random_scene(rng: np.random.Generator, shape: tuple[int, int]):
    """Anything of that size: noise, random holes, labels and depths."""
    label = rng.integers(-1, 3, shape).astype(np.int8)
    w = np.where(label == 0, 0, rng.uniform(0.01, 1, shape)).astype(np.float32)
    color = rng.integers(0, 256, (*shape, 3), dtype=np.uint8)
    return color, rng.random(shape) < 0.5, w, label


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (1, 300), (300, 1), (2, 2), (5, 400), (60, 90)])
def test_any_size_keeps_what_is_known(shape):
    """Law: known pixels come back bit-identical, twice the same, the input untouched, at every size."""
    color, hole, w, label = random_scene(np.random.default_rng(3), shape)
    before = color.copy()
    filled = spread_colors(color, hole, w, label)
    assert (color == before).all()
    assert (filled[~hole] == color[~hole]).all()
    np.testing.assert_array_equal(filled, spread_colors(color, hole, w, label))


def test_the_hole_s_content_does_not_matter():
    """Law: what stands in the hole before filling changes nothing."""
    hole, label, w = border_and_gap(160), np.ones((160, 160), np.int8), slanted_wall(160)
    truth, other = np.random.default_rng(1).integers(0, 256, (2, 160, 160, 3), np.uint8)
    noise = np.where(hole[..., None], other, truth)
    np.testing.assert_array_equal(spread_colors(truth, hole, w, label), spread_colors(noise, hole, w, label))


def test_nothing_known_is_grey_and_an_unseen_sky_is_pale():
    """Definition: GREY where nothing is known; SKY_COLOR where only sky is missing; grey where all that is known is nearer."""
    color, w = np.zeros((20, 20, 3), np.uint8), np.ones((20, 20), np.float32)
    label, hole = np.full((20, 20), -1, np.int8), np.ones((20, 20), bool)
    assert (spread_colors(color, hole, w, label) == GREY).all()
    hole[10:] = False
    w[:10] = 0.2
    assert (spread_colors(color, hole, w, label)[:10] == GREY).all()
    w[:10], label[:10] = 0, 0
    assert (spread_colors(color, hole, w, label)[:10] == SKY_COLOR).all()


@pytest.mark.parametrize("known_rows", [0, 6])
def test_sky_continues_what_the_view_shows_of_it(known_rows: int) -> None:
    """Definition: a sky of which this view shows some continues in that colour; of which it shows none, in the colour given."""
    label = np.zeros((48, 64), np.int8)
    label[40:] = 1
    hole = np.zeros((48, 64), bool)
    hole[: 40 - known_rows] = True
    color = np.where(label[..., None] == 0, np.uint8([138, 158, 188]), np.uint8(90))
    w = np.where(label, 0.2, 0).astype(np.float32)
    out = spread_colors(color, hole, w, label, sky=np.float32([150.4, 170, 200]))
    assert (out[hole] == ((138, 158, 188) if known_rows else (150, 170, 200))).all()


def test_what_lies_far_takes_no_colour_of_the_sky() -> None:
    """Law: a hole in a far lawn of no plane is green, though more sky than lawn lies behind it."""
    w = np.zeros((96, 128), np.float32)
    w[48:] = np.linspace(1 / 70, 1 / 30, 48)[:, None]
    hole = np.zeros(w.shape, bool)
    hole[50:56, 40:48], w[50:56, 40:48] = True, 1 / 65
    color = np.where(w[..., None] > 0, np.array([60, 120, 40], np.uint8), np.array([230, 230, 240], np.uint8))
    filled = spread_colors(color, hole, w, np.where(w > 0, -1, 0).astype(np.int8))
    assert (filled[hole] == (60, 120, 40)).all()


def test_sky_between_leaves_does_not_tell_its_colour() -> None:
    """Law: where a view shows its sky only in single pixels between leaves, mixed with them, the scene's colour is taken."""
    w, leaf = np.zeros((96, 128), np.float32), np.zeros((96, 128), bool)
    leaf[::2, :64] = leaf[:, :64:2] = True
    w[leaf] = 0.2
    color = np.where(leaf[..., None], np.array([30, 90, 20], np.uint8), np.array([70, 110, 90], np.uint8))
    hole = np.indices(w.shape)[1] >= 64
    filled = spread_colors(color, hole, w, np.where(leaf, -1, 0).astype(np.int8), sky=np.array([105.0, 128, 157]))
    assert (filled[hole] == (105, 128, 157)).all()


def test_a_plane_that_is_nowhere_seen_takes_what_lies_at_its_depth():
    """Definition: a hole labelled with a plane that has no known pixel is coloured by the known at like depth."""
    w, label = np.full((64, 64), 0.25, np.float32), np.ones((64, 64), np.int8)
    hole = np.zeros((64, 64), bool)
    hole[:, 40:] = True
    label[hole] = 9
    color = np.full((64, 64, 3), (10, 90, 30), np.uint8)
    assert (spread_colors(color, hole, w, label) == (10, 90, 30)).all()
