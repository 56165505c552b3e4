"""A picture with a hole and a coarse guess of it in; the hole painted with patches of the picture out.

After Wexler, Shechtman & Irani, "Space-time completion of video" (2007), with the matching of Barnes et al., "PatchMatch"
(2009), and the texture channels of Newson et al., "Video inpainting of complex scenes" (2014). From the coarsest level to the
finest, every patch that touches the hole is matched to the most similar known patch, and the hole's pixels become a weighted
vote of the matches. Patches near by, above all at the same height, are preferred, so that ground stays below walls and joints
keep their scale. Frequently used ones are penalised, so that no small piece is repeated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.patchmatch.pyramid import build_pyramid, shrink
from dlama.inpainters.patchmatch.search import Search


@dataclass(frozen=True)
class Effort:
    """Limits of the search."""

    rounds: int
    """Rounds of matching and voting per level,"""
    updates: int
    """and most patches matched in all of them, where the hole is large."""
    matchings: int
    """Steps of PatchMatch per round."""
    largest: int
    """Pixels of the largest picture that patches are matched in,"""
    hole: int
    """and of its hole; a larger one takes the matches of itself made smaller."""


THOROUGH = Effort(6, 400_000, 2, 3_000_000, 30_000)
QUICK = Effort(4, 100_000, 1, 800_000, 20_000)
"""Over surfaces of known depth."""


def complete_picture(
    picture: UInt8Array,
    hole: BoolArray,
    seed: int = 0,
    *,
    label: NDArray[np.integer] | None = None,
    effort: Effort = THOROUGH,
) -> tuple[UInt8Array, Float32Array]:
    """H x W x 3, the picture with its hole painted from known patches; known pixels as they are. And M, by how many levels the
    patches over each of the hole's pixels differ there (standard deviation); 0 where none is known.

    picture: H x W x 3 uint8 RGB, in the hole a guess, whose structure stays; hole: H x W; label: H x W, the surface of each
    pixel, hole or not: patches of another one cost more. The guess comes back where no patch of 7 x 7 px is known in the picture
    that is matched. The same seed gives the same bits.
    """
    times = times_smaller(hole, effort)
    surface = np.zeros(hole.shape, np.int8) if label is None else label
    levels = build_pyramid(*shrink(picture, hole, surface, times)) if hole.any() else []
    if not levels or not levels[0].sources.any():
        return picture, np.zeros(int(hole.sum()), np.float32)
    rng = np.random.default_rng(seed)
    coarser: Search | None = None
    while levels:
        level = levels.pop()
        side = max(hole.shape) / (times * 2 ** len(levels))
        # in squared grey levels: of the longer side as distance, down and across; of each repeated use; of another surface
        penalties = 10000.0 / side**2, 2500.0 / side**2, 30.0, 1000.0
        search = Search(level, rng, np.array(penalties, np.float32))
        if coarser is None:
            search.start_anywhere(rng)
            for turn in range(8):
                search.match(turn, 1)
        else:
            search.start_from(coarser)
        improve(search, effort, finest=not levels)
        coarser = search
    return search.copy_patches(picture, hole, times)


def times_smaller(hole: BoolArray, effort: Effort) -> int:
    """How many times smaller, along a side, a picture with that hole (H x W) is when patches are matched: a power of two."""
    times, pixels = 1, int(hole.sum())
    while hole.size > effort.largest * times**2 or pixels > effort.hole * times**2:
        times *= 2
    return times


def improve(search: Search, effort: Effort, finest: bool) -> None:
    """The rounds of one level: find better matches and paint with them; fewer of them where the hole is large."""
    rounds = int(np.clip(effort.updates // max(len(search.targets), 1), 1, effort.rounds))
    for turn in range(rounds):
        search.match(turn, effort.matchings)
        if not finest or turn < rounds - 1:  # the last vote is of the picture itself
            search.vote()
