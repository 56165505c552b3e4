"""Worlds in; folders in EasySynth's layout out: of each its orbit and stereo pair, with and without the object."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from dlama import __version__
from dlama.completion.memory import LONGEST_SIDE, check_memory
from dlama.datasets.easysynth.writer import SequenceFrame, SequenceKey, StereoSequence, write_scene
from dlama.errors import InputError, OutputError, system_errors
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.worlds.dataset import YAWS, WorldSettings, world_settings
from dlama.worlds.world import SIZE, Kind, World, classes_of, yaw_order

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

    `progress` is called with frames done and all frames. A scene is written whole or not at all, and one that an earlier run
    has written with the same settings is kept: a run that was killed resumes where it was. Returns the scenes' folders. Raises
    InputError (memory cannot hold the pictures), OutputError (a scene's folder holds something else, or the place cannot be
    written).
    """
    done = itertools.count(1)

    def step() -> None:
        if progress is not None:
            progress(next(done), FRAMES * count)

    every = world_settings(count, seed, size, kind, textures)
    if size > LONGEST_SIDE:
        raise InputError(f"`size` is {size}; at most {LONGEST_SIDE} pixels are expected")
    check_memory([Camera.from_fov(size, size, 60.0)])
    return [_write_or_keep(Path(folder), each, step) for each in every]


def _write_or_keep(root: Path, settings: WorldSettings, step: Callable[[], None]) -> Path:
    """The folder of a scene: as an earlier run with these settings left it, else written now."""
    made_with = describe_settings(settings)
    if read_settings(root / settings.scene) != made_with:
        return write_world(root, settings.scene, settings.world(), settings.size, YAWS, step, made_with)
    for _ in range(FRAMES):
        step()
    return root / settings.scene


def describe_settings(settings: WorldSettings) -> dict[str, object]:
    """What a scene is made with, as made_with.json keeps it."""
    names = ("seed", "kind", "size")
    textures = str(settings.textures) if isinstance(settings.textures, Path) else None
    return {"dlama": __version__, **{name: getattr(settings, name) for name in names}, "textures": textures}


def read_settings(folder: Path) -> dict[str, object] | None:
    """What the scene in a folder was made with; None where there is none, or it does not say."""
    try:
        found = json.loads((folder / MADE_WITH).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def write_world(
    root: Path,
    scene: str,
    world: World,
    size: int,
    yaws: Sequence[float],
    step: Callable[[], None],
    made_with: dict[str, object],
) -> Path:
    """Write `root/scene` and return it; `step` is called after every frame. Raises OutputError.

    made_with: goes into made_with.json, by which a later run knows the scene.
    """

    def frame(camera: Camera, object: bool) -> SequenceFrame:
        seen = world.raycast(camera, object=object)
        step()
        return SequenceFrame(RGBD(seen.color, seen.depth, camera), classes_of(seen.group, world.object_index))

    def orbit(object: bool) -> Iterator[SequenceFrame]:
        return (frame(world.camera(yaw, size), object) for yaw in yaw_order(tuple(yaws)))

    def pair(object: bool) -> StereoSequence:
        rig = world.rig(size=size)
        return StereoSequence((frame(rig.left, object),), (frame(rig.right, object),))

    sequences: dict[SequenceKey, Iterator[SequenceFrame] | StereoSequence] = {
        "with": orbit(True),
        "without": orbit(False),
        "stereo_with": pair(True),
        "stereo_without": pair(False),
    }
    texts = {MADE_WITH: json.dumps(made_with, indent=1) + "\n"}
    write_scene(root, scene, sequences, depth_range=10.0, classes=CLASSES, texts=texts)
    return root / scene
