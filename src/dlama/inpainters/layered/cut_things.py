"""Cut things: cells without a plane that the border cuts in; where such things go on out of view, taken for round, out.

A tree or a person that the border of the picture cuts goes on beyond it. How far, the cut says: a chord of length L that parts an
area A from a circle says its radius R and the angle t at its middle, A / L^2 = (t - sin t cos t) / (4 sin^2 t) and L = 2 R sin t,
and the circle goes on for R (1 + cos t). A post that is cut across ends, a crown of which a narrow strip is seen goes on; it is
believed up to L.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import closed, dilated, nearest_known, square
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.perception.planes import SMOOTH

AROUND = 31
"""Width, in cells, of what counts as round a cell."""
SURROUNDED = 0.3
"""Share of that which a plane must hold to surround what lies on none."""
RELIEF = 0.06
"""Relative inverse depth by which what lies on no plane may stand out of one or back from it and belong to it: a door, a sill."""
TOGETHER = 6
"""Cells round each cell of a cut within which the next one belongs to it: between leaves and twigs."""
ONE_THING = 1.6
"""Ratio of inverse depths up to which what is cut is one thing."""
THIN = 8
"""Cells: a thing that is seen no farther from the cut than this may run along the border, uncut."""
ENDS = 4.0
"""Times that a cell outside the circle counts."""
GAPS = 7
"""Side, in cells, of the square that closes the gaps between leaves."""
SOLID = 0.85
"""Share of a thing in what it covers with its gaps closed, above which it is no foliage: an eave, a bench."""
RAGGED, LEAVES = 0.3, 1.5
"""Share of the radius by which the outline of a thing that is nothing but gaps goes in and out (standard deviation), and cells
of its bumps (sigma)."""

ANGLES = np.linspace(2 * np.arctan(0.5), 3.1, 256)
"""Half the angle, in radians, of the part of a circle that a chord parts, from where the rest is as high as the chord is long."""
SHARES = (ANGLES - np.sin(ANGLES) * np.cos(ANGLES)) / (4 * np.sin(ANGLES) ** 2)
"""Its area over the square of the chord."""


class CutThings(NamedTuple):
    """Where things go on out of view, on a grid of cells."""

    beyond: Float32Array
    """h x w cells to the nearest thing, or, each counting ENDS times, to where one goes on; 0 there."""
    number: NDArray[np.int32]
    """h x w: 1..N where known cells of a cut thing are and where it goes on, 0 elsewhere."""
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
        """Centre (row, column) and radius, in cells, of the circle of which `thing` (h x w) is seen; None if THIN."""
        outwards = np.array([-self.along[1], self.along[0]])
        heights = (np.argwhere(thing) - self.middle) @ outwards
        if np.ptp(heights) < THIN:
            return None
        angle = np.interp(len(heights) / self.length**2, SHARES, ANGLES)
        radius = self.length / (2 * np.sin(angle))
        return self.middle - np.sign(heights.mean()) * radius * np.cos(angle) * outwards, float(radius)


def cut_things(
    w: Float32Array, label: NDArray[np.int32], on_planes: NDArray[np.floating], hole: BoolArray, beside: BoolArray
) -> CutThings:
    """Where they go on.

    w, label, hole: h x w inverse depth and label of the known cells; on_planes: K x h x w inverse depth of the planes; beside:
    h x w, cells next to what is out of view.
    """
    loose = ~hole & (label == SMOOTH) & (w > 0) & ~relief(w, label, on_planes, hole)
    cut = loose & beside
    number, depths = np.zeros(loose.shape, np.int32), [0.0]
    beyond = nearest_known(loose)[0] if loose.any() else np.full(loose.shape, 1e3, np.float32)
    if not cut.any():
        return CutThings(beyond, number, np.zeros(1, np.float32))
    rows, columns = np.indices(loose.shape, np.float32)
    for here, chord in cut_parts(w, loose, cut):
        whole = closed(here, square(GAPS))
        solidity = float(here.sum() / whole.sum())
        circle = chord.circle(here)
        if circle is None or solidity > SOLID:
            continue
        (row, column), radius = circle
        bumps = RAGGED * (1 - solidity) * leafy(loose.shape)
        away = np.hypot(rows - row, columns - column) - radius * (1 + bumps)
        beyond = np.minimum(beyond, ENDS * np.maximum(away, 0)).astype(np.float32)
        depths.append(float(np.median(w[here & cut])))
        number[here | ((away <= 0) & ~loose & (depths[-1] > np.array(depths)[number]))] = len(depths) - 1
    return CutThings(beyond, number, np.array(depths, np.float32))


def relief(w: Float32Array, label: NDArray[np.int32], on_planes: NDArray[np.floating], hole: BoolArray) -> BoolArray:
    """h x w, True where a cell lies nearly on the plane that most known cells round it are on. Arguments as of `cut_things`."""
    known = cv2.boxFilter((~hole).astype(np.float32), -1, (AROUND, AROUND), normalize=False)
    out = np.zeros(hole.shape, np.bool_)
    for number, value in enumerate(on_planes, start=1):
        there = ~hole & (label == number)
        count = cv2.boxFilter(there.astype(np.float32), -1, (AROUND, AROUND), normalize=False)
        out |= (np.abs(value - w) < RELIEF * w) & (count > SURROUNDED * known)
    return out


def cut_parts(w: Float32Array, loose: BoolArray, cut: BoolArray) -> Iterator[tuple[BoolArray, Chord]]:
    """Each thing that is cut: h x w, its known cells as far from the chord as that is long; its chord. Arguments: h x w."""
    part = cv2.connectedComponents(dilated(cut, TOGETHER).astype(np.uint8), connectivity=8)[1]
    own = np.where(loose, part.ravel()[nearest_known(cut)[1]], 0)
    for number in np.unique(part[cut]):
        left = own == number
        while (left & cut).any():
            typical = np.quantile(w[left & cut], 0.5, method="lower")
            here = left & (w < ONE_THING * typical) & (w * ONE_THING > typical)
            left &= ~here
            chord = Chord.of(here & cut)
            yield here & (nearest_known(here & cut)[0] <= chord.length), chord


def leafy(hw: tuple[int, ...]) -> Float32Array:
    """h x w bumps of LEAVES cells, mean 0, standard deviation 1, the same at every call."""
    bumps = cv2.GaussianBlur(np.random.default_rng(0).normal(size=hw).astype(np.float32), (0, 0), LEAVES)
    return np.asarray(bumps / max(float(bumps.std()), 1e-6), np.float32)
