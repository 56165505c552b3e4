"""A picture and the grid of its depth in; how its surfaces mix at depth edges, and the two layers that show it, out.

At the border of an object a pixel of the picture is a mix of it and of what lies behind it, most of all of hair and leaves; and
estimated depth is a few pixels off. Near each depth edge the near surface's share of every pixel is found from the colours that
both have further off (sampling, as in Gastal and Oliveira, 2010, without their local search). The near surface is continued
over the edge and drawn with that share over the far one, continued under it: at the source camera the two give the picture.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.drawing.grid_mesh import join_neighbours, mesh_grid
from dlama.geometry.holes import fill_with_nearest, nearest_known
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT, inverse_with_margin
from dlama.geometry.kernels.jit import as_input, in_bands
from dlama.geometry.kernels.matting import Border, Unmixed, separate, smooth
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View

APART, STEEP = np.float32(0.98), np.float32(0.8)
"""Inverse depth of the far surface in the near one's, at most: what is closer needs no border of its own; and of neighbours
of one surface, at least: what is steeper is a blurred edge."""
RINGS, DIRECTIONS = (0.8, 1.4, 2.2), 10
"""Where colours are sampled: distances in the reach, and how many on each ring."""
NOISE = 0.08
"""Shares this close to 0 or 1 are taken as that: noise of the picture."""
THIN = 0.3
"""Share below which the near surface's colour is that of a sample: its own says too little."""
STEPS = ((RIGHT, np.s_[:, :-1], np.s_[:, 1:]), (DOWN, np.s_[:-1], np.s_[1:]))


class SoftEdges(NamedTuple):
    """How two surfaces mix near depth edges. h x w: the grid, H x W: the picture."""

    band: BoolArray
    """h x w: where they may."""
    near_side: BoolArray
    """h x w: the grid's depth there is the near surface's."""
    near: Float32Array
    """h x w: inverse depth (1/m) of the near surface, continued over the edge."""
    far: Float32Array
    """h x w: inverse depth (1/m) of the far surface, continued under the near one."""
    alpha: Float32Array
    """H x W: share of the near surface, 0..1; outside the band 1 on its side and 0 on the other."""
    front: UInt8Array
    """H x W x 3: colour of the near surface."""
    back: UInt8Array
    """H x W x 3: colour of the far surface."""
    sample: UInt8Array
    """H x W x 3: of the near surface further off, which `front` was found with."""


def complete_surfaces(view: View, least: float = 0.0) -> tuple[Float32Array, UInt8Array]:
    """Depth of a layer (H x W metres, 0 = hole) and which neighbours are joined; a flying pixel has the nearest surface's depth.

    least: step in inverse depth (1/m) up to which neighbours are one surface.
    """
    depth, _ = mesh_grid(view, least)
    filled = np.where(view.hole, 0, fill_with_nearest(depth, depth > 0))
    return join_depth(filled, view.camera, max(least, view.noise_step))


def join_depth(depth: Float32Array, camera: Camera, least: float) -> tuple[Float32Array, UInt8Array]:
    """The depth (H x W metres, 0 = hole), and which neighbours are joined: as `join_neighbours` says, all that APART has as one
    surface, and none that are steeper than STEEP."""
    depth = np.asarray(depth, np.float32)
    joined, w = join_neighbours(inverse_with_margin(depth, depth == 0), camera, least), inverse_depth(depth)
    for bit, here, there in STEPS:
        one, other = w[here], w[there]
        ratio = np.minimum(one, other) / np.maximum(np.maximum(one, other), np.float32(1e-9))
        joined[here] |= np.where(ratio >= APART, np.uint8(bit), np.uint8(0))
        joined[here] &= np.where(ratio < STEEP, np.uint8(~bit & 3), np.uint8(3))
    return depth, joined


