"""A layer in; its depth without flying pixels, which neighbouring pixels are one surface, and its depth without gaps, out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin, has_code
from dlama.geometry.depth_noise import LINES, REACH, noise_of_lines, noise_to_average
from dlama.geometry.drawing.picture_edges import JUMP, align_edges, behind_edges, edge_ratio
from dlama.geometry.frames.stored import Layer
from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.kernels import depth_edges as edges
from dlama.geometry.kernels.drawing.hole_types import RANK_OF_TYPE
from dlama.geometry.kernels.jit import as_input, in_bands
from dlama.geometry.kernels.smoothing import average_pairs
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, paste
from dlama.geometry.view import View


class Joints(NamedTuple):
    """What is kept of a layer's mesh, 2 bytes a pixel."""

    flying: BoolArray
    """H x W, True at flying pixels: depth strictly between two adjacent surfaces, joined to neither."""
    joined: UInt8Array
    """H x W, `join_neighbours`."""


def find_joints(view: View) -> Joints:
    """A view's flying pixels, and which neighbours are joined."""
    _, flying, w = remove_flying_pixels(view, view.noise_step)
    return Joints(flying, join_neighbours(w, view.camera, view.noise_step))


def remove_flying_pixels(view: View, step: float = 0.0) -> tuple[Float32Array, BoolArray, Float32Array]:
    """Depth without holes and flying pixels (0), its edges aligned with the picture; the flying pixels; and inverse depth with
    a margin, for `depth_edges`. step: in inverse depth (1/m), up to which neighbours are one surface at least."""
    placed, mixed, _ = view.find_once(align_edges)
    if Origin.ESTIMATED in view.origins:
        mixed = mixed | behind_edges(view)
    unknown = view.hole | mixed
    w = edges.inverse_with_margin(placed, unknown)
    depth, fly = np.empty_like(placed), np.empty_like(view.hole)
    grid = edge_grid(w, view.camera, step)
    in_bands(edges.reject_flying, len(depth), grid, as_input(placed), unknown, depth, fly)
    fly |= mixed
    w[edges.PAD : -edges.PAD, edges.PAD : -edges.PAD][fly] = 0
    return depth, fly, w


def join_neighbours(w: Float32Array, camera: Camera, step: float = 0.0) -> UInt8Array:
    """H x W bits RIGHT (1), DOWN (2): is a pixel joined to its right, its lower one? w, step: as of `remove_flying_pixels`."""
    joined = np.empty(camera.hw, np.uint8)
    in_bands(edges.join, len(joined), edge_grid(w, camera, step), joined)
    return joined


def edge_grid(w: Float32Array, camera: Camera, step: float) -> edges.Grid:
    """What kernels tell edges by, with the steps that noise alone makes, of four standard deviations. w, step: as of
    `remove_flying_pixels`."""
    ratio = edge_ratio(camera)
    some = [lines[edges.PAD : -edges.PAD : max(1, len(lines) // LINES), edges.PAD : -edges.PAD] for lines in (w, w.T)]
    noise = noise_of_lines(((one, one > 0) for one in some), REACH)
    if 2.5 * noise.constant > ratio * noise.middle:  # surfaces tear; else `ratio` covers it, at the median
        step = max(step, 4 * noise.constant)
    return edges.Grid(w, math.hypot(ratio, 4 * noise.share), step)


def mesh_grid(view: View, step: float = 0.0) -> tuple[Float32Array, UInt8Array]:
    """Depth without holes and flying pixels (0), and which neighbours are joined into one surface.

    step: as of `remove_flying_pixels`; up to the view's `noise_step` its joints are found once.
    """
    if step > view.noise_step:
        depth, _, w = remove_flying_pixels(view, step)
        return depth, join_neighbours(w, view.camera, step)
    flying, joined = view.find_once(find_joints)
    depth = np.zeros(flying.shape, np.float32)
    paste(view.find_once(align_edges).depth, ~(flying | view.hole), depth)
    return depth, joined


def smooth_noise(view: View, depth: Float32Array) -> Float32Array:
    """Depth of a layer's mesh (H x W metres) whose measured noise is averaged within surfaces; the same where there is none.

    It is drawn where other cameras see the layer: noise of depth moves colours aside there.
    """
    noise = view.find_once(noise_to_average)
    if not noise.constant:
        return depth
    share = 4 * noise.share  # standard deviations by which a pair differs from the pixel between
    constant = 0.0 if share else 4 * noise.constant
    w, out = inverse_depth(depth), np.empty_like(depth)
    in_bands(average_pairs, len(w), as_input(w), constant, share, 3, out)
    return inverse_depth(out)


def close_grid(view: View, removals: tuple[Layer, ...]) -> tuple[Float32Array, UInt8Array]:
    """Depth of a layer with every gap closed, and the rank of the hole type of what was closed.

    Removed objects get their own depth back, sensor holes the depth of the nearest pixel, far pixels a large one.
    """
    depth = view.known_depth
    ranked = view.hole & has_code(view.hole_type, HoleType.SENSOR, HoleType.OBJECT)
    rank = RANK_OF_TYPE.take(view.hole_type) * ranked
    for removed in removals:
        if removed.camera.same_view_as(view.camera):
            part = removed.load()
            depth = np.where((depth == 0) & part.valid, part.depth, depth)
    horizon = 100 * float(np.where(depth < np.inf, depth, np.float32(0)).max()) or 1e4
    depth = np.minimum(depth, np.float32(horizon))
    return fill_with_nearest(depth, depth > 0), rank


SIDES = ((edges.RIGHT, np.s_[:, :-1], np.s_[:, 1:]), (edges.DOWN, np.s_[:-1], np.s_[1:]))
"""Bits of joints, and the pixels that they join."""


class Seen(NamedTuple):
    """What other cameras see of a view, H x W each."""

    depth: Float32Array
    """Metres, 0 = nothing."""
    joined: UInt8Array
    """`join_neighbours`."""
    far: BoolArray


def find_mixed_fills(view: View) -> tuple[BoolArray, UInt8Array]:
    """What was filled next to something nearer that was not (H x W), and which neighbours are joined without it: the nearer
    colour is mixed into it, as it is at the edges of a picture, and another camera would see that in the background."""
    (depth, joined), filled = mesh_grid(view), view.origin == Origin.FILLED.value
    mixed, w = np.zeros(depth.shape, np.bool_), inverse_depth(depth)
    for bit, first, second in SIDES:
        apart = (joined[first] & bit) == 0
        mixed[first] |= apart & ~filled[second] & (w[second] - w[first] > JUMP * w[second])
        mixed[second] |= apart & ~filled[first] & (w[first] - w[second] > JUMP * w[first])
    mixed &= filled & (view.hole_type != HoleType.NONE.value) & ~view.hole
    joined = joined * ~mixed
    for bit, first, second in SIDES:
        joined[first] &= ~(np.uint8(bit) * mixed[second])
    return mixed, joined


def seen_from_elsewhere(view: View) -> Seen:
    """The depth and joints of `mesh_grid` and the far pixels, without `find_mixed_fills`."""
    depth, joined = mesh_grid(view)
    if Origin.FILLED not in view.origins:
        return Seen(depth, joined, view.far)
    mixed, joined = view.find_once(find_mixed_fills)
    depth[mixed] = 0
    return Seen(depth, joined, view.far & ~mixed)
