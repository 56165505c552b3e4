"""Disparities that are right to the pixel and the pictures they were matched in: in; disparities right below a pixel: out.

Semi-global matching interpolates between whole disparities, which bends smooth surfaces into waves. Here both pictures decide
anew, by OpenCV's variational refinement of optical flow (Brox et al., ECCV 2004), and a bilateral filter removes what noise is
left.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.rgbd import Float32Array, UInt8Array

LARGEST_MOVE_PX = 0.5
"""What would move a match farther has crossed an edge."""
BAND_ROWS, SHARED_ROWS = 512, 64
"""Rows that are refined at once, and seen beyond them, which change little in them: it takes 120 bytes a pixel."""
SMOOTH_PX = 0.25
"""Sigma of disparity of the bilateral filter. A larger one hides the noise of matches: planes are then fitted with too small a
tolerance, and fills get worse."""


def refine_disparity(left: UInt8Array, right: UInt8Array, disparity: Float32Array, lowest: float) -> Float32Array:
    """The disparity of the left view (H x W px, NaN = unknown), each value moved by LARGEST_MOVE_PX at most, and smoothed.

    left, right: H x W x 3, RGB; mirrored, the right view is a left one. lowest: the least disparity that is sought.
    """
    known = np.isfinite(disparity)
    if not known.any():
        return disparity
    here, there = (cv2.cvtColor(one, cv2.COLOR_RGB2GRAY) for one in (left, right))
    flow = -fill_with_nearest(disparity, known)
    moved = np.empty_like(flow)
    for first in range(0, len(flow), BAND_ROWS):
        last, start = first + BAND_ROWS, max(first - SHARED_ROWS, 0)
        seen = np.s_[start : last + SHARED_ROWS]
        across = flow[seen].copy()  # is written to
        cv2.VariationalRefinement.create().calcUV(here[seen], there[seen], across, np.zeros_like(across))
        moved[first:last] = across[first - start : last - start]
    nearby = np.clip(-moved, np.maximum(disparity - LARGEST_MOVE_PX, lowest), disparity + LARGEST_MOVE_PX)
    return denoise(np.where(known, nearby, disparity))


def denoise(disparity: Float32Array) -> Float32Array:
    """Disparities (NaN = unknown) averaged over similar neighbours; steps between surfaces stay."""
    known = np.isfinite(disparity)
    low, high = disparity[known].min(), disparity[known].max()
    apart = np.float32(low - 20 * SMOOTH_PX)  # too far away to weigh anything
    smooth = cv2.bilateralFilter(np.where(known, disparity, apart), 5, SMOOTH_PX, 2)
    return np.where(known, np.clip(smooth, low, high), np.float32(np.nan))
