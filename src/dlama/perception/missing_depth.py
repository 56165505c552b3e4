"""A picture, and its depth where it is known, in; depth that alone is missing, continued along the colours, out.

A depth camera misses depth at the border of its picture, next to near objects, on glass and on black surfaces, where colours
are all known. Every such pixel takes the plane of the known pixel with the shortest geodesic path in colour. Depth on no plane
is relaxed to be smooth between known pixels, but not across picture edges. Between single readings, as of a LIDAR, it is the
same; and what is large and begins where the sensor's range ended lies beyond it: it is no hole in a near surface.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.arguments import check_arguments
from dlama.geometry.holes import dilate_mask, distance_to, fill_with_nearest, nearest_along_colors, nearest_known
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import depth_from_inverse, inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array, freeze, is_valid
from dlama.geometry.view import View
from dlama.perception.kernels.relaxation import conductances, relax
from dlama.perception.planes import SMOOTH, KnownSurfaces, plane_values_at
from dlama.perception.sky import find_plain_sky

RIM_PX = 4
"""Width of the rim of measured surfaces that does not extend along colours where there is sky; single readings have none."""
AT_ONCE = 8
"""Sweeps of `relax` that run together."""
PIECE = 1 << 16
"""Pixels that are worked on at a time."""
LEAST_SHARE = 0.04
"""Least share of the picture of a missing part beyond the range."""


class DepthByColor(NamedTuple):
    """A view's depth with missing pixels filled along colours."""

    inverse_depth: Float32Array
    """H x W, 1/m: as known, and where missing and reached."""
    label: NDArray[np.int8]
    """H x W: -1 no plane, 0 sky, k on the k-th plane."""
    reached: BoolArray
    """H x W, True where depth alone was missing and a lawful path leads from a known pixel."""


def find_known_surfaces(
    color: UInt8Array, depth: Float32Array, missing: BoolArray, seed: int = 0
) -> tuple[KnownSurfaces, BoolArray]:
    """The known surfaces, and H x W, True where depth alone is missing and colours say that there is sky; the same seed finds the
    same planes.

    color: H x W x 3; depth: H x W metres, 0 = unknown, inf = far; missing: H x W, True where depth alone is missing.
    """
    sky = find_plain_sky(color, missing, depth)
    return KnownSurfaces.of(inverse_depth(depth), is_valid(depth), np.isposinf(depth) | sky, seed), sky


def fill_along_colors(
    color: UInt8Array,
    missing: BoolArray,
    hole: BoolArray,
    surfaces: KnownSurfaces,
    sky: BoolArray,
    is_lawful: Callable[[Float32Array, BoolArray], BoolArray] | None = None,
) -> DepthByColor:
    """Inverse depth and labels of the pixels of `missing` that a path reaches.

    color: H x W x 3; missing: H x W, True where depth alone is missing; hole: H x W, True where depth is unknown: `missing`, and
    where colours are, too; sky: H x W, True in pixels of `missing` that are known to be sky. Noisy depth is a matcher's, which
    bleeds: there pixels of no plane count as 15 px farther off. is_lawful: says of inverse depth (H x W) where, among some pixels
    (H x W), no other camera looked past it; where one did, no path counts: one colour may lead from an object to what is behind.
    """
    w, label = surfaces.inverse_depth, surfaces.label
    smooth_color = fill_with_nearest(color, missing | ~hole).astype(np.float32)
    cv2.GaussianBlur(smooth_color, (0, 0), 1.5, dst=smooth_color)  # noise is no edge
    start = (label == SMOOTH) * np.float32(15) if surfaces.noise else 0.0
    known, free = ~hole | sky, missing & ~sky
    if sky.any():
        # Its border is where the picture has it: roofs, whose blurred colours touch the sky, begin farther inside.
        inside = ~hole & ~dilate_mask(missing, RIM_PX)
        rim = ~hole & ~inside & dilate_mask(inside, RIM_PX + 1)
        known, free = known & ~rim, free | rim
    source = nearest_along_colors(smooth_color, known, free, longest=1e6, start=start)
    reached = missing & (source >= 0)
    out, labels = w.copy(), label.copy()
    places = np.flatnonzero(reached)
    for first in range(0, len(places), PIECE):
        some = places[first : first + PIECE]
        nearest = source.ravel()[some]
        labels.ravel()[some] = of_known = label.ravel()[nearest]
        at = np.divmod(some, w.shape[1])
        out.ravel()[some] = extend_surfaces(w, of_known, surfaces.planes, at, nearest)
    del source, places
    if is_lawful is not None:
        reached &= is_lawful(out, reached)
        out[missing & ~reached], labels[missing & ~reached] = 0, SMOOTH
    relax_depth(out, reached & (labels == SMOOTH), smooth_color)
    return DepthByColor(out, labels, reached)


def relax_depth(w: Float32Array, loose: BoolArray, color: Float32Array) -> None:
    """Relax the `loose` pixels (H x W) of inverse depth (H x W, 1/m) towards their neighbours, less across picture edges.

    In 80 sweeps at most, or until none changes by 3e-4 of the median. color: H x W x 3.
    """
    if not loose.any():
        return
    across, down, begin = np.empty_like(w), np.empty_like(w), w.copy()
    in_bands(conductances, len(w), across, down, dilate_mask(loose, 1), begin, color)
    starts = np.concatenate([[0], loose.sum(1).cumsum()])
    columns = np.flatnonzero(loose) % w.shape[1]
    least = 3e-4 * float(np.median(begin[loose]))
    to_relax = across, down, starts, columns, np.float32(0.01), begin, w
    for _ in range(0, 80, AT_ONCE):
        before, changes = w[loose], np.empty(AT_ONCE)
        relax(*to_relax, changes)
        settled = np.flatnonzero(changes < least)
        if settled.size:  # those after it were too many
            w[loose] = before
            relax(*to_relax, changes[: settled[0] + 1])
            break


