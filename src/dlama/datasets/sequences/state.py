"""The steps of a sequence that are done in; kept in the output's hidden folder, so that a killed run resumes, out."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dlama.errors import FileError
from dlama.files.scenes.scene_npz import read_layer, read_npz, write_npz
from dlama.geometry.camera import Camera
from dlama.geometry.frames.stored import BoxedView, Layer, StoredView, cache_of, pixel_digest
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.writing.atomic_write import write_file

FOLDER = ".dlama-sequence"
"""In the output, while the run lasts."""
FORMAT = 6
"""Of the files there; what another one left is not gone on with."""


class Step(NamedTuple):
    """One view to be completed."""

    name: str
    """Of the frame, or of the camera."""
    camera: Camera
    place: int | None
    """Of the frame in whose camera it is; None: another camera."""
    shown: bool
    """Whether it is asked for; a frame may be filled on the way to other cameras."""


class SequenceState:
    """What an earlier run with the same inputs and settings has done, in the folder of its output."""

    def __init__(
        self, output: Path, settings: Mapping[str, Any], scene: Scene, masks: Mapping[int, BoolArray], version: str
    ) -> None:
        """scene, masks: before the removal, number of a frame -> H x W."""
        self.folder = output / FOLDER
        self.mark = fingerprint({**settings, "format": FORMAT}, scene, masks, version)
        self.cache = cache_of(scene.frames)
        self._settings = self.folder / "settings.json"

    def begin(self) -> bool:
        """Make the folder; what another run with other inputs left there is removed. True if there is something to resume."""
        try:
            same = json.loads(self._settings.read_text("utf-8"))["mark"] == self.mark
        except (OSError, ValueError, KeyError, TypeError):
            same = False
        if not same:
            shutil.rmtree(self.folder, ignore_errors=True)
            self.folder.mkdir(parents=True, exist_ok=True)
            write_file(self._settings, json.dumps({"mark": self.mark}))
        return same

    def read(self, number: int, step: Step, scene: Scene) -> tuple[dict[str, float], Scene] | None:
        """The shares of the view of a step, and the scene with what was filled for it, if it is done; files that were cut off
        count as not done."""
        file = self._file(number)
        try:
            shares = json.loads(file.with_suffix(".json").read_text("utf-8"))
            _, found = read_npz(file, self.cache)
        except (OSError, ValueError, FileError):
            return None
        frame, fills = found.frames[0], found.fills
        return shares, extend(scene, step, frame if frame.camera.hw == step.camera.hw else None, fills)

    def keep(self, number: int, step: Step, shares: Mapping[str, float], before: Scene, after: Scene) -> Scene:
        """A step is done, whose view has these shares; `after`, of which what was filled for it is read from the file when it is
        needed. Raises OutputError."""
        pixel = RGBD(np.zeros((1, 1, 3), np.uint8), np.zeros((1, 1), np.float32), step.camera.cropped(0, 0, 1, 1))
        nothing = View.from_rgbd(pixel)
        changed = step.place is not None and after.frames[step.place] is not before.frames[step.place]
        frame = after.frames[step.place] if step.place is not None and changed else nothing
        layers = tuple(one.load_part() for one in (frame, *after.fills[len(before.fills) :]))
        file = self._file(number)
        write_npz(file, nothing, Scene(layers[:1], fills=layers[1:]))
        write_file(file.with_suffix(".json"), json.dumps(shares))
        kept, *fills = (
            StoredView(layer.camera, partial(read_layer, file, f"layer{place}_"), self.cache, layer)
            for place, layer in enumerate(layers)
        )
        return extend(before, step, kept if changed else None, fills)

    def end(self) -> None:
        """All is done: nothing is left of this."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _file(self, number: int) -> Path:
        return self.folder / f"step-{number:06d}.npz"


def extend(scene: Scene, step: Step, frame: Layer | None, fills: Iterable[Layer]) -> Scene:
    """The scene with the parts of a step's view that were filled; and with `frame` in place of the step's: the frame with depth
    wherever it has a colour, where it is one that had none somewhere."""
    frames = list(scene.frames)
    if step.place is not None and frame is not None:
        frames[step.place] = frame
    boxed = (BoxedView(step.camera, fill) for fill in fills)
    return replace(scene, frames=tuple(frames), fills=(*scene.fills, *boxed))


def fingerprint(settings: Mapping[str, Any], scene: Scene, masks: Mapping[int, BoolArray], version: str) -> str:
    """Changes with any pixel, any pose, any mask and any setting."""
    digest = hashlib.sha256(json.dumps([dict(settings), version], sort_keys=True, default=str).encode())
    for layer in (*scene.layers, *scene.removals):
        for array in (layer.camera.world_from_cam, layer.camera.K):
            digest.update(np.ascontiguousarray(array).tobytes())
        digest.update(layer.find_once(pixel_digest))
    for number, mask in sorted(masks.items()):
        digest.update(bytes(str(number), "ascii") + mask.tobytes())
    return digest.hexdigest()
