"""Cut objects: known cells in; the circles as which foliage, cut by the border, extends out of view, out.

A crown is assumed round, and the border cuts it along a chord of length L. From its visible area A follow its radius R and the
angle t at its middle: A / L^2 = (t - sin t cos t) / (4 sin^2 t) and L = 2 R sin t. The circle extends by R (1 + cos t) beyond
the chord, at most by L. A post that is cut across ends; a crown of which a narrow strip is visible extends.
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

ONE_OBJECT = 1.6
"""Largest ratio of inverse depths within one cut object."""
GAPS = 7
"""Side, in cells, of the square that closes the gaps between leaves."""
ANGLES = np.linspace(2 * np.arctan(0.5), 3.1, 256)
"""Half the central angle, in radians, of the visible circle segment, from where the hidden part is as high as the chord is
long."""
SHARES = (ANGLES - np.sin(ANGLES) * np.cos(ANGLES)) / (4 * np.sin(ANGLES) ** 2)
"""Area of the segment over the squared chord."""


class CutObjects(NamedTuple):
    """Where objects extend out of view, on a grid of cells."""

    beyond: Float32Array
    """h x w cells to the possible extent of the nearest object without a plane; inf where that is cut foliage."""
    number: NDArray[np.int32]
    """h x w: 1..N on the known cells of a cut object and where it extends, 0 elsewhere."""
    inverse_depth: Float32Array
    """N + 1, 1/m, of each object; the first is 0."""
    circle: Float32Array
    """N + 1 x 3: row and column of its centre and its radius, in cells; the first is 0."""


def find_cut_objects(
    w: Float32Array, label: NDArray[np.int8], hole: BoolArray, adjacent: BoolArray, *, with_leaves: bool = True
) -> CutObjects:
    """The extents of cut objects out of view.

    w, label, hole: h x w inverse depth and label of the known cells; adjacent: h x w, cells next to the hole out of view;
    with_leaves: whether depth could show leaves one by one.
    """
    loose = ~hole & (label == SMOOTH)
    number, depths, circles = np.zeros(loose.shape, np.int32), [0.0], [(0.0, 0.0, 0.0)]
    beyond = distance_to_unlabelled(loose)
    cut = loose & adjacent
    leaves = loose & foliage(w, ~hole & (w > 0)) if with_leaves and cut.any() else np.zeros_like(loose)
    cut &= leaves
    if not cut.any():
        return CutObjects(beyond, number, np.zeros(1, np.float32), np.zeros((1, 3), np.float32))
    rows, columns = np.indices(loose.shape, np.float32)
    for here, row, column, radius in cut_parts(w, leaves, cut):
        inside = np.hypot(rows - row, columns - column) <= 1.1 * radius  # its rim is single leaves
        depths.append(float(np.median(w[here & cut])))
        circles.append((row, column, radius))
        number[here | (inside & ~loose & (depths[-1] > np.array(depths)[number]))] = len(depths) - 1
    beyond[hole & (number.ravel()[nearest_known(loose)[1]] > 0)] = np.inf
    return CutObjects(beyond, number, np.array(depths, np.float32), np.array(circles, np.float32))


def distance_to_unlabelled(loose: BoolArray) -> Float32Array:
    """h x w cells to the nearest of `loose` (h x w), less the extent of each object; 1000 if there is none."""
    if not loose.any():
        return np.full(loose.shape, 1e3, np.float32)
    seen, area = cv2.connectedComponentsWithStats(loose.astype(np.uint8), connectivity=8)[1:3]
    distance, nearest = nearest_known(loose)
    reach = 0.3 * np.sqrt(area[seen.ravel()[nearest], cv2.CC_STAT_AREA])
    return np.maximum(distance - reach, 0).astype(np.float32)


def foliage(w: Float32Array, known: BoolArray) -> BoolArray:
    """h x w, True where depth steps by 3 % between 8 % of the neighbours in a window of 15 cells; across one straight outline 3 %
    of them do. w: h x w inverse depth of the `known` cells (h x w)."""
    steps, pairs = np.zeros((2, *w.shape), np.float32)
    depth = np.log(np.where(known, w, 1))
    for ahead, behind in (((slice(1, None),), (slice(-1),)), ((slice(None), slice(1, None)), (slice(None), slice(-1)))):
        both = known[ahead] & known[behind]
        pairs[behind] += both
        steps[behind] += both & (np.abs(depth[ahead] - depth[behind]) > np.log(1.03))
    steps, pairs = (cv2.boxFilter(each, -1, (15, 15), normalize=False) for each in (steps, pairs))
    return np.asarray(steps >= 0.08 * np.maximum(pairs, 1))


def cut_parts(w: Float32Array, leaves: BoolArray, cut: BoolArray) -> Iterator[tuple[BoolArray, float, float, float]]:
    """Each cut object: h x w, its known cells within a chord's length of the chord; row and column of the centre and radius, in
    cells, of the circle whose visible part they are. Arguments: h x w."""
    # leaves and twigs 12 cells apart belong together
    part = cv2.connectedComponents(dilate_mask(cut, 6).astype(np.uint8), connectivity=8)[1]
    own = np.where(leaves, part.ravel()[nearest_known(cut)[1]], 0)
    for number in np.unique(part[cut]):
        left = own == number
        while (left & cut).any():
            typical = np.quantile(w[left & cut], 0.5, method="lower")
            here = left & at_same_depth(w, typical)
            left &= ~here
            middle, along, length = find_chord(here & cut)
            here &= nearest_known(here & cut)[0] <= length
            outwards = np.array([-along[1], along[0]])
            heights = (np.argwhere(here) - middle) @ outwards
            if np.ptp(heights) < 8:  # it may run along the border, uncut
                continue
            angle = np.interp(len(heights) / length**2, SHARES, ANGLES)
            radius = float(length / (2 * np.sin(angle)))
            yield here, *(middle - np.sign(heights.mean()) * radius * np.cos(angle) * outwards), radius


def find_chord(cut: BoolArray) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """The line through the cells of `cut` (h x w): its middle (row, column), its direction (a unit vector) and its length in
    cells."""
    cells = np.argwhere(cut).astype(np.float64)
    mean = cells.mean(0)
    along = np.linalg.svd(cells - mean, full_matrices=False)[2][0]
    places = (cells - mean) @ along
    return mean + (places.max() + places.min()) / 2 * along, along, float(np.ptp(places)) + 1


def at_same_depth(w: Float32Array, typical: float | Float32Array) -> BoolArray:
    """True where inverse depths differ from a `typical` one by at most the ratio ONE_OBJECT."""
    return np.asarray((w < ONE_OBJECT * typical) & (w * ONE_OBJECT > typical))
