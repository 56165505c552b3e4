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

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, replace_pixels
from dlama.inpainters.patchmatch.pyramid import build_pyramid, dilate_by_patch
from dlama.inpainters.patchmatch.search import Search

DISTANCE_DOWN, DISTANCE_ACROSS = 10000.0, 2500.0
"""Penalty, in squared grey levels, of a patch as far away as the picture's longer side, vertically and horizontally."""
REUSE_PENALTY = 30.0
"""Penalty, in squared grey levels, for each repeated use of a source."""
OTHER_SURFACE = 1000.0
"""Penalty, in squared grey levels, of a patch centred on another surface, where surfaces are given."""
STRIDE = 2
"""Pixels between the patches of a picture with a large hole, which takes the matches of a smaller level."""


@dataclass(frozen=True)
class Effort:
    """Limits of the search."""

    rounds: int
    """Rounds of matching and voting per level,"""
    updates: int
    """and most patches matched in all of them, where the hole is large."""
    matchings: int
    """Steps of PatchMatch per round."""
    pairs: int
    """Most comparisons of the exhaustive search in the coarsest level."""
    largest: int
    """Pixels of the largest level in which patches are matched; the picture itself, if larger, takes the matches of that one."""
    at_full_size: bool
    """Whether patches are matched at full size, too."""


THOROUGH = Effort(6, 400_000, 2, 4_000_000, 3_000_000, True)
QUICK = Effort(4, 100_000, 1, 1_000_000, 800_000, False)
"""Over surfaces of known depth, whose larger levels gain nothing from matches of their own."""


def complete_picture(
    picture: UInt8Array,
    hole: BoolArray,
    guess: UInt8Array,
    seed: int = 0,
    *,
    label: NDArray[np.integer] | None = None,
    effort: Effort = THOROUGH,
) -> tuple[UInt8Array, Float32Array]:
    """H x W x 3, the picture with its hole painted from known patches; known pixels as they are. And M, by how many levels the
    patches over each of the hole's pixels differ there (standard deviation); 0 where none is known.

    picture, guess: H x W x 3 uint8 RGB, the guess a network's, whose structure stays; hole: H x W; label: H x W, the surface of
    each pixel, hole or not: patches of another one cost more. Where no patch of 7 x 7 px is known the guess comes back. The same
    seed gives the same bits.
    """
    surface = np.zeros(hole.shape, np.int8) if label is None else label
    copied = not is_matched(hole, 0, effort) and count_rounds(int(dilate_by_patch(hole).sum()), effort) == 1
    levels = build_pyramid(picture, hole, guess, surface, copied) if hole.any() else []
    if not levels or not levels[0].sources.any():
        return replace_pixels(picture, hole, guess), np.zeros(int(hole.sum()), np.float32)
    rng = np.random.default_rng(seed)
    coarser: Search | None = None
    while levels:
        level = levels.pop()
        number = len(levels)
        matched = coarser is None or is_matched(level.hole, number, effort)
        if not matched and number:  # its matches would be those of the level below
            continue
        side = max(hole.shape) / 2**number
        penalties = DISTANCE_DOWN / side**2, DISTANCE_ACROSS / side**2, REUSE_PENALTY, OTHER_SURFACE
        search = Search(level, rng, np.array(penalties, np.float32), 1 if level.values.size else STRIDE)
        if coarser is None:
            search.compare_all(rng, effort.pairs)
        else:
            search.start_from(coarser, compare=matched)
        if level.values.size:
            improve(search, effort, matched, finest=not levels)
        if levels:
            search.keep_matches()
        coarser = search
    out, (colors, spread) = picture.copy(), search.vote_sharply(picture)
    out[hole] = np.clip(np.round(colors), 0, 255)
    return out, spread


def is_matched(hole: BoolArray, number: int, effort: Effort) -> bool:
    """Whether patches of a level (its hole, H x W; its number, 0 = the finest) are matched, if there is a coarser one."""
    return hole.size <= effort.largest and (number > 0 or effort.at_full_size)


def count_rounds(targets: int, effort: Effort) -> int:
    """Rounds of a level that has so many targets."""
    return int(np.clip(effort.updates // max(targets, 1), 1, effort.rounds))


def improve(search: Search, effort: Effort, matched: bool, finest: bool) -> None:
    """The rounds of one level: find better matches, where it is `matched`, and paint with them."""
    rounds = count_rounds(len(search.targets), effort)
    for turn in range(rounds):
        if matched:
            search.match(turn, effort.matchings)
        if not finest or turn < rounds - 1:  # the last vote is of the picture itself
            search.vote()
