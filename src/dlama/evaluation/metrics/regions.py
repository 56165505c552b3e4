"""The truth of a case in; the regions in which every recipe and filler is scored alike out (bool pictures, True = in it).

Target pixels of a new view are sorted by what the *source camera* sees of them, from the two true depth maps alone:

- `seen`: nothing the source measured lies in front of it. One of the four source pixels round its projection, or their
  bilinear mean, has its depth (within `SEEN_TOLERANCE`, relative, so that neither grazing ground nor rounding at a depth
  edge makes a seen pixel unseen), or the source pixel it falls into measured something farther.
- `out-of-view`: it projects outside the source picture, or behind the source camera.
- `object`: it is hidden by the object of the source's object mask.
- `disoccluded`: it is hidden by anything else.
- `unseen`: the three above together.

Pixels at infinity go by their direction. A target pixel without true depth, or one that falls on a sensor hole of the
source with no neighbour that has its depth, is *unknown*: in none of these regions, but in `whole`.
A surface as thin as paper counts as seen from both sides, and so does what lies closer than the tolerance behind another.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.evaluation.metrics.depth import is_known
from dlama.geometry.camera import Float64Array
from dlama.geometry.holes import box_mean, dilate_mask
from dlama.geometry.projection import inverse_depth, px_from_px
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array

SEEN_TOLERANCE = 0.02
"""Relative difference in inverse depth up to which two frames show one surface."""
SAME_DISPARITY_PX = 1.0
"""The same for a rectified pair, in pixels of disparity."""
SMALLEST_WEIGHT = 1e-6
"""Bilinear weight, 0..1, up to which a neighbouring pixel does not count: coordinates on a pixel's centre are not exact."""
DARKER = 0.1
"""Share of its luma that a pixel loses at least in a shadow,"""
DARKER_LEVELS = 3.0
"""and levels of 0..255: less is compression."""
SMALLEST_SHADOW_PX = 60
"""A smaller shadow counts as none."""
EDGE_PX = 2
"""Around the object colours are mixes of it and the background."""

IndexArray = NDArray[np.int64]
Regions = dict[str, BoolArray]
"""Name of a region in results.csv -> H x W, True = in it."""


@dataclass(frozen=True, eq=False)
class SourceVisibility:
    """What a source camera sees of a target picture, H x W of the target each; all False = unknown."""

    seen: BoolArray
    disoccluded: BoolArray
    out_of_view: BoolArray
    hidden_by_object: BoolArray
    column: IndexArray
    """H x W integers: the source pixel into which the target pixel falls, clipped to the picture."""
    row: IndexArray
    """Likewise."""

    @property
    def unseen(self) -> BoolArray:
        """H x W."""
        return self.disoccluded | self.out_of_view | self.hidden_by_object

    def regions(self, with_object: bool = False) -> Regions:
        """By the names of results.csv; `object` only where asked for."""
        found = {
            "seen": self.seen,
            "unseen": self.unseen,
            "disoccluded": self.disoccluded,
            "out-of-view": self.out_of_view,
        }
        return found | {"object": self.hidden_by_object} if with_object else found

    def warp_color(self, color: UInt8Array) -> UInt8Array:
        """H x W x 3: a source picture carried into the target by the true depth, nearest pixel; 0 where not seen."""
        return color[self.row, self.column] * self.seen[..., None]


def source_visibility(source: RGBD, target: RGBD, object_mask: BoolArray | None = None) -> SourceVisibility:
    """The target's pixels sorted by what the source sees of them; the rules stand at the top of the file.

    Args:
        source, target: with their true depths and cameras, in one world.
        object_mask: H x W of the source, True = the object; what it hides is a type of its own.
    """
    x, y, w, inside = project_target(source, target)
    column, row = (clip_index(np.floor(at), size) for at, size in zip((x, y), source.camera.wh))
    there = np.where(source.missing, np.nan, inverse_depth(source.depth)).astype(np.float64)
    with np.errstate(invalid="ignore"):
        matches = matches_neighbour(there, x, y, w)
        nearer = there[row, column] > w * (1 + SEEN_TOLERANCE)
    known = ~np.isnan(there[row, column])
    given = ~target.missing
    seen = given & inside & (matches | (known & ~nearer))
    hidden = given & inside & known & nearer & ~matches
    by_object = hidden & object_mask[row, column] if object_mask is not None else np.zeros_like(hidden)
    return SourceVisibility(seen, hidden & ~by_object, given & ~inside, by_object, column, row)


