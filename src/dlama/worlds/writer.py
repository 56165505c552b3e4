"""Worlds in; folders in EasySynth's layout out: of each its orbit and stereo pair, with and without the object."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from dlama import __version__
from dlama.completion.memory import check_memory
from dlama.datasets.easysynth.writer import LEFT, RIGHT, SequenceFrame, write_scene
from dlama.datasets.text_tables import pictures_below
from dlama.errors import FileError, OutputError, system_errors
from dlama.geometry.camera import Camera
from dlama.worlds.dataset import YAWS, WorldSettings, world_settings
from dlama.worlds.world import SIZE, Kind, World, yaw_order

FRAMES = 30
"""Frames of a scene: thirteen poses and a stereo pair, with and without the object."""
MADE_WITH = "made_with.json"
CLASSES = {"background": (0, 0, 0), "object": (255, 0, 0), "sky": (70, 130, 180)}


@system_errors(OutputError)
def write_worlds(
    folder: Path,
    *,
    count: int = 4,
    seed: int = 0,
    size: int = SIZE,
    kind: Kind | None = None,
    textures: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Write worlds in EasySynth's layout, depth range 10 m: scene folders `wNNN` with with, without, stereo_with, stereo_without.

    `textures`: a folder of pictures (searched through), as of `world`. `progress` is called with frames done and all frames. A
    scene is written whole or not at all, and one that an earlier run has written with the same settings is kept: a run that was
    killed resumes where it was. Returns the scenes' folders. Raises InputError (memory cannot hold the pictures), FileError (no
    textures there), OutputError (a scene's folder holds something else, or the place cannot be written).
    """
    done = itertools.count(1)

    def step() -> None:
        if progress is not None:
            progress(next(done), FRAMES * count)

    with system_errors(FileError):
        photos = None if textures is None else pictures_below(textures)
    every = world_settings(count, seed, size, kind, photos)
    check_memory([Camera.from_fov(size, size, 60.0)])
    return [_write_or_keep(Path(folder), each, textures, step) for each in every]


def _write_or_keep(root: Path, settings: WorldSettings, textures: Path | None, step: Callable[[], None]) -> Path:
    """The folder of a scene: as an earlier run with these settings left it, else written now; `step` is called for each frame."""
    folder = root / settings.scene
    made_with: dict[str, object] = {
        "dlama": __version__,
        "seed": settings.seed,
        "kind": settings.kind,
        "size": settings.size,
        "textures": None if textures is None else str(textures),
    }
    found = None
    with suppress(OSError, ValueError, RecursionError):
        found = json.loads((folder / MADE_WITH).read_text(encoding="utf-8"))
    if found == made_with:
        for _ in range(FRAMES):
            step()
        return folder
    texts = {MADE_WITH: json.dumps(made_with, indent=1) + "\n"}
    sequences = _sequences(settings.world(), settings.size, step)
    write_scene(root, settings.scene, sequences, depth_range=10.0, classes=CLASSES, texts=texts)
    return folder


def _sequences(
    world: World, size: int, step: Callable[[], None]
) -> dict[str, Iterator[SequenceFrame] | dict[str, list[SequenceFrame]]]:
    """The orbit and the pair of a world, with and without its object; `step` is called after every frame."""

    def frame(camera: Camera, object: bool) -> SequenceFrame:
        seen = world.raycast(camera, object=object)
        step()
        classes = np.where(seen.group < 0, 2, seen.group == world.object_index)  # by their place in CLASSES
        return SequenceFrame(seen.frame(camera), classes.astype(np.uint8))

    def orbit(object: bool) -> Iterator[SequenceFrame]:
        return (frame(world.camera(yaw, size), object) for yaw in yaw_order(YAWS))

    def pair(object: bool) -> dict[str, list[SequenceFrame]]:
        rig = world.rig(size)
        return {LEFT: [frame(rig.left, object)], RIGHT: [frame(rig.right, object)]}

    return {"with": orbit(True), "without": orbit(False), "stereo_with": pair(True), "stereo_without": pair(False)}
