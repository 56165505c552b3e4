"""A data set of posed frames, or a scene.npz, in; its scene, whose pixels are read when they are needed, and the names out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np

from dlama.arguments import as_array
from dlama.completion.start import clip_frame
from dlama.datasets.easysynth.frames import sequence_folders
from dlama.datasets.frames import Frame
from dlama.datasets.layouts import layout_of, list_dataset, select_cases
from dlama.datasets.posed.lenses import CameraOption
from dlama.datasets.sequences.reading import decide_reading
from dlama.errors import (
    DlamaError,
    FileError,
    InputError,
    MaskError,
    check_same_size,
    first_line,
    format_count,
    system_errors,
    warn,
)
from dlama.files.rasters.turned_pairs import same_proportions
from dlama.files.scenes.scene_npz import read_scene
from dlama.geometry.frames.alignment import NO_FEATURES, Features, detect_features, estimate_poses, with_pose
from dlama.geometry.frames.gathering import gather_views, open_view
from dlama.geometry.frames.stored import Layer, PixelCache, pixel_digest
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene, name_of_number
from dlama.progress import begin_stage
from dlama.writing.atomic_write import PathLike

T = TypeVar("T")


class LoadedScene(NamedTuple):
    """The scene of a data set."""

    names: list[str]
    """Of the frames."""
    scene: Scene
    damaged: dict[str, str]
    """Frames that could not be read, with why."""
    not_chosen: list[str]
    """Frames that were not asked for."""
    decisions: dict[str, dict[str, Any]]
    """For meta.json: whose poses count, and why; of a scene.npz nothing is decided."""

    @property
    def contradicting(self) -> list[str]:
        """Frames that were read and are not in the scene, as they contradict all others."""
        return [name for name in self.names if name not in self.scene.names]


def read_scene_of(
    dataset: PathLike, frames: str | None = None, *, clip: float | None = None, keep_poses: bool = False, **options: Any
) -> LoadedScene:
    """The scene of the frames that `frames` chooses, read with the options of `open_frames`. A scene.npz is one already.

    clip: metres, as of `complete`. keep_poses: else they are made to agree with the pictures, where they do not.
    """
    if Path(dataset).suffix.lower() == ".npz":
        return _read_whole_scene(dataset, frames, options, clip)
    every = open_frames(dataset, **options)
    chosen = slice_frames(every, frames)
    kept = {frame.name for frame in chosen}
    decisions = {"poses": {"name": "given", "reason": "keep_poses"}}
    if not keep_poses:
        chosen, decisions = align_poses(chosen)
    views, damaged = read_views(dataset, chosen, clip)
    names = list(views)
    called = [name if name.startswith("frame") else f"frame {name}" for name in names]
    gathered = gather_views(list(views.values()), called)
    gathered = replace(gathered, names=tuple(names[number] for number in gathered.numbers))
    not_chosen = [frame.name for frame in every if frame.name not in kept]
    read = [frame for frame in chosen if frame.name in views]
    decisions |= decide_reading(read, views[names[0]].camera.hw, options.get("max_depth"))
    return LoadedScene(names, gathered, damaged, not_chosen, decisions)


def _read_whole_scene(
    dataset: PathLike, frames: str | None, options: Mapping[str, object], clip: float | None
) -> LoadedScene:
    """The scene of a scene.npz. InputError for what can be asked for of frames alone."""
    if frames is not None:
        raise InputError(f"`frames` is {frames}, and {dataset} is a scene; its frames cannot be chosen any more")
    for name, value in options.items():
        if value is not None:
            raise InputError(f"`{name}` says how a data set is read, and {dataset} is a scene, which has all of it")
    if clip is not None:
        raise InputError(f"recipe clips depth at {clip:g} m, and {dataset} is a scene; give its frames instead")
    found = read_scene(dataset)
    named = dict(zip(found.numbers, found.names))
    names = [named.get(number, name_of_number(number)) for number in range(max(found.numbers) + 1)]
    return LoadedScene(names, found, {}, [], {})


def align_poses(frames: tuple[Frame, ...]) -> tuple[tuple[Frame, ...], dict[str, dict[str, Any]]]:
    """The frames with poses that agree with their pictures, and what was decided of them; what cannot be read has no features."""

    def features(place: int) -> Features:
        try:
            return detect_features(frames[place].load())
        except DlamaError:
            return NO_FEATURES

    found = estimate_poses(len(frames), features)
    if found.poses is None:
        return frames, found.decision
    aligned = (replace(frame, load=with_pose(frame.load, pose)) for frame, pose in zip(frames, found.poses))
    return tuple(aligned), found.decision


def read_views(
    dataset: PathLike, frames: Sequence[Frame], clip: float | None
) -> tuple[dict[str, Layer], dict[str, str]]:
    """Name -> source view, which is read again when it is needed and no longer in memory; name -> why it cannot be read, which is
    warned of. FileError where none can."""
    views, errors, cache = dict[str, Layer](), dict[str, DlamaError](), PixelCache()
    for number, frame in enumerate(frames):
        begin_stage(f"read frame {number + 1} of {len(frames)}")
        try:
            views[frame.name] = view = open_view(clip_frame(frame.load, clip), frame.name, cache)
            view.find_once(pixel_digest)  # while its pixels are in memory
        except DlamaError as error:
            errors[frame.name] = error
    if not views:
        reason = next(iter(errors.values())).marked
        raise FileError(f"{dataset}: not one of its {len(frames)} frames can be read; the first: {reason}")
    for name, why in errors.items():
        warn(f"frame {name} is left out: {why.marked}")
    return views, {name: first_line(why) for name, why in errors.items()}


def masks_of_frames(masks: Mapping[str, BoolArray], loaded: LoadedScene, frames: str | None) -> dict[int, BoolArray]:
    """Number of a frame -> mask, of frames by name, or by place of those that `frames` chose; no empty masks, unless all are;
    those of larger pictures in the size to which these were shrunk. Masks of frames that are left out are warned of.

    Raises InputError: no mask is left, no such frame, or a place where frames are damaged, which moves the places; MaskError,
    which names the frame: another size.
    """
    given = {name: as_array(mask, "mask", "a bool array H x W") for name, mask in masks.items()}
    given = {name: mask for name, mask in given.items() if mask.any()} or given
    why = loaded.damaged | dict.fromkeys(loaded.contradicting, "it contradicts all others")
    why |= dict.fromkeys(loaded.not_chosen, f"`frames` is {frames}")
    unused = [name for name in given if name in why]
    if unused and len(unused) == len(given):
        raise InputError(f"`mask` is for frame {unused[0]}, which is left out: {why[unused[0]]}")
    if unused:
        listed = ", ".join(unused[:3]) + ", ..." * (len(unused) > 3)
        warn(f"{format_count(len(unused), 'mask')} of frames that are left out: not used ({listed})")
    found: dict[int, BoolArray] = {}
    for name in (each for each in given if each not in why):
        number = _number_of(name, loaded.names, loaded.damaged)
        if number in found:
            raise InputError(f"mask: frame {loaded.names[number]} has two; one mask a frame is expected")
        hw = loaded.scene.frames[loaded.scene.place_of(number)].camera.hw
        found[number] = shrink_mask(given[name], hw)
        check_same_size(f"`mask` of frame {loaded.names[number]}", found[number].shape, "the picture", hw, MaskError)
    return found


def _number_of(name: str, names: Sequence[str], damaged: Mapping[str, str]) -> int:
    """The number of a frame by its name, or by its place."""
    if name in names:
        return list(names).index(name)
    is_place = re.fullmatch(r"\d+", name) is not None
    if is_place and damaged:
        raise InputError(
            f"`mask` is for the frame in place {name}, frames are left out ({', '.join(list(damaged)[:3])}); name the frame"
        )
    if is_place and int(name) < len(names):
        return int(name)
    few = ", ".join(names[:3]) + (f", ... {names[-1]}" if len(names) > 3 else "")
    raise InputError(
        f"`mask` is for frame {name}, which is not there; a name ({few}) or a place, 0 to {len(names) - 1}, is expected"
    )


def shrink_mask(mask: BoolArray, hw: tuple[int, int]) -> BoolArray:
    """A mask of more pixels and the same proportions at the size hw, True where any part of a pixel is; any other as it is."""
    larger = mask.ndim == 2 and mask.dtype == np.bool_ and mask.shape[0] > hw[0]
    if not larger or not same_proportions(mask.shape, hw):
        return mask
    return np.asarray(cv2.resize(mask * np.uint8(255), hw[::-1], interpolation=cv2.INTER_AREA) > 0)


@system_errors(FileError)
def open_frames(
    path: PathLike,
    layout: str | None = None,
    *,
    camera: CameraOption = None,
    scene: str | None = None,
    **reading: Any,
) -> tuple[Frame, ...]:
    """The posed frames of a scene, in their order, not yet read.

    Args:
        path: A folder in any layout of posed frames that `dlama evaluate` reads.
        layout: Its name; recognised by default.
        camera: The camera file of a layout that has none of its own (tum, 7-scenes, redwood).
        scene: Which one, of a folder that holds several.
        reading: depth_range, depth_scale, max_depth, resize_depth, as of `DatasetOptions`.
    Raises:
        InputError: no posed frames, several scenes and none chosen; FileError, CameraError: a file, with line and column.
    """
    root = Path(path)
    name = layout_of(root, layout)
    if name == "easysynth":
        sequences = [folder for _, folders in sequence_folders(root) for folder in folders]
        if len(sequences) > 1:
            names = ", ".join(str(folder.relative_to(root)) for folder in sequences[:6])
            raise InputError(f"{root}: holds {len(sequences)} sequences ({names}); give the folder of one")
    found = list_dataset(root, name, {"camera": camera, "limit": 0, **reading})
    if not found.frames:
        raise InputError(f"{root}: a data set of layout {name} has no posed frames of one scene")
    frames = select_cases(found, None if scene is None else [scene], 0).frames
    scenes = list(dict.fromkeys(frame.scene for frame in frames))
    if len(scenes) > 1:
        raise InputError(f"{root}: holds {len(scenes)} scenes ({', '.join(scenes[:8])}); say which by `scene=NAME`")
    return frames


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
