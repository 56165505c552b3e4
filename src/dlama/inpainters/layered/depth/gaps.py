"""Gaps: cells of a hole where the law forbids all adjacent surfaces in; a surface just behind the law's limit out.

Through the gap between two houses a source camera saw past both walls. So the law forbids both planes, and only the sky is
left. A third wall a little farther back is likelier than a sky that no camera saw there.
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.visibility import Law

DEEPEST = 1.2
"""Largest distance of a gap's bottom over that of its surroundings: beyond it the sky is as likely."""


def surface_behind(
    camera: Camera, smooth: Float32Array, where: BoolArray, law: Law, allowed: BoolArray
) -> tuple[Float32Array, BoolArray]:
    """h x w inverse depth (1/m) of no plane, in gaps at its nearest lawful depth; h x w, True in those gaps.

    camera: of the grid; smooth: h x w, 1/m, interpolated from the surroundings of each cell, 0 where there are none; where: h x
    w, in view, no sky seen near; allowed: L x h x w, labels (no plane, sky, planes) that the law allows.
    """
    gap = where & (smooth > 0) & allowed[1] & ~allowed[0] & ~allowed[2:].any(0)
    if not gap.any():
        return smooth, gap
    lawful, _ = law.project(camera, (1 / np.maximum(smooth, 1e-6)).astype(np.float32), gap)
    gap &= lawful * smooth < DEEPEST
    return np.where(gap, 1 / np.maximum(lawful, 1e-6), smooth).astype(np.float32), gap
