"""A law and the true depth of a view's hole in -> how near filled depth may come, as inverse depth, out.

What is lawful along a ray is no single stretch: in front of what the source saw lies the unlawful, and in front of that, where
the ray has left the source's picture, all is lawful again. The limit is that of the stretch the truth lies in: going from the
truth towards the camera, where the law is broken first (behind an occluder: its back).
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import px_from_px
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.visibility import Law
from dlama.training.data.samples.law_limit_kernels import limits


def law_limit(law: Law, camera: Camera, truth: Float32Array, where: BoolArray) -> Float32Array:
    """H x W inverse depth (1/m) that filled pixels must not exceed; +inf outside `where` and where anything is lawful.

    truth: H x W true inverse depth seen from `camera`, 0 = far. Never below the truth: where a pixel centre's truth breaks
    the law itself (at edges, by a fraction of a pixel) the truth is the limit.
    """
    found = np.full(truth.shape, np.inf)
    truth, where = np.require(truth, np.float32, ["C", "W"]), np.require(where, np.bool_, ["C", "W"])  # one signature
    for source, measured in law.measured:
        measured = np.require(measured, np.float32, ["C", "W"])
        in_bands(limits, len(truth), truth, where, *px_from_px(source, camera), measured, found)
    return found.astype(np.float32)