def separate_colors(view: View) -> View:
    """The view with the colours that its two surfaces have near depth edges in place of what is mixed of them."""
    depth, joined = complete_surfaces(view)
    soft = find_soft_edges(view.color, inverse_depth(depth), joined, 1)
    least, most = np.minimum(view.color, soft.sample), np.maximum(view.color, soft.sample)
    front = np.clip(soft.front, least, most)  # what noise it has grows by 1 / alpha, which no alpha takes back here
    return view.with_planes(color=np.where(soft.near_side[..., None], front, soft.back))


def find_soft_edges(color: UInt8Array, w: Float32Array, joined: UInt8Array, step: int) -> SoftEdges:
    """The soft edges of a picture (H x W x 3) whose grid has one pixel in step x step.

    w: h x w inverse depth (1/m), 0 = hole; joined: its bits RIGHT and DOWN.
    """
    reach = max(2.0, 0.006 * w.shape[1])  # px of the grid, to each side of an edge
    near_edge, far_edge = find_edges(w, joined)
    (to_near, at_near), (to_far, at_far) = nearest_known(near_edge), nearest_known(far_edge)
    near, far = w.ravel()[at_near], w.ravel()[at_far]
    middle = np.sqrt(near * far)
    near_side = w > middle
    near, far = np.where(near_side, w, near), np.where(near_side, far, w)
    half = np.float32(0.5)
    side = np.where(near_side, to_far - half, half - to_near)
    band = (np.abs(side) < reach) & (far < near * APART) & (far > 0)
    side = np.where(band, side, np.copysign(np.float32(reach), side))
    sizes = color.shape[1], color.shape[0]
    alpha = enlarge(near_side, step, sizes).astype(np.float32)
    front, back = color.copy(), color.copy()
    color = as_input(color)
    pixels = np.argwhere(enlarge(band, step, sizes)).astype(np.int32, order="C")
    turns = 2 * math.pi * (np.arange(DIRECTIONS) + np.arange(len(RINGS))[:, None] / len(RINGS)) / DIRECTIONS
    rings = np.array(RINGS)[:, None] * reach * step
    offsets = np.rint(np.stack([rings * np.sin(turns), rings * np.cos(turns)], 2)).astype(np.int32).reshape(-1, 2)
    room = np.empty((len(pixels), len(offsets)), np.uint8)
    border, out = Border(color, w, middle, side, step, float(reach)), Unmixed(alpha, front, back)
    in_bands(separate, len(pixels), border, pixels, offsets, room, out, band=1024)
    smoothed = np.empty(len(pixels), np.float32)
    in_bands(smooth, len(pixels), pixels, color, alpha, smoothed, band=1024)
    at = pixels[:, 0], pixels[:, 1]
    share = np.clip((smoothed - NOISE) / (1 - 2 * NOISE), 0, 1)
    alpha[at] = share
    own, share = color[at].astype(np.float32), share[:, None]
    back[at] = behind = np.where(share > 0, back[at], own)
    unmixed = np.clip(np.rint((own - (1 - share) * behind) / np.maximum(share, THIN)), 0, 255)
    sample = front.copy()
    front[at] = np.where(share > THIN, unmixed, front[at])
    return SoftEdges(band, near_side, near, far, alpha, front, back, sample)


def find_edges(w: Float32Array, joined: UInt8Array) -> tuple[BoolArray, BoolArray]:
    """H x W: the pixels at the near side of a depth edge, and those at the far side."""
    near, far = np.zeros(w.shape, bool), np.zeros(w.shape, bool)
    for bit, here, there in STEPS:
        cut = ((joined[here] & bit) == 0) & (w[here] > 0) & (w[there] > 0)
        for one, other in ((here, there), (there, here)):
            nearer = cut & (w[other] < w[one] * APART)
            near[one] |= nearer
            far[other] |= nearer
    return near, far


def enlarge(plane: np.ndarray, step: int, size: tuple[int, int]) -> np.ndarray:
    """The plane of the grid in the picture's size (width, height): each value step x step times, the last ones repeated."""
    rows, columns = (np.minimum(np.arange(n) // step, cells - 1) for n, cells in zip(size[::-1], plane.shape))
    return np.asarray(plane[rows[:, None], columns])