def project_target(source: RGBD, target: RGBD) -> tuple[Float64Array, Float64Array, Float64Array, BoolArray]:
    """Where every target pixel falls in the source picture. Target pixels without depth are projected as if far.

    Returns:
        x and y in source pixels (the first pixel's centre is at 0.5), inverse depth in the source (1/m, 0 = far), and True
        where the pixel falls into the picture: H x W of the target each.
    """
    matrix, offset = px_from_px(source.camera, target.camera)
    w = inverse_depth(target.depth).astype(np.float64)
    rows, columns = np.mgrid[: target.camera.height, : target.camera.width] + 0.5
    at = np.stack([columns, rows, np.ones_like(rows)], -1) @ matrix.T + w[..., None] * offset
    front = at[..., 2] > 0
    z = np.where(front, at[..., 2], 1.0)
    x, y = at[..., 0] / z, at[..., 1] / z
    inside = front & (x >= 0) & (y >= 0) & (x < source.camera.width) & (y < source.camera.height)
    return x, y, w / z, inside


def matches_neighbour(there: Float64Array, x: Float64Array, y: Float64Array, w: Float64Array) -> BoolArray:
    """True where one of the four source pixels round (x, y), or their bilinear mean, has the inverse depth w.

    A pixel without bilinear weight does not count: a point on a pixel's centre has one pixel round it. On a plane inverse
    depth is affine in pixels, so the mean is exact however grazing the view.

    Args:
        there: inverse depth of the source, H x W in 1/m, nan = missing.
        x, y: source pixels, of the target's H x W; so are w (1/m) and what is returned.
    """
    height, width = there.shape
    left, top = np.floor(x - 0.5), np.floor(y - 0.5)
    across, down = np.clip(x - 0.5 - left, 0, 1), np.clip(y - 0.5 - top, 0, 1)
    mean = np.zeros_like(w)
    matches = np.zeros(w.shape, np.bool_)
    for dy, weight_y in ((0, 1 - down), (1, down)):
        for dx, weight_x in ((0, 1 - across), (1, across)):
            found = there[clip_index(top + dy, height), clip_index(left + dx, width)]
            weight = weight_x * weight_y
            matches |= (weight > SMALLEST_WEIGHT) & (np.abs(found - w) <= SEEN_TOLERANCE * np.maximum(found, w))
            mean += weight * found
    return matches | (np.abs(mean - w) <= SEEN_TOLERANCE * np.maximum(mean, w))


def clip_index(at: Float64Array, size: int) -> IndexArray:
    """Whole-numbered coordinates as indices 0..size - 1; those beyond an end are the end's."""
    return np.clip(at, 0, size - 1).astype(np.int64)


def removal_regions(mask: BoolArray, shadow: BoolArray | None, ring_px: int) -> Regions:
    """Regions `mask`, `ring` (that many px round it), `outside` (beyond the ring) and, where given, `shadow`.

    Args:
        mask: H x W, True = the object.
        shadow: H x W, True = its shadow, which may overlap the mask; the region does not.
        ring_px: radius of the disc by which the mask is dilated.
    """
    grown = dilate_mask(mask, ring_px)
    found = {"mask": mask, "ring": grown & ~mask, "outside": ~grown}
    return found | {"shadow": shadow & ~mask} if shadow is not None else found


def stereo_regions(disparity_left: Float32Array, disparity_right: Float32Array | None = None) -> Regions:
    """What the left camera sees of the right picture: seen, unseen, disoccluded, out-of-view, H x W of the right one.

    A left pixel in column x has the column x - d in the right picture.

    With the right disparity each right pixel is looked up in the left one: another disparity there (by more than
    `SAME_DISPARITY_PX`) hides it. Without, left pixels are carried over row by row: a gap between two neighbours on
    different surfaces is disoccluded, what lies beyond the outermost ones is out of view, and a gap that left pixels without
    disparity may fill is unknown. 0, NaN and inf = no disparity.

    Args:
        disparity_left, disparity_right: H x W px each.
    """
    if disparity_right is None:
        disoccluded, outside, known = gaps_from_left(disparity_left)
    else:
        disoccluded, outside, known = gaps_from_both(disparity_left, disparity_right)
    return {
        "seen": known & ~disoccluded & ~outside,
        "unseen": disoccluded | outside,
        "disoccluded": disoccluded,
        "out-of-view": outside,
    }


