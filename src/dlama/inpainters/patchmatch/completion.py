"""A picture with a hole and a rough guess of it in; the hole painted with patches of the picture's own, out.

After Wexler, Shechtman & Irani, "Space-time completion of video" (2007), with the matching of Barnes et al., "PatchMatch" (2009),
and the texture channels of Newson et al., "Video inpainting of complex scenes" (2014): from the coarsest picture to the finest,
every patch that touches the hole looks for the known patch most like it, and the hole's pixels become what these say of them. A
patch from near by, above all from about the same height, is preferred, so that ground stays below walls and joints keep their
scale; and one that is used often is avoided, so that no small piece is repeated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.patchmatch import kernels
from dlama.inpainters.patchmatch.pyramid import Level, build_pyramid, dilated_by_patch

DISTANCE_DOWN, DISTANCE_ACROSS = 10000.0, 2500.0
"""Squared grey levels that a patch from as far off as the picture's longer side costs more, below or above, and next to."""
REUSE_PENALTY = 30.0
"""Squared grey levels for each time that a source is used beyond once."""
OTHER_SURFACE = 1000.0
"""Squared grey levels that a patch whose middle lies on another surface costs more, where surfaces are given."""
NEAR = 16.0
"""Pixels of the first random step in all but the first of them."""
CERTAIN = 1.3
"""By how much less a patch counts for each pixel that its middle lies deeper in the hole."""
SOFT, WIDE = 4.0, 1e3
"""How much more a better patch counts in the rounds, wherever its middle is (pixels)."""
SHARP, NARROW = 8.0, 1.4
"""The same in the last round: the best patches alone count, near their middle, as means of many are blurred."""
BAND = 512
"""Patches per task."""
LARGEST_MATCHED = 3_000_000
"""Pixels of a picture up to which patches are matched; a larger one is painted from where the level below found them."""
DRAWN = 65536
"""Random numbers drawn a level."""


@dataclass(frozen=True)
class Effort:
    """How long patches are looked for."""

    rounds: int
    """Of matching and voting a level,"""
    updates: int
    """and how many patches are matched in all of them where the hole is large."""
    matchings: int
    """Steps of PatchMatch a round."""
    pairs: int
    """Patches that are compared where all are, in the coarsest picture."""


THOROUGH, QUICK = Effort(6, 400_000, 2, 4_000_000), Effort(4, 100_000, 1, 1_000_000)


