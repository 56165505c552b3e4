"""The steps of a sequence that are done in; kept in the output's hidden folder, so that a killed run goes on, out."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dlama.completion.frames.stepwise import Added, Step
from dlama.errors import FileError
from dlama.files.atomic_write import new_file
from dlama.files.scenes.scene_npz import read_npz, write_npz
from dlama.geometry.scene import Scene

FOLDER = ".dlama-sequence"
"""In the output, while the run lasts."""


class SequenceState:
    """What an earlier run with the same inputs and settings has done, in the folder of its output."""

    def __init__(self, output: Path, settings: Mapping[str, Any], scene: Scene, version: str) -> None:
        self.folder = output / FOLDER
        self.mark = fingerprint(settings, scene, version)
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
            view, scene = read_npz(file)
        except FileError:
            return None
        return Added(view, scene.layers[1:], next(iter(scene.objects), None))

    def keep(self, step: Step, added: Added) -> None:
        """The step is done. Raises OutputError."""
        layers = (added.view, *added.layers)
        write_npz(self._file(step), added.view, Scene(layers, () if added.frame is None else (added.frame,)))

    def end(self) -> None:
        """All is done: nothing is left of this."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _file(self, step: Step) -> Path:
        return self.folder / f"{hashlib.sha256(step.key.encode()).hexdigest()[:24]}.npz"


def fingerprint(settings: Mapping[str, Any], scene: Scene, version: str) -> str:
    """Changes with any pixel, any pose and any setting."""
    digest = hashlib.sha256(json.dumps([dict(settings), version], sort_keys=True, default=str).encode())
    for layer in (*scene.layers, *scene.objects):
        for array in (layer.camera.world_from_cam, layer.camera.K, layer.color, layer.depth, layer.hole):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