def gaps_from_both(left: Float32Array, right: Float32Array) -> tuple[BoolArray, BoolArray, BoolArray]:
    """From both disparities (H x W px): right pixels that are disoccluded, out of view, and of which anything is known."""
    width = left.shape[1]
    has = is_known(right)
    at = np.arange(width) + 0.5 + np.where(has, right, 0)
    outside = has & ((at < 0) | (at >= width))  # < 0: of a rig with doffs
    columns = np.floor(at - 0.5), np.floor(at), np.ceil(at - 0.5)
    neighbours = [np.take_along_axis(left, clip_index(column, width), 1) for column in columns]
    readings = np.stack([np.where(is_known(one), one, np.nan) for one in neighbours])
    with np.errstate(invalid="ignore"):
        matches = (np.abs(readings - right) <= SAME_DISPARITY_PX).any(0)
        nearer = readings[1] > right + SAME_DISPARITY_PX
    hidden = has & ~outside & nearer & ~matches
    return hidden, outside, has & (outside | matches | ~np.isnan(readings[1]))


def gaps_from_left(left: Float32Array) -> tuple[BoolArray, BoolArray, BoolArray]:
    """As `gaps_from_both`, from the left disparity alone (H x W px): each row of left pixels is carried into the right picture's.

    n left pixels without disparity between two with one may fill the n right pixels at either end of the gap.
    """
    width = left.shape[1]
    hidden, outside, known = (np.zeros(left.shape, np.bool_) for _ in range(3))
    for row, disparity in enumerate(left):
        columns = np.flatnonzero(is_known(disparity))
        if not len(columns):
            continue
        landing = columns + 0.5 - disparity[columns].astype(np.float64)
        reached = np.floor(landing).astype(np.int64)
        known[row, reached[(reached >= 0) & (reached < width)]] = True
        furthest = np.maximum.accumulate(landing)
        for one in np.flatnonzero(landing[1:] - furthest[:-1] > 1):
            unsure = columns[one + 1] - columns[one] - 1
            first = max(int(np.floor(furthest[one])) + 1 + unsure, 0)
            last = min(max(int(reached[one + 1]) - unsure, first), width)
            known[row, first:last] = True
            # up to one pixel more is how a slanted surface stretches; beyond that there are two surfaces
            hidden[row, first:last] = landing[one + 1] - furthest[one] > 1 + SAME_DISPARITY_PX
        border = max(int(np.floor(furthest[-1])) + 1 + width - 1 - int(columns[-1]), 0)
        outside[row, border:] = known[row, border:] = True
        border = max(int(np.floor(landing.min())) - int(columns[0]), 0)  # 0 but in a rig with doffs
        outside[row, :border] = known[row, :border] = True
    return hidden, outside, known


def outside_contact_band(mask: BoolArray) -> BoolArray:
    """H x W, False on an object and within EDGE_PX of it, where a mask with its shadow holds the contact line."""
    return ~dilate_mask(mask, EDGE_PX)


def darkened_by_shadow(color: UInt8Array, without: UInt8Array, mask: BoolArray) -> BoolArray:
    """H x W, True where an object reduces the luma by a tenth or more, outside its mask; means of 3 x 3 px are compared.

    color, without: H x W x 3, the picture with and without the object.
    """
    outside = outside_contact_band(mask).astype(np.float32)
    luma = [cv2.cvtColor(each, cv2.COLOR_RGB2GRAY).astype(np.float32) for each in (color, without)]
    shown, true = (box_mean(each, outside, 3) for each in luma)
    return np.asarray((true - shown >= np.maximum(DARKER * true, DARKER_LEVELS)) & (outside > 0))
