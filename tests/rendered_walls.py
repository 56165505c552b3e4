"""A plain wall with an object's class in a corner, as frames of an EasySynth sequence: what the tests of its reader write."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from dlama.datasets.easysynth.writer import SequenceFrame
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD

CLASSES = {"background": (0, 0, 0), "object": (255, 0, 0)}
CAMERA = Camera.from_fov(16, 12, 80)


def frame(camera: Camera = CAMERA, shows: bool = True, depth: float = 2.0) -> SequenceFrame:
    """A plain wall, and the object's class in a corner of it."""
    semantic = np.zeros(camera.hw, np.uint8)
    semantic[:4, :5] = shows
    color = np.full((*camera.hw, 3), 120, np.uint8)
    return SequenceFrame(RGBD(color, np.full(camera.hw, depth, np.float32), camera), semantic)


def edit_json(path: Path, rename: str | None = None, **changes: object) -> None:
    cameras = json.loads(path.read_text())["cameras"]
    name, values = cameras.popitem()
    path.write_text(json.dumps({"cameras": {name if rename is None else rename: {**values, **changes}}}))
