"""Gaps: cells of a hole where the law forbids all that surrounds them, in; a surface just behind all of that, out.

Through the gap between two houses a source camera saw what lies deeper than both walls: there the law forbids the planes of
both, and what is left is the sky. A third wall a little farther back is likelier than a sky that nobody saw there.
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.visibility import Law

DEEPEST = 1.2
"""Times as far off as what surrounds it that the bottom of a gap may lie: behind that the sky is as likely."""


def surface_behind(
    camera: Camera, smooth: Float32Array, where: BoolArray, law: Law, allowed: BoolArray
) -> tuple[Float32Array, BoolArray]:
    """h x w inverse depth (1/m) of no plane, in gaps put at its nearest lawful depth; h x w, True in those gaps.

    camera: of the grid; smooth: h x w, 1/m, as interpolated from what surrounds each cell, 0 where nothing does; where: h x w, in
    view, no sky was seen near; allowed: L x h x w, where the law lets no plane, sky, planes be.
    """
    gap = where & (smooth > 0) & allowed[1] & ~allowed[0] & ~allowed[2:].any(0)
    if not gap.any():
        return smooth, gap
    lawful, _ = law.project(camera, (1 / np.maximum(smooth, 1e-6)).astype(np.float32), gap)
    gap &= lawful * smooth < DEEPEST
    return np.where(gap, 1 / np.maximum(lawful, 1e-6), smooth).astype(np.float32), gap
