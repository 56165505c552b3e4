"""Known surfaces and the colours of the whole picture in; inverse depth and label of pixels that lack depth alone out.

A depth camera misses depth at the border of its picture, next to near objects, on glass and on black surfaces, where colours
are all known. Every such pixel takes the plane of the known pixel with the shortest geodesic path in colour. Depth on no plane
is relaxed to be smooth between known pixels, but not across picture edges.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import dilate_mask, fill_with_nearest, nearest_along_colors
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, is_valid
from dlama.perception.missing_depth.kernels import conductances, relax
from dlama.perception.planes import SMOOTH, KnownSurfaces, plane_values_at
from dlama.perception.sky import find_plain_sky

RIM_PX = 4
"""Width of the rim of measured surfaces that does not extend along colours where there is sky; single readings have none."""
MOST = 3.0
"""Largest ratio of depths between a plane and its known pixel."""
AT_ONCE = 8
"""Sweeps of `relax` that run together."""
PIECE = 1 << 16
"""Pixels that are worked on at a time."""


class DepthByColor(NamedTuple):
    """A view's depth with missing pixels filled along colours."""

    inverse_depth: Float32Array
    """H x W, 1/m: as known, and where missing and reached."""
    label: NDArray[np.int8]
    """H x W: -1 no plane, 0 sky, k on the k-th plane."""
    reached: BoolArray
    """H x W, True where depth alone was missing and a path leads from a known pixel."""


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
    color: UInt8Array, missing: BoolArray, hole: BoolArray, surfaces: KnownSurfaces, sky: BoolArray
) -> DepthByColor:
    """Inverse depth and labels of the pixels of `missing` that a path reaches.

    color: H x W x 3; missing: H x W, True where depth alone is missing; hole: H x W, True where depth is unknown: `missing`, and
    where colours are, too; sky: H x W, True in pixels of `missing` that are known to be sky. Noisy depth is a matcher's, which
    bleeds: there pixels of no plane count as 15 px farther off.
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
    relax_depth(out, reached & (labels == SMOOTH), smooth_color)
    return DepthByColor(out, labels, reached)


def relax_depth(w: Float32Array, loose: BoolArray, color: Float32Array) -> None:
    """Relax the `loose` pixels (H x W) of inverse depth (H x W, 1/m) towards their neighbours, less across picture edges.

    In 80 sweeps at most, or until none changes by 1e-4 / m. color: H x W x 3.
    """
    across, down, begin = np.empty_like(w), np.empty_like(w), w.copy()
    in_bands(conductances, len(w), across, down, dilate_mask(loose, 1), begin, color)
    starts = np.concatenate([[0], loose.sum(1).cumsum()])
    columns = np.flatnonzero(loose) % w.shape[1]
    to_relax = across, down, starts, columns, np.float32(0.01), begin, w
    for _ in range(0, 80, AT_ONCE):
        before, changes = w[loose], np.empty(AT_ONCE)
        relax(*to_relax, changes)
        settled = np.flatnonzero(changes < 1e-4)
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
    over 16 pixels, or the known ones' own.

    w: H x W; labels: N, of the known pixels; known: N, flat.
    """
    rows, columns = np.divmod(known.astype(np.int64), w.shape[1])
    own = w.ravel()[known].astype(np.float64)
    on_plane = plane_values_at(planes, labels, at[0], at[1])
    plausible = (labels > 0) & (on_plane * MOST > own) & (on_plane < MOST * own)
    residual = own - plane_values_at(planes, labels, rows, columns)
    fading = np.exp(-np.hypot(at[0] - rows, at[1] - columns) / 16)
    return np.where(plausible, on_plane + residual * fading, own)
