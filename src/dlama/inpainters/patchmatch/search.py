"""A level of the pyramid in; the known patch matched to each patch at the hole, and the hole painted by their vote, out."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import box_around, nearest_known
from dlama.geometry.kernels.jit import as_input, in_bands
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.patchmatch import kernels
from dlama.inpainters.patchmatch.pyramid import Level, dilate_by_patch

NEAR = 16.0
"""Radius in px of the first random search in all rounds but the first."""
SOFT, WIDE = 4.0, 1e3
"""Sharpness of the vote by patch difference, and width of its Gaussian over patch centres (pixels)."""
SHARP, NARROW = 8.0, 1.4
"""The same in the last round: only the best patches count, near their centre, since means of many are blurred."""
PULL = 0.6
"""Share by which each round but the last brings what it painted back to the guess, but for its detail: the guess, a network's,
has the structure, patches the texture."""
BAND = 512
"""Patches per task."""


class Search:
    """The search on one level: patches that touch the hole, and the known patch matched to each; mutable."""

    def __init__(self, level: Level, rng: np.random.Generator, weights: Float32Array) -> None:
        """weights: penalties, as of `kernels.Penalties`."""
        self.values, self.sources, self.label = level.values, level.sources, level.label
        """As of Level; the values of the hole change."""
        touched = dilate_by_patch(level.hole)
        self.pixels, self.targets = places(level.hole), places(touched)
        """M x 2, pixels of the hole; N x 2, centres of patches that touch it."""
        self.number = np.full(level.hole.shape, -1, np.int32)
        """H x W, of each target, else -1."""
        self.number[touched] = np.arange(len(self.targets))
        self.box = box_around(touched, 0)
        """Rows and columns that hold all targets."""
        depth = cv2.distanceTransform(level.hole.astype(np.uint8), cv2.DIST_L2, 3)[touched]
        self.trust = (1.3 ** -np.minimum(depth, 200)).astype(np.float32)
        """N weights of the targets' patches, which fall with each pixel that their centres lie deeper in the hole."""
        self.guess = level.values[self.box][..., :3].copy()
        """Colours of the guess in the rows and columns of `box`, of the picture where it is known."""
        self.around = sum_over_patch(touched[self.box].view(np.uint8))[touched[self.box]]
        """N, how many patches cover the pixel at a target's centre."""
        self.weights, self.random = weights, rng.uniform(-1, 1, (65536, 2))
        self.found, self.cost = np.zeros_like(self.targets), np.full(len(self.targets), np.inf, np.float32)
        """N x 2, centre of the matched known patch; N differences of the two."""
        self.patches = kernels.Patches(self.values, self.targets, self.number, self.sources)
        self.matches = kernels.Matches(self.found, self.cost)

    def start_anywhere(self, rng: np.random.Generator) -> None:
        """Start with random matches."""
        sources = places(self.sources)
        self.found[:] = sources[rng.integers(0, len(sources), len(self.found))]
        self._weigh()

    def start_from(self, coarser: Search) -> None:
        """Start with the matches and colours of a level of half the size."""
        parent = self.targets // 2
        above = coarser.number[parent[:, 0], parent[:, 1]]
        moved = 2 * (coarser.found[above] - parent)
        moved[above < 0] = 0
        self.found[:] = nearest_source(self.sources, moved + self.targets)
        self.cost[:] = 1
        self._paint()
        self._weigh()

    def match(self, turn: int, matchings: int) -> None:
        """Improve the matches so many times, by propagation from neighbours and random search."""
        penalties = self._penalties()
        for step in range(matchings):
            reach = float(max(self.sources.shape)) if step == 0 else NEAR
            steps = kernels.Steps(self.random, 104729 * (turn * matchings + step), reach)
            arguments = self.patches, penalties, steps, self.found.copy(), self.matches
            in_bands(kernels.match_rows, len(self.targets), *arguments, band=BAND)

    def vote(self) -> None:
        """Set the hole's values by a vote of the matched patches, drawn to the guess."""
        self._paint()
        self._pull_to_guess()
        self._weigh()

    def copy_patches(self, picture: UInt8Array, hole: BoolArray, times: int) -> tuple[UInt8Array, Float32Array]:
        """H x W x 3, the picture (H x W x 3), `times` larger than this level, its hole (H x W) painted with a sharp vote of its
        own patches; M levels by which those over each of the hole's pixels differ there (standard deviation)."""
        pixels, out = places(hole), picture.copy()
        spread = np.zeros(len(pixels), np.float32)
        votes = self._votes(SHARP, NARROW, np.ones_like(self.cost))._replace(pixels=pixels)
        in_bands(
            kernels.copy_rows, len(pixels), as_input(picture), as_input(hole), votes, times, out, spread, band=BAND
        )
        return out, spread

    def _pull_to_guess(self) -> None:
        """Bring the hole's colours nearer to the guess, but for their detail."""
        rows, columns = self.pixels.T
        top, left = (side.start for side in self.box)
        step = cv2.GaussianBlur(self.guess - self.values[self.box][..., :3], (0, 0), 3.0)
        self.values[rows, columns, :3] += PULL * step[rows - top, columns - left]

    def _paint(self) -> None:
        """Set the hole's values by a soft vote of the patches, weighted by the trust in them."""
        out = np.empty((len(self.pixels), self.values.shape[2]), np.float32)
        votes = self._votes(SOFT, WIDE, self.trust)
        in_bands(kernels.vote_rows, len(self.pixels), self.values, votes, out, band=BAND)
        self.values[self.pixels[:, 0], self.pixels[:, 1]] = out

    def _votes(self, sharpness: float, width_px: float, trust: Float32Array) -> kernels.Votes:
        """The patches. One weighs exp(-sharpness cost / (2 mean cost about it)), times the trust in it (N), times a Gaussian of
        its centre's distance (width_px)."""
        touched = self.number[self.box] >= 0
        costs = np.zeros(touched.shape, np.float32)
        costs[touched] = self.cost
        mean = sum_over_patch(costs)[touched] / self.around
        weights = np.asarray(np.exp(-0.5 * sharpness * self.cost / (mean + 1e-3)) * trust, np.float32)
        return kernels.Votes(self.pixels, self.number, self.found, weights, gaussian(width_px))

    def _weigh(self) -> None:
        in_bands(kernels.cost_rows, len(self.targets), self.patches, self._penalties(), self.matches, band=BAND)

    def _penalties(self) -> kernels.Penalties:
        """By how many times each known pixel is used."""
        width = self.sources.shape[1]
        flat = self.found[:, 0].astype(np.int64) * width + self.found[:, 1]
        times = np.bincount(flat, minlength=self.sources.size).reshape(self.sources.shape)
        used = np.asarray(cv2.blur(times.astype(np.float32), (kernels.SIDE, kernels.SIDE)), np.float32)
        return kernels.Penalties(self.weights, used, self.label)


