"""The steps of a sequence that are done in; kept in the output's hidden folder, so that a killed run resumes, out."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dlama.errors import FileError
from dlama.files.scenes.scene_npz import read_layer, read_npz, write_npz
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.frames.stored import Layer, PixelCache, StoredView
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.writing.atomic_write import write_file

FOLDER = ".dlama-sequence"
"""In the output, while the run lasts."""
FORMAT = 3
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


@dataclass(frozen=True, eq=False)
class StepChange:
    """What a step found."""

    view: View
    """The completed view."""
    fills: tuple[Layer, ...]
    """What was filled for it."""
    frame: Layer | None
    """The frame itself with depth wherever it has a colour, where it is one that had none somewhere."""

    @classmethod
    def by(cls, step: Step, view: View, before: Scene, after: Scene) -> StepChange:
        """What the step that completed this view changed."""
        changed = step.place is not None and after.frames[step.place] is not before.frames[step.place]
        frame = after.frames[step.place] if step.place is not None and changed else None
        return cls(view, after.fills[len(before.fills) :], frame)

    def to(self, scene: Scene, step: Step) -> Scene:
        """The scene with it."""
        frames = list(scene.frames)
        if step.place is not None and self.frame is not None:
            frames[step.place] = self.frame
        return replace(scene, frames=tuple(frames), fills=(*scene.fills, *self.fills))


class SequenceState:
    """What an earlier run with the same inputs and settings has done, in the folder of its output."""

    def __init__(self, output: Path, settings: Mapping[str, Any], scene: Scene, version: str) -> None:
        self.folder = output / FOLDER
        self.mark = fingerprint({**settings, "format": FORMAT}, scene, version)
        self.cache = PixelCache()
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
        if not same:
            write_file(self._settings, json.dumps({"mark": self.mark}))
        return same

    def of(self, number: int) -> StepChange | None:
        """What the step of that number added, if it is done; a file that was cut off counts as not done."""
        file = self._file(number)
        if not file.is_file():
            return None
        try:
            view, scene = read_npz(file, self.cache)
        except FileError:
            return None
        return StepChange(view, scene.fills, None if scene.frames[0].load().hole.all() else scene.frames[0])

    def keep(self, number: int, added: StepChange) -> StepChange:
        """The step is done; the same, whose layers are read from the file when they are needed. Raises OutputError."""
        nothing = np.ones(added.view.camera.hw, bool)
        frame = added.view.without(nothing, HoleType.NONE) if added.frame is None else added.frame
        file = self._file(number)
        write_npz(file, added.view, Scene((frame,), fills=added.fills))
        kept, *fills = (
            StoredView(layer.camera, partial(read_layer, file, f"layer{number}_"), self.cache, layer.load())
            for number, layer in enumerate((frame, *added.fills))
        )
        return StepChange(added.view, tuple(fills), None if added.frame is None else kept)

    def end(self) -> None:
        """All is done: nothing is left of this."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _file(self, number: int) -> Path:
        return self.folder / f"step-{number:06d}.npz"


def fingerprint(settings: Mapping[str, Any], scene: Scene, version: str) -> str:
    """Changes with any pixel, any pose and any setting."""
    digest = hashlib.sha256(json.dumps([dict(settings), version], sort_keys=True, default=str).encode())
    for stored in (*scene.layers, *scene.removals):
        layer = stored.load()
        for array in (layer.camera.world_from_cam, layer.camera.K, layer.color, layer.depth, layer.hole):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
