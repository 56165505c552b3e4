"""Masks and holes (bool pictures, True = to be filled) in; the same dilated, checked, counted, or filled with the nearest out."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlama.arguments import as_array
from dlama.errors import MaskError, check_same_size
from dlama.geometry.kernels.along_colors import DepthCost, nearest_by_color
from dlama.geometry.rgbd import BoolArray, Float32Array

Box = tuple[slice, slice]
"""Rows and columns, both ends given."""


def disc(radius: int) -> np.ndarray:
    """Kernel of dilation and erosion: all pixels within `radius` of the centre, (2 radius + 1) square, uint8."""
    reach = np.arange(-radius, radius + 1)
    return (reach[:, None] ** 2 + reach**2 <= (radius + 0.5) ** 2).astype(np.uint8)


def dilate_mask(mask: BoolArray, radius: int) -> BoolArray:
    """The mask grown by `radius` pixels (disc); a large radius takes no longer than a small one, and is exact up to 1000 px, to a
    pixel beyond."""
    if radius == 0 or not mask.any():
        return mask.copy()
    if radius < 24:  # beyond, distances take less time
        return cv2.dilate(mask.astype(np.uint8), disc(radius)) > 0
    distance = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE).astype(np.float64)
    return np.rint(distance**2) <= min(radius, sum(mask.shape)) ** 2 + min(radius, sum(mask.shape))


def erode_mask(mask: BoolArray, radius: int) -> BoolArray:
    """The mask shrunk by `radius` pixels (disc); beyond the picture counts as mask."""
    return ~dilate_mask(~mask, radius)


def grow_or_shrink(mask: BoolArray, change: int) -> BoolArray:
    """The mask dilated, or eroded below 0, by so many px (disc)."""
    return dilate_mask(mask, change) if change >= 0 else erode_mask(mask, -change)


def iou(one: BoolArray, other: BoolArray) -> float:
    """Intersection over union of two masks, 0..1; 0 where both are empty."""
    return float((one & other).sum() / max((one | other).sum(), 1))


def square(side: int) -> np.ndarray:
    """Kernel of `morphological_open` and `morphological_close`: side x side pixels, uint8."""
    return np.ones((side, side), np.uint8)


def morphological_open(mask: BoolArray, kernel: np.ndarray) -> BoolArray:
    """The mask (H x W) without the parts that the kernel (`square`, `disc`) does not fit into: thin ones and small ones."""
    # undone by the mirrored kernel about its own middle: with one anchor, as OpenCV's opening has it, those of even size move it
    middle = (kernel.shape[1] - 1) // 2, (kernel.shape[0] - 1) // 2
    return cv2.dilate(cv2.erode(mask.astype(np.uint8), kernel), kernel[::-1, ::-1], anchor=middle) > 0


def morphological_close(mask: BoolArray, kernel: np.ndarray) -> BoolArray:
    """The mask (H x W) with its gaps that the kernel (`square`, `disc`) does not fit into."""
    return ~morphological_open(~mask, kernel)


def dilate_square(mask: BoolArray, side: int) -> BoolArray:
    """The mask (H x W) grown by a square of `side` pixels: by 1 px for 3, its corners too."""
    return cv2.dilate(mask.view(np.uint8), square(side)) > 0


def erode_square(mask: BoolArray, side: int) -> BoolArray:
    """The mask (H x W) shrunk by a square of `side` pixels; beyond the picture counts as mask."""
    return cv2.erode(mask.view(np.uint8), square(side)) > 0


def regions_touching(where: BoolArray, other: BoolArray) -> BoolArray:
    """The 8-connected regions of `where` (H x W) that share a pixel with `other` (H x W)."""
    _, labels = cv2.connectedComponents(where.astype(np.uint8), connectivity=8)
    numbers = np.unique(labels[where & other])
    return np.asarray(np.isin(labels, numbers) & where)


def enclosed_by(mask: BoolArray) -> BoolArray:
    """H x W, the pixels that are not in `mask` and that no path round it, also across corners, joins to the border."""
    outside = np.pad(~mask, 1, constant_values=True)
    return np.asarray(outside & ~regions_touching(outside, ~np.pad(np.ones_like(mask), 1)))[1:-1, 1:-1]


def region_at(where: BoolArray, box: Box) -> BoolArray:
    """The 8-connected region of `where` (H x W) with most pixels in a box of rows and columns; all False: it has none there."""
    _, labels = cv2.connectedComponents(where.astype(np.uint8), connectivity=8)
    counts = np.bincount(labels[box].ravel())
    counts[0] = 0
    return np.asarray(labels == int(counts.argmax())) & bool(counts.any())


def distance_to(where: BoolArray) -> Float32Array:
    """H x W distance in px to the nearest pixel of `where` (H x W), by OpenCV's 5x5 mask."""
    return np.asarray(cv2.distanceTransform((~where).view(np.uint8), cv2.DIST_L2, 5), np.float32)