def gaussian(width_px: float) -> Float32Array:
    """SIDE x SIDE weights of patch centres by their distance."""
    step = np.arange(-kernels.HALF, kernels.HALF + 1, dtype=np.float32)
    return np.asarray(np.exp(-(step[:, None] ** 2 + step**2) / (2 * width_px**2)), np.float32)


def nearest_source(sources: BoolArray, places: NDArray[np.int32]) -> NDArray[np.int32]:
    """N x 2: the known patch nearest to each place (N x 2, row and column; those beyond the border count as on it)."""
    found = np.clip(places, 0, np.array(sources.shape, np.int32) - np.int32(1))
    elsewhere = np.flatnonzero(~sources[found[:, 0], found[:, 1]])
    if len(elsewhere):
        rows, columns = found[elsewhere].T
        found[elsewhere] = np.stack(np.divmod(nearest_known(sources)[1][rows, columns], sources.shape[1]), 1)
    return found


def places(where: BoolArray) -> NDArray[np.int32]:
    """N x 2, row and column of each True pixel."""
    flat = np.flatnonzero(where).astype(np.int32)
    out = np.empty((len(flat), 2), np.int32)
    np.divmod(flat, np.int32(where.shape[1]), out[:, 0], out[:, 1])
    return out


def sum_over_patch(plane: Float32Array | UInt8Array) -> Float32Array:
    """H x W: sums of a plane (H x W) over the patch round each pixel; beyond the border is 0."""
    side = (kernels.SIDE, kernels.SIDE)
    return np.asarray(cv2.boxFilter(plane, cv2.CV_32F, side, normalize=False, borderType=cv2.BORDER_CONSTANT))
