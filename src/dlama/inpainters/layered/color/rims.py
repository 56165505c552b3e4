"""Rims: a painted hole in; the same with colours blended at its boundary with the known ones of the same surface, out.

Copied detail meets known pixels with a seam, and a hole a few pixels wide, next to a post, is all seam. There the interpolation
of known pixels on both sides is the better estimate: ledges, frames and courses of bricks continue through. It fades with the
distance from the rim, where detail counts more.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.layered.color.texture_grid import UNTRUSTED
from dlama.inpainters.layered.kernels.cells import trusted_sources
from dlama.inpainters.layered.kernels.rims import Picture, mean_known
from dlama.perception.planes import SKY

FADES = 2.5
"""Distance in px at which known colours weigh 1/e (a Gaussian). Street s03, s05 at 3, 4 and 6: the squared error of
dis-occlusions is the same, their LPIPS rises; at 2 the error of +-20 is 3 % more."""
LEAST = 0.02
"""Least weight that changes a pixel."""
REACH = 10
"""Radius in px of the known pixels that count."""
BAND = 2048
"""Pixels per task."""


def blend_at_rim(
    color: UInt8Array, hole: BoolArray, where: BoolArray, w: Float32Array, label: NDArray[np.int8], spoiled: BoolArray
) -> UInt8Array:
    """H x W x 3 colours, with those of `where` blended with known ones of their own surface next to the hole.

    color: H x W x 3, painted; hole: H x W, painted pixels; where: H x W, pixels that change; w, label: H x W inverse depth
    (1/m) and surface of all pixels; spoiled: H x W, known pixels whose colours do not continue.
    """
    places = np.flatnonzero(where).astype(np.int32)
    distance = cv2.distanceTransform(hole.view(np.uint8), cv2.DIST_L2, 5).ravel()[places]
    share = np.exp(-np.square(distance / np.float32(FADES)))
    places, share = places[share > LEAST], share[share > LEAST]
    if not len(places):
        return color
    own = trusted_sources(hole, w, label, 1) & ~spoiled
    known, depth = np.where(own, label, np.int8(UNTRUSTED)), np.where(label == SKY, np.float32(1), w)
    near, found = np.zeros((len(places), 3), np.float32), np.empty(len(places), np.bool_)
    picture = Picture(np.ascontiguousarray(color), known, label, depth)
    in_bands(mean_known, len(places), picture, places, REACH, near, found, band=BAND)
    out, places = color.copy(), places[found]
    painted = color.reshape(-1, 3)[places]
    out.reshape(-1, 3)[places] = np.clip(np.round(painted + share[found, None] * (near[found] - painted)), 0, 255)
    return out
