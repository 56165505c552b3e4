"""Cut objects: known cells in; where foliage that the border cuts continues out of view, taken for round, out.

A tree or a bush that the border of the picture cuts continues beyond it. How far, the cut says: a chord of length L that parts an
area A from a circle says its radius R and the angle t at its middle, A / L^2 = (t - sin t cos t) / (4 sin^2 t) and L = 2 R sin t,
and the circle continues for R (1 + cos t). A post that is cut across ends, a crown of which a narrow strip is seen continues;
it is believed up to L.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import dilate_mask, nearest_known
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.perception.planes import SMOOTH

REACHES = 0.3
"""Square roots of its visible area by which whatever has no plane continues out of view."""
STEP, AROUND, DENSE = 1.03, 15, 0.08
"""Foliage is where, of the pairs of neighbours in a window of AROUND cells, a share of DENSE or more are this ratio of depths
apart. A window across one straight outline has 0.03."""
TOGETHER = 6
"""Cells round each cell of a cut within which the next one belongs to it: between leaves and twigs."""
ONE_OBJECT = 1.6
"""Ratio of inverse depths up to which what is cut is one object."""
THIN = 8
"""Cells: an object that is seen no farther from the cut than this may run along the border, uncut."""
RIM = 1.1
"""Radii up to which a circle is drawn, for its rim is single leaves."""
GAPS = 7
"""Side, in cells, of the square that closes the gaps between leaves."""
ANGLES = np.linspace(2 * np.arctan(0.5), 3.1, 256)
"""Half the angle, in radians, of the part of a circle that a chord parts, from where the rest is as high as the chord is long."""
SHARES = (ANGLES - np.sin(ANGLES) * np.cos(ANGLES)) / (4 * np.sin(ANGLES) ** 2)
"""Its area over the square of the chord."""


class CutObjects(NamedTuple):
    """Where objects continue out of view, on a grid of cells."""

    beyond: Float32Array
    """h x w cells to where the nearest of what has no plane may continue; inf where that is cut foliage."""
    number: NDArray[np.int32]
    """h x w: 1..N where known cells of a cut object are and where it continues, 0 elsewhere."""
    inverse_depth: Float32Array
    """N + 1, 1/m, of each object; the first is 0."""
    circle: Float32Array
    """N + 1 x 3: row and column of its centre and its radius, in cells; the first is 0."""


class Chord(NamedTuple):
    """Where the border cuts an object."""

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

    def circle(self, seen: BoolArray) -> tuple[NDArray[np.float64], float] | None:
        """Centre (row, column) and radius, in cells, of the circle of which `seen` (h x w) is seen; None if THIN."""
        outwards = np.array([-self.along[1], self.along[0]])
        heights = (np.argwhere(seen) - self.middle) @ outwards
        if np.ptp(heights) < THIN:
            return None
        angle = np.interp(len(heights) / self.length**2, SHARES, ANGLES)
        radius = self.length / (2 * np.sin(angle))
        return self.middle - np.sign(heights.mean()) * radius * np.cos(angle) * outwards, float(radius)


def find_cut_objects(w: Float32Array, label: NDArray[np.int32], hole: BoolArray, adjacent: BoolArray) -> CutObjects:
    """Where they continue.

    w, label, hole: h x w inverse depth and label of the known cells; next to: h x w, cells next to what is out of view.
    """
    loose = ~hole & (label == SMOOTH)
    number, depths, circles = np.zeros(loose.shape, np.int32), [0.0], [(0.0, 0.0, 0.0)]
    beyond = distance_to_unlabelled(loose)
    leaves = loose & foliage(w, ~hole & (w > 0)) if (loose & adjacent).any() else np.zeros_like(loose)
    cut = leaves & adjacent
    if not cut.any():
        return CutObjects(beyond, number, np.zeros(1, np.float32), np.zeros((1, 3), np.float32))
    rows, columns = np.indices(loose.shape, np.float32)
    for here, chord in cut_parts(w, leaves, cut):
        circle = chord.circle(here)
        if circle is None:
            continue
        (row, column), radius = circle
        inside = np.hypot(rows - row, columns - column) <= RIM * radius
        depths.append(float(np.median(w[here & cut])))
        circles.append((row, column, radius))
        number[here | (inside & ~loose & (depths[-1] > np.array(depths)[number]))] = len(depths) - 1
    beyond[hole & (number.ravel()[nearest_known(loose)[1]] > 0)] = np.inf
    return CutObjects(beyond, number, np.array(depths, np.float32), np.array(circles, np.float32))


def distance_to_unlabelled(loose: BoolArray) -> Float32Array:
    """h x w cells to the nearest of `loose` (h x w), less what each object continues for (REACHES); 1000 if none is."""
    if not loose.any():
        return np.full(loose.shape, 1e3, np.float32)
    seen, area = cv2.connectedComponentsWithStats(loose.astype(np.uint8), connectivity=8)[1:3]
    distance, nearest = nearest_known(loose)
    reach = REACHES * np.sqrt(area[seen.ravel()[nearest], cv2.CC_STAT_AREA])
    return np.maximum(distance - reach, 0).astype(np.float32)


def foliage(w: Float32Array, known: BoolArray) -> BoolArray:
    """h x w, True where depth has steps everywhere. w: h x w inverse depth of the `known` cells (h x w)."""
    steps, pairs = np.zeros((2, *w.shape), np.float32)
    depth = np.log(np.where(known, w, 1))
    for ahead, behind in (((slice(1, None),), (slice(-1),)), ((slice(None), slice(1, None)), (slice(None), slice(-1)))):
        both = known[ahead] & known[behind]
        pairs[behind] += both
        steps[behind] += both & (np.abs(depth[ahead] - depth[behind]) > np.log(STEP))
    steps, pairs = (cv2.boxFilter(each, -1, (AROUND, AROUND), normalize=False) for each in (steps, pairs))
    return np.asarray(steps >= DENSE * np.maximum(pairs, 1))


def cut_parts(w: Float32Array, leaves: BoolArray, cut: BoolArray) -> Iterator[tuple[BoolArray, Chord]]:
    """Each object that is cut: h x w, its known cells as far from the chord as that is long; its chord. Arguments: h x w."""
    part = cv2.connectedComponents(dilate_mask(cut, TOGETHER).astype(np.uint8), connectivity=8)[1]
    own = np.where(leaves, part.ravel()[nearest_known(cut)[1]], 0)
    for number in np.unique(part[cut]):
        left = own == number
        while (left & cut).any():
            typical = np.quantile(w[left & cut], 0.5, method="lower")
            here = left & at_same_depth(w, typical)
            left &= ~here
            chord = Chord.of(here & cut)
            yield here & (nearest_known(here & cut)[0] <= chord.length), chord


def at_same_depth(w: Float32Array, typical: float | Float32Array) -> BoolArray:
    """True where inverse depths are those of one object of a `typical` inverse depth, up to ONE_THING."""
    return np.asarray((w < ONE_OBJECT * typical) & (w * ONE_OBJECT > typical))