def nearest_known(known: BoolArray) -> tuple[Float32Array, NDArray[np.intp]]:
    """The nearest pixel of `known` (H x W bool), for every pixel.

    Returns its distance in pixels (H x W float32, OpenCV's 5x5 approximation of the Euclidean one, 0 on known pixels) and its
    flat, row-major index (H x W). Where nothing is known the distance is +inf and the index 0.
    """
    if not known.any():
        return np.full(known.shape, np.inf, np.float32), np.zeros(known.shape, np.intp)
    distance, number = _number_of_nearest(known)
    return distance, np.flatnonzero(known)[number]


def _number_of_nearest(known: BoolArray) -> tuple[Float32Array, NDArray[np.int32]]:
    """As `nearest_known`, of known pixels by number, row by row from 0; one must be known."""
    distance, label = cv2.distanceTransformWithLabels(
        (~known).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    return np.asarray(distance, np.float32), np.asarray(np.subtract(label, 1, out=label), np.int32)


def innermost_pixel(where: BoolArray) -> tuple[int, int]:
    """Row and column of the pixel of `where` (H x W bool, not empty) farthest from all others of the picture."""
    row, column = np.unravel_index(int(nearest_known(~where)[0].argmax()), where.shape)
    return int(row), int(column)


def nearest_along_colors(
    color: Float32Array,
    known: BoolArray,
    free: BoolArray,
    *,
    longest: float,
    start: Float32Array | float = 0.0,
    against: DepthCost | None = None,
) -> NDArray[np.int32]:
    """Flat index (H x W) of the known pixel with the shortest geodesic path in colour to each `free` pixel; negative where
    there is none.

    color: H x W x 3 levels. longest: px, longest path that counts; start: px added to paths from a known pixel; against: costs
    of depth that was measured; None: there are none. See the kernel `nearest_by_color`.
    """
    source = np.where(known, np.arange(known.size, dtype=np.int32).reshape(known.shape), np.int32(-1))
    distance = np.where(known, np.float32(start), np.float32(longest))
    nothing = DepthCost(np.zeros(known.shape, np.float32), 0.0, 0.0)
    nearest_by_color(distance, source, free, color, against or nothing, 2)  # sweeps there and back
    return source


def box_around(mask: BoolArray, margin: int) -> Box:
    """Rows and columns of the box round a mask (H x W), so many pixels larger on each side, within the picture; of an empty mask
    an empty one."""
    rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    box = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
    return larger_box(box, margin, mask.shape)


def larger_box(box: Box, margin: int, hw: tuple[int, ...]) -> Box:
    """Rows and columns of a box, so many pixels larger on each side, within a picture of that height and width."""
    rows, columns = (slice(max(side.start - margin, 0), min(side.stop + margin, n)) for side, n in zip(box, hw))
    return rows, columns


def sides_of(box: Box) -> tuple[int, int]:
    """Height and width of a box in pixels."""
    return box[0].stop - box[0].start, box[1].stop - box[1].start


def fill_with_nearest(values: np.ndarray, known: BoolArray) -> np.ndarray:
    """The values (H x W or H x W x C), those outside `known` (H x W bool) replaced by the nearest known pixel's.

    The values themselves come back where all is known, or nothing.
    """
    if known.all() or not known.any():
        return values
    box = box_around(~known, 1)
    missing, out = ~known[box], values.copy()
    nearest = np.flatnonzero(~missing)[_number_of_nearest(~missing)[1][missing]]
    out[box][missing] = values[box].reshape(missing.size, *values.shape[2:])[nearest]
    return out


def box_mean(values: Float32Array, weight: Float32Array, side: int, least: float = 1e-6) -> Float32Array:
    """H x W: mean of the values in squares of `side` px, by weight (H x W, 0 .. 1); about 0 where less than `least` counts."""
    total, share = (cv2.blur(each, (side, side)) for each in (values * weight, weight))
    return np.asarray(total / np.maximum(share, least), np.float32)


def gaussian_mean(values: np.ndarray, where: BoolArray, sigma: float, least: float = 1e-6) -> Float32Array:
    """H x W (x C): mean of the values in pixels of `where` (H x W), by a Gaussian; about 0 where less than `least` counts."""
    weight = where.astype(np.float32)
    values = values * (weight if values.ndim == 2 else weight[..., None])
    total, share = (cv2.GaussianBlur(each, (0, 0), sigma) for each in (values, weight))
    share = np.maximum(share, np.float32(least))
    return np.asarray(np.divide(total, share if values.ndim == 2 else share[..., None], out=total), np.float32)


def smaller_size(hw: tuple[int, ...], side: float) -> tuple[int, int]:
    """Width and height of a picture of that height and width (first two of `hw`), the longer side `side` pixels at most."""
    height, width = hw[:2]
    by = min(1.0, side / max(height, width))
    return max(1, round(width * by)), max(1, round(height * by))


def repeat_cells(values: np.ndarray, times: int, hw: tuple[int, ...]) -> np.ndarray:
    """Values of a coarser grid (h x w ...), each `times` x `times` times, cut to a height and width (`hw`)."""
    return values.repeat(times, 0).repeat(times, 1)[: hw[0], : hw[1]]


def shrink_mask(mask: BoolArray, wh: tuple[int, int]) -> Float32Array:
    """h x w: the share of a mask (H x W) in each pixel of a smaller size (width, height)."""
    return np.asarray(cv2.resize(mask.astype(np.float32), wh, interpolation=cv2.INTER_AREA), np.float32)


def shrink_known(values: np.ndarray, known: BoolArray, wh: tuple[int, int]) -> tuple[Float32Array, Float32Array]:
    """(h x w x C means of the known values, h x w share that is known) of H x W x C values in a smaller size (width, height)."""
    weight, share = known.astype(np.float32), shrink_mask(known, wh)
    planes = np.moveaxis(values.reshape(*known.shape, -1), 2, 0)  # one at a time: weighted they are floats
    sums = np.stack([cv2.resize(plane * weight, wh, interpolation=cv2.INTER_AREA) for plane in planes], 2)
    return np.asarray(sums / np.maximum(share, np.float32(1e-6))[..., None], np.float32), share


def looks_inverted(mask: BoolArray) -> bool:
    """True if a mask (H x W) covers most of the picture and of its border, so that an object stays and the scene goes."""
    border = np.concatenate([mask[0], mask[-1], mask[1:-1, 0], mask[1:-1, -1]])
    return bool(mask.mean() > 0.5 and border.mean() > 0.6)


def check_mask(mask: ArrayLike, hw: tuple[int, int]) -> BoolArray:
    """The mask as an array. MaskError unless it is a bool picture of that size that removes something and leaves something."""
    mask = as_array(mask, "mask", "a bool array H x W")
    if mask.dtype != np.bool_ or mask.ndim != 2:
        advice = "; of 0 and 255, or 0 and 1: mask > 0" if mask.ndim == 2 and mask.dtype.kind in "uif" else ""
        raise MaskError(
            f"`mask` is {mask.dtype} with shape {mask.shape}; bool H x W is expected, True = remove{advice}"
        )
    check_same_size("`mask`", mask.shape, "the picture", hw, MaskError)
    if not mask.any():
        raise MaskError("`mask` is empty: it marks nothing to remove (is its polarity 'known'?)")
    if mask.all():
        raise MaskError("`mask` is full: it leaves nothing to fill from (is its polarity 'known'?)")
    return mask