def extend_surfaces(
    w: Float32Array,
    labels: NDArray[np.int8],
    planes: NDArray[np.float64],
    at: tuple[NDArray[np.int64], ...],
    known: NDArray[np.int32],
) -> NDArray[np.float64]:
    """N inverse depths at the pixels `at` (rows, columns): of the planes of their known pixels, whose residual there fades out
    over 16 pixels, or the known ones' own, where the plane's are more than three times as large, or as small.

    w: H x W; labels: N, of the known pixels; known: N, flat.
    """
    rows, columns = np.divmod(known.astype(np.int64), w.shape[1])
    own = w.ravel()[known].astype(np.float64)
    on_plane = plane_values_at(planes, labels, at[0], at[1])
    plausible = (labels > 0) & (3 * on_plane > own) & (on_plane < 3 * own)
    residual = own - plane_values_at(planes, labels, rows, columns)
    fading = np.exp(-np.hypot(at[0] - rows, at[1] - columns) / 16)
    return np.where(plausible, on_plane + residual * fading, own)


def densify(rgbd: RGBD) -> RGBD:
    """The picture with depth between single readings, as those of a LIDAR; itself where its depth is none of single readings.

    Readings keep their values. What lies farther than the readings lie apart (above a LIDAR's first ring, say) stays missing, as
    the sky does. `view` and `remove` need it not; frames of `scene` do.
    """
    check_arguments(densify, locals())
    known = rgbd.valid
    if not has_single_readings(rgbd.depth):
        return rgbd
    view = View.from_rgbd(rgbd)
    surfaces, sky = find_known_surfaces(view.color, view.known_depth, view.depth_hole)
    filled = fill_along_colors(view.color, view.depth_hole, view.hole, surfaces, sky)
    between = filled.reached & ~sky & (distance_to(known) <= reach_between(known))
    depth = np.where(between, depth_from_inverse(filled.inverse_depth), rgbd.depth)
    return dataclasses.replace(rgbd, depth=freeze(depth))


def has_single_readings(depth: Float32Array) -> bool:
    """Whether depth (H x W) is missing above and below most readings, or at their sides: points or lines of a scan. Far pixels,
    as of sky that was marked, are no readings, and not missing."""
    read, known = is_valid(depth), depth > 0
    if known.all():
        return False
    near = np.pad(known, 1)
    alone = ~(near[:-2, 1:-1] | near[2:, 1:-1]) | ~(near[1:-1, :-2] | near[1:-1, 2:])
    return bool((alone & read).sum() > 0.5 * read.sum())


def reach_between(known: BoolArray) -> int:
    """Pixels from a known one (H x W) up to which depth is missing between readings: a fiftieth of the picture's longer side, or
    four mean spacings of readings."""
    return round(max(0.02 * max(known.shape), 4 / known.mean() ** 0.5))


def repeat_readings(depth: Float32Array) -> Float32Array:
    """H x W metres (0 = missing): between single readings that of the nearest one, without a picture; other depth as it is."""
    known = is_valid(depth)
    if not has_single_readings(depth):
        return depth
    distance, nearest = nearest_known(known)
    between = (distance <= reach_between(known)) & ~np.isposinf(depth)
    return np.where(between, depth.ravel()[nearest], depth)


def move_beyond_range(filled: DepthByColor, w: Float32Array, missing: BoolArray, hole: BoolArray) -> DepthByColor:
    """Depth that is no nearer than the sensor's range in the parts that lie beyond it.

    w: H x W inverse depth (1/m) as known; missing: H x W, where depth alone is missing; hole: H x W, where depth is unknown.
    """
    near = ~hole & (w > 0)
    if missing.mean() < LEAST_SHARE or not near.any():
        return filled
    limit = np.float32(np.quantile(w[near], 0.005))  # hardly a known pixel is farther
    moved = find_beyond_range(w, missing, near, limit) & filled.reached & (filled.inverse_depth > limit)
    if not moved.any():
        return filled
    depth, label = np.where(moved, limit, filled.inverse_depth), np.where(moved, np.int8(SMOOTH), filled.label)
    return DepthByColor(depth, label, filled.reached)


def find_beyond_range(w: Float32Array, missing: BoolArray, near: BoolArray, limit: np.float32) -> BoolArray:
    """H x W, True in missing parts that lie beyond the range. near: H x W, known pixels; limit: inverse depth at its end."""
    out = np.zeros_like(missing)
    reach = reach_between(near)
    wide = missing & (distance_to(near) > reach)
    count, part, stats, _ = cv2.connectedComponentsWithStats(wide.view(np.uint8), connectivity=8)
    for number in range(1, count):
        if stats[number, cv2.CC_STAT_AREA] < LEAST_SHARE * missing.size:
            continue
        this = missing & dilate_mask(part == number, round(1.5 * reach))  # into right-angled corners, too
        rim = w[dilate_mask(this, 3) & near]
        if rim.size and (rim < limit / 0.9).mean() >= 0.3:  # nearly at the limit
            out |= this
    return out
