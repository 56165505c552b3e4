"""A scene.npz in; the measured frames of it as a data set of posed frames, and the cases between them, out.

Depth that was filled counts as missing. A scene from which an object was removed is refused: what it hid is no truth.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dlama.datasets.frames import Dataset
from dlama.datasets.posed.lenses import Lens
from dlama.datasets.posed.posed_frames import FrameFiles, PosedFrame
from dlama.datasets.posed.view_pairs import posed_dataset
from dlama.errors import InputError, warn
from dlama.files.scenes.scene_npz import read_layer, read_scene
from dlama.geometry.codes import from_source
from dlama.geometry.rgbd import RGBD

LAYOUT = "scene"
"""What the layout of such a file is called."""


def is_scene_file(path: Path) -> bool:
    """Whether it is called like a scene."""
    return path.suffix.lower() == ".npz" and path.is_file()


def scene_file(path: Path, *, limit: int | None = None) -> Dataset:
    """The frames of a scene.npz, in their order; warns where their depth is estimated. Raises FileError, InputError."""
    found = read_scene(path)
    if found.removals:
        raise InputError(
            f"{path}: is a scene without what was removed from it; one of frames as they were taken is expected"
        )
    if found.has_estimated_depth:
        warn(f"{path}: its depth is estimated from pictures; it is no truth")
    frames = []
    for place, (name, layer) in enumerate(zip(found.names, found.frames)):
        camera = layer.camera
        lens = Lens(str(path), (camera.fx, camera.fy, camera.cx, camera.cy), 0.5, camera.hw)
        color, depth = (partial(part_of_frame, path, place, part) for part in ("color", "depth"))
        files = FrameFiles((str(path), str(path)), color, depth, lens, camera.world_from_cam, has_far=True)
        frames.append(PosedFrame(path.stem, name, partial(load_frame, path, place), files=files))
    return posed_dataset(LAYOUT, path, frames, limit)


def load_frame(path: Path, place: int) -> RGBD:
    """A frame as it was measured. Raises FileError."""
    view = read_layer(path, f"layer{place}_")
    return RGBD(view.color, np.where(from_source(view.origin), view.depth, np.float32(0)), view.camera)


def part_of_frame(path: Path, place: int, part: str) -> Any:
    """Its color or its depth."""
    return getattr(load_frame(path, place), part)
