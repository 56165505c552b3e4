"""Cut things: cells without a plane that the border cuts in; where such things go on out of view, taken for round, out.

A tree or a person that the border of the picture cuts goes on beyond it. How far, the cut says: a chord of length L that parts
an area A = 2/3 L h from a circle has h of its diameter on that side and L^2 / 4 h on the other. So a post that is cut across ends,
and a crown of which a narrow strip is seen goes on; more than L is not believed.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import closed, dilated, nearest_known, square
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.perception.planes import SMOOTH

RELIEF = 0.06
"""Relative inverse depth by which what lies on no plane may stand out of one or back from it, and belong to it: a door, a sill."""
TOGETHER = 6
"""Cells round each cell of a cut within which the next one belongs to it: between leaves and twigs."""
ONE_THING = 1.6
"""Ratio of inverse depths up to which what is cut is one thing."""
THIN = 8
"""Cells from a chord within which a thing that is seen no farther from it may run along the border."""


ENDS = 4.0
"""Times that a cell outside the circle counts."""
RAGGED, LEAVES, GAPS = 0.3, 1.5, 7
"""Of a thing full of gaps the outline goes in and out by so much of its radius, in bumps of so many cells (sigma); side of the
square that closes gaps."""


class CutThings(NamedTuple):
    """Where things go on out of view, on a grid of cells."""

    beyond: Float32Array
    """h x w cells to the nearest thing, or to where it goes on; 0 there."""
    number: NDArray[np.int32]
    """h x w: 1..N where the known cells of a cut thing are and where it goes on, 0 elsewhere."""
    inverse_depth: Float32Array
    """N + 1, 1/m, of each thing; the first is 0."""


class Chord(NamedTuple):
    """Where the border cuts a thing."""

    middle: NDArray[np.float64]
    """Row and column."""
    along: NDArray[np.float64]
    """Unit vector, rows and columns."""
    length: float
    """Cells."""

    @classmethod
    def of(cls, cut: BoolArray) -> Chord:
        """The line through the cells of `cut` (h x w), as long as they."""
        cells = np.argwhere(cut).astype(np.float64)
        mean = cells.mean(0)
        along = np.linalg.svd(cells - mean, full_matrices=False)[2][0]
        places = (cells - mean) @ along
        return cls(mean + (places.max() + places.min()) / 2 * along, along, float(np.ptp(places)) + 1)

    def circle(self, thing: BoolArray) -> tuple[NDArray[np.float64], float] | None:
        """Centre and radius of the circle of which it cuts `thing` (h x w) off; None where that is THIN and may run along it."""
        cells = np.argwhere(thing) - self.middle
        outwards = np.array([-self.along[1], self.along[0]])
        heights = cells @ outwards
        if np.ptp(heights) < THIN:
            return None
        high = max(1.5 * len(cells) / self.length, self.length / 4)
        radius = (self.length**2 / 4 + high**2) / (2 * high)
        return self.middle + (radius - high) * (-1 if heights.mean() > 0 else 1) * outwards, radius


def loose_cells(
    w: Float32Array, label: NDArray[np.int32], on_planes: NDArray[np.float64], hole: BoolArray
) -> BoolArray:
    """h x w, True in known cells on no plane, nor nearly on one (RELIEF). w, label, hole: h x w; on_planes: K x h x w, 1/m."""
    return np.asarray(~hole & (label == SMOOTH) & (w > 0) & (np.abs(on_planes - w) > RELIEF * w).all(0))


def cut_things(w: Float32Array, loose: BoolArray, beside: BoolArray) -> CutThings:
    """Where they go on. w: h x w inverse depth; loose: h x w, `loose_cells`; beside: h x w, cells next to what is out of view."""
    cut = loose & beside
    number, depths = np.zeros(loose.shape, np.int32), [0.0]
    if not loose.any():
        return CutThings(np.full(loose.shape, 1e3, np.float32), number, np.zeros(1, np.float32))
    beyond = nearest_known(loose)[0]
    part = cv2.connectedComponents(dilated(cut, TOGETHER).astype(np.uint8), connectivity=8)[1]
    own = np.where(loose, part.ravel()[nearest_known(cut)[1]], 0) if cut.any() else np.zeros_like(part)
    rows, columns = np.indices(loose.shape, np.float32)
    bumps = leafy(loose.shape)
    for each in np.unique(part[cut]):
        left = own == each
        while (left & cut).any():
            typical = float(np.median(w[left & cut]))
            here = left & (w < ONE_THING * typical) & (w * ONE_THING > typical)
            left &= ~here
            chord = Chord.of(here & cut)
            here &= nearest_known(here & cut)[0] <= chord.length
            circle = chord.circle(here)
            if circle is None:
                continue
            (row, column), radius = circle
            outline = radius * (1 + RAGGED * (1 - solidity(here)) * bumps)
            away = np.hypot(rows - row, columns - column) - outline
            beyond = np.minimum(beyond, ENDS * np.maximum(away, 0))
            depths.append(typical)
            in_front = typical > np.array(depths)[number]
            number[here | ((away <= 0) & ~loose & in_front)] = len(depths) - 1
    return CutThings(beyond.astype(np.float32), number, np.array(depths, np.float32))


def solidity(thing: BoolArray) -> float:
    """Share of a thing (h x w) of what it covers with its gaps closed."""
    return float(thing.sum()) / max(1, int(closed(thing, square(GAPS)).sum()))


def leafy(hw: tuple[int, int]) -> Float32Array:
    """h x w bumps of LEAVES cells, mean 0, standard deviation 1, the same at every call."""
    bumps = cv2.GaussianBlur(np.random.default_rng(0).normal(size=hw).astype(np.float32), (0, 0), LEAVES)
    return np.asarray(bumps / max(float(bumps.std()), 1e-6), np.float32)


def solidity(thing: BoolArray) -> float:
    """Share of a thing (h x w) of what it covers with its gaps closed."""
    return float(thing.sum()) / max(1, int(closed(thing, square(GAPS)).sum()))


def leafy(hw: tuple[int, int]) -> Float32Array:
    """h x w bumps of LEAVES cells, mean 0, standard deviation 1, the same at every call."""
    bumps = cv2.GaussianBlur(np.random.default_rng(0).normal(size=hw).astype(np.float32), (0, 0), LEAVES)
    return np.asarray(bumps / max(float(bumps.std()), 1e-6), np.float32)


def circle_of(chord: NDArray[np.float64], inside: NDArray[np.int64]) -> tuple[NDArray[np.float64], float] | None:
    """Centre (row, column) and radius, in cells, of the circle of which N x 2 cells of a `chord` are cut and M x 2 are `inside`.

    None where it is seen no farther from the chord than THIN: it may as well run along the border.
    """
    along = np.linalg.svd(chord - chord.mean(0), full_matrices=False)[2][0] if len(chord) > 1 else np.array([1.0, 0.0])
    outwards = np.array([-along[1], along[0]])
    places, heights = (chord - chord.mean(0)) @ along, (inside - chord.mean(0)) @ outwards
    if np.ptp(heights) < THIN:
        return None
    length = float(np.ptp(places)) + 1
    high = max(1.5 * len(inside) / length, length / 4)
    radius = (length**2 / 4 + high**2) / (2 * high)
    middle = chord.mean(0) + (places.max() + places.min()) / 2 * along
    return middle + (radius - high) * (-1 if heights.mean() > 0 else 1) * outwards, radius
