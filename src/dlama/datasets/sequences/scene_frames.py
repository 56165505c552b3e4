"""The folder of a data set in; the posed frames of one scene in it out, read when they are needed. No pairs are looked for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from dlama.datasets.easysynth.listing import sequence_folders
from dlama.datasets.frames import Frame
from dlama.datasets.layouts import layout_of, list_dataset
from dlama.datasets.posed.posed_frames import CameraOption
from dlama.errors import FileError, InputError, system_errors
from dlama.files.atomic_write import PathLike

T = TypeVar("T")


@system_errors(FileError)
def open_frames(
    path: PathLike,
    layout: str | None = None,
    *,
    camera: CameraOption = None,
    depth_range: float | None = None,
    scene: str | None = None,
) -> tuple[Frame, ...]:
    """The posed frames of a scene, in their order, not yet read.

    Args:
        path: A folder in any layout of posed frames that `dlama evaluate` reads.
        layout: Its name; recognised by default.
        camera: The camera file of a layout that has none of its own (tum, 7-scenes, redwood).
        depth_range: EasySynth: metres that 1.0 stands for in its depth files.
        scene: Which one, of a folder that holds several.
    Raises:
        InputError: no posed frames, several scenes and none chosen; FileError, CameraError: a file, with line and column.
    """
    root = Path(path)
    name = layout_of(root, layout)
    if name == "easysynth":
        _check_one_sequence(root)
    frames = list_dataset(root, name, {"camera": camera, "depth_range": depth_range}, {"limit": 0}).frames
    if not frames:
        raise InputError(f"{root}: a data set of layout {name} has no posed frames of one scene")
    return _of_scene(root, frames, scene)


def _check_one_sequence(root: Path) -> None:
    found = [folder for _, folders in sequence_folders(root) for folder in folders]
    if len(found) > 1:
        names = ", ".join(str(folder.relative_to(root)) for folder in found[:6])
        raise InputError(f"{root}: holds {len(found)} sequences ({names}); give the folder of one")


def _of_scene(root: Path, frames: Sequence[Frame], scene: str | None) -> tuple[Frame, ...]:
    scenes = list(dict.fromkeys(frame.scene for frame in frames))
    if scene is None and len(scenes) > 1:
        raise InputError(f"{root}: holds {len(scenes)} scenes ({', '.join(scenes[:8])}); say which by `scene=NAME`")
    if scene is not None and scene not in scenes:
        raise InputError(f"scene '{scene}' is not in this data set; it has {', '.join(scenes)}")
    return tuple(frame for frame in frames if scene in (None, frame.scene))


def slice_frames(frames: Sequence[T], which: str | None) -> tuple[T, ...]:
    """Those of `first:end:step` (places from 0, the end not among them, as Python's slices; each part may be left out), or all.

    Raises InputError: other words, or nothing left.
    """
    if which is None:
        return tuple(frames)
    if not re.fullmatch(r"-?\d*:-?\d*(:\d+)?", which) or which.endswith(":0"):
        raise InputError(f"`frames` is {which!r}; FIRST:END:STEP is expected, places from 0, such as 0:480:10 or ::5")
    parts = [int(part) if part else None for part in which.split(":")]
    found = tuple(frames[slice(*parts)])
    if not found:
        raise InputError(f"`frames` is {which}, and there are {len(frames)}; nothing is left")
    return found
