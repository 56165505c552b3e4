"""Planes with a hole in; the hole filled by a network that sees crops around it, padded and tiled as it needs, out.

A crop is a group of holes with context, so a small hole costs little. A crop above the pixel budget is cut into
overlapping tiles, so memory is bounded; their seams are blended inside the hole. Nothing is resized, but
for a network that takes one size only: larger crops are shrunk to it and its result is enlarged, smaller ones are padded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from dlama.geometry.holes import repeat_cells, shrink_known, smaller_size
from dlama.geometry.rgbd import BoolArray, Float32Array

Network = Callable[[Float32Array, BoolArray], Float32Array]
"""(B x C x h x w planes, h x w hole) -> B x C x h x w; h and w as the layout says."""
Box = tuple[int, int, int, int]
"""top, bottom, left, right; the ends are not part of it."""

CONTEXT = 48
"""Least context in pixels on each side of a group of holes."""
CELL = 16
"""Pixels: holes are grouped on a grid of such cells; neighbouring cells are one group."""
OVERLAP = 128
"""Pixels by which tiles overlap."""


@dataclass(frozen=True)
class Layout:
    """What sizes a network takes, and how much at once."""

    multiple: int = 8
    minimum: int = 16
    budget: int = 1 << 20
    """Largest crop in pixels; larger ones are tiled."""
    call_cost: int = 96 * 96
    """Pixels that a call costs however small the crop (decides which crops are merged)."""
    side: int | None = None
    """The largest height and width the network takes."""


def fill_crops(planes: Float32Array, hole: BoolArray, network: Network, layout: Layout) -> Float32Array:
    """B x C x H x W planes with the pixels of `hole` (H x W bool) filled by the network, all others bit for bit as given."""
    out = planes.copy()
    for box, group in crops(hole, layout):
        top, bottom, left, right = box
        part = np.s_[..., top:bottom, left:right]
        tiles = list(tiles_of(box, group, layout))
        if len(tiles) == 1:
            filled = call_padded(planes[part], hole[part], network, layout)
        else:
            filled = blend_tiles(planes, hole, box, tiles, network, layout)
        out[part] = np.where(group[top:bottom, left:right], filled, out[part])
    return out


def call_padded(planes: Float32Array, hole: BoolArray, network: Network, layout: Layout) -> Float32Array:
    """One call: padded by reflection below and at the right to the multiple and the minimum (or the one side), cropped back."""
    height, width = hole.shape
    if layout.side is not None and max(height, width) > layout.side:
        return call_resized(planes, hole, network, layout, layout.side)
    below, right = (padded_size(n, layout) - n for n in (height, width))
    pad = ((0, below), (0, right))
    seen = np.pad(planes, ((0, 0), (0, 0), *pad), mode="reflect")
    return network(seen, np.pad(hole, pad, mode="reflect"))[..., :height, :width]


def call_resized(planes: Float32Array, hole: BoolArray, network: Network, layout: Layout, side: int) -> Float32Array:
    """One call for a crop larger than `side`: shrunk by averaging known pixels, the longer side to `side`, and enlarged again."""
    height, width = hole.shape
    size = smaller_size(hole.shape, side)
    means, share = shrink_known(np.moveaxis(planes.reshape(-1, height, width), 0, 2), ~hole, size)
    small = np.moveaxis(means, 2, 0).reshape(*planes.shape[:2], *share.shape)
    filled = call_padded(small, share < 0.5, network, layout).reshape(-1, *share.shape)
    large = [
        cv2.resize(plane, (width, height), interpolation=cv2.INTER_CUBIC) for plane in np.ascontiguousarray(filled)
    ]
    return np.stack(large).reshape(planes.shape).astype(np.float32)


def padded_size(size: int, layout: Layout) -> int:
    """The smallest size the network takes that is at least `size`."""
    expected = -(-max(size, layout.minimum) // layout.multiple) * layout.multiple
    return expected if layout.side is None else min(expected, layout.side)


def crops(hole: BoolArray, layout: Layout) -> Iterator[tuple[Box, BoolArray]]:
    """Each group of holes (H x W bool) and the box that is run for it; every hole pixel is in exactly one group."""
    if not hole.any():
        return
    number, cells = cell_groups(hole)
    owner, boxes = merge_boxes(boxes_with_context(hole, number, cells, layout), layout)
    whole = np.array([[0, hole.shape[0], 0, hole.shape[1]]])
    if pixel_cost(boxes, layout).sum() >= pixel_cost(whole, layout).sum() and hole.size <= layout.budget:
        yield (0, hole.shape[0], 0, hole.shape[1]), hole
        return
    for k in range(len(boxes)):
        top, bottom, left, right = map(int, boxes[k])
        yield (top, bottom, left, right), hole & np.isin(number, 1 + np.flatnonzero(owner == k))


def cell_groups(hole: BoolArray) -> tuple[np.ndarray, int]:
    """H x W int number of each pixel's group of neighbouring cells with holes (0 = no hole in its cell), and how many."""
    height, width = hole.shape
    rows, columns = -(-height // CELL), -(-width // CELL)
    full = np.zeros((rows * CELL, columns * CELL), bool)  # `reduceat` takes twice the time
    full[:height, :width] = hole
    cells = full.reshape(rows, CELL, columns, CELL).any((1, 3))
    count, number = cv2.connectedComponents(np.asarray(cells, np.uint8), connectivity=8)
    return repeat_cells(number, CELL, hole.shape), count - 1


def boxes_with_context(hole: BoolArray, number: np.ndarray, count: int, layout: Layout) -> np.ndarray:
    """N x 4: the bounding box of each group's holes, with context."""
    rows, columns = np.nonzero(hole)
    group = number[rows, columns] - 1
    box = np.tile([hole.shape[0], 0, hole.shape[1], 0], (count, 1))
    for column, value, extreme in ((0, rows, np.minimum), (2, columns, np.minimum)):
        extreme.at(box[:, column], group, value)
        np.maximum.at(box[:, column + 1], group, value + 1)
    return np.array([add_context(tuple(one), hole.shape, layout) for one in box.tolist()])


def add_context(box: Box, hw: tuple[int, ...], layout: Layout) -> Box:
    """A box with context on each side, .4 of the side of a square as large or CONTEXT, inside the picture, of a size the network
    takes where there is room."""
    top, bottom, left, right = box
    by = max(CONTEXT, round(0.4 * ((bottom - top) * (right - left)) ** 0.5))
    square = 0 if layout.side is None else max(bottom - top, right - left) + 2 * by
    ends: list[int] = []
    for start, end, size in ((top - by, bottom + by, hw[0]), (left - by, right + by, hw[1])):
        length = min(max(padded_size(min(end, size) - max(start, 0), layout), square), size)
        begin = min(max(start, 0), size - length)
        ends += [begin, begin + length]
    return ends[0], ends[1], ends[2], ends[3]


def pixel_cost(boxes: np.ndarray, layout: Layout) -> np.ndarray:
    """Pixels that each box (N x 4) costs."""
    return np.maximum((boxes[:, 1] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 2]), layout.call_cost)


