"""Matching and voting of patches (oracles: literal twins in numpy)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.inpainters.patchmatch import kernels
from dlama.inpainters.patchmatch.kernels import HALF
from dlama.inpainters.patchmatch.pyramid import Level, dilate_by_patch, whole_patches
from dlama.inpainters.patchmatch.search import NARROW, SHARP, SOFT, WIDE, Search

LEAN = np.array([3.0, 0.5, 7.0, 2000.0], np.float32)
RNG = np.random.default_rng(4)
HEIGHT, WIDTH = 22, 26
VALUES = RNG.uniform(0, 255, (HEIGHT, WIDTH, 5)).astype(np.float32)
HOLE = np.zeros((HEIGHT, WIDTH), np.bool_)
HOLE[0:6, 15:21] = True
TARGETS = np.argwhere(dilate_by_patch(HOLE)).astype(np.int32, order="C")
SOURCES = np.argwhere(whole_patches(HOLE)).astype(np.int32, order="C")
USED = RNG.uniform(0, 8, HOLE.shape).astype(np.float32)
LABEL = RNG.integers(0, 3, HOLE.shape).astype(np.int32)


def cost(row: int, column: int, source_row: int, source_column: int) -> float:
    """Mean over the patch's pixels in the picture of squared differences, and what distance, use and another surface cost."""
    steps = [
        ((VALUES[row + j, column + i].astype(float) - VALUES[source_row + j, source_column + i]) ** 2).sum()
        for j in range(-HALF, HALF + 1)
        for i in range(-HALF, HALF + 1)
        if 0 <= row + j < HEIGHT and 0 <= column + i < WIDTH
    ]
    far = 2000.0 * (LABEL[row, column] != LABEL[source_row, source_column])
    far += 3.0 * (row - source_row) ** 2 + 0.5 * (column - source_column) ** 2
    return (
        float(np.mean(steps)) + far + 7.0 * min(max(float(USED[source_row, source_column]) - 1, 0), kernels.MOST_USED)
    )


def test_costs_are_those_of_a_literal_twin() -> None:
    """Twin: of every seventh target with a random source, at the border too."""
    found = SOURCES[RNG.integers(0, len(SOURCES), len(TARGETS))]
    matches = kernels.Matches(found, np.zeros(len(TARGETS), np.float32))
    patches = kernels.Patches(VALUES, TARGETS, np.full(HOLE.shape, -1, np.int32), whole_patches(HOLE))
    kernels.cost_rows(0, len(TARGETS), patches, kernels.Penalties(LEAN, USED, LABEL), matches)
    expected = [cost(*target, *source) for target, source in zip(TARGETS[::7].tolist(), found[::7].tolist())]
    np.testing.assert_allclose(matches.cost[::7], expected, rtol=1e-5)


def test_one_lucky_patch_tells_the_others() -> None:
    """Truth: noise in which a block comes twice, no random steps, one patch of the one knows the other: all come to know it, and
    no round makes one worse."""
    values = RNG.uniform(0, 255, (60, 64, 5)).astype(np.float32)
    values[20:44, 34:58] = values[20:44, 4:28]
    hole = np.zeros((60, 64), np.bool_)
    hole[26:38, 40:52] = True
    targets, sources = (
        np.argwhere(which(hole)).astype(np.int32, order="C") for which in (dilate_by_patch, whole_patches)
    )
    number = np.full(hole.shape, -1, np.int32)
    number[targets[:, 0], targets[:, 1]] = np.arange(len(targets))
    found = sources[RNG.integers(0, len(sources), len(targets))]
    found[100] = targets[100] + (0, -30)
    free, used, random = np.zeros(4, np.float32), np.zeros(hole.shape, np.float32), RNG.uniform(-1, 1, (4096, 2))
    penalties = kernels.Penalties(free, used, np.zeros(hole.shape, np.int32))
    patches, costs = kernels.Patches(values, targets, number, whole_patches(hole)), np.empty(len(targets), np.float32)
    matches = kernels.Matches(found, costs)
    kernels.cost_rows(0, len(targets), patches, penalties, matches)
    for turn in range(30):
        before, now = costs.copy(), found.copy()
        steps = kernels.Steps(random, 977 * turn, 0.0)
        kernels.match_rows(0, len(targets), patches, penalties, steps, now, matches)
        assert (costs <= before).all()
    np.testing.assert_array_equal(found - targets, np.broadcast_to([0, -30], targets.shape))
    np.testing.assert_array_equal(costs, 0)


