"""Numba kernel of joint upsampling: a small map, which of its pixels are joined, and the picture in; the large map out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.kernels.jit import Flag, Real, Whole, kernel, piece
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.perception.kernels.edge_median import color_difference


@piece
def leads_to(own: Whole, other: Whole, top: Flag, bottom: Flag, before: Flag, after: Flag) -> Flag:
    """Whether joints lead from one pixel of a quad to another (0, 1 above, 2, 3 below); top, bottom: of the two above, of the two
    below; before, after: of the two on the left, of the two on the right."""
    level, upright = (top if own < 2 else bottom), (before if own % 2 == 0 else after)
    other_level, other_upright = (bottom if own < 2 else top), (after if own % 2 == 0 else before)
    if other == own:
        return True
    if other == own ^ 1:
        return level or (upright and other_level and other_upright)
    if other == own ^ 2:
        return upright or (level and other_upright and other_level)
    return (level and other_upright) or (upright and other_level)


@kernel
def upsample_joined(
    first: Whole,
    last: Whole,
    w: Float32Array,
    joined: UInt8Array,
    small_color: UInt8Array,
    color: UInt8Array,
    alike: Float32Array,
    least_near: Real,
    room: Float32Array,
    out: Float32Array,
) -> None:
    """Rows [first, last) of `out` (H x W metres, 0 = missing, inf = far): each pixel lies on the surface of one of the four map
    pixels round it, the one that is near and of like colour, and is interpolated among those of the four that are on it.

    w: h x w inverse depth, 0 = far, below 0 = missing; joined: h x w, RIGHT and DOWN of each pixel
    that lies on one surface with that neighbour; small_color: h x w x 3, the picture at the map's size;
    color: H x W x 3; alike: weight by squared colour difference, the last one of all greater ones, too; least_near: added to the
    weights by distance, so that a pixel of unlike colour may be left; room: H x 2 x 4, scratch.
    """
    rows, columns = w.shape
    height, width = out.shape
    most = len(alike) - 1
    for row in range(first, last):
        near, score = room[row, 0], room[row, 1]
        y = (row + 0.5) * rows / height - 0.5
        upper = min(max(int(np.floor(y)), 0), max(rows - 2, 0))
        lower, down = min(upper + 1, rows - 1), np.float32(min(max(y - upper, 0.0), 1.0))
        for column in range(width):
            x = (column + 0.5) * columns / width - 0.5
            left = min(max(int(np.floor(x)), 0), max(columns - 2, 0))
            right, across = min(left + 1, columns - 1), np.float32(min(max(x - left, 0.0), 1.0))
            near[0], near[1] = (1 - down) * (1 - across), (1 - down) * across
            near[2], near[3] = down * (1 - across), down * across
            nearest = 0
            for k in range(1, 4):
                if near[k] > near[nearest]:
                    nearest = k
            if w[lower if nearest >= 2 else upper, right if nearest % 2 else left] < 0:
                out[row, column] = 0
                continue
            top, bottom = joined[upper, left] & RIGHT > 0, joined[lower, left] & RIGHT > 0
            before, after = joined[upper, left] & DOWN > 0, joined[upper, right] & DOWN > 0
            if top and bottom and before and after:
                value = near[0] * w[upper, left] + near[1] * w[upper, right]
                value += near[2] * w[lower, left] + near[3] * w[lower, right]
                out[row, column] = np.float32(1) / value if value > 0 else np.float32(np.inf)
                continue
            own = 0
            for k in range(4):
                at_y, at_x = lower if k >= 2 else upper, right if k % 2 else left
                unlike = color_difference(color, row, column, small_color, at_y, at_x)
                score[k] = (near[k] + least_near) * alike[min(unlike, most)] if w[at_y, at_x] >= 0 else -1
                if score[k] > score[own]:
                    own = k
            sums, weights = np.float32(0), np.float32(0)
            for k in range(4):
                if leads_to(own, k, top, bottom, before, after):
                    sums += near[k] * w[lower if k >= 2 else upper, right if k % 2 else left]
                    weights += near[k]
            value = w[lower if own >= 2 else upper, right if own % 2 else left]
            if weights > 1e-3:
                value = sums / weights
            out[row, column] = np.float32(1) / value if value > 0 else np.float32(np.inf)
