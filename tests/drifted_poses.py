"""Cameras whose poses are off, as those of hand-held cameras are."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.camera import Camera


def drift(camera: Camera, rng: np.random.Generator) -> Camera:
    """The camera .8 degrees and 2 cm off: standard deviations of each axis."""
    pose = camera.world_from_cam.copy()
    pose[:3, :3] = cv2.Rodrigues(np.radians(rng.normal(0, 0.8, 3)))[0] @ pose[:3, :3]
    pose[:3, 3] += rng.normal(0, 0.02, 3)
    return camera.at(pose)
