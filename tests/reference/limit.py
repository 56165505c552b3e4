"""Slow literal twin of the law's limit: a march along each ray from the truth towards the camera, until the law is broken."""

from __future__ import annotations

import numpy as np

from dlama.geometry.camera import Camera
from reference.law import in_front
from worlds import rays_of

STEPS = 4000
NEAREST = 20.0
"""1/m at which the march ends."""


def limit(
    camera: Camera, truth: np.ndarray, where: np.ndarray, source: Camera, measured: np.ndarray
) -> tuple[np.ndarray, float]:
    """H x W inverse depth of the first step that breaks the law (inf: none up to NEAREST), and the length of a step.

    truth: H x W true inverse depth, 0 = far.
    """
    found = np.full(truth.shape, np.inf)
    rays = rays_of(camera)
    step = NEAREST / STEPS
    for row, column in np.argwhere(where):
        w = truth[row, column] + step * np.arange(0, STEPS) + 1e-7
        points = camera.world_from_cam[:3, 3] + rays[row, column] / w[:, None]
        breaks, _ = in_front(source, measured, points)
        if breaks.any():
            found[row, column] = w[np.argmax(breaks)]
    return found, step
