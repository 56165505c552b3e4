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


@dataclass(frozen=True, eq=False)
class StepChange:
    """What a step found."""

    shares: dict[str, float]
    """Of its completed view, for meta.json."""
    fills: tuple[Layer, ...]
    """What was filled for it."""
    frame: Layer | None
    """The frame itself with depth wherever it has a colour, where it is one that had none somewhere."""

    @classmethod
    def by(cls, step: Step, shares: dict[str, float], before: Scene, after: Scene) -> StepChange:
        """What the step whose view has these shares changed."""
        changed = step.place is not None and after.frames[step.place] is not before.frames[step.place]
        frame = after.frames[step.place] if step.place is not None and changed else None
        return cls(shares, after.fills[len(before.fills) :], frame)

    def to(self, scene: Scene, step: Step) -> Scene:
        """The scene with it."""
        frames = list(scene.frames)
        if step.place is not None and self.frame is not None:
            frames[step.place] = self.frame
        return replace(scene, frames=tuple(frames), fills=(*scene.fills, *self.fills))


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
        if not same:
            write_file(self._settings, json.dumps({"mark": self.mark}))
        return same

    def of(self, number: int, camera: Camera) -> StepChange | None:
        """What the step of that number and camera added, if it is done; files that were cut off count as not done."""
        file, about = self._file(number), self._file(number).with_suffix(".json")
        try:
            shares = json.loads(about.read_text("utf-8"))
            _, scene = read_npz(file, self.cache)
        except (OSError, ValueError, FileError):
            return None
        fills = tuple(BoxedView(camera, fill) for fill in scene.fills)
        return StepChange(shares, fills, scene.frames[0] if scene.frames[0].camera.hw == camera.hw else None)

    def keep(self, number: int, camera: Camera, added: StepChange) -> StepChange:
        """The step of that number and camera is done; the same, whose layers are read from the file when they are needed. Raises
        OutputError."""
        nothing = View.from_rgbd(
            RGBD(np.zeros((1, 1, 3), np.uint8), np.zeros((1, 1), np.float32), camera.cropped(0, 0, 1, 1))
        )
        layers = tuple(one.load_part() for one in (added.frame or nothing, *added.fills))
        file = self._file(number)
        write_npz(file, nothing, Scene(layers[:1], fills=layers[1:]))
        write_file(file.with_suffix(".json"), json.dumps(added.shares))
        kept, *parts = (
            StoredView(layer.camera, partial(read_layer, file, f"layer{place}_"), self.cache, layer)
            for place, layer in enumerate(layers)
        )
        fills = tuple(BoxedView(camera, part) for part in parts)
        return StepChange(added.shares, fills, None if added.frame is None else kept)

    def end(self) -> None:
        """All is done: nothing is left of this."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _file(self, number: int) -> Path:
        return self.folder / f"step-{number:06d}.npz"


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