def merge_boxes(boxes: np.ndarray, layout: Layout) -> tuple[np.ndarray, np.ndarray]:
    """Boxes merged two by two while one call costs no more than two: (which merged box each went to, merged boxes)."""
    boxes = boxes.copy()
    owner, alive = np.arange(len(boxes)), np.ones(len(boxes), bool)
    k = 0
    while k < len(boxes):
        both = np.where([True, False, True, False], np.minimum(boxes[k], boxes), np.maximum(boxes[k], boxes))
        cost = pixel_cost(boxes, layout)
        gain = np.where(alive, cost + cost[k] - pixel_cost(both, layout), -1)
        gain[k] = -1
        best = int(gain.argmax())
        if not alive[k] or gain[best] < 0:
            k += 1
            continue
        boxes[best], alive[k] = both[best], False
        owner[owner == k] = best
        k = min(k, best)
    left = np.flatnonzero(alive)
    return np.searchsorted(left, owner), boxes[left]


def tiles_of(box: Box, group: BoolArray, layout: Layout) -> Iterator[Box]:
    """Overlapping tiles that cover a box, none above the budget, those without a hole left out; one if it fits."""
    top, bottom, left, right = box
    height, width = bottom - top, right - left
    if height * width <= layout.budget:
        yield box
        return
    side = max(int(layout.budget**0.5), layout.minimum)
    tall = min(height, side) if width > side else max(1, layout.budget // width)
    wide = min(width, max(layout.budget // tall, layout.minimum))
    for y in tile_starts(height, tall):
        for x in tile_starts(width, wide):
            tile = top + y, top + y + tall, left + x, left + x + wide
            if group[tile[0] : tile[1], tile[2] : tile[3]].any():
                yield tile


def tile_starts(length: int, size: int) -> list[int]:
    """Where tiles of `size` begin so that they cover `length` and overlap by OVERLAP (or a quarter of a small tile)."""
    if size >= length:
        return [0]
    step = size - min(OVERLAP, size // 4)
    count = 1 + -(-(length - size) // step)
    return [round(k * (length - size) / (count - 1)) for k in range(count)]


def blend_tiles(
    planes: Float32Array, hole: BoolArray, box: Box, tiles: list[Box], network: Network, layout: Layout
) -> Float32Array:
    """The box's planes, each pixel the mean of its tiles weighted by distance from their borders.

    Tiles with most known go first; one in which less than 2 % is known continues from what those before it filled.
    """
    top, bottom, left, right = box
    total = np.zeros((*planes.shape[:2], bottom - top, right - left), np.float32)
    weight = np.zeros(total.shape[2:], np.float32)
    for tile in sorted(tiles, key=lambda t: float(hole[t[0] : t[1], t[2] : t[3]].mean())):
        here = np.s_[..., tile[0] : tile[1], tile[2] : tile[3]]
        inside = np.s_[..., tile[0] - top : tile[1] - top, tile[2] - left : tile[3] - left]
        seen, open_ = planes[here], hole[here]
        if open_.mean() > 0.98 and weight[inside].any():
            earlier = open_ & (weight[inside] > 0)
            seen = np.where(earlier, total[inside] / np.maximum(weight[inside], 1e-9), seen)
            open_ = open_ & ~earlier
        share = np.multiply.outer(tile_weight(tile[1] - tile[0]), tile_weight(tile[3] - tile[2]))
        filled = np.where(open_, call_padded(seen, open_, network, layout), seen) if open_.any() else seen
        total[inside] += share * filled
        weight[inside] += share
    return np.asarray(total / np.maximum(weight, 1e-9), np.float32)


def tile_weight(size: int) -> Float32Array:
    """Weight along one side of a tile: 0 < w <= 1, rising over half the overlap from either end."""
    distance = np.minimum(np.arange(size), np.arange(size)[::-1]) + 1
    return np.minimum(1, distance / max(1, min(OVERLAP, size // 4))).astype(np.float32)
