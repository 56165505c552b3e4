"""A small made-up frame on disk: a box before a wall."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from dlama.geometry.camera import Camera
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(64, 48, 60)
WORLD = World((Plane((0, 0, 4), (0, 0, 1)), Box((-0.5, -0.4, 2.0), (0.4, 0.5, 2.4))))


def small_frame(folder: Path) -> Path:
    """The folder, made if need be, with image.png, depth.png (mm) and mask.png (the box)."""
    folder.mkdir(exist_ok=True, parents=True)
    rgbd = WORLD.rgbd(CAMERA)
    _, shown = WORLD.trace(CAMERA)
    Image.fromarray(rgbd.color).save(folder / "image.png")
    Image.fromarray((rgbd.depth * 1000).round().astype(np.uint16)).save(folder / "depth.png")
    Image.fromarray(((shown == 1) * 255).astype(np.uint8)).save(folder / "mask.png")
    return folder


def pixels(path: Path) -> np.ndarray:
    """A picture's numbers; codes for a palette picture."""
    with Image.open(path) as picture:
        return np.array(picture)