def complete_picture(
    picture: UInt8Array,
    hole: BoolArray,
    guess: UInt8Array,
    seed: int = 0,
    *,
    label: NDArray[np.int32] | None = None,
    effort: Effort = THOROUGH,
) -> UInt8Array:
    """H x W x 3: the picture with its hole painted from known patches; known pixels as they are.

    picture, guess: H x W x 3 uint8 RGB; hole: H x W; label: H x W, the surface of each pixel, hole or not: patches of another
    one cost more. Where no patch of 7 x 7 px is known the guess comes back. The same seed gives the same bits.
    """
    out = np.where(hole[..., None], guess, picture)
    label = np.zeros(hole.shape, np.int32) if label is None else label.astype(np.int32)
    levels = build_pyramid(picture, hole, guess, label) if hole.any() else []
    if not levels or not levels[0].sources.any():
        return out
    rng = np.random.default_rng(seed)
    coarser: Search | None = None
    for i in reversed(range(len(levels))):
        search = Search.of(levels[i], rng, penalty_weights(max(hole.shape) / 2**i))
        if coarser is None:
            search.compare_all(rng, effort.pairs)
        else:
            search.start_from(coarser)
        rounds = int(np.clip(effort.updates // len(search.targets), 1, effort.rounds))
        for turn in range(rounds):
            if coarser is None or levels[i].hole.size <= LARGEST_MATCHED:
                search.match(turn, effort.matchings)
            search.vote(last=i == 0 and turn == rounds - 1)
        coarser = search
    out[hole] = np.clip(np.round(search.values[hole][:, :3]), 0, 255)
    return out


def penalty_weights(side: float) -> Float32Array:
    """What distance, use and another surface cost, as `kernels.penalty` reads it; side: the level's longer side in pixels."""
    return np.array([DISTANCE_DOWN / side**2, DISTANCE_ACROSS / side**2, REUSE_PENALTY, OTHER_SURFACE], np.float32)


@dataclass
class Search:
    """The patches of one level that touch the hole, and the known patch that each is like; changes as it continues."""

    values: Float32Array
    """H x W x 5, as of Level; the hole's change."""
    sources: BoolArray
    """H x W."""
    label: NDArray[np.int32]
    """H x W, the surface of each pixel."""
    pixels: NDArray[np.int32]
    """M x 2, the hole's."""
    targets: NDArray[np.int32]
    """N x 2, the middles of patches that touch it."""
    number: NDArray[np.int32]
    """H x W, of each target, else -1."""
    trust: Float32Array
    """N: how much a target's patch counts."""
    weights: Float32Array
    random: NDArray[np.float64]
    found: NDArray[np.int32]
    """N x 2, the middle of the known patch."""
    cost: Float32Array
    """N: how far the two are apart."""

    @classmethod
    def of(cls, level: Level, rng: np.random.Generator, weights: Float32Array) -> Search:
        """The search before it begins."""
        touched = dilated_by_patch(level.hole)
        targets = np.argwhere(touched).astype(np.int32)
        number = np.full(level.hole.shape, -1, np.int32)
        number[touched] = np.arange(len(targets))
        depth = cv2.distanceTransform(level.hole.astype(np.uint8), cv2.DIST_L2, 3)[touched]
        trust = (CERTAIN ** -np.minimum(depth, 200)).astype(np.float32)
        pixels = np.argwhere(level.hole).astype(np.int32)
        random = rng.uniform(-1, 1, (DRAWN, 2))
        found, cost = np.zeros_like(targets), np.full(len(targets), np.inf, np.float32)
        return cls(
            level.values, level.sources, level.label, pixels, targets, number, trust, weights, random, found, cost
        )

    def compare_all(self, rng: np.random.Generator, pairs: int) -> None:
        """Every target with every known patch, or with as many drawn ones as `pairs` allow."""
        sources = np.argwhere(self.sources).astype(np.int32)
        most = max(1, pairs // len(self.targets))
        if len(sources) > most:
            sources = sources[np.sort(rng.permutation(len(sources))[:most])]
        used = np.zeros(self.sources.shape, np.float32)
        self._run(
            kernels.search_rows,
            self.values,
            self.targets,
            sources,
            self.weights,
            used,
            self.label,
            self.found,
            self.cost,
        )

    def start_from(self, coarser: Search) -> None:
        """Begin with what the coarser level (half the size) found, and with its colours."""
        parent = self.targets // 2
        above = coarser.number[parent[:, 0], parent[:, 1]]
        moved = 2 * (coarser.found[above] - parent) + self.targets
        moved = np.where((above >= 0)[:, None], moved, self.targets)
        self.found[:] = nearest_source(self.sources, moved)
        self.cost[:] = 1
        self._paint(SOFT, WIDE, self.trust)
        self._weigh()

    def match(self, turn: int, matchings: int) -> None:
        """Look for better patches, so many times: among the neighbours' and at random."""
        used = self._used()
        for step in range(matchings):
            reach = float(max(self.sources.shape)) if step == 0 else NEAR
            now = self.found.copy()
            self._run(
                kernels.match_rows,
                self.values,
                self.targets,
                self.number,
                self.sources,
                self.weights,
                used,
                self.label,
                self.random,
                104729 * (turn * matchings + step),
                reach,
                now,
                self.found,
                self.cost,
            )

    def vote(self, *, last: bool) -> None:
        """The hole's values as the patches found say; sharp in the last round."""
        if last:
            self._paint(SHARP, NARROW, np.ones_like(self.trust))
        else:
            self._paint(SOFT, WIDE, self.trust)
            self._weigh()

    def _paint(self, sharpness: float, width_px: float, trust: Float32Array) -> None:
        out = np.empty((len(self.pixels), self.values.shape[2]), np.float32)
        rows = (self.values, self.pixels, self.number, self.found, self.cost, trust, sharpness, width_px, out)
        in_bands(kernels.vote_rows, len(self.pixels), *rows, band=BAND)
        self.values[self.pixels[:, 0], self.pixels[:, 1]] = out

    def _weigh(self) -> None:
        self._run(
            kernels.cost_rows, self.values, self.targets, self.found, self.weights, self._used(), self.label, self.cost
        )

    def _used(self) -> Float32Array:
        """H x W: how many times each known pixel is used."""
        width = self.sources.shape[1]
        flat = self.found[:, 0].astype(np.int64) * width + self.found[:, 1]
        times = np.bincount(flat, minlength=self.sources.size).reshape(self.sources.shape)
        side = 2 * kernels.HALF + 1
        return np.asarray(cv2.blur(times.astype(np.float32), (side, side)), np.float32)

    def _run(self, kernel: Callable[..., None], *arguments: Any) -> None:
        in_bands(kernel, len(self.targets), *arguments, band=BAND)


def nearest_source(sources: BoolArray, places: NDArray[np.int32]) -> NDArray[np.int32]:
    """N x 2: the known patch nearest to each place (N x 2, row and column; those beyond the border count as on it)."""
    found = np.clip(places, 0, np.array(sources.shape) - 1).astype(np.int32)
    in_bands(kernels.nearest_rows, len(found), sources, found, band=BAND)
    return found