def searched() -> tuple[Search, np.ndarray]:
    """A search with random matches, costs and trust; and N mean costs about each patch."""
    search = Search(Level(VALUES.copy(), HOLE, whole_patches(HOLE), LABEL), np.random.default_rng(0), LEAN)
    search.found[:] = SOURCES[RNG.integers(0, len(SOURCES), len(TARGETS))]
    search.cost[:], search.trust[:] = RNG.uniform(1, 9, (2, len(TARGETS)))
    np.testing.assert_array_equal(search.targets, TARGETS)
    return search, np.array([search.cost[over(search, *target)[0]].mean() for target in TARGETS.tolist()])


def over(search: Search, row: int, column: int, times: int = 1) -> tuple[list[int], list[tuple[int, int]]]:
    """The patches that cover a pixel of a picture so many times larger, and where their centres lie next to it: of those at every
    second pixel where it is larger."""
    stride = min(times, 2)
    places = [(j, i) for j in range(-HALF, HALF + 1) for i in range(-HALF, HALF + 1)]
    places = [(j, i) for j, i in places if 0 <= row + j < times * HEIGHT and 0 <= column + i < times * WIDTH]
    places = [(j, i) for j, i in places if (row + j) % stride == (column + i) % stride == 0]
    number = [int(search.number[(row + j) // times, (column + i) // times]) for j, i in places]
    return [t for t in number if t >= 0], [place for place, t in zip(places, number) if t >= 0]


def test_votes_are_the_weighted_mean_of_a_literal_twin() -> None:
    """Twin: exp(-sharpness cost / 2 mean cost about the patch) times trust times a Gaussian, over all patches that cover the
    pixel, of described pixels."""
    search, mean = searched()
    search._paint()
    np.testing.assert_array_equal(search.values[~HOLE], VALUES[~HOLE])
    for row, column in np.argwhere(HOLE).tolist():
        patch, places = over(search, row, column)
        off = np.array([j * j + i * i for j, i in places])
        soft = np.exp(-SOFT * search.cost[patch] / (2 * mean[patch]) - off / (2 * WIDE**2)) * search.trust[patch]
        held = [VALUES[search.found[t, 0] - j, search.found[t, 1] - i] for t, (j, i) in zip(patch, places)]
        np.testing.assert_allclose(search.values[row, column], np.average(held, axis=0, weights=soft), rtol=2e-3)


@pytest.mark.parametrize("times", [1, 2, 4])
def test_a_picture_takes_the_patches_of_a_smaller_one(times: int) -> None:
    """Twin: sharper votes, of the picture's own pixels, each as far from the hole's as the match of the smaller picture says;
    unknown ones have no vote. The spread of the patches is numpy's."""
    search, mean = searched()
    hole = HOLE.repeat(times, 0).repeat(times, 1)
    hole[times * 14 : times * 14 + 3, : times * 8] = True
    picture = RNG.integers(0, 256, (*hole.shape, 3), np.uint8)
    out, spread = search.copy_patches(picture, hole, times)
    np.testing.assert_array_equal(out[~hole], picture[~hole])
    for pixel, (row, column) in enumerate(np.argwhere(hole).tolist()):
        seen, weights = [], []
        for t, (j, i) in zip(*over(search, row, column, times)):
            centre = np.array([row + j, column + i]) // times
            source = tuple((row, column) + (search.found[t] - centre) * times)
            if not hole[source]:
                seen.append(picture[source])
                weights.append(np.exp(-SHARP * search.cost[t] / (2 * mean[t]) - (j * j + i * i) / (2 * NARROW**2)))
        expected = np.average(seen, axis=0, weights=weights) if seen else picture[row, column]
        np.testing.assert_allclose(out[row, column], expected, atol=0.6)
        np.testing.assert_allclose(spread[pixel], np.sqrt(np.var(seen, 0).mean()) if seen else 0, rtol=1e-4, atol=1e-4)
