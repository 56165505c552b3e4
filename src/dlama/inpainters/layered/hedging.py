"""Hedging: painted colours in; the same with less contrast where nobody can know what is there, out.

Outside the source's view, far things are a guess: does the wall end, does the sky begin? With the distance from what was seen
what is coarse in the painted colours is blended with a smooth guess; fine detail stays. Near planes (ground, table) are sure to
continue and stay as painted.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import HoleType, View
from dlama.inpainters.spreading import pull_push, spread_small, telea_spread

LARGEST_SHARE = 0.7
"""Largest share of the smooth guess, itself the mean of two: guesses with errors alike err least when they count alike."""
REACH = 0.04
"""Share of the picture's longer side over which painted colours become unsure (1 - 1/e of the way to LARGEST_SHARE)."""
DETAIL_PX = 3.0
"""Sigma of the blur that leaves what is blended; finer detail stays as painted: paving goes on."""


def hedged(view: View, color: UInt8Array, hole: BoolArray, w: Float32Array) -> UInt8Array:
    """H x W x 3 colours: `color`, blended with `smooth_guess` in the hole pixels out of view.

    color: H x W x 3, painted; hole: H x W, the pixels that were painted; w: H x W inverse depth (1/m), filled everywhere.
    """
    out_of_view = hole & (view.hole_type == HoleType.OUT_OF_VIEW)
    known = w[~view.hole]
    if not out_of_view.any() or not known.size:
        return color
    distance = cv2.distanceTransform(view.hole.astype(np.uint8), cv2.DIST_L2, 5)[out_of_view]
    middle = max(float(np.median(known)), 1e-6)
    unsure = LARGEST_SHARE * (1 - np.exp(-distance / (REACH * max(w.shape))))
    share = unsure * np.clip(2 * (1 - w[out_of_view] / middle), 0, 1)
    out = color.copy()
    there = out_of_view.astype(np.float32)
    sums, weight = (cv2.GaussianBlur(a, (0, 0), DETAIL_PX) for a in (color * there[..., None], there))
    coarse = sums[out_of_view] / weight[out_of_view, None]
    blend = color[out_of_view] + share[:, None] * (smooth_guess(view, out_of_view) - coarse)
    out[out_of_view] = np.clip(np.round(blend), 0, 255)
    return out


def smooth_guess(view: View, where: BoolArray) -> Float32Array:
    """N x 3, for the N pixels of `where` (H x W): the mean of two guesses blind to surfaces, pull-push and Telea.

    Street dev scenes, +-10 to +-60 degrees: against pull-push alone at a share of 0.55 the squared error falls by 8 to 13 %,
    LPIPS by up to 1 %.
    """
    pulled = pull_push(view.color, ~view.hole)[where]
    return np.asarray((pulled + spread_small(view.color, ~view.hole, telea_spread)[where]) / 2, np.float32)
