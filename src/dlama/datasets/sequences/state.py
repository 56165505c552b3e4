"""The steps of a sequence that are done in; kept in the output's hidden folder, so that a killed run goes on, out."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dlama.completion.frames.stepwise import Added, Step
from dlama.errors import FileError
from dlama.files.atomic_write import new_file
from dlama.files.scenes.scene_npz import read_layer, read_npz, write_npz
from dlama.geometry.frames.stored import PixelCache, StoredView
from dlama.geometry.scene import Scene
from dlama.geometry.view import View

FOLDER = ".dlama-sequence"
"""In the output, while the run lasts."""
FORMAT = 2
"""Of the files there; what another one left is not gone on with."""


class SequenceState:
    """What an earlier run with the same inputs and settings has done, in the folder of its output."""

    def __init__(self, output: Path, settings: Mapping[str, Any], scene: Scene, version: str) -> None:
        self.folder = output / FOLDER
        self.mark = fingerprint({**settings, "format": FORMAT}, scene, version)
        self.cache = PixelCache()
        self._settings = self.folder / "settings.json"

    def begin(self) -> bool:
        """Make the folder; what another run with other inputs left there is removed. True if there is something to go on with."""
        try:
            same = json.loads(self._settings.read_text("utf-8"))["mark"] == self.mark
        except (OSError, ValueError, KeyError, TypeError):
            same = False
        if not same:
            shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True, exist_ok=True)
        if not same:
            with new_file(self._settings) as draft:
                draft.write_text(json.dumps({"mark": self.mark}), encoding="utf-8")
        return same

    def of(self, step: Step) -> Added | None:
        """What a step added, if it is done; a file that was cut off counts as not done."""
        file = self._file(step)
        if not file.is_file():
            return None
        try:
            view, scene = read_npz(file, self.cache)
        except FileError:
            return None
        return self._added(view, scene)

    def keep(self, step: Step, added: Added) -> Added:
        """The step is done; the same, whose layers are read from the file when they are needed. Raises OutputError."""
        layers = (*(() if added.frame is None else (added.frame,)), *added.layers)
        numbers = () if added.frame is None else (0,)
        nothing = () if layers else (added.view,)
        scene = Scene(layers or nothing, nothing, numbers, tuple((1.0, 1.0, 1.0) for _ in numbers))
        file = self._file(step)
        write_npz(file, added.view, scene)
        stored = [
            StoredView.of(layer.camera, partial(read_layer, file, f"layer{number}_"), self.cache, layer)
            for number, layer in enumerate(scene.layers)
        ]
        return self._added(added.view, Scene(tuple(stored), nothing, numbers, scene.gains))

    @staticmethod
    def _added(view: View, scene: Scene) -> Added:
        """Of a scene as `keep` writes it: first the frame, where it has numbers; an object: nothing was added."""
        if scene.objects:
            return Added(view, (), None)
        frames = len(scene.numbers)
        return Added(view, scene.layers[frames:], scene.layers[0] if frames else None)

    def end(self) -> None:
        """All is done: nothing is left of this."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _file(self, step: Step) -> Path:
        return self.folder / f"{hashlib.sha256(step.key.encode()).hexdigest()[:24]}.npz"


def fingerprint(settings: Mapping[str, Any], scene: Scene, version: str) -> str:
    """Changes with any pixel, any pose and any setting."""
    digest = hashlib.sha256(json.dumps([dict(settings), version], sort_keys=True, default=str).encode())
    for stored in (*scene.layers, *scene.objects):
        layer = stored.read()
        for array in (layer.camera.world_from_cam, layer.camera.K, layer.color, layer.depth, layer.hole):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
